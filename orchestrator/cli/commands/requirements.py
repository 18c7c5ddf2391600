"""Commands for questions: which design is the cheapest that surely suffices."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..common import completion
from ..common.app import JsonOption, VerboseOption, app, numeric, report, show, table, waiting
from ..common.outcome import kept
from .studies import ExecutorOption, SchedulerOption, WorkersOption


@app.command()
def require(
    source: Annotated[
        str,
        typer.Argument(
            metavar="QUESTION",
            help="TOML file, or a name from 'sblcosim questions'.",
            autocompletion=completion.questions,
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Folder; runs in it are not repeated [default: answers/NAME].",
        ),
    ] = None,
    most_runs: Annotated[
        int | None,
        numeric("--most-runs", int, "N", "Budget of runs that replaces the question's.", low=1),
    ] = None,
    until_sure: Annotated[
        bool,
        typer.Option(
            "--until-sure",
            help="Make no new runs of designs that are dearer than one that surely suffices.",
        ),
    ] = False,
    workers: WorkersOption = None,
    executor: ExecutorOption = "threads",
    scheduler: SchedulerOption = None,
    as_json: JsonOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Find the cheapest design that surely meets a requirement; runs go where they decide.

    A folder gets a report, the front of cost and accuracy, and the design's scenario. After Ctrl-C
    or a crash, the same command continues. The exit code is 1 if no design surely suffices.
    """
    with waiting(remaining=True) as progress:
        from ...require import question as questions
        from ...require import run

        asked = questions.load(source)
        out = out or Path("answers", asked.study.name)
        try:
            found = run.decide(
                asked, out, most_runs=most_runs, until_sure=until_sure, workers=workers,
                executor=executor, scheduler=scheduler, progress=progress,
            )  # fmt: skip
        except KeyboardInterrupt as stop:
            from ...study import store

            done = len(store.finished(out / run.RUNS))
            kept(stop, str(done), out)
    folder = out / run.ANSWER
    report(found, folder, folder, as_json, verbose)
    if found.chosen is None:
        raise typer.Exit(1)


@app.command()
def questions(as_json: JsonOption = False) -> None:
    """List the included questions."""
    from ... import listings

    found = listings.questions()
    if as_json:
        from ..documents.document import Entry
        from ..documents.studies import Questions

        show(Questions(questions=[Entry(name=name, title=title) for name, title in found.items()]))
    else:
        table([*found.items()])
