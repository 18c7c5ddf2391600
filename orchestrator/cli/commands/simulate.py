"""Commands for scenarios: simulate, smooth, inspect, calibrate."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Annotated, Any

import typer

from ...errors import ConfigurationError, shortened
from ..common import completion
from ..common.app import (
    FmiOption,
    ForceOption,
    JsonOption,
    NoFiguresOption,
    ReceiverOption,
    ReplayOption,
    RunnableArgument,
    SeedOption,
    SetOption,
    StepTimeoutOption,
    SvgOption,
    TrajectoriesOption,
    VerboseOption,
    apart,
    app,
    beside,
    destination,
    folder_option,
    numeric,
    overrides,
    refuse_silence,
    report,
    say,
    show,
    table,
    unless_other,
    waiting,
    width,
)
from ..common.keeping import keeping


@app.command()
def run(
    scenario: RunnableArgument,
    receiver: ReceiverOption = None,
    set_: SetOption = None,
    out: Annotated[Path | None, folder_option("runs/NAME", holds="run")] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
    verbose: VerboseOption = False,
    fmi: FmiOption = None,
    seed: SeedOption = None,
    master: Annotated[
        str | None,
        typer.Option(
            "--master",
            metavar="native|python|lanes",
            help="Master [default: native if possible].",
            autocompletion=completion.words("native", "python", "lanes"),
        ),
    ] = None,
    step_timeout: StepTimeoutOption = None,
    no_figures: NoFiguresOption = False,
    animate: Annotated[
        bool, typer.Option("--animate", help="Add an animation of the run, MP4 or GIF.")
    ] = False,
    replay: ReplayOption = False,
    log: Annotated[
        bool,
        typer.Option(
            "--log", help="Add a log of the dive, for 'sblcosim process', in the subfolder log."
        ),
    ] = False,
    trajectories: TrajectoriesOption = None,
    runs: Annotated[
        int | None,
        numeric("--runs", int, "N", "Number of runs, with consecutive seeds.", low=2),
    ] = None,
) -> None:
    """Simulate a scenario, or an SSP package, and write its results.

    Prints a verdict for each receiver and the table of errors. A folder gets the record, a manifest
    and the figures. The exit code is 1 if a receiver gave no estimate at all.

    An SSP package, FILE.ssp, decides everything itself. Its communication intervals are those
    written by 'sblcosim export ssp', or the step given for OMSimulator or the Open Simulation
    Platform, or the default step sizes of its FMUs, or a thousandth of the run. Without receivers,
    the folder has the record and the manifest.

    With --runs N, prints the errors of each receiver over N runs, with mean and spread. The folder
    has their tables, and subfolders with a typical and the worst run, each with --replay a page.
    After Ctrl-C or a crash, the same command continues, also with more runs.
    """
    from ...results.figures.artist import forked_artist

    if runs is not None:
        for option, given in (
            ("--animate", animate), ("--log", log), ("--trajectories", trajectories),
        ):  # fmt: skip
            if given:
                raise ConfigurationError(f"{option}: must be given without --runs")
        settled, name = _settled(scenario, receiver, set_, fmi, seed)
        wanted, other = destination(out, Path("runs", f"{name}-{runs}-runs"), force)
        with waiting() as progress, redirect_stdout(sys.stderr):
            from ... import artifacts
            from ...comparison.many.run import run_many

            artifacts.check(wanted, other=other)
            with keeping(out or Path("runs", f"{name}-runs")) as keep:
                many = run_many(
                    settled, receiver or (), () if fmi is None else (f"fmi={fmi}",), runs=runs,
                    master=master, step_timeout=step_timeout, progress=progress, keep=keep,
                    before=unless_other(wanted, other),
                )  # fmt: skip
                folder = many.save(
                    wanted, figures=not no_figures, other=other, replay=replay
                )
        report(many, folder, wanted, as_json, verbose)
        refuse_silence(many)
        return
    # Output of the user's code is not part of the result.
    with (
        forked_artist(not no_figures) as artist,
        waiting() as progress,
        redirect_stdout(sys.stderr),
    ):
        from ... import api, artifacts
        from ...paths.folder import check

        check(trajectories or ())
        settled, name = _settled(scenario, receiver, set_, fmi, seed)
        if log and not hasattr(settled, "dump_toml"):
            raise ConfigurationError("--log: must come with a scenario, got an SSP package")
        wanted, other = destination(out, Path("runs", name), force)
        artifacts.check(wanted, other=other)
        result = api.run(
            settled,
            receiver or (),
            fmi=fmi,
            master=master,
            step_timeout=step_timeout,
            progress=progress,
            before=unless_other(wanted, other),
        )
        folder = result.save(
            wanted, figures=not no_figures, other=other, artist=artist, animate=animate,
            replay=replay, log=log, trajectories=trajectories or (),
        )  # fmt: skip
    report(result, folder, wanted, as_json, verbose)
    refuse_silence(result)


def _settled(
    scenario: str,
    receiver: list[str] | None,
    set_: list[str] | None,
    fmi: int | None,
    seed: int | None,
) -> tuple[Any, str]:
    """The scenario, or the path of a package, and its name."""
    from ...packages import is_package
    from ...scenario.scenario import load

    if not is_package(scenario):
        settled = load(scenario, overrides(set_, seed))
        return settled, settled.name
    for name, value in (
        ("--receiver", receiver), ("--set", set_), ("--fmi", fmi), ("--seed", seed),
    ):  # fmt: skip
        if value is not None and value != []:
            got = shortened(str(value[0] if isinstance(value, list) else value))
            raise ConfigurationError(
                f"{name}: must be left out for an SSP package, which holds all that runs, got {got}"
            )
    return scenario, Path(scenario).stem


@app.command()
def smooth(
    folder: Annotated[
        Path, typer.Argument(metavar="RUN", help="Folder of a run, from 'sblcosim run'.")
    ],
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Change an assumption, e.g. receiver.acceleration_psd_m2_s3=0.003.",
            autocompletion=completion.keys,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="DIR", help="Folder for the results [default: RUN-smoothed]."
        ),
    ] = None,
    range_offset_std: Annotated[
        float, numeric(
            "--range-offset-std", float, "M", "Standard deviation in m of an offset of each "
            "beacon's ranges, for beacons on the bottom and buoys.", low=0.0,
        ),
    ] = 0.0,
    range_scale_std: Annotated[
        float, numeric(
            "--range-scale-std", float, "SHARE", "Standard deviation of a scale of all ranges, "
            "e.g. 0.01, for the same.", low=0.0,
        ),
    ] = 0.0,
    force: ForceOption = False,
    as_json: JsonOption = False,
    verbose: VerboseOption = False,
    no_figures: NoFiguresOption = False,
    trajectories: TrajectoriesOption = None,
) -> None:
    """Estimate the track of a finished run from everything that was received in it.

    This is the most probable track, forwards and backwards in time, with the model of the receiver
    'coupled', or of 'long_baseline' for beacons on the bottom and buoys. Tables and figures show it
    beside the receivers of the run. In place of a track that is not believable, they show the
    filter's estimates, and a remark says so.
    """
    from ...results.figures.artist import forked_artist

    with forked_artist(not no_figures) as artist, waiting("smoothing"):
        from ... import artifacts
        from ...estimation.after import smooth as smooth_run
        from ...paths.folder import check

        check(trajectories or ())
        apart(out, folder)
        wanted, other = destination(out, beside(folder, "smoothed"), force)
        artifacts.check(wanted, other=other)
        smoothed = smooth_run(
            folder, set_ or (), range_offset_std_m=range_offset_std,
            range_scale_std=range_scale_std, before=unless_other(wanted, other),
        )
        written = smoothed.save(
            wanted, figures=not no_figures, other=other, artist=artist,
            trajectories=trajectories or (),
        )  # fmt: skip
    report(smoothed, written, wanted, as_json, verbose)


@app.command()
def plan(
    scenario: RunnableArgument,
    receiver: ReceiverOption = None,
    set_: SetOption = None,
    fmi: FmiOption = None,
    seed: SeedOption = None,
    svg: SvgOption = None,
    as_json: JsonOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Print what would run, a scenario or an SSP package, and how it is connected.

    With --verbose, print every parameter with its value, every input with its source, and every
    recorded variable. For a package, print its components and systems, and the connections that
    change values; with --verbose all connections with units. With --svg FILE, also draw them, for
    light and dark pages.
    """
    drawn = ""
    with waiting():
        from ...packages import drawing, is_package, picture
        from ...packages.read import opened
        from ...scenario.wiring import connect
        from ...simulation.plans.checks import check_size
        from ...simulation.resolve import resolve

        settled, _ = _settled(scenario, receiver, set_, fmi, seed)
        if is_package(settled):
            with opened(settled) as package:
                resolved = resolve(package.system, where=str(package.path))
                check_size(resolved)
                if svg is not None:
                    picture.save(svg, package, resolved)
                drawn = drawing.text(package, resolved, verbose=verbose, width=width())
        elif svg is not None:
            raise ConfigurationError(f"--svg: must come with an SSP package, got {scenario}")
        else:
            resolved = resolve(connect(settled, receiver or (), fmi))
            check_size(resolved)
    if as_json:
        from ..documents.contents import plan as content

        show(content(resolved))
        return
    if drawn:
        typer.echo(f"{drawn}\n")
    # The elements of a package are its components.
    short = bool(drawn) and not verbose
    typer.echo(resolved.span if short else resolved.text(verbose=verbose, width=width()))
    if not verbose:
        say(f"\n--verbose lists {resolved.contents}")


@app.command()
def calibrate(
    sound_speed: Annotated[
        float, numeric("--sound-speed", float, "M_S", "True speed of sound in m/s.")
    ] = 1530.0,
    assumed_sound_speed: Annotated[
        float,
        numeric("--assumed-sound-speed", float, "M_S", "Speed that ranging assumes, in m/s."),
    ] = 1500.0,
    range_std: Annotated[float, numeric("--range-std", float, "M", "Noise of a range in m.")] = 0.1,
    distance: Annotated[float, numeric("--distance", float, "M", "Known distance in m.")] = 10.0,
    distance_std: Annotated[
        float, numeric("--distance-std", float, "M", "Standard uncertainty of the distance in m.")
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
    as_json: JsonOption = False,
) -> None:
    """Calibrate the speed of sound and test the ranges.

    Follows the paper's section 2.3: finds the speed of sound from a known distance, and compares
    ranges at 0 to 100 m, in steps of 5 m, with the truth. Uses the Acoustics FMU.
    """
    with waiting("calibrating"):
        from ... import artifacts
        from ...calibrate import calibrate as measure

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
            before=unless_other(wanted, other),
        )
        folder = result.save(wanted, other=other)
    report(result, folder, wanted, as_json)


@app.command()
def scenarios(as_json: JsonOption = False) -> None:
    """List the included scenarios."""
    from ... import listings

    found = listings.scenarios()
    if as_json:
        from ..documents.by_command import Scenarios
        from ..documents.document import Entry

        show(Scenarios(scenarios=[Entry(name=name, title=title) for name, title in found.items()]))
    else:
        table([*found.items()])


@app.command()
def receivers(as_json: JsonOption = False) -> None:
    """List the receivers that can be chosen by name."""
    from ... import listings

    if as_json:
        from sblcosim.models import RECEIVERS

        from ...scenario.doubts import PURPOSES
        from ..documents.by_command import ReceiverEntry, Receivers

        entries = [
            ReceiverEntry(
                name=name, description=component.description, purpose=PURPOSES.get(name, ""),
                keys=[variable.key for variable in component.of("parameter")],
            )
            for name, component in RECEIVERS.items()
        ]  # fmt: skip
        show(Receivers(receivers=entries))
        return
    table([*listings.receivers().items()])
    say("or the path of an .fmu file; 'sblcosim check FILE.fmu' says whether it fits")
    say("or FILE.py:CLASS, a class made from sblcosim.Receiver")
