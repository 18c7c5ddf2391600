"""Many runs of a scenario: how its receivers do on average, a typical run and the worst one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from sblcosim.fmus.stopping import interruptible

from .. import api, artifacts, style
from ..errors import ConfigurationError
from ..layout import fitted
from ..packages.read import is_package
from ..results.definitions import LOST
from ..results.result import Result
from ..scenario.files import naming_files
from ..scenario.scenario import Receivers, Scenario, load
from ..shown import Shown, page, verbatim
from ..simulation.process import patient
from ..study.kept import Kept
from ..words.numbers import measured
from . import tournament_words
from .evaluation import PERCENTILE, receivers_in
from .tournament import RESPONSE, Tournament, compare, figures

if TYPE_CHECKING:
    from ..scenario.overrides import Changes

TYPICAL, WORST = "typical", "worst"
"""The runs that are drawn, and the names of their folders."""


@dataclass(frozen=True, eq=False, repr=False)
class Many(Shown):
    """Many runs of a scenario. Made by `run_many`.

    Attributes
    ----------
    runs
        All of them: tables, and statistics of each receiver.
    drawn
        The ``typical`` run, in which the RMS total error of the first receiver is the median of its
        runs (of an even number, the lower one), and the ``worst`` one, in which it is largest.
        Empty if that receiver has failed in all runs.
    drawn_seeds
        Their seeds.
    """

    runs: Tournament
    drawn: Mapping[str, Result]
    drawn_seeds: Mapping[str, int]

    @property
    def scenario_name(self) -> str:
        """Name of the scenario."""
        return self.runs.places[0]

    @property
    def receivers(self) -> list[str]:
        """Labels of the receivers, in the order that was asked for."""
        return receivers_in(self.runs.table)

    def rms_m(self, which: str) -> float:
        """RMS total error of the first receiver in a run that is drawn [m]."""
        table = self.runs.table
        row = table[table["seed"] == self.drawn_seeds[which]].iloc[0]
        return float(row[f"{self.receivers[0]}.{RESPONSE}"])

    @property
    def answer(self) -> str:
        """A line for each receiver: its errors, how often it was lost, and what is drawn."""
        it, place, lines = self.runs, self.scenario_name, []
        for receiver in self.receivers:
            row, beside = (it.level(place, receiver, name) for name in (None, PERCENTILE))
            runs = row["runs"]
            if row["failed"] == runs:
                lines.append(f"{receiver}: no estimate in any of {runs} runs")
                continue
            rms = measured(row["rms_over_runs"], "m")
            within = measured(beside["mean"], "m")
            lines.append(
                f"{receiver}: {rms} RMS, {within} in 95 % of the time, lost in {row['lost']} of "
                f"{runs} runs" + (f", failed in {row['failed']}" if row["failed"] else "")
            )
        told = [
            f"{which}: seed {seed} ({measured(self.rms_m(which), 'm')})"
            for which, seed in self.drawn_seeds.items()
        ]
        return "\n".join(["; ".join([lines[0], *told]), *lines[1:]])

    @property
    def problems(self) -> list[str]:
        """A line for each receiver that has failed in all runs."""
        return self.runs.problems

    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """The answer, then means and spread of each receiver.

        Parameters
        ----------
        verbose
            With what is said of each covariance.
        width
            Columns to fit into; None: sentences are not wrapped.
        """
        it, place = self.runs, self.scenario_name
        lines = [self.answer, ""]
        lines += [f"{place}: {it.settings['runs']} runs, seeds from {it.settings['seed']}"]
        lines += [*tournament_words.levels(it, place, width)]
        lines += ["", *tournament_words.spreads(it, place, width)]
        start = len(lines)
        for receiver in self.receivers:
            lines += tournament_words.beside(it, place, receiver)
            if verbose:
                said = it.level(place, receiver)["covariance_words"]
                lines.append(f"{receiver}: covariance {said}")
        lines += tournament_words.unbounded(it)
        rows = [it.level(place, receiver) for receiver in self.receivers]
        if verbose or any(row["lost"] for row in rows):
            lines.append(LOST)
        lines.append(tournament_words.WITHIN)
        lines.insert(start, "")
        return fitted("\n".join(lines), width)

    def save(
        self,
        directory: str | Path,
        *,
        drawn: bool = True,
        theme: style.ThemeName = "light",
        other: artifacts.Other = "refuse",
    ) -> Path:
        """Write the tables, and the typical and the worst run into folders of that name.

        See `sblcosim.Result.save`.
        """
        style.named(theme)
        with artifacts.draft(directory, self.manifest(), other) as draft:
            artifacts.write_table(self.runs.table, draft.folder, "runs")
            artifacts.write_table(self.runs.levels, draft.folder, "levels")
            if drawn:
                figures.job(self.runs, "runs", False).save(draft.folder, theme)
            for which, result in self.drawn.items():
                result.save(draft.folder / which, figures=drawn, theme=theme)
        return draft.saved

    def manifest(self) -> dict[str, Any]:
        """What was run, as plain data."""
        plain: dict[str, Any] = artifacts.plain({"runs": self.runs.settings})
        return plain

    def to_json(self) -> dict[str, Any]:
        """Everything as plain data; missing numbers are None."""
        plain: dict[str, Any] = artifacts.plain({
            "scenario_name": self.scenario_name,
            "answer": self.answer,
            "runs": self.runs.settings["runs"],
            "seed": self.runs.settings["seed"],
            "receivers": self.receivers,
            "levels": self.runs.levels.to_dict(orient="records"),
            "drawn": {
                which: {"seed": seed, "rms_m": self.rms_m(which)}
                for which, seed in self.drawn_seeds.items()
            },
        })  # fmt: skip
        return plain

    def __str__(self) -> str:
        return self.text()

    def _gist(self) -> str:
        return f"of {self.scenario_name}: {self.runs.settings['runs']} runs"

    def _repr_html_(self) -> str:
        return page(self.scenario_name, verbatim(str(self)))


@interruptible
@naming_files
@patient
def run_many(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    receiver: Receivers = (),
    overrides: Changes = (),
    *,
    runs: int,
    workers: int | None = None,
    master: str | None = None,
    step_timeout: float | None = None,
    progress: Callable[[float], None] | None = None,
    keep: Kept | None = None,
) -> Many:
    """Simulate a scenario many times, each with a seed of its own, that of the scenario first.

    Parameters
    ----------
    scenario, receiver, overrides, master, step_timeout
        As for `sblcosim.run`; no package, and receivers without labels.
    runs
        Number of runs, at least 2.
    workers
        Threads; default: all cores.
    progress
        Called at intervals with the completed share, 0 to 1.
    keep
        Where finished runs are kept, which are not done again; None: nothing is written.

    Raises
    ------
    ConfigurationError
        The scenario or an argument is invalid.
    FmuError
        An FMU cannot be built or is broken.
    """
    if is_package(scenario):
        raise ConfigurationError(
            "runs: must be left out for an SSP package, which has seeds of its own, got "
            f"{runs!r}"
        )
    settled = load(scenario, overrides)
    comparison = compare(
        settled, receiver, runs=runs, seed=settled.seed,
        workers=workers, master=master, step_timeout=step_timeout, timed=False, keep=keep,
        progress=None if progress is None else lambda share, _: progress(0.9 * share),
    )  # fmt: skip
    seeds = _chosen(comparison.table, receivers_in(comparison.table)[0])
    drawn = {
        which: api.run(
            settled.override({"seed": seed}), receiver, master=master, step_timeout=step_timeout
        )
        for which, seed in seeds.items()
    }
    if progress is not None:
        progress(1.0)
    return Many(comparison, drawn, seeds)


def _chosen(table: pd.DataFrame, receiver: str) -> dict[str, int]:
    """Seeds of the typical and of the worst run."""
    y = table[f"{receiver}.{RESPONSE}"].to_numpy(np.float64)
    order = np.argsort(y, kind="stable")[: int(np.isfinite(y).sum())]
    if not len(order):
        return {}
    seeds = table["seed"].to_numpy()
    return {TYPICAL: int(seeds[order[(len(order) - 1) // 2]]), WORST: int(seeds[order[-1]])}
