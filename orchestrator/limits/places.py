"""The recursion for many divers at once: what is possible at many places of a scenario.

The formulas are those of `recursion` and `field`. Nothing is random here: a packet that is lost
with probability p counts with 1 − p of its information, in place of being there or not, and the
platform rests at its mean position and heading; waves count as what receivers assume of them. The
covariance of a place is an axis of its own, so the time goes into NumPy's loops, and not into
calls. Scalar measurements are taken one after another: P ← P − P hᵀ h P/(h P hᵀ + R).
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import dataclass
from math import ceil, cos, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus import stopping
from sblcosim.models.receiver import field as field_model
from sblcosim.models.receiver import surroundings
from sblcosim.models.receiver.variables import COUPLED, LONG_BASELINE

from ..scenario.arrangement import has_own_errors
from ..scenario.scenario import Scenario
from . import field, recursion
from .parameters import beacons_of, conditions, own_beacon, parameters
from .recursion import Rows, Truth

Floats = NDArray[np.float64]
Path = Callable[[float], Floats]
"""Positions at a time since the start [s], NED [m]; (n, 3)."""

MOST_STEPS = 300
"""Of the recursion: of more slots, some count together."""
MOST_EPOCHS = 8
"""For which covariances are kept."""
_TOGETHER = 128
"""Places whose covariances fit into a processor's cache."""


@dataclass(frozen=True, eq=False)
class Covariances:
    """Covariances of the position of some divers at some epochs, NED [m²]; (epochs, n, 3, 3).

    Attributes
    ----------
    absolute, relative
        In the world, and relative to the platform.
    offset
        True x − p at these epochs [m]; (epochs, n, 3).
    own_errors
        Each beacon has an error of its own: there is no platform, and relative is absolute.
    """

    absolute: Floats
    relative: Floats
    offset: Floats
    own_errors: bool


def still_beacons(scenario: Scenario) -> Floats:
    """Positions of the beacons in still water, NED [m]; (N, 3)."""
    heading = np.deg2rad(scenario.platform.mean_heading_deg)
    c, s = cos(heading), sin(heading)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    rows: Floats = beacons_of(parameters(scenario)) @ turn.T + _place(scenario)
    return rows


def _place(scenario: Scenario) -> Floats:
    """Mean position of the platform, NED [m]; (3,)."""
    return np.asarray(scenario.platform.mean_position_m, np.float64)


def noise_densities(scenario: Scenario, position: Floats) -> Floats:
    """R T_eff of the bearing's fix at some places [m² s], for `circle_psd`; (n,)."""
    c = conditions(scenario, 0.0)
    offset = position - still_beacons(scenario).mean(0)
    densities: Floats = c.range_std**2 * (offset**2).sum(1) / max(c.spread, 1e-12) * c.round
    return densities


def covariances(
    scenario: Scenario,
    path: Path,
    acceleration_psd: Floats,
    span_s: tuple[float, float],
    workers: int | None = None,
) -> Covariances:
    """What is possible for divers on given paths, each alone with the platform.

    Parameters
    ----------
    acceleration_psd
        q of each path [m²/s³], see `circle_psd`; (n,).
    span_s
        When covariances begin to count, and the end, from the start [s].
    workers
        Threads; the result does not depend on them. None: all cores.
    """
    n = len(acceleration_psd)
    own_errors = has_own_errors(scenario.platform)
    p = parameters(scenario, 0.0, LONG_BASELINE if own_errors else COUPLED)
    steps = [*_steps(scenario, span_s[1])]
    late = [k for k, step in enumerate(steps) if step.end_s >= span_s[0]] or [len(steps) - 1]
    picked = np.round(np.linspace(0, len(late) - 1, min(len(late), MOST_EPOCHS))).astype(int)
    kept = [late[i] for i in picked]

    def part(first: int) -> tuple[Floats, Floats, Floats]:
        some = slice(first, first + _TOGETHER)
        own = copy(p)
        own.acceleration_psd = np.ascontiguousarray(acceleration_psd[some])
        model = (_Field if own_errors else _Platform)(scenario, own)
        found = []
        P = np.repeat(model.prior[:, :, None], len(own.acceleration_psd), 2)
        for k, step in enumerate(steps):
            stopping.check()
            position = path(step.end_s)[some]
            _advance(P, *model.transition(step.duration_s))
            _measure(P, model.rows(position, step))
            if k in kept:
                covariances_ = model.marginals(np.moveaxis(P, 2, 0))
                found.append((*covariances_, position - _place(scenario)))
        absolute, relative, offset = map(np.stack, zip(*found, strict=True))
        return absolute, relative, offset

    with ThreadPoolExecutor(workers or os.cpu_count() or 1) as pool:
        futures = [pool.submit(part, first) for first in range(0, n, _TOGETHER)]
        parts = [*stopping.results(futures)]
    absolute, relative, offset = (np.concatenate(it, axis=1) for it in zip(*parts, strict=True))
    return Covariances(absolute, relative, offset, own_errors)


@dataclass(frozen=True, eq=False)
class _Step:
    """Slots that count together.

    Attributes
    ----------
    duration_s, end_s
        Of the slots, and their end since the start [s].
    heard
        Packets to be expected from each beacon; (N,).
    poses
        Slots with at least one packet, to be expected.
    slots
        Number of slots, each with a reading of the depth sensor.
    """

    duration_s: float
    end_s: float
    heard: Floats
    poses: float
    slots: int


def _steps(scenario: Scenario, duration_s: float) -> Iterator[_Step]:
    a, count = scenario.acoustics, scenario.beacons
    total = max(ceil(duration_s / a.sampling_time_s - 1e-9) - 1, 1)  # the end is not sampled
    some = -(-total // MOST_STEPS)
    order = [number - 1 for number in a.slot_order]
    there = 1 - a.loss_probability
    for first in range(0, total, some):
        slots = range(first, min(first + some, total))
        heard, poses = np.zeros(count), 0.0
        for slot in slots:
            if a.schedule == "simultaneous":
                heard += there
                poses += 1 - a.loss_probability**count
            else:
                heard[order[slot % count]] += there
                poses += there
        last = slots[-1] + 1
        yield _Step(len(slots) * a.sampling_time_s, last * a.sampling_time_s, heard, poses,
                    len(slots))


class _Platform:
    """The model of `recursion`, for places whose q is an array."""

    def __init__(self, scenario: Scenario, p: Any) -> None:
        self.p, self.scenario = p, scenario
        a = scenario.acoustics
        self.speed = a.assumed_sound_speed_m_s / a.sound_speed_m_s - 1
        self.known_start = scenario.receiver.initialisation == "prior" or scenario.true_prior
        self.own_beacon = own_beacon(scenario)

    @property
    def prior(self) -> Floats:
        return recursion.prior(self.p, self.known_start)

    def transition(self, dt: float) -> tuple[Any, ...]:
        return surroundings.transition(np, self.p, dt)

    def truth(self, position: Floats) -> Truth:
        platform = self.scenario.platform
        n = len(position)
        attitude = np.array([0.0, 0.0, np.deg2rad(platform.mean_heading_deg)])
        return Truth(
            position, np.tile(_place(self.scenario), (n, 1)), np.tile(attitude, (n, 1)), self.speed
        )

    def rows(self, position: Floats, step: _Step) -> Rows:
        n = len(position)
        return recursion.rows_of(
            self.p, self.truth(position), np.tile(step.heard, (n, 1)),
            np.full(n, float(step.slots)), beacons_of(self.p), self.own_beacon,
            np.full(n, step.poses),
        )

    def marginals(self, P: Floats) -> tuple[Floats, Floats]:
        return recursion.marginals(P, self.p)


class _Field(_Platform):
    """The model of `field`: beacons with errors of their own."""

    def __init__(self, scenario: Scenario, p: Any) -> None:
        super().__init__(scenario, p)
        self.beacons = still_beacons(scenario)

    @property
    def prior(self) -> Floats:
        return field.prior(self.p, self.known_start)

    def transition(self, dt: float) -> tuple[Any, ...]:
        return field_model.transition(np, self.p, dt)

    def rows(self, position: Floats, step: _Step) -> Rows:
        n = len(position)
        return field.rows_of(
            self.p, self.truth(position), np.tile(step.heard, (n, 1)),
            np.full(n, float(step.slots)), np.tile(self.beacons, (n, 1, 1)),
        )

    def marginals(self, P: Floats) -> tuple[Floats, Floats]:
        absolute = field.marginals(P)
        return absolute, absolute


def _advance(P: Floats, phi: Any, noise: Any) -> None:
    """P ← Φ P Φᵀ + Q, in place; (m, m, n), with Φ and Q by their elements."""
    # A state is moved by others that nothing moves, so these are still as they were.
    moved = [(i, j, v) for (i, j), v in phi.items() if i != j]
    for i, j, value in moved:
        P[i] += value * P[j]
    for i, j, value in moved:
        P[:, i] += value * P[:, j]
    for (i, j), value in phi.items():
        if i == j:
            P[i] *= value
            P[:, i] *= value
    for (i, j), value in noise.items():
        P[i, j] += value
        if i != j:
            P[j, i] += value


def _measure(P: Floats, rows: Rows) -> None:
    """P with measurements, one after another, in place; those that are not there change nothing."""
    for k in range(rows.H.shape[1]):
        there = rows.there[:, k]
        if not there.any():
            continue
        h = rows.H[:, k]
        used: Sequence[int] = np.flatnonzero(h.any(axis=0)).tolist()
        c: Any = sum(P[:, j] * h[:, j] for j in used)
        s: Any = sum(c[j] * h[:, j] for j in used) + rows.R[:, k] / there
        P -= c[:, None] * (c / s)[None]
