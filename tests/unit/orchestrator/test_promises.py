"""What an FMU may do by its standard and its description, with every master that calls FMUs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from sblcosim.data.record import Record
from sblcosim.errors import FmuError
from sblcosim.simulation.masters import native, python
from sblcosim.simulation.resolve import resolve
from sblcosim.simulation.system import ComponentSpec, System
from stranger import build_stranger

T = 100_000_000
EARLY = 14
Execute = Callable[..., Record]
MASTERS = pytest.mark.parametrize("execute", [python.execute, native.execute])


def alone(name: str, fmu: Path, execute: Execute, **parameters: float) -> Record:
    spec = ComponentSpec(fmu, T, parameters)
    return execute(resolve(System({name: spec}, (), 10 * T)))


@pytest.fixture(scope="module")
def early(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("early")
    return build_stranger(3, folder, lambda text: text.replace('max="4"', 'max="99"'))


@MASTERS
def test_a_step_that_returns_early_ends_the_run(early: Path, execute: Execute) -> None:
    """Nobody asks for it, so a step that has not got to its end is none."""
    with pytest.raises(FmuError) as caught:
        alone("s", early, execute, fail_at=0.35, fail_as=EARLY)
    assert str(caught.value) == (
        "s: fmi3DoStep at 0.3 s must succeed, got Discard: "
        "the FMU ended the simulation or the step early"
    )
    assert len(alone("s", early, execute, fail_at=-1.0, fail_as=EARLY)) == 11


@pytest.mark.parametrize("fmi", [2, 3])
@MASTERS
def test_an_fmu_for_one_instance_is_instantiated_once_whatever_its_name(
    execute: Execute, fmi: int, tmp_path: Path
) -> None:
    flag = '<CoSimulation canBeInstantiatedOnlyOncePerProcess="true"'
    name = execute.__module__.replace(".", "_")  # equal FMUs would be one for the process
    fmu = build_stranger(
        fmi,
        tmp_path,
        lambda text: text.replace("<CoSimulation", flag).replace(
            "<ModelVariables>", f"<!-- {name} --><ModelVariables>"
        ),
        ("-DONLY_ONCE",),
    )
    first = alone("a", fmu, execute)
    other = alone("b", fmu, execute)
    for column, values in first.values.items():
        np.testing.assert_array_equal(values, other.values[column.replace("a.", "b.", 1)])
