"""Commands for recorded logs: what is in one, and what it tells about its device."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..common import completion
from ..common.app import (
    ForceOption,
    JsonOption,
    MappingOption,
    NoFiguresOption,
    VerboseOption,
    apart,
    app,
    destination,
    folder_option,
    report,
    waiting,
)

LogArgument = Annotated[
    Path,
    typer.Argument(
        metavar="LOG",
        readable=False,
        help="Folder of a log, CSV, Parquet, a capture of the Water Linked API, or NMEA.",
    ),
]

KnownOption = Annotated[
    str | None,
    typer.Option(
        "--scenario",
        metavar="SCENARIO",
        help="Scenario with the settings [default: that of the log, or usual values].",
        autocompletion=completion.scenarios,
    ),
]


@app.command("log")
def log_(
    log: LogArgument,
    mapping: MappingOption = None,
    out: Annotated[
        Path | None, folder_option("runs/NAME-log", what="Folder for tables and picture")
    ] = None,
    convert: Annotated[
        bool,
        typer.Option(
            "--convert",
            help="Add the log in sblcosim's own format, in the subfolder log: all that can be "
            "used of it.",
        ),
    ] = False,
    force: ForceOption = False,
    as_json: JsonOption = False,
    no_figures: NoFiguresOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Say what is in a recorded log.

    Prints times, beacons, rates, gaps, repeats, depths, truth, positions that devices have computed
    themselves, and what is wrong in which lines. A folder gets the tables and a picture.
    """
    with waiting("reading"):
        from ... import artifacts
        from ...logs.contents import log as contents_of

        apart(out, log, mapping)
        if out is not None:
            artifacts.check(out, {"log": {}}, destination(out, out, force)[1], part=True)
        result = contents_of(log, mapping)
        wanted, other = destination(out, Path("runs", f"{folder_name(result.log.name)}-log"), force)
        folder = result.save(wanted, figures=not no_figures, other=other, log=convert)
    report(result, folder, wanted, as_json, verbose)


@app.command()
def identify(
    log: LogArgument,
    scenario: KnownOption = None,
    mapping: MappingOption = None,
    out: Annotated[Path | None, folder_option("runs/NAME-identified")] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
    verbose: VerboseOption = False,
    no_figures: NoFiguresOption = False,
) -> None:
    """Identify the device that recorded a log: its noise, late ranges, offsets, losses and motion.

    LOG may also be the folder of a run. Prints each number with its 95 % interval, or that the log
    does not tell it, and writes the scenario that simulates the device. 'sblcosim process LOG
    --scenario DIR/scenario.toml' runs receivers with these settings.
    """
    with waiting("identifying"):
        from ... import artifacts
        from ...identification.run import identify as identified

        apart(out, log, scenario, mapping)
        if out is not None:
            artifacts.check(out, {"identified": {}}, destination(out, out, force)[1], part=True)
        found = identified(log, scenario=scenario, mapping=mapping)
        default = Path("runs", f"{folder_name(found.log)}-identified")
        wanted, other = destination(out, default, force)
        folder = found.save(wanted, figures=not no_figures, other=other)
    report(found, folder, wanted, as_json, verbose)


def folder_name(name: str) -> str:
    """A name that a folder may have."""
    kept = "".join(c if c.isalnum() or c in "-_." else "-" for c in name)[:60].strip(".")
    return kept or "log"
