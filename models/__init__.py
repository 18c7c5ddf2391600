"""What is simulated: the declarations of all components, by the name of their FMU."""

from __future__ import annotations

from collections.abc import Mapping

from .acoustics.variables import COMPONENT as _ACOUSTICS
from .declaration import Component
from .platform.variables import COMPONENT as _PLATFORM
from .range_model.variables import COMPONENT as _RANGE_MODEL
from .receiver.variables import EKF, MULTILATERATION, SEQUENTIAL
from .target.variables import COMPONENT as _TARGET

COMPONENTS: Mapping[str, Component] = {
    "target": _TARGET,
    "platform": _PLATFORM,
    "acoustics": _ACOUSTICS,
    "ekf": EKF,
    "sequential": SEQUENTIAL,
    "multilateration": MULTILATERATION,
    "range_model": _RANGE_MODEL,
}
RECEIVERS: Mapping[str, Component] = {
    name: COMPONENTS[name] for name in ("ekf", "sequential", "multilateration")
}

__all__ = ["COMPONENTS", "RECEIVERS"]
