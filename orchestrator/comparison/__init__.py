"""Paired runs: which sources an error comes from, and which receiver is better."""
