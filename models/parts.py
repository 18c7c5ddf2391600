"""The parts of a declaration: each must be of the type that its class or function states."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from types import UnionType
from typing import Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

_LATER: Mapping[str, Any] = {"Equations": object}
"""Types that only type checkers import: a declaration makes these objects later."""
_MOST = 80
"""Characters of a wrong value in a message."""


class DeclarationError(ValueError):
    """A declaration contradicts itself or another one. The message is for who has written it."""


def check_parts(declaration: Any) -> None:
    """Check the fields of a declaration's dataclass; the default of a field fits.

    Raises
    ------
    DeclarationError
        It names the field.
    """
    kind: Any = type(declaration)
    for part in _parts(kind):
        value = getattr(declaration, part.name)
        if value is not part.default and not part.fits(value):
            raise part.wrong(getattr(declaration, "name", kind.__name__), value)


def check_arguments(where: object, function: Callable[..., Any], given: Mapping[str, Any]) -> None:
    """Check the arguments of a function that makes a declaration.

    Raises
    ------
    DeclarationError
        It names the argument.
    """
    for part in _parts(function):
        if not part.fits(given[part.name]):
            raise part.wrong(where, given[part.name])


_Fits = Callable[[object], bool]


class _Part(NamedTuple):
    """A field or an argument: its type in words, and whether a value is of this type."""

    name: str
    default: object
    kind: str
    fits: _Fits

    def wrong(self, where: object, value: object) -> DeclarationError:
        said = repr(value)
        short = said if len(said) <= _MOST else f"{said[:_MOST]}…"
        return DeclarationError(f"{where}: {self.name} must be {self.kind}, got {short}")


@lru_cache
def _parts(of: Callable[..., Any]) -> list[_Part]:
    """The parts of a dataclass or a function."""
    fields = getattr(of, "__dataclass_fields__", {})
    hints = get_type_hints(of, vars(sys.modules[of.__module__]), {**_LATER})
    return [
        _Part(name, getattr(fields.get(name), "default", None),
              _words(hint, str(of.__annotations__[name])), _fits(hint))
        for name, hint in hints.items() if name != "return"
    ]  # fmt: skip


def _words(hint: Any, annotation: str) -> str:
    """A type in words: alternatives are listed, others are as annotated."""
    for one in (hint, *get_args(hint)):
        if get_origin(one) is Literal and "Literal" not in annotation:
            none = ", or None" if one is not hint else ""
            return f"one of {', '.join(map(repr, get_args(one)))}{none}"
    return annotation


def _fits(hint: Any) -> _Fits:
    """Whether a value is of a type."""
    kind, inner = get_origin(hint), get_args(hint)
    if kind in (Union, UnionType):
        some = [_fits(one) for one in inner]
        return lambda value: any(fits(value) for fits in some)
    if kind is Literal:
        return lambda value: isinstance(value, str) and value in inner
    if kind is tuple:
        return _elements(inner)
    if kind is not None and issubclass(kind, Mapping):
        key, content = map(_fits, inner)
        return lambda value: isinstance(value, Mapping) and all(
            key(k) and content(v) for k, v in value.items()
        )
    if kind is not None and issubclass(kind, Sequence):
        one_of = _fits(inner[0])
        return lambda value: isinstance(value, Sequence) and all(map(one_of, value))
    if kind is not None:  # a function
        return callable
    return _plain(hint)


def _elements(inner: tuple[Any, ...]) -> _Fits:
    """Whether a value is a tuple of such elements: of one type, or of a type each."""
    if inner[-1] is Ellipsis:
        each = _fits(inner[0])
        return lambda value: isinstance(value, tuple) and all(map(each, value))
    every = [_fits(one) for one in inner]
    return lambda value: (
        isinstance(value, tuple) and len(value) == len(every)
        and all(fits(one) for fits, one in zip(every, value, strict=True))
    )


def _plain(hint: Any) -> _Fits:
    """Whether a value is of a class; an int is a float, and no bool is a number."""
    if hint in (int, float):
        kinds = (int, float) if hint is float else int
        return lambda value: isinstance(value, kinds) and not isinstance(value, bool)
    return lambda value: isinstance(value, hint)
