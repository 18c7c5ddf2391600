"""Receivers that start from different knowledge, and runs that are lost."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
import sblcosim
import sblcosim.cli
import typer
from quick import one_in
from sblcosim.analysis import covariance
from sblcosim.cli.documents import contents
from sblcosim.comparison.common.evaluation import levels
from sblcosim.comparison.tournament import starts
from sblcosim.comparison.tournament.run import evaluate
from sblcosim.fmus.build.factory import build
from sblcosim.judge.consistency import of_runs
from sblcosim.judge.definitions import LOST, MANY_LOST, MISLEADING
from sblcosim.models import RECEIVERS
from sblcosim.scenario import starts as starts_of
from sblcosim.scenario.scenario import shipped
from sblcosim.study import parts
from sblcosim.study.study import load as load_study
from seams import Seam
from typer.testing import CliRunner

SHORT = {"time.duration_s": 4.0}
MINE = '''
from sblcosim import Depth, Estimate, Range, Receiver


class Mine(Receiver):
    """Says where the last beacon is."""

    def update(self, samples):
        heard = [s for s in samples if isinstance(s, Range)]
        return Estimate(heard[-1].epoch, heard[-1].beacon_position) if heard else None


class Told(Mine):
    """Has the parameter for it."""

    parameters = {"prior_position": (0.0, 0.0, 0.0)}
'''
TRUE = "paper-scenario-1"
WITHOUT = {name for name, it in RECEIVERS.items()
           if "initialisation" not in {v.key for v in it.of("parameter")}}  # fmt: skip


@pytest.fixture(scope="module")
def mine(tmp_path_factory: pytest.TempPathFactory) -> str:
    file = tmp_path_factory.mktemp("mine") / "mine.py"
    file.write_text(MINE)
    return f"{file}:Mine"


def compared(receivers: Any, scenario: Any = TRUE, **more: Any) -> Any:
    changes = SHORT | more.pop("overrides", {})
    return sblcosim.compare(scenario, receivers, runs=2, overrides=changes, timed=False, **more)


def said(found: Any) -> list[str]:
    return [line for line in found.remarks if "knows where the diver starts" in line
            or "know where the diver starts" in line]  # fmt: skip


def first_epochs(scenario: Any, receivers: Any, same_start: bool) -> dict[str, float]:
    """When each receiver has its first estimate [s]."""
    given = sblcosim.load(scenario, {"time.duration_s": 6.0})
    result = sblcosim.run(starts.evened(given) if same_start else given, receivers)
    return {name: float(result.tracks[name]["epoch_s"].iloc[0]) for name in result.receivers}


# --- Different knowledge -------------------------------------------------------------------------


@pytest.mark.parametrize("name", [it for it in RECEIVERS if it not in WITHOUT])
def test_each_of_ours_knows_the_true_start_and_a_users_does_not(name: str, mine: str) -> None:
    found = compared([name, mine])
    assert found.settings["knowing_start"] == {TRUE: [name]}
    (line,) = said(found)
    assert line.startswith(f"{TRUE}: {name} knows where the diver starts and begins there; Mine ")
    assert line in str(found)
    assert found.to_json()["knowing_start"] == {TRUE: [name]}


def test_receivers_without_a_start_are_named_among_those_that_do_not_know(mine: str) -> None:
    assert WITHOUT
    for name in WITHOUT:
        assert compared(["ekf", name]).settings["knowing_start"] == {TRUE: ["ekf"]}
        assert said(compared([name, mine])) == []


def test_several_are_listed_and_all_alike_are_silent(mine: str) -> None:
    (line,) = said(compared(["ekf", "coupled", mine]))
    assert "ekf and coupled know where the diver starts and begin there; Mine does not" in line
    assert said(compared(["ekf", "coupled"])) == []
    assert said(compared([mine])) == []


ALIKE = ("paper-scenario-2", "paper-scenario-3", "harbour-wakes", "realistic-sea")


@pytest.mark.parametrize("name", [it for it in shipped() if it not in ALIKE])
@one_in(2)
def test_only_where_the_start_is_told_is_anything_said(name: str, mine: str) -> None:
    own = "long_baseline" if name in ("gps-buoys", "harbour-lbl") else "ekf"
    found = compared([own, mine], name)
    assert bool(said(found)) == sblcosim.load(name).true_prior == name.startswith("paper")
    given = {"receiver.initialisation": "prior", "receiver.prior_position_m": [1.0, 2.0, 3.0]}
    if not name.startswith("paper"):
        assert said(compared([own, mine], name, overrides=given))


def test_an_fmu_and_a_class_with_the_parameter_know_it(mine: str, tmp_path: Path) -> None:
    fmu = tmp_path / "other.fmu"
    fmu.write_bytes(build("sequential", 2).read_bytes())
    found = compared([str(fmu), "ekf", mine])
    assert set(found.settings["knowing_start"][TRUE]) == {"other", "ekf"}
    told = compared([mine.replace("Mine", "Told"), mine])
    assert told.settings["knowing_start"] == {TRUE: ["Told"]}


def test_several_scenarios_each_have_their_line(mine: str) -> None:
    found = compared(["ekf", mine], ["paper-scenario-1", "harbour-square", "paper-scenario-3"])
    assert [line.partition(":")[0] for line in said(found)] == [
        "paper-scenario-1", "paper-scenario-3"
    ]


@pytest.mark.parametrize("scenario", [
    TRUE,
    {"receiver": {"type": "ekf", "initialisation": "prior", "prior_position_m": [15.0, 0.0, 5.0],
                  "prior_position_std_m": 2.0}},
], ids=["true", "given"])  # fmt: skip
def test_same_start_lets_all_begin_with_what_they_receive(
    scenario: Any, mine: str, tmp_path: Path
) -> None:
    fmu = tmp_path / "other.fmu"
    fmu.write_bytes(build("sequential", 3).read_bytes())
    all_ = [it for it in RECEIVERS if it not in WITHOUT]
    receivers = [*all_, str(fmu), mine, mine.replace("Mine", "Told")]
    found = compared([*all_, mine], scenario, same_start=True)
    assert said(found) == []
    (known,) = found.settings["knowing_start"].values()
    assert known == []
    assert found.settings["same_start"] is True
    assert "prior" not in found.settings["scenarios"][0]["receiver"]
    late = "fixed_lag"  # its first estimate is of a run that is longer
    receivers = [it for it in receivers if it != late]
    before, after = (first_epochs(scenario, receivers, it) for it in (False, True))
    for name in {*all_, "other"} - {late}:
        assert after[name] == after["other"] > before[name]
    assert after["Mine"] == before["Mine"]


@pytest.mark.parametrize("receivers", [["ekf"], ["ekf", "coupled"], ["multilateration"]])
def test_a_single_run_names_them_too(receivers: list[str], mine: str) -> None:
    """The receiver of a user's own may be the one that looks worse for it."""
    alike = sblcosim.run(TRUE, receivers, SHORT)
    assert said(alike) == []
    both = sblcosim.run(TRUE, [*receivers, mine], SHORT)
    known = [name for name in receivers if name not in WITHOUT]
    assert bool(said(both)) == bool(known)
    for line in said(both):
        assert line == starts_of.sentence(known, [*receivers, "Mine"])
        assert line in str(both)
    assert said(sblcosim.run("realistic-dive", ["ekf", mine], SHORT)) == []


def test_the_sentence_names_an_option_and_an_argument_that_there_are() -> None:
    line = starts_of.sentence(["a"], ["a", "b"])
    (command, option) = re.findall(r"'sblcosim (\w+) (--[\w-]+)'", line)[0]
    commands = typer.main.get_command(sblcosim.cli.app).commands  # type: ignore[attr-defined]
    assert option in [name for it in commands[command].params for name in it.opts]
    (argument,) = re.findall(r"in Python (\w+)=", line)
    assert argument in inspect.signature(sblcosim.compare).parameters


def test_same_start_is_confirmed(mine: str) -> None:
    for even in (False, True):
        found = compared(["ekf", mine], same_start=even)
        assert str(found).count("same start: no receiver is told where the diver is") == even


def test_same_start_changes_nothing_where_no_start_is_told() -> None:
    given = sblcosim.load("realistic-dive")
    assert starts.evened(given) is given
    one, two = (compared(["ekf", "coupled"], "realistic-dive", same_start=it)
                for it in (False, True))  # fmt: skip
    pd.testing.assert_frame_equal(one.table, two.table)


def test_the_command_takes_the_option(mine: str, tmp_path: Path) -> None:
    words = ["compare", TRUE, "--receiver", "ekf", "--receiver", mine, "--runs", "2", "--set",
             "time.duration_s=4", "--no-figures", "--out"]  # fmt: skip
    runner = CliRunner()
    plain = runner.invoke(sblcosim.cli.app, [*words, str(tmp_path / "a")])
    even = runner.invoke(sblcosim.cli.app, [*words, str(tmp_path / "b"), "--same-start"])
    assert (plain.exit_code, even.exit_code) == (0, 0)
    assert "ekf knows where the diver starts" in plain.output
    assert "knows where the diver starts" not in even.output


# --- Lost runs -----------------------------------------------------------------------------------


def runs_with(lost: int, nees: Any, count: int = 60) -> pd.DataFrame:
    rng = np.random.default_rng(2)
    return pd.DataFrame({
        "point": 1, "replicate": np.arange(count) + 1, "seed": np.arange(count) + 1,
        "ekf.lost": np.arange(count) < lost, "ekf.absolute_total_rms_m": rng.uniform(1, 2, count),
        "ekf.absolute_total_p95_m": rng.uniform(2, 3, count),
        "ekf.nees_position": np.broadcast_to(nees, count) * rng.uniform(0.98, 1.02, count),
        "error": None,
    })  # fmt: skip


SETTINGS = {
    "response": "absolute_total_rms_m", "practical": None, "contamination": 0.05, "runs": 60,
    "seed": 1,
}  # fmt: skip


@pytest.mark.parametrize("nees", [0.001, 1.0, 2.7, 3.0])
@pytest.mark.parametrize("lost", [4, 40, 60])
def test_a_receiver_that_is_lost_is_never_called_pessimistic_or_right(
    nees: float, lost: int
) -> None:
    found = evaluate({"it": runs_with(lost, nees)}, SETTINGS)
    row = found.level("it", "ekf")
    assert row["covariance"] == "unknown"
    share = {4: "6.7 %", 40: "67 %", 60: "100 %"}[lost]
    assert row["covariance_words"] == f"not judged: {share} of the runs are lost"
    for verbose in (False, True):
        text = found.text(verbose=verbose)
        assert "not judged" in text
        assert "pessimistic" not in text
        assert "in band" not in text
    points = covariance.by_point(runs_with(lost, nees))
    assert points["verdict"].tolist() == ["unknown"]
    assert "not judged" in covariance.sentences(points)["ekf"][0]
    both = evaluate({"a": runs_with(lost, nees), "b": runs_with(lost, nees)}, SETTINGS)
    assert set(both.levels["covariance"]) == {"unknown"}


def test_few_lost_runs_and_optimism_are_judged_as_ever() -> None:
    assert MANY_LOST * 60 == 3.0
    few = evaluate({"it": runs_with(3, 1.0)}, SETTINGS).level("it", "ekf")
    assert few["covariance"] == "pessimistic"
    wild = evaluate({"it": runs_with(40, 30.0)}, SETTINGS).level("it", "ekf")
    assert wild["covariance"] == "optimistic"
    rows = levels({"it": runs_with(0, 3.0)}, {SETTINGS["response"]: {"it": {"ekf": np.ones(60)}}},
                  ["ekf"], SETTINGS)  # fmt: skip
    assert [row["covariance"] for row in rows] == ["in band"]
    assert of_runs(np.full(9, 1.0), 0.66).factor == of_runs(np.full(9, 1.0)).factor


def test_a_single_run_that_is_lost_is_not_judged() -> None:
    assert str(of_runs([0.5], 1.0)) == "not judged: the run is lost"
    assert "looks pessimistic" in str(of_runs([0.5]))


@pytest.mark.parametrize(("lost", "counts", "said"), [
    (0.66, {"untold": 3}, ", 66 % lost; its covariance is not judged, because too many "
     "runs are lost"),
    (0.0, {"untold": 3}, "; too few runs to tell whether its covariance is right"),
    (0.04, {"untold": 3}, ", 4 % lost; too few runs to tell whether its covariance is right"),
    (0.66, {"in_band": 2, "untold": 1}, ", 66 % lost; its covariance is in band"),
    (0.66, {"pessimistic": 3}, ", 66 % lost; its covariance is pessimistic"),
    (0.66, {"optimistic": 3}, ", 66 % lost; do not trust its covariance: optimistic"),
])  # fmt: skip
def test_a_study_says_so_too(lost: float, counts: dict[str, int], said: str) -> None:
    found = SimpleNamespace(
        **{"points": 3, "optimistic": 0, "pessimistic": 0, "in_band": 0, "untold": 0, **counts}
    )
    receiver = SimpleNamespace(
        lost=lost, misleading=None, rms_m=3.0, covariances={"absolute": found}
    )
    study: Any = SimpleNamespace(receivers={"ekf": receiver}, finished=9, failed=0, failure=None)
    first = next(iter(contents.study_lines(study, False)))
    assert first.startswith(f"ekf: 3.0 m RMS over all runs{said}")


POINTS: dict[str, Any] = {"points": 20, "optimistic": 0, "pessimistic": 0, "in_band": 20,
                          "untold": 0, "words": "covariance: words"}  # fmt: skip


def a_study(
    covariance: dict[str, Any] | None = None, failure: str | None = None, **known: Any
) -> Any:
    """The document of a study of 123 runs with one receiver."""
    both = {} if covariance is None else {"absolute": SimpleNamespace(**POINTS | covariance)}
    receiver = SimpleNamespace(**{"lost": 0.0, "misleading": 0.0, "rms_m": 3.0, "inconsistent": 0.2,
                                  "covariances": both, **known})  # fmt: skip
    return SimpleNamespace(receivers={"ekf": receiver}, finished=123, failed=4, failure=failure)


@pytest.mark.parametrize(("counts", "said"), [
    (None, "no covariance"),
    ({}, "its covariance is in band at 20 of 20 points"),
    ({"optimistic": 1, "in_band": 19}, "its covariance is in band at 19 of 20 points"),
    ({"optimistic": 2, "in_band": 18}, "do not trust its covariance: optimistic at 2 of 20 points"),
    ({"pessimistic": 1, "in_band": 19}, "its covariance is in band at 19 of 20 points"),
    ({"pessimistic": 2, "in_band": 17, "untold": 1},
     "its covariance is pessimistic at 2 of 20 points"),
    ({"pessimistic": 9, "optimistic": 2}, "do not trust its covariance: optimistic at 2 of 20 "
     "points"),
    ({"untold": 20, "in_band": 0}, "too few runs to tell whether its covariance is right"),
    ({"untold": 19, "in_band": 1}, "its covariance is in band at 1 of 20 points"),
    ({"points": 1, "optimistic": 1, "in_band": 0}, "do not trust its covariance: optimistic"),
    ({"points": 1, "in_band": 1}, "its covariance is in band"),
])  # fmt: skip
def test_one_point_in_twenty_leaves_the_band_by_chance(
    counts: dict[str, int] | None, said: str
) -> None:
    lines = [*contents.study_lines(a_study(counts), False)]
    assert lines == [f"ekf: 3.0 m RMS over all runs; {said}", "123 runs, 4 failed"]


def test_a_study_says_what_is_lost_and_misleading_and_what_failed_first() -> None:
    lost = a_study({"untold": 20}, lost=0.05, misleading=0.034, failure="ab12: it gave up")
    first = "ekf: 3.0 m RMS over all runs, 5 % lost, 3.4 % misleading; too few runs to tell " \
        "whether its covariance is right"
    last = ["123 runs, 4 failed", "  e.g. ab12: it gave up"]
    assert [*contents.study_lines(lost, False)] == [first, LOST, MISLEADING, *last]
    verbose = [first, "  20 % of its runs inconsistent", "  covariance: words"]
    assert [*contents.study_lines(lost, True)] == [*verbose, LOST, MISLEADING, *last]
    plain = a_study({}, rms_m=None, inconsistent=None, misleading=None, lost=None)
    first = "ekf: – RMS over all runs; its covariance is in band at 20 of 20 points"
    assert [*contents.study_lines(plain, False)] == [first, last[0]]
    assert [*contents.study_lines(plain, True)] == [
        first, "  covariance: words", LOST, MISLEADING, last[0]
    ]
    for known, line in (({"lost": 0.2}, LOST), ({"misleading": 0.2}, MISLEADING)):
        (said,) = [*contents.study_lines(a_study({}, **known), False)][1:-1]
        assert said == line


def test_a_study_that_was_run_is_told_by_the_runs_of_its_replicates(seam: Seam) -> None:
    """More replicates may be in the folder; a receiver that always failed is left out."""
    made = load_study({
        "name": "x", "scenario": "harbour-square", "replicates": 3,
        "factors": {"noise": {"keys": ["acoustics.range_std_m"], "levels": [0.1, 0.5]}},
    })  # fmt: skip
    runs = pd.DataFrame([(point, i) for point in (1, 2) for i in (1, 2, 3, 4, 5)],
                        columns=["point", "replicate"])  # fmt: skip
    counted = runs["replicate"] <= 3
    runs["run_id"] = [f"id{row}" for row in range(10)]
    runs["error"] = None
    runs.loc[[2, 4, 6], "error"] = ["third: bad", "fifth: bad", "seventh: bad"]
    gone = runs["error"].notna()
    for name, scale in (("ekf", 2.0), ("coupled", 0.7), ("never", np.nan)):
        runs[f"{name}.absolute_total_rms_m"] = scale * (1.0 + runs.index) / ~gone
        runs.loc[gone, f"{name}.absolute_total_rms_m"] = np.nan
        runs[f"{name}.nees_position"] = scale * (3.0 + 0.1 * runs.index)
        for flag, every in (("inconsistent", 2), ("lost", 3), ("misleading", 5)):
            flags = pd.array(runs.index % every == 0, "boolean")
            flags[gone] = pd.NA
            runs[f"{name}.{flag}"] = flags
    runs["coupled.own_relative_nees_position"] = 30.0 + runs.index
    del runs["ekf.misleading"]  # an earlier version had none

    def table(there: Any, wanted: Any = lambda names: names) -> pd.DataFrame:
        return runs[wanted([*runs])].copy()

    seam.instead(parts.table, table)
    told = contents.carried_out(made, Path("out"), None)  # type: ignore[arg-type]
    assert (told.folder, told.points, told.replicates, told.runs) == ("out", 2, 3, 6)
    assert (told.finished, told.failed, told.failure) == (6, 2, "id2: third: bad")
    assert [*told.receivers] == ["ekf", "coupled"]
    for name, receiver in told.receivers.items():
        mine = runs[counted & ~gone]
        square = mine[f"{name}.absolute_total_rms_m"] ** 2
        assert receiver.rms_m == pytest.approx(np.sqrt(square.mean()))
        assert receiver.lost == pytest.approx(mine[f"{name}.lost"].astype(float).mean())
        share = mine[f"{name}.inconsistent"].astype(float).mean()
        assert receiver.inconsistent == pytest.approx(share)
    assert told.receivers["ekf"].misleading is None
    assert told.receivers["coupled"].misleading == pytest.approx(2 / 4)
    assert [*told.receivers["ekf"].covariances] == ["absolute"]
    own = told.receivers["coupled"].covariances
    assert [*own] == ["absolute", "own_relative"]
    assert own["absolute"].words.startswith("covariance: ")
    assert own["own_relative"].words.startswith("covariance relative to the platform: optimistic")
    assert own["own_relative"].optimistic == own["own_relative"].points == 2
