"""Reading FMUs: their archives, descriptions and interfaces. Nothing is run."""
