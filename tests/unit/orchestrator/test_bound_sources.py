"""Every error of a scenario changes what is called possible, or is named as left out."""

from __future__ import annotations

import warnings
from functools import cache
from typing import Any

import pytest
import sblcosim
from quick import one_in
from sblcosim import limits
from sblcosim.limits.parameters import conditions
from sblcosim.models import COMPONENTS
from sblcosim.models.declaration import Variable
from sblcosim.scenario.error_sources import SOURCES, UNMODELLED
from sblcosim.scenario.scenario import Scenario, load

KEYS = [key for source in SOURCES.values() for part in source.parts for key in part.keys]
REPORTED = {"platform.heave_amplitude_m"}
"""No error by itself: packets say how high the platform is, with the error of the GPS's down."""
BASE = {
    "time.duration_s": 20.0, "platform.roll_amplitude_deg": 4.0, "platform.yaw_amplitude_deg": 9.0,
    "platform.imu_temperature_offset_K": 5.0, "acoustics.clock_sync_age_s": 100.0,
    "acoustics.clock_drift_s_s": 1e-6, "acoustics.outlier_probability": 0.1,
    "acoustics.outlier_mean_m": 1.0, "acoustics.loss_probability": 0.3,
    "acoustics.water_depth_m": 12.0,
}
CONTEXTS: dict[str, dict[str, Any]] = {
    "sines": {},
    "spectrum": {"platform.motion": "spectrum", "platform.wave_height_m": 0.3,
                 "platform.watch_circle_m": 2.0},
    "two_way": {"acoustics.ranging": "two_way"},
    "inverted": {"acoustics.ranging": "inverted"},
    "shadow": {"acoustics.shadow_loss_probability": 0.5, "acoustics.shadow_half_width_deg": 60.0},
    "usbl": {"acoustics.ranging": "inverted", "acoustics.range_std_m": 0.001,
             "acoustics.range_common_std_m": 0.1, "acoustics.arrivals_shared": True,
             "platform.arm_length_m": 0.02, "platform.misalignment_heading_std_deg": 0.5},
    "differences": {"acoustics.ranging": "inverted", "acoustics.common_clock": False},
    "boat": {"platform.boat_speed_m_s": 0.5, "platform.boat_course_deg": 20.0},
    "profile": {"acoustics.profile_depth_m": [0.0, 5.0],
                "acoustics.profile_speed_m_s": [1520.0, 1500.0]},
}
"""What some errors need to be any. An error that has an effect in one counts in it."""
COMMON = {("differences", "acoustics.processing_delay_s")}
"""No error there: all arrivals are late by it."""


@cache
def run_of(context: str) -> tuple[Scenario, Any, tuple[float, float]]:
    """A scenario, its record, and what is possible there."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scenario = load("harbour-square", {**BASE, **CONTEXTS[context]})
        record = sblcosim.run(scenario, "coupled").record
    return scenario, record, possible(record, scenario)


def possible(record: Any, scenario: Scenario) -> tuple[float, float]:
    """RMS error for the ranges of a record [m], and the share of ranges that a map counts as lost:
    of a record, the losses are seen."""
    rms = float(limits.reference(record, scenario).verdict().absolute_rms)
    return rms, conditions(scenario).loss


def variable_of(key: str) -> Variable:
    table, _, name = key.partition(".")
    return next(v for v in COMPONENTS[table].of("parameter") if v.key == name)


def larger(key: str, value: Any) -> Any:
    """The error with some more of it, in the unit of its key."""
    variable = variable_of(key)
    step = {"m/s": 30.0, "s/s": 1e-5, "s": 1e-5}.get(variable.unit or "", 0.5)
    if (variable.min, variable.max, variable.unit) == (0.0, 1.0, None):
        step = 0.3
    if key == "acoustics.clock_sync_age_s":
        step = 10.0
    return tuple(it + step for it in value) if isinstance(value, tuple) else value + step


@one_in(2)
@pytest.mark.parametrize("key", KEYS)
def test_an_error_changes_what_is_possible_or_is_named_as_left_out(key: str) -> None:
    table, _, name = key.partition(".")
    tried, changes, missing = 0, [], []
    for context in CONTEXTS:
        scenario, record, before = run_of(context)
        value = getattr(getattr(scenario, table), name)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            wrong = load(scenario, {key: larger(key, value)})
        if (table, name) in wrong.idle() or (context, key) in COMMON:
            continue
        tried += 1
        if possible(record, wrong) != before:
            changes.append(context)
        else:
            missing.append(context)
    assert tried, "it has no effect in any context"
    assert not (changes if key in {*UNMODELLED, *REPORTED} else missing)
