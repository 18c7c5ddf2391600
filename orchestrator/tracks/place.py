"""Where a system is on Earth, and positions there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Origin:
    """The origin of north, east and down, on WGS 84.

    Attributes
    ----------
    latitude_deg, longitude_deg
        Geodetic coordinates [°].
    height_m
        Height of the water's surface above the ellipsoid [m].
    """

    latitude_deg: float
    longitude_deg: float
    height_m: float = 0.0

    def local(self, geographic: Floats) -> Floats:
        """North, east, down [m] of rows of latitude [°], longitude [°], depth [m]."""
        latitude, longitude, depth = geographic.T
        ned = _maps().geodetic2ned(latitude, longitude, self.height_m - depth, *self._values)
        return np.stack(ned, axis=1)

    def geographic(self, ned: Floats) -> Floats:
        """Latitude [°], longitude [°], depth [m] of rows of north, east, down [m]."""
        latitude, longitude, height = _maps().ned2geodetic(*ned.T, *self._values)
        return np.stack([latitude, longitude, self.height_m - height], axis=1)

    @property
    def _values(self) -> tuple[float, float, float]:
        return self.latitude_deg, self.longitude_deg, self.height_m


def _maps() -> Any:
    import pymap3d  # only needed with a place on Earth

    return pymap3d
