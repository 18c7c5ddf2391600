"""Scenario files, and the systems that are made of them."""
