"""The sequence of (epoch, estimate) does not depend on how a system is stepped."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import sblcosim
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters.python import execute
from sblcosim.simulation.resolve import resolve
from sblcosim.simulation.system import ComponentSpec, System

CHOSEN = ("ekf", "sequential", "coupled", "fixed_lag")
RECEIVERS = (*CHOSEN, "raw")
SCENARIO = {
    "time": {"sampling_time_s": 0.1, "ekf_ratio": 2, "duration_s": 12.0},
    "platform": {"beaufort": 3, "motion": "spectrum", "watch_circle_m": 3.0,
                 "gps_horizontal_std_m": 0.5, "imu_tilt_std_deg": 1.0,
                 "gps_horizontal_markov_std_m": 0.5},
    "acoustics": {"loss_probability": 0.2, "outlier_probability": 0.05},
    "receiver": {"lag_s": 0.4},
}


def estimates(system: System) -> dict[str, np.ndarray]:
    record = execute(resolve(system))
    columns = {}
    for name in RECEIVERS:
        found = record.estimates(name)
        assert found.covariance is not None
        columns[name] = np.column_stack(
            [found.epoch_ns, found.position, found.covariance.reshape(len(found), -1)]
        )
    return columns


def same(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> None:
    for name in RECEIVERS:
        # A longer communication interval shows the last estimates later, or not any more.
        n = min(len(one[name]), len(other[name]))
        assert n > 50
        assert abs(len(one[name]) - len(other[name])) <= 1
        np.testing.assert_array_equal(one[name][:n], other[name][:n])


def stepped(change: Callable[[str, ComponentSpec], ComponentSpec]) -> System:
    system = connect(sblcosim.load(SCENARIO), CHOSEN)
    components = {name: change(name, spec) for name, spec in system.components.items()}
    return replace(system, components=components)


@pytest.fixture(scope="module")
def reference() -> dict[str, np.ndarray]:
    return estimates(stepped(lambda name, spec: spec))


@pytest.mark.parametrize(("divisor", "fmi"), list(itertools.product((1, 2, 5), (2, 3))))
def test_every_communication_interval_gives_the_same_estimates(
    divisor: int, fmi: int, reference: dict[str, np.ndarray]
) -> None:
    system = connect(sblcosim.load(SCENARIO), CHOSEN, fmi=fmi)
    step = 100_000_000 // divisor
    components = {
        name: replace(spec, interval_ns=step) for name, spec in system.components.items()
    }
    same(estimates(replace(system, components=components)), reference)


def test_receivers_stepped_at_the_ratio_or_at_the_sampling_time(
    reference: dict[str, np.ndarray],
) -> None:
    fine = stepped(
        lambda name, spec: replace(spec, interval_ns=100_000_000) if name in RECEIVERS else spec
    )
    assert stepped(lambda name, spec: spec).components["ekf"].interval_ns == 200_000_000
    same(estimates(fine), reference)


def test_versions_of_fmi_mixed(reference: dict[str, np.ndarray]) -> None:
    three = connect(sblcosim.load(SCENARIO), CHOSEN, fmi=3).components
    other = ("acoustics", "ekf", "coupled", "fixed_lag")
    mixed = stepped(lambda name, spec: three[name] if name in other else spec)
    same(estimates(mixed), reference)
