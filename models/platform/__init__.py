"""The Platform component."""
