"""The report of one study: `sblcosim analyse`."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import pandas as pd
from sblcosim.fmus.stopping import interruptible

from .. import artifacts
from ..analysis import covariance, workflow
from ..analysis.common import columns
from ..analysis.common.options import Error, Transform
from ..analysis.levels.analysis import GeneralFactorial
from ..analysis.two_level import saving
from ..errors import ConfigurationError
from ..judge.consistency import TELLING
from ..judge.definitions import FRAME_WORDS
from ..study import store
from ..study.study import Study, load, shipped, study_of
from ..words.lists import plural
from ..words.numbers import interval, number
from . import levels, means, points, possible, space
from . import two_level as factorial
from .common import DEFINITIONS, as_toml, method, reproduce, seeding
from .means import Means
from .page import Block, Page, PagePicture, PageTable, Section, Text, render
from .parts import StudySections
from .space import Indices
from .two_level import Findings
from .two_level_figures import FIGURES

REPORT = "report.html"


@interruptible
def save(
    results: str | Path,
    directory: str | Path,
    response: str | None = None,
    *,
    receiver: str | None = None,
    order: int | None = None,
    transform: Transform | None = None,
    error: Error = "pure",
    practical: float | None = None,
    command: str = "",
) -> Findings | Means | GeneralFactorial | Indices:
    """Analyse a study; write its tables, figures and report into a folder.

    Parameters
    ----------
    response, receiver, order, transform, error, practical
        As in `sblcosim.analysis.of_study`; default of the response: `RESPONSE`, or what a function
        returns.
    command
        The command line, for the report.

    Returns
    -------
    Findings, GeneralFactorial, Indices or Means
        Of a two-level design, a grid, a space, or a sweep and a study without factors.

    Raises
    ------
    ConfigurationError
        There are no runs, or they cannot be analysed so; nothing is written then.
    """
    results = Path(results)
    study = study_of(results)
    response = response or columns.default_response(study)
    table = store.table(results, columns.needed(study, response, receiver))
    has_points = study.sample is None and study.model is None
    source = _Source(
        study,
        int(table["error"].notna().sum()),
        covariance.by_point(table, list(study.varied)) if has_points else pd.DataFrame(),
        _again(study, results, command or shlex.join(["sblcosim", "analyse", str(results)])),
        points.tables(study, table) if has_points else [],
        possible.tables(study, table) if has_points else [],
    )
    if study.design.kind in ("grid", "space"):
        _check_options(study, order=order, error=error, practical=practical)
    column = columns.column_of(table, response, receiver)
    if study.design.kind == "space":
        indices = Indices(
            study, workflow.of_space(study, table, column, transform=transform)
        )
        return _save_parts(indices, directory, source, column, partial(space.parts, indices))
    if study.design.kind == "grid":
        found = workflow.of_grid(study, table, column, order=order, transform=transform or "none",
                                 practical=practical)
        return _save_parts(found, directory, source, column, partial(levels.parts, study, found))
    plain = order is None and transform is None and error == "pure" and practical is None
    if study.design.kind in workflow.FACTORIAL or not plain:
        findings = factorial.find(study, table, column, order=order, transform=transform or "none",
                                  error=error, practical=practical)
        return _save_factorial(findings, directory, source)
    made = means.find(study, table, column)
    return _save_parts(made, directory, source, column, partial(means.parts, made))


def _check_options(
    study: Study, *, order: int | None, error: Error, practical: float | None
) -> None:
    """Refuse options that a grid or a space has no use for."""
    kind = study.design.kind
    for name, given in (("error", error != "pure"),
                        ("practical", practical is not None and kind == "space"),
                        ("order", order is not None and kind == "space")):
        if given:
            raise ConfigurationError(f"{name}: must be left out for a design of kind {kind!r}")


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


Found = TypeVar("Found")


def _save_parts(
    found: Found, directory: str | Path, source: _Source, column: str,
    made: Callable[[Path], StudySections],
) -> Found:
    """Write the report of any design but a two-level one."""
    about = {"analysis": {"response": column, "factors": list(source.study.factors)}}
    with artifacts.folder(directory, about) as folder:
        own = made(folder)
        own.write(folder)
        _write_verdicts(source, folder)
        summary = [Text(own.answer, "answer"), *(Text(line, "note") for line in own.warnings)]
        page = Page(
            own.title,
            _lead(source.study, own.runs, source.failed),
            [
                Section("Summary", "summary", summary),
                *([_figures(own.pictures)] if own.pictures else []),
                _tables(source, Section(own.heading, "numbers", own.tables)),
                Section("Method", "method", own.method, folded=True),
                source.again,
            ],
            f"sblcosim {artifacts.software()['sblcosim']}",
        )
        (folder / REPORT).write_text(render(page), "utf-8")
    return found


def _save_factorial(findings: Findings, directory: str | Path, source: _Source) -> Findings:
    with artifacts.folder(directory, saving.about(findings.data)) as folder:
        saving.write(findings.data, folder)
        _write_verdicts(source, folder)
        page = _factorial_page(findings, folder, source)
        (folder / REPORT).write_text(render(page), "utf-8")
    return findings


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
    return [PageTable("Are the covariances right?", head, rows, (1,), note)] if rows else []


def _wrong(row: Mapping[Hashable, Any], word: str) -> str:
    """At how many points a covariance is wrong, and by what."""
    if not row[word]:
        return "0"
    low, high = row[f"{word}_from"], row[f"{word}_to"]
    return f"{number(row[word])}, {number(low) if low == high else interval(low, high, number)}"


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
    return f"{count} {plural(count, 'point')}"


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


def _figures(pictures: Sequence[PagePicture], seen: int = 2) -> Section:
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


def _pictures(findings: Findings, folder: Path) -> list[PagePicture]:
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
        pictures.append(PagePicture(name, svg, figure.caption(findings), figure.alt(findings)))
    return pictures
