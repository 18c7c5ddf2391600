"""Estimates made after a run from the data received in it: smoother and particle filter."""
