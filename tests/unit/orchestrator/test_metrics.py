from __future__ import annotations

import numpy as np
import pytest
from sblcosim import metrics
from sblcosim.errors import FmuError
from sblcosim.record import Record
from scipy.stats import chi2
from synthetic_record import make_record, silent

SECOND = 1_000_000_000


def cubic(time_s):
    """A cubic in each axis, and its derivative; shape (n, 3)."""
    t = np.asarray(time_s, dtype=float)[:, None]
    a = np.array([[1.0, -2.0, 0.5]])
    return a * t**3 - t**2 + 3 * a * t + 7, 3 * a * t**2 - 2 * t + 3 * a


def test_truth_at_a_recorded_instant_is_the_recorded_row_bit_by_bit():
    rng = np.random.default_rng(1)
    time_ns = np.array([0, 3, 7, 20]) * SECOND // 10
    position, velocity = rng.normal(size=(2, 4, 3))
    p, v = metrics.state_at(time_ns, position, velocity, time_ns[[3, 0, 2]])
    assert (p == position[[3, 0, 2]]).all()
    assert (v == velocity[[3, 0, 2]]).all()


def test_truth_between_recorded_instants_is_exact_for_a_cubic():
    time_s = np.array([0.0, 0.4, 1.0, 2.5])
    epoch_s = np.array([0.1, 0.39, 0.7, 2.4999])
    p, v = metrics.state_at(
        (time_s * SECOND).astype(np.int64), *cubic(time_s), np.rint(epoch_s * SECOND).astype(int)
    )
    expected_p, expected_v = cubic(epoch_s)
    np.testing.assert_allclose(p, expected_p, rtol=1e-12)
    np.testing.assert_allclose(v, expected_v, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("epoch_ns", [-1, SECOND + 1])
def test_truth_outside_of_the_record_is_refused(epoch_ns):
    with pytest.raises(ValueError, match="recorded time"):
        metrics.state_at(
            np.array([0, SECOND]), np.zeros((2, 3)), np.zeros((2, 3)), np.array([epoch_ns])
        )


def test_platform_error_is_held_between_instants():
    time_ns = np.array([0, 10, 20])
    values = np.array([[1.0], [2.0], [3.0]])
    held = metrics.held_at(time_ns, values, np.array([0, 9, 10, 19, 20]))
    assert held[:, 0].tolist() == [1, 1, 2, 2, 3]


def test_absolute_error_is_estimate_minus_truth_and_relative_leaves_out_the_platform():
    record = make_record({"ekf": np.array([[1.0, -2, 3]])}, platform_error=(0.5, 0.5, 0.0))
    table = metrics.track(record, "ekf")
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
    tracks = {"ekf": metrics.track(make_record({"ekf": errors}), "ekf")}
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
    table = metrics.error_table({"ekf": metrics.track(make_record({"ekf": errors}), "ekf")})
    for frame in metrics.FRAMES:
        rms = table.loc[("ekf", frame), "rms_m"]
        assert rms["total"] == pytest.approx(np.sqrt((rms[["x", "y", "z"]] ** 2).sum()))
    np.testing.assert_allclose(table.rms_m**2, table.mean_m**2 + table.std_m**2)


def test_receiver_without_an_estimate_has_no_numbers_and_is_lost():
    record = silent("ekf")
    tracks = {"ekf": metrics.track(record, "ekf")}
    table, summary = metrics.error_table(tracks), metrics.summary(record, tracks)
    assert table["n"].eq(0).all()
    assert table["rms_m"].isna().all()
    assert summary.loc["ekf", "availability"] == 0
    assert summary.loc["ekf", "nees_position_verdict"] == "unknown"
    assert summary.loc["ekf", "lost"]


def test_receiver_with_the_required_ports_only_is_measured():
    record = make_record(optional_ports=False)
    tracks = {"ekf": metrics.track(record, "ekf")}
    row = metrics.summary(record, tracks).loc["ekf"]
    assert metrics.error_table(tracks).loc[("ekf", "absolute", "x"), "rms_m"] == pytest.approx(1)
    assert np.isnan(row.nees_position)
    assert np.isnan(row.nis)
    assert row.availability == pytest.approx(0.98)


def test_estimate_from_outside_of_the_run_is_an_error_that_names_the_receiver():
    record = make_record()
    values = {**record.values, "ekf.epoch": record.values["ekf.epoch"] + 100}
    with pytest.raises(FmuError, match=r"^ekf\.epoch: must lie within the run, 0 to 10 s, got 100"):
        metrics.track(Record(record.time_ns, values), "ekf")


def test_estimate_that_is_not_a_number_is_an_error_that_names_the_receiver():
    record = make_record({"ekf": np.array([[np.nan, 0, 0]])})
    with pytest.raises(FmuError, match=r"^ekf\.position: must be finite .* at epoch 0\.1 s"):
        metrics.track(record, "ekf")


def test_nees_by_hand():
    P = np.array([[4.0, 0], [0, 9]])
    error = np.array([[2.0, 3], [4, 0], [0, 0]])
    np.testing.assert_allclose(metrics.nees(error, np.tile(P, (3, 1, 1))), [2, 4, 0])


def test_nees_counts_correlation():
    # P = [[2, 1], [1, 2]], P⁻¹ = [[2, -1], [-1, 2]] / 3
    P = np.array([[[2.0, 1], [1, 2]]])
    assert metrics.nees(np.array([[1.0, 1]]), P)[0] == pytest.approx(2 / 3)
    assert metrics.nees(np.array([[1.0, -1]]), P)[0] == pytest.approx(2)


@pytest.mark.parametrize("P", [np.zeros((2, 2)), np.diag([1.0, 0]), np.diag([1.0, -1]),
                               np.diag([1.0, np.nan])])
def test_nees_of_a_useless_covariance_is_not_a_number_and_spoils_no_other(P):
    result = metrics.nees(np.ones((2, 2)), np.stack([P, np.eye(2)]))
    assert np.isnan(result[0])
    assert result[1] == pytest.approx(2)


def test_relative_nees_is_that_of_the_error_relative_to_the_platform():
    record = make_record({"ekf": np.array([[2.0, 0, 0]])}, platform_error=(1.5, 0.0, 0.0))
    tracks = {"ekf": metrics.track(record, "ekf")}
    np.testing.assert_allclose(tracks["ekf"]["relative_nees_position"], 0.5**2 / 0.25)
    row = metrics.summary(record, tracks).loc["ekf"]
    assert row.nees_position == pytest.approx(16)
    assert row.relative_nees_position == pytest.approx(1)
    assert row.relative_nees_position_expected == 3


def test_state_nees_takes_positions_and_velocities_in_the_paper_s_order():
    record = make_record({"ekf": np.array([[1.0, 0, 0]])})
    covariance = np.tile(np.diag([1.0, 100, 2, 200, 3, 300]), (101, 1, 1))
    velocity = record.values["target.velocity"] + np.array([0, 20.0, 0])
    values = {**record.values, "ekf.covariance": covariance, "ekf.velocity": velocity}
    table = metrics.track(Record(record.time_ns, values), "ekf")
    np.testing.assert_allclose(table["nees_position"], 1)
    np.testing.assert_allclose(table["nees_state"], 1 + 20**2 / 200)


def test_band_is_that_of_the_mean_of_independent_chi_squares():
    low, high = metrics.chi_square_band(150, 50)
    assert low == pytest.approx(chi2.ppf(0.025, 150) / 50)
    assert high == pytest.approx(chi2.ppf(0.975, 150) / 50)
    assert np.isnan(metrics.chi_square_band(0, 0)).all()


def test_band_holds_the_mean_nees_of_a_matched_gaussian_in_nineteen_runs_of_twenty():
    rng = np.random.default_rng(3)
    low, high = metrics.chi_square_band(3 * 40, 40)
    means = (rng.normal(size=(4000, 40, 3)) ** 2).sum(axis=2).mean(axis=1)
    inside = ((means >= low) & (means <= high)).mean()
    assert inside == pytest.approx(0.95, abs=4 * np.sqrt(0.05 * 0.95 / 4000))


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
    row = metrics.summary(record, {"ekf": metrics.track(record, "ekf")}).loc["ekf"]
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
    row = metrics.summary(record, {"ekf": metrics.track(record, "ekf")}).loc["ekf"]
    assert row.nis == pytest.approx(6)


@pytest.mark.parametrize(("error", "flag"), [(0.1, False), (1.0, True)])
def test_inconsistent_means_errors_beyond_what_the_filter_claims(error, flag):
    record = make_record({"ekf": np.array([[error, 0, 0]])}, variance=0.25)
    row = metrics.summary(record, {"ekf": metrics.track(record, "ekf")}).loc["ekf"]
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


def test_lost_compares_the_last_quarter_with_the_distance_to_the_platform():
    # the distance is 11.2 to 12.2 m
    late = np.zeros((99, 3))
    late[76:, 0] = 20
    early = np.zeros((99, 3))
    early[:70, 0] = 1000
    for errors, flag in ((late, True), (early, False), (np.array([[11.0, 0, 0]]), False)):
        record = make_record({"ekf": errors})
        assert metrics.lost(record, metrics.track(record, "ekf")) is flag
