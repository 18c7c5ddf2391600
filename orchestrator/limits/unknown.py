"""Errors of a scenario that the reference does not include: with them less is possible.

All of them displace the beacons from where packets say they are: errors of the mounting, and of the
attitude beyond what the model includes. To first order, simultaneous ranges to beacons displaced by
δs_i move the estimate of a diver at known depth by δx = G⁻¹ Σ u_h,i (u_i·δs_i), with u_i and G as
in `sblcosim.limits.geometry`. Independent displacements with standard deviation σ per axis give the
covariance σ² G⁻¹. This is an approximation: in runs of `coupled` with and without such an error, at
10 to 60 m, the actual errors were 0.6 to 1.6 times as large where they matter.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from math import cos, sin, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.models.settings.assumptions import lasting_delay
from sblcosim.models.settings.motion import is_sine, of_waves

from ..scenario.arrangement import has_own_errors
from ..scenario.error_sources import DELAYS, SOURCES, SURVEY, UNMODELLED
from ..scenario.tracks import follows
from ..tracks.resample import motion
from ..words.lists import listed
from .geometry import hdop
from .parameters import beacons_of, parameters

if TYPE_CHECKING:
    from ..scenario.scenario import Scenario

Floats = NDArray[np.float64]

MATTERS = 0.05
"""What is left out is worth a word where it makes the error larger by this share."""
_PLATFORM = "platform."
_TIMES = 8
"""At which errors that grow are taken, where a diver is in one place."""


def left_out(scenario: Scenario) -> tuple[str, ...]:
    """Keys of nonzero errors that the reference does not include.

    Those of ``[platform]`` are without the name of the table.
    """
    known = {SURVEY, DELAYS} if has_own_errors(scenario.platform) else set()
    idle = {".".join(key) for key in scenario.idle()}
    return tuple(
        key.removeprefix(_PLATFORM) for key in UNMODELLED
        if _not_zero(_value(scenario, key)) and key not in known and key not in idle
    )


def squares(scenario: Scenario, position: Floats, since_s: Floats) -> dict[str, Floats]:
    """Mean squares of the errors that are left out [m²], by what they are in words; each (n,).

    Parameters
    ----------
    position
        Of divers, NED [m]; (n, 3).
    since_s
        Time of each since the start [s]; (n,).

    Returns
    -------
    dict
        NaN where ranges say nothing of the place, or nothing is known of such an error.
    """
    found = {}
    position = _beside(scenario.platform, position, np.asarray(since_s, float))
    for words, keys in _by_source(scenario):
        if DELAYS in keys:
            found[words] = _delayed(scenario, position)
        elif all(key in _MOUNTING for key in keys):
            found[words] = _mounted(scenario, position, keys)
        elif all(key.startswith("imu_") for key in keys):
            found[words] = _turned(scenario, position, since_s, keys)
        else:
            found[words] = np.full(len(position), np.nan)
    return found


def _beside(platform: Any, position: Floats, since_s: Floats) -> Floats:
    """Where divers were beside the platform, had it stayed where it was and kept its heading."""
    if not follows("platform", platform):
        course = np.deg2rad(platform.boat_course_deg)
        way = platform.boat_speed_m_s * np.array([cos(course), sin(course), 0.0])
        straight: Floats = position - since_s[:, None] * way
        return straight
    used = slice(platform.track_count)
    track = np.reshape(platform.track_m, (-1, 2))
    turned = np.deg2rad(platform.track_heading_deg or np.zeros(len(track)))
    points = np.column_stack([track, turned])[used]
    times = np.asarray(platform.track_time_s)[used]
    way, _ = motion(times, points, since_s - platform.departure_time_s)
    mean = np.asarray(platform.mean_position_m, float)
    north, east, down = (position - mean).T - np.stack([*way.T[:2], np.zeros(len(way))])
    c, s = np.cos(way[:, 2]), np.sin(way[:, 2])
    found: Floats = mean + np.column_stack([c * north + s * east, c * east - s * north, down])
    return found


def squares_in_places(
    scenario: Scenario, position: Floats, span_s: tuple[float, float]
) -> dict[str, Floats]:
    """`squares` of divers who stay at a place, mean over a time [m²]; each (n,)."""
    times = np.linspace(*span_s, _TIMES).tolist()
    every = [squares(scenario, position, np.full(len(position), time)) for time in times]
    return {words: np.mean([it[words] for it in every], axis=0) for words in every[0]}


def matter(possible_m: float, mean_square: Mapping[str, float]) -> dict[str, float]:
    """The errors that are left out, RMS [m], if they matter.

    Parameters
    ----------
    possible_m
        RMS error without them [m].
    mean_square
        Of each [m²], by what it is; NaN: not known, which matters.

    Returns
    -------
    dict
        Empty if all together make the RMS error larger by less than `MATTERS`. An error that is
        less than a twentieth of their mean square is not in it.
    """
    known = {words: it for words, it in mean_square.items() if np.isnan(it) or it > 0}
    total = float(np.nansum([*known.values()]))
    unknown = any(np.isnan(it) for it in known.values())
    if not np.isfinite(possible_m) or not known:
        return {}
    if not unknown and sqrt(possible_m**2 + total) <= (1 + MATTERS) * possible_m:
        return {}
    least = total / 20
    return {w: sqrt(it) for w, it in known.items() if np.isnan(it) or it >= least}


def sentence(sizes: Mapping[str, str], together: str = "") -> str:
    """What is left out in words.

    Parameters
    ----------
    sizes
        How large each error is, in words; empty: not known.
    together
        What is possible with them, in words; empty where that is not known.
    """
    names = [f"{words}, {size}" if size else words for words, size in sizes.items()]
    return f"{brief(names)}{together and f'; {together}'}"


def brief(errors: Iterable[str], what: str = "possible") -> str:
    """The sentence for a caption, without sizes; empty if nothing is left out."""
    names = list(errors)
    return f"{what} leaves out {listed(names)}" if names else ""


def _by_source(scenario: Scenario) -> Iterator[tuple[str, list[str]]]:
    """Words for a source, and its keys that are left out, without the name of the platform."""
    keys = left_out(scenario)
    for source in SOURCES.values():
        own = {key.removeprefix(_PLATFORM) for part in source.parts for key in part.unmodelled}
        if mine := [key for key in keys if key in own]:
            yield f"{source.words} ({', '.join(mine)})", mine


_MOUNTING = ("mounting_error_m", "mounting_std_m")


def _mounted(scenario: Scenario, position: Floats, keys: list[str]) -> Floats:
    """Of beacons that are not where they were meant to be."""
    platform = scenario.platform
    total = np.zeros(len(position))
    R, _, beacons = _placed(scenario)
    if "mounting_std_m" in keys:
        total += (platform.mounting_std_m * hdop(position, beacons).horizontal) ** 2
    if "mounting_error_m" in keys:
        shift = np.reshape(platform.mounting_error_m, (-1, 3)).astype(float)
        total += _response(position, beacons, shift @ R.T)
    return np.where(np.isfinite(total), total, np.nan)


def _delayed(scenario: Scenario, position: Floats) -> Floats:
    """Of answers that are late by an error of each beacon."""
    _, _, beacons = _placed(scenario)
    total = (lasting_delay(scenario.acoustics) * hdop(position, beacons).horizontal) ** 2
    return np.where(np.isfinite(total), total, np.nan)


def _turned(scenario: Scenario, position: Floats, since_s: Floats, keys: list[str]) -> Floats:
    """Of an attitude that is wrong."""
    p = scenario.platform
    R, arms, beacons = _placed(scenario)

    def of(axis: str, end: str) -> float:
        key = f"imu_{axis}_{end}"
        return float(getattr(p, key)) if key in keys else 0.0

    temperature = p.imu_temperature_offset_K + p.imu_temperature_rate_K_s * since_s
    late = since_s >= p.imu_step_time_s
    steady = {
        axis: of(axis, "drift_deg_s") * since_s + of(axis, "step_deg") * late
        + of(axis, "temperature_coefficient_deg_K") * temperature
        for axis in ("tilt", "heading")
    }  # fmt: skip
    units = [R @ np.cross(np.eye(3)[i], arms).T for i in range(3)]
    angles = np.deg2rad([steady["tilt"], steady["tilt"], steady["heading"]])
    total = _response(position, beacons, np.einsum("an,aib->nbi", angles, np.stack(units)))
    for axis, size in enumerate(_swinging(p, keys)):
        if size:
            total += size**2 * _response(position, beacons, units[axis].T)
    return np.where(np.isfinite(total), total, np.nan)


def _swinging(platform: Any, keys: list[str]) -> list[float]:
    """RMS errors of roll, pitch and yaw that follow the motion of the platform [rad]."""
    axes = ("roll", "pitch", "yaw")
    a = np.deg2rad([
        getattr(platform, f"{axis}_amplitude_deg") if is_sine(platform, axis)
        else sqrt(of_waves(platform)[1][0])  # half of the slope is along each axis
        for axis in axes
    ])
    squares_ = np.zeros(3)
    for axis, which in (("tilt", slice(0, 2)), ("heading", slice(2, 3))):
        if f"imu_{axis}_scale_factor_error" in keys:
            squares_[which] += (getattr(platform, f"imu_{axis}_scale_factor_error") * a[which]) ** 2
    if "imu_misalignment_deg" in keys:
        e = np.deg2rad(platform.imu_misalignment_deg)
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            squares_[i] += (e[j] * a[k]) ** 2 + (e[k] * a[j]) ** 2
    sizes: list[float] = np.sqrt(squares_ / 2).tolist()
    return sizes


def _placed(scenario: Scenario) -> tuple[Floats, Floats, Floats]:
    """From body to NED, nominal beacons in the body frame [m], and in still water, NED [m]."""
    arms = beacons_of(parameters(scenario))
    heading = np.deg2rad(scenario.platform.mean_heading_deg)
    c, s = cos(heading), sin(heading)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    place = np.asarray(scenario.platform.mean_position_m, np.float64)
    return R, arms, arms @ R.T + place


def _response(position: Floats, beacons: Floats, shift: Floats) -> Floats:
    """Square of the horizontal error of divers if beacons are displaced [m²]; (n,).

    Parameters
    ----------
    shift
        How far, NED [m]; (N, 3), or another one for each diver, (n, N, 3).
    """
    o = position[:, None, :] - beacons
    distance = np.sqrt((o**2).sum(-1, keepdims=True))
    u = o / np.where(distance > 0, distance, np.inf)
    G = np.einsum("nbi,nbj->nij", u[..., :2], u[..., :2])
    seen = (u * shift).sum(-1)
    right = np.einsum("nbi,nb->ni", u[..., :2], seen)
    good = np.linalg.cond(G) < 1e12
    moved = np.linalg.solve(np.where(good[:, None, None], G, np.eye(2)), right[..., None])[..., 0]
    found: Floats = np.where(good, (moved**2).sum(-1), np.nan)
    return found


def _value(scenario: Scenario, key: str) -> Any:
    table, _, name = key.partition(".")
    return getattr(getattr(scenario, table), name)


def _not_zero(value: Any) -> bool:
    return any(value) if isinstance(value, tuple) else bool(value)
