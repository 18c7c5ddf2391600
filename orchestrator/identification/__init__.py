"""What a log tells about the device that wrote it, and the scenario that simulates the device."""
