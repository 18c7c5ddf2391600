"""What a scenario says counts, or is said not to: every key is changed, and the record compared."""

from __future__ import annotations

import random
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pytest
from quick import one_in
from sblcosim.errors import ConfigurationError
from sblcosim.models import COMPONENTS, RECEIVERS
from sblcosim.models.declaration import Variable
from sblcosim.models.settings.keys import in_file_units
from sblcosim.models.settings.presets import PRESET_TABLES, PRESET_VALUES
from sblcosim.scenario import effects
from sblcosim.scenario.scenario import Scenario, load, shipped
from sblcosim.scenario.schema import CORE_COMPONENTS
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters import lanes
from sblcosim.simulation.plans.plan import TICK_PARAMETERS
from sblcosim.simulation.resolve import resolve
from sblcosim.simulation.system import System
from sblcosim.study.groups import PreparedPoint, grouped

pytestmark = pytest.mark.filterwarnings("ignore::sblcosim.errors.NoEffectWarning")
Record = Mapping[str, np.ndarray]


VALID: Mapping[str, list[Any]] = {
    "water_depth": [40.0], "loss_burst_length": [0.0, 4.0], "profile_count": [],
    "shadow_loss_probability": [1.0], "turnaround": [0.03],
}
"""Other values where most numbers within the bounds contradict other keys."""


def values_of(variable: Variable, value: Any) -> list[Any]:
    """Other values of a parameter, as they stand in a scenario file."""
    if variable.name in VALID:
        return VALID[variable.name]
    if variable.choices is not None:
        return [name for name in variable.choices.values() if name != value]
    if variable.type == "Boolean":
        return [not value]
    if variable.shape:
        changed = [x + 0.03 * (i + 1) for i, x in enumerate(value)] or [0.0] * 6
        return [np.reshape(changed, (-1, *variable.shape[1:])).tolist()]
    low, high = (
        None if bound is None else in_file_units(variable, bound)
        for bound in variable.bounds
    )
    if isinstance(value, str):  # a named value
        return [x for x in (low, high) if x is not None]
    if (variable.unit == "s" and "interval" in variable.name) or variable.name == "sampling_time":
        return [2 * value]
    step = 1 if variable.type == "Int32" else 0.37
    found = [x for x in (value + step, value - step) if _within(x, low, high)]
    found += [x for x in (low,) if x is not None and x != value]
    return [int(x) for x in found] if variable.type == "Int32" else found


def _within(value: float, low: float | None, high: float | None) -> bool:
    return (low is None or value >= low) and (high is None or value <= high)


def changes(scenario: Scenario) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Every key of the scenario that holds a number or a choice, and other values of it.

    Only which FMUs there are and how often they talk (`interval_s`) is left out.
    """
    time = scenario.time
    yield ("seed",), scenario.seed + 1
    yield ("time", "sampling_time_s"), 2 * time.sampling_time_s
    yield ("time", "ekf_ratio"), time.ekf_ratio + 1
    yield ("time", "duration_s"), time.duration_s / 2
    for key, table in PRESET_TABLES.items():
        for value in PRESET_VALUES[key]:
            if not isinstance(value, int) or value in (1, 5):
                yield (table, key), value
    for table, names in effects.components_of(scenario).items():
        for variable in [v for name in names for v in COMPONENTS[name].of("parameter")]:
            for value in values_of(variable, getattr(getattr(scenario, table), variable.key)):
                yield (table, variable.key), value


def records(systems: Sequence[System]) -> list[Record]:
    """All outputs of some systems; those that differ in parameters only run side by side."""
    plans = [resolve(system) for system in systems]
    points = [PreparedPoint(n, (), system, "") for n, system in enumerate(systems, start=1)]
    found: list[Record] = [{}] * len(systems)
    for group in grouped(points, plans, free=(), master="lanes", alone=False):
        columns = [column.name for column in group.plan.columns]
        outcome = lanes.execute(group.plan, group.values, record=columns)
        runs = len(next(iter(outcome.values.values())))
        for place, run in group.places.items():
            found[place] = outcome.record(min(run, runs - 1)).values
    return found


def same(one: Record, other: Record) -> bool:
    return all(np.array_equal(_told(one, name), _told(other, name)) for name in one)


def _told(record: Record, name: str) -> np.ndarray:
    """An output; of a receiver without what it shows before its first estimate."""
    valid = record.get(f"{name.partition('.')[0]}.valid")
    return record[name] if valid is None or name.endswith(".valid") else record[name][valid]


def without_effect(base: Scenario) -> tuple[set[Any], set[Any]]:
    """Keys that change nothing in the record, whatever their value, and those that can change."""
    made, keys = [connect(base)], []
    for key, value in changes(base):
        try:
            made.append(connect(base.override({".".join(key): value})))
            keys.append(key)
        except ConfigurationError:
            pass  # what is refused is not silent
    first, *others = records(made)
    effective = {key for key, other in zip(keys, others, strict=True) if not same(first, other)}
    return set(keys) - effective, set(keys)


def check(base: Scenario, unknown: Collection[Any] = ()) -> None:
    idle, tried = without_effect(base)
    assert len(tried) > 80
    assert idle - {*unknown, WATCH} == base.idle().keys() & tried


WATCH = ("receiver", "watch")
"""A challenger changes nothing while it is no better, and begins after a minute only."""
SHORT = {"time.duration_s": 12.0, "acoustics.shadow_half_width_deg": 90.0}
MORE = {
    "realistic-dive": {"time.duration_s": 60.0},
    "realistic-sea": {"time.duration_s": 60.0, "acoustics.outlier_probability": 0.3},
    "harbour-wakes": {"time.duration_s": 40.0},
    "harbour-lbl": {"time.duration_s": 90.0, "platform.mean_heading_deg": 7.0},
    "gps-buoys": {"time.duration_s": 90.0},
    "usbl-boat": {"time.duration_s": 60.0, "acoustics.outlier_probability": 0.3},
}
SPECTRUM = {
    "platform.motion": "spectrum", "platform.wave_height_m": 0.6, "platform.watch_circle_m": 3.0,
    "platform.wave_spreading_deg": 20.0,
}
"""What a short run needs so that there are enough receptions, and no number is round by chance."""
NO_ATTITUDE = {("acoustics", "packet_angle_resolution_deg")}
"""Where buoys have no attitude there is nothing to round; the Acoustics cannot know."""


MUCH_ALIKE = (
    "harbour-square", "harbour-spiral", "harbour-wakes", "paper-scenario-2", "paper-scenario-3",
    "realistic-dive", "realistic-sea",
)


@pytest.mark.parametrize("name", [
    pytest.param(name, marks=[pytest.mark.slow] if name in MUCH_ALIKE else []) for name in shipped()
])
@one_in(2)
def test_the_keys_without_effect_are_those_of_the_declarations(name: str) -> None:
    check(
        load(name, SHORT | {"platform.arm_length_m": 2.9} | MORE.get(name, {})),
        NO_ATTITUDE if name == "gps-buoys" else set(),
    )


def test_the_same_holds_for_a_sea_with_a_spectrum() -> None:
    check(load("paper-scenario-1", SHORT | {"platform.arm_length_m": 2.9} | SPECTRUM))


@pytest.mark.slow
def test_the_same_holds_for_a_recorded_track() -> None:
    check(load("paper-scenario-1", {
        "target": TRACK, "receiver.type": "ekf", "platform.arm_length_m": 2.9, **SHORT}))


@pytest.mark.slow
def test_the_same_holds_for_a_boat_on_a_track() -> None:
    check(load("paper-scenario-1", {
        **{f"platform.{key}": it for key, it in BOAT.items()}, "receiver.type": "ekf",
        "platform.arm_length_m": 2.9, **SHORT}))


@pytest.mark.parametrize("receiver", [
    pytest.param(name, marks=[] if name in ("ekf", "coupled") else pytest.mark.slow)
    for name in RECEIVERS
])
def test_the_same_holds_for_every_receiver(receiver: str) -> None:
    more = {"sequential": {"gate": 0.5}, "fixed_lag": {"lag_s": 1.0}}.get(receiver, {})
    tables = load("paper-scenario-1", SHORT | {"platform.arm_length_m": 2.9}).given()
    check(load({**tables, "receiver": {"type": receiver, **more}}))


TRACK = {
    "trajectory": "file",
    "track_time_s": [0.0, 3.0, 5.0, 12.0],
    "track_m": [[5, 0, 1], [6, 0, 2], [6, 0, 2], [9, 5, 3]],
}


BOAT = {
    "track_time_s": [0.0, 3.0, 5.0, 12.0],
    "track_m": [[1, 0], [2, 0], [2, 0], [3, 4]],
    "track_heading_deg": [0.0, 20.0, 50.0, 90.0],
}


def anything(numbers: random.Random) -> dict[str, Any]:
    """A scenario in which much is zero and much is not."""
    tables: dict[str, Any] = {"time": {"duration_s": 10.0}, "receiver": {"type": "sequential"}}
    plain = {"receiver": tables["receiver"]}
    for table, component in (*((t, t) for t in CORE_COMPONENTS), ("receiver", "sequential")):
        for variable in COMPONENTS[component].of("parameter"):
            likely = 0.9 if variable.choices is None else 0.5
            if numbers.random() < likely or variable.name in ("waypoint_count", *TICK_PARAMETERS):
                continue
            default = getattr(getattr(load(plain), table), variable.key)
            if default is None:
                continue
            others = values_of(variable, default)
            if others and (not variable.shape or variable.name == "waypoint"):
                tables.setdefault(table, {})[variable.key] = numbers.choice(others)
    if tables.get("platform", {}).get("motion") == "spectrum":
        tables["platform"].setdefault("wave_height_m", 0.37)
    if tables.get("target", {}).get("trajectory") == "waypoints":
        tables["target"]["waypoint_m"] = [[0, 0, 1], [5, 0, 2], [5, 5, 3]]
    if tables.get("target", {}).get("trajectory") == "file":
        tables["target"] |= TRACK
    if tables.get("platform", {}).get("track_count"):
        del tables["platform"]["track_count"]  # with points, below
    return tables


@pytest.mark.parametrize(
    "seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 20))]
)
def test_no_key_that_is_said_to_have_no_effect_has_one(seed: int) -> None:
    base = load(anything(random.Random(seed)))
    idle, tried = without_effect(base)
    assert base.idle().keys() & tried <= idle
