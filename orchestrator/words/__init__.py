"""Formatting of numbers, shares and lists for people, the same everywhere."""
