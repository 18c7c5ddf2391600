"""Files of the user: inspected and built by child processes."""
