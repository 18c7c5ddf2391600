"""All masters give the same record, to the last bit, whatever runs and however it is stepped."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import sblcosim
from quick import one_in
from sblcosim.cli import app
from sblcosim.data.record import Record
from sblcosim.scenario.scenario import shipped
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters import native, python
from sblcosim.simulation.resolve import resolve
from sblcosim.simulation.system import System
from typer.testing import CliRunner

SHORT = {"time.duration_s": 40.0, "receiver.lag_s": 4.0}
RECEIVERS = ("ekf", "sequential", "coupled", "fixed_lag")
DIVISORS = {"target": 2, "platform": 1, "acoustics": 5, "ekf": 4}


def mixed_versions(scenario: str) -> System:
    loaded = sblcosim.load(scenario, SHORT)
    two, three = (connect(loaded, RECEIVERS, fmi=fmi) for fmi in (2, 3))
    components = {
        name: (two if i % 2 else three).components[name] for i, name in enumerate(two.components)
    }
    return replace(two, components=components)


def mixed_intervals(scenario: str) -> System:
    system = connect(sblcosim.load(scenario, SHORT), RECEIVERS)
    components = {
        name: replace(spec, interval_ns=spec.interval_ns // DIVISORS.get(name, 1))
        for name, spec in system.components.items()
    }
    return replace(system, components=components)


SYSTEMS = {
    "FMI 2": lambda scenario: connect(sblcosim.load(scenario, SHORT), RECEIVERS, fmi=2),
    "FMI 3": lambda scenario: connect(sblcosim.load(scenario, SHORT), RECEIVERS, fmi=3),
    "mixed versions": mixed_versions,
    "mixed intervals": mixed_intervals,
}


def same(one: Record, other: Record) -> None:
    assert np.array_equal(one.time_ns, other.time_ns)
    assert one.values.keys() == other.values.keys()
    for name, values in one.values.items():
        found = other.values[name]
        assert (values.dtype, values.shape) == (found.dtype, found.shape), name
        assert values.tobytes() == found.tobytes(), name


@one_in(2)
@pytest.mark.parametrize("variant", SYSTEMS)
@pytest.mark.parametrize("scenario", shipped())
def test_native_gives_the_record_of_the_python_master(scenario: str, variant: str) -> None:
    plan = resolve(SYSTEMS[variant](scenario))
    reference = python.execute(plan)
    assert len(reference) > 20
    for receiver in (*RECEIVERS, "raw"):
        assert len(reference.estimates(receiver)) > 5
    same(native.execute(plan), reference)


def test_a_sea_with_a_spectrum_is_the_same_with_both() -> None:
    sea = {"platform.motion": "spectrum", "platform.wave_height_m": 0.6, "time.duration_s": 12.0}
    plan = resolve(connect(sblcosim.load("harbour-square", sea), "ekf", tell_idle=False))
    reference = python.execute(plan)
    assert np.ptp(reference.values["platform.attitude"][:, 0]) > 0.01
    same(native.execute(plan), reference)


def test_both_masters_give_the_same_result() -> None:
    results = [
        sblcosim.run("paper-scenario-1", RECEIVERS, SHORT, master=name)
        for name in ("python", "native")
    ]
    assert results[0].table.equals(results[1].table)
    assert results[0].errors.equals(results[1].errors)


@pytest.mark.parametrize("options", [("--master", "native", "--step-timeout", "300"), ()])
def test_the_command_runs_the_master_it_is_told(
    options: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    command = ["run", "paper-scenario-1", "--set", "time.duration_s=5", "--no-figures", "--json"]
    monkeypatch.chdir(tmp_path)
    outputs = [
        CliRunner().invoke(app, [*command, *chosen], catch_exceptions=False).stdout
        for chosen in (options, ("--master", "python"))
    ]
    assert outputs[0] == outputs[1]
    wrong = CliRunner().invoke(app, [*command, "--master", "pyton"])
    assert wrong.exit_code == 2
    assert "master: must be" in wrong.stderr
    assert "did you mean 'python'?" in wrong.stderr


@pytest.mark.parametrize("master", ["python", "lanes"])
def test_a_master_that_waits_for_ever_takes_no_timeout(master: str) -> None:
    done = CliRunner().invoke(
        app, ["run", "paper-scenario-1", "--master", master, "--step-timeout", "3"]
    )
    assert done.exit_code == 2
    assert f"--step-timeout: must be left out with the {master} master" in done.output
