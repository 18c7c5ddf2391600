"""Values as people type them: lists without brackets, numbers with units, names in any case."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from ..errors import ConfigurationError, nearest, quoted
from ..words.lists import listed
from .units import PARTS, spellings

_TOKEN = re.compile(r"[\[\]();]|[^\s,\[\]();]+")
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?", re.IGNORECASE)
_DECIMAL_COMMA = re.compile(r"(?<![^\s;])[+-]?\d+,\d+[^\s\d,;.]*,?(?![^\s;])")
_MOST_DIGITS = 15
"""Longest whole number that a float holds."""


def number(text: str, unit: str = "") -> float:
    """One number, with its unit or without.

    Raises
    ------
    ConfigurationError
        The text is anything else. The message has no place, as for all functions of this module.
    """
    rows = _rows(text, unit, "a number")
    if len(rows) != 1 or len(rows[0]) != 1:
        raise _not("a number", unit, text)
    return rows[0][0]


def numbers(text: str, unit: str = "", what: str = "numbers") -> list[float]:
    """Numbers in sequence: ``0.5, 0.5, 1``, ``[0.5, 0.5, 1]`` or ``0.5 0.5 1 m``.

    Parameters
    ----------
    what
        What must be typed, for the message.
    """
    return [value for row in _rows(text, unit, what) for value in row]


def rows(text: str, unit: str = "") -> list[list[float]] | list[float]:
    """Numbers row by row, ``0 0 5; 10 0 5`` or ``[[0, 0, 5], [10, 0, 5]]``, or in sequence."""
    found = _rows(text, unit, "numbers")
    return found[0] if len(found) == 1 else found


def are_numbers(text: str) -> bool:
    """Whether a text begins like numbers, and not like a name."""
    return re.match(r"[\s\[(]*[+\-−]?\.?\d", text) is not None


def name(
    text: str, names: Iterable[str], also: Mapping[str, str] | None = None, others: str = ""
) -> str:
    """One of some names: in any case, with spaces or hyphens, or only as much as tells it apart.

    Parameters
    ----------
    also
        Other words for some of the names.
    others
        What else may be typed, for the message.
    """
    known = {_plain(it): it for it in names}
    synonyms = {_plain(word): it for word, it in (also or {}).items()}
    word = _plain(text)
    if word in known or word in synonyms:
        return (known | synonyms)[word]
    begun = [it for plain, it in known.items() if word and plain.startswith(word)]
    if len(begun) == 1:
        return begun[0]
    close = nearest(word, [*known.values(), *(also or ())])
    choices = [*known.values()]
    must = f"{', '.join(choices)}, or {others}" if others else listed(choices, "or")
    raise ConfigurationError(f"must be {must}, got {quoted(text)}{close}")


def _plain(word: str) -> str:
    return re.sub(r"[\s_-]+", "_", word.strip(" \"'").casefold())


def _rows(text: str, unit: str, what: str) -> list[list[float]]:
    """Numbers by rows, which brackets and semicolons separate.

    A unit is that of the number before it, and of all numbers before that have none.
    """
    plain = text.strip().replace("−", "-")
    if _DECIMAL_COMMA.search(plain) and not plain.startswith("["):
        raise ConfigurationError(
            f"must have a point before decimals, and a space after each comma, got {quoted(text)}"
        )
    found: list[list[float]] = [[]]
    parts = PARTS.get(unit, {})
    bare: list[tuple[list[float], int]] = []  # places of numbers whose unit may still come
    mixed = False
    for token in _TOKEN.findall(plain):
        if token in "[]();":
            found.append([])
            continue
        digits = _NUMBER.match(token)
        rest = (token[digits.end() :] if digits else token).casefold()
        if rest and rest not in parts and rest not in spellings(unit):
            raise _not(what, unit, text)
        if digits:
            whole = digits[0].lstrip("+-").isdecimal() and len(digits[0]) <= _MOST_DIGITS
            bare.append((found[-1], len(found[-1])))
            found[-1].append(int(digits[0]) if whole else float(digits[0]))
        if rest in parts:
            mixed = True
            for row, place in bare:
                row[place] /= parts[rest]
        if rest:
            bare = []
    if mixed and bare:
        raise ConfigurationError(f"must have the unit of each number, got {quoted(text)}")
    kept = [row for row in found if row]
    if not kept or re.search(r",\s*,", plain):
        raise _not(what, unit, text)
    return kept


def _not(what: str, unit: str, text: str) -> ConfigurationError:
    """The error of a text that is no such number."""
    of = f" in {unit}" if unit else ""
    return ConfigurationError(f"must be {what}{of}, got {quoted(text)}")
