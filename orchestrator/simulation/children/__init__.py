"""Child processes: assignment of tasks, messages and answers."""
