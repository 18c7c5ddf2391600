"""Reading FMUs: their archives, their descriptions, what they say they are. Nothing is run."""
