"""What all commands share: the application, its options, completion, and how a command ends."""
