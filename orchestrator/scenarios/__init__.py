"""Scenario files that come with the project."""
