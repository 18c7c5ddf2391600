"""The slot of a ping: it lasts until the packet, and its echoes, have passed the farthest diver.

With two-way ranges, it lasts from the request of the farthest diver to the end of the answer.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, hypot
from typing import Any

from sblcosim.models.acoustics.ranging import legs

_SPEED = 1500.0
_STEP = 1000
"""Slots are whole milliseconds."""


@dataclass(frozen=True)
class Slot:
    """The parts of a slot [s]; ``echo_s`` is the time from the direct arrival to the last echo.

    With two-way ranges, ``packet_s`` is that of request and answer, ``travel_s`` there and back.
    """

    packet_s: float
    travel_s: float
    echo_s: float
    guard_s: float
    turnaround_s: float = 0.0

    @property
    def needed_s(self) -> float:
        """The shortest slot in which nothing collides, a whole number of milliseconds."""
        total = self.packet_s + self.travel_s + self.echo_s + self.guard_s + self.turnaround_s
        return ceil(total * _STEP - 1e-6) / _STEP


def slot_of(acoustics: Any) -> Slot | None:
    """The slot that ``packet_duration_s``, ``guard_interval_s`` and ``reach_m`` need.

    The farthest echo is that of a beacon and a diver who are both at the surface, or both at the
    bottom.

    Parameters
    ----------
    acoustics
        Table of a scenario, complete or not.

    Returns
    -------
    Slot or None
        None without a duration of packets.
    """
    packet = acoustics.packet_duration_s
    if packet is None or acoustics.fmu is not None:
        return None
    reach, depth = acoustics.reach_m or 0.0, acoustics.water_depth_m or 0.0
    speed = min([acoustics.sound_speed_m_s or _SPEED, *(acoustics.profile_speed_m_s or ())])
    travel = reach / speed
    echo = hypot(reach, 2 * depth) / speed - travel
    guard, both = acoustics.guard_interval_s or 0.0, legs(acoustics.ranging)
    turnaround = acoustics.turnaround_s or 0.0 if both > 1 else 0.0
    return Slot(both * packet, both * travel, echo, guard, turnaround)
