"""The parts that all analyses share: usable runs, and the terms of a model."""
