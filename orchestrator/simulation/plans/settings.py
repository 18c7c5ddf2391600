"""Values of parameters and inputs, checked against the variables of a component."""

from __future__ import annotations

import marshal
import math
from collections.abc import Iterator, Mapping
from itertools import count
from typing import Any

import numpy as np
from sblcosim.fmus.host.instances import DTYPES
from sblcosim.fmus.read.ports import Port
from sblcosim.models.declaration import Number

from ...errors import ConfigurationError, nearest
from ..system import ComponentSpec
from .alike import alike
from .plan import Setting

_LONGEST = 512
_PLAIN = {bool, int, float}


def settings_of(name: str, spec: ComponentSpec, ports: Mapping[str, Port]) -> tuple[Setting, ...]:
    """The checked settings of a component.

    Raises
    ------
    ConfigurationError
        There is no such variable, or a value does not fit it.
    """
    return alike("specs", (id(spec), id(ports)), lambda: _made(name, spec, ports), spec, ports)


def _made(name: str, spec: ComponentSpec, ports: Mapping[str, Port]) -> tuple[Setting, ...]:
    if spec.like is not None:
        to = spec.like.to
        try:
            known = settings_of(name, to, ports)
        except ConfigurationError:
            pass  # it is not that component's turn to be refused
        else:
            places = alike("places", id(to), lambda: dict(zip(to.parameters, count())), to)
            settings = list(known)
            for key in sorted(spec.like.but, key=places.__getitem__):
                settings[places[key]] = _shared(name, key, spec.parameters[key], ports)
            return tuple(settings)
    settings = [_setting(name, key, value, ports) for key, value in spec.parameters.items()]
    for key, value in spec.starts.items():
        port = ports.get(key)
        if port is None or port.type not in DTYPES:
            got = "an unknown name" if port is None else with_article(port.type)
            raise ConfigurationError(
                f"{name}.{key}: must be a number or a switch of {name}, got {got}"
                f"{nearest(key, ports)}"
            )
        settings.append(Setting(port, _values(f"{name}.{key}", port, value)))
    for key, value in spec.inputs.items():
        port = ports.get(key)
        if port is None or port.causality != "input" or port.type not in DTYPES:
            names = [p.name for p in ports.values() if p.causality == "input"]
            got = with_article(port.causality) if port else "an unknown name"
            raise ConfigurationError(
                f"{name}.{key}: must be an input of {name} that is a number or a switch, got "
                f"{got}{nearest(key, names)}"
            )
        settings.append(Setting(port, _values(f"{name}.{key}", port, value)))
    return tuple(settings)


def _shared(name: str, key: str, value: Any, ports: Mapping[str, Port]) -> Setting:
    """As `_setting`; shared by the points of a study."""
    fact = _fact(key, value)
    if fact is None:
        return _setting(name, key, value, ports)
    return alike("settings", (id(ports), fact), lambda: _setting(name, key, value, ports), ports)


def texts_of(
    name: str, spec: ComponentSpec, ports: Mapping[str, Port]
) -> tuple[tuple[Port, str], ...]:
    """The checked texts of a component.

    Raises
    ------
    ConfigurationError
        There is no such variable, or it is not a single text.
    """
    for key in spec.texts:
        port = ports.get(key)
        if port is None or port.type != "String" or port.shape or not port.references:
            got = "an unknown name" if port is None else f"{port.type} of {port.size}"
            raise ConfigurationError(f"{name}.{key}: must be a single text of an FMU, got {got}")
    return tuple((ports[key], text) for key, text in spec.texts.items())


def facts_of(spec: ComponentSpec) -> Mapping[str, bytes | None]:
    """A key of all parameter values, by parameter: different if they differ in a bit or in type.

    None for values that are not plain. Parameters with different names have different keys.
    """
    like = spec.like
    if like is not None:
        changed = {key: _fact(key, spec.parameters[key]) for key in like.but}
        return {**facts_of(like.to), **changed}
    return alike(
        "facts", id(spec), lambda: {k: _fact(k, v) for k, v in spec.parameters.items()}, spec
    )


def _fact(key: str, value: Any) -> bytes | None:
    if type(value) in _PLAIN or _are_plain(value):
        return marshal.dumps((key, value), 2)  # version 2: without references
    return None


def _are_plain(value: Any) -> bool:
    return (
        type(value) is tuple and len(value) <= _LONGEST and _PLAIN.issuperset(map(type, value))
    )


def _setting(name: str, key: str, value: Any, ports: Mapping[str, Port]) -> Setting:
    """A parameter's setting, checked."""
    port, where = ports.get(key), f"{name}.{key}"
    if port is None:
        names = [p.name for p in ports.values() if p.causality == "parameter"]
        raise ConfigurationError(
            f"{where}: must be a parameter of {name}, got an unknown name{nearest(key, names)}"
        )
    if port.causality != "parameter":
        got = with_article(port.causality)
        raise ConfigurationError(f"{where}: must be a parameter, got {got}")
    if port.type not in DTYPES:
        got = with_article(port.type)
        raise ConfigurationError(f"{where}: must be a number or a switch, got {got}")
    return Setting(port, _values(where, port, value))


def _values(where: str, port: Port, value: Any) -> tuple[Number, ...]:
    """The elements of a value, checked against the variable's shape, type and bounds."""
    elements = list(_flat(value))
    if len(elements) != port.size or (not port.shape and isinstance(value, (list, tuple))):
        must = f"{port.size} numbers" if port.shape else "one number"
        raise ConfigurationError(f"{where}: must be {must}, got {len(elements)}")
    return tuple(checked(where, port, i, element) for i, element in enumerate(elements))


def _subscript(index: tuple[int, ...]) -> str:
    return f"[{','.join(str(i + 1) for i in index)}]" if index else ""


def _flat(value: Any) -> Iterator[Any]:
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        for element in value:
            yield from _flat(element)
    else:
        yield value


def checked(name: str, port: Port, number: int, value: Any) -> Number:
    """An element of a value, checked against the variable's type and bounds."""
    problem = _problem(port, value, port.min[number], port.max[number])
    if problem is not None:
        index = tuple(int(i) for i in np.unravel_index(number, port.shape)) if port.shape else ()
        raise ConfigurationError(f"{name}{_subscript(index)}: must be {problem}")
    return float(value) if port.type.startswith("Float") else value


def _problem(port: Port, value: Any, low: float, high: float) -> str | None:
    """The problem of an invalid value, as the end of 'must be'; None if it is valid."""
    if port.type == "Boolean":
        if not isinstance(value, bool):
            return f"true or false, got {value!r}"
        return None
    real = port.type.startswith("Float")
    if isinstance(value, bool) or not isinstance(value, (int, float) if real else int):
        must = "a number" if real else "a whole number"
        return f"{must}, got {value!r}"
    if not math.isfinite(value):
        return f"finite, got {value!r}"
    if not real:
        limits = np.iinfo(DTYPES[port.type])  # type: ignore[type-var]
        low, high = max(low, limits.min), min(high, limits.max)
    unit = f" {port.unit}" if port.unit else ""
    if value < low:
        return f"at least {low:.10g}{unit}, got {value!r}{unit}"
    if value > high:
        return f"at most {high:.10g}{unit}, got {value!r}{unit}"
    return None


def with_article(noun: str) -> str:
    """A noun with its article."""
    return f"{'an' if noun[0] in 'aeiouAEIOU' else 'a'} {noun}"
