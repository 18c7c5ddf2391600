"""The samples on a receiver's inputs, and the measurement equations (the paper's z and H).

The measurements are always in the order of the paper's z: the ranges to the N beacons, then the
depth.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from ..declaration import number_of
from ..equations import Symbols, Values
from .variables import BEACON_POSITION_SOURCE, MEASUREMENT_NOISE

DEPTH = -1
"""Index of the depth in z: the last one."""
_OWN_PACKET = number_of(BEACON_POSITION_SOURCE, "own_packet")
_VARIANCE = number_of(MEASUREMENT_NOISE, "variance")


@dataclass(frozen=True, slots=True)
class Samples:
    """The newest samples of the sensors; flags are 0 or 1.

    Attributes
    ----------
    z
        Ranges and depth in m, (N + 1, 1).
    epoch
        Their epochs in s, (N + 1, 1).
    beacons
        Beacon position that goes with each range in m, NED, (N, 3).
    mark
        A value that changes with each new sample, (N + 1, 1).
    heard, new
        Whether there has been a sample at all; whether one came after the last one seen, (N + 1,
        1).
    any_new
        Whether any sample is new.
    newest
        The latest epoch in s.
    enough
        Whether the samples suffice for a fix: three ranges and the depth.
    """

    z: Any
    epoch: Any
    beacons: Any
    mark: Any
    heard: Any
    new: Any
    any_new: Any
    newest: Any
    enough: Any

    @property
    def count(self) -> int:
        """N, the number of beacons."""
        return int(self.beacons.shape[0])


def initial(p: Symbols, t: Any) -> Values:
    """The states that `samples` needs, at the start."""
    return {"start": t, "seen": ca.vertcat(ca.SX.zeros(p.beacons), t)}


def samples(p: Symbols, x: Symbols, u: Symbols) -> Samples:
    """Read the inputs; ``x.seen`` marks the samples already used."""
    return with_beacons(x, u, ca.if_else(
        p.beacon_position_source == _OWN_PACKET, u.ping_beacon_position, u.packet_beacon_position
    ))


def with_beacons(x: Symbols, u: Symbols, beacons: Any) -> Samples:
    """The same, with given beacon positions, (N, 3)."""
    epoch = ca.vertcat(u.range_epoch, u.depth_epoch)
    mark = ca.vertcat(u.reception_count, u.depth_epoch)
    heard = ca.vertcat(u.reception_count > 0, u.depth_epoch > x.start)
    new = mark != x.seen
    return Samples(
        z=ca.vertcat(u.range, u.depth),
        epoch=epoch,
        beacons=beacons,
        mark=mark,
        heard=heard,
        new=new,
        any_new=ca.sum1(new) > 0,
        newest=ca.mmax(epoch),
        enough=(ca.sum1(heard[:DEPTH]) >= 3) * heard[DEPTH],
    )


def noise(p: Symbols) -> Any:
    """Diagonal of R, (N + 1, 1): variances, or literally the standard deviations, taken as m^2."""
    variances = ca.vertcat(ca.repmat(p.range_std**2, p.beacons, 1), p.depth_std**2)
    literal = ca.vertcat(ca.repmat(p.range_std, p.beacons, 1), p.depth_std)
    return ca.if_else(p.measurement_noise == _VARIANCE, variances, literal)


def distance(position: Any, beacon: Any) -> tuple[Any, Any]:
    """Distance in m from a beacon (row) to a position (column), and its gradient, (3, 1).

    The gradient is the row of the paper's H. On the beacon itself it is 0.
    """
    offset = position - beacon.T
    length = ca.sqrt(ca.fmax(ca.sumsqr(offset), 1e-24))
    return length, offset * (1 / length)


def predicted(position: Any, s: Samples) -> list[tuple[Any, Any]]:
    """Each measurement at a position, and its gradient, (3, 1)."""
    ranges = [distance(position, s.beacons[i, :]) for i in range(s.count)]
    return [*ranges, (position[2], ca.SX([0, 0, 1]))]
