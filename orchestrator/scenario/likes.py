"""Systems as people have them, to begin a scenario with, and what to ask of each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from ..errors import ConfigurationError, nearest
from ..words.lists import listed


@dataclass(frozen=True)
class KnownNumber:
    """One number of a system that its owner knows.

    Attributes
    ----------
    key
        Of a scenario, with its table.
    asks
        What to ask, with the unit; ``{}`` stands for its choices.
    choices
        What there is to choose from; not looked up before it is asked, as commands wait for it.
    """

    key: str
    asks: str
    choices: Callable[[], str] = str

    @property
    def text(self) -> str:
        """What to ask, with the unit."""
        choices = self.choices()
        return self.asks.format(choices) if choices else self.asks


@dataclass(frozen=True)
class Like:
    """A system.

    Attributes
    ----------
    about
        What it is, in a line.
    source
        Name of a shipped scenario, or tables.
    """

    about: str
    source: str | Mapping[str, Any]
    questions: tuple[KnownNumber, ...]


def _grades() -> str:
    from sblcosim.models.platform.gps import GRADES

    return listed([*GRADES], "or")


def _levels() -> str:
    from sblcosim.models.platform.beaufort import LEVELS

    return f"{min(LEVELS)} to {max(LEVELS)}"


_ARM = KnownNumber("platform.arm_length_m", "Length of its arms [m]")
_BEACONS = "Where the {} are: forward, right and down of {} [m], as [[x, y, z], ...]"
_PING = KnownNumber("time.sampling_time_s", "Time from ping to ping [s]")
_SPEED = KnownNumber("target.speed_m_s", "How fast the diver swims [m/s]")
_GPS = KnownNumber("platform.gps_grade", "The GPS: {}", _grades)
_SEA = KnownNumber("platform.beaufort", "The sea [Beaufort, {}]", _levels)
_BOAT: Mapping[str, Any] = {
    "title": "Four receivers off a boat",
    "time": {"sampling_time_s": 0.5},
    "target": {
        "trajectory": "waypoints", "speed_m_s": 0.4, "depth_std_m": 0.05, "depth_bias_m": 0.05,
        "waypoint_m": [[10.0, -15.0, 5.0], [10.0, 15.0, 7.0], [18.0, 15.0, 8.0],
                       [18.0, -15.0, 8.0], [26.0, -15.0, 9.0], [26.0, 15.0, 10.0]],
    },
    "platform": {
        "beaufort": 2,
        "beacon_m": [[2.5, 1.3, 1.0], [2.5, -1.3, 3.0], [-2.5, -1.3, 1.5], [-2.5, 1.3, 4.0]],
        "mounting_std_m": 0.05, "surge_amplitude_m": 1.0, "surge_frequency_Hz": 0.005,
        "sway_amplitude_m": 1.0, "sway_frequency_Hz": 0.004, "gps_grade": "standalone",
        "imu_heading_turn_on_std_deg": 2.0, "imu_tilt_std_deg": 0.5,
    },
    "acoustics": {
        "schedule": "simultaneous", "range_std_m": 0.1, "loss_probability": 0.1,
        "outlier_probability": 0.05, "outlier_mean_m": 1.0, "clock_offset_std_s": 2e-5,
        "sound_speed_m_s": 1510.0, "assumed_sound_speed_m_s": 1500.0,
    },
    "receiver": {"type": "coupled", "acceleration_psd_m2_s3": 0.003},
}

LIKES: Mapping[str, Like] = {
    "water-linked": Like(
        "four receivers hung off a boat at different depths; the diver's locator pings",
        _BOAT,
        (KnownNumber("platform.beacon_m", _BEACONS.format("receivers", "the boat's middle")),
         _GPS, _SEA, _PING, _SPEED),
    ),
    "buoys": Like(
        "buoys around the dive, each with a GPS of its own",
        "gps-buoys",
        (KnownNumber("platform.beacon_m", _BEACONS.format("beacons", "the middle of the buoys")),
         _GPS, _PING, _SPEED),
    ),
    "lbl": Like(
        "beacons on the bottom, far apart",
        "harbour-lbl",
        (KnownNumber("platform.beacon_m", _BEACONS.format("beacons", "the origin")),
         KnownNumber("platform.mounting_std_m", "How well they are surveyed, per axis [m]"),
         _PING, _SPEED),
    ),
    "paper": Like(
        "the paper's floating cross of four beacons",
        "paper-scenario-1",
        (_ARM, KnownNumber("platform.gps_horizontal_std_m", "White error of its GPS, per axis [m]"),
         _PING, _SPEED),
    ),
}


def like(name: str) -> Like:
    """A system by its name.

    Raises
    ------
    ConfigurationError
        There is none of this name.
    """
    if name not in LIKES:
        raise ConfigurationError(
            f"--like: must be {', '.join(LIKES)}, got {name!r}{nearest(name, LIKES)}"
        )
    return LIKES[name]
