"""Long records of the channel have the numbers that it was given, within confidence bounds."""

from __future__ import annotations

import warnings
from functools import cache
from math import hypot, sqrt
from typing import Any

import numpy as np
import pytest
import sblcosim
from numpy.typing import NDArray
from sblcosim.identification.losses import losses
from sblcosim.scenario import water
from sblcosim.scenario.scenario import load
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters import lanes
from sblcosim.simulation.resolve import resolve
from scipy.optimize import minimize
from scipy.stats import norm

RUNS, Z = 32, norm.isf(0.005 / 2)
STILL: dict[str, Any] = {
    "target.trajectory": "waypoints", "target.waypoint_m": [[15.0, 0.0, 2.0], [15.0, 0.0, 2.001]],
    "target.side_m": None, "target.center_m": None, "target.depth_start_m": None,
    "target.depth_end_m": None, "time.duration_s": 400.0, "platform.beaufort": None,
    "platform.roll_amplitude_deg": 0.0, "platform.pitch_amplitude_deg": 0.0,
    "platform.yaw_amplitude_deg": 0.0, "acoustics.range_std_m": 0.0,
}


@cache
def recorded(*keys: tuple[str, Any]) -> dict[str, NDArray[np.float64]]:
    """Receptions of a diver who rests 15 m away, in many runs; (runs, pings of each, 4)."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        plan = resolve(connect(load("harbour-square", {**STILL, **dict(keys)}), "multilateration"))
        names = ["reception_count", "range", "true_range"]
        outcome = lanes.execute(
            plan, {"acoustics.seed": np.arange(RUNS)}, record=[f"acoustics.{n}" for n in names]
        )
    of = {name: outcome.values[f"acoustics.{name}"] for name in names}
    # Ping k happens in the step that begins at k T: a round is complete after its fourth step.
    rounds = {name: value[:, 5::4] for name, value in of.items()}
    arrived = np.diff(rounds["reception_count"], axis=1, prepend=0) > 0
    return {"arrived": arrived, "excess": rounds["range"] - rounds["true_range"]}


def mean_within(samples: NDArray[Any], expected: float) -> None:
    """The mean over runs is the expected one, within the confidence bound of independent runs."""
    runs = samples.reshape(len(samples), -1).mean(1)
    bound = Z * runs.std(ddof=1) / sqrt(len(runs))
    assert runs.mean() == pytest.approx(expected, abs=bound)
    assert bound < 0.1 * expected


BURSTS = (("acoustics.loss_probability", 0.3), ("acoustics.loss_burst_length", 6.0))


def test_mean_loss_and_burst_length_are_recovered() -> None:
    lost = ~recorded(*BURSTS)["arrived"]
    mean_within(lost, 0.3)
    first = lost[:, 0]
    assert first.mean() == pytest.approx(0.3, abs=Z * sqrt(0.21 / first.size))
    again = lost[:, 1:][lost[:, :-1]]
    assert again.mean() == pytest.approx(
        1 - 1 / 6, abs=Z * sqrt(again.mean() * (1 - again.mean()) / again.size)
    )
    begins = lost[:, 1:][~lost[:, :-1]]
    rate = 0.3 / (6 * 0.7)
    assert begins.mean() == pytest.approx(rate, abs=Z * sqrt(rate / begins.size))


def test_beacons_fade_independently_of_each_other() -> None:
    lost = (~recorded(*BURSTS)["arrived"]).astype(float)
    for i, j in ((0, 1), (0, 3), (2, 3)):
        runs = [np.corrcoef(run[:, i], run[:, j])[0, 1] for run in lost]
        assert np.mean(runs) == pytest.approx(0, abs=Z * np.std(runs) / sqrt(len(runs)))


def test_identify_finds_bursts_in_the_losses_of_a_log() -> None:
    """95 % intervals of single logs hold the truth in most of many runs."""
    held = []
    for run in recorded(*BURSTS)["arrived"]:
        ping, beacon = np.nonzero(run)
        time_ns = (ping * 4 + beacon) * 100_000_000
        found = losses(time_ns, beacon)
        assert found is not None
        assert found.burst is not None
        held.append((found.share[1] <= 0.3 <= found.share[2],
                     found.burst[1] <= 6 <= found.burst[2]))
        assert found.burst[1] > 1 / 0.7  # not independent
    assert np.mean(held, axis=0) == pytest.approx([0.95, 0.95], abs=0.12)


ECHOES = (
    ("acoustics.loss_probability", 0.4), ("acoustics.water_depth_m", 3.5),
    ("acoustics.surface_echo_probability", 0.5), ("acoustics.bottom_echo_probability", 0.3),
)


def test_share_and_mean_excess_of_echoes_are_those_of_the_geometry() -> None:
    found = recorded(*ECHOES)
    arrived, excess = found["arrived"], found["excess"]
    # The surface is nearer to this diver: its echo is the first of two.
    for beacon, n in ((0, 3.0), (2, -3.0)):
        direct = hypot(15 - n, 1.5)
        late = [hypot(15 - n, 2.5) - direct, hypot(15 - n, 4.5) - direct]
        of = excess[..., beacon]
        there = arrived[..., beacon]
        for e, share in zip((0.0, *late), (0.6, 0.4 * 0.5, 0.4 * 0.5 * 0.3), strict=True):
            mean_within(there & (np.abs(of - e) < 1e-3), share)
        mean = np.array([run[which].mean() for run, which in zip(of, there, strict=True)])
        mean_within(mean, (0.2 * late[0] + 0.06 * late[1]) / 0.86)
    assert excess[arrived].min() > -1e-9
    mean_within(~arrived, 0.4 * 0.5 * 0.7)


def test_echoes_grow_with_the_lost_direct_path() -> None:
    shares = []
    for loss in (0.1, 0.4, 0.7):
        found = recorded(*{**dict(ECHOES), "acoustics.loss_probability": loss}.items())
        shares.append(np.mean(found["excess"][found["arrived"]] > 0.01))
    assert shares[0] < shares[1] < shares[2]


@pytest.mark.parametrize("more", [
    {}, {"acoustics.outlier_probability": 0.2, "acoustics.outlier_mean_m": 0.5},
    {"acoustics.ranging": "two_way", "acoustics.turnaround_s": 0.01},
])
def test_receivers_assume_the_mean_excess_of_late_ranges(more: dict[str, Any]) -> None:
    """That of outliers and echoes together; a range is late by the mean of both legs."""
    keys = {**dict(ECHOES), **more}
    found = recorded(*keys.items())
    assumed = load("harbour-square", {**STILL, **keys}).assumptions()
    late = found["arrived"] & (found["excess"] > 1e-3)
    mean = np.array([run[which].mean() for run, which in zip(found["excess"], late, strict=True)])
    mean_within(mean, assumed["outlier_mean_m"])
    share = late.sum((1, 2)) / found["arrived"].sum((1, 2))
    mean_within(share, assumed["outlier_probability"])


# --- In all masters ------------------------------------------------------------------------------

EVERYTHING = {
    **dict(ECHOES), "acoustics.loss_burst_length": 3.0, "time.duration_s": 30.0,
    "acoustics.profile_depth_m": [0.0, 2.0, 3.0],
    "acoustics.profile_speed_m_s": [1530.0, 1515.0, 1500.0],
}


@pytest.mark.parametrize("schedule", ["round_robin", "simultaneous"])
def test_the_masters_agree_to_the_bit(schedule: str) -> None:
    keys = {**EVERYTHING, "acoustics.schedule": schedule}
    runs = [sblcosim.run("harbour-square", "multilateration", keys, master=master, fmi=fmi)
            for master, fmi in (("python", 2), ("native", 3), ("lanes", 2))]
    first, *others = (it.record.values for it in runs)
    assert (first["acoustics.range"] != 0).any()
    for other in others:
        for name in ("range", "reception_count", "arrival_epoch", "true_range"):
            assert np.array_equal(first[f"acoustics.{name}"], other[f"acoustics.{name}"])


# --- The speed of sound --------------------------------------------------------------------------


def ray_time(depth: NDArray[Any], speed: NDArray[Any], far: float, begin: float, end: float
             ) -> float:
    """Shortest time [s] along a bent path: Fermat's principle, with many straight parts."""
    x = np.linspace(0.0, far, 41)
    lower, upper = np.full(39, depth[0]), np.full(39, depth[-1])

    def time(inner: NDArray[Any]) -> float:
        z = np.concatenate([[begin], inner, [end]])
        u = (np.arange(8) + 0.5) / 8
        along = z[:-1, None] + u * np.diff(z)[:, None]
        slow = (1 / np.interp(along, depth, speed)).mean(1)
        return float((np.hypot(np.diff(x), np.diff(z)) * slow).sum()) * 1e3

    start = np.linspace(begin, end, 41)[1:-1]
    found = minimize(time, start, method="L-BFGS-B", bounds=[*zip(lower, upper, strict=True)],
                     options={"maxiter": 500, "maxfun": 100_000, "ftol": 1e-15, "gtol": 1e-10})
    return float(found.fun) / 1e3


@pytest.mark.parametrize("far", [30.0, 100.0])
@pytest.mark.parametrize(("begin", "end"), [(0.5, 10.0), (10.0, 10.5)])
def test_straight_rays_are_wrong_by_less_than_is_said(far: float, begin: float, end: float
                                                      ) -> None:
    """Through a thermocline of a summer: 25 °C above 5 m, 15 °C below 15 m."""
    depth, speed = np.array([0.0, 5.0, 15.0, 30.0]), np.array([1535.0, 1535.0, 1508.0, 1508.0])
    z = np.linspace(begin, end, 100_001)
    straight = hypot(far, end - begin) * float((1 / np.interp(z, depth, speed)).mean())
    bent = ray_time(depth, speed, far, begin, end)
    error = 1500 * (straight - bent)
    bound = water.bending(depth.tolist(), speed.tolist(), far)
    assert -1e-6 < error < bound
    assert bound < 0.15
