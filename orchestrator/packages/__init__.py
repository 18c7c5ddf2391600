"""SSP packages, ours and those of others: what is in them, as systems to run."""
