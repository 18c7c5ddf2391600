"""What the points of a study share, so that it is worked out once."""

from __future__ import annotations

import marshal
from collections.abc import Callable, Hashable
from typing import Any, TypeVar

from sblcosim.fmus import unchanged

T = TypeVar("T")
_MOST = 1024
_PLAIN = {bool, int, float, str, type(None)}


def alike(what: str, key: Hashable, make: Callable[[], T], *kept: object) -> T:
    """What was made of the same key, while files are assumed unchanged; else it is made.

    Parameters
    ----------
    kept
        Objects whose ids are in the key.
    """
    known: dict[Hashable, tuple[T, tuple[object, ...]]] = unchanged.once(what, dict)
    found = known.get(key)
    if found is None:
        if len(known) >= _MOST:
            known.clear()
        found = known[key] = (make(), kept)
    return found[0]


def bits_of(value: Any) -> bytes | None:
    """What tells apart plain values, and arrays of them, that differ in a bit or in type.

    None for values that are not plain.
    """
    return marshal.dumps(value, 2) if _is_plain(value) else None  # version 2: without references


def _is_plain(value: Any) -> bool:
    kind = type(value)
    return kind in _PLAIN or (kind in (tuple, list) and all(map(_is_plain, value)))
