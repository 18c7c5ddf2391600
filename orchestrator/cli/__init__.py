"""The command ``sblcosim``; a module for each group of its commands, in the order of the help."""

# ruff: noqa: F401, I001
from . import simulate, studies, components, export
from .base import app


def main() -> None:
    """Entry point of the command."""
    app()
