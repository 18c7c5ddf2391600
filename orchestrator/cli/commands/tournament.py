"""The command that compares receivers."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Annotated

import typer

from ..common import completion
from ..common.app import (
    ForceOption,
    JsonOption,
    NoFiguresOption,
    ReceiverOption,
    SeedOption,
    SetOption,
    StepTimeoutOption,
    VerboseOption,
    app,
    destination,
    folder_option,
    numeric,
    overrides,
    refuse_silence,
    report,
    unless_other,
    waiting,
)
from ..common.keeping import keeping
from .studies import ContaminationOption, MasterOption, WorkersOption

ScenariosArgument = Annotated[
    list[str],
    typer.Argument(
        metavar="SCENARIO",
        help="TOML files, or names from 'sblcosim scenarios'.",
        autocompletion=completion.scenarios,
    ),
]


@app.command()
def compare(
    scenarios: ScenariosArgument,
    receiver: ReceiverOption = None,
    runs: Annotated[int, numeric("--runs", int, "N", "Runs of each scenario.", low=2)] = 200,
    set_: SetOption = None,
    practical: Annotated[
        float | None,
        numeric("--practical", float, "SIZE", "Differences below this do not matter."),
    ] = None,
    response: Annotated[
        str | None,
        typer.Option(
            "--response",
            metavar="NAME|FILE.py:FUNCTION",
            help="Response to compare, less is better [default: RMS total error].",
            autocompletion=completion.responses,
        ),
    ] = None,
    settling: Annotated[
        float,
        numeric("--settling", float, "S", "Errors count from this time after the start.", low=0),
    ] = 0.0,
    same_start: Annotated[
        bool,
        typer.Option(
            "--same-start",
            help="Tell no receiver where the diver starts: all begin with what they receive first.",
        ),
    ] = False,
    contamination: ContaminationOption = 0.05,
    seed: SeedOption = None,
    workers: WorkersOption = None,
    master: MasterOption = None,
    step_timeout: StepTimeoutOption = None,
    out: Annotated[Path | None, folder_option("runs/comparison")] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
    verbose: VerboseOption = False,
    no_figures: NoFiguresOption = False,
    replay: Annotated[
        bool,
        typer.Option(
            "--replay",
            help="Add a page that plays back the best receiver's worst run, worst.html.",
        ),
    ] = False,
) -> None:
    """Find out which receiver is better, with the same noise for all.

    Prints the answer, then for each scenario and over all of them the error, lost runs, covariance
    and time of each receiver, and the paired differences, whose intervals hold simultaneously.
    Receivers are called equal only with --practical. A folder gets the tables and a figure. After
    Ctrl-C or a crash, the same command continues. The exit code is 1 if a receiver gave no estimate
    in any run of a scenario.
    """
    # Output of the user's code is not part of the result.
    with waiting(remaining=True) as progress, redirect_stdout(sys.stderr):
        from ... import artifacts
        from ...comparison.tournament.result import RESPONSE
        from ...comparison.tournament.run import compare as compared
        from ...comparison.tournament.worst import worst_run

        wanted, other = destination(out, Path("runs", "comparison"), force)
        artifacts.check(wanted, other=other)
        with keeping(wanted) as keep:
            found = compared(
                scenarios,
                receiver or (),
                runs=runs,
                response=response or RESPONSE,
                settling_s=settling,
                practical=practical,
                overrides=overrides(set_, None),
                seed=seed,
                contamination=contamination,
                workers=workers,
                master=master,
                step_timeout=step_timeout,
                progress=progress,
                keep=keep,
                before=unless_other(wanted, other),
                same_start=same_start,
            )
            worst = worst_run(
                found, receiver or (), master=master, step_timeout=step_timeout
            ) if replay else None
            folder = found.save(wanted, figures=not no_figures, other=other, worst=worst)
    report(found, folder, wanted, as_json, verbose)
    refuse_silence(found)
