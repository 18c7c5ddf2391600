"""Resolved and checked systems, ready for any master."""
