"""What rooms say about logs of many kinds, conditions and designs is what was recorded.

What it should be, other tests say. ``SBLCOSIM_RECORD_ANSWERS=1`` records it anew, where a change is
wanted.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import as_recorded
import log_samples
import made_logs
import numpy as np
import pytest
import sblcosim
from sblcosim import require, style
from sblcosim.calibrate import calibrate
from sblcosim.errors import ConfigurationError
from sblcosim.estimation import late as late_ranges
from sblcosim.identification import losses
from sblcosim.identification import path as way
from sblcosim.identification.run import identify
from sblcosim.judge import consistency, definitions
from sblcosim.limits import echoes, fisher, geometry, path, steady, unknown
from sblcosim.models.settings.presets import PRESET_TABLES, PRESET_VALUES
from sblcosim.processing.settings import settled, start_values
from sblcosim.require.file_schema import question_schema
from sblcosim.results.figures import drawing
from sblcosim.scenario import conditions, water
from sblcosim.scenario.file_schema import scenario_schema
from sblcosim.scenario.likes import LIKES
from sblcosim.scenario.scenario import Scenario, load, shipped
from sblcosim.scenario.starter import starter
from sblcosim.study import design, space
from sblcosim.study.distributions import distribution_of
from sblcosim.study.file_schema import study_schema
from sblcosim.tracks import course, resample
from sblcosim.words import numbers, shares

CORNERS = made_logs.CORNERS
OFFSETS = np.array([0.6, -0.4, 0.3, 0.0])


def quietly(action: Callable[[], Any]) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return action()


def late() -> Any:
    """A log with late ranges and some that are far too short."""
    log = made_logs.made(seconds=240, std=0.2, seed=5, turning=0.05)
    rng = np.random.default_rng(5)
    log = made_logs.changed(log, np.flatnonzero(rng.random(240) < 0.15), 4.0)
    return made_logs.changed(log, [37, 111], -15.0)


def alike() -> Any:
    """A log whose ranges have errors that resemble those before."""
    log = made_logs.made(seconds=240, std=0.05, seed=6, turning=0.05)
    time = (log.receptions.arrival_ns - log.receptions.arrival_ns[0]) / 1e9
    return made_logs.changed(log, slice(None), 0.25 * np.sin(time / 9 + log.receptions.beacon))


def dive(scenario: str, **keys: Any) -> Callable[[Path], Any]:
    def made(folder: Path) -> Any:
        _, log = made_logs.written(folder, scenario, None, overrides={
            "time.duration_s": 60.0, **keys})  # fmt: skip
        return sblcosim.read_log(log)

    return made


LOGS: Mapping[str, Callable[[Path], Any]] = {
    "plane": lambda _: made_logs.made(seconds=90, plane=True, seed=2),
    "offsets": lambda _: made_logs.made(seconds=200, scale=1.02, offsets=OFFSETS, seed=3),
    "without truth": lambda _: made_logs.made(
        seconds=120, truth=False, origin=(300.0, -200.0, 2.0), start_s=50.0, seed=4, speed=1.2),
    "late": lambda _: late(),
    "alike": lambda _: alike(),
    "sea": dive("realistic-sea"),
    "buoys": dive("gps-buoys"),
    "two-way": dive("harbour-square", **{"acoustics.ranging": "two_way",
                                         "acoustics.loss_probability": 0.2,
                                         "acoustics.outlier_probability": 0.1}),
}  # fmt: skip


@pytest.mark.parametrize("name", LOGS)
def test_what_is_said_of_a_log_is_as_recorded(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    log = quietly(lambda: LOGS[name](Path("run")))
    found = {
        "process": as_recorded.told(quietly(lambda: sblcosim.process(log)), tmp_path),
        "smoothed": smoothed(log),
    }
    ready = quietly(lambda: settled(log))
    settings = [ready.scenario.given(), start_values(ready, 0.5), ready.interval_ns, ready.slots]
    found["settings"] = json.loads(json.dumps(every(settings)).replace(str(tmp_path), "HERE"))
    as_recorded.check(f"log {name}", found)
    device = as_recorded.told(quietly(lambda: identify(log)), tmp_path)
    as_recorded.check(f"identified {name}", device, as_recorded.SEARCHED)


def smoothed(log: Any) -> Any:
    """Estimates of the smoother, or why there are none."""
    try:
        found = quietly(lambda: sblcosim.process(log, smooth=True))
    except ConfigurationError as error:
        return str(error)
    return [as_recorded.fields_of(dict(found.made)), list(found.remarks)]


@pytest.mark.parametrize("name", log_samples.SAMPLES)
def test_what_is_read_from_a_log_is_as_recorded(name: str, tmp_path: Path) -> None:
    make, file = log_samples.SAMPLES[name]
    folder = tmp_path / "log"
    folder.mkdir()
    for part, text in make().items():
        (folder / part).write_bytes(text.encode())
    log = quietly(lambda: sblcosim.read_log(folder / file if file else folder))
    found = json.loads(json.dumps(every(log)).replace(str(folder), "HERE"))
    as_recorded.check(f"read {name}", {"log": found})


def every(it: Any) -> Any:
    """Fields of a dataclass, and of what they hold, arrays as digests."""
    if is_dataclass(it) and not isinstance(it, type):
        return {f.name: every(getattr(it, f.name)) for f in fields(it)}
    if isinstance(it, Mapping):
        return {str(key): every(value) for key, value in it.items()}
    if isinstance(it, tuple | list):
        return [every(value) for value in it]
    return as_recorded.fields_of(it)


def drawn(seed: int, low: float, high: float, *shape: int) -> Any:
    return np.random.default_rng(seed).uniform(low, high, shape)


TRACK: dict[str, Any] = {
    "platform.boat_speed_m_s": 0.0, "platform.mean_position_m": [6.0, -9.0, 0.5],
    "platform.mounting_std_m": 0.1, "platform.misalignment_heading_std_deg": 2.0,
    "platform.track_time_s": [0.0, 20.0, 50.0], "platform.departure_time_s": 5.0,
    "platform.track_m": [[0.0, 0.0], [14.0, -3.0], [20.0, 18.0]],
    "platform.track_heading_deg": [10.0, 40.0, 130.0],
}  # fmt: skip


def limits() -> dict[str, Any]:
    """Closed forms over wide inputs."""
    beacons = drawn(1, -8.0, 8.0, 5, 3)
    places = drawn(2, -40.0, 40.0, 60, 3)
    found: dict[str, Any] = {
        f"dilution {clock}": geometry.hdop(places, beacons, unknown_clock=clock)
        for clock in (False, True)
    }
    found["dilution in one line"] = geometry.hdop(places, beacons * [1.0, 0.0, 0.0])
    found["cross"] = geometry.cross(2.5, 1.5)
    for name in sorted(shipped()):
        scenario = quietly(lambda name=name: load(name))
        known = quietly(lambda scenario=scenario: steady_of(scenario))
        if known is not None:
            found[name] = steady.closed_form(places, known)
        found[f"{name} unknown"] = [
            [*unknown.left_out(scenario)],
            unknown.squares(scenario, places, drawn(3, 0.0, 900.0, 60)),
        ]
        rest = scenario.acoustics
        found[f"{name} echoes"] = [echoes.echo_chances(rest), echoes.lost(rest)]
    boat = quietly(lambda: load("usbl-boat", TRACK))
    found["along a track unknown"] = [
        [*unknown.left_out(boat)], unknown.squares(boat, places, drawn(3, 0.0, 60.0, 60)),
    ]
    for share, std, mean in product((0.01, 0.1, 0.4), (0.02, 0.3), (0.2, 1.0, 6.0)):
        for kind in ("exponential", "half_normal"):
            found[f"factor {share} {std} {mean} {kind}"] = fisher.fisher_factor(
                std, share, mean, kind
            )
    time = np.arange(40.0)
    found["path"] = [
        path.path_psd(time, np.stack([np.cos(time / r), np.sin(time / r), 0 * time], 1), density)
        for r, density in product((2.0, 9.0), (0.01, 0.4))
    ]
    found["circle"] = path.circle_psd(0.7, 12.0, drawn(4, 0.001, 0.5, 9), 90.0)
    return found


def steady_of(scenario: Scenario) -> Any:
    from sblcosim.limits.parameters import conditions as of

    try:
        return of(scenario)
    except (ConfigurationError, ValueError):
        return None


def changes() -> Iterable[tuple[str, dict[str, Any]]]:
    """Each value of a preset, and numbers of components that conditions name."""
    for name, values in PRESET_VALUES.items():
        for value in values:
            yield f"{name}={value}", {f"{PRESET_TABLES[name]}.{name}": value}
    for key, value in {
        "platform.roll_amplitude_deg": 4.0,
        "platform.yaw_amplitude_deg": 12.0,
        "platform.heave_amplitude_m": 0.3,
        "platform.wave_height_m": 0.7,
        "platform.gps_horizontal_std_m": 0.4,
        "platform.gps_horizontal_bias_std_m": 0.9,
        "platform.imu_heading_std_deg": 1.5,
        "platform.imu_heading_bias_deg": -2.5,
        "platform.misalignment_heading_std_deg": 1.0,
        "platform.mounting_std_m": 0.06,
        "platform.boat_speed_m_s": 1.1,
        "platform.watch_circle_m": 3.0,
        "acoustics.loss_probability": 0.15,
        "acoustics.loss_burst_length": 5.0,
        "acoustics.outlier_probability": 0.05,
        "acoustics.outlier_mean_m": 2.0,
        "acoustics.clock_offset_std_s": 2e-4,
        "acoustics.clock_drift_std_s_s": 3e-6,
        "acoustics.clock_offset_s": 1e-3,
        "acoustics.clock_sync_age_s": 7200.0,
        "acoustics.range_std_m": 0.25,
        "acoustics.range_common_std_m": 0.4,
        "acoustics.shadow_loss_probability": 0.5,
        "acoustics.schedule": "simultaneous",
        "acoustics.ranging": "two_way",
        "acoustics.packet_content": "own_beacon",
    }.items():
        yield f"{key}={value}", {key: value}


def scenarios() -> dict[str, Any]:
    """Conditions in words after many changes, scenarios to begin with, and water."""
    found: dict[str, Any] = {}
    for name in ("harbour-square", "realistic-sea", "gps-buoys"):
        for said, keys in changes():
            try:
                scenario = quietly(lambda name=name, keys=keys: load(name, keys))
                found[f"{name} {said}"] = conditions.conditions(scenario)
            except ConfigurationError as error:
                found[f"{name} {said}"] = str(error)
    for word in LIKES:
        found[f"like {word}"] = quietly(
            lambda word=word: starter("begun", LIKES[word].source, short=True)
        ).splitlines()
    found["all keys"] = quietly(lambda: starter("begun")).splitlines()
    found["sound"] = [
        water.sound_speed(*row) for row in product((1.0, 14.0, 29.0), (0.0, 35.0), (0.0, 80.0))
    ]
    depth, speed = [0.0, 4.0, 4.0, 30.0, 200.0], [1530.0, 1500.0, 1490.0, 1495.0, 1480.0]
    found["mean speed"] = water.mean_speed(depth, speed)
    found["bending"] = [water.bending(depth, speed, d) for d in (5.0, 100.0, 3000.0)]
    return found


def designs() -> dict[str, Any]:
    """Points and orders of designs, and samples of each distribution."""
    found: dict[str, Any] = {}
    factors = [design.Factor(name, (-2.0 + n, 3.0 * n + 1)) for n, name in enumerate("ABCDEFG")]
    for k in (1, 2, 4):
        found[f"full {k}"] = told(design.full(factors[:k], k - 1))
    for k, resolution in ((3, 3), (5, 3), (5, 5), (6, 4), (7, 3), (7, 4)):
        found[f"fraction {k} {resolution}"] = told(
            design.fractional(factors[:k], resolution=resolution, centre_points=2)
        )
    found["generators"] = told(design.fractional(factors[:5], ["D=AB", "E=-ABC"]))
    levels = [design.Factor(name, (0.5, 1.5, 2.5, 9.0)[: n + 2]) for n, name in enumerate("abc")]
    found["sweep"] = told(design.sweep(levels, [0.5, 1.5, 9.0]))
    for n, given in enumerate(DISTRIBUTIONS):
        drawn_factor = space.DrawnFactor("x", distribution_of(**given))
        found[f"drawn {n}"] = drawn_factor.values(np.linspace(0.001, 0.999, 41))
    numeric = [space.DrawnFactor(f"x{n}", distribution_of(**given))
               for n, given in enumerate(DISTRIBUTIONS[:3])]  # fmt: skip
    for version, rows, seed in ((1, 16, 3), (2, 16, 3), (2, 64, 8)):
        made = space.sample(numeric, rows, seed, version)
        found[f"sample {version} {rows} {seed}"] = made.table()
    stepped = space.DrawnFactor("x", distribution_of(**DISTRIBUTIONS[0]), step=0.3)
    found["steps"] = stepped.values(np.linspace(0.001, 0.999, 41))
    return found


DISTRIBUTIONS: Sequence[dict[str, Any]] = (
    {"distribution": "uniform", "range": (0.3, 2.4)},
    {"distribution": "log-uniform", "range": (0.1, 30.0)},
    {"distribution": "normal", "mean": 3.0, "std": 0.8, "range": (1.0, 6.0)},
    {"distribution": "log-normal", "median": 2.0, "factor": 1.7},
    {"distribution": "triangular", "range": (1.0, 4.0), "mode": 1.6},
    {"distribution": "choice", "levels": (1.0, 2.0, 5.0), "weights": (1.0, 2.0, 0.5)},
)


def told(made: design.Design) -> Any:
    return [made.table(), [made.run_order(r, 4) for r in (1, 2, 3)]]


def tracks() -> dict[str, Any]:
    """Points that stand for recorded tracks, with stops, and the motion through them."""
    found: dict[str, Any] = {}
    for seed, tolerance in product((1, 2), (0.05, 0.4, 2.0)):
        rng = np.random.default_rng(seed)
        times = np.cumsum(rng.uniform(0.3, 4.0, 120))
        points = np.cumsum(rng.normal(0.1, 0.5, (120, 3)), axis=0)
        points[30:45] = points[30]
        kept = resample.fitted(times, points, tolerance, most=400)
        found[f"{seed} {tolerance}"] = kept
        at = np.linspace(times[0] - 1, times[-1] + 1, 57)
        found[f"{seed} {tolerance} motion"] = resample.motion(kept.times, kept.points, at)
        found[f"{seed} {tolerance} headed"] = course.headed(times, points[:, :2], tolerance)
    return found


SHORT = {"time.duration_s": 8.0}


def question(**about: Any) -> Callable[[Path], Any]:
    asked = {
        "name": "asked", "settling_time_s": 0.0, "scenario": "paper-scenario-1",
        "fixed": {"time": {"duration_s": 8.0}}, "response": "absolute_total_rms_m",
        "limit": 0.6, "share": 0.6, "confidence": 0.9,
        "choices": {
            "gps": {"keys": ["platform.gps_horizontal_std_m"], "levels": [0.1, 0.4, 3.0],
                    "costs": [100.0, 40.0, 10.0]},
            "arm": {"keys": ["platform.arm_length_m"], "levels": [0.5, 3.0], "costs": [0.0, 5.0]},
        },
        "conditions": {
            "loss": {"keys": ["acoustics.loss_probability"], "levels": [0.0, 0.4],
                     "combine": "all"},
        },
    }  # fmt: skip
    return lambda folder: require.decide({**asked, **about}, folder / "asked", most_runs=300)


ANSWERS: Mapping[str, Callable[[Path], Any]] = {
    "compare several": lambda _: sblcosim.compare(
        ["paper-scenario-1", "harbour-square"], ["ekf", "sequential", "coupled"], runs=7,
        overrides=SHORT, timed=False, practical=0.2, settling_s=1.0),
    "compare few": lambda _: sblcosim.compare(
        "harbour-square", ["coupled", "ekf"], runs=2, overrides=SHORT, timed=False),
    "budget of all errors": lambda _: sblcosim.budget(
        sblcosim.load("harbour-square", SHORT), "coupled", runs=40),
    "map with a limit": lambda _: sblcosim.map_area(
        "harbour-square", "30x14", 4.0, limit_m=0.6, cells="6x3", runs=3, duration_s=8.0,
        settling_s=2.0),
    "distances with a limit": lambda _: sblcosim.map_distance(
        "harbour-square", 60, 4.0, limit_m=0.6, cells=5, runs=4, duration_s=8.0, settling_s=2.0),
    "require": question(),
    "many runs": lambda _: sblcosim.run_many(
        "realistic-sea", ["coupled", "multilateration"], {"time.duration_s": 15.0}, runs=12),
    "dive of buoys": lambda _: sblcosim.run("gps-buoys", overrides={"time.duration_s": 40.0}),
    "dive at sea": lambda _: sblcosim.run(
        "realistic-sea", ["coupled", "ekf"], {"time.duration_s": 40.0}),
    "smoothed at sea": lambda _: sblcosim.smooth(sblcosim.run(
        "realistic-sea", ["coupled", "ekf"], {"time.duration_s": 40.0, "seed": 8})),
    "range test": lambda _: calibrate(pings=45, distances=(5.0, 20.0, 60.0)),
}  # fmt: skip


@pytest.mark.parametrize("name", ANSWERS)
def test_more_answers_are_as_recorded(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    answer = quietly(lambda: ANSWERS[name](tmp_path))
    as_recorded.check(f"more {name}", as_recorded.told(answer, tmp_path))


def words() -> dict[str, Any]:
    """Numbers of all sizes as words."""
    sizes = [0.0, *(sign * 10.0**k * m for k in range(-7, 8) for m in (1.0, 2.46, 9.96)
                    for sign in (1, -1))]  # fmt: skip
    of_any = (numbers.rounded, numbers.signed, numbers.number, numbers.figure)
    of_lengths = (numbers.meters, numbers.meters_at_most, numbers.short_length)
    of_shares = (
        shares.percent, shares.rough_percent, shares.whole_percent, shares.column_percent,
        shares.percent_at_least, shares.percent_at_most,
    )  # fmt: skip
    found: dict[str, Any] = {f.__name__: [f(x) for x in sizes] for f in of_any}
    found |= {f.__name__: [f(abs(x)) for x in sizes] for f in of_lengths}
    few = [0.0, 1e-9, 1e-5, 4e-4, 0.0049, 0.005, 0.015, 0.25, 0.333, 0.5, 0.949, 0.95, 0.9949,
           0.995, 0.9996, 0.99999, 1.0]  # fmt: skip
    found |= {f.__name__: [f(x) for x in few] for f in of_shares}
    found["p"] = [[numbers.p_value(x), numbers.probability(x)] for x in few]
    found["short"] = [drawing.short("abcdefghijklmnopqrstuvwxyz"[:n], most)
                      for n in (7, 8, 9, 26) for most in (7, 8, 9)]  # fmt: skip
    found["inches"] = [drawing.inches("abc"), drawing.inches("abc", 14.0)]
    found["ordinal"] = [numbers.ordinal(x) for x in (1, 2, 3, 4, 11, 12, 13, 21, 22, 95, 111, 99.9)]
    return found


def estimates() -> dict[str, Any]:
    """Late ranges, losses, smooth paths and consistency, over wide inputs."""
    found: dict[str, Any] = {}
    residual, variance = np.linspace(-6.0, 12.0, 37), 0.02 * 1.5 ** np.arange(37.0)
    for chance, mean in product((0.0, 0.01, 0.3), (0.1, 2.0)):
        p = SimpleNamespace(outlier_probability=chance, outlier_mean=mean)
        found[f"late {chance} {mean}"] = [
            late_ranges.log_densities(p, residual, variance),
            late_ranges.share(p, residual, variance),
        ]  # fmt: skip
    for count, of in product((0, 1, 7, 40), (40, 900)):
        found[f"wilson {count} {of}"] = losses.wilson(count, of)
    rng = np.random.default_rng(3)
    for share in (0.0, 0.1, 0.6):
        kept = np.flatnonzero(rng.random(400) >= share)
        times = kept * 10**9 + rng.integers(-(10**7), 10**7, len(kept))
        for slot in (None, 4.0):
            found[f"losses {share} {slot}"] = losses.losses(times, kept % 4, slot)
    time = np.cumsum(rng.uniform(0.2, 2.0, 60))
    values = np.cumsum(rng.normal(size=60))
    for std, psd in product((0.01, 0.5), (0.0, 0.02, 3.0)):
        found[f"smooth {std} {psd}"] = way.smoothed(time, values, std, psd)
    found["noise"] = way.noise_of(time, values, np.arange(60) % 3)
    for mean, runs, lost in product((0.4, 0.97, 1.4, 9.0), (1, 3, 25, 200), (0.0, 0.02, 0.3)):
        nees = mean * rng.gamma(20.0, 3 / 20, runs)
        found[f"consistent {mean} {runs} {lost}"] = consistency.of_runs(nees, lost)
    for degrees, samples in product((2, 3, 6), (1, 8, 500)):
        found[f"band {degrees} {samples}"] = definitions.chi_square_band(degrees, samples)
    found["inconsistent"] = definitions.inconsistent(np.linspace(0.1, 4.0, 9), np.arange(1, 82, 9))
    found["order"] = definitions.order_statistics(
        np.sort(rng.normal(size=(4, 33)), axis=1), [1, 5, 50, 95, 99]
    )
    return found


SCENARIO = ("scenario", "fixed", "time", "place", "target", "platform", "acoustics", "receiver ",
            "receiver.")
"""What is the same in studies and questions."""
BOUNDS = ("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum", "minItems", "maxItems",
          "minLength", "maxLength", "pattern")  # fmt: skip


def files() -> dict[str, Any]:
    """Bounds of all values in files of scenarios, studies and questions."""
    return {
        f"{name} {place}": bound
        for name, schema in {"scenario": scenario_schema(), "study": study_schema(),
                             "question": question_schema()}.items()
        for place, bound in bounds(schema, "")
        if name == "scenario" or not any(f" {table}" in place for table in SCENARIO)
    }  # fmt: skip


def bounds(schema: Any, where: str) -> Iterable[tuple[str, Any]]:
    for key, part in schema.items() if isinstance(schema, dict) else enumerate(schema):
        if key in BOUNDS and not isinstance(part, dict):
            yield f"{where} {key}", part
        elif isinstance(part, dict | list):
            yield from bounds(part, f"{where} {key}".strip())


def looks() -> dict[str, Any]:
    """Lines, markers, colours and sizes of all figures."""
    return {name: repr(value) for name, value in vars(style).items() if name.isupper()}


ROOMS = (limits, scenarios, designs, tracks, words, estimates, files, looks)


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: str(room.__name__))
def test_a_room_says_what_was_recorded(room: Callable[[], dict[str, Any]]) -> None:
    found = {key: as_recorded.fields_of(value) for key, value in room().items()}
    as_recorded.check(f"room {room.__name__}", found)
