"""A truth on a clock, or in a frame, of its own: its offset, turn and shift, from estimates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from sblcosim.fmus.host.nanoseconds import SECOND

from ..data.estimates import Estimates, Floats
from ..data.truth import Truth
from ..lazy import Module
from ..logs.log import Log
from ..words.numbers import signed

optimize: Any = Module("scipy.optimize")

_WIDEST_S = 600.0
"""Largest offset of clocks that is looked for [s], beyond that of the middles."""
_STEPS = 241
_LEAST = 30
"""Number of estimates that an alignment needs."""
_NEARLY = 1.1
"""Another offset of clocks fits nearly as well up to this many times the least distance."""


@dataclass(frozen=True)
class Alignment:
    """How a truth was brought to the clock and the frame of a log.

    Attributes
    ----------
    offset_s
        What was added to its times [s].
    turn_rad, shift_m
        Turn about the vertical, and then the shift north, east, down [m].
    estimated
        Whether the offset, and whether turn and shift, were estimated.
    alike_s
        The smallest and the largest of other offsets that fit nearly as well [s], as on a circle
        whose turn is not known either; None if there are none.
    """

    offset_s: float = 0.0
    turn_rad: float = 0.0
    shift_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    estimated: tuple[bool, bool] = (False, False)
    alike_s: tuple[float, float] | None = None

    def told(self, label: str) -> str:
        """What was done, as a sentence; empty if nothing was."""
        parts = []
        if self.offset_s or self.estimated[0]:
            parts.append(f"its clock by {signed(self.offset_s, 3)} s")
        if self.estimated[1]:
            north, east, down = self.shift_m
            parts.append(
                f"its frame by a turn of {signed(float(np.rad2deg(self.turn_rad)), 3)}° and "
                f"({signed(north)}, {signed(east)}, {signed(down)}) m"
            )
        if not parts:
            return ""
        how = (
            f"so that it fits {label} best; errors are what then remains"
            if any(self.estimated) else "as meta.toml says"
        )
        also = ""
        if self.alike_s is not None:
            low, high = (signed(end, 3) for end in self.alike_s)
            also = f"; other offsets of its clock, between {low} s and {high} s, fit nearly as well"
        return f"truth: moved {' and '.join(parts)}, {how}{also}"


def aligned(log: Log, estimates: Estimates) -> tuple[Truth, Alignment] | None:
    """The truth on the clock and in the frame of the log; None without a truth that fits.

    Parameters
    ----------
    estimates
        Estimates of the main receiver, in the times and coordinates of the log.
    """
    truth = log.truth
    if truth is None:
        return None
    stated = log.meta.clock.truth.offset_s
    by_clock = stated == "estimate" or not _overlaps(truth, log)
    by_frame = log.meta.frame.truth == "estimate"
    offset = 0.0 if by_clock else float(stated)
    alignment = Alignment(offset, estimated=(by_clock, by_frame))
    if by_clock or by_frame:
        fitted = _estimated(truth, estimates, alignment) if len(estimates) >= _LEAST else None
        if fitted is None:
            return None
        alignment = fitted
    return moved(truth, alignment), alignment


def moved(truth: Truth, by: Alignment) -> Truth:
    """A truth with another clock and frame."""
    turn = _turn(by.turn_rad)
    return replace(
        truth,
        time_ns=truth.time_ns + round(by.offset_s * SECOND),
        position=truth.position @ turn.T + by.shift_m,
        velocity=None if truth.velocity is None else truth.velocity @ turn.T,
    )


def _turn(angle: float) -> Floats:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _overlaps(truth: Truth, log: Log) -> bool:
    offset = log.meta.clock.truth.offset_s
    late = 0 if offset == "estimate" else round(float(offset) * SECOND)
    first, last = truth.start_ns + late, truth.stop_ns + late
    common = min(last, log.stop_ns) - max(first, log.start_ns)
    return common > 0.1 * min(last - first, log.stop_ns - log.start_ns)


def _estimated(truth: Truth, estimates: Estimates, begin: Alignment) -> Alignment | None:
    """The alignment with the smallest robust distance between truth and estimates.

    None if no alignment leaves enough estimates within the truth.
    """
    at = estimates.epoch_ns / SECOND
    zero = at[0]
    times = truth.time_ns / SECOND - zero

    def fitted(offset: float) -> tuple[float, float, Floats]:
        asked = at - zero - offset
        inside = (asked >= times[0]) & (asked <= times[-1])
        if inside.sum() < max(_LEAST, 0.3 * len(at)):
            return np.inf, 0.0, np.zeros(3)
        there = np.column_stack([np.interp(asked[inside], times, x) for x in truth.position.T])
        seen = estimates.position[inside]
        turn, shift = _rigid(there, seen) if begin.estimated[1] else (0.0, np.zeros(3))
        off = np.linalg.norm(there @ _turn(turn).T + shift - seen, axis=1)
        # Half of the estimates decide: outliers do not move it.
        return float(np.sqrt(np.mean(np.sort(off)[: len(off) // 2 + 1] ** 2))), turn, shift

    offset, found = begin.offset_s, []
    if begin.estimated[0]:
        middle = 0.0
        if not np.isfinite(fitted(0.0)[0]):  # too few estimates are within the truth
            middle = float((at[-1] - zero) / 2 - (times[0] + times[-1]) / 2)
        reach = min(_WIDEST_S, 0.7 * float(np.ptp(times)))
        for _ in range(4):
            grid = middle + np.linspace(-reach, reach, _STEPS)
            found.append((grid, np.array([fitted(o)[0] for o in grid])))
            middle = float(grid[int(np.argmin(found[-1][1]))])
            reach *= 4 / _STEPS
        offset = middle
    least, turn, shift = fitted(offset)
    if not np.isfinite(least):
        return None
    alike = None
    if found:
        others = _others(*found[0], offset, _NEARLY * least, lambda o: fitted(o)[0])
        alike = (min(others), max(others)) if others else None
    north, east, down = map(float, shift)
    return replace(
        begin, offset_s=offset, turn_rad=turn, shift_m=(north, east, down), alike_s=alike
    )


def _others(
    grid: Floats, distance: Floats, best: float, limit: float, at: Callable[[float], float]
) -> list[float]:
    """Offsets on a grid that fit within a limit, and are farther from the best than the next ones.

    Between the points of the grid, three more are looked for: after whole rounds, there may be one.
    """
    step = grid[1] - grid[0]
    far = np.abs(grid - best) > 2 * step
    others: list[float] = grid[far & (distance <= limit)].tolist()
    if others:
        return others
    inner = np.flatnonzero(
        far[1:-1] & (distance[1:-1] <= np.minimum(distance[:-2], distance[2:]))) + 1
    for i in inner[np.argsort(distance[inner])][:3]:
        near = optimize.minimize_scalar(at, bounds=grid[[i - 1, i + 1]], method="bounded")
        others += [float(near.x)] * bool(near.fun <= limit)
    return others


def _rigid(there: Floats, seen: Floats) -> tuple[float, Floats]:
    """Turn about the vertical, and shift, of least squares with weights against outliers."""
    weight = np.ones(len(there))
    turn, shift = 0.0, np.zeros(3)
    for _ in range(10):
        a, b = (np.average(x, axis=0, weights=weight) for x in (there, seen))
        p, q = (there - a)[:, :2], (seen - b)[:, :2]
        cross = (weight * (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])).sum()
        dot = (weight * (p * q).sum(axis=1)).sum()
        turn = float(np.arctan2(cross, dot))
        shift = b - _turn(turn) @ a
        off = np.linalg.norm(there @ _turn(turn).T + shift - seen, axis=1)
        weight = 1 / np.maximum(off, max(float(np.median(off)), 1e-9))
    return turn, shift
