"""Names and switches where numbers are expressions: branches on them become choices.

Settings are functions with a Python ``if`` on names (``acoustics.ranging``) and switches. Of a
table of expressions, each such function runs once for every name that it asks for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from typing import Any, ParamSpec, TypeVar, cast

from ..declaration import Variable
from .either import where
from .expression import number, symbol

_P = ParamSpec("_P")
_T = TypeVar("_T")


class TableOfInputs:
    """A table of a scenario with inputs in place of numbers.

    Parameters
    ----------
    name
        Name of the table.
    variables
        The parameters of its keys.
    names
        The names or switch positions that are known, by path: ``{"platform.motion": "sines"}``.
    filled
        Expressions of keys that need not be given, by path.
    beacons
        Number of beacons.
    """

    def __init__(
        self, name: str, variables: Iterable[Variable], names: Mapping[str, Any],
        filled: Mapping[str, Any], beacons: int,
    ) -> None:
        self._name, self._names, self._filled, self.beacons = name, names, filled, beacons
        self._variables = {v.key: v for v in variables}

    def __getattr__(self, key: str) -> Any:
        if key.startswith("_"):
            raise AttributeError(key)
        variable, path = self._variables[key], f"{self._name}.{key}"
        positions = names_of(variable)
        if positions:
            if path not in self._names:
                raise _AskedError(path, positions)
            return self._names[path]
        value = self._filled.get(path)
        if value is None:
            symbols = tuple(map(symbol, elements(path, variable)))
            value = symbols if variable.shape else symbols[0]
        self.__dict__[key] = value
        return value

    def named(self, path: str, name: Any) -> TableOfInputs:
        """The table with one more name known; any path may be given."""
        return TableOfInputs(
            self._name, self._variables.values(), {**self._names, path: name}, self._filled,
            self.beacons,
        )


class _AskedError(Exception):
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
        if not any(type(it) is TableOfInputs for it in args):
            return function(*args, **rest)
        return cast(_T, _run(function, args, rest))

    return run


def _run(function: Any, args: Any, rest: Any) -> Any:
    try:
        return function(*args, **rest)
    except _AskedError as asked:
        path, names = asked.args

    def of(name: Any) -> Any:
        known = [it.named(path, name) if type(it) is TableOfInputs else it for it in args]
        return _run(function, known, rest)

    *others, last = names
    merged = of(last)
    for name in reversed(others):
        merged = chosen(symbol(path) == names[name], of(name), merged)
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
