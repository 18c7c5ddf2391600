"""Recorded tracks: read from files, and reduced to as few points as a tolerance allows."""
