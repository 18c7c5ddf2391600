"""A position from ranges and depth alone: closed-form start, then damped Gauss-Newton."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import casadi as ca

from .measurements import DEPTH, Samples, distance, predicted

PASSES = 20
"""Maximum number of passes of `improve` per fix."""
FIRST_DAMPING = 1e-6
CLOSE = 1e-7
"""A step shorter than this many m ends the iteration."""


def symmetric(matrix: Any) -> Any:
    """The upper triangle and its mirror image; elements below the diagonal are never computed."""
    return ca.triu2symm(ca.triu(matrix))


def reciprocal(x: Any) -> Any:
    """``1/x`` as a value of its own: CasADi turns a product with `1/x` into a division."""
    return 2 * (0.5 / x)


def adjugate(matrix: Any) -> tuple[Any, Any]:
    """Adjugate and determinant of a symmetric, positive semidefinite 3 x 3 matrix.

    Each diagonal element grows by 1e-12 of itself, 1e-20 of the trace and 1e-30. Degenerate
    geometry then gives a large variance, and missing data cause no division by zero.
    """
    a = matrix + ca.diag(1e-12 * ca.diag(matrix) + (1e-20 * ca.trace(matrix) + 1e-30))
    cofactors = ca.SX(3, 3)
    for i in range(3):
        for j in range(i, 3):
            (r, s), (c, d) = ([(n + 1) % 3, (n + 2) % 3] for n in (i, j))
            cofactors[i, j] = a[r, c] * a[s, d] - a[r, d] * a[s, c]
    cofactors = symmetric(cofactors)
    determinant = ca.dot(a[:, 0], cofactors[:, 0])
    return cofactors, ca.fmax(determinant, 1e-26 * a[0, 0] * a[1, 1] * a[2, 2])


def inverse(matrix: Any) -> Any:
    """Inverse of a symmetric, positive semidefinite 3 x 3 matrix; see `adjugate`."""
    cofactors, determinant = adjugate(matrix)
    return cofactors * (1 / determinant)


def middle(s: Samples) -> Any:
    """Mean of the beacons that have been heard, (3, 1) [m]."""
    heard = s.heard[:DEPTH]
    return (heard.T @ s.beacons).T / ca.fmax(ca.sum1(heard), 1)


def closed_form(s: Samples) -> Any:
    """A position in m from differences of squared ranges, with z equal to the depth, (3, 1).

    About the mean of the heard beacons, ``q_i = s_i - mean``, each squared range is ``r_i^2 = |x|^2
    - 2 q_i x + |q_i|^2``. In the sum over i with weights q_i the unknown ``|x|^2`` cancels, which
    leaves two linear equations in north and east.
    """
    heard, mean = s.heard[:DEPTH], middle(s)
    z = s.z[DEPTH] - mean[2]
    a, b = ca.SX.zeros(2, 2), ca.SX.zeros(2)
    for i in range(s.count):
        q = s.beacons[i, :].T - mean
        horizontal = heard[i] * q[:2]
        a += horizontal @ q[:2].T
        b += horizontal * ((ca.sumsqr(q) - s.z[i] ** 2) / 2 - q[2] * z)
    a11, a12, a22 = a[0, 0], a[0, 1], a[1, 1]
    ridge = 1e-12 * (a11 + a22) + 1e-24
    a11, a22 = a11 + ridge, a22 + ridge
    determinant = ca.fmax(a11 * a22 - a12 * a12, ridge * (a11 + a22) / 2)
    return mean + ca.vertcat(
        (a22 * b[0] - a12 * b[1]) / determinant,
        (a11 * b[1] - a12 * b[0]) / determinant,
        z,
    )


def weights(s: Samples, variances: Any) -> Any:
    """Weight of each measurement in 1/m^2, 0 for a missing one, (N + 1, 1)."""
    return s.heard * reciprocal(variances)


def degrees(s: Samples) -> Any:
    """Degrees of freedom of a fix's residuals: measurements minus coordinates."""
    return ca.sum1(s.heard) - 3


@dataclass(frozen=True, slots=True)
class Common:
    """What is known before a fix whose ranges have an error in common.

    Attributes
    ----------
    prior
        Information on that error [1/m²].
    middle, near
        A place, (3, 1) [m], and the information that the diver is about it, north and east [1/m²].
    """

    prior: Any
    middle: Any
    near: Any


@dataclass(frozen=True, slots=True)
class Normal:
    """Normal equations of a fix, linearised at a position.

    An error that ranges have in common is eliminated. With weights w of the ranges, residuals e and
    the information of its prior, it is Σwe / (Σw + prior).

    Attributes
    ----------
    position
        (3, 1) [m].
    information, slope
        ``H' W H``, (3, 3), and ``H' W e``, (3, 1).
    cost
        Weighted sum of squared residuals.
    common, alone
        The error in common [m], and its variance for a known position [m²]; 0 without one.
    lean
        Negative derivative of the error in common with respect to the position, (3, 1).
    """

    position: Any
    information: Any
    slope: Any
    cost: Any
    common: Any = 0
    alone: Any = 0
    lean: Any = 0


def separate(position: Any, s: Samples, weight: Any) -> Normal:
    """The normal equations at a position, where each measurement has an error of its own."""
    information, slope, cost = ca.SX.zeros(3, 3), ca.SX.zeros(3), ca.SX(0)
    for i, (value, gradient) in enumerate(predicted(position, s)):
        weighted = weight[i] * gradient
        residual = s.z[i] - value
        information += weighted @ gradient.T
        slope += weighted * residual
        cost += weight[i] * residual**2
    return Normal(position, symmetric(information), slope, cost)


def together(position: Any, s: Samples, weight: Any, known: Common) -> Normal:
    """The normal equations at a position, where the ranges have an error in common."""
    alone = reciprocal(ca.sum1(weight[:DEPTH]) + known.prior)
    information, slope = ca.SX.zeros(3, 3), ca.SX.zeros(3)
    cost, first, lean = ca.SX(0), ca.SX(0), ca.SX.zeros(3)
    for i in range(s.count):
        length, gradient = distance(position, s.beacons[i, :])
        residual = s.z[i] - length
        information += weight[i] * gradient @ gradient.T
        slope += weight[i] * residual * gradient
        cost += weight[i] * residual**2
        first += weight[i] * residual
        lean += weight[i] * gradient
    residual = s.z[DEPTH] - position[2]
    information[2, 2] += weight[DEPTH]
    slope[2] += weight[DEPTH] * residual
    cost += weight[DEPTH] * residual**2
    near = ca.SX([1, 1, 0]) * known.near
    off = position - known.middle
    return Normal(
        position,
        symmetric(information - alone * (lean @ lean.T) + ca.diag(near)),
        slope - alone * first * lean - near * off,
        cost - alone * first**2 + ca.dot(near, off**2),
        alone * first, alone, alone * lean,
    )


def chosen(condition: Any, one: Normal, other: Normal) -> Normal:
    """One of two, element by element."""
    return Normal(*(
        ca.if_else(condition, getattr(one, f.name), getattr(other, f.name)) for f in fields(Normal)
    ))


@dataclass(frozen=True, slots=True)
class Pass:
    """Result of one pass.

    Attributes
    ----------
    here, there
        The normal equations before the step and after it.
    better
        Whether the step does not raise the cost: only then it is taken.
    damping
        For the next pass.
    done
        Whether the step was too short to matter.
    """

    here: Normal
    there: Normal
    better: Any
    damping: Any
    done: Any

    @property
    def taken(self) -> Normal:
        """The normal equations where the next pass begins."""
        return chosen(self.better, self.there, self.here)


def improve(position: Any, damping: Any, linearised: Callable[[Any], Normal]) -> Pass:
    """One Levenberg-Marquardt pass: a Gauss-Newton step, taken if it does not raise the cost.

    Parameters
    ----------
    linearised
        Gives the normal equations at a position.
    """
    here = linearised(position)
    damped = here.information + damping * ca.diag(ca.diag(here.information))
    step = inverse(damped) @ here.slope
    there = linearised(position + step)
    better = there.cost <= here.cost
    return Pass(
        here, there, better, damping * ca.if_else(better, 0.01, 100), ca.sumsqr(step) < CLOSE**2
    )
