"""The receiver `fixed_lag`: against a smoother that goes backwards in time, and how old it is."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from typing import Any

import numpy as np
import pytest
from coupled_reference import P_, PSI, SINK, Beside, J, N, Reference, gradient, retracted
from harness import NS, Array
from raft import LINE, Raft
from stepper import Stepper

PRIOR = {"initialisation": 2, "prior_position": (16.5, 3.5, 5.2), "prior_velocity": (0.1, 0.0, 0.0),
         "prior_position_std": 0.8, "prior_velocity_std": 0.5}
NOISY = {"range_std": 0.1, "loss_probability": 0.25}
SINKING = {"gps_vertical_error_std": 0.5, "gps_vertical_error_time": 60.0}
"""Off by default, and the way back needs a variance of every state."""
DIVER_AND_PLATFORM = [*range(6), *range(N)[P_], SINK]


class Backwards(Reference):
    """The filter with a diary, and from it the past by Rauch, Tung and Striebel.

    The deviation of a state from the filter's own is smoothed backwards: through a correction d
    along the arc with the Jacobian A, ``d + A^-1 δ``; through a prediction, ``P F' (FPF'+Q)^-1 δ``.
    """

    def __init__(self, p: Mapping[str, Any]) -> None:
        super().__init__(p)
        self.diary: list[tuple[str, Any]] = []
        self.kept: list[tuple[float, int, Array, Array, Beside]] = []
        self.estimates: list[tuple[float, Array, Array, Beside]] = []

    def predict(self, dt: float) -> None:
        before = self.P
        F, _ = self.transition(dt)
        super().predict(dt)
        self.diary.append(("predicted", (before, F, self.P)))

    def partly(self, gain: Array, H: Array, nu: float, R: float) -> None:
        before = self.P
        super().partly(gain, H, nu, R)
        self.diary.append(("predicted", (before, np.eye(N) - np.outer(gain, H), self.P)))

    def depth(self, z: float) -> None:
        before = self.mean
        super().depth(z)
        self.diary.append(("corrected", (self.mean - before, np.eye(N))))

    def correct(self, d: Array) -> None:
        y, before = self.mean[:2] - self.mean[P_], self.mean
        radius = np.linalg.norm(y)
        d_y = d[:2] - d[P_]
        arc = radius > 1 and y @ d_y / radius > -radius / 2 and abs((J @ y) @ d_y) < radius**2
        A = gradient(lambda d: retracted(before, d), d) if arc else np.eye(N)
        super().correct(d)
        self.diary.append(("corrected", (d, A)))

    def sampled(self) -> None:
        spacing = self.p["lag"] / 4
        if not self.kept or self.epoch - self.kept[-1][0] >= spacing - 1e-6:
            self.kept.append((self.epoch, len(self.diary), self.mean, self.P, copy(self.heave)))

    def anew(self, u: Mapping[str, Any]) -> None:
        super().anew(u)
        self.kept, self.diary = [], []

    def give(self, t: float) -> tuple[float, Array, Array, Beside] | None:
        """The newest state that is as old as the lag, unless it was given before."""
        ripe = [kept for kept in self.kept if t - kept[0] >= self.p["lag"] - 1e-6]
        if not ripe or (self.estimates and ripe[-1][0] <= self.estimates[-1][0]):
            return None
        epoch, begins, mean, _, heave = ripe[-1]
        delta, Pi = np.zeros(N), self.P
        for kind, what in reversed(self.diary[begins:]):
            if kind == "corrected":
                d, A = what
                back = np.linalg.inv(A)
                delta, Pi = d + back @ delta, back @ Pi @ back.T
            else:
                before, F, after = what
                scale = np.sqrt(np.diag(after))
                G = np.linalg.solve(after / np.outer(scale, scale),
                                    (F @ before) / scale[:, None]).T / scale
                delta, Pi = G @ delta, before + G @ (Pi - after) @ G.T
        self.estimates.append((epoch, mean + delta, Pi, heave))
        return self.estimates[-1]


def outputs_of(
    reference: Backwards, estimate: tuple[float, Array, Array, Beside]
) -> dict[str, Any]:
    """The outputs of `coupled` for an estimate of the past: all that is of diver and platform."""
    past = Reference(reference.p)
    epoch, mean, P, heave = estimate
    past.mean[DIVER_AND_PLATFORM] = mean[DIVER_AND_PLATFORM]
    past.P = np.zeros((N, N))
    rows = np.ix_(DIVER_AND_PLATFORM, DIVER_AND_PLATFORM)
    past.P[rows] = P[rows]
    past.epoch, past.heave = epoch, heave
    shown = past.output()
    return {name: shown[name] for name in (
        "epoch", "position", "velocity", "covariance", "relative_position", "relative_covariance",
        "platform_position",
    )}


def follow(raft: Raft, parameters: Mapping[str, Any], **settings: Any) -> tuple[int, Backwards]:
    """A dive by both; every estimate is compared, and how many there were is returned."""
    result = raft.dive(LINE, {**SINKING, **parameters}, receiver="fixed_lag", **settings)
    reference = Backwards(result.receiver.p)
    interval = result.receiver.interval_ns
    assert interval is not None
    rows, compared = {round(epoch, 6): row for row, epoch in enumerate(result.epoch)}, 0
    since = np.zeros(2)  # the last estimate: NIS and its degrees of freedom of all samples
    for k, u in enumerate(result.inputs, start=1):
        updates, restarts = reference.updates, reference.restarts
        reference.tick(u)
        if reference.restarts > restarts:
            since[:] = 0.0
        if reference.updates > updates:
            since += reference.nis, reference.degrees
        estimate = reference.give(k * interval / NS)
        if estimate is None:
            continue
        expected = outputs_of(reference, estimate)
        expected |= dict(zip(("nis", "nis_degrees"), since, strict=True))
        since[:] = 0.0
        row = rows.pop(round(expected["epoch"], 6))
        for name in ("position", "velocity", "covariance", "nis", "nis_degrees"):
            np.testing.assert_allclose(
                getattr(result, name)[row], expected[name], rtol=1e-5, atol=2e-6, err_msg=name
            )
        compared += 1
        last = expected
    assert not rows
    for name, value in last.items():
        np.testing.assert_allclose(
            result.receiver.y[name], value, rtol=1e-5, atol=2e-6, err_msg=name
        )
    return compared, reference


@pytest.mark.parametrize("lag", [0.4, 1.0, 3.0])
@pytest.mark.parametrize("ratio", [1, 4])
def test_it_smooths_as_one_does_backwards(lag: float, ratio: int) -> None:
    compared, _ = follow(Raft(), {"lag": lag}, ratio=ratio, acoustics=NOISY,
                         steps=30 * (2 + ratio))
    assert compared > 6


@pytest.mark.parametrize("parameters", [
    PRIOR, {"pose_source": 2}, {"pose_source": 3},
    {"outlier_probability": 0.1, "outlier_mean": 3.0},
])
def test_whatever_it_is_told(parameters: Mapping[str, Any]) -> None:
    late = {k: v for k, v in parameters.items() if k.startswith("outlier")}
    compared, _ = follow(Raft(), {"lag": 2.0, **parameters}, acoustics={**NOISY, **late},
                         steps=120)
    assert compared > 15


def test_arms_of_40_cm_and_a_ping_per_second() -> None:
    body = Raft().body * [0.4 / 3, 0.4 / 3, 1.0]
    compared, reference = follow(
        Raft(body=body), {"lag": 12.0, **PRIOR}, acoustics=NOISY, sampling_time=1.0, steps=100
    )
    assert compared > 15
    assert reference.P[PSI, PSI] > 0


def test_a_filter_that_starts_anew_forgets() -> None:
    wrong = {**PRIOR, "prior_position": (34.0, -2.0, 5.0), "prior_position_std": 1.0}
    compared, reference = follow(Raft(), {"lag": 1.0, **wrong}, acoustics=NOISY, steps=200)
    assert reference.restarts >= 1
    assert compared > 30


@pytest.mark.parametrize("ratio", [1, 3])
def test_every_sample_is_in_the_nis_of_one_estimate(ratio: int) -> None:
    """In all it is that of `coupled` on the same samples, up to those since the last estimate."""
    settings: dict[str, Any] = {"acoustics": NOISY, "steps": 150, "ratio": ratio}
    own = Raft().dive(LINE, {**SINKING, "lag": 1.5}, receiver="fixed_lag", **settings)
    other = Raft().dive(LINE, SINKING, receiver="coupled", **settings)
    for name in ("nis", "nis_degrees"):
        until = [getattr(other, name)[other.t <= t + 1e-9].sum() for t in own.t]
        np.testing.assert_allclose(np.cumsum(getattr(own, name)), until, rtol=1e-9)


def test_an_estimate_is_as_old_as_the_lag() -> None:
    """Up to the interval of the updates; in a gap of 20 s, too."""
    lag, interval = 5.0, 0.1
    box = Stepper("fixed_lag", {"lag": lag})
    box.step(0, NS // 10)
    raft, seen = Raft(gps_std=0.0, imu_std=0.0), []
    for n in range(1, 500):
        t, before = 0.1 * n, box.y["update_count"]
        if not 200 <= n < 400:
            place, attitude = raft.pose(t)
            box.set(
                range=np.linalg.norm(LINE(t)[0] - raft.beacons(t), axis=1),
                range_epoch=np.full(4, t), reception_count=np.full(4, float(n)),
                depth=LINE(t)[0][2], depth_epoch=t, ping_beacon_position=raft.reported(t),
                packet_beacon_position=raft.reported(t),
                ping_platform_position=np.tile(place, (4, 1)),
                ping_platform_attitude=np.tile(attitude, (4, 1)),
            )
        box.step(box.t_ns, NS // 10)
        if box.y["update_count"] != before:
            seen.append((t - box.y["epoch"], np.linalg.norm(box.y["position"]
                                                           - LINE(box.y["epoch"])[0])))
    ages, errors = np.array(seen).T
    assert len(ages) == pytest.approx((50 - 20 - lag) / (lag / 4), abs=3)
    assert (ages >= lag - 1e-6).all()
    assert (ages <= lag + interval + 1e-6).all()
    assert errors.max() < 1.0
