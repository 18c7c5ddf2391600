"""Systems that are resolved and checked, ready for any master."""
