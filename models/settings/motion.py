"""How a platform moves: mean squares of its motion, in the paper's sines or in a sea."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from ..platform import spectrum
from ..platform.variables import ANGLES
from . import either
from .either import square

Sums = tuple[Any, Any]
"""Mean squares of a motion and of its rate, summed over axes."""


def is_sine(platform: Any, axis: str) -> bool:
    """Whether an axis follows the paper's wave equation: all do, or yaw alone."""
    return bool(platform.motion == "sines" or axis == "yaw")


def of_sines(platform: Any, axes: Sequence[str]) -> Sums:
    """Of sinusoids; angles in degrees."""
    place: Any = 0.0
    rate: Any = 0.0
    for axis in axes:
        unit = "deg" if axis in ANGLES else "m"
        amplitude = getattr(platform, f"{axis}_amplitude_{unit}")
        fastest = 2 * math.pi * getattr(platform, f"{axis}_frequency_Hz") * amplitude
        place += square(amplitude) / 2
        rate += square(fastest) / 2
    return place, rate


def of_waves(platform: Any) -> tuple[Sums, Sums]:
    """Of a platform in a spectrum: its heave, or surge and sway together; roll and pitch [deg]."""
    period = platform.wave_period_s
    found = spectrum.mean_squares(
        either, platform.wave_height_m, spectrum.DEVELOPED if isinstance(period, str) else period,
        platform.wave_peak_enhancement, platform.raft_size_m, platform.raft_draught_m,
    )
    degrees = square(math.degrees(1.0))
    return (
        (found.place, found.place_rate), (degrees * found.slope, degrees * found.slope_rate)
    )


def of_mooring(platform: Any) -> Sums:
    """Of the drift in the watch circle, both axes."""
    place = 2 * square(platform.watch_circle_m / spectrum.WITHIN)
    return place, place / square(platform.mooring_time_s)
