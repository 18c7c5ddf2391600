"""An SSP package as a system to run.

Its FMUs are unpacked for as long as they are needed, and nested systems are made flat. Scalars that
make up an array, as in FMI 2, are connected as one if the package connects all of them in their
order.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from sblcosim.fmus.files import scratch
from sblcosim.fmus.host.nanoseconds import text_of
from sblcosim.fmus.read import archive as archives
from sblcosim.fmus.read.archive import shown

from ..errors import ConfigurationError, ConfigurationWarning, FmuError, SblcosimError
from ..simulation.system import ComponentSpec, Connection, Conversion, System
from .documents import some
from .parts import DescribedFmu, PortElement, part_of
from .structure import Inside, PackageComponent, StepAnnotation, Structure, structure_of
from .structure import Path as Inner
from .units import Quantity, chained
from .values import filled, values_of
from .wiring import Wiring

STEPS = 1000
"""Number of steps of a run if neither the package nor its FMUs give a step."""
SEPARATOR = "/"
"""Separator between the names of systems and that of a component in them."""


@dataclass(frozen=True)
class Package:
    """An unpacked package.

    Attributes
    ----------
    name
        Name of the file, without its suffix.
    sha256
        SHA-256 of the file.
    remarks
        What the package leaves open and how it was settled, as sentences.
    path, folder
        The file, and the folder with its contents.
    structure, wiring
        The description in the package, and its connections with their directions.
    labels
        Names of the components in the system, by their places in the structure.
    """

    name: str
    sha256: str
    system: System
    remarks: tuple[str, ...]
    path: Path
    folder: Path
    structure: Structure
    wiring: Wiring
    labels: Mapping[Inner, str]

    def said(self, message: str) -> str:
        """A message about the package that names its path, instead of the folder or in front."""
        said = message.replace(str(self.folder), str(self.path))
        return said if str(self.path) in said else f"{self.path}: {said}"


@contextmanager
def opened(source: str | Path) -> Iterator[Package]:
    """A package that is unpacked while the statement lasts.

    Raises
    ------
    ConfigurationError
        There is no such package, it is damaged, or it holds something that cannot be simulated
        here; the message names it.

    Warns
    -----
    ConfigurationWarning
        A parameter of the package has no effect, or a unit is missing.
    """
    path = Path(source)
    with tempfile.TemporaryDirectory(dir=scratch()) as temporary:
        folder = Path(temporary)
        try:
            with archives.opened(path, "an SSP package") as archive:
                structure = structure_of(archive)
                archive.unpack(folder)
                sha256 = archive.sha256
            labels = _labels(structure)
            parts = {
                place: part_of(labels[place], folder / component.source)
                for place, component in structure.system.walk()
                if isinstance(component, PackageComponent)
            }
        except FmuError as error:
            raise ConfigurationError(str(error).replace(str(folder), str(path))) from error
        try:
            wiring = Wiring(structure, parts)
            assembly = _Assembly(structure, parts, wiring)
            system, remarks = assembly.system()
        except ConfigurationError as error:
            raise ConfigurationError(f"{path}: {error}") from error
        for message in (*structure.warnings, *assembly.warnings):
            text = f"{path}: {shown(message, 250)}"
            warnings.warn(text, ConfigurationWarning, stacklevel=3)
        package = Package(
            path.stem, sha256, system, (*structure.remarks, *remarks), path, folder, structure,
            wiring, labels,
        )  # fmt: skip
        try:
            yield package
        except SblcosimError as error:
            error.args = (package.said(str(error)),)
            raise


def _labels(structure: Structure) -> dict[Inner, str]:
    """Names for the components in one system: unique, and without dots."""
    labels: dict[Inner, str] = {}
    taken: set[str] = set()
    for path, element in structure.system.walk():
        if isinstance(element, PackageComponent):
            name = label = SEPARATOR.join(path).replace(".", SEPARATOR)
            number = 1
            while label in taken:
                number += 1
                label = f"{name}_{number}"
            taken.add(label)
            labels[path] = label
    return labels


class _Assembly:
    """Puts a system together."""

    def __init__(
        self, structure: Structure, parts: Mapping[Inner, DescribedFmu], wiring: Wiring
    ) -> None:
        self._structure = structure
        self._parts = parts
        self._wiring = wiring
        self.warnings: list[str] = []

    def system(self) -> tuple[System, list[str]]:
        """The system, and remarks on what the package leaves open."""
        if not self._parts:
            raise ConfigurationError("the system must have at least one component, got none")
        stop_ns, remarks = self._stop()
        intervals, more = self._intervals(stop_ns)
        values, self.warnings = values_of(self._structure, self._parts, self._wiring)
        components = {
            part.label: ComponentSpec(part.fmu.path, intervals[path], *filled(part, values[path]))
            for path, part in self._parts.items()
        }
        connections = tuple(self._connections())
        start_ns = self._structure.start_ns
        return System(components, connections, stop_ns, start_ns), [*remarks, *more]

    # --- Time ---

    def _stop(self) -> tuple[int, list[str]]:
        if self._structure.stop_ns is not None:
            return self._structure.stop_ns, []
        given = [part.default("stopTime") for part in self._parts.values()]
        known = [stop_ns for stop_ns in given if stop_ns is not None]
        if not known:
            raise ConfigurationError(
                "DefaultExperiment: must have a stopTime, got none, nor has any of its FMUs"
            )
        return max(known), [
            f"stop time {text_of(max(known))}: the longest of the FMUs, as the package gives none"
        ]

    def _intervals(self, stop_ns: int) -> tuple[dict[Inner, int], list[str]]:
        """The communication intervals [ns], and how they were chosen.

        The interval of a component is its own, or the step of the innermost system that has one, or
        the default of its FMU, or the smallest of the others, or a fraction of the run.
        """
        own = {
            path: self._structure.intervals_ns[".".join(path)]
            for path in self._parts
            if ".".join(path) in self._structure.intervals_ns
        }
        given = {path: self._step(path) for path in self._parts}
        steps = {path: step for path, step in given.items() if step is not None}
        defaults = {path: part.default("stepSize") for path, part in self._parts.items()}
        found = {path: step.ns for path, step in steps.items()} | own
        remarks = []
        if used := {step: None for path, step in steps.items() if path not in own}:
            words = " and ".join(f"{text_of(step.ns)}: the step that the package gives for "
                                 f"{step.tool}" for step in used)  # fmt: skip
            remarks.append(f"communication interval {words}")
        rest = [path for path in self._parts if path not in found]
        if not rest:
            return found, remarks
        known = [*found.values(), *(ns for path in rest if (ns := defaults[path]))]
        if known:
            found |= {path: defaults[path] or min(known) for path in rest}
            others = "" if all(defaults[path] for path in rest) else (
                ", the smallest for those without one"
            )
            remarks.append(
                f"communication intervals: the default step sizes of the FMUs{others} "
                f"({self._each({path: found[path] for path in rest})})"
            )
            return found, remarks
        share = max((stop_ns - self._structure.start_ns) // STEPS, 1)
        return dict.fromkeys(self._parts, share), [
            f"communication interval {text_of(share)}: a {STEPS}th of the run, as neither the "
            "package nor its FMUs give a step size"
        ]

    def _each(self, intervals_ns: Mapping[Inner, int]) -> str:
        """The intervals with the components that have them, or the one of all."""
        labels: dict[int, list[str]] = {}
        for path, interval_ns in intervals_ns.items():
            labels.setdefault(interval_ns, []).append(self._parts[path].label)
        if len(labels) == 1 and len(intervals_ns) == len(self._parts):
            return text_of(*labels)
        return "; ".join(f"{some(names)}: {text_of(ns)}" for ns, names in sorted(labels.items()))

    def _step(self, path: Inner) -> StepAnnotation | None:
        """The step in the innermost annotation that is about a component."""
        element: PackageComponent | Inside = self._structure.system
        step = element.step
        for name in path:
            assert isinstance(element, Inside)
            element = element.elements[name]
            step = element.step or step
        return step

    # --- Connections ---

    def _connections(self) -> Iterator[Connection]:
        """Between components; whole arrays where all elements are connected in order."""
        groups: dict[tuple[str, ...], list[tuple[PortElement, PortElement, Conversion | None]]] = {}
        for source, target, quantity in self._wiring.connections():
            one, other = self._parts[source[0]], self._parts[target[0]]
            out, into = one.places[source[1]], other.places[target[1]]
            key = (one.label, out.port.name, other.label, into.port.name)
            groups.setdefault(key, []).append((out, into, self._conversion(quantity)))
        for (giving, name, taking, other_name), pairs in groups.items():
            if _is_whole(pairs):
                yield Connection(f"{giving}.{name}", f"{taking}.{other_name}", pairs[0][2])
                continue
            for out, into, through in pairs:
                yield Connection(f"{giving}.{out.name}", f"{taking}.{into.name}", through)

    def _conversion(self, quantity: Quantity) -> Conversion | None:
        """What becomes of the values; None: the FMUs' units are left to be compared by name."""
        if not quantity.certain:
            return None
        said = (
            f"{where}: both ends must have the same unit, got {one} and {other}"
            for where, one, other in quantity.doubts
        )
        # Connections with the same beginning have the same doubts.
        self.warnings += [message for message in said if message not in self.warnings]
        return chained(quantity.through)


def _is_whole(pairs: Sequence[tuple[PortElement, PortElement, Conversion | None]]) -> bool:
    """Whether connections of elements equal a connection of two arrays."""
    one, other, through = pairs[0]
    if one.element is None and other.element is None:
        return len(pairs) == 1
    elements = [(a.element, b.element) for a, b, _ in pairs]
    return (
        one.port.shape == other.port.shape
        and sorted(elements, key=str) == sorted(((i, i) for i in range(one.port.size)), key=str)
        and all(own == through for _, _, own in pairs)
    )
