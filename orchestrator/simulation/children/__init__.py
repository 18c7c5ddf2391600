"""Child processes: which does a task, what it is told, and what it answers."""
