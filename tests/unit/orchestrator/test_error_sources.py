"""What makes a run wrong is a source of error, and what the bound ignores is named as left out."""

from __future__ import annotations

import warnings
from functools import cache
from typing import Any

import numpy as np
import pytest
from sblcosim.comparison.budget import sources
from sblcosim.limits.unknown import left_out
from sblcosim.models import COMPONENTS
from sblcosim.models.declaration import Variable
from sblcosim.scenario.error_sources import SOURCES, Part
from sblcosim.scenario.scenario import Scenario, load
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters import lanes
from sblcosim.simulation.resolve import resolve

TABLES = ("target", "platform", "acoustics")
KEYS = [key for source in SOURCES.values() for part in source.parts for key in part.keys]
ABOUT = {part.about for source in SOURCES.values() for part in source.parts} - {""}
MOVING = {f"platform.{axis}_amplitude_{unit}": size for axis, unit, size in (
    ("roll", "deg", 4.0), ("pitch", "deg", 4.0), ("yaw", "deg", 9.0), ("surge", "m", 0.3),
    ("sway", "m", 0.3), ("heave", "m", 0.1),
)}  # fmt: skip
ENABLED = {"platform.imu_temperature_offset_K": 5.0, "time.duration_s": 12.0,
           "acoustics.shadow_direction_deg": 0.0}
"""What some errors need to be any."""
MEASURED = {
    "platform.reported_beacon_position": "platform.beacon_position",
    "platform.reported_position": "platform.position",
    "platform.reported_attitude": "platform.attitude",
    "acoustics.range": "acoustics.true_range",
    "target.depth": "target.true_depth",
}
"""And what is true."""
SAID = ("acoustics.ping_beacon_position", "acoustics.ping_platform_attitude",
        "acoustics.ping_platform_position", "acoustics.reception_count")  # fmt: skip
"""What arrives, which is that of a run without errors unless something is wrong."""


@cache
def right() -> Scenario:
    """A scenario without any error, on a platform that moves."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        base = load("harbour-square", {**ENABLED, "acoustics.packet_bits": None})
        off = sources.switched(base, sources.of_scenario(base))
        none = {"acoustics.range_std_m": 0.0, "target.depth_std_m": 0.0}
        return load(base.given(), {**off, **none, **MOVING})


def numbers() -> list[tuple[str, Variable]]:
    """Parameters that are numbers, but for ticks and what selects something."""
    return [
        (table, v) for table in TABLES for v in COMPONENTS[table].of("parameter")
        if v.type == "Float64" and v.choices is None and v.name != COMPONENTS[table].interval
    ]


def a_little_more(variable: Variable, value: Any) -> Any:
    """Another value that is allowed [SI]: in all elements, by various amounts."""
    flat = np.ravel(value).astype(float)
    is_share = (variable.min, variable.max, variable.unit) == (0.0, 1.0, None)
    more = flat + (0.4 if is_share else 0.05) * (1 + np.arange(len(flat)) / 7)
    high = np.inf if variable.max is None else float(variable.max)
    more = np.where(more > high, flat - 0.05, more)
    return more if variable.shape else float(more[0])


@cache
def wrong() -> frozenset[str]:
    """Keys of parameters with which something measured or said is not true."""
    scenario = right()
    system = connect(scenario, ["multilateration"], tell_idle=False)
    plan = resolve(system)
    known = {name: system.components[name].parameters for name in TABLES}
    tried = [
        (table, v) for table, v in numbers() if v.name in known[table] or not v.shape
    ]
    values: dict[str, Any] = {}
    for lane, (table, v) in enumerate(tried, 1):
        now = known[table].get(v.name, v.starts if v.shape else v.starts[0])
        column = np.tile(np.ravel(now).astype(float), (len(tried) + 1, 1))
        column[lane] = np.ravel(a_little_more(v, now))
        values[f"{table}.{v.name}"] = column if v.shape else column[:, 0]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        outcome = lanes.execute(plan, values, record=[*MEASURED, *MEASURED.values(), *SAID])

    def differs(lane: int) -> bool:
        of = outcome.values
        if any(not np.allclose(of[said][lane], of[true][lane], rtol=0, atol=1e-6)
               for said, true in MEASURED.items()):  # fmt: skip
            return True
        truths = [true for true in MEASURED.values() if not true.startswith("acoustics.")]
        alike = all(np.array_equal(of[t][lane], of[t][0]) for t in truths)
        return alike and any(not np.array_equal(of[s][lane], of[s][0]) for s in SAID)

    assert not differs(0)
    return frozenset(
        f"{table}.{v.key}" for lane, (table, v) in enumerate(tried, 1) if differs(lane)
    )


def test_whatever_makes_a_run_wrong_is_a_key_of_a_source() -> None:
    assert wrong() <= {*KEYS, *ABOUT}
    assert len(wrong()) > 30  # the test sees errors at all


def test_the_errors_of_a_run_are_seen_alone_or_only_with_others() -> None:
    """Keys of sources that are wrong only with another key, or make the truth itself move."""
    spectrum = {"platform.wave_height_m", "platform.watch_circle_m"}
    echoes = {"acoustics.surface_echo_probability", "acoustics.bottom_echo_probability"}
    two_way = {f"acoustics.turnaround_{it}_s" for it in ("std", "bias_std", "beacon_std")}
    assert {*KEYS} - wrong() == {
        *MOVING, *spectrum, *echoes, *two_way, "acoustics.clock_sync_age_s",
        "acoustics.range_resolution_m", "acoustics.range_common_std_m",
    }


def test_what_is_unmodelled_is_a_key_of_the_part() -> None:
    with pytest.raises(ValueError, match="must be keys of the part, got"):
        Part(("platform.heave_amplitude_m",), unmodelled=("platform.imu_tilt_step_deg",))


def test_the_bound_of_beacons_with_own_errors_knows_their_survey() -> None:
    surveyed = {"platform.mounting_std_m": 0.1, **dict.fromkeys(MOVING, 0.0)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scenario = load(right().given(), surveyed)
        moving = load(scenario.given(), {"platform.gps_horizontal_std_m": 0.1})
    assert left_out(scenario) == ()
    assert left_out(moving) == ("mounting_std_m",)
