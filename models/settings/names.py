"""Names and switches where numbers are expressions: branches on them become choices.

Settings are functions with a Python ``if`` on names (``acoustics.ranging``) and switches. Of a
table of expressions, each such function runs once for every name that it asks for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from typing import Any, ParamSpec, TypeVar

from ..declaration import Variable
from .either import where
from .expression import Expression, number, symbol

_P = ParamSpec("_P")
_T = TypeVar("_T")


class Table:
    """A table of a scenario with inputs in place of numbers.

    Parameters
    ----------
    name
        Name of the table.
    variables
        The parameters of its keys.
    names
        The names or switch positions that are known, by path: ``{"platform.motion": "sines"}``.
    beacons
        Number of beacons.
    """

    def __init__(
        self, name: str, variables: Iterable[Variable], names: Mapping[str, Any], beacons: int = 0
    ) -> None:
        self._name, self._names, self.beacons = name, names, beacons
        self._variables = {v.key: v for v in variables}

    def __getattr__(self, key: str) -> Any:
        if key.startswith("_"):
            raise AttributeError(key)
        variable, path = self._variables[key], f"{self._name}.{key}"
        positions = names_of(variable)
        if positions:
            if path not in self._names:
                raise _Asked(path, positions)
            return self._names[path]
        symbols = tuple(map(symbol, elements(path, variable)))
        value = self.__dict__[key] = symbols if variable.shape else symbols[0]
        return value

    def named(self, path: str, name: Any) -> Table:
        """The table with one more name known; any path may be given."""
        names = {**self._names, path: name}
        return Table(self._name, self._variables.values(), names, self.beacons)


class _Asked(Exception):
    """A name is asked for that is not known: its path, and all names with their numbers."""


def elements(path: str, variable: Variable) -> tuple[str, ...]:
    """Names of the elements of a key: ``("target.center_m[1]", "target.center_m[2]")``."""
    return tuple(path + it.removeprefix(variable.name) for it in variable.elements)


def names_of(variable: Variable) -> dict[Any, float]:
    """The names or switch positions that a key may have, and their numbers; none of a number."""
    if variable.type == "Boolean":
        return {True: 1.0, False: 0.0}
    return {name: float(value) for value, name in (variable.choices or {}).items()}


def branching(function: Callable[_P, _T]) -> Callable[_P, _T]:
    """A setting function that may branch on names, in tables of numbers or of expressions."""

    @wraps(function)
    def run(*args: _P.args, **rest: _P.kwargs) -> _T:
        if not any(type(it) is Table for it in args):
            return function(*args, **rest)
        return _run(function, args, rest)

    return run


def _run(function: Any, args: Any, rest: Any) -> Any:
    try:
        return function(*args, **rest)
    except _Asked as asked:
        path, names = asked.args
    found = {
        name: _run(function, [it.named(path, name) if type(it) is Table else it for it in args],
                   rest)
        for name in names
    }
    *others, last = names
    merged = found[last]
    for name in reversed(others):
        merged = chosen(symbol(path) == names[name], found[name], merged)
    return merged


def chosen(condition: Any, value: Any, otherwise: Any) -> Any:
    """As `where`, element by element of mappings and sequences of the same form."""
    if isinstance(value, Mapping):
        if value.keys() != otherwise.keys():
            raise ValueError(f"must have the same keys, got {[*value]} and {[*otherwise]}")
        return {key: chosen(condition, value[key], otherwise[key]) for key in value}
    if isinstance(value, list | tuple):
        return tuple(chosen(condition, a, b) for a, b in zip(value, otherwise, strict=True))
    if isinstance(value, str):
        raise TypeError(f"a name must be known, got {value!r} or {otherwise!r}")
    return where(condition, number(value), number(otherwise))
