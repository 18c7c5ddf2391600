"""Units of the standards FMI and SSP, and conversions between them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from ..simulation.system import Conversion

EXPONENTS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
"""What a unit is made of, in the words of both standards."""


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit: a value v in it is ``factor * v + offset`` in base units.

    Attributes
    ----------
    exponents
        Of the base units, as in `EXPONENTS`.
    """

    exponents: tuple[int, ...]
    factor: float
    offset: float


def unit_of(attributes: Mapping[str, Any]) -> Unit:
    """A unit from the attributes of a BaseUnit.

    Raises
    ------
    ValueError
        One of them is no number, or the factor is no divisor.
    """
    exponents = tuple(int(attributes.get(name) or 0) for name in EXPONENTS)
    factor, offset = (
        default if attributes.get(name) is None else float(attributes[name])
        for name, default in (("factor", 1.0), ("offset", 0.0))
    )
    if not (math.isfinite(factor) and math.isfinite(offset) and factor != 0):
        raise ValueError(f"must have a finite factor and offset, got {factor:g} and {offset:g}")
    return Unit(exponents, factor, offset)


def units_of(definitions: Iterable[Any]) -> dict[str, Unit]:
    """The units that an FMU's model description defines, by name; without those not understood."""
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


def conversion(source: Unit, target: Unit) -> Conversion:
    """How a value in one unit becomes one in another.

    Raises
    ------
    ValueError
        They are units of different quantities.
    """
    if source.exponents != target.exponents:
        raise ValueError("different quantities")
    if source == target:
        return Conversion()
    return Conversion(
        source.factor / target.factor, (source.offset - target.offset) / target.factor
    )
