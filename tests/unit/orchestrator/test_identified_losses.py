"""Pings that a log has missed: every number of the answer by another way, and its limits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from sblcosim.identification.losses import losses, usual, wilson
from scipy import stats


def interval(count: float, of: float) -> tuple[float, float]:
    """Shares p from which the counted one is off by 1.96 standard deviations √(p (1 − p) / n)."""
    z2, share = stats.norm.ppf(0.975) ** 2 / of, count / of
    low, high = sorted(np.roots([1 + z2, -2 * share - z2, share**2]))
    return float(low), float(high)


def heard(slots: Any, slot_s: float = 2.0, begin: int = 7) -> Any:
    """Times of pings [ns], after so many slots each."""
    return begin + np.rint(np.concatenate([[0], np.cumsum(slots)]) * slot_s * 1e9).astype(np.int64)


@pytest.mark.parametrize(("count", "of"), [(3, 17), (1, 2), (12.7, 13.1), (0.4, 99.0), (70, 140)])
def test_the_interval_of_a_share_is_that_of_wilson(count: float, of: float) -> None:
    share, *ends = wilson(count, of)
    assert share == count / of
    assert ends == pytest.approx(interval(count, of), rel=1e-6)


@pytest.mark.parametrize("bursts", [
    (1, 1, 2, 1), (1, 7, 3), (5, 9, 9, 8), (1,), (2,), (1, 1, 1, 1, 1, 1, 1, 1, 1, 2),
])  # fmt: skip
def test_losses_of_several_beacons_are_those_of_all_together(bursts: tuple[int, ...]) -> None:
    """Losses that follow each other more often than by chance count as fewer, of fewer pings."""
    gaps = np.concatenate([np.ones(17), 1.0 + np.array(bursts)])
    np.random.default_rng(4).shuffle(gaps)
    parts = [gaps[:6], gaps[6:13], gaps[13:]]
    times = [heard(part, begin=b * 300_000_000) for b, part in enumerate(parts)]
    times[1] = np.append(times[1], times[1][:2])  # a ping that is heard twice is heard
    beacon = np.concatenate([np.full(len(t), 3 * b) for b, t in enumerate(times)])
    found = losses(np.concatenate(times), beacon)
    assert found is not None
    assert found.burst is not None
    lost, number = float(sum(bursts)), float(len(bursts))
    again = (lost - number) / lost
    low, high = interval(lost - number, lost)
    assert found.slot_s == 2.0
    assert found.burst == pytest.approx(
        (lost / number, 1 / (1 - max(low, 0.0)), 1 / (1 - high)), rel=1e-6)
    linked = max(0.0, again - number / len(gaps))
    fewer = (1 - linked) / (1 + linked)
    total = lost + len(gaps)
    assert found.share[0] == pytest.approx(lost / total)
    assert found.share[1:] == pytest.approx(interval(lost * fewer, total * fewer), rel=1e-6)


def test_a_schedule_is_regular_if_nineteen_of_twenty_gaps_are_whole_slots_to_a_fifth() -> None:
    for odd, regular in (
        ([1.19, 0.81, 2.19, 2.81], True), ([1.21], True), ([2.79], True), ([1.21, 2.79], False),
        ([0.1], True), ([0.1, 1.21], False), ([0.1, 0.1], False), ([1.5, 1.5], False),
    ):
        gaps = np.concatenate([np.ones(20 - len(odd)), odd])
        found = losses(heard(gaps), np.zeros(21, np.intp), slot_s=2.0)
        assert (found is not None) == regular, odd
        if found is not None:  # to the nearest slot
            lost = sum(max(np.rint(gap) - 1, 0) for gap in odd)
            assert found.share[0] == pytest.approx(lost / (20 + lost))


def test_a_schedule_needs_ten_gaps() -> None:
    for number, told in ((9, False), (10, True)):
        found = losses(heard(np.ones(number)), np.zeros(number + 1, np.intp))
        assert (found is not None) == told


def test_the_usual_gap_is_the_median_of_those_up_to_half_as_long_again_as_the_shortest() -> None:
    assert usual(np.array([1.0] * 4 + [1.5] * 6)) == 1.0
    assert usual(np.array([1.0] * 4 + [1.49] * 6)) == 1.49
    assert usual(np.array([0.1, *[1.0] * 38, 2.9, 2.9])) == 1.0  # one in forty is too early
    rng = np.random.default_rng(7)
    for _ in range(20):
        gaps = np.sort(rng.uniform(0.5, 3.0, rng.integers(10, 60)))
        at = 0.05 * (len(gaps) - 1)
        share = at - int(at)
        short = (1 - share) * gaps[int(at)] + share * gaps[int(at) + 1]
        assert usual(rng.permutation(gaps)) == pytest.approx(np.median(gaps[gaps < 1.5 * short]))
