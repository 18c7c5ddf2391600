"""A position from ranges and depth alone: closed-form start, then damped Gauss-Newton."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from .measurements import DEPTH, Samples, predicted

PASSES = 20
"""Maximum number of passes of `improve` per fix."""
FIRST_DAMPING = 1e-6
CLOSE = 1e-7
"""A step shorter than this many m ends the iteration."""


@dataclass(frozen=True, slots=True)
class Pass:
    """Result of one pass.

    Attributes
    ----------
    position
        In m, NED, (3, 1).
    damping
        For the next pass.
    done
        Whether the step was too short to matter.
    information
        ``H' W H`` at the start of the pass, (3, 3).
    cost
        Weighted sum of squared residuals at ``position``.
    """

    position: Any
    damping: Any
    done: Any
    information: Any
    cost: Any


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


def closed_form(s: Samples) -> Any:
    """A position in m from differences of squared ranges, with z equal to the depth, (3, 1).

    About the mean of the heard beacons, ``q_i = s_i - mean``, each squared range is ``r_i^2 = |x|^2
    - 2 q_i x + |q_i|^2``. In the sum over i with weights q_i the unknown ``|x|^2`` cancels, which
    leaves two linear equations in north and east.
    """
    heard = s.heard[:DEPTH]
    mean = (heard.T @ s.beacons).T / ca.fmax(ca.sum1(heard), 1)
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


def cost(position: Any, s: Samples, weight: Any) -> Any:
    """Weighted sum of squared residuals."""
    return sum(
        weight[i] * (s.z[i] - value) ** 2 for i, (value, _) in enumerate(predicted(position, s))
    )


def improve(position: Any, damping: Any, s: Samples, weight: Any) -> Pass:
    """One Levenberg-Marquardt pass: a Gauss-Newton step, taken if it does not raise the cost."""
    information, slope, here = ca.SX.zeros(3, 3), ca.SX.zeros(3), ca.SX(0)
    for i, (value, gradient) in enumerate(predicted(position, s)):
        weighted = weight[i] * gradient
        residual = s.z[i] - value
        information += weighted @ gradient.T
        slope += weighted * residual
        here += weight[i] * residual**2
    information = symmetric(information)
    damped = information + damping * ca.diag(ca.diag(information))
    step = inverse(damped) @ slope
    there = cost(position + step, s, weight)
    better = there <= here
    return Pass(
        position=position + ca.if_else(better, step, 0),
        damping=damping * ca.if_else(better, 0.01, 100),
        done=ca.sumsqr(step) < CLOSE**2,
        information=information,
        cost=ca.fmin(here, there),
    )
