"""What all comparisons share: statistics of paired runs."""
