"""How a boat on a recorded track moves: what receivers are told of its velocity and heading."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from .either import ratio, sqrt, square, where
from .expression import UNKNOWN, Expression

_STILL = 1e6
"""Correlation time [s] of what does not change."""
_LEAST = 1e-6
"""Shortest time between two points [s]."""

Rates = tuple[float, float]
"""Mean square of a rate, and sum of the squares of its changes per second; both per axis."""


def heading(platform: Any) -> Any:
    """Mean heading of a platform that has none given [deg]: a boat points where it goes.

    On a track it turns, and the headings of the track say so.
    """
    moves = where(platform.track_count > 0, 0.0, platform.boat_speed_m_s)
    return where(moves != 0, platform.boat_course_deg, 0.0)


def turning(
    platform: Any, told: Mapping[str, Any], std: str, time: str, *, yaw: bool = False
) -> dict[str, Any]:
    """What receivers are told of a rate, with that of a boat on a track.

    The mean squares add, and so do the noises that change the rates, 2 σ²/τ. On a track that is
    the sum of the squares of its changes at the points, per second: it is at rest before and after.

    Parameters
    ----------
    told
        Standard deviation and, if known, correlation time [s] without a track.
    std, time
        Their keys.
    yaw
        Whether the rate is that of the heading [deg/s], or the velocity, north and east [m/s].
    """
    count = platform.track_count
    if isinstance(count, Expression):  # the points are not inputs of the settings module
        return {key: where(count > 0, UNKNOWN, value) for key, value in told.items()}
    if not count:
        return dict(told)
    mean, changes = _rates(platform, yaw)
    own = square(told[std])
    noise = changes + 2 * own / told.get(time, _STILL)
    both = own + mean
    slow = where(noise > 2 * both / _STILL, 2 * both * ratio(1.0, noise), _STILL)
    return {**told, std: sqrt(both), time: slow}


def _rates(platform: Any, yaw: bool) -> Rates:
    width = 1 if yaw else 2
    flat = platform.track_heading_deg if yaw else platform.track_m
    times = platform.track_time_s[: platform.track_count]
    rows = [flat[width * i : width * (i + 1)] for i in range(min(len(times), len(flat) // width))]
    spans = [max(b - a, _LEAST) for a, b in pairwise(times)]  # their order is checked later
    rest = (0.0,) * width
    rates = [
        [(b - a) / span for a, b in zip(*both, strict=True)]
        for both, span in zip(pairwise(rows), spans, strict=False)
    ]
    duration = max(sum(spans), _LEAST) * width
    mean = sum(span * _squares(rate, rest) for span, rate in zip(spans, rates, strict=False))
    changes = sum(_squares(*both) for both in pairwise([rest, *rates, rest]))
    return mean / duration, changes / duration


def _squares(one: Sequence[float], other: Sequence[float]) -> float:
    return sum((a - b) ** 2 for a, b in zip(one, other, strict=True))
