"""Evaluation of a record: errors, consistency, tables and figures of a run."""
