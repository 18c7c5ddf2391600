"""Receivers compared on the same noise: in a sentence, tables, a figure, a folder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import pandas as pd

from ... import artifacts, style
from ...answer import Answer
from ...catalogue import Job
from ...lazy import Module
from ...results.responses import RESPONSES, unit_of
from ...shown import Picture
from ..common.evaluation import ALL
from ..common.tables import DIFFERENCES, LEVELS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ...results.result import Result
    from ...style import ThemeName

words = Module("sblcosim.comparison.tournament.sentences")
drawings = Module("sblcosim.comparison.tournament.figures")

RESPONSE = "absolute_total_rms_m"
"""Response that is compared by default."""
WORST_PAGE = "worst.html"
"""Page in the folder of a comparison that plays back a run."""


def manifest_of(settings: Mapping[str, Any]) -> dict[str, Any]:
    """What is compared, as plain data."""
    plain: dict[str, Any] = artifacts.plain({"comparison": settings})
    return plain


@dataclass(frozen=True, eq=False, repr=False)
class Tournament(Answer):
    """Which receiver is better, where, by how much, and how certain that is. Made by `compare`.

    Attributes
    ----------
    settings
        Arguments: scenarios as they were run, receivers, ``runs``, ``seed``, ``settling_s``,
        ``response``, ``practical``, ``contamination``.
    receivers
        Labels, beginning with the smallest median.
    places
        Names of the scenarios, and `ALL` if there are several.
    table
        One row per scenario and run: ``scenario``, and the columns of a study's table.
    levels
        One row per place, receiver and response: the fields of
        `sblcosim.comparison.common.statistics.Level`, the number of ``lost`` runs with the 95 %
        interval of their share (Clopper and Pearson's; for one scenario), the verdict on the
        covariance (`sblcosim.judge.consistency`), and ``rms_over_runs`` (see
        `sblcosim.judge.over_runs`; NaN if the response is not an RMS).
    differences
        One row per place, response and pair of receivers: the fields of
        `sblcosim.comparison.common.statistics.Difference`, which hold at once for a response.
    update_s
        Time of an update [s] by scenario and receiver. It is measured on this machine and varies
        from time to time, so no file contains it. None if it cannot be measured.
    """

    document = "compare"
    columns = MappingProxyType({"levels": LEVELS, "differences": DIFFERENCES})

    settings: Mapping[str, Any]
    receivers: tuple[str, ...]
    places: tuple[str, ...]
    table: pd.DataFrame
    levels: pd.DataFrame
    differences: pd.DataFrame
    update_s: Mapping[str, Mapping[str, float | None]] = field(default_factory=dict)

    @property
    def response(self) -> str:
        """Column that is compared."""
        return str(self.settings["response"])

    @property
    def title(self) -> str:
        """Of a page."""
        return "Comparison"

    @property
    def answer(self) -> str:
        """Which receiver is best, in a sentence or two."""
        return str(words.answer(self))

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """All runs, and their evaluation."""
        return {"runs": self.table, "levels": self.levels, "differences": self.differences}

    @property
    def figures(self) -> list[Job]:
        """Means and paired differences."""
        return [drawings.job(self)]

    @property
    def remarks(self) -> list[str]:
        """Remarks that are needed to read the answer, one line each."""
        return [*words.notes(self)]

    @property
    def problems(self) -> list[str]:
        """A line for each receiver that failed in all runs of a scenario."""
        mine = self.levels[self.levels["response"] == self.response]
        silent = mine[(mine["failed"] == mine["runs"]) & (mine["scenario"] != ALL)]
        what = "give estimates" if self.response in RESPONSES else f"have a finite {self.response}"
        return [
            f"{row.receiver}: must {what} in {row.scenario}, got none in {row.runs} runs"
            for row in silent.itertuples()
        ]

    def level(self, place: str, receiver: str, response: str | None = None) -> Any:
        """A row of `levels`; by default of the response that is compared."""
        it = self.levels
        mine = (it["scenario"] == place) & (it["receiver"] == receiver)
        return it[mine & (it["response"] == (response or self.response))].iloc[0]

    def plot(self, axes: Sequence[Axes] | None = None, theme: ThemeName = "light") -> Picture:
        """Means and paired differences; see `figures.plot_tournament`."""
        return Picture(drawings.plot_tournament(*drawings.shown(self), axes, theme), axes)

    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """The answer, then the tables.

        Parameters
        ----------
        verbose
            Add all percentages and intervals, and explanations of the numbers.
        width
            Columns to fit into; None: sentences are not wrapped.
        """
        return str(words.text(self, verbose, width))

    def manifest(self) -> dict[str, Any]:
        """What was compared, as plain data."""
        return manifest_of(self.settings)

    def save(
        self, directory: str | Path, *, figures: bool = True, theme: ThemeName = "light",
        other: artifacts.Other = "refuse", worst: Result | None = None,
    ) -> Path:
        """Like `Answer.save`, with a page that plays a run back.

        Parameters
        ----------
        worst
            The run for ``worst.html``, from `sblcosim.comparison.tournament.worst.worst_run`.
        """
        style.named(theme)
        with artifacts.draft(directory, self.manifest(), other) as draft:
            self.write(draft.folder, theme, figures)
            if worst is not None:
                worst.replay(draft.folder / WORST_PAGE)
        return draft.saved

    def to_json(self) -> dict[str, Any]:
        """Answer and tables as plain data; missing numbers are None."""
        settings = {k: v for k, v in self.settings.items() if k not in ("scenarios", "receivers")}
        plain: dict[str, Any] = artifacts.plain(
            {
                "answer": self.answer,
                "scenarios": [place for place in self.places if place != ALL],
                "receivers": self.receivers,
                **settings,
                "unit": unit_of(self.response),
                "levels": LEVELS.rows(self.levels),
                "differences": DIFFERENCES.rows(self.differences),
                "update_s": self.update_s,
            }
        )
        return plain

    def _gist(self) -> str:
        return f"of {', '.join(self.receivers)}: {self.answer}"
