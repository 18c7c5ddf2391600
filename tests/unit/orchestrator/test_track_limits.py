"""Recorded tracks of a scenario: default tolerance, and what is taken or told at the limits."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from sblcosim.errors import ConfigurationError, ConfigurationWarning
from sblcosim.scenario.scenario import Scenario, load
from sblcosim.scenario.tracks import FOLLOWERS, capacity

Row = tuple[float, float, float, float]


def recorded(folder: Path, rows: Sequence[Row], **more: Any) -> Scenario:
    """A scenario whose diver follows rows of time, north, east and down."""
    file = folder / "dive.csv"
    lines = [",".join(map(repr, row)) for row in rows]
    file.write_text("\n".join(["time_s,north_m,east_m,down_m", *lines, ""]), "utf-8")
    return load({"target": {"trajectory": "file", "track_file": str(file), **more}})


def test_a_track_is_followed_to_ten_centimetres_unless_another_tolerance_is_given(
    tmp_path: Path,
) -> None:
    rows = [(float(t), 0.2 * t, 0.03 * (t * t % 11), 5.0) for t in range(60)]
    plain = recorded(tmp_path, rows).target
    assert plain == recorded(tmp_path, rows, track_tolerance_m=0.1).target
    coarse = recorded(tmp_path, rows, track_tolerance_m=0.2).target
    assert coarse.track_count < plain.track_count


@pytest.mark.parametrize(("rows", "told"), [
    ([(0.0, 0.0, 0.0, -2.0), (9.0, 3.0, 0.0, 5.0)], ""),
    ([(0.0, 0.0, 0.0, -2.1), (9.0, 3.0, 0.0, 5.0)], "got up to 2.1 m above it at 1 of 2 points"),
    ([(0.0, 0.0, 0.0, 5.0), (86_400.0, 3.0, 0.0, 5.0)], ""),
    ([(0.0, 0.0, 0.0, 5.0), (86_401.0, 3.0, 0.0, 5.0)], "got a track that lasts 24 h; times are in "
     "seconds"),
])  # fmt: skip
def test_points_high_above_the_water_and_days_are_told(
    tmp_path: Path, rows: Sequence[Row], told: str
) -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ConfigurationWarning)
        recorded(tmp_path, rows)
    assert [str(w.message).rpartition(", got")[2] for w in caught] == (
        [told.removeprefix("got")] if told else []
    )


@pytest.mark.parametrize("name", FOLLOWERS)
def test_a_component_is_built_for_the_fewest_points_that_are_enough(name: str) -> None:
    def built(points: int) -> dict[str, int]:
        return capacity(name, SimpleNamespace(
            trajectory="file", track_file=None, track_count=points, track_time_s=range(points)
        ))  # fmt: skip

    it = FOLLOWERS[name]
    assert built(0) == {it.constant.name: it.capacities[0]}
    for few, more in pairwise(it.capacities):
        assert built(few) == {it.constant.name: few}
        assert built(few + 1) == built(more) == {it.constant.name: more}


@pytest.mark.parametrize(("name", "count", "said"), [
    ("target", 2, ""), ("target", 3, ""), ("target", 4, "must be from 2 to 3, got 4"),
    ("platform", 1, "must be from 2 to 3, got 1"), ("platform", 2, ""), ("platform", 3, ""),
    ("platform", 4, "must be from 2 to 3, got 4"),
])  # fmt: skip
def test_two_points_or_more_of_a_track_are_followed(name: str, count: int, said: str) -> None:
    rows = [[0, 0, 1], [1, 0, 1], [1, 2, 1]]
    own = {"track_m": rows, "trajectory": "file"} if name == "target" else {
        "track_m": [row[:2] for row in rows]
    }
    tables = {name: {"track_count": count, "track_time_s": [0, 1, 3], **own}}
    if said:
        with pytest.raises(ConfigurationError, match=rf"\[{name}\] track_count: {said}$"):
            load(tables)
    else:
        assert getattr(load(tables), name).track_count == count
