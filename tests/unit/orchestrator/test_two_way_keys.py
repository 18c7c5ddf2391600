"""Keys of two-way ranging: what follows from them for the slot, receivers, bounds and texts."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
import sblcosim
from sblcosim.comparison.budget import sources
from sblcosim.errors import NoEffectWarning
from sblcosim.limits import echoes, places, reference
from sblcosim.limits.geometry import hdop
from sblcosim.limits.parameters import conditions, parameters
from sblcosim.limits.unknown import left_out, squares
from sblcosim.scenario.conditions import conditions as words_of
from sblcosim.scenario.doubts import doubts
from sblcosim.scenario.scenario import Scenario, load
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters import lanes
from sblcosim.simulation.resolve import resolve
from scipy.stats import chi2

HARBOUR = "harbour-square"
A = "acoustics."
TWO_WAY = {f"{A}ranging": "two_way", f"{A}turnaround_s": 0.02}


def asked(source: str = HARBOUR, **keys: Any) -> Scenario:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NoEffectWarning)
        return load(source, {**TWO_WAY, **{f"{A}{key}": value for key, value in keys.items()}})


def test_a_slot_lasts_a_round_trip_unless_it_is_given() -> None:
    """0.02 s twice, 0.03 s of turn-around, 150 m there and back at 1500 m/s, 0.01 s of silence."""
    packets = {"packet_duration_s": 0.02, "reach_m": 150.0, "guard_interval_s": 0.01}
    tables = {"acoustics": {"ranging": "two_way", "turnaround_s": 0.03, **packets}}
    assert load(tables).acoustics.sampling_time_s == pytest.approx(0.28)
    (said,) = [line for line in doubts(asked(**packets), {}) if "should be" in line]
    assert said == (
        "harbour-square: [time] sampling_time_s: should be at least 0.27 s, got 0.1 s: 150 m away, "
        "an answer ends 0.26 s after its request, and collides there with the next request"
    )


def test_the_clock_is_replaced_by_the_turn_around() -> None:
    """1e-4 s is 7.5 cm; a noise of 1e-4 s adds to that of 0.1 m."""
    late = asked("realistic-dive", turnaround_std_s=1e-4, turnaround_bias_std_s=1e-4)
    told = late.assumptions()
    assert told["clock_std_m"] == pytest.approx(0.075)
    assert told["clock_walk_psd_m2_s"] == 0.0
    assert told["range_std_m"] == pytest.approx(np.hypot(0.1, 0.075))
    assert load("realistic-dive").assumptions()["clock_std_m"] > 1.0
    alone = asked("realistic-dive")
    assert parameters(late).range_std / parameters(alone).range_std == pytest.approx(
        1.25, rel=0.05
    )
    assert "two-way ranging" in words_of(late)
    assert "turn-around error 0.141 ms (1σ)" in words_of(late)


def test_keys_of_the_other_way_have_no_effect() -> None:
    idle = {key for _, key in asked(clock_offset_s=1e-3, clock_drift_std_s_s=1e-6).idle()}
    assert {"clock_offset_s", "clock_drift_std_s_s"} <= idle
    one_way = load(HARBOUR, {f"{A}turnaround_std_s": 1e-4, f"{A}turnaround_bias_std_s": 1e-4})
    assert {"turnaround_std_s", "turnaround_bias_std_s"} <= {key for _, key in one_way.idle()}
    assert one_way.assumptions() == load(HARBOUR).assumptions()


def test_the_budget_names_the_turn_around_and_no_clock() -> None:
    late = asked(turnaround_std_s=1e-4, turnaround_bias_std_s=1e-4, clock_offset_s=1e-3)
    names = sources.of_scenario(late)
    assert "turn-around" in names
    assert "clock" not in names


ECHOES = {"loss_probability": 0.4, "surface_echo_probability": 0.5, "bottom_echo_probability": 0.5,
          "water_depth_m": 5.0}


def test_both_legs_are_lost_and_late() -> None:
    one, two = (load(HARBOUR, {f"{A}{k}": v for k, v in ECHOES.items()}), asked(**ECHOES))
    assert echoes.lost(one.acoustics) == pytest.approx(0.1)
    assert echoes.lost(two.acoustics) == pytest.approx(0.19)
    assert conditions(two).loss == echoes.lost(two.acoustics)
    late = one.assumptions()["outlier_probability"]
    assert late == pytest.approx(0.3 / 0.9)
    assert two.assumptions()["outlier_probability"] == pytest.approx(1 - (1 - late) ** 2)
    wild = asked(**ECHOES, outlier_probability=0.2, outlier_mean_m=3.0)
    assert wild.assumptions()["outlier_probability"] == pytest.approx(1 - 0.8 * (1 - late) ** 2)


def test_information_of_late_two_way_ranges_is_that_of_their_density() -> None:
    """Fisher's information of location, from a histogram of drawn arrivals of both legs."""
    s = asked(**ECHOES, range_std_m=0.1)
    diver, beacon = np.array([8.0, 0.0, 2.0]), np.array([0.0, 0.0, 0.5])
    e1, e2 = echoes.excesses(s.acoustics, diver, beacon)
    p, q = 0.4, 0.5
    weights = np.array([1 - p, p * q, p * q * q]) / (1 - p + p * q + p * q * q)
    x = np.arange(-1.0, 4.0, 0.002)
    f = sum(
        a * b * np.exp(-0.5 * ((x - (u + v) / 2) / 0.1) ** 2) / (0.1 * np.sqrt(2 * np.pi))
        for a, u in zip(weights, (0.0, e1, e2), strict=True)
        for b, v in zip(weights, (0.0, e1, e2), strict=True)
    )
    expected = 0.01 * (np.gradient(f, x) ** 2 / np.fmax(f, 1e-12)).sum() * 0.002
    assert echoes.shares(s.acoustics, diver, beacon) == pytest.approx(expected, rel=0.01)


def test_a_map_counts_both_legs_in_bursts() -> None:
    """Eight sequences of each leg: the mean is that of independent legs."""
    s = asked(loss_probability=0.3, loss_burst_length=3.0)
    model = places.model_of(s, 0.01)
    heard = [places.epochs_of(s, model, 200.0, i).heard.sum() for i in range(places.SEQUENCES)]
    lossless = asked(loss_probability=0.0)
    sent = places.epochs_of(lossless, model, 200.0).heard.sum()
    assert np.mean(heard) / sent == pytest.approx(0.7**2, abs=0.03)


@pytest.mark.parametrize("master", ["python", "native", "lanes"])
def test_a_dive_runs_in_every_master_with_the_same_bits(master: str) -> None:
    s = asked("realistic-dive", turnaround_std_s=1e-4, turnaround_bias_std_s=1e-4,
              packet_content="pose", packet_resolution_m=0.01)
    s = load(s, {"time.duration_s": 20.0})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NoEffectWarning)
        found, other = sblcosim.run(s, master=master), sblcosim.run(s, master="python")
    for name in ("acoustics.range", "acoustics.reception_count", "coupled.position"):
        assert np.array_equal(found.record.values[name], other.record.values[name])
    assert found.record.values["acoustics.reception_count"][-1].sum() > 5
    assert reference(found.record, s).verdict().absolute_rms > 0


def test_an_answer_arrives_after_half_of_the_turn_around() -> None:
    s = load(asked("realistic-dive", turnaround_s=0.2), {"time.duration_s": 20.0})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NoEffectWarning)
        result = sblcosim.run(s)
    values = {name: value[-1] for name, value in result.record.values.items()}
    heard = values["acoustics.reception_count"] > 0
    waited = values["acoustics.arrival_epoch"] - values["acoustics.range_epoch"]
    assert (waited[heard] > 0.1).all()


DELAYS = {"turnaround_beacon_std_s": 2e-4, "range_std_m": 0.0, "loss_probability": 0.0}


def test_a_delay_of_each_beacon_is_recovered_from_many_runs() -> None:
    """2e-4 s is 15 cm: its spread over runs and beacons, within 99 % bounds."""
    scenario = load(asked(**DELAYS), {"time.duration_s": 3.0})
    runs = 200
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NoEffectWarning)
        plan = resolve(connect(scenario, "multilateration"))
        values = lanes.execute(
            plan, {"acoustics.seed": np.arange(runs)},
            record=["acoustics.range", "acoustics.true_range"],
        ).values
    late = values["acoustics.range"] - values["acoustics.true_range"]
    assert np.ptp(late[:, 8:], axis=1).max() < 1e-9  # every answer of a beacon has the same
    of = late[:, -1].ravel()
    low, high = chi2.ppf([0.005, 0.995], of.size)
    assert low < (of**2).sum() / 0.15**2 < high
    assert abs(np.corrcoef(late[:, -1].T)[0, 1:]).max() < 2.6 / np.sqrt(runs)


def test_what_lasts_for_each_beacon_is_known_to_receivers_and_beside_the_bound() -> None:
    """Left out like the mounting, with its size; where beacons have own errors, one of them."""
    late, without = asked("realistic-dive", turnaround_beacon_std_s=2e-4), asked("realistic-dive")
    told, before = (
        connect(it, "coupled").components["coupled"].parameters["range_std"]
        for it in (late, without)
    )
    assert told > before
    assert left_out(late) == ("acoustics.turnaround_beacon_std_s",)
    diver = np.array([[12.0, 0.0, 5.0]])
    (size,) = squares(late, diver, np.zeros(1)).values()
    dilution = hdop(diver, places.still_beacons(late)).horizontal
    assert np.sqrt(size) == pytest.approx(0.15 * dilution, rel=1e-6)
    assert "turn-around" in sources.of_scenario(late)
    lbl = asked("harbour-lbl", turnaround_beacon_std_s=2e-4)
    assert left_out(lbl) == ()
    assert lbl.assumptions()["beacon_error_std_m"] == pytest.approx(
        np.hypot(0.15, asked("harbour-lbl").assumptions()["beacon_error_std_m"])
    )


def test_a_fix_is_off_by_what_is_said_of_such_delays() -> None:
    """RMS of raw fixes without other errors, over runs, against the size that is left out."""
    scenario = load(asked(**DELAYS, schedule="simultaneous"), {
        "time.duration_s": 20.0, "target.depth_std_m": 0.0, "platform.beaufort": None,
        **{f"platform.{it}_amplitude_deg": 0.0 for it in ("roll", "pitch", "yaw")},
        "platform.gps_horizontal_markov_std_m": 0.0, "platform.imu_tilt_std_deg": 0.0,
        "platform.imu_heading_std_deg": 0.0,
    })
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NoEffectWarning)
        plan = resolve(connect(scenario, "multilateration"))
        values = lanes.execute(
            plan, {"acoustics.seed": np.arange(200)},
            record=["multilateration.position", "target.position"],
        ).values
    last = values["multilateration.position"][:, -1] - values["target.position"][:, -2]
    diver = values["target.position"][:1, -2]
    (size,) = squares(scenario, diver, np.zeros(1)).values()
    assert (last[:, :2] ** 2).sum(1).mean() == pytest.approx(size[0], rel=0.3)
