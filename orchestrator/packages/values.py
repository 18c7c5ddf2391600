"""The values of a package's parameters, as its FMUs take them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from fmpy.model_description import ModelVariable
from sblcosim.fmus.read.ports import Port
from sblcosim.models.declaration import Number

from ..errors import ConfigurationError, nearest, quoted
from ..simulation.plans.settings import checked
from ..simulation.system import Conversion, Value
from .documents import some
from .parameters import Parameter
from .parts import DescribedFmu
from .structure import End, Path, Structure
from .units import EXPONENTS, LinearUnit, Named, Quantity, chained
from .wiring import Wiring


@dataclass(frozen=True, slots=True)
class Given:
    """A value for a variable of an FMU, and its conversions on the way there."""

    parameter: Parameter
    through: tuple[Conversion, ...]


def values_of(
    structure: Structure, parts: Mapping[Path, DescribedFmu], wiring: Wiring
) -> tuple[dict[Path, dict[str, Given]], list[str]]:
    """The values of variables, by component, and warnings about those without an effect.

    Values bound to an outer system have priority over inner ones. Within one element the last value
    counts (SSP 2.0, section 5.2.3). Anything connected to a connector with a value has that value.

    Raises
    ------
    ConfigurationError
        A value cannot be converted to the required unit.
    """
    warnings: list[str] = []
    given: dict[End, tuple[str, Parameter]] = {}
    for path, element in reversed([*structure.system.walk()]):
        missing: dict[str, None] = {}
        for parameter in element.parameters:
            label = _label(path, [parameter.name], path in parts)
            ends = [*wiring.named(path, parameter.name)]
            close = "" if ends else nearest(parameter.name, wiring.names(path))
            if close:
                warnings.append(f"{label} has no effect: there is no such variable{close}")
            elif not ends:
                missing[parameter.name] = None
            given |= dict.fromkeys(ends, (label, parameter))
        if missing:
            what = "has no effect: there is no such variable" if len(missing) == 1 else (
                "have no effect: there are no such variables"
            )
            warnings.append(f"{_label(path, [*missing], path in parts)} {what}")
    values: dict[Path, dict[str, Given]] = {path: {} for path in parts}
    for end in sorted(given, key=wiring.depth, reverse=True):
        label, parameter = given[end]
        unit = parameter.unit
        if unit is not None and unit.unit is None and parameter.converts:
            _check_same(label, parameter, wiring.unit(end), structure)
        reached = [*wiring.reached(end, _at(parameter, end, wiring))]
        if not reached:
            warnings.append(f"{label} has no effect: its connector leads to no component")
        for (owner, variable), there in reached:
            values[owner][variable] = Given(parameter, there.through)
            if not there.certain and wiring.unit((owner, variable)) is None:
                warnings += _doubts(f"{'.'.join(owner)}.{variable}", parameter.unit)
    return values, warnings


def _label(path: Path, names: Sequence[str], of_fmu: bool) -> str:
    """Parameters that an element is bound to, for messages."""
    what, where = f"parameter{'s' if len(names) > 1 else ''}", ".".join(path)
    listed = some([*map(quoted, names)])
    return f"{where}: {what} {listed}" if of_fmu else (
        f"{what} of {where or 'the system'}: {listed}"
    )


def _check_same(
    label: str, parameter: Parameter, target: Named | None, structure: Structure
) -> None:
    """Refuse an undefined unit, unless its name is that of the variable's unit."""
    assert parameter.unit is not None
    name = parameter.unit.name
    if target is None or target.name != name:
        raise ConfigurationError(
            f"{parameter.origin}{label}: must have a unit that is defined, got {quoted(name)}"
            f"{nearest(name, structure.units)}"
        )


def _at(parameter: Parameter, end: tuple[Path, str], wiring: Wiring) -> Quantity:
    """A value at the connector or variable to which it is given."""
    target = wiring.unit(end)
    given = Quantity.of(parameter.unit)
    try:
        there = given.to(target) if parameter.converts else given.unchanged(target)
    except ValueError:
        assert target is not None
        assert parameter.unit is not None
        known = target.unit is not None and parameter.unit.unit is not None
        got = f"{'one of another quantity, ' if known else ''}{quoted(parameter.unit.name)}"
        raise ConfigurationError(
            f"{parameter.origin}{'.'.join((*end[0], end[1]))}: must be given in a unit that can "
            f"become {target.name}, got {got}"
        ) from None
    by = parameter.transformation
    return there if by is None else there.transformed(by)


def _doubts(where: str, unit: Named | None) -> Iterator[str]:
    """The remark on a value with a unit for a variable without one."""
    plain = LinearUnit((0,) * len(EXPONENTS), 1.0, 0.0)
    if unit is not None and unit.unit != plain:
        yield (
            f"{where}: its value is given in {unit.name} and taken as it is, as neither the "
            "connector nor the variable has a unit"
        )


def filled(
    part: DescribedFmu, values: Mapping[str, Given]
) -> tuple[dict[str, Value], dict[str, Value], dict[str, Value], dict[str, str]]:
    """Values of parameters, of inputs, of others at the start, and texts, by port.

    Elements without a value keep their start value.

    Raises
    ------
    ConfigurationError
        A value does not fit its variable, or it cannot be set.
    """
    given: dict[str, dict[int, Number]] = {}
    texts: dict[str, str] = {}
    for variable, value in values.items():
        name = part.label
        if variable not in part.places:
            raise ConfigurationError(
                f"{name}.{variable}: must be a parameter or an input to be set, got the time"
            )
        place = part.places[variable]
        if place.port.causality not in ("parameter", "input") and not part.may_start(variable):
            raise ConfigurationError(
                f"{name}.{variable}: must be a parameter or an input to be set, got one of "
                f"causality {place.port.causality}"
            )
        if place.port.type == "String":
            texts[place.name] = value.parameter.text
            continue
        before = f"{value.parameter.origin}{name}."
        numbers = _numbers(before + variable, part, variable, value)
        first = place.element or 0
        size = place.port.size if place.element is None else 1
        if len(numbers) != size:
            raise ConfigurationError(
                f"{before}{variable}: must have {size} values, got {len(numbers)}"
            )
        for i, number in enumerate(numbers, first):
            checked(before + place.port.name, place.port, i, number)
        given.setdefault(place.port.name, {}).update(enumerate(numbers, first))
    kinds: dict[str, dict[str, Value]] = {"parameter": {}, "input": {}, "": {}}
    for key, elements in given.items():
        port = part.fmu.ports[key]
        kind = port.causality if port.causality in kinds else ""
        kinds[kind][key] = _whole(f"{part.label}.{key}", port, elements)
    return kinds["parameter"], kinds["input"], kinds[""], texts


def _whole(where: str, port: Port, given: Mapping[int, Number]) -> Value:
    if len(given) < port.size and port.start is None:
        got = f"as the FMU gives none, got {len(given)}"
        raise ConfigurationError(f"{where}: must have values of all {port.size} elements, {got}")
    start = port.start or ()
    values = [given[i] if i in given else start[i] for i in range(port.size)]
    return values if port.shape else values[0]


def _numbers(where: str, part: DescribedFmu, variable: str, value: Given) -> list[Number]:
    """A value in the type and the unit of a variable."""
    port = part.places[variable].port
    if value.parameter.type == "Enumeration":
        return [_item(where, part.variables[variable], value.parameter.text)]
    numbers = [_number(where, port, word) for word in value.parameter.text.split()]
    steps = chained(value.through).steps
    if steps and not port.type.startswith("Float"):
        raise ConfigurationError(f"{where}: must be a real number to be converted, got {port.type}")
    for step in steps:
        numbers = [step.factor * number + step.offset for number in numbers]
    return numbers


def _number(where: str, port: Port, word: str) -> Number:
    real = port.type.startswith("Float")
    try:
        if port.type == "Boolean":
            return {"true": True, "1": True, "false": False, "0": False}[word]
        return float(word) if real else int(word)
    except (KeyError, ValueError):
        must = "true or false" if port.type == "Boolean" else "a number"
        must = must if real or port.type == "Boolean" else "a whole number"
        raise ConfigurationError(f"{where}: must be {must}, got {quoted(word)}") from None


def _item(where: str, variable: ModelVariable, text: str) -> int:
    """The number of an item of an enumeration."""
    items = {item.name: item.value for item in getattr(variable.declaredType, "items", ())}
    if text not in items:
        raise ConfigurationError(
            f"{where}: must be {', '.join(items) or 'an item of an enumeration'}, got "
            f"{quoted(text)}{nearest(text, items)}"
        )
    return int(items[text])
