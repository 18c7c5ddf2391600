"""What is said of an estimate; everything else that judges is held to this."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sblcosim.data import truth
from sblcosim.data.record import NEVER, Record, epochs_ns
from sblcosim.judge import definitions, metrics
from scipy.stats import chi2
from synthetic_record import make_record

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
    p, v = truth.state_at(time_ns, position, velocity, time_ns[[3, 0, 2]])
    assert (p == position[[3, 0, 2]]).all()
    assert (v == velocity[[3, 0, 2]]).all()


def test_truth_between_recorded_instants_is_exact_for_a_cubic():
    time_s = np.array([0.0, 0.4, 1.0, 2.5])
    epoch_s = np.array([0.1, 0.39, 0.7, 2.4999])
    p, v = truth.state_at(
        (time_s * SECOND).astype(np.int64), *cubic(time_s), np.rint(epoch_s * SECOND).astype(int)
    )
    expected_p, expected_v = cubic(epoch_s)
    np.testing.assert_allclose(p, expected_p, rtol=1e-12)
    np.testing.assert_allclose(v, expected_v, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("epoch_ns", [-1, SECOND + 1])
def test_truth_outside_of_the_record_is_refused(epoch_ns):
    with pytest.raises(ValueError, match="recorded time"):
        truth.state_at(
            np.array([0, SECOND]), np.zeros((2, 3)), np.zeros((2, 3)), np.array([epoch_ns])
        )


def test_platform_error_is_held_between_instants():
    time_ns = np.array([0, 10, 20])
    values = np.array([[1.0], [2.0], [3.0]])
    held = truth.held_at(time_ns, values, np.array([0, 9, 10, 19, 20]))
    assert held[:, 0].tolist() == [1, 1, 2, 2, 3]


def test_nees_by_hand():
    P = np.array([[4.0, 0], [0, 9]])
    error = np.array([[2.0, 3], [4, 0], [0, 0]])
    np.testing.assert_allclose(definitions.nees(error, np.tile(P, (3, 1, 1))), [2, 4, 0])


def test_nees_counts_correlation():
    # P = [[2, 1], [1, 2]], P⁻¹ = [[2, -1], [-1, 2]] / 3
    P = np.array([[[2.0, 1], [1, 2]]])
    assert definitions.nees(np.array([[1.0, 1]]), P)[0] == pytest.approx(2 / 3)
    assert definitions.nees(np.array([[1.0, -1]]), P)[0] == pytest.approx(2)


@pytest.mark.parametrize("P", [np.zeros((2, 2)), np.diag([1.0, 0]), np.diag([1.0, -1]),
                               np.diag([1.0, np.nan])])
def test_nees_of_a_useless_covariance_is_not_a_number_and_spoils_no_other(P):
    result = definitions.nees(np.ones((2, 2)), np.stack([P, np.eye(2)]))
    assert np.isnan(result[0])
    assert result[1] == pytest.approx(2)


def test_band_is_that_of_the_mean_of_independent_chi_squares():
    low, high = definitions.chi_square_band(150, 50)
    assert low == pytest.approx(chi2.ppf(0.025, 150) / 50)
    assert high == pytest.approx(chi2.ppf(0.975, 150) / 50)
    assert np.isnan(definitions.chi_square_band(0, 0)).all()


def test_band_holds_the_mean_nees_of_a_matched_gaussian_in_nineteen_runs_of_twenty():
    rng = np.random.default_rng(3)
    low, high = definitions.chi_square_band(3 * 40, 40)
    means = (rng.normal(size=(4000, 40, 3)) ** 2).sum(axis=2).mean(axis=1)
    inside = ((means >= low) & (means <= high)).mean()
    assert inside == pytest.approx(0.95, abs=4 * np.sqrt(0.05 * 0.95 / 4000))

def off_grid(step_s=0.02, **changes):
    """The hand-made record with epochs that are later by `step_s`; positions as they are."""
    record = make_record()
    epoch = record.values["ekf.epoch"] + step_s
    return replace(record, values={**record.values, "ekf.epoch": epoch, **changes})


def test_an_epoch_is_the_instant_whose_time_in_seconds_it_is_else_the_nearest_nanosecond():
    time_ns = np.arange(5) * SECOND // 10
    given = np.array([0.3, 0.1 + 0.2, 0.3 + 4e-10, 0.35, -1.25])
    found = epochs_ns(time_ns, given)
    assert found.tolist() == [300_000_000, 300_000_000, 300_000_000, 350_000_000, -1_250_000_000]


@pytest.mark.parametrize("start_s", [0, 100, 9_000_000, 1_700_000_000, 3_999_000_000])
def test_every_instant_is_found_by_its_time_in_seconds(start_s):
    time_ns = start_s * SECOND + np.arange(2000) * SECOND // 30
    assert (epochs_ns(time_ns, time_ns / 1e9) == time_ns).all()


@pytest.mark.parametrize("epoch", [np.nan, np.inf, -np.inf, 1e300])
def test_what_is_no_time_is_never(epoch):
    assert epochs_ns(np.array([0, 1]), np.array([epoch])) == NEVER


@pytest.mark.parametrize("step_s", [0.0, 0.02, -0.07, 1e-9, 0.2])
def test_an_estimate_is_judged_at_its_epoch_wherever_in_the_run_it_is(step_s):
    judged = definitions.judge(off_grid(step_s), "ekf")
    assert not judged.broken[:-2].any()
    # the diver swims north at 0.5 m/s
    np.testing.assert_allclose(
        judged.error[:-2], [[1 - 0.5 * step_s, 0, 0]] * len(judged.error[:-2]), atol=1e-12
    )


@pytest.mark.parametrize("bad", [-0.2, 10.2, np.nan, np.inf])
def test_an_epoch_outside_of_the_run_is_broken(bad):
    record = off_grid()
    record.values["ekf.epoch"][50] = bad
    judged = definitions.judge(record, "ekf")
    assert np.flatnonzero(judged.broken).tolist() == [48]


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e200])
def test_an_error_that_cannot_be_squared_is_broken(bad):
    record = make_record()
    record.values["ekf.position"][50, 1] = bad
    assert np.flatnonzero(definitions.judge(record, "ekf").broken).tolist() == [48]


def test_truth_is_read_at_the_target_s_own_instants_only():
    """In between the target shows where it was."""
    fine = make_record()
    values = dict(fine.values)
    for name in ("target.position", "target.velocity"):
        values[name] = np.repeat(fine.values[name][::5], 5, axis=0)[:101]
    coarse = Record(fine.time_ns, values, {"target": 500_000_000})
    np.testing.assert_allclose(
        definitions.judge(coarse, "ekf").true_position,
        definitions.judge(fine, "ekf").true_position, atol=1e-12,
    )


def test_platform_error_and_distance_are_of_the_last_instant_before_the_epoch():
    record = make_record()
    beacon = record.values["platform.beacon_position"]
    reported = beacon + np.arange(101)[:, None, None] * [1.0, 0, 0]
    record = off_grid(
        0.09,
        **{"platform.reported_beacon_position": reported,
           "platform.position": np.arange(101)[:, None] * [0.0, 1, 0]},
    )
    judged = definitions.judge(record, "ekf")
    np.testing.assert_allclose(judged.platform_error[:98, 0], np.arange(1, 99))
    away = judged.true_position[:98] - np.arange(1, 99)[:, None] * [0.0, 1, 0]
    np.testing.assert_allclose(judged.distance_square[:98], (away**2).sum(axis=1))


@pytest.mark.parametrize("start_s", [0, 7, -3, 1_700_000_000])
def test_late_is_the_last_quarter_of_the_run_wherever_it_starts(start_s):
    record = make_record()
    shifted = Record(
        record.time_ns + start_s * SECOND,
        {**record.values, "ekf.epoch": (record.time_ns + start_s * SECOND)[
            np.maximum(record.values["ekf.update_count"], 0)] / 1e9},
    )  # fmt: skip
    late = definitions.judge(shifted, "ekf").late
    assert late.sum() == 25  # epochs 7.5, 7.6 … 9.9 s of a run of 10 s
    assert np.flatnonzero(late)[0] == 74
    start = start_s * SECOND
    assert definitions.late_from_ns(start, start + 10 * SECOND) == start + 7_500_000_000


@pytest.mark.parametrize("d", [1, 2, 3, 6])
def test_nees_is_that_of_the_inverse(d):
    rng = np.random.default_rng(d)
    root = rng.normal(size=(200, d, d))
    P = root @ root.transpose(0, 2, 1) + 0.1 * np.eye(d)
    e = rng.normal(size=(200, d))
    expected = np.einsum("mi,mij,mj->m", e, np.linalg.inv(P), e)
    np.testing.assert_allclose(definitions.nees(e, P), expected, rtol=1e-9)


@pytest.mark.parametrize("d", [3, 6])
@pytest.mark.parametrize("change", [
    lambda P: P - 2 * np.eye(len(P)), lambda P: P * 0, lambda P: np.ones_like(P),
    lambda P: P * np.nan, lambda P: P + np.diag([np.inf] + [0.0] * (len(P) - 1)),
    lambda P: P + np.diag([0.0] * (len(P) - 1) + [-1.0]),
])  # fmt: skip
def test_a_covariance_that_is_not_positive_definite_has_no_nees(d, change):
    with np.errstate(invalid="ignore"):
        P = change(np.eye(d))
    assert np.isnan(definitions.nees(np.ones((1, d)), P[None])[0])


def test_inconsistent_is_above_the_two_sided_95_percent_band():
    n = np.array([40, 40, 40, 0])
    bound = chi2.ppf(0.975, 120) / 40
    mean = np.array([bound * (1 - 1e-9), bound * (1 + 1e-9), 0.0, np.nan])
    flags, known = definitions.inconsistent(mean, n)
    assert flags.tolist() == [False, True, False, False]
    assert known.tolist() == [True, True, True, False]


def test_lost_is_silent_at_the_end_or_farther_off_than_the_platform():
    assert definitions.lost(0, 0.0, 0.0)
    assert definitions.lost(3, 2.0, 1.9)
    assert not definitions.lost(3, 1.9, 2.0)


def test_at_a_bound_a_run_is_neither_inconsistent_nor_lost():
    samples = np.array([0, 1, 7, 7, 7])
    low, high = definitions.chi_square_band(3 * samples, samples)
    mean = np.array([np.nan, high[1], high[2], np.nextafter(high[3], 9), 3.0])
    flagged, known = definitions.inconsistent(mean, samples)
    assert flagged.tolist() == [False, False, False, True, False]
    assert known.tolist() == [False, True, True, True, True]
    for value, word in (
        (low[2], "consistent"), (high[2], "consistent"), (np.nextafter(low[2], 0), "pessimistic"),
        (np.nextafter(high[2], 9), "optimistic"), (np.nan, "unknown"),
    ):
        assert metrics.verdict(value, (low[2], high[2])) == word
    assert metrics.verdict(3.0, (low[0], high[0])) == "unknown"
    lost = definitions.lost(np.array([0, 1, 1, 1]), np.array([0.0, 4.0, 4.5, 0.0]), 4.0)
    assert lost.tolist() == [True, False, True, False]
