"""The part of a study's report for a space: Sobol' indices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from .. import artifacts
from ..analysis.space import figures as plots
from ..analysis.space.analysis import Sensitivity
from ..analysis.space.tables import INDICES
from ..answer import Extended
from ..catalogue import Figure, Job, by_name, jobs
from ..layout import fitted
from ..results.responses import defined
from ..study.study import Study
from ..words.numbers import interval, number
from .common import DEFINITIONS
from .page import PageTable, Text
from .parts import StudySections, pictures
from .two_level import factor_table

METHOD = (
    "Sobol' indices: the first-order index of a factor is the share of the variance that its value "
    "alone explains. The total index is the share that would remain if all other factors were "
    "known. The seed is a factor of the design, so its index is the share of chance. The "
    "estimators are Saltelli's (2010) and Jansen's. The intervals are Student's t, from the "
    "jackknife over base rows; those of totals are on the logarithmic scale. For a response with "
    "two values, such as lost, they come from the likelihood of its pairs of runs."
)


@dataclass(frozen=True, eq=False, repr=False)
class Indices(Extended):
    """The indices of a response, and of whether its receiver is lost, if some runs are.

    Attributes
    ----------
    study
        The study with the space.
    of
        The indices of each, the response first.
    """

    study: Study
    of: tuple[Sensitivity, ...]

    @property
    def main(self) -> Sensitivity:
        """The indices of the response."""
        return self.of[0]

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """All indices."""
        each = [one.tables["indices"] for one in self.of]
        return {"indices": pd.concat(each, ignore_index=True)}

    @property
    def figures(self) -> list[Job]:
        """Indices and scatter of the response, and of whether the receiver is lost."""
        return jobs(FIGURES, self)

    @property
    def remarks(self) -> list[str]:
        """Remarks that are needed to read the numbers, one line each."""
        return [line for one in self.of for line in one.remarks]

    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """Answers and tables in words."""
        shown = self.of if verbose else self.of[:1]
        said = fitted("\n".join(defined(self.main.response)), width)
        return "\n".join(filter(None, ("\n\n".join(one.text(width=width) for one in shown), said)))

    def to_json(self) -> dict[str, Any]:
        """All indices as plain data."""
        rows = artifacts.plain(INDICES.rows(self.tables["indices"]))
        return {**self.main.to_json(), "indices": rows}


def _figures(number: int, suffix: str) -> tuple[Figure[Indices], ...]:
    def data(indices: Indices) -> tuple[Sensitivity]:
        return (indices.of[number],)

    def has(indices: Indices) -> bool:
        return len(indices.of) > number

    return (
        Figure(
            f"indices{suffix}", plots.plot_indices, data,
            lambda f: f"Sobol' indices of {f.of[number].quantity}, with intervals: the share that "
            "a factor explains alone, and together with others. The seed is chance.",
            lambda f: f"Sobol' indices of {f.of[number].quantity}", has,
        ),
        Figure(
            f"scatter{suffix}", plots.plot_scatter, data,
            lambda f: f"Independent runs: {f.of[number].quantity} against each factor, with its "
            "conditional mean.",
            lambda f: f"Scatter of {f.of[number].quantity} against each factor", has,
        ),
    )  # fmt: skip


FIGURES: Mapping[str, Figure[Indices]] = by_name(*_figures(0, ""), *_figures(1, "_lost"))
"""The figures of a space."""


def parts(indices: Indices, drawn: Path | None) -> StudySections:
    """Sentences, figures and tables of a space; `drawn` is a folder with finished figures."""
    study, main = indices.study, indices.main
    return StudySections(
        f"What explains the error: {study.name}",
        main.answer,
        indices.remarks,
        pictures(FIGURES, indices, drawn),
        [_table(one) for one in indices.of],
        [Text(METHOD), *([] if study.model else [Text(DEFINITIONS)]), factor_table(study)],
        main.runs,
    )


def _table(sobol: Sensitivity) -> PageTable:
    rows = []
    for name, given in sobol.ranked().iterrows():
        row: Any = given
        rows.append((
            sobol.name_of(str(name)),
            number(row["first"]), interval(row["first_low"], row["first_high"], number),
            number(row["total"]), interval(row["total_low"], row["total_high"], number),
        ))  # fmt: skip
    head = ("Factor", "First order", "Interval", "Total", "Interval")
    return PageTable(f"Sobol' indices of {sobol.quantity}", head, rows)
