"""The range model component."""
