"""The factorial analysis against published worked examples, to the digits printed there.

Montgomery, D. C.: Design and Analysis of Experiments, 8th edition, Wiley 2013: Example 6.1
(plasma etching, 2³ with two replicates, pages 245 to 253), Example 6.2 (pilot plant filtration
rate, unreplicated 2⁴, pages 257 to 268) and Example 8.1 (a half fraction of the latter).
"""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
import pandas as pd
import pytest
from sblcosim.analysis.two_level.analysis import Factorial, analyse
from sblcosim.analysis.two_level.noise import lenth
from sblcosim.study.design import INTERACTION_SIGN

PLASMA = (
    (550, 669, 633, 642, 1037, 749, 1075, 729),
    (604, 650, 601, 635, 1052, 868, 1063, 860),
)
"""Etch rate of both replicates, in standard order of gap A, flow B and power C."""
PLASMA_RUN_ORDER = (
    (9, 14, 3, 13, 5, 2, 4, 10),
    (6, 1, 12, 8, 16, 15, 7, 11),
)
PLASMA_EFFECTS = {
    "A": -101.625, "B": 7.375, "C": 306.125,
    "AB": -24.875, "AC": -153.625, "BC": -2.125, "ABC": 5.625,
}
PLASMA_T = {
    "A": -4.2824, "B": 0.3108, "C": 12.9000,
    "AB": -1.0482, "AC": -6.4737, "BC": -0.0895, "ABC": 0.2370,
}
"""Effects over their standard errors, from the printed data."""

FILTRATION = (45, 71, 48, 65, 68, 60, 80, 65, 43, 100, 45, 104, 75, 86, 70, 96)
"""Filtration rate in standard order of A, B, C, D."""
FILTRATION_EFFECTS = {
    "A": 21.625, "B": 3.125, "C": 9.875, "D": 14.625,
    "AB": 0.125, "AC": -18.125, "AD": 16.625, "BC": 2.375, "BD": -0.375, "CD": -1.125,
    "ABC": 1.875, "ABD": 4.125, "ACD": -1.625, "BCD": -2.625, "ABCD": 1.375,
}
HALF_EFFECTS = {
    "A": 19.00, "B": 1.50, "C": 14.00, "D": 16.50, "AB": -1.00, "AC": -18.50, "AD": 19.00
}
"""Example 8.1: the half of the filtration runs with ABCD = +1."""


def standard_order(names: str) -> pd.DataFrame:
    """All points of a two-level design; the first factor changes fastest."""
    points = [point[::-1] for point in product((-1.0, 1.0), repeat=len(names))]
    return pd.DataFrame(points, columns=list(names))


def term(letters: str) -> str:
    return INTERACTION_SIGN.join(letters)


def printed(value: float, digits: int) -> float:
    return round(float(value), digits)


@pytest.fixture(scope="module")
def plasma() -> pd.DataFrame:
    return pd.concat(
        [
            standard_order("ABC").assign(replicate=i, rate=rate, run_order=order)
            for i, (rate, order) in enumerate(zip(PLASMA, PLASMA_RUN_ORDER, strict=True))
        ],
        ignore_index=True,
    )


@pytest.fixture(scope="module")
def full(plasma: pd.DataFrame) -> Factorial:
    return analyse(plasma, "ABC", "rate", order=3)


@pytest.fixture(scope="module")
def filtration() -> pd.DataFrame:
    return standard_order("ABCD").assign(rate=FILTRATION)


@pytest.fixture(scope="module")
def unreplicated(filtration: pd.DataFrame) -> Factorial:
    return analyse(filtration, "ABCD", "rate", order=4)


@pytest.mark.parametrize("letters", PLASMA_EFFECTS)
def test_plasma_effects_and_t_are_the_published_ones(full: Factorial, letters: str):
    row = full.effects.loc[term(letters)]
    assert printed(row.effect, 3) == PLASMA_EFFECTS[letters]
    assert printed(row.t, 4) == PLASMA_T[letters]
    assert printed(row.std_error / 2, 2) == 11.87


def test_plasma_fit_is_the_published_one(full: Factorial):
    assert printed(full.rmse, 2) == 47.46
    assert printed(full.r2, 4) == 0.9661
    assert printed(full.press, 1) == 72082.0
    assert printed(full.r2_predicted, 4) == printed(1 - 72082 / 531420.9375, 4)
    assert full.df == 8
    assert printed(full.reference, 6) == 2.306004
    assert printed(full.anova.loc["total", "ss"], 4) == 531420.9375
    assert printed(full.anova.loc["residual", "ss"], 1) == 18020.5
    assert full.lack_of_fit is None


def test_plasma_reduced_model_is_the_published_one(plasma: pd.DataFrame):
    # the book pools what the model leaves out with the error
    reduced = analyse(plasma, "ABC", "rate", terms=["A", "C", "A × C"], error="residual")
    assert (reduced.error, reduced.df) == ("residual", 12)
    assert printed(reduced.rmse, 2) == 41.69
    assert printed(reduced.effects["std_error"].iloc[0] / 2, 2) == 10.42
    assert printed(reduced.r2, 4) == 0.9608
    assert printed(reduced.press, 2) == 37080.44


def test_plasma_reduced_model_has_the_published_pure_error_between_replicates(
    plasma: pd.DataFrame
):
    # the residual of the full model, which has a term for each point
    reduced = analyse(plasma, "ABC", "rate", terms=["A", "C", "A × C"])
    assert (reduced.error, reduced.df) == ("pure", 8)
    assert printed(reduced.anova.loc["pure error", "ss"], 1) == 18020.5
    assert printed(reduced.sigma, 2) == 47.46
    assert printed(reduced.rmse, 2) == 41.69
    for letters in ("A", "C", "AC"):
        assert printed(reduced.effects.loc[term(letters), "t"], 4) == PLASMA_T[letters]


def test_plasma_run_order_is_kept(full: Factorial):
    assert full.residuals["run_order"].tolist() == [*PLASMA_RUN_ORDER[0], *PLASMA_RUN_ORDER[1]]


@pytest.mark.parametrize("letters", FILTRATION_EFFECTS)
def test_filtration_effects_are_the_published_ones(unreplicated: Factorial, letters: str):
    assert printed(unreplicated.effects.loc[term(letters), "effect"], 3) == (
        FILTRATION_EFFECTS[letters]
    )


def test_filtration_s_lenth_values_are_the_published_ones(unreplicated: Factorial):
    found = unreplicated.lenth
    assert unreplicated.method == "lenth"
    assert found is not None
    assert printed(found.pse, 3) == 2.625
    assert printed(found.me, 2) == 6.75
    assert printed(found.sme, 1) == 13.7
    assert found.df == 5


def test_lenth_on_the_scale_of_coefficients_is_half():
    half = lenth(np.array(list(FILTRATION_EFFECTS.values())) / 2)
    assert printed(half.pse, 4) == 1.3125


def test_filtration_s_active_effects_are_the_published_five(unreplicated: Factorial):
    active = unreplicated.effects.index[unreplicated.effects["significant"]]
    assert set(active) == {term(letters) for letters in ("A", "C", "D", "AC", "AD")}


def test_filtration_s_reduced_model_has_the_published_scatter(filtration: pd.DataFrame):
    reduced = analyse(filtration, "ABCD", "rate", terms=["A", "C", "D", ("A", "C"), ("D", "A")])
    assert printed(reduced.rmse, 6) == 4.417296


def test_half_fraction_s_effects_and_aliases_are_the_published_ones(filtration: pd.DataFrame):
    half = filtration[filtration[list("ABCD")].prod(axis=1) > 0]
    found = analyse(half, "ABCD", "rate", terms=[*map(tuple, HALF_EFFECTS)])
    for letters, effect in HALF_EFFECTS.items():
        assert printed(found.effects.loc[term(letters), "effect"], 2) == effect
    others = {n: ["".join(c) for c in combinations("ABCD", n)] for n in (2, 3)}
    # I = ABCD: a main effect goes with the three others, a pair with the other pair
    for letters in HALF_EFFECTS:
        rest = "".join(sorted(set("ABCD") - set(letters)))
        assert rest in others[len(rest)]
        assert found.aliases[term(letters)] == (term(rest),)
