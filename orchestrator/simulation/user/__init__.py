"""Files of the user: looked at and built by child processes."""
