"""Sobol' indices of a space."""
