"""Distributions of factors, and samples of a space in which the seed is a factor."""

from __future__ import annotations

import re
from typing import get_args

import numpy as np
import pytest
from pydantic import BaseModel
from sblcosim.errors import ConfigurationError
from sblcosim.study.distributions import Distribution, Kind, distribution_of
from sblcosim.study.space import DrawnFactor, sample
from scipy import stats
from scipy.stats import qmc

U = (np.arange(200_000) + 0.5) / 200_000

DISTRIBUTIONS = {
    "uniform": (distribution_of("uniform", range=[2, 5]), stats.uniform(2, 3)),
    "log-uniform": (distribution_of("log-uniform", range=[0.1, 10]), stats.loguniform(0.1, 10)),
    "normal": (distribution_of("normal", mean=-3, std=2), stats.norm(-3, 2)),
    "truncated normal": (
        distribution_of("normal", mean=1, std=2, range=[0, 1.5]),
        stats.truncnorm(-0.5, 0.25, 1, 2),
    ),
    "log-normal": (
        distribution_of("log-normal", median=3, factor=2), stats.lognorm(np.log(2), scale=3)
    ),
    "triangular": (
        distribution_of("triangular", range=[1, 4], mode=2), stats.triang(1 / 3, loc=1, scale=3)
    ),
    "triangular from its mode": (
        distribution_of("triangular", range=[1, 4], mode=1), stats.triang(0, loc=1, scale=3)
    ),
    "triangular to its mode": (
        distribution_of("triangular", range=[1, 4], mode=4), stats.triang(1, loc=1, scale=3)
    ),
}


@pytest.mark.parametrize("name", DISTRIBUTIONS)
def test_quantiles_have_the_distribution_that_was_asked_for(name: str) -> None:
    given, law = DISTRIBUTIONS[name]
    x = given.quantiles(U)
    assert np.all(np.diff(x) >= 0)
    assert np.abs(law.cdf(x) - U).max() < 1e-9


def test_a_truncated_log_normal_is_the_log_normal_inside_the_range() -> None:
    x = distribution_of("log-normal", median=3, factor=2, range=[1, 4]).quantiles(U)
    law = stats.lognorm(np.log(2), scale=3)
    inside = (law.cdf(x) - law.cdf(1)) / (law.cdf(4) - law.cdf(1))
    assert np.abs(inside - U).max() < 1e-9
    assert 1 <= x.min() < x.max() <= 4
    from_zero = distribution_of("log-normal", median=3, factor=2, range=[0, 4]).quantiles(U)
    assert np.abs(law.cdf(from_zero) / law.cdf(4) - U).max() < 1e-9


def test_two_thirds_of_a_log_normal_are_within_its_factor() -> None:
    x = distribution_of("log-normal", median=0.2, factor=3).quantiles(U)
    assert np.median(x) == pytest.approx(0.2, rel=1e-4)
    assert np.mean((x > 0.2 / 3) & (x < 0.2 * 3)) == pytest.approx(0.6827, abs=1e-4)


@pytest.mark.parametrize("levels", [(1, 3, 2), (0.5, 1.5, 9.0), ("ekf", "ukf", "pf")])
def test_a_choice_has_its_levels_as_often_as_their_weights_say(levels) -> None:
    x = distribution_of("choice", levels=levels, weights=[1, 2, 5]).quantiles(U)
    shares = [np.mean(x == level) for level in levels]
    assert shares == pytest.approx([1 / 8, 2 / 8, 5 / 8], abs=1e-4)
    x = distribution_of("choice", levels=levels).quantiles(U)
    assert [np.mean(x == level) for level in levels] == pytest.approx([1 / 3] * 3, abs=1e-4)
    assert {type(value) for value in x.tolist()} == {type(level) for level in levels}


def test_true_and_false_are_levels() -> None:
    x = distribution_of("choice", levels=[True, False]).quantiles(np.array([0.2, 0.7]))
    assert x.tolist() == [True, False]


def test_a_table_of_a_file_can_hold_a_distribution() -> None:
    class FactorTable(Distribution):
        keys: tuple[str, ...]

    class File(BaseModel):
        gps: FactorTable

    file = File.model_validate(
        {"gps": {"keys": ("platform.gps_std_m",), "distribution": "uniform", "range": [0, 2]}}
    )
    assert file.gps.quantiles(np.array([0.25])) == 0.5


# --- Bad input -----------------------------------------------------------------------------------

MESSAGES = {
    "distribution: must be uniform or .*, got 'norml'; did you mean 'normal'?":
        {"distribution": "norml"},
    "std: must be given for the distribution 'normal', which has mean and std and perhaps range, "
    "got nothing": {"distribution": "normal", "mean": 1},
    "range: must be given for the distribution 'uniform', .*, got nothing":
        {"distribution": "uniform", "mean": 1, "std": 2},
    "median: must be given for the distribution 'log-normal', which has median and factor .*":
        {"distribution": "log-normal", "mean": 1, "std": 2},
    "mean: must not be given for the distribution 'uniform', which has range, got it":
        {"distribution": "uniform", "range": [0, 1], "mean": 2},
    "normal: there is no key 'stdd'; did you mean 'std'?":
        {"distribution": "normal", "mean": 1, "stdd": 1},
    "mean: must be a number, got abc": {"distribution": "normal", "mean": "abc", "std": 1},
    "mean: must be a finite number, got inf":
        {"distribution": "normal", "mean": float("inf"), "std": 1},
    "std: must be more than 0, got 0": {"distribution": "normal", "mean": 1, "std": 0},
    "factor: must be more than 1, got 0.5":
        {"distribution": "log-normal", "median": 1, "factor": 0.5},
    "range: must be two numbers, the lower first, got .2.0, 1.0.":
        {"distribution": "uniform", "range": [2, 1]},
    "range: must be two numbers, the lower first, got .1.0.":
        {"distribution": "uniform", "range": [1]},
    "range: must be two numbers, the lower first, got .-1e.308, 1e.308.":
        {"distribution": "uniform", "range": [-1e308, 1e308]},
    "range: must be above 0 for 'log-uniform', got .0.0, 1.0.":
        {"distribution": "log-uniform", "range": [0, 1]},
    "range: must reach above 0 for 'log-normal', got .-2.0, 0.0.":
        {"distribution": "log-normal", "median": 1, "factor": 2, "range": [-2, 0]},
    "mode: must be within the range .1.0, 2.0., got 3":
        {"distribution": "triangular", "range": [1, 2], "mode": 3},
    "levels: must be at least two, got 1": {"distribution": "choice", "levels": [1]},
    "levels: must differ, got 'a' 2 times": {"distribution": "choice", "levels": ["a", "a"]},
    "levels: must be all numbers or all texts, got .1, 'a'.":
        {"distribution": "choice", "levels": [1, "a"]},
    "levels: must be all numbers or all texts, got .1, True.":
        {"distribution": "choice", "levels": [1, True]},
    "levels: must be numbers or texts, got an instance of list":
        {"distribution": "choice", "levels": [[1], [2]]},
    "levels: must be finite, got nan": {"distribution": "choice", "levels": [1.0, float("nan")]},
    "weights: must be as many as the levels, 2, got 1":
        {"distribution": "choice", "levels": [1, 2], "weights": [1]},
    "weights: must be more than 0, got 0":
        {"distribution": "choice", "levels": [1, 2], "weights": [1, 0]},
}


@pytest.mark.parametrize("message", MESSAGES)
def test_a_wrong_distribution_is_refused_in_one_line(message: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        distribution_of(**MESSAGES[message])
    assert re.fullmatch(message.replace("?", r"\?"), str(caught.value)), caught.value


def refused(**options) -> str:
    with pytest.raises(ConfigurationError) as caught:
        DrawnFactor("gps", **options)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("factor gps: ")
    return str(caught.value).removeprefix("factor gps: ")


def test_a_key_that_is_set_by_name_has_a_choice_only() -> None:
    names = ("ekf", "sequential_ekf")
    given = distribution_of("uniform", range=[0, 1])
    assert refused(distribution=given, names=names) == (
        "distribution: must be 'choice' for a key that is one of 'ekf', 'sequential_ekf', got "
        "'uniform'"
    )
    given = distribution_of("choice", levels=["ekf", "sequental_ekf"])
    assert refused(distribution=given, names=names) == (
        "levels: must be among 'ekf', 'sequential_ekf', got 'sequental_ekf'; did you mean "
        "'sequential_ekf'?"
    )
    assert not DrawnFactor("x", distribution_of("choice", levels=names), names=names).numeric
    given = distribution_of("choice", levels=["a", "b"])
    assert refused(distribution=given, low=0) == "levels: must be numbers, got 'a'"


def test_no_value_can_leave_the_bounds_of_the_keys() -> None:
    normal = distribution_of("normal", mean=1, std=0.5)
    assert refused(distribution=normal, low=0) == (
        "range: must be given to keep 'normal' within the bounds of its keys, 0 to inf, got values "
        "from -2.06038 to 4.06038"
    )
    DrawnFactor("gps", distribution_of("normal", mean=1, std=0.1), low=0)  # ten standard deviations
    truncated = distribution_of("normal", mean=1, std=0.5, range=[0, 3])
    assert DrawnFactor("gps", truncated, low=0).values(U).min() >= 0
    wide = distribution_of("uniform", range=[-1, 2])
    assert refused(distribution=wide, low=0, high=2) == (
        "range: must be within the bounds of its keys, 0 to 2, got [-1.0, 2.0]"
    )
    endless = distribution_of("log-normal", median=1, factor=1e100)
    assert refused(distribution=endless).endswith("got values from 0 to inf")
    assert refused(distribution=distribution_of("choice", levels=[1, 7]), high=6).startswith(
        "levels: must be within the bounds of its keys, -inf to 6, got values from 1 to 7"
    )


@pytest.mark.parametrize("step", [0.001, 0.25, 1, 2, 0.3])
def test_values_are_rounded_to_whole_steps_inside_the_range(step: float) -> None:
    given = distribution_of("uniform", range=[0.7, 9.2])
    x = DrawnFactor("T", given, step=step).values(U)
    whole = x / step
    assert np.abs(whole - np.rint(whole)).max() < 1e-9
    assert 0.7 <= x.min() < 0.7 + step
    assert 9.2 - step < x.max() <= 9.2
    assert np.abs(x - given.quantiles(U)).max() <= step * (1 + 1e-9)
    assert np.issubdtype(x.dtype, np.integer) == (step >= 1)


def test_a_sampling_time_in_ms_is_the_number_that_people_write() -> None:
    x = DrawnFactor("T", distribution_of("uniform", range=[0.1, 2]), step=0.001).values(U)
    assert set(np.unique(x)) == {k / 1000 for k in range(100, 2001)}
    given = distribution_of("uniform", range=[0.0004, 0.1])
    assert DrawnFactor("T", given, low=0.0001, step=0.001).values(U).min() == 0.001  # and not 0
    choice = distribution_of("choice", levels=[0.1, 0.3, 2])
    assert set(DrawnFactor("T", choice, step=0.001).values(U)) == {0.1, 0.3, 2}
    choice = distribution_of("choice", levels=[0.1, 0.3004])
    assert refused(distribution=choice, step=0.001) == (
        "levels: must be whole multiples of 0.001, got 0.3004"
    )
    tiny = distribution_of("uniform", range=[0.0001, 0.0002])
    assert refused(distribution=tiny, step=0.001) == (
        "range: must hold two multiples of 0.001, to which values are rounded, got values from "
        "0.0001 to 0.0002"
    )


@pytest.mark.parametrize("parts", [3, 10, 49, 1000])
def test_ends_of_a_range_that_are_multiples_of_the_step_are_reached(parts: int) -> None:
    """Though a quotient such as 0.3 / 0.1 is less than 3, and 1.1 / 0.1 more than 11."""
    ends = np.array([1e-9, 1 - 1e-9])
    for low in range(1, 60):
        low_end, high_end = low / parts, (2 * low + 1) / parts
        given = distribution_of("uniform", range=[low_end, high_end])
        x = DrawnFactor("T", given, step=1 / parts).values(ends)
        np.testing.assert_allclose(x, [low_end, high_end], rtol=1e-12)


def test_levels_are_multiples_to_a_billionth_of_the_step() -> None:
    near = distribution_of("choice", levels=[0.5 + 0.4e-9, 2])
    assert DrawnFactor("T", near, step=0.5).values(U).max() == 2
    beside = distribution_of("choice", levels=[0.5 + 0.7e-9, 2])
    assert refused(distribution=beside, step=0.5) == (
        "levels: must be whole multiples of 0.5, got 0.5"
    )


def test_bounds_of_the_keys_and_ends_of_a_range_may_be_equal() -> None:
    given = distribution_of("choice", levels=[1, 3])
    assert set(DrawnFactor("n", given, low=1, high=3).values(U)) == {1, 3}
    for mode in (1.0, 4.0):
        law = distribution_of("triangular", range=[1, 4], mode=mode)
        share = law.quantiles(np.array([0.75]))[0]
        assert share == pytest.approx(4 - 3 * np.sqrt(0.25) if mode == 1 else 1 + 3 * np.sqrt(0.75))
    for kind, others in (("uniform", {}), ("normal", {"mean": 2, "std": 1})):
        with pytest.raises(ConfigurationError, match="must be two numbers, the lower first"):
            distribution_of(kind, range=[2, 2], **others)


def test_random_numbers_make_a_distribution_or_a_line() -> None:
    rng = np.random.default_rng(1)
    pool = [0, 1, -1, 1e-300, 1e300, 0.1, 2, 5, -0.5, 1e-9, 1 + 1e-12]
    made, lines = 0, list[str]()
    for _ in range(2000):
        kind = rng.choice([*get_args(Kind)])
        needed = {"uniform": ["range"], "log-uniform": ["range"], "normal": ["mean", "std"],
                  "log-normal": ["median", "factor"], "triangular": ["range", "mode"],
                  "choice": ["levels"]}[kind]  # fmt: skip
        several = ("range", "levels", "weights")
        others = [name for name in Distribution.model_fields if name != "distribution"]
        names = {*needed, *rng.choice(others, rng.integers(0, 2))}
        numbers = {
            name: rng.choice(pool, rng.integers(1, 4)).tolist() if name in several
            else float(rng.choice(pool)) for name in sorted(names)
        }
        step = rng.choice([None, 0.001, 1])
        try:
            factor = DrawnFactor("x", distribution_of(kind, **numbers), low=-10, high=10, step=step)
        except ConfigurationError as error:
            lines.append(str(error))
            continue
        made += 1
        x = factor.values(rng.uniform(2**-31, 1 - 2**-31, 50))
        assert np.isfinite(x).all(), numbers
        assert (x >= -10).all(), numbers
        assert (x <= 10).all(), numbers
    assert made > 100
    assert not any("\n" in line for line in lines)


def test_a_text_of_numpy_is_a_distribution_like_any_other() -> None:
    """As in `numpy.unique` of a column; pydantic before 2.10 refuses them."""
    for kind in get_args(Kind):
        numbers = {
            "normal": {"mean": 1, "std": 2}, "log-normal": {"median": 1, "factor": 2},
            "triangular": {"range": [1, 3], "mode": 2}, "choice": {"levels": [1, 2]},
        }.get(kind, {"range": [1, 3]})  # fmt: skip
        assert distribution_of(np.str_(kind), **numbers) == distribution_of(kind, **numbers)


# --- Samples -------------------------------------------------------------------------------------

FACTORS = (
    DrawnFactor("gps", distribution_of("log-uniform", range=[0.1, 5])),
    DrawnFactor("T", distribution_of("uniform", range=[0.1, 2]), step=0.001),
    DrawnFactor("receiver", distribution_of("choice", levels=["ekf", "ukf"])),
)


def test_a_base_row_swaps_one_column_at_a_time_and_the_seed_is_a_column() -> None:
    drawn = sample(FACTORS, 64, seed=100)
    assert len(drawn) == 64 * (3 + 3)
    assert drawn.columns == ("gps", "T", "receiver", "seed")
    for rows in np.arange(len(drawn)).reshape(64, drawn.runs_per_row):
        a, *swapped, b = drawn.table()[[*drawn.columns]].to_numpy()[rows]
        for i, row in enumerate(swapped):
            expected = a.copy()
            expected[i] = b[i]
            assert (row == expected).all()
        assert a[3] != b[3]


def test_seeds_are_different_and_go_upward_from_the_first() -> None:
    drawn = sample(FACTORS, 64, seed=100)
    by_row = drawn.seeds.reshape(64, -1)
    assert sorted({*drawn.seeds.tolist()}) == [*range(100, 228)]
    assert all(len({*row}) == 2 for row in by_row.tolist())
    assert (by_row[:, :-2] == by_row[:, :1]).all()


def test_equal_arguments_give_equal_bits_and_more_rows_continue() -> None:
    one, same, more, other = (sample(FACTORS, n, seed=s) for n, s in
                              ((64, 7), (64, 7), (256, 7), (64, 8)))
    assert one.table().equals(same.table())
    assert more.table()[: len(one)].equals(one.table())
    assert not other.values.equals(one.values)


def test_no_column_goes_with_another_one() -> None:
    """Over many samples of 16 rows, pairs of columns of A and B are as independent ones."""
    factors = [DrawnFactor(f"x{i}", distribution_of("uniform", range=[0, 1])) for i in range(6)]
    spread = {}
    for version in (1, 2):
        found = []
        for seed in range(60):
            u = sample(factors, 16, seed, version).values.to_numpy().reshape(16, -1, 6)
            both = np.corrcoef(np.hstack([u[:, 0], u[:, -1]]).T)
            found.append(both[np.triu_indices(12, 1)])
        spread[version] = np.sqrt(np.mean(np.square(found), axis=0))
    # of independent columns 1/√15; a Sobol' sequence has pairs that nearly are each other
    assert spread[2] == pytest.approx(np.full(66, 1 / np.sqrt(15)), abs=0.09)
    assert spread[1].max() > 0.45


def test_the_sample_of_before_is_drawn_as_it_was() -> None:
    """Numbers from before there were versions; A and B are from one sequence."""
    drawn = sample(FACTORS, 64, 7, 1)
    assert drawn.version == 1
    assert sample(FACTORS, 64, 7).version == 2
    row = drawn.values.iloc[[0, 5, 200]]
    assert row["gps"].tolist() == pytest.approx(
        [1.2736664575072862, 1.619534453747907, 0.3389542945908972], rel=1e-12
    )
    assert row["T"].tolist() == [1.843, 0.491, 0.843]
    assert row["receiver"].tolist() == ["ekf", "ukf", "ekf"]
    u = qmc.Sobol(8, scramble=True, seed=np.random.default_rng(7)).random(64)
    gps = FACTORS[0].values(u + 2.0**-31)
    assert np.array_equal(drawn.values["gps"].to_numpy().reshape(64, 6)[:, [0, 5]], gps[:, [0, 4]])
    with pytest.raises(ConfigurationError, match="version: must be 1 or 2, got 3"):
        sample(FACTORS, 64, 7, 3)  # type: ignore[arg-type]


@pytest.mark.parametrize("version", [1, 2])
def test_values_are_taken_in_the_middle_of_the_cells_of_the_sequence(version: int) -> None:
    """Of 2**30 cells: no value is 0 or 1, where a distribution may be infinite."""
    factors = [DrawnFactor(f"x{i}", distribution_of("uniform", range=[0, 1])) for i in range(3)]
    u = sample(factors, 128, 5, version).values.to_numpy()  # type: ignore[arg-type]
    assert np.unique(2.0**30 * u % 1.0).tolist() == [0.5]
    assert 0 < u.min() < u.max() < 1


def test_a_sample_is_more_even_than_independent_points() -> None:
    for n in (64, 1024):
        u = sample([DrawnFactor("x", distribution_of("uniform", range=[0, 1]))], n).values["x"]
        at_a = u.to_numpy().reshape(n, -1)[:, 0]
        assert {*np.floor(at_a * n).astype(int).tolist()} == {*range(n)}  # one in each cell


def test_every_quantile_is_finite() -> None:
    drawn = sample([DrawnFactor("x", distribution_of("normal", mean=0, std=1))], 2**14, seed=3)
    assert np.isfinite(drawn.values["x"]).all()
    assert stats.kstest(drawn.values["x"][:: drawn.runs_per_row], "norm").pvalue > 0.5


@pytest.mark.parametrize(
    ("factors", "n", "seed", "message"),
    [
        ((), 16, 1, "space: must have at least one factor, got none"),
        (FACTORS[:1] * 2, 16, 1, "factor gps: must appear once, got 2"),
        (FACTORS, 1000, 1,
         "base_rows: must be a power of 2 from 16 to 1048576, got 1000; did you mean 1024?"),
        (FACTORS, 8, 1, "base_rows: must be a power of 2 from 16 to 1048576, got 8"),
        (FACTORS, 2**21, 1, "base_rows: must be a power of 2 from 16 to 1048576, got 2097152"),
        (FACTORS, True, 1, "base_rows: must be a power of 2 from 16 to 1048576, got True"),
        (FACTORS, 16.0, 1, "base_rows: must be a power of 2 from 16 to 1048576, got 16.0"),
        (FACTORS, 16, -1,
         "seed: must be from 0 on and leave room for 32 seeds up to 2147483647, got -1"),
        (FACTORS, 16, 2**31 - 31,
         "seed: must be from 0 on and leave room for 32 seeds up to 2147483647, got 2147483617"),
        ([DrawnFactor("seed", FACTORS[0].distribution)], 16, 1,
         "factor seed: must have another name, because the seed is a factor of every space"),
    ],
)  # fmt: skip
def test_a_wrong_space_is_refused_in_one_line(factors, n, seed, message: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        sample(factors, n, seed)
    assert str(caught.value) == message


def test_the_last_seed_may_be_the_largest() -> None:
    assert sample(FACTORS, 16, 2**31 - 32).seeds.max() == 2**31 - 1
    assert sample(FACTORS, 16, 0).seeds.min() == 0


def test_a_sample_shows_itself_in_a_line() -> None:
    assert repr(sample(FACTORS, 16)) == "<Sample of 3 factors, 16 base rows, 96 runs>"
