"""Result of processing a log: tables, figures, verdict, and a folder with all of them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import pandas as pd

from .. import artifacts, style
from ..answer import Answer
from ..catalogue import Figure, Job, by_name, jobs
from ..data.estimates import Estimates
from ..data.truth import Truth
from ..judge.without_truth import agreement, unknown_bearings
from ..lazy import Module
from ..logs.log import Log
from ..paths import folder as path_files
from ..paths.diver_path import DiverPath, of_estimates, of_truth
from ..scenario.labels import FIXES
from ..web import page
from ..words.lists import listed
from . import quality, text
from .columns import TABLES
from .pages import played

if TYPE_CHECKING:
    from ..scenario.scenario import Scenario
    from ..style import ThemeName

figures: Any = Module("sblcosim.processing.figures")
FIGURES: Mapping[str, Figure[Processed]] = by_name(
    Figure("map", figures.later("plot_map"), lambda it: it.on_map(False),
           condition=lambda it: bool(it.along(False)) or not it.made),
    Figure("map_own_axes", figures.later("plot_map"), lambda it: it.on_map(True),
           condition=lambda it: bool(it.along(True))),
    Figure("errors", figures.later("plot_errors"),
           lambda it: (it.log, {label: it.tracks[label] for label in it.along(it.truth_axes)}),
           condition=lambda it: it.truth is not None),
    Figure("residuals_by_time", figures.later("plot_residuals"),
           lambda it: (it.log, it.main, it.made[it.main], "time"),
           condition=lambda it: it.has_residuals),
    Figure("residuals_by_range", figures.later("plot_residuals"),
           lambda it: (it.log, it.main, it.made[it.main], "range"),
           condition=lambda it: it.has_residuals),
)  # fmt: skip
"""The figures in the folder of a processed log."""


def manifest_of(
    log: Log, scenario: Scenario, interval_ns: int, asked: Mapping[str, Any]
) -> dict[str, Any]:
    """What is known of a manifest before a receiver runs."""
    settings = scenario.model_dump(mode="json")
    known: dict[str, Any] = artifacts.plain({
        "processed": log.name,
        "log_sha256": log.sha256(),
        "interval_s": interval_ns / 1e9,
        "asked": asked,
        "scenario": {k: v for k, v in settings.items() if k != "target"},
    })
    return known


@dataclass(frozen=True, eq=False, repr=False)
class Processed(Answer):
    """A log, and what receivers made of it.

    Attributes
    ----------
    log
        The log, without ranges that are far too short or far too late.
    scenario
        The settings.
    made
        Estimates by label, in the times and coordinates of the log; devices' own positions, too.
    truth
        The truth on the clock and in the frame of the log, or None.
    restarts
        Number of restarts, by label.
    failures
        Messages of receivers that failed, by label.
    origins
        Origin of each receiver.
    interval_ns
        Time between the updates of the receivers [ns]; 0 without any.
    said
        Remarks: where settings are from, how a truth was aligned, …
    doubts
        What speaks against the track of the smoother.
    asked
        What was asked for: labels of receivers, and whether to smooth.
    """

    document = "process"
    columns = MappingProxyType(TABLES)

    log: Log
    scenario: Scenario
    made: Mapping[str, Estimates]
    truth: Truth | None = None
    restarts: Mapping[str, int] = field(default_factory=dict)
    failures: Mapping[str, str] = field(default_factory=dict)
    origins: Mapping[str, Any] = field(default_factory=dict)
    interval_ns: int = 0
    said: Sequence[str] = ()
    doubts: Sequence[str] = ()
    asked: Mapping[str, Any] = field(default_factory=dict)

    @property
    def main(self) -> str:
        """Label of the first receiver with estimates; empty if there is none."""
        return next((label for label, own in self.made.items() if len(own)), "")

    @property
    def has_residuals(self) -> bool:
        """Whether there are ranges to compare the estimates with."""
        there = bool(self.main) and len(self.log.receptions) > 0
        return there and self.main in self.along(self.log.in_own_axes(""))

    @property
    def truth_axes(self) -> bool:
        """Whether the truth is along axes of its own: those of the beacons."""
        return self.log.in_own_axes("")

    def along(self, own_axes: bool) -> dict[str, Estimates]:
        """The estimates along axes of their own, or those along north and east, by label."""
        return {label: own for label, own in self.made.items()
                if self.log.in_own_axes(label) == own_axes}

    def on_map(self, own_axes: bool) -> tuple[Any, ...]:
        """Log, tracks and truth of a map with these axes."""
        tracks = {label: self.tracks[label] for label in self.along(own_axes)}
        return self.log, tracks, self.truth if own_axes == self.truth_axes else None

    def _truth_for(self, label: str) -> Truth | None:
        """The truth, if an estimate is along the same axes."""
        return self.truth if self.log.in_own_axes(label) == self.truth_axes else None

    @cached_property
    def tracks(self) -> dict[str, pd.DataFrame]:
        """The estimates of each receiver, as tables."""
        return {
            label: quality.table_of(
                self.log, own, self._truth_for(label),
                None if self.log.in_own_axes(label) else self.log.meta.place,
            )
            for label, own in self.made.items()
        }

    @cached_property
    def receivers(self) -> pd.DataFrame:
        """Errors, claims and availability of each receiver, see `RECEIVERS` in `columns`."""
        rows = {}
        for label, own in self.made.items():
            rows[label] = quality.row_of(self.log, own, self._truth_for(label))
            if label in self.restarts:
                rows[label]["restarts"] = self.restarts[label]
        for label, message in self.failures.items():
            rows.setdefault(label, {"estimates": 0})["failure"] = message
        table = pd.DataFrame.from_dict(rows, orient="index")
        known = [name for name in TABLES["receivers"].names if name in table]
        whole = {n: "Int64" for n in ("estimates", "judged", "restarts") if n in table}
        return table[known].astype(whole).rename_axis("receiver")

    @cached_property
    def residuals(self) -> pd.DataFrame:
        """Residuals by receiver and beacon, see `RESIDUALS` in `columns`."""
        return quality.residuals(self.log, self.along(self.log.in_own_axes("")))

    @cached_property
    def agreement(self) -> pd.DataFrame:
        """Distances between receivers along the same axes, see `AGREEMENT` in `columns`."""
        both = [agreement(self.along(own_axes)) for own_axes in (False, True)]
        return pd.concat([table for table in both if len(table)] or both[:1])

    @property
    def title(self) -> str:
        """Title of the log, or its name."""
        return self.log.meta.title or self.log.name

    @property
    def answer(self) -> str:
        """A verdict for each receiver, one line each."""
        return "\n".join(text.verdicts(self))

    @cached_property
    def estimates(self) -> pd.DataFrame:
        """The estimates of all receivers, a row for each; the columns are those of `tracks`."""
        each = [table.assign(receiver=label) for label, table in self.tracks.items()]
        if not each:
            return pd.DataFrame({"receiver": pd.Series(dtype=str)})
        estimates = pd.concat(each, ignore_index=True)
        estimates.insert(0, "receiver", estimates.pop("receiver"))
        return estimates

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The numbers, by the names of their files."""
        tables = {"receivers": self.receivers, "residuals": self.residuals,
                  "agreement": self.agreement}
        return {
            "estimates": self.estimates,
            **{name: table.reset_index() for name, table in tables.items() if len(table)},
        }

    @property
    def figures(self) -> list[Job]:
        """The figures."""
        return jobs(FIGURES, self)

    @property
    def remarks(self) -> list[str]:
        """What was found in the log, where settings are from, and how the truth was aligned."""
        own = (*self.log.remarks, *self.said, *self._apart(), *self._unjudged())
        return [*self.log.counted(), *own, *unknown_bearings(self.made)]

    def _apart(self) -> list[str]:
        """A remark on what is not compared, as its axes differ."""
        here, own = self.along(False), self.along(True)
        if here and own:
            words = f"{', '.join(own)} (forward, starboard) and {', '.join(here)} (north, east)"
            return [f"{words} are not compared, and not on one map: their axes differ"]
        place = self.log.meta.place
        return ["there are no files for maps: no position is along north and east"] if (
            own and place is not None) else []

    def _unjudged(self) -> list[str]:
        """A remark on a truth that is known for less than nine in ten of the estimates."""
        if "judged" not in self.receivers:
            return []
        counts = self.receivers[["judged", "estimates"]].dropna()
        few = [
            f"{n:,} of {m:,} of {label}" for label, n, m in counts.itertuples() if n < 0.9 * m
        ]
        return [f"errors are of the estimates whose truth is known: {listed(few)}"] if few else []

    @property
    def problems(self) -> list[str]:
        """A line for each receiver that failed or has no estimate."""
        return [*self.failures.values()] + [
            f"{label}: must give at least one estimate, got none"
            for label, own in self.made.items() if not len(own) and label != "raw"
        ]

    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """A verdict for each receiver, then residuals and remarks.

        Residuals of one filter are told in detail, those of several side by side.

        Parameters
        ----------
        verbose
            Tell the residuals of all receivers in detail, and the distances between them.
        width
            Columns to fit into; None: sentences are not wrapped.
        """
        return text.of_log(self, verbose, width)

    def to_json(self) -> dict[str, Any]:
        """The tables except the estimates, and the remarks."""
        rows = {
            name: [] if table.empty else self.columns[name].rows(table)
            for name, table in (("receivers", self.receivers), ("residuals", self.residuals),
                                ("agreement", self.agreement))
        }
        named = {
            "receivers": dict(zip(self.receivers.index, rows["receivers"], strict=True)),
            "residuals": _nested(self.residuals.index, rows["residuals"]),
            "agreement": _nested(self.agreement.index, rows["agreement"]),
        }
        found: dict[str, Any] = artifacts.plain({
            "log": self.log.name, "dimension": self.log.meta.dimension,
            "beacons": [*self.log.beacons], "ranges": len(self.log.receptions),
            "duration_s": (self.log.stop_ns - self.log.start_ns) / 1e9,
            "has_truth": self.truth is not None, "remarks": self.remarks,
            "doubts": [*self.doubts], **named,
        })
        return found

    def manifest(self) -> dict[str, Any]:
        """What was processed, and how, as plain data."""
        about = manifest_of(self.log, self.scenario, self.interval_ns, self.asked)
        found: dict[str, Any] = artifacts.plain({
            "receivers": [{"label": name, **self.origins.get(name, {})} for name in self.made],
            "remarks": self.remarks,
        })
        return about | found

    @property
    def paths(self) -> list[DiverPath]:
        """The true path, if it is known, and those of all estimates.

        Without those along axes of their own, if there are others.
        """
        here = self.along(False)
        own = [
            of_estimates(label, it, "fix" if label in FIXES else "filter")
            for label, it in (here or self.made).items()
        ]
        known = self.truth is not None and (not here or not self.truth_axes)
        return [*([of_truth(self.truth)] if known and self.truth is not None else []), *own]

    def save(
        self, directory: str | Path, *, figures: bool = True, theme: ThemeName = "light",
        other: artifacts.Other = "refuse", trajectories: str | Collection[str] = (),
        replay: bool = False,
    ) -> Path:
        """Like `Answer.save`, with the paths for maps, if the log has an origin on Earth.

        Parameters
        ----------
        replay
            Whether to add a page that plays the log back, ``replay.html``; see `replay`.
        trajectories
            Files of the paths to add, some of ``"tum"`` and ``"mcap"``; see
            `sblcosim.paths.folder.write`.
        """
        style.named(theme)
        wanted = path_files.check(trajectories)
        with artifacts.draft(directory, self.manifest(), other) as draft:
            self.write(draft.folder, theme, figures)
            if replay:
                page.write(played(self), draft.folder / page.NAME)
            place = self.log.meta.place if self.along(False) else None
            path_files.write(
                draft.folder, self.title, self.paths, place, trajectories=wanted,
                dated=self.log.dated,
            )
        return draft.saved

    def replay(self, file: str | Path) -> Path:
        """Write the log as one HTML file that plays it back, without a network.

        It shows what `sblcosim.Result.replay` does, as far as the log has it: where beacons last
        said that they were, the estimates, and the truth if there is one.

        Parameters
        ----------
        file
            The file to write, ``.html``. It appears when it is complete.

        Raises
        ------
        ConfigurationError
            The file cannot be written.
        """
        return page.write(played(self), file)

    def write(self, folder: Path, theme: ThemeName = "light", figures: bool = True) -> None:
        """Write tables, figures and the settings into an existing folder."""
        super().write(folder, theme, figures)
        settings = self.scenario.dump_toml(folder, everything=False)  # for other receivers, too
        (folder / "scenario.toml").write_text(settings, "utf-8")

    def _gist(self) -> str:
        return f"of {self.log.name}: {', '.join(self.made)}"


def _nested(index: pd.Index, rows: Sequence[Any]) -> dict[str, Any]:
    nested: dict[str, Any] = {}
    for (first, second), row in zip(index, rows, strict=True):
        nested.setdefault(first, {})[second] = row
    return nested

