"""The Acoustics component."""
