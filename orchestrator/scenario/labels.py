"""Labels with a meaning; separate from slow imports, because figures need them."""

RAW = "raw"
"""Label of the raw fix, which every run includes for comparison."""
FIXES = (RAW, "multilateration")
"""Receivers without dynamics: their estimates are drawn as separate dots."""
