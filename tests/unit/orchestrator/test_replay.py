"""Recorded inputs given to one component: the same bits as in a run."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest
import sblcosim
from sblcosim.data.record import Record
from sblcosim.errors import ConfigurationError, FmuError
from sblcosim.fmus import stopping
from sblcosim.fmus.build import factory
from sblcosim.fmus.read.ports import read
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.execution import execute
from sblcosim.simulation.masters import python
from sblcosim.simulation.masters.replay import replay
from sblcosim.simulation.plans.plan import Plan, PlannedComponent
from sblcosim.simulation.resolve import resolve
from seams import Seam
from stranger import build_stranger

CASES = (
    ("realistic-dive", "coupled"), ("realistic-dive", "fixed_lag"), ("realistic-dive", "ekf"),
    ("realistic-dive", "sequential"), ("realistic-dive", "multilateration"),
    ("harbour-lbl", "long_baseline"), ("gps-buoys", "long_baseline"),
    ("paper-scenario-1", "coupled"),
)
RECORDED = ("position", "update_count", "valid", "covariance")


def dive(name: str, receiver: str, **changes: Any) -> tuple[Plan, PlannedComponent]:
    """A minute of a scenario, and its receiver."""
    scenario = sblcosim.load(name, {"time.duration_s": 60.0, **changes})
    plan = resolve(connect(scenario, receiver))
    return plan, next(c for c in plan.components if c.name == receiver)


def inputs_of(one: PlannedComponent, record: Record) -> dict[str, Any]:
    """The receiver's inputs at all instants."""
    return {
        port.name: record.values[connection.source]
        for write in one.writes
        for port, connection in zip(write.ports, write.connections, strict=True)
    }


def replayed(
    one: PlannedComponent, recorded: Record, rows: Any, parameters: Any = None, **options: Any
) -> dict[str, Any]:
    """The receiver's outputs if it is given its inputs at some instants."""
    given = {s.port.name: np.array([s.values]) for s in one.settings}
    return replay(
        one.source.path, recorded.time_ns[rows],
        {name: values[rows] for name, values in inputs_of(one, recorded).items()},
        {**given, **(parameters or {})}, one.interval_ns, start_ns=int(recorded.time_ns[0]),
        **{"record": RECORDED, **options},
    )


def news(one: PlannedComponent, record: Record) -> Any:
    """Instants with a new sample, all but the first and the last one."""
    inputs = inputs_of(one, record)
    new = [np.any(np.diff(inputs["reception_count"], axis=0) != 0, axis=1),
           np.diff(inputs["depth_epoch"]) != 0]
    rows = np.flatnonzero(np.any(new, axis=0)) + 1
    return rows[rows < len(record.time_ns) - 1]


@pytest.mark.parametrize(("name", "receiver"), CASES)
def test_only_ticks_with_news_are_needed_and_the_bits_are_those_of_the_run(
    name: str, receiver: str
) -> None:
    plan, one = dive(name, receiver)
    record = python.execute(plan)
    rows = news(one, record)
    assert 0 < len(rows) < len(record.time_ns)
    found = replayed(one, record, rows)
    for output in RECORDED:
        expected = record.values[f"{receiver}.{output}"][rows + 1]
        assert found[output].dtype == expected.dtype
        assert found[output].shape == (1, *expected.shape)
        assert found[output][0].tobytes() == expected.tobytes()
    assert record.valid(receiver)[-1]


@pytest.mark.parametrize("few", [2, 4, 7, 19])
def test_a_long_replay_is_one_of_few_instants_after_another(few: int, seam: Seam) -> None:
    """Between them, an interrupt is looked for."""
    plan, one = dive("realistic-dive", "coupled")
    record = execute(plan)
    rows = news(one, record)
    assert len(rows) > 2 * few
    whole = replayed(one, record, rows)
    seam.instead(stopping.check, looked := MagicMock())
    seam.tuned(replayed_together=few)
    found = replayed(one, record, rows)
    assert looked.call_count == -(-len(rows) // few)
    for output in RECORDED:
        assert found[output].tobytes() == whole[output].tobytes()


@pytest.mark.parametrize("lanes", [1, 2, 4, 0])
def test_each_set_of_parameters_gives_what_it_gives_alone(lanes: int) -> None:
    plan, one = dive("harbour-lbl", "long_baseline")
    record = execute(plan)
    rows = news(one, record)
    stds = np.array([0.05, 0.1, 0.2, 0.3, 0.4])
    together = replayed(one, record, rows, {"range_std": stds}, lanes=lanes)["position"]
    alone = [replayed(one, record, rows, {"range_std": [std]})["position"][0] for std in stds]
    assert together.tobytes() == np.array(alone).tobytes()
    assert len({row.tobytes() for row in together}) == len(stds)


def test_outputs_are_returned_after_the_wanted_ticks() -> None:
    plan, one = dive("harbour-lbl", "long_baseline")
    record = execute(plan)
    rows = news(one, record)
    whole = replayed(one, record, rows, record=["position", "epoch"])
    some = replayed(one, record, rows, record=["position", "epoch"], wanted=[3, len(rows) - 1])
    for name in whole:
        assert np.array_equal(some[name], whole[name][:, [3, -1]])


def test_wanted_ticks_are_numbers_of_the_given_ones() -> None:
    plan, one = dive("harbour-lbl", "long_baseline")
    record = execute(plan)
    rows = news(one, record)
    for wrong in ([len(rows)], [-1, 3], [4, 4]):
        with pytest.raises(ConfigurationError, match=f"ascending numbers of {len(rows)} ticks"):
            replayed(one, record, rows, record=["epoch"], wanted=wrong)


@pytest.mark.parametrize(("changes", "message"), [
    ({"parameters": {"nonsense": [1.0]}}, "nonsense: must be one of the parameters"),
    ({"parameters": {"range_std": [-1.0]}}, "range_std: must be between"),
    ({"parameters": {"range_std": [np.nan]}}, "range_std: must be between"),
    ({"parameters": {"range_std": [0.1, 0.2], "depth_std": [0.1, 0.2, 0.3]}}, "as many runs"),
    ({"parameters": {"beacon_error_std": [[0.1, 0.2]]}}, "must have 1 values"),
    ({"record": ["nonsense"]}, "nonsense: must be one of the outputs"),
    ({"wanted": [5, 3]}, "wanted: must be ascending"),
    ({"wanted": [10**6]}, "wanted: must be ascending"),
])
def test_what_does_not_fit_is_refused(changes: dict[str, Any], message: str) -> None:
    plan, one = dive("harbour-lbl", "long_baseline")
    record = execute(plan)
    with pytest.raises(ConfigurationError, match=message):
        replayed(one, record, news(one, record), **changes)


def test_ticks_and_inputs_that_do_not_fit_are_refused() -> None:
    _, one = dive("harbour-lbl", "long_baseline")
    path, depth = one.source.path, {"depth": [1.0, 2.0]}
    for ticks in ([10**9, 10**9], [10**9, 1_500_000_000], [2 * 10**9, 10**9]):
        with pytest.raises(ConfigurationError, match="ticks: must ascend"):
            replay(path, ticks, depth, {}, 10**9, record=["position"], start_ns=0)
    with pytest.raises(ConfigurationError, match="depth: must have the shape"):
        replay(path, [1, 2, 3], depth, {}, 1, record=["position"])


def test_a_component_of_another_tool_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="one of our own components"):
        replay(build_stranger(2, tmp_path), [1], {}, {}, 1, record=[])


def test_a_parameter_that_lanes_must_share_is_named() -> None:
    plan, one = dive("harbour-lbl", "long_baseline")
    target = next(c for c in plan.components if c.name == "target")
    with pytest.raises(FmuError, match="trajectory: must be the same"):
        replay(target.source.path, [10**9], {}, {"trajectory": [1, 2], "sampling_time": [1.0]},
               10**9, record=["position"], lanes=2)
    assert one.interval_ns > 0


def test_inputs_that_are_not_given_keep_their_start_values() -> None:
    fmu, position = factory.build("range_model", 2), np.array([[3.0, 4.0, 0.5], [0.0, 7.0, 0.5]])
    ticks = np.array([10**8, 2 * 10**8])
    found = replay(fmu, ticks, {"position": position}, {}, 10**8, record=["range"])["range"]
    beacons = np.reshape(read(fmu).ports["beacon_position"].start, (-1, 3))
    expected = np.linalg.norm(position[:, None] - beacons, axis=2)
    np.testing.assert_allclose(found[0], expected, rtol=1e-12)
