"""The contents of a package for people: elements, connections, units and intervals, in text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from sblcosim.fmus.host.nanoseconds import text_of
from sblcosim.fmus.read.description import split
from sblcosim.fmus.read.ports import Fmu

from ..errors import ConfigurationError
from ..layout import fitted, table
from ..simulation.plans.plan import Plan, PlannedComponent
from ..simulation.system import Conversion
from ..words.lists import counted
from .documents import some
from .read import SEPARATOR, Package
from .structure import Inside, Path

MOST = 6
"""Number of connections that change values that the first screen has."""


@dataclass
class Line:
    """A connection, or those of all elements of an array together.

    Attributes
    ----------
    system
        System that contains the connection.
    source, target
        Elements, and the names of their connectors without indices.
    units
        Units of both ends; empty: none.
    what
        Conversion of the values, in words; empty: none.
    count
        Number of connections that it stands for.
    """

    system: Path
    source: tuple[Path, str]
    target: tuple[Path, str]
    units: tuple[str, str]
    what: str
    count: int = field(default=1, compare=False)


def lines_of(package: Package) -> list[Line]:
    """The connections of a package, in the direction of values; elements of arrays together."""
    found: dict[object, Line] = {}
    for edge in package.wiring.edges:
        ends = [(path, split(name)[0]) for path, name in (edge.source, edge.target)]
        units = [package.wiring.unit(end) for end in (edge.source, edge.target)]
        one, other = ("" if unit is None else unit.name for unit in units)
        try:
            what = _words(package.wiring.through(edge))
        except ConfigurationError:
            what = "cannot be converted"
        if not edge.link.converts and not what and one != other:
            what = "not converted"
        line = Line(edge.link.system, ends[0], ends[1], (one, other), what)
        known = found.setdefault(
            (line.system, line.source, line.target, line.units, line.what), line
        )
        if known is not line:
            known.count += 1
    return [*found.values()]


def text(
    package: Package, plan: Plan, *, verbose: bool = False, width: int | None = None
) -> str:
    """A package in text: its elements, and how they are connected.

    Parameters
    ----------
    verbose
        Whether to list all connections, not only the first ones that do not pass values as they
        are.
    width
        Columns to fit into; None: as wide as the tables are.
    """
    return "\n".join(_text(package, plan, verbose, width))


def _text(package: Package, plan: Plan, verbose: bool, width: int | None) -> Iterator[str]:
    planned = {c.name: c for c in plan.components}
    lines = lines_of(package)
    systems = sum(isinstance(e, Inside) for _, e in package.structure.system.walk()) - 1
    inside = f" in {systems + 1} systems" if systems else ""
    sentences = [
        f"{package.name}: {counted(len(planned), 'component')}{inside}, "
        f"{counted(sum(line.count for line in lines), 'connection')}",
        *package.remarks,
    ]
    yield fitted("\n".join(sentences), width)
    yield ""
    rows = [
        ("  " * (len(path) - 1) + path[-1], *_about(planned.get(package.labels.get(path, ""))))
        for path, _ in package.structure.system.walk()
        if path
    ]
    yield from table(rows, width, ("element", "from", "FMI", "interval"))
    told = lines if verbose else [line for line in lines if line.what]
    if told:
        yield ""
        head = ("from", "unit", "to", "unit", "values")
        cells = [
            (
                _name(line.source) + (f" ({line.count})" if line.count > 1 else ""),
                line.units[0], _name(line.target), line.units[1], line.what,
            )
            for line in (told if verbose else told[:MOST])
        ]  # fmt: skip
        kept = 5 if any(line.what for line in told) else 4
        yield from table([row[:kept] for row in cells], width, head[:kept])
        if len(told) > len(cells):
            yield f"and {len(told) - len(cells)} more that change values"
    free = [f"{label}.{name}" for path, label in package.labels.items()
            for name in dict.fromkeys(split(v)[0] for v in package.wiring.unfed(path))]  # fmt: skip
    if free:
        yield ""
        begun = "inputs without a connection keep the value they begin with"
        yield fitted(f"{begun}: {some(free)}", width)


def about(component: PlannedComponent) -> str:
    """The interval of an FMU, its version of FMI, and its file in a line."""
    origin, fmi, interval = _about(component)
    return f"{interval}, FMI {fmi}, {origin}"


def intervals(package: Package, plan: Plan) -> Mapping[Path, PlannedComponent]:
    """The components of the plan, by their places in the package."""
    planned = {c.name: c for c in plan.components}
    return {path: planned[label] for path, label in package.labels.items()}


def _about(component: PlannedComponent | None) -> tuple[str, str, str]:
    if component is None:
        return "system", "", ""
    fmi = str(component.source.fmi) if isinstance(component.source, Fmu) else ""
    return component.origin, fmi, text_of(component.interval_ns)


def _name(end: tuple[Path, str]) -> str:
    path, name = end
    return f"{SEPARATOR.join(path)}.{name}" if path else name


def _words(steps: Sequence[Conversion]) -> str:
    return ", ".join(filter(None, map(_step, steps)))


def _step(step: Conversion) -> str:
    factor = "" if step.factor == 1 else f"× {step.factor:.6g}"
    sign = "−" if step.offset < 0 else "+"
    offset = "" if step.offset == 0 else f"{sign} {abs(step.offset):.6g}"
    return f"{factor} {offset}".strip()
