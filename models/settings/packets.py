"""What packets hold, and how exactly."""

from __future__ import annotations

from ..acoustics.contents import CONTENTS
from ..acoustics.packet import finest

DEFAULT = "everything"
"""Default content of packets."""
KEYS = ("packet_resolution_m", "packet_angle_resolution_deg")
"""Keys of ``[acoustics]`` that round the contents of a packet."""


def pose_source(content: str) -> str:
    """What a receiver uses of such packets, as a value of the key ``pose_source``."""
    return CONTENTS[content].pose_source


def resolutions(
    content: str, bits: int, beacons: int,
    resolution: float | None = None, angle_resolution: float | None = None,
) -> dict[str, float]:
    """Keys of ``[acoustics]`` that follow from ``packet_bits``; none if no resolution fits.

    Parameters
    ----------
    content, bits, beacons
        Content of a packet, its number of bits, and the number of beacons.
    resolution, angle_resolution
        A resolution that is given [m, degrees].
    """
    found = finest(content, bits, beacons, resolution, angle_resolution)
    return dict(zip(KEYS, found, strict=True)) if found else {}
