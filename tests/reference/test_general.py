"""The analysis of multi-level designs against published worked examples, to the digits printed.

Each example names its source. Those of types II and III are unbalanced.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from sblcosim.analysis.levels.analysis import analyse
from sblcosim.study.design import INTERACTION_SIGN
from scipy import stats
from statsmodels.stats.multitest import multipletests


def numbers(text: str) -> list[float]:
    return [np.nan if word == "." else float(word) for word in text.split()]


def by_cell(names: list[str], cells: dict[tuple[object, ...], str]) -> pd.DataFrame:
    """One row per number: levels and ``y``."""
    rows = [(*levels, y) for levels, text in cells.items() for y in numbers(text)]
    return pd.DataFrame(rows, columns=[*names, "y"])


DRUGS = by_cell(["drug", "disease"], {
    (1, 1): "42 44 36 13 19 22", (1, 2): "33 . 26 . 33 21", (1, 3): "31 -3 . 25 25 24",
    (2, 1): "28 . 23 34 42 13", (2, 2): ". 34 33 31 . 36", (2, 3): "3 26 28 32 4 16",
    (3, 1): ". . 1 29 . 19", (3, 2): ". 11 9 7 1 -6", (3, 3): "21 1 . 9 3 .",
    (4, 1): "24 . 9 22 -2 15", (4, 2): "27 12 12 -5 16 15", (4, 3): "22 7 25 5 12 .",
})
"""SAS/STAT User's Guide, The GLM Procedure, example "Unbalanced ANOVA for Two-Way Design with
Interaction" (data of Afifi and Azen, 1972, in Kutner, Am. Statistician 28, 1974, 98); dots are
missing."""

CARS = pd.DataFrame({
    "cyl": numbers("6 6 4 6 8 6 8 4 4 6 6 8 8 8 8 8 8 4 4 4 4 8 8 8 8 4 4 4 8 6 8 4"),
    "am": numbers("1 1 1 0 0 0 0 0 0 0 0 0 0 0 0 0 0 1 1 1 0 0 0 0 0 1 1 1 1 1 1 1"),
    "wt": numbers(
        "2.62 2.875 2.32 3.215 3.44 3.46 3.57 3.19 3.15 3.44 3.44 4.07 3.73 3.78 5.25 5.424 5.345 "
        "2.2 1.615 1.835 2.465 3.52 3.435 3.84 3.845 1.935 2.14 1.513 3.17 2.77 3.57 2.78"
    ),
    "hp": numbers(
        "110 110 93 110 175 105 245 62 95 123 123 180 180 180 205 215 230 66 52 65 97 150 150 245 "
        "175 66 91 113 264 175 335 109"
    ),
})
"""R's data set mtcars (Henderson and Velleman, Biometrics 37, 1981, 391–411)."""

CONFORMITY = by_cell(["status", "category"], {
    ("low", "low"): "8 7 10 6 13 12 7 6 8 12", ("low", "high"): "4 8 13 9 24 7 23 13",
    ("low", "medium"): "12 4 4 9", ("high", "low"): "21 23 15 12 16",
    ("high", "high"): "19 9 7 11 14 13 10",
    ("high", "medium"): "12 17 14 16 20 8 14 17 7 17 15",
})
"""Moore and Krupat, Sociometry 34, 1971, 122–134; data set Moore of R's package carData."""

BATTERIES = by_cell(["material", "temperature"], {
    (1, 15): "130 155 74 180", (1, 70): "34 40 80 75", (1, 125): "20 70 82 58",
    (2, 15): "150 188 159 126", (2, 70): "136 122 106 115", (2, 125): "25 70 58 45",
    (3, 15): "138 110 168 160", (3, 70): "174 120 150 139", (3, 125): "96 104 82 60",
})
"""Montgomery, Design and Analysis of Experiments, 8th edition, Example 5.1."""

WARP = by_cell(["wool", "tension"], {
    ("A", "L"): "26 30 54 25 70 52 51 26 67", ("A", "M"): "18 21 29 17 12 18 35 30 36",
    ("A", "H"): "36 21 24 18 10 43 28 15 26", ("B", "L"): "27 14 29 19 29 31 41 20 44",
    ("B", "M"): "42 26 19 16 39 28 21 39 29", ("B", "H"): "20 21 24 17 13 15 15 16 28",
})
"""R's data set warpbreaks (Tippett 1950)."""

OZONE = by_cell(["month"], {
    ("May",): "41 36 12 18 28 23 19 8 7 16 11 14 18 14 34 6 30 11 1 11 4 32 23 45 115 37",
    ("Jun",): "29 71 39 23 21 37 20 12 13",
    ("Jul",): "135 49 32 64 40 77 97 97 85 10 27 7 48 35 61 79 63 16 80 108 20 52 82 50 64 59",
    ("Aug",): "39 9 16 78 35 66 122 89 110 44 28 65 22 59 23 31 44 21 9 45 168 73 76 118 84 85",
    ("Sep",): "96 78 73 91 47 32 20 23 21 24 44 21 28 9 13 46 18 13 24 16 13 23 36 7 14 30 14 18 "
    "20",
})
"""R's data set airquality (New York, 1973)."""

PRINTED = {
    "SAS, type II": (DRUGS, ["drug", "disease"], "y", {"typ": 2}, {
        "drug": "3 3063.432863 1021.144288 9.25", "disease": "2 418.833741 209.416870 1.90",
        "drug × disease": "6 707.266259 117.877710 1.07",
        "residual": "46 5080.816667 110.452536", "total": "57 9340.155172",
    }, {"disease": "0.1617", "drug × disease": "0.3958"}),
    "SAS, type III": (DRUGS, ["drug", "disease"], "y", {"typ": 3}, {
        "drug": "3 2997.471860 999.157287 9.05", "disease": "2 415.873046 207.936523 1.88",
        "drug × disease": "6 707.266259 117.877710 1.07",
    }, {"disease": "0.1637", "drug × disease": "0.3958"}),
    # car::Anova, as printed on riptutorial.com/r/example/12989
    "mtcars weight, type II": (CARS, ["cyl", "am"], "wt", {"typ": 2}, {
        "cyl": "2 7.2278 . 11.5266", "am": "1 3.2845 . 10.4758", "cyl × am": "2 0.0668 . 0.1065",
        "residual": "26 8.1517",
    }, {"cyl": "0.0002606", "am": "0.0032895", "cyl × am": "0.8993714"}),
    # the documentation of aovtype2 in R's package CGPfunctions
    "mtcars power, type II": (CARS, ["cyl", "am"], "hp", {"typ": 2}, {
        "cyl": "2 102729 . 60.1644", "am": "1 7318 . 8.5716", "cyl × am": "2 12181 . 7.1341",
        "residual": "26 22197",
    }, {"am": "0.007009", "cyl × am": "0.003390"}),
    # the documentation of statsmodels, ANOVA
    "Moore and Krupat, type II": (CONFORMITY, ["category", "status"], "y", {"typ": 2}, {
        "category": "2 11.614700 . 0.276958", "status": "1 212.213778 . 10.120692",
        "category × status": "2 175.488928 . 4.184623", "residual": "39 817.763961",
    }, {"category": "0.759564", "status": "0.002874", "category × status": "0.022572"}),
    "Montgomery": (BATTERIES, ["material", "temperature"], "y", {"typ": 3}, {
        "material": "2 10683.72 5341.86 7.91", "temperature": "2 39118.72 19559.36 28.97",
        "material × temperature": "4 9613.78 2403.44 3.56", "residual": "27 18230.75 675.21",
        "total": "35 77646.97",
    }, {"material": "0.0020", "material × temperature": "0.0186"}),
    # R's documentation of TukeyHSD: main effects alone
    "warpbreaks": (WARP, ["wool", "tension"], "y", {"order": 1}, {
        "wool": "1 450.7 450.7 3.339", "tension": "2 2034.3 1017.1 7.537",
        "residual": "50 6747.9 135.0",
    }, {"wool": "0.07361", "tension": "0.00138"}),
}


def check(value: float, printed: str) -> None:
    """A value rounds to what is printed."""
    assert f"{value:.{len(printed.partition('.')[2])}f}" == printed


@pytest.mark.parametrize("example", PRINTED)
def test_analysis_of_variance(example: str) -> None:
    table, factors, response, options, rows, p = PRINTED[example]
    anova = analyse(table, factors, response, **options).anova
    for source, line in rows.items():
        row = anova.loc[source.replace(" × ", INTERACTION_SIGN)]
        for column, printed in zip(("df", "sum_sq", "mean_sq", "F"), line.split(), strict=False):
            if printed != ".":
                check(row[column], printed)
    for source, printed in p.items():
        check(anova.loc[source.replace(" × ", INTERACTION_SIGN), "p"], printed)


def test_marginal_means_are_the_least_squares_means_of_sas() -> None:
    means = analyse(DRUGS, ["drug", "disease"], "y").means
    printed = ("25.9944444", "26.5555556", "9.7444444", "13.5444444")
    for value, text in zip(means.loc[means["factor"] == "drug", "mean"], printed, strict=True):
        check(value, text)


def test_pairs_with_unequal_variances() -> None:
    """Printed in R's own tests (stats-Ex.Rout.save): pairwise.t.test without a pooled deviation.

    R adjusts by Holm's method there, so the unadjusted p values are adjusted so.
    """
    pairs = analyse(OZONE, ["month"], "y").pairs
    p = 2 * stats.t.sf(pairs["t"].abs(), pairs["df"])
    np.testing.assert_allclose(pairs["p"], np.minimum(1, 10 * p))
    holm = dict(zip(zip(pairs["one"], pairs["other"], strict=True),
                    multipletests(p, method="holm")[1], strict=True))
    printed = {
        ("May", "Jun"): "1.00000", ("May", "Jul"): "0.00026", ("Jun", "Jul"): "0.01527",
        ("May", "Aug"): "0.00195", ("Jun", "Aug"): "0.02135", ("Jul", "Aug"): "1.00000",
        ("May", "Sep"): "0.86321", ("Jun", "Sep"): "1.00000", ("Jul", "Sep"): "0.00589",
        ("Aug", "Sep"): "0.01721",
    }
    for pair, text in printed.items():
        check(holm[pair], text)


def test_common_random_numbers_are_repeated_measures() -> None:
    """Winer, Statistical Principles in Experimental Design, 2nd edition, 1971, page 268.

    Four drugs, each given to five persons: sums of squares 698.20, 680.80, 112.80, F = 24.76.
    """
    table = pd.DataFrame({
        "replicate": np.repeat(np.arange(5), 4), "drug": np.tile(np.arange(4), 5),
        "y": numbers("30 28 16 34 14 18 10 22 24 20 18 30 38 34 20 44 26 28 14 30"),
    })
    anova = analyse(table, ["drug"], "y", seeding="common").anova
    for source, printed in (("drug", "698.20"), ("replicates", "680.80"), ("residual", "112.80")):
        check(anova.loc[source, "sum_sq"], printed)
    check(anova.loc["drug", "F"], "24.76")
