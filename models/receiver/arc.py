"""What a short baseline cannot observe: rotation of the diver's track about the platform.

y = x − p, horizontal. e_r = y/|y|, and e_t is e_r rotated by 90°. Corrections along e_t follow the
arc. The spread along the arc bends ranges and shifts the mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from .least_squares import symmetric
from .steps import Map
from .surroundings import (
    CLOCK,
    HEADING,
    NEAREST,
    PLATFORM,
    POSITION,
    VELOCITY,
    WIDEST,
    Measurement,
    Range,
    crescent,
)

_NORTH_EAST = list(POSITION[:2])
_SPEEDS = list(VELOCITY[:2])
_PLATFORM = list(PLATFORM)
_J = ca.SX([[0, -1], [1, 0]])


@dataclass(frozen=True, slots=True)
class Arc:
    """The diver as seen from the platform.

    Attributes
    ----------
    y, radius
        x − p, (2, 1), and its length, at least `NEAREST` [m].
    radial, tangential
        e_r and e_t, (2, 1).
    far
        Whether the diver is far enough for an arc: 0 or 1.
    spread, depth
        Variances of the bearing, at most `WIDEST` [rad²], and of the distance [m²].
    offset, with_offset
        Variance of what all ranges have in common, and its covariance with the distance [m²].
    heading, turned
        Variance of the platform's heading, and the excess variance of the bearing minus the
        heading, which is what bends a range; at most `WIDEST` [rad²].
    """

    y: Any
    radius: Any
    radial: Any
    tangential: Any
    far: Any
    spread: Any
    depth: Any
    heading: Any
    turned: Any
    offset: Any
    with_offset: Any


def about(mean: Any, P: Any, offsets: Sequence[int] = (CLOCK,)) -> Arc:
    """The arc of a state and its covariance.

    Parameters
    ----------
    offsets
        States that all ranges have in common [m].
    """
    y = mean[_NORTH_EAST] - mean[_PLATFORM]
    length = ca.sqrt(ca.sumsqr(y))
    radius = ca.fmax(length, NEAREST)
    radial = y / radius
    tangential = ca.vertcat(-radial[1], radial[0])
    P_yy = relative(P)
    P_yh = P[_NORTH_EAST, HEADING] - P[_PLATFORM, HEADING]
    return Arc(
        y, radius, radial, tangential,
        far=length > NEAREST,
        spread=ca.fmin(_form(tangential, P_yy) / radius**2, WIDEST),
        depth=_form(radial, P_yy),
        heading=ca.fmax(P[HEADING, HEADING], 0),
        turned=ca.fmin(ca.fmax(
            _form(tangential, P_yy) / radius**2 - 2 * ca.dot(tangential, P_yh) / radius, 0,
        ), WIDEST),
        offset=sum(P[i, j] for i in offsets for j in offsets),
        with_offset=sum(ca.dot(radial, P[_NORTH_EAST, i] - P[_PLATFORM, i]) for i in offsets),
    )


def relative(P: Any) -> Any:
    """Covariance of y, (2, 2)."""
    cross = P[_NORTH_EAST, _PLATFORM]
    return P[_NORTH_EAST, _NORTH_EAST] - cross - cross.T + P[_PLATFORM, _PLATFORM]


def _form(v: Any, matrix: Any) -> Any:
    return (
        v[0] ** 2 * matrix[0, 0] + 2 * v[0] * v[1] * matrix[0, 1] + v[1] ** 2 * matrix[1, 1]
    )


def bent(arc: Arc, row: Range) -> Measurement:
    """A range averaged over the spread of bearing, heading and distance.

    Rotation about the platform keeps the distance to its centre. Only the beacon's arm bends the
    range, to second order. The heading may be quite unknown: over its spread s, the arm keeps ``k =
    exp(-s/2)`` of its part in the range and in the slope. The rest is noise. So is what the
    distance bends one beacon's range more than it bends that of the centre, to second order. What
    it bends all alike, a clock that leaves the distance unknown takes.
    """
    first = (row.u[0] * arc.tangential[0] + row.u[1] * arc.tangential[1]) * arc.radius
    arm = (arc.y[0] * row.arm[0] + arc.y[1] * row.arm[1]) / row.distance
    s = arc.far * arc.heading
    k = ca.exp(-s / 2)
    along = 0.5 * (1 + k**4) - k**2
    across = 0.5 * (1 - k**4) - s * k**2
    second = arc.far * 0.5 * (k * arm - first**2 / row.distance) * arc.turned
    less = (1 - k) * first / arc.radius
    stretch = ca.sqrt(ca.fmax(sum(u**2 for u in row.u), 0.25))  # 1 + κ, but on a beacon
    deep = row.u[2] / stretch * row.distance + row.arm[2]
    slant = ca.sqrt(arc.radius**2 + deep**2)
    outward = row.u[0] * arc.radial[0] + row.u[1] * arc.radial[1]
    own = (1 - (outward / stretch) ** 2) / row.distance - deep**2 / slant**3
    flat = arc.far * 0.5 * stretch * own * _unseen(arc, outward, row.variance)
    turned = {
        **row.row,
        HEADING: k * row.row[HEADING],
        **{i: row.row[i] - less * arc.tangential[n] for n, i in enumerate(POSITION[:2])},
        **{i: row.row[i] + less * arc.tangential[n] for n, i in enumerate(PLATFORM)},
    }
    return Measurement(
        row.value + (1 - k) * arm + second + flat, turned,
        row.variance + along * arm**2 + across * first**2 + 2 * second**2 + 2 * flat**2,
    )


def _unseen(arc: Arc, outward: Any, noise: Any) -> Any:
    """Variance of the distance that a range leaves, because of what all have in common [m²]."""
    seen = outward * arc.depth + arc.with_offset
    total = outward * (seen + arc.with_offset) + arc.offset + noise
    return ca.fmax(arc.depth - seen**2 / total, 0)


def retract(mean: Any, P: Any, d: Any) -> tuple[Any, Any, Map]:
    """Apply a correction d of all states along the arc; the covariance rotates with it.

    Returns
    -------
    mean, P, turn
        ``turn`` is the map of the state's error, A.
    """
    y = mean[_NORTH_EAST] - mean[_PLATFORM]
    length = ca.sqrt(ca.sumsqr(y))
    radius = ca.fmax(length, NEAREST)
    radial = y / radius
    tangential = ca.vertcat(-radial[1], radial[0])
    d_y = d[_NORTH_EAST] - d[_PLATFORM]
    out, turn = ca.dot(radial, d_y), ca.dot(tangential, d_y) / radius
    on_arc = (length > NEAREST) * (out > -radius / 2) * (ca.fabs(turn) < 1)
    c, s = ca.cos(turn), ca.sin(turn)
    M = ca.vertcat(ca.horzcat(c, -s), ca.horzcat(s, c))
    v = mean[_SPEEDS]
    xi = d[_SPEEDS] - turn * (_J @ v)
    moved = ca.SX(mean + d)
    for states, curved in (
        (_NORTH_EAST, mean[_PLATFORM] + d[_PLATFORM] + M @ (y + out * radial)),
        (_SPEEDS, M @ (v + xi)),
    ):
        moved[states] = ca.if_else(on_arc, curved, moved[states])

    eye = ca.SX.eye(2)
    G = ca.if_else(
        on_arc, M @ (radial @ radial.T + (radius + out) / radius * (tangential @ tangential.T)), eye
    )
    lag = ca.if_else(on_arc, (M @ (_J @ xi)) @ tangential.T / radius, 0)
    A: dict[tuple[int, int], Any] = {}
    for rows, columns, block in (
        (_NORTH_EAST, _NORTH_EAST, G),
        (_NORTH_EAST, _PLATFORM, eye - G),
        (_SPEEDS, _SPEEDS, ca.if_else(on_arc, M, eye)),
        (_SPEEDS, _NORTH_EAST, lag),
        (_SPEEDS, _PLATFORM, -lag),
    ):
        A |= {(i, j): block[n, m] for n, i in enumerate(rows) for m, j in enumerate(columns)}
    turn = Map(A)
    matrix = turn.matrix(P.shape[0])
    return moved, symmetric(matrix @ P @ matrix.T), turn


def moments(arc: Arc, P: Any) -> tuple[Any, Any]:
    """Offset of the banana's mean from its crest, (2, 1), and the covariance that it adds.

    See `surroundings.crescent`.
    """
    once, along, across = crescent(ca, arc.radius, arc.far * arc.spread, arc.depth)
    more = arc.radius**2 * (
        along * (arc.radial @ arc.radial.T) + across * (arc.tangential @ arc.tangential.T)
    )
    return arc.y * (once - 1), more
