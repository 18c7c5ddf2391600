"""Logs of devices as they are found: several things are wrong in each, drawn from a seed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sblcosim.logs.checks import log_of
from sblcosim.logs.log import Log
from sblcosim.logs.raw import Raw

Floats = NDArray[np.float64]
ODD = (
    "misplaced", "scale", "offsets", "wrong depth", "gaps", "plane", "outliers", "short",
    "correlated", "blocked", "clock", "walk",
)
"""What may be wrong."""


@dataclass(frozen=True)
class Drawn:
    """A log, what is wrong in it, and the reach of the beacons or of the diver by a boat [m]."""

    log: Log
    odd: list[str]
    reach: float
    boat: bool


def _path(random: np.random.Generator, time: Floats, reach: float, deep: float) -> Floats:
    """A diver between random points, who turns in some seconds; NED [m]."""
    speed = float(random.uniform(0.2, 1.0))
    points = [random.uniform(-0.9, 0.9, 2) * reach]
    walked = [0.0]
    while walked[-1] < speed * time[-1] + reach:
        step = random.uniform(-0.9, 0.9, 2) * reach
        walked.append(walked[-1] + float(np.linalg.norm(step - points[-1])))
        points.append(step)
    along = speed * time
    level = np.column_stack([np.interp(along, walked, axis) for axis in np.array(points).T])
    width = max(int(random.uniform(2, 8) / float(np.median(np.diff(time)))), 1)
    smooth = np.ones(width) / width
    level = np.column_stack([
        np.convolve(np.pad(axis, width, mode="edge"), smooth, "same")[width:-width]
        for axis in level.T
    ])
    down = deep * (1 + 0.3 * np.sin(2 * np.pi * time / random.uniform(200, 900)))
    return np.column_stack([level, down])


def _lasting(random: np.random.Generator, time: Floats, std: float, tau: float) -> Floats:
    """A Gauss-Markov error at these times."""
    keep = np.exp(-np.diff(time, prepend=time[0]) / tau)
    new = std * np.sqrt(1 - keep**2) * random.standard_normal(len(time))
    out = np.empty(len(time))
    last = std * float(random.standard_normal())
    for i, (k, n) in enumerate(zip(keep.tolist(), new.tolist(), strict=True)):
        out[i] = last = k * last + n
    return out


def odd_log(seed: int) -> Drawn:
    """The log of a seed: fixed beacons among which a diver swims; in one of four, beacons close
    together, and in one, a boat with a pose in its packets."""
    random = np.random.default_rng(seed)
    boat, far = seed % 4 == 3, seed % 4 == 1
    allowed = [o for o in ODD if not (boat and o in ("plane", "misplaced"))]
    odd = sorted(random.choice(allowed, 3, replace=False).tolist())
    count = int(random.choice([4, 6] if boat else [4, 6, 8]))
    reach = float(np.exp(random.uniform(np.log(8), np.log(40) if boat else np.log(150))))
    std = float(np.exp(random.uniform(np.log(0.03), np.log(0.5))))
    deep = float(random.uniform(3, 15))
    spacing = float(random.choice([0.2, 0.25, 0.5, 1.0]))
    length = float(random.uniform(500, 1200))
    time = np.arange(spacing, length, spacing)
    time = time + spacing * 0.1 * random.uniform(-1, 1, len(time))
    beacon = np.arange(len(time)) % count
    kept = random.random(len(time)) > random.uniform(0, 0.3)
    if "gaps" in odd:
        for _ in range(int(random.integers(1, 4))):
            begin = random.uniform(0.1, 0.8) * length
            kept &= ~((time > begin) & (time < begin + random.uniform(30, 240)))
    if "outliers" in odd:
        kept &= random.random(len(time)) > 0.1
    truth_time = np.arange(0, length + 1, 0.2)
    path = _path(random, truth_time, reach, deep)
    plane = "plane" in odd
    if plane:
        path[:, 2] = 0.0
    time, beacon = time[kept], beacon[kept]
    at = np.column_stack([np.interp(time, truth_time, axis) for axis in path.T])
    places, true_places, extra, meta = _places(random, boat, odd, count, reach, time, plane, far)
    true_distance = np.linalg.norm(at - true_places[np.arange(len(time)), beacon], axis=1)
    ranges = true_distance + std * random.standard_normal(len(time))
    ranges += _errors(random, odd, time, beacon, true_distance, std)
    ranges = np.maximum(ranges, 0.01)
    if "wrong depth" in odd and not plane:
        bias = float(random.choice([-1, 1]) * random.uniform(0.3, 1.5))
    else:
        bias = 0.0
    shown = places[np.arange(len(time)), beacon]
    ns = np.rint(time * 1e9).astype(np.int64)
    late = np.rint(true_distance / 1500 * 1e9).astype(np.int64)
    meta |= {"dimension": 2 if plane else 3}
    offset = 0.0
    if "clock" in odd:
        offset = float(random.uniform(-300, 300))
        meta["clock"] = {"truth": {"offset_s": "estimate"}}
    raw = Raw(f"odd{seed}", meta=meta)
    raw.tables["receptions"] = pd.DataFrame({
        "arrival_ns": ns + late, "epoch_ns": ns, "beacon": [f"B{b}" for b in beacon],
        "range_m": ranges, "reported_n_m": shown[:, 0], "reported_e_m": shown[:, 1],
        "reported_d_m": shown[:, 2], **extra, "line": np.arange(2, len(time) + 2),
    })
    if not plane:
        depth_time = np.arange(0, length, 1.0)
        depth = np.interp(depth_time, truth_time, path[:, 2]) + bias
        depth = depth + 0.05 * random.standard_normal(len(depth))
        raw.tables["depth"] = pd.DataFrame({
            "time_ns": np.rint(depth_time * 1e9).astype(np.int64), "depth_m": depth,
        })
    raw.tables["truth"] = pd.DataFrame({
        "time_ns": np.rint((truth_time - offset) * 1e9).astype(np.int64),
        "n_m": path[:, 0], "e_m": path[:, 1], "d_m": path[:, 2],
    })
    return Drawn(log_of(raw), odd, reach, boat)


def _places(
    random: np.random.Generator, boat: bool, odd: list[str], count: int, reach: float,
    time: Floats, plane: bool, far: bool,
) -> tuple[Floats, Floats, dict[str, Any], dict[str, Any]]:
    """Reported and true places of all beacons at each time, columns of a pose, and meta."""
    angle = 2 * np.pi * (np.arange(count) + random.uniform(-0.3, 0.3, count)) / count
    n = len(time)
    if not boat:
        radius = reach * random.uniform(0.8, 1.3, count) * (0.15 if far else 1.0)
        ring = np.column_stack([
            radius * np.cos(angle), radius * np.sin(angle), random.uniform(1, 6, count),
        ])
        if plane:
            ring[:, 2] = 0.0
        said = ring.copy()
        if "misplaced" in odd:
            size = float(random.uniform(0.1, 0.6))
            said[:, :2] += size * random.standard_normal((count, 2))
            if random.random() < 0.5:
                said[int(random.integers(count)), :2] += random.uniform(1, 3) * np.array([0.6, 0.8])
        return (np.broadcast_to(said, (n, count, 3)), np.broadcast_to(ring, (n, count, 3)), {}, {})
    arm = float(random.uniform(2, 6))
    arms = np.column_stack([
        arm * np.cos(angle), arm * np.sin(angle), random.uniform(0.5, 2.5, count),
    ])
    drift = _lasting(random, time, float(random.uniform(0.2, 4)), 120.0), _lasting(
        random, time, float(random.uniform(0.2, 4)), 120.0)
    swing = np.deg2rad(random.uniform(1, 6))
    turns = [swing * np.sin(2 * np.pi * time / p + random.uniform(0, 6))
             for p in (5.3, 6.1)] + [0.5 * np.sin(2 * np.pi * time / 90) + random.uniform(0, 6)]
    pose = np.column_stack([drift[0], drift[1], 0.1 * np.sin(2 * np.pi * time / 6)])
    true = pose[:, None] + np.einsum("nij,kj->nki", _rotation(*turns), arms)
    said_pose = pose + np.column_stack([
        _lasting(random, time, 0.8, 200.0), _lasting(random, time, 0.8, 200.0),
        0.1 * random.standard_normal(n),
    ]) + np.append(0.2 * random.standard_normal((n, 2)), np.zeros((n, 1)), axis=1)
    noise = np.deg2rad([0.5, 0.5, 1.0])
    bias = np.deg2rad([0.3, 0.3, 1.5]) * random.standard_normal(3)
    said_turns = [t + s * random.standard_normal(n) + b
                  for t, s, b in zip(turns, noise, bias, strict=True)]
    said = said_pose[:, None] + np.einsum("nij,kj->nki", _rotation(*said_turns), arms)
    names = ("platform_n_m", "platform_e_m", "platform_d_m", "platform_roll_rad",
             "platform_pitch_rad", "platform_yaw_rad")
    extra = dict(zip(names, [*said_pose.T, *said_turns], strict=True))
    arms_m = {f"B{i}": a for i, a in enumerate(arms.round(3).tolist())}
    return said, true, extra, {"arms_m": arms_m}


def _rotation(roll: Floats, pitch: Floats, yaw: Floats) -> Floats:
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (np.cos, np.sin))
    rows = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return np.moveaxis(np.array([[np.broadcast_to(x, roll.shape) for x in row] for row in rows]),
                       2, 0)


def _errors(
    random: np.random.Generator, odd: list[str], time: Floats, beacon: NDArray[np.intp],
    distance: Floats, std: float,
) -> Floats:
    """Errors of the ranges beside noise [m]."""
    n, count = len(time), int(beacon.max()) + 1
    error = np.zeros(n)
    if "scale" in odd:
        error += 0.02 * float(random.standard_normal()) * distance
    if "offsets" in odd:
        size = float(random.uniform(0.5, 4)) * std
        error += (size * random.standard_normal(count))[beacon]
    share = float(random.uniform(0.1, 0.25)) if "outliers" in odd else 0.02
    mean = float(random.uniform(5, 30)) * std
    late = random.random(n) < share
    error[late] += mean * random.standard_exponential(int(late.sum()))
    if "short" in odd:
        early = random.random(n) < 0.01
        error[early] -= random.uniform(0.2, 0.8, int(early.sum())) * distance[early]
    for one in range(count):
        own = beacon == one
        if "correlated" in odd:
            tau = float(random.uniform(5, 60))
            error[own] += _lasting(random, time[own], std * float(random.uniform(1, 4)), tau)
        if "walk" in odd:
            step = np.sqrt(np.diff(time[own], prepend=time[own][0]))
            error[own] += np.cumsum(0.05 * std * step * random.standard_normal(len(step)))
        if "blocked" in odd and random.random() < 0.6:
            begin = float(random.uniform(0.05, 0.9)) * time[-1]
            inside = own & (time > begin) & (time < begin + random.uniform(20, 90))
            error[inside] += float(random.uniform(3, 20)) * std
    return error
