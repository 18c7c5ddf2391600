"""The verdict on a covariance: right about as often as it says, careful where it cannot tell."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, replace

import numpy as np
import pandas as pd
import pytest
from quick import one_in
from sblcosim.analysis.covariance import sentences
from sblcosim.judge.consistency import TELLING, Verdict, most_of_one_run, of_runs
from sblcosim.judge.definitions import MANY_LOST

STUDIES = 1500


def run_means(rng: np.random.Generator, degrees: float, size: tuple[int, int], factor: float = 1):
    """Mean NEES of runs whose true standard deviation is so many times the claimed one.

    `degrees` is that of the run's mean: 3 if the errors last throughout a run, and three times the
    number of independent estimates otherwise.
    """
    return 3 * factor**2 * rng.chisquare(degrees, size) / degrees


def needed(spread: float) -> int | None:
    """Runs that tell a factor, as a study says whose runs spread by that much of their mean."""
    half = spread / math.sqrt(2)  # of two values, the standard deviation is √2 of this
    return of_runs([3 * (1 - half), 3 * (1 + half)]).runs_needed


@one_in(2)
@pytest.mark.parametrize("degrees", [1, 3, 10, 40])
@pytest.mark.parametrize("runs", [2, 3, 5, 20, 100])
def test_the_interval_holds_the_true_mean_nees_about_as_often_as_it_says(degrees, runs):
    rng = np.random.default_rng([degrees, runs])
    found = [of_runs(study) for study in run_means(rng, degrees, (STUDIES, runs))]
    inside = np.mean([v.low <= 3 <= v.high for v in found if v.basis == "mean"])
    noise = 4 * math.sqrt(0.05 * 0.95 / STUDIES)
    assert (0.93 if degrees >= 3 else 0.90) - noise < inside < 0.96 + noise


@pytest.mark.parametrize("degrees", [3, 10, 40])
@pytest.mark.parametrize("factor", [TELLING, 1 / TELLING])
def test_so_many_runs_as_are_needed_tell_the_factor_in_nine_studies_of_ten(degrees, factor):
    rng = np.random.default_rng([degrees, factor > 1])
    count = needed(math.sqrt(2 / degrees))
    found = [of_runs(s) for s in run_means(rng, degrees, (STUDIES, count), factor)]
    word = "optimistic" if factor > 1 else "pessimistic"
    told = np.mean([v.verdict == word for v in found])
    assert told == pytest.approx(0.9, abs=0.035)
    assert np.median([v.by for v in found]) == pytest.approx(TELLING, rel=0.02)


def test_what_is_needed_is_estimated_from_the_runs_and_the_least_number():
    rng = np.random.default_rng(1)
    (study,) = run_means(rng, 10, (1, 4000))
    assert of_runs(study).runs_needed == pytest.approx(
        needed(math.sqrt(0.2)), rel=0.1
    )
    assert needed(0.0) == 2
    numbers = [needed(spread) for spread in (0.01, 0.1, 0.5, 1.0, 1.4)]
    assert numbers == sorted(set(numbers))


@pytest.mark.parametrize("factor", [0.2, 0.8, 1.3, 10.0])
def test_a_wrong_covariance_is_called_so_by_its_factor(factor):
    rng = np.random.default_rng(2)
    (study,) = run_means(rng, 20, (1, 200), factor)
    found = of_runs(study)
    assert found.verdict == ("optimistic" if factor > 1 else "pessimistic")
    assert found.factor == pytest.approx(factor, rel=0.05)
    assert found.by == pytest.approx(max(factor, 1 / factor), rel=0.05)
    assert f"{found.verdict} by a factor of {found.by:.3g} (mean NEES" in str(found)


def test_one_run_cannot_tell_but_says_what_it_looks_like():
    for nees, words in ((12.0, "looks optimistic by a factor of 2"), (3.1, "looks right"),
                        (0.75, "looks pessimistic by a factor of 2")):  # fmt: skip
        found = of_runs([nees])
        assert (found.verdict, found.runs, found.runs_needed) == ("one run", 1, None)
        assert np.isnan([found.low, found.high]).all()
        assert str(found) == f"{words}; one run cannot tell, because its errors are correlated"


def test_runs_without_nees_do_not_count_and_without_any_nothing_is_known():
    assert of_runs([np.nan, 3.0, np.nan, 2.0]) == of_runs([2.0, 3.0])
    for nothing in ([], [np.nan]):
        assert (of_runs(nothing).verdict, of_runs(nothing).runs) == ("unknown", 0)
        assert str(of_runs(nothing)) == "unknown"


def test_few_runs_in_band_say_how_many_would_tell():
    found = of_runs([1.0, 5.0, 4.0])
    assert found.verdict == "in band"
    assert found.runs_needed > 100
    assert str(found).endswith(f"3 runs); {found.runs_needed} runs would detect a factor of 1.1")
    (study,) = run_means(np.random.default_rng(4), 40, (1, 400))
    assert "would tell" not in str(of_runs(study))


@pytest.mark.parametrize("needed", [9_999, 10_000, 10_001, 10**9])
def test_more_than_10_000_runs_are_not_asked_for(needed):
    found = replace(of_runs([1.0, 5.0, 4.0]), runs_needed=needed)
    row = asdict(found) | {"receiver": "a", "frame": "absolute", "words": str(found)}
    ((over_points,),) = sentences(pd.DataFrame([row, row])).values()
    if needed <= 10_000:
        assert str(found).endswith(f"; {needed} runs would detect a factor of 1.1")
        assert over_points.endswith(f"; up to {needed} would reveal a factor of 1.1)")
    else:
        assert str(found).endswith(
            "; no practical number of runs (10,000) would detect a factor of 1.1"
        )
        assert over_points.endswith(
            "; at some points no practical number (10,000) would reveal a factor of 1.1)"
        )


@pytest.mark.parametrize(("factor", "word"), [(1.0, "in band"), (3.0, "optimistic"),
                                              (0.4, "pessimistic")])  # fmt: skip
def test_lost_runs_do_not_make_the_verdict_but_are_counted(factor, word):
    (study,) = run_means(np.random.default_rng(5), 10, (1, 48), factor)
    found = of_runs([*study, 8e4, 9e4])
    assert (found.basis, found.verdict, found.runs_far_above) == ("median", word, 2)
    assert found.runs_needed is None
    assert found.mean_nees > 3000
    if factor != 1:
        assert found.factor == pytest.approx(factor, rel=0.25)
    assert "50 runs); 2 runs lie far above and would dominate the mean, 3,4" in str(found)


def test_lost_runs_among_too_few_leave_it_unknown():
    found = of_runs([3.0, 2.9, 3.3, 1e6])
    assert (found.verdict, found.basis) == ("unknown", "median")
    assert str(found) == "unknown: few of the 4 runs dominate the mean"


@pytest.mark.parametrize("degrees", [3, 10])
@pytest.mark.parametrize("runs", [5, 50])
def test_normal_errors_are_hardly_ever_called_heavy_tailed(degrees, runs):
    rng = np.random.default_rng([degrees, runs])
    found = [of_runs(s) for s in run_means(rng, degrees, (STUDIES, runs), 7.0)]
    assert np.mean([v.basis == "median" for v in found]) < 0.005


@pytest.mark.parametrize("degrees", [3, 10, 40])
def test_the_median_of_a_right_covariance_is_in_band_however_long_its_errors_last(degrees):
    rng = np.random.default_rng(degrees)
    studies = run_means(rng, degrees, (STUDIES, 38))
    studies = np.column_stack([studies, np.full((STUDIES, 2), 1e6)])
    found = [of_runs(study) for study in studies]
    assert all(v.basis == "median" for v in found)
    assert np.mean([v.verdict == "in band" for v in found]) > 0.9


def test_errors_of_zero_and_infinite_nees_do_not_break_it():
    found = of_runs([0.0, 0.0, 0.0])
    assert (found.verdict, found.by) == ("pessimistic", math.inf)
    assert of_runs([3.0, 2.0, 3.0, 2.5, 3.5, 3.0, 3.1, math.inf]).basis == "median"


def test_a_verdict_is_plain_data():
    data = json.loads(json.dumps(of_runs([2.0, 3.0, 4.0]).to_json(), allow_nan=False))
    assert data["words"].startswith("in band (mean NEES 3, 95 %: ")
    assert set(data) == {"words", *Verdict.__dataclass_fields__}


@pytest.mark.parametrize(("dimensions", "most"), [(1, 0.055), (3, 0.02), (300, 0.0)])
def test_one_run_of_a_right_covariance_is_rarely_called_too_little(
    dimensions: int, most: float
) -> None:
    """Errors that stay throughout a run, in one direction or in all, and errors that change."""
    rng = np.random.default_rng(5)
    nees = 3 * (rng.standard_normal((20_000, dimensions)) ** 2).mean(axis=1)
    share = np.mean([of_runs([m]).claim == "optimistic" for m in nees])
    assert share <= most
    assert dimensions > 1 or share > 0.04  # and not much more rarely than is said


@pytest.mark.parametrize(
    ("nees", "claim"),
    [(3.0, "fits"), (3.6, "fits"), (3.7, "perhaps optimistic"), (11.5, "perhaps optimistic"),
     (11.6, "optimistic"), (2.5, "fits"), (2.4, "perhaps pessimistic"),
     (0.0, "perhaps pessimistic")],
)  # fmt: skip
def test_what_one_run_says_of_a_claim(nees: float, claim: str) -> None:
    assert of_runs([nees]).claim == claim


def test_a_factor_that_is_just_told_fits() -> None:
    assert replace(of_runs([3.6]), factor=TELLING).claim == "fits"
    assert replace(of_runs([3.6]), factor=np.nextafter(TELLING, 2)).claim == "perhaps optimistic"


def test_what_is_just_as_large_as_a_bound_is_not_beyond_it() -> None:
    bound = most_of_one_run()
    assert of_runs([bound]).claim == "perhaps optimistic"
    assert of_runs([np.nextafter(bound, 99)]).claim == "optimistic"
    for factor, words in ((TELLING, "right"), (1.11, "optimistic by a factor of 1.11")):
        assert str(replace(of_runs([3.0]), factor=factor)).startswith(f"looks {words};")
    assert of_runs([3.0, 3.0]).verdict == "in band"
    for word, count, asked in (
        ("in band", 19, "; 20 runs would detect a factor of 1.1"), ("in band", 20, ""),
        ("optimistic", 19, ""),
    ):
        found = replace(of_runs([3.0, 2.9]), verdict=word, runs=count, runs_needed=20)
        assert str(found).partition(f"{count} runs)")[2] == asked
    more = np.nextafter(MANY_LOST, 1)
    for runs, at_bound, beyond in (
        ([2.9, 3.0], "in band (mean NEES 2.95, 95 %: ", "not judged: 5 % of the runs are lost"),
        ([], "unknown", "not judged: 5 % of the runs are lost"),
        ([3.0], "looks right; one run", "not judged: the run is lost"),
    ):
        assert str(of_runs(runs, MANY_LOST)).startswith(at_bound)
        assert str(of_runs(runs, more)) == beyond


def test_a_number_of_a_thousand_has_no_digits_after_the_point() -> None:
    found = replace(of_runs([2.9, 3.0]), centre=1000.0, low=999.4, high=123456.0)
    assert "mean NEES 1,000, 95 %: 999 to 123,456, 2 runs" in str(found)
