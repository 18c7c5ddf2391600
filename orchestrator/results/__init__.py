"""What a record says: errors, consistency, tables and figures of a run."""
