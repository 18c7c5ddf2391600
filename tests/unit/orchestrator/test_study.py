"""Study files, and campaigns small enough for a unit test."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import sblcosim
from pyarrow import parquet
from sblcosim.errors import BuildError, ConfigurationError, ConfigurationWarning, FmuError
from sblcosim.results.sums import SUMS
from sblcosim.simulation.how import How
from sblcosim.simulation.masters import lanes, lanes_layout, native
from sblcosim.study import again, batch, campaign, definition, executors, runner, study, tables
from seams import Seam

ARM = {"keys": ["platform.arm_length_m"], "levels": [0.4, 3.0]}
GPS = {"keys": ["platform.gps_horizontal_std_m"], "levels": [0.1, 3.5]}
TICK = {"keys": ["time.sampling_time_s"], "levels": [0.1, 0.5]}


def small(**changes: Any) -> definition.Study:
    """Two factors at two levels, two replicates, runs of 5 s."""
    return study.load(
        {
            "name": "small",
            "scenario": "paper-scenario-1",
            "fixed": {"time": {"duration_s": 5.0}},
            "replicates": 2,
            "factors": {"arm": ARM, "tick": TICK},
            **changes,
        }
    )


PAPER = tuple(name for name in study.shipped() if name.startswith("paper-"))


@pytest.mark.parametrize("name", PAPER)
def test_the_papers_studies_are_its_table_3(name: str) -> None:
    loaded = study.load(name)
    assert loaded.base.name == loaded.scenario == name
    assert loaded.replicates * len(loaded.points.values) == 6400
    levels = {factor: f.levels for factor, f in loaded.factors.items()}
    assert levels == {
        "baseline": (0.4, 3.0), "gps": (0.1, 3.5), "imu": (1.0, 10.0), "depth_sensor": (0.01, 0.1),
        "range": (0.1, 1.0), "sampling_time": (0.1, 1.0), "packet_loss": (0.0, 0.25),
    }  # fmt: skip
    assert loaded.overrides(5)["platform.imu_tilt_std_deg"] == 10.0
    assert loaded.overrides(5)["platform.imu_heading_std_deg"] == 10.0
    # The first combination of levels is the scenario's own run, all but the baseline.
    assert loaded.base.override(loaded.overrides(2)) == loaded.base


def test_no_run_of_the_papers_studies_shares_its_seed_with_another() -> None:
    seeds = [
        loaded.run_seed(point, replicate)
        for loaded in map(study.load, PAPER)
        for replicate in range(1, 51)
        for point in range(1, 129)
    ]
    assert len(set(seeds)) == 3 * 6400


def test_levels_and_factors_can_be_changed() -> None:
    made = small(factors={"arm": ARM, "tick": TICK, "gps": GPS})
    other = made.with_levels(gps=[0.5, 1.0], arm=[1.0, 2.0])
    assert [f.levels for f in other.factors.values()] == [(1.0, 2.0), (0.1, 0.5), (0.5, 1.0)]
    fewer = made.without("gps", "tick")
    assert [*fewer.factors] == ["arm"]
    assert fewer.overrides(1) == {"platform.arm_length_m": 0.4}
    for changed in (other, fewer):
        kept = {"factors"}
        assert changed.model_dump(exclude=kept) == made.model_dump(exclude=kept)
    assert [*made.factors] == ["arm", "tick", "gps"]


@pytest.mark.parametrize(("change", "words"), [
    (lambda made: made.with_levels(arn=[1.0, 2.0]),
     "factor: must be arm or tick, got 'arn'; did you mean 'arm'?"),
    (lambda made: made.without("gps"), "factor: must be arm or tick, got 'gps'"),
    (lambda made: made.without("arm", "arm"), "factor: must be tick, got 'arm'"),
    (lambda made: made.with_levels(arm=[1.0]),
     "small: [factors.arm] levels: must have at least two levels, got 1"),
])  # fmt: skip
def test_levels_and_factors_that_cannot_be_are_refused(change: Any, words: str) -> None:
    with pytest.raises(ConfigurationError) as refusal:
        change(small())
    assert str(refusal.value) == words


def test_common_seeds_are_shared_by_the_points_of_a_replicate() -> None:
    common = small(seeding="common", seed=7)
    assert [common.run_seed(p, 2) for p in (1, 2, 3, 4)] == [8, 8, 8, 8]
    independent = small(seed=7)
    assert [independent.run_seed(p, 2) for p in (1, 2, 3, 4)] == [11, 12, 13, 14]


def test_a_study_file_names_its_scenario_relative_to_itself(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text(sblcosim.load("harbour-square").dump_toml())
    (tmp_path / "mine.toml").write_text(
        'scenario = "own.toml"\n[fixed]\n"time.duration_s" = 7.0\n'
        '[factors.loss]\nkeys = ["acoustics.loss_probability"]\nlevels = [0, 0.5]\n'
    )
    loaded = study.load(tmp_path / "mine.toml")
    assert loaded.name == "mine"
    assert loaded.base.time.duration_s == 7.0
    assert loaded.base.target.trajectory == sblcosim.load("harbour-square").target.trajectory


def test_a_sweep_holds_the_other_factors_where_the_scenario_has_them() -> None:
    loaded = small(
        factors={"arm": {**ARM, "levels": [0.4, 1, 2]}, "gps": GPS}, design={"kind": "sweep"}
    )
    assert loaded.points.values == ((3.0, 0.1), (0.4, 0.1), (1, 0.1), (2, 0.1), (3.0, 3.5))


def test_times_of_a_study_are_whole_nanoseconds_where_only_rounding_says_no() -> None:
    middle = small(
        factors={"tick": {**TICK, "levels": [0.1, 0.2]}}, design={"centre_points": 1},
        settling_time_s=0.21 / 5,
    )
    assert middle.points.values[-1] == ((0.1 + 0.2) / 2,) != (0.15,)
    _, system, _ = campaign.resolved(middle, 3)
    assert system.components["acoustics"].parameters["sampling_time"] == 0.15
    assert (middle.settling_time_s, middle.settling_ns) == (0.042, 42_000_000)


PROBLEMS: list[tuple[dict[str, Any], str]] = [
    (
        {"factors": {"arm": {"keys": ["platform.arm_lenght_m"], "levels": [1, 2]}}},
        r"\[factors.arm\] keys: there is no key 'platform.arm_lenght_m'; "
        "did you mean 'platform.arm_length_m'",
    ),
    (
        {"factors": {"arm": {"keys": ["arm_length_m"], "levels": [1, 2]}}},
        "did you mean 'platform.arm_length_m'",
    ),
    (
        {"factors": {"gps": {"keys": ["platform.gps_std_m"], "levels": [1, 2]}}},
        "'platform.gps_shared' or 'receiver.gps_std_m'",
    ),
    ({"factors": {"arm": {**ARM, "levels": [1, 1.0]}}}, r"levels that differ, got 1 twice"),
    ({"factors": {"arm": {**ARM, "levels": [1]}}}, "must have at least two levels, got 1"),
    ({"factors": {"arm": {**ARM, "levels": [1, -1]}}}, "levels: platform.arm_length_m: must be at"),
    ({"factors": {"arm": {**ARM, "levels": ["a", 1]}}},
     "must have numbers as levels in this design, got .a.; a grid"),
    ({"factors": {"arm": {**ARM, "keys": []}}}, "keys: must have at least one key"),
    ({"factors": {"arm": {**ARM, "level": 1}}}, "there is no key 'level'; did you mean 'levels'"),
    ({"factors": {"arm": {**ARM, "high": 1}}}, "'high'; there are range, .*keys, levels, dist"),
    ({"factors": {"arm": ARM, "length": ARM}}, "must belong to one factor, also belongs to arm"),
    ({"factors": {"error": ARM}}, "must have a name of at most 60 letters"),
    ({"factors": {"a-b": ARM}}, "must have a name of at most 60 letters"),
    ({"factors": {}}, "factors: must have at least one, got none"),
    ({"factors": {"s": {"keys": ["target.seed"], "levels": [1, 2]}}}, "no key 'target.seed'"),
    (
        {"factors": {"s": {"keys": ["target.trajectory"], "levels": [1, 2]}}},
        "levels: target.trajectory: must be ",
    ),
    ({"fixed": {"platform.arm_length_m": 1.0}}, "must not also be a fixed key"),
    ({"fixed": {"seed": 1}}, "fixed: must not have seed"),
    ({"fixed": {"platform.arm_lenght_m": 1.0}},
     r"^[^:]+: fixed: platform\.arm_lenght_m: \[platform\] has no key 'arm_lenght_m'; did you mean "
     "'arm_length_m'"),
    ({"scenario": "paper-scenario-4"}, "scenario: .* did you mean"),
    ({"scenario": 4}, "scenario: must be a name, a file or a table, got 4"),
    ({"replicates": 0}, "replicates: must be at least 1, got 0"),
    ({"seeding": "same"}, "seeding: must be 'independent' or 'common'"),
    ({"seed": 2**31 - 4}, "seed: must leave room for all runs"),
    ({"settling_time": 1}, "there is no key 'settling_time'; did you mean 'settling_time_s'"),
    (
        {"design": {"kind": "half"}},
        r"\[design\] kind: must be 'full', 'fraction', 'sweep', 'grid', 'space' or 'single'",
    ),
    ({"design": {"kind": "fraction"}}, "must have generators or a resolution"),
    ({"design": {"resolution": 3}}, "must be 'fraction' with generators or a resolution"),
    ({"design": {"kind": "fraction", "generators": ["B=A"]}}, "got arm aliased with tick"),
    ({"design": {"kind": "sweep", "centre_points": 1}}, "must be 0 for kind 'sweep'"),
    ({"design": {"centre_points": 2}, "seeding": "common"}, "must be at most 1 with seeding"),
    (
        {"factors": {"arm": ARM, "r": {"keys": ["target.side_m"], "levels": [1, 2]}}},
        r"^small: \[factors.r\] keys: target.side_m must have an effect, got none, as trajectory "
        'is "semicircle"$',
    ),
    (
        {"factors": {"r": {"keys": ["target.side_m"], "levels": [1, 2]}, "arm": ARM},
         "design": {"kind": "sweep"}},
        r"\[factors.r\] keys: target.side_m must have an effect, got none, as trajectory is ",
    ),
    (
        {"factors": {"limit": {"keys": ["receiver.gate_limit"], "levels": [1, 2]}},
         "receivers": ["sequential"], "fixed": {"receiver.gate": 0.0}},
        r"\[factors.limit\] keys: receiver.gate_limit must have an effect, got none, as gate is 0$",
    ),
    (
        {"factors": {"ratio": {"keys": ["time.ekf_ratio"], "levels": [1, 2]}},
         "fixed": {"receiver.update_interval_s": 0.2}},
        r"\[factors.ratio\] keys: time.ekf_ratio must have an effect, got none, as "
        "receiver.update_interval_s is given$",
    ),
]


@pytest.mark.parametrize(("changes", "message"), PROBLEMS)
def test_a_study_that_cannot_be_carried_out_is_refused_in_one_line(
    changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(ConfigurationError, match=message) as caught:
        small(**changes)
    assert "\n" not in str(caught.value)


def test_a_factor_may_have_no_effect_at_some_points() -> None:
    mean = {"keys": ["acoustics.outlier_mean_m"], "levels": [1, 2]}
    share = {"keys": ["acoustics.outlier_probability"], "levels": [0.0, 0.1]}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        campaign.prepare(small(factors={"size": mean, "share": share}))
    with pytest.raises(ConfigurationError, match="must have an effect, got none, as outlier_prob"):
        small(factors={"size": mean, "arm": ARM})


@pytest.mark.filterwarnings("ignore::sblcosim.errors.NoEffectWarning")
def test_a_sea_state_is_a_factor_whatever_the_scenario_states() -> None:
    sea = small(factors={"sea": {"keys": ["platform.beaufort"], "levels": [0, 6]}})
    calm, rough = (campaign.resolved(sea, n)[0].platform for n in (1, 2))
    assert calm.roll_amplitude_deg == calm.heave_amplitude_m == 0.0
    assert rough.roll_amplitude_deg > 8.0
    assert rough.heave_amplitude_m > 1.0
    level = small(fixed={"platform.beaufort": 6, "time.duration_s": 5.0}).base.platform
    assert level.roll_amplitude_deg == rough.roll_amplitude_deg


def test_warnings_of_a_study_come_once_with_a_count(seam: Seam) -> None:
    original = campaign.resolved

    def resolved(made: definition.Study, number: int) -> Any:
        warnings.warn("of the first kind", ConfigurationWarning, stacklevel=1)
        if number % 2:
            warnings.warn("of the second kind", ConfigurationWarning, stacklevel=1)
        return original(made, number)

    seam.instead(campaign.resolved, resolved)
    fixed = {"time.duration_s": 5.0, "target.side_m": 3.0, "acoustics.outlier_mean_m": 2.0}
    share = {"keys": ["acoustics.outlier_probability"], "levels": [0.0, 0.1]}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        campaign.prepare(small(fixed=fixed, factors={"arm": ARM, "share": share}))
    assert [str(w.message) for w in caught] == [
        "of the first kind (at 4 of 4 points)",
        "of the second kind (at 2 of 4 points)",
        'override target.side_m: has no effect, as trajectory is "semicircle"',
    ]


WITHOUT_A_UNIT = """
from dataclasses import replace
import sblcosim


class Mine(sblcosim.Receiver):
    @property
    def variables(self):
        return tuple(replace(v, unit=None) if v.name == "depth" else v for v in super().variables)

    def update(self, samples):
        return sblcosim.Estimate(samples[-1].epoch, (0.0, 0.0, 5.0))
"""


def test_runs_of_a_study_do_not_warn_again(tmp_path: Path) -> None:
    """With the master that looks up every run on its own."""
    (tmp_path / "mine.py").write_text(WITHOUT_A_UNIT)
    made = small(factors={"arm": ARM}, replicates=3, receivers=[str(tmp_path / "mine.py")])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        table = made.run(tmp_path / "out", master="native")
    assert table["error"].isna().all()
    (message,) = [str(w.message) for w in caught]
    assert message.endswith("the same unit, got m and none (at 2 of 2 points)")


def test_a_file_that_is_no_study_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="study: must be a TOML file or one of"):
        study.load("nothing")
    with pytest.raises(ConfigurationError, match=r"no such file"):
        study.load(tmp_path / "nothing.toml")
    (tmp_path / "bad.toml").write_text("a = 1\nb =\n")
    with pytest.raises(ConfigurationError, match=r"bad.toml, line 2"):
        study.load(tmp_path / "bad.toml")


def test_the_table_has_a_row_per_run(tmp_path: Path) -> None:
    table = small(receivers=["ekf", "multilateration"]).run(tmp_path / "out")
    assert table["point"].tolist() == [1, 2, 3, 4] * 2
    assert table["replicate"].tolist() == [1] * 4 + [2] * 4
    assert sorted(table["run_order"]) == list(range(1, 9))
    assert table["arm"].tolist() == [0.4, 3.0] * 4
    assert table["tick"].tolist() == [0.1, 0.1, 0.5, 0.5] * 2
    assert table["seed"].tolist() == list(range(1, 9))
    assert table["run_id"].is_unique
    assert table["error"].isna().all()
    for receiver in ("ekf", "multilateration"):
        assert np.isfinite(table[f"{receiver}.absolute_total_rms_m"]).all()
    assert not any(name.startswith("raw.") for name in table)
    pd.testing.assert_frame_equal(pd.read_parquet(tmp_path / "out" / "runs.parquet"), table)


def test_a_row_is_what_the_run_gives_alone(tmp_path: Path) -> None:
    made = small(settling_time_s=1.0)
    table = made.run(tmp_path / "out")
    for i in (1, 6):
        row = table.iloc[i]
        scenario = made.base.override({**made.overrides(int(row.point)), "seed": int(row.seed)})
        track = sblcosim.run(scenario).tracks["ekf"]
        error = track[track["epoch_s"] >= 1.0]["error_total_m"]
        assert row["ekf.estimates"] == len(error)
        assert row["ekf.absolute_total_mean_m"] == pytest.approx(error.mean(), rel=1e-12)


def test_the_table_is_the_same_for_all_masters_and_numbers_of_threads(tmp_path: Path) -> None:
    made = small(receivers=["ekf", "sequential"], scenario="realistic-dive", factors={
        "arm": ARM, "tick": TICK, "loss": {"keys": ["acoustics.loss_probability"],
                                           "levels": [0.0, 0.3]},
    })  # fmt: skip
    (tmp_path / "lanes").mkdir()
    reference = made.run(tmp_path / "lanes", workers=1)
    for workers in (2, 4):
        again = made.run(tmp_path / f"workers {workers}", workers=workers)
        pd.testing.assert_frame_equal(again, reference, check_exact=True)
    bytes_ = (tmp_path / "lanes" / "runs.parquet").read_bytes()
    for master in ("native", "python"):
        made.run(tmp_path / master, master=master, workers=2)
        assert (tmp_path / master / "runs.parquet").read_bytes() == bytes_, master


@pytest.mark.parametrize("short", [False, True], ids=["remembered", "forgotten"])
def test_the_table_is_the_same_for_all_masters_whatever_the_update_interval(
    tmp_path: Path, seam: Seam, short: bool
) -> None:
    if short:
        seam.instead(lanes.remembered, lambda plan, variations: 2)
    made = small(
        receivers=["ekf", "multilateration"], factors={"arm": ARM}, replicates=1,
        fixed={"time.duration_s": 100.0, "time.ekf_ratio": 100}, settling_time_s=1.0,
    )  # fmt: skip
    alone = []
    original = native.execute
    seam.instead(native.execute, lambda *a, **k: alone.append(a) or original(*a, **k))
    reference = made.run(tmp_path / "lanes")
    assert bool(alone) == short
    assert (reference["ekf.estimates"] >= 8).all()
    assert reference["error"].isna().all()
    assert not reference["ekf.broken"].any()
    for master in ("native", "python"):
        again = made.run(tmp_path / master, master=master)
        pd.testing.assert_frame_equal(again, reference, check_exact=True)


def test_flags_that_are_unknown_stay_so_in_the_folder(
    tmp_path: Path, seam: Seam
) -> None:
    """As of a receiver without covariance; in one part of two."""
    seam.tuned(batch=4)
    original = batch.responses

    def unknown(sums: Any, *durations: Any) -> Any:
        sums = sums.copy()
        if unknown.calls == 0:
            sums[:2, [SUMS.index("nees"), SUMS.index("nees_estimates")]] = 0.0
        unknown.calls += 1
        return original(sums, *durations)

    unknown.calls = 0
    seam.instead(batch.responses, unknown)
    table = small().run(tmp_path / "out")
    assert unknown.calls == 2
    assert table["ekf.inconsistent"].isna().tolist() == [True] * 2 + [False] * 6
    assert table["ekf.lost"].dtype == bool
    stored = parquet.read_table(tmp_path / "out" / "runs.parquet")["ekf.inconsistent"]
    assert (str(stored.type), stored.null_count) == ("bool", 2)
    pd.testing.assert_frame_equal(small().run(tmp_path / "out"), table)


def test_the_true_prior_is_that_of_each_run(tmp_path: Path) -> None:
    """The random path starts elsewhere with each seed; every master hands the start over."""
    made = small(scenario="paper-scenario-3", factors={"arm": ARM})
    assert made.base.true_prior
    tables = [made.run(tmp_path / m, master=m) for m in ("lanes", "native")]
    pd.testing.assert_frame_equal(*tables, check_exact=True)
    row = tables[0].iloc[3]
    scenario = made.base.override({**made.overrides(int(row.point)), "seed": int(row.seed)})
    expected = sblcosim.run(scenario).errors.loc["ekf", "absolute", "total"].rms_m
    assert row["ekf.absolute_total_rms_m"] == pytest.approx(expected, rel=1e-12)


def test_more_replicates_leave_those_before_as_they_are(
    tmp_path: Path, seam: Seam
) -> None:
    first = small().run(tmp_path / "out")
    counted = counting(seam)
    longer = small(replicates=4).run(tmp_path / "out")
    assert sum(counted) == 8
    pd.testing.assert_frame_equal(longer.iloc[:8], first, check_exact=True)
    small(replicates=4).run(tmp_path / "at once")
    assert sum(counted) == 24
    assert (tmp_path / "out" / "runs.parquet").read_bytes() == (
        tmp_path / "at once" / "runs.parquet"
    ).read_bytes()
    pd.testing.assert_frame_equal(small().run(tmp_path / "out"), first, check_exact=True)
    assert sum(counted) == 24


def counting(seam: Seam) -> list[int]:
    """Numbers of runs that are simulated from now on."""
    counted: list[int] = []
    original = executors.simulate

    def simulated(made: Any, runs: Any, *rest: Any) -> Any:
        counted.append(len(runs))
        return original(made, runs, *rest)

    seam.instead(executors.simulate, simulated)
    return counted


def test_a_missing_part_is_done_again(tmp_path: Path, seam: Seam) -> None:
    seam.tuned(batch=4)
    table = small().run(tmp_path / "out")
    whole = (tmp_path / "out" / "runs.parquet").read_bytes()
    parts = sorted((tmp_path / "out" / "parts").iterdir())
    assert len(parts) == 2
    parts[0].unlink()
    counted = counting(seam)
    pd.testing.assert_frame_equal(small().run(tmp_path / "out"), table, check_exact=True)
    assert counted == [4]
    assert (tmp_path / "out" / "runs.parquet").read_bytes() == whole


def test_the_identity_of_a_run_is_that_of_what_is_run(tmp_path: Path) -> None:
    ids = small().run(tmp_path / "a")["run_id"]
    renamed = small(name="other", title="Other", factors={"x": ARM, "y": TICK})
    assert renamed.run(tmp_path / "b")["run_id"].tolist() == ids.tolist()
    for i, changes in enumerate((
        {"seed": 100},
        {"settling_time_s": 1.0},
        {"fixed": {"time.duration_s": 5.0, "acoustics.range_std_m": 0.2}},
        {"receivers": ["sequential"]},
    )):
        other = small(**changes).run(tmp_path / str(i))["run_id"]  # type: ignore[arg-type]
        assert not set(other) & set(ids), changes


def test_the_folder_of_another_study_is_refused(tmp_path: Path) -> None:
    out = tmp_path / "out"
    small().run(out)
    before = sorted(p.name for p in out.rglob("*"))
    with pytest.raises(ConfigurationError, match=r"got those of 'small' with other seed$"):
        small(seed=5).run(out)
    with pytest.raises(ConfigurationError, match=r"with other factors$"):
        small(factors={"arm": ARM}).run(out)
    with pytest.raises(ConfigurationError, match=r"with other scenario$"):
        small(fixed={"time.duration_s": 6.0}).run(out)
    assert sorted(p.name for p in out.rglob("*")) == before
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").touch()
    with pytest.raises(ConfigurationError, match=r"got 'letter.txt' in it"):
        small().run(tmp_path / "mine")
    with pytest.raises(ConfigurationError, match=r"got Not a directory$"):
        small().run(tmp_path / "mine" / "letter.txt")


def test_a_run_without_finite_estimates_is_a_row_with_its_error(tmp_path: Path) -> None:
    made = small(
        fixed={"time.duration_s": 5.0, "receiver.range_std_m": 0.1},
        factors={"range": {"keys": ["acoustics.range_std_m"], "levels": [0.1, 1e300]}, "arm": ARM},
    )
    table = made.run(tmp_path / "out")
    bad = table["range"] > 1
    assert (table["error"].notna() == bad).all()
    assert table["error"][bad].str.match(r"ekf: fmi2DoStep at 0\.\d s must succeed").all()
    assert table.loc[bad, "ekf.absolute_total_rms_m"].isna().all()
    assert np.isfinite(table.loc[~bad, "ekf.absolute_total_rms_m"]).all()
    for master in ("native", "python"):
        again = made.run(tmp_path / master, master=master)
        pd.testing.assert_frame_equal(again, table, check_exact=True)


def test_components_that_are_not_ours_run_one_by_one(
    tmp_path: Path, seam: Seam
) -> None:
    small().run(tmp_path / "lanes")
    seam.instead(lanes_layout.unsupported, lambda plan: "ekf")
    seam.tuned(alone=1)
    small().run(tmp_path / "alone", workers=2)
    assert len(list((tmp_path / "alone" / "parts").iterdir())) == 4
    assert (tmp_path / "alone" / "runs.parquet").read_bytes() == (
        tmp_path / "lanes" / "runs.parquet"
    ).read_bytes()
    with pytest.raises(ConfigurationError, match="ekf: must be one of our own components"):
        small(seed=50).run(tmp_path / "refused", master="lanes")


def test_a_run_that_fails_does_not_end_the_others(
    tmp_path: Path, seam: Seam
) -> None:
    reference = small().run(tmp_path / "reference")
    original = lanes.execute

    def execute(plan: Any, variations: Any, **rest: Any) -> Any:
        if 3 in variations["target.seed"]:
            raise FmuError("target: has\nfailed")
        return original(plan, variations, **rest)

    seam.instead(lanes.execute, execute)
    table = small().run(tmp_path / "out")
    assert table["error"].dropna().to_dict() == {2: "target: has failed"}
    assert np.isnan(table["ekf.absolute_total_rms_m"][2])
    others = [i for i in range(8) if i != 2]
    assert table["ekf.inconsistent"][2] is pd.NA
    pd.testing.assert_frame_equal(
        table.iloc[others].astype({"ekf.inconsistent": bool, "ekf.misleading": bool}),
        reference.iloc[others],
        check_exact=True,
    )

    def broken(*_: Any, **__: Any) -> Any:
        raise BuildError("no compiler")

    seam.instead(lanes.execute, broken)
    with pytest.raises(BuildError):
        small().run(tmp_path / "no compiler")


def test_a_point_that_cannot_be_run_is_named_before_anything_runs(tmp_path: Path) -> None:
    made = small(
        factors={
            "tick": TICK,
            "receiver": {"keys": ["receiver.update_interval_s"], "levels": [0.1, 0.5]},
        }
    )
    with pytest.raises(ConfigurationError, match=r"small: point 2 \(tick = 0.5, receiver = 0.1\)"):
        made.run(tmp_path / "out")
    assert not (tmp_path / "out").exists()
    with pytest.raises(ConfigurationError, match="settling_time_s: must be less than the length"):
        small(settling_time_s=5.0).run(tmp_path / "out")
    with pytest.raises(ConfigurationError, match=r"\[factors.length\]: must change something"):
        small(
            fixed={}, factors={"length": {"keys": ["time.duration_s"], "levels": [5.0, 5.04]}}
        ).run(tmp_path / "out")
    seeds = {f"{name}.seed": 3 for name in ("target", "platform", "acoustics")}
    with pytest.raises(ConfigurationError, match="seed: must be left to the study"):
        small(fixed={"time.duration_s": 5.0, **seeds}).run(tmp_path / "out")
    with pytest.raises(ConfigurationError, match="master: must be python or native or lanes"):
        small().run(tmp_path / "out", master="fast")


def test_a_component_with_a_seed_of_its_own_keeps_it(tmp_path: Path) -> None:
    made = small(fixed={"time.duration_s": 5.0, "target.seed": 9})
    assert campaign.prepare(made).seeded == ("platform", "acoustics")


def test_any_run_can_be_replayed_with_its_full_record(tmp_path: Path) -> None:
    table = small(scenario="paper-scenario-3").run(tmp_path / "out")
    row = table.iloc[6]
    result = again.replay(tmp_path / "out", row["run_id"])
    assert result.seeds["acoustics"] == row["seed"]
    assert result.errors.loc["ekf", "absolute", "total"].rms_m == pytest.approx(
        row["ekf.absolute_total_rms_m"], rel=1e-12
    )
    assert "acoustics.range" in "".join(result.table.columns)
    for wrong in ("", "zz"):
        with pytest.raises(ConfigurationError, match="none of them"):
            again.replay(tmp_path / "out", wrong)
    with pytest.raises(ConfigurationError, match="must be a folder of a study's results"):
        again.replay(tmp_path, row["run_id"])


def test_a_run_of_other_fmus_is_not_replayed(
    tmp_path: Path, seam: Seam
) -> None:
    table = small().run(tmp_path / "out")
    original = campaign.point_digest
    seam.instead(again.point_digest, lambda *args: original(*args)[::-1])
    with pytest.raises(ConfigurationError, match="with the original FMUs and files"):
        again.replay(tmp_path / "out", table["run_id"][0])


def test_the_folder_says_what_was_run(tmp_path: Path) -> None:
    small(title="Small one").run(tmp_path / "out")
    content = json.loads((tmp_path / "out" / "study.json").read_text())
    assert content["definition"]["fmus"].keys() == {"target", "platform", "acoustics", "ekf"}
    assert "numpy" in content["software"]
    again = study.study_of(tmp_path / "out")
    assert again.title == "Small one"
    assert again.points == small().points
    assert campaign.prepare(again).definition() == content["definition"]


def test_progress_goes_from_nothing_to_all(tmp_path: Path) -> None:
    shares: list[float] = []
    small().run(tmp_path / "out", progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert all(0.0 <= share <= 1.0 for share in shares)
    small().run(tmp_path / "out", progress=shares.append)  # nothing is missing
    assert shares[-1] == 1.0
    shares.clear()
    runner.simulated(small(replicates=2), How(progress=shares.append))  # without a folder
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_runs_of_some_steps_are_kept_together(seam: Seam) -> None:
    seam.tuned(kept_steps=1000)
    made = campaign.prepare(small())  # the longest runs have 50 steps
    assert runner.kept_together(made, How(workers=1)) == 20
    assert runner.kept_together(made, How(workers=4)) == 4 * runner.SIDE_BY_SIDE


def test_progress_of_a_function_is_told_while_it_is_called() -> None:
    shares: list[float] = []
    made = study.load({
        "model": lambda gps: 2 * gps, "design": {"kind": "grid"},
        "factors": {"gps": {"levels": np.arange(1.0, 61.0).tolist()}},
    })  # fmt: skip
    table = runner.simulated(made, How(progress=shares.append))
    assert table["<lambda>.value"].tolist() == np.arange(2.0, 122.0, 2.0).tolist()
    assert shares == sorted(shares)
    assert len(shares) >= 20
    assert shares[-1] == 1.0


def test_a_part_has_the_runs_of_a_batch_and_progress_counts_them(
    tmp_path: Path, seam: Seam
) -> None:
    """Three points and batches of eight runs: three whole replicates at a time, in two parts."""
    seam.tuned(batch=8)
    noise = {"keys": ["acoustics.range_std_m"], "levels": [0.1, 0.2, 0.4]}
    made = small(replicates=10, design={"kind": "grid"}, factors={"noise": noise},
                 fixed={"time.duration_s": 2.0})  # fmt: skip
    shares: list[float] = []
    table = made.run(tmp_path / "out", workers=1, progress=shares.append)
    assert table["noise"].tolist() == [0.1, 0.2, 0.4] * 10
    parts = sorted((tmp_path / "out" / "parts").glob("*.parquet"))
    assert [int(part.name[:6]) for part in parts] == [1, 3, 4, 6, 7, 9, 10]
    assert [len(pd.read_parquet(part)) for part in parts] == [8, 1, 8, 1, 8, 1, 3]
    for alone in (False, True):
        if alone:
            shares.clear()
            runner.simulated(made, How(workers=1, progress=shares.append))
        assert shares == sorted(shares)
        for done in (8, 9, 17, 18, 26, 27, 30):
            assert min(abs(share - done / 30) for share in shares) < 1e-9, (alone, done)
    for part in (parts[1], parts[-1]):  # the third point of replicate 3, and replicate 10
        part.unlink()
    prepared = campaign.prepare(made)
    left = runner.missing(prepared, tmp_path / "out")
    assert (left.runs, left.steps, left.by_point) == (4, 4 * 20, (1, 1, 2))
    has = [[left.has(campaign.run_of(prepared, place, replicate)) for place in range(3)]
           for replicate in (2, 3, 10)]  # fmt: skip
    assert has == [[True] * 3, [True, True, False], [False] * 3]
    assert left.has_all(1, 3)
    assert not left.has_all(1, 4)
    assert left.has_all(4, 10)
    assert not left.has_all(4, 11)


def test_a_single_study_is_the_scenario_again_and_again(tmp_path: Path) -> None:
    alone = study.load(
        {"scenario": "paper-scenario-1", "fixed": {"time": {"duration_s": 5.0}},
         "design": {"kind": "single"}, "replicates": 3, "seed": 5}
    )
    assert alone.points.values == ((),)
    table = alone.run(tmp_path / "single")
    assert table["seed"].tolist() == [5, 6, 7]
    assert table["ekf.absolute_total_rms_m"].nunique() == 3


def test_a_single_study_has_no_factors() -> None:
    with pytest.raises(ConfigurationError, match="kind: must not be 'single' with factors"):
        small(design={"kind": "single"})


def test_another_label_is_not_another_study(tmp_path: Path) -> None:
    before = small(replicates=1, factors={"arm": ARM}).run(tmp_path / "s")
    named = {"arm": {**ARM, "label": "baseline", "unit": "m"}}
    pd.testing.assert_frame_equal(small(replicates=1, factors=named).run(tmp_path / "s"), before)
    kept = study.study_of(tmp_path / "s")
    assert (kept.labels, kept.units) == ({"arm": "baseline"}, {"arm": "m"})


@pytest.mark.parametrize("label", ["a × b", "mean", "gps"])
def test_labels_that_would_be_mistaken_for_something_else_are_refused(label: str) -> None:
    with pytest.raises(ConfigurationError, match=r"\[factors.arm\] label: must|label: must differ"):
        small(factors={"arm": {**ARM, "label": label}, "gps": GPS})


def test_a_number_among_names_is_written_so_that_it_can_be_read_back() -> None:
    given = ["developed", 8.5, 3, 0.123456789, 1e-9, 1234567.0]
    factor = tables.FactorTable(keys=("platform.wave_period_s",), levels=given)
    texts = ("developed", "8.5", "3", "0.123456789", "1e-09", "1234567.0")
    assert factor.values == texts
    assert factor.numbers == dict(zip(texts[1:], given[1:], strict=True))
    assert tables.FactorTable(levels=given[1:]).values == tuple(given[1:])
