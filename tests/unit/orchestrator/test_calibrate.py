from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
from sblcosim.calibrate import RANGE_TEST_M, calibrate
from sblcosim.errors import ConfigurationError, ConfigurationWarning


@pytest.fixture(scope="module")
def noisy():
    return calibrate(clock_offset=1e-4, pings=100, seed=3)


def test_without_noise_both_tests_give_the_true_speed_exactly():
    result = calibrate(sound_speed=1530.0, range_std=0.0, pings=2)
    assert result.known_distance.value == pytest.approx(1530, rel=1e-12)
    assert result.known_distance.std == pytest.approx(0, abs=1e-9)
    assert result.line.value == pytest.approx(1530, rel=1e-9)
    assert result.intercept_m == pytest.approx(0, abs=1e-9)


def test_range_test_is_the_paper_s_0_to_100_m_in_steps_of_5_m(noisy):
    assert tuple(range(0, 101, 5)) == RANGE_TEST_M
    assert noisy.table["distance_m"].tolist() == list(RANGE_TEST_M)
    assert (noisy.table["pings"] == 100).all()


def test_ranges_belong_to_their_distances():
    result = calibrate(
        sound_speed=1500.0, range_std=0.0, distances=(30.0, 0.0, 7.0), pings=3, distance=12.0
    )
    np.testing.assert_allclose(result.table["mean_m"], [30, 0, 7], atol=1e-12)
    np.testing.assert_allclose(result.table["std_m"], 0, atol=1e-12)


def test_noise_of_the_ranges_is_the_configured_one(noisy):
    # 21 distances with 99 degrees of freedom each
    pooled = np.sqrt((noisy.table["std_m"] ** 2).mean())
    assert pooled == pytest.approx(0.1, rel=4 / np.sqrt(2 * 21 * 99))


def test_line_tells_sound_speed_and_clock_apart(noisy):
    assert abs(noisy.line.value - 1530) < 4 * noisy.line.std
    assert abs(noisy.intercept_m - 1500 * 1e-4) < 4 * noisy.intercept_std_m
    assert noisy.slope == pytest.approx(1500 / 1530, abs=4 * noisy.slope_std)


def test_line_is_that_of_least_squares_over_all_pings(noisy):
    table, n = noisy.table, noisy.table["pings"].sum()
    d, mean = table["distance_m"], table["mean_m"]
    spread = 100 * ((d - d.mean()) ** 2).sum()
    slope = 100 * ((d - d.mean()) * mean).sum() / spread
    intercept = mean.mean() - slope * d.mean()
    residuals = 99 * table["std_m"] ** 2 + 100 * (mean - intercept - slope * d) ** 2
    variance = residuals.sum() / (n - 2)
    assert noisy.slope == pytest.approx(slope, rel=1e-12)
    assert noisy.intercept_m == pytest.approx(intercept, rel=1e-9)
    assert noisy.slope_std == pytest.approx(np.sqrt(variance / spread), rel=1e-9)
    assert noisy.intercept_std_m == pytest.approx(
        np.sqrt(variance * (1 / n + d.mean() ** 2 / spread)), rel=1e-9
    )
    assert noisy.line.value == pytest.approx(1500 / slope, rel=1e-12)


def test_uncertainty_of_a_speed_is_that_of_its_slope_carried_over():
    # far apart, so that the slope is far from 1
    result = calibrate(sound_speed=1400.0, assumed_sound_speed=1700.0, pings=5, seed=2)
    assert result.slope > 1.2
    speed = 1700 / (result.slope + np.array([-1e-6, 1e-6]))
    derivative = (speed[0] - speed[1]) / 2e-6
    assert result.line.std == pytest.approx(derivative * result.slope_std, rel=1e-6)
    assert result.known_distance.std == pytest.approx(
        result.per_ping_m_s / np.sqrt(5), rel=1e-12
    )


def test_a_clock_s_error_is_told_in_the_time_of_the_clock():
    # the receiver multiplies it with the speed it assumes, whatever the true one
    few = {"clock_offset": 1e-4, "range_std": 0.0, "pings": 2}
    for assumed in (1450.0, 1600.0):
        result = calibrate(sound_speed=1530.0, assumed_sound_speed=assumed, **few)
        assert result.intercept_m == pytest.approx(assumed * 1e-4)
        assert "the intercept is an error of clock and delay of 100.0 µs" in str(result)


def test_known_distance_takes_a_clock_error_for_sound_speed(noisy):
    biased = 1500 * 10 / (1500 * (10 / 1530 + 1e-4))
    assert abs(noisy.known_distance.value - biased) < 4 * noisy.known_distance.std
    assert abs(noisy.known_distance.value - 1530) > 4 * noisy.known_distance.std


def test_ten_metres_with_a_tenth_of_a_metre_are_good_to_15_m_s_per_ping(noisy):
    assert noisy.per_ping_m_s == pytest.approx(15.3, rel=0.3)
    assert noisy.known_distance.std == pytest.approx(noisy.per_ping_m_s / 10)


def test_uncertainty_covers_the_truth_as_often_as_it_claims():
    hits = 0
    for seed in range(1, 41):
        result = calibrate(seed=seed, pings=20, distances=(0.0, 1.0, 2.0))
        hits += abs(result.known_distance.value - 1530) < 1.96 * result.known_distance.std
    assert 34 <= hits <= 40  # binomial(40, 0.94), 19 degrees of freedom


def test_uncertainty_of_the_distance_counts():
    result = calibrate(range_std=0.0, pings=2, distance_std=0.1)
    assert result.known_distance.std == pytest.approx(15.3)


@pytest.mark.parametrize(("distance", "distance_std"), [(4.0, 0.02), (25.0, 0.3), (100.0, 2.0)])
def test_errors_of_distance_and_ranges_add_as_squares(distance, distance_std):
    result = calibrate(distance=distance, distance_std=distance_std, range_std=0.4, pings=30)
    exact = calibrate(distance=distance, range_std=0.4, pings=30)
    assert result.known_distance.value == exact.known_distance.value
    of_distance = result.known_distance.value * distance_std / distance
    of_ranges = exact.per_ping_m_s / np.sqrt(30)
    assert exact.known_distance.std == pytest.approx(of_ranges)
    assert result.known_distance.std == pytest.approx(np.hypot(of_distance, of_ranges))
    assert result.per_ping_m_s == exact.per_ping_m_s  # a property of the ranges alone


def test_a_wrong_distance_is_within_its_uncertainty_as_often_as_that_says():
    # A distance that is 1 m too long by the tape gives a speed that is too high by the same share.
    true, by_tape = 20.0, 21.0
    ranges = 1500.0 / 1530.0 * true
    assert 1500.0 * by_tape / ranges == pytest.approx(1530.0 * by_tape / true)
    result = calibrate(distance=true, range_std=0.0, pings=2, distance_std=by_tape - true)
    assert result.known_distance.std == pytest.approx(1530.0 * by_tape / true - 1530.0)


def test_the_error_of_the_range_test_is_mean_less_distance():
    result = calibrate(clock_offset=1e-3, range_std=0.0, sound_speed=1500.0, pings=2)
    np.testing.assert_allclose(result.table["error_m"], 1.5, rtol=1e-9)  # too long: above zero
    slow = calibrate(range_std=0.0, sound_speed=1530.0, pings=2).table
    np.testing.assert_allclose(
        slow["error_m"], slow["distance_m"] * (1500.0 / 1530.0 - 1.0), atol=1e-9
    )


def test_corrected_processing_delay_leaves_no_trace():
    delays = {"range_std": 0.0, "pings": 2, "processing_delay": 2e-3}
    assert calibrate(**delays).intercept_m == pytest.approx(3.0)
    corrected = calibrate(**delays, processing_delay_correction=2e-3)
    assert corrected.intercept_m == pytest.approx(0, abs=1e-9)


def test_same_seed_same_calibration_and_another_seed_another():
    few = {"pings": 2, "distances": (0.0, 5.0, 10.0)}
    first, again, other = (calibrate(seed=seed, **few) for seed in (1, 1, 2))
    assert first.to_json() == again.to_json()
    assert first.known_distance.value != other.known_distance.value


def test_text_states_result_and_uncertainty(noisy):
    text = str(noisy)
    assert f"{noisy.known_distance.value:.1f} ± {noisy.known_distance.std:.1f} m/s" in text
    assert f"{noisy.line.value:.2f} ± {noisy.line.std:.2f} m/s" in text
    assert f"standard deviation of a single ping {noisy.per_ping_m_s:.1f} m/s" in text
    assert len(text.splitlines()) > len(RANGE_TEST_M)


def test_saved_folder_holds_table_figure_and_manifest(noisy, tmp_path):
    folder = noisy.save(tmp_path / "calibration")
    assert {path.name for path in folder.iterdir()} == {
        "manifest.json", "range_test.csv", "range_test.parquet", "range_test.png", "range_test.svg"
    }
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["calibration"]["settings"]["seed"] == 3
    assert manifest["calibration"]["line"]["value"] == noisy.line.value


@pytest.mark.parametrize(
    ("argument", "value"),
    [("sound_speed", 0.0), ("distance", -1.0), ("range_std", -0.1), ("distance_std", np.nan),
     ("pings", 1), ("distances", (0.0, 5.0, 5.0)), ("distances", (-1.0, 0.0, 5.0))],
)
def test_bad_argument_is_refused_by_name(argument, value):
    with pytest.raises(ConfigurationError, match=f"^calibrate {argument}: must be"):
        calibrate(**{argument: value})


@pytest.mark.parametrize("argument", ["sound_speed", "assumed_sound_speed"])
def test_a_speed_that_sound_has_in_no_water_is_told(argument):
    said = f"^calibrate {argument}: should be from 1350 to 1650 m/s, as in water, got 1.5 m/s$"
    with pytest.warns(ConfigurationWarning, match=said):
        calibrate(**{argument: 1.5}, pings=2)


@pytest.mark.parametrize(
    "argument", ["sound_speed", "assumed_sound_speed", "distance", "range_std", "distance_std"]
)
def test_a_refusal_says_whether_0_is_possible(argument):
    with pytest.raises(ConfigurationError) as refused:
        calibrate(**{argument: -1.0})
    bound = str(refused.value).removeprefix(f"calibrate {argument}: must be ")
    if bound == "at least 0, got -1.0":
        calibrate(**{argument: 0.0}, pings=2)
        return
    assert bound == "more than 0, got -1.0"
    with pytest.raises(ConfigurationError, match=f"{argument}: must be more than 0, got 0.0"):
        calibrate(**{argument: 0.0}, pings=2)


def test_what_takes_long_to_import_waits_until_it_is_used():
    code = "import sys, sblcosim.calibrate; sys.exit('statsmodels' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
