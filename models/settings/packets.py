"""What packets say, and how exactly."""

from __future__ import annotations

from ..acoustics.contents import CONTENTS
from ..acoustics.packet import finest

DEFAULT = "everything"
"""What packets say where nothing is said of it."""
KEYS = ("packet_resolution_m", "packet_angle_resolution_deg")
"""Keys of ``[acoustics]`` that round what a packet says."""


def pose_source(content: str) -> str:
    """What a receiver uses of such packets, as the key ``pose_source``."""
    return CONTENTS[content].pose_source


def resolutions(
    content: str, bits: int, beacons: int,
    resolution: float | None = None, angle_resolution: float | None = None,
) -> dict[str, float]:
    """Keys of ``[acoustics]`` that follow from ``packet_bits``; none if nothing fits.

    Parameters
    ----------
    content, bits, beacons
        What a packet says, how many bits it has, and the number of beacons.
    resolution, angle_resolution
        One that is given [m, degrees].
    """
    found = finest(content, bits, beacons, resolution, angle_resolution)
    return dict(zip(KEYS, found, strict=True)) if found else {}
