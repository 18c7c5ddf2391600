"""Systems as people have them, to begin a scenario with, and what is asked about each.

Reading this module takes no time, as every command does it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..errors import ConfigurationError


@dataclass(frozen=True)
class Like:
    """A system. What is asked about it follows from its beacons and its path.

    Attributes
    ----------
    about
        What it is, in a line.
    source
        Name of a shipped scenario, or tables.
    """

    about: str
    source: str | Mapping[str, Any]


@dataclass(frozen=True)
class Asked:
    """A question about a system; `DECISIONS` in ``decisions.py`` read the answers.

    Attributes
    ----------
    name
        Its name, also of the option.
    about
        What it decides, in a sentence.
    example
        An answer.
    """

    name: str
    about: str
    example: str


ASKED: Mapping[str, Asked] = {
    it.name: it
    for it in (
        Asked("beacons", "Where the beacons are: points, or '6 x 3 m' for six on arms of 3 m. The "
              "farther apart, the better.", "2 1 0.5; 2 -1 0.5; -2 0 1.5"),
        Asked("mounting", "How well the positions of the beacons are known.", "0.05 m"),
        Asked("gps", "How good the GPS is. Its errors shift the estimates.", "rtk"),
        Asked("compass", "How good the compass is. Its errors turn the estimates about the "
              "platform.", "5 deg"),
        Asked("sea", "How rough the sea is. Waves move the platform with its beacons.",
              "Beaufort 3"),
        Asked("pings", "Time T between pings. One beacon pings after the other, so each of four "
              "pings every 4 T; acoustics.schedule = \"simultaneous\" lets all ping at once. More "
              "ranges average out more noise.", "0.5 s"),
        Asked("noise", "How noisy a range is. Many ranges average the noise out.", "0.2 m"),
        Asked("path", "Where the diver swims.", "0 0 5; 20 0 8"),
        Asked("depth", "How deep the diver is.", "5, 10 m"),
        Asked("speed", "How fast the diver swims, and so how far between pings.", "0.4 m/s"),
    )
}  # fmt: skip
"""What is asked, in this order: an answer may depend on an earlier one."""
_PLATFORM: Mapping[str, Any] = {
    "time": {"sampling_time_s": 0.1},
    "target": {"trajectory": "semicircle", "radius_m": 15.0, "depth_std_m": 0.05},
    "platform": {
        "beaufort": 2, "arm_length_m": 3.0, "gps_grade": "standalone",
        "imu_heading_turn_on_std_deg": 2.0, "imu_tilt_std_deg": 1.0,
    },
    "acoustics": {"range_std_m": 0.1, "loss_probability": 0.1},
    "receiver": {"type": "coupled", "acceleration_psd_m2_s3": "learned"},
}
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
        "ranging": "inverted", "range_std_m": 0.1, "loss_probability": 0.1,
        "outlier_probability": 0.05, "outlier_mean_m": 1.0, "clock_offset_std_s": 2e-5,
        "sound_speed_m_s": 1510.0, "assumed_sound_speed_m_s": 1500.0,
    },
    "receiver": {"type": "coupled", "acceleration_psd_m2_s3": "learned"},
}

LIKES: Mapping[str, Like] = {
    "platform": Like("a floating platform with four beacons on arms", _PLATFORM),
    "water-linked": Like(
        "four receivers hung off a boat at different depths; the diver's locator pings", _BOAT
    ),
    "usbl": Like(
        "hydrophones a few centimetres apart under a boat; the diver's locator pings", "usbl-boat"
    ),
    "buoys": Like("buoys around the dive, each with a GPS of its own", "gps-buoys"),
    "lbl": Like("beacons on the bottom, far apart", "harbour-lbl"),
    "paper": Like("the paper's floating cross of four beacons", "paper-scenario-1"),
}
USUAL = "platform"
"""The system of a scenario that is begun without a word about it."""


def like(word: str) -> Like:
    """A system by its name.

    Raises
    ------
    ConfigurationError
        There is none of this name.
    """
    from .typed import name

    try:
        return LIKES[name(word, LIKES)]
    except ConfigurationError as error:
        raise ConfigurationError(f"like: {error}") from None
