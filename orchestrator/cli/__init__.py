"""The command ``sblcosim``; a module for each group of its commands, in the order of the help."""

# ruff: noqa: F401, I001
import gc
import sys
from io import TextIOWrapper

from . import simulate, studies, components, export
from .base import app


def main() -> None:
    """Entry point of the command."""
    gc.set_threshold(100_000)  # imports and figures make many objects, and little of it is garbage
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # whatever the terminal's encoding
    app()
