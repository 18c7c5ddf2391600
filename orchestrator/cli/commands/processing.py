"""Commands for recorded logs: receivers on a log."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Annotated

import typer

from ..common.app import (
    FmiOption,
    ForceOption,
    JsonOption,
    MappingOption,
    NoFiguresOption,
    ReceiverOption,
    ReplayOption,
    SetOption,
    StepTimeoutOption,
    TrajectoriesOption,
    VerboseOption,
    apart,
    app,
    destination,
    folder_option,
    numeric,
    refuse_silence,
    report,
    unless_other,
    waiting,
)
from .logs import KnownOption, LogArgument, folder_name


@app.command()
def process(
    log: LogArgument,
    receiver: ReceiverOption = None,
    scenario: KnownOption = None,
    set_: SetOption = None,
    mapping: MappingOption = None,
    smooth: Annotated[
        bool,
        typer.Option("--smooth", help="Also estimate the most probable track of the whole log."),
    ] = False,
    interval: Annotated[
        float | None,
        numeric(
            "--interval", float, "S",
            "Time in s between updates of the receivers [default: from the log].", low=1e-6,
        ),
    ] = None,
    out: Annotated[Path | None, folder_option("runs/NAME-processed")] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
    verbose: VerboseOption = False,
    fmi: FmiOption = None,
    step_timeout: StepTimeoutOption = None,
    no_figures: NoFiguresOption = False,
    trajectories: TrajectoriesOption = None,
    replay: ReplayOption = False,
) -> None:
    """Run receivers on a recorded log, side by side.

    With a true track in the log, prints the error of each receiver. Without one, prints the
    residuals of the ranges by beacon, and how far receivers agree. Ranges that are far too short or
    far too late are left out, and counted. The receivers start where a straight line fits the first
    ranges.

    The settings are those of --scenario, or of the log's own scenario, or usual values with the
    scatter of the ranges. The output says which. The exit code is 1 if a receiver gave no estimate
    at all.
    """
    with waiting("processing") as progress, redirect_stdout(sys.stderr):
        from ... import artifacts
        from ...paths.folder import check
        from ...processing.workflow import process as process_log

        check(trajectories or ())
        apart(out, log, scenario, mapping)
        if out is not None:
            artifacts.check(out, other=destination(out, out, force)[1])
        processed = process_log(
            log, receiver or (), set_ or (), scenario=scenario, mapping=mapping, smooth=smooth,
            interval_s=interval, fmi=fmi, step_timeout=step_timeout, progress=progress,
            before=None if out is None else unless_other(*destination(out, out, force)),
        )
        default = Path("runs", f"{folder_name(processed.log.name)}-processed")
        wanted, other = destination(out, default, force)
        folder = processed.save(
            wanted, figures=not no_figures, other=other, trajectories=trajectories or (),
            replay=replay,
        )
    report(processed, folder, wanted, as_json, verbose)
    refuse_silence(processed)
