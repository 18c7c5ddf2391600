"""What the points of a study share changes nothing: neither plans, nor messages, nor warnings."""

from __future__ import annotations

import hashlib
import json
import random
import warnings
from typing import Any

import numpy as np
import pytest
from sblcosim.errors import ConfigurationWarning, SblcosimError
from sblcosim.fmus import unchanged
from sblcosim.study import campaign, load, runner
from sblcosim.study.batch import Run

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


def test_points_are_the_same_whether_they_share_or_not() -> None:
    failed = warned = fine = 0
    for study in filter(None, map(made, range(10))):
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


def test_what_is_missing_is_sampled_without_looking_at_what_is_there(
    monkeypatch: pytest.MonkeyPatch,
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
    original, asked = campaign.run_of, []
    monkeypatch.setattr(runner, "run_of", lambda *a: asked.append(a) or original(*a))
    for rows, share, size in ((40, 0.9, 5), (40, 0.99, 3), (40, 1.0, 2), (35, 0.95, 9), (0, 0, 4)):
        done = rng.random((rows, 4)) < share
        what = runner.Missing(done, 1, 1, (1,) * 4)
        wanted: list[Run] = []
        counts = dict.fromkeys(group_of.values(), 0)
        for run in campaign.batch(prepared, 1, 40):
            number = group_of[run.place]
            if not what.has(run) and counts[number] < size:
                counts[number] += 1
                wanted.append(run)
        asked.clear()
        assert runner._sample(prepared, what, size) == wanted
        assert len(asked) == len(wanted)
