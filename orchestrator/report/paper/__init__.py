"""The report on the paper's study."""
