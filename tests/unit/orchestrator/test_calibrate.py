from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
from sblcosim.calibrate import RANGE_TEST_M, calibrate
from sblcosim.errors import ConfigurationError, ConfigurationWarning
from sblcosim.models.declaration import Variable
from sblcosim.models.ports import BEACON_POSITIONS, BEACONS, MOTION, RECEPTION


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


# --- With ranges that are written down ------------------------------------------------------------


class Written:
    """Acoustics whose ranges are those of a list, ping by ping; the second beacon is heard."""

    given = ("sound_speed", "assumed_sound_speed", "range_std", "clock_offset", "processing_delay",
             "processing_delay_correction", "seed", "sampling_time")
    variables = (
        *(Variable(name, "As given", "parameter", start=0.0) for name in given),
        *(Variable(prefix + v.name, v.description, "input", v.unit, v.shape, start=0.0)
          for prefix, ports in (("target_", MOTION), ("", BEACON_POSITIONS)) for v in ports),
        *(v for v in RECEPTION if v.name in ("range", "range_epoch", "reception_count")),
    )

    def __init__(self, ranges):
        self.ranges, self.count, self.told, self.seen = ranges, 0, None, []

    def initialise(self, start_ns, parameters):
        self.told = {name: float(value) for name, value in parameters.items()}
        return self.outputs(0.0, 0.0)

    def do_step(self, time_ns, step_ns, inputs):
        # Inputs hold during a step: those of the instant at which it begins.
        assert not any(np.any(inputs[name]) for name in (
            "target_velocity", "beacon_position", "reported_beacon_position"))
        if time_ns == 0 or self.count == len(self.ranges):
            return self.outputs(0.0, 0.0)
        self.seen.append((time_ns, *inputs["target_position"]))
        self.count += 1
        return self.outputs(self.ranges[self.count - 1], time_ns / 1e9)

    def outputs(self, far, epoch):
        only = np.arange(BEACONS) == 1
        return {"range": far * only, "range_epoch": epoch * only,
                "reception_count": self.count * only.astype(np.int32)}


RANGES = [9.7, 10.1, 9.9, 4.9, 5.2, 5.2, 1.0, 1.2, 1.1, 19.5, 19.6, 20.0, 48.8, 49.4, 48.8]
"""Of 10 m, then of 5, 1, 20 and 50 m, three pings each."""


def written(**more):
    made = []

    def acoustics():
        made.append(Written(RANGES))
        return made[-1]

    result = calibrate(distances=(5.0, 1.0, 20.0, 50.0), pings=3, acoustics=acoustics, **more)
    return result, made[-1]


SETTINGS = {
    "sound_speed": 1510.0, "assumed_sound_speed": 1480.0, "range_std": 0.2, "clock_offset": 3e-5,
    "processing_delay": 1e-3, "processing_delay_correction": 2e-3, "distance": 10.0,
    "distance_std": 0.05, "seed": 7,
}


def test_ranges_that_are_written_down_give_both_speeds():
    asked = []
    result, acoustics = written(**SETTINGS, before=asked.append)
    told = {name: SETTINGS[name] for name in Written.given if name != "sampling_time"}
    assert acoustics.told == {**told, "sampling_time": 1.0}
    assert acoustics.seen == [
        ((k + 1) * 10**9, d, 0.0, 0.0)
        for k, d in enumerate(np.repeat([10.0, 5.0, 1.0, 20.0, 50.0], 3))
    ]
    settings = {**SETTINGS, "distances": (5.0, 1.0, 20.0, 50.0), "pings": 3}
    assert result.settings == settings
    assert asked == [{"calibration": {"settings": {**settings, "distances": [5, 1, 20, 50]}}}]
    # 10 m look like 9.9 m, with 0.2 m of noise.
    speed = 1480 * 10 / 9.9
    assert result.known_distance.value == pytest.approx(speed)
    assert result.known_distance.std == pytest.approx(
        speed * np.hypot(0.2 / np.sqrt(3) / 9.9, 0.005)
    )
    assert result.per_ping_m_s == pytest.approx(speed * 0.2 / 9.9)
    table = result.table
    assert table["distance_m"].tolist() == [5, 1, 20, 50]
    assert table["pings"].tolist() == [3] * 4
    assert table["mean_m"].tolist() == pytest.approx([5.1, 1.1, 19.7, 49.0])
    assert table["std_m"].tolist() == pytest.approx(
        [np.sqrt(0.03), 0.1, np.sqrt(0.07), np.sqrt(0.12)])
    assert table["error_m"].tolist() == pytest.approx([0.1, 0.1, -0.3, -1.0])
    slope, intercept = np.polyfit([5, 1, 20, 50], [5.1, 1.1, 19.7, 49.0], 1)
    assert (result.slope, result.intercept_m) == pytest.approx((slope, intercept))
    assert result.line.value == pytest.approx(1480 / slope)
    assert result.line.std == pytest.approx(1480 / slope * result.slope_std / slope)


def test_the_whole_text_and_the_plain_data_of_a_calibration():
    result, _ = written(**SETTINGS)
    known, line = result.known_distance, result.line
    assert str(result).splitlines() == [
        "Speed of sound: true 1510 m/s, assumed for ranging 1480 m/s",
        f"  from 3 ranges over 10 m: 1494.9 ± {known.std:.1f} m/s (standard deviation of a single "
        f"ping {result.per_ping_m_s:.1f} m/s)",
        f"  from the slope of the range test:   {line.value:.2f} ± {line.std:.2f} m/s",
        f"Range test: range = {result.intercept_m:.4f} m (± {result.intercept_std_m:.4f}) + "
        f"{result.slope:.5f} (± {result.slope_std:.5f}) × distance",
        f"  the intercept is an error of clock and delay of {result.intercept_m / 1480 * 1e6:.1f} "
        "µs",
        "  ± is one standard uncertainty; that of the known distance leaves out clock and delay",
        "",
        " distance_m  pings mean_m std_m error_m",
        "        5.0      3  5.100 0.173   0.100",
        "        1.0      3  1.100 0.100   0.100",
        "       20.0      3 19.700 0.265  -0.300",
        "       50.0      3 49.000 0.346  -1.000",
    ]
    assert result.title == "Calibration"
    assert [*result.tables] == ["range_test"]
    assert result.tables["range_test"] is result.table
    assert f"of the speed of sound: 1494.9 ± {known.std:.1f} m/s" in repr(result)
    plain = result.to_json()
    assert plain["known_distance"] == {"value": known.value, "std": known.std}
    assert plain["line"] == {"value": line.value, "std": line.std}
    numbers = ("per_ping_m_s", "intercept_m", "intercept_std_m", "slope", "slope_std")
    assert {n: plain[n] for n in numbers} == {n: getattr(result, n) for n in numbers}
    assert [row["distance_m"] for row in plain["table"]] == [5, 1, 20, 50]
    assert {*plain} == {"settings", "known_distance", "line", "table", *numbers}
    assert result.manifest() == {"calibration": plain}


def test_the_figure_of_a_calibration_shows_its_line_and_its_ranges():
    result, _ = written(**SETTINGS)
    above, below = result.plot().axes
    points = next(line for line in above.get_lines() if line.get_marker() == "o")
    assert points.get_xdata().tolist() == [5, 1, 20, 50]
    assert points.get_ydata().tolist() == pytest.approx([5.1, 1.1, 19.7, 49.0])
    drawn = next(line for line in below.get_lines() if line.get_label() == "fitted line")
    x, y = drawn.get_xdata(), drawn.get_ydata()
    assert y == pytest.approx(result.intercept_m + (result.slope - 1) * x)
    ((bars,),) = (container.lines[2] for container in below.containers)
    heights = [float(np.ptp(path[:, 1])) / 2 for path in bars.get_segments()]
    assert heights == pytest.approx(result.table["std_m"].tolist())


@pytest.mark.parametrize(("arguments", "message"), [
    ({"sound_speed": np.inf}, "sound_speed: must be more than 0, got inf"),
    ({"range_std": np.nan}, "range_std: must be at least 0, got nan"),
    ({"pings": 1}, "pings: must be 2 or more, got 1"),
    ({"distances": (3.0, 4.0)},
     "distances: must be three different ones or more, none below 0, got [3.0, 4.0]"),
    ({"distances": (3.0, 4.0, 5.0, np.inf)},
     "distances: must be three different ones or more, none below 0, got [3.0, 4.0, 5.0, inf]"),
    ({"distances": (3.0, 4.0, 5.0, -0.1)},
     "distances: must be three different ones or more, none below 0, got [3.0, 4.0, 5.0, -0.1]"),
])
def test_a_refused_argument_in_a_whole_sentence(arguments, message):
    asked = []
    with pytest.raises(ConfigurationError) as refused:
        calibrate(**arguments, before=asked.append)
    assert str(refused.value) == f"calibrate {message}"
    assert not asked


def test_a_version_of_fmi_that_is_not_is_refused():
    with pytest.raises(ConfigurationError, match=r"^calibrate fmi: "):
        calibrate(fmi=1)


def test_three_distances_and_two_pings_are_enough_in_either_version_of_fmi():
    few = {"distances": (0.0, 1.0, 2.0), "pings": 2, "range_std": 0.1}
    assert calibrate(**few, fmi=3).to_json() == calibrate(**few, fmi=2).to_json()
