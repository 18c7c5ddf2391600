"""A receiver of a scenario as C for a microcontroller, with a self-test from its own dive."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus.build.targets import TARGETS
from sblcosim.fmus.stopping import interruptible
from sblcosim.models import RECEIVERS, declared, file_name
from sblcosim.models.declaration import Causality, Component

from .. import artifacts
from ..data.record import Record
from ..errors import check_choice
from ..scenario.files import naming_files
from ..scenario.overrides import Changes
from ..scenario.scenario import Scenario, load
from ..simulation.execution import execute
from ..simulation.plans.plan import PlannedComponent
from .parts import fmu_plan


@interruptible
@naming_files
def export_firmware(
    receiver: str,
    scenario: str | Path | Mapping[str, Any] | Scenario = "realistic-dive",
    path: str | Path | None = None,
    overrides: Changes = (),
    *,
    target: str = "cortex-m7",
) -> Path:
    """Write a receiver as C, with its README and a self-test, into a folder.

    Its parameters are the scenario's. The self-test has the receptions of the scenario's dive, and
    the outputs of the receiver's FMU.

    Parameters
    ----------
    receiver
        One of our receivers, by name.
    path
        The folder; None: ``firmware-RECEIVER``. An equal one is replaced.
    scenario, overrides
        As in `sblcosim.run`.
    target
        A key of `sblcosim.fmus.build.targets.TARGETS`: it decides the flags, and where the
        self-test runs.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    ConfigurationError
        The receiver or the target is unknown, the scenario is wrong, or the folder holds something
        else.
    BuildError
        CasADi or a compiler is missing.
    """
    check_choice("RECEIVER", receiver, tuple(RECEIVERS))
    check_choice("--target", target, tuple(TARGETS))
    settled = load(scenario, overrides)
    folder = Path(path or f"firmware-{receiver}")
    manifest = {
        "kind": "firmware", "receiver": receiver, "target": target,
        "scenario": settled.dump_toml(),
    }
    artifacts.check(folder, manifest, "replace")
    artifacts.check_kind(folder, "target")
    files = _files(receiver, settled, target)
    with artifacts.folder(folder, manifest) as part:
        for name, content in files.items():
            (part / name).write_bytes(content)
    return folder


def _files(receiver: str, scenario: Scenario, target: str) -> dict[str, bytes]:
    """The content of the folder, by file."""
    plan = fmu_plan(scenario, (receiver,), None, 2, "firmware")
    planned = next(c for c in plan.components if c.name == receiver)
    constants = {"beacons": scenario.beacons}
    recording = _recording(declared(receiver, **constants), planned, execute(plan))
    from sblcosim.fmus.build import firmware  # imports CasADi
    from sblcosim.models.loading import load as load_model

    return firmware.folder_files(
        load_model(receiver, **constants),
        file_name(receiver, **constants),
        {s.port.name: [float(value) for value in s.values] for s in planned.settings},
        planned.interval_ns,
        target,
        firmware.SelfTest(*recording),
        f"Its parameters are those of the scenario {scenario.name}.",
    )


def _recording(
    component: Component, planned: PlannedComponent, record: Record
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What a receiver had at its updates, and what it made of that.

    Update k uses the inputs at k times its interval; outputs after it are those an interval later.
    """
    sources = {
        port.name: connection.source for write in planned.writes
        for port, connection in zip(write.ports, write.connections, strict=True)
    }
    own = np.flatnonzero(record.own(planned.name))

    def elements(names: Mapping[str, str], causality: Causality, rows: Any) -> NDArray[np.float64]:
        columns = []
        for variable in component.of(causality):
            if variable.name in names:
                values = record.values[names[variable.name]][rows].astype(np.float64)
            else:
                values = np.tile(np.asarray(variable.starts, dtype=np.float64), (len(rows), 1))
            columns.append(values.reshape(len(rows), -1))
        return np.hstack(columns)

    outputs = {v.name: f"{planned.name}.{v.name}" for v in component.of("output")}
    inputs = elements(sources, "input", own[1:-1])
    return inputs, elements(outputs, "output", own[2:])
