"""How a boat on a recorded track moves: what receivers are told of its velocity and heading."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from .either import ratio, sqrt, square, total, where
from .expression import Expression, symbol

_STILL = 1e6
"""Correlation time [s] of what does not change."""
_LEAST = 1e-6
"""Shortest time between two points [s]."""

Rates = tuple[Any, Any]
"""Mean square of a rate, and sum of the squares of its changes per second; both per axis."""
_VELOCITY, _YAW = (
    tuple(f"platform.{key}[{what}]" for what in ("rates", "changes"))
    for key in ("track_m", "track_heading_deg")
)
RATES = (*_VELOCITY, *_YAW)
"""Inputs of the settings module in place of the points of a track: see `rates`."""


def heading(platform: Any) -> Any:
    """Mean heading of a platform that has none given [deg]: a boat points where it goes.

    On a track it turns, and the headings of the track say so.
    """
    moves = where(platform.track_count > 0, 0.0, platform.boat_speed_m_s)
    return where(moves != 0, platform.boat_course_deg, 0.0)


def turning(
    platform: Any, told: Mapping[str, Any], std: str, time: str, straight: Mapping[str, Any], *,
    yaw: bool = False,
) -> dict[str, Any]:
    """What receivers are told of a rate, with that of a boat on a track.

    The mean squares add, and so do the noises that change the rates, 2 σ²/τ. On a track that is
    the sum of the squares of its changes at the points, per second: it is at rest before and after.

    Parameters
    ----------
    told
        Standard deviation and, if known, correlation time [s] of the platform's own motion.
    std, time
        Their keys.
    straight
        What receivers are told without a track.
    yaw
        Whether the rate is that of the heading [deg/s], or the velocity, north and east [m/s].
    """
    count = platform.track_count
    follows = isinstance(count, Expression)
    if not follows and not count:
        return dict(straight)
    mean, changes = rates(platform, yaw)
    own = square(told[std])
    # A time that is not known belongs to a rate of 0.
    noise = changes + 2 * own / told.get(time, _STILL)
    both = own + mean
    slow = where(noise > 2 * both / _STILL, 2 * both * ratio(1.0, noise), _STILL)
    found = {**told, std: sqrt(both), time: slow}
    if not follows:
        return found
    return {key: where(count > 0, value, straight[key]) for key, value in found.items()}


def rates(platform: Any, yaw: bool) -> Rates:
    """How fast a boat moves or turns on its track, and how much that changes.

    In the settings module they are inputs: it has no room for all points.
    """
    if isinstance(platform.track_count, Expression):
        mean, changes = _YAW if yaw else _VELOCITY
        return symbol(mean), symbol(changes)
    width = 1 if yaw else 2
    flat = platform.track_heading_deg if yaw else platform.track_m
    times = platform.track_time_s[: platform.track_count]
    rows = [flat[width * i : width * (i + 1)] for i in range(min(len(times), len(flat) // width))]
    spans = [max(b - a, _LEAST) for a, b in pairwise(times)]  # their order is checked later
    rest = (0.0,) * width
    each = [
        [(b - a) / span for a, b in zip(*both, strict=True)]
        for both, span in zip(pairwise(rows), spans, strict=False)
    ]
    duration = max(total(spans), _LEAST) * width
    mean = total(span * _squares(rate, rest) for span, rate in zip(spans, each, strict=False))
    changes = total(_squares(*both) for both in pairwise([rest, *each, rest]))
    return mean / duration, changes / duration


def inputs(platform: Any) -> dict[str, float]:
    """The rates of a platform by their names in `RATES`; 0 without a track."""
    found = [rates(platform, yaw) if platform.track_count else (0.0, 0.0) for yaw in (False, True)]
    return dict(zip(RATES, (it for both in found for it in both), strict=True))


def _squares(one: Sequence[float], other: Sequence[float]) -> Any:
    return total(square(a - b) for a, b in zip(one, other, strict=True))
