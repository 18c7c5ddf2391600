"""Reports: one HTML file that says what a study found, and `sblcosim paper`."""
