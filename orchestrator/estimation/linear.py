"""A Kalman filter over scalar measurements and the modified Bryson-Frazier smoother.

G. J. Bierman, *Factorization Methods for Discrete Sequential Estimation*, Academic Press, 1977,
section X. The smoother needs no inverse, so states without variance, and variances of a kilometre
next to those of a centimetre, do no harm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus import stopping

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Problem:
    """A linear problem with n epochs, d states and m scalar measurements.

    Attributes
    ----------
    mean, covariance
        Prior; shape (d,), (d, d).
    phi, noise
        Distinct transitions Φ and covariances Q; shape (u, d, d).
    which
        The transition before each epoch, including that from the prior to the first; shape (n,).
    first
        Index of the first measurement of each epoch, and m; shape (n + 1,).
    H, z, R
        Rows, measurements and variances; shape (m, d), (m,), (m,).
    """

    mean: Floats
    covariance: Floats
    phi: Floats
    noise: Floats
    which: NDArray[np.intp]
    first: NDArray[np.intp]
    H: Floats
    z: Floats
    R: Floats


@dataclass(frozen=True, eq=False)
class Moments:
    """Means and covariances at the epochs, and what later measurements say against the prediction.

    Attributes
    ----------
    mean, covariance
        Shape (n, d), (n, d, d).
    lean, weight
        λ and Λ before the measurements of each epoch: the noise of the step to it has the mean −Q λ
        and the covariance Q − Q Λ Q; shape (n, d), (n, d, d).
    """

    mean: Floats
    covariance: Floats
    lean: Floats
    weight: Floats


def smooth(problem: Problem) -> Moments:
    """Mean and covariance of all states, given all measurements."""
    n, d = len(problem.which), len(problem.mean)
    x, P = problem.mean, problem.covariance
    means, covariances = np.empty((n, d)), np.empty((n, d, d))
    gains, innovation, S = np.empty_like(problem.H), np.empty(len(problem.z)), problem.R.copy()
    for k, (turn, begin, end) in enumerate(
        zip(problem.which, problem.first[:-1], problem.first[1:], strict=True)
    ):
        stopping.check()
        phi = problem.phi[turn]
        x, P = phi @ x, phi @ P @ phi.T + problem.noise[turn]
        P = (P + P.T) / 2
        for i in range(begin, end):
            h = problem.H[i]
            c = P @ h
            own, nu = h @ c, problem.z[i] - h @ x
            S[i] += own
            innovation[i], gains[i] = nu, c / S[i]
            x = x + gains[i] * nu
            P = P - np.outer(c, c) / S[i]
        means[k], covariances[k] = x, P
    (lean, before_lean), (weight, before_weight) = _backwards(problem, gains, innovation, S)
    mean = means - np.einsum("kij,kj->ki", covariances, lean)
    covariance = covariances - covariances @ weight @ covariances
    return Moments(
        mean, (covariance + covariance.transpose(0, 2, 1)) / 2, before_lean, before_weight
    )


def _backwards(
    problem: Problem, gains: Floats, innovation: Floats, S: Floats
) -> tuple[Floats, Floats]:
    """λ and Λ, each after and before the measurements of each epoch; (2, n, d), (2, n, d, d).

    They are the information from later measurements, those of the epoch included in the second.
    """
    n, d = len(problem.which), len(problem.mean)
    leans, weights = np.empty((2, n, d)), np.empty((2, n, d, d))
    lean, weight = np.zeros(d), np.zeros((d, d))
    for k in range(n - 1, -1, -1):
        stopping.check()
        leans[0, k], weights[0, k] = lean, weight
        for i in range(problem.first[k + 1] - 1, problem.first[k] - 1, -1):
            h, K = problem.H[i], gains[i]
            lean = lean - h * (K @ lean + innovation[i] / S[i])
            # One side after the other: together, a first packet leaves little but rounding errors.
            weight = weight - np.outer(weight @ K, h)
            weight = weight + np.outer(h, h / S[i] - K @ weight)
        leans[1, k], weights[1, k] = lean, weight
        phi = problem.phi[problem.which[k]]
        lean, weight = phi.T @ lean, phi.T @ weight @ phi
        weight = (weight + weight.T) / 2
    return leans, weights
