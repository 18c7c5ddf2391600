"""Ways to range, one row each. Keys, equations, bounds and documents are derived from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..numbered import in_order


@dataclass(frozen=True)
class Ranging:
    """How a range is measured.

    Attributes
    ----------
    number
        Its value in the FMU; never reused.
    words
        What happens, as text for the description of the key.
    legs
        Number of times that sound travels between diver and beacon for a range; all must arrive.
    """

    number: int
    words: str
    legs: int


RANGINGS: Mapping[str, Ranging] = in_order("ways to range", {
    "one_way": Ranging(1, "beacons ping, and the diver has their clock", 1),
    "two_way": Ranging(2, "the diver asks, and a beacon answers", 2),
})
RANGING: Mapping[int, str] = {it.number: name for name, it in RANGINGS.items()}


def legs(name: str | None) -> int:
    """`Ranging.legs` of a way to range; None: that of the default."""
    return RANGINGS[name or "one_way"].legs
