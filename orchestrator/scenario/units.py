"""Units of keys, which are their suffixes, as people read and type them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from sblcosim.models.declaration import UNITS

SYMBOLS: Mapping[str, str] = {
    unit.suffix: unit.name.replace("rad", "°").replace("2", "²").replace("s3", "s³")
    for unit in UNITS.values()
}
"""Units as they are written, by suffix: ``m_s`` is m/s. Angles are in degrees."""
_LONGEST_FIRST = sorted(SYMBOLS, key=len, reverse=True)


def unit_of(key: str) -> str:
    """The unit of a key as it is written; empty if it has none."""
    return next((SYMBOLS[end] for end in _LONGEST_FIRST if key.endswith(f"_{end}")), "")


_WORDS: Mapping[str, Sequence[str]] = {
    "m": ("metre", "metres", "meter", "meters"), "s": ("second", "seconds", "sec"),
    "°": ("degree", "degrees"),
}  # fmt: skip


PARTS: Mapping[str, Mapping[str, int]] = {"m": {"cm": 100, "mm": 1000}}
"""Smaller units that people may type for a unit, and how many of them it has."""


def spellings(unit: str) -> frozenset[str]:
    """How people may type a unit, in lower case: as it is written, like the suffix, or in words."""
    plain = unit.replace("²", "2").replace("³", "3")
    suffixes = (end for end, symbol in SYMBOLS.items() if symbol == unit)
    typed = (unit, plain, *suffixes, *_WORDS.get(unit, ()))
    return frozenset(text.casefold() for text in typed if text)
