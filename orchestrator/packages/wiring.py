"""Nested systems made flat: the source of each component's input, and the units on the way.

The standard derives the source of a connection from the kinds of its connectors, not from which end
is called the start (SSP 2.0, section 5.3.2.1, Allowed Connections).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from sblcosim.fmus.read.archive import shown

from ..errors import ConfigurationError, nearest, quoted
from ..simulation.system import Conversion
from .parts import DescribedFmu
from .structure import End, Inside, Link, PackageComponent, Path, Structure
from .units import Named, Quantity

_GIVING = frozenset({"output", "calculatedParameter", "local", "constant"})
_TAKING = frozenset({"input", "parameter", "structuralParameter"})


@dataclass(frozen=True, slots=True)
class Edge:
    """A connection in the direction of its values."""

    link: Link
    source: End
    target: End

    def __str__(self) -> str:
        return str(replace(self.link, start=self.source, end=self.target))


class Wiring:
    """The connections of a package.

    Raises
    ------
    ConfigurationError
        A connection is impossible: the message names it.
    """

    def __init__(self, structure: Structure, parts: Mapping[Path, DescribedFmu]) -> None:
        self._elements = dict(structure.system.walk())
        self._units = structure.units
        self._parts = parts
        self.edges = [
            self._edge(link)
            for element in self._elements.values()
            if isinstance(element, Inside)
            for link in element.links
        ]
        self._into: dict[End, Edge] = {}
        self._out_of: dict[End, list[Edge]] = {}
        for edge in self.edges:
            earlier = self._into.setdefault(edge.target, edge)
            if earlier is not edge and edge.target[0]:  # values that leave the package go nowhere
                raise ConfigurationError(
                    f"{_words(edge.link)}: an input must have one source, got "
                    f"{'.'.join((*earlier.source[0], earlier.source[1]))} as well"
                )
            self._out_of.setdefault(edge.source, []).append(edge)
        self._known: dict[End, Named | None] = {}
        self._origins: dict[End, tuple[End, Quantity]] = {}
        self._refuse_circles()

    def connections(self) -> Iterator[tuple[End, End, Quantity]]:
        """A connection between components: the source, the target, and the conversion of a
        number."""
        for edge in self.edges:
            if edge.target[0] in self._parts:
                source, quantity = self._arriving(edge)
                if source[0] in self._parts:
                    yield source, edge.target, quantity

    def named(self, path: Path, name: str) -> Iterator[End]:
        """The variables and connectors that have a hierarchical name in an element."""
        element = self._elements[path]
        if isinstance(element, PackageComponent):
            if name in self._parts[path].variables:
                yield path, name
            return
        end = (path, name)
        if name in element.connectors or end in self._into or end in self._out_of:
            yield end
        for dot in (i for i, letter in enumerate(name) if letter == "."):
            if name[:dot] in element.elements:
                yield from self.named((*path, name[:dot]), name[dot + 1 :])

    def names(self, path: Path) -> Iterator[str]:
        """All hierarchical names in an element."""
        element = self._elements[path]
        if isinstance(element, PackageComponent):
            yield from self._parts[path].variables
            return
        yield from dict.fromkeys([
            *element.connectors, *(name for owner, name in self._out_of if owner == path),
        ])  # fmt: skip
        for inner in element.elements:
            yield from (f"{inner}.{name}" for name in self.names((*path, inner)))

    def reached(self, end: End, quantity: Quantity) -> Iterator[tuple[End, Quantity]]:
        """The variables of components that a number at a connector goes to.

        None for a connector that gives values of its system: they come from inside.
        """
        if end[0] not in self._parts and self._gives(end, inside=True) is False:
            return
        ahead = [(end, quantity)]
        while ahead:
            end, quantity = ahead.pop()
            if end[0] in self._parts:
                yield end, quantity
            else:
                ahead += [(e.target, self._along(quantity, e)) for e in self._out_of.get(end, ())]

    def depth(self, end: End) -> int:
        """Number of connections that lead to a connector, one after another."""
        depth = 0
        while end in self._into:
            depth, end = depth + 1, self._into[end].source
            if end[0] in self._parts:
                break
        return depth

    def unit(self, end: End) -> Named | None:
        """The unit of a connector: its own, that of the FMU, or that of everything it leads to
        inside."""
        if end not in self._known:
            self._known[end] = self._unit(end)
        return self._known[end]

    def _unit(self, end: End) -> Named | None:
        path, name = end
        connectors, part = self._elements[path].connectors, self._parts.get(path)
        own = connectors[name].unit if name in connectors else ""
        if own:
            unit = self._units.get(own) or (None if part is None else part.units.get(own))
            return None if unit is None and own == "1" else Named(own, unit)
        if part is not None:
            return part.unit(name) if name in part.variables else None
        around = [*self._out_of.get(end, ()), *filter(None, [self._into.get(end)])]
        plain = [e.link for e in around if e.link.converts and e.link.transformation is None]
        others = (other for link in plain for other in (link.start, link.end))
        inside = {self.unit(other) for other in others if other[0][:-1] == path != other[0]}
        return inside.pop() if len(inside) == 1 else None

    def through(self, edge: Edge) -> tuple[Conversion, ...]:
        """Conversion of a number on a single edge.

        Raises
        ------
        ConfigurationError
            It cannot be converted. For values that leave the package, only this check finds it.
        """
        return self._along(Quantity.of(self.unit(edge.source)), edge).through

    def unfed(self, path: Path) -> list[str]:
        """Inputs of a component that no connection leads to."""
        places = self._parts[path].places.items()
        return [v for v, p in places if p.port.causality == "input" and (path, v) not in self._into]

    def _along(self, quantity: Quantity, edge: Edge) -> Quantity:
        link, target = edge.link, self.unit(edge.target)
        try:
            there = (
                quantity.to(target, str(edge)) if link.converts else quantity.unchanged(target)
            )
        except ValueError as error:
            raise ConfigurationError(f"{_words(link)}: {error}") from None
        return there if link.transformation is None else there.transformed(link.transformation)

    def _arriving(self, edge: Edge) -> tuple[End, Quantity]:
        """Source of the values that arrive at the end of an edge, and their conversions."""
        way, source = [edge], edge.source
        while source not in self._origins and source in self._into:
            way.append(self._into[source])
            source = way[-1].source
        origin, quantity = self._origins.get(source, (source, Quantity.of(self.unit(source))))
        for passed in reversed(way):
            quantity = self._along(quantity, passed)
            if passed is not edge:
                self._origins[passed.target] = origin, quantity
        return origin, quantity

    def _refuse_circles(self) -> None:
        """Refuse connectors of systems that are connected to each other but to no component."""
        good: set[End] = set()
        for edge in self.edges:
            passed: set[End] = set()
            end = edge.target
            while end in self._into and end not in good:
                if end in passed:
                    raise ConfigurationError(
                        f"{_words(self._into[end].link)}: must come from a component, got a "
                        "circle of connectors of systems"
                    )
                passed.add(end)
                end = self._into[end].source
            good |= passed

    # --- Directions ---

    def _edge(self, link: Link) -> Edge:
        for end in (link.start, link.end):
            self._check(link, end)
        one, other = (self._gives(e, inside=e[0] == link.system) for e in (link.start, link.end))
        if one is not None and one == other:
            got = " and ".join(
                f"{self._kind(e)} {quoted('.'.join((*e[0], e[1])))}" for e in (link.start, link.end)
            )
            raise ConfigurationError(
                f"{_words(link)}: must connect an output with an input, got {got}"
            )
        if one is False or other is True:
            return Edge(link, link.end, link.start)
        return Edge(link, link.start, link.end)

    def _check(self, link: Link, end: End) -> None:
        path, name = end
        part = self._parts.get(path)
        if part is not None and name not in part.places:
            raise ConfigurationError(
                f"{_words(link)}: must be connectors of variables of the FMUs, got "
                f"{quoted(name)} of {'.'.join(path)}{nearest(name, part.places)}"
            )

    def _gives(self, end: End, *, inside: bool) -> bool | None:
        """Whether values come from a connector; None: not yet known.

        Seen from inside a system, its inputs give values and its outputs take them.
        """
        kind = self._kind(end)
        if kind in _GIVING:
            return not inside
        return inside if kind in _TAKING else None

    def _kind(self, end: End) -> str:
        """The kind of a connector; for a component's, the causality of its variable in the FMU."""
        path, name = end
        if path in self._parts:
            return self._parts[path].places[name].port.causality
        connector = self._elements[path].connectors.get(name)
        return "" if connector is None else connector.kind


def _words(link: Link) -> str:
    return shown(str(link), 200)
