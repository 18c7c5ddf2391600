"""FMUs from the components' declarations and equations."""
