"""Beyond the claim, and misleading: by hand, in one run, in many, and in the lanes."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import sblcosim
from sblcosim.analysis.common.bounds import share_interval
from sblcosim.comparison.tournament import sentences
from sblcosim.comparison.tournament.run import RESPONSE, Tournament, evaluate
from sblcosim.data.description import RunDescription
from sblcosim.data.estimates import Estimates
from sblcosim.data.record import Record
from sblcosim.data.truth import Truth
from sblcosim.judge import definitions, metrics
from sblcosim.judge.definitions import (
    BEYOND_M,
    BEYOND_NEES,
    MISLEADING,
    MISLEADING_NEES,
    MISLEADING_S,
    Judged,
    beyond_claim,
    judged_by,
    misleading,
    times_standing,
)
from sblcosim.results.responses import RESPONSES, Run, value_of
from sblcosim.results.result import Result
from sblcosim.results.sums import SUMS, responses, sums_of
from sblcosim.simulation.masters import lanes_driver
from scipy.stats import binomtest, chi2
from synthetic_record import make_record, silent, summary

SECOND = 1_000_000_000
NEW = ("beyond_claim", "beyond_claim_longest_s", "misleading")
FAR, NEAR = 4.0, 0.5
"""Errors [m] beyond three times a claim of 1 m, and within it."""


def judged(
    errors: Sequence[float],
    at_s: Sequence[float] | None = None,
    until_s: Sequence[float] | None = None,
    stop_s: float = 10.0,
    variances: Any = 1.0,
    **given: Any,
) -> Judged:
    """Estimates whose errors are down, of a diver at rest in the origin.

    `at_s`: when they become available; `until_s`: when they no longer stand.
    """
    n = len(errors)
    at = np.rint(np.arange(n) * SECOND if at_s is None else np.array(at_s) * SECOND)
    ends = np.append(at[1:], stop_s * SECOND)[:n] if until_s is None else np.array(until_s) * SECOND
    covariance = np.ones(n)[:, None, None] * np.eye(6)
    covariance *= np.broadcast_to(variances, n)[:, None, None]
    estimates = Estimates(**{
        "epoch_ns": at.astype(np.int64), "position": np.outer(errors, [0.0, 0.0, 1.0]),
        "available_ns": at.astype(np.int64), "until_ns": ends.astype(np.int64),
        "covariance": covariance, **given,
    })  # fmt: skip
    instants = np.array([0, round(stop_s * SECOND)])
    return judged_by(estimates, Truth(time_ns=instants, position=np.zeros((2, 3))))


def seconds(found: Judged) -> tuple[float, float]:
    """Time beyond the claim, and the longest without a break [s]."""
    whole, longest = times_standing(found, beyond_claim(found))
    return whole / SECOND, longest / SECOND


# --- The definition ------------------------------------------------------------------------------


def test_three_sigma_is_as_rare_in_space_as_on_a_line() -> None:
    rare = math.erfc(3 / math.sqrt(2))
    assert pytest.approx(chi2.isf(rare, 3), rel=1e-12) == BEYOND_NEES
    errors = np.random.default_rng(1).normal(size=(200_000, 3)) * [3.0, 2.0, 5.0]
    nees = definitions.nees(errors, np.tile(np.diag([9.0, 4.0, 25.0]), (len(errors), 1, 1)))
    assert (nees > BEYOND_NEES).mean() == pytest.approx(rare, abs=4 * math.sqrt(rare / len(errors)))


def test_a_right_covariance_seldom_has_such_a_mean_however_long_its_errors_last() -> None:
    assert chi2.sf(MISLEADING_NEES / 3, 1) < 1 / 39
    assert 3 < BEYOND_NEES < MISLEADING_NEES


@pytest.mark.parametrize(
    ("errors", "at_s", "whole", "longest"),
    [
        ([FAR] * 10, None, 10.0, 10.0),
        ([NEAR] * 10, None, 0.0, 0.0),
        ([NEAR, FAR, FAR, NEAR, FAR, FAR, FAR, NEAR], None, 5.0, 3.0),
        ([FAR, NEAR] * 5, None, 5.0, 1.0),
        ([NEAR, FAR, FAR, NEAR], [0.0, 1.0, 5.0, 6.0], 5.0, 5.0),  # unequal intervals
        ([NEAR, FAR, NEAR, FAR], [0.0, 1.0, 1.5, 9.75], 0.75, 0.5),
        ([FAR], [2.5], 7.5, 7.5),  # one estimate stands to the end
        ([NEAR], [2.5], 0.0, 0.0),
        ([NEAR, FAR], [0.0, 10.0], 0.0, 0.0),  # at the last instant, for no time
        ([], None, 0.0, 0.0),
    ],
)  # fmt: skip
def test_an_estimate_stands_until_the_next_one(
    errors: list[float], at_s: list[float] | None, whole: float, longest: float
) -> None:
    assert seconds(judged(errors, at_s)) == (whole, longest)


def test_what_is_withdrawn_stands_no_longer_and_ends_the_time_without_a_break() -> None:
    found = judged([FAR, FAR, FAR], [0.0, 4.0, 5.0], [3.0, 5.0, 9.0])
    assert seconds(found) == (8.0, 5.0)


@pytest.mark.parametrize("broken", [np.nan, 1e200])
def test_a_good_a_broken_and_an_unsettled_estimate_end_it_too(broken: float) -> None:
    found = judged([FAR, FAR, broken, FAR, FAR])
    which = beyond_claim(found) & ~found.broken
    assert times_standing(found, which) == (9 * SECOND, 7 * SECOND)
    settled = definitions.chosen(found, ~found.broken & (found.epoch_s >= 1.0))
    assert seconds(settled) == (8.0, 7.0)


def exact(target: float) -> tuple[float, float]:
    """An error [m] and a variance [m²] whose NEES is a number to the last bit."""
    for error in np.arange(4.0, 60.0, 0.25):
        variance = error * error / target
        for near in (variance, np.nextafter(variance, 0), np.nextafter(variance, 99)):
            if error * error / near == target:
                return float(error), float(near)
    raise AssertionError(target)


@pytest.mark.parametrize(("step", "beyond"), [(-1, False), (0, False), (1, True)])
def test_at_the_threshold_of_the_claim_an_estimate_is_not_beyond_it(
    step: int, beyond: bool
) -> None:
    nees = np.nextafter(BEYOND_NEES, BEYOND_NEES + step)
    error, variance = exact(float(nees))
    assert beyond_claim(judged([error], variances=variance)).tolist() == [beyond]


@pytest.mark.parametrize(
    ("error", "beyond"),
    [(np.nextafter(BEYOND_M, 0), False), (BEYOND_M, False), (np.nextafter(BEYOND_M, 2), True)],
)
def test_a_short_error_misleads_nobody_whatever_is_claimed(error: float, beyond: bool) -> None:
    found = judged([error], variances=1e-6)
    assert found.nees[0] > 1000 * BEYOND_NEES
    assert beyond_claim(found).tolist() == [beyond]
    assert beyond_claim(found, distance_m=0.5).all()


@pytest.mark.parametrize("useless", [0.0, -1.0, np.nan])
def test_a_covariance_that_is_not_positive_definite_claims_nothing(useless: float) -> None:
    found = judged([FAR] * 5, variances=[1.0, 1.0, useless, 1.0, 1.0])
    assert seconds(found) == (9.0, 7.0)
    assert not beyond_claim(judged([FAR] * 5, variances=useless)).any()
    assert not beyond_claim(judged([FAR] * 5, covariance=None)).any()


def test_an_estimate_made_after_the_run_stands_from_its_epoch_to_the_next() -> None:
    at = [0.0, 2.0, 3.0, 7.0]
    found = judged([NEAR, FAR, FAR, FAR], at, available_ns=None, until_ns=None)
    assert seconds(found) == (8.0, 8.0)
    assert seconds(judged([FAR, NEAR], [0.0, 2.0], available_ns=None, until_ns=None)) == (2.0, 2.0)
    assert seconds(judged([], available_ns=None, until_ns=None)) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("nees", "rms_m", "longest_s", "flag"),
    [
        (3.0, 0.5, 0.0, False),
        (3.0, 0.5, MISLEADING_S, False),
        (3.0, 0.5, MISLEADING_S + 1e-9, True),
        (MISLEADING_NEES, 9.0, 0.0, False),
        (np.nextafter(MISLEADING_NEES, 99), 9.0, 0.0, True),
        (1e6, BEYOND_M, 0.0, False),
        (1e6, np.nextafter(BEYOND_M, 2), 0.0, True),
        (np.nan, np.nan, 0.0, False),
    ],
)
def test_misleading_is_long_beyond_the_claim_or_far_off_on_the_whole(
    nees: float, rms_m: float, longest_s: float, flag: bool
) -> None:
    assert bool(misleading(nees, rms_m, longest_s)) is flag
    assert misleading(np.array([nees]), np.array([rms_m]), np.array([longest_s])).tolist() == [flag]


def test_the_words_have_the_numbers_of_the_definition() -> None:
    for number in (BEYOND_M, MISLEADING_S, MISLEADING_NEES, round(BEYOND_NEES, 1)):
        assert f" {number:g}" in MISLEADING


def test_the_lanes_master_has_the_same_thresholds() -> None:
    source = Path(lanes_driver.__file__).with_name("c") / "lanes_master.c"
    for name in ("BEYOND_NEES", "BEYOND_M", "PIVOT"):
        (given,) = re.findall(rf"^#define {name} (\S+)", source.read_text("utf-8"), re.M)
        assert float(given) == getattr(definitions, name)


# --- A record ------------------------------------------------------------------------------------


def off(*spans: tuple[int, int], error: float = FAR, variance: float = 0.25) -> Record:
    """A run of 10 s; its estimates k = 1 … 99, available at (k + 1)/10 s, are off in some spans."""
    errors = np.full((99, 3), [NEAR, 0.0, 0.0])
    for first, last in spans:
        errors[first - 1 : last] = [error, 0.0, 0.0]
    return make_record({"ekf": errors}, variance=variance)


def with_valid(record: Record, invalid: Sequence[int]) -> Record:
    """The record with instants at which the receiver is not valid."""
    valid = record.values["ekf.valid"].copy()
    valid[list(invalid)] = False
    return replace(record, values={**record.values, "ekf.valid": valid})


def said(record: Record, settling_s: float = 0.0) -> dict[str, float]:
    """The responses of a record, as a study sums them up and as they are defined."""
    run = Run(record, "ekf", round(settling_s * SECOND))
    span = int(record.time_ns[-1] - record.time_ns[0])
    row = responses(sums_of(run)[None], span, run.settling_ns).iloc[0]
    found = {}
    for name in NEW:
        value = math.nan if row[name] is pd.NA else float(row[name])
        assert value_of(RESPONSES[name], run) == pytest.approx(value, rel=1e-12, nan_ok=True)
        found[name] = value
    if not settling_s:
        table = summary(record, ["ekf"]).loc["ekf"]
        for name, value in found.items():
            told = math.nan if table[name] is pd.NA else float(table[name])
            assert told == pytest.approx(value, rel=1e-12, nan_ok=True), name
    return found


def test_a_record_s_times_are_those_of_its_instants() -> None:
    found = said(off((10, 29), (50, 54)))
    assert found["beyond_claim"] == pytest.approx(0.25)
    assert found["beyond_claim_longest_s"] == pytest.approx(2.0)
    assert found["misleading"] == 1.0  # far_off
    assert said(off((99, 99)))["beyond_claim_longest_s"] == 0.0
    assert said(off())["beyond_claim"] == 0.0


def test_a_gap_is_counted_while_the_estimate_is_shown_as_valid() -> None:
    record = off((10, 29))
    count = record.values["ekf.update_count"].copy()
    count[20:30] = count[20]  # no update for a second
    held = replace(record, values={**record.values, "ekf.update_count": count})
    assert said(held)["beyond_claim_longest_s"] == pytest.approx(2.0)
    assert said(with_valid(held, range(22, 31)))["beyond_claim_longest_s"] == pytest.approx(1.1)
    assert said(with_valid(held, range(22, 31)))["beyond_claim"] == pytest.approx(0.11)


def test_an_estimate_that_was_withdrawn_does_not_stand_again() -> None:
    record = off((10, 99))
    count = record.values["ekf.update_count"].copy()
    count[40:] = count[40]  # the last estimate at 4 s
    held = replace(record, values={**record.values, "ekf.update_count": count})
    assert said(held)["beyond_claim_longest_s"] == pytest.approx(8.9)
    assert said(with_valid(held, [60]))["beyond_claim_longest_s"] == pytest.approx(4.9)


def test_before_the_settling_time_nothing_counts() -> None:
    found = said(off((1, 59)), settling_s=4.0)
    # epochs 4.0 to 5.9 s, available from 4.1 to 6.1 s, of the 6 s that are left
    assert found["beyond_claim"] == pytest.approx(2.0 / 6.0)
    assert found["beyond_claim_longest_s"] == pytest.approx(2.0)
    assert math.isnan(said(off((1, 59)), settling_s=10.0)["beyond_claim"])


@pytest.mark.parametrize(
    "record",
    [make_record(optional_ports=False), silent("ekf"), off((10, 99), variance=0.0)],
    ids=["no covariance", "no estimate", "singular"],
)
def test_without_any_claim_nothing_is_known(record: Record) -> None:
    assert all(map(math.isnan, said(record).values()))


def result_of(record: Record) -> Result:
    scenario = sblcosim.load("paper-scenario-1")
    about = RunDescription(scenario.name, scenario, ("ekf",), {"ekf": "0" * 64}, {})
    return Result(about, record)


def long_record(far_s: float, error: float = FAR, variance: float = 0.25) -> Record:
    """A run of 100 s, off for some of it."""
    record = off((1, round(far_s)), error=error, variance=variance)
    values = {**record.values, "ekf.epoch": record.values["ekf.epoch"] * 10}
    return Record(record.time_ns * 10, values)


@pytest.mark.parametrize(
    ("record", "words"),
    [
        (long_record(0), None),
        (long_record(20), None),
        (long_record(21), "misleading: for 21 s beyond three times what it claims"),
        (long_record(15, 9.0),
         "misleading: 4.08 times as far off as it claims, direction by direction"),
        (long_record(99, 0.9, 1e-4), None),
        (make_record(optional_ports=False), None),
    ],
)
def test_the_verdict_on_a_run_says_that_it_is_misleading_and_why(
    record: Record, words: str | None
) -> None:
    result = result_of(record)
    (line,) = (it for it in result.answer.splitlines() if it.startswith("ekf: "))
    assert line.endswith(f"; {words}" if words else line)
    assert ("misleading" in line) == (words is not None)
    more = result.text(verbose=True)
    assert "nan" not in more.lower().replace("resonance", "")
    known = result.judged["ekf"].estimates.covariance is not None
    assert (MISLEADING in more) == ("error beyond three times its claim" in more) == known
    row = result.to_json()["summary"]["ekf"]
    json.dumps(row, allow_nan=False)
    assert row["misleading"] is (words is not None if known else None)
    assert (row["beyond_claim"] is None) is (not known)


def test_estimates_made_after_the_run_are_judged_in_the_same_way() -> None:
    record = off((10, 29))
    before = record.estimates("ekf")
    made = replace(before, available_ns=None, until_ns=None, update_count=None)
    truth = result_of(record).truth
    table = metrics.summary(
        {"late": judged_by(made, truth)}, {"late": metrics.track(judged_by(made, truth))}, truth
    )
    assert table.loc["late", "beyond_claim_longest_s"] == pytest.approx(2.0)
    assert table.loc["late", "beyond_claim"] == pytest.approx(0.2)


# --- Many runs -----------------------------------------------------------------------------------


SETTINGS = {
    "scenarios": [], "receivers": [], "runs": 60, "seed": 1, "settling_s": 0.0,
    "response": RESPONSE, "practical": None, "contamination": 0.05,
}  # fmt: skip


def table_of(flags: dict[str, Any]) -> pd.DataFrame:
    """Runs in which receivers are misleading, or not, or nobody knows; None: an older table."""
    n = 60
    table = pd.DataFrame({"point": 1, "replicate": np.arange(n) + 1, "seed": np.arange(n) + 1})
    random = np.random.default_rng(1)
    for i, (name, own) in enumerate(flags.items()):
        y = 1 + i + 0.1 * random.normal(size=n)
        known = own is not None and not np.isnan(np.array(own, float)).all()
        table = table.assign(**{
            f"{name}.{RESPONSE}": y, f"{name}.absolute_total_p95_m": 2 * y, f"{name}.lost": False,
            f"{name}.nees_position": random.chisquare(30, n) / 10 if known else np.nan,
            f"{name}.own_relative_nees_position": np.nan,
        })  # fmt: skip
        if own is not None:
            table[f"{name}.misleading"] = pd.array(
                [pd.NA if np.isnan(it) else bool(it) for it in own], "boolean"
            )
    return table.assign(error=None)


def some(count: int, unknown: int = 0) -> list[float]:
    return [1.0] * count + [0.0] * (60 - count - unknown) + [math.nan] * unknown


def compared(**flags: Any) -> Tournament:
    return evaluate({"here": table_of(flags)}, SETTINGS)


@pytest.mark.parametrize("unknown", [0, 5, 59])
@pytest.mark.parametrize("count", [0, 1])
def test_the_share_of_misleading_runs_is_of_those_with_a_claim(count: int, unknown: int) -> None:
    row = compared(a=some(count, unknown)).level("here", "a")
    known = 60 - unknown
    assert (row["misleading"], row["misleading_known"]) == (count, known)
    exact_ends = binomtest(count, known).proportion_ci(method="exact")
    assert (row["misleading_low"], row["misleading_high"]) == pytest.approx(
        (exact_ends.low, exact_ends.high), abs=1e-9
    )
    assert (row["misleading_low"], row["misleading_high"]) == share_interval(count, known)


@pytest.mark.parametrize("own", [None, some(0, 60)], ids=["older", "no covariance"])
def test_a_receiver_without_covariance_has_none_of_it(own: Any) -> None:
    it = compared(a=some(3), b=own)
    row = it.level("here", "b")
    assert row["misleading"] is pd.NA
    for text in (it.text(), it.text(verbose=True), it.answer):
        assert "nan" not in text.lower()
        assert "NA" not in text
    plain = it.to_json()
    json.dumps(plain, allow_nan=False)
    (told,) = (r for r in plain["levels"] if r["receiver"] == "b" and r["response"] == RESPONSE)
    assert (told["misleading"], told["misleading_low"], told["misleading_known"]) == (None, None, 0)
    # without any such receiver there is no column
    assert "misleading" not in compared(b=own).text()


def test_the_small_table_has_the_share_with_its_interval() -> None:
    it = compared(a=some(0), b=some(45), c=some(0, 60))
    head, *rows = it.text(verbose=True).split("here: 60 runs\n")[1].splitlines()[:4]
    heads = re.split(r"\s{2,}", head.strip())
    at = heads.index("misleading") + 1
    cells = [re.split(r"\s{2,}", row)[at] for row in rows]
    assert cells == ["0 % (0–6)", "75 % (62–86)", "–"]
    assert re.search(r"^b .* 75 % ", it.text(), re.M)
    low, high = share_interval(45, 60)
    assert math.floor(100 * low) == 62
    assert math.ceil(100 * high) == 86
    assert MISLEADING not in it.text()
    assert MISLEADING in it.text(verbose=True)


def test_over_all_scenarios_the_runs_count_together_without_an_interval() -> None:
    it = evaluate({"one": table_of({"a": some(6)}), "two": table_of({"a": some(0, 20)})}, SETTINGS)
    row = it.level(it.places[-1], "a")
    assert (row["misleading"], row["misleading_known"]) == (6, 100)
    assert np.isnan(row["misleading_low"])
    assert re.search(r"^a .* 6 % ", it.text(), re.M)


def test_a_better_receiver_that_is_misleading_more_often_is_told_by_that() -> None:
    worse = "But it was misleading in 7 of 58 runs."
    assert worse in compared(a=some(7, 2), b=some(6)).answer
    assert worse not in compared(a=some(7, 2), b=some(7)).answer
    assert worse not in compared(a=some(7, 2), b=None).answer  # of whom nothing is known
    assert "misleading" not in compared(a=None, b=some(7)).answer


def test_two_receivers_fit_a_small_screen() -> None:
    """24 lines of 60 columns, two of them to say where the result is."""
    lines = compared(coupled=some(1), ekf=some(45)).text(width=60).splitlines()
    assert len(lines) <= 22
    assert max(map(len, lines)) <= 60
    assert any("misleading" in line for line in lines)


@pytest.fixture(scope="module")
def dives() -> Any:
    return sblcosim.run_many(
        "harbour-square", ["coupled", "ekf", "multilateration"], {"time.duration_s": 60.0},
        runs=12, workers=1,
    )  # fmt: skip


def test_many_runs_say_in_how_many_a_receiver_is_misleading(dives: Any) -> None:
    table = dives.runs.table
    for line, receiver in zip(dives.answer.splitlines(), dives.receivers, strict=True):
        count = int(table[f"{receiver}.misleading"].sum())
        low, high = share_interval(count, 12)
        interval = f"{math.floor(100 * low)}–{math.ceil(100 * high)} %"
        assert f", misleading in {count} ({interval})" in line
    assert table["ekf.misleading"].sum() > table["coupled.misleading"].sum() == 0
    assert MISLEADING in dives.text(verbose=True)
    assert dives.text().count("misleading") == len(dives.receivers)  # in the answer, not a column
    flags = misleading(
        table["ekf.nees_position"], table[f"ekf.{RESPONSE}"], table["ekf.beyond_claim_longest_s"]
    )
    assert table["ekf.misleading"].tolist() == flags.tolist()
    for which, result in dives.drawn.items():
        seed = dives.drawn_seeds[which]
        row = table[table["seed"] == seed].iloc[0]
        for receiver in dives.receivers:
            for name in NEW:
                assert result.summary.loc[receiver, name] == pytest.approx(
                    row[f"{receiver}.{name}"], rel=1e-12
                )


@pytest.mark.parametrize("response", NEW)
def test_each_response_is_compared(dives: Any, response: str) -> None:
    runs = {"harbour-square": dives.runs.table}
    it = evaluate(runs, {**dives.runs.settings, "response": response})
    assert it.level("harbour-square", "ekf")["mean"] == pytest.approx(
        dives.runs.table[f"ekf.{response}"].astype(float).mean()
    )
    assert it.answer
    assert sentences.words_of(response) == RESPONSES[response].words


def test_the_sums_have_what_the_responses_need() -> None:
    assert {"beyond_ns", "beyond_longest_ns"} <= {*SUMS}
