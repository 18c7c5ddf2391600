"""Output of commands with ``--json``: a class for each document, which is also its schema."""
