"""The report of one study: `sblcosim analyse`."""

from __future__ import annotations

import shlex
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .. import artifacts, layout
from ..analysis import covariance, sweep, workflow
from ..analysis.options import Error, Transform
from ..analysis.sentences import quantity as quantity_of
from ..results.catalogue import Figure, by_name, jobs
from ..results.consistency import TELLING
from ..results.definitions import FRAME_WORDS
from ..results.responses import unit_of
from ..study import store
from ..study.study import Study, load, shipped, study_of
from . import factorial, points, possible
from .common import DEFINITIONS, as_toml, method, reproduce, seeding
from .factorial import Findings
from .figures import FIGURES
from .formats import number, span
from .page import Block, Page, Picture, Section, Table, Text, render

REPORT = "report.html"


def save(
    results: str | Path,
    directory: str | Path,
    response: str = workflow.RESPONSE,
    *,
    receiver: str | None = None,
    order: int | None = None,
    transform: Transform = "none",
    error: Error = "pure",
    practical: float | None = None,
    command: str = "",
) -> Findings | Means:
    """Analyse a study; write its tables, figures and report into a folder.

    Parameters
    ----------
    response, receiver, order, transform, error, practical
        As in `sblcosim.analysis.of_study`.
    command
        The command line, for the report.

    Returns
    -------
    Findings or Means
        Of a factorial design, or of a sweep and a study without factors.

    Raises
    ------
    ConfigurationError
        There are no runs, or they cannot be analysed so; nothing is written then.
    """
    results = Path(results)
    study, table = study_of(results), store.table(results)
    source = _Source(
        study,
        int(table["error"].notna().sum()),
        covariance.by_point(table, list(study.varied)),
        _again(study, results, command or shlex.join(["sblcosim", "analyse", str(results)])),
        points.tables(study, table),
        possible.tables(study, table),
    )
    plain = order is None and transform == "none" and error == "pure" and practical is None
    if study.design.kind in workflow.FACTORIAL or not plain:
        findings = factorial.find(study, table, response, receiver=receiver, order=order,
                                  transform=transform, error=error, practical=practical)
        return _save_factorial(findings, directory, source)
    column = workflow.column_of(table, response, receiver)
    return _save_means(workflow.in_choices(study, table, column), column, directory, source)


@dataclass(frozen=True, eq=False)
class _Source:
    """Where the runs are from.

    Attributes
    ----------
    failed
        Number of runs that failed.
    verdicts
        On the receivers' covariances, by point.
    again
        How to reproduce.
    points
        The table of its points.
    possible
        What is possible at them.
    """

    study: Study
    failed: int
    verdicts: pd.DataFrame
    again: Section
    points: list[Block]
    possible: list[Block]


@dataclass(frozen=True, eq=False)
class Means:
    """The mean response at each level of a sweep, or of a study without factors.

    Attributes
    ----------
    response, unit
        Column of the table of runs, and its unit.
    table
        Of `sblcosim.analysis.sweep.means`.
    answer
        In a sentence or two.
    """

    study: Study
    response: str
    unit: str
    table: pd.DataFrame
    answer: str

    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """The answer, then the table; as `sblcosim.analysis.factorial.Factorial.text`."""
        shown = self.table.replace({"factor": self.study.labels})
        shown = shown if self.study.factors else shown.drop(columns=["factor", "value"])
        rows = [[x if isinstance(x, str) else f"{x:.4g}" for x in row] for row in shown.to_numpy()]
        head = [str(name) for name in shown.columns]
        lines = [self.answer, "", *layout.table(rows, width, head, range(1, len(head)))]
        return layout.fitted("\n".join(lines), width)


def _save_factorial(findings: Findings, directory: str | Path, source: _Source) -> Findings:
    with artifacts.folder(directory, workflow.about(findings.data)) as folder:
        workflow.write(findings.data, folder)
        _write_verdicts(source, folder)
        page = _factorial_page(findings, folder, source)
        (folder / REPORT).write_text(render(page), "utf-8")
    return findings


def _save_means(
    table: pd.DataFrame, column: str, directory: str | Path, source: _Source
) -> Means:
    study = source.study
    means = sweep.means(table, list(study.factors), column, study.sweep_base)
    about = {"analysis": {"response": column, "factors": list(study.factors)}}
    with artifacts.folder(directory, about) as folder:
        artifacts.write_table(means, folder, "means")
        _write_verdicts(source, folder)
        page = _means_page(table, means, column, folder, source)
        (folder / REPORT).write_text(render(page), "utf-8")
    unit = unit_of(column)
    answer = _means_answer(study, means, workflow.words(column, table), unit)
    return Means(study, column, unit, means, answer)


def _write_verdicts(source: _Source, folder: Path) -> None:
    if len(source.verdicts):
        artifacts.write_table(source.verdicts, folder, "consistency")


def _covariances(source: _Source) -> list[Block]:
    """Whether the covariances are right, as a table."""
    rows = [
        (
            str(row["receiver"]), FRAME_WORDS[row["frame"]], number(row["points"]),
            number(row["in_band"]),
            *(_wrong(row, word) for word in covariance.WRONG),
            number(row["untold"]), number(row["runs"]), number(row["runs_needed"]),
        )
        for row in covariance.summary(source.verdicts).to_dict(orient="records")
    ]  # fmt: skip
    head = ("Receiver", "Error", "Points", "In band", "Optimistic, by a factor of",
            "Pessimistic, by a factor of", "Not to be told", "Runs a point", "Runs needed")
    note = (
        "Points by the 95 % interval of the mean NEES over their runs, each of which counts once. "
        "Optimistic: errors larger than claimed; the factor is on the standard deviation. Runs "
        f"needed: to tell a factor of {TELLING:g}, at the point where it takes most. One point in "
        "20 leaves the band by chance."
    )
    return [Table("Are the covariances right?", head, rows, (1,), note)] if rows else []


def _wrong(row: Mapping[Hashable, Any], word: str) -> str:
    """At how many points a covariance is wrong, and by what."""
    if not row[word]:
        return "0"
    low, high = row[f"{word}_from"], row[f"{word}_to"]
    return f"{number(row[word])}, {number(low) if low == high else span(low, high, number)}"


def _again(study: Study, results: Path, command: str) -> Section:
    """How to reproduce."""
    about = store.described(results)
    lines = [
        f"{_points(study)}, {study.replicates} replicates; {seeding(study)}.",
    ]
    source, file = study.name, ""
    if source in shipped() and _same(study, load(source)):
        if study.replicates != load(source).replicates:
            source += f" --replicates {study.replicates}"
    else:
        file = as_toml(study.tables())
        source = shlex.quote(f"{source}.toml")
    return reproduce(
        [f"sblcosim study {source} --out {shlex.quote(str(results))}", command],
        lines, about["definition"]["fmus"], file,
    )


def _same(one: Study, other: Study) -> bool:
    """Whether two studies have the same runs, but for the number of replicates."""
    kept = {"title", "replicates", "scenario", "fixed"}
    return (
        one.model_dump(exclude=kept) == other.model_dump(exclude=kept)
        and one.base.given() == other.base.given()
    )


def _points(study: Study) -> str:
    count = len(study.points.values)
    return f"{count} point{'' if count == 1 else 's'}"


def _lead(study: Study, runs: int, failed: int) -> str:
    title = f"{study.title.rstrip('.')}. " if study.title else ""
    text = f"{title}{runs:,} runs at {_points(study)}"
    return f"{text}; {failed} of them failed." if failed else f"{text}."


def _factorial_page(findings: Findings, folder: Path, source: _Source) -> Page:
    study, a = findings.study, findings.shown
    how: list[Block] = [
        Text(method(a)), Text(DEFINITIONS),
        Text(f"Settling time: {study.settling_time_s:g} s. Intervals and the reference line have a "
             f"confidence of {a.confidence:g}."),
        factorial.factor_table(study),
    ]
    return Page(
        f"Which factor matters: {study.name}",
        _lead(study, a.runs, source.failed),
        [
            Section("Summary", "summary", factorial.summary(findings)),
            _figures(_pictures(findings, folder)),
            _tables(source, Section("Effects and model", "effects", factorial.tables(findings))),
            Section("Method", "method", how, folded=True),
            source.again,
        ],
        f"sblcosim {artifacts.software()['sblcosim']}",
    )


def _figures(pictures: Sequence[Picture], seen: int = 2) -> Section:
    """The first figures, and the others folded."""
    rest = pictures[seen:]
    words = " · ".join(picture.caption.partition(":")[0] for picture in rest)
    more = [Section(words, "more-figures", rest, folded=True)] if rest else []
    return Section("Figures", "figures", pictures[:seen], more)


def _tables(source: _Source, first: Section) -> Section:
    """All tables, folded but for their headings."""
    parts = [
        first,
        Section("Design points, with lost and inconsistent runs", "points", source.points),
        Section("Covariances", "covariances", _covariances(source)),
        Section("What is possible", "possible", source.possible),
    ]
    return Section(
        "Tables", "tables", parts=[replace(part, folded=True) for part in parts if part.blocks]
    )


def _pictures(findings: Findings, folder: Path) -> list[Picture]:
    """The figures of the analysis; those in the folder already are not drawn again."""
    pictures = []
    for name, figure in FIGURES.items():
        file = folder / f"{name}.svg"
        if file.exists():
            svg = file.read_text("utf-8")
        elif figure.condition(findings):
            svg = figure.job(findings).svg()
        else:
            continue
        pictures.append(Picture(name, svg, figure.caption(findings), figure.alt(findings)))
    return pictures


def _means_answer(study: Study, means: pd.DataFrame, quantity: str, unit: str) -> str:
    unit = f" {unit}" if unit else ""
    if not study.factors:
        row = means.iloc[0]
        return (
            f"Mean {quantity} {number(row['mean'], 4)}{unit}, "
            f"{span(row['low'], row['high'], number)}{unit}. The study has no factors: there are "
            "no effects to analyse."
        )
    parts = []
    for name in study.factors:
        mine = means[means["factor"] == name].reset_index(drop=True)
        best, worst = mine.iloc[mine["mean"].argmin()], mine.iloc[mine["mean"].argmax()]
        own = study.units[name]
        ends = [quantity_of(row["value"], own) for row in (best, worst)]
        parts.append(
            f"with {study.labels[name]} it is lowest, {number(best['mean'])}{unit}, at {ends[0]} "
            f"and highest, {number(worst['mean'])}{unit}, at {ends[1]}"
        )
    return (
        f"Mean {quantity}, one factor at a time: {'; '.join(parts)}. This is a sweep, no "
        "factorial design: it has no interactions and no effects to test."
    )


def _shared(study: Study) -> str:
    """Which rows of the means are of the same runs."""
    base = dict(zip(study.factors, study.sweep_base, strict=False))
    own = [name for name, value in base.items() if value in study.factors[name].levels]
    if len(own) < 2:
        return ""
    rows = ", ".join(
        f"{study.labels[name]} {quantity_of(float(base[name]), study.units[name])}" for name in own
    )
    return f"These rows are of the same runs, all factors at the scenario's own values: {rows}."


@dataclass(frozen=True, eq=False)
class _Means:
    """The means of a sweep, with the names of factors for people."""

    shown: pd.DataFrame
    quantity: str
    own: str
    units: Mapping[str, str]


def _caption(means: _Means) -> str:
    return f"Mean {means.quantity} at each level; bars are the intervals of the means."


MEANS_FIGURES: Mapping[str, Figure[_Means]] = by_name(
    Figure(
        "means", sweep.plot_means,
        lambda means: (means.shown, f"{means.quantity}{means.own}", means.units),
        _caption, _caption,
        lambda means: bool(means.units),
    ),
)  # fmt: skip
"""The figures in the report of a sweep."""


def _means_page(
    table: pd.DataFrame, means: pd.DataFrame, column: str, folder: Path, source: _Source
) -> Page:
    study = source.study
    quantity, unit = workflow.words(column, table), unit_of(column)
    own = f" [{unit}]" if unit else ""
    rows = [
        (*_level(study, row), number(row["runs"], 6),
         number(row["mean"], 4), span(row["low"], row["high"], number), number(row["std"]))
        for _, row in means.iterrows()
    ]
    head = (*(("Factor", "Level") if study.factors else ()), "Runs", f"Mean{own}",
            f"95% interval{own}", f"Standard deviation{own}")
    units = {study.labels[name]: study.units[name] for name in study.factors}
    subject = _Means(means.replace({"factor": study.labels}), quantity, own, units)
    pictures = _means_pictures(subject, folder)
    shown = Table(f"{quantity[0].upper()}{quantity[1:]}", head, rows, (), _shared(study))
    sections = [
        Section("Summary", "summary",
                [Text(_means_answer(study, means, quantity, unit), "answer")]),
        *([_figures(pictures)] if pictures else []),
        _tables(source, Section("Means at each level" if study.factors else "Mean", "means-table",
                                [shown])),
        Section("Method", "method", _means_method(study), folded=True),
        source.again,
    ]
    runs = int(np.isfinite(table[column]).sum())
    return Page(f"What the runs say: {study.name}", _lead(study, runs, source.failed), sections,
                f"sblcosim {artifacts.software()['sblcosim']}")


def _level(study: Study, row: pd.Series) -> tuple[str, ...]:
    """Factor and level of a row of the means; nothing without factors."""
    if not study.factors:
        return ()
    name = row["factor"]
    return study.labels[name], quantity_of(row["value"], study.units[name])


def _means_pictures(means: _Means, folder: Path) -> list[Picture]:
    """The figures, which are written into the folder, too."""
    pictures = []
    for job in jobs(MEANS_FIGURES, means):
        figure = MEANS_FIGURES[job.name]
        job.save(folder)
        svg = (folder / f"{job.name}.svg").read_text("utf-8")
        pictures.append(Picture(job.name, svg, figure.caption(means), figure.alt(means)))
    return pictures


def _means_method(study: Study) -> list[Block]:
    at = " at each level, the other factors at the scenario's own values" if study.factors else ""
    blocks: list[Block] = [
        Text(f"Means over the runs{at}; the intervals are Student's."), Text(DEFINITIONS),
        Text(f"Settling time: {study.settling_time_s:g} s."),
    ]
    return [*blocks, factorial.factor_table(study)] if study.factors else blocks
