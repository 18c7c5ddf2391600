"""The speed of sound from temperature, salinity and depth, by TEOS-10.

T. J. McDougall, P. M. Barker, *Getting started with TEOS-10 and the Gibbs Seawater (GSW)
Oceanographic Toolbox*, SCOR/IAPSO WG127, 2011. Salinity is practical salinity; the water counts as
having the composition of standard seawater, which changes the speed by less than 0.05 m/s.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Any

SETTERS = ("temperature_C", "profile_depth_m", "profile_speed_m_s", "profile_temperature_C")
"""Keys of ``[acoustics]`` that decide the speed of sound, beside ``sound_speed_m_s``."""
KEYS = (*SETTERS, "salinity", "sample_depth_m", "profile_salinity", "profile_count")
"""All keys of ``[acoustics]`` that only the speed of sound depends on."""
SALINITY = 35.0
"""Practical salinity that is assumed if none is given."""
_LATITUDE = 45.0
"""Latitude [°] for the weight of water: elsewhere it differs by 0.3 %, 0.01 m/s in 200 m."""


@lru_cache(4096)
def sound_speed(temperature_C: float, salinity: float, depth_m: float) -> float:
    """Speed of sound [m/s].

    Parameters
    ----------
    temperature_C
        In the water [°C].
    salinity
        Practical salinity, a plain number.
    depth_m
        Depth [m].
    """
    import gsw  # only needed with a temperature

    pressure = gsw.p_from_z(-depth_m, _LATITUDE)
    absolute = gsw.SR_from_SP(salinity)
    conservative = gsw.CT_from_t(absolute, temperature_C, pressure)
    return float(gsw.sound_speed(absolute, conservative, pressure))


def mean_speed(depth_m: Sequence[float], speed_m_s: Sequence[float]) -> float:
    """Harmonic mean of a speed over depths, linear between them [m/s]."""
    if depth_m[-1] - depth_m[0] <= 0:
        return speed_m_s[0]
    # The channel takes 1/c as linear, the mean of which is that of its ends.
    time = sum(
        (b - a) * (1 / c + 1 / d) / 2
        for (a, b), (c, d) in zip(pairwise(depth_m), pairwise(speed_m_s), strict=True)
    )
    return (depth_m[-1] - depth_m[0]) / time


def derived(acoustics: Any) -> Mapping[str, Any]:
    """Keys of ``[acoustics]`` that follow from its temperatures, salinities and profile."""
    depths, speeds = acoustics.profile_depth_m, profile_speeds(acoustics)
    if depths and speeds is not None and len(speeds) == len(depths):
        return {
            "profile_count": len(depths), "profile_depth_m": depths, "profile_speed_m_s": speeds,
            "sound_speed_m_s": mean_speed(depths, speeds),
        }
    if acoustics.temperature_C is None:
        return {}
    salinity, depth = _or(acoustics.salinity, SALINITY), _or(acoustics.sample_depth_m, 0.0)
    return {"sound_speed_m_s": sound_speed(acoustics.temperature_C, salinity, depth)}


def of_profile(acoustics: Any) -> tuple[str, ...]:
    """Keys that a profile sets, and that must not be given beside it."""
    return ("sound_speed_m_s", "profile_speed_m_s") if acoustics.profile_count else ()


def profile_speeds(acoustics: Any) -> tuple[float, ...] | None:
    """Speeds at the depths of the profile [m/s]; None if they are not known for each of them."""
    if acoustics.profile_speed_m_s:
        return tuple(acoustics.profile_speed_m_s)
    depths, temperatures = acoustics.profile_depth_m, acoustics.profile_temperature_C
    if not depths or not temperatures:
        return None
    salinities = acoustics.profile_salinity
    if not salinities:
        salinities = (_or(acoustics.salinity, SALINITY),) * len(depths)
    if not len(depths) == len(temperatures) == len(salinities):
        return None
    return tuple(map(sound_speed, temperatures, salinities, depths))


def bending(depth_m: Sequence[float], speed_m_s: Sequence[float], distance_m: float) -> float:
    """Upper estimate of the error of straight rays over a distance [m of range].

    In water whose speed changes by g in each metre, the ray is an arc. Its time is shorter than
    that along the straight line by the share g² d²/24 c² of it, with the horizontal distance d (to
    second order). The steepest layer counts for the whole way.
    """
    steepest = max(
        (abs(d - c) / (b - a) / min(c, d) for (a, b), (c, d) in zip(
            pairwise(depth_m), pairwise(speed_m_s), strict=True) if b > a), default=0.0,
    )
    return distance_m**3 * steepest**2 / 24


def _or(value: float | None, otherwise: float) -> float:
    return otherwise if value is None else value
