"""Paired runs: what an error comes from, which receiver is better."""
