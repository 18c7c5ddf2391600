"""A scenario as a single FMU for other tools, built with fmu-manipulation-toolbox."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from sblcosim.fmus.files import scratch, write_file
from sblcosim.fmus.host.nanoseconds import SECOND
from sblcosim.fmus.stopping import interruptible

from ..artifacts import check_place
from ..errors import ConfigurationError
from ..scenario.files import naming_files
from ..scenario.overrides import Changes
from ..scenario.scenario import Receivers, Scenario, Source, load
from ..simulation.plans.plan import Plan
from .parts import fmu_plan, links_of, outputs_of, parts_of, step_ns, written

TOOLBOX = "fmu-manipulation-toolbox"


@interruptible
@naming_files
def export_fmu(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    path: str | Path | None = None,
    receiver: Receivers = (),
    overrides: Changes = (),
    *,
    components: Mapping[str, Source] | None = None,
) -> Path:
    """Write a scenario as a single FMU (FMI 2) that holds all others.

    Its variables are the outputs of the components, ``component.variable``; those connected inside
    are local variables. It has neither inputs nor parameters: the FMUs inside are baked.

    Parameters
    ----------
    path
        Path of the file; None: ``NAME.fmu`` in the current folder. An existing file is replaced.
    scenario, receiver, overrides, components
        As in `sblcosim.export_ssp`.

    Raises
    ------
    ConfigurationError
        As in `sblcosim.export_ssp`; or the package ``fmu-manipulation-toolbox`` is not installed.
    FmuError
        An FMU cannot be built or read.
    """
    if find_spec("fmu_manipulation_toolbox") is None:
        raise ConfigurationError(
            f"export fmu: must have the package {TOOLBOX}, got none; pip install {TOOLBOX}"
        )
    settled = load(scenario, overrides)
    target = Path(path or f"{settled.name}.fmu")
    check_place(target.parent)
    plan = fmu_plan(settled, receiver, components, 2, "a single FMU")
    # The file name becomes an identifier in C.
    content = _container(plan, re.sub(r"\W", "_", settled.name) + ".fmu")
    return written(target, lambda file: write_file(file, content))


def _container(plan: Plan, name: str) -> bytes:
    """The content of the FMU; `name` is that of its file."""
    # imported here: the package is optional
    from fmu_manipulation_toolbox.assembly import Assembly, AssemblyError, AssemblyNode
    from fmu_manipulation_toolbox.container import FMUContainerError

    links = list(links_of(plan))
    linked = {source for source, _ in links}
    whole = AssemblyNode(
        name,
        step_size=step_ns(plan) / SECOND,
        auto_link=False,
        auto_input=False,
        auto_output=False,
    )
    with tempfile.TemporaryDirectory(dir=scratch()) as temporary:
        folder = Path(temporary)
        for part in parts_of(plan, bake=True):
            file = f"{part.name}.fmu"
            (folder / file).write_bytes(part.fmu.read_bytes())
            whole.add_fmu(file)
            for variable in outputs_of(part):
                if (part.name, variable.name) in linked:
                    continue  # it becomes a local variable of the same name
                whole.add_output(file, variable.name, f"{part.name}.{variable.name}")
        for (source, output), (target, input_) in links:
            whole.add_link(f"{source}.fmu", output, f"{target}.fmu", input_)
        assembly = Assembly(fmu_directory=folder)
        assembly.root = whole
        try:
            assembly.make_fmu()
        except (AssemblyError, FMUContainerError) as error:
            raise ConfigurationError(
                f"export fmu: {TOOLBOX} must take all components, got: {error.reason}"
            ) from error
        return Path(folder, whole.name).read_bytes()
