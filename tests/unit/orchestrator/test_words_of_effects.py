"""Which effects matter, in whole sentences, and means that end at zero."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from sblcosim.analysis.means.analysis import means
from sblcosim.analysis.two_level.analysis import Factorial, analyse
from sblcosim.analysis.two_level.power import detectable
from sblcosim.errors import ConfigurationError
from sblcosim.report.two_level import direction, what_matters
from scipy import stats


def analysed(practical: float | None = 0.5, factors: str = "abcd") -> Factorial:
    points = np.array(np.meshgrid(*[[-1.0, 1.0]] * len(factors))).reshape(len(factors), -1).T
    table = pd.DataFrame(np.tile(points, (3, 1)), columns=[*factors])
    table["y"] = 5 + np.random.default_rng(91).normal(size=len(table))
    return analyse(table, factors, "y", practical=practical, unit="m")


def told(verdicts: str, significant: int = 0, practical: float | None = 0.5) -> str:
    """The words on effects of decreasing size with these verdicts: m, u or s."""
    found = analysed(practical)
    effects = found.ranked().copy()
    words = {"m": "matters", "u": "undecided", "s": "too small"}
    if verdicts:
        effects["verdict"] = [words[v] for v in verdicts]
    effects["significant"] = np.arange(len(effects)) < significant
    return what_matters(replace(found, effects=effects))


NAMES = [*analysed().ranked().index]
MANY = ". With many runs, almost all are, whether they matter or not"


def test_effects_that_matter_that_may_and_that_do_not_are_counted_and_named() -> None:
    assert len(NAMES) == 10
    first = ", ".join(NAMES[:3])
    assert told("mmmuuuusss", 4) == (
        f"4 of 10 effects are statistically significant. 3 matter, as they are surely larger than "
        f"0.5 m: {first}. More runs are needed to decide about {', '.join(NAMES[3:6])} and 1 "
        "smaller ones. 3 are too small to matter, significant or not."
    )
    assert told("uuussssssm", 1) == (
        f"1 of 10 effects are statistically significant. 1 matter, as they are surely larger than "
        f"0.5 m: {NAMES[9]}. More runs are needed to decide about {first}. 6 are too small to "
        "matter, significant or not."
    )
    assert told("s" * 10) == (
        "0 of 10 effects are statistically significant. None is surely larger than 0.5 m. 10 are "
        "too small to matter, significant or not."
    )
    assert told("m" * 10, 10) == (
        f"10 of 10 effects are statistically significant. 10 matter, as they are surely larger "
        f"than 0.5 m: {', '.join(NAMES)}."
    )


@pytest.mark.parametrize(("significant", "more"), [(0, ""), (5, ""), (6, MANY), (10, MANY)])
def test_more_than_half_of_all_effects_are_almost_all(significant: int, more: str) -> None:
    assert told("", significant, None) == (
        f"{significant} of 10 effects are statistically significant{more}. No smallest effect that "
        "matters was given (option --practical)."
    )


def test_the_better_level_is_named_of_significant_factors_only() -> None:
    found = analysed()
    effects = found.effects.assign(effect=0.1, significant=False)
    assert direction(replace(found, effects=effects)) == ""
    effects.loc[["a", "c", "a × b"], "significant"] = True
    effects.loc["a", "effect"] = 0.2
    effects.loc["c", "effect"] = -0.3
    assert direction(replace(found, effects=effects)) == (
        "The better levels, on average over the others: c 1, a −1."
    )


@pytest.mark.parametrize("power", [0.5, 0.8, 0.99])
def test_an_effect_is_detected_as_often_as_is_said(power: float) -> None:
    """By SciPy's noncentral t distribution, which is right at these degrees of freedom."""
    found = analysed()
    size = detectable(found, power) / found.effects["std_error"]
    line = stats.t.isf(0.025, found.df)
    often = stats.nct.sf(line, found.df, size) + stats.nct.cdf(-line, found.df, size)
    assert often == pytest.approx(power, abs=1e-4)


@pytest.mark.parametrize("power", [0.0, 0.499, 1.0, 1.5])
def test_a_power_is_from_a_half_to_below_one(power: float) -> None:
    with pytest.raises(ConfigurationError, match=r"power: must be from 0\.5 to below 1"):
        detectable(analysed(), power)


@pytest.mark.parametrize(("least", "low"), [(0.0, 0.0), (1e-3, 0.0), (-1e-3, None)])
def test_an_interval_of_a_mean_ends_at_zero_where_no_run_is_below_it(
    least: float, low: float | None
) -> None:
    table = pd.DataFrame({
        "a": [1.0] * 4 + [2.0] * 3 + [3.0], "y": [least, 0.1, 0.1, 3.0, 7.0, 8.0, 9.5, 4.0],
    })  # fmt: skip
    found = means(table, ["a"], "y", confidence=0.9).set_index("value")
    for value, own in table.groupby("a")["y"]:
        row = found.loc[value]
        assert (row["runs"], row["mean"]) == (len(own), pytest.approx(own.mean()))
        if len(own) == 1:
            assert row[["std", "low", "high"]].isna().all()
            continue
        reach = stats.t.isf(0.05, len(own) - 1) * own.std() / np.sqrt(len(own))
        assert row["high"] == pytest.approx(own.mean() + reach)
        free = own.mean() - reach
        assert row["low"] == pytest.approx(free if value == 2 or low is None else low)
        assert value == 2 or free < 0
