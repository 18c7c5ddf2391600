"""Judging estimates: errors and consistency, with a truth and without."""
