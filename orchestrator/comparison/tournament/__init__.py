"""Receivers side by side on the same noise: which is better."""
