"""Ranges that are late by a wall far away, or too short: left out, counted and said."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pandas as pd
import pytest
from made_logs import changed, made, on_a_boat
from numpy.typing import NDArray
from quick import few, one_in
from sblcosim import identify, process
from sblcosim.logs.log import Log
from sblcosim.processing.settings import settled
from sblcosim.processing.windows import LATE_M

Flags = NDArray[np.bool_]


KINDS: dict[str, Any] = {
    "fixed": lambda: made(seconds=1200),
    "plane": lambda: made(seconds=1200, plane=True, seed=4),
    "boat": lambda: on_a_boat(seconds=1200, std=0.05),
}


@cache
def log_of(kind: str) -> Log:
    log: Log = KINDS[kind]()
    return log


def wrong_in(log: Log, share: float, seed: int) -> Flags:
    """Which ranges are wrong."""
    which: Flags = np.random.default_rng(seed).random(len(log.receptions)) < share
    return which


def late_by(log: Log, which: Flags, by: float) -> Log:
    """A log with ranges that are late by about as much."""
    scatter = np.random.default_rng(5).normal(1.0, 0.02, int(which.sum()))
    return changed(log, which, by * scatter)


def without(log: Log, which: Flags) -> Log:
    return replace(log, receptions=log.receptions.chosen(~which))


def left_out(log: Log, kept: Log) -> Flags:
    return ~np.isin(log.receptions.line, kept.receptions.line)


@cache
def error_without(kind: str, share: float) -> float:
    log = log_of(kind)
    found = process(without(log, wrong_in(log, share, 3)))
    return float(found.receivers.horizontal_rms_m[found.main])


@pytest.mark.parametrize("by", few([50.0, 100.0, 300.0, 1000.0], quick=[50.0, 1000.0]))
@pytest.mark.parametrize("share", few([0.05, 0.1, 0.2], quick=[0.05, 0.2]))
@pytest.mark.parametrize("kind", KINDS)
def test_ranges_that_are_far_too_late_are_survived_counted_and_said(
    kind: str, share: float, by: float
) -> None:
    log = log_of(kind)
    which = wrong_in(log, share, 3)
    found = process(late_by(log, which, by))
    gone = left_out(log, found.log)
    assert gone[which].all()
    assert gone[~which].sum() <= 0.02 * which.sum() + 10 * (share == 0.2)
    (told,) = (line for line in found.remarks if "too late" in line)
    assert told.startswith(f"receptions: {int((gone & which).sum())} lines left out: a range too "
                           "late by ")
    assert told.split("(lines ")[1].startswith(str(int(log.receptions.line[which][0])))
    made_error = found.receivers.horizontal_rms_m[found.main]
    assert made_error <= 1.5 * error_without(kind, share)


@one_in(2)
@pytest.mark.parametrize("by", [50.0, 1000.0])
def test_identify_is_not_spoiled_by_them(by: float) -> None:
    log = log_of("fixed")
    which = wrong_in(log, 0.1, 3)
    spoiled, clean = identify(late_by(log, which, by)), identify(without(log, which))
    pd.testing.assert_frame_equal(spoiled.numbers, clean.numbers, rtol=1e-9)
    assert any("too late" in line for line in spoiled.remarks)
    assert f"losses: {int(which.sum())} ranges left out, as if lost" in spoiled.remarks
    assert not any(line.startswith("losses: ") for line in clean.remarks)


@pytest.mark.parametrize("mean", [1.0, 3.0, 6.0])
def test_ranges_that_are_late_by_some_metres_are_kept(mean: float) -> None:
    log = log_of("fixed")
    which = wrong_in(log, 0.1, 3)
    excess = np.minimum(np.random.default_rng(6).exponential(mean, int(which.sum())), LATE_M - 5)
    assert not left_out(log, settled(changed(log, which, excess)).log).any()


@pytest.mark.parametrize(("gap_s", "end"), [(200.0, 600), (45.0, 600), (200.0, 607)])
def test_they_are_found_beside_gaps_and_at_the_end_of_a_log(gap_s: float, end: int) -> None:
    """Windows of twelve ranges that hold the gap, or are not full, would not show them."""
    log = made(seconds=int(end + gap_s))
    heard = log.receptions
    time = heard.epoch_ns / 1e9
    kept = (time <= 306) | (time > 306 + gap_s)
    log = replace(log, receptions=heard.chosen(kept))
    time = log.receptions.epoch_ns / 1e9
    which = np.isin(time, [303, 305, 308 + gap_s, 311 + gap_s, end + gap_s - 1, end + gap_s])
    assert which.sum() == 6
    assert (left_out(log, settled(late_by(log, which, 100.0)).log) == which).all()


@pytest.mark.parametrize("by", [4.0, 12.0, 25.0])
def test_where_a_beacon_is_behind_something_no_other_is_too_short(by: float) -> None:
    """A line through the late ranges of one beacon makes those of others too short."""
    log = log_of("fixed")
    time = log.receptions.epoch_ns / 1e9
    for first in range(100, 1000, 100):
        which = (log.receptions.beacon == first // 100 % 4) & (np.abs(time - first) < 30)
        ready = settled(changed(log, which, by))
        assert not left_out(log, ready.log).any(), first


def test_both_kinds_are_told_apart() -> None:
    log = log_of("fixed")
    which = wrong_in(log, 0.04, 8)
    first, second = np.flatnonzero(which)[::2], np.flatnonzero(which)[1::2]
    ready = settled(changed(changed(log, first, 70.0), second, -20.0))
    late, short = sorted(ready.log.counted())
    if "short" in late:
        late, short = short, late
    assert late.startswith(f"receptions: {len(first)} lines left out: a range too late by ")
    assert short.startswith(f"receptions: {len(second)} lines left out: a range too short by ")


def test_the_settings_are_those_of_the_ranges_that_are_left() -> None:
    log = log_of("fixed")
    which = wrong_in(log, 0.2, 3)
    spoiled, clean = settled(late_by(log, which, 300.0)), settled(without(log, which))
    assert spoiled.scenario == clean.scenario
    assert spoiled.alike == clean.alike
    assert spoiled.window is not None
    assert clean.window is not None
    np.testing.assert_array_equal(spoiled.window.position, clean.window.position)
