"""What is possible in a page is what the command line states."""

from __future__ import annotations

import base64
import json
import random
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sblcosim
from explored import (
    CHOICES,
    LONG,
    MODULES,
    NAME,
    NEEDS,
    NODE,
    SCRIPT,
    answers,
    loaded,
    settings,
)
from quick import few, one_in
from sblcosim.areas.motion import RADIUS, circle_of, circling
from sblcosim.areas.possible import PossibleInCells
from sblcosim.areas.possible import possible as of_cells
from sblcosim.data.truth import state_at
from sblcosim.explore.bounds import facts
from sblcosim.explore.contents import contents
from sblcosim.fmus.build import bound
from sblcosim.fmus.platforms import WASM
from sblcosim.limits import echoes, lengths, path, recursion
from sblcosim.limits.fisher import fisher_factor
from sblcosim.limits.parameters import model_of
from sblcosim.limits.run import of_run
from sblcosim.limits.verdict import Possible
from sblcosim.models.acoustics.ranging import legs
from sblcosim.models.acoustics.schedules import SCHEDULES
from sblcosim.models.receiver.bound import BOUNDS
from sblcosim.results.result import Result
from sblcosim.scenario.scenario import Scenario, load, shipped

pytestmark = NEEDS
EQUAL = 1e-9


@pytest.fixture(scope="module")
def told() -> Mapping[str, Any]:
    return contents(load(NAME), lanes=(2,))


def jobs_at_random(
    name: str, count: int, further: Mapping[str, Any] | None = None
) -> list[dict[str, Any]]:
    numbers, jobs = random.Random(f"{name} {count}"), []
    while len(jobs) < count:
        given = {**settings(numbers, 7, LONG), **(further or {})}
        given["time.duration_s"] = numbers.choice([20.0, 45.0])
        receivers = numbers.choice(CHOICES)
        if isinstance(loaded(name, given, receivers), Scenario):
            seed = numbers.randrange(2**31)
            jobs.append({
                "settings": {"given": given, "seed": seed, "receivers": receivers},
                "ask": ["toml"], "possible": 1,
            })  # fmt: skip
    return jobs


def in_python(answer: Mapping[str, Any], folder: Path, receivers: Sequence[str] = ()) -> Result:
    """The run of the scenario file that a page offers."""
    (folder / "scenario.toml").write_text(answer["toml"])
    return sblcosim.run(folder / "scenario.toml", receivers)


def same(found: Mapping[str, Any], result: Result) -> None:
    """One dive of a page, all that is stated about it."""
    assert found["dives"] == 1
    assert found["receivers"].keys() == result.verdicts.keys()
    for label, expected in result.verdicts.items():
        mine, one = found["receivers"][label], found["each"][0][label]
        assert mine["absolute"] == pytest.approx(expected.absolute_rms, rel=EQUAL)
        assert mine["relative"] == pytest.approx(expected.relative_rms, rel=EQUAL)
        assert mine["bearing"] == pytest.approx(expected.bearing_std, rel=EQUAL)
        assert one["psd"] == pytest.approx(expected.acceleration_psd, rel=EQUAL)
        assert [mine["kind"], mine["accuracy"], mine["timed"]] == [
            expected.kind, expected.accuracy, expected.timed]
        assert [it.removeprefix("platform.") for it in mine["without"]] == [*expected.without]
        assert numbers_in(mine["leftOut"].values()) == pytest.approx(
            [*expected.matters.values()], rel=EQUAL, nan_ok=True)
        assert numbers_in([mine["all"]]) == pytest.approx(
            [expected.with_left_out], rel=EQUAL, nan_ok=True)


def numbers_in(values: Any) -> list[float]:
    """JSON has no NaN."""
    return [np.nan if it is None else float(it) for it in values]


# --- The numbers of the command line -------------------------------------------------------------


@pytest.mark.parametrize("count", few([20, 200], quick=[20]))
def test_settings_at_random(told: Mapping[str, Any], count: int, tmp_path: Path) -> None:
    compared, jobs = 0, jobs_at_random(NAME, count)
    for job, answer in zip(jobs, answers(told, jobs, tmp_path), strict=True):
        if answer["refused"] is None:
            run = in_python(answer, tmp_path, job["settings"]["receivers"])
            same(answer["possible"], run)
            compared += 1
    assert compared > 0.9 * count


ECHOES = {
    "target.trajectory": "circle", "acoustics.water_depth_m": 30.0,
    "acoustics.surface_echo_probability": 0.6, "acoustics.bottom_echo_probability": 0.4,
}
TURNED = {
    "platform.imu_misalignment_deg": [2.0, -3.0, 4.0], "platform.imu_tilt_scale_factor_error": 0.2,
    "platform.imu_heading_scale_factor_error": 0.5, "platform.imu_tilt_drift_deg_s": 0.1,
    "platform.imu_heading_temperature_coefficient_deg_K": 0.4,
    "platform.imu_temperature_offset_K": 9.0, "platform.imu_temperature_rate_K_s": 0.1,
    "platform.imu_tilt_step_deg": 5.0, "platform.imu_step_time_s": 30.0,
}  # fmt: skip
STILL = {
    key: 0.0 for name, keys in (("motions", facts()["motions"]["sines"]),
                                ("sensors", facts()["sensors"])) for key in keys
    if not key.endswith(("antenna_offset_m", "misalignment_deg"))
}
CASES: Mapping[str, Mapping[str, Any]] = {
    "echoes": ECHOES,
    "echoes of both legs": {**ECHOES, "acoustics.ranging": "two_way"},
    "a shadow": {**ECHOES, "acoustics.shadow_loss_probability": 0.9,
                 "acoustics.shadow_direction_deg": 160.0},
    "answers": {"acoustics.ranging": "two_way", "acoustics.turnaround_std_s": 0.001,
                "acoustics.turnaround_beacon_std_s": 0.002},
    "late ranges": {"acoustics.outlier_probability": 0.3, "acoustics.outlier_mean_m": 0.4,
                    "acoustics.outlier_distribution": "half_normal"},
    "an attitude that is wrong": TURNED,
    "an attitude that is wrong in a sea": {**TURNED, "platform.motion": "spectrum",
                                           "platform.beaufort": 4},
    "mounting": {"platform.mounting_std_m": 0.2, "platform.mounting_error_m": [
        [0.3, 0.0, 0.1], [0.0, -0.4, 0.0], [0.1, 0.1, 0.1], [0.0, 0.0, 0.5]]},
    "a boat": {"platform.boat_speed_m_s": 0.3, "platform.boat_course_deg": 70.0,
               "platform.mounting_std_m": 0.3},
    "buoys": {"platform.gps_shared": False},
    "a survey": {**{f"platform.{key}": value for key, value in STILL.items()},
                 "platform.mounting_std_m": 0.1},
    "all hear a ping": {"acoustics.ranging": "inverted", "acoustics.range_common_std_m": 0.2,
                        "acoustics.arrivals_shared": True},
    "bearings alone": {"acoustics.ranging": "inverted", "acoustics.common_clock": False,
                       "platform.arm_length_m": 0.3},
    "own positions in packets": {"acoustics.packet_content": "own_beacon"},
    "their own positions used": {"receiver.pose_source": "own_beacon"},
    "a known start": {"receiver.prior": "true", "receiver.prior_position_std_m": 0.5},
    "a drawn motion": {"target.trajectory": "white_noise_acceleration",
                       "target.acceleration_psd_m2_s3": 0.02},
    "no bearing": {"platform.arm_length_m": 0.05, "target.speed_m_s": 1.0},
    "slow platform": {"platform.interval_s": 0.5, "target.interval_s": 0.25,
                      "time.ekf_ratio": 3},
}  # fmt: skip


def test_settings_that_decide(told: Mapping[str, Any], tmp_path: Path) -> None:
    """All change what is possible, or what is left out."""
    jobs = [
        {"settings": {"given": {"time.duration_s": 60.0, **given}, "receivers": ["coupled"]},
         "ask": ["toml"], "possible": 1} for given in ({}, *CASES.values())
    ]  # fmt: skip
    plain = None
    for name, answer in zip(("plain", *CASES), answers(told, jobs, tmp_path), strict=True):
        assert answer["refused"] is None, (name, answer["refused"])
        same(answer["possible"], in_python(answer, tmp_path, ["coupled"]))
        assert answer["possible"]["receivers"] != plain, name
        plain = plain or answer["possible"]["receivers"]


@pytest.mark.parametrize(("first", "given"), [
    ("ekf", {"acoustics.turnaround_beacon_std_s": 0.002}),
    ("multilateration", {"receiver.initialisation": "prior", "receiver.prior_position_std_m": 0.5}),
])  # fmt: skip
def test_settings_that_do_not_count(
    told: Mapping[str, Any], first: str, given: Mapping[str, Any], tmp_path: Path
) -> None:
    """Of ranging that is not used, or of a receiver that is not the first one."""
    receivers = [first, "coupled"]
    jobs = [
        {"settings": {"given": {"time.duration_s": 60.0, **own}, "receivers": receivers},
         "ask": ["toml"], "possible": 1} for own in ({}, given)
    ]  # fmt: skip
    plain, other = answers(told, jobs, tmp_path)
    for it in (plain, other):
        same(it["possible"], in_python(it, tmp_path, receivers))
    assert other["possible"]["receivers"][first] == plain["possible"]["receivers"][first]


@pytest.mark.parametrize("name", few(
    [it for it in shipped() if it != "usbl-boat"], quick=["paper-scenario-3", "realistic-sea"]
))  # fmt: skip
def test_every_scenario(name: str, tmp_path: Path) -> None:
    (answer,) = answers(
        contents(load(name), lanes=(2,)), [{"ask": ["toml"], "possible": 1}], tmp_path)
    same(answer["possible"], in_python(answer, tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize("beacons", [3, 8])
def test_other_numbers_of_beacons(beacons: int, tmp_path: Path) -> None:
    numbers, compared = random.Random(beacons), 0
    arms = [[round(numbers.uniform(-5, 5), 3) for _ in range(3)] for _ in range(beacons)]
    jobs = jobs_at_random(NAME, 12, {
        "platform.beacon_m": arms, "acoustics.slot_order": None,
        "platform.mounting_error_m": None, "receiver.beacon_offset_m": None,
    })  # fmt: skip
    told = contents(load(NAME), beacons=[beacons], lanes=(2,))
    for job, answer in zip(jobs, answers(told, jobs, tmp_path), strict=True):
        if answer["refused"] is None:
            run = in_python(answer, tmp_path, job["settings"]["receivers"])
            assert run.scenario.beacons == beacons
            same(answer["possible"], run)
            compared += 1
    assert compared > 6


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gps-buoys", "harbour-lbl"])
def test_beacons_with_errors_of_their_own(name: str, tmp_path: Path) -> None:
    jobs = jobs_at_random(name, 40)
    told = contents(load(name), lanes=(2,))
    for job, answer in zip(jobs, answers(told, jobs, tmp_path), strict=True):
        if answer["refused"] is None:
            same(answer["possible"], in_python(answer, tmp_path, job["settings"]["receivers"]))


@pytest.mark.slow
def test_hydrophones_two_centimetres_apart(tmp_path: Path) -> None:
    """A change of q by its last bit changes what is possible by up to 1e-4: both have the same."""
    name = "usbl-boat"
    jobs = jobs_at_random(name, 40, {"acoustics.outlier_probability": 0.0})
    told = contents(load(name), lanes=(2,))
    jobs.append({"ask": ["toml"], "possible": 1})
    for job, answer in zip(jobs, answers(told, jobs, tmp_path), strict=True):
        if answer["refused"] is not None:
            continue
        result = in_python(answer, tmp_path, job.get("settings", {}).get("receivers", ()))
        for label, expected in result.verdicts.items():
            one = answer["possible"]["each"][0][label]
            assert one["psd"] == pytest.approx(expected.acceleration_psd, rel=EQUAL)
            assert one["absolute"] == pytest.approx(expected.absolute_rms, rel=1e-3)
            if "settings" in job:
                known = with_psd(result, label, one["psd"])
                assert one["absolute"] == pytest.approx(known.absolute_rms, rel=EQUAL)


def with_psd(result: Result, label: str, psd: float) -> Possible:
    """What is possible at the epochs of a receiver, with this q."""
    epochs = {it: result.record.estimates(it).epoch_ns for it in result.receivers}
    every = np.concatenate([*epochs.values()])
    limits = of_run(result.record, result.scenario, result.description.fmus, every, psd)
    assert limits is not None
    found = limits.verdict(epochs[label])
    assert found is not None
    return found


def test_several_dives_count_together(told: Mapping[str, Any], tmp_path: Path) -> None:
    job = {"settings": {"seed": 3, "receivers": ["ekf"]}, "possible": 4}
    alone = [{"settings": {"seed": 3 + i, "receivers": ["ekf"]}, "possible": 1} for i in range(4)]
    every, *each = (it["possible"] for it in answers(told, [job, *alone], tmp_path))
    assert every["dives"] == 4
    assert every["each"] == [it["each"][0] for it in each]
    squares = [it["receivers"]["ekf"]["absolute"] ** 2 for it in each]
    assert len({*squares}) == 4
    assert every["receivers"]["ekf"]["absolute"] == pytest.approx(np.mean(squares) ** 0.5)


def test_a_page_says_why_it_has_no_number(told: Mapping[str, Any], tmp_path: Path) -> None:
    """As the command line, it takes runs up to some length; without an estimate there is none."""
    long = {"settings": {"given": {"time.duration_s": 25_000.0}, "receivers": ["ekf"]}}
    deaf = {"settings": {"given": {"acoustics.loss_probability": 1.0}, "receivers": ["ekf"]}}
    jobs = [{**it, "ask": ["toml"], "possible": 2} for it in (long, deaf)]
    of_long, of_deaf = answers(told, jobs, tmp_path)
    most = 2 * facts()["most_epochs"]
    assert of_long["possible"] == {
        "why": f"only known for dives of up to {most:,} instants and estimates"}
    assert of_deaf["possible"]["receivers"] == {}
    for answer in (of_long, of_deaf):
        assert in_python(answer, tmp_path, ["ekf"]).verdicts == {}


# --- By place ------------------------------------------------------------------------------------

GRID = {"north": [-30.0, 0.0, 7.5, 60.0], "east": [-11.0, 4.0, 40.0], "size": 15.0, "depth": 5.0}
PLACES: Mapping[str, Mapping[str, Any]] = {
    **{name: CASES[name] for name in (
        "answers", "late ranges", "an attitude that is wrong in a sea", "mounting", "buoys",
        "a survey", "own positions in packets", "a known start", "a drawn motion", "no bearing")},
    "many slots": {"time.sampling_time_s": 0.1},
    "all at once": {"acoustics.schedule": "simultaneous", "platform.mean_heading_deg": 40.0,
                    "platform.mean_position_m": [3.0, -4.0, 0.5]},
    "another order": {"acoustics.slot_order": [4, 2, 1, 3], "time.sampling_time_s": 1.7},
    "nothing heard": {"acoustics.loss_probability": 1.0},
    "differences of arrivals": {
        "acoustics.ranging": "inverted", "acoustics.common_clock": False,
        "acoustics.loss_probability": 0.0, "platform.arm_length_m": 0.3},
}  # fmt: skip
DRAWN = (
    {"acoustics.loss_burst_length": 4.0}, {"acoustics.shadow_loss_probability": 0.5},
    {"acoustics.ranging": "inverted"},
)
"""Settings with which `sblcosim map` draws losses."""


def in_cells(scenario: Scenario) -> PossibleInCells:
    """What `sblcosim map` finds possible in the cells of the grid."""
    circle = circle_of(scenario, RADIUS, scenario.target.speed_m_s or 0.3, 60.0)
    centres = np.array([[n, e, GRID["depth"]] for n in GRID["north"] for e in GRID["east"]])
    cells = SimpleNamespace(count=len(centres), centres=centres)
    moving = circling(scenario, circle, GRID["depth"], 60.0)
    return of_cells(moving, cells, circle, "absolute_total", (20.0, 60.0))


def same_places(answer: Mapping[str, Any], file: Path) -> PossibleInCells:
    assert answer["refused"] is None
    file.write_text(answer["toml"])
    expected, water = in_cells(load(file)), answer["water"]
    found = [np.inf if it == "inf" else it for it in water["values"]]
    np.testing.assert_allclose(
        found, np.where(expected.accuracy, expected.percentile, np.inf), rtol=1e-11)
    assert [water["done"], water["n"]] == [len(found)] * 2
    return expected


def test_water_is_coloured_by_what_a_map_finds_possible(
    told: Mapping[str, Any], tmp_path: Path
) -> None:
    """The same from workers, whatever else they do."""
    given = [{"time.duration_s": 60.0, **it} for it in ({}, *PLACES.values())]
    jobs = [{"settings": {"given": it, "receivers": ["coupled"]}, "ask": ["toml"],
             "water": GRID, "what": "possible", "by": by}
            for it in given for by in ("here", "workers")]
    found = answers(told, jobs, tmp_path)
    values, rings = {}, 0
    for name, here, workers in zip(("plain", *PLACES), found[::2], found[1::2], strict=True):
        expected = same_places(here, tmp_path / "s.toml")
        assert here["water"] == workers["water"]
        values[name] = str(here["water"]["values"])
        rings += np.count_nonzero(~expected.accuracy)
        assert ("where the beacons are mounted" in here["water"]["words"]) == (
            name == "mounting"), name
    assert rings > 0
    # Errors that are left out change nothing, nor does the motion that a circle replaces.
    others = {name: it for name, it in values.items()
              if name not in ("plain", "mounting", "a drawn motion")}
    assert len({values["plain"], *others.values()}) == len(others) + 1


@one_in(3)
@pytest.mark.parametrize("name", ["gps-buoys", "harbour-lbl", "paper-scenario-1"])
def test_water_of_other_scenarios(name: str, tmp_path: Path) -> None:
    """And with echoes, which a page can only have if its scenario has them."""
    given = {"acoustics.surface_echo_probability": 0.6, "acoustics.loss_probability": 0.4,
             "acoustics.loss_burst_length": 0.0}
    for own in ({}, given):
        job = {"ask": ["toml"], "water": GRID, "what": "possible"}
        (answer,) = answers(contents(load(name, own), lanes=(2,)), [job], tmp_path)
        same_places(answer, tmp_path / "s.toml")


def test_water_has_no_colours_where_a_map_is_refused_or_draws(
    told: Mapping[str, Any], tmp_path: Path
) -> None:
    boat = {"platform.boat_speed_m_s": 1.0}
    jobs = [{"settings": {"given": it}, "water": GRID, "what": what}
            for it in (boat, *DRAWN) for what in ("possible", "error")]
    sails, too, *rest = (it["water"] for it in answers(told, jobs, tmp_path))
    assert sails == too == {
        "why": "a boat under way leaves every place, so no place has an error of its own"}
    for possible, error in zip(rest[::2], rest[1::2], strict=True):
        assert possible["why"].startswith("only known to 'sblcosim map' where losses come in")
        assert len(error["values"]) == 12


# --- Its parts -----------------------------------------------------------------------------------


def in_node(cases: Sequence[Mapping[str, Any]], folder: Path) -> list[Any]:
    """Results of functions of the page; see ``explore_limits.mjs``."""
    module = base64.b64encode(bound.library(platform=WASM).read_bytes()).decode()
    files = [folder / "cases.json", folder / "answers.json"]
    files[0].write_text(json.dumps({"cases": cases, "module": module, "task": facts()["task"]}))
    host = Path(__file__).with_name("explore_limits.mjs")
    assert NODE is not None
    subprocess.run([NODE, MODULES, host, SCRIPT.parent, *files], check=True, timeout=600)
    found: list[Any] = json.loads(files[1].read_text())
    return found


@pytest.mark.parametrize("name", [*BOUNDS])
def test_the_recursion_has_the_bits_of_the_library(name: str, tmp_path: Path) -> None:
    own = {"platform": NAME, "field": "harbour-lbl", "array": "usbl-boat"}[name]
    model = model_of(load(own), 0.01)
    assert model.name == name
    cases, expected = [], []
    for count in (3, 4, 8):
        draw, n = np.random.default_rng(count), 60
        epochs = recursion.Epochs(
            step_s=np.fmax(draw.normal(0.5, 0.5, n), 0.0), readings=draw.integers(0, 2, n) * 1.0,
            packets=draw.integers(0, 2, n) * 1.0, heard=draw.choice([0.0, 0.7, 1.0], (n, count)),
            platform=draw.normal(0, 2, (n, 3)), attitude=draw.normal(0, 0.3, (n, 3)),
            beacons=draw.normal(0, 5, (n, count, 3)),
        )
        position, q = draw.normal((0, 0, 12), 10, (n, 1, 3)), np.array([0.003])
        arrays = {
            "parameters": model.values(), "acceleration_psd": q, "dt": epochs.step_s,
            "readings": epochs.readings, "packets": epochs.packets, "heard": epochs.heard,
            "position": position, "platform": epochs.platform, "attitude": epochs.attitude,
            "beacon": epochs.beacons,
        }  # fmt: skip
        flat = {key: it.ravel().tolist() for key, it in arrays.items()}
        cases.append({"name": "covariances", "arguments": [[*BOUNDS].index(name), count, flat]})
        expected.append(recursion.covariances(model, epochs, position, q))
    for found, known in zip(in_node(cases, tmp_path), expected, strict=True):
        for mine, theirs in zip(found, known, strict=True):
            np.testing.assert_array_equal(mine, theirs.ravel())


def test_the_true_state_between_instants(tmp_path: Path) -> None:
    """Place and velocity at any epoch, of a target at a multiple of the instants, or at them."""
    draw, cases, expected = np.random.default_rng(8), [], []
    for every in (1, 3):
        time = np.arange(31) * 250_000_000
        position, velocity = draw.normal(0, 9, (31, 3)), draw.normal(0, 1, (31, 3))
        epoch = np.concatenate([draw.integers(0, time[-1], 80), time[[0, 4, 6, 30]]])
        record = {"target.position": position.ravel().tolist(),
                  "target.velocity": velocity.ravel().tolist()}
        told = [time.tolist(), [*epoch.tolist(), -1, int(time[-1]) + 1]]
        cases.append({"name": "states", "arguments": [record, told, every * 250_000_000]})
        own = slice(None, None, every)
        expected.append(state_at(time[own], position[own], velocity[own], epoch))
    for found, known in zip(in_node(cases, tmp_path), expected, strict=True):
        of = np.array(found, float).reshape(-1, 2, 3)
        assert np.isnan(of[-2:]).all()  # before and after the dive
        for i, theirs in enumerate(known):
            np.testing.assert_allclose(of[:-2, i], theirs, rtol=1e-12, atol=1e-12)


def test_information_despite_outliers(tmp_path: Path) -> None:
    numbers = random.Random(5)
    given = [
        (10 ** numbers.uniform(-3, 0.5), numbers.choice([0.0, 0.01, 0.3, 0.9, 1.0]),
         10 ** numbers.uniform(-4, 2), numbers.choice(["exponential", "half_normal"]))
        for _ in range(100)
    ]  # fmt: skip
    given += [(0.0, 0.1, 1.0, "exponential"), (1e-9, 0.1, 1.0, "half_normal")]
    found = in_node([{"name": "fisherFactor", "arguments": it} for it in given], tmp_path)
    assert found == pytest.approx([fisher_factor(*it) for it in given], rel=EQUAL)


def test_information_despite_echoes_and_a_shadow(tmp_path: Path) -> None:
    draw, cases, expected, losses = np.random.default_rng(6), [], [], []
    for number in range(24):
        keys = {
            "ranging": ("one_way", "two_way", "inverted")[number % 3],
            "loss_probability": draw.choice([0.0, 0.3, 1.0]),
            "surface_echo_probability": draw.choice([0.0, 0.2, 1.0]),
            "bottom_echo_probability": draw.choice([0.1, 0.9]),
            "water_depth_m": draw.choice([0.0, 40.0]),
            "shadow_loss_probability": draw.choice([0.0, 0.8]),
            "shadow_half_width_deg": draw.uniform(10, 90),
            "shadow_direction_deg": draw.uniform(0, 360),
            "range_std_m": draw.choice([0.02, 0.3, 1.0]), "turnaround_std_s": 0.0,
            "range_resolution_m": 0.0, "assumed_sound_speed_m_s": 1500.0,
        }  # fmt: skip
        acoustics, n = SimpleNamespace(**keys), (1, 7, 230)[number % 3]
        position = np.array([20.0, 5.0, 12.0]) + np.cumsum(draw.normal(0, 0.5, (n, 3)), axis=0)
        beacons, velocity = draw.normal((0, 0, 4), 3, (n, 4, 3)), draw.normal(0, 1, (n, 3))
        velocity[0] = 0.0
        both = legs(acoustics.ranging)
        told = [both, acoustics.range_std_m, *(it.tolist() for it in (position, velocity, beacons))]
        cases += [{"name": "sharesAlong", "keys": keys, "arguments": told},
                  {"name": "lost", "keys": keys, "arguments": [both]}]
        expected.append(echoes.shares_along(acoustics, position, beacons, velocity).ravel())
        losses.append(echoes.lost(acoustics))
    found = in_node(cases, tmp_path)
    for mine, theirs in zip(found[::2], expected, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=EQUAL)
    assert min(it.min() for it in expected) < 0.8
    np.testing.assert_allclose(found[1::2], losses, rtol=EQUAL)


def test_the_activity_of_a_path(tmp_path: Path) -> None:
    draw, cases, expected = np.random.default_rng(7), [], []
    for number in range(12):
        n = (2, 3, 40, 400)[number % 4]
        time = 5.0 + np.cumsum(draw.uniform(0.5, 1.0, n) if number % 2 else np.ones(n))
        velocity = np.cumsum(draw.normal(0, 0.1, (n, 3)), axis=0) * (number != 6)
        density = float(draw.choice([0.0, 0.01, 10.0]))
        cases.append({
            "name": "pathPsd", "arguments": [time.tolist(), velocity[:, :2].T.tolist(), density]})
        expected.append(path.path_psd(time, velocity, density))
    assert len({*expected}) > 4
    np.testing.assert_allclose(in_node(cases, tmp_path), expected, rtol=EQUAL)


def test_lengths_that_hold_most_errors(tmp_path: Path) -> None:
    """Of mixtures of covariances, round and flat ones, large and small."""
    draw, cases, expected = np.random.default_rng(9), [], []
    for number in range(60):
        own = []
        for _ in range(1 + number % 8):
            turn = np.linalg.qr(draw.normal(size=(3, 3)))[0]
            own.append(turn @ np.diag(10.0 ** draw.uniform(-6 * (number % 3), 3, 3)) @ turn.T)
        some = np.array(own) if number else np.zeros((1, 3, 3))
        cases.append({"name": "within", "arguments": [some.reshape(-1, 9).tolist()]})
        expected.append(lengths.percentile(some[:, None])[0])
    np.testing.assert_allclose(in_node(cases, tmp_path), expected, rtol=1e-11)


def test_schedules_are_the_same_in_each_round() -> None:
    """A page has the places of one round."""
    for name, schedule in SCHEDULES.items():
        for count, own in facts()["schedules"][name].items():
            n, slots = int(count), np.arange(100)
            assert own["together"] == schedule.together(n)
            places = np.broadcast_to(schedule.place(slots), slots.shape) % n
            assert places.tolist() == [own["first"][slot % n] for slot in slots]
