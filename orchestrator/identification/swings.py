"""Swings of what carries the beacons: sinusoids of known frequency."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from sblcosim.models.settings.motion import is_sine

from ..data.estimates import Floats

_SHIFTS, _ANGLES = ("surge", "sway"), ("roll", "pitch", "yaw")


@dataclass(frozen=True, slots=True)
class CarrierSwing:
    """A horizontal swing.

    Attributes
    ----------
    frequency
        In Hz.
    amplitude
        Its usual size [m].
    """

    frequency: float
    amplitude: float


def swings_of(platform: Any, arm_m: float) -> tuple[CarrierSwing, ...]:
    """Swings of a point that a scenario's platform carries.

    Parameters
    ----------
    arm_m
        Distance of the point from the centre of the rotation [m].
    """
    sizes = [
        *((name, getattr(platform, f"{name}_amplitude_m")) for name in _SHIFTS),
        *((name, arm_m * np.radians(getattr(platform, f"{name}_amplitude_deg")))
          for name in _ANGLES),
    ]
    found: dict[float, float] = {}
    for name, size in sizes:
        frequency = float(getattr(platform, f"{name}_frequency_Hz"))
        if size and is_sine(platform, name):
            found[frequency] = max(found.get(frequency, 0.0), abs(float(size)))
    return tuple(CarrierSwing(frequency, size) for frequency, size in found.items())


def sines(time: Floats, swings: Sequence[CarrierSwing]) -> Floats:
    """Sine and cosine of each swing, (n, 2 swings)."""
    angle = 2 * np.pi * np.outer(time, [s.frequency for s in swings])
    both: Floats = np.stack([np.sin(angle), np.cos(angle)], axis=2).reshape(len(time), -1)
    return both
