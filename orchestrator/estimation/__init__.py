"""Estimates made after a run from what was received in it: smoother and particle filter."""
