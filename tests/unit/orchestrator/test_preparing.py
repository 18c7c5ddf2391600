"""What the points of a study share changes nothing: neither plans, nor messages, nor warnings."""

from __future__ import annotations

import gc
import hashlib
import json
import math
import random
import warnings
from collections.abc import Sequence
from dataclasses import replace
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from quick import few
from sblcosim.errors import ConfigurationWarning, SblcosimError
from sblcosim.fmus import unchanged
from sblcosim.fmus.read.ports import Port
from sblcosim.models import COMPONENTS
from sblcosim.scenario import wiring
from sblcosim.scenario.scenario import load as load_scenario
from sblcosim.simulation.how import HOW, How
from sblcosim.simulation.plans.settings import settings_of
from sblcosim.simulation.system import ComponentSpec
from sblcosim.study import batch, campaign, load, runner
from sblcosim.study.batch import Run
from seams import Seam

LEVELS: dict[str, list[Any]] = {
    "target.speed_m_s": [0.3, 0.5, -0.0, 0.0, -1.0],
    "target.depth_std_m": [0.0, 0.1, 1.0],
    "target.trajectory": ["semicircle", "spiral", "random"],
    "platform.arm_length_m": [0.4, 3.0, -1.0],
    "platform.gps_horizontal_std_m": [0.1, 3.5],
    "platform.imu_heading_std_deg": [0.0, 2.0, 10.0],
    "platform.beacons": [4, 6],
    "acoustics.range_std_m": [0.0, 0.1, 1.0],
    "acoustics.loss_probability": [0.0, 0.25, 1.5],
    "acoustics.sound_speed_m_s": [1500.0, 1300.0, 1700.0],
    "acoustics.clock_drift_s_s": [0.0, 1e-6],
    "receiver.acceleration_psd_m2_s3": [0.01, 0.1],
    "time.sampling_time_s": [0.1, 0.25, 0.5, 7.0],
    "time.ekf_ratio": [1, 2],
    "time.duration_s": [5.0, 5.2, "path"],
}
"""Levels, some of which fail or make others fail, and some of which warn."""


def made(seed: int) -> Any:
    """A study of random factors; None if it is refused as a whole."""
    rng = random.Random(seed)
    keys = rng.sample(sorted(LEVELS), 2)
    tables = {
        "scenario": rng.choice(["paper-scenario-1", "harbour-square", "gps-buoys"]),
        "fixed": {"time.duration_s": 5.0} if "time.duration_s" not in keys else {},
        "design": {"kind": "grid"},
        "receivers": rng.choice([["ekf"], ["ekf", "coupled"], ["long_baseline"]]),
        "factors": {
            key.rpartition(".")[2]: {"keys": [key], "levels": rng.sample(LEVELS[key], 2)}
            for key in keys
        },
    }
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return load(tables)
    except SblcosimError:
        return None


def outcome(study: Any, number: int) -> list[Any]:
    """System, plan and warnings of a point, or the message."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ConfigurationWarning)
        try:
            _, system, plan = campaign.resolved(study, number)
        except SblcosimError as error:
            return [type(error), str(error)]
    settings = [(c.name, s.port.name, repr(s.values)) for c in plan.components for s in c.settings]
    return [
        repr(system), settings, plan.columns, plan.sizes, plan.start_ns, plan.stop_ns,
        [(c.name, c.tick_ns, c.interval_ns, c.reads, c.writes) for c in plan.components],
        [(w.category, str(w.message)) for w in caught],
    ]  # fmt: skip


@pytest.mark.parametrize("seeds", few([(0, 3, 22), (*range(10), 22)], quick=[(0, 3, 22)]))
def test_points_are_the_same_whether_they_share_or_not(seeds: Sequence[int]) -> None:
    failed = warned = fine = 0
    for study in filter(None, map(made, seeds)):  # of 22 some points fail
        numbers = range(1, len(study.points.values) + 1)
        alone = [outcome(study, number) for number in numbers]
        with unchanged.assumed():
            assert [outcome(study, number) for number in numbers] == alone
        failed += sum(len(one) == 2 for one in alone)
        fine += sum(len(one) > 2 for one in alone)
        warned += sum(len(one) > 2 and bool(one[-1]) for one in alone)
    assert min(failed, warned, fine) > 0


def test_a_zero_keeps_its_sign() -> None:
    tables = {
        "scenario": "paper-scenario-1", "fixed": {"time.duration_s": 5.0},
        "design": {"kind": "grid"},
        "factors": {"bias": {"keys": ["target.depth_bias_m"], "levels": [-0.0, 0.5]},
                    "gps": {"keys": ["platform.gps_horizontal_std_m"], "levels": [0.0, 1.0]}},
    }  # fmt: skip
    study = load(tables)
    with unchanged.assumed():
        shared = [outcome(study, number) for number in range(1, 5)]
    assert shared == [outcome(study, number) for number in range(1, 5)]
    assert any("(-0.0,)" in values for _, _, values in shared[0][1])


class Number(IntEnum):
    ONE = 1


ALIKE = [
    0.0, -0.0, 0, False, 1.0, 1, True, Number.ONE, np.float64(1.0), np.bool_(True), np.int64(1),
    np.int64(np.float64(1.0).view(np.int64)), "1", None, (1.0,), [1.0], (1,), (True,), (-0.0,),
    (0.0,), np.array([1.0]), b"1",
]  # fmt: skip
"""Values that are equal, or have equal bytes, or are refused."""


@pytest.mark.parametrize("kind", ["Float64", "Int32", "Boolean"])
@pytest.mark.parametrize("shape", [(), (1,)])
def test_values_that_differ_in_a_bit_or_in_type_share_no_setting(
    kind: str, shape: tuple[int, ...]
) -> None:
    ports = {"a": Port("a", "parameter", kind, shape, min=(-9.0,), max=(9.0,), references=(1,))}

    def found(value: Any) -> str:
        try:
            return repr(settings_of("c", ComponentSpec(Path("x"), 1, {"a": value}), ports))
        except SblcosimError as error:
            return str(error)

    alone = [found(value) for value in ALIKE]
    assert sum("must be" in one for one in alone) > 5
    for order in (1, -1):
        with unchanged.assumed():
            assert [found(value) for value in ALIKE[::order]] == alone[::order]


TRAJECTORIES = [*COMPONENTS["target"]["trajectory"].choices.values()]


@pytest.mark.parametrize("trajectory", TRAJECTORIES)
def test_a_shared_start_is_the_one_that_each_has_alone(trajectory: str) -> None:
    """Whatever key of the target points differ in: a start is shared only if it does not count."""
    own: dict[str, Any] = {
        "file": {"track_time_s": [1.0, 40.0], "track_m": [[0.0, 0.0, 2.0], [9.0, 0.0, 3.0]]},
        "waypoints": {"waypoint_m": [[0.0, 0.0, 2.0], [9.0, 1.0, 3.0]]},
        "white_noise_acceleration": {"initial_position_std_m": 2.0},
    }.get(trajectory, {})
    usual = {"target": {"trajectory": trajectory, "seed": 3, **own}}
    changes = {"time.sampling_time_s": 0.25, "target.seed": 4} | {
        f"target.{v.key}": min(v.starts[0] + 0.25, math.inf if v.max is None else v.max)
        for v in COMPONENTS["target"].of("parameter") if v.type == "Float64" and not v.shape
    }

    def told(duration_s: Any, changes: dict[str, float]) -> str:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                given = load_scenario({"time": {"duration_s": duration_s}, **usual}, changes)
                return repr(wiring.connect(given, ["coupled"]))
            except SblcosimError as error:
                return str(error)

    for duration_s in (5.0, "path"):
        points = [{}, *({key: value} for key, value in changes.items())]
        alone = [told(duration_s, point) for point in points]
        assert len(set(alone)) > 5 or duration_s == "path"
        with unchanged.assumed():
            shared = [told(duration_s, point) for point in points]
        assert dict(zip(changes, shared[1:], strict=True)) == dict(
            zip(changes, alone[1:], strict=True))


def test_the_target_starts_once_for_points_that_differ_in_their_sensors(
    seam: Seam,
) -> None:
    started: list[Any] = []
    original = wiring.initial_outputs
    seam.instead(wiring.initial_outputs, lambda *a: started.append(a) or original(*a))

    def starts(key: str) -> int:
        started.clear()
        campaign.prepare(load({
            "scenario": "paper-scenario-1", "design": {"kind": "full"}, "receivers": ["ekf"],
            "factors": {"depth": {"keys": ["target.depth_std_m"], "levels": [0.01, 0.1]},
                        "tick": {"keys": ["time.sampling_time_s"], "levels": [0.25, 0.5]},
                        "other": {"keys": [key], "levels": [1.0, 2.0]}},
        }))  # fmt: skip
        return len(started)

    assert starts("platform.arm_length_m") == 1
    assert starts("target.depth_start_m") == starts("target.speed_m_s") == 2


def test_unused_cycles_are_searched_for_again_after_points_are_made(
    seam: Seam,
) -> None:
    study = load({"scenario": "paper-scenario-1", "design": {"kind": "single"}})
    during: list[bool] = []

    def failing(*_: Any, **__: Any) -> Any:
        during.append(gc.isenabled())
        raise RuntimeError

    campaign.prepare(study)
    assert gc.isenabled()
    seam.instead(campaign.resolved, failing)
    with pytest.raises(RuntimeError):
        campaign.prepare(study)
    assert during == [False]
    assert gc.isenabled()
    gc.disable()
    try:
        with pytest.raises(RuntimeError):
            campaign.prepare(study)
        assert not gc.isenabled()
    finally:
        gc.enable()


@pytest.mark.parametrize("extra", [{}, {"responses": ["percentiles"]}])
def test_a_digest_is_that_of_the_whole_content(extra: dict[str, Any]) -> None:
    """Ids of runs in folders of before were made of one JSON text."""
    study = load({
        "scenario": "paper-scenario-1", "fixed": {"time.duration_s": 5.0},
        "receivers": ["ekf", "coupled"], "design": {"kind": "single"}, **extra,
    })  # fmt: skip
    prepared = campaign.prepare(study)
    _, system, plan = campaign.resolved(study, 1)
    free = {f"{name}.seed" for name in prepared.seeded} | {c.target for c in prepared.handovers}
    content = {
        "components": {
            c.name: {
                "fmu": c.sha256,
                "interval_ns": c.interval_ns,
                "parameters": {
                    k: v for k, v in system.components[c.name].parameters.items()
                    if f"{c.name}.{k}" not in free
                },
            }
            for c in plan.components
        },
        "free": sorted(free),
        "connections": sorted(f"{c.source} {c.target}" for c in system.connections),
        "span_ns": [plan.start_ns, plan.stop_ns, 0],
    } | ({"responses": sorted(f"{r.name} {r.sha256}" for r in study.asked)} if extra else {})
    text = json.dumps(content, sort_keys=True)
    assert prepared.points[0].digest == hashlib.sha256(text.encode()).hexdigest()
    assert prepared.fmus == {c.name: c.sha256 for c in plan.components}


def test_runs_know_our_fmus_by_what_counts_in_them() -> None:
    study = load({
        "scenario": "paper-scenario-1", "fixed": {"time.duration_s": 5.0}, "receivers": ["ekf"],
        "design": {"kind": "single"},
    })  # fmt: skip
    _, system, plan = campaign.resolved(study, 1)
    first = plan.components[0]
    assert first.sha256 == first.source.known_as != first.source.sha256 == first.file_sha256

    def digest(**changes: str) -> str:
        changed = replace(first, source=replace(first.source, **changes))
        other = replace(plan, components=(changed, *plan.components[1:]))
        return campaign.point_digest(study, 1, system, other, ())

    assert digest() == digest(sha256="0" * 64) != digest(known_as="0" * 64)


def test_what_is_missing_is_sampled_without_looking_at_what_is_there(
    seam: Seam,
) -> None:
    study = load({
        "scenario": "paper-scenario-1", "fixed": {"time.duration_s": 5.0}, "replicates": 40,
        "receivers": ["ekf"], "design": {"kind": "grid"},
        "factors": {"gps": {"keys": ["platform.gps_horizontal_std_m"], "levels": [0.1, 1.0]},
                    "tick": {"keys": ["time.sampling_time_s"], "levels": [0.25, 0.5]}},
    })  # fmt: skip
    prepared = campaign.prepare(study)
    group_of = {p: n for n, group in enumerate(prepared.groups) for p in group.places}
    rng = np.random.default_rng(1)
    original, asked, simulated = campaign.run_of, [], []
    seam.instead(runner.run_of, lambda *a: asked.append(a) or original(*a))
    seam.instead(runner.simulate, lambda _, runs, *__: simulated.append([*runs]))
    first = -(-runner.SIDE_BY_SIDE // len(prepared.groups))
    for rows, share in ((40, 0.9), (40, 0.99), (40, 1.0), (35, 0.95), (0, 0)):
        done = rng.random((rows, 4)) < share
        there = runner.Missing(done, 1, 1, (1,) * 4)
        missing = [run for run in campaign.batch(prepared, 1, 40) if not there.has(run)]

        def of_each_group(size: int, missing: Sequence[Run] = missing) -> list[Run]:
            of_groups: dict[int, list[Run]] = {}
            for run in missing:
                of_groups.setdefault(group_of[run.place], []).append(run)
            few = [run for group in of_groups.values() for run in group[:size]]
            return [run for run in missing if run in few]

        asked.clear()
        simulated.clear()
        runner.estimate(prepared, replace(there, runs=len(missing)), How(workers=1))
        sizes = [1, first]
        while missing and len(of_each_group(sizes[-1])) < len(missing):
            sizes.append(4 * sizes[-1])
        wanted = [of_each_group(size) for size in sizes] if missing else []
        assert simulated == [*wanted, *wanted[-1:] * (runner.SAMPLES - 1)]
        assert len(asked) == sum(map(len, wanted))


def test_passes_of_the_collector_skip_what_a_study_keeps(seam: Seam) -> None:
    frozen: list[int] = []

    def counting(*_: Any, **__: Any) -> Any:
        frozen.append(gc.get_freeze_count())
        raise RuntimeError

    study = load("paper-scenario-1").with_replicates(1)
    made = campaign.prepare(study)
    seam.instead(batch.reduced, counting)
    with pytest.raises(RuntimeError):
        batch.simulate(made, campaign.batch(made, 1, 1), HOW)
    assert frozen[0] > len(made.points)
    assert gc.get_freeze_count() == 0
    gc.freeze()  # by somebody else, who wants it kept
    try:
        with pytest.raises(RuntimeError):
            batch.simulate(made, campaign.batch(made, 1, 1), HOW)
        assert gc.get_freeze_count() > 1000
    finally:
        gc.unfreeze()
