from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from sblcosim.data.record import Record
from sblcosim.data.truth import Truth
from sblcosim.errors import FmuError
from sblcosim.judge import metrics, over_runs
from sblcosim.results.responses import RESPONSES, Run, value_of
from scipy.stats import chi2
from synthetic_record import judged_in, make_record, silent, summary, track

SECOND = 1_000_000_000


def test_absolute_error_is_estimate_minus_truth_and_relative_leaves_out_the_platform():
    record = make_record({"ekf": np.array([[1.0, -2, 3]])}, platform_error=(0.5, 0.5, 0.0))
    table = track(record, "ekf")
    assert table["epoch_s"].iloc[0] == 0.1
    np.testing.assert_allclose(table[["error_x_m", "error_y_m", "error_z_m"]], [[1, -2, 3]] * 99)
    np.testing.assert_allclose(
        table[["relative_error_x_m", "relative_error_y_m", "relative_error_z_m"]],
        [[0.5, -2.5, 3]] * 99,
    )
    np.testing.assert_allclose(table["error_total_m"], np.sqrt(14))


def test_error_table_gives_mean_rms_and_standard_deviation_by_hand():
    # x: 3, -1, 1, 1; y: 4, 0, 0, 0; lengths 5, 1, 1, 1
    errors = np.array([[3.0, 4, 0], [-1, 0, 0], [1, 0, 0], [1, 0, 0]])
    tracks = {"ekf": track(make_record({"ekf": errors}), "ekf")}
    table = metrics.error_table(tracks)
    np.testing.assert_allclose(
        table.loc[("ekf", "absolute")].to_numpy(),
        [
            [1, np.sqrt(3), np.sqrt(2), 4],
            [1, 2, np.sqrt(3), 4],
            [0, 0, 0, 4],
            [2, np.sqrt(7), np.sqrt(3), 4],
        ],
        atol=1e-12,
    )
    assert table.columns.tolist() == ["mean_m", "rms_m", "std_m", "n"]
    assert table.index.names == ["receiver", "frame", "axis"]


def test_error_table_keeps_the_paper_s_sum_of_squares():
    errors = np.random.default_rng(2).normal(size=(80, 3))
    table = metrics.error_table({"ekf": track(make_record({"ekf": errors}), "ekf")})
    for frame in ("absolute", "relative"):
        rms = table.loc[("ekf", frame), "rms_m"]
        assert rms["total"] == pytest.approx(np.sqrt((rms[["x", "y", "z"]] ** 2).sum()))
    np.testing.assert_allclose(table.rms_m**2, table.mean_m**2 + table.std_m**2)


def test_receiver_without_an_estimate_has_no_numbers_and_is_lost():
    record = silent("ekf")
    tracks = {"ekf": track(record, "ekf")}
    table, told = metrics.error_table(tracks), summary(record, tracks)
    assert table["n"].eq(0).all()
    assert table["rms_m"].isna().all()
    assert told.loc["ekf", "availability"] == 0
    assert told.loc["ekf", "nees_position_verdict"] == "unknown"
    assert pd.isna(told.loc["ekf", "inconsistent"])
    assert told.loc["ekf", "lost"]


def test_receiver_with_the_required_ports_only_is_measured():
    record = make_record(optional_ports=False)
    tracks = {"ekf": track(record, "ekf")}
    row = summary(record, tracks).loc["ekf"]
    assert metrics.error_table(tracks).loc[("ekf", "absolute", "x"), "rms_m"] == pytest.approx(1)
    assert np.isnan(row.nees_position)
    assert pd.isna(row.inconsistent)
    assert np.isnan(row.nis)
    assert row.availability == pytest.approx(0.98)


def test_estimate_from_outside_of_the_run_is_an_error_that_names_the_receiver():
    record = make_record()
    values = {**record.values, "ekf.epoch": record.values["ekf.epoch"] + 100}
    with pytest.raises(FmuError, match=r"^ekf\.epoch: must lie within the run, 0 to 10 s, got 100"):
        track(Record(record.time_ns, values), "ekf")


def test_estimate_that_is_not_a_number_is_an_error_that_names_the_receiver():
    record = make_record({"ekf": np.array([[np.nan, 0, 0]])})
    with pytest.raises(FmuError, match=r"^ekf\.position: must be finite, .* at epoch 0\.1 s"):
        track(record, "ekf")


def test_estimate_whose_error_has_no_finite_square_is_an_error_that_names_the_receiver():
    record = make_record({"ekf": np.array([[1e200, 0, 0]])})
    with pytest.raises(FmuError, match=r"^ekf\.position: must be finite, and so must its square"):
        track(record, "ekf")


@pytest.mark.parametrize("name", ["target.position", "platform.reported_beacon_position"])
def test_truth_that_is_not_a_number_is_an_error_that_names_it(name):
    record = make_record()
    record.values[name][20] = np.nan
    with pytest.raises(FmuError, match=rf"^{name.replace('.', '[.]')}: must be finite"):
        track(record, "ekf")


def test_an_epoch_that_is_no_time_is_an_error_that_says_so():
    record = make_record()
    record.values["ekf.epoch"][20] = np.nan
    with pytest.raises(FmuError, match=r"^ekf\.epoch: must lie within the run, .* got no time$"):
        track(record, "ekf")


def test_relative_nees_is_that_of_the_error_relative_to_the_platform():
    record = make_record({"ekf": np.array([[2.0, 0, 0]])}, platform_error=(1.5, 0.0, 0.0))
    tracks = {"ekf": track(record, "ekf")}
    np.testing.assert_allclose(tracks["ekf"]["relative_nees_position"], 0.5**2 / 0.25)
    row = summary(record, tracks).loc["ekf"]
    assert row.nees_position == pytest.approx(16)
    assert row.relative_nees_position == pytest.approx(1)
    assert row.relative_nees_position_expected == 3


def own(record, error, covariance=None):
    """The record with a relative position that is off by an error."""
    away = record.values["target.position"] - record.values["platform.position"]
    count = record.values["ekf.update_count"]
    values = {**record.values, "ekf.relative_position": away[count] + error}
    if covariance is not None:
        values["ekf.relative_covariance"] = np.tile(covariance, (101, 1, 1))
    return Record(record.time_ns, values)


def test_own_relative_error_is_against_the_platform_s_true_position_whatever_it_reports():
    record = make_record(platform_error=(7.0, 0.0, 0.0))
    north = np.arange(101)[:, None] * [0.3, 0.0, 0.0]
    record = Record(record.time_ns, {**record.values, "platform.position": north})
    table = track(own(record, [1.0, 2.0, -2.0], np.diag([1.0, 4.0, 4.0])), "ekf")
    names = [f"own_relative_error_{axis}_m" for axis in ("x", "y", "z", "total")]
    np.testing.assert_allclose(table[names], [[1, 2, -2, 3]] * 99)
    np.testing.assert_allclose(table["own_relative_nees_position"], 3)
    stds = [f"own_relative_std_{axis}_m" for axis in ("x", "y", "z")]
    np.testing.assert_allclose(table[stds], [[1, 2, 2]] * 99)
    before = track(record, "ekf")
    pd.testing.assert_frame_equal(table[before.columns], before)


def test_own_relative_errors_without_a_covariance_have_no_nees():
    record = own(make_record(), [3.0, 0.0, 4.0])
    tracks = {"ekf": track(record, "ekf")}
    assert "own_relative_nees_position" not in tracks["ekf"]
    assert metrics.error_table(tracks).loc[("ekf", "own_relative", "total"), "rms_m"] == 5
    row = summary(record, tracks).loc["ekf"]
    assert np.isnan(row.own_relative_nees_position)
    assert row.own_relative_nees_position_verdict == "unknown"


def test_of_a_receiver_without_the_port_there_is_nothing_own_relative():
    tracks = {"ekf": track(make_record(), "ekf")}
    assert not [c for c in tracks["ekf"] if c.startswith("own_relative")]
    assert metrics.frames_of(tracks["ekf"]) == ["absolute", "relative"]
    for table in (metrics.error_table(tracks), metrics.percentile_table(tracks)):
        assert set(table.index.get_level_values("frame")) == {"absolute", "relative"}


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e200])
def test_a_relative_position_that_cannot_be_squared_is_an_error_that_names_it(bad):
    with pytest.raises(FmuError, match=r"^ekf\.relative_position: must be finite"):
        track(own(make_record(), [0.0, bad, 0.0]), "ekf")


def test_state_nees_takes_positions_and_velocities_in_the_paper_s_order():
    record = make_record({"ekf": np.array([[1.0, 0, 0]])})
    covariance = np.tile(np.diag([1.0, 100, 2, 200, 3, 300]), (101, 1, 1))
    velocity = record.values["target.velocity"] + np.array([0, 20.0, 0])
    values = {**record.values, "ekf.covariance": covariance, "ekf.velocity": velocity}
    table = track(Record(record.time_ns, values), "ekf")
    np.testing.assert_allclose(table["nees_position"], 1)
    np.testing.assert_allclose(table["nees_state"], 1 + 20**2 / 200)


@pytest.mark.parametrize(
    ("mean", "word"),
    [(2, "consistent"), (0.5, "pessimistic"), (3.5, "optimistic"), (np.nan, "unknown")],
)
def test_verdict(mean, word):
    assert metrics.verdict(mean, (1.0, 3.0)) == word


def test_nis_band_counts_the_degrees_of_each_update():
    record = make_record()
    degrees = np.where(np.arange(101) % 2, 1, 4)
    values = {**record.values, "ekf.nis_degrees": degrees, "ekf.nis": degrees.astype(float)}
    record = Record(record.time_ns, values)
    row = summary(record, ["ekf"]).loc["ekf"]
    total = degrees[2:].sum()
    assert row.nis == pytest.approx(total / 99)
    assert row.nis_low == pytest.approx(chi2.ppf(0.025, total) / 99)
    assert row.nis_expected == pytest.approx(total / 99)
    assert row.nis_verdict == "consistent"


def test_updates_without_a_measurement_do_not_count_in_the_nis():
    record = make_record()
    degrees = np.where(np.arange(101) < 50, 0, 5)
    values = {**record.values, "ekf.nis_degrees": degrees, "ekf.nis": np.where(degrees, 6.0, 0.0)}
    record = Record(record.time_ns, values)
    row = summary(record, ["ekf"]).loc["ekf"]
    assert row.nis == pytest.approx(6)


def test_nis_without_degrees_is_that_of_the_updates_with_a_measurement() -> None:
    record = make_record()
    values = {k: v for k, v in record.values.items() if k != "ekf.nis_degrees"}
    k = np.arange(101.0)
    run = Run(Record(record.time_ns, {**values, "ekf.nis": np.where(k % 7 == 3, np.nan, k)}), "ekf")
    mean = k[2:][k[2:] % 7 != 3].mean()
    assert value_of(RESPONSES["nis"], run) == pytest.approx(mean)
    assert value_of(RESPONSES["nis_degrees"], run) == 0


@pytest.mark.parametrize(("error", "flag"), [(0.1, False), (1.0, True)])
def test_inconsistent_means_errors_beyond_what_the_filter_claims(error, flag):
    record = make_record({"ekf": np.array([[error, 0, 0]])}, variance=0.25)
    row = summary(record, ["ekf"]).loc["ekf"]
    assert row.nees_position == pytest.approx(error**2 / 0.25)
    assert row.inconsistent == flag


def test_availability_is_a_share_of_time_not_of_instants():
    time_ns = np.array([0, 1, 2, 10])
    assert metrics.availability(time_ns, np.array([False, False, True, True])) == 0.8


def test_update_share_counts_what_was_due_and_could_be_read():
    time_ns = np.arange(11) * 100
    # updates due at 200, 400, 600, 800; the one at 1000 would show after the end
    assert metrics.update_share(time_ns, np.array([0] * 5 + [1] * 5 + [3]), 200) == 0.75
    assert np.isnan(metrics.update_share(time_ns, np.zeros(11, int), 1000))


@pytest.mark.parametrize("counted", [0, 1])
@pytest.mark.parametrize("instants", [1, 2, 11])
def test_where_no_update_is_due_there_is_no_share_of_updates(instants, counted):
    """Whatever a receiver counts: a share of nothing would be infinite."""
    time_ns, count = np.arange(instants) * 100, np.linspace(0, counted, instants).astype(int)
    for interval in (int(time_ns[-1]) or 1, 2000):
        assert np.isnan(metrics.update_share(time_ns, count, interval))


@pytest.mark.parametrize("known", [True, False])
def test_at_a_single_instant_an_estimate_made_afterwards_is_available_or_not(known):
    record = make_record() if known else silent("ekf")
    judged = judged_in(record, "ekf")
    truth = Truth(time_ns=record.time_ns[:1], position=record.values["target.position"][:1])
    row = metrics.summary({"ekf": judged}, {"ekf": metrics.track(judged)}, truth).loc["ekf"]
    assert row.availability == float(known)
    assert np.isnan(row.update_share)


def test_lost_compares_the_last_quarter_with_the_distance_to_the_platform():
    # the distance is 11.2 to 12.2 m
    late = np.zeros((99, 3))
    late[76:, 0] = 20
    early = np.zeros((99, 3))
    early[:70, 0] = 1000
    for errors, flag in ((late, True), (early, False), (np.array([[11.0, 0, 0]]), False)):
        record = make_record({"ekf": errors})
        assert metrics.lost(judged_in(record, "ekf")) is flag


def test_lost_measures_from_the_platform_and_not_from_the_origin():
    """11 m off, 11.2 to 12.2 m from the platform, which is 100 m from the origin."""
    for off, flag in ((11.0, False), (20.0, True)):
        record = make_record({"ekf": np.array([[off, 0, 0]])})
        away = np.array([100.0, 0, 0])
        values = {
            name: v + away if name in ("target.position", "ekf.position", "platform.position")
            else v
            for name, v in record.values.items()
        }
        assert metrics.lost(judged_in(Record(record.time_ns, values), "ekf")) is flag


def test_a_receiver_that_falls_silent_in_the_last_quarter_is_lost():
    for estimates, flag in ((70, True), (80, False)):
        record = make_record({"ekf": np.tile([[0.1, 0, 0]], (estimates, 1))})
        told = summary(record, ["ekf"])
        assert bool(told.loc["ekf", "lost"]) is flag


def test_inconsistent_of_receivers_that_say_it_and_of_one_that_does_not():
    record = make_record({"good": np.array([[0.1, 0, 0]]), "bad": np.array([[5.0, 0, 0]])})
    tracks = {name: track(record, name) for name in ("good", "bad")}
    assert summary(record, tracks)["inconsistent"].dtype == bool
    values = {k: v for k, v in record.values.items() if k != "good.covariance"}
    record = Record(record.time_ns, values)
    tracks = {name: track(record, name) for name in ("good", "bad")}
    flags = summary(record, tracks)["inconsistent"]
    assert flags.isna().tolist() == [True, False]
    assert flags["bad"]


def test_an_rms_over_runs_is_the_root_of_the_mean_of_the_squares():
    rms, groups = pd.Series([3.0, 4.0, np.nan, 1.0, np.nan]), pd.Series([7, 7, 7, 2, 5])
    assert over_runs.pooled(rms.to_numpy()) == pytest.approx(np.sqrt((9 + 16 + 1) / 3))
    assert np.isnan(over_runs.pooled(rms.to_numpy()[2:3]))
    found = over_runs.pooled_by(rms, groups)
    assert found.index.tolist() == [2, 5, 7]
    assert found.to_numpy() == pytest.approx([1.0, np.nan, np.sqrt(12.5)], nan_ok=True)
