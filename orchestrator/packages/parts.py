"""The FMUs of an SSP package, and the descriptions of their variables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from fmpy.model_description import ModelDescription, ModelVariable
from sblcosim.fmus.host.nanoseconds import nanoseconds
from sblcosim.fmus.read import archive as archives
from sblcosim.fmus.read import ports
from sblcosim.fmus.read.description import describe
from sblcosim.fmus.read.ports import Fmu, Port

from .units import LinearUnit, Named, units_of


@dataclass(frozen=True, slots=True)
class PortElement:
    """Place of an FMU's variable: its port, and its element there; None: all elements."""

    port: Port
    element: int | None

    @property
    def name(self) -> str:
        """The place in the form of a `Connection`."""
        if self.element is None or not self.port.shape:
            return self.port.name
        index = np.unravel_index(self.element, self.port.shape)
        return f"{self.port.name}[{','.join(str(i + 1) for i in index)}]"


@dataclass(frozen=True)
class DescribedFmu:
    """A component's FMU, and its model description.

    Attributes
    ----------
    label
        Name of the component in the system to run.
    """

    label: str
    fmu: Fmu
    description: ModelDescription
    variables: Mapping[str, ModelVariable]
    places: Mapping[str, PortElement]
    units: Mapping[str, LinearUnit]

    def unit(self, variable: str) -> Named | None:
        """A variable's unit; None without one."""
        found = self.variables[variable]
        name = found.unit or getattr(found.declaredType, "unit", None) or ""
        unit = self.units.get(name)
        return None if unit is None and name in ("", "1") else Named(name, unit)

    def may_start(self, variable: str) -> bool:
        """Whether the FMU allows a variable to be set at the start, although it is not an input."""
        found = self.variables[variable]
        return found.variability != "constant" and found.initial in ("exact", "approx")

    def default(self, what: str) -> int | None:
        """A time of the FMU's default experiment [ns]; None: not given."""
        text = getattr(self.description.defaultExperiment, what, None)
        try:
            time_ns = nanoseconds(float(text)) if text is not None else 0
        except (ValueError, OverflowError, ArithmeticError):
            return None
        return time_ns if time_ns > 0 else None


def part_of(label: str, path: Path) -> DescribedFmu:
    """A component's FMU.

    Raises
    ------
    FmuError
        As in `sblcosim.fmus.read.ports.read`.
    """
    with archives.opened(path) as archive:
        description = describe(archive)
    fmu = ports.read(path)
    places = {}
    for port in fmu.ports.values():
        single = len(port.variables) == 1
        for number, variable in enumerate(port.variables):
            places[variable] = PortElement(port, None if single else number)
    return DescribedFmu(
        label,
        fmu,
        description,
        {v.name: v for v in description.modelVariables},
        places,
        units_of(description.unitDefinitions),
    )
