"""Co-simulation of a short-baseline acoustic positioning system for divers."""
