"""The command that maps the error of a receiver over an area."""

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
    OneReceiverOption,
    ScenarioArgument,
    SeedOption,
    SetOption,
    app,
    destination,
    numeric,
    one_receiver,
    overrides,
    report,
    waiting,
)
from ..common.keeping import keeping

_ERRORS = ("absolute_total", "absolute_horizontal", "relative_total", "relative_horizontal")


@app.command("map")
def map_(
    scenario: ScenarioArgument,
    area: Annotated[
        str,
        typer.Option(
            "--area",
            metavar="NORTHxEAST|N,N,E,E",
            help="Its size in m about the beacons, e.g. 60x60, or its bounds: north from and to, "
            "east from and to.",
        ),
    ],
    depth: Annotated[float, numeric("--depth", float, "M", "Depth of the diver in m.")],
    receiver: OneReceiverOption = None,
    set_: SetOption = None,
    limit: Annotated[
        float | None,
        numeric("--limit", float, "M", "The requirement in m: its contour, and more runs near it."),
    ] = None,
    cells: Annotated[
        str,
        typer.Option(
            "--cells",
            metavar="N|NORTHxEAST",
            help="Cells along the longer side, or both numbers.",
        ),
    ] = "60",
    runs: Annotated[int, numeric("--runs", int, "N", "Runs in each cell.")] = 20,
    error: Annotated[
        str,
        typer.Option(
            "--error",
            metavar="|".join(_ERRORS),
            help="Which error.",
            autocompletion=completion.words(*_ERRORS),
        ),
    ] = _ERRORS[0],
    duration: Annotated[float, numeric("--duration", float, "S", "Length of a run in s.")] = 60.0,
    settling: Annotated[
        float, numeric("--settling", float, "S", "Time until errors count, in s.")
    ] = 20.0,
    radius: Annotated[
        float, numeric("--radius", float, "M", "Of the circle that the diver swims, in m.")
    ] = 3.0,
    speed: Annotated[
        float | None,
        numeric("--speed", float, "M_S", "Of the diver in m/s [default: the scenario's]."),
    ] = None,
    workers: Annotated[
        int | None, numeric("--workers", int, "N", "Threads [default: all cores].")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="DIR", help="Folder for the results [default: runs/NAME-map]."
        ),
    ] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
    seed: SeedOption = None,
    no_figures: NoFiguresOption = False,
) -> None:
    """Map the 95 % error of a receiver over an area, beside what is possible there.

    In each cell a diver circles about its middle. The errors of all epochs and runs are pooled with
    those of neighbouring cells. Cells as a table, figures, and, where the scenario has a place on
    Earth, contours as GeoJSON go to a folder. After Ctrl-C or a crash the same command goes on.
    """
    # What a user's code prints is no part of the result.
    with waiting() as progress, redirect_stdout(sys.stderr):
        from ... import artifacts
        from ...areas.survey import map_area
        from ...scenario.scenario import load

        given = load(scenario, overrides(set_, seed))
        wanted, other = destination(out, Path("runs", f"{given.name}-map"), force)
        artifacts.check(wanted, other=other)
        with keeping(wanted) as keep:
            found = map_area(
                given, area, depth, one_receiver(receiver), limit_m=limit, cells=cells, runs=runs,
                error=error, duration_s=duration, settling_s=settling, radius_m=radius,
                speed_m_s=speed, workers=workers, progress=progress, keep=keep,
            )
            folder = found.save(wanted, figures=not no_figures, other=other)
    report(found, folder, wanted, as_json)
