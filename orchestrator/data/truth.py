"""Truth: true positions of the diver and of the platform, as far as they are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import ConfigurationError
from ..shown import Shown
from .estimates import Floats, Integers
from .record import Record

TRUTH = (
    "target.position", "target.velocity", "platform.position", "platform.beacon_position",
    "platform.reported_beacon_position",
)
"""Outputs of a record that form its truth."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Truth(Shown):
    """True motion of a diver and, if known, of the platform.

    Attributes
    ----------
    time_ns
        Instants of the diver's motion [ns], increasing; shape (n,).
    position
        NED [m]; shape (n, 3).
    velocity
        NED [m/s]; shape (n, 3). None: the diver moves in a straight line between instants.
    span_ns
        First and last instant of the dive [ns]; None: those of ``time_ns``.
    platform_time_ns
        Instants of the platform's motion [ns], increasing; shape (k,).
    platform_position
        NED [m]; shape (k, 3); None: unknown, and so are errors relative to the platform.
    platform_error
        Mean over the beacons of reported minus true position [m]; shape (k, 3).

    Raises
    ------
    ConfigurationError
        There is no instant, instants do not increase, or shapes do not fit.
    """

    time_ns: Integers
    position: Floats
    velocity: Floats | None = None
    span_ns: tuple[int, int] | None = None
    platform_time_ns: Integers | None = None
    platform_position: Floats | None = None
    platform_error: Floats | None = None

    def __post_init__(self) -> None:
        _check("truth", self.time_ns, {"position": self.position, "velocity": self.velocity})
        if self.platform_time_ns is not None:
            _check("truth of the platform", self.platform_time_ns, {
                "platform_position": self.platform_position,
                "platform_error": self.platform_error,
            })  # fmt: skip

    @property
    def start_ns(self) -> int:
        """First instant of the dive [ns]."""
        return int(self.time_ns[0]) if self.span_ns is None else self.span_ns[0]

    @property
    def stop_ns(self) -> int:
        """Last instant of the dive [ns]."""
        return int(self.time_ns[-1]) if self.span_ns is None else self.span_ns[1]

    def state_at(self, epoch_ns: Integers) -> tuple[Floats, Floats]:
        """Position and velocity at epochs, see `state_at`; shapes (m, 3); NaN where unknown."""
        if self.velocity is not None:
            return state_at(self.time_ns, self.position, self.velocity, epoch_ns)
        columns = [np.interp(epoch_ns, self.time_ns, x) for x in self.position.T]
        return np.column_stack(columns), np.full((len(epoch_ns), 3), np.nan)

    def platform_at(self, epoch_ns: Integers) -> tuple[Floats, Floats] | None:
        """Platform position and error of its reports at epochs, as held; None if unknown."""
        time, position, error = self.platform_time_ns, self.platform_position, self.platform_error
        if time is None or position is None or error is None:
            return None
        return held_at(time, position, epoch_ns), held_at(time, error, epoch_ns)

    def _gist(self) -> str:
        start_s, stop_s = self.start_ns / 1e9, self.stop_ns / 1e9
        return f"of {len(self.time_ns)} instants, {start_s:g} to {stop_s:g} s"


def of_record(record: Record) -> Truth:
    """The truth of a run, from a record that contains `TRUTH`.

    Raises
    ------
    ConfigurationError
        The record lacks one of these outputs.
    """
    missing = [name for name in TRUTH if name not in record.values]
    if missing:
        raise ConfigurationError(
            f"record: must have the outputs {', '.join(TRUTH)}, got no {', '.join(missing)}"
        )
    time, own = record.time_ns, record.own("target")
    return Truth(
        time_ns=time[own],
        position=recorded(record, "target.position")[own],
        velocity=recorded(record, "target.velocity")[own],
        span_ns=(int(time[0]), int(time[-1])),
        platform_time_ns=time,
        platform_position=recorded(record, "platform.position"),
        platform_error=platform_errors(record),
    )


def _check(what: str, time_ns: Integers, values: dict[str, Floats | None]) -> None:
    if not len(time_ns) or np.any(np.diff(time_ns) <= 0):
        got = "none" if not len(time_ns) else "some that do not"
        raise ConfigurationError(f"{what}: must have instants that increase, got {got}")
    for name, array in values.items():
        if array is not None and np.shape(array) != (len(time_ns), 3):
            raise ConfigurationError(
                f"{what}: {name} must have three coordinates for each of {len(time_ns)} instants, "
                f"got shape {np.shape(array)}"
            )


def state_at(
    time_ns: Integers, position: Floats, velocity: Floats, epoch_ns: Integers
) -> tuple[Floats, Floats]:
    """True position and velocity at the given epochs.

    At a recorded instant these are the recorded values, to the bit. Between instants they follow
    the cubic Hermite polynomial through the recorded positions and velocities at both ends.

    Parameters
    ----------
    time_ns
        Recorded instants [ns], increasing; shape (n,).
    position, velocity
        Recorded motion [m], [m/s]; shape (n, 3).
    epoch_ns
        Epochs within the recorded time [ns]; shape (m,).

    Returns
    -------
    position, velocity
        [m], [m/s]; shape (m, 3).

    Raises
    ------
    ValueError
        An epoch lies outside the recorded time.
    """
    if epoch_ns.size and not (time_ns[0] <= epoch_ns.min() and epoch_ns.max() <= time_ns[-1]):
        raise ValueError("epochs must lie within the recorded time")
    right = np.searchsorted(time_ns, epoch_ns)
    exact = time_ns[right] == epoch_ns
    left = np.where(exact, right, right - 1)
    step = np.where(exact, 1, time_ns[right] - time_ns[left])
    h = (step * 1e-9)[:, None]
    u = ((epoch_ns - time_ns[left]) / step)[:, None]
    p0, p1, v0, v1 = position[left], position[right], velocity[left], velocity[right]
    secant = (p1 - p0) / h
    # p = p0 + h (v0 u + b u² + a u³), with a and b from p(1) = p1 and dp/du(1) = h v1
    b = 3 * secant - 2 * v0 - v1
    a = v0 + v1 - 2 * secant
    between = p0 + h * u * (v0 + u * (b + u * a))
    return (
        np.where(exact[:, None], p0, between),
        np.where(exact[:, None], v0, v0 + u * (2 * b + u * 3 * a)),
    )


def held_at(time_ns: Integers, values: Floats, epoch_ns: Integers) -> Floats:
    """Recorded values at the last instant at or before each epoch; shape (m, …)."""
    held: Floats = values[np.searchsorted(time_ns, epoch_ns, side="right") - 1]
    return held


def recorded(record: Record, name: str) -> Floats:
    """Recorded values of ``"component.variable"`` as floats; shape (n, …)."""
    return record.values[name].astype(np.float64, copy=False)


def platform_errors(record: Record) -> Floats:
    """Mean over the beacons of reported minus true position at all instants [m]; shape (n, 3)."""
    reported = recorded(record, "platform.reported_beacon_position")
    beacon = recorded(record, "platform.beacon_position")
    beacons = beacon.shape[1]
    error = np.zeros((len(record), 3))
    for j in range(beacons):  # in the same order as the C code, for equal bits
        error += reported[:, j] - beacon[:, j]
    error *= 1.0 / beacons
    return error
