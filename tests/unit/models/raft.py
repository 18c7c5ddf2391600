"""A platform that swings, turns and drifts, and what it reports: for dives with `coupled`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from coupled_reference import rotation
from harness import CROSS, Array, Dive, Path, dive, straight

LINE = straight((17.0, 4.0, 5.0), (-0.3, 0.4, 0.05))


@dataclass(frozen=True)
class Raft:
    """Errors are of every sample, but for that of the heading, which also has a constant part."""

    body: Array = field(default_factory=lambda: CROSS)
    gps_std: float = 0.1
    imu_std: float = 0.01
    heading_error: float = 0.0
    tilt: float = 0.05
    swing: float = 1.0
    center: tuple[float, float, float] = (5.0, -3.0, 0.0)
    heading: float = 2.9
    """Mean; with the swing it goes beyond 180° [rad]."""
    turning: float = 0.0
    """Rate of the heading [rad/s]."""
    seed: int = 3

    def true(self, t: float) -> tuple[Array, Array]:
        """Position [m] and roll, pitch, yaw [rad]."""
        swing = [0.8 * np.sin(0.2 * t), 0.5 * np.sin(0.15 * t + 1), 0.1 * np.sin(2 * t)]
        yaw = self.heading + self.turning * t + 0.5 * self.swing * np.sin(0.2 * t)
        tilt = (self.tilt * np.sin(1.3 * t), self.tilt * np.sin(1.1 * t + 1))
        return self.center + self.swing * np.array(swing), np.array([*tilt, yaw])

    def pose(self, t: float) -> tuple[Array, Array]:
        """What GPS and IMU say; the heading within ±180°."""
        rng = np.random.default_rng([self.seed, round(t * 1000)])
        place, attitude = self.true(t)
        place = place + self.gps_std * rng.standard_normal(3) * [1, 1, 0.2]
        attitude = attitude + self.imu_std * rng.standard_normal(3) + [0, 0, self.heading_error]
        attitude[2] = (attitude[2] + np.pi) % (2 * np.pi) - np.pi
        return place, attitude

    def beacons(self, t: float) -> Array:
        """Where they are."""
        place, attitude = self.true(t)
        return place + self.body @ rotation(*attitude).T

    def reported(self, t: float) -> Array:
        """Where they are said to be."""
        place, attitude = self.pose(t)
        return place + self.body @ rotation(*attitude).T

    def dive(
        self, path: Path = LINE, parameters: Mapping[str, Any] | None = None,
        receiver: str = "coupled", **settings: Any,
    ) -> Dive:
        """A dive with a receiver that knows how good the sensors are."""
        known = {"beacon_offset": self.body, "gps_std": self.gps_std,
                 "imu_heading_std": self.imu_std, "imu_tilt_std": self.imu_std,
                 "tilt_std": self.tilt, "depth_std": 0.05}
        return dive(
            receiver, path, beacons=self.beacons, reported=self.reported, pose=self.pose,
            parameters={**known, **(parameters or {})}, **{"depth_std": 0.05, **settings},
        )
