"""Factors with any number of levels."""
