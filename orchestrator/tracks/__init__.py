"""Recorded tracks: read from files, and made of as few points as a tolerance needs."""
