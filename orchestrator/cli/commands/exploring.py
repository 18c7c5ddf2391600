"""The command that writes a page to explore a scenario."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Annotated

import typer

from ...errors import ConfigurationError, quoted
from ..common import completion
from ..common.app import MappingOption, SeedOption, SetOption, app, overrides, say, waiting

_USUAL = "realistic-dive"


@app.command()
def explore(
    scenario: Annotated[
        str | None,
        typer.Argument(
            metavar="SCENARIO",
            help=f"Name of an included scenario, or FILE.toml [default: {_USUAL}, or with --log "
            "the settings of the log].",
            autocompletion=completion.scenarios,
        ),
    ] = None,
    log: Annotated[
        Path | None,
        typer.Option(
            "--log", metavar="LOG", readable=False,
            help="Log of a dive that the page replays through its receivers, as 'sblcosim "
            "process' does.",
        ),
    ] = None,
    mapping: MappingOption = None,
    receiver: Annotated[
        list[str] | None,
        typer.Option(
            "--receiver", metavar="NAME", autocompletion=completion.receivers,
            help="Receiver to begin with instead of the scenario's; repeat it for several.",
        ),
    ] = None,
    set_: SetOption = None,
    seed: SeedOption = None,
    beacons: Annotated[
        str | None,
        typer.Option(
            "--beacons", metavar="N,…",
            help="Numbers of beacons that the page can have, beside the scenario's [default: 3 to "
            "8]. Fewer make it smaller.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="FILE",
            help="The page [default: NAME.html]; with --log also FILE.json, the recorded dive "
            "alone, which can be opened in any page.",
        ),
    ] = None,
    no_open: Annotated[
        bool, typer.Option("--no-open", help="Only write the page; show it nowhere.")
    ] = False,
) -> None:
    """Write one HTML file in which the scenario can be changed and simulated, and open it.

    The page has the real components and needs no network. Its numbers are those of the command
    line: the scenario file that it offers for download gives the same record, to the last bit.

    With --log, the page also replays a recorded dive. Its estimates are those of 'sblcosim
    process', to the last bit, with any receivers and settings that are chosen there.
    """
    if log is None and mapping is not None:
        raise ConfigurationError(f"--mapping: must come with --log, got {quoted(str(mapping))}")
    if log is not None and not log.exists():
        raise ConfigurationError(f"--log: must be a log, got nothing named {quoted(str(log))}")
    with waiting("building components"), redirect_stdout(sys.stderr):
        from ...explore import page
        from ...scenario.scenario import load

        chosen, changes = receiver or (), overrides(set_, seed)
        dive = None
        if log is None:
            settled = load(scenario or _USUAL, changes)
            usual = Path(f"{settled.name}.html")
        else:
            from ...processing.dive import recorded_dive
            from .logs import folder_name  # the module's own commands come later in the help

            dive = recorded_dive(log, chosen, changes, scenario=scenario, mapping=mapping)
            settled = dive.scenario
            usual = Path(f"{folder_name(settled.name)}.html")
        file = usual if out is None else out
        alone = dive is not None and file.suffix.lower() == page.DIVE_ENDING
        if dive is not None and alone:
            page.write_dive(settled, file, chosen, dive)
        else:
            page.write(settled, file, chosen, _numbers(beacons), dive)
    say(f"written to {file}")
    if not (no_open or alone):
        page.show(file)


def _numbers(text: str | None) -> list[int]:
    """Numbers of beacons as typed: ``4,6``; None: all."""
    from sblcosim.models.ports import BEACONS

    if text is None:
        return [*range(BEACONS.least, BEACONS.most + 1)]
    words = text.replace(",", " ").split()
    if not words or not all(it.isdecimal() for it in words):
        raise ConfigurationError(
            f"--beacons: must be numbers from {BEACONS.least} to {BEACONS.most}, such as 4,6, got "
            f"{quoted(text)}"
        )
    return [*map(int, words)]
