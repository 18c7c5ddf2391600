"""The sequential filter: each sample once, at its own epoch, through the gate."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from harness import CROSS, NS, Dive, at_rest, dive, follow, hear, model, simultaneous, straight
from sblcosim.models import RECEIVERS
from stepper import Stepper

LINE = straight((15.0, 2.0, 5.0), (-0.3, 0.4, 0.05))
NOISY = {"range_std": 0.1, "loss_probability": 0.25}
PRIOR = {"initialisation": 2, "prior_position": (14.8, 2.1, 4.9), "prior_velocity": (0.1, 0.0, 0.0),
         "prior_position_std": 0.5, "prior_velocity_std": 0.4}
HERE = np.array([12.0, -7.0, 5.0])


class Reference:
    """Scalar Kalman updates in NumPy, one sample after another, gate included."""

    def __init__(self, p: dict[str, Any]) -> None:
        self.p = p
        self.mean = np.column_stack([p["prior_position"], p["prior_velocity"]]).ravel()
        self.P = np.kron(
            np.eye(3), np.diag([p["prior_position_std"] ** 2, p["prior_velocity_std"] ** 2])
        )
        self.epoch = 0.0
        self.counts = np.zeros(4)
        self.depth_epoch = 0.0
        self.nis, self.degrees = 0.0, 0
        self.updates = 0

    def tick(self, u: Any) -> None:
        queue = []
        if u["depth_epoch"] != self.depth_epoch:
            queue.append((u["depth_epoch"], -1))
        queue += [(u["range_epoch"][i], i)
                  for i in np.flatnonzero(u["reception_count"] != self.counts)]
        self.counts, self.depth_epoch = u["reception_count"], u["depth_epoch"]
        if queue:
            self.nis, self.degrees = 0.0, 0
            self.updates += 1
        for epoch, i in sorted(queue):
            dt, self.epoch = epoch - self.epoch, epoch
            F = np.kron(np.eye(3), [[1, dt], [0, 1]])
            Q = np.kron(np.eye(3), [[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
            self.mean = F @ self.mean
            self.P = F @ self.P @ F.T + self.p["acceleration_psd"] * Q
            position = self.mean[::2]
            if i < 0:
                gradient, nu, R = np.array([0, 0, 1]), u["depth"] - position[2], "depth_std"
            else:
                offset = position - u["ping_beacon_position"][i]
                gradient = offset / np.linalg.norm(offset)
                nu, R = u["range"][i] - np.linalg.norm(offset), "range_std"
            H = np.kron(gradient, [1.0, 0.0])
            S = H @ self.P @ H + self.p[R] ** (2 if self.p["measurement_noise"] == 1 else 1)
            if i >= 0 and 0 < self.p["gate"] * np.sqrt(S) < abs(nu):
                continue
            K = self.P @ H / S
            self.mean = self.mean + K * nu
            self.P = self.P - np.outer(K, H @ self.P)
            self.nis += nu**2 / S
            self.degrees += 1

    def output(self) -> dict[str, Any]:
        return {"position": self.mean[::2], "velocity": self.mean[1::2], "covariance": self.P,
                "nis": self.nis, "nis_degrees": self.degrees}


@pytest.mark.parametrize("ratio", [1, 4])
@pytest.mark.parametrize("gate", [0.0, 2.0])
@pytest.mark.parametrize("measurement_noise", [1, 2])
def test_it_equals_scalar_updates_in_order_of_epoch(
    ratio: int, gate: float, measurement_noise: int
) -> None:
    result = dive("sequential", LINE, steps=160, ratio=ratio, acoustics=NOISY, depth_std=0.1,
                  parameters={**PRIOR, "gate": gate, "gate_limit": 1000, "range_std": 0.2,
                              "depth_std": 0.05, "measurement_noise": measurement_noise})
    follow(result, Reference(result.receiver.p), 1e-9)


def test_each_sample_is_used_once() -> None:
    result = dive("sequential", LINE, steps=101, acoustics=NOISY, depth_std=0.1, parameters=PRIOR)
    last = result.inputs[-1]
    samples = last["reception_count"].sum() + round(last["depth_epoch"] / 0.1)
    assert result.receiver.counts["process"] == samples
    assert result.nis_degrees.sum() == samples


@pytest.mark.parametrize("ratio", [1, 2, 4, 8])
def test_a_tick_takes_at_most_five_turns(ratio: int) -> None:
    result = dive("sequential", LINE, steps=161, ratio=ratio, parameters=PRIOR)
    ticks = len(result.inputs)
    assert result.receiver.counts["process"] <= min(1 + ratio, 5) * ticks
    assert result.distance[-1] < 0.6


def test_with_an_update_interval_of_four_samples_no_range_is_lost() -> None:
    every = dive("sequential", LINE, steps=161, acoustics={"range_std": 0.0}, parameters=PRIOR)
    fourth = dive("sequential", LINE, steps=161, ratio=4, acoustics={"range_std": 0.0},
                  parameters=PRIOR)
    assert every.nis_degrees.sum() == 2 * len(every.epoch)
    # The first of them has seen three pings.
    assert fourth.nis_degrees.tolist() == [4] + [5] * (len(fourth.epoch) - 1)
    assert fourth.distance[-1] < 1e-3


def test_a_late_sample_is_taken_as_if_it_were_of_now() -> None:
    box = simultaneous("sequential", HERE)
    hear(box, HERE, 0.05)
    y = box.step(box.t_ns, NS // 10)
    assert y["epoch"] == 0.1
    assert np.linalg.norm(y["position"] - HERE) < 1e-6


def step_until(box: Stepper, count: int, errors: Any, start: int = 2) -> list[Any]:
    rows = []
    for n in range(count):
        hear(box, HERE, 0.1 * (start + n), errors=errors)
        rows.append(box.step(box.t_ns, NS // 10))
    return rows


def test_a_range_outside_the_gate_is_rejected_and_the_depth_is_not() -> None:
    box = simultaneous("sequential", HERE)
    rows = step_until(box, 20, 0.0)
    (outlier,) = step_until(box, 1, np.array([9.0, 0.0, 0.0, 0.0]), start=22)
    assert rows[-1]["nis_degrees"] == 5
    assert outlier["nis_degrees"] == 4
    assert np.linalg.norm(outlier["position"] - HERE) < 1e-6


def test_a_gate_of_zero_lets_everything_in() -> None:
    box = simultaneous("sequential", HERE, {"gate": 0.0})
    step_until(box, 20, 0.0)
    (outlier,) = step_until(box, 1, np.array([9.0, 0.0, 0.0, 0.0]), start=22)
    assert outlier["nis_degrees"] == 5
    assert np.linalg.norm(outlier["position"] - HERE) > 0.5


def test_depth_readings_do_not_lower_the_score_of_rejections() -> None:
    box = simultaneous("sequential", HERE, {"gate_limit": 1000})
    step_until(box, 20, 0.0)
    for n in range(1, 4):
        step_until(box, 1, 9.0, start=21 + n)
        assert box.state("score") == 4 * n


@pytest.mark.parametrize("limit", [None, 1, 2, 7])
def test_a_range_rejected_at_the_limit_is_the_one_that_starts_it_anew(limit: int | None) -> None:
    box = simultaneous("sequential", HERE, {} if limit is None else {"gate_limit": limit})
    step_until(box, 20, 0.0)
    scores = []
    for n in range((limit or 5) + 1):
        count = box.u["reception_count"].copy()
        hear(box, HERE, 0.1 * (22 + n), errors=np.array([9.0, 0.0, 0.0, 0.0]))
        box.set(reception_count=count + np.array([1, 0, 0, 0]))
        y = box.step(box.t_ns, NS // 10)
        scores.append(box.state("score"))
    assert scores == [*range(1, (limit or 5) + 1), 0]
    assert y["nis_degrees"] == 0


def test_defaults_of_the_receivers() -> None:
    """Studies rely on them: another one is another filter."""
    sensors = {
        "update_interval": 0.1, "range_std": 0.1, "depth_std": 0.1, "beacon_position_source": 1,
        "measurement_noise": 1,
    }
    motion = {
        "initialisation": 1, "prior_position": (0.0,) * 3, "prior_velocity": (0.0,) * 3,
        "prior_position_std": 1.0, "prior_velocity_std": 1.0, "process_noise": 1,
        "acceleration_psd": 0.01,
    }
    expected = {
        "ekf": sensors | motion,
        "sequential": sensors | motion | {"gate": 4.0, "gate_limit": 5},
        "multilateration": sensors,
    }
    for name, parameters in expected.items():
        found = {v.name: v.starts if v.shape else v.start
                 for v in RECEIVERS[name].of("parameter")}
        assert found == parameters


def test_it_starts_anew_when_the_limit_is_reached() -> None:
    box = simultaneous("sequential", HERE, {"gate_limit": 6})
    step_until(box, 20, 0.0)
    there = np.array([-9.0, 11.0, 3.0])
    errors = np.linalg.norm(there - CROSS, axis=1) - np.linalg.norm(HERE - CROSS, axis=1)
    before = box.y["update_count"]
    rows = []
    for n in range(3):
        hear(box, HERE, 0.1 * (22 + n), errors=errors)
        box.set(depth=there[2])
        rows.append(box.step(box.t_ns, NS // 10))
    away = [np.linalg.norm(y["position"] - there) for y in rows]
    assert away[0] > 5.0
    assert away[1] < 1e-6
    assert rows[1]["nis_degrees"] == 0
    assert rows[1]["epoch"] == pytest.approx(2.3)
    assert [y["update_count"] - before for y in rows] == [1, 2, 3]


def test_nothing_new_means_no_new_estimate() -> None:
    box = dive("sequential", LINE, steps=50).receiver
    before = box.y
    after = box.step(box.t_ns, NS // 10)
    for name, value in before.items():
        np.testing.assert_array_equal(after[name], value, err_msg=name)


def test_covariances_are_symmetric_and_positive() -> None:
    cases: list[Dive] = [
        dive("sequential", LINE, steps=200, acoustics=NOISY, depth_std=0.1),
        dive("sequential", at_rest(0.1, 0.2, 2.0), steps=200, acoustics=NOISY,
             parameters={"range_std": 1e-6, "depth_std": 1e-6, "gate": 0.0}),
        dive("ekf", LINE, steps=200, acoustics=NOISY, depth_std=0.1),
        dive("ekf", LINE, steps=200, parameters={"range_std": 1e-5, "depth_std": 1e-5}),
    ]
    for result in cases:
        P = result.covariance
        np.testing.assert_array_equal(P, P.transpose(0, 2, 1))
        scale = np.sqrt(np.einsum("nii->ni", P))
        assert (scale > 0).all()
        assert np.linalg.eigvalsh(P / (scale[:, :, None] * scale[:, None, :])).min() > -1e-9


@pytest.mark.parametrize("name", ["acoustics", "ekf", "sequential", "multilateration"])
@pytest.mark.parametrize("heard", [False, True])
def test_what_a_guard_would_have_skipped_is_finite_too(name: str, heard: bool) -> None:
    """Side by side with a run that loops, one that does not evaluates the body in vain."""
    box = Stepper(model(name))
    if heard and name != "acoustics":
        hear(box, HERE, 0.1)
    functions = box.functions
    noise = np.full(functions.tick.size1_in(3), 0.5)
    results = [functions.tick(box.x, box._u, box._p, noise, 0.1, 1)]
    results += [body(box.x, box._u, box._p, [], 0.1) for body in functions.bodies.values()]
    for result in results:
        assert np.isfinite(result.full()).all()
