"""NIST's reference data sets of one-way analysis of variance, against exact arithmetic.

NIST/ITL Statistical Reference Datasets (itl.nist.gov/div898/strd/anova), part of SciPy's tests.
The certified values are of the decimal data; those of 13 leading digits lose most of their scatter
when they become doubles. So the analysis is compared with exact fractions of the same doubles.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from importlib import resources
from itertools import combinations
from math import log10

import numpy as np
import pandas as pd
import pytest
from sblcosim.analysis.levels import analysis as general
from sblcosim.analysis.two_level import analysis as factorial

SETS = ["SiRstv", "AtmWtAg", *(f"SmLs0{i}" for i in range(1, 10))]
DIGITS = 12 - 0.5
"""As many as NIST's own log relative error is taken to, less half of one."""


@cache
def lines(name: str) -> list[list[str]]:
    text = resources.files("scipy.stats").joinpath(f"tests/data/nist_anova/{name}.dat").read_text()
    return [line.split() for line in text.splitlines()]


@cache
def data(name: str) -> pd.DataFrame:
    found = lines(name)
    start = next(i for i, words in enumerate(found) if words[:1] == ["Data:"] and i > 50) + 1
    rows = [(int(words[0]), float(words[1])) for words in found[start:] if len(words) == 2]
    return pd.DataFrame(rows, columns=["treatment", "y"])


def certified(name: str) -> dict[str, float]:
    """F and R² as printed."""
    f = next(words for words in lines(name) if words[:1] == ["Between"] and len(words) == 6)
    r2 = next(words for words in lines(name) if words[:2] == ["Certified", "R-Squared"])
    return {"f": float(f[-1]), "r2": float(r2[-1])}


@cache
def exact(name: str) -> dict[str, Fraction]:
    """Everything that an analysis of variance prints, by rational arithmetic."""
    table = data(name)
    groups = [list(map(Fraction, own.tolist())) for _, own in table.groupby("treatment")["y"]]
    sums, sizes = [sum(own) for own in groups], [len(own) for own in groups]
    means = [total / size for total, size in zip(sums, sizes, strict=True)]
    whole = Fraction(sum(sums), 1) / sum(sizes)
    between = sum(n * (mean - whole) ** 2 for n, mean in zip(sizes, means, strict=True))
    squares = [sum((y - mean) ** 2 for y in own) for own, mean in zip(groups, means, strict=True)]
    within = sum(squares)
    df, spare = len(groups) - 1, sum(sizes) - len(groups)
    found = {
        "between": between, "within": within, "total": between + within, "mean_sq": between / df,
        "mean_sq_error": within / spare, "f": between / df / (within / spare),
        "r2": between / (between + within),
    }
    found |= {f"mean {i}": mean for i, mean in enumerate(means)}
    found |= {f"gap {i} {j}": means[i] - means[j] for i, j in combinations(range(df + 1), 2)}
    found |= {f"var {i} {j}": squares[i] / (sizes[i] - 1) / sizes[i]
              + squares[j] / (sizes[j] - 1) / sizes[j] for i, j in combinations(range(df + 1), 2)}
    return found


def digits(value: float, truth: Fraction | float) -> float:
    """NIST's log relative error: how many digits agree."""
    off = abs(Fraction(value) - Fraction(truth))
    return -log10(float(off / abs(Fraction(truth)))) if off else 16.0


@pytest.mark.parametrize("name", SETS)
def test_analysis_of_variance_has_the_digits_of_exact_arithmetic(name: str) -> None:
    found, truth = general.analyse(data(name), ["treatment"], "y"), exact(name)
    term, residual = found.anova.loc["treatment"], found.anova.loc["residual"]
    values = {
        "between": term["sum_sq"], "within": residual["sum_sq"], "mean_sq": term["mean_sq"],
        "mean_sq_error": residual["mean_sq"], "f": term["F"], "r2": found.r2,
        "total": found.anova.loc["total", "sum_sq"],
    }
    values |= {f"mean {i}": mean for i, mean in enumerate(found.means["mean"])}
    for row in found.pairs.itertuples():
        where = f"{row.one - 1} {row.other - 1}"
        values |= {f"gap {where}": row.difference, f"var {where}": row.std_error**2}
    assert set(values) == set(truth)
    worst = {key: digits(float(values[key]), truth[key]) for key in values if truth[key]}
    assert min(worst.values()) >= DIGITS, worst
    assert digits(found.rmse**2, truth["mean_sq_error"]) >= DIGITS
    size = abs(float(data(name)["y"].iloc[0]))
    # where the decimals survive as doubles, the certified values follow
    kept = min(DIGITS, -np.log10(np.spacing(size) / found.rmse) - 0.5)
    for key, value in certified(name).items():
        assert digits(float(values[key]), value) >= kept - (key == "f")


def test_two_level_analysis_has_the_digits_of_exact_arithmetic() -> None:
    """AtmWtAg has two treatments: an experiment with one factor."""
    found, truth = factorial.analyse(data("AtmWtAg"), ["treatment"], "y"), exact("AtmWtAg")
    effect = found.effects.loc["treatment"]
    anova = found.anova
    for value, key in (
        (-effect["effect"], "gap 0 1"), (effect["t"] ** 2, "f"), (found.r2, "r2"),
        (anova.loc["treatment", "ss"], "between"), (anova.loc["residual", "ss"], "within"),
        (found.sigma**2, "mean_sq_error"), (anova.loc["total", "ss"], "total"),
    ):
        assert digits(float(value), truth[key]) >= DIGITS, key
