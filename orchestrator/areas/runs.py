"""The runs of cells, and what is kept of each: percentiles of its errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol, overload

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sblcosim.fmus.host.nanoseconds import nanoseconds

from ..errors import ConfigurationError, instance, shortened
from ..judge.pooling import PERCENTAGES
from ..results.responses import Percentile
from ..results.sums import responses
from ..scenario.scenario import Scenario, Source
from ..scenario.schema import SEED
from ..simulation.children.children import Children
from ..simulation.how import How
from ..study import parts, study
from ..study.batch import reduced
from ..study.campaign import Campaign, CampaignRun, prepare
from ..study.groups import PreparedPoint
from ..study.kept import Kept, sound
from ..study.runner import kept_together
from ..study.store import at_work

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

_LENGTHS = tuple(f"p{p}" for p in PERCENTAGES)
_TOGETHER = 100_000
"""Runs whose sums are in memory at a time."""


@dataclass(frozen=True, eq=False)
class CellRuns:
    """Some runs.

    Attributes
    ----------
    cell
        Index of each run's cell; (runs,).
    lengths
        Order statistics of the lengths of its errors [m], infinite without an estimate; (runs,
        len(PERCENTAGES)).
    lost
        Whether the run is lost, broken or without an estimate; (runs,).
    availability
        Share of the time with a valid estimate; (runs,).
    rms
        Root mean square of the lengths [m], NaN without an estimate; (runs,).
    """

    cell: Integers
    lengths: Floats
    lost: Flags
    availability: Floats
    rms: Floats

    def __add__(self, other: CellRuns) -> CellRuns:
        return CellRuns(*(
            np.concatenate([getattr(self, name), getattr(other, name)])
            for name in ("cell", "lengths", "lost", "availability", "rms")
        ))


class Whereabouts(Protocol):
    """Places of divers: the cells of an area, or distances from the platform."""

    @property
    def count(self) -> int:
        """Number of cells."""

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""

    @property
    def identity(self) -> tuple[object, ...]:
        """Data that identify the cells."""

    def placed(self, cell: Integers, replicate: Integers, seed: int) -> dict[str, Floats]:
        """Parameters of the target in some runs, by name; each (runs, …)."""


class Simulator:
    """Runs of a receiver in some cells; each run has its own seed.

    Parameters
    ----------
    scenario
        A scenario whose diver circles about the origin; see `motion.circling`.
    cells
        Places of the divers.
    error
        Kind of length, from `sblcosim.simulation.masters.lanes_driver.LENGTHS`.

    Attributes
    ----------
    receiver
        Label of the receiver.
    failures
        Messages of failed runs, each with their number.
    """

    def __init__(
        self, scenario: Scenario, receiver: Source | None, cells: Whereabouts, error: str,
        settling_s: float,
    ) -> None:
        self.cells, self.base, self.error = cells, scenario, error
        definition = study.load(
            {
                "name": "map", "scenario": scenario.given(), "settling_time_s": settling_s,
                "design": {"kind": "single"},
            },
            responses=[Percentile(error, p) for p in PERCENTAGES],
            receivers=() if receiver is None else (receiver,),
        )
        self.campaign = prepare(definition)
        if len(self.campaign.receivers) != 1:
            raise ConfigurationError(
                "map receiver: must be one that a study can have, got none beside the raw fix"
            )
        (self.receiver,) = self.campaign.receivers
        self.failures: dict[str, int] = {}

    @property
    def in_lanes(self) -> bool:
        """Whether many runs are executed side by side."""
        return self.campaign.groups[0].in_lanes

    def seeds(self, cell: Integers, replicate: Integers) -> Integers:
        """Seed of each run; replicates count from 0."""
        seeds = self.base.seed + replicate * self.cells.count + cell
        last = int(seeds.max(initial=0))
        if SEED.max is not None and last > SEED.max:
            raise ConfigurationError(
                f"map seed: must leave room for all runs below {int(SEED.max)}, got "
                f"{self.base.seed} with {last - self.base.seed + 1} seeds"
            )
        return seeds

    def bearings(self, cell: Integers, replicate: Integers) -> Floats:
        """Starting bearing of each run on its circle [rad]."""
        found = np.empty(len(cell))
        for number in np.unique(replicate).tolist():
            draw = np.random.Generator(np.random.Philox(key=[self.base.seed, number]))
            some = replicate == number
            found[some] = draw.uniform(-np.pi, np.pi, self.cells.count)[cell[some]]
        return found

    def run(
        self,
        cell: Integers,
        replicate: Integers,
        how: How,
        keep: Kept | None = None,
    ) -> CellRuns:
        """Simulate runs; the result depends neither on their order nor on the workers.

        Parameters
        ----------
        keep
            Folder of finished runs, which are not repeated; None: nothing is written.

        Raises
        ------
        ConfigurationError
            All runs failed.
        """
        seeds = self.seeds(cell, replicate)
        folder = None if keep is None else keep.of(*self._identity())
        with (
            Children(patience_s=self.campaign.step_timeout) as children,
            nullcontext() if folder is None else at_work(folder),
        ):
            tables = [] if folder is None else _kept(folder, seeds)
            missing = np.flatnonzero(~np.isin(seeds, tables[0]["seed"] if tables else ()))
            size = min(_TOGETHER, kept_together(self.campaign, how))
            for first in range(0, len(missing), size):
                some = missing[first : first + size]

                def told(part: float, done: int = first, count: int = len(some)) -> None:
                    how.tell((done + part * count) / len(missing))

                own = replace(how, progress=told)
                rows = self._part(cell[some], replicate[some], own, children)
                if folder is not None:
                    parts.write(folder, self.campaign, _runs(seeds[some]), rows)
                tables.append(rows)
        return self._sample(pd.concat(tables, ignore_index=True).set_index("seed").loc[seeds])

    def _identity(self) -> tuple[object, ...]:
        """Everything that decides a run, except its cell and its number."""
        return (self.campaign.digest, self.base.seed, *self.cells.identity, "rms")

    def _part(
        self,
        cell: Integers,
        replicate: Integers,
        how: How,
        children: Children,
    ) -> pd.DataFrame:
        """A row for each run."""
        values: dict[str, Floats] = {
            **self.cells.placed(cell, replicate, self.base.seed),
            "target.heading": self.bearings(cell, replicate),
        }
        group = replace(
            self.campaign.groups[0], values=values, places={i: i for i in range(len(cell))}
        )
        points = _Points(self.campaign.points[0], values)
        campaign: Campaign = replace(self.campaign, points=points, groups=(group,))
        seeds = self.seeds(cell, replicate)
        runs = _runs(seeds)
        sums, extra, errors = reduced(campaign, group, runs, how, children)
        judged = responses(sums[:, 0], group.plan.stop_ns - group.plan.start_ns)
        lost = (judged["lost"] | judged["broken"] | (judged["estimates"] == 0)).to_numpy(bool)
        lengths = np.where(np.isnan(extra[:, 0]), np.inf, extra[:, 0])
        return pd.DataFrame({
            "point": cell + 1, "replicate": replicate + 1, "seed": seeds,
            "run_id": [run.run_id for run in runs], "error": np.array(errors, object),
            "lost": lost, "availability": judged["availability"].to_numpy(float),
            "rms": _rms(judged, self.error), **dict(zip(_LENGTHS, lengths.T, strict=True)),
        })  # fmt: skip

    def _sample(self, rows: pd.DataFrame) -> CellRuns:
        """The recorded numbers of some runs, and the messages of failed ones."""
        failed = rows["error"].dropna()
        for message in failed:
            self.failures[message] = self.failures.get(message, 0) + 1
        if len(failed) == len(rows):
            raise ConfigurationError(
                f"map: a run must not fail, got in all of them: {failed.iloc[0]}"
            )
        return CellRuns(
            rows["point"].to_numpy() - 1, rows[[*_LENGTHS]].to_numpy(),
            rows["lost"].to_numpy(bool), rows["availability"].to_numpy(), rows["rms"].to_numpy(),
        )  # fmt: skip


def _rms(judged: pd.DataFrame, error: str) -> Floats:
    """Root mean square of a length in each run [m]."""
    frame, _, what = error.rpartition("_")
    axes = ("x", "y") if what == "horizontal" else ("x", "y", "z")
    squares = [judged[f"{frame}_{axis}_rms_m"].to_numpy(float) ** 2 for axis in axes]
    roots: Floats = np.sqrt(np.sum(squares, axis=0))
    return roots


def _runs(seeds: Integers) -> list[CampaignRun]:
    """The runs of a part, identified by their seeds."""
    return [CampaignRun(i, 1, seed, f"{seed:016x}") for i, seed in enumerate(seeds.tolist())]


def _kept(folder: Path, seeds: Integers) -> list[pd.DataFrame]:
    """A table of the existing runs, if any."""
    there = sound(folder)
    rows = parts.table(there) if there.paths else pd.DataFrame({"seed": ()})
    mine = rows[rows["seed"].isin(seeds)]
    return [mine] if len(mine) else []


class _Points(Sequence[PreparedPoint]):
    """A study point for each run, made when a run is executed alone."""

    def __init__(self, point: PreparedPoint, values: Mapping[str, Floats]) -> None:
        self._point, self._values = point, values

    def __len__(self) -> int:
        return len(next(iter(self._values.values())))

    @overload
    def __getitem__(self, index: int) -> PreparedPoint: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[PreparedPoint]: ...
    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return [self[i] for i in range(len(self))[index]]
        specs = dict(self._point.system.components)
        for name, values in self._values.items():
            component, _, parameter = name.partition(".")
            value = values[index].tolist()
            given = tuple(value) if isinstance(value, list) else value
            specs[component] = replace(
                specs[component],
                parameters={**specs[component].parameters, parameter: given},
            )
        return replace(self._point, system=replace(self._point.system, components=specs))


def check_times(duration_s: float, settling_s: float) -> None:
    """Refuse a run that ends before errors count.

    Raises
    ------
    ConfigurationError
        A time is out of range.
    """
    for name, value in (("duration", duration_s), ("settling", settling_s)):
        if not isinstance(value, int | float) or not 0 <= value < np.inf:
            raise ConfigurationError(
                f"map {name}: must be a time from 0 s on, got {shortened(instance(value))}"
            )
    if duration_s == 0:
        raise ConfigurationError("map duration: must be more than 0 s, got 0")
    if not 0 <= settling_s < duration_s or nanoseconds(settling_s) >= nanoseconds(duration_s):
        raise ConfigurationError(
            f"map settling: must be from 0 s to less than the duration ({duration_s:g} s), got "
            f"{settling_s!r}"
        )
