"""The part of a study's report for a sweep, or for a study without factors: means."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd

from .. import artifacts, layout
from ..analysis.common import columns
from ..analysis.means import analysis as sweep
from ..analysis.means.tables import MEANS
from ..answer import Answer
from ..catalogue import Figure, Job, by_name, jobs
from ..results.responses import defined, unit_of
from ..study.study import Study
from ..words.numbers import interval, number, quantity
from .common import DEFINITIONS
from .page import Block, PageTable, Text
from .parts import StudySections, pictures
from .two_level import factor_table


@dataclass(frozen=True, eq=False, repr=False)
class Means(Answer):
    """The mean response at each level of a sweep, or of a study without factors.

    Attributes
    ----------
    response, unit, quantity
        Column of the table of runs, its unit, and its description.
    runs
        Number of runs that were analysed.
    table
        Table from `sblcosim.analysis.means.analysis.means`.
    sentence
        The answer.
    """

    columns = MappingProxyType({"means": MEANS})

    study: Study
    response: str
    unit: str
    quantity: str
    runs: int
    table: pd.DataFrame
    sentence: str

    @property
    def title(self) -> str:
        """Title of a page."""
        return f"What the runs say: {self.study.name}"

    @property
    def answer(self) -> str:
        """The answer, in a sentence or two."""
        return self.sentence

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The means."""
        return {"means": self.table}

    @property
    def figures(self) -> list[Job]:
        """The means at each level, if there are factors."""
        return jobs(FIGURES, self)

    @property
    def remarks(self) -> list[str]:
        """Definition of the response."""
        return [*defined(self.response)]

    def to_json(self) -> dict[str, Any]:
        """The means as plain data."""
        plain: dict[str, Any] = artifacts.plain({
            "response": self.response, "unit": self.unit, "answer": self.answer,
            "runs": int(self.table["runs"].sum()), "means": MEANS.rows(self.table),
        })  # fmt: skip
        return plain

    def manifest(self) -> dict[str, Any]:
        """The question: response and factors."""
        return {"analysis": {"response": self.response, "factors": list(self.study.factors)}}

    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """The answer, then the table; see `sblcosim.analysis.two_level.analysis.Factorial.text`."""
        shown = self.table.replace({"factor": self.study.labels})
        shown = shown if self.study.factors else shown.drop(columns=["factor", "value"])
        rows = [[x if isinstance(x, str) else f"{x:.4g}" for x in row] for row in shown.to_numpy()]
        head = [MEANS.head(str(name)) for name in shown.columns]
        lines = [self.answer, "", *layout.table(rows, width, head, range(1, len(head))),
                 *self.remarks]
        return layout.fitted("\n".join(lines), width)


def find(study: Study, table: pd.DataFrame, column: str) -> Means:
    """The means of a column of a table of runs."""
    what, unit = columns.words(column, table), unit_of(column)
    runs = columns.in_choices(study, table, column)
    made = sweep.means(runs, list(study.factors), column, study.sweep_base)
    count = int(np.isfinite(runs[column]).sum())
    return Means(
        study, column, unit, what, count, made, _answer(study, made, what, unit)
    )


def _answer(study: Study, means: pd.DataFrame, what: str, unit: str) -> str:
    unit = f" {unit}" if unit else ""
    if not study.factors:
        row = means.iloc[0]
        return (
            f"Mean {what} {number(row['mean'], 4)}{unit}, "
            f"{interval(row['low'], row['high'], number)}{unit}. The study has no factors, so "
            "there are no effects to analyse."
        )
    parts = []
    for name in study.factors:
        mine = means[means["factor"] == name].reset_index(drop=True)
        best, worst = mine.iloc[mine["mean"].argmin()], mine.iloc[mine["mean"].argmax()]
        own = study.units[name]
        ends = [quantity(row["value"], own) for row in (best, worst)]
        parts.append(
            f"with {study.labels[name]} it is lowest, {number(best['mean'])}{unit}, at {ends[0]} "
            f"and highest, {number(worst['mean'])}{unit}, at {ends[1]}"
        )
    return (
        f"Mean {what}, one factor at a time: {'; '.join(parts)}. This is a sweep and not a "
        "factorial design, so it has no interactions and no effects to test."
    )


def _shared(study: Study) -> str:
    """A note on the rows of the means that share their runs."""
    base = dict(zip(study.factors, study.sweep_base, strict=False))
    own = [name for name, value in base.items() if value in study.factors[name].levels]
    if len(own) < 2:
        return ""
    rows = ", ".join(
        f"{study.labels[name]} {quantity(float(base[name]), study.units[name])}" for name in own
    )
    return f"These rows share their runs, with all factors at the scenario's own values: {rows}."


def _shown(means: Means) -> tuple[pd.DataFrame, str, Mapping[str, str]]:
    """Data of the figure: the table with labels, the quantity with its unit, and units."""
    study = means.study
    own = f" [{means.unit}]" if means.unit else ""
    units = {study.labels[name]: study.units[name] for name in study.factors}
    return means.table.replace({"factor": study.labels}), f"{means.quantity}{own}", units


def _caption(means: Means) -> str:
    return f"Mean {means.quantity} at each level. Bars are the intervals of the means."


FIGURES: Mapping[str, Figure[Means]] = by_name(
    Figure(
        "means", sweep.plot_means, _shown, _caption, _caption,
        lambda means: bool(means.study.factors),
    ),
)  # fmt: skip
"""The figures in the report of a sweep."""


def parts(means: Means, drawn: Path | None) -> StudySections:
    """Sentences, figures and tables of means; `drawn` is a folder with finished figures."""
    study, unit = means.study, means.unit
    own = f" [{unit}]" if unit else ""
    rows = [
        (*_level(study, row), number(row["runs"], 6),
         number(row["mean"], 4), interval(row["low"], row["high"], number), number(row["std"]))
        for _, row in means.table.iterrows()
    ]
    head = (*(("Factor", "Level") if study.factors else ()), "Runs", f"Mean{own}",
            f"95 % interval{own}", f"Standard deviation{own}")
    title = f"{means.quantity[0].upper()}{means.quantity[1:]}"
    return StudySections(
        means.title, means.answer, (),
        pictures(FIGURES, means, drawn),
        [PageTable(title, head, rows, (), _shared(study))],
        _method(study), means.runs,
        "Means at each level" if study.factors else "Mean",
    )  # fmt: skip


def _level(study: Study, row: pd.Series) -> tuple[str, ...]:
    """Factor and level of a row of the means; nothing without factors."""
    if not study.factors:
        return ()
    name = row["factor"]
    return study.labels[name], quantity(row["value"], study.units[name])


def _method(study: Study) -> list[Block]:
    at = " at each level, the other factors at the scenario's own values" if study.factors else ""
    blocks: list[Block] = [
        Text(f"Means over the runs{at}; the intervals are Student's."), Text(DEFINITIONS),
        Text(f"Settling time: {study.settling_time_s:g} s."),
    ]
    return [*blocks, factor_table(study)] if study.factors else blocks
