"""Sources of the FMUs in C."""
