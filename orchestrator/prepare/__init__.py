"""What will run, decided once: from a scenario and what was chosen, or from a package."""
