"""Sobol' indices against published values, and what is said of them."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from published_functions import ANGLES, ISHIGAMI, UNIT, UNITS, WITH_NOISE, G, g, ishigami, noisy
from sblcosim.analysis.space import sentences as sensitivity_sentences
from sblcosim.analysis.space.analysis import Sensitivity, indices, of_table
from sblcosim.errors import ConfigurationError
from sblcosim.judge.definitions import LOST
from sblcosim.study.distributions import distribution_of
from sblcosim.study.space import DrawnFactor, sample
from sblcosim.study.stand_in import evaluate, model_of
from scipy import optimize, stats

DIGIT = 5e-5
"""Published values are rounded."""


def of(function: Any, factors: tuple[DrawnFactor, ...], n: int, seed: int = 1) -> Sensitivity:
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
    shared = indices(drawn, evaluate(model, drawn))
    assert shared.indices["total"].to_numpy() == pytest.approx([0.279, 0.221, 0.122, 0.5], abs=0.03)
    own = replace(drawn, seeds=1 + np.arange(len(drawn)))
    apart = indices(drawn, evaluate(model, own))
    assert apart.indices["total"][:3].to_numpy() == pytest.approx([0.779, 0.721, 0.622], abs=0.05)
    assert not holds(apart, {"total": WITH_NOISE["total"][:3]}).any()


def test_a_function_without_chance_has_an_index_of_the_seed_of_0_with_a_bound() -> None:
    highs = []
    for rows in (16, 64, 256):
        found = of(ishigami, ANGLES, rows)
        seed = found.indices.loc["seed"]
        assert (seed[["first", "first_low", "total", "total_low"]] == 0).all()
        assert "and 0 % by chance (the seed)." in found.text()
        highs.append(seed["total_high"])
    assert 0.4 > highs[0] > highs[1] > highs[2] > 0.01


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


@pytest.mark.parametrize("unit", [2.0**1019, 1e200, 1e-200, 2.0**-1000, 1e-300])
def test_the_unit_of_the_response_does_not_matter_however_large(unit: float) -> None:
    drawn = sample(ANGLES, 64)
    y = evaluate(model_of(noisy), drawn)
    with np.errstate(all="raise", under="ignore"):
        one, other = (indices(drawn, values) for values in (y, unit * y))
        assert np.abs(one.indices - other.indices).to_numpy().max() < 1e-9
        assert other.text()
        assert other.tail == pytest.approx(one.tail)
        logs = [indices(drawn, values, transform="log").indices
                for values in (np.abs(y) + 1, unit * (np.abs(y) + 1))]  # fmt: skip
    assert np.abs(logs[0] - logs[1]).to_numpy().max() < 1e-9


# --- Intervals -----------------------------------------------------------------------------------


def test_equal_arguments_give_equal_bits() -> None:
    drawn = sample(ANGLES, 64)
    y = evaluate(model_of(noisy), drawn)
    assert indices(drawn, y).indices.equals(indices(drawn, y).indices)


def test_intervals_grow_with_the_confidence_and_shrink_with_the_rows() -> None:
    drawn = sample(ANGLES, 256)
    y = evaluate(model_of(noisy), drawn)
    widths = [indices(drawn, y, confidence=c).widest for c in (0.5, 0.9, 0.99)]
    assert widths == sorted(widths)
    assert of(noisy, ANGLES, 1024).widest == pytest.approx(widths[1] * 1.96 / 1.645 / 2, rel=0.25)


def test_intervals_are_those_of_the_jackknife_by_hand() -> None:
    """Each base row left out once; totals on the logarithmic scale."""
    drawn = sample(ANGLES, 32)
    y = evaluate(model_of(noisy), drawn)
    y -= y.mean()
    found = indices(drawn, y).indices

    def estimates(rows: np.ndarray) -> np.ndarray:
        a, *swapped, b = (rows - rows.mean()).T
        variance = np.append(a, b).var()
        first = [np.mean(b * (m - a)) / variance for m in swapped]
        total = [np.log(np.mean((m - a) ** 2) / 2 / variance) for m in swapped]
        return np.array([first, total])

    rows = y.reshape(32, -1)
    left = np.array([estimates(np.delete(rows, i, axis=0)) for i in range(32)])
    squares = (left - left.mean(axis=0)) ** 2
    s = np.sqrt(squares.sum(axis=0) * 31 / 32)
    kurtosis = (squares**2).mean(axis=0) / squares.mean(axis=0) ** 2
    freedom = np.minimum(31, 64 / (kurtosis - 1 + 2 / 31))
    reach = stats.t.ppf(0.975, freedom) * s
    assert (freedom < 31).any()
    first, total = estimates(rows)
    for kind, value, far, back in (("first", first, reach[0], lambda x: x),
                                   ("total", total, reach[1], np.exp)):  # fmt: skip
        expected = np.clip(back(np.array([value, value - far, value + far])), 0, 1)
        columns = [kind, f"{kind}_low", f"{kind}_high"]
        np.testing.assert_allclose(found[columns].to_numpy().T, expected, rtol=1e-9, atol=1e-12)


# --- Logarithms, tails and lost runs -------------------------------------------------------------

POSITIVE = distribution_of("uniform", range=[0, 1])
TWO = (DrawnFactor("gps", POSITIVE, label="GPS error", unit="m"), DrawnFactor("depth", POSITIVE))


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
        f"{100 * row['total']:.0f} % of the variance of ln ekf.error_m, including interactions, is "
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
        said, total = sensitivity_sentences.answer(found), found.indices["total"]
        first, second, *rest = found.ranked().drop(index="seed").index
        assert said.count(". ") == 0
        assert f"is explained by {found.name_of(first)}, {100 * total[second]:.0f} % by " in said
        assert not any(found.name_of(name) in said for name in rest)
        assert said.startswith("Roughly ") == (found.widest > sensitivity_sentences.WIDEST)
        assert total.sum() > 1
        assert found.text().count("Totals exceed 100 %, because an interaction counts") == 1


def test_that_no_factor_matters_is_said_only_where_the_intervals_say_it() -> None:
    found = of(noisy, ANGLES, 64)
    small = dict.fromkeys(["first", "first_low", "total", "total_low"], 0.01)
    for high, chance_low, words in (
        (0.04, 0.95, r"Each factor explains less than 5 % of the variance of noisy, including "
                     r"interactions\. Chance \(the seed\) explains 97 %\."),
        (0.04, 0.5, r"Each factor .* explains roughly 97 %\."),
        (0.09, 0.95, r"No factor stands out: estimates are below 5 % of the variance of noisy, "
                     r"including interactions, but intervals reach up to 9 %\. Chance \(the seed\) "
                     r"explains 97 %\."),
        (1.0, 0.5, r"No factor stands out: .* up to 100 %\. Chance \(the seed\) explains roughly "
                   r"97 %\."),
    ):  # fmt: skip
        table = found.indices.assign(**small, first_high=high, total_high=high)
        table.loc["seed"] = [0.97, chance_low, 1.0, 0.97, chance_low, 1.0]
        assert re.fullmatch(words, sensitivity_sentences.answer(replace(found, indices=table)))
    assert "Totals" not in replace(found, indices=found.indices.assign(total=0.01)).text()


def test_few_rows_of_noise_and_little_else_do_not_say_that_no_factor_matters() -> None:
    """Unless each interval is below the share that is said."""
    factors = tuple(DrawnFactor(f"x{i}", UNIT) for i in (1, 2))
    said = 0
    for seed in range(40):
        drawn = sample(factors, 16, 1000 * seed)
        noise = stats.norm.ppf(((drawn.seeds + 0.5) * 0.6180339887) % 1)
        found = indices(drawn, drawn.values["x1"].to_numpy() + noise)
        answer = sensitivity_sentences.answer(found)
        assert not answer.startswith("Each factor") or found.indices["total_high"][:2].max() <= 0.05
        said += answer.startswith("No factor stands out")
    assert said


def test_heavy_tails_of_a_raw_response_are_said() -> None:
    drawn = sample(TWO, 256)
    y = evaluate(model_of(error), drawn) ** 3
    found = indices(drawn, y, "ekf.error_m")
    assert found.heavy
    assert "Heavy tails: 1 % of the runs contribute " in found.text()
    independent = y.reshape(256, -1)[:, [0, -1]]  # the others share factors with these
    squares = np.sort((independent - independent.mean()).ravel() ** 2)
    assert found.tail == pytest.approx(squares[-6:].sum() / squares.sum(), rel=1e-12)
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
    more_runs = (needed - 32) * 6
    assert f"needs at least {needed} base rows, which is {more_runs} more runs." in few.text()
    more = of(noisy, ANGLES, 128)
    assert f"needs about {more.base_rows_needed} base rows, " in more.text()
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
    assert "2 of 64 base rows are left out, because 3 of their runs have no finite response" in (
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
    assert f"{100 * share:.2g} % of the runs are lost. {LOST}" in found[0].text(width=None)
    assert found[1].text().count(LOST) == 1
    assert found[1].is_flag
    assert not found[0].is_flag


def test_without_lost_runs_there_is_nothing_to_say_of_them_but_that() -> None:
    drawn = sample(TWO, 64)
    table = table_of(drawn).assign(**{"ekf.lost": False})
    (found,) = of_table(drawn, table, "ekf.absolute_total_rms_m")
    assert "0 % of the runs are lost." in found.text()
    assert LOST not in found.text()
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
    """Its bound is that of the likelihood of its pairs, of which none differ."""
    drawn = sample(TWO, 64)
    y = (drawn.values["gps"] > 0.8).to_numpy(np.float64)
    found = indices(drawn, y, "ekf.lost").indices
    both = int(y[:: drawn.runs_per_row].sum())
    far = stats.t.ppf(0.975, 63) ** 2 / 2

    def likelihood(total: float) -> float:
        def negative(p: float) -> float:
            q = 1 - p
            return -both * np.log(p * (1 - total + total * p)) - (64 - both) * np.log(
                q * (1 - total + total * q)
            )

        return -float(optimize.minimize_scalar(negative, (1e-6, 1 - 1e-6), method="bounded",
                                               bounds=(1e-9, 1 - 1e-9)).fun)  # fmt: skip

    bound = optimize.brentq(lambda total: likelihood(0) - likelihood(total) - far, 0, 1)
    for name in ("depth", "seed"):
        low, total, high = found.loc[name, ["total_low", "total", "total_high"]]
        assert (low, total) == (0, 0)
        assert high == pytest.approx(bound, rel=1e-4)
    assert found.loc["gps", "total_low"] > 0.5


def steps(gps, depth, seed):
    return max(0.0, gps - 0.7) * (2 + depth)


@pytest.mark.parametrize("rows", [64, 256])
def test_a_factor_without_a_change_is_bounded_whatever_the_others_do(rows: int) -> None:
    """A run is moved to the farthest of all, in a share that likelihood does not exclude."""
    levels = DrawnFactor("kind", distribution_of("choice", levels=[1.0, 2.0]))
    share = 1 - np.exp(-(stats.t.ppf(0.975, rows - 1) ** 2) / 2 / rows)
    for of_levels in (False, True):
        drawn = sample((*TWO, levels), rows)
        for y in (
            evaluate(model_of(lambda gps, depth, kind, seed: steps(gps, depth, seed)), drawn),
            drawn.values["gps"] + of_levels * drawn.values["kind"],
        ):
            y = np.asarray(y)
            found = indices(drawn, y).indices.loc["seed"]
            far = np.max((y - y.mean()) ** 2) / y.reshape(rows, -1)[:, [0, -1]].var()
            assert (found[["first", "first_low", "total", "total_low"]] == 0).all()
            assert found["total_high"] == pytest.approx(share * far / (2 + share * far))
            assert found["first_high"] == found["total_high"]


@pytest.mark.parametrize("share", [0.3, 0.08, 0.01])
def test_rare_values_of_any_number_have_wide_intervals_or_are_too_few(share: float) -> None:
    """As of ``lost`` averaged over conditions: 0, 1/2 or 1."""
    factors = [DrawnFactor(f"x{i}", POSITIVE) for i in range(5)]
    rng = np.random.default_rng(1)
    a, b = rng.random((2, 2**16, 5))
    limits = np.quantile(a.sum(axis=1), [1 - share, 1 - share / 2])

    def of(u: np.ndarray) -> np.ndarray:
        return (u.sum(axis=-1)[..., None] > limits).mean(axis=-1)

    change = of(np.column_stack([a[:, :1], b[:, 1:]])) - of(a)  # all but the first
    first = 1 - np.mean(change**2) / 2 / of(a).var()
    held, few = [], 0
    for seed in range(60):
        drawn = sample(factors, 256, 1000 * seed)
        y = of(drawn.values.to_numpy())
        found = indices(drawn, y)
        row = found.indices[:5]
        held.append((row["first_low"] <= first + 0.01) & (first - 0.01 <= row["first_high"]))
        if found.few is not None:
            few += 1
            assert (found.indices[["first_low", "total_low"]] == 0).all(axis=None)
            assert (found.indices[["first_high", "total_high"]] == 1).all(axis=None)
    assert np.mean(held, axis=0).min() > 0.85
    assert (few > 50) == (share == 0.01)
    assert few == 0 or share == 0.01


def test_runs_that_a_table_does_not_have_are_missing() -> None:
    drawn = sample(TWO, 64)
    table = table_of(drawn)
    (found, *_) = of_table(drawn, table.drop(index=[0, 11]), "ekf.absolute_total_rms_m")
    assert found.used.sum() == 62
    assert found.left_out == 0
    assert "2 of 64 base rows have unfinished runs." in found.text()


def test_an_unfinished_study_is_not_refused() -> None:
    drawn = sample(TWO, 64)
    (found, *_) = of_table(drawn, table_of(drawn)[:100], "ekf.absolute_total_rms_m")
    assert found.used.sum() == 20
    assert "Without" not in found.text()


REGIONS = {
    "a box": lambda a, c, far: a > far,
    "a corner": lambda a, c, far: a + c < 2 - 2 * far,
    "a corner box": lambda a, c, far: (a < 1 - far) | (c < 1 - far),
    "a band": lambda a, c, far: np.abs(a - c) < 1 - far,
    "beside a band": lambda a, c, far: np.abs(a - c) > far / 2,
    "two corners": lambda a, c, far: (
        ((a > far) | (c < 1 - far)) & ((a < 1 - far) | (c > far))
    ),
    "a disc": lambda a, c, far: (a - 0.5) ** 2 + (c - 0.5) ** 2 < 0.5 * (1 - far),
}  # fmt: skip
"""Where a response is, and nowhere else."""


@pytest.mark.parametrize("region", REGIONS)
def test_few_rows_without_a_response_change_little_and_many_are_refused(region: str) -> None:
    """Of y = a, which a alone explains, whatever is left out."""
    drawn = sample(TWO, 1024)
    a, c = drawn.values["gps"].to_numpy(), drawn.values["depth"].to_numpy()
    answers = refusals = 0
    for far in np.linspace(0.02, 0.6, 30):
        y = np.where(REGIONS[region](a, c, far), a, np.nan)
        gone = int((~np.isfinite(y).reshape(1024, -1).all(axis=1)).sum())
        share = f"{gone / 10.24:.0f} %"
        if gone <= 0.2 * 1024:
            found = indices(drawn, y, "y")
            assert found.indices.loc["gps", ["first", "total"]].min() > 0.92
            said = found.text().split(". ")[0]
            if gone:
                assert said.startswith("Without ")
                assert f" of base rows ({gone} of 1024) in which a run has no response: " in said
                assert share in said or gone < 102
                assert f"{gone} of 1024 base rows are left out" in found.text()
            answers += 1
        else:
            with pytest.raises(ConfigurationError) as caught:
                indices(drawn, y, "y")
            if gone <= 1024 - 16:
                assert str(caught.value).startswith(
                    "y: must be finite in all 5 runs of at least 80 % of the base rows, got "
                )
                assert f"{gone} of 1024 are left out" in str(caught.value)
            assert "\n" not in str(caught.value)
            refusals += 1
    assert answers
    assert refusals


# --- Bad input -----------------------------------------------------------------------------------

FINE = np.arange(64.0 * 6) + 1
DRAWN = sample(ANGLES, 64)


@pytest.mark.parametrize(
    ("values", "options", "message"),
    [
        (FINE[1:], {}, "y: must have a value for each of the 384 runs of the sample, got shape "
                       "(383,)"),
        (np.full(384, 2.0), {}, "y: must vary over the runs, got 2 in all independent runs"),
        (np.full(384, np.nan), {},
         "y: must be finite in all 6 runs of at least 16 base rows, got 0"),
        (np.where(FINE > 15 * 6, np.nan, FINE), {},
         "y: must be finite in all 6 runs of at least 16 base rows, got 15"),
        (FINE - 1, {"transform": "log"}, "y: must be positive for its logarithm, got 0"),
        (FINE, {"transform": "lg"}, "transform: must be none or log, got 'lg'; did you mean "
                                    "'log'?"),
        (FINE, {"confidence": 95}, "confidence: must be between 0 and 1, got 95"),
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
         "point: must occur once, because the seed is a factor, got 1 twice"),
        (lambda t: pd.concat([t[4:5], t[4:5]]), "ekf.x",
         "point: must occur once, because the seed is a factor, got 5 twice"),
        (lambda t: t.assign(point=t["point"] + 1), "ekf.x",
         "point: must be from 1 to 384, the runs of the sample, got 2 to 385"),
        (lambda t: t.assign(seed=t["seed"] + 1), "ekf.x",
         "seed: must be that of the sample, 1 at point 1, got 2"),
        (lambda t: t.assign(x1=t["x1"] + (t["point"] == 7)), "ekf.x",
         f"x1: must be that of the sample, {DRAWN.values['x1'][6]:g} at point 7, got "
         f"{DRAWN.values['x1'][6] + 1:g}; is it another version of the sample?"),
    ],
)  # fmt: skip
def test_a_table_of_other_runs_is_refused_in_one_line(change, response, message: str) -> None:
    table = change(DRAWN.table().assign(**{"ekf.x": FINE}))
    with pytest.raises(ConfigurationError) as caught:
        of_table(DRAWN, table, response)
    assert str(caught.value) == message
