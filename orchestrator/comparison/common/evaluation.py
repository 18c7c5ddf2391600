"""Evaluates the runs of a tournament: levels and paired differences."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from ...analysis.common.bounds import share_interval
from ...judge.consistency import NEES_COLUMNS, Verdict, of_runs
from ...judge.over_runs import SUFFIX, rms_over_runs
from ...results.responses import unit_of
from .statistics import Difference, Floats, Level, difference, level

PERCENTILE = "absolute_total_p95_m"
"""Responses that are always compared, besides the requested one."""
ALL = "all scenarios"
"""Name of the place for means over the scenarios."""
Values = Mapping[str, Mapping[str, Floats]]
"""Responses by place and receiver, shape (runs,)."""


def receivers_in(table: pd.DataFrame) -> list[str]:
    """Labels of the receivers in a table of runs."""
    return [c.removesuffix(".lost") for c in table.columns if c.endswith(".lost")]


def by_place(runs: Mapping[str, pd.DataFrame], response: str) -> dict[str, dict[str, Floats]]:
    """A column by scenario and receiver; with several scenarios also the mean over them.

    A seed that failed in one scenario has no mean: its other scenarios do not count.
    """
    values = {
        name: {
            receiver: _column(table, f"{receiver}.{response}")
            for receiver in receivers_in(table)
        }
        for name, table in runs.items()
    }
    if len(values) > 1:
        first, *others = values.values()
        common = [receiver for receiver in first if all(receiver in other for other in others)]
        values[ALL] = {r: np.mean([mine[r] for mine in values.values()], axis=0) for r in common}
    return values


def _column(table: pd.DataFrame, name: str) -> Floats:
    """A column as numbers; NaN in runs of an earlier version, which lack it."""
    if name not in table:
        return np.full(len(table), np.nan)
    return table[name].to_numpy(np.float64, na_value=np.nan)


def ranked(values: Values) -> Iterator[str]:
    """The receivers by their median over all scenarios, then those that were only in some.

    A failed run is worse than any other. Ties are broken by failures, then by the means.
    """
    last = [*values.values()][-1]

    def rank(receiver: str) -> tuple[float, int, float]:
        y = last[receiver]
        good = y[np.isfinite(y)]
        median = float(np.median(np.where(np.isfinite(y), y, np.inf)))
        return median, len(y) - len(good), float(good.mean()) if len(good) else 0.0

    yield from sorted(last, key=rank)
    others = dict.fromkeys(receiver for mine in values.values() for receiver in mine)
    yield from (receiver for receiver in others if receiver not in last)


def levels(
    runs: Mapping[str, pd.DataFrame],
    values: Mapping[str, Values],
    ranked: Sequence[str],
    settings: Mapping[str, Any],
) -> Iterator[dict[str, Any]]:
    """The rows of `sblcosim.comparison.tournament.result.Tournament.levels`."""
    frame = "own_relative" if settings["response"].startswith("own_relative") else "absolute"
    nees, lost = by_place(runs, NEES_COLUMNS[frame]), by_place(runs, "lost")
    misleading = by_place(runs, "misleading")
    for place in lost:
        for receiver in (r for r in ranked if r in lost[place]):
            own = _flags(lost, place, receiver)
            count = round(float(np.nansum(own)))
            verdict = of_runs(nees[place][receiver], count / max(len(own), 1))
            shares = {
                **_share("lost", count, len(lost[place][receiver]), place),
                **_misleading(_flags(misleading, place, receiver), place),
            }
            for response, mine in values.items():
                found = level(mine[place][receiver], settings["contamination"])
                yield {
                    **_row(place, receiver, response, found, shares, verdict),
                    "rms_over_runs": _rms(mine, place, receiver, response),
                }


def _flags(values: Mapping[str, Mapping[str, Floats]], place: str, receiver: str) -> Floats:
    """Flags of all runs of a place; NaN where they are unknown."""
    parts = [name for name in values if name != ALL] if place == ALL else [place]
    return np.concatenate([values[name][receiver] for name in parts])


def _share(name: str, count: int, runs: int, place: str) -> dict[str, Any]:
    """A number of runs, with the interval of their share in a scenario."""
    ends = (np.nan, np.nan) if place == ALL else share_interval(count, runs)
    return {name: count, f"{name}_low": ends[0], f"{name}_high": ends[1]}


def _misleading(flags: Floats, place: str) -> dict[str, Any]:
    """Misleading runs, of those in which that is known; missing if it is known of none."""
    known = flags[~np.isnan(flags)]
    found = _share("misleading", round(float(known.sum())), len(known), place)
    if not len(known):
        found = {"misleading": pd.NA, "misleading_low": np.nan, "misleading_high": np.nan}
    return {**found, "misleading_known": len(known)}


def _rms(values: Values, place: str, receiver: str, response: str) -> float:
    """RMS over the runs of a scenario; over all, the mean of theirs, for seeds without a
    failure."""
    if not response.endswith(SUFFIX):
        return np.nan
    good = np.isfinite(values[place][receiver])
    parts = [name for name in values if name != ALL] if place == ALL else [place]
    if not good.any():
        return np.nan
    return float(np.mean([rms_over_runs(values[it][receiver][good] ** 2) for it in parts]))


def _row(
    place: str, receiver: str, response: str, found: Level, shares: Mapping[str, Any],
    verdict: Verdict,
) -> dict[str, Any]:
    return {
        "scenario": place, "receiver": receiver, "response": response, **found.to_json(),
        **shares, "covariance": verdict.verdict, "covariance_factor": verdict.factor,
        "covariance_words": str(verdict), "nees_runs": verdict.runs,
    }  # fmt: skip


def differences(
    values: Mapping[str, Values], ranked: Sequence[str], settings: Mapping[str, Any]
) -> pd.DataFrame:
    """The table `sblcosim.comparison.tournament.result.Tournament.differences`."""
    rows = []
    for response, mine in values.items():
        alike = unit_of(response) == unit_of(settings["response"])
        asked = [
            (place, one, other)
            for place in mine
            for one, other in combinations([r for r in ranked if r in mine[place]], 2)
        ]
        for place, one, other in asked:
            found = difference(
                mine[place][one], mine[place][other], len(asked),
                settings["practical"] if alike else None, settings["contamination"],
            )  # fmt: skip
            where = {"scenario": place, "response": response, "one": one, "other": other}
            rows.append({**where, **found.to_json()})
    columns = ["scenario", "response", "one", "other", *Difference.__dataclass_fields__]
    return pd.DataFrame(rows, columns=columns).astype({"runs_needed": "Int64"})
