"""The user's Python code: run from its file, identified by a hash, sent by value."""
