"""What all commands share: the application, options, progress."""

from __future__ import annotations

import math
import shutil
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from sblcosim.fmus import stopping

from ...errors import ConfigurationError, resolved, shortened
from . import completion
from .outcome import App, ErrorReportingGroup, say_warnings

if TYPE_CHECKING:
    from ...answer import Answer
    from ...artifacts import Other
    from ..documents.document import Document

PATIENCE = 2.0
"""Seconds after which a command shows what it is doing."""


def numeric(
    name: str,
    kind: type[int] | type[float],
    metavar: str,
    description: str,
    *,
    low: float | None = None,
    high: float | None = None,
) -> Any:
    """An option that takes a number; a wrong one is refused in our wording.

    Parameters
    ----------
    low, high
        Smallest and largest accepted value.
    """
    what = "a whole number" if kind is int else "a finite number"
    if low is not None:
        what += f" from {low} to {high}" if high is not None else f" of at least {low}"

    def parse(text: Any) -> int | float:
        try:
            value = kind(text)
        except (ValueError, OverflowError):
            pass
        else:
            least, most = -math.inf if low is None else low, math.inf if high is None else high
            if least <= value <= most and abs(value) != math.inf:
                return value
        raise ConfigurationError(f"{name}: must be {what}, got {shortened(repr(text))}")

    return typer.Option(name, metavar=metavar, help=description, parser=parse)


app = App(
    cls=ErrorReportingGroup,
    no_args_is_help=True,
    context_settings={"help_option_names": ["--help", "-h"]},
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Co-simulation of a short-baseline acoustic positioning system for divers.",
)


def _scenario(what: str) -> Any:
    return typer.Argument(metavar="SCENARIO", help=what, autocompletion=completion.scenarios)


ScenarioArgument = Annotated[str, _scenario("TOML file, or a name from 'sblcosim scenarios'.")]
RunnableArgument = Annotated[
    str,
    _scenario("TOML file, a name from 'sblcosim scenarios', or an SSP package, FILE.ssp."),
]
ReceiverOption = Annotated[
    list[str] | None,
    typer.Option(
        "--receiver",
        metavar="NAME|FILE.fmu|FILE.py:CLASS",
        help="Receiver instead of the scenario's; repeat it to compare several on equal noise.",
        autocompletion=completion.receivers,
    ),
]
OneReceiverOption = Annotated[
    list[str] | None,  # of one given twice, only the last would silently be used
    typer.Option(
        "--receiver",
        metavar="NAME|FILE.fmu|FILE.py:CLASS",
        help="Receiver instead of the scenario's.",
        autocompletion=completion.receivers,
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change a key, e.g. platform.arm_length_m=0.4.",
        autocompletion=completion.keys,
    ),
]
FmiOption = Annotated[
    int | None, numeric("--fmi", int, "2|3", "FMI version of our components.", low=2, high=3)
]
SvgOption = Annotated[
    Path | None,
    typer.Option("--svg", metavar="FILE", help="Draw the system of an SSP package as SVG."),
]
MappingOption = Annotated[
    Path | None,
    typer.Option(
        "--mapping",
        metavar="FILE.toml",
        help="What the log says about itself, and which column is what, as in [mapping.receptions] "
        "range_m = 'Dist' (docs/reference/logs.md) [default: meta.toml beside the log, if there is "
        "one].",
    ),
]
StepTimeoutOption = Annotated[
    float | None,
    numeric(
        "--step-timeout",
        float,
        "SECONDS",
        "Time limit in s for a call of an FMU of others or of a Python file [default: 60].",
    ),
]


def folder_option(default: str, what: str = "Folder for the results", holds: str = "one") -> Any:
    """The option ``--out`` of a command whose default folder is numbered.

    Parameters
    ----------
    default
        The folder, in words.
    what, holds
        What the folder is for, and what may be in it already.
    """
    help_ = f"{what} [default: {default}, or the next number if that holds another {holds}]."
    return typer.Option("--out", metavar="DIR", help=help_)


ForceOption = Annotated[
    bool, typer.Option("--force", help="Replace the result of another run in the folder.")
]
JsonOption = Annotated[
    bool,
    typer.Option(
        "--json", help="Print JSON and nothing else; its schema: sblcosim schema COMMAND.json."
    ),
]
VerboseOption = Annotated[
    bool, typer.Option("--verbose", help="Print more numbers, and how to read them.")
]
TrajectoriesOption = Annotated[
    list[str] | None,
    typer.Option(
        "--trajectories",
        metavar="tum|mcap",
        help="Add the paths as files for evo (tum), or for Foxglove and ROS 2 (mcap); repeat it "
        "for both.",
        autocompletion=completion.words("tum", "mcap"),
    ),
]
NoFiguresOption = Annotated[bool, typer.Option("--no-figures", help="Draw no figures.")]
ReplayOption = Annotated[
    bool, typer.Option("--replay", help="Add a page that plays it back, replay.html.")
]
SeedOption = Annotated[int | None, numeric("--seed", int, "N", "Seed of all random numbers.")]


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"sblcosim {version('sblcosim')}")
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


def one_receiver(given: list[str] | None) -> str | None:
    """The receiver of a command that takes only one; None: the scenario's."""
    if given and len(given) > 1:
        raise ConfigurationError(
            f"--receiver: must be given once, got {shortened(' and '.join(given))}; "
            "'sblcosim compare' takes several"
        )
    return given[0] if given else None


def overrides(keys: list[str] | None, seed: int | None) -> list[str]:
    return [*(keys or ()), *(() if seed is None else (f"seed={seed}",))]


def destination(out: Path | None, default: Path, force: bool) -> tuple[Path, Other]:
    """The folder of the results, and what to do about results of another run."""
    return out or default, "replace" if force else "number" if out is None else "refuse"


def apart(out: Path | None, *read: str | Path | None) -> None:
    """Refuse a folder for results that would take the place of what the command reads.

    Raises
    ------
    ConfigurationError
        One of the files or folders is the folder, or is in it.
    """
    if out is None:
        return
    for path in (Path(path) for path in read if path is not None):
        if path.exists() and resolved(path).is_relative_to(resolved(out)):
            got = "which is read" if resolved(path) == resolved(out) else f"which holds {path}"
            raise ConfigurationError(
                f"--out: must be another folder than what is read, got {out}, {got}"
            )


def unless_other(wanted: Path, other: Other) -> Callable[[Mapping[str, Any]], None]:
    """Refuses the result of another run in a folder, as soon as the question is known."""
    from ... import artifacts

    return lambda known: artifacts.check(wanted, known, other, part=True)


def width() -> int | None:
    """Columns of the terminal; None in a pipe or a file, where nothing is wrapped."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else None


def say(text: str, *, err: bool = False) -> None:
    """Print a text that fits the terminal."""
    from ...layout import fitted

    typer.echo(fitted(text, width()), err=err)


def ask(what: str) -> str:
    """What is typed on a terminal, without spaces around it; empty if it is nothing.

    Raises
    ------
    KeyboardInterrupt
        There is no answer, but the end of the input or an interruption.
    """
    try:
        with stopping.prompting():
            return str(typer.prompt(what, default="", show_default=False, err=True)).strip()
    except typer.Abort:
        typer.echo(err=True)
        raise KeyboardInterrupt from None
    except UnicodeDecodeError:
        say("the answer must be UTF-8", err=True)
        return ask(what)


def show(document: Document) -> None:
    """Print JSON."""
    typer.echo(document.text())


def where(folder: Path, wanted: Path) -> str:
    """The line that says where the results are."""
    other = "" if folder == wanted else f"; {wanted} holds something else"
    return f"written to {folder}{other}"


def report(
    answer: Answer, folder: Path, wanted: Path, as_json: bool, verbose: bool = False, **shown: Any
) -> None:
    """Print an answer that has been written to a folder; `shown` is for its text."""
    if as_json:
        from ..documents.by_command import document

        show(document(answer, folder))
    else:
        page = f"; the report is {folder / answer.report}" if answer.report else ""
        typer.echo(answer.text(verbose=verbose, width=width(), **shown))
        say(f"\n{where(folder, wanted)}{page}")


def refuse_silence(answer: Answer) -> None:
    """End with exit code 1 if a receiver gave no estimate at all.

    On a terminal, which shows the output too, the reasons are not repeated.
    """
    both = sys.stdout.isatty() and sys.stderr.isatty()
    for line in answer.problems[:0] if both else answer.problems:
        typer.echo(f"error: {line}", err=True)
    if both and answer.problems:
        typer.echo("error: not every receiver gave estimates; the reasons are above", err=True)
    if answer.problems:
        raise typer.Exit(1)


def beside(results: Path, what: str) -> Path:
    """Default folder for what is computed from a folder of results, even if that is ``.``."""
    whole = resolved(results)
    near = whole if results.name in {"", ".."} else results
    return near.parent / f"{whole.name}-{what}"


def table(rows: list[tuple[str, str]]) -> None:
    from ...layout import table as laid_out

    typer.echo("\n".join(laid_out(rows, width())))


@contextmanager
def waiting(
    what: str = "preparing", *, remaining: bool = False
) -> Iterator[Callable[..., None]]:
    """Show progress on a terminal's stderr, as soon as it takes longer than two seconds.

    Parameters
    ----------
    remaining
        Also show the remaining time.

    Yields
    ------
    function
        Takes the completed share, and optionally a word for the current activity.
    """
    if not sys.stderr.isatty():
        yield lambda share, doing="": say_warnings()
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
        TaskProgressColumn("[progress.percentage]{task.percentage:>3.0f} %"),
        *((TimeRemainingColumn(),) if remaining else ()),
        console=Console(stderr=True),
        transient=True,
    )
    task = display.add_task(what, total=None)
    timer = threading.Timer(PATIENCE, display.start)
    timer.daemon = True
    timer.start()

    def show(share: float, doing: str = "") -> None:
        say_warnings()
        display.update(
            task,
            total=1.0,
            completed=share,
            description=doing or ("simulating" if share < 1.0 else "writing"),
        )

    try:
        yield show
    finally:
        timer.cancel()
        timer.join()  # it may be starting the display just now
        display.stop()
