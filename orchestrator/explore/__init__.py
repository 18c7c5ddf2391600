"""One offline page in which the real components simulate: what it holds, and its script."""
