"""What commands print with ``--json``: a class for each document, which is its schema, too."""
