"""Units of the standards FMI and SSP, and conversions between them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from ..simulation.system import Conversion

EXPONENTS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
"""Attributes of a unit, as named in both standards."""


@dataclass(frozen=True, slots=True)
class LinearUnit:
    """A unit: a value v in it is ``factor * v + offset`` in base units.

    Attributes
    ----------
    exponents
        Exponents of the base units, as in `EXPONENTS`.
    """

    exponents: tuple[int, ...]
    factor: float
    offset: float


@dataclass(frozen=True, slots=True)
class Named:
    """A unit as a file has it: its name and its definition; None if that is missing."""

    name: str
    unit: LinearUnit | None


def unit_of(attributes: Mapping[str, Any]) -> LinearUnit:
    """A unit from the attributes of a BaseUnit.

    Raises
    ------
    ValueError
        An attribute is not a number, or the factor is no valid divisor.
    """
    exponents = tuple(int(attributes.get(name) or 0) for name in EXPONENTS)
    factor, offset = (
        default if attributes.get(name) is None else float(attributes[name])
        for name, default in (("factor", 1.0), ("offset", 0.0))
    )
    if not (math.isfinite(factor) and math.isfinite(offset) and factor != 0):
        raise ValueError(f"must have a finite factor and offset, got {factor:g} and {offset:g}")
    return LinearUnit(exponents, factor, offset)


def units_of(definitions: Iterable[Any]) -> dict[str, LinearUnit]:
    """The units that an FMU's model description defines, by name, except invalid ones."""
    found = {}
    for definition in definitions:
        given = definition.baseUnit
        if given is None:
            continue
        names = (*EXPONENTS, "factor", "offset")
        try:
            found[definition.name] = unit_of({name: getattr(given, name, None) for name in names})
        except (TypeError, ValueError):
            continue
    return found


def conversion(source: LinearUnit, target: LinearUnit) -> Conversion:
    """Conversion of a value from one unit to another.

    Raises
    ------
    ValueError
        The units are of different quantities.
    """
    if source.exponents != target.exponents:
        raise ValueError("different quantities")
    if source == target:
        return Conversion()
    return Conversion(
        source.factor / target.factor, (source.offset - target.offset) / target.factor
    )


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number on its way from connector to connector: its unit, and its conversions.

    Consecutive units are converted at once, from the first to the last, so that a value that
    returns to its unit is the same to the bit.

    Attributes
    ----------
    unit
        Unit of the number at its present place; None: not known.
    first
        Unit in which the last of `steps` left it.
    certain
        Whether a unit, a transformation, or the wish to have neither has decided anything.
    doubts
        Places where a unit is missing, and the units of both ends there, for messages.
    """

    unit: Named | None
    first: Named | None
    steps: tuple[Conversion, ...] = ()
    certain: bool = False
    doubts: tuple[tuple[str, str, str], ...] = ()

    @classmethod
    def of(cls, unit: Named | None) -> Quantity:
        """A number before its way begins."""
        return cls(unit, unit)

    @property
    def through(self) -> tuple[Conversion, ...]:
        """The conversions of the number, in order."""
        return (*self.steps, *_between(self.first, self.unit))

    def to(self, target: Named | None, where: str = "") -> Quantity:
        """The number in the unit of the next connector, at the place ``where``.

        Raises
        ------
        ValueError
            It cannot be converted; the message begins with what must hold.
        """
        here = self.unit
        if target is None:
            return self
        if here is None:
            doubts = (*self.doubts, (where, "none", target.name))
            return Quantity(target, target, self.steps, self.certain, doubts)
        if here.unit is None or target.unit is None:
            if here.name != target.name:
                raise ValueError(
                    f"both units must be defined, got {_quoted(here)} and {_quoted(target)}"
                )
            return Quantity(target, target, self.through, self.certain, self.doubts)
        if here.unit.exponents != target.unit.exponents:
            raise ValueError(
                "must have units of the same quantity at both ends, got "
                f"{_quoted(here)} and {_quoted(target)}"
            )
        return Quantity(target, self.first, self.steps, True, self.doubts)

    def unchanged(self, target: Named | None) -> Quantity:
        """The same number at the next connector, whose unit is then that of the number."""
        return Quantity(target, target, self.through, True, self.doubts)

    def transformed(self, by: Conversion) -> Quantity:
        """The number after a transformation in its unit."""
        return Quantity(self.unit, self.unit, (*self.through, by), True)


def chained(steps: Iterable[Conversion]) -> Conversion:
    """Conversions one after another."""
    whole = Conversion()
    for step in reversed([step for step in steps if step != Conversion()]):
        whole = Conversion(step.factor, step.offset, None if whole == Conversion() else whole)
    return whole


def _between(first: Named | None, last: Named | None) -> tuple[Conversion, ...]:
    if first is None or last is None or first.unit is None or last.unit is None:
        return ()
    found = conversion(first.unit, last.unit)
    return () if found == Conversion() else (found,)


def _quoted(unit: Named) -> str:
    return repr(unit.name)
