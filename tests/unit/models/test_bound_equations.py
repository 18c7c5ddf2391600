"""The equations of the bounds give the numbers that were recorded, with any parameters.

What they should be, the bounds themselves say elsewhere, in which parts that are small are lost
beside large ones. Here each number counts. Nothing is compiled.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from types import SimpleNamespace
from typing import Any

import as_recorded
import casadi as ca
import numpy as np
import pytest
from sblcosim.models.receiver.bound import BOUNDS, SURROUNDINGS, Bound, least
from sblcosim.models.receiver.surroundings import Measurement
from sblcosim.models.settings.keys import OF_RECEIVERS

DECLARED = {v.name: v for v in OF_RECEIVERS.values()}
SITUATIONS = 32
AWAY = (1.0, 25.0, 45.0, 200.0)
"""How far the diver is from the platform [m]: less than the bound's own doubt, and more."""


def situation(of: Bound, seed: int) -> tuple[Any, Any]:
    """Parameters and true values."""
    rng = np.random.default_rng([5, seed])
    p = {
        name: float(np.clip((DECLARED[name].starts[0] or 0.1) * rng.lognormal(0.0, 0.4),
                            DECLARED[name].bounds[0], DECLARED[name].bounds[1]))
        for name in of.parameters
    }  # fmt: skip
    p |= {"own_beacon": float(seed % 2), "known_start": float(seed // 2 % 2),
          "common_clock": float(seed // 4 % 2), "pings": 1.0 + seed % 5,
          "speed": rng.uniform(-0.02, 0.02)}  # fmt: skip
    s = {name: rng.normal(0.0, 0.6, length).tolist() for name, length in SURROUNDINGS.items()}
    away = rng.normal(size=3)
    away *= AWAY[seed // 8] / np.linalg.norm(away)
    s["position"] = (np.array(s["platform"]) + away).tolist()
    return SimpleNamespace(**p), SimpleNamespace(**s)


def numbers(found: Any) -> Iterator[float]:
    if dataclasses.is_dataclass(found):
        for field in dataclasses.fields(found):
            yield from numbers(getattr(found, field.name))
    elif isinstance(found, Mapping):
        for key in sorted(found):
            yield from numbers(key)
            yield from numbers(found[key])
    elif isinstance(found, list | tuple):
        for each in found:
            yield from numbers(each)
    else:
        yield float(found or 0.0)


@pytest.mark.parametrize("name", BOUNDS)
def test_equations_of_a_bound_give_the_recorded_numbers(name: str) -> None:
    of, rows = BOUNDS[name], []
    root = np.random.default_rng(6).normal(size=(of.states + of.each,) * 2)
    for seed in range(SITUATIONS):
        p, s = situation(of, seed)
        parts = {
            "prior": of.prior_stds(ca, p, s),
            **{f"transition {dt}": of.transition(ca, p, dt) for dt in (0.1, 20.0)},
            **{f"row {n}": row.of(ca, p, s) for n, row in enumerate(of.rows)},
            "marginals": of.marginals(p, root @ root.T),
        }
        flat = {key: [*numbers(it)] for key, it in parts.items()}
        rows.append({
            key: [len(it), *as_recorded.digest_of_all([[it]])] for key, it in flat.items()
        })
    as_recorded.check(f"equations of the bound {name}", {
        "sizes": [of.states, of.each], "parameters": [*of.parameters],
        "rows": [[row.counts, row.own_beacon] for row in of.rows],
        **{f"situation {n}": row for n, row in enumerate(rows)},
    })  # fmt: skip


@pytest.mark.parametrize(("variance", "counts"), [(0.0, 1e-12), (1e-14, 1e-12), (4e-12, 4e-12)])
def test_no_sensor_is_better_than_a_micrometre(variance: float, counts: float) -> None:
    measurement = Measurement(**{
        field.name: variance if field.name == "variance" else {}
        for field in dataclasses.fields(Measurement)
    })  # fmt: skip
    assert least(np, measurement) == pytest.approx(counts, rel=1e-12, abs=0.0)
