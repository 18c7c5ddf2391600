"""Intervals of what a log tells about its device: they hold its numbers in 90 % of logs or more."""

from __future__ import annotations

import pytest
from identified import CARRIED, LOGS, coverage, missed

RUNS = 400
OFTEN = {"harbour-lbl": (), "random_path": (), "model": ("late_share", "late_mean")}
"""Numbers that the log tells apart from turns in 80 % of logs or more."""
TURNS = ("late_share", "late_mean")


def check(name: str, found: dict[str, tuple[float, float, int]], least: float) -> None:
    for parameter, (held, told, count) in found.items():
        print(f"{name}: {parameter}: held {held:.3f} of {count}, told {told:.3f}")
    for parameter, (held, told, _) in found.items():
        if told > 0:
            assert held >= least, parameter
        if parameter not in TURNS or parameter in OFTEN[name]:
            assert told >= 0.8, parameter


@pytest.mark.slow
@pytest.mark.parametrize("name", LOGS)
def test_intervals_hold_the_numbers_of_the_device(name: str) -> None:
    check(name, coverage(name, RUNS), 0.9)


@pytest.mark.slow
@pytest.mark.parametrize("name", LOGS)
def test_in_a_few_logs_they_do(name: str) -> None:
    check(name, coverage(name, 6, 901), 0.5)


# --- Platforms and buoys --------------------------------------------------------------------------

CARRIED_RUNS = 60
TOLD = {
    "platform": ("range_std", "range_scale", "range_offset[1]", "gps_std", "depth_std"),
    "harbour": ("range_std", "range_scale", "range_offset[1]", "depth_std", "loss_share"),
    "paper": ("range_std", "gps_std", "depth_std"),
    "buoys": ("gps_markov_std", "gps_correlation_time", "loss_share"),
    "buoys of a fast GPS": ("gps_std", "gps_markov_std", "gps_correlation_time"),
}
"""Numbers that 80 % of the logs tell or more."""


@pytest.mark.slow
@pytest.mark.parametrize("name", CARRIED)
def test_intervals_hold_the_numbers_of_platforms_and_buoys(name: str) -> None:
    found = missed(name, CARRIED_RUNS)
    for parameter, (off, told) in found.items():
        print(f"{name}: {parameter}: missed {off} of {told}")
    for parameter, (off, told) in found.items():
        # What a log rarely tells may miss its number in a few logs of all.
        assert off <= max(0.1 * told, 0.05 * CARRIED_RUNS), parameter
    for parameter in TOLD[name]:
        assert found[parameter][1] >= 0.8 * CARRIED_RUNS, parameter


def test_in_two_dives_of_a_platform_they_do() -> None:
    assert max(off for off, _ in missed("platform", 2).values()) <= 1
