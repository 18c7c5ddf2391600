"""Keys of inverted ranging and of a misaligned frame: what follows for receivers and bounds."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
import sblcosim
from sblcosim.comparison.budget import sources
from sblcosim.errors import NoEffectWarning
from sblcosim.limits import places
from sblcosim.limits.parameters import conditions, parameters
from sblcosim.scenario.arrangement import errors_of, has_own_errors
from sblcosim.scenario.scenario import Scenario, load

A = "acoustics."
DIVE = "realistic-dive"


def inverted(source: str = DIVE, **keys: Any) -> Scenario:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NoEffectWarning)
        return load(source, {f"{A}ranging": "inverted",
                             **{k.replace("__", "."): v for k, v in keys.items()}})


def test_a_ping_of_the_diver_counts_as_pings_of_all_beacons_at_once() -> None:
    """The number of ranges per slot, in the closed form, on maps, and for mounting errors."""
    one, both = load(DIVE), load(DIVE, {f"{A}schedule": "simultaneous"})
    mine = inverted()
    assert conditions(one).together == 1
    assert conditions(mine).together == conditions(both).together == 4

    def heard(scenario: Scenario) -> float:
        return float(places.epochs_of(scenario, places.model_of(scenario, 0.01), 100.0).heard.sum())

    assert heard(mine) == heard(both) == pytest.approx(4 * heard(one), rel=0.02)
    loose = {"platform__mounting_std_m": 0.05, "time__sampling_time_s": 8.0}
    told = [scenario.assumptions()["range_std_m"] for scenario in (
        load(DIVE, {k.replace("__", "."): v for k, v in loose.items()}), inverted(**loose),
    )]
    assert told[1] > told[0]


def test_keys_of_turns_and_answers_have_no_effect_and_the_clock_has() -> None:
    mine = inverted(acoustics__schedule="simultaneous", acoustics__turnaround_std_s=1e-4,
                    acoustics__slot_order=[2, 1, 3, 4])
    idle = {key for _, key in mine.idle()}
    assert {"schedule", "slot_order", "turnaround_std_s"} <= idle
    assert not {"clock_offset_s", "clock_drift_s_s"} & idle
    assert mine.assumptions()["clock_std_m"] == load(DIVE).assumptions()["clock_std_m"]
    assert "range_resolution_m" in {key for _, key in load(
        DIVE, {f"{A}range_resolution_m": 0.1}).idle()}


@pytest.mark.parametrize("resolution", [0.0, 0.02, 0.5])
def test_resolution_is_noise_of_a_twelfth_of_its_square(resolution: float) -> None:
    told = inverted(acoustics__range_resolution_m=resolution)
    expected = np.hypot(0.1, resolution / np.sqrt(12))
    assert told.acoustics.range_std_m == 0.1
    assert told.assumptions()["range_std_m"] == pytest.approx(expected)
    ratio = parameters(told).range_std / parameters(inverted()).range_std
    assert ratio == pytest.approx(expected / 0.1, rel=0.05)


def test_a_misaligned_frame_is_an_error_of_heading_and_tilt() -> None:
    exact = load(DIVE).assumptions()
    told = load(DIVE, {"platform.misalignment_tilt_std_deg": 2.0,
                       "platform.misalignment_heading_std_deg": 4.0}).assumptions()
    more = {"imu_heading_error_std_deg": 4.0, "imu_tilt_std_deg": 2.0,
            "imu_tilt_error_std_deg": 2.0}
    for key, std in more.items():
        assert told[key] == pytest.approx(np.hypot(exact[key], std))
    assert {k for k in told if told[k] != exact[k]} == {*more}


def test_surveyed_beacons_in_a_frame_share_its_errors() -> None:
    assert has_own_errors(load("harbour-lbl").platform)
    for it in ("tilt", "heading"):
        framed = load("harbour-lbl", {f"platform.misalignment_{it}_std_deg": 1.0})
        assert not has_own_errors(framed.platform)
        assert errors_of(framed.platform) == "platform"


def test_the_budget_has_both() -> None:
    mine = inverted(acoustics__range_resolution_m=0.05, platform__misalignment_tilt_std_deg=1.0)
    assert {"timing", "misalignment", "clock"} <= {*sources.of_scenario(mine)}
    assert not {"timing", "misalignment", "turn-around"} & {*sources.of_scenario(load(DIVE))}


def test_a_slot_lasts_until_the_ping_has_passed() -> None:
    """0.02 s of packet, 150 m at 1500 m/s, 0.01 s of silence."""
    tables = {"acoustics": {"ranging": "inverted", "packet_duration_s": 0.02, "reach_m": 150.0,
                            "guard_interval_s": 0.01}}
    assert load(tables).acoustics.sampling_time_s == pytest.approx(0.13)


@pytest.mark.parametrize("key", ["platform.misalignment_tilt_std_deg",
                                 "platform.misalignment_heading_std_deg",
                                 "acoustics.range_resolution_m"])
def test_a_negative_size_is_refused(key: str) -> None:
    with pytest.raises(sblcosim.ConfigurationError, match="must be at least 0"):
        load(DIVE, {f"{A}ranging": "inverted", key: -1.0})


@pytest.mark.parametrize("master", ["python", "lanes"])
@pytest.mark.parametrize(("source", "more"), [
    (DIVE, {"platform.misalignment_heading_std_deg": 1.0}), ("gps-buoys", {}), ("harbour-lbl", {}),
    pytest.param(DIVE, {"platform.beacons": 6}, marks=pytest.mark.slow),
])
@pytest.mark.filterwarnings("ignore::sblcosim.errors.NoEffectWarning")
@pytest.mark.filterwarnings("ignore::sblcosim.errors.ConfigurationWarning")
def test_all_masters_give_the_same_bits(source: str, more: dict[str, Any], master: str) -> None:
    """With losses, echoes, a shadow, a resolution and a misaligned frame."""
    keys = {
        f"{A}ranging": "inverted", f"{A}range_resolution_m": 0.01, f"{A}loss_probability": 0.4,
        f"{A}surface_echo_probability": 0.5, f"{A}shadow_loss_probability": 0.5,
        "time.duration_s": 20.0, **more,
    }
    one, other = (
        sblcosim.run(source, ["coupled", "sequential"], keys, master=name)
        for name in ("native", master)
    )
    for label in ("coupled", "sequential"):
        a, b = one.record.estimates(label), other.record.estimates(label)
        assert len(a) > 5
        assert np.array_equal(a.position, b.position, equal_nan=True)
