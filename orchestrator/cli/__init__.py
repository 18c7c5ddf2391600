"""The command ``sblcosim``; a module for each group of its commands, in the order of the help."""

# ruff: noqa: F401, I001
import gc
import sys
from io import TextIOWrapper

from .commands import (
    simulate,
    exploring,
    new,
    tournament,
    areas,
    studies,
    requirements,
    budgets,
    logs,
    processing,
    components,
    export,
    firmware,
)
from .commands import schemas
from .common.app import app


def main() -> None:
    """Entry point of the command."""
    gc.set_threshold(100_000)  # what a command loads is not garbage, but would be scanned often
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # whatever the terminal's encoding
    app()
