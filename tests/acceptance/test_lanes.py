"""Many runs side by side give what each gives alone."""

from __future__ import annotations

import ctypes
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sblcosim
from sanitized import is_clean
from sblcosim.errors import ConfigurationError, FmuError
from sblcosim.fmus.build import c_files, compiler, factory
from sblcosim.results.sums import responses
from sblcosim.scenario.scenario import shipped
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters import c_libraries, lanes, lanes_driver
from sblcosim.simulation.masters.lanes import LanesMemory
from sblcosim.simulation.masters.python import execute
from sblcosim.simulation.plans.plan import Plan
from sblcosim.simulation.resolve import resolve
from sblcosim.simulation.system import ComponentSpec, Connection, System

RECEIVERS = ("ekf", "sequential", "multilateration")
NOISY = ("target", "platform", "acoustics")
NUMBERS = (1, 2, 4, 8)
FENCE = 1 << 16
"""Bytes on each side of a block of memory."""


def plan_of(name: str, fmi: int = 2, seed: int = 1, **overrides: Any) -> Plan:
    """A scenario, shortened, with all receivers."""
    scenario = sblcosim.load(name, {"seed": seed, **overrides})
    steps = 40 * scenario.time.ekf_ratio
    scenario = scenario.override({"time.duration_s": steps * scenario.time.sampling_time_s})
    return resolve(connect(scenario, RECEIVERS, fmi=fmi))


def seeds(values: Any) -> dict[str, Any]:
    return {f"{name}.seed": values for name in NOISY}


def everything(plan: Plan) -> list[str]:
    return [c.name for c in plan.columns]


def possible(number: int, plan: Plan) -> bool:
    try:
        lanes.execute(plan, {}, lanes=number)
    except FmuError:
        return False
    return True


def same(outcome: lanes.RunsOutcome, run: int, plan: Plan) -> None:
    alone = execute(plan)
    np.testing.assert_array_equal(outcome.time_ns, alone.time_ns)
    for name, values in alone.values.items():
        np.testing.assert_array_equal(outcome.values[name][run], values, err_msg=name)


@pytest.mark.parametrize("name", shipped())
def test_every_scenario_is_the_same_to_the_bit(name: str) -> None:
    plan = plan_of(name)
    outcome = lanes.execute(
        plan, seeds(np.arange(1, 12)), record=everything(plan), handovers=starts(name)
    )
    for run in (0, 4, 10):  # the second group is not full
        same(outcome, run, plan_of(name, seed=run + 1))


def starts(name: str) -> list[Connection]:
    """The true start for the prior, where the scenario hands it over."""
    if sblcosim.load(name).receiver.prior is None:
        return []
    return [Connection("target.position", f"{r}.prior_position") for r in ("ekf", "sequential")]


@pytest.mark.parametrize("number", NUMBERS)
@pytest.mark.parametrize("fmi", [2, 3])
def test_every_number_of_lanes_and_version_of_fmi(number: int, fmi: int) -> None:
    plan = plan_of("realistic-dive", fmi)
    if not possible(number, plan):
        pytest.skip(f"this processor does not do {number} lanes")
    outcome = lanes.execute(
        plan, seeds(np.arange(1, 10)), record=everything(plan), lanes=number, threads=2
    )
    for run in (0, 8):
        same(outcome, run, plan_of("realistic-dive", 2, seed=run + 1))
    reference = lanes.execute(plan, seeds(np.arange(1, 10)), threads=1)
    for receiver, sums in reference.sums.items():
        np.testing.assert_array_equal(outcome.sums[receiver], sums)


def mixed(scenario: str, **overrides: Any) -> System:
    """Target and platform at T/5, acoustics at T, the receivers at the update interval."""
    system = connect(sblcosim.load(scenario, overrides), RECEIVERS)

    def changed(name: str, spec: ComponentSpec) -> ComponentSpec:
        fine = name in ("target", "platform")
        return replace(spec, interval_ns=spec.interval_ns // 5) if fine else spec

    return replace(system, components={k: changed(k, s) for k, s in system.components.items()})


def test_mixed_intervals() -> None:
    changes = {"time.ekf_ratio": 4, "time.duration_s": 16.0}
    plan = resolve(mixed("harbour-square", **changes))
    assert len({c.interval_ns for c in plan.components}) == 3
    outcome = lanes.execute(plan, seeds([3, 4, 5]), record=everything(plan))
    for run in range(3):
        same(outcome, run, resolve(mixed("harbour-square", seed=run + 3, **changes)))


def test_parameters_differ_from_run_to_run() -> None:
    arms, loss = [0.4, 3.0, 1.0], [0.0, 0.5, 0.25]
    plan = plan_of("harbour-spiral")
    outcome = lanes.execute(
        plan,
        {"platform.arm_length": arms, "acoustics.loss_probability": loss},
        record=everything(plan),
    )
    for run in range(3):
        alone = plan_of(
            "harbour-spiral",
            **{"platform.arm_length_m": arms[run], "acoustics.loss_probability": loss[run]},
        )
        same(outcome, run, alone)


@pytest.mark.filterwarnings("ignore::sblcosim.errors.NoEffectWarning")
def test_seas_with_a_spectrum_differ_from_run_to_run() -> None:
    sea = {"platform.motion": "spectrum", "platform.watch_circle_m": 3.0}
    heights, counts = [0.2, 0.6, 2.0], [16, 5, 1]
    plan = plan_of("realistic-dive", **sea)
    varied = {"platform.wave_height": heights, "platform.wave_components": counts}
    outcome = lanes.execute(plan, varied, record=everything(plan))
    for run in range(3):
        own = {"platform.wave_height_m": heights[run], "platform.wave_components": counts[run]}
        same(outcome, run, plan_of("realistic-dive", **sea, **own))


def test_sums_are_those_of_the_record() -> None:
    scenario = sblcosim.load("realistic-dive", {"time.duration_s": 120.0})
    plan = resolve(connect(scenario, RECEIVERS))
    outcome = lanes.execute(plan, seeds([1, 2]))
    for run in range(2):
        result = sblcosim.run(scenario, RECEIVERS, {"seed": run + 1})
        for receiver in RECEIVERS:
            row = responses(outcome.sums[receiver], plan.stop_ns).iloc[run]
            for frame in ("absolute", "relative"):
                for axis in ("x", "y", "z", "total"):
                    expected = result.errors.loc[(receiver, frame, axis)]
                    for what in ("mean", "rms"):
                        assert row[f"{frame}_{axis}_{what}_m"] == pytest.approx(
                            expected[f"{what}_m"], rel=1e-9, abs=1e-12
                        )
            summary = result.summary.loc[receiver]
            assert row["estimates"] == summary["estimates"]
            for name in ("nees_position", "nis", "availability"):
                assert row[name] == pytest.approx(summary[name], rel=1e-6, nan_ok=True)
            assert row["lost"] == summary["lost"]
            assert not row["broken"]


def test_errors_count_from_the_settling_time() -> None:
    plan = plan_of("paper-scenario-1")
    late = lanes.execute(plan, {}, settling_ns=2_000_000_000, handovers=starts("paper-scenario-1"))
    result = execute(plan).estimates("ekf")
    assert late.sums["ekf"][0][0] == (result.epoch_ns >= 2_000_000_000).sum() > 0


def test_a_run_that_turns_nan_ends_alone() -> None:
    plan = plan_of("harbour-square")
    clean = lanes.execute(plan, seeds(np.arange(1, 9)), record=["ekf.position"])
    std = np.full(8, 0.1)
    reference = lanes.execute(
        plan, {**seeds(np.arange(1, 9)), "acoustics.range_std": std}, record=["ekf.position"]
    )
    std[3] = 1e300  # squares overflow
    bad = lanes.execute(
        plan, {**seeds(np.arange(1, 9)), "acoustics.range_std": std}, record=["ekf.position"]
    )
    others = np.arange(8) != 3
    np.testing.assert_array_equal(
        bad.values["ekf.position"][others], reference.values["ekf.position"][others]
    )
    np.testing.assert_array_equal(bad.sums["ekf"][others], reference.sums["ekf"][others])
    broken = responses(bad.sums["ekf"], plan.stop_ns)["broken"]
    assert broken.tolist() == (~others).tolist()
    assert not responses(clean.sums["ekf"], plan.stop_ns)["broken"].any()


@pytest.mark.parametrize(
    ("variations", "words"),
    [
        ({"platfrom.arm_length": [1.0]}, ["'platfrom'", "did you mean 'platform'"]),
        ({"platform.arm": [1.0]}, ["'arm'", "parameter of platform"]),
        ({"platform.arm_length": [1.0, -2.0]}, ["platform.arm_length", "must be between"]),
        ({"acoustics.loss_probability": [0.5, 1.0001]},
         ["acoustics.loss_probability", "must be between 0 and 1", "got 0.5 to 1.0001"]),
        ({"acoustics.loss_probability": [-1e-9, 0.5]}, ["must be between 0 and 1"]),
        ({"ekf.range_std": [1e-10]}, ["ekf.range_std: must be between 1e-09 and inf"]),
        ({"platform.arm_length": [1.0, np.nan]}, ["platform.arm_length", "finite"]),
        ({"platform.mean_position": [[1.0, 2.0]]}, ["3 values per run", "got 2"]),
        ({"platform.arm_length": [1.0, 2.0], "target.speed": [1.0, 1.0, 1.0]}, ["2 runs", "3"]),
    ],
)
def test_what_does_not_fit_is_named(variations: dict[str, Any], words: list[str]) -> None:
    with pytest.raises(ConfigurationError) as caught:
        lanes.execute(plan_of("harbour-square"), variations)
    for word in words:
        assert word in str(caught.value)


def test_bounds_themselves_are_allowed() -> None:
    outcome = lanes.execute(plan_of("harbour-square"), {"acoustics.loss_probability": [0.0, 1.0]})
    assert len(outcome.sums["ekf"]) == 2


def test_what_must_be_equal_in_all_runs_is_named() -> None:
    plan = plan_of("harbour-square")
    with pytest.raises(FmuError, match=r"target\.trajectory: must be the same in all runs"):
        lanes.execute(plan, {"target.trajectory": [2, 3]})
    with pytest.raises(FmuError, match=r"acoustics\.sampling_time: must be the same"):
        lanes.execute(plan, {"acoustics.sampling_time": [0.1, 0.2]})


def test_a_foreign_component_is_named(tmp_path: Path) -> None:
    class Fixed:
        """A receiver in Python."""

        variables = (
            *(v for v in sblcosim.models.COMPONENTS["ekf"].of("output")
              if v.name in ("epoch", "position", "update_count")),
        )

        def initialise(self, start_ns: int, parameters: Any) -> dict[str, Any]:
            return {"epoch": 0.0, "position": np.zeros(3), "update_count": 0}

        def do_step(self, time_ns: int, step_ns: int, inputs: Any) -> dict[str, Any]:
            return {"epoch": 0.0, "position": np.zeros(3), "update_count": 0}

    plan = resolve(
        connect(sblcosim.load("harbour-square", {"time.duration_s": 1.0}), {"mine": Fixed})
    )
    assert lanes_driver.unsupported(plan) == "mine"
    with pytest.raises(ConfigurationError, match="mine: must be one of our own components"):
        lanes.execute(plan, {})


def test_a_single_run_may_use_it_too() -> None:
    changes = {"time.duration_s": 5.0}
    side = sblcosim.run("harbour-random", overrides=changes, master="lanes").table
    alone = sblcosim.run("harbour-random", overrides=changes, master="python").table
    assert side.equals(alone)


def test_the_structures_are_those_of_the_driver(tmp_path: Path) -> None:
    """Sizes and places of all members, as the compiler sees them."""
    source = (c_libraries.FOLDER / "lanes_master.c").read_text()
    structures = {
        "lanes": lanes_driver.Engine, "plan": lanes_driver.LanesPlan, "link": lanes_driver.Link,
        "receiver": lanes_driver.Receiver, "truth": lanes_driver.Truth, "span": lanes_driver.Span,
    }
    expected, places = [], []
    for name, structure in structures.items():
        expected.append(ctypes.sizeof(structure))
        places.append(f"sizeof(struct {name})")
        for field, *_ in structure._fields_:
            expected.append(getattr(structure, field).offset)
            places.append(f"offsetof(struct {name}, {field.rstrip('_')})")
    source += f"API size_t places[] = {{{', '.join(places)}}};\n"
    sources = {
        "places.c": source.encode(), "lanes_master.h": lanes_driver.DRIVER.header.encode(),
        **c_files.engine_headers(),
        **{name: (c_libraries.FOLDER / name).read_bytes() for name in lanes_driver.DRIVER.includes},
    }
    library = tmp_path / "places.so"
    library.write_bytes(
        factory.compile_shared(sources, [factory.Unit("places.c")], compiler.find())
    )
    found = (ctypes.c_size_t * len(places)).in_dll(ctypes.CDLL(str(library)), "places")
    assert list(found) == expected


@pytest.mark.parametrize("number", NUMBERS)
def test_no_run_writes_beside_its_memory(number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """What stands around each block is there afterwards; with sanitizers below, but slowly."""
    plan = plan_of("realistic-dive")
    if not possible(number, plan):
        pytest.skip("not on this processor")
    blocks: list[tuple[np.ndarray, int, int]] = []

    def fenced(memory: LanesMemory, size: int) -> int:
        whole = np.full(size + 2 * FENCE + 64, 0xA5, np.uint8)
        first = FENCE + -(whole.ctypes.data + FENCE) % 64
        whole[first : first + size] = 0
        blocks.append((whole, first, size))
        return int(whole.ctypes.data) + first

    monkeypatch.setattr(LanesMemory, "_aligned", fenced)
    runs = seeds(np.arange(1, number + 1))
    asked = {"record": everything(plan), "percentages": (5, 50, 100), "threads": 1}
    outcome = lanes.execute(plan, runs, lanes=number, **asked)
    assert np.isfinite(outcome.order["ekf"]).all()
    assert len(blocks) > len(plan.components)
    for whole, first, size in blocks:
        assert (whole[:first] == 0xA5).all()
        assert (whole[first + size :] == 0xA5).all()


SANITIZED = """
from dataclasses import replace
import numpy as np
import sblcosim
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters import lanes
from sblcosim.simulation.masters.lanes_driver import SUMS
from sblcosim.simulation.resolve import resolve
from sblcosim.simulation.system import Connection
scenario = sblcosim.load("harbour-random", {"time.duration_s": 6.0})
plan = resolve(connect(scenario, ("ekf", "sequential")))
seeds = {f"{name}.seed": np.arange(1, 12) for name in ("target", "platform", "acoustics")}
for number in (1, 2, 0):
    outcome = lanes.execute(
        plan, seeds, record=["ekf.position", "raw.nis_degrees"], lanes=number, threads=2,
        percentages=(50, 100),
        handovers=[Connection("target.position", "ekf.prior_position")],
    )
    assert np.isfinite(outcome.values["ekf.position"]).all()
# Depth at 0.2, 0.4 … s, the target at 0.3, 0.6 … s: epochs between its instants.
scenario = scenario.override({"time.sampling_time_s": 0.3, "time.duration_s": 15.0})
system = connect(scenario, ("ekf", "sequential"))
target = system.components["target"]
target = replace(target, parameters={**target.parameters, "sampling_time": 0.2})
plan = resolve(replace(system, components={**system.components, "target": target}))
for number in (1, 2, 0):
    sums = lanes.execute(plan, seeds, lanes=number, threads=2).sums["ekf"]
    assert (sums[:, SUMS.index("estimates")] > 5).all()
    assert not sums[:, SUMS.index("unjudged")].any()
"""


@pytest.mark.slow
def test_engine_and_driver_touch_no_memory_that_is_not_theirs(tmp_path: Path) -> None:
    """Under AddressSanitizer and UndefinedBehaviourSanitizer; builds everything for it."""
    is_clean(SANITIZED, tmp_path)
