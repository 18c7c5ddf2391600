"""The user's Python code: run from its file, known by a hash, sent to other processes by value."""
