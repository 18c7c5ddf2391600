"""The command ``sblcosim``."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import signal
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from .errors import ConfigurationError, SblcosimError

if TYPE_CHECKING:
    from collections.abc import Callable

PATIENCE = 2.0
"""Seconds after which a command shows what it is doing."""


class _Group(TyperGroup):
    """Turns our exceptions into a line per problem and an exit code, our warnings into a line."""

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
        except _Terminated:
            typer.echo("terminated; nothing was written", err=True)
            raise typer.Exit(128 + signal.SIGTERM) from None
        except KeyboardInterrupt:
            typer.echo("interrupted; nothing was written", err=True)
            raise typer.Exit(130) from None


class _Terminated(KeyboardInterrupt):
    """Somebody has asked the process to end."""


@contextmanager
def _terminable() -> Iterator[None]:
    """Let SIGTERM end a command as Ctrl-C does: what is half written is removed."""

    def end(number: int, frame: object) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # once is enough
        raise _Terminated

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
    cls=_Group,
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Co-simulation of a short-baseline acoustic positioning system for divers.",
)

_ScenarioArgument = Annotated[
    str, typer.Argument(metavar="SCENARIO", help="TOML file, or a name from 'sblcosim scenarios'.")
]
_ReceiverOption = Annotated[
    list[str] | None,
    typer.Option(
        "--receiver",
        metavar="NAME|FILE.fmu",
        help="Receiver in place of the scenario's; repeat it to compare several on equal noise.",
    ),
]
_SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Change a key, e.g. platform.arm_length_m=0.4."
    ),
]
_FmiOption = Annotated[
    int | None, typer.Option("--fmi", min=2, max=3, help="FMI version of our components.")
]
_SeedOption = Annotated[int | None, typer.Option("--seed", help="Seed of all random numbers.")]


def _print_version(wanted: bool) -> None:
    if wanted:
        from . import __version__

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


@app.command()
def run(
    scenario: _ScenarioArgument,
    receiver: _ReceiverOption = None,
    set_: _SetOption = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Folder for the results [default: runs/NAME]."),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the tables as JSON, and nothing else.")
    ] = False,
    fmi: _FmiOption = None,
    seed: _SeedOption = None,
    master: Annotated[
        str | None,
        typer.Option(
            "--master",
            metavar="native|python|lanes",
            help="What runs it [default: native if it can].",
        ),
    ] = None,
    step_timeout: Annotated[
        float | None,
        typer.Option(
            "--step-timeout", help="Seconds until an FMU that hangs is given up [default: 60]."
        ),
    ] = None,
    no_figures: Annotated[bool, typer.Option("--no-figures", help="Draw no figures.")] = False,
) -> None:
    """Simulate a scenario and write its results.

    Prints the table of errors; the record, a manifest and the figures go to a folder.
    """
    with _waiting() as progress:
        from . import api, artifacts
        from .scenario import load

        settled = load(scenario, _overrides(set_, seed))
        out = out or Path("runs", settled.name)
        artifacts.check(out)
        result = api.run(
            settled,
            receiver or (),
            fmi=fmi,
            master=master,
            step_timeout=step_timeout,
            progress=progress,
        )
        folder = result.save(out, figures=not no_figures)
    _report(result, folder, as_json)


@app.command()
def plan(
    scenario: _ScenarioArgument,
    receiver: _ReceiverOption = None,
    set_: _SetOption = None,
    fmi: _FmiOption = None,
    seed: _SeedOption = None,
) -> None:
    """Print what would run, and how it is connected."""
    with _waiting():
        from .plan import check_size, resolve
        from .scenario import load
        from .wiring import connect

        settled = load(scenario, _overrides(set_, seed))
        resolved = resolve(connect(settled, receiver or (), fmi))
        check_size(resolved)
    typer.echo(str(resolved))


@app.command()
def calibrate(
    sound_speed: Annotated[float, typer.Option(help="True speed of sound in m/s.")] = 1530.0,
    assumed_sound_speed: Annotated[
        float, typer.Option(help="Speed with which ranges are formed, in m/s.")
    ] = 1500.0,
    range_std: Annotated[float, typer.Option(help="Noise of a range in m.")] = 0.1,
    distance: Annotated[float, typer.Option(help="Known distance in m.")] = 10.0,
    distance_std: Annotated[float, typer.Option(help="Its standard uncertainty in m.")] = 0.0,
    clock_offset: Annotated[float, typer.Option(help="Receiver's clock error in s.")] = 0.0,
    pings: Annotated[int, typer.Option(help="Pings per distance.")] = 100,
    seed: Annotated[int, typer.Option(help="Seed of the noise.")] = 1,
    fmi: Annotated[int, typer.Option(min=2, max=3, help="FMI version.")] = 2,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the results.")] = (
        Path("runs", "calibration")
    ),
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, and nothing else.")] = False,
) -> None:
    """Calibrate the speed of sound and test the ranges.

    As in the paper's section 2.3: the speed of sound from a known distance, and ranges at 0 to
    100 m in steps of 5 m against the truth, through the Acoustics FMU.
    """
    with _waiting("calibrating"):
        from . import artifacts
        from .calibrate import calibrate as measure

        artifacts.check(out)
        result = measure(
            sound_speed=sound_speed,
            assumed_sound_speed=assumed_sound_speed,
            range_std=range_std,
            distance=distance,
            distance_std=distance_std,
            clock_offset=clock_offset,
            pings=pings,
            seed=seed,
            fmi=3 if fmi == 3 else 2,
        )
        folder = result.save(out)
    _report(result, folder, as_json)


@app.command()
def study(
    source: Annotated[
        str, typer.Argument(metavar="STUDY", help="TOML file, or a name from 'sblcosim studies'.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Folder for the results; what is there already is not run again "
            "[default: studies/NAME].",
        ),
    ] = None,
    replicates: Annotated[
        int | None, typer.Option("--replicates", min=1, help="In place of the study's.")
    ] = None,
    threads: Annotated[
        int | None, typer.Option("--threads", min=1, help="Threads [default: all cores].")
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say what would run, and how long; write nothing.")
    ] = False,
    master: Annotated[
        str | None,
        typer.Option(
            "--master",
            metavar="native|python|lanes",
            help="What runs it [default: lanes if it can].",
        ),
    ] = None,
) -> None:
    """Run a factorial study, or what is missing of it.

    The folder gets a table with a row per run. After Ctrl-C or a crash the same command goes on.
    """
    with _waiting(remaining=True) as progress:
        from . import campaign
        from . import study as studies

        settled = studies.load(source)
        if replicates is not None:
            settled = settled.with_replicates(replicates)
        out = out or Path("studies", settled.name)
        if not dry_run:
            try:
                runs = settled.run(out, threads=threads, master=master, progress=progress)
            except KeyboardInterrupt as stop:
                _say_how_to_resume(out, settled.replicates * len(settled.plan.points))
                terminated = isinstance(stop, _Terminated)
                raise typer.Exit(128 + signal.SIGTERM if terminated else 130) from None
        else:
            prepared = campaign.prepare(settled, master)
            seconds = campaign.estimate(prepared, threads, master)
    if dry_run:
        typer.echo(
            f"{len(prepared.points)} points x {settled.replicates} replicates = {prepared.runs} "
            f"runs, {prepared.steps} steps; {_duration(seconds)} on this machine; nothing was run"
        )
        return
    typer.echo(_summary(runs))
    typer.echo(f"\nwritten to {out}")


def _say_how_to_resume(out: Path, runs: int) -> None:
    from . import campaign

    done = len(campaign.finished(out))
    command = shlex.join(["sblcosim", *sys.argv[1:]])
    typer.echo(f"interrupted; {done} of {runs} runs are in {out}; go on with: {command}", err=True)


def _duration(seconds: float) -> str:
    if seconds < 90:
        return f"about {max(seconds, 1):.0f} s"
    minutes = seconds / 60
    return f"about {minutes:.0f} min" if minutes < 90 else f"about {minutes / 60:.1f} h"


def _summary(runs: Any) -> str:
    """What came out of a study, for each receiver over all its runs."""
    failed = runs[runs["error"].notna()]
    lines = [f"{len(runs)} runs, {len(failed)} failed"]
    lines += [f"  e.g. {row.run_id}: {row.error}" for row in failed.head(1).itertuples()]
    suffix = ".absolute_total_rms_m"
    for column in runs.columns[runs.columns.str.endswith(suffix)]:
        name = column.removesuffix(suffix)
        lines.append(
            f"{name}: RMS total error {runs[column].mean():.3g} m on average over all runs, "
            f"{runs[f'{name}.inconsistent'].mean():.0%} of them inconsistent, "
            f"{runs[f'{name}.lost'].mean():.0%} lost"
        )
    return "\n".join(lines)


@app.command()
def replay(
    results: Annotated[Path, typer.Argument(metavar="RESULTS", help="Folder of a study.")],
    run_id: Annotated[str, typer.Argument(metavar="RUN_ID", help="From the study's table.")],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="DIR", help="Folder for the results [default: runs/RUN_ID]."
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the tables as JSON, and nothing else.")
    ] = False,
    no_figures: Annotated[bool, typer.Option("--no-figures", help="Draw no figures.")] = False,
) -> None:
    """Do one run of a study again, with a full record."""
    with _waiting() as progress:
        from . import artifacts, campaign

        out = out or Path("runs", re.sub(r"\W", "_", run_id))
        artifacts.check(out)
        result = campaign.replay(results, run_id, progress=progress)
        folder = result.save(out, figures=not no_figures)
    _report(result, folder, as_json)


@app.command()
def analyse(
    results: Annotated[Path, typer.Argument(metavar="RESULTS", help="Folder of a study.")],
    response: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Of the table of runs [default: RMS total error]."),
    ] = None,
    receiver: Annotated[
        str | None, typer.Option(metavar="NAME", help="Whose [default: the first].")
    ] = None,
    order: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Interactions up to it [default: 2].")
    ] = None,
    transform: Annotated[
        str,
        typer.Option(
            metavar="none|log|spread", help="Analyse the mean, its logarithm, or the spread."
        ),
    ] = "none",
    practical: Annotated[
        float | None, typer.Option(metavar="SIZE", help="Effects below it do not matter.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Folder [default: RESULTS-analysis]."),
    ] = None,
) -> None:
    """Say which factor of a study matters: effects, their tests and the paper's four pictures."""
    with _waiting("analysing"):
        from typing import get_args

        from . import analysis, artifacts, factorial

        known = get_args(factorial.Transform)
        if transform not in known:
            raise ConfigurationError(f"transform: must be {', '.join(known)}, got {transform!r}")
        out = out or results.with_name(f"{results.resolve().name}-analysis")
        artifacts.check(out)
        found = analysis.of_study(
            results, response or analysis.RESPONSE, receiver=receiver, order=order,
            transform=transform, practical=practical,  # type: ignore[arg-type]
        )
        folder = analysis.save(found, out)
    typer.echo(found)
    typer.echo(f"\nwritten to {folder}")


@app.command()
def studies() -> None:
    """List the studies that come with the project."""
    from .study import load, shipped

    _table([(name, load(name).title) for name in shipped()])


@app.command()
def scenarios() -> None:
    """List the scenarios that come with the project."""
    from .scenario import load, shipped

    _table([(name, load(name).title) for name in shipped()])


@app.command()
def receivers() -> None:
    """List the receivers that can be chosen by name."""
    from sblcosim.models import RECEIVERS

    _table([(name, component.description) for name, component in RECEIVERS.items()])
    typer.echo("or the path of an .fmu file; 'sblcosim check FILE.fmu' says whether it fits")


@app.command()
def new(
    file: Annotated[Path, typer.Argument(metavar="FILE.toml")],
    source: Annotated[
        str | None,
        typer.Option("--from", metavar="SCENARIO", help="Begin with the keys of this scenario."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
) -> None:
    """Write a scenario file to begin with."""
    from .starter import starter

    if not re.match(r"\w", file.name):
        raise ConfigurationError(
            f"{file}: must have a name that begins with a letter or digit, got {file.name!r}"
        )
    if file.suffix != ".toml":
        file = file.with_name(f"{file.name}.toml")
    text = starter(file.stem, source)
    try:
        with file.open("w" if force else "x", encoding="utf-8") as stream:
            stream.write(text)
    except FileExistsError:
        raise ConfigurationError(
            f"{file}: must not exist yet, got an existing file; --force replaces it"
        ) from None
    except OSError as error:
        raise ConfigurationError(f"{file}: must be writable, got {error.strerror}") from None
    command = shlex.join(["sblcosim", "run", str(file)])
    typer.echo(f"written to {file}; simulate it with: {command}")


@app.command()
def build(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="[NAME]...", help="Components; none: all.")
    ] = None,
    fmi: Annotated[
        int | None, typer.Option("--fmi", min=2, max=3, help="FMI version; none: both.")
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the FMUs.")] = (
        Path("fmus")
    ),
) -> None:
    """Build our components as FMUs.

    They become DIR/fmi2/NAME.fmu and DIR/fmi3/NAME.fmu.
    """
    from sblcosim.fmus.factory import build as build_fmu
    from sblcosim.models import COMPONENTS

    with _waiting("building"):
        built = [
            (build_fmu(name, version), out / f"fmi{version}" / f"{name}.fmu")
            for version in ((2, 3) if fmi is None else (fmi,))
            for name in (names or COMPONENTS)
        ]
        for cached, path in built:
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(cached, path)
            except OSError as error:
                raise ConfigurationError(
                    f"{path}: must be writable, got {error.strerror}"
                ) from None
    for _, path in built:
        typer.echo(str(path))


@app.command()
def check(file: Annotated[Path, typer.Argument(metavar="FILE.fmu", readable=False)]) -> None:
    """Say whether an FMU can be a receiver.

    Lists its variables against the contract and loads it; the exit code is 1 if either fails.
    """
    from sblcosim.fmus.check import check_receiver

    report = check_receiver(file, load=True)
    typer.echo(str(report))
    if not report.ok:
        raise typer.Exit(1)


def _overrides(keys: list[str] | None, seed: int | None) -> list[str]:
    return [*(keys or ()), *(() if seed is None else (f"seed={seed}",))]


def _report(result: Any, folder: Path, as_json: bool) -> None:
    if as_json:
        typer.echo(json.dumps(result.to_json() | {"folder": str(folder)}, indent=2))
    else:
        typer.echo(f"{result}\n\nwritten to {folder}")


def _table(rows: list[tuple[str, str]]) -> None:
    width = max(len(first) for first, _ in rows)
    for first, second in rows:
        typer.echo(f"{first:{width}}  {second}")


@contextmanager
def _waiting(
    what: str = "preparing", *, remaining: bool = False
) -> Iterator[Callable[[float], None]]:
    """Show progress on a terminal's stderr, as soon as it takes longer than two seconds.

    Parameters
    ----------
    remaining
        Show the remaining time, too.
    """
    if not sys.stderr.isatty():
        yield lambda share: None
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
        yield lambda share: display.update(
            task,
            total=1.0,
            completed=share,
            description="simulating" if share < 1.0 else "writing",
        )
    finally:
        timer.cancel()
        timer.join()  # it may be starting the display just now
        display.stop()


def main() -> None:
    """Entry point of the command."""
    app()
