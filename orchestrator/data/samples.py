"""Samples: sensor data of a diver during a dive, from any source."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sblcosim.models.declaration import number_of
from sblcosim.models.receiver.variables import POSE_SOURCE

from ..errors import ConfigurationError
from .estimates import Flags, Floats, Integers
from .record import Record, epochs_ns
from .turns import turned

NEEDED = (
    "acoustics.range", "acoustics.range_epoch", "acoustics.reception_count",
    "acoustics.ping_beacon_position", "target.depth", "target.depth_epoch",
)
"""Outputs that a record must have to give samples."""
_POSE = ("acoustics.ping_platform_position", "acoustics.ping_platform_attitude")
_ALL = "acoustics.packet_beacon_position"
_REPORTED = number_of(POSE_SOURCE, "reported_pose")
OWN = number_of(POSE_SOURCE, "own_beacon")
"""Number of the pose source that takes only the own beacon's position."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Ranges and depth readings, each in the order of its epochs.

    Attributes
    ----------
    start_ns
        Time before which nothing is known [ns].
    depth_ns, depth
        Epochs [ns] and readings of the depth sensor [m]; shape (d,).
    range_ns, beacon, range
        Epochs [ns], indices of beacons from 0, and ranges [m]; shape (m,).
    has_pose
        Whether the packet holds the platform's pose, or only its own beacon's position; (m,).
    position
        Reported position of the platform's reference point or of that beacon, NED [m]; (m, 3).
    attitude
        Reported roll, pitch, yaw [rad], 0 without a pose; (m, 3).
    """

    start_ns: int
    depth_ns: Integers
    depth: Floats
    range_ns: Integers
    beacon: NDArray[np.intp]
    range: Floats
    has_pose: Flags
    position: Floats
    attitude: Floats

    @property
    def epochs_ns(self) -> Integers:
        """All epochs, each once [ns]; shape (n,)."""
        return np.unique(np.concatenate([self.depth_ns, self.range_ns]))

    @property
    def has_own_pose(self) -> Flags:
        """Whether a packet adds information to earlier ones of its epoch, errors included; (m,)."""
        again = np.diff(self.range_ns, prepend=self.range_ns[:1] - 1) == 0
        own: Flags = ~(self.has_pose & again)
        return own

    def beacon_position(self, body: Floats | None = None) -> Floats:
        """Reported position of each packet's beacon, NED [m]; (m, 3).

        Parameters
        ----------
        body
            Nominal positions of the beacons, body frame [m], shape (beacons, 3).

        Raises
        ------
        ConfigurationError
            A packet holds the platform's pose, and ``body`` is None.
        """
        position = self.position.copy()
        posed = np.flatnonzero(self.has_pose)
        if len(posed) and body is None:
            raise ConfigurationError(
                f"body: must be the positions of the beacons on the platform, as {len(posed)} of "
                f"{len(self.range)} packets hold its pose, got none"
            )
        if body is not None and len(posed):
            position[posed] += turned(self.attitude[posed], body[self.beacon[posed]])
        return position

    def enough_ns(self) -> int | None:
        """Epoch at which three beacons and a depth have been heard [ns]; None if there is none.

        The same rule as for receivers that start from the first receptions.
        """
        firsts = sorted(int(self.range_ns[self.beacon == b].min()) for b in set(self.beacon))
        if len(firsts) < 3 or not len(self.depth_ns):
            return None
        return max(firsts[2], int(self.depth_ns[0]))


def of_record(record: Record, body: Floats, pose_source: int = _REPORTED) -> Samples:
    """The samples of a run; of each beacon, only the last packet between two instants.

    Parameters
    ----------
    body
        Nominal positions of the beacons, body frame [m]; shape (beacons, 3).
    pose_source
        Pose to take from a packet, as ``pose_source`` of `coupled`: the pose itself, the positions
        of all beacons, or only the own beacon's position. If the packet lacks it, the next one in
        this order.

    Raises
    ------
    ConfigurationError
        The record lacks these outputs.
    """
    missing = [name for name in NEEDED if name not in record.values]
    if missing:
        raise ConfigurationError(
            f"record: must have the outputs {', '.join(NEEDED)}, got no {', '.join(missing)}"
        )
    start = record.time_ns[0]
    depth_epoch = record.values["target.depth_epoch"].astype(np.float64)
    fresh = np.diff(depth_epoch, prepend=start / 1e9) > 0
    count = record.values["acoustics.reception_count"].astype(np.int64)
    instant, beacon = np.nonzero(np.diff(count, axis=0, prepend=0 * count[:1]) > 0)

    def of_packet(name: str) -> Floats:
        values: Floats = record.values[name].astype(np.float64)[instant, beacon]
        return values

    has_pose, position, attitude = _poses(record, instant, beacon, body, pose_source)
    own = of_packet("acoustics.ping_beacon_position")
    epoch = of_packet("acoustics.range_epoch")
    order = np.lexsort((beacon, epoch))
    return Samples(
        int(start),
        epochs_ns(record.time_ns, depth_epoch[fresh]),
        record.values["target.depth"].astype(np.float64)[fresh],
        epochs_ns(record.time_ns, epoch)[order],
        beacon[order],
        of_packet("acoustics.range")[order],
        has_pose[order],
        np.where(has_pose[:, None], position, own)[order],
        np.where(has_pose[:, None], attitude, 0.0)[order],
    )


def _poses(
    record: Record, instant: NDArray[np.intp], beacon: NDArray[np.intp], body: Floats, source: int
) -> tuple[Flags, Floats, Floats]:
    """Which packets hold a pose, and the platform's position and attitude in them."""
    n = len(instant)
    there, position, attitude = np.zeros(n, bool), np.zeros((n, 3)), np.zeros((n, 3))
    if source == OWN:
        return there, position, attitude
    if source == _REPORTED and all(name in record.values for name in _POSE):
        said = [record.values[name].astype(np.float64)[instant, beacon] for name in _POSE]
        there = np.any(said[0] != 0, axis=1) | np.any(said[1] != 0, axis=1)
        position, attitude = said
    if _ALL in record.values:
        every = record.values[_ALL].astype(np.float64)
        for i in np.flatnonzero(~there):
            if np.any(every[instant[i]] != 0):
                there[i] = True
                position[i], attitude[i] = pose_of(every[instant[i]], body)
    return there, position, attitude


def pose_of(points: Floats, body: Floats) -> tuple[Floats, Floats]:
    """Least-squares pose that moves body-frame points to their reported positions.

    Parameters
    ----------
    points, body
        Reported positions, NED, and nominal ones in the body frame [m]; shape (beacons, 3).

    Returns
    -------
    position, attitude
        Position of the reference point, NED [m], and roll, pitch, yaw [rad].
    """
    center, mean = points.mean(axis=0), body.mean(axis=0)
    u, _, vt = np.linalg.svd((points - center).T @ (body - mean))
    R = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    angles = (np.arctan2(R[2, 1], R[2, 2]), -np.arcsin(np.clip(R[2, 0], -1, 1)),
              np.arctan2(R[1, 0], R[0, 0]))
    return center - R @ mean, np.array(angles)
