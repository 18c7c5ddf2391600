"""FMUs as used by a program: their functions and instances."""
