"""What the points of a study share, so that it is worked out once."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import TypeVar

from sblcosim.fmus import unchanged

T = TypeVar("T")
_MOST = 1024


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
