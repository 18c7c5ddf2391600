"""The generated C: equal to CasADi, and to itself on any number of lanes and compilers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from sblcosim.fmus.build import compiler
from sblcosim.models import COMPONENTS, RECEIVERS
from sblcosim.models.declaration import Component
from sblcosim.models.equations import Model

from .engine import Array, Engine

STEP = 100_000_000
RUNS, STEPS = 8, 60


def plausible(component: Component, rng: np.random.Generator) -> dict[str, object]:
    """Random parameters inside their declared bounds, of the size of their start values."""
    values: dict[str, object] = {}
    for v in component.of("parameter"):
        if v.choices is not None:
            values[v.name] = rng.choice(list(v.choices))
        elif v.type == "Boolean":
            values[v.name] = rng.integers(2)
        elif v.name in ("seed", "stream"):
            values[v.name] = rng.integers(60000)
        elif v.name == "slot_order":
            values[v.name] = rng.permutation(v.size) + 1
        elif v.type == "Int32":
            values[v.name] = rng.integers(int(v.min or 0), int(min(v.max or 9, 9)) + 1)
        elif v.name in (component.interval,):
            values[v.name] = 0.1
        else:
            least, most = v.bounds
            low = -1.0 if least is None else least
            scale = np.maximum(np.abs(np.asarray(v.starts, float)), 0.05)
            drawn = np.asarray(v.starts, float) + scale * rng.uniform(-0.5, 0.5, v.size)
            values[v.name] = np.clip(drawn, max(low, -1e9), min(most or 1e9, 1e9))
    return values


@pytest.fixture(scope="module")
def engines(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Engine]:
    folder = tmp_path_factory.mktemp("engines")
    return {name: Engine(name, folder) for name in COMPONENTS}


@pytest.fixture(scope="module")
def chain(engines: dict[str, Engine]) -> dict[str, tuple[Array, Array, Array, int]]:
    """Eight runs of the whole system with different parameters, one lane each.

    By component: parameters (n_p, 8), inputs (steps, n_u, 8), outputs (steps + 1, n_y, 8), variant.
    """
    rng = np.random.default_rng(20210123)
    ports: dict[str, Array] = {}
    result = {}
    for name in CHAIN:
        engine = engines[name]
        component = engine.model.component
        random = [plausible(component, rng) for _ in range(RUNS)]
        variant = 0
        if name == "target":
            variant = 6  # the random path has loops that differ from lane to lane
            for values in random:
                values |= {"trajectory": variant, "leg_length": 0.5, "speed": 1.0}
        if name == "platform":
            variant = 1  # a sea with a spectrum
            for values in random:
                values |= {"motion": variant, "wave_height": 1.0, "watch_circle": 3.0}
        if name == "acoustics":
            for values in random:
                values |= {"loss_probability": 0.25, "outlier_probability": 0.1}
        p = np.stack([engine.parameters(**values) for values in random], axis=1)
        declared = component.of("input")
        u = np.concatenate(
            [ports[v.name] for v in declared] or [np.zeros((STEPS, 0, RUNS))], axis=1
        )
        y = np.concatenate(
            [
                engine.drive(p[:, [i]], u[:, :, [i]], STEP, STEP, variant)[0]
                for i in range(RUNS)
            ],
            axis=2,
        )
        result[name] = p, u, y, variant
        for v in component.of("output"):
            values = engine.outputs(y, v.name)[:-1]
            ports[v.name] = values
            if name == "target":
                ports[f"target_{v.name}"] = values
    return result


BUILDS = [(cc, lanes) for cc in ("gcc", "zig") for lanes in (1, 2, 4, 8)]
FEW = [("gcc", 8), ("zig", 4)]
CHAIN = ("target", "platform", "acoustics", *RECEIVERS)


@pytest.mark.parametrize(
    ("name", "builds"),
    [(name, FEW) for name in CHAIN if name in ("target", "platform", "acoustics", "ekf")]
    + [pytest.param(name, BUILDS, marks=pytest.mark.slow) for name in CHAIN],
)  # fmt: skip
def test_every_number_of_lanes_gives_the_same_bits(
    name: str, builds: list[tuple[str, int]],
    chain: dict[str, tuple[Array, Array, Array, int]], tmp_path: Path,
) -> None:
    p, u, expected, variant = chain[name]
    assert np.isfinite(expected).all()
    assert np.ptp(expected[-1], axis=1).max() > 0, "the lanes must differ from each other"
    compilers = {"gcc": compiler.system("gcc"), "zig": compiler.zig()}
    tried = 0
    for which, lanes in builds:
        cc = compilers[which]
        if cc is None:
            continue
        engine = Engine(name, tmp_path, lanes, cc)
        for first in range(0, RUNS, lanes):
            group = slice(first, first + lanes)
            y, _ = engine.drive(p[:, group], u[:, :, group], STEP, STEP, variant)
            np.testing.assert_array_equal(
                y.view(np.int64), np.ascontiguousarray(expected[:, :, group]).view(np.int64)
            )
        tried += 1
    assert tried >= len(builds) // 2


def rows_of(model: Model, loop: str) -> list[Array]:
    """Places in the state of the rows that a loop goes through."""
    places = model.places(loop)
    return [
        np.concatenate([first + n * width + np.arange(width) for first, _, width in places])
        for n in range(places[0][1])
    ]


def without(function: Any, own: Array) -> Any:
    """A body whose result has the row only at its end."""
    def called(*arguments: Any) -> Any:
        result = np.ravel(function(*arguments).full())
        n = len(arguments[0])
        return ca.DM(np.concatenate([np.delete(result[:n], own), result[n:]]))

    called.size1_in = function.size1_in
    return called


def relative(actual: Array, expected: Array) -> float:
    np.testing.assert_array_equal(np.isnan(actual), np.isnan(expected))
    actual, expected = np.nan_to_num(actual), np.nan_to_num(expected)
    scale = np.maximum(np.abs(expected), 1.0)
    return float(np.max(np.abs(actual - expected) / scale, initial=0.0))


@pytest.mark.parametrize("name", list(COMPONENTS))
def test_compiled_functions_agree_with_casadi(
    name: str, engines: dict[str, Engine], chain: dict[str, tuple[Array, Array, Array, int]]
) -> None:
    """At points that a run passes through, with noise and times of their own.

    A loop's body may give NaN where its guard does not hold; it is not run there.
    """
    engine, rng = engines[name], np.random.default_rng(7)
    loops = [*engine.model.advance, *engine.model.iterate]
    worst = 0.0
    for variant, functions in engine.model.variants.items():
        p = engine.parameters(**plausible(engine.model.component, rng))
        u = (
            np.ascontiguousarray(chain[name][1][:, :, 0])
            if name in chain
            else rng.uniform(-20.0, 20.0, (STEPS, engine.n_u))
        )
        _, states = engine.drive(p[:, None], u[:, :, None], STEP, STEP, variant)
        for step in range(0, STEPS, 2):
            x, now = np.ascontiguousarray(states[step, :, 0]), u[step]
            w = rng.uniform(0.1, 1.0, engine.n_w)
            t, k = step * 0.1 + rng.uniform(0.0, 0.1), float(step + 1)

            def compare(
                actual: Array, function: Any, *arguments: Any, w: Array = w
            ) -> None:
                # Only so much of the noise as the occasion draws.
                cut = [
                    a[: function.size1_in(i)] if a is w else a for i, a in enumerate(arguments)
                ]
                nonlocal worst
                worst = max(worst, relative(actual, np.ravel(function(*cut).full())))

            def read(occasion: str, *arguments: Any, rows: Any = functions.rows) -> list[Any]:
                return [rows[occasion].read(*arguments)] if occasion in rows else []

            compare(
                engine.call("initial", variant, p, w, t),
                functions.initial, p, w, t, *read("initial", p),
            )
            compare(
                engine.call("tick", variant, x, now, p, w, t, k),
                functions.tick, x, now, p, w, t, k,
            )
            assert np.isfinite(engine.call("tick", variant, x, now, p, w, t, k)).all()
            compare(
                engine.call("output", variant, x, now, p, t), functions.output, x, now, p, t
            )
            for number, loop in enumerate(loops):
                if loop in engine.model.each:
                    for row, own in enumerate(rows_of(engine.model, loop)):
                        compare(
                            engine.call("row_guard", number, variant, row, x, now, p, t),
                            functions.guards[loop], x, now, p, t, x[own], row,
                        )
                        there = engine.call("row_body", number, variant, row, x, now, p, t)
                        compare(
                            np.concatenate([np.delete(there, own), there[own]]),
                            without(functions.bodies[loop], own),
                            x, now, p, np.zeros(0), t, x[own], row,
                        )
                    continue
                compare(
                    engine.call("guard", number, variant, x, now, p, t),
                    functions.guards[loop], x, now, p, t,
                )
                compare(
                    engine.call("body", number, variant, x, now, p, w, t),
                    functions.bodies[loop], x, now, p, w, t, *read(loop, x, p),
                )
    print(f"{name}: worst relative difference {worst:.1e}")
    # The array's differences of arrivals are small beside what they are of.
    assert worst < (1e-11 if name == "array" else 1e-12)


def test_every_component_has_its_noise_counted_apart() -> None:
    numbers = [component.number for component in COMPONENTS.values()]
    assert len(set(numbers)) == len(numbers)
