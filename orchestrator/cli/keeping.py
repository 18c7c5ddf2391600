"""What a command has done of its runs is kept until it goes on, or its result is written."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import typer

from ..errors import SblcosimError
from .outcome import stopped

if TYPE_CHECKING:
    from ..study.kept import Kept


@contextmanager
def keeping(result: Path) -> Iterator[Kept]:
    """Keep finished runs beside the folder of a result until the end of the block."""
    from ..study.kept import Kept

    kept = Kept(result)
    try:
        yield kept
    except KeyboardInterrupt as stop:
        runs = kept.runs
        if not runs:
            kept.remove()
        end_of(stop, f"{runs}", kept.folder)
    except SblcosimError as error:
        if runs := kept.runs:
            error.args = (f"{error}; {runs} finished runs are kept in {kept.folder}",)
        else:
            kept.remove()
        raise
    kept.remove()


def end_of(stop: KeyboardInterrupt, runs: str, folder: Path) -> NoReturn:
    """End a command that was stopped.

    It says which runs are in a folder and how to go on; without the folder, nothing was written.
    """
    if not folder.exists():
        raise stop
    command = shlex.join(["sblcosim", *sys.argv[1:]])
    typer.echo(f"interrupted; {runs} runs are in {folder}; go on with: {command}", err=True)
    raise typer.Exit(stopped(stop)) from None
