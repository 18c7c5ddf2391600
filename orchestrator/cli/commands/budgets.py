"""The command that finds the sources of an error."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ...errors import check_choice
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
    say,
    unless_other,
    waiting,
)
from ..common.keeping import keeping


def _sources(incomplete: str) -> completion.Offers:
    from ...scenario.error_sources import SOURCES

    before, plus, last = incomplete.rpartition("+")
    offers = completion.starting(
        [(name.replace(" ", "-"), it.words) for name, it in SOURCES.items()], last
    )
    return [(f"{before}{plus}{name}", words) for name, words in offers]


@app.command()
def budget(
    scenario: ScenarioArgument,
    receiver: OneReceiverOption = None,
    set_: SetOption = None,
    better: Annotated[
        bool,
        typer.Option("--better", help="Replace equipment with better, instead of perfect, one."),
    ] = False,
    together: Annotated[
        list[str] | None,
        typer.Option(
            "--with",
            metavar="A+B",
            help="Also switch these errors together, e.g. clock+sound-speed; can be repeated.",
            autocompletion=_sources,
        ),
    ] = None,
    untold: Annotated[
        bool, typer.Option("--untold", help="Do not tell the receiver of the switch.")
    ] = False,
    frame: Annotated[
        str,
        typer.Option(
            metavar="absolute|own_relative",
            help="Frame of the error: absolute, or relative to the platform's true position.",
            autocompletion=completion.words("absolute", "own_relative"),
        ),
    ] = "absolute",
    runs: Annotated[
        int | None,
        numeric("--runs", int, "N", "Runs with each switch, at least 30 [default: 400].", low=30),
    ] = None,
    workers: Annotated[
        int | None, numeric("--workers", int, "N", "Parallel workers [default: all cores].", low=1)
    ] = None,
    out: Annotated[Path | None, folder_option("runs/NAME-budget")] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
    verbose: VerboseOption = False,
    seed: SeedOption = None,
    no_figures: NoFiguresOption = False,
) -> None:
    """Find the sources of the error.

    Switches each error of a scenario off alone, and on alone, in many runs with the same noise, and
    does the same for the bound. Shares are parts of the mean square; what does not add up is
    printed. A folder gets budget.csv and a bar chart. After Ctrl-C or a crash, the same command
    continues.
    """
    with waiting("simulating", remaining=True) as progress:
        from ... import artifacts
        from ...comparison.budget import run as budgets
        from ...comparison.budget.result import FRAMES
        from ...explore import contents as pages
        from ...report.common import PLAY, explore
        from ...scenario.scenario import load

        check_choice("frame", frame, [*FRAMES])
        chosen = one_receiver(receiver)
        settled = load(scenario, overrides(set_, seed))
        wanted, other = destination(out, Path("runs", f"{settled.name}-budget"), force)
        artifacts.check(wanted, other=other)
        with keeping(wanted) as keep:
            found = budgets.budget(
                settled,
                chosen,
                better=better,
                together=together or (),
                untold=untold,
                runs=budgets.RUNS if runs is None else runs,
                workers=workers,
                progress=progress,
                keep=keep,
                before=unless_other(wanted, other),
            )
            found.of(frame)  # refused before anything is written
            folder = found.save(wanted, figures=not no_figures, other=other)
    report(found, folder, wanted, as_json, verbose, frame=frame)
    if not as_json and pages.is_possible(settled, found.receiver):
        given = [*(("--receiver", chosen) if chosen else ())]
        for key in overrides(set_, seed):
            given += ["--set", key]
        say(f"{PLAY} {explore(scenario, *given)}")
