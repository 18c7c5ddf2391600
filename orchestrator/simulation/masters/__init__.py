"""The three masters."""
