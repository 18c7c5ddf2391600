"""A receiver for a microcontroller."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..common import completion
from ..common.app import SeedOption, SetOption, app, overrides, waiting


@app.command()
def firmware(
    receiver: Annotated[
        str,
        typer.Argument(
            metavar="RECEIVER", help="One of our receivers.", autocompletion=completion.receivers,
        ),
    ],
    scenario: Annotated[
        str,
        typer.Argument(
            metavar="[SCENARIO]", autocompletion=completion.scenarios,
            help="Its parameters and its dive are for this: a TOML file, or a name from 'sblcosim "
            "scenarios'.",
        ),
    ] = "realistic-dive",
    target: Annotated[
        str,
        typer.Option(
            "--target", metavar="cortex-m7|cortex-m4|host",
            help="Processor that the flags and the self-test are for.",
        ),
    ] = "cortex-m7",
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="DIR",
            help="Folder; an equal one is replaced [default: firmware-RECEIVER].",
        ),
    ] = None,
    set_: SetOption = None,
    seed: SeedOption = None,
) -> None:
    """Write a receiver as C for a microcontroller.

    The folder has one C file and one header, without FMI, heap and global variables, with the
    parameters of the scenario. Its numbers are those of the FMU, to the last bit: a self-test with
    receptions of the scenario's dive shows it on the processor. README.md says how to use it.
    """
    with waiting("building"):
        from ...export.firmware import export_firmware

        folder = export_firmware(receiver, scenario, out, overrides(set_, seed), target=target)
    typer.echo(str(folder))
