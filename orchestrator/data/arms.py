"""Whether beacons may be on arms of one platform."""

from __future__ import annotations

import numpy as np

from .estimates import Floats

LONGEST_ARM = 10.0
"""Beacons farther from their middle than this [m] are not on arms of a platform."""


def are_far(beacons: Floats) -> bool:
    """Whether beacons, NED [m], shape (N, 3), cannot be on arms of one platform."""
    return bool(np.abs(beacons - beacons.mean(axis=0)).max() > LONGEST_ARM)
