"""What *possible* leaves out, in words and figures, wherever that is a leading error."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import sblcosim
from matplotlib.text import Text
from sblcosim.limits import unknown
from sblcosim.limits.geometry import hdop
from sblcosim.limits.places import still_beacons
from sblcosim.scenario.error_sources import UNMODELLED
from sblcosim.scenario.likes import LIKES
from sblcosim.scenario.scenario import shipped

SHORT = {"time.duration_s": 30.0}
LARGE: dict[str, dict[str, Any]] = {
    "mounting_error_m": {"mounting_error_m": [[0.5, 0, 0], [0, 0.5, 0], [0, -0.5, 0], [0, 0, 0]]},
    "mounting_std_m": {"mounting_std_m": 0.5},
    "imu_tilt_drift_deg_s": {"imu_tilt_drift_deg_s": 2.0},
    "imu_heading_drift_deg_s": {"imu_heading_drift_deg_s": 2.0},
    "imu_tilt_temperature_coefficient_deg_K": {
        "imu_tilt_temperature_coefficient_deg_K": 5.0, "imu_temperature_offset_K": 9.0,
    },
    "imu_heading_temperature_coefficient_deg_K": {
        "imu_heading_temperature_coefficient_deg_K": 5.0, "imu_temperature_rate_K_s": 1.0,
    },
    "imu_tilt_step_deg": {"imu_tilt_step_deg": 40.0, "imu_step_time_s": 1.0},
    "imu_tilt_scale_factor_error": {"imu_tilt_scale_factor_error": 3.0,
                                    "roll_amplitude_deg": 20.0},
    "imu_heading_scale_factor_error": {"imu_heading_scale_factor_error": 3.0,
                                       "yaw_amplitude_deg": 20.0},
    "imu_misalignment_deg": {"imu_misalignment_deg": [40.0, 40.0, 40.0],
                             "yaw_amplitude_deg": 30.0},
    "acoustics.turnaround_beacon_std_s": {"acoustics.turnaround_beacon_std_s": 1e-3,
                                          "acoustics.ranging": "two_way"},
}  # fmt: skip
"""For each key that the bound leaves out, a value that matters."""


def run_with(keys: dict[str, Any], name: str = "paper-scenario-1") -> Any:
    changes = {key if "." in key else f"platform.{key}": value for key, value in keys.items()}
    return sblcosim.run(name, "coupled", SHORT | changes)


def test_every_error_that_the_bound_leaves_out_has_a_value_here() -> None:
    assert [key.removeprefix("platform.") for key in UNMODELLED] == [*LARGE]


@pytest.mark.parametrize("key", LARGE)
def test_a_leading_error_that_is_left_out_is_said_with_its_size(key: str) -> None:
    result = run_with(LARGE[key])
    verdict = result.verdicts["coupled"]
    (words,) = verdict.matters
    assert f"({key})" in words
    assert verdict.matters[words] > 0.05
    assert verdict.with_left_out > 1.05 * verdict.absolute_rms
    assert result.text().count(f"possible leaves out {words}, about ") == 1
    told = verdict.to_json()
    assert told["left_out_m"] == verdict.matters
    assert told["with_left_out_m"] ** 2 == pytest.approx(
        verdict.absolute_rms**2 + verdict.matters[words] ** 2
    )


@pytest.mark.parametrize("key", LARGE)
def test_a_small_error_is_not_worth_a_word(key: str) -> None:
    small = {
        name: np.multiply(value, 1e-4).tolist() if name == key else value
        for name, value in LARGE[key].items()
    }
    result = run_with(small)
    assert any(key in it.without for it in result.verdicts.values())
    assert "possible leaves out" not in result.text()


@pytest.mark.parametrize("source", [*shipped(), *(it for it in LIKES)])
def test_shipped_scenarios_and_systems_leave_nothing_out_that_matters(source: str) -> None:
    result = sblcosim.run(LIKES[source].source if source in LIKES else source, overrides=SHORT)
    for verdict in result.verdicts.values():
        assert bool(verdict.caveat) == bool(verdict.matters)
        assert not verdict.caveat or verdict.without
        assert not verdict.caveat


def test_beacons_on_the_bottom_have_their_survey_in_the_bound() -> None:
    result = sblcosim.run("harbour-lbl", overrides={**SHORT, "platform.mounting_std_m": 3.0})
    assert all(not it.caveat for it in result.verdicts.values())
    mixed = {**SHORT, "platform.mounting_error_m": [[5.0, 0, 0], [0, 5.0, 0], [0, 0, 0], [0, 0, 0]]}
    result = sblcosim.run("harbour-lbl", overrides=mixed)
    assert all("mounting_error_m" in it.caveat for it in result.verdicts.values())


def test_without_an_accuracy_nothing_is_said_of_it() -> None:
    far = {"imu_heading_std_deg": 80.0, "mounting_std_m": 1.0}
    result = run_with(far | {"imu_heading_markov_std_deg": 80.0, "arm_length_m": 0.1})
    for verdict in result.verdicts.values():
        assert verdict.accuracy or not verdict.caveat


def test_random_mounting_is_its_dilution_and_a_turn_of_all_beacons_is_a_turn_of_the_diver() -> None:
    place = np.array([[40.0, 9.0, 5.0], [-3.0, 25.0, 12.0]])
    since = np.full(2, 10.0)
    one = sblcosim.load("paper-scenario-1", {"platform.mounting_std_m": 0.2})
    (found,) = unknown.squares(one, place, since).values()
    np.testing.assert_allclose(
        np.sqrt(found), 0.2 * hdop(place, still_beacons(one)).horizontal, rtol=1e-12
    )
    two = sblcosim.load("paper-scenario-1", {"platform.imu_heading_drift_deg_s": 0.1})
    (found,) = unknown.squares(two, place, since).values()
    np.testing.assert_allclose(
        np.sqrt(found), np.hypot(*place[:, :2].T) * np.deg2rad(1.0), rtol=0.05
    )
    both = sblcosim.load("paper-scenario-1", {
        "platform.imu_heading_drift_deg_s": 0.1, "platform.mounting_std_m": 0.2,
        "platform.mean_heading_deg": 77.0,
    })  # fmt: skip
    assert len(unknown.squares(both, place, since)) == 2


@pytest.mark.slow
@pytest.mark.parametrize("changes", [
    {"platform.mounting_std_m": 0.2},
    {"platform.mounting_error_m": [[0.3, 0, 0], [0, 0.3, 0], [-0.3, 0.1, 0], [0, 0, 0.1]]},
    {"platform.imu_heading_drift_deg_s": 0.1},
    {"platform.imu_heading_scale_factor_error": 1.0},
], ids=str)  # fmt: skip
def test_the_size_is_about_what_runs_have(changes: dict[str, Any]) -> None:
    options: dict[str, Any] = {"cells": 2, "runs": 300}
    found = [
        sblcosim.map_distance("harbour-square", "20,50", 5.0, "coupled", it, **options)
        for it in ({}, changes)
    ]
    squares = [it.distances["rms_m"].to_numpy() ** 2 for it in found]
    (told,) = found[1].left_out.values()
    ratio = np.sqrt(squares[1] - squares[0]) / told
    assert (ratio > 0.6).all()
    assert (ratio < 1.6).all()


# --- Maps ----------------------------------------------------------------------------------------

FEW: dict[str, Any] = {"cells": 2, "runs": 2, "duration_s": 12.0, "settling_s": 6.0}


@pytest.mark.parametrize("key", ["mounting_std_m", "imu_heading_drift_deg_s"])
@pytest.mark.parametrize("kind", ["area", "distance"])
def test_maps_say_what_possible_leaves_out(kind: str, key: str) -> None:
    def mapped(scale: float) -> Any:
        changes = {f"platform.{key}": scale * LARGE[key][key]}
        if kind == "area":
            return sblcosim.map_area("realistic-dive", "40x40", 5.0, overrides=changes, **FEW)
        return sblcosim.map_distance("realistic-dive", 40, 5.0, overrides=changes, **FEW)

    found = mapped(1.0)
    (said,) = (line for line in found.remarks if line.startswith("possible leaves out"))
    assert f"({key}), about " in said
    assert said in str(found)
    assert found.to_json()["caveat"] == said
    (size,) = found.left_out.values()
    assert len(size) == sum(map(len, found.tables.values()))
    quiet = mapped(1e-4)
    assert quiet.to_json()["caveat"] is None
    assert "leaves out" not in str(quiet)


# --- Figures -------------------------------------------------------------------------------------


def words_in(picture: Any) -> str:
    figure = picture.figure
    return " ".join(" ".join(it.get_text() for it in figure.findobj(Text)).split())


@pytest.mark.parametrize("size", [0.5, 1e-4])
def test_figures_name_it_where_it_matters(size: float) -> None:
    mounted = {"platform.mounting_std_m": size}
    maps: list[Any] = [
        sblcosim.map_area("realistic-dive", "40x40", 5.0, overrides=mounted, **FEW),
        sblcosim.map_distance("realistic-dive", 40, 5.0, overrides=mounted, **FEW),
    ]
    for found in maps:
        assert ("possible leaves out where the beacons" in words_in(found.plot())) == (size > 0.1)
    run = run_with({"mounting_std_m": size})
    assert ("reference leaves out where the" in words_in(run.plot_errors())) == (size > 0.1)


def test_a_budget_names_what_its_reference_does_not_know() -> None:
    changes = {**SHORT, "platform.mounting_std_m": 0.5}
    found = sblcosim.budget("paper-scenario-1", "coupled", changes, runs=30)
    assert found.unseen() == ["mounting"]
    assert "it leaves out mounting" in found.text(verbose=True)
    assert "not in the reference: mounting" in words_in(found.plot())
    quiet = sblcosim.budget("paper-scenario-1", "coupled", SHORT, runs=30)
    assert quiet.unseen() == []
    assert "not in the reference" not in words_in(quiet.plot())


def test_what_is_not_known_is_said_without_a_size() -> None:
    errors = unknown.matter(2.0, {"the fish (fish_m)": float("nan"), "tiny": 1e-9})
    assert "the fish (fish_m)" in errors
    assert unknown.sentence({"the fish (fish_m)": ""}) == "possible leaves out the fish (fish_m)"
    assert unknown.matter(2.0, {}) == {}
    assert unknown.matter(float("nan"), {"tiny": 1.0}) == {}


def test_errors_of_less_than_a_twentieth_of_all_are_not_named() -> None:
    found = unknown.matter(1.0, {"large": 9.0, "small": 0.6, "less": 0.4, "none": 0.0})
    assert found == {"large": 3.0, "small": math.sqrt(0.6)}
    some = unknown.matter(1.0, {"large": 9.5, "just": 0.5})
    assert {*some} == {"large", "just"}
    open_ = unknown.matter(1e3, {"not known": math.nan, "small": 1e-6})
    assert {*open_} == {"not known", "small"}
    square = 100 * ((1 + unknown.MATTERS) ** 2 - 1)
    assert unknown.matter(10.0, {"all": square * (1 - 1e-9)}) == {}
    assert {*unknown.matter(10.0, {"all": square * (1 + 1e-9)})} == {"all"}
    assert unknown.matter(math.inf, {"all": 1.0}) == unknown.matter(1.0, {"none": 0.0}) == {}
