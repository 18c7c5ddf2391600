"""The equations of all components give the numbers that were recorded, with any parameters.

Short dives have parameters drawn within their bounds, and a place, an echo or a loss now and then
that no scenario has. What the numbers should be, other tests say; here, no equation may change
unnoticed. The interpreter runs them, so nothing is compiled.
"""

from __future__ import annotations

from collections import defaultdict
from functools import cache
from itertools import pairwise
from typing import Any

import as_recorded
import numpy as np
import pytest
from sblcosim.models import COMPONENTS, RECEIVERS
from sblcosim.models.declaration import Variable
from sblcosim.models.loading import load
from sblcosim.models.ports import PING_POSE, RECEPTION
from stepper import Stepper

TICKS, DIVES = 40, 8
TICK = 10**8
"""Nanoseconds."""
KEPT = {"sampling_time", "update_interval", "seed", "stream", "slot_order"}
"""Parameters that are as declared."""
POINTS = {"waypoint_count", "waypoint", "track_count", "track_time", "track"}
"""Parameters that are always drawn: without them a diver does not move."""
EXPONENTS = {"s": (-5.0, 0.0), "s/s": (-6.0, -4.0), "rad": (-3.0, -0.3), "m": (-2.0, 0.5)}
"""Of ten: sizes of a parameter that is 0 unless set, by its unit."""
model = cache(load)


def parameters(name: str, share: float, rng: np.random.Generator) -> dict[str, Any]:
    """Those that are not as declared."""
    return {
        v.name: value(v, rng) for v in COMPONENTS[name].of("parameter")
        if v.name not in KEPT and (v.name in POINTS or rng.random() < share)
    }  # fmt: skip


def value(v: Variable, rng: np.random.Generator) -> Any:
    low, high = -np.inf if v.min is None else v.min, np.inf if v.max is None else v.max
    if v.named and rng.random() < 0.5:
        return next(iter(v.named.values()))
    if v.type == "Boolean":
        return rng.random() < 0.5
    if v.type == "Int32":
        return rng.integers(low, high, endpoint=True)
    start = np.reshape(v.starts, v.shape).astype(float)
    if (low, high) == (0.0, 1.0) and v.unit is None:
        return rng.uniform(0.0, 0.6)
    if v.name in {"track_time", "profile_depth"}:
        return np.cumsum(rng.uniform(0.1, 1.5, v.shape)) - 0.1
    exponent = rng.uniform(*EXPONENTS.get(str(v.unit), (-3.0, 0.0)))
    sign = np.where(rng.random(v.shape) < 0.5, 1.0, 1.0 if low >= 0 else -1.0)
    new = sign * 10**exponent * rng.lognormal(0.0, 0.3, v.shape)
    drawn = np.where(start == 0, new, start * rng.lognormal(0.0, 0.4, v.shape))
    return np.clip(drawn, low, high)


class Dive:
    """All components, each with parameters of its own, and what they give at each tick."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng([3, seed])
        self.rng = rng
        self.start = 7 * 10**9 * (seed % 2)
        self.parts = {}
        for name in ("target", "platform", "acoustics", *RECEIVERS):
            given = parameters(name, (0.1, 0.3, 0.6)[seed // DIVES % 3], rng)
            if name == "target":
                given["trajectory"] = 1 + seed % 9
            self.parts[name] = Stepper(model(name), given, seed=seed, start_ns=self.start)
        self.told: dict[str, list[dict[str, Any]]] = defaultdict(list)

    def step(self, t: int) -> None:
        parts = self.parts
        target, platform, acoustics = (parts[n] for n in ("target", "platform", "acoustics"))
        y, z = target.step(t, TICK), platform.step(t, TICK)
        for name in RECEIVERS:
            given = {
                v.name: acoustics.y[v.name] for v in (*RECEPTION, *PING_POSE)
                if v.name in parts[name].u
            }  # fmt: skip
            parts[name].set(**given, depth=y["depth"], depth_epoch=y["depth_epoch"])
            parts[name].step(t, TICK)
        acoustics.set(
            target_position=y["position"],
            target_velocity=y["velocity"],
            **{k: v for k, v in z.items() if k in acoustics.u},
        )
        acoustics.step(t, TICK)
        for name, part in parts.items():
            self.told[name].append({**part.y, **states(part)})


def states(part: Stepper) -> dict[str, Any]:
    sizes = {name: rows * columns for name, (rows, columns) in part.model.states.items()}
    ends = np.cumsum([0, *sizes.values()])
    return {
        f"x.{name}": part.x[a:b]
        for name, (a, b) in zip(sizes, pairwise(ends), strict=True)
        if b > a
    }


def other(x: Any, rng: np.random.Generator) -> Any:
    """A state that a dive hardly reaches: some flags are set, and all numbers differ."""
    flags = ((x == 0) | (x == 1)) & (rng.random(x.shape) < 0.3)
    return np.where(flags, 1 - x, x * rng.lognormal(0.0, 0.1, x.shape))


def digest(rows: Any) -> float:
    (found,) = as_recorded.digest_of_all([np.array(rows, float).reshape(1, -1)])
    return found


@pytest.mark.parametrize("group", range(3))
def test_equations_give_the_recorded_numbers(group: int) -> None:
    found: dict[str, list[float]] = defaultdict(list)
    for seed in range(DIVES * group, DIVES * (group + 1)):
        dive = Dive(seed)
        for n in range(TICKS):
            dive.step(dive.start + n * TICK)
        for name, rows in dive.told.items():
            for key in rows[0]:
                found[f"{name}.{key}"].append(digest([row[key] for row in rows]))
        for name, part in dive.parts.items():
            elsewhere = [part.results(other(part.x, dive.rng)) for _ in range(3)]
            for key in elsewhere[0]:
                found[f"{name}: {key}"].append(digest([row[key] for row in elsewhere]))
    as_recorded.check(f"equations {group}", {"numbers": found})


@pytest.mark.parametrize("name", ["target", "platform"])
def test_whole_paths_and_long_motion_give_the_recorded_numbers(name: str) -> None:
    """Of the environment alone, in long steps."""
    found = {}
    for seed in range(18):
        given = parameters(name, (0.1, 0.5)[seed % 2], np.random.default_rng([4, seed]))
        if name == "target":
            given["trajectory"] = 1 + seed // 2
        part = Stepper(model(name), {**given, "sampling_time": 0.8}, seed=seed)
        duration = min(float(part.y.get("path_duration", 60.0)) or 60.0, 600.0)
        step = round(duration / 50 * 1e3) * 10**6
        rows = [part.step(n * step, step) for n in range(55)]
        found[f"{name} {seed}"] = [digest([row[key] for row in rows]) for key in rows[0]]
    as_recorded.check(f"equations of the {name}", {"numbers": found})


@pytest.mark.parametrize("name", COMPONENTS)
def test_bounds_and_starts_are_as_recorded(name: str) -> None:
    found = {
        f"{v.causality} {v.name}": [
            v.type, str(v.unit), *v.shape, *as_recorded.digest(v.starts), str(v.min), str(v.max),
            str(v.named), *(v.choices or {}).values(),
        ]
        for v in COMPONENTS[name].variables
    }  # fmt: skip
    as_recorded.check(f"declared {name}", {"variables": found})
