"""Tables of numbered alternatives, and their wording."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Protocol, TypeVar

from .declaration import DeclarationError


class Numbered(Protocol):
    """An alternative with a number."""

    @property
    def number(self) -> int: ...


_N = TypeVar("_N", bound=Numbered)


def in_order(what: str, them: Mapping[str, _N]) -> Mapping[str, _N]:
    """Alternatives in the order of their numbers.

    Raises
    ------
    DeclarationError
        Two alternatives have the same number.
    """
    ordered = dict(sorted(them.items(), key=lambda item: item[1].number))
    first: dict[int, str] = {}
    for name, one in ordered.items():
        other = first.setdefault(one.number, name)
        if other != name:
            raise DeclarationError(
                f"{what}: each must have a number of its own, got {one.number} for {other} and "
                f"{name}; {max(it.number for it in ordered.values()) + 1} is free"
            )
    return ordered


def alternatives(words: Iterable[str]) -> str:
    """The alternatives as a phrase: ``"one, two, or three"``."""
    *first, last = words
    return f"{', '.join(first)}, or {last}" if first else last
