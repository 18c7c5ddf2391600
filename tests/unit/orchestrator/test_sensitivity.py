"""Sobol' indices against published values, and what is said of them."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from published_functions import ANGLES, ISHIGAMI, UNITS, WITH_NOISE, G, g, ishigami, noisy
from sblcosim.analysis import sobol
from sblcosim.analysis.sensitivity import Sensitivity, indices, of_table
from sblcosim.errors import ConfigurationError
from sblcosim.study.distributions import distribution_of
from sblcosim.study.space import Factor, sample
from sblcosim.study.stand_in import evaluate, model_of
from scipy import stats

DIGIT = 5e-5
"""Published values are rounded."""


def of(function: Any, factors: tuple[Factor, ...], n: int, seed: int = 1) -> Sensitivity:
    drawn = sample(factors, n, seed)
    return indices(drawn, evaluate(model_of(function), drawn), function.__name__)


def holds(found: Sensitivity, published: dict[str, tuple[float, ...]]) -> np.ndarray:
    """Whether each interval holds the published index; shape (first and total, factors)."""
    rows = []
    for kind, values in published.items():
        low, high = (found.indices[f"{kind}_{end}"][: len(values)] for end in ("low", "high"))
        rows.append((low <= np.add(values, DIGIT)) & (np.subtract(values, DIGIT) <= high))
    return np.array(rows)


# --- Published values ----------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize(
    ("function", "factors", "published"),
    [(ishigami, ANGLES, ISHIGAMI), (g, UNITS, G), (noisy, ANGLES, WITH_NOISE)],
)
def test_published_indices_are_inside_the_intervals(function, factors, published, seed) -> None:
    found = of(function, factors, 1024, 10_000 * seed)
    assert holds(found, published).all()
    for kind, values in published.items():
        assert found.indices[kind][: len(values)].to_numpy() == pytest.approx(values, abs=0.06)
    assert found.widest < 0.2


def test_the_published_indices_are_those_of_the_formulas() -> None:
    part = 1 / 3 / (1 + np.array([0, 1, 4.5, 9, 99, 99, 99, 99])) ** 2
    whole = np.prod(1 + part) - 1
    assert part / whole == pytest.approx(G["first"], abs=DIGIT)
    assert part / (1 + part) * (1 + whole) / whole == pytest.approx(G["total"], abs=DIGIT)


def test_a_seed_of_its_own_for_each_run_makes_all_factors_look_important() -> None:
    drawn = sample(ANGLES, 2048, 1)
    model = model_of(noisy)
    shared = indices(drawn, evaluate(model, drawn), resamples=200)
    assert shared.indices["total"].to_numpy() == pytest.approx([0.279, 0.221, 0.122, 0.5], abs=0.03)
    own = replace(drawn, seeds=1 + np.arange(len(drawn)))
    apart = indices(drawn, evaluate(model, own), resamples=200)
    assert apart.indices["total"][:3].to_numpy() == pytest.approx([0.779, 0.721, 0.622], abs=0.05)
    assert not holds(apart, {"total": WITH_NOISE["total"][:3]}).any()


def test_a_function_without_chance_has_no_index_of_the_seed() -> None:
    found = of(ishigami, ANGLES, 64)
    assert (found.indices.loc["seed"] == 0).all()
    assert "and nothing by chance (the seed)." in found.text()


def test_scipy_finds_the_same_indices() -> None:
    drawn = sample(UNITS, 256, 3)
    y = evaluate(model_of(g), drawn)
    found = indices(drawn, y)
    a, *swapped, b = y.reshape(256, -1).T
    other = stats.sobol_indices(
        func={"f_A": a[None], "f_B": b[None], "f_AB": np.array(swapped)[:, None]}, n=256
    )
    # the variance of all runs there is that of A and B here, and the mean is another
    assert found.indices["total"].to_numpy() == pytest.approx(other.total_order, rel=1e-9)
    assert found.indices["first"].to_numpy() == pytest.approx(other.first_order, abs=0.05)


def test_the_scale_of_the_response_does_not_matter() -> None:
    drawn = sample(ANGLES, 64)
    y = evaluate(model_of(noisy), drawn)
    one, other = (indices(drawn, values).indices for values in (y, 1e6 - 1e-3 * y))
    assert np.abs(one - other).to_numpy().max() < 1e-6


# --- Intervals -----------------------------------------------------------------------------------


def test_equal_arguments_give_equal_bits_and_the_seed_of_the_bootstrap_counts() -> None:
    drawn = sample(ANGLES, 64)
    y = evaluate(model_of(noisy), drawn)
    assert indices(drawn, y, seed=0).indices.equals(indices(drawn, y, seed=0).indices)
    columns = ["first_low", "first_high", "total_low", "total_high"]
    one, other = (indices(drawn, y, seed=s).indices for s in (0, 1))
    assert (one[columns] != other[columns]).all(axis=None)
    assert one[["first", "total"]].equals(other[["first", "total"]])


def test_intervals_grow_with_the_confidence_and_shrink_with_the_rows() -> None:
    drawn = sample(ANGLES, 256)
    y = evaluate(model_of(noisy), drawn)
    widths = [indices(drawn, y, confidence=c).widest for c in (0.5, 0.9, 0.99)]
    assert widths == sorted(widths)
    assert of(noisy, ANGLES, 1024).widest == pytest.approx(widths[1] * 1.96 / 1.645 / 2, rel=0.25)


def test_large_bootstraps_are_made_in_parts(monkeypatch) -> None:
    drawn = sample(ANGLES, 64)
    y = evaluate(model_of(noisy), drawn)
    whole = indices(drawn, y, resamples=400).indices
    monkeypatch.setattr("sblcosim.analysis.sensitivity._AT_ONCE", 64 * 30)
    parts = indices(drawn, y, resamples=400).indices
    assert (parts[["first", "total"]] == whole[["first", "total"]]).all(axis=None)
    assert np.abs(parts - whole).to_numpy().max() < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("n", [64, 128, 256, 512, 1024])
@pytest.mark.parametrize(
    ("function", "factors", "published"),
    [(ishigami, ANGLES, ISHIGAMI), (g, UNITS, G), (noisy, ANGLES, WITH_NOISE)],
)
def test_intervals_hold_the_index_about_as_often_as_they_say(
    function, factors, published, n: int
) -> None:
    samples = 200
    held = np.mean(
        [holds(of(function, factors, n, 10_000 * s), published) for s in range(1, 1 + samples)],
        axis=0,
    )
    print(f"\n{function.__name__}, {n} base rows: {held.min():.3f}, mean {held.mean():.3f}", held)
    assert held.mean() > 0.93
    assert held.min() > 0.75


# --- Logarithms, tails and lost runs -------------------------------------------------------------

POSITIVE = distribution_of("uniform", range=[0, 1])
TWO = (Factor("gps", POSITIVE, label="GPS error", unit="m"), Factor("depth", POSITIVE))


def error(gps, depth, seed):
    noise = np.random.Generator(np.random.Philox(key=seed)).normal()
    return float(np.exp(3 * gps + depth + noise))


def test_the_log_of_a_product_is_a_sum_of_variances() -> None:
    drawn = sample(TWO, 1024)
    found = indices(drawn, evaluate(model_of(error), drawn), "ekf.error_m", transform="log")
    parts = np.array([9 / 12, 1 / 12, 1])
    assert found.quantity == "ln ekf.error_m"
    assert not found.heavy
    for kind in ("first", "total"):
        assert found.indices[kind].to_numpy() == pytest.approx(parts / parts.sum(), abs=0.04)


def test_the_answer_says_the_shares_in_words() -> None:
    drawn = sample(TWO, 1024)
    found = indices(drawn, evaluate(model_of(error), drawn), "ekf.error_m", transform="log")
    text = found.text()
    row = found.indices.loc["gps"]
    assert text.startswith(
        f"{100 * row['total']:.0f} % of the variance of ln ekf.error_m, interactions included, is "
        f"explained by GPS error and {100 * found.indices.loc['seed', 'total']:.0f} % by chance "
        "(the seed)."
    )
    assert "1024 base rows of 5 runs: 5120 runs, 2048 of them independent." in text
    assert max(map(len, found.text(width=70).splitlines())) <= 70
    assert "GPS error" in found._repr_html_()
    assert repr(found).startswith("<Sensitivity of 5120 runs, total indices of ln ekf.error_m: ")


def test_the_answer_is_one_sentence_of_the_two_largest_and_chance() -> None:
    """Rough where the intervals are wide; what adds up to more than all is explained once."""
    for model, factors, rows in ((g, UNITS, 256), (noisy, ANGLES, 64)):
        found = of(model, factors, rows)
        said, total = sobol.answer(found), found.indices["total"]
        first, second, *rest = found.ranked().drop(index="seed").index
        assert said.count(". ") == 0
        assert f"is explained by {found.name_of(first)}, {100 * total[second]:.0f} % by " in said
        assert not any(found.name_of(name) in said for name in rest)
        assert said.startswith("Roughly ") == (found.widest > sobol.WIDEST)
        assert total.sum() > 1
        assert found.text().count("Totals add up to more than 100 %: an interaction counts") == 1
    flat = replace(found, indices=found.indices.assign(total=0.01))
    assert re.fullmatch(
        r"Each factor explains less than 5 % of the variance of .*, interactions included; chance "
        r"\(the seed\) explains (\d+ %|nothing)\.", sobol.answer(flat),
    )  # fmt: skip
    assert "Totals" not in flat.text()


def test_heavy_tails_of_a_raw_response_are_said() -> None:
    drawn = sample(TWO, 256)
    y = evaluate(model_of(error), drawn) ** 3
    found = indices(drawn, y, "ekf.error_m")
    assert found.heavy
    assert found.indices["total_high"].max() > 1.5
    assert "Heavy tails: 1 % of the runs make " in found.text()
    assert "; analyse the logarithm." in found.text()
    assert "analyse the logarithm" not in indices(drawn, y - y.min()).text()
    assert not of(ishigami, ANGLES, 256).heavy
    y = stats.norm.ppf(drawn.values["gps"])
    assert not indices(drawn, y).heavy


def test_it_says_how_many_rows_are_needed() -> None:
    few = of(noisy, ANGLES, 32)
    assert few.widest > 0.2
    needed = few.base_rows_needed
    assert needed & (needed - 1) == 0
    assert needed >= 32 * (few.widest / 0.2) ** 2 > needed / 2
    assert f"about {needed} base rows are needed, {(needed - 32) * 6} more runs." in few.text()
    assert of(noisy, ANGLES, needed).widest < 0.25
    enough = of(noisy, ANGLES, 1024)
    assert enough.base_rows_needed == 1024
    assert "more runs" not in enough.text()


# --- Missing runs and tables ---------------------------------------------------------------------


def test_whole_base_rows_are_left_out() -> None:
    drawn = sample(ANGLES, 64)
    y = evaluate(model_of(noisy), drawn)
    whole = y.reshape(64, -1)
    broken = y.copy()
    broken[[7, 8, 63 * 6]] = np.nan, np.inf, np.nan
    found = indices(drawn, broken)
    assert found.used.tolist() == [i not in (1, 63) for i in range(64)]
    assert (found.independent == whole[found.used][:, [0, -1]].T).all()
    assert found.runs == 62 * 6
    assert "2 of 64 base rows are left out, for 3 of their runs have no finite response" in (
        found.text()
    )
    # those that are left are analysed as if there were no others
    kept = replace(drawn, base_rows=62)
    kept = replace(kept, values=drawn.values[np.repeat(found.used, 6)],
                   seeds=drawn.seeds[np.repeat(found.used, 6)])
    assert found.indices.equals(indices(kept, whole[found.used].ravel()).indices)


def table_of(drawn: Any) -> pd.DataFrame:
    y = evaluate(model_of(error), drawn)
    return drawn.table().assign(**{"ekf.absolute_total_rms_m": y, "ekf.lost": y > 20})


def test_a_table_gives_the_log_error_and_what_is_lost_beside_it() -> None:
    drawn = sample(TWO, 256)
    table = table_of(drawn)
    shuffled = table.sample(frac=1, random_state=1)
    found = of_table(drawn, shuffled, "ekf.absolute_total_rms_m")
    assert [(f.response, f.transform) for f in found] == [
        ("ekf.absolute_total_rms_m", "log"), ("ekf.lost", "none")
    ]  # fmt: skip
    y = table["ekf.absolute_total_rms_m"].to_numpy()
    assert found[0].indices.equals(indices(drawn, y, transform="log").indices)
    assert found[1].indices.equals(indices(drawn, y > 20).indices)
    share = table["ekf.lost"].mean()
    assert found[0].lost == found[1].lost == pytest.approx(share)
    assert f"{100 * share:.2g} % of the runs are lost." in found[0].text()
    assert found[1].is_flag
    assert not found[0].is_flag


def test_without_lost_runs_there_is_nothing_to_say_of_them_but_that() -> None:
    drawn = sample(TWO, 64)
    table = table_of(drawn).assign(**{"ekf.lost": False})
    (found,) = of_table(drawn, table, "ekf.absolute_total_rms_m")
    assert "0 % of the runs are lost." in found.text()
    (found,) = of_table(drawn, table.drop(columns="ekf.lost"), "ekf.absolute_total_rms_m")
    assert "lost" not in found.text()


@pytest.mark.parametrize("place", [0, 1, -1])
def test_a_single_lost_run_does_not_take_the_answer_along(place: int) -> None:
    """Also if it is none of the independent runs."""
    drawn = sample(TWO, 64)
    table = table_of(drawn)
    lost = np.zeros((drawn.base_rows, len(table) // drawn.base_rows))
    lost[3, place] = 1
    table["ekf.lost"] = lost.ravel()[table["point"].to_numpy() - 1]
    main, *beside = of_table(drawn, table, "ekf.absolute_total_rms_m")
    assert main.lost == 1 / len(table)
    assert len(beside) == (place != 1)


def test_few_lost_runs_are_too_few() -> None:
    drawn = sample(TWO, 64)
    y = np.zeros(len(drawn))
    y[:: drawn.runs_per_row][:7] = 1
    assert "Only 7 of the 128 independent runs differ from the others" in indices(drawn, y).text()
    y[:: drawn.runs_per_row][:20] = 1
    assert "Only" not in indices(drawn, y).text()


def test_a_factor_that_has_never_changed_what_is_lost_may_do_so() -> None:
    drawn = sample(TWO, 64)
    y = (drawn.values["gps"] > 0.8).to_numpy(np.float64)
    found = indices(drawn, y, "ekf.lost").indices
    # nothing in 64 rows: at a risk of 2.5 %, each has had a chance of 1 − 0.025^(1/64)
    variance = y.reshape(64, -1)[:, [0, -1]].var()
    for name in ("depth", "seed"):
        low, total, high = found.loc[name, ["total_low", "total", "total_high"]]
        assert (low, total) == (0, 0)
        assert high == pytest.approx((1 - 0.025 ** (1 / 64)) / 2 / variance)
    assert found.loc["gps", "total_low"] > 0.5
    assert (indices(drawn, y + 1).indices.loc["depth"] == 0).all()


def test_runs_that_a_table_does_not_have_are_missing() -> None:
    drawn = sample(TWO, 64)
    table = table_of(drawn)
    (found, *_) = of_table(drawn, table.drop(index=[0, 11]), "ekf.absolute_total_rms_m")
    assert found.used.sum() == 62


# --- Bad input -----------------------------------------------------------------------------------

FINE = np.arange(64.0 * 6) + 1
DRAWN = sample(ANGLES, 64)


@pytest.mark.parametrize(
    ("values", "options", "message"),
    [
        (FINE[1:], {}, "y: must have a value for each of the 384 runs of the sample, got shape "
                       "(383,)"),
        (np.full(384, 2.0), {}, "y: must vary over the runs, got 2 in all that are independent"),
        (np.full(384, np.nan), {},
         "y: must be finite in all 6 runs of at least 16 base rows, got 0"),
        (np.where(FINE > 15 * 6, np.nan, FINE), {},
         "y: must be finite in all 6 runs of at least 16 base rows, got 15"),
        (FINE - 1, {"transform": "log"}, "y: must be positive for its logarithm, got 0"),
        (FINE, {"transform": "lg"}, "transform: must be none or log, got 'lg'; did you mean "
                                    "'log'?"),
        (FINE, {"confidence": 95}, "confidence: must be between 0 and 1, got 95"),
        (FINE, {"resamples": 10}, "resamples: must be at least 100, got 10"),
    ],
)  # fmt: skip
def test_what_cannot_be_analysed_is_refused_in_one_line(values, options, message: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        indices(DRAWN, values, "y", **options)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("change", "response", "message"),
    [
        (lambda t: t, "ekf.y", "response: must be a column of the table, got 'ekf.y'; did you mean "
                               "'ekf.x'?"),
        (lambda t: t.drop(columns="seed"), "ekf.x", "seed: must be a column of the table, got "
                                                    "none"),
        (lambda t: pd.concat([t, t[:1]]), "ekf.x",
         "point: must be there once, for the seed is a factor, got 1 again"),
        (lambda t: t.assign(point=t["point"] + 1), "ekf.x",
         "point: must be from 1 to 384, the runs of the sample, got 2 to 385"),
        (lambda t: t.assign(seed=t["seed"] + 1), "ekf.x",
         "seed: must be that of the sample, 1 at point 1, got 2"),
    ],
)  # fmt: skip
def test_a_table_of_other_runs_is_refused_in_one_line(change, response, message: str) -> None:
    table = change(DRAWN.table().assign(**{"ekf.x": FINE}))
    with pytest.raises(ConfigurationError) as caught:
        of_table(DRAWN, table, response)
    assert str(caught.value) == message
