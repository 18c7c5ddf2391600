"""The three masters, and the replay of recorded inputs."""
