"""Scale and offsets from all ranges at once, about the most probable track."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from ..data.estimates import Floats
from .innovations import DEPTH_BIAS, OFFSET, SCALE, VELOCITY, Filtered, Ranges

PASSES = 20
_MOVED = 1e-3
_STATES = 5
"""Of a time: north and east, their rates, and the clock."""
_FIRST_CLOCK = 1e-3


def refined(ranges: Ranges, parameters: Floats, begin: Filtered) -> Filtered | None:
    """The mean and the covariance of the constants, about the most probable track.

    A filter takes each range about what it knew then. Of beacons that are close together its scale
    and offsets are then more certain than they may be. Here all ranges are taken about the same
    track: Gauss-Newton steps of a diver who does not turn, in which a range counts as much as it is
    probably punctual.

    Parameters
    ----------
    parameters
        Of the likelihood, (p,).
    begin
        What the filter found with them.

    Returns
    -------
    Filtered or None
        As the filter's, of one set, with all constants at their places; the other states are 0.
        None if the steps do not end.

    Raises
    ------
    LinAlgError
        The equations of a step have no solution.
    """
    problem = _Problem(ranges, parameters, begin.by_range)
    x = problem.begin(begin)
    for _ in range(PASSES):
        A, b = problem.normal(x)
        try:
            solved = splu(A)
        except RuntimeError as error:  # "Factor is exactly singular"
            raise np.linalg.LinAlgError(str(error)) from None
        step = solved.solve(b)
        x = x + step
        if np.abs(step[problem.constants]).max() < _MOVED:
            break
    else:
        return None
    G = len(problem.constants)
    unit = np.zeros((len(x), G))
    unit[problem.constants, np.arange(G)] = 1.0
    covariance = solved.solve(unit)[problem.constants]
    mean, P = np.zeros((1, ranges.states)), np.zeros((1, ranges.states, ranges.states))
    rows = np.arange(SCALE, ranges.states)
    mean[0, rows] = x[problem.constants]
    P[0][np.ix_(rows, rows)] = (covariance + covariance.T) / 2
    return Filtered(begin.likelihood, begin.by_range, mean, P)


class _Problem:
    """The sum of squares of a log: motion, priors and ranges."""

    def __init__(
        self, ranges: Ranges, parameters: Floats, shown: Mapping[str, Floats]
    ) -> None:
        self.ranges, self.parameters = ranges, parameters
        self.n, self.punctual = len(ranges.time), shown["punctual"][0]
        count = ranges.states - SCALE
        self.constants = _STATES * self.n + np.arange(count)
        g, prior = ranges, ranges.prior
        dt = np.maximum(np.diff(g.time), 1e-6)
        psd = np.full(self.n - 1, parameters[3])
        std = np.array([prior["scale_std"], max(prior["depth_bias_std"], 1e-6),
                        *[prior["offset_std"]] * g.beacons,
                        *([prior["place_std"], prior["place_std"],
                           max(prior["place_down_std"], 1e-6)] * g.beacons
                          if g.uncertain else [])])
        self.prior = np.concatenate([
            [prior["position_std"] ** -2.0] * 2, [prior["velocity_std"] ** -2.0] * 2,
            [_FIRST_CLOCK**-2.0], np.zeros(_STATES * (self.n - 1)), std**-2.0,
        ])
        self.motion = self._motion(dt, psd)
        across, upright = prior["place_noise_std"], prior["place_down_noise_std"]
        self.horizontal, self.down = across**2, g.down_variance + upright**2

    def _motion(self, dt: Floats, psd: Floats) -> Any:
        """Precision of the steps from each time to the next."""
        m, at = self.n - 1, _STATES * np.arange(self.n - 1)
        blocks: list[tuple[Any, Any, Any]] = []
        root = np.sqrt(psd)
        # The root of the inverse of psd [[dt³/3, dt²/2], [dt²/2, dt]]: rows (a, -a dt/2), (0, b).
        a, b = np.sqrt(12 / dt**3) / root, 1 / (np.sqrt(dt) * root)
        row = 0
        for axis in range(2):
            p, v = at + axis, at + VELOCITY + axis
            r = row + np.arange(m)
            blocks += [(r, p + _STATES, a), (r, p, -a), (r, v, -a * dt / 2),
                       (r, v + _STATES, -a * dt / 2)]
            r = row + m + np.arange(m)
            blocks += [(r, v + _STATES, b), (r, v, -b)]
            row += 2 * m
        walk = 1 / np.sqrt(max(self.ranges.prior["clock_walk"], 1e-9) * dt)
        r = row + np.arange(m)
        blocks += [(r, at + 4 + _STATES, walk), (r, at + 4, -walk)]
        rows, columns, values = (np.concatenate(part) for part in zip(*blocks, strict=True))
        size = _STATES * self.n + self.ranges.states - SCALE
        root_ = sparse.csc_matrix((values, (rows, columns)), shape=(row + m, size))
        return (root_.T @ root_).tocsc()

    def begin(self, found: Filtered) -> Floats:
        """The filter's positions and its constants."""
        g = self.ranges
        states = np.zeros((self.n, _STATES))
        states[:, 0], states[:, 1] = found.by_range["north"][0], found.by_range["east"][0]
        states[:, 2:4] = np.gradient(states[:, :2], np.maximum.accumulate(
            g.time + 1e-6 * np.arange(self.n)), axis=0)
        self.first = np.array([g.prior[k] for k in (
            "north", "east", "velocity_north", "velocity_east")] + [0.0])
        return np.concatenate([states.ravel(), found.mean[0, SCALE:]])

    def normal(self, x: Floats) -> tuple[Any, Floats]:
        """Matrix and right side of a step."""
        g, n = self.ranges, self.n
        states, c = x[: _STATES * n].reshape(n, _STATES), x[_STATES * n :]
        bias, offset = c[DEPTH_BIAS - SCALE], c[OFFSET - SCALE :][: g.beacons]
        o = np.column_stack([states[:, :2] - g.place[:, :2], g.down - g.place[:, 2] - bias])
        e = OFFSET - SCALE + g.beacons + 3 * g.beacon
        if g.uncertain:
            o -= np.column_stack([c[e], c[e + 1], c[e + 2]])
        distance = np.sqrt(np.sum(o**2, axis=1) + 1e-12)
        stretch = 1 + c[0]
        u = stretch * o / distance[:, None]
        nu = g.range - stretch * distance - states[:, 4] - offset[g.beacon]
        variance = (self.parameters[0] ** 2 + (u[:, 0] ** 2 + u[:, 1] ** 2) * self.horizontal
                    + u[:, 2] ** 2 * self.down)
        weight = self.punctual / variance
        base = _STATES * np.arange(n)
        zero = self.constants[0]
        columns = [base, base + 1, base + 4, np.full(n, zero), np.full(n, zero + 1),
                   zero + OFFSET - SCALE + g.beacon]
        values = [u[:, 0], u[:, 1], np.ones(n), distance, -u[:, 2], np.ones(n)]
        if g.uncertain:
            columns += [zero + e + k for k in range(3)]
            values += [-u[:, k] for k in range(3)]
        H = sparse.csc_matrix(
            (np.concatenate(values), (np.tile(np.arange(n), len(values)), np.concatenate(columns))),
            shape=(n, len(x)),
        )
        A = self.motion + sparse.diags(self.prior) + H.T @ sparse.diags(weight) @ H
        mean = np.zeros(len(x))
        mean[:_STATES] = self.first
        b = H.T @ (weight * nu) - self.motion @ x - self.prior * (x - mean)
        return A.tocsc(), b
