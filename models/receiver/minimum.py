"""The minimum of a fix's cost to rounding: accelerated Gauss-Newton far away, then Newton."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from .least_squares import adjugate, reciprocal, symmetric
from .measurements import DEPTH, Samples, distance

_NEAR = 0.1
"""A step below this fraction of the shortest beacon distance may be followed by a Newton step."""
_DEFINITE = 0.1
"""Smallest ratio of the leading minors of the second derivative to those of the information."""
_BEND = 0.75
"""Largest acceleration as a fraction of the step; beyond it the series is meaningless."""
_LAST_OF_NEWTON = 1e-6
"""A Newton step below this many m is the last: what remains is about its square, per m."""
_LAST = 1e-10
"""Any other step below this many m is the last."""


@dataclass(frozen=True, slots=True)
class Point:
    """A position and how well it fits.

    Attributes
    ----------
    position
        In m, NED, (3, 1).
    lengths
        Distances to the beacons in m, (N, 1).
    cost
        Weighted sum of squared residuals.
    """

    position: Any
    lengths: Any
    cost: Any


@dataclass(frozen=True, slots=True)
class Tangent:
    """The measurement equations about a point.

    Attributes
    ----------
    gradients, bends
        For the ranges: gradient g of each, (N, 3), and w / h, (N, 1). The second derivative of a
        range h is ``(I - g g') / h``.
    information, slope
        ``H' W H``, (3, 3), and ``H' W (z - h)``, (3, 1).
    curvature
        Newton's matrix minus the information, (3, 3).
    """

    gradients: Any
    bends: Any
    information: Any
    slope: Any
    curvature: Any


@dataclass(frozen=True, slots=True)
class Step:
    """The next step.

    Attributes
    ----------
    move
        In m, (3, 1).
    last
        Whether what remains after it is negligible.
    """

    move: Any
    last: Any


def point(position: Any, s: Samples, weight: Any) -> Point:
    """Cost of a position."""
    lengths = ca.vertcat(*(distance(position, s.beacons[i, :])[0] for i in range(s.count)))
    residuals = s.z - ca.vertcat(lengths, position[2])
    return Point(position, lengths, ca.dot(weight, residuals**2))


def choose(condition: Any, one: Point, other: Point) -> Point:
    """The first point where the condition holds, else the second."""
    return Point(
        ca.if_else(condition, one.position, other.position),
        ca.if_else(condition, one.lengths, other.lengths),
        ca.if_else(condition, one.cost, other.cost),
    )


def tangent(at: Point, s: Samples, weight: Any) -> Tangent:
    """Linearise at a point, including second derivatives."""
    information, curvature, slope = ca.SX.zeros(3, 3), ca.SX.zeros(3, 3), ca.SX.zeros(3)
    rows, bends, diagonal = [], [], ca.SX(0)
    for i in range(s.count):
        per_metre = reciprocal(at.lengths[i])
        gradient = (at.position - s.beacons[i, :].T) * per_metre
        weighted = weight[i] * gradient
        residual = s.z[i] - at.lengths[i]
        bend = weight[i] * per_metre
        share = bend * residual
        information += weighted @ gradient.T
        slope += weighted * residual
        curvature += (share * gradient) @ gradient.T
        diagonal += share
        rows.append(gradient.T)
        bends.append(bend)
    information[2, 2] += weight[DEPTH]
    slope[2] += weight[DEPTH] * (s.z[DEPTH] - at.position[2])
    return Tangent(
        gradients=ca.vertcat(*rows),
        bends=ca.vertcat(*bends),
        information=symmetric(information),
        slope=slope,
        curvature=symmetric(curvature - diagonal * ca.SX.eye(3)),
    )


def is_near(move: Any, at: Point) -> Any:
    """Whether the step to a point was small compared with all distances."""
    return ca.sumsqr(move) < _NEAR**2 * ca.mmin(at.lengths) ** 2


def is_safe(t: Tangent) -> Any:
    """Whether Newton's matrix at the tangent is safely positive definite."""
    return _definite(t.information + t.curvature, t.information)


def newton(t: Tangent, damping: Any) -> Step:
    """Newton's step from the tangent's point, where `is_near` and `is_safe` allow it."""
    cofactors, determinant = _solved(t.information + t.curvature, t.information, damping)
    move = reciprocal(determinant) * (cofactors @ t.slope)
    return Step(move, ca.sumsqr(move) < _LAST_OF_NEWTON**2)


def step(t: Tangent, damping: Any, fresh: Any) -> Step:
    """The next step where Newton's is not allowed: a damped Gauss-Newton step.

    It is accelerated: along a step v a range grows by ``v' (I - g g') v / 2 h`` more than its
    gradient predicts, and the same matrix gives the step that compensates for this.

    Parameters
    ----------
    t
        Information and slope of the starting point.
    fresh
        Whether the gradients and bends of `t` belong to that point too; otherwise no second
        derivative is available.
    """
    cofactors, determinant = _solved(t.information, t.information, damping)
    scale = reciprocal(determinant)
    move = scale * (cofactors @ t.slope)
    along = t.gradients @ move
    growth = t.bends * (ca.sumsqr(move) - along**2)
    acceleration = -0.5 * scale * (cofactors @ (t.gradients.T @ growth))
    accelerated = fresh * (ca.sumsqr(2 * acceleration) <= _BEND**2 * ca.sumsqr(move))
    move += ca.if_else(accelerated, acceleration, 0)
    return Step(move, ca.sumsqr(move) < _LAST**2)


def _solved(matrix: Any, information: Any, damping: Any) -> tuple[Any, Any]:
    """Adjugate and determinant of a matrix damped by the information's diagonal."""
    return adjugate(matrix + damping * ca.diag(ca.diag(information)))


def _definite(matrix: Any, information: Any) -> Any:
    """Whether a symmetric matrix is positive definite, with a margin."""
    pairs = zip(_minors(matrix), _minors(information), strict=True)
    first, second, third = (m > _DEFINITE * o for m, o in pairs)
    return first * second * third


def _minors(a: Any) -> tuple[Any, Any, Any]:
    second = a[0, 0] * a[1, 1] - a[0, 1] ** 2
    return a[0, 0], second, (
        a[2, 2] * second
        + a[0, 2] * (2 * a[0, 1] * a[1, 2] - a[1, 1] * a[0, 2])
        - a[0, 0] * a[1, 2] ** 2
    )
