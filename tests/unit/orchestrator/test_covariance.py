"""What a study says of the receivers' covariances: verdicts over the replicates of each point."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
import sblcosim
from sblcosim.analysis import covariance
from sblcosim.judge.consistency import of_runs
from sblcosim.report import study as reports


def runs(nees: dict[int, list[float]], own: dict[int, list[float]] | None = None) -> pd.DataFrame:
    """A table of runs of two receivers, from the mean NEES at each point."""
    points = np.repeat(list(nees), [len(v) for v in nees.values()])
    table = pd.DataFrame({
        "point": points,
        "gps": np.where(points == 1, 0.1, 3.5),
        "good.nees_position": np.concatenate(list(nees.values())),
        "good.own_relative_nees_position": (
            np.nan if own is None else np.concatenate(list(own.values()))
        ),
        "silent.nees_position": np.nan,
        "error": None,
    })
    return table.sample(frac=1, random_state=1)


def right(seed: int, factor: float = 1.0, count: int = 30) -> list[float]:
    values = 3 * factor**2 * np.random.default_rng(seed).chisquare(20, count) / 20
    return values.tolist()


def test_each_point_is_judged_by_its_own_runs() -> None:
    nees = {1: right(1), 2: right(2, 3.0), 3: right(3, 0.5)}
    table = covariance.by_point(runs(nees), ["gps"])
    assert table["receiver"].unique().tolist() == ["good"]
    assert table["frame"].unique().tolist() == ["absolute"]
    assert table["verdict"].tolist() == ["in band", "optimistic", "pessimistic"]
    assert table["gps"].tolist() == [0.1, 3.5, 3.5]
    for values, (_, row) in zip(nees.values(), table.iterrows(), strict=True):
        alone = of_runs(values)
        assert (row["words"], row["factor"]) == (str(alone), alone.factor)
        assert row["runs_needed"] == alone.runs_needed
    (row,) = covariance.summary(table).to_dict(orient="records")
    assert (row["points"], row["in_band"], row["optimistic"], row["pessimistic"]) == (3, 1, 1, 1)
    assert row["optimistic_to"] == pytest.approx(3.0, rel=0.1)
    assert row["pessimistic_to"] == pytest.approx(2.0, rel=0.1)
    (sentence,) = covariance.sentences(table)["good"]
    assert sentence.startswith("covariance: optimistic at 1 of 3 points, by a factor of ")
    assert "pessimistic at 1 of 3 points" in sentence
    assert "in band at 1 (95 % each, from 30 runs per point" in sentence


def test_a_run_that_has_failed_counts_for_the_receivers_that_have_not() -> None:
    table = runs({1: [*right(1), 1e9]})
    last = table["good.nees_position"] == 1e9
    table.loc[last, "good.nees_position"] = np.nan
    table.loc[last, "error"] = "broken"
    assert covariance.by_point(table)["runs"].tolist() == [30]
    before = covariance.by_point(runs({1: right(1)}))
    others = runs({1: right(1)}).assign(error="another has failed")
    pd.testing.assert_frame_equal(covariance.by_point(others), before)


def test_both_covariances_of_a_receiver_are_judged_apart() -> None:
    table = covariance.by_point(runs({1: right(1, 2.0)}, {1: right(2)}))
    assert table["frame"].tolist() == ["absolute", "own_relative"]
    absolute, own = covariance.sentences(table)["good"]
    assert absolute.startswith("covariance: optimistic by a factor of 1.94 (mean NEES 11.2, ")
    assert own.startswith("covariance relative to the platform: in band (mean NEES")


def test_one_run_at_each_point_cannot_tell() -> None:
    table = covariance.by_point(runs({1: [12.0], 2: [3.0]}), ["gps"])
    assert table["gps"].tolist() == [0.1, 3.5]
    (sentence,) = covariance.sentences(table)["good"]
    assert sentence == (
        "covariance: looks wrong by factors of 1 to 2 at 2 points (above 1: optimistic); one run "
        "at each cannot tell"
    )
    (alone,) = covariance.sentences(covariance.by_point(runs({1: [12.0]})))["good"]
    assert alone.startswith("covariance: looks optimistic by a factor of 2; one run cannot tell")


def verdicts(*rows: tuple[str, float, int, int | None]) -> pd.DataFrame:
    """Of points with a verdict, a factor, a number of runs, and the runs that would be needed."""
    table = pd.DataFrame(rows, columns=["verdict", "factor", "runs", "runs_needed"])
    table["words"] = [f"words of point {i}" for i in range(1, len(rows) + 1)]
    table.insert(0, "point", range(1, len(rows) + 1))
    table = table.astype({"runs_needed": "Int64"})
    return table.assign(receiver="mine", frame="own_relative")


def test_factors_of_several_points_are_told_from_the_smallest_to_the_largest() -> None:
    """Of pessimistic points, how much smaller the true standard deviation is."""
    table = verdicts(
        ("optimistic", 2.5, 30, 40), ("pessimistic", 0.25, 20, 70), ("optimistic", 1.5, 25, None),
        ("in band", 1.01, 30, 35), ("unknown", 3.0, 30, None), ("pessimistic", 0.5, 30, 60),
        ("one run", 9.0, 22, None), ("in band", 0.99, 30, 30),
    )
    (row,) = covariance.summary(table).to_dict(orient="records")
    assert row == {
        "receiver": "mine", "frame": "own_relative", "points": 8, "in_band": 2, "optimistic": 2,
        "optimistic_from": 1.5, "optimistic_to": 2.5, "pessimistic": 2, "pessimistic_from": 2.0,
        "pessimistic_to": 4.0, "untold": 2, "runs": 20, "runs_needed": 70,
    }
    assert covariance.sentences(table) == {"mine": [
        "covariance relative to the platform: optimistic at 2 of 8 points, by a factor of 1.5 to "
        "2.5, pessimistic at 2 of 8 points, by a factor of 2 to 4, in band at 2, unknown at 2 "
        "(95 % each, from 20 runs per point; up to 70 would reveal a factor of 1.1)"
    ]}


@pytest.mark.parametrize(("needed", "words"), [
    (20, ""), (21, "; up to 21 would reveal a factor of 1.1"),
    (10_000, "; up to 10000 would reveal a factor of 1.1"),
    (10_001, "; at some points no practical number (10,000) would reveal a factor of 1.1"),
    (None, ""),
])
def test_runs_that_would_be_enough_are_named_where_they_are_more(
    needed: int | None, words: str
) -> None:
    table = verdicts(("optimistic", 2.0, 20, needed), ("optimistic", 2.0004, 25, None))
    (sentence,) = covariance.sentences(table)["mine"]
    assert sentence == (
        "covariance relative to the platform: optimistic at 2 of 2 points, by a factor of 2 (95 % "
        f"each, from 20 runs per point{words})"
    )
    (alone,) = covariance.sentences(table[:1])["mine"]
    assert alone == "covariance relative to the platform: words of point 1"


def test_points_with_one_run_each_are_told_apart_from_a_mixture() -> None:
    table = verdicts(("one run", 1.25, 1, None), ("one run", 0.5, 1, None))
    (sentence,) = covariance.sentences(table)["mine"]
    assert sentence == (
        "covariance relative to the platform: looks wrong by factors of 0.5 to 1.25 at 2 points "
        "(above 1: optimistic); one run at each cannot tell"
    )
    (mixed,) = covariance.sentences(verdicts(("one run", 1.25, 1, 4), ("in band", 1, 9, None)))[
        "mine"
    ]
    assert mixed == (
        "covariance relative to the platform: in band at 1, unknown at 1 (95 % each, from 1 runs "
        "per point; up to 4 would reveal a factor of 1.1)"
    )


def test_without_any_nees_nothing_is_said() -> None:
    table = covariance.by_point(runs({1: [np.nan, np.nan]}))
    assert table.empty
    assert covariance.summary(table).empty
    assert covariance.sentences(table) == {}


STUDY: dict[str, Any] = {
    "name": "mine",
    "scenario": "paper-scenario-1",
    "fixed": {"time.duration_s": 20.0},
    "replicates": 4,
    "receivers": ["ekf", "coupled", "multilateration"],
}


@pytest.mark.parametrize("factors", [
    {"design": {"kind": "single"}},
    {"factors": {"gps": {"keys": ["platform.gps_horizontal_std_m"], "levels": [0.1, 3.5]}}},
])  # fmt: skip
def test_a_study_has_own_relative_columns_and_its_report_the_verdicts(tmp_path, factors) -> None:
    table = sblcosim.study.load({**STUDY, **factors}).run(tmp_path / "runs")
    for axis in ("x", "y", "z", "total"):
        for what in ("mean", "rms"):
            column = f"own_relative_{axis}_{what}_m"
            assert table[f"coupled.{column}"].notna().all()
            assert table[f"ekf.{column}"].isna().all()
    assert (table["coupled.own_relative_nees_position"] > 0).all()
    assert (table["ekf.own_relative_nees_estimates"] == 0).all()
    reports.analysed(tmp_path / "runs", command="x").save(tmp_path / "out", other="replace")
    written = pd.read_csv(tmp_path / "out" / "consistency.csv")
    points = len(table) // 4
    assert len(written) == 4 * points
    assert written["runs"].unique().tolist() == [4]
    page = (tmp_path / "out" / "report.html").read_text("utf-8")
    assert "Are the covariances right?" in page
    for words in ("relative to the platform as it reports itself",
                  "by the receiver&#39;s own account", "Runs needed"):  # fmt: skip
        assert words in page


def test_own_relative_percentiles_are_of_the_records(tmp_path) -> None:
    asked = {**STUDY, "design": {"kind": "single"}, "replicates": 2, "receivers": ["coupled"],
             "responses": ["own_relative_total_p95_m", "percentiles"]}  # fmt: skip
    table = sblcosim.study.load(asked).run(tmp_path / "runs")
    scenario = {"time.duration_s": 20.0, "seed": int(table["seed"][0])}
    result = sblcosim.run("paper-scenario-1", receiver="coupled", overrides=scenario)
    expected = result.percentiles.loc[("coupled", "own_relative", "total"), "p95_m"]
    assert table["coupled.own_relative_total_p95_m"][0] == expected
    assert table["coupled.relative_total_p95_m"].notna().all()
