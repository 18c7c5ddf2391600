"""Commands for scenarios: simulate, smooth, look, begin a new one, calibrate."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Annotated

import typer

from ..errors import ConfigurationError
from .base import (
    FmiOption,
    ForceOption,
    NoFiguresOption,
    ReceiverOption,
    ScenarioArgument,
    SeedOption,
    SetOption,
    StepTimeoutOption,
    TablesOption,
    app,
    beside,
    destination,
    numeric,
    overrides,
    report,
    report_run,
    table,
    waiting,
)


@app.command()
def run(
    scenario: ScenarioArgument,
    receiver: ReceiverOption = None,
    set_: SetOption = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Folder for the results [default: runs/NAME, or the next number if that holds "
            "another run].",
        ),
    ] = None,
    force: ForceOption = False,
    as_json: TablesOption = False,
    fmi: FmiOption = None,
    seed: SeedOption = None,
    master: Annotated[
        str | None,
        typer.Option(
            "--master",
            metavar="native|python|lanes",
            help="What runs it [default: native if it can].",
        ),
    ] = None,
    step_timeout: StepTimeoutOption = None,
    no_figures: NoFiguresOption = False,
) -> None:
    """Simulate a scenario and write its results.

    Prints the table of errors; the record, a manifest and the figures go to a folder. The exit
    code is 1 if a receiver has given no estimate at all.
    """
    with waiting() as progress:
        from .. import api, artifacts
        from ..scenario.scenario import load

        settled = load(scenario, overrides(set_, seed))
        wanted, other = destination(out, Path("runs", settled.name), force)
        artifacts.check(wanted, other=other)
        result = api.run(
            settled,
            receiver or (),
            fmi=fmi,
            master=master,
            step_timeout=step_timeout,
            progress=progress,
            before=lambda manifest: artifacts.check(wanted, manifest, other),
        )
        folder = result.save(wanted, figures=not no_figures, other=other)
    report_run(result, folder, as_json, wanted)


@app.command()
def smooth(
    folder: Annotated[
        Path, typer.Argument(metavar="RUN", help="Folder that 'sblcosim run' has written.")
    ],
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Change what is assumed, e.g. receiver.acceleration_psd_m2_s3=0.003.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="DIR", help="Folder for the results [default: RUN-smoothed]."
        ),
    ] = None,
    force: ForceOption = False,
    as_json: TablesOption = False,
    no_figures: NoFiguresOption = False,
) -> None:
    """Estimate the track of a finished run from all that was received in it.

    The most probable track, forwards and backwards in time, with the model of the receiver
    'coupled'; tables and figures have it beside the receivers of the run.
    """
    with waiting("smoothing"):
        from .. import artifacts
        from ..estimation.after import smooth as smooth_run

        wanted, other = destination(out, beside(folder, "smoothed"), force)
        artifacts.check(wanted, other=other)
        smoothed = smooth_run(folder, set_ or ())
        written = smoothed.save(wanted, figures=not no_figures, other=other)
    report(smoothed, written, as_json, wanted)


@app.command()
def plan(
    scenario: ScenarioArgument,
    receiver: ReceiverOption = None,
    set_: SetOption = None,
    fmi: FmiOption = None,
    seed: SeedOption = None,
) -> None:
    """Print what would run, and how it is connected."""
    with waiting():
        from ..scenario.scenario import load
        from ..scenario.wiring import connect
        from ..simulation.plan_checks import check_size
        from ..simulation.resolve import resolve

        settled = load(scenario, overrides(set_, seed))
        resolved = resolve(connect(settled, receiver or (), fmi))
        check_size(resolved)
    typer.echo(str(resolved))


@app.command()
def calibrate(
    sound_speed: Annotated[
        float, numeric("--sound-speed", float, "M_S", "True speed of sound in m/s.")
    ] = 1530.0,
    assumed_sound_speed: Annotated[
        float,
        numeric("--assumed-sound-speed", float, "M_S", "With which ranges are formed, in m/s."),
    ] = 1500.0,
    range_std: Annotated[float, numeric("--range-std", float, "M", "Noise of a range in m.")] = 0.1,
    distance: Annotated[float, numeric("--distance", float, "M", "Known distance in m.")] = 10.0,
    distance_std: Annotated[
        float, numeric("--distance-std", float, "M", "Its standard uncertainty in m.")
    ] = 0.0,
    clock_offset: Annotated[
        float, numeric("--clock-offset", float, "S", "Receiver's clock error in s.")
    ] = 0.0,
    pings: Annotated[int, numeric("--pings", int, "N", "Pings per distance.")] = 100,
    seed: Annotated[int, numeric("--seed", int, "N", "Seed of the noise.")] = 1,
    fmi: Annotated[int, numeric("--fmi", int, "2|3", "FMI version.", low=2, high=3)] = 2,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="DIR", help="Folder for the results [default: runs/calibration]."
        ),
    ] = None,
    force: ForceOption = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, and nothing else.")] = False,
) -> None:
    """Calibrate the speed of sound and test the ranges.

    As in the paper's section 2.3: the speed of sound from a known distance, and ranges at 0 to
    100 m in steps of 5 m against the truth, through the Acoustics FMU.
    """
    with waiting("calibrating"):
        from .. import artifacts
        from ..calibrate import calibrate as measure

        wanted, other = destination(out, Path("runs", "calibration"), force)
        artifacts.check(wanted, other=other)
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
        folder = result.save(wanted, other=other)
    report(result, folder, as_json, wanted)


@app.command()
def scenarios() -> None:
    """List the scenarios that come with the project."""
    from .. import listings

    table([*listings.scenarios().items()])


@app.command()
def receivers() -> None:
    """List the receivers that can be chosen by name."""
    from .. import listings

    table([*listings.receivers().items()])
    typer.echo("or the path of an .fmu file; 'sblcosim check FILE.fmu' says whether it fits")
    typer.echo("or FILE.py:CLASS, a class made from sblcosim.Receiver")


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
    from sblcosim.fmus.files import write_file

    from ..scenario.starter import starter

    if not re.match(r"\w", file.name):
        raise ConfigurationError(
            f"{file}: must have a name that begins with a letter or digit, got {file.name!r}"
        )
    if file.suffix != ".toml":
        file = file.with_name(f"{file.name}.toml")
    text = starter(file.stem, source)
    if not file.parent.is_dir():
        raise ConfigurationError(f"{file}: must be in a folder that exists, got {file.parent}")
    try:
        write_file(file, text.encode(), replace=force)
    except FileExistsError:
        raise ConfigurationError(
            f"{file}: must not exist yet, got an existing file; --force replaces it"
        ) from None
    except OSError as error:
        raise ConfigurationError(f"{file}: must be writable, got {error.strerror}") from None
    command = shlex.join(["sblcosim", "run", str(file)])
    typer.echo(f"written to {file}; simulate it with: {command}")
