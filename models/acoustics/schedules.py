"""When beacons ping: a row for each schedule. Keys, equations, bounds and documents follow."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from ..numbered import in_order


@dataclass(frozen=True)
class Schedule:
    """Which beacons ping in a slot: some that follow each other in ``slot_order``.

    Attributes
    ----------
    number
        Its value in the FMU; never reused.
    words
        What pings in a slot, for the description of the key.
    together
        How many beacons ping at once, of all: from 1 to all.
    first
        Place in the order of the first of them, counted round, by the number of the slot; both
        start at 0. Of a number, an array or a symbol. None: the next place in each slot.
    ordered
        Whether the order has an effect.
    """

    number: int
    words: str
    together: Callable[[int], int]
    first: Callable[[Any], Any] | None = None
    ordered: bool = True

    def place(self, slot: Any) -> Any:
        """The place of the first beacon of a slot, before it is counted round."""
        return slot if self.first is None else self.first(slot)


SCHEDULES: Mapping[str, Schedule] = in_order("schedules", {
    "round_robin": Schedule(1, "one beacon pings in each slot", lambda n: 1),
    "simultaneous": Schedule(2, "all", lambda n: n, ordered=False),
})
SCHEDULE: Mapping[int, str] = {it.number: name for name, it in SCHEDULES.items()}
ORDERED = tuple(name for name, it in SCHEDULES.items() if it.ordered)
"""Names of those on which ``slot_order`` has an effect."""
