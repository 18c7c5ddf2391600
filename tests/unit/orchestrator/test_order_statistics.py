"""Order statistics of the lanes master: the C says what the definition says, for any values."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from quick import one_in
from sblcosim.fmus.build import c_files, compiler
from sblcosim.judge.definitions import order_statistics
from sblcosim.simulation.masters import c_libraries

DRIVER = Path(__file__).with_name("order_statistics_driver.c")
PERCENTAGES = (1, 50, 95, 100)

CASES: dict[str, Callable[[np.random.Generator, tuple[int, int]], NDArray[np.float64]]] = {
    "usual": lambda rng, shape: 0.01 * rng.chisquare(2, shape),
    "equal": lambda rng, shape: np.full(shape, 0.3),
    "few values": lambda rng, shape: rng.integers(0, 3, shape) / 7,
    "one key": lambda rng, shape: 1 + 1e-9 * rng.random(shape),
    "below all keys": lambda rng, shape: 1e-30 * rng.random(shape) * (rng.random(shape) < 0.9),
    "above all keys": lambda rng, shape: 1e30 * rng.random(shape),
    "all magnitudes": lambda rng, shape: np.exp(rng.uniform(-700, 700, shape)),
}


def flags(lanes: int) -> list[str]:
    """What the lanes master is compiled with, if this processor has it."""
    info = Path("/proc/cpuinfo")
    has = set(info.read_text("utf-8").split()) if info.exists() else set()
    wanted = {4: ["avx2"], 8: ["avx512f", "avx512dq"]}.get(lanes, [])
    return [f"-DLANES={lanes}", *(f"-m{flag}" for flag in wanted if set(wanted) <= has)]


@pytest.fixture(scope="module", params=[1, 2, 4, 8])
def library(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("order_statistics")
    for name, header in c_files.engine_headers().items():
        (folder / name).write_bytes(header)
    cc = compiler.find()
    include = (c_libraries.FOLDER,)
    cc.compile(str(DRIVER), "order.o", include, flags(request.param), folder)
    cc.link(["order.o"], "order.so", folder)
    return ctypes.CDLL(str(folder / "order.so"))


def statistics(library: Any, squares: NDArray[np.float64]) -> NDArray[np.float64]:
    """By the C; shape (len(PERCENTAGES), columns)."""
    n, columns = squares.shape
    keys = np.empty(n * columns * 2 + 64, np.uint8)
    at = -keys.ctypes.data % 64
    count = np.isfinite(squares).sum(axis=0)
    percentages = np.array(PERCENTAGES, np.int32)
    candidates, result = np.empty(squares.shape), np.empty((len(PERCENTAGES), columns))
    given = (count, percentages, keys[at:], candidates, result)
    library.order(
        ctypes.c_void_p(squares.ctypes.data), ctypes.c_int64(n),
        *(ctypes.c_void_p(array.ctypes.data) for array in given),
    )  # fmt: skip
    return result


@one_in(2)
@pytest.mark.parametrize("n", [1, 2, 19, 300, 70_000])
@pytest.mark.parametrize("case", CASES)
def test_they_are_those_of_the_definition(library: Any, case: str, n: int) -> None:
    columns = ctypes.c_int32.in_dll(library, "columns").value
    rng = np.random.default_rng(n)
    squares = CASES[case](rng, (n, columns))
    squares[rng.random(squares.shape) < 0.1] = np.inf
    squares[:, 0] = np.inf  # no value at all
    found = statistics(library, squares)
    for column, values in enumerate(squares.T):
        defined = order_statistics(np.sqrt(values[np.isfinite(values)]), PERCENTAGES)
        np.testing.assert_array_equal(found[:, column], defined)
    assert np.isnan(found[:, 0]).all()


def test_without_a_row_there_are_none(library: Any) -> None:
    columns = ctypes.c_int32.in_dll(library, "columns").value
    assert np.isnan(statistics(library, np.empty((0, columns)))).all()
