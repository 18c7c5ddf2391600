"""The sources that an error comes from."""
