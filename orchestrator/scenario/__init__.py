"""Scenario files, and the systems built from them."""
