"""Components as WebAssembly: the same bits as the FMU. Skipped where there is no node or zig."""

from __future__ import annotations

import json
import shutil
import subprocess
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from quick import few
from sblcosim.fmus.build import compiler, factory
from sblcosim.models import COMPONENTS
from sblcosim.models.declaration import Variable

from .host import NOISY, Array, Host, T, assert_same_bits

NODE = shutil.which("node")
pytestmark = [
    pytest.mark.skipif(NODE is None, reason="needs node"),
    pytest.mark.skipif(compiler.zig() is None, reason="needs ziglang"),
]
SCRIPT = Path(__file__).with_name("wasm.cjs")
QUICK = ("range_model", "ekf")
STEPS = 60
LARGEST = {
    "target": 40_000, "platform": 75_000, "acoustics": 60_000, "range_model": 1_000,
    "ekf": 11_000, "sequential": 11_000, "multilateration": 12_000, "long_baseline": 150_000,
    "coupled": 160_000, "fixed_lag": 240_000,
}
"""Largest size of a module in bytes."""


def module_of(fmu: Path, folder: Path) -> Path:
    """The module in an FMU, unpacked."""
    with zipfile.ZipFile(fmu) as archive:
        (name,) = (n for n in archive.namelist() if n.startswith("binaries/wasm32-freestanding/"))
        return Path(archive.extract(name, folder))


def at_random(variable: Variable, rng: np.random.Generator, ends: Array) -> Array:
    """An input before each step: counts that grow, epochs before now, other numbers at random."""
    shape = (len(ends), variable.size)
    if "count" in variable.name:
        return np.cumsum(rng.random(shape) < 0.4, axis=0).astype(float)
    if "epoch" in variable.name:
        return np.broadcast_to(np.maximum(ends - 2 * T, 0.0)[:, None], shape).copy()
    low = np.broadcast_to(-20.0 if variable.min is None else variable.min, shape)
    high = np.broadcast_to(20.0 if variable.max is None else variable.max, shape)
    values = rng.uniform(np.maximum(low, -20.0), np.minimum(high, 20.0))
    return values if variable.type == "Float64" else np.round(values)


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("name", few(COMPONENTS, QUICK))
def test_a_module_gives_the_bits_of_its_fmu(name: str, seed: int, tmp_path: Path) -> None:
    component, rng = COMPONENTS[name], np.random.default_rng(seed)
    (fmu,) = factory.build_all([factory.Wanted(name, 3, wasm=True)])
    module = module_of(fmu, tmp_path)
    assert module.stat().st_size <= LARGEST[name]
    parts = rng.choice([1, 2, 4], STEPS)
    ns = [0]
    for tick, part in enumerate(parts):
        ns += [tick * 100_000_000 + 100_000_000 * (i + 1) // int(part) for i in range(part)]
    times = np.array(ns) / 1e9
    declared = component.of("input")
    inputs = np.concatenate(
        [np.zeros((len(ns) - 1, 0)), *(at_random(v, rng, times[:-1]) for v in declared)], axis=1
    )
    changed: Any = NOISY[name]
    first = [
        np.broadcast_to(np.ravel(changed.get(v.name, v.starts)), v.size)
        for v in (*component.of("parameter"), *declared)
    ]
    (tmp_path / "times.json").write_text(json.dumps([str(t) for t in ns]))
    (tmp_path / "values").write_bytes(np.concatenate([*first, inputs.ravel()]).astype("<f8"))
    assert NODE is not None
    subprocess.run(
        [NODE, SCRIPT, module, "times.json", "values", "outputs"], cwd=tmp_path, check=True
    )
    native = Host(name, 3, fmu, f"_wasm_{seed}").start(changed)
    expected = np.concatenate(
        [[native.outputs()], native.run(times.tolist(), inputs if declared else None)]
    )
    found = np.frombuffer((tmp_path / "outputs").read_bytes(), "<f8")
    assert (expected != expected[0]).any()
    assert_same_bits(found.reshape(expected.shape), expected)


@pytest.mark.parametrize("fmi", [2, 3])
def test_only_a_build_that_asks_for_it_has_a_module(fmi: Any) -> None:
    def binaries(wasm: bool) -> set[str]:
        (fmu,) = factory.build_all([factory.Wanted("range_model", fmi, wasm=wasm)])
        with zipfile.ZipFile(fmu) as archive:
            names = (n.split("/") for n in archive.namelist())
            return {n[1] for n in names if n[0] == "binaries"}

    assert binaries(True) - binaries(False) == {"wasm32-freestanding"}
