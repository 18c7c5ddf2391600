"""Responses: each as its definition in Python says, and functions of one's own."""

from __future__ import annotations

import math
import runpy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import sblcosim
from quick import few, one_in
from sblcosim.data.record import Record
from sblcosim.data.truth import TRUTH
from sblcosim.errors import ConfigurationError
from sblcosim.judge.definitions import PERCENTAGES, order_statistics
from sblcosim.results import responses, sums, user_responses
from sblcosim.results.responses import (
    ON_REQUEST,
    PERCENTILES,
    RESPONSES,
    Run,
    value_of,
)
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.execution import execute
from sblcosim.simulation.how import How
from sblcosim.simulation.masters import lanes
from sblcosim.simulation.resolve import resolve
from sblcosim.study import campaign, study
from seams import Seam

RECEIVERS = ("ekf", "sequential", "multilateration")
WITH_OWN = ("ekf", "coupled")
STUDY: dict[str, Any] = {
    "scenario": "paper-scenario-1",
    "fixed": {"time.duration_s": 8.0, "acoustics.loss_probability": 0.3},
    "replicates": 3,
    "receivers": ["ekf"],
    "settling_time_s": 1.0,
    "factors": {"gps": {"keys": ["platform.gps_horizontal_std_m"], "levels": [0.1, 3.5]}},
}


def plan_of(scenario: str, receivers: tuple[str, ...] = RECEIVERS, **keys: Any) -> Any:
    return resolve(connect(sblcosim.load(scenario, keys), receivers))


PLANS = {
    "losses": ("paper-scenario-1", {"time.duration_s": 12.0, "acoustics.loss_probability": 0.4}),
    "random": ("harbour-random", {"time.duration_s": 30.0, "acoustics.outlier_probability": 0.1}),
    "nothing": ("paper-scenario-2", {"time.duration_s": 5.0, "acoustics.loss_probability": 1.0}),
}


@pytest.mark.parametrize("settling_ns", [0, 3_000_000_000])
@pytest.mark.parametrize("name", PLANS)
def test_every_sum_gives_what_its_definition_says(name: str, settling_ns: int) -> None:
    scenario, keys = PLANS[name]
    record = execute(plan_of(scenario, WITH_OWN, **keys))
    span = int(record.time_ns[-1] - record.time_ns[0])
    for receiver in WITH_OWN:
        run = Run(record, receiver, settling_ns)
        made = sums.responses(sums.sums_of(run)[None], span, settling_ns).iloc[0]
        assert [*made.index, *ON_REQUEST] == list(RESPONSES)
        for column, value in made.items():
            defined = value_of(RESPONSES[str(column)], run)
            got = math.nan if value is pd.NA else float(value)
            assert defined == pytest.approx(got, rel=1e-12, abs=0, nan_ok=True), column


@pytest.mark.parametrize("start_ns", [4 * 10**9, 10**18])
def test_errors_of_lanes_have_the_same_room_whenever_the_time_begins(start_ns: int) -> None:
    """One place for each estimate: that of packages begins where their file says."""
    plan = plan_of("paper-scenario-1", ("ekf",), **{"time.duration_s": 6.0})
    later = replace(plan, start_ns=start_ns, stop_ns=start_ns + plan.stop_ns)
    room = [lanes.LanesBatch(it, {}, (), (), 0, 1).room for it in (plan, later)]
    assert room == [plan.stop_ns // 10**8 + 1] * 2


@pytest.mark.parametrize("name", PLANS)
@pytest.mark.parametrize("number", [1, 2, 4, 8])
def test_percentiles_of_the_lanes_are_the_order_statistics_of_the_record(
    name: str, number: int
) -> None:
    scenario, keys = PLANS[name]
    plan = plan_of(scenario, **keys)
    ports = [f"{r}.{p}" for r in RECEIVERS for p in ("valid", "update_count", "epoch", "position")]
    seeds = {f"{c}.seed": np.arange(7.0) + 1 for c in ("target", "platform", "acoustics")}
    outcome = lanes.execute(
        plan, seeds, record=[*TRUTH, *ports], settling_ns=2_000_000_000,
        percentages=PERCENTAGES, lanes=number,
    )  # fmt: skip
    for run in range(7):
        for receiver in RECEIVERS:
            seen = Run(outcome.record(run), receiver, 2_000_000_000)
            defined = [value_of(response, seen) for response in PERCENTILES.values()]
            np.testing.assert_array_equal(outcome.order[receiver][run].ravel(), defined)


def test_long_runs_go_through_fewer_lanes_to_the_same_numbers(seam: Seam) -> None:
    plan = plan_of("paper-scenario-1", **{"time.duration_s": 10.0})
    seeds = {"acoustics.seed": np.arange(40.0)}
    whole = lanes.execute(plan, seeds, percentages=(95,), threads=2)
    tried: list[int] = []
    used: list[int] = []
    original = lanes.layout_of

    def noted(plan: Any, lanes: int) -> Any:
        layout = original(plan, lanes)
        tried.append(layout.lanes)
        return layout

    seam.instead(lanes.layout_of, noted)
    for room in (1, 2 * 10 * 3 * 4 * 8 * 10):
        seam.tuned(room_bytes=room)
        small = lanes.execute(plan, seeds, percentages=(95,), threads=2)
        for receiver in RECEIVERS:
            np.testing.assert_array_equal(small.order[receiver], whole.order[receiver])
        used.append(tried[-1])
    assert used[0] == 1
    assert lanes.execute(plan, seeds).order == {}
    assert tried[-1] >= used[1] >= used[0]


@pytest.mark.parametrize("n", [1, 2, 3, 19, 20, 21, 100, 1000])
def test_a_percentile_is_the_least_value_that_so_many_do_not_exceed(n: int) -> None:
    values = np.random.default_rng(n).normal(size=n)
    for p in range(1, 101):
        (found,) = order_statistics(values, (p,))
        assert 100 * (values <= found).sum() >= p * n > 100 * (values < found).sum()


def test_the_table_of_a_run_has_the_percentiles_of_its_responses() -> None:
    result = sblcosim.run(
        "harbour-random", receiver=WITH_OWN, overrides={"time.duration_s": 20.0}
    )
    assert len(result.percentiles.loc["coupled"]) == len(result.percentiles.loc["ekf"]) + 2
    for (receiver, frame, length), row in result.percentiles.iterrows():
        run = Run(result.record, receiver)
        for column, value in row.items():
            assert value == value_of(RESPONSES[f"{frame}_{length}_{column}"], run)
    assert "Within [m]" in result.text(verbose=True)
    total = result.tracks["ekf"]["error_total_m"]
    assert any(
        line.strip().startswith("total ") and f" {total.max():.3f}" in line
        for line in result.text(verbose=True).splitlines()
    )


def test_without_estimates_there_is_no_percentile() -> None:
    assert np.isnan(order_statistics(np.empty(0), PERCENTAGES)).all()


# --- In studies ----------------------------------------------------------------------------------


def worst_after_three_seconds_m(run: Run) -> float:
    return float(np.sqrt(run.used.square[run.used.epoch_s > 3.0]).max())


def test_percentiles_are_there_if_they_are_asked_for(tmp_path: Path) -> None:
    plain = study.load(STUDY).run(tmp_path / "plain")
    asked = study.load(STUDY | {"responses": ["percentiles"]}).run(tmp_path / "asked")
    assert [c for c in asked if c not in plain] == [f"ekf.{name}" for name in PERCENTILES]
    pd.testing.assert_frame_equal(
        asked[plain.columns].drop(columns="run_id"), plain.drop(columns="run_id"),
        check_exact=True,
    )  # fmt: skip
    one = study.load(STUDY, responses=["absolute_total_p95_m"]).run(tmp_path / "one")
    assert (one["ekf.absolute_total_p95_m"] == asked["ekf.absolute_total_p95_m"]).all()
    native = study.load(STUDY | {"responses": ["percentiles"]}).run(
        tmp_path / "native", master="native"
    )
    pd.testing.assert_frame_equal(native, asked, check_exact=True)


def test_a_response_without_sums_takes_the_record(tmp_path: Path) -> None:
    table = study.load(STUDY | {"responses": ["first_fix_s"]}).run(tmp_path / "out")
    for _, row in table.iterrows():
        record = study_record(tmp_path / "out", row["run_id"])
        seen = Run(record, "ekf").judged.epoch_s[0]
        assert row["ekf.first_fix_s"] == seen
    assert RESPONSES["first_fix_s"].unit == "s"


def test_a_function_is_a_response_wherever_it_is_run(tmp_path: Path) -> None:
    made = study.load(STUDY, responses=[worst_after_three_seconds_m]).with_replicates(2)
    here = made.run(tmp_path / "here")
    for i, row in here.iterrows():
        record = study_record(tmp_path / "here", row["run_id"])
        expected = worst_after_three_seconds_m(Run(record, "ekf", 1_000_000_000))
        assert row["ekf.worst_after_three_seconds_m"] == expected, i
    there = made.run(
        tmp_path / "there", executor="processes", workers=2
    )
    pd.testing.assert_frame_equal(there, here, check_exact=True)
    assert study.study_of(tmp_path / "here").asked[0].name == "worst_after_three_seconds_m"


def study_record(folder: Path, run_id: str) -> Any:
    from sblcosim.study.again import replay

    result = replay(folder, run_id)
    return result.record


FILE = """
import numpy as np
LIMIT = {limit}

def share_above(run):
    return (np.sqrt(run.used.square) > LIMIT).mean()

def fails(run):
    raise RuntimeError("nothing\\nto say")

def ends(run):
    raise SystemExit(3)

def words(run):
    return "many"

def digits(run):
    return "0.5"
"""


def test_a_function_of_a_file_is_known_by_the_file(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    toml = (
        'scenario = "paper-scenario-1"\nreceivers = ["ekf"]\nresponses = ["mine.py:share_above"]\n'
        '[fixed.time]\nduration_s = 4.0\n[design]\nkind = "single"\n'
    )
    (tmp_path / "study.toml").write_text(toml)
    file.write_text(FILE.format(limit=0.4))
    first = study.load(tmp_path / "study.toml").run(tmp_path / "first")
    assert 0 <= first["ekf.share_above"][0] <= 1
    again = study.load(tmp_path / "study.toml").run(tmp_path / "again")
    assert again["run_id"].tolist() == first["run_id"].tolist()
    file.write_text(FILE.format(limit=0.0))
    other = study.load(tmp_path / "study.toml")
    assert other.run(tmp_path / "other")["ekf.share_above"][0] == 1.0
    assert other.run(tmp_path / "other")["run_id"].tolist() != first["run_id"].tolist()
    with pytest.raises(ConfigurationError, match=r"must be that of .*|with other"):
        other.run(tmp_path / "first")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("fails", "must not raise an exception, got RuntimeError: nothing to say"),
        ("ends", "must not raise an exception, got SystemExit: 3"),
        ("words", "must be a number, got 'many'"),
        ("digits", "must be a number, got '0.5'"),
    ],
)
@pytest.mark.parametrize("executor", few(["threads", "processes"], quick=["threads"]))
@one_in(2)
def test_a_function_that_fails_ends_the_study(
    tmp_path: Path, name: str, message: str, executor: str
) -> None:
    (tmp_path / "mine.py").write_text(FILE.format(limit=1))
    made = study.load(STUDY, responses=[f"{tmp_path / 'mine.py'}:{name}"])
    with pytest.raises(ConfigurationError, match=rf"^ekf\.{name}: {message}$"):
        made.run(tmp_path / "out", executor=executor)


LIMIT = 1.0


def above_limit(run: Run) -> float:
    return helper(run, LIMIT)


def helper(run: Run, limit: float) -> float:
    return float((run.used.square > limit**2).mean())


def test_a_function_is_known_by_what_it_refers_to(monkeypatch: pytest.MonkeyPatch) -> None:
    def of(limit: float) -> Any:
        def above(run: Run) -> float:
            return helper(run, limit)

        return above

    known = user_responses.of_function(above_limit).sha256
    assert user_responses.of_function(above_limit).sha256 == known
    assert user_responses.of_function(of(1.0)).sha256 == user_responses.of_function(of(1.0)).sha256
    assert user_responses.of_function(of(1.0)).sha256 != user_responses.of_function(of(2.0)).sha256
    monkeypatch.setitem(globals(), "LIMIT", 2.0)
    assert user_responses.of_function(above_limit).sha256 != known


def test_a_file_that_was_just_changed_is_read_again(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    nothing = Record(np.zeros(1, np.int64), {}, {})
    for value in (1.0, 2.0):
        file.write_text(f"def constant(run):\n    return {value}\n")
        made = user_responses.of_file("mine.py:constant", tmp_path)
        assert user_responses.values_of([made], [Run(nothing, "ekf")]) == [[value]]
    assert [p.name for p in tmp_path.iterdir()] == ["mine.py"]


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("absolute_total_p96_m", "responses or FILE.py:FUNCTION, got .*did you mean"),
        ("lost", "must not have lost, which is always included"),
        (3, "must be names of responses or FILE.py:FUNCTION, got 3"),
        ("mien.py:mine", "must be FILE.py:FUNCTION, got no Python file .*'; did you mean 'mine"),
        ("leaves.py:f", "'leaves.py:f' must be importable, got SystemExit: 4"),
        ("mine.py:share_abov", "must name a function of 'mine.py', .*did you mean 'share_above'"),
        ("broken.py:f", r"'broken.py:f' must be importable, got ZeroDivisionError: division by"),
    ],
)
def test_what_is_no_response_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, entry: object, message: str
) -> None:
    (tmp_path / "mine.py").write_text(FILE.format(limit=1))
    (tmp_path / "broken.py").write_text("1 / 0\n")
    (tmp_path / "leaves.py").write_text("raise SystemExit(4)\n")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigurationError, match=message) as caught:
        study.load(STUDY | {"responses": [entry]})
    assert "\n" not in str(caught.value)


def test_a_name_belongs_to_one_response(seam: Seam) -> None:
    def lost(run: Run) -> float:
        return 0.0

    with pytest.raises(ConfigurationError, match="lost must not be the name of one that is"):
        study.load(STUDY, responses=[lost])
    rows = responses.rows
    seam.instead(rows, lambda kind: [*rows(kind), *list(rows(kind))[:1]])
    with (
        pytest.raises(ValueError, match=r"^\w+: must be the name of one response, got two$"),
        pytest.warns(RuntimeWarning, match="found in sys.modules"),
    ):
        runpy.run_module(responses.__name__, run_name="once_more", alter_sys=True)
    first = worst_after_three_seconds_m
    other = eval("lambda run: 0.0")
    with pytest.raises(ConfigurationError, match="must be names or functions with a name"):
        study.load(STUDY, responses=[first, other])


def test_lanes_cannot_do_functions() -> None:
    made = study.load(STUDY, responses=[worst_after_three_seconds_m])
    with pytest.raises(ConfigurationError, match="master: must not be lanes with a response"):
        campaign.prepare(made, How(master="lanes"))
