"""Paths of a diver, true and estimated, as files of other programs: maps and trajectories."""
