"""The settings module: in C and as WebAssembly it has the bits of Python."""

from __future__ import annotations

import ctypes
import random
import shutil
import subprocess
import warnings
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from quick import few
from sblcosim.errors import ConfigurationError
from sblcosim.fmus.build import compiler
from sblcosim.fmus.platforms import WASM
from sblcosim.models import RECEIVERS, declared
from sblcosim.models.acoustics.schedules import schedule_of
from sblcosim.models.declaration import Component, Variable
from sblcosim.models.ports import BEACONS
from sblcosim.models.settings import assumptions, boat, keys, times
from sblcosim.models.settings.names import names_of
from sblcosim.models.settings.start_values import TABLES
from sblcosim.scenario import settings
from sblcosim.scenario.scenario import load, shipped
from sblcosim.scenario.wiring import connect

NODE = shutil.which("node")
SCRIPT = Path(__file__).with_name("settings.cjs")
QUICK_CASES, SLOW_CASES = 50, 200_000 // 6 + 1
"""Random settings for each number of beacons."""
LARGEST = 60_000
"""Largest size of a module in bytes."""
COUNTS = range(BEACONS.least, BEACONS.most + 1)
Elements = Mapping[str, tuple[float, ...]]


# --- The module ----------------------------------------------------------------------------------


@cache
def module(beacons: int) -> Any:
    return ctypes.CDLL(str(settings.library(beacons)))


def of_c(beacons: int, given: np.ndarray) -> np.ndarray:
    """Results of the shared library for rows of inputs."""
    library, places = module(beacons), ctypes.POINTER(ctypes.c_double)
    assert library.sblcosim_keys() == given.shape[1]
    found = np.zeros((len(given), length_of(beacons)))
    for row, result in zip(given, found, strict=True):
        length = library.sblcosim_start_values(
            row.ctypes.data_as(places), result.ctypes.data_as(places))
        assert length == len(result)
    return found


def of_wasm(beacons: int, given: np.ndarray, folder: Path) -> np.ndarray:
    """The same of the module of WebAssembly, in node."""
    built = settings.library(beacons, compiler.for_platform(WASM))
    assert built.stat().st_size <= LARGEST
    (folder / "keys").write_bytes(given.astype("<f8").tobytes())
    assert NODE is not None
    subprocess.run([NODE, SCRIPT, built, "keys", "values"], cwd=folder, check=True)
    return np.frombuffer((folder / "values").read_bytes(), "<f8").reshape(len(given), -1)


@cache
def component(name: str, beacons: int) -> Component:
    return declared(name, beacons=beacons)


@cache
def start(name: str, beacons: int, parameter: str) -> Any:
    of = component(name, beacons)
    return keys.default(of, of[parameter])


@cache
def described(beacons: int) -> Mapping[str, Any]:
    return settings.description(beacons)


def length_of(beacons: int) -> int:
    return 1 + max(max(places) for places in every_place(beacons).values())


def every_place(beacons: int) -> Mapping[str, Any]:
    """Places of all results, by parameter, or by the name of what a bound needs."""
    found = described(beacons)
    return {**found["values"], **{name: [place] for name, place in found["levels"].items()}}


def bits(values: np.ndarray) -> np.ndarray:
    """Bits of doubles; all NaN are one."""
    return np.where(np.isnan(values), np.nan, values).view(np.int64)


# --- Settings at random --------------------------------------------------------------------------


class Settings(SimpleNamespace):
    """Tables as a scenario has them, of which any combination may be drawn."""

    beacons: int


def drawn(beacons: int, numbers: random.Random) -> Settings:
    found = Settings(beacons=beacons)
    for name in TABLES:
        table = SimpleNamespace(beacons=beacons)
        for variable in component(name, beacons).of("parameter"):
            setattr(table, variable.key, a_value(variable, numbers))
        table.model_fields_set = {*vars(table)}
        setattr(found, name, table)
    if found.target.trajectory == "file":
        found.target.trajectory = "waypoints"
    found.target.waypoint_count = numbers.randint(2, 64)
    found.platform.track_count = 0 if numbers.random() < 0.7 else numbers.randint(1, 5)
    vars(found.platform).update(a_track(numbers))
    if numbers.random() < 0.7:
        found.acoustics.surface_echo_probability = found.acoustics.bottom_echo_probability = 0.0
    known = {v.key: v for r in RECEIVERS for v in component(r, beacons).of("parameter")}
    given = {
        key: a_value(variable, numbers) for key, variable in known.items()
        if numbers.random() < 0.2
    }
    found.time = SimpleNamespace(
        sampling_time_s=numbers.randint(1, 10**numbers.randint(4, 10)) / 1e9,
        ekf_ratio=numbers.randint(1, 1000))
    for table in (found.target, found.platform, found.acoustics):
        if numbers.random() < 0.5:
            table.sampling_time_s = found.time.sampling_time_s
            table.model_fields_set.remove("sampling_time_s")
    if numbers.random() < 0.5:
        found.platform.mean_heading_deg = boat.heading(found.platform)
        found.platform.model_fields_set.remove("mean_heading_deg")
    found.receiver = SimpleNamespace(
        **dict.fromkeys(known), model_fields_set={*given})
    vars(found.receiver).update(given)
    return found


def a_track(numbers: random.Random) -> dict[str, tuple[float, ...]]:
    """A boat's track of a few points, of which some may be without a heading or at one place."""
    points, still = numbers.randint(2, 5), numbers.random() < 0.2

    def some(count: int, size: float) -> tuple[float, ...]:
        return tuple(0.0 if still else round(numbers.uniform(-size, size), 3) for _ in range(count))

    times = sorted(numbers.uniform(0.0, 100.0) for _ in range(points))
    return {
        "track_time_s": tuple(times), "track_m": some(2 * points, 50.0),
        "track_heading_deg": some(numbers.choice([0, points]), 400.0),
    }


def a_value(variable: Variable, numbers: random.Random) -> Any:
    """A value of a key: a start value, 0, a decimal, or any number within the bounds."""
    names = names_of(variable)
    if names:
        return numbers.choice([*names])
    if variable.named and numbers.random() < 0.3:
        return numbers.choice([*variable.named])
    if variable.shape:
        if numbers.random() < 0.2:
            return (0.0,) * variable.size
        elements = [a_number(variable, numbers) for _ in range(min(variable.size, 24))]
        return (*elements, *elements * 7)[: variable.size]
    return a_number(variable, numbers)


def a_number(variable: Variable, numbers: random.Random) -> float:
    low, high = (
        end if bound is None else keys.in_file_units(variable, bound)
        for bound, end in zip(variable.bounds, (-1e4, 1e4), strict=True)
    )
    kind = numbers.random()
    if low <= 0.0 <= high and kind < 0.35:
        return 0.0
    if variable.type != "Float64":
        return float(numbers.randint(int(low), int(min(high, 1e6))))
    sizes = max(abs(low), abs(high), 1e-6)
    value = 10 ** numbers.uniform(-6, np.log10(sizes)) * numbers.choice([1.0, -1.0])
    if kind < 0.75:
        value = round(value, numbers.randint(0, 5))
    return min(max(value, low), high)


def of_python(drawn: Settings) -> Elements:
    """Start values of all components as the product computes them."""
    found, tables = {}, (drawn.target, drawn.platform, drawn.acoustics)
    own, given = drawn.receiver, drawn.receiver.model_fields_set
    source = own.pose_source if "pose_source" in given else None
    known = assumptions.assumed(*tables, source)
    for name in (*TABLES, *RECEIVERS):
        parameters = component(name, drawn.beacons).of("parameter")
        table = getattr(drawn, name if name in TABLES else "receiver")
        told: Mapping[str, Any] = {}
        if name in RECEIVERS:
            names = {v.name for v in parameters}
            everything = not assumptions.PARAMETERS.isdisjoint(names)
            told = assumptions.levels(
                known if everything else assumptions.clock(drawn.acoustics), *tables,
                **assumptions.knowledge(names))
            told = {**told, "update_interval_s": times.update_interval(
                drawn.time.sampling_time_s, drawn.time.ekf_ratio)}
        for v in parameters:
            if f"{name}.{v.name}" not in described(drawn.beacons)["values"]:
                continue
            value = getattr(table, v.key)
            if name in RECEIVERS and v.key not in given:
                value = told.get(v.key) if v.key in told else start(name, drawn.beacons, v.name)
            # A track has more points than there is room for in a usual platform.
            value = keys.in_si(v, value[: v.size] if v.shape else value)
            found[f"{name}.{v.name}"] = value if isinstance(value, tuple) else (value,)
    noise = assumptions.range_noise(drawn.acoustics)
    together = schedule_of(drawn.acoustics).together(drawn.beacons)
    levels = {
        "range_noise": noise, "noise": assumptions.with_common(noise, drawn.acoustics),
        "common_noise": assumptions.common_noise(drawn.acoustics),
        "lasting_delay": assumptions.lasting_delay(drawn.acoustics),
        "slots": drawn.beacons / together,
    }  # fmt: skip
    return {**found, **{name: (value,) for name, value in levels.items()}}


def expected(found: Elements, beacons: int) -> np.ndarray:
    """The values that the module should compute, in its order."""
    values = np.full(length_of(beacons), np.nan)
    for name, places in every_place(beacons).items():
        for place, value in zip(places, found[name], strict=True):
            assert np.isnan(values[place]) or values[place] == value, name
            values[place] = value
    return values


def may_be_unknown(beacons: int) -> np.ndarray:
    found = np.zeros(length_of(beacons), bool)
    for name in described(beacons)["unknown"]:
        found[described(beacons)["values"][name]] = True
    return found


# --- Tests ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("cases", few([QUICK_CASES, SLOW_CASES], quick=[QUICK_CASES]))
@pytest.mark.parametrize("beacons", few(COUNTS, quick=(3, 4, 8)))
def test_settings_at_random_have_the_same_bits(beacons: int, cases: int, tmp_path: Path) -> None:
    numbers, done, known = random.Random(f"{beacons} {cases}"), 0, 0
    unknown = may_be_unknown(beacons)
    while done < cases:
        some = [drawn(beacons, numbers) for _ in range(min(cases - done, 2000))]
        given = np.array([settings.keys_of(it) for it in some])
        wanted = np.array([expected(of_python(it), beacons) for it in some])
        found = of_c(beacons, given)
        if NODE is not None and compiler.zig() is not None:
            assert (bits(of_wasm(beacons, given, tmp_path)) == bits(found)).all()
        missing = np.isnan(found)
        assert not missing[:, ~unknown].any()
        calm = [it.target.trajectory != "waypoints" or not (
            it.acoustics.surface_echo_probability or it.acoustics.bottom_echo_probability
        ) for it in some]
        assert not missing[calm].any()
        other = (bits(found) != bits(wanted)) & ~missing
        assert not other.any(), [
            (name, found[other][:3], wanted[other][:3])
            for name, places in every_place(beacons).items() if other[:, places].any()
        ][:5]
        done, known = done + len(some), known + sum(calm)
    assert known > 0.8 * cases


@pytest.mark.parametrize("name", few(shipped(), quick=("gps-buoys", "paper-scenario-1")))
def test_scenarios_start_with_the_values_of_the_module(name: str) -> None:
    """With all that loading fills in, and with keys that change what it fills in."""
    numbers = random.Random(name)
    compared = 0
    for case in range(8):
        changes = {} if case == 0 else changed(name, numbers)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                scenario = load(name, changes)
                system = connect(scenario, receivers=[*RECEIVERS])
        except ConfigurationError:
            continue
        beacons = scenario.beacons
        (values,) = of_c(beacons, np.array([settings.keys_of(scenario)]))
        for path, places in described(beacons)["values"].items():
            name_of, parameter = path.split(".")
            start = component(name_of, beacons)[parameter].starts
            own: Any = system.components[name_of].parameters.get(parameter, start)
            own = np.array(own if isinstance(own, tuple) else (own,), float)
            same = bits(values[places]) == bits(own)
            assert (same | np.isnan(values[places])).all(), (path, changes)
            compared += np.count_nonzero(same)
    assert compared > 300


def changed(name: str, numbers: random.Random) -> dict[str, Any]:
    """Some keys of a scenario with values at random."""
    changes = {}
    for table in TABLES:
        parameters = [v for v in declared(table).of("parameter") if not v.shape and v.unit]
        for v in numbers.sample(parameters, 4):
            changes[f"{table}.{v.key}"] = a_value(v, numbers)
    changes["time.sampling_time_s"] = numbers.choice([0.1, 0.25, 0.7])
    changes["time.ekf_ratio"] = numbers.choice([1, 4, 7])
    return changes


@pytest.mark.parametrize("beacons", COUNTS)
def test_the_description_covers_every_parameter_once(beacons: int) -> None:
    found = described(beacons)
    names = {f"{name}.{v.name}" for name in (*TABLES, *RECEIVERS)
             for v in component(name, beacons).of("parameter")}
    assert {*found["values"], *found["copies"]} == names
    assert not found["values"].keys() & found["copies"].keys()
    assert found["depends"].keys() == found["values"].keys() >= found["unknown"].keys()
    asked = {key for keys in found["depends"].values() for key in keys}
    assert found["optional"]
    assert {*found["optional"]} <= asked
    assert asked == {name.partition("[")[0] for name in found["keys"]}
