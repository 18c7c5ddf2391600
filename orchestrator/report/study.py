"""The report of one study: `sblcosim analyse`."""

from __future__ import annotations

import shlex
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from sblcosim.fmus.stopping import interruptible

from .. import artifacts
from ..analysis import covariance, workflow
from ..analysis.common import columns
from ..analysis.common.options import Error, Transform
from ..analysis.levels.analysis import GeneralFactorial
from ..analysis.tables import VERDICTS
from ..answer import Extended
from ..data.tables import Columns
from ..errors import ConfigurationError
from ..judge.consistency import TELLING
from ..judge.definitions import FRAME_WORDS
from ..results.responses import unit_of
from ..study import store
from ..study.study import Study, load, shipped, study_of
from ..style import ThemeName
from ..words.lists import counted, plural
from ..words.numbers import interval, measured, number
from . import levels, means, points, possible, space
from . import two_level as factorial
from .common import DEFINITIONS, PLAY, as_toml, explore, method, reproduce, seeding
from .means import Means
from .page import Block, Code, Page, PagePicture, PageTable, Section, Text, render
from .parts import StudySections, folded, pictures
from .space import Indices
from .two_level import Findings
from .two_level_figures import FIGURES

REPORT = "report.html"


@dataclass(frozen=True, eq=False, repr=False)
class Analysis(Extended):
    """The analysis that a study's design asks for, with its page.

    Attributes
    ----------
    found
        The findings: of a two-level design, a grid, a space, or a sweep or study without factors.
    source
        The origin of the runs.
    """

    document = "analyse"
    report = REPORT

    found: Findings | GeneralFactorial | Indices | Means
    source: StudiedRuns

    @property
    def main(self) -> Findings | GeneralFactorial | Indices | Means:
        """The findings, without the page."""
        return self.found

    @property
    def columns(self) -> dict[str, Columns]:
        """The declared columns of the tables, by the names of their files."""
        return {**self.found.columns, "consistency": VERDICTS}

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The tables of the findings, and the verdicts on covariances, if there are any."""
        verdicts = self.source.verdicts
        return {**self.found.tables, **({"consistency": verdicts} if len(verdicts) else {})}

    def to_json(self) -> dict[str, Any]:
        """The findings as plain data; fields of other designs are empty."""
        return {**_BLANK, **self.found.to_json()}

    def manifest(self) -> dict[str, Any]:
        """The question, and the study."""
        return {"analysis": {**self.found.manifest()["analysis"], "study": self.source.study.name}}

    def write(
        self, folder: Path, theme: ThemeName = "light", figures: bool = True
    ) -> None:
        """Write tables, figures and the page into an existing folder."""
        super().write(folder, theme, figures)
        found, source = self.found, self.source
        drawn = folder if theme == "light" else None
        if isinstance(found, Findings):
            page = _factorial_page(found, drawn, source)
        elif isinstance(found, GeneralFactorial):
            page = _page(levels.parts(source.study, found, drawn), source)
        elif isinstance(found, Indices):
            page = _page(space.parts(found, drawn), source)
        else:
            page = _page(means.parts(found, drawn), source)
        (folder / REPORT).write_text(render(page), "utf-8")


_RUN = "run_id"
"""Columns that identify a run."""
_BLANK: Mapping[str, Any] = {
    "transform": "none", "method": None, "confidence": 0.95, "dropped": 0, "left_out": None,
    "r2": None, "effects": [], "means": [], "levels": [], "medians": [], "pairs": [],
    "indices": [], "notes": [],
}  # fmt: skip
"""Values of the fields that an analysis does not have."""


@interruptible
def analysed(
    results: str | Path,
    response: str | None = None,
    *,
    receiver: str | None = None,
    order: int | None = None,
    transform: Transform | None = None,
    error: Error = "pure",
    practical: float | None = None,
    command: str = "",
) -> Analysis:
    """Analyse a study as its design requires.

    Parameters
    ----------
    response, receiver, order, transform, error, practical
        As in `sblcosim.analysis.of_study`. The default response is `RESPONSE`, or the value that a
        function returns.
    command
        The command line, for the page.

    Raises
    ------
    ConfigurationError
        There are no runs, or they cannot be analysed in this way.
    """
    results = Path(results)
    study = study_of(results)
    response = response or columns.default_response(study)
    needed = columns.needed(study, response, receiver)
    table = store.table(
        results, lambda names: [it for it in names if it in {*needed(names), _RUN}]
    )
    has_points = study.sample is None and study.model is None
    if study.design.kind in ("grid", "space"):
        _check_options(study, order=order, error=error, practical=practical)
    column = columns.column_of(table, response, receiver)
    source = StudiedRuns(
        study,
        column,
        int(table["error"].notna().sum()),
        covariance.by_point(table, list(study.varied)) if has_points else pd.DataFrame(),
        how_to_repeat(study, results, command or shlex.join(["sblcosim", "analyse", str(results)])),
        _worst(study, table, column, results),
        points.tables(study, table) if has_points else [],
        possible.tables(study, table) if has_points else [],
    )
    return Analysis(_found(study, table, column, order, transform, error, practical), source)


def _found(
    study: Study, table: pd.DataFrame, column: str, order: int | None,
    transform: Transform | None, error: Error, practical: float | None,
) -> Findings | GeneralFactorial | Indices | Means:
    """The findings on a column of the table of runs."""
    if study.design.kind == "space":
        return Indices(study, workflow.of_space(study, table, column, transform=transform))
    if study.design.kind == "grid":
        return workflow.of_grid(study, table, column, order=order, transform=transform or "none",
                                practical=practical)
    plain = order is None and transform is None and error == "pure" and practical is None
    if study.design.kind in workflow.FACTORIAL or not plain:
        return factorial.find(study, table, column, order=order, transform=transform or "none",
                              error=error, practical=practical)
    return means.find(study, table, column)


def _check_options(
    study: Study, *, order: int | None, error: Error, practical: float | None
) -> None:
    """Refuse options that do not apply to a grid or a space."""
    kind = study.design.kind
    for name, given in (("error", error != "pure"),
                        ("practical", practical is not None and kind == "space"),
                        ("order", order is not None and kind == "space")):
        if given:
            raise ConfigurationError(f"{name}: must be left out for a design of kind {kind!r}")


@dataclass(frozen=True, eq=False)
class StudiedRuns:
    """The origin of the runs.

    Attributes
    ----------
    column
        The response: a column of the table of runs.
    failed
        Number of runs that failed.
    verdicts
        Verdicts on the receivers' covariances, by point.
    again
        How to reproduce the results.
    worst
        How to look at the worst run; empty if no run is the worst.
    points
        The table of the points.
    possible
        The table of the possible errors at the points.
    """

    study: Study
    column: str
    failed: int
    verdicts: pd.DataFrame
    again: Section
    worst: list[Section]
    points: list[Block]
    possible: list[Block]


def _page(own: StudySections, source: StudiedRuns) -> Page:
    """The page of any design except a two-level one."""
    summary = [Text(own.answer, "answer"), *(Text(line, "note") for line in own.warnings)]
    return Page(
        own.title,
        _lead(source.study, own.runs, source.failed),
        [
            Section("Summary", "summary", summary),
            *([_figures(own.pictures)] if own.pictures else []),
            _tables(source, Section(own.heading, "numbers", own.tables)),
            Section("Method", "method", own.method, folded=True),
            *source.worst,
            source.again,
        ],
        f"sblcosim {artifacts.software()['sblcosim']}",
    )


def _covariances(source: StudiedRuns) -> list[Block]:
    """A table that says whether the covariances are right."""
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
            "Pessimistic, by a factor of", "Unknown", "Runs per point", "Runs needed")
    note = (
        "Points are counted by the 95 % interval of the mean NEES over their runs, each of which "
        "counts once. Optimistic: errors are larger than claimed, by a factor on the standard "
        f"deviation. Runs needed: runs that reveal a factor of {TELLING:g}, at the point that "
        "needs the most. One point in 20 leaves the band by chance."
    )
    return [PageTable("Are the covariances right?", head, rows, (1,), note)] if rows else []


def _wrong(row: Mapping[Hashable, Any], word: str) -> str:
    """The number of points where a covariance is wrong, and the factors."""
    if not row[word]:
        return "0"
    low, high = row[f"{word}_from"], row[f"{word}_to"]
    return f"{number(row[word])}, {number(low) if low == high else interval(low, high, number)}"


def how_to_repeat(study: Study, results: Path, command: str) -> Section:
    """How to reproduce the results."""
    about = store.described(results)
    lines = [
        f"{_points(study)}, {counted(study.replicates, 'replicate')}; {seeding(study)}.",
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


def _worst(study: Study, table: pd.DataFrame, column: str, results: Path) -> list[Section]:
    """How to look at the run with the largest error, of a study that simulates errors."""
    if study.model is not None or unit_of(column.partition(".")[2]) != "m":
        return []
    lengths = table[column].to_numpy(np.float64, na_value=np.nan)
    if not np.isfinite(lengths).any():
        return []
    row: Any = table.iloc[int(np.nanargmax(np.where(np.isfinite(lengths), lengths, np.nan)))]
    text = (
        f"The largest value is {measured(float(row[column]), 'm')}, in the run with seed "
        f"{row['seed']} at point {row['point']}. This command repeats the run and writes "
        "replay.html, a page that plays it back:"
    )
    run = str(row[_RUN])
    again = shlex.join(["sblcosim", "replay", str(results), run, "--replay"])
    play = explore(f"runs/{run}/scenario.toml")
    blocks: list[Block] = [Text(text), Code(again), Text(PLAY), Code(play)]
    return [Section("Look at the worst run", "worst", blocks, folded=True)]


def _same(one: Study, other: Study) -> bool:
    """Whether two studies have the same runs, except for the number of replicates."""
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


def _factorial_page(findings: Findings, drawn: Path | None, source: StudiedRuns) -> Page:
    study, a = findings.study, findings.shown
    how: list[Block] = [
        Text(method(a)), Text(DEFINITIONS),
        Text(f"Settling time: {study.settling_time_s:g} s. The intervals and the reference line "
             f"have a confidence of {a.confidence:g}."),
        factorial.factor_table(study),
    ]
    return Page(
        f"Which factor matters: {study.name}",
        _lead(study, a.runs, source.failed),
        [
            Section("Summary", "summary", factorial.summary(findings)),
            _figures(pictures(FIGURES, findings, drawn)),
            _tables(source, Section("Effects and model", "effects", factorial.tables(findings))),
            Section("Method", "method", how, folded=True),
            *source.worst,
            source.again,
        ],
        f"sblcosim {artifacts.software()['sblcosim']}",
    )


def _figures(pictures: Sequence[PagePicture]) -> Section:
    """The first figures, and the others small."""
    return Section("Figures", "figures", pictures[:2], folded(pictures[2:]))


def _tables(source: StudiedRuns, first: Section) -> Section:
    """All tables, folded under their headings."""
    parts = [
        first,
        Section("Design points, with shares of bad runs", "points", source.points),
        Section("Covariances", "covariances", _covariances(source)),
        Section("What is possible", "possible", source.possible),
    ]
    return Section(
        "Tables", "tables", parts=[replace(part, folded=True) for part in parts if part.blocks]
    )
