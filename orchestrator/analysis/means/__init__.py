"""One factor at a time: means at each level."""
