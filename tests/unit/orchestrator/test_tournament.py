"""Tournaments: who is said to be better, from runs that were made up and from real ones."""

from __future__ import annotations

import json
import re
import time
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import sblcosim
import sblcosim.cli
from drawn_texts import spoiled_texts
from sblcosim import style
from sblcosim.analysis.common.bounds import share_interval
from sblcosim.comparison.common.evaluation import ALL, PERCENTILE
from sblcosim.comparison.many import run as many
from sblcosim.comparison.tournament import (
    alike,
    cost,
)
from sblcosim.comparison.tournament import (
    figures as tournament_figures,
)
from sblcosim.comparison.tournament import (
    run as tournament,
)
from sblcosim.comparison.tournament.run import RESPONSE, Tournament, evaluate
from sblcosim.comparison.tournament.sentences import reached, would_decide
from sblcosim.comparison.tournament.worst import worst_run
from sblcosim.errors import ConfigurationError
from sblcosim.fmus.build import factory
from sblcosim.judge.consistency import of_runs
from sblcosim.judge.definitions import LOST
from sblcosim.results.responses import FLAGS
from sblcosim.scenario.scenario import load
from sblcosim.study.study import load as load_study
from seams import Seam
from statsmodels.stats.proportion import proportion_confint
from typer.testing import CliRunner, Result

RUNS = 200
SETTINGS = {
    "scenarios": [], "receivers": [], "runs": RUNS, "seed": 1, "settling_s": 0.0,
    "response": RESPONSE, "practical": None, "contamination": 0.05,
}  # fmt: skip
SHORT = {"time.duration_s": 5.0}
NEVER = """
import sblcosim


class Never(sblcosim.Receiver):
    def update(self, samples):
        return None


class Fix(sblcosim.Receiver):
    def update(self, samples):
        here = self.fix(samples)
        return None if here is None else sblcosim.Estimate(samples[-1].epoch, here)
"""


def runs_of(errors: dict[str, Any], lost: dict[str, Any] | None = None) -> pd.DataFrame:
    """A table of runs, from the RMS errors of its receivers."""
    columns: dict[str, Any] = {"point": 1, "replicate": np.arange(RUNS) + 1,
                               "seed": np.arange(RUNS) + 1}  # fmt: skip
    random = np.random.default_rng(1)
    for name, y in errors.items():
        columns |= {
            f"{name}.{RESPONSE}": y, f"{name}.{PERCENTILE}": 1.7 * y,
            f"{name}.lost": np.isnan(y) if lost is None else lost.get(name, False),
            f"{name}.nees_position": 3 * random.chisquare(30, RUNS) / 30,
            f"{name}.own_relative_nees_position": np.nan,
        }  # fmt: skip
    failed = np.any([np.isnan(y) for y in errors.values()], axis=0)
    return pd.DataFrame(columns).assign(error=np.where(failed, "failing: it gave up", None))


def noise(seed: int, mean: float, std: float = 0.05) -> Any:
    return np.random.default_rng(seed).normal(mean, std, RUNS)


def made_up(**settings: Any) -> Tournament:
    """Two scenarios: `a` is better than `b` in the first, and `c` is no different from `a`."""
    common = noise(1, 1.0, 0.3)
    near = {"a": common, "b": common + noise(2, 0.2), "c": common + noise(3, 0.006)}
    far = {"a": 3 + common, "b": 3 + common - noise(4, 0.1), "c": 3 + common + noise(5, 0.006)}
    return evaluate({"near": runs_of(near), "far": runs_of(far)}, {**SETTINGS, **settings})


def verdicts(it: Tournament, place: str, response: str = RESPONSE) -> dict[str, str]:
    mine = it.differences
    mine = mine[(mine["scenario"] == place) & (mine["response"] == response)]
    return {f"{row.one} {row.other}": row.verdict for row in mine.itertuples()}


def test_the_answer_says_who_is_better_who_is_equal_and_where_it_is_not_so() -> None:
    it = made_up(practical=0.03)
    assert verdicts(it, "near")["a b"] == "better"
    assert verdicts(it, "far")["a b"] == "worse"
    assert verdicts(it, ALL)["a c"] == "equal" == verdicts(it, "near")["a c"]
    row = it.differences.query("scenario == @ALL and one == 'a' and other == 'b'").iloc[0]
    assert it.answer.startswith(
        f"a is better than b. It is better in {row['wins']} of 200 runs: in at least "
        f"{int(100 * row['share_low'])} % of dives (95 % confidence, all pairs at once); "
        f"{-row['median']:#.3g} m less in the median ({-row['high']:#.3g} to "
        f"{-row['low']:#.3g} m), {-row['mean']:#.3g} m on average ("
    )
    assert ". a and c are equal within 0.0300 m in the median. RMS total error over 200 runs, " \
        "mean of 2 scenarios: a " in it.answer
    assert "In far, b is better than a and b is better than c." in it.answer
    open_ = made_up()
    assert verdicts(open_, ALL)["a c"] == "undecided"
    assert ". Whether a is better than c is undecided after 200 runs; about " in open_.answer
    assert "cannot tell" not in open_.text(verbose=True)


def test_over_all_scenarios_a_seed_counts_by_its_mean_difference() -> None:
    it = made_up()
    table = it.table.pivot(index="seed", columns="scenario")
    per_seed = (table[f"a.{RESPONSE}"] - table[f"b.{RESPONSE}"]).mean(axis=1)
    mine = it.differences
    row = mine[(mine["scenario"] == ALL) & (mine["one"] == "a") & (mine["other"] == "b")].iloc[0]
    assert row["mean"] == pytest.approx(per_seed.mean(), rel=1e-12)
    assert row["wins"] == (per_seed < 0).sum()
    assert row["runs"] == RUNS  # seeds: the scenarios of one seed are not independent
    assert row["least"] == 9  # log2(2 · 9 / 0.05) = 8.5: 3 pairs, 3 places
    assert row["mean_least"] == 142  # ln(0.05 / 72) / ln(0.95) = 141.8
    assert row["share_low"] == pytest.approx(
        proportion_confint(row["wins"], RUNS, 0.05 / 9, "beta")[0], rel=1e-12
    )
    assert len(it.differences) == 18
    nees = it.table.pivot(index="seed", columns="scenario")["a.nees_position"].mean(axis=1)
    assert it.level(ALL, "a")["covariance_words"] == str(of_runs(nees))


def test_the_order_of_the_receivers_changes_nothing() -> None:
    it = made_up()
    turned = [c for name in "cba" for c in it.table.columns if c.startswith(f"{name}.")]
    others = [c for c in it.table.columns if "." not in c and c != "scenario"]
    runs = {name: it.table[it.table["scenario"] == name][[*others, *turned]].reset_index(drop=True)
            for name in ("near", "far")}  # fmt: skip
    again = evaluate(runs, it.settings)
    assert again.answer == it.answer
    pd.testing.assert_frame_equal(again.differences, it.differences)


def test_an_rms_over_runs_is_the_root_of_the_mean_of_the_squares() -> None:
    it = made_up()
    table = it.table
    for receiver in "abc":
        own = {}
        for place in ("near", "far"):
            rms = table.loc[table["scenario"] == place, f"{receiver}.{RESPONSE}"]
            own[place] = float(np.sqrt((rms**2).mean()))
            assert it.level(place, receiver)["rms_over_runs"] == pytest.approx(own[place], 1e-12)
            assert it.level(place, receiver)["mean"] == pytest.approx(rms.mean(), 1e-12)
        whole = it.level(ALL, receiver)["rms_over_runs"]
        assert whole == pytest.approx((own["near"] + own["far"]) / 2, 1e-12)
        assert f"{receiver} {whole:#.3g} m" in it.answer
    assert np.isnan(it.level(ALL, "a", PERCENTILE)["rms_over_runs"])
    rates = evaluate({"x": table[table["scenario"] == "near"].assign(scenario=None)},
                     {**SETTINGS, "response": PERCENTILE})  # fmt: skip
    assert "95th percentile in a run, mean of 200 runs in x: a " in rates.answer


def test_a_seed_that_failed_in_one_scenario_does_not_count_by_the_others() -> None:
    """Neither in means nor in differences: its other scenarios may be the easy ones."""
    easy, hard = noise(1, 1.0), noise(2, 9.0)
    gone = np.arange(RUNS) % 4 == 0
    near = {"a": np.where(gone, 0.001, easy), "b": easy + 0.5}
    far = {"a": np.where(gone, np.nan, hard), "b": hard + 0.5}
    it = evaluate({"near": runs_of(near), "far": runs_of(far)}, SETTINGS)
    found = it.level(ALL, "a")
    both = (easy + hard)[~gone] / 2
    assert (found["runs"], found["failed"]) == (RUNS, gone.sum())
    assert found["mean"] == pytest.approx(both.mean(), rel=1e-12)
    assert found["least"] == pytest.approx(both.min(), rel=1e-12)
    squares = [np.sqrt((y[~gone] ** 2).mean()) for y in (easy, hard)]
    assert found["rms_over_runs"] == pytest.approx(np.mean(squares), rel=1e-12)
    row = it.differences.query("scenario == @ALL and response == @RESPONSE").iloc[0]
    assert (row["wins"], row["losses"]) == (150, 50)
    assert row["mean"] == pytest.approx(-0.5)
    assert it.level("near", "a")["failed"] == 0
    assert "But it failed in 50 of 200 runs." in it.answer


def test_what_needs_no_assumption_is_said_first() -> None:
    """100 paired runs, 22.3 m against 2.4 m in each, with a tail that no mean withstands."""
    random = np.random.default_rng(1)
    tail = random.lognormal(0.0, 2.0, RUNS)
    for others, share, held in ((("b",), 96, ""), (("b", "c"), 95, ", all pairs at once")):
        errors = {"a": 2.4 + 0.1 * random.random(RUNS)}
        errors |= {name: 22.3 + tail * (1 + i) for i, name in enumerate(others)}
        runs = runs_of(errors).head(100)
        it = evaluate({"x": runs}, {**SETTINGS, "runs": 100})
        than = "all others" if held else "b"
        whom = "than b, the closest, " if held else ""
        assert it.answer.startswith(
            f"a is better than {than}. It is better {whom}in 100 of 100 runs: in at least {share} "
            f"% of dives (95 % confidence{held}); "
        )
        assert " on average" not in it.answer
        assert {*verdicts(it, "x").values()} == {"better"}


def test_a_receiver_that_is_lost_in_some_runs_is_told_by_that() -> None:
    bad = np.arange(RUNS) % 20 == 3
    good = noise(1, 1.0)
    lossy = np.where(bad, 500.0, good - 0.2)
    failing = np.where(bad, np.nan, good - 0.2)
    it = evaluate(
        {"x": runs_of({"good": good, "lossy": lossy, "failing": failing}, {"lossy": bad})},
        {**SETTINGS, "practical": 0.5},
    )
    assert it.receivers == ("lossy", "failing", "good")
    found = verdicts(it, "x")
    assert found["lossy good"] == found["failing good"] == "better"  # not equal within 0.5 m
    assert "But it was lost in 10 of 200 runs." in it.answer
    said, more = it.text(), it.text(verbose=True)
    assert "x: lossy is better than good in most runs, but its mean over the runs is 24.8 m more" \
        in said
    told = "x: lossy was lost in 10 of 200 runs, 2.4 to 9 % of all with 95 % confidence"
    assert told in more
    assert told not in said  # the table has the share
    rows = [line.split() for line in more.splitlines()]
    assert any(row[:1] == ["lossy"] and row[-4:] == ["2.42", "to", "9.00", "%"] for row in rows)
    assert "x: lossy is heavy-tailed: the worst 10 of 200 runs make 100 % of the spread" in said
    assert "x: failing failed in 10 of 200 runs, which count as worse than any other, e.g." in said
    assert "with seed 4: failing: it gave up" in said
    other = evaluate({"x": it.table.assign(error="another: silent")}, it.settings).text()
    assert ", e.g. with seed 4\n" in other


def test_a_single_receiver_gets_a_table_without_differences() -> None:
    it = evaluate({"x": runs_of({"a": noise(1, 1.0)})}, SETTINGS)
    assert it.differences.empty
    assert it.answer == "RMS total error over 200 runs in x: a 0.997 m."
    assert "difference" not in it.text()
    assert len(it.plot().axes) == 1


def test_too_few_runs_are_said_with_the_number_that_is_missing() -> None:
    few = {name: table.head(8) for name, table in (
        (name, made_up().table.query("scenario == @name")) for name in ("near", "far")
    )}  # fmt: skip
    it = evaluate(few, {**SETTINGS, "runs": 8})
    assert set(it.differences["verdict"]) == {"undecided"}
    said, more = it.text(), it.text(verbose=True)
    assert it.answer.startswith("Whether a is better than c and b is undecided after 8 runs")
    for line in ("no interval of a mean from 8 runs: 72 are needed, 64 more",
                 "no bound for 95 % of the runs from 8: 59 are needed, 51 more"):
        assert line in more
        assert line not in said  # it has none
    line = "no verdict from 8 runs: 9 are needed, 1 more"
    assert line in said
    assert line in more


@pytest.mark.parametrize(("missing", "least"), [
    ("no verdict", 7), ("no bound for 95 % of the runs", 59), ("no interval of a mean from", 72),
])  # fmt: skip
def test_with_as_many_runs_as_are_needed_nothing_is_missing(missing: str, least: int) -> None:
    table = runs_of({name: noise(i, 1.0 + i) for i, name in enumerate("abc")})
    few, enough = (
        evaluate({"x": table.head(runs)}, {**SETTINGS, "runs": runs}).text(verbose=True)
        for runs in (least - 1, least)
    )
    (line,) = [line for line in few.splitlines() if line.startswith(missing)]
    assert line.endswith(f": {least} are needed, 1 more")
    assert missing not in enough


def test_columns_of_which_nothing_is_known_are_left_away() -> None:
    few = {name: table.head(8) for name, table in (
        (name, made_up().table.query("scenario == @name")) for name in ("near", "far")
    )}  # fmt: skip
    heads = ("95 %, all at once", "of dives", "95 % of runs [m]", "mean, 95 % interval")
    said = evaluate(few, {**SETTINGS, "runs": 8}).text(verbose=True)
    assert not any(head in said for head in heads)
    assert "95 % in a run [m]" in said
    assert said.count("lost, 95 % interval") == 2  # there is none over all scenarios
    enough = made_up().text(verbose=True)
    assert all(head in enough for head in heads)
    axes = evaluate(few, {**SETTINGS, "runs": 8}).plot().axes
    assert axes[1].get_xlabel() == "median difference from a [m]"


def test_no_number_of_runs_that_nobody_makes_is_asked_for() -> None:
    """Up to 10,000 it is said; beyond, that they are alike."""
    assert would_decide(10_000) == "about 10,000 runs would decide"
    assert would_decide(10_001) == "no practical number of runs (10,000) would decide"


def test_runs_that_would_decide_are_those_of_each_pair() -> None:
    """Of the largest number, if it is said for all; what any verdict takes is said once."""
    common = noise(1, 1.0, 0.3)
    near = {"a": common, "b": common + noise(2, 0.008), "c": common + noise(3, 0.008)}
    it = evaluate({"x": runs_of(near)}, SETTINGS)
    mine = it.differences.query("response == @RESPONSE and one == 'a'").set_index("other")
    needed = mine["runs_needed"].to_dict()
    assert {*mine["verdict"]} == {"undecided"}
    assert min(needed.values()) > RUNS
    assert it.answer.startswith(
        f"Whether a is better than b and c is undecided after 200 runs; about "
        f"{max(needed.values()):,} runs would decide all of it. "
    )
    rows = [line for line in it.text(verbose=True).splitlines() if line.startswith("a − ")]
    assert [row.partition("undecided")[2] for row in rows[:2]] == [
        f"; about {needed[other]:,} runs would decide" for other in ("b", "c")
    ]
    few = evaluate({"x": runs_of(near).head(6)}, {**SETTINGS, "runs": 6})
    assert {*few.differences["least"]} == {7}
    lines = [line for line in few.text(verbose=True).splitlines()
             if "undecided" in line and " − " in line][:3]  # fmt: skip
    for row, line in zip(few.differences.itertuples(), lines, strict=False):
        own = pd.notna(row.runs_needed) and row.runs_needed > 7
        assert line.endswith(
            f"; about {row.runs_needed:,} runs would decide" if own else "undecided"
        )
    assert "7 are needed" in few.text()


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_the_figure_has_a_row_for_each_receiver_and_no_small_text(theme: Any) -> None:
    from matplotlib.text import Text

    axes = made_up(practical=0.03).plot(theme=theme).axes
    assert len(axes) == 6
    assert [t.get_text() for t in axes[0].get_yticklabels()] == ["a", "c", "b"]
    texts = [t for t in axes[0].figure.findobj(Text) if t.get_text()]
    assert min(t.get_fontsize() for t in texts) >= 8
    left, right = axes[:2]
    assert left.get_xlabel() == "RMS total error [m], 5 to 95 % of runs"
    assert right.get_xlabel().replace("\n", " ") == "median difference from a [m], 95 % all at once"
    said = [t.get_text() for t in axes[0].figure.legends[0].get_texts()]
    assert said.count("like the best; right of it: worse") == 1
    assert {"circle: median of the runs", "thick bar: middle half of the runs",
            "thin line: 5 to 95 % of the runs", "grey: within ±0.03 m, does not matter",
            "bar: 95 % interval of the difference"} <= {*said}
    assert spoiled_texts(axes[0].figure) == []
    panels = tournament_figures.shown(made_up(practical=0.03))[0]
    with style.use(theme):
        narrow = style.new_figure(3.9, 6.0).subplots(3, 2)
    tournament_figures.plot_tournament(*tournament_figures.shown(made_up()), narrow.flat, theme)
    narrow[0, 0].figure.draw_without_rendering()
    for row in narrow:
        one, other = (ax.xaxis.label.get_window_extent() for ax in row)
        assert one.x1 < other.x0
    with pytest.raises(ValueError, match="axes: must be 6 axes, got 1"):
        tournament_figures.plot_tournament(panels, "x", "m", axes=[left])


@pytest.mark.parametrize(("practical", "runs", "bands"), [
    (None, RUNS, ["thick bar"]), (1e-6, RUNS, ["thick bar"]), (0.03, RUNS, ["thick bar", "grey"]),
    (0.03, 1, ["grey"]),
])  # fmt: skip
def test_the_key_has_no_band_that_is_not_drawn(
    practical: float | None, runs: int, bands: list[str]
) -> None:
    made = made_up().table
    some = {n: made.query("scenario == @n").head(runs) for n in ("near", "far")}
    axes = evaluate(some, {**SETTINGS, "runs": runs, "practical": practical}).plot().axes
    said = [t.get_text().partition(":")[0] for t in axes[0].figure.legends[0].get_texts()]
    assert [word for word in said if word in ("thick bar", "grey")] == bands


# --- Real runs -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def real() -> Tournament:
    return sblcosim.compare(
        ["paper-scenario-1", "harbour-square"], ["ekf", "sequential"], runs=6, seed=5,
        settling_s=1.0, overrides=SHORT, workers=1,
    )  # fmt: skip


def test_all_receivers_have_the_noise_of_a_single_run(real: Tournament) -> None:
    table = real.table[real.table["scenario"] == "paper-scenario-1"]
    assert table["seed"].tolist() == [5, 6, 7, 8, 9, 10]
    run = sblcosim.run("paper-scenario-1", ["ekf", "sequential"], SHORT | {"seed": 7})
    for receiver in ("ekf", "sequential"):
        late = run.tracks[receiver].query("epoch_s >= 1")["error_total_m"]
        found = table.loc[table["seed"] == 7, f"{receiver}.{RESPONSE}"].iloc[0]
        assert found == pytest.approx(float(np.sqrt((late**2).mean())), rel=1e-12)
    alone = sblcosim.compare("paper-scenario-1", "ekf", runs=6, seed=5, settling_s=1.0,
                             overrides=SHORT, timed=False)  # fmt: skip
    assert alone.table[f"ekf.{RESPONSE}"].tolist() == table[f"ekf.{RESPONSE}"].tolist()


def test_equal_questions_give_equal_files_on_any_number_of_workers(
    real: Tournament, tmp_path: Path
) -> None:
    again = sblcosim.compare(
        ["paper-scenario-1", "harbour-square"], ["ekf", "sequential"], runs=6, seed=5,
        settling_s=1.0, overrides=[*(f"{k}={v}" for k, v in SHORT.items())], workers=2,
    )  # fmt: skip
    one, other = real.save(tmp_path / "one"), again.save(tmp_path / "other")
    names = sorted(file.name for file in one.iterdir())
    assert names == sorted(
        [f"{name}.{kind}" for name in ("runs", "levels", "differences") for kind in
         ("csv", "parquet")] + ["comparison.png", "comparison.svg", "manifest.json"]
    )
    for name in names:
        assert (one / name).read_bytes() == (other / name).read_bytes(), name
    assert real.update_s["harbour-square"].keys() == {"ekf", "sequential"}


def test_the_time_of_an_update_is_that_of_runs_with_it_less_that_without(
    monkeypatch: pytest.MonkeyPatch, seam: Seam,
) -> None:
    now = [0.0]
    original = cost.lanes.execute

    def execute(plan: Any, *arguments: Any, **options: Any) -> Any:
        now[0] += len(plan.components) ** 2  # seconds
        return original(plan, *arguments, **options)

    seam.instead(cost.lanes.execute, execute)
    monkeypatch.setattr(time, "process_time", lambda: now[0])
    study = load_study({
        "scenario": "harbour-square", "design": {"kind": "single"}, "receivers": ["ekf", "coupled"],
        "fixed": {"time.duration_s": 5.0},
    })  # fmt: skip
    updates = sblcosim.run("harbour-square", "ekf", SHORT).record.values["ekf.update_count"][-1]
    assert cost.update_seconds(study)["ekf"] == pytest.approx((16 - 9) / updates)
    now[0] = 0.0
    monkeypatch.setattr(time, "process_time", lambda: 0.0)  # a clock too coarse to tell
    assert cost.update_seconds(study) == {"ekf": None, "coupled": None}


def test_a_response_that_is_never_a_number_is_named_and_no_receiver_is_blamed(
    tmp_path: Path
) -> None:
    (tmp_path / "mine.py").write_text("def g(run):\n    return float('nan')\n")
    it = sblcosim.compare(
        "harbour-square", ["ekf"], runs=2, overrides=SHORT, response=f"{tmp_path}/mine.py:g",
    )  # fmt: skip
    assert it.problems == ["ekf: must have a finite g in harbour-square, got none in 2 runs"]


def test_receivers_in_python_take_part_and_one_that_is_silent_is_named(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(NEVER)
    it = sblcosim.compare(
        "harbour-square", ["ekf", f"{tmp_path}/own.py:Fix", f"{tmp_path}/own.py:Never"],
        runs=2, overrides=SHORT,
    )  # fmt: skip
    assert it.receivers[-1] == "Never"
    assert it.answer.endswith(", Never –.")
    assert it.problems == ["Never: must give estimates in harbour-square, got none in 2 runs"]
    assert it.update_s["harbour-square"]["Never"] is None
    assert np.isfinite(it.level("harbour-square", "Fix")["mean"])
    assert it.manifest()["comparison"]["receivers"][1]["python"] == "own.py:Fix"
    assert str(tmp_path) not in json.dumps(it.manifest())


def test_no_run_is_repeated_of_a_receiver_that_always_failed() -> None:
    it = evaluate({"x": runs_of({"a": np.full(RUNS, np.nan)})}, SETTINGS)
    with pytest.raises(ConfigurationError) as refused:
        worst_run(it)
    assert str(refused.value) == "replay: must be of a run in which a gives estimates, got none"


def test_a_response_of_the_user_is_compared(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(
        "def first_epoch_s(run):\n    return run.used.epoch_s[0]\n"
    )
    it = sblcosim.compare("harbour-square", ["ekf", "sequential"], runs=2, overrides=SHORT,
                          response=f"{tmp_path}/mine.py:first_epoch_s", timed=False)  # fmt: skip
    assert it.response == "first_epoch_s"

    def first_epoch_s(run: Any) -> float:
        return float(run.used.epoch_s[0])

    name, asked = tournament.response_of(first_epoch_s)
    assert name == "first_epoch_s"
    assert asked.definition is first_epoch_s
    assert set(it.differences["response"]) == {"first_epoch_s", PERCENTILE}


def test_the_receiver_of_each_scenario_runs_where_none_is_asked_for() -> None:
    it = sblcosim.compare(["paper-scenario-1", "realistic-dive"], runs=2, overrides=SHORT,
                          timed=False)  # fmt: skip
    assert it.differences.empty
    there = set(zip(it.levels["scenario"], it.levels["receiver"], strict=True))
    assert there == {("paper-scenario-1", "ekf"), ("realistic-dive", "coupled")}


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "runs": ({"runs": 1}, "runs: must be a whole number of at least 2, got 1"),
    "practical": ({"practical": 0}, "practical: must be more than 0 and finite, got 0"),
    "contamination": ({"contamination": 1.0}, "contamination: must be a share between 0 and 1, "),
    "receiver": ({"receivers": ["copled"]}, "receiver: must be .*; did you mean 'coupled'?"),
    "response": ({"response": "absolute_total_rms"}, "response: .*; did you mean 'absolute_total"),
    "no response": ({"response": 5}, "response: must be a name or a function, got 5"),
    "more is better": ({"response": "availability"}, "response: must be one of which less is bett"),
    "signed": ({"response": "absolute_x_mean_m"}, "response: must be one of which less is better"),
    "scenario": ({"scenarios": ["harbour"]}, "scenario: must be a TOML file or one of "),
    "none": ({"scenarios": []}, "scenarios: must be at least one, got none"),
    "labels": ({"receivers": {"a": "ekf"}}, "receivers: must be a sequence of receivers, got a "),
    "twice": ({"scenarios": ["harbour-square"] * 2}, "scenarios: must have different names, got "),
    "named as all": ({"scenarios": [load("harbour-square", {"name": ALL})]},
                     "scenarios: must not be named 'all scenarios'"),
    "receiver twice": ({"receivers": ["ekf", "coupled", "ekf"]},
                       "receivers: must differ from each other, got 'ekf' twice"),
    "settling": ({"settling_s": 1e6}, ".*settling_time_s: must be less than the length of the ru"),
    "key": ({"overrides": ["platform.arm=1"]}, r"override platform.arm: \[platform\] has no key"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_one_line(case: str) -> None:
    given, words = WRONG[case]
    with pytest.raises(ConfigurationError, match=words.replace("?", r"\?")) as caught:
        sblcosim.compare(**{"scenarios": ["harbour-square"], "receivers": ["ekf"]} | given)
    assert "\n" not in str(caught.value)


def test_every_response_of_which_less_is_better_can_be_asked_for() -> None:
    for name in tournament.lesser():
        assert tournament.response_of(name)[0] == name
    assert {"absolute_total_p95_m", "lost", "first_fix_s"} <= set(tournament.lesser())
    assert not {"availability", "nis", "absolute_x_mean_m"} & set(tournament.lesser())


# --- Many runs of one scenario -------------------------------------------------------------------


@pytest.fixture(scope="module")
def several() -> many.Many:
    return sblcosim.run_many(
        "harbour-square", ["ekf", "coupled"], SHORT | {"seed": 11}, runs=6, workers=1
    )


def within_of_all(receiver: str, it: many.Many) -> float:
    """Radius that holds 95 % of the estimates of all runs, from the estimates themselves [m]."""
    lengths = []
    for seed in it.runs.table["seed"]:
        run = sblcosim.run("harbour-square", ["ekf", "coupled"], SHORT | {"seed": int(seed)})
        lengths.append(run.tracks[receiver]["error_total_m"].to_numpy())
    every = np.sort(np.concatenate(lengths))
    return float(every[int(np.ceil(0.95 * len(every))) - 1])


def test_the_typical_and_the_worst_run_are_those_of_the_table(several: many.Many) -> None:
    table = several.runs.table
    assert table["seed"].tolist() == [11, 12, 13, 14, 15, 16]
    ranked = table.sort_values(f"ekf.{RESPONSE}")["seed"].tolist()
    assert several.drawn_seeds == {"typical": ranked[2], "worst": ranked[-1]}
    for which, result in several.drawn.items():
        row = table[table["seed"] == several.drawn_seeds[which]].iloc[0]
        for receiver in ("ekf", "coupled"):
            made = result.errors.loc[(receiver, "absolute", "total"), "rms_m"]
            assert made == pytest.approx(row[f"{receiver}.{RESPONSE}"], rel=1e-12)
    lines = several.answer.splitlines()
    worst, median = (table.set_index("seed")[f"ekf.{RESPONSE}"][ranked[i]] for i in (-1, 2))
    assert within_of_all("ekf", several) == pytest.approx(several.within_m["ekf"], rel=0.02)
    assert several.to_json()["within_m"] == several.within_m
    rms = np.sqrt((table[f"ekf.{RESPONSE}"] ** 2).mean())
    count = table["ekf.misleading"].sum()
    low, high = share_interval(count, 6)
    misleading = f", misleading in {count} ({100 * low // 1:.0f}–{-(-100 * high // 1):.0f} %)"
    assert lines[0] == (
        f"ekf: {rms:.3g} m RMS, 95 % within {several.within_m['ekf']:.3g} m, "
        f"lost in 0 of 6 runs{misleading}; typical: seed {ranked[2]} ({median:.3g} m); "
        f"worst: seed {ranked[-1]} ({worst:.3g} m)"
    )
    assert re.fullmatch(r"coupled: \S+ m RMS, 95 % within \S+ m, lost in 0 of 6 runs, "
                        r"misleading in \d \(\d+–\d+ %\)", lines[1])  # fmt: skip
    assert several.text().startswith(several.answer)
    assert several.to_json()["answer"] == several.answer
    found = several.runs.level("harbour-square", "coupled")
    column = table[f"coupled.{RESPONSE}"]
    assert [found[k] for k in ("mean", "std", "median", "least", "most")] == pytest.approx(
        [column.mean(), column.std(), column.median(), column.min(), column.max()]
    )


SCREEN = 24
"""Lines of a terminal, two of them to say where the result is."""


@pytest.fixture(scope="module")
def sixty() -> many.Many:
    return sblcosim.run_many(
        "harbour-square", ["coupled", "ekf"], {"time.duration_s": 60.0}, runs=60, workers=1
    )


@pytest.mark.parametrize("lost", [0, 2])
def test_the_first_screen_of_many_runs_is_the_verdicts_and_one_small_table(
    sixty: many.Many, lost: int
) -> None:
    table = sixty.runs.table.assign(**{
        f"{name}.lost": np.arange(60) < lost for name in sixty.receivers
    })  # fmt: skip
    it = replace(sixty, runs=evaluate({"harbour-square": table}, sixty.runs.settings))
    said, more = it.text(width=60), it.text(width=60, verbose=True)
    for text in (said, more):
        assert max(map(len, text.splitlines())) <= 60
        words = " ".join(text.split())
        assert words.startswith(" ".join(it.answer.split()))
        for sheet in it.data_sheet[: 2 if text is more else 1]:
            assert sheet in words
        assert words.count(LOST) == (lost > 0 or text is more)
        assert f"lost in {lost} of 60 runs" in words
    assert len(said.splitlines()) <= SCREEN - 2
    assert it.data_sheet[1] not in " ".join(said.split())
    for word in ("median", "std", "interval", "order statistic", "NEES"):
        assert word not in said
        assert word in " ".join(more.split())


def test_compare_prints_differences_of_all_scenarios_and_means_on_request() -> None:
    it = made_up()
    said, more = it.text(), it.text(verbose=True)
    heads = [re.split(r"\s{2,}", line.strip()) for line in said.splitlines()
             if line.startswith("difference")]  # fmt: skip
    assert heads == [["difference [m]", "better in", "of dives", "median",
                      "95 %, all at once", "the first is"]]  # fmt: skip
    rows = [line for line in said.splitlines() if line.startswith("a − ")]
    assert len(rows) == len(it.receivers) - 1
    assert more.count("\ndifference of ") == 2 * len(it.places)
    assert said.count(" runs\n") == 1
    assert more.count(" runs\n") == len(it.places)
    of_each = said.splitlines().index(next(it for it in said.splitlines() if "near" in it))
    assert said.splitlines()[of_each].split() == ["RMS", "[m]", *it.places[:-1]]
    for row in said.splitlines()[of_each + 1 : of_each + 1 + len(it.receivers)]:
        name, *values = row.split()
        assert [float(value) for value in values] == pytest.approx(
            [reached(it.level(place, name)) for place in it.places[:-1]], rel=0.01
        )


@pytest.mark.parametrize("places", [1, 2])
def test_what_compare_prints_fits_a_screen(places: int) -> None:
    bad = np.arange(RUNS) % 20 == 3
    runs = runs_of({name: noise(i, 1.0) for i, name in enumerate(("coupled", "sequential", "ekf"))},
                   {"ekf": bad, "sequential": bad})  # fmt: skip
    it = evaluate({f"realistic-dive-{i}": runs for i in range(places)}, SETTINGS)
    lines = it.text(width=80).splitlines()
    assert len(lines) <= (20 if places == 1 else SCREEN)
    assert max(map(len, lines)) <= 80


def test_a_table_of_many_columns_is_put_together_without_a_warning() -> None:
    base = runs_of({"a": noise(1, 1.0), "b": noise(2, 2.0)})
    many_ = pd.DataFrame(
        {**dict(base.items()), **{f"a.column{i}": noise(i, 1.0) for i in range(120)}}
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        table = evaluate({"x": many_}, SETTINGS).table
    assert [*table.columns] == ["scenario", *(c for c in many_.columns if c != "scenario")]
    assert (table["scenario"] == "x").all()


def test_many_runs_are_a_folder_with_two_results_that_is_replaced_whole(
    several: many.Many, tmp_path: Path
) -> None:
    folder = several.save(tmp_path / "m", figures=False)
    assert {"runs.csv", "levels.csv", "typical", "worst", "manifest.json"} <= {
        file.name for file in folder.iterdir()
    }
    for which in ("typical", "worst"):
        about = json.loads((folder / which / "manifest.json").read_text())
        assert about["seeds"]["acoustics"] == several.drawn_seeds[which]
    assert several.save(tmp_path / "m", figures=False) == folder
    (tmp_path / "empty").mkdir()
    several.save(tmp_path / "empty", figures=False)
    assert (tmp_path / "empty" / "worst" / "record.csv").is_file()
    (folder / "worst" / "mine.txt").write_text("mine")
    with pytest.raises(ConfigurationError, match=r"worst: must be empty .*got 'mine.txt' in it"):
        several.save(tmp_path / "m", figures=False, other="replace")
    assert (folder / "worst" / "mine.txt").read_text() == "mine"


def test_a_receiver_that_never_answers_leaves_nothing_to_draw(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(NEVER)
    found = sblcosim.run_many("harbour-square", f"{tmp_path}/own.py:Never", SHORT, runs=2)
    assert (found.drawn, found.drawn_seeds) == ({}, {})
    assert found.problems == ["Never: must give estimates in harbour-square, got none in 2 runs"]
    assert found.answer == "Never: no estimate in any of 2 runs"


# --- The commands --------------------------------------------------------------------------------


def cli(*arguments: object) -> Result:
    return CliRunner().invoke(
        sblcosim.cli.app, [str(a) for a in arguments], catch_exceptions=False
    )


def test_the_commands_write_and_say_what_the_functions_do(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(NEVER)
    short = ("--set", "time.duration_s=5", "--no-figures")
    done = cli("compare", "harbour-square", "paper-scenario-1", "--receiver", "ekf", "--receiver",
               "sequential", "--runs", 2, *short, "--out", tmp_path / "c")  # fmt: skip
    assert (done.exit_code, done.stderr) == (0, "")
    assert done.stdout.startswith("Whether ")
    assert f"written to {tmp_path / 'c'}" in done.stdout
    again = cli("compare", "harbour-square", "--runs", 3, *short, "--out", tmp_path / "c")
    assert again.exit_code == 2
    assert again.stderr.startswith(f"error: {tmp_path / 'c'}: must be empty or hold the result of ")
    silent = cli("compare", "harbour-square", "--receiver", f"{tmp_path}/own.py:Never", "--runs",
                 2, *short, "--out", tmp_path / "n", "--json")  # fmt: skip
    assert silent.exit_code == 1
    assert json.loads(silent.stdout)["levels"][0]["failed"] == 2
    last = silent.stderr.splitlines()[-1]
    assert last == "error: Never: must give estimates in harbour-square, got none in 2 runs"
    runs = cli("run", "harbour-square", "--runs", 3, "--seed", 4, *short, "--out", tmp_path / "r")
    assert re.match(r"ekf: \S+ m RMS, .* in 0 of 3 runs.*; typical: seed \d \(.*; worst: seed \d "
                    r"\(.* m\)\n\nharbour-square: 3 runs, seeds from 4\n", runs.stdout)  # fmt: skip
    assert (tmp_path / "r" / "typical" / "record.csv").is_file()


@pytest.mark.parametrize("given", ["1", "0", "x"])
def test_fewer_than_two_runs_are_refused(given: str) -> None:
    for command in ("compare", "run"):
        done = cli(command, "harbour-square", "--runs", given)
        assert done.exit_code == 2
        assert done.stderr == (
            f"error: --runs: must be a whole number of at least 2, got {given!r}\n"
        )


# What is said of a pair ---------------------------------------------------------------------------


def test_a_larger_mean_is_said_to_be_more() -> None:
    random = np.random.default_rng(3)
    base = random.normal(1, 0.1, RUNS)
    gap = np.where(random.random(RUNS) < 0.65, -1, 2.5)
    it = evaluate({"x": runs_of({"a": 5 + base + gap, "b": 5 + base})}, SETTINGS)
    row = it.differences.iloc[0]
    assert row["verdict"] == "better"
    assert row["mean"] > 0
    more = f"but {row['mean']:.3f} m more on average (−0.0314 to 0.600 m)"
    assert f"1.00 m less in the median (1.00 to 1.00 m), {more}" in it.answer
    assert "−0.26" not in it.answer


@pytest.mark.parametrize("scenarios", [1, 2])
def test_who_is_surely_better_than_the_least_median_comes_first_and_once(scenarios: int) -> None:
    """c is far behind both; in two scenarios the place of each is said besides."""
    a = np.r_[np.full(101, 1.0), np.full(99, 3.0)]
    b = np.r_[np.full(66, 0.9), np.full(35, 5.0), np.full(99, 2.9)]
    table = runs_of({"a": a, "b": b, "c": a + 9})
    it = evaluate(dict.fromkeys("xy"[:scenarios], table), SETTINGS)
    assert it.receivers[0] == "a"
    row = it.differences.iloc[0]
    share = int(100 * row["share_low"])
    assert it.answer.startswith(
        f"b is better than a. It is better in 165 of 200 runs: in at least {share} % of dives (95 "
        "% confidence, all pairs at once); 0.100 m less in the median (0.100 to 0.100 m), but "
        "0.617 m more on average ("
    )
    assert "a is better than c. It is better in 200 of 200 runs" in it.answer
    assert it.answer.count("b is better than a") == scenarios * 2 - 1
    assert "worse" not in it.answer


def test_a_pair_behind_the_least_median_is_said_where_it_is_turned() -> None:
    a = np.full(RUNS, 0.5)
    b = np.r_[np.full(101, 1.0), np.full(99, 3.0)]
    c = np.r_[np.full(66, 0.9), np.full(35, 5.0), np.full(99, 2.9)]
    it = evaluate({"x": runs_of({"a": a, "b": b, "c": c})}, SETTINGS)
    assert it.answer.startswith("a is better than all others.")
    assert it.answer.endswith("In x, c is better than b.")


@pytest.mark.parametrize(
    ("receivers", "runs", "least"), [(2, 98, 99), (3, 110, 121), (7, 150, 159)]
)
def test_too_few_runs_for_the_mean_of_a_pair_are_said(
    receivers: int, runs: int, least: int
) -> None:
    base = np.random.default_rng(3).normal(1, 0.1, RUNS)
    table = runs_of({f"r{i}": base + i / 2 for i in range(receivers)})
    said = f"no interval of a mean difference from {runs} runs: {least} are needed, {least - runs} "
    it = evaluate({"x": table.head(runs)}, SETTINGS | {"runs": runs})
    assert it.differences["mean_low"].isna().all()
    assert said in it.text(verbose=True)
    assert "mean difference" not in it.text()  # it has none
    it = evaluate({"x": table.head(least)}, SETTINGS | {"runs": least})
    assert it.differences["mean_low"].notna().all()
    assert "no interval of a mean" not in it.text(verbose=True)


@pytest.mark.parametrize("response", FLAGS)
def test_of_a_share_of_runs_no_tail_and_no_median_of_0_is_told(response: str) -> None:
    table = runs_of({"a": np.ones(RUNS), "b": np.ones(RUNS)})
    for receiver, every in (("a", 50), ("b", 4)):
        table[f"{receiver}.{response}"] = (np.arange(RUNS) % every == 0) * 1.0
    it = evaluate({"x": table}, SETTINGS | {"response": response})
    said = it.text()
    assert "heavy-tailed" not in said
    assert not it.levels["heavy_tailed"][it.levels["response"] == response].any()
    assert "; no difference in the median, 0.2" in it.answer
    assert "; 0 less" not in it.answer
    assert f" Share of {response} runs, mean of 200 runs in x: a 0.0200, b 0.250." in it.answer


@pytest.mark.parametrize("verbose", [False, True])
@pytest.mark.parametrize("lost", [False, True])
def test_columns_of_percentages_are_said_to_be_order_statistics(verbose: bool, lost: bool) -> None:
    base = np.random.default_rng(1).normal(1, 0.1, RUNS)
    gone = {"a": np.arange(RUNS) < 3 * lost}
    it = evaluate({"x": runs_of({"a": base, "b": base + 1}, gone)}, SETTINGS)
    said = it.text(verbose=verbose)
    for line in ("95 % in a run: an order statistic, of a run's n errors",
                 "upper confidence bound of the 95th percentile over the runs, by order"):
        assert said.count(line) == verbose
    assert said.count(LOST) == (verbose or lost)


@pytest.mark.parametrize(("factor", "told"), [(0.25, "optimistic ×4"), (3.0, "pessimistic ×3")])
def test_a_wrong_covariance_is_told_with_its_factor(factor: float, told: str) -> None:
    it = evaluate({"x": runs_of({"a": noise(1, 1.0), "b": noise(2, 1.0)})}, SETTINGS)
    levels = it.levels.assign(nees_runs=RUNS, covariance=told.split()[0], covariance_factor=factor)
    assert replace(it, levels=levels).text(verbose=True).count(told) == 2


@pytest.mark.parametrize(("covariance", "words", "told"), [
    ("unknown", "not judged: 40 % of the runs are lost", "not judged"),
    ("unknown", "there is no telling", "unknown"),
    ("consistent", "not judged: never said beside this", "consistent"),
])
def test_a_covariance_that_is_not_judged_is_told_from_one_that_is_unknown(
    covariance: str, words: str, told: str
) -> None:
    it = evaluate({"x": runs_of({"a": noise(1, 1.0), "b": noise(2, 1.0)})}, SETTINGS)
    levels = it.levels.assign(nees_runs=RUNS, covariance=covariance, covariance_words=words)
    lines = replace(it, levels=levels).text(verbose=True).splitlines()
    assert sum(line.count(told) for line in lines if "│" in line or line.split()[:1] in (
        ["a"], ["b"])) == 2  # fmt: skip


# The whole text ----------------------------------------------------------------------------------


def table_after(lines: list[str], first: int) -> list[list[str]]:
    """The cells of a table of the text, row by row, without its heading."""
    rows = []
    for line in lines[first + 1 :]:
        if not line or line.startswith("  "):
            return rows
        rows.append(re.split(r"\s{2,}", line))
    return rows


@pytest.fixture(scope="module")
def told() -> Tournament:
    """Two scenarios in which every share, count and time is another."""
    near = runs_of({"a": noise(1, 1.0), "b": noise(2, 1.3), "c": noise(3, 2.4)},
                   {"a": np.arange(RUNS) % 20 == 3, "b": np.arange(RUNS) < 31})  # fmt: skip
    far = runs_of({"a": noise(4, 2.0), "b": noise(5, 1.9), "c": noise(6, 3.4)},
                  {"c": np.arange(RUNS) < 7})  # fmt: skip
    for k, table in enumerate((near, far)):
        for i, name in enumerate("abc"):
            table[f"{name}.misleading"] = (np.arange(RUNS) % (7 + i + 3 * k) == 0) * 1.0
        table.loc[:49, "b.misleading"] = np.nan
    times = {"near": {"a": 3e-7, "b": 2.5e-6, "c": 4e-3}, "far": {"a": 5e-7, "b": None, "c": 2e-3}}
    return evaluate({"near": near, "far": far}, {**SETTINGS, "practical": 0.05}, times)


SHARES_TOLD = {
    ALL: {"a": ("2.5 %", "12 %", "in band", "~ 400 ns"), "b": ("7.8 %", "11 %", "not judged", "–"),
          "c": ("1.8 %", "10 %", "in band", "~ 3.0 ms")},
    "near": {"a": ("5 %", "14 % (9–21)", "in band", "~ 300 ns"),
             "b": ("16 %", "12 % (7–19)", "not judged", "~ 2.5 µs"),
             "c": ("0 %", "12 % (7–17)", "in band", "~ 4.0 ms")},
    "far": {"a": ("0 %", "10 % (6–16)", "in band", "~ 500 ns"),
            "b": ("0 %", "9.3 % (5–16)", "in band", "–"),
            "c": ("3.5 %", "8.5 % (5–14)", "in band", "~ 2.0 ms")},
}  # fmt: skip
"""Lost, misleading, covariance, update: 29, 18 of 150 and 23 misleading in `near`, 20, 14 of 150
and 17 in `far`, with the intervals of SciPy's `binomtest`; 10, 31 and 7 lost."""


def test_the_verbose_text_has_every_table_of_every_place(told: Tournament) -> None:
    lines = told.text(verbose=True).splitlines()
    heads = [i for i, line in enumerate(lines) if line.endswith(": 200 runs")]
    assert [lines[i] for i in heads] == [f"{p}: 200 runs" for p in (ALL, "near", "far")]
    errors, within = (
        {place: {name: np.array([told.table.loc[told.table["scenario"] == it, f"{name}.{of}"]
                                 for it in ([place] if place != ALL else ["near", "far"])])
                 for name in "abc"} for place in SHARES_TOLD}
        for of in (RESPONSE, PERCENTILE)
    )  # fmt: skip
    for at, place in zip(heads, SHARES_TOLD, strict=True):
        head = re.split(r"\s{2,}", lines[at + 1].strip())
        assert head == ["RMS [m]", "95 % in a run [m]", "95 % of runs [m]", "lost", "misleading",
                        "covariance", "update"]  # fmt: skip
        rows = table_after(lines, at + 1)
        for row, name in zip(rows, "abc", strict=True):
            mean = np.sort(errors[place][name].mean(axis=0))
            squares = np.sqrt((errors[place][name] ** 2).mean(axis=1)).mean()
            # Of 200 runs, the 196th bounds the 95th percentile: P(Binomial(200, 0.95) < 196) > 0.95
            assert row == [name, f"{squares:#.3g}", f"{within[place][name].mean():#.3g}",
                           f"≤ {mean[195]:#.3g}", *SHARES_TOLD[place][name]]  # fmt: skip
        spread = at + 3 + len(rows)
        head = re.split(r"\s{2,}", lines[spread].strip())
        assert head == ["RMS [m] of each run", "std", "least", "median", "most",
                        "mean, 95 % interval", *["lost, 95 % interval"] * (place != ALL)]
        for row, name in zip(table_after(lines, spread), "abc", strict=True):
            mean, level = errors[place][name].mean(axis=0), told.level(place, name)
            numbers = (mean.std(ddof=1), mean.min(), np.median(mean), mean.max())
            assert row[:6] == [name, *(f"{it:#.3g}" for it in numbers),
                               f"{level['low']:#.3g} to {level['high']:#.3g}"]  # fmt: skip
            assert level["low"] < mean.mean() < level["high"]
            lost = {"near": (10, 31, 0), "far": (0, 0, 7)}.get(place)
            low, high = ("", "") if lost is None else (
                f"{100 * end:#.3g}" if end else "0"
                for end in proportion_confint(lost["abc".index(name)], RUNS, 0.05, "beta"))
            assert row[6:] == [f"{low} to {high} %"] * (lost is not None)
        verdicts_told = [line for line in lines[spread:] if line.startswith("  ")][:3]
        assert verdicts_told == [
            f"  {name}: covariance {told.level(place, name)['covariance_words']}" for name in "abc"
        ]


def test_the_tables_of_differences_have_what_is_counted(told: Tournament) -> None:
    lines = told.text(verbose=True).splitlines()
    heads = [i for i, line in enumerate(lines) if line.startswith("difference of ")]
    named = [re.split(r"\s{2,}", lines[i])[0] for i in heads]
    assert named == ["difference of RMS total error [m]",
                     "difference of total error's 95th percentile in a run [m]"] * 3  # fmt: skip
    asked = [(place, of) for place in (ALL, "near", "far") for of in (RESPONSE, PERCENTILE)]
    for at, (place, of) in zip(heads, asked, strict=True):
        places = ["near", "far"] if place == ALL else [place]
        values = {name: np.mean([told.table.loc[told.table["scenario"] == it, f"{name}.{of}"]
                                 for it in places], axis=0) for name in "abc"}  # fmt: skip
        rows = table_after(lines, at)
        for row, (one, other) in zip(rows, ("ab", "ac", "bc"), strict=True):
            less = values[one] - values[other]
            wins = int((less < 0).sum())
            sure = proportion_confint(max(wins, RUNS - wins), RUNS, 0.05 / 9, "beta")[0]
            least = int(100 * sure)
            dives = f"≥ {least} %" if wins > 100 else f"≤ {100 - least} %"
            number = [f"{it:#.3g}".replace("-", "−") for it in (np.median(less), less.mean())]
            word = "better" if wins > 100 else "worse"
            assert [*row[:4], row[5], row[7]] == [
                f"{one} − {other}", f"{wins} of 200", dives, *number, word]
            of_median, of_mean = (
                [float(end.replace("−", "-")) for end in row[i].split(" to ")] for i in (4, 6)
            )
            assert of_median[0] < np.median(less) < of_median[1]
            assert of_mean[0] < less.mean() < of_mean[1]


def test_what_the_share_of_dives_hides_is_counted_over_all_scenarios(told: Tournament) -> None:
    """Of the best only: 10 lost runs of 400 against 31 and 7; 49 misleading against 32 and 40."""
    assert "But it was lost in 10 of 400 runs. But it was misleading in 49 of 400 runs." in (
        told.answer
    )
    assert "In far, b is better than a." in told.answer
    alone = evaluate({"near": told.table[told.table["scenario"] == "near"]}, told.settings)
    assert "But it was lost in 10 of 200 runs. But it was misleading in 29 of 200 runs." in (
        alone.answer
    )
    equal = told.levels.assign(lost=10, misleading=49)  # no more often than the others
    assert "But " not in replace(told, levels=equal).answer


def test_plain_data_have_the_scenarios_and_the_tables_without_the_mean_of_all(
    told: Tournament,
) -> None:
    plain = told.to_json()
    json.dumps(plain)
    assert plain["scenarios"] == ["near", "far"]
    assert plain["receivers"] == list(told.receivers)
    assert {name: plain[name] for name in ("runs", "seed", "response", "practical", "unit")} == {
        "runs": RUNS, "seed": 1, "response": RESPONSE, "practical": 0.05, "unit": "m",
    }  # fmt: skip
    assert (plain["answer"], plain["update_s"]) == (told.answer, told.update_s)
    for name, table in (("levels", told.levels), ("differences", told.differences)):
        assert len(plain[name]) == len(table)
        for row, own in zip(plain[name], table.to_dict(orient="records"), strict=True):
            assert set(own) <= set(row)
            assert {k: v for k, v in row.items() if v is not None} == {
                k: pytest.approx(v) if isinstance(v, float) else v
                for k, v in own.items() if pd.notna(v)
            }  # fmt: skip


@pytest.mark.parametrize(("seconds", "said"), [
    (None, "–"), (2.5e-10, "~ 0.25 ns"), (0.99e-6, "~ 990 ns"), (1e-6, "~ 1.0 µs"),
    (0.99e-3, "~ 990 µs"), (1e-3, "~ 1.0 ms"), (0.99, "~ 990 ms"), (1.0, "~ 1.0 s"),
    (75.0, "~ 75 s"),
])  # fmt: skip
def test_the_time_of_an_update_has_the_unit_that_fits(seconds: float | None, said: str) -> None:
    it = evaluate({"x": runs_of({"a": noise(1, 1.0), "b": noise(2, 2.0)})}, SETTINGS,
                  {"x": {"a": seconds, "b": 3.0}})  # fmt: skip
    lines = it.text(verbose=True).splitlines()
    (at,) = (i for i, line in enumerate(lines) if line.endswith("  update"))
    assert [row[-1] for row in table_after(lines, at)] == [said, "~ 3.0 s"]
    assert "update" not in it.text()


def test_a_better_one_whose_mean_is_more_is_remarked_in_either_order() -> None:
    a = np.r_[np.full(101, 1.0), np.full(99, 3.0)]
    b = np.r_[np.full(66, 0.9), np.full(35, 5.0), np.full(99, 2.9)]
    for names in ("ab", "ba"):
        it = evaluate({"x": runs_of({name: {"a": a, "b": b}[name] for name in names})}, SETTINGS)
        assert it.receivers == ("a", "b")
        assert [line for line in it.remarks if "most runs" in line] == [
            "x: b is better than a in most runs, but its mean over the runs is 0.617 m more"
        ]
    assert not [line for line in made_up().remarks if "most runs" in line]


def test_of_receivers_that_were_in_different_scenarios_none_is_best() -> None:
    it = evaluate({"x": runs_of({"a": noise(1, 1.0)}), "y": runs_of({"b": noise(2, 2.0)})},
                  SETTINGS)  # fmt: skip
    assert it.answer == "No receiver was in all scenarios, so none is best over all."
    both = evaluate({"x": runs_of({"a": noise(1, 1.0), "b": noise(2, 2.0)}),
                     "y": runs_of({"b": noise(3, 4.0)})}, SETTINGS)  # fmt: skip
    assert both.answer == "RMS total error over 200 runs, mean of 2 scenarios: b 3.00 m."
    lines = both.text().splitlines()
    at = next(i for i, line in enumerate(lines) if line.split() == ["RMS", "[m]", "x", "y"])
    assert [line.split() for line in lines[at + 1 : at + 3]] == [
        ["b", "2.00", "4.00"], ["a", "0.997", "–"]
    ]


def test_many_others_are_counted_and_four_are_named() -> None:
    """Beyond four names three are said, and the number of the others."""
    base = np.round(1024 * noise(1, 1.0, 0.3)) / 1024  # so that each difference is always the same
    for others, said in ((4, "r1, r2, r3 and r4"), (5, "r1, r2, r3 and 2 more")):
        errors = {f"r{i}": base + i / 1024 for i in range(others + 1)}
        it = evaluate({"x": runs_of(errors)}, {**SETTINGS, "practical": 0.03})
        assert it.receivers == tuple(f"r{i}" for i in range(others + 1))
        assert it.answer.startswith(f"r0 and {said} are equal within 0.0300 m in the median. ")


def test_runs_in_which_both_are_alike_are_told_by_those_in_which_it_is_worse() -> None:
    one = noise(1, 1.0)
    other = one + np.r_[np.full(150, 0.5), np.full(30, 0.0), np.full(20, -0.25)]
    it = evaluate({"x": runs_of({"one": one, "other": other})}, SETTINGS)
    share = int(100 * proportion_confint(150, RUNS, 0.05, "beta")[0])
    assert it.answer.startswith(
        f"one is better than other. It is better in 150 of 200 runs (worse in 20): in at least "
        f"{share} % of dives (95 % confidence); 0.500 m less in the median (0.500 to 0.500 m), "
    )
    differ = evaluate({"x": runs_of({"one": one, "other": other - 0.1})}, SETTINGS)
    assert "It is better in 150 of 200 runs: in" in differ.answer


def test_the_worst_run_is_that_of_the_largest_finite_value(real: Tournament) -> None:
    """Of the best receiver, in any scenario; failed runs and the other receivers do not count."""
    best = real.receivers[0]
    column = f"{best}.{RESPONSE}"
    table = real.table.reset_index(drop=True)
    there = table.index[(table["scenario"] == "harbour-square") & (table["seed"] == 8)]
    table.loc[there, column] = 77.0
    table.loc[[0, 1], column] = [np.inf, np.nan]
    table.loc[2, f"{real.receivers[1]}.{RESPONSE}"] = 99.0
    found = worst_run(replace(real, table=table), ["ekf", "sequential"])
    assert (found.scenario.name, {*found.seeds.values()}) == ("harbour-square", {8})
    assert {"ekf", "sequential"} <= {*found.tracks}


def test_the_figure_has_the_percentiles_of_the_runs_and_the_differences(told: Tournament) -> None:
    """From the best one: second minus first; far beyond the others at the edge, with the number."""
    panels, words, unit, practical = tournament_figures.shown(told)
    assert (words, unit, practical) == ("RMS total error", "m", 0.05)
    assert [panel.place for panel in panels] == [ALL, "near", "far"]
    near = told.table[told.table["scenario"] == "near"]
    far = told.table[told.table["scenario"] == "far"]
    values = {name: near[f"{name}.{RESPONSE}"].to_numpy() for name in "abc"}
    for row, name in zip(panels[1].spread, "abc", strict=True):
        assert row == pytest.approx(np.percentile(values[name], (5, 25, 75, 95, 50)))
    less = far[f"b.{RESPONSE}"].to_numpy() - far[f"a.{RESPONSE}"].to_numpy()
    assert panels[2].verdicts == ("better", "worse")
    median, low, high = panels[2].difference[0]
    assert median == pytest.approx(np.median(less))
    assert low < median < high < 0
    axes = told.plot().axes
    for ax, panel in zip(axes[::2], panels, strict=True):
        assert ax.get_title("left") == panel.place
        thin, thick, dot = (ax.lines[i::3] for i in range(3))
        for y, (p5, p25, p75, p95, p50) in enumerate(panel.spread):
            assert thin[y].get_xydata() == pytest.approx(np.array([[p5, y], [p95, y]]))
            assert thick[y].get_xydata() == pytest.approx(np.array([[p25, y], [p75, y]]))
            assert dot[y].get_xydata() == pytest.approx(np.array([[p50, y]]))
            assert (thin[y].get_linewidth(), thick[y].get_linewidth()) == (0.9, 5)
            assert thick[y].get_color() != thin[y].get_color()
        assert ax.get_xlim()[0] == 0
        assert ax.get_ylim() == (2.5, -0.5)
    look = style.THEMES["light"]
    colours = {"worse": look.receivers[0], "better": look.receivers[2]}
    for ax, panel in zip(axes[1::2], panels, strict=True):
        marks = [line for line in ax.lines if line.get_marker() not in ("None", None)]
        for y, (line, (at, _, _), verdict) in enumerate(
            zip(marks, panel.difference, panel.verdicts, strict=True), 1
        ):
            assert line.get_xydata() == pytest.approx(np.array([[at, y]]))
            assert line.get_marker() == {"worse": "s", "better": "^"}[verdict]
            assert line.get_color() == line.get_markerfacecolor() == colours[verdict]
        (band,) = ax.patches
        assert band.get_x() == pytest.approx(-0.05)
        assert band.get_width() == pytest.approx(0.1)


@pytest.mark.parametrize(("gap", "beyond"), [(5.9, False), (6.1, True), (-6.1, True)])
def test_a_difference_far_beyond_the_others_is_at_the_edge(gap: float, beyond: bool) -> None:
    """Beyond six times the median of the differences, and one and a half times the best."""
    panel = tournament_figures.Panel(
        "x", ("best", "b", "c", "d"),
        np.array([[0.5, 0.6, 0.8, 0.9, 0.7], *[[1.0, 1.1, 1.3, 1.4, 1.2]] * 3]),
        np.array([[1.0, 0.9, 1.2], [gap, gap - 0.1, gap + 0.1], [1.0, 0.8, 1.3]]),
        ("worse", "worse", "undecided"),
    )  # fmt: skip
    ax = tournament_figures.plot_tournament([panel], "RMS", "m", 0.3)[1]
    marks = [line for line in ax.lines if line.get_marker() not in ("None", None)]
    edge = 6.0 * np.sign(gap)
    assert [float(line.get_xdata()[0]) for line in marks] == [1.0, edge if beyond else gap, 1.0]
    assert [line.get_marker() for line in marks] == [
        "s", (">" if gap > 0 else "<") if beyond else "s", "o"
    ]
    assert [text.get_text() for text in ax.texts] == [f"{gap:.3g}"] * beyond
    assert [text.get_ha() for text in ax.texts] == [["left", "right"][gap > 0]] * beyond
    near_best = replace(panel, spread=10 * panel.spread)  # 1.5 times 7 m
    ax = tournament_figures.plot_tournament([near_best], "RMS", "m", 0.3)[1]
    assert not ax.texts


def a_panel(place: str, spread: list[list[float]], differences: list[list[float]]) -> Any:
    """The first of these receivers is the best one; the others are worse."""
    names = tuple("abcdef"[: len(spread)])
    return tournament_figures.Panel(
        place, names, np.array(spread), np.array(differences).reshape(-1, 3),
        ("worse",) * len(differences),
    )  # fmt: skip


@pytest.mark.parametrize(("most", "scale"), [(99.0, "linear"), (100.0, "linear"), (101.0, "log")])
@pytest.mark.parametrize("least", [2.0, 0.0])
def test_runs_that_differ_by_more_than_fifty_times_have_a_logarithmic_axis(
    most: float, scale: str, least: float
) -> None:
    """The 5th to the 95th percentile of all receivers; one of 0 has no place on such an axis."""
    panel = a_panel("x", [[least, 2.0, 3.0, 4.0, 2.5], [3.0, 4.0, 50.0, most, 5.0]],
                    [[1.0, 0.5, 2.0]])  # fmt: skip
    left, right = tournament_figures.plot_tournament([panel], "RMS", "m")
    assert left.get_xscale() == scale
    assert right.get_xscale() == "linear"
    if scale == "linear":
        assert left.get_xlim()[0] == 0
    assert left.get_xlabel() == "RMS [m], 5 to 95 % of runs"


def test_each_receiver_has_a_row_of_the_same_height_and_a_median() -> None:
    spread = [[1.0, 1.2, 1.6, 2.0, 1.5], [2.0, 2.1, 2.5, 3.0, 2.2], [3.0, 3.5, 4.0, 6.0, 3.75]]
    both = [
        a_panel("x", spread, [[0.7, 0.5, 0.9], [2.2, 2.0, 2.5]]),
        a_panel("y", spread[:2], [[0.8, np.nan, np.nan]]),
    ]
    axes = tournament_figures.plot_tournament(both, "RMS", "", 0.25)
    figure = axes[0].figure
    assert figure.get_size_inches() == pytest.approx((7.2, 1.0 + 2 * 0.75 + 0.27 * 5))
    assert [ax.get_ylim() for ax in axes] == [(2.5, -0.5)] * 2 + [(1.5, -0.5)] * 2
    assert [[text.get_text() for text in ax.get_yticklabels()] for ax in axes[::2]] == [
        ["a", "b", "c"], ["a", "b"]
    ]
    dots = [line for line in axes[0].lines if line.get_marker() == "o"]
    assert [dot.get_xydata().tolist() for dot in dots] == [
        [[row[4], y]] for y, row in enumerate(spread)
    ]
    look = style.THEMES["light"]
    assert {(dot.get_markersize(), dot.get_markeredgewidth(), dot.get_markerfacecolor(),
             dot.get_markeredgecolor()) for dot in dots} == {(5.0, 1.2, look.paper, look.ink)}
    bars = [line for line in axes[1].lines if len(line.get_xdata()) == 2][1:]
    assert [bar.get_xydata().tolist() for bar in bars] == [
        [[0.5, 1], [0.9, 1]], [[2.0, 2], [2.5, 2]]
    ]
    assert {bar.get_linewidth() for bar in bars} == {1.6}
    marks = [line for ax in axes[1::2] for line in ax.lines if line.get_marker() == "s"]
    assert [mark.get_xydata().tolist() for mark in marks] == [[[0.7, 1]], [[2.2, 2]], [[0.8, 1]]]
    assert {mark.get_markersize() for mark in marks} == {5.5}
    assert [ax.get_xlabel().replace("\n", " ") for ax in axes[1::2]] == [
        "median difference from a, 95 % all at once", "median difference from a"
    ]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "circle: median of the runs", "thick bar: middle half of the runs",
        "thin line: 5 to 95 % of the runs", "worse than the best",
        "bar: 95 % interval of the difference", "like the best; right of it: worse",
        "grey: within ±0.25, does not matter",
    ]  # fmt: skip
    alone = tournament_figures.plot_tournament([a_panel("x", spread[:1], [])], "RMS", "m")
    assert len(alone) == 1
    assert len(alone[0].figure.legends[0].get_texts()) == 3


def test_a_mark_is_filled_where_it_is_sure_who_is_better() -> None:
    verdicts_ = ("worse", "undecided", "equal", "better")
    panel = replace(
        a_panel("x", [[1.0, 1.2, 1.6, 2.0, 1.5]] * 5, [[0.5, 0.4, 0.6]] * 4), verdicts=verdicts_
    )
    ax = tournament_figures.plot_tournament([panel], "RMS", "m")[1]
    look = style.THEMES["light"]
    marks = [line for line in ax.lines if line.get_marker() not in ("None", None)]
    drawn = [(it.get_marker(), it.get_color(), it.get_markerfacecolor()) for it in marks]
    assert drawn == [
        ("s", look.receivers[0], look.receivers[0]), ("o", look.soft, look.paper),
        ("D", look.receivers[1], look.paper), ("^", look.receivers[2], look.receivers[2]),
    ]  # fmt: skip
    (legend,) = ax.figure.legends
    texts = [text.get_text() for text in legend.get_texts()]
    told = ("worse than the best", "undecided", "equal for practical purposes", "better here")
    handles = [legend.legend_handles[texts.index(words)] for words in told]
    keys = [(it.get_marker(), it.get_color(), it.get_markerfacecolor()) for it in handles]
    assert keys == drawn


# The same under two names ------------------------------------------------------------------------


def test_the_same_scenario_under_two_names_does_not_count_twice(tmp_path: Path) -> None:
    """However it is written: what decides is what runs."""
    base = sblcosim.load("harbour-square", {"time.duration_s": 20.0})
    tables = base.given() | {"name": "copy", "title": "Another"}
    whole = tables | {"platform": tables["platform"] | {"mean_heading_deg": 0.0}}
    for other in (tables, whole):
        with pytest.raises(ConfigurationError, match=(
            "scenarios: must differ in more than their names, got the same runs as "
            "'harbour-square' and as 'copy'"
        )):  # fmt: skip
            tournament.compare([base, other], ["ekf"], runs=2)
    moved = tables | {"platform": tables["platform"] | {"mean_heading_deg": 1.0}}
    tournament.compare([base, moved], ["ekf"], runs=2, timed=False)


@pytest.mark.parametrize(
    ("idle", "working"),
    [
        ({"acoustics.outlier_mean_m": 3.0}, {"acoustics.outlier_probability": 0.02}),
        ({"target.track_tolerance_m": 0.5}, {"target.speed_m_s": 0.3}),
    ],
)
@pytest.mark.filterwarnings("ignore::sblcosim.errors.NoEffectWarning")
def test_a_key_without_effect_makes_no_other_scenario(
    idle: dict[str, float], working: dict[str, float]
) -> None:
    base = sblcosim.load("harbour-square", {"time.duration_s": 20.0})
    other = base.override([*idle.items(), ("name", "copy")])
    with pytest.raises(ConfigurationError, match="got the same runs as 'harbour-square' and as"):
        tournament.compare([base, other], ["ekf"], runs=2)
    tournament.compare([base, other.override(working.items())], ["ekf"], runs=2, timed=False)


def test_the_same_receiver_under_two_names_does_not_count_twice(tmp_path: Path) -> None:
    one, other = tmp_path / "one.fmu", tmp_path / "other.fmu"
    for path in (one, other):
        path.write_bytes(factory.build("ekf", 2).read_bytes())
    with pytest.raises(ConfigurationError, match=(
        "receivers: must differ in more than their names, got the same content as 'one' and as "
        "'other'"
    )):  # fmt: skip
        tournament.compare("harbour-square", [one, other], runs=2)
    third = tmp_path / "third.fmu"
    third.write_bytes(factory.build("ekf", 3).read_bytes())
    for pair in (["ekf", one], ["ekf", third], [one, third]):  # a build of either version
        with pytest.raises(ConfigurationError, match="receivers: must differ in more than their"):
            tournament.compare("harbour-square", pair, runs=2)
    tournament.compare("harbour-square", ["coupled", one], runs=2, overrides=SHORT, timed=False)
    for path in (one := tmp_path / "one.py", other := tmp_path / "other.py"):
        path.write_text(
            "class Mine:\n    def initialise(self, *a): ...\n    def update(self, *a): ...\n"
            "class Other(Mine):\n    pass\n", "utf-8",
        )  # fmt: skip
    with pytest.raises(ConfigurationError, match="got the same content as 'Mine' and as 'Mine_2'"):
        tournament.compare("harbour-square", [f"{one}:Mine", f"{other}:Mine"], runs=2)


def test_a_build_of_an_earlier_version_is_another_receiver(
    tmp_path: Path, seam: Seam
) -> None:
    """It may lie in the cache still; here it is today's that is said to be another one."""
    earlier, today = tmp_path / "earlier.fmu", factory.build("coupled", 2)
    earlier.write_bytes(factory.build("ekf", 2).read_bytes())
    seam.instead(factory.build, lambda *a, **k: today, only=alike)
    found = tournament.compare(
        "harbour-square", ["ekf", earlier], runs=2, overrides=SHORT, timed=False
    )
    assert found.receivers == ("ekf", "earlier")
