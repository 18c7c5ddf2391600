"""A diver's path, the Acoustics and one receiver, coupled as the time contract says."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.models.loading import load
from sblcosim.models.ports import PING_POSE, RECEPTION
from stepper import Noise, Stepper

Array = NDArray[np.float64]
Path = Callable[[float], tuple[Array, Array]]
"""``path(t)``: true position in m and velocity in m/s, NED, at time t in s."""
Beacons = Callable[[float], Array]
"""``beacons(t)``: positions of the beacons at time t, m, NED, (4, 3)."""
Pose = Callable[[float], tuple[Array, Array]]
"""``pose(t)``: position in m and roll, pitch, yaw in rad that the platform reports at time t."""

NS = 10**9
CROSS = np.array([[3.0, 0.0, 0.5], [0.0, 3.0, 0.5], [-3.0, 0.0, 0.5], [0.0, -3.0, 0.5]])
"""Beacons of a cross with arms of 3 m."""
model = cache(load)


def cross(arm: float) -> Array:
    """Beacons of a cross with arms of a length in m."""
    return CROSS * [arm / 3, arm / 3, 1.0]


def at_rest(*position: float) -> Path:
    """A diver who stays where he is."""
    return lambda t: (np.array(position), np.zeros(3))


def straight(start: Any, velocity: Any) -> Path:
    """A diver on a straight line."""
    return lambda t: (np.asarray(start) + np.asarray(velocity) * t, np.asarray(velocity, float))


@dataclass(frozen=True)
class Dive:
    """One row per new estimate, and what the receiver saw at each of its ticks.

    Attributes
    ----------
    t
        Time of the tick that gave the estimate, s.
    error
        Estimate minus truth at its epoch, m.
    inputs
        The receiver's inputs at all its ticks, first tick first.
    """

    t: Array
    epoch: Array
    position: Array
    velocity: Array
    covariance: Array
    nis: Array
    nis_degrees: Array
    error: Array
    inputs: list[Mapping[str, Any]]
    receiver: Stepper

    @property
    def distance(self) -> Array:
        """Length of the error, m."""
        return np.linalg.norm(self.error, axis=1)


def dive(
    receiver: str,
    path: Path,
    *,
    steps: int = 300,
    sampling_time: float = 0.1,
    ratio: int = 1,
    acoustics: Mapping[str, Any] | None = None,
    parameters: Mapping[str, Any] | None = None,
    depth_std: float = 0.0,
    beacons: Beacons = lambda t: CROSS,
    reported: Beacons | None = None,
    pose: Pose | None = None,
    noise: Noise | None = None,
    seed: int = 1,
) -> Dive:
    """Simulate `steps` sampling times; distances are taken at the ping unless asked otherwise."""
    T = round(sampling_time * NS)
    channel = Stepper(
        model("acoustics"),
        {"sampling_time": sampling_time, "motion_during_travel": False, **(acoustics or {})},
        noise=noise, seed=seed,
    )
    box = Stepper(model(receiver), {"update_interval": ratio * sampling_time, **(parameters or {})})
    takes = {v.name for v in box.model.component.of("input")}
    rng = np.random.default_rng(seed)
    depth = depth_epoch = 0.0
    rows, inputs = [], []
    for n in range(steps):
        t = n * T
        position, velocity = path(t / NS)
        received = {v.name: channel.y[v.name] for v in (*RECEPTION, *PING_POSE) if v.name in takes}
        channel.set(
            target_position=position, target_velocity=velocity, beacon_position=beacons(t / NS),
            reported_beacon_position=(reported or beacons)(t / NS),
        )
        if pose is not None:
            place, attitude = pose(t / NS)
            channel.set(reported_position=place, reported_attitude=attitude)
        if n % ratio == 0:
            box.set(**received, depth=depth, depth_epoch=depth_epoch)
            before = box.y
            y = box.step(t, ratio * T)
            if n > 0:
                inputs.append(box.u)
            if y["update_count"] != before["update_count"]:
                truth = path(y["epoch"])[0]
                rows.append((t / NS, y["epoch"], y["position"], y["velocity"], y["covariance"],
                             y["nis"], y["nis_degrees"], y["position"] - truth))
        channel.step(t, T)
        if n > 0:
            depth, depth_epoch = position[2] + depth_std * rng.standard_normal(), t / NS
    columns = zip(*rows, strict=True) if rows else [()] * 8
    return Dive(*(np.array(column) for column in columns), inputs, box)


def simultaneous(
    receiver: str, position: Any, parameters: Mapping[str, Any] | None = None, *,
    beacons: Array = CROSS, errors: Any = 0.0,
) -> Stepper:
    """A receiver right after its first tick, at which all four ranges and the depth are fresh."""
    box = Stepper(model(receiver), {"update_interval": 0.1, **(parameters or {})})
    box.step(0, NS // 10)
    hear(box, position, 0.1, beacons=beacons, errors=errors)
    box.step(NS // 10, NS // 10)
    return box


def hear(box: Stepper, position: Any, epoch: float, *, beacons: Array = CROSS,
         errors: Any = 0.0) -> None:
    """Put four ranges and a depth of one epoch on a receiver's inputs."""
    box.set(
        range=np.linalg.norm(position - beacons, axis=1) + errors, range_epoch=np.full(4, epoch),
        reception_count=box.u["reception_count"] + 1, ping_beacon_position=beacons,
        packet_beacon_position=beacons, depth=position[2], depth_epoch=epoch,
    )


def follow(found: Dive, reference: Any, tolerance: float) -> None:
    """Show a reference all that a receiver saw in a dive, and compare them at each estimate."""
    rows = {round(epoch, 6): row for row, epoch in enumerate(found.epoch)}
    for u in found.inputs:
        before = reference.updates
        reference.tick(u)
        if reference.updates == before:
            continue
        row, expected = rows.pop(round(reference.epoch, 6)), reference.output()
        for name in ("position", "velocity", "covariance", "nis", "nis_degrees"):
            np.testing.assert_allclose(
                getattr(found, name)[row], expected[name], rtol=tolerance, atol=tolerance,
                err_msg=name,
            )
    assert not rows
    assert len(found.epoch) > 20
