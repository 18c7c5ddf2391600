"""How the diver of a cell moves: in a circle about its middle, at a constant depth and speed."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, floor, isfinite, log10, pi, sin, sqrt

import numpy as np
from numpy.typing import NDArray
from sblcosim.models.target.trajectories import FOUND
from sblcosim.models.target.variables import COMPONENT as TARGET

from ..errors import ConfigurationError, instance, shortened
from ..scenario.scenario import Scenario, load
from ..scenario.schema import PRIOR_KEYS
from ..scenario.tracks import FILE_KEYS, follows

Floats = NDArray[np.float64]

RADIUS = 3.0
"""Default radius of the circle [m]: at 0.3 m/s a turn takes a minute."""
_WITHOUT_SPEED = tuple(name for name, it in FOUND.items() if "speed" not in it.all)
_NOISE = ("seed", "stream")
_MOST_TURNS = float(TARGET["turns"].max or 0)
_HALF_TURNED = 1.1655611852
"""Half the angle by which a diver turns in the time that is hardest for a filter [rad]: where
sin²(x)/x is largest."""
_ALLOWED = 2.0
"""Standard deviations of the velocity's change that a receiver allows for. In maps of the systems
of ``new --like`` lbl, buoys and water-linked, the 95 % error beyond this limit was 2 to 34 % above
that with a better q. Below the limit it was at most 1 % above."""


@dataclass(frozen=True)
class Circle:
    """Motion of a diver, clockwise.

    Attributes
    ----------
    radius, speed
        Radius [m] and speed [m/s].
    """

    radius: float
    speed: float

    def position(self, centres: Floats, time_s: float) -> Floats:
        """Positions of divers that began in the north of their circles, NED [m]; shaped as
        ``centres``."""
        angle = self.speed * time_s / self.radius
        offset: Floats = self.radius * np.array([np.cos(angle), np.sin(angle), 0.0])
        return centres + offset

    def doubt(self, receiver: str, acceleration_psd: float) -> str:
        """Whether the diver turns faster than a receiver allows for, in words; empty if not.

        The velocity changes by 2v sin(vτ/2R) in a time τ. White acceleration with the density q
        changes it by √(2qτ) (root mean square, north and east together). Their ratio is largest
        where vτ/2R is `_HALF_TURNED`.

        Parameters
        ----------
        acceleration_psd
            q that the receiver assumes [m²/s³].
        """
        x, v, q = _HALF_TURNED, self.speed, acceleration_psd
        if v <= 0:
            return ""
        time_s = 2 * self.radius * x / v
        change, expected = 2 * v * sin(x), sqrt(2 * q * time_s)
        if change <= _ALLOWED * expected:
            return ""
        text = (
            f"the circle turns faster than {receiver} allows for, which makes its errors larger: "
            f"the velocity changes by {change:.2g} m/s in {time_s:.2g} s, where q = {q:g} m²/s³ "
            f"expects {expected:.2g} m/s"
        )
        if q == 0:
            return text
        enough = v**3 * sin(x) ** 2 / (_ALLOWED**2 * q * x)
        return f"{text}; a radius of {_up(enough):g} m is slow enough"

    def __str__(self) -> str:
        return (
            f"circles clockwise about the middle of the cell, radius {self.radius:g} m, at "
            f"{self.speed:g} m/s, each time from another bearing"
        )


def _up(value: float) -> float:
    """Rounded up to two digits."""
    unit = 10.0 ** (floor(log10(value)) - 1)
    return float(f"{ceil(value / unit - 1e-9) * unit:.6g}")


def circle_of(
    scenario: Scenario, radius: float, speed: float | None, duration_s: float
) -> Circle:
    """The motion, at the scenario's own speed unless another one is given.

    Raises
    ------
    ConfigurationError
        The radius or the speed is out of range, or the scenario has no speed.
    """
    trajectory = scenario.target.trajectory
    if speed is None and trajectory in _WITHOUT_SPEED:
        raise ConfigurationError(
            f"map speed: must be given, as the diver of {scenario.name} has none that is constant "
            f"(trajectory {trajectory!r}), and circles in each cell instead"
        )
    v = scenario.target.speed_m_s if speed is None else speed
    for name, value in (("radius", radius), ("speed", v)):
        low, high, unit = TARGET[name].min or 0, TARGET[name].max or 0, TARGET[name].unit
        if not isinstance(value, int | float) or not isfinite(value) or not low <= value <= high:
            raise ConfigurationError(
                f"map {name}: must be from {low:g} to {high:g} {unit}, got "
                f"{shortened(instance(value))}"
            )
    if v * duration_s > 2 * pi * radius * _MOST_TURNS:
        raise ConfigurationError(
            f"map radius: must be large enough for at most {_MOST_TURNS:g} turns in {duration_s:g} "
            f"s at {v:g} m/s, got {radius:g} m"
        )
    return Circle(float(radius), float(v))


def check_depth(scenario: Scenario, depth: float) -> None:
    """Refuse a depth below the bottom.

    Raises
    ------
    ConfigurationError
        It is.
    """
    bottom = scenario.acoustics.water_depth_m if scenario.acoustics.fmu is None else 0.0
    if bottom and depth > bottom:
        raise ConfigurationError(
            f"map depth: must be at most the depth of the water, {bottom:g} m "
            f"({scenario.where('acoustics', 'water_depth_m')}), got {depth:g} m"
        )


def circling(scenario: Scenario, circle: Circle, depth: float, duration_s: float) -> Scenario:
    """The scenario with that motion about the origin, for a time [s].

    Raises
    ------
    ConfigurationError
        The target is an FMU from another tool, or the receiver begins at a given place.
    """
    if scenario.target.fmu is not None:
        raise ConfigurationError(
            f"{scenario.where('target', 'fmu')}: must be left out for a map, whose divers move in "
            f"circles, got {scenario.target.fmu}"
        )
    if scenario.platform.fmu is None and follows("platform", scenario.platform):
        raise ConfigurationError(
            f"{scenario.where('platform', 'track_m')}: must be left out for a map, as a boat under "
            f"way leaves every cell, got {scenario.platform.track_count} points"
        )
    if scenario.platform.fmu is None and scenario.platform.boat_speed_m_s:
        raise ConfigurationError(
            f"{scenario.where('platform', 'boat_speed_m_s')}: must be 0 for a map, as a boat under "
            f"way leaves every cell, got {scenario.platform.boat_speed_m_s:g} m/s"
        )
    for key in PRIOR_KEYS:
        if getattr(scenario.receiver, key, None) is not None and not scenario.true_prior and (
            key in scenario.receiver.model_fields_set
        ):
            raise ConfigurationError(
                f"{scenario.where('receiver', key)}: must be left out for a map, or be that of "
                "each cell (prior = 'true'), got one for all"
            )
    tables = scenario.given()
    turns = circle.speed * duration_s / (2 * pi * circle.radius)
    tables["target"] = {
        key: value for key, value in tables.get("target", {}).items() if key not in _path_keys()
    } | {
        "trajectory": "circle", "center_m": [0.0, 0.0], "radius_m": circle.radius,
        "speed_m_s": circle.speed, "turns": min(1.01 * turns + 0.01, _MOST_TURNS),
        "depth_start_m": depth, "depth_end_m": depth,
    }
    tables["time"] = tables.get("time", {}) | {"duration_s": duration_s}
    return load(tables)


def _path_keys() -> set[str]:
    """Keys that describe the diver's path."""
    own = {v.key for v in TARGET.of("parameter") if v.needs and v.name not in _NOISE}
    return own | {"trajectory", *FILE_KEYS}

