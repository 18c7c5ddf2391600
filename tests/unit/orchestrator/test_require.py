"""Questions and their answers: what a file says, what is run, and what is said of it."""

from __future__ import annotations

import html
import itertools
import json
import re
import shutil
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from math import isfinite
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jsonschema
import numpy as np
import pandas as pd
import pytest
import sblcosim
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex
from sblcosim import require, style
from sblcosim.analysis.advice.costs import of_levels
from sblcosim.errors import ConfigurationError
from sblcosim.fmus.build import factory
from sblcosim.judge.definitions import LOST
from sblcosim.report.common import as_toml
from sblcosim.require import figures, limiting, run, sequential
from sblcosim.require.figures import plot_front, plot_narrow
from sblcosim.require.file_schema import question_schema
from sblcosim.require.question import Question, passable
from sblcosim.require.result import Requirement, missing
from sblcosim.require.run import decided
from sblcosim.require.sequential import Elimination, Rule, looks, percentile
from sblcosim.require.tables import claimed_share
from sblcosim.require.weighing import answered
from sblcosim.results.figures.drawing import free_places
from sblcosim.results.responses import FLAGS, RESPONSES, check_limit
from sblcosim.simulation.how import How
from sblcosim.study import runner, store
from scipy import stats
from seams import Seam
from typer.testing import CliRunner

QUESTION: dict[str, Any] = {
    "name": "small",
    "title": "Which GPS, and how long a baseline?",
    "scenario": "paper-scenario-1",
    "fixed": {"time": {"duration_s": 12.0}},
    "settling_time_s": 4.0,
    "response": "total_rms_m",
    "limit": 1.0,
    "share": 0.9,
    "most_runs": 3000,
    "currency": "€",
    "choices": {
        "gps": {
            "label": "GPS", "keys": ["platform.gps_horizontal_std_m"],
            "levels": [0.1, 1.0, 3.5], "costs": [500, 100, 20],
        },
        "arm": {
            "label": "baseline", "keys": ["platform.arm_length_m"],
            "levels": [0.4, 3.0], "costs": [10, 60],
        },
    },
}  # fmt: skip


def changed(**changes: Any) -> dict[str, Any]:
    """The question with other values of some keys; None: without the key."""
    tables = {k: v for k, v in {**QUESTION, **changes}.items() if v is not None}
    json.dumps(tables)  # plain data
    return tables


def choices(name: str, **changes: Any) -> dict[str, Any]:
    """The choices with a change in one of them."""
    mine = {**QUESTION["choices"][name], **changes}
    return {**QUESTION["choices"], name: {k: v for k, v in mine.items() if v is not None}}


@pytest.fixture(autouse=True)
def _quick(seam: Seam) -> None:
    seam.tuned(limiting_runs=40)


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> tuple[Requirement, Path]:
    out = tmp_path_factory.mktemp("small")
    with Seam() as seam:
        seam.tuned(limiting_runs=40)
        return require.decide(QUESTION, out), out


def pretended(
    question: Question, share: Mapping[int, float], scale: float = 0.5, seed: int = 1,
    until_sure: bool = False, over: Mapping[int, float] | None = None,
) -> Requirement:
    """The answer if so many runs of each design were within the limit; ``over``: others by that."""
    elimination = Elimination(
        question.rule, [d.group for d in question.designs], question.terms.most_runs,
        [d.cost for d in question.designs] if until_sure else None,
    )
    values: dict[tuple[int, int], list[Any]] = {}
    while batches := elimination.batches():
        for batch in batches:
            passed = {}
            for number in elimination.counting(batch):
                rng = np.random.default_rng([seed, number, batch.condition, batch.start])
                good = rng.random(batch.stop - batch.start) < share[number]
                made = question.terms.limit * np.where(
                    good, rng.uniform(0.9, 1.0, len(good)) * (1 - scale * 0.01),
                    1 + (scale * rng.random(len(good)) if over is None else over[number]),
                )  # fmt: skip
                values.setdefault((number, batch.condition), []).append(made)
                passed[number] = int((made <= question.terms.limit).sum())
            elimination.add(batch, passed)
    return answered(question, elimination, {k: np.concatenate(v) for k, v in values.items()}, 1)


# --- Files ---------------------------------------------------------------------------------------


def test_the_shipped_question_is_what_it_says() -> None:
    question = require.load("one-metre")
    assert sblcosim.questions()["one-metre"] == question.study.title
    assert question.response == "absolute_total_p95_m"
    assert (question.terms.limit, question.terms.share) == (1.0, 0.95)
    scenario = question.study.base
    assert scenario.platform.beaufort == 4
    assert scenario.target.radius_m == 30.0
    assert scenario.receiver.type == "coupled"
    assert len(question.designs) == 48
    costs = [design.cost for design in question.designs]
    assert costs == sorted(costs)
    assert costs[0] == 30 + 60 + 20
    file = Path(str(require.__file__)).parent / "shipped" / "one-metre.toml"
    tables = tomllib.loads(file.read_text("utf-8"))
    jsonschema.validate(tables, question_schema())
    assert {"settling_time_s", "scenario"} <= set(tables)
    assert {"duration_s"} <= set(tables["scenario"]["time"])
    assert {"trajectory", "radius_m"} <= set(tables["scenario"]["target"])


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        (changed(response="total_p96_m"), "small: response: must be the name of a response, or "
         "FILE.py:FUNCTION, got 'total_p96_m'; did you mean 'total_p95_m'?"),
        (changed(response="availability"), "of which less is better"),
        (changed(choices=choices("gps", levels=[0.1, 1.0, 0.1])),
         "small: [choices.gps] levels: must have levels that differ, got 0.1 twice"),
        (changed(choices=choices("gps", costs=[1, 2])),
         "small: [choices.gps] costs: must have a cost for each of the levels 0.1, 1, 3.5, got 2"),
        (changed(choices=choices("gps", costs={"0.1": 1, "1": 2})),
         "small: [choices.gps] costs: must have one cost for each level, got none for 3.5"),
        (changed(choices=choices("gps", costs={"0.1": 1, "1": 2, "3.6": 3})),
         "must be for the levels 0.1, 1, 3.5, got '3.6'; did you mean '3.5'?"),
        (changed(choices=choices("gps", costs=[1, 2, -3])),
         "must be numbers, finite and not negative, got -3 for 3.5"),
        (changed(choices=choices("gps", costs=[1, 2, float("nan")])), "must be numbers, finite"),
        (changed(choices=choices("gps", costs=5)), "must be an array of costs, or a table by"),
        (changed(choices=choices("gps", keys=["platform.gps_horizontal_std"])),
         "[choices.gps] keys: there is no key 'platform.gps_horizontal_std'; did you mean"),
        (changed(choices=choices("gps", cost=[1, 2, 3], costs=None)),
         "small: [choices.gps] there is no key 'cost'; did you mean 'costs'?"),
        (changed(choices=choices("gps", distribution="normal")),
         "small: [choices.gps] there is no key 'distribution'"),
        (changed(choices=choices("gps", costs={"0.1": 1, "1": 2, "1.0": 5, "3.5": 3})),
         "small: [choices.gps] costs: must have one cost for each level, got 2 for 1"),
        (changed(limit=-1.0),
         "small: limit: must be more than 0 m, as the RMS total error always is, got -1"),
        (changed(limit=None, limt=1.0), "small: there is no key 'limt'; did you mean 'limit'?"),
        (changed(scenario="paper-scenario1"), "small: scenario: must be a TOML file or one of"),
        (changed(choices=choices("gps", price=[1])), "[choices.gps] there is no key 'price'"),
        (changed(choices=None), "small: choices: must have at least one, got nothing"),
        (changed(choices={}), "small: choices: must have at least one, got"),
        (changed(choices={"gps": 3}), "small: [choices.gps]: must be a table, got 3"),
        (changed(settling_time_s=None), "small: settling_time_s: must be given, got nothing"),
        (changed(settling_time_s=12.0), "settling_time_s: must be less than the length of the run"),
        (changed(limit=None), "small: limit: must be given, got nothing"),
        (changed(limits=1.0), "small: there is no key 'limits'; did you mean 'limit'?"),
        (changed(replicates=5), "small: there is no key 'replicates'"),
        (changed(share=1.0), "small: share: must be less than 1"),
        (changed(share=95), "small: share: must be less than 1"),
        (changed(confidence=0), "small: confidence: must be more than 0"),
        (changed(limit="1 m"), "small: limit: must be a number, got"),
        (changed(most_runs=0), "small: most_runs: must be at least 1, got 0"),
        (changed(scenario=None), "small: scenario: must be given, got nothing"),
        (changed(scenario="paper-scenario-9"), "paper-scenario-9"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_one_line(tables: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        decided(require.load(tables), Path("nowhere"))
    assert message in str(error.value)
    assert "\n" not in str(error.value)
    assert "factors" not in str(error.value)
    assert not Path("nowhere").exists()


def test_an_unknown_question_suggests_the_nearest() -> None:
    with pytest.raises(ConfigurationError, match="must be a TOML file or one of one-metre"):
        require.load("one-meter")


def test_a_mean_of_one_coordinate_may_be_negative() -> None:
    question = require.load(changed(response="x_mean_m", limit=-1.0))
    assert question.terms.limit == -1.0


def test_costs_by_name_and_by_order_are_the_same() -> None:
    named = require.load(
        changed(choices=choices("gps", costs={"3.5": 20, "0.1": 500, "1": 100}))
    )
    assert named.costs == require.load(QUESTION).costs


def test_the_cost_of_a_design_is_the_sum_over_its_choices() -> None:
    free = require.load(changed(choices=choices("arm", costs=None)))
    for question in (free, require.load(QUESTION)):
        for design in question.designs:
            gps = {0.1: 500, 1.0: 100, 3.5: 20}[float(design.levels["gps"])]
            arm = {0.4: 10, 3.0: 60}[float(design.levels["arm"])]
            assert design.cost == gps + (arm if question is not free else 0)
            point = question.study.points.values[design.group]
            assert point == (design.levels["gps"], design.levels["arm"])


def test_a_response_without_a_frame_is_absolute() -> None:
    assert require.load(changed(response="total_p95_m")).response == "absolute_total_p95_m"
    assert require.load(changed(response="relative_total_p95_m")).response.startswith("relative")
    assert require.load(changed(response="total_rms_m")).response == "absolute_total_rms_m"


# --- Which runs ----------------------------------------------------------------------------------

CONDITIONS = {
    "sea": {"keys": ["platform.beaufort"], "levels": [1, 4], "combine": "all"},
    "loss": {"keys": ["acoustics.loss_probability"], "levels": [0.0, 0.1, 0.25]},
}


def test_conditions_hold_one_by_one_or_count_together() -> None:
    question = require.load(changed(conditions=CONDITIONS))
    assert [*question.conditions] == [(("sea", 1),), (("sea", 4),)]
    assert question.rule.conditions == 2
    values = question.study.points.values
    for condition, sea in enumerate((1, 4)):
        places = question.places(5, condition, 0, 3000)
        assert {values[p][:3] for p in places} == {(*values[5][:2], sea)}
        shares = pd.Series([values[p][3] for p in places]).value_counts(normalize=True)
        assert shares.to_numpy() == pytest.approx(1 / 3, abs=0.03)
        # The draw of a replicate is the same in any batch.
        assert (question.places(5, condition, 700, 800) == places[700:800]).all()


def test_a_run_depends_on_its_design_condition_and_number_only() -> None:
    one = require.load(QUESTION)
    more = one.with_budget(9000)
    assert one.study.run_seed(3, 17) == more.study.run_seed(3, 17)
    assert more.terms.most_runs == 9000
    seeds = {one.study.run_seed(p, r) for p in range(1, 7) for r in range(1, 200)}
    assert len(seeds) == 6 * 199


# --- Answers -------------------------------------------------------------------------------------


def test_the_answer_of_real_runs(found: tuple[Requirement, Path]) -> None:
    answer, out = found
    chosen = answer.of(answer.named)
    assert (chosen["gps"], chosen["arm"], chosen["verdict"]) == (0.1, 3.0, "suffices")
    text = answer.answer
    assert text.startswith("The cheapest design that suffices: GPS 0.1 m, baseline 3 m, for 560 €.")
    assert "The next cheaper one worth its cost fails by" in text
    assert "It is limited most by " in text
    assert "With 95 % confidence, every claim about the 6 designs is right" in text
    assert answer.spent < 3000
    # The same from the table of runs.
    runs = store.table(out / "runs")
    assert len(runs) == answer.spent
    for number, design in enumerate(answer.question.designs):
        mine = runs[runs["point"] == design.group + 1].sort_values("replicate")
        value = mine["ekf.absolute_total_rms_m"].where(~mine["ekf.lost"].astype(bool), np.inf)
        row = answer.of(number)
        assert (row["runs"], row["passed"]) == (len(mine), (value <= 1.0).sum())
        assert row["estimate"] == np.quantile(value, 0.9, method="inverted_cdf")


def test_the_folder_of_an_answer(found: tuple[Requirement, Path]) -> None:
    answer, out = found
    names = {path.name for path in (out / "answer").iterdir()}
    assert names == {"report.html", "front.svg", "front.png", "front_narrow.svg",
                     "front_narrow.png", "designs.csv", "designs.parquet", "scenario.toml",
                     "manifest.json"}  # fmt: skip
    page = (out / "answer" / "report.html").read_text("utf-8")
    assert "sblcosim explore scenario.toml" in page
    assert answer.sentences()[0] in page
    assert "errors count from 4 s on" in page
    assert "12 s" in page
    question = page.partition("The question:")[2].partition("<code>")[2].partition("</code>")[0]
    again = require.load(tomllib.loads(html.unescape(question)))
    assert again.study.tables() == answer.question.study.tables()
    assert (again.terms, again.costs) == (answer.question.terms, answer.question.costs)
    table = pd.read_parquet(out / "answer" / "designs.parquet")
    assert len(table) == 6
    scenario = sblcosim.load(out / "answer" / "scenario.toml")
    assert scenario.platform.gps_horizontal_std_m == 0.1
    assert scenario.platform.arm_length_m == 3.0
    assert scenario.time.duration_s == 12.0
    assert scenario.target.trajectory == "semicircle"
    result = sblcosim.run(scenario)
    assert result.record.time_ns[-1] == 12_000_000_000
    # With other seeds, too: so one can see for oneself that it suffices.
    other = sblcosim.run(scenario.override({"seed": 77}))
    assert {*other.seeds.values()} == {77}
    assert not other.errors.equals(result.errors)


def test_progress_grows_and_leaves_a_rest_for_the_answer(found: tuple[Requirement, Path]) -> None:
    shares: list[float] = []
    decided(require.load(QUESTION), found[1] / "runs", How(progress=shares.append))
    assert shares == sorted(shares)
    assert shares[-1] == 0.99


@pytest.mark.parametrize(("steps", "in_lanes", "threads", "size"), [
    ((100,), True, 4, runner.BATCH), ((100, 10**9), True, 4, 1),
    ((100, 2 * runner.BATCH_STEPS // runner.BATCH), True, 1, runner.BATCH // 2),
    ((100, 100), False, 1, runner.ALONE), ((100, 100), False, 3, 3 * runner.ALONE),
])  # fmt: skip
def test_a_kill_loses_so_many_runs(
    steps: tuple[int, ...], in_lanes: bool, threads: int, size: int
) -> None:
    groups = [SimpleNamespace(steps=n, in_lanes=in_lanes or i == 0) for i, n in enumerate(steps)]
    runs: Any = range(3 * size + 1)
    campaign: Any = SimpleNamespace(groups=groups)
    how: Any = SimpleNamespace(threads=threads)
    parts = [*run.in_parts(campaign, runs, how)]
    assert [len(part) for part in parts] == [size] * 3 + [1]
    assert [place for part in parts for place in part] == [*runs]


def test_any_run_can_be_done_again(found: tuple[Requirement, Path]) -> None:
    out = found[1] / "runs"
    run = store.table(out).iloc[100]
    result = sblcosim.study.replay(out, run["run_id"])
    assert result.seeds["acoustics"] == run["seed"]




def test_none_suffices_is_an_answer() -> None:
    question = require.load(QUESTION)
    answer = pretended(question, {n: 0.3 + 0.08 * n for n in range(6)})
    assert answer.chosen is None
    text = answer.answer
    assert text.startswith("No design suffices: all 6 surely fail.")
    assert "The nearest design, " in text
    assert ", surely by " in text
    assert answer.nearest == answer.designs["estimate"].idxmin()


def test_open_is_an_answer_and_says_how_many_runs_it_takes() -> None:
    question = require.load(changed(most_runs=580))
    answer = pretended(question, dict.fromkeys(range(6), 1.0))
    assert question.rule.least == 104
    assert answer.designs["verdict"].eq("undecided").all()
    assert "At least 104 runs of a design, all of them good," in answer.answer
    assert "each of the 6 undecided ones has 96 and needs 8 more" in answer.answer
    half = pretended(require.load(changed(most_runs=3 * 96)), dict.fromkeys(range(6), 1.0))
    assert half.answer.endswith("3 were not tried: a first look at all designs takes a budget of "
                                  "576 runs.")
    assert "all 6 are undecided, 3 of them not tried." in half.answer
    assert "to say that it suffices; the undecided ones have 0 to 96." in half.answer
    assert "tried" not in answer.answer
    exact = pretended(require.load(QUESTION), {0: 0.5, 1: 0.5, 2: 0.9, 3: 0.5, 4: 0.5, 5: 0.5})
    assert "The nearest design is undecided: GPS 1 m, baseline 0.4 m" in exact.answer
    # Where all that are undecided have as many runs: what is missing of each.
    strict = require.load(changed(share=0.99, most_runs=6 * 96))
    few = pretended(strict, dict.fromkeys(range(6), 1.0))
    missing = strict.rule.least - 96
    assert f"each of the 6 undecided ones has 96 and needs {missing} more" in few.answer
    assert strict.rule.verdict(96 + missing, 96 + missing) == "suffices"


def test_the_nearest_does_not_surely_fail_while_others_are_open() -> None:
    """Even where a failing one has a smaller percentile: that one is out of the question."""
    question = require.load(changed(most_runs=4 * 96))
    over = {0: 0.2, 1: 0.1, 2: 0.5, 3: 0.4}
    open_ = pretended(question, {0: 0.6, 1: 0.6, 2: 0.86, 3: 0.86}, over=over)
    assert open_.designs["verdict"].tolist() == ["fails"] * 2 + ["undecided"] * 4
    assert open_.designs["runs"].tolist() == [96] * 4 + [0] * 2
    np.testing.assert_allclose(open_.designs["estimate"][:4], [1.2, 1.1, 1.5, 1.4])
    assert open_.nearest == 3
    failing = pretended(question, dict.fromkeys(range(4), 0.6), over=over)
    assert failing.designs["verdict"].tolist() == ["fails"] * 4 + ["undecided"] * 2
    assert failing.nearest == 1
    # Where all that were tried fail, it is said that others were not.
    tried = pretended(require.load(changed(most_runs=3 * 96)), dict.fromkeys(range(6), 0.1))
    assert tried.counts == {"suffices": 0, "fails": 3, "undecided": 3}
    assert tried.nearest < 3
    text = tried.answer
    assert "of 6, 3 fail for sure, 3 are undecided, none of them tried." in text
    assert f"The nearest design that was tried, {tried.priced(tried.nearest)}, fails by" in text
    assert "3 were not tried: a first look at all designs takes a budget of 576" in text
    least = tried.question.rule.least
    assert f"each of the 3 undecided ones has 0 and needs {least} more." in text


def test_prices_are_added_as_on_paper() -> None:
    """In binary, 0.1 + 0.2 is more than 0.3 + 0, which made one of equal cost the cheaper."""
    tables = changed(choices={
        "gps": {**QUESTION["choices"]["gps"], "levels": [0.1, 1.0], "costs": [0.1, 0.3]},
        "arm": {**QUESTION["choices"]["arm"], "costs": [0.2, 0.0]},
    })  # fmt: skip
    question = require.load(tables)
    assert [design.cost for design in question.designs] == [0.1, 0.3, 0.3, 0.5]
    answer = pretended(question, {0: 0.1, 1: 0.2, 2: 0.99, 3: 0.2})
    assert answer.chosen == 2
    assert answer.cheaper == 0


def test_a_cheaper_one_of_the_same_printed_price_is_said_to_be_so() -> None:
    gps = {**QUESTION["choices"]["gps"], "costs": [500.001, 100, 500.002]}
    question = require.load(changed(choices={"gps": gps}))
    answer = pretended(question, {0: 0.1, 1: 0.7, 2: 0.99}, scale=2.0)
    assert (answer.chosen, answer.cheaper) == (2, 1)
    assert "The next one, at the same price, fails" in answer.answer
    assert "cheaper one" not in answer.answer
    other = pretended(require.load(QUESTION), {0: 0.1, 1: 0.2, 2: 0.99, 3: 0.2, 4: 0.2, 5: 0.2})
    assert "The next cheaper one worth its cost fails" in other.answer


def test_cheaper_designs_that_stay_open_are_told() -> None:
    """One of them may suffice, too, so the chosen one is not surely the cheapest."""
    answer = at(
        pretended(require.load(QUESTION), {0: 0.1, 1: 0.2, 2: 0.1, 3: 0.99, 4: 0.3, 5: 0.99}),
        verdict=["undecided", "fails", "undecided", "suffices", "fails", "suffices"],
    )
    assert answer.chosen == 3
    beside = {0, 2} - {answer.cheaper}
    said = "2 more are" if len(beside) == 2 else "1 more is"
    assert f"Of the cheaper designs, {said} undecided." in answer.answer


def test_without_any_run_there_is_an_answer() -> None:
    answer = pretended(require.load(changed(most_runs=5)), dict.fromkeys(range(6), 1.0))
    assert answer.spent == 0
    assert answer.limits.without == {}
    assert "all 6 are undecided, none of them tried." in answer.answer
    assert "nearest" not in answer.answer
    assert f"has 0 and needs {answer.question.rule.least} more" in answer.answer
    plot_front(answer)
    assert "–" in answer.text(verbose=True, width=80)


def test_the_cheapest_that_suffices_is_chosen_and_the_next_cheaper_compared() -> None:
    question = require.load(QUESTION)
    answer = pretended(question, {0: 0.1, 1: 0.99, 2: 0.2, 3: 0.999, 4: 0.3, 5: 0.99})
    assert answer.chosen == 1
    assert answer.cheaper == 0
    assert answer.counts == {"suffices": 3, "fails": 3, "undecided": 0}
    cheap = pretended(question, dict.fromkeys(range(6), 0.99))
    assert cheap.chosen == 0
    assert "Nothing is cheaper." in cheap.answer


def test_without_costs_the_most_accurate_is_named(tmp_path: Path) -> None:
    tables = {n: {k: v for k, v in t.items() if k != "costs"}
              for n, t in QUESTION["choices"].items()}  # fmt: skip
    question = require.load(changed(choices=tables))
    answer = pretended(question, {0: 0.99, 1: 1.0, 2: 0.2, 3: 0.3, 4: 0.2, 5: 0.1}, scale=0.1)
    assert answer.chosen == answer.designs["estimate"].idxmin()
    assert answer.answer.startswith("The most accurate design that suffices: ")
    assert "cheap" not in answer.answer
    assert "cost" not in answer.text()
    answer.save(tmp_path / "answer", other="replace")
    page = (tmp_path / "answer" / "report.html").read_text("utf-8")
    assert "The most accurate designs" in page
    assert "cheap" not in page.partition("The most accurate designs")[2].partition("Method")[0]
    assert plot_front(answer).get_xlabel() == "Designs by accuracy"


def test_conditions_are_named_where_they_are_worst() -> None:
    conditions = {"sea": {**CONDITIONS["sea"], "label": "Beaufort"}}
    question = require.load(changed(conditions=conditions))
    answer = pretended(question, {0: 0.1, 1: 0.99, 2: 0.2, 3: 0.999, 4: 0.3, 5: 0.99})
    assert set(answer.designs["condition"]) <= {"Beaufort 1", "Beaufort 4"}
    assert "6 designs in 2 conditions" in answer.answer
    beaufort = int(answer.of(answer.named)["condition"].split()[-1])
    assert answer.scenario.platform.beaufort == beaufort


def test_receivers_may_be_a_choice(tmp_path: Path) -> None:
    chosen = {"keys": ["receivers"], "levels": ["ekf", "sequential"], "costs": [5, 0]}
    question = require.load(
        changed(choices={"who": chosen, "gps": QUESTION["choices"]["gps"]}, limit=2.0)
    )
    answer = require.decide(question, tmp_path)
    runs = store.table(tmp_path / "runs")
    assert len(answer.designs) == 6
    assert len(runs) == answer.spent < 6 * 96 * 6
    for number, design in enumerate(question.designs):
        mine = runs[runs["point"] == design.group + 1].sort_values("replicate")
        own = mine[f"{design.receiver}.absolute_total_rms_m"]
        lost = mine[f"{design.receiver}.lost"].astype(bool)
        row = answer.of(number)
        assert row["passed"] == ((own <= 2.0) & ~lost).iloc[: row["runs"]].sum()
    if answer.chosen is not None:
        written = sblcosim.load(tmp_path / "answer" / "scenario.toml")
        assert written.receiver.type == answer.of(answer.named)["who"]


def test_what_limits_a_design_is_what_is_large_in_it() -> None:
    scenario = sblcosim.load(
        "paper-scenario-1",
        {"platform.gps_horizontal_std_m": 3.5, "acoustics.range_std_m": 0.02,
         "time.duration_s": 12.0, "platform.imu_heading_std_deg": 0.1,
         "platform.imu_tilt_std_deg": 0.1},
    )  # fmt: skip
    about = {"name": "x", "settling_time_s": 4.0, "seed": 1}

    def mean(runs: pd.DataFrame, label: str) -> float:
        return float(runs[f"{label}.absolute_total_rms_m"].mean())

    for limit, few in ((0.5, 1), (1e-4, 0), (1e3, 0)):
        found = limiting.limiting(scenario, "ekf", about, mean, limit)
        assert next(iter(found.without)) == "the GPS"
        assert found.without["the GPS"] < 0.3 * found.everything
        assert len(found.enough) == few
    assert "the clock" not in limiting.switches(scenario)


def test_a_failed_or_lost_run_does_not_pass() -> None:
    table = pd.DataFrame({
        "a.absolute_total_rms_m": [0.5, 0.5, np.nan, 0.5, 0.5],
        "a.lost": pd.array([False, True, None, False, False], "boolean"),
        "error": [None, None, "the FMU has crashed", "a: estimates must be", "b: estimates must"],
    })  # fmt: skip
    values = passable(table, "absolute_total_rms_m", "a")
    assert (values <= 1.0).tolist() == [True, False, False, False, True]
    assert np.isinf(values[1:4]).all()


def test_a_response_that_no_receiver_has_is_refused(tmp_path: Path) -> None:
    tables = changed(response="own_relative_total_rms_m")
    with pytest.raises(ConfigurationError, match="response: must be known in some runs, got none"):
        require.decide(tables, tmp_path)


# --- Figures, the command, and its document ------------------------------------------------------


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_the_front_shows_every_design(found: tuple[Requirement, Path], theme: Any) -> None:
    answer = found[0]
    ax = plot_front(answer, theme=theme)
    drawn = np.concatenate([line.get_xydata() for line in ax.lines if line.get_marker() in "oXD"])
    finite = answer.designs[np.isfinite(answer.designs["estimate"])]
    for cost, value in finite[["cost", "estimate"]].to_numpy():
        assert any(np.allclose(point, (cost, value)) for point in drawn)
    texts = {text.get_text() for text in ax.texts}
    assert {*answer.letters.values()} == {"A", "B"} <= texts
    assert "€" in ax.get_xlabel()
    assert "[m]" in ax.get_ylabel()
    sizes = {text.get_fontsize() for text in [*ax.texts, *ax.figure.texts]}
    assert min(sizes) >= 8


def at(answer: Requirement, **columns: list[Any]) -> Requirement:
    """An answer whose designs have other values in some columns."""
    designs = answer.designs.assign(**columns)
    known = designs["estimate"].fillna(np.inf)
    designs["front"] = known < known.cummin().shift(fill_value=np.inf)
    return replace(answer, designs=designs)


@pytest.mark.parametrize("plot", [plot_front, plot_narrow])
def test_large_costs_are_not_cut_off(plot: Any) -> None:
    gps = {**QUESTION["choices"]["gps"], "costs": [1_000_000, 500, 0]}
    question = require.load(changed(choices={**QUESTION["choices"], "gps": gps}))
    ax = plot(pretended(question, dict.fromkeys(range(6), 0.5)))
    ax.figure.draw_without_rendering()
    assert 0 <= ax.get_tightbbox().x0 < ax.get_tightbbox().x1 <= ax.figure.bbox.x1


def test_room_beside_the_axes_is_for_their_labels() -> None:
    ax = plot_front(drawn_answer())
    ax.figure.draw_without_rendering()
    inch, labels = ax.figure.dpi, ax.get_tightbbox()
    assert labels.x0 / inch == pytest.approx(0.08, abs=0.02)
    assert 0.02 < (ax.figure.bbox.x1 - labels.x1) / inch < 0.2


@pytest.mark.parametrize("plot", [plot_front, plot_narrow])
def test_designs_without_a_finite_value_are_drawn_and_counted(plot: Any) -> None:
    """The legend's counts add up to those of the text, and each mark is in the picture."""
    inf, nan = float("inf"), float("nan")
    answer = at(
        pretended(require.load(QUESTION), dict.fromkeys(range(6), 0.5)),
        estimate=[inf, inf, 3.0, 2.0, nan, nan],
        verdict=["fails", "undecided", "fails", "fails", "undecided", "undecided"],
        runs=[96, 96, 96, 96, 0, 0], lower=[2.0, -inf, 2.0, 1.5, -inf, -inf], upper=[inf] * 6,
    )  # fmt: skip
    answer = replace(answer, nearest=1)
    ax = plot(answer)
    ax.figure.draw_without_rendering()
    (legend,) = ax.figure.legends
    labels = [text.get_text() for text in legend.get_texts()]
    assert "undecided (1)" in labels
    assert "not tried: not shown (2)" in labels
    unseen = legend.legend_handles[labels.index("not tried: not shown (2)")]
    assert (unseen.get_marker(), unseen.get_linestyle()) == ("None", "None")
    assert "fails (3)" in labels
    assert "beyond (2): less than 90 % end well" in labels
    assert labels.count("bar: to the sure bounds") == 1
    top = ax.get_ylim()[1]
    arrows = [line for line in ax.lines if line.get_marker() == "^" and len(line.get_xdata())]
    assert sorted(x for line in arrows for x in line.get_xdata()) == sorted(
        answer.designs["cost"][:2]
    )
    assert all(y == top for line in arrows for y in line.get_ydata())
    assert not any(line.get_clip_on() for line in arrows)  # on the edge of the axes
    (ring,) = (line for line in ax.lines if line.get_markerfacecolor() == "none")
    assert ring.get_xydata().tolist() == [[answer.of(1)["cost"], top]]
    width, height = ax.figure.get_size_inches() * ax.figure.dpi
    for artist in (legend, ax, *ax.figure.texts):
        box = artist.get_tightbbox()
        assert -1 <= box.x0 < box.x1 <= width + 1
        assert -1 <= box.y0 < box.y1 <= height + 1
    keys = [text.get_tightbbox() for text in ax.figure.texts]
    assert max(box.y1 for box in keys) <= ax.get_tightbbox().y0 < legend.get_tightbbox().y0


def drawn_answer(**changes: Any) -> Requirement:
    """One that names two of six designs, all with different numbers."""
    inf, nan = float("inf"), float("nan")
    answer = pretended(require.load(changed(**changes)), dict.fromkeys(range(6), 0.5))
    return replace(at(
        answer, estimate=[3.5, 2.9, 3.1, 1.5, 0.95, 0.9], lower=[3.0, 2.0, -inf, 1.2, 0.9, nan],
        upper=[3.75, inf, 3.3, 2.2, 0.99, inf], runs=[96, 0, 96, 300, 96, 64],
        verdict=["fails", "undecided", "fails", "undecided", "suffices", "suffices"],
    ), chosen=4, cheaper=3)  # fmt: skip


def test_designs_have_marks_by_verdict_and_bars_to_the_known_bounds() -> None:
    answer = drawn_answer()
    cost = answer.designs["cost"].tolist()
    assert cost == [30, 80, 110, 160, 510, 560]
    ax = plot_front(answer)
    colours = style.THEMES["light"].receivers
    marks = {
        (line.get_marker(), line.get_color(), line.get_markersize()): line.get_xydata().tolist()
        for line in ax.lines if line.get_marker() in "oDX" and len(line.get_xdata())
        and line.get_markerfacecolor() != "none"
    }  # fmt: skip
    assert marks == {
        ("X", colours[0], 3.5): [[30, 3.5], [110, 3.1]],
        ("D", colours[3], 3.5): [[80, 2.9]],
        ("D", colours[3], 6): [[160, 1.5]],
        ("o", colours[2], 6): [[510, 0.95], [560, 0.9]],
    }
    bars = {
        (round(float(x), 6), it.get_linewidth()[0]): (low, high)
        for it in ax.collections for (x, low), (_, high) in it.get_segments()
    }  # fmt: skip
    assert bars == {
        (30, 0.5): (3.0, 3.75), (80, 0.5): (2.0, 2.9), (110, 0.5): (3.1, 3.3),
        (160, 1.2): (1.2, 2.2), (510, 1.2): (0.9, 0.99), (560, 1.2): (0.9, 0.9),
    }
    (front,) = (line for line in ax.lines if line.get_drawstyle() == "steps-post")
    assert front.get_xydata().tolist() == [[30, 3.5], [80, 2.9], [160, 1.5], [510, 0.95],
                                           [560, 0.9]]  # fmt: skip
    (limit,) = (line for line in ax.lines if line.get_label() == "limit: 1 m")
    assert [*limit.get_ydata()] == [1.0, 1.0]
    (ring,) = (line for line in ax.lines if line.get_markerfacecolor() == "none")
    assert ring.get_xydata().tolist() == [[510, 0.95]]
    assert (ring.get_markersize(), ring.get_markeredgewidth()) == (12, 1.4)
    assert ax.get_xlim() == pytest.approx((30 - 0.06 * 530, 560 + 0.06 * 530))
    assert ax.get_ylim() == pytest.approx((0, 3.75 + 0.08 * (3.75 - 0.9)))
    assert ax.get_xlabel() == "Cost [€]"
    assert ax.get_ylabel().endswith(":\n90 % of the runs are within [m]")
    assert [text.get_text() for text in ax.figure.legends[0].get_texts()] == [
        "suffices (2)", "undecided (1)", "fails (2)", "not tried: not shown (1)",
        "bar: to the sure bounds", "no other is cheaper and better", "limit: 1 m",
    ]
    # The letter of each design is beside it, 13 points away at most.
    ax.figure.draw_without_rendering()
    letters = {text.get_text(): text for text in ax.texts}
    for letter, at_x, at_y in (("A", 510, 0.95), ("B", 160, 1.5)):
        assert letters[letter].get_position() == (at_x, at_y)
        away = letters[letter].get_transform().transform((at_x, at_y)) - ax.transData.transform(
            (at_x, at_y)
        )
        assert 6 <= 72 / ax.figure.dpi * np.hypot(*away) <= 13 * 1.2


def test_without_costs_designs_are_in_the_order_of_their_accuracy() -> None:
    free = {name: {k: v for k, v in choice.items() if k != "costs"}
            for name, choice in QUESTION["choices"].items()}  # fmt: skip
    answer = at(drawn_answer(choices=free, currency=None),
                estimate=[3.5, float("nan"), 3.1, 1.5, 3.1, 0.9])  # fmt: skip
    ax = plot_front(answer)
    marks = sorted(
        tuple(point) for line in ax.lines if line.get_marker() in "oDX"
        and line.get_markerfacecolor() != "none" for point in line.get_xydata().tolist()
    )  # fmt: skip
    assert marks == [(1, 0.9), (2, 1.5), (3, 3.1), (4, 3.1), (5, 3.5)]
    assert ax.get_xlabel() == "Designs by accuracy"
    assert not len(ax.get_xticks())
    assert not [line for line in ax.lines if line.get_drawstyle() == "steps-post"]


@pytest.mark.parametrize(("plot", "width", "characters"), [
    (plot_front, 6.4, 88), (plot_narrow, 3.7, 48),
])  # fmt: skip
def test_the_legend_is_above_the_axes_and_the_key_below_them(
    plot: Any, width: float, characters: int
) -> None:
    ax = plot(drawn_answer())
    figure = ax.figure
    figure.draw_without_rendering()
    inch = figure.dpi
    height = figure.get_figheight()
    key = [text.get_text() for text in figure.texts]
    said = " ".join(" ".join(key).replace("\u00a0", " ").split())
    answer = drawn_answer()
    assert said == (
        f"A the answer: {answer.priced(4)} B the next cheaper: {answer.priced(3)}"
    )
    assert max(map(len, key)) <= characters
    assert len(key) == (2 if plot is plot_front else 4)
    below = (len(key) + 0.6) * 0.165
    for number, text in enumerate(figure.texts):
        x, y = text.get_position()
        assert x * width == pytest.approx(0.08)
        assert y * height == pytest.approx(below - (number + 0.3) * 0.165)
    (legend,) = figure.legends
    above = legend.get_window_extent().height / inch + 0.2
    assert figure.get_size_inches() == pytest.approx([width, 4.2 + above + below])
    labels = ax.get_tightbbox()
    assert labels.x0 / inch == pytest.approx(0.08, abs=0.02)
    assert labels.y0 / inch == pytest.approx(below + 0.08, abs=0.02)
    assert height - ax.bbox.y1 / inch == pytest.approx(above)
    over = (labels.x1 - ax.bbox.x1) / inch
    assert width - ax.bbox.x1 / inch == pytest.approx(max(over + 0.04, 0.12), abs=0.02)
    assert legend.get_window_extent().x1 <= figure.bbox.x1
    assert len({round(text.get_window_extent().x0) for text in legend.get_texts()}) == (
        3 if plot is plot_front else 1
    )


def test_bars_are_in_the_key_only_if_there_are_any() -> None:
    answer = pretended(require.load(QUESTION), dict.fromkeys(range(6), 0.5))
    inf = float("inf")
    for lower, said in ((0.5, True), (-inf, False)):
        made = at(answer, estimate=[3.0] * 6, lower=[lower] * 6, upper=[inf] * 6,
                  verdict=["fails"] * 6, runs=[96] * 6)  # fmt: skip
        (legend,) = plot_front(made).figure.legends
        labels = [text.get_text() for text in legend.get_texts()]
        assert ("bar: to the sure bounds" in labels) == said


@pytest.mark.parametrize("plot", [plot_front, plot_narrow])
def test_letters_keep_off_all_points_their_bars_and_the_limit(
    plot: Any, seam: Seam
) -> None:
    given: list[np.ndarray] = []

    def places(ax: Any, points: Any, words: Any, drawn: Any) -> Any:
        given.append(drawn)
        return free_places(ax, points, words, drawn)

    seam.instead(figures.free_places, places)
    estimate, lower = [3.5, 3.2, 3.0, 2.0, 1.7, 1.0], [3.0, 2.0, 2.5, 1.5, 1.6, 0.4]
    upper = [3.6, 4.0, 3.9, 2.1, 2.7, 1.2]
    answer = at(pretended(require.load(QUESTION), dict.fromkeys(range(6), 0.5)),
                estimate=estimate, lower=lower, upper=upper)  # fmt: skip
    ax = plot(answer)
    (drawn,) = given
    for cost, low, mid, high in zip(answer.designs["cost"], lower, estimate, upper, strict=True):
        for y in (mid, low, high, (low + mid) / 2, (mid + high) / 2):
            assert np.isclose(drawn, [cost, y]).all(axis=1).any(), (cost, y)
    limit = answer.question.terms.limit
    for x in np.linspace(*ax.get_xlim(), 5):
        near = np.isclose(drawn[:, 1], limit) & (abs(drawn[:, 0] - x) < np.ptp(ax.get_xlim()) / 100)
        assert near.any()


@pytest.mark.parametrize(("ratio", "scale"), [(4.8, "linear"), (5.2, "log"), (400.0, "log")])
def test_values_that_differ_by_more_than_five_times_have_a_logarithmic_axis(
    ratio: float, scale: str
) -> None:
    answer = pretended(require.load(changed()), dict.fromkeys(range(6), 0.5))
    for least in (0.02, 3.0):
        values = least * ratio ** np.linspace(0, 1, 6)
        found = replace(answer, designs=answer.designs.assign(estimate=values))
        assert plot_front(found).get_yscale() == scale
    none = replace(answer, designs=answer.designs.assign(estimate=[0.0, *values[1:]]))
    assert plot_front(none).get_yscale() == "linear"


@pytest.mark.parametrize(("plot", "width"), [(plot_front, 6.4), (plot_narrow, 3.7)])
def test_each_design_has_the_look_of_its_verdict(plot: Any, width: float) -> None:
    """Those that suffice or are named are large; the answer has a ring."""
    verdicts = ["fails", "undecided", "suffices", "fails", "suffices", "undecided"]
    estimate, inf = [3.5, 1.2, 0.9, 2.5, 0.75, 1.05], float("inf")
    answer = at(
        pretended(require.load(QUESTION), dict.fromkeys(range(6), 0.99)), estimate=estimate,
        verdict=verdicts, runs=[96] * 6, lower=[3.0, 0.8, -inf, 2.25, -inf, 0.6],
        upper=[inf, 1.7, 0.97, inf, 0.8, 1.3],
    )  # fmt: skip
    answer = replace(answer, chosen=2, cheaper=1)
    ax = plot(answer)
    look = style.THEMES["light"]
    costs = answer.designs["cost"].tolist()
    assert costs == [30, 80, 110, 160, 510, 560]
    named, inked = {1, 2}, {"fails": ("X", 0), "undecided": ("D", 3), "suffices": ("o", 2)}
    seen = {}
    for line in ax.lines:
        if line.get_marker() in "XDo" and line.get_markerfacecolor() != "none":
            for x, y in line.get_xydata():
                seen[x, y] = (line.get_marker(), line.get_color(), line.get_markersize(),
                              line.get_markeredgewidth())
    assert seen == {
        (cost, value): (inked[verdict][0], look.receivers[inked[verdict][1]],
                        6.0 if row in named or verdict == "suffices" else 3.5, 0)
        for row, (cost, value, verdict) in enumerate(zip(costs, estimate, verdicts, strict=True))
    }
    widths = {
        segment[0, 0]: (bars.get_linewidth()[0], to_hex(bars.get_color()[0]))
        for bars in ax.collections if isinstance(bars, LineCollection)
        for segment in bars.get_segments()
    }  # fmt: skip
    assert widths == {
        cost: (1.2 if row in named or verdict == "suffices" else 0.5,
               look.receivers[inked[verdict][1]].lower())
        for row, (cost, verdict) in enumerate(zip(costs, verdicts, strict=True))
    }
    (ring,) = (line for line in ax.lines if line.get_markerfacecolor() == "none")
    assert ring.get_xydata().tolist() == [[110, 0.9]]
    assert (ring.get_markersize(), ring.get_markeredgewidth()) == (12, 1.4)
    assert (ring.get_markeredgecolor(), ring.get_clip_on()) == (look.ink, False)
    (front,) = (line for line in ax.lines if line.get_drawstyle() == "steps-post")
    better = [0, 1, 2, 4]
    assert front.get_xydata().tolist() == [[costs[row], estimate[row]] for row in better]
    (limit,) = (line for line in ax.lines if line.get_label() == "limit: 1 m")
    assert {*limit.get_ydata()} == {1.0}
    assert (limit.get_color(), limit.get_linewidth()) == (look.ink, 1.2)
    assert ax.get_ylim()[0] == 0
    assert ax.get_xlabel() == "Cost [€]"
    assert ax.get_ylabel() == "RMS total error:\n90 % of the runs are within [m]"
    (legend,) = ax.figure.legends
    assert sorted(text.get_text() for text in legend.get_texts()) == [
        "bar: to the sure bounds", "fails (2)", "limit: 1 m", "no other is cheaper and better",
        "suffices (2)", "undecided (2)",
    ]  # fmt: skip
    left, right = ax.get_xlim()
    assert (30 - left, right - 560) == pytest.approx((0.06 * 530,) * 2)
    assert [text.get_text() for text in ax.texts] == ["A", "B"]
    key = ax.figure.texts
    made, height = ax.figure.get_size_inches()
    assert made == pytest.approx(width)
    above = legend.get_window_extent().height / ax.figure.dpi
    assert height == pytest.approx(4.2 + 0.2 + above + 0.165 * (len(key) + 0.6), abs=0.01)
    ups = [text.get_position()[1] * height for text in key]
    assert ups == pytest.approx([0.165 * (len(key) + 0.3 - row) for row in range(len(key))])
    assert [text.get_position()[0] * width for text in key] == pytest.approx([0.08] * len(key))
    longest = 48 if plot is plot_narrow else 88
    assert max(len(text.get_text()) for text in key) <= longest
    assert ("     " in key[1].get_text()[:5]) == (plot is plot_narrow)


def test_without_costs_the_places_are_those_of_the_accuracy() -> None:
    tables = {n: {k: v for k, v in t.items() if k != "costs"}
              for n, t in QUESTION["choices"].items()}  # fmt: skip
    made = pretended(require.load(changed(choices=tables)), dict.fromkeys(range(6), 0.5))
    estimate = [1.5, 1.2, np.nan, 2.5, 1.2, 1.1]
    ax = plot_front(at(made, estimate=estimate, runs=[96, 96, 0, 96, 96, 96]))
    drawn = sorted(
        (x, y) for line in ax.lines if line.get_marker() in "XDo"
        and line.get_markerfacecolor() != "none" for x, y in line.get_xydata()
    )  # fmt: skip
    assert drawn == [(1, 1.1), (2, 1.2), (3, 1.2), (4, 1.5), (5, 2.5)]
    assert not ax.get_xticks().size
    assert not [line for line in ax.lines if line.get_drawstyle() == "steps-post"]


def test_the_front_names_the_answer_and_the_next_cheaper_alone() -> None:
    """However many designs fail; those are small, and without a name."""
    levels = [0.1 * n for n in range(1, 21)]
    gps = {**QUESTION["choices"]["gps"], "levels": levels,
           "costs": [*range(220, 20, -10)]}  # fmt: skip
    question = require.load(changed(choices={**QUESTION["choices"], "gps": gps}, most_runs=10_000))
    answer = pretended(question, dict.fromkeys(range(40), 0.2) | {35: 1.0})
    assert answer.chosen == 35
    ax = plot_front(answer)
    assert [text.get_text() for text in ax.texts] == ["A", "B"]
    key = " ".join(text.get_text() for text in ax.figure.texts).replace("\u00a0", " ")
    assert f"A  the answer: {answer.priced(35)}" in key
    assert f"B  the next cheaper: {answer.priced(answer.cheaper or 0)}" in key
    sizes = {
        x: line.get_markersize() for line in ax.lines if line.get_marker() in "oX"
        for x, y in line.get_xydata() if line.get_markerfacecolor() != "none"
    }  # fmt: skip
    large = {x for x, size in sizes.items() if size > 4}
    assert large == {answer.of(row)["cost"] for row in (35, answer.cheaper)}
    none = pretended(question, dict.fromkeys(range(40), 0.2))
    assert [*none.roles.values()] == ["the nearest"]
    assert len(plot_front(none).texts) == 1


def test_what_decides_is_first_in_the_table(found: tuple[Requirement, Path]) -> None:
    head, rows = found[0].table(found[0].designs)
    assert head == ["GPS · baseline", "verdict", "90 % within [m]", "cost", "within 1 m",
                    "surely [m]", "runs"]  # fmt: skip
    assert len({len(row) for row in rows}) == 1
    row = rows[found[0].named]
    assert row[0].startswith("A  0.1 m · 3 m")
    assert row[1] == "suffices"
    assert row[3] == "560 €"
    assert row[6] == f"{found[0].of(found[0].named)['runs']:,}"


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from sblcosim.cli import app

    monkeypatch.chdir(tmp_path)
    Path("small.toml").write_text(as_toml(QUESTION), "utf-8")
    jsonschema.validate(tomllib.loads(Path("small.toml").read_text("utf-8")), question_schema())
    result = CliRunner().invoke(app, ["require", "small.toml", "--json"])
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    assert told["designs"][told["chosen"]]["levels"] == {"gps": 0.1, "arm": 3.0}
    assert Path(told["scenario"]).exists()
    assert Path(told["report"]).exists()
    again = CliRunner().invoke(app, ["require", "small.toml", "--most-runs", "50", "--out", "few"])
    assert again.exit_code == 1
    assert "No design surely suffices: all 6 are undecided, none of them tried." in again.stdout
    wrong = CliRunner().invoke(app, ["require", "small.toml", "--most-runs", "0"])
    assert wrong.exit_code == 2


@pytest.mark.parametrize("receiver", ["coupled", "sequential", "multilateration"])
def test_a_named_receiver_leaves_the_keys_of_others_behind(receiver: str) -> None:
    """The paper's scenario has keys that only its own receiver takes."""
    base = sblcosim.load("paper-scenario-1", {"time.duration_s": 5.0})
    levels = ["ekf", "coupled", "sequential", "multilateration"]
    answer = pretended(
        require.load(changed(
            choices={"who": {"keys": ["receivers"], "levels": levels}}, settling_time_s=0.0,
            fixed={"time.duration_s": 5.0},
        )),
        {number: float(level == receiver) for number, level in enumerate(levels)},
    )  # fmt: skip
    named = answer.scenario
    assert answer.of(answer.chosen)["who"] == named.receiver.type == receiver
    alone = sblcosim.run(named, receiver)
    beside = sblcosim.run(base, ["ekf", receiver])
    pd.testing.assert_frame_equal(alone.errors.loc[[receiver]], beside.errors.loc[[receiver]])


def test_a_folder_of_another_question_is_refused_with_what_to_do(tmp_path: Path) -> None:
    choices = {"gps": {"keys": ["platform.gps_horizontal_std_m"], "levels": [0.1, 1.0]}}
    tables: dict[str, Any] = {
        "name": "x", "scenario": "paper-scenario-1", "response": "total_rms_m", "limit": 50.0,
        "settling_time_s": 0.0, "fixed": {"time.duration_s": 3.0}, "choices": choices,
    }  # fmt: skip
    require.decide(tables, tmp_path / "x")
    choices["gps"]["levels"] = [0.1, 2.0]
    with pytest.raises(ConfigurationError, match=r"with other factors; answer into another folder"):
        require.decide(tables, tmp_path / "x")


def test_a_question_and_a_study_are_told_apart() -> None:
    with pytest.raises(ConfigurationError, match=r"choices in a question .*'sblcosim study'"):
        require.load({"factors": {}, "scenario": "paper-scenario-1"})
    with pytest.raises(ConfigurationError, match=r"factors in a study .*'sblcosim require'"):
        sblcosim.study.load({**QUESTION})


def test_costs_may_be_written_as_the_levels_are() -> None:
    costs = of_levels("x", {"0.1": 1, "1.0": 2, "3.50": 3}, (0.1, 1.0, 3.5))
    assert costs == {0.1: 1.0, 1.0: 2.0, 3.5: 3.0}
    with pytest.raises(ConfigurationError, match=r"got none for 3\.5"):
        of_levels("x", {"0.1": 1, "1.0": 2}, (0.1, 1.0, 3.5))


# --- What is sure, and what is not ---------------------------------------------------------------


@pytest.mark.parametrize(
    ("passed", "runs"),
    [(1851, 2056), (9, 10), (900, 1000), (1850, 2056), (1800, 2056), (1900, 2056)],
)
def test_what_is_missing_to_decide_is_true(passed: int, runs: int) -> None:
    """Each number of runs that is said would decide it, and none before does."""
    rule = Rule(0.9, 0.05, 6, 2)
    text = missing(rule, passed, runs)
    shares = [passed / runs]
    if "too close" in text:
        for n in (10**3, 10**4):
            assert rule.verdict(passed * n // runs, n) == "undecided"
        # Clopper and Pearson's interval, by the quantiles of the beta distribution.
        low = stats.beta.ppf(0.025, passed, runs - passed + 1)
        high = stats.beta.ppf(0.975, passed + 1, runs - passed)
        assert f"anything from {100 * low:.4g} % to {100 * high:.4g} % (95 % interval)" in text
        shares, text = [low, high], text.partition("At these ends, ")[2]
    told = [int(n.replace(",", "")) for n in re.findall(r"\b\d[\d,]*", text)]
    assert len(told) == len(shares)
    for n, share in zip(told, shares, strict=True):
        assert rule.verdict(int(share * n), n) != "undecided"
        before = itertools.takewhile(n.__gt__, looks())
        assert all(rule.verdict(int(share * m), m) == "undecided" for m in before if m > runs)


SIDES = [(1824, 9456), (1825, 10400), (1838, 47768), (1852, 3165688), (1874, 10400), (1875, 9456)]


@pytest.mark.parametrize(("passed", "needed"), SIDES)
def test_more_than_10_000_runs_are_not_asked_for(passed: int, needed: int) -> None:
    """On both sides of the limit, for shares below and above the required one."""
    rule = Rule(0.9, 0.05, 6, 2)
    assert rule.runs_to_decide(passed, 2056) == needed
    text = missing(rule, passed, 2056)
    if needed <= 10_000:
        assert text == f"At this share, {needed:,} runs of it would decide."
    else:
        assert text.startswith(
            "This share is too close to the required one to decide with any practical number of "
            "runs (10,000)."
        )


@pytest.mark.parametrize("seed", range(10))
def test_no_number_above_10_000_is_said(seed: int) -> None:
    rng = np.random.default_rng(seed)
    share, runs = rng.uniform(0.5, 0.99), int(rng.integers(96, 9000))
    passed = int(np.clip(round(runs * rng.normal(share, 0.01)), 0, runs))
    rule = Rule(share, 0.05, int(rng.integers(1, 20)), 2)
    text = missing(rule, passed, runs)
    told = re.findall(r"([\d,]+)(?: or ([\d,]+))? runs (?:of it )?would", text)
    assert told or "practical" in text
    assert all(int(n.replace(",", "")) <= 10_000 for both in told for n in both if n)


def test_undecided_designs_have_intervals_of_the_confidence_that_is_said() -> None:
    """All bounds of them together have the risk that the sentence names, both sides at once."""
    question = require.load(changed(conditions=CONDITIONS))
    answer = pretended(question, {0: 0.1, 1: 0.9, 2: 0.2, 3: 0.999, 4: 0.9, 5: 0.99})
    rule, risk = question.rule, 0.05
    undecided = answer.designs[answer.designs["verdict"] == "undecided"]
    assert len(undecided)
    arms = answer.arms[answer.arms["verdict"] == "undecided"]
    each = risk / (2 * 6 * 2)  # two sides, six designs, two conditions
    assert rule.risk == pytest.approx(risk)
    for row in arms.itertuples():
        few, many = (f(row.runs, 0.9, each) for f in (sequential.too_few, sequential.enough))
        # Of the responses, whose ranks are known: as many are at most a bound as its rank says.
        assert sequential.evidence(few, row.runs, 0.9, above=False) >= -np.log(each)
        assert sequential.evidence(few + 1, row.runs, 0.9, above=False) < -np.log(each)
        assert sequential.evidence(many, row.runs, 0.9, above=True) >= -np.log(each)
        assert row.lower <= row.estimate <= row.upper
    values = np.arange(1.0, 501.0)
    _, low, high = percentile(values, rule, decided=False)
    assert (low, high) == (
        1 + sequential.too_few(500, 0.9, each), sequential.enough(500, 0.9, each)
    )
    _, lower, upper = percentile(values, rule)
    assert low <= lower <= upper <= high
    assert low < lower
    assert high > upper
    assert "Of undecided designs both hold, of all of them together" in answer.text(verbose=True)


def test_an_undecided_condition_is_worse_than_one_that_suffices() -> None:
    """Whatever the percentiles are: what is not sure in it is not sure of the design."""
    question = require.load(changed(conditions=CONDITIONS))
    runs, far, near = 200, np.linspace(0.5, 0.99, 200), np.linspace(0.1, 0.2, 200)
    near[:15] = 2.0
    values, done = {}, Elimination(question.rule, [d.group for d in question.designs], 10**6)
    for number in range(6):
        for condition, made in ((0, far), (1, near)):
            values[number, condition] = made
            done.runs[question.designs[number].group, condition] = runs
            done.seen[number, condition] = runs
            done.passed[number, condition] = int((made <= 1.0).sum())
    assert [done.arm(0, c) for c in (0, 1)] == ["suffices", "undecided"]
    found = answered(question, done, values, 1)
    assert set(found.designs["verdict"]) == {"undecided"}
    assert set(found.designs["condition"]) == {found.arms["condition"][1]}
    assert (found.designs["estimate"] < 0.25).all()
    done.passed[:, 1] = 100
    failing = answered(question, done, values, 1)
    assert set(failing.designs["verdict"]) == {"fails"}
    assert set(failing.designs["condition"]) == {found.arms["condition"][1]}


@pytest.mark.parametrize("response", ["absolute_total_p95_m", "lost"])
def test_bounds_of_a_design_hold_in_each_condition(response: str) -> None:
    """The condition with the largest estimate is named, and another one may have a larger bound."""
    flag = {"response": response, "limit": 0} if response == "lost" else {}
    question = require.load(changed(conditions=CONDITIONS, **flag))
    names, others = [question.named(dict(it)) for it in question.conditions], 0
    for runs in ((2_000, 250), (250, 2_000), (400, 400)):
        values, done = {}, Elimination(question.rule, [d.group for d in question.designs], 10**6)
        for number in range(6):
            for condition in (0, 1):
                rng, n = np.random.default_rng([number, condition]), runs[condition]
                made = 1.1 * question.terms.limit * rng.random(n) ** (0.2 + 0.2 * number)
                if flag:
                    made = (rng.random(n) < 0.05 * number).astype(float)
                values[number, condition] = made
                done.runs[question.designs[number].group, condition] = n
                done.seen[number, condition] = n
                done.passed[number, condition] = int((made <= question.terms.limit).sum())
        found = answered(question, done, values, 1)
        assert found.designs["verdict"].nunique() > 1
        for number, row in found.designs.iterrows():
            arms = found.arms[found.arms["design"] == number]
            assert (row["lower"], row["upper"]) == (arms["lower"].max(), arms["upper"].max())
            low, high = (arms[f"share_{end}"].fillna(none) for end, none in
                         (("lower", 0.0), ("upper", 1.0)))
            np.testing.assert_array_equal(
                [row["share_lower"], row["share_upper"]],
                [low.min() if low.min() > 0 else np.nan, high.min() if high.min() < 1 else np.nan])
            own = arms[arms["condition"] == row["condition"]].iloc[0]
            ends = ("share_lower", "share_upper") if flag else ("lower", "upper")
            others += any(own[end] != row[end] and np.isfinite(row[end]) for end in ends)
            keys = ["verdict", "estimate"]
            alike = arms[(arms[keys] == own[keys]).all(axis=1)]
            assert own["passed"] / own["runs"] == (alike["passed"] / alike["runs"]).min()
            assert row["condition"] in names
    assert others


def test_what_limits_a_design_is_found_on_the_same_noise() -> None:
    tables = []

    def seen(runs: pd.DataFrame, label: str) -> float:
        tables.append(runs)
        return float(runs[f"{label}.absolute_total_rms_m"].mean())

    scenario = sblcosim.load("paper-scenario-1", {"time.duration_s": 8.0})
    about = {"name": "x", "settling_time_s": 2.0, "seed": 7}
    limiting.limiting(scenario, "ekf", about, seen, 1e-6)
    assert len(tables) > len(limiting.switches(scenario)) + 1
    for runs in tables:
        assert runs["seed"].tolist() == list(range(7, 7 + limiting.RUNS))


@pytest.mark.parametrize(
    ("without", "enough", "words_"),
    [
        ({"a": 0.5, "b": 1.2, "c": 2.0}, ("a",), "It would suffice without a alone."),
        ({"a": 0.5, "b": 0.9, "c": 2.0}, ("a",), "It would suffice without any one of a and b."),
        ({"a": 0.5, "b": 0.8, "c": 1.0}, ("a",), "It would suffice without any one of a, b and c."),
        ({"a": 1.5, "b": 1.7, "c": 2.0}, ("a", "b"),
         "It would suffice without a and b together, but not without one of them alone."),
        ({"a": 1.5, "b": 1.7}, (), "It would not suffice even without all of them."),
    ],
)  # fmt: skip
def test_errors_without_which_it_would_do_are_alone_or_together(
    without: dict[str, float], enough: tuple[str, ...], words_: str
) -> None:
    answer = pretended(require.load(QUESTION), dict.fromkeys(range(6), 0.3))
    found = replace(answer, limits=limiting.Limiting(2.5, without, enough))
    assert found.limited().endswith(words_)


def test_the_answer_ends_when_it_is_sure() -> None:
    """The same design is named, with fewer runs; those of the same price go on."""
    shares = {0: 0.1, 1: 0.8, 2: 0.99, 3: 0.91, 4: 0.9, 5: 0.92}
    question = require.load(changed(most_runs=200_000))
    whole = pretended(question, shares)
    ended = pretended(question, shares, until_sure=True)
    assert ended.chosen == whole.chosen == 2
    assert ended.spent < whole.spent
    cheaper = [*range(3)]
    pd.testing.assert_frame_equal(ended.designs.loc[cheaper], whole.designs.loc[cheaper])
    assert (ended.designs["runs"] < whole.designs["runs"])[3:].all()
    left = int((ended.designs["verdict"] == "undecided").sum())
    assert left == 3
    assert "3 dearer designs were left undecided." in ended.answer
    assert "dearer" not in whole.answer
    free = require.load(changed(choices={
        name: {k: v for k, v in table.items() if k != "costs"}
        for name, table in QUESTION["choices"].items()
    }))  # fmt: skip
    every = [pretended(free, shares, until_sure=until) for until in (False, True)]
    pd.testing.assert_frame_equal(every[0].designs, every[1].designs)


def test_an_answer_that_ends_when_it_is_sure_counts_the_runs_that_are_there(
    tmp_path: Path,
) -> None:
    """A dear design is near the limit, and would go on when a cheaper one suffices."""
    asked = require.load(changed(limit=2.6, most_runs=2000))
    ended = require.decide(asked, tmp_path / "ended", until_sure=True)
    assert "1 dearer design was left undecided." in ended.answer
    once_more = require.decide(asked, tmp_path / "ended", until_sure=True)
    pd.testing.assert_frame_equal(once_more.designs, ended.designs)
    whole = require.decide(asked, tmp_path / "ended")
    assert whole.spent > ended.spent
    assert whole.chosen == ended.chosen
    again = require.decide(asked, tmp_path / "ended", until_sure=True)
    pd.testing.assert_frame_equal(again.designs, whole.designs)
    assert again.spent == whole.spent == len(store.table(tmp_path / "ended" / "runs"))


def test_an_answer_without_costs_leaves_none_alone_and_says_so() -> None:
    free = require.load(changed(most_runs=2000, choices={
        name: {k: v for k, v in table.items() if k != "costs"}
        for name, table in QUESTION["choices"].items()
    }))  # fmt: skip
    said = "No design was skipped as dearer, because none has a cost."
    for until_sure in (False, True):
        answer = pretended(free, dict.fromkeys(range(6), 0.99), until_sure=until_sure)
        assert (said in answer.answer) == until_sure


@pytest.mark.parametrize("conditions", [None, CONDITIONS])
def test_of_a_decided_design_only_the_end_of_its_claim_is_drawn_and_written(
    tmp_path: Path, conditions: dict[str, Any] | None
) -> None:
    question = require.load(changed(conditions=conditions, most_runs=6000))
    answer = pretended(question, {0: 0.75, 1: 0.9, 2: 0.8, 3: 0.97, 4: 0.9, 5: 0.98})
    assert set(answer.designs["verdict"]) == {"suffices", "fails", "undecided"}
    answer.save(tmp_path / "a", other="replace")
    tables = [answer.designs, answer.arms, pd.read_parquet(tmp_path / "a" / "designs.parquet")]
    if conditions:
        tables.append(pd.read_parquet(tmp_path / "a" / "conditions.parquet"))
    for table in tables:
        for row in table.itertuples():
            ends = np.isfinite([row.lower, row.upper]).tolist()
            assert ends == {
                "suffices": [False, True], "fails": [True, False], "undecided": [True, True],
            }[row.verdict]  # fmt: skip
    drawn = sorted(
        tuple(sorted(segment[:, 1]))
        for lines in plot_front(answer).collections if isinstance(lines, LineCollection)
        for segment in lines.get_segments()
    )
    expected = sorted(
        (row.lower if np.isfinite(row.lower) else row.estimate,
         row.upper if np.isfinite(row.upper) else row.estimate)
        for row in answer.designs.itertuples()
    )  # fmt: skip
    assert np.array(drawn) == pytest.approx(np.array(expected))


@pytest.mark.parametrize(
    ("everything", "without", "said"),
    [
        (2.5, {"a": 0.5, "b": 1.2, "c": 2.6}, "It is limited most by a: in 40 other runs, 90 % are "
         "within 2.5 m with all errors, and 90 % would be within 0.5 m without this one, 1.2 m "
         "without b."),
        (np.inf, {"a": 0.7, "b": np.inf}, "It is limited most by a: in 40 other runs, fewer than "
         "90 % end well with all errors, and 90 % would be within 0.7 m without this one."),
        (0.9, {"a": 0.9, "b": 1.2}, "No error alone limits it: in 40 other runs, 90 % are within "
         "0.9 m with all errors, and no less without any one of them."),
        (np.inf, {"a": np.inf, "b": np.inf}, "No error alone limits it: in 40 other runs, fewer "
         "than 90 % end well with all errors, and no less without any one of them."),
        (np.nan, {}, ""),
    ],
)  # fmt: skip
def test_what_limits_a_design_is_beside_the_runs_with_all_errors(
    everything: float, without: dict[str, float], said: str
) -> None:
    answer = pretended(require.load(QUESTION), dict.fromkeys(range(6), 0.999))
    assert answer.chosen is not None
    found = replace(answer, limits=limiting.Limiting(everything, without, ()))
    assert found.limited() == said


def test_of_a_design_of_which_too_many_are_lost_no_distance_is_said() -> None:
    answer = pretended(require.load(QUESTION), dict.fromkeys(range(6), 0.3))
    designs = answer.designs.assign(estimate=np.inf)
    for lower, bound in ((2.0, ", and 90 % are surely not within less than 2 m."), (-np.inf, ".")):
        lost = replace(answer, designs=designs.assign(lower=lower))
        assert f"fewer than 90 % end well{bound}" in lost.answer
        for text in (lost.text(), lost.text(verbose=True)):
            assert "a loss" not in text
            assert text.count(LOST) == 1
    for text in (answer.text(), answer.text(verbose=True)):
        assert text.count("What 90 % are within is an order statistic: of n runs, the one of") == 1
    assert LOST not in answer.text()


def test_runs_that_are_there_count_whatever_the_budget_is(
    found: tuple[Requirement, Path], tmp_path: Path
) -> None:
    before, folder = found
    shutil.copytree(folder, tmp_path / "again")
    for budget in (1, 96, before.spent - 1, before.spent):
        again = require.decide(QUESTION, tmp_path / "again", most_runs=budget)
        pd.testing.assert_frame_equal(again.designs, before.designs)
        said = f"The answer took {before.spent:,} runs: the budget of {budget:,} does not include"
        assert (said in again.answer) == (budget < before.spent)
    assert len(store.table(tmp_path / "again" / "runs")) == before.spent
    fresh = require.decide(QUESTION, tmp_path / "fresh", most_runs=2 * 96)
    assert fresh.spent == 2 * 96


def test_a_budget_that_is_kept_does_not_depend_on_what_is_there(tmp_path: Path) -> None:
    """Runs beyond it count only if they are there: a part of a batch is no reason for the rest."""
    asked = require.load(changed(most_runs=3 * 96))
    whole, _ = decided(asked, tmp_path / "whole")
    lost = sorted((tmp_path / "whole" / "parts").glob("*.parquet"))
    for part in lost[1::2]:
        part.unlink()
    again, _ = decided(asked, tmp_path / "whole")
    assert again.runs.tolist() == whole.runs.tolist()
    assert again.spent == 3 * 96


def test_the_report_has_the_conditions(tmp_path: Path) -> None:
    conditions = {
        "sea": {**CONDITIONS["sea"], "label": "Beaufort"},
        "loss": {"label": "packet loss", "keys": ["acoustics.loss_probability"],
                 "levels": [0.0, 0.3]},
    }  # fmt: skip
    question = require.load(changed(conditions=conditions))
    answer = pretended(question, {0: 0.1, 1: 0.99, 2: 0.2, 3: 0.999, 4: 0.3, 5: 0.99})
    folder = answer.save(tmp_path, other="replace")
    page = html.unescape((folder / "report.html").read_text("utf-8"))
    part = page.partition('id="conditions"')[2].partition("<section")[0]
    for text in ("Beaufort", "1, 4", "a design must suffice in each of them", "packet loss",
                 "0, 0.3", "each run is in one of them, drawn at random"):  # fmt: skip
        assert text in part
    assert "in each of 2 conditions" in page
    for row in answer.arms[answer.arms["design"].isin([*answer.roles])].itertuples():
        cells = [row.condition, row.verdict, f"{row.passed}", f"{row.runs}"]
        assert re.search(".*?".join(f">{cell}<" for cell in cells), part, re.DOTALL)
    table = pd.read_csv(tmp_path / "conditions.csv")
    assert len(table) == 6 * 2
    assert table["passed"].tolist() == answer.arms["passed"].tolist()
    assert table["gps"].tolist() == [x for x in answer.designs["gps"] for _ in range(2)]
    alone = pretended(require.load(QUESTION), dict.fromkeys(range(6), 0.3))
    plain = alone.save(tmp_path / "plain")
    assert "Conditions" not in (plain / "report.html").read_text("utf-8")
    assert not (plain / "conditions.csv").exists()


def test_without_runs_there_is_no_chart(tmp_path: Path) -> None:
    answer = pretended(require.load(changed(most_runs=95)), dict.fromkeys(range(6), 1.0))
    folder = answer.save(tmp_path, other="replace")
    assert not [*folder.glob("front*")]
    page = (folder / "report.html").read_text("utf-8")
    assert "<svg" not in page
    assert "6 were not tried" in page
    assert "no design was tried" in [text.get_text() for text in plot_front(answer).texts]
    few = pretended(require.load(changed(most_runs=96)), dict.fromkeys(range(6), 1.0))
    assert few.spent == 96
    folder = few.save(tmp_path / "few", other="replace")
    assert "<svg" in (folder / "report.html").read_text("utf-8")


@pytest.mark.parametrize("name", sorted(RESPONSES))
def test_a_limit_that_no_run_can_be_within_is_refused(name: str) -> None:
    signed = name.endswith(("_x_mean_m", "_y_mean_m", "_z_mean_m"))
    none = name in FLAGS or name.startswith("beyond_claim")
    for limit, taken in ((-1.0, signed), (0.0, signed or none), (1e-9, True)):
        if taken:
            check_limit("limit", limit, name)
        else:
            with pytest.raises(ConfigurationError, match=r"limit: must be (more than|at least) 0"):
                check_limit("limit", limit, name)


def test_a_limit_of_0_is_refused_where_it_is_asked_for(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"^small: limit: must be more than 0 m, as the R"):
        require.load(changed(limit=0))
    require.load(changed(limit=0, response="lost"))


def test_a_design_that_is_named_though_another_one_beats_it_is_said_to_be() -> None:
    """A cheaper one that is not yet sure to suffice may have runs that are as good."""
    answer = pretended(require.load(changed()), dict.fromkeys(range(6), 1.0))
    assert "beats in cost and accuracy:" in answer.text()
    beaten = replace(answer, designs=answer.designs.assign(front=False))
    assert "beats in cost and accuracy, and those named above:" in beaten.text()
    assert "All designs:" in beaten.text(verbose=True)


@pytest.mark.parametrize("flag", FLAGS)
def test_a_limit_other_than_0_is_refused_where_a_run_is_something_or_not(flag: str) -> None:
    for limit in (0.05, 0.99, 1.0, 3.0):
        with pytest.raises(ConfigurationError, match=rf"limit: must be 0, as a run is {flag}"):
            require.load(changed(limit=limit, response=flag))
    assert require.load(changed(limit=0, response=flag)).flag == flag


@pytest.mark.parametrize(("share", "levels"), [
    (0.01, [0.1, 1.0, 3.5]), (0.99, [0.1, 1.0, 3.5]), (0.99, [1.0, 2.0, 3.5]),
])  # fmt: skip
def test_an_answer_on_what_a_run_is_or_is_not_speaks_of_no_size(
    share: float, levels: list[float], tmp_path: Path, seam: Seam
) -> None:
    """Half a minute of the paper's filter is misleading in some runs."""
    seam.tuned(limiting_runs=40)
    answer = require.decide(changed(
        response="misleading", limit=0, share=share, most_runs=1500,
        fixed={"time": {"duration_s": 30.0}}, choices=choices("gps", levels=levels),
    ), tmp_path / "answer")  # fmt: skip
    page = (answer.save(tmp_path / "report") / "report.html").read_text("utf-8")
    assert "<svg" not in page
    assert 0 < answer.designs["passed"].sum() < answer.designs["runs"].sum()
    for text in (answer.text(), answer.text(verbose=True), page):
        assert "misleading" in text
        for size in ("% within", "are within", "be within", "within 0"):
            assert size not in text
    assert any("The upper bounds of all designs that fail hold" in it for it in answer.notes())
    for row in answer.designs.to_dict(orient="records"):
        low, high = claimed_share(row["passed"], row["runs"], answer.question.rule, row["verdict"])
        assert isfinite(low) or row["verdict"] != "suffices"
        assert isfinite(high) or row["verdict"] != "fails"
        np.testing.assert_array_equal([row["share_lower"], row["share_upper"]], [low, high])
    head, rows = answer.table(answer.designs)
    assert "not misleading" in head
    assert {len(row) for row in rows} == {len(head)}
    # What limits a design is only asked where one must be better.
    limited = "in 40 other runs, fewer than 99 % are not misleading with all errors"
    assert (limited in answer.text().replace("\n  ", " ")) is (answer.chosen is None)
    assert (answer.chosen is None) is (levels[0] == 1.0)


@pytest.mark.parametrize("everything", [1.0, np.inf])
def test_only_what_is_enough_limits_a_run_that_is_something_or_not(everything: float) -> None:
    question = require.load(changed(response="lost", limit=0))
    answer = pretended(question, dict.fromkeys(range(6), 0.0))
    without = {"the GPS": 0.0, "the tilt": 1.0, "the heading": 0.0, "the sea": everything}
    told = replace(answer, limits=limiting.Limiting(everything, without, ())).limited()
    assert re.match(r"It is limited most by the GPS: in \d+ other runs, fewer than 90 % ", told)
    assert told.endswith(", and 90 % would not be lost without this one or without the heading.")


def test_a_question_may_be_moved_with_its_files(tmp_path: Path, seam: Seam) -> None:
    """What its files hold decides, not where they are or how the question is named."""
    seam.tuned(limiting_runs=2)  # a function of the user's takes its runs one by one
    here, there = tmp_path / "here", tmp_path / "elsewhere" / "deep"
    here.mkdir()
    here.joinpath("own.py").write_text("def spread(run):\n    return 0.5\n", "utf-8")
    shutil.copy(factory.build("ekf", 2), here / "mine.fmu")
    here.joinpath("dive.toml").write_text(sblcosim.load("paper-scenario-1").dump_toml(), "utf-8")
    choice = {"keys": ["receivers"], "levels": ["ekf", "mine.fmu"], "costs": [5, 0]}
    tables = changed(
        name=None, scenario="dive.toml", response="own.py:spread", most_runs=32,
        choices={"who": choice}, fixed={"time": {"duration_s": 2.0}}, settling_time_s=1.0,
    )  # fmt: skip
    here.joinpath("asked.toml").write_text(as_toml(tables), "utf-8")
    first = require.decide(here / "asked.toml", tmp_path / "out")
    parts = sorted((tmp_path / "out" / "runs" / "parts").glob("*.parquet"))
    there.parent.mkdir()
    here.rename(there)
    there.joinpath("asked.toml").rename(there / "other-name.toml")
    again = require.decide(there / "other-name.toml", tmp_path / "out")
    assert sorted((tmp_path / "out" / "runs" / "parts").glob("*.parquet")) == parts
    pd.testing.assert_frame_equal(again.designs, first.designs)
    there.joinpath("own.py").write_text("def spread(run):\n    return 0.6\n", "utf-8")
    changed_code = r"other responses; the code of own\.py:spread, or what it imports, has changed; "
    with pytest.raises(ConfigurationError, match=f"{changed_code}answer into another"):
        require.decide(there / "other-name.toml", tmp_path / "out")


INF = np.inf


@pytest.mark.parametrize(("passed", "runs", "estimate", "lower", "upper", "said"), [
    (450, 1000, 1.25, -INF, INF, "45 % of 1,000 runs are within 1 m; 90 % are within 1.25 m."),
    (8995, 10_000, 1.25, 0.5, INF,
     "89.95 % of 10,000 runs are within 1 m; 90 % are within 1.25 m, surely at least 0.5 m."),
    (9004, 10_000, 1.25, 0.5, 2.5,
     "90.04 % of 10,000 runs are within 1 m; 90 % are within 1.25 m, surely between 0.5 m and "
     "2.5 m."),
    (999, 1000, 1.25, -INF, 2.5,
     "99.9 % of 1,000 runs are within 1 m; 90 % are within 1.25 m, surely at most 2.5 m."),
    (9995, 10_000, 0.5, -INF, 2.5,
     "99.95 % of 10,000 runs are within 1 m; 90 % are within 0.5 m, surely at most 2.5 m."),
    (96, 96, INF, 0.5, INF,
     "100 % of 96 runs are within 1 m; fewer than 90 % end well, and 90 % are surely not within "
     "less than 0.5 m."),
    (89, 100, INF, -INF, INF, "89 % of 100 runs are within 1 m; fewer than 90 % end well."),
    (0, 0, np.nan, -INF, INF, "It has no runs yet."),
])  # fmt: skip
def test_the_numbers_of_a_design_are_its_share_its_percentile_and_the_bounds_that_are_known(
    passed: int, runs: int, estimate: float, lower: float, upper: float, said: str
) -> None:
    answer = _chosen_beside_open_ones()
    designs = answer.designs.astype({"lower": float, "upper": float})
    for name, value in (("passed", passed), ("runs", runs), ("estimate", estimate),
                        ("lower", lower), ("upper", upper)):  # fmt: skip
        designs.loc[3, name] = value
    assert replace(answer, designs=designs).sentences()[0] == (
        f"The cheapest design that suffices: GPS 1 m, baseline 3 m, for 160 €. {said}"
    )


@cache
def _chosen_beside_open_ones() -> Requirement:
    """The fourth of six suffices, with costs of 30, 80, 110, 160, 510 and 560 €."""
    shares = {0: 0.1, 1: 0.2, 2: 0.1, 3: 0.99, 4: 0.3, 5: 0.99}
    return pretended(require.load(QUESTION), shares)


@pytest.mark.parametrize(("verdicts", "cheaper", "until_sure", "others", "alone"), [
    ("ffffff", 0, True, "", ""),
    ("uuufff", 1, False, " Of the cheaper designs, 2 more are undecided.", ""),
    ("ufffuf", 0, True, "", " 1 dearer design was left undecided."),
    ("ufffuu", 1, True, " Of the cheaper designs, 1 more is undecided.",
     " 2 dearer designs were left undecided."),
    ("uuffuu", 1, False, " Of the cheaper designs, 1 more is undecided.", ""),
])  # fmt: skip
def test_designs_that_stay_open_are_counted_among_the_cheaper_and_the_dearer(
    verdicts: str, cheaper: int, until_sure: bool, others: str, alone: str
) -> None:
    words = {"f": "fails", "u": "undecided"}
    found = [words[letter] for letter in verdicts]
    found[3] = "suffices"
    answer = _chosen_beside_open_ones()
    answer = replace(answer, designs=answer.designs.assign(verdict=found), cheaper=cheaper,
                     until_sure=until_sure)  # fmt: skip
    next_one, said = answer.sentences()[1], answer.sure()
    assert (re.findall(r" Of the cheaper.*", next_one) or [""]) == [others]
    assert said.endswith(f"of 3,000 allowed runs.{alone}")
    counts = answer.counts
    assert counts == {"suffices": 1, "fails": found.count("fails"),
                      "undecided": found.count("undecided")}  # fmt: skip


@pytest.mark.parametrize(("everything", "without", "enough", "said"), [
    (2.0, {"a": 3.0, "b": 2.0}, (), "No error alone limits it: in 40 other runs, 90 % are within "
     "2 m with all errors, and no less without any one of them."),
    (0.8, {"a": 0.6, "b": 0.8, "c": 0.5, "d": 0.7, "e": 0.75}, (), "It is limited most by a: in 40 "
     "other runs, 90 % are within 0.8 m with all errors, and 90 % would be within 0.6 m without "
     "this one, 0.5 m without c, 0.7 m without d."),
    (1.0, {"a": 0.5}, (), "It is limited most by a: in 40 other runs, 90 % are within 1 m with all "
     "errors, and 90 % would be within 0.5 m without this one."),
    (INF, {"a": 1.5, "b": INF}, (), "It is limited most by a: in 40 other runs, fewer than 90 % "
     "end well with all errors, and 90 % would be within 1.5 m without this one."),
    (0.8, {}, (), ""),
])  # fmt: skip
def test_what_limits_a_design_that_suffices_is_told_with_three_errors(
    everything: float, without: dict[str, float], enough: tuple[str, ...], said: str
) -> None:
    limits = limiting.Limiting(everything, without, enough)
    answer = replace(_chosen_beside_open_ones(), limits=limits)
    assert answer.limited() == said


@pytest.mark.parametrize(("everything", "without", "enough", "said"), [
    (1.5, {"a": 0.6, "b": 1.0, "c": 1.2}, ("a",),
     "It would suffice without any one of a and b."),
    (1.5, {"a": 1.0, "b": 1.2}, ("a",), "It would suffice without a alone."),
    (1.5, {"a": 1.1, "b": 1.2}, ("a", "b"),
     "It would suffice without a and b together, but not without one of them alone."),
    (1.5, {"a": 1.1, "b": 1.2}, (), "It would not suffice even without all of them."),
    (1.0, {"a": 0.6}, ("a",), ""),
])  # fmt: skip
def test_without_which_errors_a_design_would_suffice_is_told_if_it_does_not(
    everything: float, without: dict[str, float], enough: tuple[str, ...], said: str
) -> None:
    answer = replace(_chosen_beside_open_ones(), chosen=None,
                     limits=limiting.Limiting(everything, without, enough))  # fmt: skip
    text = answer.limited()
    assert text.startswith(f"It is limited most by a: in 40 other runs, 90 % are within "
                           f"{everything:g} m with all errors, and ")  # fmt: skip
    assert (re.findall(r"It would .*", text) or [""]) == [said]


@pytest.mark.parametrize(("everything", "one", "several", "enough"), [
    (1.0, 0.5, {}, 0), (2.0, 1.0, {}, 1), (2.0, 1.1, {2: 1.05, 3: 1.0, 4: 0.5}, 3),
    (2.0, 1.1, {2: 1.0}, 2), (2.0, 1.1, {}, 0),
])  # fmt: skip
def test_the_fewest_errors_are_named_without_which_a_design_is_at_its_limit(
    everything: float, one: float, several: dict[int, float], enough: int, seam: Seam
) -> None:
    """A percentile that is exactly at the limit of 1 is within it."""
    scenario = sblcosim.load("realistic-dive")
    off = limiting.switches(scenario)
    sizes = dict(zip(off, [one + 0.01 * n for n in range(len(off))][::-1], strict=True))
    order = [*off][::-1]
    value = {limiting.EVERYTHING: everything, **sizes}
    value |= {str(n): several.get(n, 1.01) for n in range(2, len(off) + 1)}

    def made(study: Any, _: Any) -> pd.DataFrame:
        return pd.DataFrame({"without": [v[0] for v in study.points.values], "ekf.lost": False})

    def percentile(runs: pd.DataFrame, label: str) -> float:
        assert label == "ekf"
        return value[runs["without"].iloc[0]]

    seam.instead(limiting.runner.simulated, made)
    about = {"name": "x", "settling_time_s": 2.0, "seed": 7}
    found = limiting.limiting(scenario, "ekf", about, percentile, 1.0)
    assert found.everything == everything
    assert [*found.without] == order
    assert dict(found.without) == sizes
    assert found.enough == tuple(order[:enough])


def test_a_budget_of_one_run_is_the_least_and_that_of_the_format_the_most() -> None:
    question = require.load(QUESTION)
    for runs in (1, sequential.MOST_RUNS):
        assert question.with_budget(runs).terms.most_runs == runs
    for runs in (0, sequential.MOST_RUNS + 1, 5.0):
        with pytest.raises(ConfigurationError, match="most_runs: must be a whole number from 1 "):
            question.with_budget(runs)  # type: ignore[arg-type]


def test_a_run_fails_a_receiver_by_its_own_error_or_by_one_of_the_whole_run() -> None:
    table = pd.DataFrame({
        "ekf.y": [1.0, 2.0, 3.0, 4.0, np.nan, np.inf, 7.0, 8.0],
        "ekf.lost": [False, False, False, False, False, False, True, None],
        "error": [None, "ekf: gave up", "raw: gave up", "it ended", None, None, None, None],
    })  # fmt: skip
    passed = passable(table, "y", "ekf")
    assert passed.tolist() == [1.0, INF, 3.0, INF, INF, INF, INF, INF]


def test_questions_and_answers_are_shown_in_a_line() -> None:
    question = require.load(QUESTION)
    what = "RMS total error of at most 1 m in 90 % of the runs; 6 designs"
    assert repr(question) == f"<Question small: {what}>"
    both = require.load(changed(conditions=CONDITIONS))
    assert repr(both) == f"<Question small: {what} in {len(both.conditions)} conditions>"
    answer = _chosen_beside_open_ones()
    assert repr(answer) == "<Requirement to small, on 6 designs; GPS 1 m, baseline 3 m>"
    assert repr(replace(answer, chosen=None)) == "<Requirement to small, on 6 designs; none>"
