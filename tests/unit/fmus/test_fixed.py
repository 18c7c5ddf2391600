"""Models with known parameters: which values follow, what is left out, and which bits stay."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from sblcosim.errors import BuildError
from sblcosim.fmus.build import factory
from sblcosim.fmus.build.c_files import c_files
from sblcosim.fmus.build.fixed import fixed
from sblcosim.fmus.build.folding import Folded
from sblcosim.fmus.build.generator import Fixed, model_source, state_indices
from sblcosim.fmus.build.rolling import Rolled
from sblcosim.fmus.build.straight_line import Computation, constant, evaluated, statements
from sblcosim.models import RECEIVERS
from sblcosim.models.declaration import Component, output
from sblcosim.models.equations import Equations, Loop, build
from sblcosim.models.loading import load
from seams import Seam

Array = NDArray[np.float64]


def folded(expression: ca.SX, x: ca.SX, p: ca.SX, *numbers: float) -> str:
    """The statements for numbers of p."""
    function = ca.Function("f", [x, p], [expression])
    return "\n".join(statements(function, ["x", [*map(constant, numbers)]], ["y"], kind=Folded))


X, P = ca.SX.sym("x", 2), ca.SX.sym("p", 2)


@pytest.mark.parametrize(
    ("expression", "numbers", "left"),
    [
        (P[0] * P[1] + P[0], (2.0, 3.0), "r_set1(0x1.0000000000000p+3)"),
        (ca.if_else(P[0] > 1, X[0], X[1]), (2.0, 0.0), "x[0]"),
        (ca.if_else(P[0] > 1, X[0], X[1]), (1.0, 0.0), "x[1]"),
        (ca.if_else(ca.logic_and(P[0] > 1, X[0] > 1), 5, X[1]), (1.0, 0.0), "x[1]"),
        (ca.if_else(ca.logic_or(P[0] > 1, X[0] > 1), X[1], 5), (2.0, 0.0), "x[1]"),
        (ca.if_else(ca.logic_not(P[0] > 1), X[0], X[1]), (2.0, 0.0), "x[1]"),
        (ca.if_else(P[0] * X[0], 5, X[1]), (0.0, 0.0), "x[1]"),
        (ca.sqrt(P[0]) / P[1], (9.0, 2.0), "r_set1(0x1.8000000000000p+0)"),
    ],
)  # fmt: skip
def test_what_follows_from_known_numbers_is_left(
    expression: ca.SX, numbers: tuple[float, ...], left: str
) -> None:
    text = folded(expression, X, P, *numbers)
    assert f"= {left};" in text
    assert not any(word in text for word in ("r_blend", "r_keep", "m_lt", " * ", "r_sqrt"))


@pytest.mark.parametrize("function", ["sin", "cos", "tan", "exp", "log", "atan", "asin", "acos"])
def test_no_elementary_function_is_computed_by_python(function: str) -> None:
    assert f"r_{function}(" in folded(getattr(ca, function)(P[0]) * X[0], X, P, 0.5, 0.0)


@pytest.mark.parametrize("number", [0.0, -0.0])
def test_a_product_with_zero_stays_as_it_may_be_minus_zero(number: float) -> None:
    assert " * " in folded(P[0] * X[0] + X[1], X, P, number, 0.0)


def test_a_division_by_zero_stays() -> None:
    assert " / " in folded(P[0] / P[1] + X[0], X, P, 1.0, 0.0)


def test_few_possible_values_decide_comparisons() -> None:
    x = ca.SX.sym("x")
    function = ca.Function("f", [x], [ca.vertcat(x == 3, x > 0, x == 1)])
    kind = partial(Folded, {"x[0]": frozenset({1.0.hex(), 2.0.hex()})})
    values, results = evaluated(function, ["x"], kind)
    assert isinstance(values, Folded)
    assert [values.known.get(results[i]) for i in range(3)] == [0.0, 1.0, None]


def without_parts(name: str, **parameters: float) -> Fixed:
    return fixed(load(name), {key: [value] for key, value in parameters.items()})


@pytest.mark.slow
def test_coupled_with_q_given_has_no_bank_and_no_challenger() -> None:
    given = without_parts("coupled", acceleration_psd=0.01)
    learned = without_parts("coupled", acceleration_psd=-1.0)
    assert not {"show", "average", "mix"} & {*given.iterate}
    assert {"show", "average", "mix"} <= {*learned.iterate}
    assert (given.rows["filter"], learned.rows["filter"]) == (1, 4)
    watched = without_parts("coupled", acceleration_psd=0.01, watch=1.0)
    assert watched.rows["filter"] == 5
    sizes = [max(state_indices(model)) for model in (given, learned, watched)]
    assert sizes == sorted(sizes)
    assert sizes[0] < 0.6 * sizes[1]


def in_rows() -> Fixed:
    """Rows whose second state nothing uses, and which share the code that gives it another's."""
    number = output("y", "Both rows", "m")
    copied = Loop("copied", lambda p, x, u, t: x.a[0] < 9,
                  lambda p, x, u, w, t: {"a": ca.vertcat(x.a[0] + 1, x.b)}, each=("a",))
    return fixed(build(Component("C", 901, "For a test", (number,), None), Equations(
        output=lambda p, x, u, t: {"y": ca.sum1(x.a[:, 0])},
        initial=lambda p, w, t: {"a": ca.DM.zeros(2, 2), "b": t},
        tick=lambda p, x, u, w, t, k: {"b": x.b + t},
        iterate=(copied,),
    )), {})


def test_what_rows_with_one_code_are_written_from_has_a_place() -> None:
    model = in_rows()
    assert model.together("copied") == [0, 1]
    assert min(state_indices(model)) > 0
    assert "nowhere" not in model_source(model)


def test_a_state_without_a_place_is_not_read() -> None:
    with pytest.raises(BuildError, match="body_0: must not read a state without a place"):
        model_source(replace(in_rows(), unread=frozenset({4})))


def test_a_model_with_noise_is_refused() -> None:
    with pytest.raises(ValueError, match="must be without variants, noise and rows"):
        fixed(load("acoustics"), {})


def library(texts: dict[str, list[str]], folder: Path) -> ctypes.CDLL:
    """Functions of x that write y, by name."""
    lines = ['#include "real.h"', '#include "elementary.h"']
    for name, body in texts.items():
        lines += [f"__attribute__((visibility(\"default\"))) void {name}(const real *x, real *y)",
                  "{", *body, "}"]
    sources = {**c_files(("real.h", "elementary.h")), "it.c": "\n".join(lines).encode()}
    path = folder / "it.so"
    path.write_bytes(factory.compile_shared(sources, [factory.Unit("it.c")],
                                            factory.compilers.find()))
    return ctypes.CDLL(str(path))


def alike(n: int) -> tuple[ca.Function, int]:
    """A correction of a covariance and more, with many elements that are computed alike."""
    x = ca.SX.sym("x", n * n + n)
    A, b = ca.reshape(x[: n * n], n, n), x[n * n :]
    A = A + A.T
    for _ in range(3):
        c = A @ b
        A = A - (c @ c.T) / (1 + ca.fmax(ca.dot(b, c), 0))
    odd = ca.if_else(x[0] > 0, ca.sin(x[1]) * A[0, 1], ca.cos(x[1]) - A[1, 1])
    found = ca.vertcat(ca.vec(A), odd, ca.if_else(odd > 0, ca.exp(-odd), b))
    return ca.Function("f", [x], [found]), n * n + n


@pytest.mark.parametrize("n", [2, 7, 12])
def test_loops_give_the_bits_of_straight_lines(
    n: int, tmp_path: Path, seam: Seam
) -> None:
    seam.tuned(rolled_from=0, rolled_gain=-10_000)
    function, size = alike(n)
    kinds: dict[str, Callable[[], Computation]] = {"straight": Computation, "rolled": Rolled}
    texts = {name: statements(function, ["x"], "y", kind=kind) for name, kind in kinds.items()}
    assert ("for (" in "".join(texts["rolled"])) == (n > 2) or n == 2
    assert "for (" not in "".join(texts["straight"])
    both = library(texts, tmp_path)
    random = np.random.default_rng(n)
    for _ in range(50):
        x = random.normal(size=size)
        found = []
        for name in texts:
            y = np.zeros(function.numel_out(0))
            getattr(both, name)(x.ctypes.data_as(ctypes.c_void_p),
                                y.ctypes.data_as(ctypes.c_void_p))
            found.append(y.tobytes())
        assert found[0] == found[1]
        assert np.any(np.frombuffer(found[0]) != 0)


def test_loops_make_a_large_function_much_shorter() -> None:
    function, _ = alike(12)
    lengths = [len("\n".join(statements(function, ["x"], "y", kind=kind)))
               for kind in (Folded, Rolled)]
    assert lengths[1] < 0.5 * lengths[0]


@pytest.mark.parametrize(
    "name",
    [name if name in ("ekf", "sequential", "multilateration")
     else pytest.param(name, marks=pytest.mark.slow) for name in RECEIVERS],
)
def test_every_receiver_is_printed_without_parameters_and_unplaced_states(name: str) -> None:
    text = model_source(without_parts(name))
    assert "nowhere" not in text
    assert "#define N_P 0\n" in text
    assert "p[" not in text


def test_the_square_root_in_software_is_rounded_correctly(tmp_path: Path) -> None:
    body = (
        b"#define SOFT_SQRT\n#include \"soft_sqrt.h\"\n"
        b"__attribute__((visibility(\"default\"))) void roots(double *x, int n)\n"
        b"{ for (int i = 0; i < n; i++) x[i] = soft_sqrt(x[i]); }\n"
    )
    path = tmp_path / "it.so"
    path.write_bytes(factory.compile_shared(
        {**c_files(("soft_sqrt.h",)), "it.c": body}, [factory.Unit("it.c")],
        factory.compilers.find(),
    ))
    bits = np.random.default_rng(1).integers(0, 0x7FF0_0000_0000_0000, 200_000, dtype=np.uint64)
    near = [n * n * s for n, s in product(range(1, 500), (1.0, 2.0**-1060, 2.0**900))]
    info = np.finfo(np.float64)
    ends = [0.0, -0.0, np.inf, np.nan, -1.0, 5e-324, float(info.tiny), float(info.max)]
    x = np.concatenate([bits.view(np.float64), bits[:1000].view(np.float64) * 0 + bits[:1000] % 97,
                        near, np.nextafter(near, 0), np.nextafter(near, np.inf), ends])
    found = x.copy()
    ctypes.CDLL(str(path)).roots(found.ctypes.data_as(ctypes.c_void_p), len(found))
    with np.errstate(invalid="ignore"):
        expected = np.sqrt(x)
    some = ~np.isnan(expected)
    assert np.isnan(found[~some]).all()
    assert found[some].tobytes() == expected[some].tobytes()
