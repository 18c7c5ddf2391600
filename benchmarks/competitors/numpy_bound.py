"""The bound's recursion on NumPy: the same formulas, with divers along an axis of their own.

`sblcosim map` used it before the recursion was written in C. Scalar measurements are applied one
after another, P ← P − P hᵀ h P/(h P hᵀ + R), with as many divers at a time as fit into the cache.
"""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
from sblcosim.limits.recursion import Epochs, ReceiverModel
from sblcosim.models.receiver.bound import BOUNDS, Bound, least

TOGETHER = 128


def covariances(
    model: ReceiverModel, epochs: Epochs, position: Any, acceleration_psd: Any, keep: Any
) -> tuple[Any, Any]:
    """As `sblcosim.limits.recursion.covariances`."""
    parts = [
        _part(model, epochs, position[:, i : i + TOGETHER], acceleration_psd[i : i + TOGETHER],
              set(keep.tolist()))
        for i in range(0, position.shape[1], TOGETHER)
    ]
    absolute, relative = (np.concatenate(it, axis=1) for it in zip(*parts, strict=True))
    return absolute, relative


def _part(
    model: ReceiverModel, epochs: Epochs, position: Any, acceleration_psd: Any, keep: set[int]
) -> tuple[Any, Any]:
    bound = BOUNDS[model.name]
    (n, divers), count = position.shape[:2], epochs.heard.shape[1]
    platform, attitude = (np.broadcast_to(a, (n, 3)) for a in (epochs.platform, epochs.attitude))
    beacons = np.broadcast_to(epochs.beacons, (n, count, 3))
    numbers = vars(model.parameters) | dict(model.situation)
    p = SimpleNamespace(**numbers | {"acceleration_psd": acceleration_psd})
    size = bound.states + bound.each * count
    P = np.zeros((size, size, divers))
    first = SimpleNamespace(position=position[0].T, platform=platform[0], attitude=attitude[0])
    for state, std in bound.prior_stds(np, p, first).items():
        for i in _copies(bound, state, count):
            P[i, i] = std**2
    found = []
    for k in range(n):
        if epochs.step_s[k] > 0:
            _advance(bound, P, p, epochs.step_s[k], count)
        s = SimpleNamespace(position=position[k].T, platform=platform[k], attitude=attitude[k])
        there = {"readings": epochs.readings[k], "packets": epochs.packets[k]}
        for kind in ("other", *range(count)):
            s.beacon = np.zeros(3) if kind == "other" else beacons[k, kind]
            for row in bound.rows:
                if (row.counts == "beacons") == (kind == "other"):
                    continue
                amount = there[row.counts] if kind == "other" else epochs.heard[k, kind]
                own = row.own_beacon in (None, bool(model.situation["own_beacon"]))
                if own and amount > 0:
                    _measure(bound, P, row.of(np, p, s), amount, kind)
        if k in keep:
            found.append([
                np.array([[np.broadcast_to(e, divers) for e in line] for line in matrix])
                for matrix in bound.marginals(p, P)
            ])
    absolute, relative = (np.moveaxis(np.stack(it), -1, 1) for it in zip(*found, strict=True))
    return absolute, relative


def _copies(bound: Bound, state: int, count: int) -> Iterator[int]:
    """A state, or the states of all beacons."""
    for i in range(1 if state < bound.states else count):
        yield state + i * bound.each


def _advance(bound: Bound, P: Any, p: Any, dt: float, count: int) -> None:
    """P ← Φ P Φᵀ + Q, in place."""
    phi, noise = bound.transition(np, p, dt)
    elements = [
        (i, j, value)
        for (row, column), value in phi.items()
        for i, j in zip(_copies(bound, row, count), _copies(bound, column, count), strict=True)
    ]
    moved = [it for it in elements if it[0] != it[1]]
    for i, j, value in moved:
        P[i] += value * P[j]
    for i, j, value in moved:
        P[:, i] += value * P[:, j]
    for i, j, value in elements:
        if i == j:
            P[i] *= value
            P[:, i] *= value
    for (row, column), value in noise.items():
        for i, j in zip(_copies(bound, row, count), _copies(bound, column, count), strict=True):
            P[i, j] += value
            if i != j:
                P[j, i] += value


def _measure(bound: Bound, P: Any, measurement: Any, amount: float, beacon: Any) -> None:
    """P with a scalar measurement, in place."""
    shift = bound.each * beacon if isinstance(beacon, int) else 0
    row = [(i if i < bound.states else i + shift, h) for i, h in measurement.row.items()]
    c: Any = sum(P[:, j] * h for j, h in row)
    s: Any = sum(c[j] * h for j, h in row) + least(np, measurement) / amount
    P -= c[:, None] * (c / s)[None]
