"""The Acoustics: travel time, timing, noise, loss, outliers, round robin."""

from __future__ import annotations

from importlib import resources
from typing import Any

import numpy as np
import pytest
from harness import CROSS, NS
from sblcosim.models.acoustics import clock
from sblcosim.models.acoustics.contents import CONTENTS, PACKET_CONTENT, Content
from sblcosim.models.acoustics.schedules import SCHEDULES, Schedule
from sblcosim.models.loading import load
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.stats import binom, expon, halfnorm, kstest, norm
from stepper import Stepper, no_noise

MODEL = load("acoustics")
MANY = 20_000
POSITION = np.array([9.0, -4.0, 6.0])


def channel(**parameters: Any) -> Stepper:
    stepper = Stepper(MODEL, {"range_std": 0.0, **parameters}, noise=no_noise)
    stepper.set(target_position=POSITION, beacon_position=CROSS, reported_beacon_position=CROSS)
    stepper.step(0, NS // 10)
    return stepper


def tick(stepper: Stepper) -> Any:
    return stepper.step(stepper.t_ns, NS // 10)


def first_ticks(seed: int = 1, **parameters: Any) -> dict[str, np.ndarray]:
    """Ranges and counts of beacon 1 after tick 1, for many independent draws at once."""
    stepper = channel(**parameters)
    rng = np.random.default_rng(seed)
    w = np.array([
        rng.standard_normal(MANY) if draw.kind == "normal" else rng.integers(2**53, size=MANY)
        for draw in MODEL.draws if draw.occasion == "tick"
        for _ in range(draw.size)
    ], dtype=float)
    columns = [np.repeat(part[:, None], MANY, 1) for part in (stepper.x, stepper._u, stepper._p)]
    x = stepper.functions.tick(*columns, w, np.full((1, MANY), 0.1), np.ones((1, MANY))).full()
    at = {}
    row = 0
    for name, (rows, n) in MODEL.states.items():
        at[name] = row
        row += rows * n
    return {"range": x[at["range"]], "count": x[at["reception_count"]]}


def length(beacon: int) -> float:
    return float(np.linalg.norm(POSITION - CROSS[beacon]))


def test_a_noise_free_range_is_the_distance_at_the_ping() -> None:
    c = channel()
    for beacon in range(4):
        y = tick(c)
        assert y["range"][beacon] == pytest.approx(length(beacon), abs=1e-12)
        assert y["true_range"][beacon] == pytest.approx(length(beacon), abs=1e-12)


def test_a_range_is_there_after_the_step_of_its_ping_and_0_before_the_first() -> None:
    """However long the sound takes: at 50 m/s it arrives after the step."""
    c = channel(sound_speed=50.0, assumed_sound_speed=50.0)
    assert c.y["range"].tolist() == [0.0] * 4
    assert c.y["reception_count"].tolist() == [0] * 4
    y = tick(c)
    assert y["reception_count"].tolist() == [1, 0, 0, 0]
    assert y["range_epoch"][0] == 0.1
    assert y["arrival_epoch"][0] == pytest.approx(0.1 + length(0) / 50.0, abs=1e-12)
    assert y["arrival_epoch"][0] > 0.2


@pytest.mark.parametrize("velocity", [(0.5, 0.2, -0.1), (-20.0, 3.0, 0.0), (0.0, 0.0, 0.0)])
def test_sound_meets_the_moving_diver_exactly(velocity: tuple[float, float, float]) -> None:
    c = channel(sound_speed=1480.0, assumed_sound_speed=1500.0)
    c.set(target_velocity=velocity)
    y = tick(c)
    offset = POSITION - CROSS[0]
    tau = brentq(
        lambda s: np.linalg.norm(offset + np.multiply(velocity, s)) - 1480.0 * s, 0.0, 1.0,
        xtol=1e-16, rtol=1e-15,
    )
    assert y["true_range"][0] == pytest.approx(1480.0 * tau, abs=1e-10)
    assert y["range"][0] == pytest.approx(1500.0 * tau, abs=1e-10)


def test_motion_during_travel_can_be_switched_off() -> None:
    c = channel(motion_during_travel=False)
    c.set(target_velocity=(15.0, 0.0, 0.0))
    assert tick(c)["range"][0] == pytest.approx(length(0), abs=1e-12)


def test_a_diver_on_the_beacon_has_range_zero() -> None:
    c = channel()
    c.set(target_position=CROSS[0], target_velocity=(1.0, 0.0, 0.0))
    assert tick(c)["range"][0] == 0.0


def test_a_diver_faster_than_sound_gives_a_finite_range() -> None:
    c = channel(sound_speed=1.0)
    c.set(target_velocity=(20.0, 0.0, 0.0))
    assert np.isfinite(tick(c)["range"]).all()


def test_clock_and_delays_enter_with_the_assumed_sound_speed() -> None:
    c = channel(
        assumed_sound_speed=1490.0, clock_offset=2e-3, clock_drift=-1e-4, processing_delay=5e-3,
        processing_delay_correction=4e-3,
    )
    for k in range(1, 9):
        y = tick(c)
        beacon = (k - 1) % 4
        expected = 1490.0 * (length(beacon) / 1500.0 + 2e-3 - 1e-4 * 0.1 * k + 1e-3)
        assert y["range"][beacon] == pytest.approx(expected, abs=1e-9)
        assert y["true_range"][beacon] == pytest.approx(length(beacon), abs=1e-12)


def test_clock_drift_counts_from_the_start() -> None:
    start = 50 * NS
    c = Stepper(MODEL, {"range_std": 0.0, "clock_drift": 1e-4}, noise=no_noise, start_ns=start)
    c.set(target_position=POSITION, beacon_position=CROSS)
    c.step(start, NS // 10)
    y = c.step(start + NS // 10, NS // 10)
    assert y["range"][0] == pytest.approx(length(0) + 1500.0 * 1e-4 * 0.1, abs=1e-9)
    assert y["range_epoch"].tolist() == [50.1, 50.0, 50.0, 50.0]


def test_a_clock_that_a_run_draws_has_drifted_since_it_was_synchronised() -> None:
    drawn = {"clock_offset": 2.0, "clock_drift": -0.5}
    c = Stepper(
        MODEL, {"range_std": 0.0, "clock_offset": 1e-3, "clock_offset_std": 1e-4,
                "clock_drift": 1e-5, "clock_drift_std": 4e-5, "clock_sync_age": 20.0},
        noise=lambda draw, _: np.full(draw.size, drawn.get(draw.name, 0.0)),
    )
    c.set(target_position=POSITION, beacon_position=CROSS)
    c.step(0, NS // 10)
    for k in range(1, 9):
        y = tick(c)
        beacon = (k - 1) % 4
        error = 1e-3 + 2.0 * 1e-4 + (1e-5 - 0.5 * 4e-5) * (20.0 + 0.1 * k)
        assert y["range"][beacon] == pytest.approx(length(beacon) + 1500.0 * error, abs=1e-9)


def test_clock_grades_are_in_the_readme_and_within_bounds() -> None:
    readme = (resources.files("sblcosim.models.acoustics") / "README.md").read_text("utf-8")
    shown = [name for name in clock.GRADES if f"| `{name}` |" in readme]
    assert len(shown) >= 4
    for name, std in clock.GRADES.items():
        assert name not in shown or f"| `{name}` | {std:g} | {1500 * 3600 * std:.2g} |" in readme
        assert clock.grade(name) == {"clock_drift": 0.0, "clock_drift_std": std}
        for parameter in clock.grade(name):
            assert MODEL.component[parameter].causality == "parameter"
    with pytest.raises(KeyError):
        clock.grade("sundial")


def test_beacons_take_turns_and_only_the_received_one_changes() -> None:
    c = channel()
    rows = ("range", "true_range", "range_epoch", "reception_count", "ping_beacon_position")
    for k in range(1, 14):
        before = c.y
        reported = CROSS + 0.01 * k
        c.set(target_position=POSITION + 0.1 * k, reported_beacon_position=reported)
        after = tick(c)
        beacon = (k - 1) % 4
        for name in rows:
            changed = (after[name] != before[name]).reshape(4, -1).any(axis=1)
            assert changed.tolist() == [i == beacon for i in range(4)], name
        assert after["range_epoch"][beacon] == pytest.approx(0.1 * k)
        assert after["reception_count"].sum() == k
        np.testing.assert_array_equal(after["ping_beacon_position"][beacon], reported[beacon])
        np.testing.assert_array_equal(after["packet_beacon_position"], reported)


def test_a_lost_packet_changes_nothing_but_uses_up_its_turn() -> None:
    lost = {2}

    def noise(draw: Any, count: int) -> np.ndarray:
        value = 0.0 if draw.name == "loss" and count in lost else 2.0**52
        return np.full(draw.size, 0.0 if draw.kind == "normal" else value)

    c = Stepper(MODEL, {"range_std": 0.0, "loss_probability": 0.25}, noise=noise)
    c.set(target_position=POSITION, beacon_position=CROSS, reported_beacon_position=CROSS)
    c.step(0, NS // 10)
    before = tick(c)
    c.set(  # a packet that got through would show all of it
        target_position=POSITION + 1.0, beacon_position=CROSS + 2.0,
        reported_beacon_position=CROSS + 3.0,
    )
    after = tick(c)
    for name, value in before.items():
        np.testing.assert_array_equal(after[name], value, err_msg=name)
    received = tick(c)
    assert received["reception_count"].tolist() == [1, 0, 1, 0]
    np.testing.assert_array_equal(received["packet_beacon_position"], CROSS + 3.0)


@pytest.mark.parametrize("probability", [0.0, 0.01, 0.25, 0.5, 1.0])
def test_packets_are_lost_with_the_configured_probability(probability: float) -> None:
    lost = MANY - first_ticks(loss_probability=probability)["count"].sum()
    low, high = binom.interval(0.9999, MANY, probability)
    assert low <= lost <= high


@pytest.mark.parametrize(("threshold", "share"), [(-0.674, 0.25), (0.0, 0.5)])
def test_the_papers_unit_normal_below_a_threshold_is_the_same_model(
    threshold: float, share: float
) -> None:
    """A normal below its quantile and a uniform number below the probability are one event."""
    uniform = np.random.default_rng(3).integers(2**53, size=MANY)
    probability = norm.cdf(threshold)
    normal = norm.ppf((uniform + 0.5) / 2**53)
    np.testing.assert_array_equal(normal < threshold, uniform < probability * 2**53)
    assert probability == pytest.approx(share, abs=2e-4)


def test_range_noise_is_normal_with_the_configured_deviation() -> None:
    errors = first_ticks(range_std=0.3)["range"] - length(0)
    assert kstest(errors / 0.3, "norm").pvalue > 1e-3


@pytest.mark.parametrize(
    ("kind", "law"), [(1, expon(scale=1.7)), (2, halfnorm(scale=1.7 * np.sqrt(np.pi / 2)))]
)
def test_outliers_have_the_configured_share_and_law(kind: int, law: Any) -> None:
    excess = first_ticks(
        outlier_probability=0.1, outlier_distribution=kind, outlier_mean=1.7
    )["range"] - length(0)
    low, high = binom.interval(0.9999, MANY, 0.1)
    outliers = excess[np.abs(excess) > 1e-12]
    assert low <= len(outliers) <= high
    assert outliers.min() > 0
    assert kstest(outliers, law.cdf).pvalue > 1e-3
    assert outliers.mean() == pytest.approx(1.7, rel=0.1)


def test_loss_and_outliers_do_not_depend_on_each_other_or_on_the_noise() -> None:
    quiet = first_ticks(loss_probability=0.3)
    noisy = first_ticks(loss_probability=0.3, range_std=1.0, outlier_probability=0.5)
    np.testing.assert_array_equal(quiet["count"], noisy["count"])
    received = noisy["count"] > 0
    excess = first_ticks(outlier_probability=0.5)["range"] - length(0) > 1e-9
    assert np.corrcoef(received, excess)[0, 1] == pytest.approx(0.0, abs=4 / np.sqrt(MANY))


# --- What a packet says --------------------------------------------------------------------------

RESOLUTION, ANGLE = 0.3, 0.02
PLATFORM = {"reported_position": np.array([4.13, -2.71, 0.37]),
            "reported_attitude": np.array([0.213, -0.087, 2.345])}


def turned(attitude: np.ndarray) -> np.ndarray:
    roll, pitch, yaw = attitude
    return Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()


def raft(**parameters: Any) -> Stepper:
    """A channel below a platform with a pose; what it reports fits together."""
    c = channel(**parameters)
    sway(c, 0)
    return c


def sway(c: Stepper, k: int) -> dict[str, np.ndarray]:
    """Move the platform; returns what it reports."""
    said = {name: value * (1 + 0.07 * k) for name, value in PLATFORM.items()}
    R = turned(said["reported_attitude"])
    said["reported_beacon_position"] = said["reported_position"] + CROSS @ R.T
    c.set(**said)
    return said


def nearest(values: np.ndarray, step: float) -> np.ndarray:
    return values if step == 0 else np.floor(values / step + 0.5) * step


@pytest.mark.parametrize("schedule", SCHEDULES.values(), ids=SCHEDULES)
@pytest.mark.parametrize("steps", [(0.0, 0.0), (RESOLUTION, ANGLE), (RESOLUTION, 0.0),
                                   (0.0, ANGLE)])
@pytest.mark.parametrize("content", PACKET_CONTENT)
def test_a_packet_says_what_it_has_bits_for(
    content: int, steps: tuple[float, float], schedule: Schedule
) -> None:
    step, angle = steps
    c = raft(packet_content=content, packet_resolution=step, packet_angle_resolution=angle,
             schedule=schedule.number)
    what = PACKET_CONTENT[content]
    for k in range(1, 7):
        before, said = c.y, sway(c, k)
        after = tick(c)
        beacons = nearest(said["reported_beacon_position"], step)
        position = nearest(said["reported_position"], step)
        attitude = nearest(said["reported_attitude"], angle)
        if CONTENTS[what].beacons == "none":
            beacons = position + CROSS @ turned(attitude).T
        if not CONTENTS[what].pose:
            position = attitude = np.zeros(3)
        now = [(schedule.place(k - 1) + j) % 4 for j in range(schedule.together(4))]
        wanted = {name: before[name].copy() for name in (
            "ping_beacon_position", "ping_platform_position", "ping_platform_attitude")}
        for i in now:
            wanted["ping_beacon_position"][i] = beacons[i]
            wanted["ping_platform_position"][i] = position
            wanted["ping_platform_attitude"][i] = attitude
        wanted["packet_beacon_position"] = (
            wanted["ping_beacon_position"] if CONTENTS[what].beacons == "own" else beacons
        )
        for name, value in wanted.items():
            np.testing.assert_allclose(after[name], value, rtol=0, atol=1e-12, err_msg=name)
        assert after["range_epoch"][now] == pytest.approx(0.1 * k)


def test_schedules_are_of_all_beacons_and_a_packet_says_something() -> None:
    for it in SCHEDULES.values():
        for beacons in range(3, 9):
            assert 1 <= it.together(beacons) <= beacons
            assert it.ordered or it.together(beacons) == beacons
    with pytest.raises(ValueError, match="must have beacons or a pose, got neither"):
        Content(9, "nothing", "none")


@pytest.mark.parametrize("content", PACKET_CONTENT)
def test_a_lost_packet_says_nothing(content: int) -> None:
    c = raft(packet_content=content, packet_resolution=RESOLUTION, loss_probability=1.0)
    before = tick(c)
    sway(c, 3)
    after = tick(c)
    for name, value in before.items():
        np.testing.assert_array_equal(after[name], value, err_msg=name)
    assert not after["packet_beacon_position"].any()


def test_without_rounding_a_packet_says_it_to_the_bit() -> None:
    for content in (1, 3, 4):
        c = raft(packet_content=content)
        said = sway(c, 2)
        after = tick(c)
        np.testing.assert_array_equal(
            after["packet_beacon_position"], said["reported_beacon_position"])
        if content != 3:
            np.testing.assert_array_equal(
                after["ping_platform_attitude"][0], said["reported_attitude"])


def test_what_is_rounded_again_stays_as_it_is() -> None:
    """Rows of earlier packets are not rounded anew, and multiples are multiples to the bit."""
    c = raft(packet_resolution=0.1)
    said = np.round(np.random.default_rng(4).uniform(-1000, 1000, (4, 3)), 1)
    c.set(reported_beacon_position=said)
    first = tick(c)["packet_beacon_position"]
    c.set(reported_beacon_position=first)
    np.testing.assert_array_equal(tick(c)["packet_beacon_position"], first)
    np.testing.assert_allclose(first, said, rtol=0, atol=1e-12)


def test_no_output_depends_directly_on_an_input() -> None:
    assert not MODEL.feedthrough
