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
    from_diver
        Whether the sound starts at the diver and ends at the beacons, which all hear one ping.
    """

    number: int
    words: str
    legs: int
    from_diver: bool = False


RANGINGS: Mapping[str, Ranging] = in_order("ways to range", {
    "one_way": Ranging(1, "beacons ping and the diver has their clock", 1),
    "two_way": Ranging(2, "the diver asks and a beacon answers", 2),
    "inverted": Ranging(3, "the diver pings and all beacons listen", 1, from_diver=True),
})
RANGING: Mapping[int, str] = {it.number: name for name, it in RANGINGS.items()}
INVERTED = tuple(name for name, it in RANGINGS.items() if it.from_diver)
"""Names of the ways in which the diver's ping is heard by all beacons."""


def legs(name: str | None) -> int:
    """`Ranging.legs` of a way to range; None: that of the default."""
    return RANGINGS[name or "one_way"].legs
