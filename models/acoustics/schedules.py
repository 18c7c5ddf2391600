"""Ping schedules, one row each. Keys, equations, bounds and documents are derived from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from ..numbered import in_order
from .ranging import INVERTED


@dataclass(frozen=True)
class Schedule:
    """Which beacons ping in a slot: a run of consecutive places in ``slot_order``.

    Attributes
    ----------
    number
        Its value in the FMU; never reused.
    words
        What pings in a slot, as text for the description of the key.
    together
        ``together(beacons)``: number of beacons that ping at once, from 1 to all of them.
    first
        ``first(slot)``: place of the first of them in the order, modulo the number of beacons;
        slots and places start at 0. The slot may be a number, an array or a symbol. None: each slot
        continues with the next place.
    ordered
        Whether the order has an effect.
    """

    number: int
    words: str
    together: Callable[[int], int]
    first: Callable[[Any], Any] | None = None
    ordered: bool = True

    def place(self, slot: Any) -> Any:
        """Place of the first beacon of a slot, before the modulo."""
        return slot if self.first is None else self.first(slot)


SCHEDULES: Mapping[str, Schedule] = in_order("schedules", {
    "round_robin": Schedule(1, "one beacon pings in each slot", lambda n: 1),
    "simultaneous": Schedule(2, "all", lambda n: n, ordered=False),
})
SCHEDULE: Mapping[int, str] = {it.number: name for name, it in SCHEDULES.items()}
ORDERED = tuple(name for name, it in SCHEDULES.items() if it.ordered)
"""Names of the schedules on which ``slot_order`` has an effect."""


def schedule_of(acoustics: Any) -> Schedule:
    """The schedule of a table ``[acoustics]``. A ping of the diver comes to all beacons at once."""
    inverted = acoustics.ranging in INVERTED
    return SCHEDULES["simultaneous" if inverted else acoustics.schedule]
