"""Straight lines through short windows of a log: start, scatter of ranges, and wrong ranges.

In a window, the diver moves on a straight line, x(t) = p + v t, and the ranges fit it but for noise
and some that are far off: least squares with Cauchy's weights 1/(1 + (e/(2.385 s))²), with the
scale s from the median of the absolute residuals (P. J. Huber, E. M. Ronchetti, Robust Statistics,
2009, sections 7.8 and 7.9). No filter and no truth is needed. All windows are solved at once.

Receivers weigh ranges that are late by some metres, as from echoes. They believe those that are too
short, and lose the diver by those that are later than any echo nearby. Such ranges, as from an echo
of another ping or of a wall far away, are wrong, and left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus.host.nanoseconds import SECOND

from ..data.estimates import Flags, Floats, Integers
from ..data.samples import Samples

PER_BEACON, LONG = 3, 6
"""Ranges of each beacon in a window, on average, and in a long one, in which fewer chance to be
wrong than right."""
LONGEST_S = 120.0
"""Longest window [s]: a diver does not swim straight on for longer."""
WRONG = 10.0
"""A range is wrong if it is off by this many times the scatter, and the motion of the window."""
LATE_M = 40.0
"""A late range is wrong if it is late by this [m], and by half of the other limit: late ranges are
more usual than short ones, but not so late ones."""
_MOTION_M_S = 0.5
"""Deviation from a straight line per time of a window [m/s]: that of a diver who turns back."""
_SPEED_STD = 1.0
"""Standard deviation of the diver's speed per axis [m/s], so that a window needs few ranges."""
_TO_STD = 1.4826
"""Standard deviation of a normal distribution in units of its median absolute deviation."""
_TUNING = 2.385
_EARLY = 2.0
"""Loss of a range that is too short over that of a late one, which is more usual."""
_PASSES = 25
_ROUGHLY, _FINELY = 1e-2, 1e-4
"""A line that moves by less [m], [m/s] needs no further pass: when the best is sought, and then."""
TOGETHER = 4_000
"""Number of lines in the processor's cache."""
_STATES = 4
_LEAST_STD = 1e-3
"""Smallest scatter [m]."""


@dataclass(frozen=True)
class Window:
    """A straight line through a window.

    Attributes
    ----------
    begin_ns
        Begin of the window, to which the position belongs [ns].
    position, velocity
        NED [m], [m/s].
    std
        Standard deviations of the position, north and east [m].
    """

    begin_ns: int
    position: Floats
    velocity: Floats
    std: Floats


@dataclass(frozen=True, eq=False)
class Lines:
    """What straight lines through the windows of a log say.

    Attributes
    ----------
    first
        The first window, or None without any.
    scatter
        Robust standard deviation of the ranges about the lines [m], or None.
    offset
        Root mean square over the beacons of the median of a beacon's residuals [m].
    wrong
        Whether a range is far too short or far too late; shape (m,), in the order of the samples.
    residual
        Range minus that of its line [m]; NaN outside windows; shape (m,).
    """

    first: Window | None
    scatter: float | None
    offset: float
    wrong: Flags
    residual: Floats


def lines(
    samples: Samples, position: Floats, depth: float | None, per_beacon: int = PER_BEACON
) -> Lines:
    """Fit straight lines to all windows of a log.

    Parameters
    ----------
    position
        Position of the beacon of each range, NED [m]; shape (m, 3).
    depth
        Depth of the plane of a log in two dimensions [m]; None: there are readings.
    per_beacon
        Ranges of each beacon in a window, on average.
    """
    m = len(samples.range)
    length = per_beacon * max(len(set(samples.beacon.tolist())), 1)
    none = Lines(None, None, 0.0, np.zeros(m, bool), np.full(m, np.nan))
    if length < 3 * per_beacon or m < length or (depth is None and not len(samples.depth)):
        return none
    which, kept = _windows(samples.range_ns, length)
    count = len(which)
    begin = samples.range_ns[which[np.arange(count), kept.argmax(axis=1)]]
    time = np.where(kept, samples.range_ns[which] - begin[:, None], 0) / SECOND
    kept &= time <= LONGEST_S
    deep = np.full(count, depth) if depth is not None else np.interp(
        begin, samples.depth_ns, samples.depth
    )
    place, size = position[which], samples.range[which]
    usable = kept.sum(axis=1) > _STATES
    x, scale, normal = _solved(place, size, time, kept, deep)
    off = np.where(kept, size - _distance(x, place, time, deep), np.nan)
    usable &= np.isfinite(x).all(axis=1)
    if not usable.any():
        return none
    spread = np.where(usable, _spread(off, kept), np.nan)
    scatter = max(float(np.nanmedian(spread)), _LEAST_STD)
    limit = (WRONG * scatter + _MOTION_M_S * np.where(kept, time, 0.0).max(axis=1))[:, None]
    near = kept & (np.abs(off) <= limit)
    usable_near = near.sum(axis=1) > kept.sum(axis=1) / 2
    limit = np.maximum(limit, WRONG * _spread(off, near)[:, None])
    wrong, residual = np.zeros(m, bool), np.full(m, np.nan)
    far = (off < -limit) | (off > np.maximum(limit / 2, LATE_M))
    others = usable & usable_near & _others(samples.beacon[which], kept & ~far)
    wrong[which[others[:, None] & far]] = True
    inside = kept & usable[:, None]
    residual[which[inside]] = off[inside]
    i = int(usable.argmax())
    covariance = np.linalg.pinv(normal[i])
    std = np.sqrt(np.maximum(np.diag(covariance)[:2], 0.0)) * max(float(spread[i]), scatter) / max(
        float(scale[i]), _LEAST_STD)  # fmt: skip
    first = Window(
        int(begin[i]), np.array([x[i, 0], x[i, 1], deep[i]]), np.array([x[i, 2], x[i, 3], 0.0]),
        std,
    )
    return Lines(first, scatter, _offset(samples.beacon, residual), wrong, residual)


def _windows(time_ns: Integers, length: int) -> tuple[NDArray[np.intp], Flags]:
    """Numbers of the ranges of each window, (w, length), and which of them belong to it.

    Windows end at gaps; the last one before a gap has some ranges of the one before.
    """
    n = len(time_ns)
    ends = np.append(np.flatnonzero(np.diff(time_ns) > LONGEST_S / _STATES * SECOND) + 1, n)
    begins = np.append(0, ends[:-1])
    last = np.concatenate([
        np.append(np.arange(a + length, b, length), b) for a, b in zip(begins, ends, strict=True)
    ])
    run = np.searchsorted(ends, np.arange(n), "right")
    which = np.maximum(last, length)[:, None] - length + np.arange(length)
    return which, run[which] == run[last - 1][:, None]


def _spread(off: Floats, some: Flags) -> Floats:
    """Robust standard deviation of some residuals of each window, but for what the line takes."""
    count = np.maximum(some.sum(axis=1), 1)
    spread: Floats = _scale(off, some) * np.sqrt(count / np.maximum(count - _STATES + 1, 1))
    return spread


def _offset(beacon: Any, residual: Floats) -> float:
    """Root mean square over the beacons of the median of their residuals."""
    each = [residual[(beacon == one) & np.isfinite(residual)] for one in np.unique(beacon)]
    medians = [np.median(own) for own in each if len(own)]
    return float(np.sqrt(np.mean(np.square(medians))))


def _others(beacon: Any, good: Flags) -> Flags:
    """Whether each window has good ranges of three beacons, without which it says nothing."""
    kinds = [np.any(good & (beacon == one), axis=1) for one in np.unique(beacon)]
    others: Flags = np.sum(kinds, axis=0) >= 3
    return others


def _from_beacons(
    x: Floats, place: Floats, time: Floats, deep: Floats
) -> tuple[Floats, Floats, Floats]:
    """North and east of lines x (…, w, 4) from beacons (w, l, 3), and distances; (…, w, l)."""
    north = x[..., 0, None] + x[..., 2, None] * time - place[..., 0]
    east = x[..., 1, None] + x[..., 3, None] * time - place[..., 1]
    down = deep[:, None] - place[..., 2]
    return north, east, np.sqrt(north**2 + east**2 + down**2)


def _distance(x: Floats, place: Floats, time: Floats, deep: Floats) -> Floats:
    return _from_beacons(x, place, time, deep)[2]


_Data = tuple[Floats, Floats, Floats, Flags, Floats]


def _solved(
    place: Floats, size: Floats, time: Floats, kept: Flags, deep: Floats
) -> tuple[Floats, Floats, Floats]:
    """Best line of each window (w, 4), its scale (w,), and its normal matrix (w, 4, 4)."""
    data = place, size, time, kept, deep
    first, _ = _passes(_starts(place, size), data, _ROUGHLY)
    x, *_ = _best(first, *data)
    # A window with many wrong ranges may only find its line from that of a neighbour.
    beside = np.stack([x, np.roll(x, 1, axis=0), np.roll(x, -1, axis=0)])
    again, normal = _passes(beside, data, _FINELY)
    x, scale, best = _best(again, *data)
    return x, scale, normal[best, np.arange(len(x))]


def _passes(x: Floats, data: _Data, settled: float) -> tuple[Floats, Floats]:
    """Lines after some passes from other ones, and their normal matrices.

    A few lines go through all passes together, so that they stay in the processor's cache.

    Parameters
    ----------
    data
        Place, size, time, kept and depth of each window.
    settled
        A line that moves by less [m], [m/s] needs no further pass.
    """
    lines = x.reshape(-1, _STATES)
    found, normal = np.empty_like(lines), np.empty((*lines.shape, _STATES))
    window = np.tile(np.arange(x.shape[1]), len(x))
    reach = np.maximum(np.median(data[1], axis=1), 1e-6)
    for first in range(0, len(window), TOGETHER):
        some = slice(first, first + TOGETHER)
        own: Any = [values[window[some]] for values in (*data, reach)]
        left, moved = np.arange(len(own[0])), lines[some]
        for _ in range(_PASSES):
            moved, normal[first + left], step = _pass(moved, *own)
            found[first + left] = moved
            moving = np.abs(step).max(axis=1) > settled
            if not moving.any():
                break
            if not moving.all():
                left, moved, own = left[moving], moved[moving], [values[moving] for values in own]
    return found.reshape(x.shape), normal.reshape(*x.shape, _STATES)


def _pass(
    x: Floats, place: Floats, size: Floats, time: Floats, kept: Flags, deep: Floats, reach: Floats
) -> tuple[Floats, Floats, Floats]:
    """Better lines (n, 4), the normal matrices, and the steps, of at most ``reach`` [m] (n,)."""
    speed = np.diag([0.0, 0.0, 1.0, 1.0]) / _SPEED_STD**2
    north, east, distance = _from_beacons(x, place, time, deep)
    distance = np.maximum(distance, 1e-6)
    off = size - distance
    scale = _scale(off, kept)
    weight = kept / (1 + (off / (_TUNING * scale[..., None])) ** 2) / (scale**2)[..., None]
    rows = np.empty((*off.shape, _STATES))
    rows[..., 0], rows[..., 1] = north / distance, east / distance
    rows[..., 2:] = rows[..., :2] * time[..., None]
    weighted = np.swapaxes(rows * weight[..., None], -1, -2)
    normal = weighted @ rows + speed
    gain = (weighted @ off[..., None])[..., 0] - x @ speed
    damped = normal + 1e-9 * np.trace(normal, axis1=-2, axis2=-1)[..., None, None] * np.eye(4)
    step = np.linalg.solve(damped, gain[..., None])[..., 0]
    far = np.linalg.norm(step[..., :2], axis=-1) / reach
    step = step / np.maximum(far, 1.0)[..., None]
    return x + step, normal, step


def _best(
    x: Floats, place: Floats, size: Floats, time: Floats, kept: Flags, deep: Floats
) -> tuple[Floats, Floats, Any]:
    """Of several lines of each window the best, its scale, and its number."""
    off = size - _distance(x, place, time, deep)
    scale = _scale(off, kept)
    usual = np.median(scale.min(axis=0))
    # With a scale of its own, half of the ranges would as soon take the other side of two beacons.
    loss = np.where(kept, np.log1p((off / (_TUNING * usual)) ** 2), 0.0)
    loss = np.where(off < 0, _EARLY * loss, loss).sum(axis=-1)
    best, each = loss.argmin(axis=0), np.arange(x.shape[1])
    return x[best, each], scale[best, each], best


def _scale(off: Floats, kept: Flags) -> Floats:
    """Robust standard deviation of the residuals of each window."""
    size = np.sort(np.where(kept, np.abs(off), np.inf), axis=-1)
    count = kept.sum(axis=-1)
    if (count == kept.shape[-1]).all():  # mostly; all have the same places in the middle
        n = kept.shape[-1]
        median: Floats = (size[..., (n - 1) // 2] + size[..., n // 2]) / 2
    else:
        count = np.broadcast_to(count, size.shape[:-1])
        middle = np.stack([(count - 1) // 2, count // 2], axis=-1)
        median = np.take_along_axis(size, middle, axis=-1).mean(axis=-1)
    return np.maximum(_TO_STD * median, _LEAST_STD)


def _starts(place: Floats, size: Floats) -> Floats:
    """Where the search begins: about the beacons, and on all sides of them; (starts, w, 4)."""
    centre, reach = place[..., :2].mean(axis=1), np.median(size, axis=1)
    angles = np.arange(8) * np.pi / 4
    around = np.stack([np.cos(angles), np.sin(angles)], axis=-1)[:, None] * reach[:, None]
    points = np.concatenate([centre[None], centre + around])
    return np.concatenate([points, np.zeros_like(points)], axis=-1)
