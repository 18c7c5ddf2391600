"""Scenarios for other tools."""
