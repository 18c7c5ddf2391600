"""Where the smoother begins: estimates of a run at the epochs of its samples."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from model_dive import parameters
from sblcosim.data.estimates import Estimates
from sblcosim.data.samples import Samples
from sblcosim.estimation import start

SECOND = 1_000_000_000
WINDOW = 20
"""Packets that together give a heading, if each holds only its own beacon's position."""


def a_run(p: Any, rng: np.random.Generator, posed: bool) -> tuple[Any, Samples, np.ndarray]:
    """Record and samples of a platform that turns beyond a half turn, and its heading by packet."""
    count = 60
    range_ns = np.cumsum(rng.integers(1, 4, count)) * SECOND // 2
    depth_ns = np.arange(1, 90) * SECOND
    beacon = rng.integers(0, len(p.beacon_offset), count)
    heading = 2.0 + 0.03 * range_ns / SECOND
    middle = np.array([300.0, -140.0, 0.4]) + rng.normal(0, 3, (count, 3)) * [0, 0, 1]
    place, attitude = middle.copy(), np.zeros((count, 3))
    if posed:
        attitude[:, 2] = np.angle(np.exp(1j * heading))
    else:
        arm = p.beacon_offset[beacon]
        flat = (arm[:, :2] @ [1, 1j]) * np.exp(1j * heading)
        place += np.column_stack([flat.real, flat.imag, arm[:, 2]])
    samples = Samples(
        0, depth_ns, rng.uniform(3, 5, len(depth_ns)), range_ns, beacon,
        rng.uniform(9, 20, count), np.full(count, posed), place, attitude,
    )  # fmt: skip
    n = 40
    epoch_ns = np.cumsum(rng.integers(1, 3, n)) * SECOND + 250_000_000
    available_ns = epoch_ns + rng.integers(1, 4, n) * 10_000_000
    estimates = Estimates(
        epoch_ns=epoch_ns, position=rng.normal(0, 9, (n, 3)), velocity=rng.normal(0, 1, (n, 3)),
        available_ns=available_ns,
    )
    time_ns = np.arange(0, epoch_ns[-1] + SECOND, 10_000_000)
    rows = len(time_ns)
    own = {
        "platform_position": rng.normal(0, 1, (rows, 3)),
        "clock_offset": rng.normal(0, 1e-3, rows), "sound_speed": rng.uniform(1470, 1530, rows),
    }
    own["platform_position"][:, :2] = middle[0, :2]
    record = SimpleNamespace(
        time_ns=time_ns, values={f"it.{name}": values for name, values in own.items()},
        estimates=lambda label: estimates,
    )
    return record, samples, heading


@pytest.mark.parametrize("posed", [True, False], ids=["poses", "own positions"])
def test_it_has_what_the_estimates_say_by_straight_lines(posed: bool) -> None:
    p, rng = parameters(), np.random.default_rng(5)
    p.beacon_offset = p.beacon_offset * [[1.0], [0.5], [2.0], [0.7]]
    record, samples, heading = a_run(p, rng, posed)
    estimates = record.estimates("it")
    at = start.trajectory(record, "it", p, samples)
    epochs = samples.epochs_ns
    assert len(at) == len(epochs)
    own: dict[str, list[Any]] = {name: [] for name in ("platform", "error", "clock", "speed")}
    for epoch, there in zip(estimates.epoch_ns, estimates.available_ns, strict=True):
        row = int(np.flatnonzero(record.time_ns == there)[0])
        heard = max(int((samples.range_ns <= epoch).sum()) - 1, 0)
        down = samples.position[heard, 2]
        if not posed:
            down -= p.beacon_offset[samples.beacon[heard], 2]
        platform = record.values["it.platform_position"][row]
        own["platform"].append(platform)
        own["error"].append(down - platform[2])
        own["clock"].append(p.assumed_sound_speed * record.values["it.clock_offset"][row])
        own["speed"].append(p.assumed_sound_speed / record.values["it.sound_speed"][row] - 1)
    columns = np.column_stack([
        estimates.position, estimates.velocity, np.array(own["platform"]),
        own["clock"], own["speed"], own["error"],
    ])  # fmt: skip
    expected = [np.interp(epochs, estimates.epoch_ns, column) for column in columns.T]
    which = [0, 1, 2, 3, 4, 5, 6, 7, start.HEAVE, 15, 16, 18]
    np.testing.assert_allclose(at[:, which], np.transpose(expected), rtol=1e-12, atol=1e-12)

    seen = heading.copy()
    if not posed:  # the mean of a window about each packet, long arms more than short ones
        weight = np.linalg.norm(p.beacon_offset[samples.beacon][:, :2], axis=1) ** 2
        for i in range(len(heading)):
            some = slice(max(i - WINDOW // 2, 0), i + WINDOW // 2)
            seen[i] = np.angle(np.sum(weight[some] * np.exp(1j * heading[some])))
        seen = np.unwrap(seen)
    found = at[:, 12] - np.interp(epochs, samples.range_ns, seen)
    turns = found[0] / (2 * np.pi)
    assert turns == pytest.approx(round(turns), abs=1e-9)
    np.testing.assert_allclose(found, found[0], atol=1e-9)
    assert np.ptp(at[:, 12]) > 1.3
    others = np.delete(at, [*which, 12], axis=1)
    assert others.shape[1] == 9
    assert not others.any()
