"""Many runs of a scenario."""
