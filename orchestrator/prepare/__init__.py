"""Preparation: decides once what will run, from a scenario with choices or from a package."""
