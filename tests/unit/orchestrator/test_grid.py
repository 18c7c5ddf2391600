"""Designs of any levels, conditions, and receivers as a factor."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import sblcosim
from sblcosim.analysis import workflow
from sblcosim.analysis.common import columns
from sblcosim.analysis.common.conditions import of_choices
from sblcosim.analysis.levels.analysis import GeneralFactorial
from sblcosim.cli.documents.by_command import document as document_of
from sblcosim.errors import ConfigurationError
from sblcosim.fmus.build import factory
from sblcosim.report import levels as level_pages
from sblcosim.report import possible
from sblcosim.report import study as reports
from sblcosim.report.common import as_toml
from sblcosim.report.page import PageTable
from sblcosim.results.responses import ON_REQUEST, RESPONSES
from sblcosim.study import again, runner, study
from sblcosim.study.design import MOST_POINTS, Factor
from sblcosim.study.grid import crossed, grid

GPS = {"keys": ["platform.gps_grade"], "levels": ["standalone", "rtk_fixed"]}
BOAT = {
    "levels": {
        "rib": {"platform": {"arm_length_m": 0.8}},
        "ship": {"platform.arm_length_m": 5.0, "platform.beacon_depth_m": 2.0},
    }
}
SEA = {"keys": ["platform.beaufort"], "levels": [2, 3, 4]}
TOTAL = "absolute_total_rms_m"


def small(**changes: Any) -> study.Study:
    return study.load({
        "name": "boats", "scenario": "realistic-dive", "seeding": "common", "replicates": 2,
        "fixed": {"time": {"duration_s": 15.0}}, "design": {"kind": "grid"},
        "factors": {"gps": GPS, "boat": BOAT}, **changes,
    })  # fmt: skip


def test_a_grid_has_all_combinations_in_standard_order() -> None:
    design = grid([Factor("a", (1, 2, 4)), Factor("b", ("x", "y"))])
    assert design.values == ((1, "x"), (2, "x"), (4, "x"), (1, "y"), (2, "y"), (4, "y"))
    both = crossed(design, [Factor("sea", (2, 3))])
    assert both.values[:6] == tuple((*v, 2) for v in design.values)
    assert both.values[6:] == tuple((*v, 3) for v in design.values)


def test_conditions_may_make_as_many_points_as_there_may_be_and_no_more() -> None:
    points, most = 2**8, MOST_POINTS // 2**8
    design = grid([Factor("a", tuple(range(points)))])
    assert len(crossed(design, [Factor("sea", tuple(range(most)))]).values) == MOST_POINTS
    got = f"at most {MOST_POINTS} points, got {points} in {most + 1} conditions"
    with pytest.raises(ConfigurationError, match=got):
        crossed(design, [Factor("sea", tuple(range(most + 1)))])


@pytest.mark.parametrize("levels", [6, 400])
def test_some_of_a_grid_are_drawn_from_the_seed_and_each_once(levels: int) -> None:
    """400 levels: more combinations than could be listed."""
    factors = [Factor(name, tuple(range(levels))) for name in "abc"]
    drawn = {seed: grid(factors, 60 if levels == 6 else 8000, seed).values for seed in (1, 1, 2)}
    assert all(len(set(rows)) == len(rows) for rows in drawn.values())
    assert drawn[1] == grid(factors, len(drawn[1]), 1).values
    assert len(set(drawn[1]) & set(drawn[2])) < len(drawn[1]) / 2
    means = np.mean(drawn[1], axis=0)
    assert np.all(np.abs(means - (levels - 1) / 2) < 4 * levels / np.sqrt(12 * len(drawn[1])))


def test_every_level_is_drawn_where_there_is_room() -> None:
    factors = [Factor("a", (1, 2, 3)), Factor("b", ("x", "y")), Factor("c", (1, 2, 3, 4))]
    for seed in range(30):
        drawn = grid(factors, 5, seed)
        assert len(set(drawn.values)) == 5
        for i, factor in enumerate(factors):
            assert {row[i] for row in drawn.values} == set(factor.levels)


def test_levels_may_be_grades_truth_values_tables_and_files(tmp_path: Path) -> None:
    (tmp_path / "ship.toml").write_text("name = 'ship'\n[platform]\narm_length_m = 5.0\n")
    file = tmp_path / "boats.toml"
    file.write_text(
        "scenario = 'realistic-dive'\n"
        "[design]\nkind = 'grid'\n"
        "[factors.boat.levels]\nrib = {platform = {arm_length_m = 0.8}}\nship = 'ship.toml'\n"
        "[factors.gps]\nkeys = ['platform.gps_grade']\nlevels = ['sbas', 'rtk_fixed']\n"
        "[factors.motion]\nkeys = ['acoustics.motion_during_travel']\nlevels = [true, false]\n"
    )
    loaded = study.load(file)
    assert loaded.points.values[1] == ("ship", "sbas", "true")
    assert loaded.overrides(2) == {
        "platform.arm_length_m": 5.0, "platform.gps_grade": "sbas",
        "acoustics.motion_during_travel": True,
    }  # fmt: skip
    scenario = loaded.base.override(loaded.overrides(3).items())
    assert (scenario.platform.arm_length_m, scenario.platform.gps_horizontal_std_m) == (0.8, 0.005)


def test_a_grid_is_run_kept_and_found_again(tmp_path: Path) -> None:
    made = small(
        factors={"gps": GPS, "boat": BOAT,
                 "estimator": {"keys": ["receivers"], "levels": ["ekf", "sequential"]}},
        conditions={"sea": {**SEA, "combine": "all"}},
    )  # fmt: skip
    assert repr(made) == "<Study boats: 3 factors, 1 condition, 12 points × 2 = 24 runs>"
    table = made.run(tmp_path / "out")
    unwritten = runner.simulated(made)
    assert unwritten["error"].isna().all()
    pd.testing.assert_frame_equal(
        unwritten.drop(columns="error"), table.drop(columns="error"), check_dtype=False
    )
    assert table["error"].isna().all()
    assert table.loc[5, ["gps", "boat", "sea"]].tolist() == ["rtk_fixed", "rib", 3.0]
    # Each run is that of the scenario with these keys, for both receivers on the same noise.
    direct = sblcosim.run(
        "realistic-dive", ["ekf", "sequential"],
        {"time.duration_s": 15.0, "platform.gps_grade": "rtk_fixed", "platform.arm_length_m": 0.8,
         "platform.beaufort": 3, "seed": int(table["seed"][5])},
    )  # fmt: skip
    for name in ("ekf", "sequential"):
        expected = direct.errors.loc[name, "absolute", "total"].rms_m
        assert table[f"{name}.{TOTAL}"][5] == pytest.approx(expected, rel=1e-12)
    replayed = again.replay(tmp_path / "out", table["run_id"][5])
    assert replayed.errors.equals(direct.errors)
    found = study.study_of(tmp_path / "out")
    assert found.points == made.points
    assert found.with_replicates(3).receivers == ("ekf", "sequential")
    text = as_toml(found.tables())
    (tmp_path / "again.toml").write_text(text)
    assert study.load(tmp_path / "again.toml").points == made.points

    chosen = of_choices(made, table, f"ekf.{TOTAL}")
    assert chosen.factors == ("gps", "boat", "estimator")
    assert len(chosen.table) == 4 * 2 * 2
    row = chosen.table.set_index(["replicate", *chosen.factors]).loc[2, "rtk_fixed", "rib", "ekf"]
    mine = table[(table.replicate == 2) & (table.gps == "rtk_fixed") & (table.boat == "rib")]
    assert row[TOTAL] == mine[f"ekf.{TOTAL}"].max()  # the worst sea
    assert row["lost"] == mine["ekf.lost"].mean()


@pytest.mark.parametrize(("combine", "expected"), [("average", 2.0), ("all", 3.0)])
def test_conditions_are_put_together_and_a_missing_one_is_missed(
    combine: str, expected: float
) -> None:
    made = small(conditions={"sea": {**SEA, "combine": combine}}, replicates=1)
    points = len(made.points.values)
    values = np.array(made.points.values, object)
    table = pd.DataFrame({
        "point": np.arange(1, points + 1), "replicate": 1,
        **{name: values[:, i] for i, name in enumerate(made.varied)},
        f"ekf.{TOTAL}": np.repeat([1.0, 2.0, 3.0], 4),
        "ekf.availability": np.repeat([0.5, 0.6, 0.7], 4),
    })  # fmt: skip
    table.loc[5, f"ekf.{TOTAL}"] = np.nan
    chosen = of_choices(made, table, f"ekf.{TOTAL}").table
    assert chosen[f"ekf.{TOTAL}"].tolist() == pytest.approx(
        [expected, np.nan, expected, expected], nan_ok=True
    )
    assert chosen["point"].tolist() == [1, 2, 3, 4]
    available = of_choices(made, table, "ekf.availability").table["ekf.availability"]
    assert available.tolist() == pytest.approx([0.6 if combine == "average" else 0.5] * 4)
    assert "availability" in RESPONSES


def test_averages_are_taken_before_the_worst() -> None:
    made = small(
        factors={"gps": GPS},
        conditions={"sea": {"keys": ["platform.beaufort"], "levels": [2, 4], "combine": "all"},
                    "boat": BOAT},
    )  # fmt: skip
    values = np.array(made.points.values, object)
    table = pd.DataFrame({
        "point": np.arange(1, 9), "replicate": 1,
        **{name: values[:, i] for i, name in enumerate(made.varied)},
        f"ekf.{TOTAL}": [1.0, 0, 5.0, 0, 2.0, 0, 3.0, 0],  # gps changes fastest, then the sea
    })  # fmt: skip
    chosen = of_choices(made, table, f"ekf.{TOTAL}").table
    assert chosen["point"].tolist() == [1, 2]
    assert chosen[f"ekf.{TOTAL}"].tolist() == [4.0, 0.0]  # not 3.5, the average of the worst


@pytest.mark.slow
@pytest.mark.parametrize("beacons", [(3, 4), (4, 6)])
def test_the_number_of_beacons_may_be_a_factor(tmp_path: Path, beacons: tuple[int, int]) -> None:
    made = study.load({
        "scenario": "paper-scenario-1", "replicates": 2, "fixed": {"time": {"duration_s": 5.0}},
        "factors": {"beacons": {"keys": ["platform.beacons"], "levels": [*beacons]},
                    "arm": {"keys": ["platform.arm_length_m"], "levels": [0.4, 3.0]}},
    })  # fmt: skip
    table = made.run(tmp_path / "out")
    assert table["error"].isna().all()
    run = table.iloc[3]
    direct = sblcosim.run("paper-scenario-1", overrides={
        "time.duration_s": 5.0, "platform.beacons": beacons[1], "platform.arm_length_m": 3.0,
        "seed": int(run["seed"]),
    })  # fmt: skip
    assert direct.record.values["platform.beacon_position"].shape[1] == beacons[1]
    assert run[f"ekf.{TOTAL}"] == pytest.approx(
        direct.errors.loc["ekf", "absolute", "total"].rms_m, rel=1e-12
    )


PROBLEMS = [
    ({"factors": {"gps": {**GPS, "levels": ["sbas", "sbas"]}}}, "that differ, got 'sbas' twice"),
    ({"factors": {"gps": {**GPS, "levels": ["sbas", "rtk"]}}}, "platform.gps_grade: must be"),
    ({"factors": {"gps": GPS}, "design": {"kind": "full"}}, "must have numbers as levels in this"),
    ({"factors": {"b": {**BOAT, "keys": ["platform.beacons"]}}}, "keys: must be left out with"),
    ({"factors": {"b": {"levels": {"rib": {"platform.arm": 1}, "x": {}}}}}, "no key 'platform.a"),
    ({"factors": {"b": {"levels": {"rb": {}, "x": {}}}}}, "must have at least one key, got none"),
    ({"factors": {"b": {"levels": {"rib": 1, "ship": 2}}}}, "must be a table of tables of keys"),
    ({"factors": {"b": {"levels": {"rib": "rib.toml", "x": {}}}}}, "levels: rib: .*rib.toml"),
    ({"factors": {"r": {"keys": ["receivers"], "levels": ["ekf", "cupled"]}}}, "mean 'coupled'"),
    ({"factors": {"r": {"keys": ["receivers"], "levels": ["ekf", "ekf"]}}}, "differ, got 'ekf' tw"),
    ({"factors": {"r": {"keys": ["receivers"], "levels": 3}}}, "must be an array of receivers"),
    ({"receivers": ["ekf"], "factors": {"r": {"keys": ["receivers"], "levels": ["ekf", "raw"]}}},
     "receivers: must be left out with the factor r"),
    ({"factors": {"gps": GPS, "r": {"keys": ["receivers", "platform.beaufort"], "levels": [1, 2]}}},
     "receivers must be the only key of one factor"),
    ({"conditions": {"gps": SEA}}, "conditions.gps"),
    ({"conditions": {"sea": {**SEA, "combine": "worst"}}}, "must be 'average' or 'all'"),
    ({"conditions": {"sea": {**GPS, "levels": ["sbas", "rtk_float"]}}}, "must belong to one"),
    ({"design": {"kind": "grid", "points": 5}}, "points: must be at most 4, got 5 of 4 combinat"),
    ({"design": {"kind": "grid", "points": 1}},
     "points: must be enough for every level, got 1 without gps"),
    ({"design": {"kind": "full", "points": 3}, "factors": {"sea": {**SEA, "levels": [2, 3]}}},
     "kind: must be 'grid' with points"),
    ({"design": {"kind": "grid", "centre_points": 1}}, "centre_points: must be 0 for kind 'grid'"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "message"), PROBLEMS)
def test_what_is_wrong_with_a_grid_is_said_in_one_line(
    changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(ConfigurationError, match=message) as caught:
        small(**changes)
    assert "\n" not in str(caught.value)


def test_a_grid_is_analysed_by_its_levels(tmp_path: Path) -> None:
    made = small(
        replicates=4, conditions={"sea": {**SEA, "levels": [2, 4]}},
        factors={"gps": GPS, "boat": {**BOAT, "label": "boat type"},
                 "estimator": {"keys": ["receivers"], "levels": ["ekf", "sequential"]}},
    )  # fmt: skip
    table = made.run(tmp_path / "out")
    analysis = reports.analysed(tmp_path / "out", transform="log")
    analysis.save(tmp_path / "page", other="replace")
    found = analysis.found
    assert isinstance(found, GeneralFactorial)
    assert found.factors == ("gps", "boat", "estimator")
    assert found.runs == 8 * 4
    mean = found.means.set_index(["factor", "level"]).loc[("estimator", "ekf")]
    runs = table.groupby(["replicate", "gps", "boat"])[f"ekf.{TOTAL}"].mean()
    assert mean["mean"] == pytest.approx(np.log(runs).mean(), rel=1e-12)
    shown = found.own_means.set_index(["factor", "level"]).loc[("estimator", "ekf"), "mean"]
    assert shown == pytest.approx(np.exp(np.log(runs).mean()), rel=1e-12)
    assert "Geometric mean RMS total error [m], 95 % intervals" in found.text()
    page = (tmp_path / "page" / "report.html").read_text()
    assert "boat type" in page
    assert "sea (condition, average)" in page
    document: Any = document_of(analysis, tmp_path)
    assert {(row.factor, row.level) for row in document.levels} == {
        ("gps", "standalone"), ("gps", "rtk_fixed"), ("boat", "rib"), ("boat", "ship"),
        ("estimator", "ekf"), ("estimator", "sequential"),
    }  # fmt: skip
    assert len(document.pairs) == 3
    with pytest.raises(ConfigurationError, match="error: must be left out for a design of kind"):
        reports.analysed(tmp_path / "out", error="residual")


def test_levels_may_be_texts_of_one_factor_and_numbers_of_another(tmp_path: Path) -> None:
    loss = {"keys": ["acoustics.loss_probability"], "levels": [0, 0.3]}
    small(replicates=4, factors={"gps": GPS, "loss": loss}).run(tmp_path / "out")
    reports.analysed(tmp_path / "out").save(tmp_path / "page", other="replace")
    levels = pd.read_parquet(tmp_path / "page" / "main_effects.parquet")["level"]
    assert levels.tolist() == ["standalone", "rtk_fixed", "0", "0.3"]


def test_receivers_that_are_a_factor_share_the_noise() -> None:
    factors = {"gps": GPS, "r": {"keys": ["receivers"], "levels": ["ekf", "sequential"]}}
    with pytest.raises(ConfigurationError, match="seeding: must be 'common' with receivers as a"):
        small(factors=factors, seeding="independent")


def test_receivers_of_others_are_levels_like_any(tmp_path: Path) -> None:
    """A class of the user's and an FMU, found beside the study's file."""
    (tmp_path / "mine.py").write_text(
        "import numpy as np\nimport sblcosim\n\n"
        "class Still(sblcosim.Receiver):\n"
        "    def update(self, samples):\n"
        "        return sblcosim.Estimate(samples[-1].epoch, np.array([0.0, 0.0, 5.0]))\n"
    )
    shutil.copy(factory.build("sequential", 3), tmp_path / "theirs.fmu")
    (tmp_path / "three.toml").write_text(
        "scenario = 'harbour-square'\nseeding = 'common'\nreplicates = 2\n"
        "fixed = {time = {duration_s = 10.0}}\n[design]\nkind = 'grid'\n"
        "[factors.who]\nkeys = ['receivers']\n"
        "levels = ['sequential', 'mine.py:Still', 'theirs.fmu']\n"
    )
    made = study.load(tmp_path / "three.toml")
    assert made.factors["who"].values == ("sequential", "Still", "theirs")
    table = made.run(tmp_path / "out")
    assert table["error"].isna().all()
    pd.testing.assert_series_equal(
        table[f"theirs.{TOTAL}"], table[f"sequential.{TOTAL}"], check_names=False
    )
    found = workflow.of_grid(study.study_of(tmp_path / "out"), table)
    assert [*found.means["level"]] == ["sequential", "Still", "theirs"]


def test_a_report_names_the_errors_that_what_is_possible_leaves_out(tmp_path: Path) -> None:
    arms = {"arm": {"keys": ["platform.arm_length_m"], "levels": [1.0, 3.0]}}
    fixed = {"time": {"duration_s": 15.0}, "platform": {"mounting_std_m": 0.2}}
    made = small(factors=arms, fixed=fixed)
    (table,) = possible.tables(made, made.run(tmp_path))
    assert isinstance(table, PageTable)
    assert table.note.endswith("The reference leaves out these errors: mounting_std_m.")


def test_the_run_that_ran_away_is_named_and_pairs_are_weighed(tmp_path: Path) -> None:
    """Over receivers and conditions; with the words that the share of lost runs needs."""
    of = small(conditions={"sea": SEA | {"levels": [2, 4]}}, factors={
        "boat": BOAT, "receiver": {"keys": ["receivers"], "levels": ["sequential", "coupled"]},
    })  # fmt: skip
    runs = of.run(tmp_path / "s")
    planted = runs.copy()
    planted.loc[5, f"coupled.{TOTAL}"] = 9e4
    found = workflow.of_grid(of, planted, practical=0.5)
    assert found.worst_run == planted["run_id"][5]
    assert found.largest == 9e4
    assert f"sblcosim replay RESULTS {planted['run_id'][5]}" in found.text()
    assert "A run is lost if, in its last quarter" in found.text()
    assert set(found.pairs["verdict"]) <= {"equal", "differs", "undecided"}
    analysis = reports.analysed(tmp_path / "s", practical=0.5)
    analysis.save(tmp_path / "a", other="replace")
    saved = analysis.found
    assert isinstance(saved, GeneralFactorial)
    assert saved.worst_run in set(runs["run_id"])
    page = (tmp_path / "a" / "report.html").read_text("utf-8")
    for words in ("Medians of the levels", "A run is lost if, in its last quarter", "Verdict"):
        assert words in page
    assert (tmp_path / "a" / "medians.csv").exists()


@pytest.mark.parametrize(
    ("planted", "by_medians", "practical"),
    [(1.0, False, 0.3), (120.0, True, 0.3), (120.0, True, None), (9e3, True, 0.3)],
)
def test_pairs_are_judged_by_what_is_said_wherever_they_stand(
    tmp_path: Path, planted: float, by_medians: bool, practical: float | None
) -> None:
    """One run of four conditions is far off: 120 m are 30 m on the average, 9 km run away."""
    sea = {"keys": ["platform.beaufort"], "levels": [1, 2, 3, 4], "combine": "average"}
    noise = {"keys": ["acoustics.range_std_m"], "levels": [0.05, 0.5, 1.5]}
    of = small(conditions={"sea": sea}, factors={"noise": noise}, replicates=40,
               seeding="independent")  # fmt: skip
    base = {0.05: 1.0, 0.5: 1.02, 1.5: 1.5}
    rows = [
        {"point": number, "replicate": r, "run_id": f"{number}-{r}", "ekf.lost": 0.0,
         **dict(zip(of.varied, values, strict=True))}
        for number, values in enumerate(of.points.values, 1) for r in range(1, 41)
    ]  # fmt: skip
    table = pd.DataFrame(rows)
    random = np.random.default_rng(1)
    table[f"ekf.{TOTAL}"] = [base[x] for x in table["noise"]] + random.normal(0, 0.1, len(table))
    table.loc[5, f"ekf.{TOTAL}"] = planted
    found = workflow.of_grid(of, table, practical=practical)
    assert found.by_medians == by_medians
    by = found.pairs.set_index(["one", "other"])
    own = "median_" if by_medians else ""
    low, high = by[f"{own}low"], by[f"{own}high"]
    assert by["differs"].to_dict() == ((low > 0) | (high < 0)).to_dict()
    assert by["differs"].tolist() == [False, True, True]
    made = level_pages.parts(of, found, tmp_path).tables
    (page,) = (t for t in made if isinstance(t, PageTable) and t.caption == "Pairs of levels")
    document = found.to_json()["pairs"]
    for shown in page.rows:
        one, other = (float(text.removesuffix(" m")) for text in shown[1].split(" less "))
        row = by.loc[(one, other)]
        assert float(shown[2].replace("−", "-")) == pytest.approx(row[f"{own}difference"], rel=1e-3)
        ends = [float(text.replace("−", "-")) for text in shown[3].strip("()").split(" to ")]
        assert ends == pytest.approx([row[f"{own}low"], row[f"{own}high"]], rel=6e-3)
        (plain,) = (it for it in document if (it["one"], it["other"]) == (one, other))
        for name in ("difference", "low", "high"):
            assert plain[own + name] == pytest.approx(row[own + name])
        assert plain["differs"] == row["differs"]
        if practical is not None:
            assert shown[5] == plain["verdict"] + (
                " within ±0.3 m" if row["verdict"] == "equal" else "")
    if practical is not None:
        assert by["verdict"].tolist() == ["equal", "differs", "differs"]
        assert f"{'Judged by medians, of' if by_medians else 'Of'} the 3 pairs" in found.text()


def test_an_empty_level_is_the_scenario_as_it_is_and_no_level_is_there_twice(
    tmp_path: Path,
) -> None:
    of = small(factors={"boat": {"levels": {"own": {}, "ship": BOAT["levels"]["ship"]}}})
    assert of.overrides(1) == {}
    of.run(tmp_path / "s")
    reports.analysed(tmp_path / "s").save(tmp_path / "a", other="replace")
    assert "own (the scenario as it is)" in (tmp_path / "a" / "report.html").read_text("utf-8")
    same = {"platform": {"arm_length_m": of.base.platform.arm_length_m}}
    for levels in ({"own": {}, "same": same}, {"own": {}, "none": {}, "s": BOAT["levels"]["rib"]}):
        with pytest.raises(ConfigurationError, match=r"levels: must have levels that differ, got "
                           r"own and \w+ the same \(own, which is empty, is the unchanged"):
            small(factors={"boat": {"levels": levels}})


@pytest.mark.parametrize(
    ("asked", "hint"),
    [
        ("absolute_total_rms", "; did you mean 'absolute_total_rms_m'?; docs/reference/results.md"),
        ("total_rms_m", "; did you mean 'absolute_total_rms_m'?; docs/reference/results.md"),
        ("absolute_total_p95_m",
         '; this study has none, for which its file must say responses = ["absolute'),
        ("relative_total_p96_m",
         '; this study has none, for which its file must say responses = ["percenti'),
        ("zzz", "got 'zzz'; docs/reference/results.md lists all"),
    ],
)
def test_an_unknown_response_is_refused_in_a_line(asked: str, hint: str) -> None:
    table = pd.DataFrame({f"ekf.{name}": [1.0] for name in RESPONSES if name not in ON_REQUEST})
    with pytest.raises(ConfigurationError) as refused:
        columns.column_of(table, asked)
    assert hint in str(refused.value)
    assert len(str(refused.value)) < 250


def test_an_unknown_scenario_is_named_once() -> None:
    with pytest.raises(ConfigurationError, match=r"^boats: scenario: must be a TOML file"):
        small(scenario="no-such-dive")


@pytest.mark.parametrize("gone", [np.nan, np.inf])
def test_a_run_without_a_response_is_not_the_largest(gone: float) -> None:
    made = small(seeding="independent", replicates=6)
    values = np.array(made.points.values, object)
    y = np.random.default_rng(5).uniform(1.0, 2.0, 24)
    y[[3, 17, 20]] = 7.0, gone, -8.0
    table = pd.DataFrame({
        "point": np.repeat([1, 2, 3, 4], 6), "replicate": np.tile(np.arange(1, 7), 4),
        "run_id": [f"run-{n}" for n in range(24)], f"ekf.{TOTAL}": y,
        **{name: np.repeat(values[:, i], 6) for i, name in enumerate(made.varied)},
    })  # fmt: skip
    found = workflow.of_grid(made, table)
    assert (found.worst_run, found.largest) == ("run-3", 7.0)
    assert workflow.of_grid(made, table.drop(columns="run_id")).worst_run == ""
