"""The command that writes a page to explore a scenario."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Annotated

import typer

from ...errors import ConfigurationError, quoted
from ..common import completion
from ..common.app import SeedOption, SetOption, app, overrides, say, waiting

_USUAL = "realistic-dive"


@app.command()
def explore(
    scenario: Annotated[
        str,
        typer.Argument(
            metavar="SCENARIO", help="Name of an included scenario, or FILE.toml.",
            autocompletion=completion.scenarios,
        ),
    ] = _USUAL,
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
        typer.Option("--out", metavar="FILE.html", help="The page [default: NAME.html]."),
    ] = None,
    no_open: Annotated[
        bool, typer.Option("--no-open", help="Only write the page; show it nowhere.")
    ] = False,
) -> None:
    """Write one HTML file in which the scenario can be changed and simulated, and open it.

    The page has the real components and needs no network. Its numbers are those of the command
    line: the scenario file that it offers for download gives the same record, to the last bit.
    """
    with waiting("building components"), redirect_stdout(sys.stderr):
        from ...explore import page
        from ...scenario.scenario import load

        settled = load(scenario, overrides(set_, seed))
        file = Path(f"{settled.name}.html") if out is None else out
        page.write(settled, file, receiver or (), _numbers(beacons))
    say(f"written to {file}")
    if not no_open:
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
