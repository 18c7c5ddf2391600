"""Budgets of errors: what is switched, what a share is, how sure it is, and what is printed."""

from __future__ import annotations

import json
import re
import warnings
from dataclasses import replace
from functools import cache
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import sblcosim
from drawn_texts import spoiled_texts
from jsonschema import Draft202012Validator
from matplotlib.text import Text
from quick import one_in
from sblcosim import limits, style
from sblcosim.cli.common.app import app
from sblcosim.cli.documents.by_command import schema
from sblcosim.comparison.budget import run as budgets
from sblcosim.comparison.budget import sources
from sblcosim.comparison.budget.bound import BOUND_RUNS, bounds
from sblcosim.comparison.budget.result import ALL, NONE, REMAINDER, Budget, bars
from sblcosim.comparison.budget.shares import shares
from sblcosim.errors import ConfigurationError
from sblcosim.layout import filled
from sblcosim.limits.run import of_run
from sblcosim.models import COMPONENTS
from sblcosim.models.acoustics import clock
from sblcosim.models.platform import gps, imu
from sblcosim.report.common import PLAY
from sblcosim.scenario.error_sources import SOURCES
from sblcosim.scenario.scenario import load, shipped
from sblcosim.scenario.wiring import connect
from seams import Seam
from typer.testing import CliRunner

DIVE, PAPER = "realistic-dive", "paper-scenario-1"
NO_GPS = {"platform.gps_horizontal_std_m": 0.0, "platform.gps_horizontal_markov_std_m": 0.0}
SHORT = {"time.duration_s": 60.0, "receiver.acceleration_psd_m2_s3": 0.003}  # q of the bound, too
RUNS = 30


@cache
def _found(name: str = DIVE, **options: Any) -> Budget:
    changes = SHORT | dict(options.pop("changes", ()))
    return sblcosim.budget(name, None, changes.items(), runs=RUNS, **options)


def _made_up(
    sound_speed: tuple[float, float, float], gps: float = 0.5, left: float = 0.0, **about: Any
) -> Budget:
    """A budget of 1 m² with given shares: of the sound speed with its interval, and of the GPS."""
    shares_of = {
        (ALL, "all"): (np.nan,) * 3, ("GPS", "source"): (gps, gps - 0.01, gps + 0.01),
        ("sound speed", "source"): sound_speed, (NONE, "rest"): (left,) * 3,
        (REMAINDER, "remainder"): (1 - gps - left - sound_speed[0],) * 3,
    }  # fmt: skip
    table = pd.DataFrame([
        {"frame": "absolute", "source": name, "kind": kind,
         "rms_m": 1.0 if kind == "all" else np.sqrt(1 - share),
         "share": share, "share_low": low, "share_high": high}
        | dict.fromkeys(("alone_rms_m", "alone_share", "bound_share", "bound_rms_m"), np.nan)
        for (name, kind), (share, low, high) in shares_of.items()
    ])  # fmt: skip
    return Budget("x", "m", table, **{
        "runs": 30, "dropped": 0, "seed": 1, "better": False, "untold": False, "lost": 0.0,
        "bound_runs": 0, "bound_kind": "", "acceleration_psd": None, **about,
    })  # fmt: skip


@cache
def _quick(**options: Any) -> Budget:
    return sblcosim.budget(PAPER, None, {"time.duration_s": 10.0}, runs=30, **options)


# --- What is switched ----------------------------------------------------------------------------


def test_all_keys_of_sources_are_there_and_in_one_source_each() -> None:
    keys = [key for s in SOURCES.values() for part in s.parts for key in part.keys]
    assert len(keys) == len(set(keys))
    known = {f"{name}.{v.key}" for name in ("target", "platform", "acoustics")
             for v in COMPONENTS[name].of("parameter")}
    assert set(keys) <= known
    assert {part.about for s in SOURCES.values() for part in s.parts} - {""} <= known


def test_no_error_of_a_sensor_is_forgotten() -> None:
    """Whatever is named as an error is in a source; the rest says how errors vary in time."""
    keys = {key for s in SOURCES.values() for part in s.parts for key in part.keys}
    error = re.compile(r"_(std|bias|drift|step|offset|error|probability|resolution|amplitude|"
                       r"coefficient|misalignment)(_|$)")
    no_error = {
        "target.initial_position_std_m", "target.initial_velocity_std_m_s",  # the motion
        "platform.imu_step_time_s", "platform.imu_temperature_offset_K",
    }
    named = {f"{name}.{v.key}" for name in ("target", "platform", "acoustics")
             for v in COMPONENTS[name].of("parameter") if error.search(v.key)}
    assert named - no_error <= keys


PRESETS = {
    "platform.gps_grade": "standalone", "platform.imu_grade": "consumer", "platform.beaufort": 3,
    "acoustics.clock_grade": "crystal", "acoustics.clock_sync_age_s": 600.0,
    "platform.imu_heading_turn_on_std_deg": 2.0, "acoustics.packet_bits": 120,
    "acoustics.processing_delay_s": 1e-3, "acoustics.processing_delay_correction_s": 4e-4,
    "platform.mounting_error_m": [[0.1, 0.0, 0.0], [0.0, 0.0, 0.1]] * 2,
    "platform.mounting_std_m": 0.02, "platform.imu_misalignment_deg": [1.0, 0.0, 2.0],
    "platform.gps_antenna_offset_m": [0.1, 0.2, 0.0], "platform.imu_heading_step_deg": 4.0,
    "target.depth_bias_std_m": 0.1, "acoustics.surface_echo_probability": 0.4,
    "acoustics.shadow_loss_probability": 0.5, "platform.misalignment_heading_std_deg": 1.0,
}
PRESET_DIVES: dict[str, tuple[dict[str, Any], set[str]]] = {
    "presets": (PRESETS, {"turn-around", "timing", "ping"}),
    "presets, two-way": (
        {**{key: value for key, value in PRESETS.items() if "acoustics.clock" not in key},
         "acoustics.ranging": "two_way", "acoustics.turnaround_std_s": 1e-4},
        {"clock", "timing", "ping"},
    ),
    "presets, inverted": (
        {**PRESETS, "acoustics.ranging": "inverted", "acoustics.range_resolution_m": 0.02,
         "acoustics.range_common_std_m": 0.05},
        {"turn-around"},
    ),
    "presets, in a sea": (
        {**PRESETS, "platform.motion": "spectrum", "platform.watch_circle_m": 3.0},
        {"turn-around", "timing", "ping"},
    ),
}
"""Dives with the presets, and the sources of error that they cannot have."""


def _value(scenario: Any, key: str) -> Any:
    """What a scenario has for a key such as ``platform.arm_length_m``."""
    return attrgetter(key)(scenario)


@one_in(2)
@pytest.mark.parametrize("better", [False, True])
@pytest.mark.parametrize("name", [*shipped(), *PRESET_DIVES])
def test_what_is_switched_is_gone(name: str, better: bool) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        base = load(DIVE, PRESET_DIVES[name][0].items()) if name in PRESET_DIVES else load(name)
        there = sources.of_scenario(base, better)
        after = load(base.given(), sources.switched(base, there, better).items())
        best = after
        for _ in range(3 if better else 0):  # where there is a better grade than the better one
            still = sources.of_scenario(best, better)
            assert {*still} <= {"clock", "tilt"}
            best = load(best.given(), sources.switched(best, still, better).items())
    if name in PRESET_DIVES and not better:
        assert {*there} == {*SOURCES} - PRESET_DIVES[name][1]
    assert sources.of_scenario(best, better) == ()
    for source in there:
        for part in SOURCES[source].parts:
            for key in part.keys:
                old, new = (np.abs(np.ravel(_value(s, key)) - (
                    _value(s, part.about) if part.about else 0)) for s in (base, after))
                assert (new <= old + 1e-12).all(), key


def test_better_equipment_keeps_the_character_of_an_error() -> None:
    base = load(DIVE, {"platform.imu_heading_markov_std_deg": 4.0, "platform.gps_grade": "sbas"})
    changes = sources.switched(base, ("heading", "GPS", "sound speed", "clock"), better=True)
    assert changes["platform.imu_heading_bias_deg"] == pytest.approx(0.3)  # 3 and 4 make 5
    assert changes["platform.imu_heading_markov_std_deg"] == pytest.approx(0.4)
    horizontal = [v for k, v in changes.items() if "gps_horizontal" in k]
    assert np.hypot.reduce(horizontal) == pytest.approx(0.01 / np.sqrt(2), rel=1e-3)
    assert changes["acoustics.sound_speed_m_s"] == pytest.approx(1503.0)
    assert changes["acoustics.clock_offset_s"] == pytest.approx(0.05 / 1500)
    assert changes["acoustics.clock_drift_s_s"] == pytest.approx(clock.GRADES["ocxo"])
    good = load(DIVE, {"acoustics.range_std_m": 0.015})
    assert "range noise" not in sources.of_scenario(good, better=True)


GRADED = {
    "platform.gps_grade": ("GPS", gps.GRADES, {"RTK": "rtk_fixed"}),
    "platform.imu_grade": ("tilt", imu.GRADES, {it: it for it in imu.GRADES}),
    "acoustics.clock_grade": ("clock", clock.GRADES, {"OCXO": "ocxo", "CSAC": "csac"}),
}
"""Grades of sensors: the source, all grades, and the grades that may be better."""


@pytest.mark.parametrize(
    ("key", "grade"), [(key, grade) for key, (_, grades, _) in GRADED.items() for grade in grades]
)
def test_every_grade_has_a_better_one_or_it_is_said_that_there_is_none(
    key: str, grade: str
) -> None:
    """The better values are those of a grade; no grade is better than the best."""
    source, grades, better = GRADED[key]
    clean = {"acoustics.clock_offset_s": 0.0, "acoustics.clock_drift_s_s": 0.0,
             "platform.imu_tilt_bias_deg": None, "platform.imu_heading_bias_deg": None}  # fmt: skip
    sizes = {it: load(DIVE, {**clean, key: it}) for it in grades}
    of = {it: np.hypot.reduce([
        *map(float, (_value(base, k) for part in SOURCES[source].parts for k in part.keys
                     if part.better and np.ndim(_value(base, k)) == 0 and "horizontal" not in k))
    ]) for it, base in sizes.items()}  # fmt: skip
    found = sources.equipment(sizes[grade])
    if of[grade] == min(of.values()):
        assert source not in found
        assert source not in sources.of_scenario(sizes[grade], better=True)
        return
    after = load(sizes[grade].given(), sources.switched(sizes[grade], (source,), True).items())
    assert found[source] in better
    changed = sources.of_scenario(after, better=True)
    taken = of[better[found[source]]]
    assert min(of.values()) <= taken < of[grade]
    assert (source in changed) == (taken > min(of.values()))


def test_what_nothing_is_better_than_is_said_and_what_is_better_is_named() -> None:
    best = {"platform.gps_grade": "rtk_fixed", "acoustics.clock_grade": "ocxo",
            "acoustics.clock_offset_s": 0.0, "acoustics.clock_drift_s_s": 0.0}  # fmt: skip
    found = sblcosim.budget(DIVE, "ekf", {"time.duration_s": 40.0, **best}, better=True, runs=30)
    assert found.unchanged[0] == "GPS"
    assert f"nothing better is known for: {', '.join(found.unchanged)}" in found.text()
    assert "clock → CSAC" in found.text(verbose=True)
    assert found.to_json()["equipment"]["clock"] == "CSAC"
    assert _found().to_json()["equipment"] == {}


@pytest.mark.parametrize("grade", imu.GRADES)
@pytest.mark.parametrize("other", [
    {}, {"platform.imu_heading_temperature_coefficient_deg_K": 0.1},
    {"platform.imu_heading_scale_factor_error": 0.01},
])  # fmt: skip
def test_a_compass_with_antennas_does_not_drift(grade: str, other: dict[str, float]) -> None:
    given = {"platform.imu_heading_bias_deg": 0.0, "platform.imu_grade": grade, **other}
    base = load("harbour-square", {**given, "platform.imu_heading_std_deg": 0.0})
    assert sources.equipment(base)["heading"] == "0.5°"
    changes = sources.switched(base, ("heading",), better=True)
    assert {*changes.values()} == {0.0}


@pytest.mark.parametrize("age", [0.0, 600.0])
@pytest.mark.parametrize("grade", clock.GRADES)
def test_a_better_clock_drifts_as_a_better_grade(grade: str, age: float) -> None:
    """Every grade that drifts more becomes an OCXO, an OCXO a CSAC; none becomes worse."""
    given = {"acoustics.clock_grade": grade, "acoustics.clock_sync_age_s": age,
             "acoustics.clock_offset_s": 0.0, "acoustics.clock_drift_s_s": 0.0}
    base = load("gps-buoys", given)
    changes = sources.switched(base, ("clock",), better=True)
    after = load(base.given(), changes).acoustics.clock_drift_std_s_s
    better = "ocxo" if grade in ("crystal", "tcxo") else "csac"
    assert after == pytest.approx(clock.GRADES[better], rel=1e-9)
    assert ("acoustics.clock_drift_std_s_s" in changes) is (grade != "csac")


@pytest.mark.parametrize("seed", range(5))
def test_a_constant_and_a_drawn_drift_shrink_together(seed: int) -> None:
    constant, drawn = np.random.default_rng(seed).uniform(1e-8, 1e-5, 2) * (-1.0, 1.0)
    base = load(DIVE, {"acoustics.clock_drift_s_s": constant,
                       "acoustics.clock_drift_std_s_s": drawn})
    keys = ("acoustics.clock_drift_s_s", "acoustics.clock_drift_std_s_s")
    better, off = (sources.switched(base, ("clock",), it) for it in (True, False))
    assert np.hypot(*(better[key] for key in keys)) == pytest.approx(clock.GRADES["ocxo"])
    assert better[keys[0]] / better[keys[1]] == pytest.approx(constant / drawn)
    assert [off[key] for key in keys] == [0.0, 0.0]


def test_a_sign_is_kept() -> None:
    base = load(DIVE, {"platform.imu_heading_bias_deg": -3.0, "acoustics.sound_speed_m_s": 1470.0})
    changes = sources.switched(base, ("heading", "sound speed"), better=True)
    assert changes["platform.imu_heading_bias_deg"] == pytest.approx(-0.5)
    assert changes["acoustics.sound_speed_m_s"] == pytest.approx(1497.0)


def test_errors_without_effect_are_no_source() -> None:
    base = load("gps-buoys", {"platform.imu_heading_bias_deg": 3.0})  # buoys have no IMU
    assert "heading" not in sources.of_scenario(base)
    none = load(DIVE, {"acoustics.outlier_mean_m": 0.0})
    assert "outliers" not in sources.of_scenario(none)


def test_which_errors_are_the_same_in_every_run() -> None:
    base = load(DIVE)
    there = sources.of_scenario(base)
    assert sources.fixed(base, there) == (
        "heading", "tilt", "clock", "sound speed", "depth sensor"
    )
    drawn = load(DIVE, {"platform.imu_heading_bias_deg": 0.0,
                        "platform.imu_heading_turn_on_std_deg": 3.0})
    assert "heading" not in sources.fixed(drawn, sources.of_scenario(drawn))


@pytest.mark.parametrize("receiver", ["coupled", "ekf", "sequential", "multilateration"])
@pytest.mark.parametrize("better", [False, True])
@one_in(3)
def test_an_untold_receiver_has_the_parameters_of_the_whole_scenario(
    receiver: str, better: bool
) -> None:
    def parameters(untold: bool) -> list[Any]:
        """Those of the receiver in the runs of each switch, beginning with the whole."""
        found = []

        def made_up(made: Any, *_: Any) -> pd.DataFrame:
            found.append(connect(made.base, receiver).components[receiver].parameters)
            columns = [f"{receiver}.{frame}_total_rms_m" for frame in ("absolute", "own_relative")]
            table = pd.DataFrame(1.0, columns=columns, index=range(30))
            return table.assign(error=None, **{f"{receiver}.lost": 0.0})

        with Seam() as own, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            own.instead(budgets.runner.simulated, made_up)
            own.instead(budgets.bounds, lambda *_: None)
            sblcosim.budget(DIVE, receiver, runs=30, better=better, untold=untold)
        assert len(found) > 5
        return found

    whole, *others = parameters(untold=True)
    assert all(other == whole for other in others)
    whole, *others = parameters(untold=False)
    assert any(other != whole for other in others)


# --- What a share is -----------------------------------------------------------------------------


def test_a_budget_adds_up_to_the_whole() -> None:
    found = _found(together=("clock+heading",))
    assert [*dict.fromkeys(found.table["frame"])] == ["absolute", "own_relative"]
    for frame in ("absolute", "own_relative"):
        rows = found.of(frame)
        added = rows[rows["kind"].isin(("source", "rest", "remainder"))]
        for column in ("share", "alone_share", "bound_share", "bound_alone_share"):
            assert added[column].sum() == pytest.approx(1.0)
        assert abs(rows.loc[REMAINDER, "share"]) > 0.01
        of_sources = rows[rows["kind"].isin(("source", "together"))]
        whole = rows.loc[ALL, "rms_m"] ** 2
        np.testing.assert_allclose(of_sources["share"], 1 - of_sources["rms_m"] ** 2 / whole)
        np.testing.assert_allclose(
            of_sources["alone_share"],
            (of_sources["alone_rms_m"] ** 2 - rows.loc[NONE, "rms_m"] ** 2) / whole,
        )
        assert (of_sources["share_low"] <= of_sources["share"]).all()
        assert (of_sources["share_high"] >= of_sources["share"]).all()
        assert of_sources["share"].iloc[0] == rows.loc[
            rows["kind"] == "source", "share"].max()


def test_the_numbers_are_those_of_single_runs() -> None:
    """A second way: `sblcosim.run` for each seed, on the native master."""
    squares = []
    for seed in range(1, RUNS + 1):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result = sblcosim.run(DIVE, "coupled", (SHORT | NO_GPS | {"seed": seed}).items())
        squares.append(result.errors.rms_m["coupled", "absolute", "total"] ** 2)
    assert _found().of().loc["GPS", "rms_m"] == pytest.approx(np.sqrt(np.mean(squares)), rel=1e-9)


def test_a_single_error_makes_all_of_it() -> None:
    """Alone on, it is the scenario itself."""
    clean = sources.switched(load(DIVE), [n for n in SOURCES if n != "GPS"])
    clean |= {"acoustics.range_std_m": 0.01, "target.depth_std_m": 0.01}
    found = _found(changes=tuple(clean.items())).of("absolute")
    assert [*found.index[found["kind"] == "source"]] == ["GPS"]
    assert found.loc["GPS", "alone_rms_m"] == found.loc[ALL, "rms_m"]
    assert found.loc["GPS", "rms_m"] == found.loc[NONE, "rms_m"]
    assert found.loc[REMAINDER, "share"] == pytest.approx(0.0, abs=1e-12)
    assert found.loc["GPS", "share"] > 0.5


def test_workers_and_repetition_do_not_matter() -> None:
    one, again = (_quick(workers=n).table for n in (1, 2))
    pd.testing.assert_frame_equal(one, again, check_exact=True)


def test_another_seed_is_another_draw() -> None:
    given = {"time.duration_s": 10.0, "seed": 1000}
    a, b = _quick(seed=1000), sblcosim.budget(PAPER, None, given.items(), runs=30)
    assert a.seed == b.seed == 1000
    pd.testing.assert_frame_equal(a.table, b.table)
    assert a.of().loc[ALL, "rms_m"] != _quick(workers=1).of().loc[ALL, "rms_m"]


def test_the_receiver_is_told_unless_it_is_not() -> None:
    told, untold = _found(), _found(untold=True)
    assert told.of().loc[ALL, "rms_m"] == untold.of().loc[ALL, "rms_m"]
    assert told.of().loc["GPS", "rms_m"] < 0.99 * untold.of().loc["GPS", "rms_m"]
    assert "untold" in untold.text()
    np.testing.assert_array_equal(told.of()["bound_rms_m"].sort_index(),
                                  untold.of()["bound_rms_m"].sort_index())


def test_what_the_scenario_says_the_receiver_is_told_of() -> None:
    given = _found(changes=(("receiver.clock_std_m", 1.35),))
    assert given.given == ("clock_std_m",)
    assert "is not told" in given.text()
    assert "clock_std_m" in given.text()
    gps, clock = (abs(given.of().loc[name, "rms_m"] / _found().of().loc[name, "rms_m"] - 1)
                  for name in ("GPS", "clock"))
    assert gps < 1e-9
    assert clock > 1e-3


@pytest.mark.parametrize(
    ("name", "better"), [("gps-buoys", False), ("harbour-lbl", False), ("harbour-lbl", True),
                         ("harbour-random", True)],
)
def test_budgets_of_other_systems(name: str, better: bool) -> None:
    found = sblcosim.budget(name, None, {"time.duration_s": 40.0}, better=better, runs=30)
    rows = found.of()
    assert found.dropped == 0
    kinds = rows["kind"].isin(("all", "source", "rest"))
    assert np.isfinite(rows.loc[kinds, ["rms_m", "bound_rms_m"]]).all(axis=None)
    assert rows.loc[NONE, "bound_rms_m"] < rows.loc[ALL, "bound_rms_m"]
    of_bound = rows.loc[rows["kind"] == "source", "bound_share"]
    assert (of_bound > -0.02).all()


def test_the_bound_of_a_drawn_motion_is_one() -> None:
    drawn = {
        "target": {"trajectory": "white_noise_acceleration", "acceleration_psd_m2_s3": 0.002},
        "time": {"duration_s": 30.0, "sampling_time_s": 1.0},
        "platform": {"gps_horizontal_std_m": 1.0},
    }
    found = sblcosim.budget(drawn, runs=30, acceleration_psd=0.5)
    assert (found.bound_kind, found.acceleration_psd) == ("bound", pytest.approx(0.002))


def test_q_is_that_of_the_receiver_then_of_the_path() -> None:
    assert _found().acceleration_psd == pytest.approx(0.003)
    circle = {"target": {"trajectory": "circle"},
              "time": {"duration_s": 30.0, "sampling_time_s": 1.0}}
    paths = [limits.reference(r.record, r.scenario).acceleration_psd
             for r in (sblcosim.run(circle, "multilateration", {"seed": n}) for n in (1, 2, 3))]
    found = sblcosim.budget(circle, "ekf", runs=30)
    assert found.acceleration_psd == pytest.approx(np.mean(paths))
    learned = {"receiver.acceleration_psd_m2_s3": "learned"}
    left = sblcosim.budget(circle, "ekf", learned, runs=30)
    assert left.acceleration_psd == pytest.approx(np.mean(paths))
    asked = sblcosim.budget(circle, "ekf", runs=30, acceleration_psd=0.02)
    assert asked.acceleration_psd == pytest.approx(0.02)
    assert asked.of().loc[ALL, "bound_rms_m"] > found.of().loc[ALL, "bound_rms_m"]


# --- How sure it is ------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["chi-square", "log-normal"])
def test_intervals_cover_the_share_of_skewed_runs(kind: str) -> None:
    """Of 200 samples of 40 runs 95 % should; 91 % are 2.6 standard deviations less."""
    rng = np.random.default_rng(5)
    draw = {"chi-square": lambda: rng.chisquare(1, 40),
            "log-normal": lambda: np.exp(rng.normal(0, 1, 40))}[kind]
    inside = 0
    for sample in range(200):
        a, b = 1.2 * draw(), 0.8 * draw()
        _, (low,), (high,) = shares(a[:, None], a + b, sample)
        inside += low <= 0.6 <= high
    assert 0.91 <= inside / 200 <= 0.99


def test_the_longer_end_of_an_interval_is_on_the_side_of_the_tail() -> None:
    """Of skewed runs the mean is more often too small: each end from its own tail of t.

    With the ends the other way round the true share lies above one interval in seven.
    """
    rng = np.random.default_rng(6)
    longer, above, below = 0, 0, 0
    for sample in range(150):
        part = rng.chisquare(1, 30)
        (ratio,), (low,), (high,) = shares(part[:, None], np.full(30, 2.0), sample)
        longer += high - ratio > ratio - low
        above += high < 0.5
        below += low > 0.5
    assert longer == 150
    assert above <= 0.09 * 150
    assert below <= 0.06 * 150
    mirrored = shares(-part[:, None], np.full(30, 2.0), sample)
    np.testing.assert_allclose([-x[0] for x in mirrored], [ratio, high, low], rtol=0.05)


def test_intervals_are_paired() -> None:
    """What is common to both runs of a seed cancels."""
    rng = np.random.default_rng(1)
    whole = rng.chisquare(1, 100)
    ratio, low, high = shares(np.column_stack([0.3 * whole, 0 * whole, whole[::-1]]), whole, 1)
    np.testing.assert_allclose(ratio, [0.3, 0.0, 1.0])
    np.testing.assert_allclose((high - low)[:2], 0, atol=1e-6)
    assert (high - low)[2] > 0.3
    again = shares(np.column_stack([whole[::-1]]), whole, 2)
    assert again[1][0] != low[2]


# --- What is printed -----------------------------------------------------------------------------


def test_the_sentence_names_what_matters() -> None:
    found = _found()
    rows = found.of()
    first = rows.index[1]
    share = f"{100 * rows.loc[first, 'share']:.0f} %"
    assert found.answer.startswith(
        f"coupled: {share} of the mean square is {SOURCES[first].words}: "
        f"{rows.loc[ALL, 'rms_m']:.2f} m → {rows.loc[first, 'rms_m']:.2f} m RMS; "
    )
    better = _found(better=True).answer
    assert re.match(r"coupled: \S.* → .+ takes away \d+ % of the mean square: ", better)
    assert repr(found) == f"<Budget of {DIVE}: {found.answer}>"
    assert found.answer in found._repr_html_()


@pytest.mark.parametrize("width", [60, 80, 120])
def test_the_text_fits_a_terminal(width: int) -> None:
    for found in (_found(together=("clock+heading",)), _found(better=True)):
        for frame in ("absolute", "own_relative"):
            text = found.text(frame, verbose=True, width=width)
            assert max(map(len, text.splitlines())) <= width
            flat = " ".join(text.split())
            assert "the same in every run" in flat
            assert "bootstrap" in flat
            assert "does not add up" in " ".join(found.text(frame).split())
    assert "nothing better is known for: outliers" in _found(better=True).text()


def test_every_share_that_is_surely_negative_is_told() -> None:
    """However small it is, told of the switch or not; and none that may be positive."""
    for found in (_made_up((-0.03, -0.04, -0.015)), _made_up((-0.03, -0.04, -0.015), untold=True)):
        assert "the error grows without sound speed (−3 %)" in found.text()
        assert ("; compare --untold" in found.text()) == (not found.untold)
    assert "grows without sound speed (−0.2 %)" in _made_up((-0.002, -0.003, -0.001)).text()
    assert "grows" not in _made_up((-0.03, -0.04, 0.001)).text()
    better = _made_up((-0.03, -0.04, -0.015), better=True).text()
    assert "the error grows with better sound speed (−3 %)" in better


_OVER = "; shares exceed 100 % because joint effects count for every error involved"


@pytest.mark.parametrize(("sound_speed", "gps", "left", "about", "answer"), [
    ((0.02, 0.01, 0.03), 0.5, 0.02, {}, "50 % of the mean square is the GPS: 1.00 m → 0.71 m RMS; "
     "the sound speed 2 %; 2 % is left with all off"),
    ((0.05, 0.0, 0.1), 0.04, 0.019, {},
     "4 % of the mean square is the GPS: 1.00 m → 0.98 m RMS"),
    ((0.3, 0.2, 0.4), 0.7, 0.01, {}, "70 % of the mean square is the GPS: 1.00 m → 0.55 m RMS; the "
     "sound speed 30 %"),
    ((0.3, 0.2, 0.4), 0.7, 0.05, {"better": True}, "GPS takes away 70 % of the mean square: 1.00 m "
     f"→ 0.55 m RMS; sound speed 30 %; 5 % is left with all better{_OVER}"),
    ((0.6, 0.2, 0.8), 0.41, 0.0, {}, "60 % of the mean square is the sound speed: 1.00 m → 0.63 m "
     f"RMS; the GPS 41 %{_OVER}"),
    ((0.4, 0.2, 0.8), 0.6, 0.02, {}, "60 % of the mean square is the GPS: 1.00 m → 0.63 m RMS; the "
     f"sound speed 40 %; 2 % is left with all off{_OVER}"),
])  # fmt: skip
def test_an_error_is_named_from_two_per_cent_on_if_it_is_surely_above_0(
    sound_speed: tuple[float, float, float], gps: float, left: float, about: dict[str, Any],
    answer: str,
) -> None:
    assert _made_up(sound_speed, gps, left, **about).answer == f"m: {answer}"


def test_half_a_per_cent_is_shown_and_less_is_listed() -> None:
    for share, listed in ((0.005, False), (0.0049, True), (-0.005, False)):
        found = _made_up((share, -0.003, 0.004))
        shown, none = bars(found, "absolute", bound=False)
        assert none == (["sound speed"] if listed else [])
        assert ("sound speed" in shown) != listed
    assert "sound speed (−0.5 %)" in _made_up((-0.005, -0.01, -0.001)).remarks[0]
    assert _made_up((-0.02, -0.03, 0.0)).remarks == []


def test_what_the_bound_has_no_part_of_is_named_from_half_a_per_cent_on() -> None:
    kinds = {ALL: "all", "gps + clock": "together", NONE: "rest", REMAINDER: "remainder"}
    rows = [*kinds, *SOURCES]
    table = pd.DataFrame({
        "frame": "absolute", "source": rows, "kind": [kinds.get(name, "source") for name in rows],
        "share": [np.nan, *[0.1] * (len(rows) - 1)], "bound_share": 0.0,
    })  # fmt: skip
    unmodelled = [name for name, it in SOURCES.items() if any(p.unmodelled for p in it.parts)]
    assert 0 < len(unmodelled) < len(SOURCES)
    found = replace(_made_up((0.1, 0.0, 0.2)), table=table)
    assert found.unseen() == unmodelled
    first = table["source"] == unmodelled[0]
    for share, named in ((0.005, True), (0.0049, False), (-0.005, True), (-0.0049, False)):
        other = replace(found, table=table.assign(share=table["share"].where(~first, share)))
        assert (unmodelled[0] in other.unseen()) == named
    for part in (0.01, -0.01):
        other = replace(found, table=table.assign(bound_share=np.where(first, part, 0.0)))
        assert other.unseen() == unmodelled[1:]


def test_the_sentence_says_what_is_left_and_why_shares_are_more_than_the_whole() -> None:
    clause = "; shares exceed 100 % because joint effects count for every error involved"
    alone = _made_up((0.005, 0.0, 0.01), gps=0.9, left=0.1).answer
    assert alone.endswith("is the GPS: 1.00 m → 0.32 m RMS; 10 % is left with all off")
    over = _made_up((0.3, 0.2, 0.4), gps=0.9, left=0.01).answer
    assert over.endswith(f"RMS; the sound speed 30 %{clause}")
    assert "better" in _made_up((0.005, 0.0, 0.01), gps=0.9, left=0.1, better=True).answer
    for share, named in ((0.019, False), (0.021, True), (0.035, True)):
        assert ("sound speed" in _made_up((share, 0.01, 0.05), gps=0.9).answer) == named
        assert ("is left with all" in _made_up((0, 0, 0), gps=0.9, left=share).answer) == named


def test_columns_and_rows_have_names_of_their_own() -> None:
    """What an RMS is of, what is switched in a row, and which position is in error."""
    for found, done in ((_found(), "off"), (_found(better=True), "better")):
        lines = found.text().splitlines()
        head = [done, "share", "95 %", f"RMS {done}"]
        assert re.split(r"\s{2,}", lines[2]) == head
        more = found.text(verbose=True).splitlines()
        assert re.split(r"\s{2,}", more[2]) == [
            *head, "alone", "RMS alone", "reference", f"its RMS {done}"
        ]
        assert [line.startswith(lines[i]) for i, line in enumerate(more[3:6], 3)] == [True] * 3
        assert lines[3].startswith("nothing ")
        assert any(line.startswith(f"what is left, all {done} ") for line in lines)
    for frame, words in (("absolute", "absolute position"),
                         ("own_relative", "position relative to the platform's true one")):
        title = " ".join(_found().plot(frame).axes[0].get_title(loc="left").split())
        rms = _found().of(frame).loc[ALL, "rms_m"]
        assert title == f"coupled in {DIVE}: {words}, {rms:.2f} m RMS"
    assert _found().text("own_relative").startswith("Error of the position relative to the platf")


def test_it_is_written_whole(tmp_path: Path) -> None:
    found = _found()
    folder = found.save(tmp_path / "budget")
    names = {"budget.csv", "manifest.json"} | {
        f"budget_{frame}.{end}" for frame in ("absolute", "own_relative") for end in ("svg", "png")
    }
    assert {path.name for path in folder.iterdir()} == names
    read = pd.read_csv(folder / "budget.csv")
    pd.testing.assert_frame_equal(read, found.table)
    manifest = json.loads((folder / "manifest.json").read_text("utf-8"))
    assert manifest["budget"]["runs"] == RUNS
    assert manifest["scenario"]["time"]["duration_s"] == 60.0
    before = (folder / "budget.csv").read_bytes()
    found.save(tmp_path / "budget")
    assert (folder / "budget.csv").read_bytes() == before
    with pytest.raises(ConfigurationError, match="must be empty or hold the result"):
        _found(better=True).save(tmp_path / "budget", figures=False)


def test_the_figure_shows_receiver_and_bound_side_by_side() -> None:
    found = _found(better=True, together=("clock+heading",))
    for theme in ("light", "dark"):
        for ax in (None, style.new_figure(3.5, 5.0).add_subplot()):
            picture = found.plot("own_relative", ax, theme)  # type: ignore[arg-type]
            (axes,) = picture.axes
            rows = found.of("own_relative")
            shares = rows[["share", "share_low", "share_high", "bound_share"]].abs()
            none = (rows["kind"] == "source") & ((shares < 0.005) | shares.isna()).all(axis=1)
            kept = rows[(rows["kind"] != "all") & ~none]
            assert [*kept.index[-2:]] == [NONE, REMAINDER]
            bars, _, bound = (c for c in axes.containers)
            for drawn, column in ((bars, "share"), (bound, "bound_share")):
                widths = [bar.get_width() for bar in drawn]  # type: ignore[attr-defined]
                np.testing.assert_allclose(widths, 100 * kept[column])
            shown = [" ".join(t.get_text().split()) for t in axes.get_yticklabels()]
            assert shown == [found.label(str(name)) for name in kept.index]
            assert all(t.get_fontsize() >= 8 for t in picture.figure.findobj(Text))
            label = " ".join(axes.get_xlabel().split())
            assert label.startswith(
                "Share of the mean square that goes when this is made better [%]"
            )
            assert ("0 %: " in label) == none.any()
            assert all(found.label(str(name)) in label for name in rows.index[none])


def test_sources_of_nothing_are_named_in_one_line_of_the_figure() -> None:
    found = _found()
    sources = found.table["kind"] == "source"
    columns = ["share", "share_low", "share_high", "bound_share"]
    first, second = found.table.loc[sources, "source"].unique()[:2]
    nothing = sources & (found.table["source"] != first)
    table = found.table.copy()
    table.loc[nothing, columns] = 0.004
    table.loc[sources & (found.table["source"] == second), "share_high"] = 0.02  # perhaps not 0
    picture = replace(found, table=table).plot()
    (ax,) = picture.axes
    shown = [" ".join(t.get_text().split()) for t in ax.get_yticklabels()]
    assert shown[:2] == [found.label(first), found.label(second)]
    assert len(shown) == 4
    *_, words = " ".join(ax.get_xlabel().split()).partition("0 %: ")
    others = found.table.loc[nothing, "source"].unique()[1:]
    assert others.size
    assert all(found.label(name) in words for name in others)
    assert spoiled_texts(picture.figure) == []
    for figure in (picture.figure, found.plot().figure):  # few rows and many are as high
        low, high = figure.axes[0].transData.transform([(0, 0), (0, 1)])[:, 1] / figure.dpi
        assert 0.3 < high - low < 0.5


def test_sources_of_nothing_are_named_in_one_line_of_the_text() -> None:
    """Also where the reference, which has no column then, is not 0 %; on request they are rows."""
    found = _found()
    sources = found.table["kind"] == "source"
    first = found.table.loc[sources, "source"].iloc[0]
    nothing = sources & (found.table["source"] != first)
    table = found.table.copy()
    table.loc[nothing, ["share", "share_low", "share_high"]] = 0.004
    table.loc[nothing, "bound_share"] = 0.2
    found = replace(found, table=table)
    others = [found.label(str(name)) for name in table.loc[nothing, "source"].unique()]
    lines = found.text().splitlines()
    (line,) = (line for line in lines if line.startswith("0 %: "))
    assert sorted(re.split(", | and ", line.removeprefix("0 %: "))) == sorted(others)
    assert not [line for line in lines if line.startswith(tuple(f"{name}  " for name in others))]
    more = found.text(verbose=True).splitlines()
    assert not [line for line in more if line.startswith("0 %: ")]
    assert all(any(line.startswith(f"{name}  ") for line in more) for name in others)


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("known", [True, False])
def test_the_key_of_the_figure_has_what_is_drawn(theme: style.ThemeName, known: bool) -> None:
    found = _made_up((0.1, 0.05, 0.2))
    if not known:
        found.table[["share_low", "share_high"]] = np.nan
    for ax in (None, style.new_figure(6.0, 5.0).add_subplot()):
        picture = found.plot("absolute", ax, theme)
        legends = [*picture.figure.legends, *filter(None, [picture.axes[0].get_legend()])]
        labels = [text.get_text() for it in legends for text in it.get_texts()]
        assert labels == ["m", *(["95 % interval"] if known else [])]


@pytest.mark.parametrize("bound", [None, 0.04])
def test_bars_of_shares_stand_in_rows_with_their_intervals(bound: float | None) -> None:
    """With a bound there are two in a row, the receiver's above."""
    found = _made_up((0.1, 0.15, 0.3), gps=0.25, left=0.375, bound_kind="bound")  # an odd interval
    table = found.table.copy()
    if bound is not None:
        table["bound_share"] = bound * np.arange(len(table))
    (ax,) = replace(found, table=table).plot().axes
    names = [text.get_text().replace("\n", " ") for text in ax.get_yticklabels()]
    assert names == ["GPS", "sound speed", f"{NONE}, all off", REMAINDER]
    assert ax.get_yticks().tolist() == [3, 2, 1, 0]
    assert ax.figure.get_size_inches() == pytest.approx([6.4, 1.6 + 4 * 0.42])
    high = 0.6 if bound is None else 0.38
    first, whiskers, *more = ax.containers
    assert len(more) == (bound is not None)
    up = 0.0 if bound is None else 0.19
    for bar, row, share in zip(first, (3, 2, 1, 0), (25, 10, 37.5, 27.5), strict=True):
        assert bar.get_width() == pytest.approx(share)
        assert bar.get_height() == pytest.approx(high)
        assert bar.get_y() == pytest.approx(row + up - high / 2)
    segments = np.array(whiskers[2][0].get_segments())
    np.testing.assert_allclose(segments[:, 0], [(24, 3 + up), (10, 2 + up), (37.5, 1 + up),
                                                (27.5, up)])  # fmt: skip
    np.testing.assert_allclose(segments[:, 1, 0], [26, 30, 37.5, 27.5])
    for other in more:
        of_bound = 100 * (bound or 0.0)
        for bar, row, number in zip(other, (3, 2, 1, 0), (1, 2, 3, 4), strict=True):
            assert bar.get_width() == pytest.approx(of_bound * number)
            assert bar.get_y() == pytest.approx(row - 0.38)
            assert bar.get_hatch() == "///"
    between = [line for line in ax.lines if {*line.get_ydata()} == {1.5}]
    assert len(between) == 1
    assert ax.get_title("left").replace("\n", " ") == "m in x: absolute position, 1.00 m RMS"


@pytest.mark.parametrize(("width", "longest"), [(4.9, 16), (5.1, 26)])
def test_texts_of_a_narrow_figure_are_wrapped_sooner(width: float, longest: int) -> None:
    found = _made_up((0.1, 0.05, 0.3))
    table = found.table.replace({"source": {"sound speed": "sea surface and its reflections"}})
    ax = style.new_figure(width, 5.0).add_subplot()
    replace(found, table=table).plot("absolute", ax)
    labels = [text.get_text().split("\n") for text in ax.get_yticklabels()]
    (words,) = (lines for lines in labels if lines[0].startswith("sea"))
    assert max(map(len, words)) <= longest
    assert len(f"{words[0]} {words[1].split()[0]}") > longest
    beside = max(len(line) for lines in labels for line in lines)
    across = round(12 * (width - 0.3)) - beside
    words = "Share of the mean square that goes when this is switched off [%]"
    assert ax.get_xlabel() == filled(words, across)


def test_a_receiver_without_a_relative_position_has_one_frame() -> None:
    found = _quick(workers=1)
    assert set(found.table["frame"]) == {"absolute"}
    with pytest.raises(ConfigurationError, match=r"^frame: must be absolute for ekf, got"):
        found.of("own_relative")


def test_a_receiver_in_python(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(
        "import sblcosim\n\n\n"
        "class Still(sblcosim.Receiver):\n"
        "    def update(self, samples):\n"
        "        return sblcosim.Estimate(samples[-1].epoch, (0, 0, 5)) if samples else None\n"
    )
    source = f"{tmp_path / 'mine.py'}:Still"
    only = sources.switched(load(PAPER), ("heading", "tilt", "range noise"))
    only |= {"time.duration_s": 5.0}
    found = sblcosim.budget(PAPER, source, only.items(), runs=30)
    assert found.receiver == "Still"
    rows = found.of()
    np.testing.assert_allclose(rows.loc[rows["kind"] == "source", "share"], 0.0, atol=1e-9)
    assert "no error stands out" in found.answer
    assert rows.loc["GPS", "bound_share"] > 0.01
    with pytest.raises(ConfigurationError, match=r"^untold: must come with one of "):
        sblcosim.budget(PAPER, source, runs=30, untold=True)


def test_what_is_not_ours_has_no_bound() -> None:
    base = load(DIVE, {"platform.fmu": "/nowhere/platform.fmu"})
    assert bounds(base, {ALL: {}}, 1) is None
    assert "GPS" not in sources.of_scenario(load(DIVE, {"platform.fmu": "/nowhere/platform.fmu"
                                                       } | NO_GPS))
    assert "mounting" not in sources.of_scenario(base)


@pytest.mark.slow
def test_runs_that_fail_are_left_out(tmp_path: Path) -> None:
    """With all switches, so that what is left is paired."""
    (tmp_path / "mine.py").write_text(
        "import sblcosim\n\n\n"
        "class Picky(sblcosim.Receiver):\n"
        "    def update(self, samples):\n"
        "        far = [s for s in samples if isinstance(s, sblcosim.Range) and s.range > FAR]\n"
        "        if far:\n"
        "            raise ValueError('too far')\n"
        "        return sblcosim.Estimate(samples[-1].epoch, (0, 0, 5)) if samples else None\n"
        .replace("FAR", "20.6")
    )
    only = sources.switched(load(PAPER), ("GPS", "heading", "tilt", "depth sensor"))
    only |= {"time.duration_s": 5.0, "acoustics.range_std_m": 1.0}
    found = sblcosim.budget(PAPER, f"{tmp_path / 'mine.py'}:Picky", only.items(), runs=45)
    assert 0 < found.dropped <= 15
    assert found.runs == 45 - found.dropped
    assert "a run of theirs failed" in found.text()
    with pytest.raises(ConfigurationError, match="must do at least 30 runs with every switch, got"):
        sblcosim.budget(PAPER, f"{tmp_path / 'mine.py'}:Picky", only.items(), runs=30)


def test_a_run_without_an_error_drops_its_seed_and_not_its_frame(
    seam: Seam,
) -> None:
    """Of all switches, so that what is left is paired."""
    simulated, missing = budgets.runner.simulated, {0: 4, 2: 9}  # seeds by number of the switch
    made: list[pd.DataFrame] = []

    def with_gaps(*given: Any, **options: Any) -> pd.DataFrame:
        table = simulated(*given, **options)
        if len(made) in missing:
            table.loc[missing[len(made)], "coupled.own_relative_total_rms_m"] = np.nan
        made.append(table)
        return table

    only = sources.switched(load(PAPER), ("heading", "tilt", "depth sensor"))
    only |= {"time.duration_s": 5.0}
    seam.instead(budgets.runner.simulated, with_gaps)
    found = sblcosim.budget(PAPER, "coupled", only.items(), runs=33)
    assert [*dict.fromkeys(found.table["frame"])] == ["absolute", "own_relative"]
    assert (found.runs, found.dropped) == (31, 2)
    assert "2 seeds are left out: a run of theirs failed or has no estimate" in found.text()
    kept = made[0].drop(index=[4, 9])
    for frame in ("absolute", "own_relative"):
        rms = np.sqrt((kept[f"coupled.{frame}_total_rms_m"].astype(float) ** 2).mean())
        assert found.of(frame)["rms_m"].iloc[0] == pytest.approx(rms, rel=1e-12)
        assert found.of(frame)["share_low"].iloc[1:].notna().all()
    one = replace(found, dropped=1).text()
    assert "1 seed is left out: one of its runs failed or has no estimate" in one
    made.clear()
    missing |= dict.fromkeys([1], slice(0, 5))
    with pytest.raises(ConfigurationError, match=r"30 runs with every switch, got .* without an"):
        sblcosim.budget(PAPER, "coupled", only.items(), runs=33)


@pytest.mark.parametrize(
    ("missing", "dropped"),
    [
        ([], []),
        ([("all", 3, 0)], [3]),
        ([("all", 3, 1), ("on", 3, 1)], [3]),
        ([("off", 5, 0), ("on", 2, 1)], [2, 5]),
        ([("off", slice(None), 0)], []),  # this switch never has an estimate
        ([("all", slice(None), 1), ("off", slice(None), 1), ("on", 4, 1)], []),
        ([("all", 1, 0), ("off", slice(None), 0)], [1]),
    ],
)
def test_seeds_of_which_a_run_has_no_error(
    missing: Any, dropped: list[int], seam: Seam
) -> None:
    """Whatever switch it is: the runs of that seed count for none, and those of others do."""
    kept_on = {"GPS", "range noise"}
    base = load(PAPER)
    only = sources.switched(base, [name for name in sources.of_scenario(base)
                                   if name not in kept_on])  # fmt: skip
    columns = [f"coupled.{frame}_total_rms_m" for frame in ("absolute", "own_relative")]
    errors = np.linspace(1.0, 2.0, 40)[:, None] * np.ones(2)
    names = iter(("all", "off", "on", "none"))  # the whole, without GPS, without noise, neither

    def made_up(*_: Any, **__: Any) -> pd.DataFrame:
        name, values = next(names), errors.copy()
        for where, seed, frame in missing:
            if where == name:
                values[seed, frame] = np.nan
        table = pd.DataFrame(values, columns=columns)
        return table.assign(error=None, **{"coupled.lost": 0.0})

    seam.instead(budgets.runner.simulated, made_up)
    seam.instead(budgets.bounds, lambda *_: None)
    found = sblcosim.budget(PAPER, "coupled", only.items(), runs=40)
    assert next(names, "") == ""
    assert (found.dropped, found.runs) == (len(dropped), 40 - len(dropped))
    rms = np.sqrt(np.mean(np.delete(errors[:, 0], dropped) ** 2))
    for frame in found.table["frame"].unique():
        assert found.of(frame).loc[ALL, "rms_m"] == pytest.approx(rms, rel=1e-12)


@pytest.mark.parametrize("source", ["packet loss", "platform motion", "GPS"])
def test_the_bound_of_a_switch_is_along_what_is_received_with_it(source: str) -> None:
    """And where its diver and platform are: never along the run without any switch."""
    base, q, seed = load(DIVE, {"time.duration_s": 30.0}), 0.004, 5
    switch = sources.switched(base, [source])
    found = bounds(base, {ALL: {}, "without": switch}, seed, q)
    assert found is not None

    def along(run_with: Any, judged_with: Any) -> float:
        squares = []
        for one in range(seed, seed + BOUND_RUNS):
            result = sblcosim.run(
                base, "multilateration", overrides={**run_with, "seed": one}.items()
            )
            scenario = load(base.given(), {**judged_with, "seed": one}.items())
            epochs = result.record.estimates("multilateration").epoch_ns
            limits = of_run(result.record, scenario, result.fmus, epochs, q)
            assert limits is not None
            verdict = limits.verdict(epochs)
            assert verdict is not None
            squares.append(verdict.absolute_rms**2)
        return float(np.mean(squares))

    expected = along(switch, switch)
    assert found.squares["absolute"]["without"] == pytest.approx(expected, rel=1e-9)
    if source != "GPS":  # which changes neither paths nor what is received
        assert abs(along({}, switch) / expected - 1) > 1e-3


# --- What is refused -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"together": ["clok+heading"]},
         r"together: must be one of GPS, .*, joined by '\+', got 'clok'; did you mean 'clock'\?"),
        ({"together": ["clock"]},
         r"together: must be two sources or more, such as clock\+sound-speed, got clock"),
        ({"together": "mounting+clock"},
         "together: must be one of GPS, .*, got 'mounting', which is no error in realistic-dive"),
        ({"together": "outliers+clock", "better": True},
         r"together: must be one of GPS, heading, .*, got 'outliers', for which nothing better is "
         r"known: it can only be switched off"),
        ({"together": "outlers+clock", "better": True},
         r"together: must be one of GPS, .*, got 'outlers'; did you mean 'outliers'\?"),
        ({"runs": 29}, "runs: must be a whole number of at least 30, got 29"),
        ({"runs": 1e3}, r"runs: must be a whole number of at least 30, got 1000\.0"),
        ({"runs": True}, "runs: must be a whole number of at least 30, got True"),
        ({"receiver": "efk"}, "receiver: must be .*did you mean 'ekf'.*"),
    ],
)
def test_wrong_arguments_are_refused_in_a_line(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigurationError) as raised:
        sblcosim.budget(DIVE, overrides=SHORT.items(), **options)
    assert re.fullmatch(message, str(raised.value)), str(raised.value)


def test_a_scenario_without_any_error_is_refused() -> None:
    base = load(PAPER)
    clean = sources.switched(base, sources.of_scenario(base))
    with pytest.raises(ConfigurationError, match=r"^paper-scenario-1: must have an error to look "):
        sblcosim.budget(PAPER, None, clean.items())
    with pytest.raises(ConfigurationError, match="that better equipment changes, got none"):
        sblcosim.budget(PAPER, None, clean.items(), better=True)


def test_names_are_found_however_they_are_written() -> None:
    known = ("GPS", "clock", "sound speed")
    assert sources.combination("Sound-Speed+gps+ clock", known) == known
    assert sources.combination("clock+sound_speed", known) == ("clock", "sound speed")
    assert sources.combination(["clock", "clock", "GPS"], known) == ("GPS", "clock")


# --- The command ---------------------------------------------------------------------------------


def invoke(*arguments: str) -> Any:
    return CliRunner().invoke(app, ["budget", *arguments])


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    keys = [f"--set={key}={value}" for key, value in SHORT.items()]
    options = (*keys, "--runs", str(RUNS), "--no-figures")
    printed = invoke(DIVE, *options)
    assert printed.exit_code == 0, printed.output
    play = f"sblcosim explore realistic-dive {' '.join(keys).replace('--set=', '--set ')}"
    assert printed.stdout == (
        f"{_found().text()}\n\nwritten to runs/realistic-dive-budget\n{PLAY} {play}\n"
    )
    with_json = invoke(DIVE, *options, "--json", "--better", "--with", "clock+sound-speed")
    document = json.loads(with_json.stdout)
    Draft202012Validator(schema("budget")).validate(document)
    assert document["folder"] == "runs/realistic-dive-budget-2"
    expected = _found(better=True, together=("clock+sound speed",)).to_json()
    assert {k: v for k, v in document.items() if k != "folder"} == expected
    assert document["answers"]["absolute"] == _found(better=True).answer


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((DIVE, "--with", "clok+gps"), "error: --with: must be one of GPS, "),
        ((DIVE, "--runs", "3"), "error: --runs: must be a whole number of at least 30, got '3'"),
        ((DIVE, "--frame", "abslute"), "error: --frame: must be absolute or own_relative, got"),
        ((DIVE, "--receiver", "ekf", "--receiver", "coupled"),
         "error: --receiver: must be given once, got ekf and coupled; 'sblcosim compare' "),
        (("realistic-dvie",), "error: scenario: must be a TOML file or one of "),
    ],
)
def test_mistakes_end_with_a_line(
    arguments: tuple[str, ...], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = invoke(*arguments)
    assert done.exit_code == 2
    assert done.stderr.startswith(message)
    assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "runs").exists()
