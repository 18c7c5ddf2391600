"""The dive of a log without a scenario: slot, duration and path, as a scenario has them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from sblcosim.fmus.host.nanoseconds import SECOND

from ..data.estimates import Floats
from ..logs.log import Log
from ..scenario.scenario import Scenario
from ..words.numbers import rounded
from .device import YES, Device
from .losses import usual
from .path import smoothed

POINTS = 200
"""Largest number of points of the path."""
_TOGETHER = 0.5
"""Beacons ping together if their pings follow each other faster than this share of a slot."""
_SHORTEST_S = 1e-3


def dive_of(log: Log, device: Device, base: Scenario) -> tuple[Mapping[str, Any], list[str]]:
    """Keys of a scenario that dives as the log did, and sentences on where they are from.

    Parameters
    ----------
    base
        The scenario with usual values.
    """
    span = (log.stop_ns - log.start_ns) / SECOND
    every = log.meta.interval_s or _every(log)
    together = _together(log, every)
    slot = max(float(f"{every if together else every / base.beacons:.6g}"), _SHORTEST_S)
    duration = max(round(span / slot), 1) * slot
    keys: dict[str, Any] = {
        "time.sampling_time_s": slot, "time.duration_s": float(f"{duration:.9g}"),
        "acoustics.schedule": "simultaneous" if together else "round_robin",
        **_speed(device, base),
    }
    if 0 < log.turnaround_s < slot:
        keys["acoustics.turnaround_s"] = float(f"{log.turnaround_s:.9g}")
    pings = "all beacons ping together" if together else "the beacons ping in turn"
    said = f"from the log, {pings}, each every {rounded(every, 3)} s; it lasts {rounded(span)} s"
    path = _path(device)
    if path is None:
        return keys, [f"scenario: {said}; its path is not from the log, but the default"]
    keys |= path
    return keys, [
        f"scenario: {said}, on the estimated path ({len(path['target.track_time_s'])} points, as "
        "smooth as the ranges allow)"
    ]


def _speed(device: Device, base: Scenario) -> dict[str, Any]:
    """The speed of sound as far off as the log allows, if that is less than the usual value."""
    (scale,) = (n for n in device.numbers if n.parameter == "range_scale")
    acoustics = base.acoustics
    usual_scale = acoustics.assumed_sound_speed_m_s / acoustics.sound_speed_m_s - 1
    if scale.told != YES or scale.low is None or scale.high is None:
        return {}
    if scale.low <= usual_scale <= scale.high:
        return {}
    farther = max(scale.low, scale.high, key=abs)
    return {"acoustics.sound_speed_m_s": acoustics.assumed_sound_speed_m_s / (1 + farther)}


def _every(log: Log) -> float:
    """Usual time between two pings of a beacon [s]."""
    heard = log.receptions
    gaps = [np.diff(np.unique(heard.epoch_ns[heard.beacon == b])) for b in np.unique(heard.beacon)]
    gap = np.concatenate(gaps) / SECOND
    return usual(gap) if len(gap) else 1.0


def _together(log: Log, every: float) -> bool:
    """Whether the beacons ping at once, rather than in turn."""
    heard = log.receptions
    order = np.argsort(heard.epoch_ns, kind="stable")
    other = np.diff(heard.beacon[order]) != 0
    gap = np.diff(heard.epoch_ns[order])[other] / SECOND
    fair = every / max(len(np.unique(heard.beacon)), 1)
    return bool(len(gap)) and float(np.median(gap)) < _TOGETHER * fair


def _path(device: Device) -> dict[str, Any] | None:
    """The estimated path, smoothed; None if the log gives none."""
    ranges, found = device.ranges, device.of_ranges.by_range
    time, first = np.unique(ranges.time, return_index=True)
    if len(time) < 3:
        return None
    std, _, _, psd, rate, turn, _ = device.motion.parameters.tolist()
    density = psd + (rate * turn**2 if device.motion.turns else 0.0)
    scattered = [np.asarray(found[axis][0], float)[first] for axis in ("north", "east")]
    if not np.isfinite([*scattered, ranges.down[first]]).all():
        return None
    try:
        north, east = (smoothed(time, each, std, density)[0] for each in scattered)
    except np.linalg.LinAlgError:  # estimates as scattered as those of a few centimetres of arms
        return None
    rows: Floats = np.column_stack([north, east, ranges.down[first]])
    at = np.linspace(time[0], time[-1], min(POINTS, len(time)))
    track = np.column_stack([np.interp(at, time, own) for own in rows.T])
    return {
        "target.trajectory": "file",
        "target.departure_time_s": round(max(float(time[0]), 0.0), 3),
        "target.track_time_s": np.round(at - at[0], 3).tolist(),
        "target.track_m": np.round(track, 3).tolist(),
    }
