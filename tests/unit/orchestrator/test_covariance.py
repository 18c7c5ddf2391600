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
    table = covariance.by_point(runs({1: [12.0], 2: [3.0]}))
    (sentence,) = covariance.sentences(table)["good"]
    assert sentence == (
        "covariance: looks wrong by factors of 1 to 2 at 2 points (above 1: optimistic); one run "
        "at each cannot tell"
    )
    (alone,) = covariance.sentences(covariance.by_point(runs({1: [12.0]})))["good"]
    assert alone.startswith("covariance: looks optimistic by a factor of 2; one run cannot tell")


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
