"""What all commands share: the application, options, errors as lines, progress."""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer
from typer.core import TyperGroup

from ..errors import SblcosimError

if TYPE_CHECKING:
    from ..artifacts import Other

PATIENCE = 2.0
"""Seconds after which a command shows what it is doing."""


class Group(TyperGroup):
    """Turns our exceptions into a line per problem and an exit code, our warnings into a line."""

    def main(self, *args: Any, **kwargs: Any) -> Any:
        try:
            os.getcwd()
        except OSError:
            _refuse("the working directory must exist, got one that was deleted")
        try:
            return super().main(*args, **kwargs)
        except OSError as error:
            if error.filename is not None:
                _refuse(f"{error.filename}: must be accessible, got {error.strerror}")
            _forget(sys.stdout)
            _refuse(f"output: must be writable, got {error.strerror or error}")

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        for argument in args:
            if not argument.isprintable() and any("\ud800" <= c <= "\udfff" for c in argument):
                _refuse(f"arguments: must be UTF-8, got {os.fsencode(argument)!r:.80}")
        return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        try:
            with warnings.catch_warnings(), _terminable():
                warnings.showwarning = _show_warning
                return super().invoke(ctx)
        except SblcosimError as error:
            for line in str(error).splitlines():
                typer.echo(f"error: {line}", err=True)
            raise typer.Exit(2) from None
        except MemoryError:
            typer.echo(
                "error: the memory of this machine must be enough, got too large a run; make it "
                "shorter or the sampling time longer",
                err=True,
            )
            raise typer.Exit(2) from None
        except Terminated:
            typer.echo("terminated; nothing was written", err=True)
            raise typer.Exit(128 + signal.SIGTERM) from None
        except KeyboardInterrupt:
            typer.echo("interrupted; nothing was written", err=True)
            raise typer.Exit(130) from None


def _refuse(message: str) -> NoReturn:
    typer.echo(f"error: {message}", err=True)
    sys.exit(2)


def _forget(stream: Any) -> None:
    """Let what waits to be written go nowhere: at the end it would fail again."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


class Terminated(KeyboardInterrupt):
    """Somebody has asked the process to end."""


@contextmanager
def _terminable() -> Iterator[None]:
    """Let SIGTERM end a command as Ctrl-C does: what is half written is removed."""

    def end(number: int, frame: object) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # once is enough
        raise Terminated

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _show_warning(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    typer.echo(f"warning: {message}", err=True)


app = typer.Typer(
    cls=Group,
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Co-simulation of a short-baseline acoustic positioning system for divers.",
)

ScenarioArgument = Annotated[
    str, typer.Argument(metavar="SCENARIO", help="TOML file, or a name from 'sblcosim scenarios'.")
]
ReceiverOption = Annotated[
    list[str] | None,
    typer.Option(
        "--receiver",
        metavar="NAME|FILE.fmu",
        help="Receiver in place of the scenario's; repeat it to compare several on equal noise.",
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Change a key, e.g. platform.arm_length_m=0.4."
    ),
]
FmiOption = Annotated[
    int | None, typer.Option("--fmi", min=2, max=3, help="FMI version of our components.")
]
ForceOption = Annotated[
    bool, typer.Option("--force", help="Replace the result of another run in the folder.")
]
SeedOption = Annotated[int | None, typer.Option("--seed", help="Seed of all random numbers.")]


def _print_version(wanted: bool) -> None:
    if wanted:
        from .. import __version__

        typer.echo(f"sblcosim {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version and exit."
        ),
    ] = False,
) -> None:
    pass


def overrides(keys: list[str] | None, seed: int | None) -> list[str]:
    return [*(keys or ()), *(() if seed is None else (f"seed={seed}",))]


def place(out: Path | None, default: Path, force: bool) -> tuple[Path, Other]:
    """Where results go, and what is done about those of another run."""
    return out or default, "replace" if force else "number" if out is None else "refuse"


def report(result: Any, folder: Path, as_json: bool, wanted: Path) -> None:
    if as_json:
        typer.echo(json.dumps(result.to_json() | {"folder": str(folder)}, indent=2))
    else:
        other = "" if folder == wanted else f"; {wanted} holds something else"
        typer.echo(f"{result}\n\nwritten to {folder}{other}")


def report_run(result: Any, folder: Path, as_json: bool, wanted: Path) -> None:
    """As `report`; the exit code is 1 if a receiver has given no estimate at all."""
    report(result, folder, as_json, wanted)
    for line in result.problems:
        typer.echo(f"error: {line}", err=True)
    if result.problems:
        raise typer.Exit(1)


def table(rows: list[tuple[str, str]]) -> None:
    width = max(len(first) for first, _ in rows)
    for first, second in rows:
        typer.echo(f"{first:{width}}  {second}")


@contextmanager
def waiting(
    what: str = "preparing", *, remaining: bool = False
) -> Iterator[Callable[..., None]]:
    """Show progress on a terminal's stderr, as soon as it takes longer than two seconds.

    Parameters
    ----------
    remaining
        Show the remaining time, too.

    Yields
    ------
    function
        Takes the share that is done, and perhaps a word for what is being done.
    """
    if not sys.stderr.isatty():
        yield lambda share, doing="": None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    display = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        *((TimeRemainingColumn(),) if remaining else ()),
        console=Console(stderr=True),
        transient=True,
    )
    task = display.add_task(what, total=None)
    timer = threading.Timer(PATIENCE, display.start)
    timer.daemon = True
    timer.start()
    try:
        yield lambda share, doing="": display.update(
            task,
            total=1.0,
            completed=share,
            description=doing or ("simulating" if share < 1.0 else "writing"),
        )
    finally:
        timer.cancel()
        timer.join()  # it may be starting the display just now
        display.stop()
