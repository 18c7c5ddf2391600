"""Logs: recorded receptions, depths, fixes and truth, and how they are read and written."""
