"""The Target component."""
