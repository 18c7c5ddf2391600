"""Paired runs: what an error comes from, and which receiver is better."""
