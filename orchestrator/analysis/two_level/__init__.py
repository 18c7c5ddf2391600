"""Two-level factorial designs."""
