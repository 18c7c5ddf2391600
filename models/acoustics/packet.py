"""Size of a packet: bits needed for its contents, and the resolution that a given size allows."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, log2

from .contents import CONTENTS

HORIZONTAL_SPAN, VERTICAL_SPAN = 81.92, 1.28
"""Span of the coordinates, about points that both sides know [m]."""
TURN, TILT_SPAN = 360.0, 32.0
"""Spans of heading, and of roll and pitch [degrees]."""
SLOT, GPS_CLASS, CHECKSUM, NUMBER = 6, 3, 8, 64
"""Bits of the slot counter, the GPS class, the checksum, and a number that is not rounded."""
_RESOLUTION, _ANGLE = 0.01, 0.125
_FINER, _COARSER = 3, 7
"""How often both resolutions may be halved or doubled."""


def fields(
    content: str, resolution: float, angle_resolution: float, beacons: int = 4
) -> dict[str, int]:
    """Bits of each field of a packet.

    Parameters
    ----------
    content
        Value of the parameter ``packet_content``.
    resolution, angle_resolution
        Resolutions of positions [m] and angles [degrees]; 0: not rounded.
    beacons
        Number of beacons of the platform.
    """
    n = CONTENTS[content].places(beacons)
    angles = has_angles(content)
    return {
        "slot": SLOT,
        "beacon": ceil(log2(beacons)),
        "north, east": 2 * n * _bits(HORIZONTAL_SPAN, resolution),
        "down": n * _bits(VERTICAL_SPAN, resolution),
        "heading": angles * _bits(TURN, angle_resolution),
        "roll, pitch": 2 * angles * _bits(TILT_SPAN, angle_resolution),
        "GPS class": GPS_CLASS,
        "checksum": CHECKSUM,
    }


def packet_bits(
    content: str, resolution: float, angle_resolution: float, beacons: int = 4
) -> int:
    """Bits of a packet; same parameters as `fields`."""
    return sum(fields(content, resolution, angle_resolution, beacons).values())


def has_angles(content: str) -> bool:
    """Whether packets with this content hold heading, roll and pitch."""
    return CONTENTS[content].pose


def finest(
    content: str, bits: int, beacons: int = 4,
    resolution: float | None = None, angle_resolution: float | None = None,
) -> tuple[float, float] | None:
    """Finest resolutions of positions [m] and angles [degrees] that fit into the bits, or None.

    Candidates are 1 cm and 0.125°, alternately doubled or halved, starting with the position. They
    range from 1.25 mm and 1/64° to 1.28 m and 16°.

    Parameters
    ----------
    resolution, angle_resolution
        A resolution that is fixed beforehand; None: chosen.
    """
    return next(
        (steps for steps in _steps(content, resolution, angle_resolution)
         if packet_bits(content, *steps, beacons) <= bits), None,
    )


def least_bits(
    content: str, beacons: int = 4,
    resolution: float | None = None, angle_resolution: float | None = None,
) -> int:
    """Smallest number of bits for which `finest` finds a resolution; same parameters."""
    *_, coarsest = _steps(content, resolution, angle_resolution)
    return packet_bits(content, *coarsest, beacons)


def _steps(
    content: str, resolution: float | None, angle_resolution: float | None
) -> Iterator[tuple[float, float]]:
    for step in range(-2 * _FINER, 2 * _COARSER + 1):
        first, second = _at(content, step)
        yield (first if resolution is None else resolution,
               second if angle_resolution is None else angle_resolution)


def _at(content: str, step: int) -> tuple[float, float]:
    angle = _ANGLE * 2.0 ** (step // 2) if has_angles(content) else 0.0
    return _RESOLUTION * 2.0 ** -(-step // 2), angle


def _bits(span: float, resolution: float) -> int:
    """Bits needed for a multiple of a resolution within a span."""
    return max(ceil(log2(span / resolution) - 1e-9), 0) if resolution > 0 else NUMBER
