"""Many runs of a scenario: averages for its receivers, a typical run and the worst one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from ... import artifacts, style
from ...answer import Answer
from ...catalogue import Job
from ...judge.definitions import LOST, MISLEADING
from ...layout import fitted
from ...results.data_sheet import NOTE as SHEET
from ...results.result import Result
from ...words.numbers import measured
from ..common.evaluation import receivers_in
from ..common.tables import LEVELS
from ..tournament import sentences
from ..tournament.result import RESPONSE, Tournament, drawings
from . import data_sheet

if TYPE_CHECKING:
    import pandas as pd

TYPICAL, WORST = "typical", "worst"
"""The selected runs, and the names of their folders."""


def _misleading(row: Any) -> str:
    """In how many runs a receiver was misleading, with the interval of the share; empty without a
    covariance."""
    known = row["misleading_known"]
    if not known:
        return ""
    of = "" if known == row["runs"] else f" of {known}"
    return f", misleading in {row['misleading']}{of} ({sentences.share_of_misleading(row)} %)"


@dataclass(frozen=True, eq=False, repr=False)
class Many(Answer):
    """Many runs of a scenario. Made by `run_many`.

    Attributes
    ----------
    runs
        All runs: tables, and statistics of each receiver.
    drawn
        The ``typical`` run, whose RMS total error of the first receiver is the median over the runs
        (the lower one for an even number), and the ``worst`` run, where it is largest. Empty if
        that receiver failed in all runs.
    drawn_seeds
        Seeds of these runs.
    """

    document = "runs"
    columns = MappingProxyType({"levels": LEVELS})

    runs: Tournament
    drawn: Mapping[str, Result]
    drawn_seeds: Mapping[str, int]

    @property
    def scenario_name(self) -> str:
        """Name of the scenario."""
        return self.runs.places[0]

    @property
    def receivers(self) -> list[str]:
        """Labels of the receivers, in the requested order."""
        return receivers_in(self.runs.table)

    @property
    def title(self) -> str:
        """Of a page."""
        return self.scenario_name

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """All runs, and their evaluation."""
        return {"runs": self.runs.table, "levels": self.runs.levels}

    @property
    def figures(self) -> list[Job]:
        """Means of the receivers."""
        return [drawings.job(self.runs, "runs", False)]

    @property
    def remarks(self) -> list[str]:
        """Remarks that are needed to read the answer, one line each."""
        it, lines = self.runs, list[str]()
        for receiver in self.receivers:
            lines += sentences.beside(it, self.scenario_name, receiver)
            lines += sentences.lost(it, self.scenario_name, receiver)
        bounds = [*sentences.unbounded_means(it), *sentences.unbounded(it)]
        return [*lines, *sentences.start(it), *bounds, *self._unsaid]

    def rms_m(self, which: str) -> float:
        """RMS total error of the first receiver in a selected run [m]."""
        table = self.runs.table
        row = table[table["seed"] == self.drawn_seeds[which]].iloc[0]
        return float(row[f"{self.receivers[0]}.{RESPONSE}"])

    @cached_property
    def within_m(self) -> dict[str, float]:
        """Radius that holds 95 % of the estimates of all runs [m], by receiver; infinite where
        more than 5 % of the runs have none."""
        it = self.runs
        return {
            name: data_sheet.radius_of(data_sheet.percentiles_of(it, name), it.settings["seed"])[0]
            for name in self.receivers
        }

    @property
    def answer(self) -> str:
        """A line for each receiver: its errors, how often it was lost and misleading, and the
        selected runs."""
        it, place, lines = self.runs, self.scenario_name, []
        for receiver in self.receivers:
            row = it.level(place, receiver)
            runs = row["runs"]
            if row["failed"] == runs:
                lines.append(f"{receiver}: no estimate in any of {runs} runs")
                continue
            rms = measured(row["rms_over_runs"], "m")
            radius = self.within_m[receiver]
            within = f", 95 % within {measured(radius, 'm')}" if isfinite(radius) else ""
            lines.append(
                f"{receiver}: {rms} RMS{within}, lost in {row['lost']} of {runs} runs"
                f"{_misleading(row)}"
                + (f", failed in {row['failed']}" if row["failed"] else "")
            )
        told = [
            f"{which}: seed {seed} ({measured(self.rms_m(which), 'm')})"
            for which, seed in self.drawn_seeds.items()
        ]
        return "\n".join(["; ".join([lines[0], *told]), *lines[1:]])

    @cached_property
    def data_sheet(self) -> list[str]:
        """A sentence for a data sheet for each receiver, or why there is none."""
        return [*data_sheet.sentences(self.runs, self.receivers, [*self.drawn.values()])]

    @property
    def _unsaid(self) -> list[str]:
        """Why there is no such sentence."""
        return [line for line in self.data_sheet if line.startswith("no ")]

    @property
    def problems(self) -> list[str]:
        """A line for each receiver that failed in all runs."""
        return self.runs.problems

    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """The answer, a sentence for a data sheet, and a small table of the receivers.

        Parameters
        ----------
        verbose
            Add the sentence for a data sheet of every receiver, the spread over the runs, the
            verdict on each covariance, and explanations of these numbers.
        width
            Columns to fit into; None: sentences are not wrapped.
        """
        it, place = self.runs, self.scenario_name
        sheet = [line for line in self.data_sheet if line not in self._unsaid]
        shown = sheet if verbose else sheet[:1]
        lines = [self.answer, *([""] if sheet else []), *shown, ""]
        lines += [f"{place}: {it.settings['runs']} runs, seeds from {it.settings['seed']}"]
        told = () if verbose else (sentences.MISLEADING_COLUMN,)  # the answer has it
        lines += [*sentences.levels(it, place, width, told)]
        if verbose:
            lines += ["", *sentences.spreads(it, place, width), "", *self._verbose_notes(sheet)]
        else:
            lines += self._notes()
        return fitted("\n".join(lines), width)

    def _notes(self) -> Iterator[str]:
        """What is needed to read the answer and the small table; it has the lost runs."""
        it, place = self.runs, self.scenario_name
        for receiver in self.receivers:
            yield from sentences.beside(it, place, receiver)
        yield from (*sentences.start(it), *sentences.unbounded(it), *self._unsaid)
        if any(it.level(place, receiver)["lost"] for receiver in self.receivers):
            yield LOST

    def _verbose_notes(self, sheet: Sequence[str]) -> Iterator[str]:
        yield from self.remarks
        for receiver in self.receivers:
            said = self.runs.level(self.scenario_name, receiver)["covariance_words"]
            yield f"{receiver}: covariance {said}"
        if sheet:
            yield SHEET
        yield from (LOST, MISLEADING, sentences.WITHIN)

    def save(
        self,
        directory: str | Path,
        *,
        figures: bool = True,
        theme: style.ThemeName = "light",
        other: artifacts.Other = "refuse",
        replay: bool = False,
    ) -> Path:
        """Like `Answer.save`, with the typical and the worst run in separate folders.

        Parameters
        ----------
        replay
            Whether to add a page that plays it back to each of these runs; see
            `sblcosim.Result.replay`.
        """
        style.named(theme)
        with artifacts.draft(directory, self.manifest(), other) as draft:
            self.write(draft.folder, theme, figures, replay)
        return draft.saved

    def write(
        self, folder: Path, theme: style.ThemeName = "light", figures: bool = True,
        replay: bool = False,
    ) -> None:
        """Write tables, figures and the selected runs into an existing folder; see `save`."""
        super().write(folder, theme, figures)
        for which, result in self.drawn.items():
            result.save(folder / which, figures=figures, theme=theme, replay=replay)

    def manifest(self) -> dict[str, Any]:
        """What was run, as plain data."""
        plain: dict[str, Any] = artifacts.plain({"runs": self.runs.settings})
        return plain

    def to_json(self) -> dict[str, Any]:
        """Everything as plain data; missing numbers are None."""
        plain: dict[str, Any] = artifacts.plain({
            "scenario_name": self.scenario_name,
            "answer": self.answer,
            "within_m": self.within_m,
            "data_sheet": self.data_sheet,
            "runs": self.runs.settings["runs"],
            "seed": self.runs.settings["seed"],
            "receivers": self.receivers,
            "levels": LEVELS.rows(self.runs.levels),
            "drawn": {
                which: {"seed": seed, "rms_m": self.rms_m(which)}
                for which, seed in self.drawn_seeds.items()
            },
        })  # fmt: skip
        return plain

    def _gist(self) -> str:
        return f"of {self.scenario_name}: {self.runs.settings['runs']} runs"
