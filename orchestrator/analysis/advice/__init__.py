"""The cheapest design of a study that is good enough."""
