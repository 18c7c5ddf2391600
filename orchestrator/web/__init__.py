"""Pages that play a run back in a browser."""
