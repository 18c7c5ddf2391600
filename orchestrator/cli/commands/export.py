"""Commands that write a scenario as one file for other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..common.app import (
    ReceiverOption,
    ScenarioArgument,
    SeedOption,
    SetOption,
    app,
    numeric,
    overrides,
    waiting,
)
from ..common.outcome import App, Commands

group = App(cls=Commands, no_args_is_help=True, rich_markup_mode=None)
app.add_typer(group, name="export", help="Write a scenario as one file for other tools.")


@group.command()
def ssp(
    scenario: ScenarioArgument,
    version: Annotated[
        int,
        numeric(
            "--ssp",
            int,
            "1|2",
            "1: SSP 1.0, FMI 2, scalars; 2: SSP 2.0, FMI 3, arrays.",
            low=1,
            high=2,
        ),
    ] = 1,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="FILE.ssp",
            help="The package; replaces a file [default: NAME.ssp, or NAME-baked.ssp].",
        ),
    ] = None,
    receiver: ReceiverOption = None,
    set_: SetOption = None,
    seed: SeedOption = None,
    bake: Annotated[
        bool,
        typer.Option(
            "--bake",
            help="Build the FMUs with the scenario's numbers as start values, for tools that "
            "ignore parameter sets; needs a C compiler.",
        ),
    ] = False,
) -> None:
    """Write a scenario as an SSP package.

    The package holds all FMUs, their connections, parameters and step sizes.
    """
    with waiting("building"):
        from ...export.ssp import export_ssp

        path = export_ssp(
            scenario,
            out,
            receiver or (),
            overrides(set_, seed),
            version=2 if version == 2 else 1,
            bake=bake,
        )
    typer.echo(str(path))


@group.command()
def fmu(
    scenario: ScenarioArgument,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="FILE.fmu",
            help="The FMU; replaces a file [default: NAME.fmu].",
        ),
    ] = None,
    receiver: ReceiverOption = None,
    set_: SetOption = None,
    seed: SeedOption = None,
) -> None:
    """Write a scenario as a single FMU that holds all others.

    Its outputs are COMPONENT.VARIABLE, and its numbers are the scenario's. Needs a C compiler and
    the package fmu-manipulation-toolbox.
    """
    with waiting("building"):
        from ...export.container import export_fmu

        path = export_fmu(scenario, out, receiver or (), overrides(set_, seed))
    typer.echo(str(path))
