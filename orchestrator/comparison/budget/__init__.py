"""What an error comes from."""
