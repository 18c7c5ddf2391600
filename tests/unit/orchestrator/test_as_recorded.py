"""Numbers of short dives, settings, limits and statistics are those that were recorded.

What they should be, other tests say, with tolerances; here, no formula may change a number
unnoticed. ``SBLCOSIM_RECORD_ANSWERS=1`` records them anew, where a change is wanted.
"""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import as_recorded
import numpy as np
import pandas as pd
import pytest
import sblcosim
from sblcosim.analysis.common import bounds
from sblcosim.analysis.levels.analysis import analyse as several_levels
from sblcosim.analysis.space import jackknife, two_values
from sblcosim.analysis.two_level.analysis import analyse as two_level
from sblcosim.comparison.common import statistics
from sblcosim.errors import ConfigurationError
from sblcosim.estimation.particles import particle_filter
from sblcosim.judge import pooling
from sblcosim.limits import lengths
from sblcosim.models import COMPONENTS, RECEIVERS
from sblcosim.models.declaration import Component, Variable
from sblcosim.models.settings.presets import PRESET_TABLES, PRESET_VALUES
from sblcosim.results.figures import maps
from sblcosim.scenario.likes import LIKES
from sblcosim.scenario.scenario import Scenario, load, shipped
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters import lanes
from sblcosim.simulation.resolve import resolve

ENVIRONMENT = ("target", "platform", "acoustics")
ALIKE = {"paper-scenario-2", "paper-scenario-3"}
"""Scenarios that differ from others by the path alone."""
ROUGH = {
    "platform.roll_amplitude_deg": 4.0, "platform.pitch_amplitude_deg": 3.0,
    "platform.yaw_amplitude_deg": 9.0, "platform.surge_amplitude_m": 0.3,
    "platform.sway_amplitude_m": 0.2, "platform.heave_amplitude_m": 0.1,
    "platform.imu_temperature_offset_K": 5.0, "platform.mounting_std_m": 0.02,
    "acoustics.loss_probability": 0.2, "acoustics.outlier_probability": 0.1,
    "acoustics.clock_offset_std_s": 1e-4, "acoustics.clock_drift_std_s_s": 1e-6,
}  # fmt: skip
SYSTEMS: Mapping[str, tuple[str, dict[str, Any]]] = {
    "one-way": ("harbour-square", {**ROUGH, "acoustics.shadow_direction_deg": 0.0}),
    "two-way": ("harbour-square", {**ROUGH, "acoustics.ranging": "two_way"}),
    "inverted": ("harbour-square", {**ROUGH, "acoustics.ranging": "inverted"}),
    "sea": ("realistic-sea", {}),
    "buoys": ("gps-buoys", {}),
}

DIVES: Mapping[str, tuple[str, dict[str, Any]]] = {
    "two-way": SYSTEMS["two-way"],
    "inverted": SYSTEMS["inverted"],
    "together": ("harbour-square", {**ROUGH, "acoustics.schedule": "simultaneous"}),
    "own packets": ("harbour-square", {
        **ROUGH, "acoustics.packet_content": "own_beacon", "acoustics.packet_bits": 60}),
    "misaligned": ("harbour-lbl", {
        "receiver.acceleration_psd_m2_s3": 0.01, "platform.mounting_std_m": 0.5}),
    "layers": ("harbour-square", {
        **ROUGH, "acoustics.sound_speed_m_s": None, "acoustics.profile_depth_m": [0.0, 1.0, 2.5],
        "acoustics.profile_speed_m_s": [1530.0, 1480.0, 1510.0]}),
    "wakes": ("harbour-wakes", {"acoustics.shadow_loss_probability": 0.5,
                                "acoustics.shadow_direction_deg": 20.0, "seed": 4}),
}  # fmt: skip


def quietly(action: Callable[[], Any]) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return action()


def all_receivers(scenario: Scenario) -> list[str]:
    """Those that take its ranges."""
    taken = []
    for name in RECEIVERS:
        try:
            quietly(lambda name=name: connect(scenario, [name]))
        except ConfigurationError:
            continue
        taken.append(name)
    return taken


@pytest.mark.parametrize("name", [*sorted({*shipped()} - ALIKE), *DIVES])
def test_a_dive_is_as_recorded(name: str) -> None:
    base, keys = DIVES.get(name, (name, {}))
    scenario = quietly(lambda: load(base, {"time.duration_s": 90.0, **keys}))
    result = quietly(lambda: sblcosim.run(scenario, all_receivers(scenario)))
    found = {
        "tables": {key: as_recorded.table_of(t) for key, t in result.tables.items()},
        "judged": {key: as_recorded.fields_of(it) for key, it in result.judged.items()},
        "possible": as_recorded.fields_of(result.limits),
        "verdicts": {key: as_recorded.fields_of(it) for key, it in result.verdicts.items()},
        "text": result.text(verbose=True).splitlines(),
    }
    as_recorded.check(f"dive {name}", found)


def component(name: str) -> Component:
    return RECEIVERS[name] if name in RECEIVERS else COMPONENTS[name]


def numbers(table: str) -> list[Variable]:
    """Parameters that are numbers, but for ticks and what selects something."""
    return [
        v for v in component(table).of("parameter")
        if v.type == "Float64" and v.choices is None and v.name != component(table).interval
    ]  # fmt: skip


def a_little_more(variable: Variable, value: Any) -> Any:
    """Another value that is allowed [SI]: in all elements, by various amounts."""
    flat = np.ravel(value).astype(float)
    is_share = (variable.min, variable.max, variable.unit) == (0.0, 1.0, None)
    more = flat + (0.4 if is_share else 0.05) * (1 + np.arange(len(flat)) / 7)
    more = np.where(more > (np.inf if variable.max is None else variable.max), flat - 0.05, more)
    return more if variable.shape else float(more[0])


@pytest.mark.parametrize("which", SYSTEMS)
def test_each_parameter_acts_as_recorded(which: str) -> None:
    """One lane for each parameter, which is a little more there."""
    name, keys = SYSTEMS[which]
    scenario = quietly(lambda: load(name, {**keys, "time.duration_s": 16.0}))
    labels = all_receivers(scenario)
    system = quietly(lambda: connect(scenario, labels, tell_idle=False))
    known = {part: system.components[part].parameters for part in (*ENVIRONMENT, *labels)}
    tried = [
        (part, v) for part in known for v in numbers(part)
        if v.name in known[part] or not v.shape
    ]  # fmt: skip
    values: dict[str, Any] = {}
    for lane, (part, v) in enumerate(tried, 1):
        now = known[part].get(v.name, v.starts if v.shape else v.starts[0])
        column = np.tile(np.ravel(now).astype(float), (len(tried) + 1, 1))
        column[lane] = np.ravel(a_little_more(v, now))
        values[f"{part}.{v.name}"] = column if v.shape else column[:, 0]
    outputs = [f"{part}.{v.name}" for part in known for v in component(part).of("output")]
    outcome = quietly(lambda: lanes.execute(resolve(system), values, record=outputs))
    of = {
        part: as_recorded.digest_of_all(
            outcome.values[key] for key in outputs if key.startswith(f"{part}.")
        )
        for part in known
    }
    names = ["as it is", *(f"{part}.{v.name}" for part, v in tried)]
    found = {name: [of[part][lane] for part in known] for lane, name in enumerate(names)}
    as_recorded.check(f"parameters {which}", found)


@pytest.mark.parametrize("name", [
    "paper-scenario-1", "realistic-sea", "harbour-lbl", "gps-buoys", "own packets",
])  # fmt: skip
def test_what_is_estimated_after_a_dive_is_as_recorded(name: str) -> None:
    scenario, keys = DIVES.get(name, (name, {}))
    short = {**keys, "time.duration_s": 60.0, "seed": 3}
    run = quietly(lambda: sblcosim.run(scenario, overrides=short))
    after = [quietly(lambda: sblcosim.smooth(run))]
    if name == "realistic-sea":
        after.append(quietly(lambda: particle_filter(run, particles=2000)))
    found = {
        type(it).__name__: {key: as_recorded.table_of(t) for key, t in it.tables.items()}
        for it in after
    }
    as_recorded.check(f"after {name}", found)


def settings() -> dict[str, dict[str, Any]]:
    """Changes of a scenario: each choice of a component and each value of a preset."""
    changes: dict[str, dict[str, Any]] = {}
    for table in ENVIRONMENT:
        for v in COMPONENTS[table].of("parameter"):
            for choice in (v.choices or {}).values():
                changes[f"{table}.{v.key}={choice}"] = {f"{table}.{v.key}": choice}
    for name, values in PRESET_VALUES.items():
        for value in values:
            key = f"{PRESET_TABLES[name]}.{name}"
            changes[f"{key}={value}"] = {key: value}
    return changes


def parameters(scenario: Scenario, labels: Iterable[str]) -> dict[str, float]:
    """One number of the parameters of each component, with those receivers that it may have."""
    found = {}
    for label in labels:
        with contextlib.suppress(ConfigurationError), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            system = connect(scenario, [label], tell_idle=False)
            for part, spec in system.components.items():
                told = sorted(spec.parameters.items())
                (found[part],) = as_recorded.digest_of_all([value] for _, value in told)
    return found


@pytest.mark.parametrize("name", ["harbour-square", "realistic-sea", "gps-buoys"])
def test_what_follows_from_each_choice_is_as_recorded(name: str) -> None:
    """Parameters of all components and receivers, or why a choice is refused."""
    found: dict[str, Any] = {}
    for said, keys in {"as it is": {}, **settings()}.items():
        try:
            scenario = quietly(lambda keys=keys: load(name, keys))
            found[said] = parameters(
                scenario, [*RECEIVERS] if not found else ["coupled", "long_baseline", "ekf"]
            )
        except ConfigurationError as error:
            found[said] = str(error)
    as_recorded.check(f"settings {name}", found)


def test_the_systems_to_begin_with_are_as_recorded() -> None:
    """Parameters of all components of each."""
    found = {
        name: parameters(quietly(lambda it=it: load(it.source)), ["coupled", "long_baseline"])
        for name, it in LIKES.items()
    }
    as_recorded.check("likes", found)


def drawn(seed: int, *shape: int) -> Any:
    """Lengths, some of them long [m]."""
    return np.random.default_rng(seed).lognormal(0.0, 0.6, shape)


@dataclass(frozen=True)
class Cells:
    """Runs in cells, some without an estimate."""

    cell: Any
    lengths: Any


def comparisons() -> dict[str, Any]:
    """Differences of all verdicts, from few and many runs, of which some fail."""
    found: dict[str, Any] = {}
    cases = [*product((2, 7, 12, 40, 200), (0.0, 0.05, 0.3, 2.0), (None, 0.15, 0.6))]
    for seed, (runs, apart, practical) in enumerate(cases):
        one, other = drawn(seed, runs), drawn(seed + 1000, runs) + apart
        if seed % 4 == 3:
            one[::9] = np.nan
        near = one + np.random.default_rng(seed).normal(apart / 9, 0.2, runs)
        for name, pair in (("far", (one, other)), ("near", (one, near))):
            told = statistics.difference(*pair, 1 + seed % 3, practical)
            found[f"{name} {runs} {apart} {practical}"] = told.to_json()
        found[f"level {seed}"] = statistics.level(one)
    return found


def bounds_of_runs() -> dict[str, Any]:
    found: dict[str, Any] = {}
    for risk, share in product((0.01, 0.05, 0.5, 0.9), (0.02, 0.1, 0.5, 0.95)):
        y = np.sort(drawn(int(1000 * share), 60))
        found[f"{risk} {share}"] = [
            bounds.runs_to_see(share, min(risk, 0.5)), bounds.share_bound(3, 40, risk),
            *bounds.mean_bound(y, risk), *bounds.percentile_bound(y, share, min(risk, 0.5)),
        ]  # fmt: skip
    found["runs for t"] = [bounds.runs_for_t(s) for s in (-3.0, -0.4, 0.0, 0.7, 2.0, 6.0)]
    return found


def indices_of_runs() -> dict[str, Any]:
    found: dict[str, Any] = {}
    for rows, columns in ((16, 3), (64, 4)):
        a, b = drawn(rows, rows, columns), drawn(rows + 1, rows, columns)
        every = [a, *(np.where(np.arange(columns) == i, b, a) for i in range(columns)), b]
        y = np.stack([x[:, 0] * x[:, 1] + 0.2 * x[:, 2] for x in every], axis=1)
        for confidence in (0.8, 0.95):
            found[f"{rows} {confidence}"] = [
                jackknife.indices(y, confidence), two_values.intervals(1.0 * (y > 1.2), confidence),
                two_values.intervals(1.0 * (y > 4.0), confidence),
            ]  # fmt: skip
    return found


def pooled_cells() -> dict[str, Any]:
    found: dict[str, Any] = {}
    for seed, (shape, reach) in enumerate([((5, 6), 0), ((5, 6), 1), ((8, 3), 2), ((1, 9), 1)]):
        count = shape[0] * shape[1]
        lengths_ = np.sort(drawn(seed, 4 * count, len(pooling.PERCENTAGES)))
        runs = Cells(np.repeat(np.arange(count), 4), lengths_)
        runs.lengths[:5] = np.inf
        possible = drawn(seed + 50, count)
        possible[2] = 0.0
        found[f"{shape} {reach}"] = pooling.pooled(runs, possible, shape, seed, 1, reach)
        found[f"{shape}"] = pooling.effective(shape)
    return found


def lengths_of_covariances() -> dict[str, Any]:
    found: dict[str, Any] = {}
    for d, share in product((1, 2, 3), (0.1, 0.5, 0.95, 0.999)):
        half = np.random.default_rng(d).normal(size=(3, 5, d, d)) * drawn(d, 1, 5, 1, 1)
        half[:, 0, :, 1:] = 0.0
        found[f"{d} {share}"] = lengths.percentile(half @ half.swapaxes(-1, -2), share)
    return found


def experiments() -> dict[str, Any]:
    """Analyses of runs on two levels, with and without centre points, and on several levels."""
    found: dict[str, Any] = {}
    names = ["a", "b", "c"]
    points = pd.DataFrame(product((-1.0, 1.0), repeat=3), columns=names)
    middle = pd.concat([points, pd.DataFrame([[0.0] * 3] * 2, columns=names)])
    fraction = points[points.a * points.b * points.c > 0]
    for seed, (table, runs) in enumerate([(points, 1), (points, 5), (middle, 3), (fraction, 4)]):
        data = pd.concat([table.assign(replicate=r) for r in range(runs)], ignore_index=True)
        noise = drawn(seed, len(data))
        data["y"] = np.exp(0.4 * data.a - 0.2 * data.b * data.c) * (2 + noise)
        data["run_order"] = np.argsort(noise)
        for options in ({}, {"transform": "log"}, {"order": 1}, {"seeding": "common"},
                        {"practical": 0.5, "confidence": 0.9}):  # fmt: skip
            with contextlib.suppress(ConfigurationError):
                told = quietly(
                    lambda options=options, data=data: two_level(data, names, "y", **options)
                )
                found[f"two levels {seed} {options}"] = saying(told)
    table = pd.DataFrame(product((1, 2, 5), ("x", "y"), (0.1, 0.2, 0.3, 0.4)), columns=names)
    data = pd.concat([table.assign(replicate=r) for r in range(3)], ignore_index=True)
    data["y"] = 1 + 0.3 * data.a * (data.b == "x") + data.c + drawn(9, len(data))
    for options in ({}, {"typ": 3}, {"transform": "log"}, {"order": 1}, {"seeding": "common"},
                    {"practical": 0.4, "confidence": 0.9}):  # fmt: skip
        for some in (data, data.iloc[np.r_[0:40, 43:72]]):
            with contextlib.suppress(ConfigurationError):
                told = quietly(
                    lambda options=options, some=some: several_levels(some, names, "y", **options)
                )
                found[f"levels {len(some)} {options}"] = saying(told)
    return found


def saying(answer: Any) -> dict[str, Any]:
    return {
        "text": answer.text(verbose=True).splitlines(),
        "tables": {name: as_recorded.table_of(table) for name, table in answer.tables.items()},
    }


def sheets_of_maps() -> dict[str, Any]:
    """Room for one map or several, of areas from narrow to wide [inch]."""
    found: dict[str, Any] = {}
    for count, north, east in product((1, 2, 3, 5, 9), (4.0, 20.0, 90.0), (3.0, 20.0, 70.0)):
        limits = {"x_m": (-1.0, north - 1.0), "y_m": (2.0, east + 2.0)}
        sheet = maps.Sheet(limits, count, 1.4)
        found[f"{count} {north} {east}"] = [
            sheet.wide, sheet.high, sheet.scale, sheet.beside, sheet.limits
        ]
    return found


STATISTICS = (sheets_of_maps, comparisons, bounds_of_runs, indices_of_runs, pooled_cells,
              lengths_of_covariances, experiments)  # fmt: skip


@pytest.mark.parametrize("made", STATISTICS, ids=lambda made: str(made.__name__))
def test_statistics_of_drawn_numbers_are_as_recorded(made: Callable[[], dict[str, Any]]) -> None:
    found = {key: as_recorded.fields_of(value) for key, value in made().items()}
    as_recorded.check(made.__name__, found)


@pytest.mark.parametrize(("name", "area", "keys"), [
    ("harbour-wakes", "8x40", {"acoustics.shadow_loss_probability": 0.5,
                               "acoustics.shadow_direction_deg": 20.0}),
    ("harbour-square", "40x10", {"acoustics.schedule": "simultaneous",
                                 "acoustics.loss_probability": 0.4,
                                 "acoustics.shadow_loss_probability": 0.5,
                                 "acoustics.shadow_direction_deg": 20.0}),
])  # fmt: skip
def test_a_map_is_as_recorded(name: str, area: str, keys: dict[str, Any]) -> None:
    """Of wide and of tall areas, with a diver who shades the beacons."""
    found = quietly(lambda: sblcosim.map_area(
        name, area, 2.5, cells="2x2", runs=2, duration_s=8.0, settling_s=2.0, overrides=keys
    ))  # fmt: skip
    told = as_recorded.told(found, Path("nowhere"))
    as_recorded.check(f"map {name}", told)


@pytest.mark.parametrize("name", ["realistic-dive", "harbour-lbl"])
def test_figures_of_a_long_dive_are_as_recorded(name: str) -> None:
    result = quietly(lambda: sblcosim.run(name))
    figures = [job for job in result.figures if job.name.startswith("path")]
    assert figures
    as_recorded.check(f"figures {name}", {
        "figures": {job.name: as_recorded.drawn(job.axes()) for job in figures}
    })  # fmt: skip
