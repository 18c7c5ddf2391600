"""Commands for studies: run, replay, analyse."""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_args

import typer

from ...errors import ConfigurationError, check_choice
from ..common import completion
from ..common.app import (
    ForceOption,
    JsonOption,
    NoFiguresOption,
    ReplayOption,
    StepTimeoutOption,
    VerboseOption,
    app,
    beside,
    destination,
    numeric,
    refuse_silence,
    report,
    say,
    show,
    table,
    unless_other,
    waiting,
)
from ..common.outcome import kept, typed

if TYPE_CHECKING:
    from ...simulation.how import How
    from ...study.study import Study
    from ..documents.studies import Study as StudyDocument

StudyArgument = Annotated[
    str,
    typer.Argument(
        metavar="STUDY",
        help="TOML file, or a name from 'sblcosim studies'.",
        autocompletion=completion.studies,
    ),
]
ResultsArgument = Annotated[Path, typer.Argument(metavar="RESULTS", help="Folder of a study.")]
ReplicatesOption = Annotated[
    int | None, numeric("--replicates", int, "N", "Replicates, instead of the study's.", low=1)
]
WorkersOption = Annotated[
    int | None, numeric("--workers", int, "N", "Parallel workers [default: all cores].", low=1)
]
ExecutorOption = Annotated[
    str, typer.Option("--executor", metavar="threads|processes", help="Kind of workers.")
]
SchedulerOption = Annotated[
    str | None,
    typer.Option(
        "--scheduler", metavar="ADDRESS", help="Dask scheduler whose workers make the runs instead."
    ),
]
MasterOption = Annotated[
    str | None,
    typer.Option(
        "--master", metavar="native|python|lanes", help="Master [default: lanes if possible]."
    ),
]
ResponseOption = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="Column of the table of runs [default: RMS total error]."),
]
WhoseOption = Annotated[
    str | None, typer.Option(metavar="NAME", help="Receiver [default: the first].")
]
TransformOption = Annotated[
    str | None,
    typer.Option(
        metavar="none|log|spread",
        help="Analyse the mean, its logarithm, or the spread [default: none; for a space log].",
    ),
]
ErrorOption = Annotated[
    str,
    typer.Option(
        metavar="pure|residual",
        help="Error of the effects: between replicates, or about the model.",
    ),
]
CostsOption = Annotated[
    Path,
    typer.Option(
        "--costs",
        metavar="FILE.toml",
        help="Cost of each level of a factor, in the study's order: gps = [900, 40].",
    ),
]
PercentileOption = Annotated[
    float | None,
    numeric(
        "--percentile",
        float,
        "P",
        "Share of runs, in per cent, that must be within the limit [default: 90].",
    ),
]
ContaminationOption = Annotated[
    float,
    numeric(
        "--contamination",
        float,
        "SHARE",
        "Share of bad runs against which a mean must hold; the smaller, the more runs.",
    ),
]


@app.command()
def study(
    source: StudyArgument,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="Folder for the results; runs in it are not repeated "
            "[default: studies/NAME].",
        ),
    ] = None,
    replicates: ReplicatesOption = None,
    workers: WorkersOption = None,
    executor: ExecutorOption = "threads",
    scheduler: SchedulerOption = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say what would run, and how long; write nothing.")
    ] = False,
    master: MasterOption = None,
    step_timeout: StepTimeoutOption = None,
    as_json: JsonOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Run a factorial study, or the missing part of it.

    The folder gets a table with a row per run. After Ctrl-C or a crash, the same command continues.
    The exit code is 1 if all runs failed.
    """
    with waiting(remaining=True) as progress:
        from ...simulation.children.process import patience
        from ...simulation.how import How
        from ...study import runner
        from ...study import study as studies
        from ..documents import contents

        with patience(step_timeout):
            settled = studies.load(source)
        if replicates is not None:
            settled = settled.with_replicates(replicates)
        out = out or Path("studies", settled.name)
        if dry_run:
            told = _what_would_run(settled, out, How(master, step_timeout, workers))
        else:
            try:
                how = How(master, step_timeout, workers, executor, scheduler, progress)
                there = runner.carry_out(settled, out, how)
            except KeyboardInterrupt as stop:
                from ...study import store

                runs = settled.replicates * len(settled.points.values)
                kept(stop, f"{len(store.finished(out))} of {runs}", out)
            told = contents.carried_out(settled, out, there)
    if as_json:
        show(told)
    elif dry_run:
        say(_estimated(told))
    else:
        lines = contents.study_lines(told, verbose)
        say("\n".join([*lines, "", f"written to {out}"]))
    if told.failed == told.runs:
        rest = ", ".join(told.receivers)
        left = f"what can be analysed is of {rest}" if rest else "there is nothing to analyse"
        typer.echo(f"error: all {told.runs} runs failed: {left}", err=True)
        raise typer.Exit(1)


def _what_would_run(definition: Study, out: Path, how: How) -> StudyDocument:
    from ...study import campaign, runner, store
    from ..documents import contents

    prepared = campaign.prepare(store.as_begun(definition, out), how)
    missing = runner.missing(prepared, out, tell=True)
    seconds = runner.estimate(prepared, missing, how) if missing.runs else (None, None)
    return contents.study(
        definition,
        out,
        finished=prepared.runs - missing.runs,
        estimate={
            "steps": prepared.steps, "seconds_from": seconds[0], "seconds_to": seconds[1],
        },
    )  # fmt: skip


def _estimated(told: StudyDocument) -> str:
    """What a study would run, and how long it would take."""
    assert told.estimate is not None
    least, most = told.estimate.seconds_from, told.estimate.seconds_to
    time = "" if least is None or most is None else f"; {_duration(least, most)} on this machine"
    return (
        f"{told.points} points x {told.replicates} replicates = {told.runs} runs, "
        f"{told.estimate.steps} steps"
        + (f"; {told.finished} runs are in {told.folder}" if told.finished else "")
        + f"{time}; nothing was run"
    )


def _duration(least: float, most: float) -> str:
    """A range of two times, which may come in the wrong order."""
    (low, unit), (high, other) = (_amount(s) for s in (least, max(least, most)))
    if (low, unit) == (high, other):
        return f"about {low} {unit}"
    return f"about {low}{'' if unit == other else f' {unit}'} to {high} {other}"


def _amount(seconds: float) -> tuple[str, str]:
    for unit, length, until in (("s", 1, 90), ("min", 60, 90), ("h", 3600, 72)):
        if seconds < until * length:
            return f"{max(seconds / length, 1):.2g}", unit
    return f"{seconds / 86400:,.0f}", "days"


@app.command()
def replay(
    results: ResultsArgument,
    run_id: Annotated[str, typer.Argument(metavar="RUN_ID", help="ID from the study's table.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Folder for the results [default: runs/RUN_ID]."),
    ] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
    verbose: VerboseOption = False,
    no_figures: NoFiguresOption = False,
    page: ReplayOption = False,
) -> None:
    """Repeat one run of a study with a full record."""
    from ...results.figures.artist import forked_artist

    with forked_artist(not no_figures) as artist, waiting() as progress:
        from ... import artifacts
        from ...study.again import replay as again

        wanted, other = destination(out, Path("runs", re.sub(r"\W", "_", run_id)), force)
        artifacts.check(wanted, other=other)
        result = again(
            results, run_id, progress=progress, before=unless_other(wanted, other)
        )
        folder = result.save(
            wanted, figures=not no_figures, other=other, artist=artist, replay=page
        )
    report(result, folder, wanted, as_json, verbose)
    refuse_silence(result)


@app.command()
def analyse(
    results: ResultsArgument,
    response: ResponseOption = None,
    receiver: WhoseOption = None,
    order: Annotated[
        int | None, numeric("--order", int, "N", "Order of interactions [default: 2].", low=1)
    ] = None,
    transform: TransformOption = None,
    error: ErrorOption = "pure",
    practical: Annotated[
        float | None, numeric("--practical", float, "SIZE", "Effects below this do not matter.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Folder [default: RESULTS-analysis]."),
    ] = None,
    as_json: JsonOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Show which factor of a study matters: report, tables and the paper's four pictures.

    A folder gets report.html, which works offline. For a sweep it has the means at each level, for
    a grid the differences of levels, for a space Sobol' indices.
    """
    with waiting("analysing"):
        from ... import artifacts
        from ...analysis.common import options
        from ...report import study as reports

        if transform is not None:
            check_choice("transform", transform, get_args(options.Transform))
        check_choice("error", error, get_args(options.Error))
        out = out or beside(results, "analysis")
        artifacts.check(out)
        artifacts.check_kind(out, "analysis")
        found = reports.analysed(
            results,
            response,
            receiver=receiver,
            order=order,
            transform=transform,  # type: ignore[arg-type]
            error=error,  # type: ignore[arg-type]
            practical=practical,
            command=typed(),
        )
        found.save(out, other="replace")
    report(found, out, out, as_json, verbose)


@app.command()
def advise(
    results: ResultsArgument,
    costs: CostsOption,
    limit: Annotated[
        float | None, numeric("--limit", float, "SIZE", "Largest acceptable error.")
    ] = None,
    percentile: PercentileOption = None,
    mean: Annotated[
        bool, typer.Option("--mean", help="Require the mean of the runs to be within it instead.")
    ] = False,
    contamination: ContaminationOption = 0.05,
    confidence: Annotated[
        float, numeric("--confidence", float, "C", "Confidence that the advised design suffices.")
    ] = 0.95,
    response: ResponseOption = None,
    receiver: WhoseOption = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Folder [default: RESULTS-advice].")
    ] = None,
    as_json: JsonOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Find the cheapest design of a study that suffices.

    The exit code is 1 if no design surely suffices.
    """
    with waiting("weighing"):
        from ... import artifacts
        from ...analysis.advice import advice
        from ...analysis.advice import of_study as study_advice
        from ...analysis.common import columns

        if mean and percentile is not None:
            raise ConfigurationError(
                f"--percentile: must not be given with --mean, got {percentile:g}"
            )
        wanted = None if mean else advice.PERCENTILE if percentile is None else percentile
        out = out or beside(results, "advice")
        artifacts.check(out)
        artifacts.check_kind(out, "advice")
        found = study_advice.advice_on_study(
            results,
            costs,
            response or columns.RESPONSE,
            receiver=receiver,
            limit=limit,
            percentile=wanted,
            contamination=contamination,
            confidence=confidence,
        )
        folder = found.save(out, other="replace")
    report(found, folder, out, as_json, verbose)
    if found.limit is not None and found.chosen is None:
        raise typer.Exit(1)


@app.command()
def paper(
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="DIR", help="Folder; runs in it are not repeated."
        ),
    ] = Path("paper"),
    quick: Annotated[
        bool, typer.Option("--quick", help="Do 5 replicates instead of 50: a look at everything.")
    ] = False,
    practical: Annotated[
        float, numeric("--practical", float, "SIZE", "Effects below this do not matter [m].")
    ] = 0.5,
    workers: WorkersOption = None,
) -> None:
    """Reproduce the paper: its three studies, its tables and figures beside ours, in one report.

    After Ctrl-C or a crash, the same command continues.
    """
    started = time.perf_counter()
    with waiting(remaining=True) as progress:
        from ...report import paper as papers

        try:
            outcome = papers.run(
                out,
                quick=quick,
                practical=practical,
                workers=workers,
                command=typed(),
                progress=progress,
                started=started,
            )
        except KeyboardInterrupt as stop:
            done, runs = papers.progress_of(out, quick)
            kept(stop, f"{done} of {runs}", out)
    for number, text in outcome.answers.items():
        say(f"Scenario {number}: {text}\n")
    rows = [(name, f"{seconds:6.1f} s") for name, seconds in outcome.seconds.items()]
    table([*rows, ("together", f"{sum(outcome.seconds.values()):6.1f} s")])
    typer.echo(f"\nthe report is {outcome.report}")


@app.command()
def studies(as_json: JsonOption = False) -> None:
    """List the included studies."""
    from ... import listings

    found = listings.studies()
    if as_json:
        from ..documents.document import Entry
        from ..documents.studies import Studies

        show(Studies(studies=[Entry(name=name, title=title) for name, title in found.items()]))
    else:
        table([*found.items()])
