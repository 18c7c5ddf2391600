"""The platform's pose in a packet, stated directly or implied by the beacons' positions."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any

import casadi as ca

from ..declaration import number_of
from ..equations import Symbols
from . import surroundings
from .measurements import Samples
from .surroundings import LEAST_GPS_STD, Pose
from .variables import POSE_SOURCE

_REPORTED = number_of(POSE_SOURCE, "reported_pose")
_OWN = number_of(POSE_SOURCE, "own_beacon")
_PASSES = 4
_KNOWN = 0.1
"""Largest variance of a heading to start with [rad²]."""
_ENOUGH = 12
"""Number of own positions to start with, whatever the heading."""
_TURN_VARIANCE = 0.5
"""Variances of cos ψ and of sin ψ if ψ is unknown."""
_UNKNOWN = pi**2 / 3
"""Variance of an unknown heading [rad²]."""


@dataclass(frozen=True, slots=True)
class Packet:
    """What a packet says about the platform.

    Attributes
    ----------
    is_own
        Whether it holds only its own beacon's position: 0 or 1.
    place
        North and east of the reference point, or of its own beacon, (2, 1) [m].
    body
        The point of the body frame that `place` refers to, (3, 1) [m].
    arm
        Nominal position of the beacon in the body frame, (3, 1) [m].
    heading
        Reported heading [rad]; not available if `is_own`.
    pose
        Everything else.
    platform, first_heading, heading_variance
        Position of the reference point, (2, 1) [m], its heading [rad], and the variance of the
        heading as far as it follows from own positions [rad²].
    complete
        Whether these are good enough to start with. A single own position is not.
    """

    is_own: Any
    place: Any
    body: Any
    arm: Any
    heading: Any
    pose: Pose
    platform: Any
    first_heading: Any
    heading_variance: Any
    complete: Any

    @property
    def numbers(self) -> Any:
        """All numbers as a column; `packet` makes a packet of them."""
        return ca.vertcat(
            self.is_own, self.place, self.arm, self.heading, self.pose.down, self.pose.roll,
            self.pose.pitch, self.pose.tilt_variance, self.platform, self.first_heading,
            self.heading_variance, self.complete,
        )


NUMBERS = 16
"""Numbers of a packet."""


def packet(numbers: Any) -> Packet:
    """The packet of a column of numbers."""
    is_own, arm = numbers[0], numbers[3:6]
    return Packet(
        is_own=is_own,
        place=numbers[1:3],
        body=ca.if_else(is_own, arm, 0),
        arm=arm,
        heading=numbers[6],
        pose=Pose(down=numbers[7], roll=numbers[8], pitch=numbers[9], tilt_variance=numbers[10],
                  own=is_own),
        platform=numbers[11:13],
        first_heading=numbers[13],
        heading_variance=numbers[14],
        complete=numbers[15],
    )


@dataclass(frozen=True, slots=True)
class Own:
    """What single own positions imply for the platform: ŝ_i = q + h b_i, as complex numbers.

    q = p + g wanders as the platform and the slow error of its GPS do. h = exp(j(ψ + e_ψ)) is free
    in the plane, so that a Kalman filter can handle an unknown heading. Its variance is the same in
    all directions.

    Attributes
    ----------
    place, turn
        q and h, (2, 1) each [m], [1].
    place_variance, turn_variance
        Variances of each of their parts [m²], [1].
    shared
        Half of E[q h*], (2, 1) [m].
    count
        Number of own positions.
    """

    place: Any
    turn: Any
    place_variance: Any
    turn_variance: Any
    shared: Any
    count: Any

    @property
    def states(self) -> dict[str, Any]:
        """The values as states of the component."""
        return {
            "own_place": self.place,
            "own_turn": self.turn,
            "own_place_variance": self.place_variance,
            "own_turn_variance": self.turn_variance,
            "own_shared": self.shared,
            "own_count": self.count,
        }

    @property
    def heading_variance(self) -> Any:
        """Variance of the direction of h [rad²]: inverse of its von Mises concentration."""
        length = ca.sqrt(ca.sumsqr(self.turn))
        return ca.fmin(self.turn_variance / ca.fmax(length, 1e-6), _UNKNOWN)


NOTHING = Own(ca.SX.zeros(2), ca.SX.zeros(2), 0, _TURN_VARIANCE, ca.SX.zeros(2), 0)
"""State of the own positions before the first one."""


def _times(a: Any, b: Any) -> Any:
    """The product a b of complex numbers stored as (2, 1)."""
    return ca.vertcat(a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0])


def _conjugate(a: Any) -> Any:
    return ca.vertcat(a[0], -a[1])


def later(x: Symbols, drift: tuple[Any, Any, Any]) -> Own:
    """The own positions so far, after place and heading have wandered."""
    kept = ca.exp(-drift[1] / 2)
    return Own(
        x.own_place, kept * x.own_turn, x.own_place_variance + drift[0],
        _TURN_VARIANCE + kept**2 * (x.own_turn_variance - _TURN_VARIANCE),
        kept * x.own_shared, x.own_count,
    )


def _with(own: Own, z: Any, b: Any, R: Any, there: Any) -> Own:
    """Add an own position z of a beacon at b, with variance R. The first one sets q."""
    square, shared, a, d = ca.sumsqr(b), own.shared, own.place_variance, own.turn_variance
    off = z - own.place - _times(own.turn, b)
    S = ca.fmax(a + square * d + 2 * ca.dot(b, shared), 0) + R
    K = (_times(_conjugate(b), shared) + ca.vertcat(a, 0)) / S
    L = (_conjugate(shared) + d * _conjugate(b)) / S
    first = own.count == 0

    def chosen(new: Any, at_first: Any, before: Any) -> Any:
        return ca.if_else(there, ca.if_else(first, at_first, new), before)

    return Own(
        chosen(own.place + _times(K, off), z - _times(own.turn, b), own.place),
        chosen(own.turn + _times(L, off), own.turn, own.turn),
        chosen(a - ca.sumsqr(K) * S, R + square * d, a),
        chosen(d - ca.sumsqr(L) * S, d, d),
        chosen(shared - _times(K, _conjugate(L)) * S, -d * b, shared),
        own.count + there,
    )


def fit(points: Any, body: Any) -> tuple[Any, Any]:
    """Pose that moves body-frame points to their reported positions, in closed form.

    The first two columns of the rotation are a least-squares solution, made orthogonal. The third,
    which matters if the points do not lie in one plane, is iterated. For exact points the first
    pass is exact if all lie at one depth.

    Parameters
    ----------
    points, body
        Reported positions, NED, and nominal ones in the body frame, (n, 3) [m].

    Returns
    -------
    position, rotation
        Position of the reference point, (3, 1) [m], and rotation from body to NED, (3, 3).
    """
    n = points.shape[0]
    center, mean = ca.sum1(points).T / n, ca.sum1(body).T / n
    at, b = points - ca.repmat(center.T, n, 1), body - ca.repmat(mean.T, n, 1)
    horizontal = b[:, :2]
    G = b[:, :2].T @ horizontal
    ridge = 1e-12 * (G[0, 0] + G[1, 1]) + 1e-24
    g11, g22, g12 = G[0, 0] + ridge, G[1, 1] + ridge, G[0, 1]
    share = 1 / (g11 * g22 - g12 * g12)
    inverse = ca.vertcat(ca.horzcat(g22, -g12), ca.horzcat(-g12, g11)) * share
    first = at.T @ horizontal @ inverse  # (3, 2)
    lower = (b[:, 2].T @ horizontal @ inverse).T  # (2, 1)
    e_z = ca.SX([0, 0, 1])
    e_x = e_y = e_z
    for _ in range(_PASSES):
        columns = first - e_z @ lower.T
        e_x = _unit(columns[:, 0])
        e_y = _unit(columns[:, 1] - ca.dot(e_x, columns[:, 1]) * e_x)
        e_z = ca.cross(e_x, e_y)
    rotation = ca.horzcat(e_x, e_y, e_z)
    return center - rotation @ mean, rotation


def _unit(v: Any) -> Any:
    return v / ca.sqrt(ca.fmax(ca.sumsqr(v), 1e-24))


def read(
    p: Symbols, u: Symbols, s: Samples, which: Any, newest: Any, before: Own
) -> tuple[Packet, Own]:
    """The packet of one beacon, and the state of the own positions so far.

    Parameters
    ----------
    which
        Which beacon sent the packet, one flag per beacon: 0 or 1, (N, 1).
    newest
        Whether it is the newest packet. The positions of all beacons belong to that one only.
    before
        State of the own positions before it.
    """
    def chosen(rows: Any) -> Any:
        return (which.T @ rows).T

    position, attitude = chosen(u.ping_platform_position), chosen(u.ping_platform_attitude)
    own, arm = chosen(u.ping_beacon_position), chosen(p.beacon_offset)
    given = (p.pose_source == _REPORTED) * (ca.sumsqr(position) + ca.sumsqr(attitude) > 0)
    all_there = (p.pose_source != _OWN) * newest * (ca.sumsqr(u.packet_beacon_position) > 0)
    is_own = (given == 0) * (all_there == 0)
    fitted, R = fit(u.packet_beacon_position, p.beacon_offset)
    white = ca.fmax(p.gps_std, LEAST_GPS_STD) ** 2 + (arm[2] * p.tilt_std) ** 2
    all_own = _with(before, own[:2], arm[:2], white, ca.sum1(which))
    position = ca.if_else(given, position, fitted)
    yaw = ca.if_else(given, attitude[2], ca.atan2(R[1, 0], R[0, 0]))
    roll = ca.if_else(given, attitude[0], ca.atan2(R[2, 1], R[2, 2]))
    pitch = ca.if_else(given, attitude[1], -ca.asin(ca.fmax(ca.fmin(R[2, 0], 1), -1)))
    (roll, tilt_variance), (pitch, _) = (surroundings.tilt(p, angle) for angle in (roll, pitch))
    said = Packet(
        is_own=is_own,
        place=ca.if_else(is_own, own[:2], position[:2]),
        body=ca.if_else(is_own, arm, 0),
        arm=arm,
        heading=yaw,
        pose=Pose(
            down=ca.if_else(is_own, own[2] - arm[2], position[2]),
            roll=ca.if_else(is_own, 0, roll),
            pitch=ca.if_else(is_own, 0, pitch),
            tilt_variance=ca.if_else(is_own, 0, tilt_variance),
            own=is_own,
        ),
        platform=ca.if_else(is_own, all_own.place, position[:2]),
        first_heading=ca.if_else(is_own, ca.atan2(all_own.turn[1], all_own.turn[0]), yaw),
        heading_variance=all_own.heading_variance,
        complete=ca.fmax(is_own == 0, ca.fmax(
            all_own.heading_variance < _KNOWN, all_own.count >= _ENOUGH
        )),
    )
    return said, all_own
