"""Labels with a meaning; apart from all that takes long to import, for figures need them."""

RAW = "raw"
"""Label of the raw fix that runs beside the receivers for comparison."""
