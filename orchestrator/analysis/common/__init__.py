"""What all analyses share: the runs that they can use, and the terms of a model."""
