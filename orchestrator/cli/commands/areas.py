"""The command that maps the error of a receiver over an area, or against distance."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...errors import ConfigurationError
from ..common import completion
from ..common.app import (
    ForceOption,
    JsonOption,
    NoFiguresOption,
    OneReceiverOption,
    ScenarioArgument,
    SeedOption,
    SetOption,
    VerboseOption,
    app,
    destination,
    folder_option,
    numeric,
    one_receiver,
    overrides,
    report,
    unless_other,
    waiting,
)
from ..common.keeping import keeping

if TYPE_CHECKING:
    from ...answer import Answer

_ERRORS = ("absolute_total", "absolute_horizontal", "relative_total", "relative_horizontal")


@app.command("map")
def map_(
    scenario: ScenarioArgument,
    depth: Annotated[
        list[float],
        numeric("--depth", float, "M", "Depth of the diver in m; with --distance several times."),
    ],
    area: Annotated[
        str | None,
        typer.Option(
            "--area",
            metavar="NORTHxEAST|N,N,E,E",
            help="Size in m about the beacons, e.g. 60x60, or bounds: north from and to, east from "
            "and to.",
        ),
    ] = None,
    distance: Annotated[
        str | None,
        typer.Option(
            "--distance",
            metavar="TO|FROM,TO",
            help="In place of an area: distances from the platform in m, e.g. 60, in all "
            "directions.",
        ),
    ] = None,
    receiver: OneReceiverOption = None,
    set_: SetOption = None,
    limit: Annotated[
        float | None,
        numeric("--limit", float, "M", "Requirement in m: draws its contour, adds runs near it."),
    ] = None,
    cells: Annotated[
        str | None,
        typer.Option(
            "--cells",
            metavar="N|NORTHxEAST",
            help="Cells along the longer side, or both numbers; number of distances [default: 60; "
            "21 distances].",
        ),
    ] = None,
    runs: Annotated[
        int | None,
        numeric("--runs", int, "N", "Runs in each cell [default: 20; 500 at a distance, where the "
                "data-sheet sentence needs at least 59]."),
    ] = None,
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
        float, numeric("--radius", float, "M", "Radius of the diver's circle in m.")
    ] = 3.0,
    speed: Annotated[
        float | None,
        numeric("--speed", float, "M_S", "Speed of the diver in m/s [default: the scenario's]."),
    ] = None,
    workers: Annotated[
        int | None, numeric("--workers", int, "N", "Threads [default: all cores].")
    ] = None,
    out: Annotated[Path | None, folder_option("runs/NAME-map or runs/NAME-distance")] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
    seed: SeedOption = None,
    no_figures: NoFiguresOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Map the 95 % error of a receiver over an area, or against distance from the platform.

    With --area, a diver circles about the middle of each cell. The errors of all epochs and runs
    are pooled with those of neighbouring cells. A folder gets the cells as a table, figures and,
    if the scenario has a place on Earth, contours as GeoJSON. With --distance, divers circle at
    each distance in all directions. The answer is a sentence for a data sheet, a table and a
    figure. Both show the possible error too. After Ctrl-C or a crash, the same command continues.
    """
    # Output of the user's code is not part of the result.
    with waiting() as progress, redirect_stdout(sys.stderr):
        from ... import artifacts
        from ...areas.distance import map_distance
        from ...areas.survey import map_area
        from ...scenario.scenario import load

        where = _where(area, distance, depth)
        given = load(scenario, overrides(set_, seed))
        name = f"{given.name}-{'map' if distance is None else 'distance'}"
        wanted, other = destination(out, Path("runs", name), force)
        artifacts.check(wanted, other=other)
        numbers: dict[str, Any] = {"cells": cells, "runs": runs}
        mapped: Callable[..., Answer] = map_area if distance is None else map_distance
        with keeping(wanted) as keep:
            found = mapped(
                given, *where, one_receiver(receiver), limit_m=limit, error=error,
                duration_s=duration, settling_s=settling, radius_m=radius, speed_m_s=speed,
                workers=workers, progress=progress, keep=keep,
                before=unless_other(wanted, other),
                **{key: it for key, it in numbers.items() if it is not None},
            )
            folder = found.save(wanted, figures=not no_figures, other=other)
    report(found, folder, wanted, as_json, verbose)


def _where(area: str | None, distance: str | None, depth: list[float]) -> tuple[Any, Any]:
    """The area and its depth, or the distance and its depths.

    Raises
    ------
    ConfigurationError
        Neither or both are given, or an area at several depths.
    """
    if (area is None) == (distance is None):
        raise ConfigurationError(
            "--area: must be given, or --distance, got neither" if area is None else
            f"--distance: must be left out with --area, got {distance}"
        )
    if area is None:
        return distance, depth
    if len(depth) > 1:
        raise ConfigurationError(
            f"--depth: must be given once with --area, got {len(depth)} depths; --distance takes "
            "several"
        )
    return area, depth[0]
