"""A constant that is added to a response changes no statistic but those that have it themselves.

Responses are multiples of 2⁻¹⁰, so that the sum is exact: whatever changes, the analysis has lost.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from fractions import Fraction
from itertools import product
from typing import Any

import mpmath
import numpy as np
import pandas as pd
import pytest
from quick import one_in
from sblcosim.analysis.common.centred import group_means
from sblcosim.analysis.levels import analysis as general
from sblcosim.analysis.means import analysis as sweep
from sblcosim.analysis.two_level import analysis as factorial
from sblcosim.analysis.two_level.box_cox import box_cox
from sblcosim.analysis.two_level.power import detectable
from sblcosim.analysis.two_level.ranking import ranking

CONSTANTS = [1e12, -1e12, 2.0**41 + 0.25, 12345.0]
LOCATIONS = {
    "factorial": {"overall_mean", "points.mean", "points.fit", "main_effects.mean",
                  "interactions.mean", "residuals.fit", "table.y"},
    "general": {"means.mean", "means.low", "means.high", "cells.mean", "cells.low", "cells.high",
                "medians.median", "medians.low", "medians.high", "medians.all_low",
                "medians.all_high", "largest", "median"},
}
"""What has the constant in it."""


def two_level(replicates: int, centre: int = 0, drop: int = 0) -> pd.DataFrame:
    """Runs of a 2³ design, with common noise of each replicate."""
    random = np.random.default_rng(replicates + 10 * centre + drop)
    points = [*product((-1.0, 1.0), repeat=3), *[(0.0, 0.0, 0.0)] * centre]
    table = pd.DataFrame(
        [(*point, k) for k in range(replicates) for point in points],
        columns=["A", "B", "C", "replicate"],
    )
    noise = random.normal(0.0, 0.3, len(table)) + random.normal(0, 0.5, replicates)[
        table["replicate"]]
    y = 7.0 + 1.5 * table["A"] - 0.6 * table["B"] + 0.2 * table["A"] * table["C"] + noise
    table["y"] = np.round(y * 1024) / 1024
    return table.iloc[: len(table) - drop]


def many_levels(seed: int, drop: int = 0) -> pd.DataFrame:
    random = np.random.default_rng(seed)
    table = pd.DataFrame(
        [(a, b, k) for k in range(12) for a in ("x", "y", "z") for b in (1, 2)],
        columns=["one", "two", "replicate"],
    )
    y = 40.0 + (table["one"] == "z") * 2.0 + table["two"] + random.lognormal(0, 0.8, len(table))
    table["y"] = np.round(y * 1024) / 1024
    return table.iloc[: len(table) - drop]


Case = tuple[str, pd.DataFrame, Callable[[pd.DataFrame], Any]]


def factorial_of(**options: Any) -> Callable[[pd.DataFrame], Any]:
    return lambda table: factorial.analyse(table, ["A", "B", "C"], "y", **options)


def general_of(**options: Any) -> Callable[[pd.DataFrame], Any]:
    return lambda table: general.analyse(table, ["one", "two"], "y", **options)


CASES: dict[str, Case] = {
    "pure error": ("factorial", two_level(4), factorial_of(practical=0.5)),
    "residual": ("factorial", two_level(3), factorial_of(error="residual", order=1)),
    "centre points": ("factorial", two_level(3, 2), factorial_of()),
    "Lenth": ("factorial", two_level(1), factorial_of(order=3)),
    "unbalanced": ("factorial", two_level(4, drop=5), factorial_of()),
    "paired": ("factorial", two_level(5), factorial_of(seeding="common", order=1)),
    "levels": ("general", many_levels(1), general_of(practical=0.5)),
    "type III": ("general", many_levels(2, 7), general_of(typ=3)),
    "levels, paired": ("general", many_levels(3), general_of(seeding="common")),
    "main effects": ("general", many_levels(4, 3), general_of(order=1)),
}


def numbers(found: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Every number of a result, by its place."""
    if is_dataclass(found):
        for it in fields(found):
            yield from numbers(getattr(found, it.name), f"{path}.{it.name}".lstrip("."))
    elif isinstance(found, pd.DataFrame):
        for column in found.columns:
            yield f"{path}.{column}", found[column].to_numpy()
    elif isinstance(found, float | tuple | bool | str):
        yield path, np.array(found, dtype=object if isinstance(found, tuple) else None)


def check(kind: str, before: Any, after: Any, constant: float) -> None:
    old, new = dict(numbers(before)), dict(numbers(after))
    assert set(old) == set(new)
    assert LOCATIONS[kind] <= set(old)
    for name, value in old.items():
        if name == "far_log":  # of the logarithms
            continue
        if value.dtype == object or value.dtype.kind in "Ub":
            assert str(new[name].tolist()) == str(value.tolist()), name
        elif name in LOCATIONS[kind]:
            np.testing.assert_allclose(new[name], value + constant, rtol=0, err_msg=name,
                                       atol=4 * np.spacing(abs(constant) + 100.0))
        else:
            np.testing.assert_allclose(new[name], value, rtol=1e-9, atol=1e-12, err_msg=name)


@one_in(2)
@pytest.mark.parametrize("constant", CONSTANTS)
@pytest.mark.parametrize("name", CASES)
def test_no_statistic_depends_on_a_constant(name: str, constant: float) -> None:
    kind, table, analysis = CASES[name]
    before, after = analysis(table), analysis(table.assign(y=table["y"] + constant))
    check(kind, before, after, constant)
    if kind == "factorial":
        assert ranking(after) == ranking(before)
        np.testing.assert_allclose(detectable(after), detectable(before), rtol=1e-9)
        assert after.text().splitlines()[-1] == before.text().splitlines()[-1]


@pytest.mark.parametrize("seeding", ["independent", "common"])
def test_a_spread_does_not_depend_on_a_constant(seeding: Any) -> None:
    table = two_level(6)
    before, after = (
        factorial.analyse(table.assign(y=table["y"] + c), ["A", "B", "C"], "y", transform="spread",
                          seeding=seeding, order=1) for c in (0.0, 1e12)
    )  # fmt: skip
    old, new = dict(numbers(before)), dict(numbers(after))
    for name, value in old.items():
        if value.dtype.kind == "f":
            np.testing.assert_allclose(new[name], value, rtol=1e-9, atol=1e-12, err_msg=name)


def test_means_of_a_sweep_do_not_depend_on_a_constant() -> None:
    table = many_levels(5)
    before, after = (sweep.means(table.assign(y=table["y"] + c), ["two"], "y") for c in (0.0, 1e12))
    np.testing.assert_allclose(after["std"], before["std"], rtol=1e-9)
    for column in ("mean", "low", "high"):
        np.testing.assert_allclose(after[column] - 1e12, before[column], atol=2e-4)


def test_what_is_rounded_away_is_no_scatter() -> None:
    """Runs that follow a model but for their last digits have no error to test it with."""
    random = np.random.default_rng(9)
    table = two_level(3)
    for constant in (0.0, 1.0, 1e3, 1e12):
        y = 1.5 * table["A"] - 0.6 * table["B"] + constant
        y *= 1 + np.finfo(float).eps * random.integers(-1, 2, len(y))
        found = factorial.analyse(table.assign(y=y), ["A", "B", "C"], "y")
        assert found.sigma == 0.0
        np.testing.assert_allclose(
            found.effects["effect"], [3.0, -1.2, 0, 0, 0, 0], atol=4e-4 if constant else 1e-12
        )
        assert (found.effects["effect"].iloc[2:] == 0).all()


def exact_heights(y: list[float], groups: list[int], powers: list[float]) -> list[Any]:
    """Box and Cox's log likelihood about the means of groups, with 60 digits."""
    with mpmath.workdps(60):
        logs = [mpmath.log(mpmath.mpf(value)) for value in y]
        middle = mpmath.fsum(logs) / len(y)
        found = []
        for power in powers:
            z = [mpmath.expm1(power * (x - middle)) / power if power else x - middle for x in logs]
            means = {g: mpmath.fsum(v for v, own in zip(z, groups, strict=True) if own == g)
                     / groups.count(g) for g in groups}
            left = mpmath.fsum((v - means[g]) ** 2 for v, g in zip(z, groups, strict=True))
            found.append(-mpmath.mpf(len(y)) / 2 * mpmath.log(left / len(y)))
        return found


@pytest.mark.parametrize("constant", [0.0, 1e6, 1e12])
def test_box_cox_has_the_digits_of_exact_arithmetic(constant: float) -> None:
    table = two_level(3)
    table["y"] += constant
    powers = [-2.0, -0.5, 0.0, 1.0, 2.0]
    found = box_cox(factorial.analyse(table, ["A", "B", "C"], "y", order=3), powers)
    groups = (4 * table["A"] + 2 * table["B"] + table["C"]).astype(int).tolist()
    expected = exact_heights(table["y"].tolist(), groups, powers)
    np.testing.assert_allclose(found["log_likelihood"], [*map(float, expected)], rtol=1e-12)


@pytest.mark.parametrize("constant", [0.0, 1e6, 1e12])
def test_logarithms_have_the_digits_of_exact_arithmetic(constant: float) -> None:
    table = many_levels(6)
    table["y"] += constant
    found = general.analyse(table, ["one"], "y", transform="log")
    with mpmath.workdps(40):
        means = [mpmath.fsum(map(mpmath.log, map(mpmath.mpf, own))) / len(own)
                 for _, own in table.groupby("one", sort=True)["y"]]
        gaps = [float(means[i] - means[j]) for i, j in ((0, 1), (0, 2), (1, 2))]
    np.testing.assert_allclose(found.pairs["difference"], gaps, rtol=1e-9)


def test_a_response_of_any_size_is_taken_about_its_middle() -> None:
    table = two_level(2)
    for y in (table["y"] * 1e-55, table["y"] * 1e55, np.exp(12 * table["y"])):
        found = factorial.analyse(table.assign(y=y), ["A", "B", "C"], "y")
        assert np.isfinite(found.effects["effect"]).all()
        direct = y[table["A"] > 0].mean() - y[table["A"] < 0].mean()
        assert found.effects["effect"].iloc[0] == pytest.approx(direct, rel=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_means_of_many_runs_are_exact_to_the_last_digit(seed: int) -> None:
    random = np.random.default_rng(seed)
    group = np.sort(random.integers(0, 3, 40000))
    y = 10.0 ** random.uniform(-3, 6) * (1.0 + 1e-3 * random.normal(size=len(group)))
    for found, own in zip(group_means(group, y), (y[group == n] for n in range(3)), strict=True):
        exact = sum(map(Fraction, own.tolist()), Fraction(0)) / len(own)
        assert abs(Fraction(float(found)) - exact) <= Fraction(float(np.spacing(found)))
