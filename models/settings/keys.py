"""From keys of a scenario to parameters of the FMUs: units, bounds and starts.

A key holds the value of a parameter in the unit of its suffix: angles are in degrees, choices are
names, arrays are flat, row by row. Instead of a number it may hold the name of a named value, which
is in no unit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from functools import cache, lru_cache, partial
from types import MappingProxyType
from typing import Any

from .. import RECEIVERS, declared
from ..declaration import Component, Variable, number_of
from ..ports import BEACONS
from . import either

OF_RECEIVERS: Mapping[str, Variable] = {
    v.key: v
    for named in (False, True) for receiver in RECEIVERS.values()
    for v in receiver.of("parameter") if bool(v.named) is named
}
"""Parameters of all our receivers, by key. Where they differ, one that has named values."""


def is_list(variables: Iterable[Variable], variable: Variable) -> bool:
    """Whether an array has a fixed capacity and a separate count."""
    name = variable.name
    for end in ("_time", "_depth", "_speed", "_heading"):
        name = name.removesuffix(end)
    return any(v.name == f"{name}_count" for v in variables)


def in_file_units(variable: Variable, value: Any) -> Any:
    """Convert an SI value to the unit of the scenario file: radians become degrees."""
    return _in_file_units(variable.unit, value)


def _in_file_units(unit: str | None, value: Any) -> Any:
    if unit is None or not unit.startswith("rad"):
        return value
    angle = either.degrees(value)
    return angle if either.symbolic(angle) else float(f"{angle:.12g}")


@lru_cache(4096, typed=True)
def _range(unit: str | None, low: float | None, high: float | None) -> tuple[float, float]:
    """Bounds in the unit of the scenario file."""
    return (
        -math.inf if low is None else _in_file_units(unit, low),
        math.inf if high is None else _in_file_units(unit, high),
    )


def within(variable: Variable, value: Any) -> Any:
    """The value of a scenario file, clipped to the bounds of the declaration."""
    low, high = _range(variable.unit, *variable.bounds)
    if variable.shape:
        return tuple(either.clipped(v, low, high) for v in value)
    return value if variable.choices is not None else either.clipped(value, low, high)


def in_si(variable: Variable, value: Any) -> Any:
    """Convert a value of a scenario file to the FMU's; arrays become row-major and complete."""
    convert = to_si(variable)
    return value if convert is None else convert(value)


def to_si(variable: Variable) -> Callable[[Any], Any] | None:
    """The conversion that `in_si` applies to values of a variable; None if they stay unchanged."""
    scalar: Callable[[Any], Any] | None = None
    if variable.choices is not None:
        scalar = partial(number_of, variable.choices)
    elif variable.unit is not None and variable.unit.startswith("rad"):
        scalar = either.radians
    if not variable.shape:
        return _or_named(variable, scalar) if _has_names(variable) else scalar
    # The number of beacons may vary: the declaration at hand may be for another number.
    beacons = variable.rows is not None and variable.rows.name == BEACONS.name
    rest = () if beacons else variable.starts

    def convert(value: Iterable[Any]) -> tuple[Any, ...]:
        elements = tuple(value) if scalar is None else tuple(map(scalar, value))
        return elements + rest[len(elements) :]

    return convert


def _has_names(variable: Variable) -> bool:
    """Whether the key of a parameter may hold a name in place of a number."""
    ours = OF_RECEIVERS.get(variable.key)
    return bool(variable.named or (ours is not None and ours.named))


def _or_named(
    variable: Variable, convert: Callable[[Any], Any] | None
) -> Callable[[Any], Any]:
    """A conversion that also takes names; for a name that only others have, the start value."""
    named, start = variable.named or {}, variable.starts[0]

    def converted(value: Any) -> Any:
        if isinstance(value, str):
            return named.get(value, start)
        return value if convert is None else convert(value)

    return converted


def default(component: Component, variable: Variable) -> Any:
    """Start value of a parameter, in the form and unit of a scenario file."""
    if variable.choices is not None:
        return variable.choices[int(variable.starts[0])]
    for name, value in (variable.named or {}).items():
        if value == variable.starts[0]:
            return name
    if variable.type != "Float64":
        return variable.starts if variable.shape else variable.starts[0]
    if is_list(component.variables, variable):
        return ()
    elements = tuple(in_file_units(variable, float(x)) for x in variable.starts)
    return elements if variable.shape else elements[0]


@cache
def starts(component: str, beacons: int) -> Mapping[str, Any]:
    """Default values of a component's parameters, for this number of beacons."""
    of = declared(component, beacons=beacons)
    return MappingProxyType({v.key: default(of, v) for v in of.of("parameter")})


@cache
def start_of(key: str) -> Any:
    """Value that our receivers use for a missing key. All that have the key use the same."""
    receiver = next(r for r in RECEIVERS.values() if key in {v.key for v in r.of("parameter")})
    return default(receiver, OF_RECEIVERS[key])
