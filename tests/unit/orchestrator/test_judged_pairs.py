"""Pairs of levels whose bounds are exactly at a limit, and means with a bound at zero."""

from __future__ import annotations

from dataclasses import replace
from math import log
from typing import Any

import numpy as np
import pandas as pd
import pytest
from sblcosim.analysis.levels.analysis import RUNAWAY, GeneralFactorial, analyse, judged
from sblcosim.analysis.levels.sentences import MOST_NAMED, answer

BOUNDS = ((-1.0, 0.5), (-0.5, 1.0), (-0.5, 0.5), (1.0, 2.0), (1.25, 2.0), (-2.0, -1.0),
          (-2.0, -1.25), (0.0, 0.5), (0.25, 0.5), (-0.5, 0.0), (-2.0, 2.0))  # fmt: skip
EQUAL = (False, False, True, False, False, False, False, True, True, True, False)
MORE = (False, False, False, False, True, False, True, False, False, False, False)
DIFFER = (False, False, False, True, True, True, True, False, True, False, False)


def several(**options: Any) -> GeneralFactorial:
    """Runs at eleven levels, which make 55 pairs."""
    random = np.random.default_rng(81)
    table = pd.DataFrame({"a": np.repeat(np.arange(11), 12), "y": random.uniform(1.0, 2.0, 132)})
    return analyse(table, ["a"], "y", **options)


def bounded(analysis: GeneralFactorial, scale: float = 1.0) -> GeneralFactorial:
    """The first pairs with the bounds above."""
    low, high = (scale * np.array(ends) for ends in zip(*BOUNDS, strict=True))
    pairs = analysis.pairs[: len(BOUNDS)].assign(low=low, high=high, difference=(low + high) / 2)
    return judged(replace(analysis, pairs=pairs))


@pytest.mark.parametrize(("options", "scale"), [
    ({"practical": 1.0}, 1.0), ({"practical": 2.0, "transform": "log"}, log(2.0)),
])  # fmt: skip
def test_a_bound_at_the_limit_decides_nothing(options: dict[str, Any], scale: float) -> None:
    pairs = bounded(several(**options), scale).pairs
    assert tuple(pairs["verdict"] == "equal") == EQUAL
    assert tuple(pairs["verdict"] == "differs") == MORE
    assert tuple(pairs["differs"]) == DIFFER
    assert "verdict" not in bounded(several()).pairs


@pytest.mark.parametrize(("low", "high", "apart"), [
    (0.0, 1.0, False), (-1.0, 0.0, False), (0.01, 1.0, True), (-1.0, -0.01, True),
])  # fmt: skip
def test_a_difference_that_may_be_0_is_not_told(low: float, high: float, apart: bool) -> None:
    found = several()
    middle = (low + high) / 2
    pairs = found.pairs[:1].assign(low=low, high=high, difference=middle)
    said = answer(judged(replace(found, pairs=pairs)))
    assert said.startswith("The y falls with a from ") == apart
    assert ("No two levels of a factor can be told apart by the y." in said) != apart
    if apart:
        ends = "0 to 1" if middle > 0 else "1 to 0"
        assert f"a from {ends}, by {abs(middle):.3g}" in said


def test_of_two_differences_of_a_factor_the_largest_is_told_whatever_its_sign() -> None:
    found = several()
    pairs = found.pairs[:3].assign(low=[0.1, -0.9, 0.2], high=[0.3, -0.3, 0.6],
                                   difference=[0.2, -0.6, 0.4])  # fmt: skip
    assert "a from 2 to 0, by 0.6" in answer(judged(replace(found, pairs=pairs)))


@pytest.mark.parametrize(("times", "away"), [(1.0, False), (1.0 + 1e-9, True)])
def test_a_run_ran_away_above_fifty_times_the_median(times: float, away: bool) -> None:
    found = several()
    assert found.median > 0
    assert replace(found, largest=RUNAWAY * found.median * times).ran_away == away
    assert not replace(found, largest=9e9, transform="log").ran_away
    assert not replace(found, largest=9e9, median=0.0).ran_away


def test_an_interval_that_reaches_below_zero_is_unknown_where_no_run_does() -> None:
    random = np.random.default_rng(82)
    table = pd.DataFrame({"a": np.repeat([0, 1], 8), "y": random.exponential(1.0, 16) ** 3})
    table.loc[:7, "y"] += 50.0
    for least, known in ((0.0, False), (-1e-6, True)):
        table.loc[15, "y"] = least
        means = analyse(table, ["a"], "y").means
        assert means["low"].notna().tolist() == [True, known]
        assert means["high"].notna().tolist() == [True, known]
    table.loc[8:, "y"] = 0.0
    means = analyse(table, ["a"], "y").means
    assert means.loc[1, ["low", "mean", "high"]].tolist() == [0.0] * 3


@pytest.mark.parametrize(("count", "rest"), [
    (0, ""), (1, ""), (MOST_NAMED, ""), (MOST_NAMED + 1, "; 1 more pairs differ"),
    (MOST_NAMED + 4, "; 4 more pairs differ"),
])  # fmt: skip
def test_pairs_of_medians_that_differ_are_named_and_the_others_counted(
    count: int, rest: str
) -> None:
    """Where the levels' own intervals of the median overlap, as with common random numbers."""
    found = several()
    medians = found.medians.assign(all_low=0.0, all_high=9.0)
    differs = np.arange(len(found.pairs)) < count
    pairs = found.pairs.assign(
        median_difference=-0.5, median_low=np.where(differs, -0.75, -1.0),
        median_high=np.where(differs, -0.25, 0.25),
    )  # fmt: skip
    means = found.means.assign(low=np.nan)  # so medians come first
    said = answer(judged(replace(found, medians=medians, pairs=pairs, means=means)))
    ends = zip(pairs["one"][:count], pairs["other"][:count], strict=True)
    named = [f"a: {b} to {a}, less by 0.500 (0.250 to 0.750)" for a, b in ends][:MOST_NAMED]
    start = "The means depend on few runs, so the medians come first. "
    if count:
        start += f"By the medians of the pairs, {'; '.join(named)}{rest}. "
    else:
        start += "No two levels of a surely differ in the median. "
    assert said.startswith(start), said
