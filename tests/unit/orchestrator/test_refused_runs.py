"""Tables of runs that no analysis takes, and the value, run or column that is named."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
import pytest
from sblcosim.analysis.common.runs import LARGEST
from sblcosim.analysis.levels.analysis import analyse as several_levels
from sblcosim.analysis.two_level.analysis import analyse as two_levels
from sblcosim.errors import ConfigurationError


def runs() -> pd.DataFrame:
    """Four replicates of four points."""
    points = pd.DataFrame({"a": [0.0, 1.0, 0.0, 1.0], "b": [2.0, 2.0, 5.0, 5.0]})
    table = pd.concat([points.assign(replicate=r) for r in range(1, 5)], ignore_index=True)
    return table.assign(y=np.random.default_rng(93).uniform(1.0, 2.0, 16), c="word")


@pytest.mark.parametrize(("again", "named"), [
    ((9,), 3), ((6, 13), 2), ((13, 6), 4), ((9, 10, 1), 3),
])  # fmt: skip
def test_the_first_run_that_is_there_twice_names_its_replicate(
    again: Sequence[int], named: int
) -> None:
    table = runs()
    twice = pd.concat([table, table.iloc[[*again]]], ignore_index=True)
    for analyse in (two_levels, several_levels):
        with pytest.raises(ConfigurationError, match=rf"got one twice in {named}$"):
            analyse(twice, ["a", "b"], "y", seeding="common")
    assert two_levels(table, ["a", "b"], "y", seeding="common").runs == 16


@pytest.mark.parametrize(("factors", "message"), [
    (("b", "a", "a"), "factors: must be different columns, got 'a' twice"),
    (("a", "y"), "response: must not be a factor, got 'y'"),
    (("a", "c"), "c: must be a column of numbers, got "),
    (("a", "d"), "factors: must be columns of the table, got 'd'"),
    ((), "factors: must name at least one column, got none"),
])  # fmt: skip
def test_the_column_that_is_no_factor_is_named(factors: Sequence[str], message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        two_levels(runs(), factors, "y")


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_response_is_within_the_range_of_sums_of_squares(sign: float) -> None:
    table = runs()
    for largest, good in ((LARGEST, True), (1 / LARGEST, True), (1.01 * LARGEST, False),
                          (0.99 / LARGEST, False)):  # fmt: skip
        scaled = table.assign(y=sign * table["y"] / table["y"].max() * largest)
        assert scaled["y"].abs().max() == largest
        if good:
            two_levels(scaled, ["a", "b"], "y")
            continue
        with pytest.raises(ConfigurationError, match=r"must be from .* in the run farthest from 0"):
            two_levels(scaled, ["a", "b"], "y")


@pytest.mark.parametrize("complete", [1, 2, 3])
def test_two_complete_replicates_are_enough(complete: int) -> None:
    table = runs()
    kept = table[(table["replicate"] <= complete) | (table["a"] == 0)]
    if complete == 1:
        with pytest.raises(ConfigurationError, match=r"at least two complete replicates .* got 1"):
            two_levels(kept, ["a", "b"], "y", seeding="common")
        return
    found = two_levels(kept, ["a", "b"], "y", seeding="common")
    assert (found.runs, found.dropped) == (4 * complete, len(kept) - 4 * complete)


@pytest.mark.parametrize(("factors", "columns", "fewer"), [("a", 4, False), ("ab", 8, True)])
def test_main_effects_are_proposed_where_they_leave_a_run_for_the_error(
    factors: str, columns: int, fewer: bool
) -> None:
    """Each combination has one run, so no model of all of them leaves one."""
    table = pd.DataFrame({"a": np.tile(np.arange(4), 2), "b": np.repeat([0, 1], 4)})[:columns]
    table["y"] = np.random.default_rng(94).uniform(size=columns)
    with pytest.raises(ConfigurationError) as failed:
        several_levels(table, [*factors], "y", order=len(factors))
    assert str(failed.value) == (
        f"runs: must be more than the {columns} coefficients of the model, to estimate an error "
        f"from, got {columns}{'; order 1 needs fewer (--order 1)' if fewer else ''}"
    )
    if fewer:
        assert several_levels(table, [*factors], "y", order=1).runs == columns


def test_the_level_that_is_there_twice_is_named() -> None:
    with pytest.raises(ConfigurationError, match=r"got 1\.0 twice"):
        several_levels(runs(), ["a", "b"], "y", levels={"a": [0.0, 1.0, 1.0], "b": [2.0, 5.0]})
