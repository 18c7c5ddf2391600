"""Sea states: waves and platform motion for a Beaufort number (the paper's section 4).

The README of this folder gives sources and derivation. The tests recompute the slopes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians, sqrt

from ..preset import Preset

YAW_PERIOD = 20.0
"""Period of the swing about the mooring [s]; an assumption."""


@dataclass(frozen=True, slots=True)
class Level:
    """A sea state, and how a raft of 1.6 m responds to it.

    Attributes
    ----------
    wave_height
        Significant wave height H_s [m]: the probable wave height in the WMO's Beaufort table.
    slope_rms
        RMS inclination of the raft [rad].
    """

    wave_height: float
    slope_rms: float

    @property
    def period(self) -> float:
        """Peak period of the fully developed sea [s], T_p = 5.0 √H_s (H_s in m)."""
        return 5.0 * sqrt(self.wave_height)

    @property
    def angle_amplitude(self) -> float:
        """Amplitude of a sinusoid with this RMS slope [rad]; for roll, pitch and yaw."""
        return sqrt(2.0) * self.slope_rms

    @property
    def heave_amplitude(self) -> float:
        """Amplitude of a sinusoid with the RMS of the surface, H_s / 4 [m]."""
        return sqrt(2.0) * self.wave_height / 4.0


LEVELS: Mapping[int, Level] = {
    0: Level(0.0, 0.0),
    1: Level(0.1, radians(1.2)),
    2: Level(0.2, radians(2.2)),
    3: Level(0.6, radians(3.9)),
    4: Level(1.0, radians(4.6)),
    5: Level(2.0, radians(5.5)),
    6: Level(3.0, radians(5.9)),
}


def sea_state(beaufort: int) -> Mapping[str, float]:
    """Parameters of the Platform for a Beaufort number, by name, in SI units.

    Raises
    ------
    KeyError
        The number is not a key of `LEVELS`.
    """
    level = LEVELS[beaufort]
    amplitudes = {
        "roll_amplitude": level.angle_amplitude,
        "pitch_amplitude": level.angle_amplitude,
        "yaw_amplitude": level.angle_amplitude,
        "heave_amplitude": level.heave_amplitude,
        "wave_height": level.wave_height,
    }
    if not level.period:
        return amplitudes
    return amplitudes | {
        "roll_frequency": 1.0 / level.period,
        "pitch_frequency": 1.0 / level.period,
        "yaw_frequency": 1.0 / YAW_PERIOD,
        "heave_frequency": 1.0 / level.period,
        "wave_period": level.period,
    }


PRESET = Preset(
    "beaufort", "platform", "Sea state, {}: sets the keys of the waves that are not given",
    sea_state, LEVELS,
)
