"""Receivers compared on the same noise: which is better."""
