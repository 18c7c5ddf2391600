"""What limits a design: the percentile of its response without each source of error, in turn.

All runs with the same seed have the same noise, whatever is switched off.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..comparison.budget import sources
from ..errors import NoEffectWarning
from ..scenario.error_sources import SOURCES
from ..scenario.scenario import Scenario, Source
from ..simulation.how import How
from ..study import runner
from ..study.definition import value_of
from ..study.study import load

RUNS = 400
"""Number of runs without each source."""
EVERYTHING = "everything"
"""Name of the runs in which nothing is switched off."""


@dataclass(frozen=True)
class Limiting:
    """A design's percentile without some sources of error.

    Attributes
    ----------
    everything
        The percentile with all sources of error, in these runs.
    without
        The percentile without each source, by name, the smallest first.
    enough
        The fewest of the largest sources whose removal brings the percentile within the limit.
        Empty if it is within the limit already, or never.
    """

    everything: float
    without: Mapping[str, float]
    enough: tuple[str, ...]


def switches(scenario: Scenario) -> dict[str, dict[str, Any]]:
    """Keys that switch off each of a scenario's sources of error, with their values."""
    return {
        SOURCES[name].words: sources.switched(scenario, [name])
        for name in sources.of_scenario(scenario)
    }


def limiting(
    scenario: Scenario,
    receiver: Source,
    about: Mapping[str, Any],
    percentile: Callable[[Any, str], float],
    limit: float,
    workers: int | None = None,
) -> Limiting:
    """Switch off each source of error of a design, and then as many as needed.

    Parameters
    ----------
    about
        Keys of the study of these runs: responses, settling time and seed.
    percentile
        Function of some runs of that study and of a receiver's label.
    limit
        Limit of the percentile.
    """
    off = switches(scenario)
    if not off:
        return Limiting(float("nan"), {}, ())
    found = _percentiles(scenario, receiver, about, percentile, off, workers)
    everything = found.pop(EVERYTHING)
    order = sorted(found, key=lambda name: found[name])
    enough: tuple[str, ...] = ()
    if everything > limit:
        enough = tuple(order[:1]) if found[order[0]] <= limit else ()
        sums = {str(n): _joined(off, order[:n]) for n in range(2, len(order) + 1)}
        if not enough and sums:
            more = _percentiles(scenario, receiver, about, percentile, sums, workers)
            few = next((int(n) for n in sums if more[n] <= limit), 0)
            enough = tuple(order[:few])
    return Limiting(everything, {name: found[name] for name in order}, enough)


def _joined(off: Mapping[str, Mapping[str, float]], names: Sequence[str]) -> dict[str, float]:
    return {key: value for name in names for key, value in off[name].items()}


def _percentiles(
    scenario: Scenario,
    receiver: Source,
    about: Mapping[str, Any],
    percentile: Callable[[Any, str], float],
    off: Mapping[str, Mapping[str, float]],
    workers: int | None,
) -> dict[str, float]:
    """The percentile with everything, and without each source."""
    own = {key: value_of(scenario, key) for key in next(iter(off.values()))}
    levels = {EVERYTHING: _nested(own), **{name: _nested(keys) for name, keys in off.items()}}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NoEffectWarning)  # for keys of errors that are off
        study = load(
            {
                **about, "scenario": scenario.given(), "receivers": [receiver],
                "design": {"kind": "grid"}, "seeding": "common", "replicates": RUNS,
                "factors": {"without": {"levels": levels}},
            }
        )
        table = runner.simulated(study, How(workers=workers))
    label = next(c.partition(".")[0] for c in table.columns if c.endswith(".lost"))
    groups = table.groupby("without", sort=False)
    return {str(name): percentile(runs, label) for name, runs in groups}


def _nested(keys: Mapping[str, Any]) -> dict[str, Any]:
    tables: dict[str, Any] = {}
    for key, value in keys.items():
        table, _, name = key.partition(".")
        tables.setdefault(table, {})[name] = value
    return tables
