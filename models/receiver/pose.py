"""The platform's pose as a packet says it: by itself, or by the positions of its beacons."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from ..declaration import number_of
from ..equations import Symbols
from ..ports import BEACONS
from . import surroundings
from .measurements import Samples
from .surroundings import Pose
from .variables import POSE_SOURCE

_REPORTED = number_of(POSE_SOURCE, "reported_pose")
_OWN = number_of(POSE_SOURCE, "own_beacon")
_PASSES = 4


@dataclass(frozen=True, slots=True)
class Packet:
    """What a packet says of the platform.

    Attributes
    ----------
    is_own
        Whether it says only where its own beacon is: 0 or 1.
    place
        North and east of the reference point, or of that beacon, (2, 1) [m].
    body
        The point of the body frame that `place` is about, (3, 1) [m].
    arm
        Nominal position of the beacon in the body frame, (3, 1) [m].
    heading
        Reported heading [rad]; there is none if `is_own`.
    pose
        The rest.
    platform, complete
        Where the reference point is, (2, 1) [m], and whether that is known: from an own position
        alone it is not, from those of three beacons it is.
    first_heading
        The heading that goes with it [rad].
    """

    is_own: Any
    place: Any
    body: Any
    arm: Any
    heading: Any
    pose: Pose
    platform: Any
    complete: Any
    first_heading: Any


def fit(points: Any, body: Any, weight: Any) -> tuple[Any, Any]:
    """Pose that brings body-frame points to where they are reported, in closed form.

    Least squares for the first two columns of the rotation, made orthogonal; the third, which
    matters where the points are not in one plane, is iterated. Exact for exact points at the first
    pass if all lie at one depth.

    Parameters
    ----------
    points, body
        Reported positions, NED, and nominal ones in the body frame, (n, 3) [m].
    weight
        0 for a point that is not there, else 1; (n, 1).

    Returns
    -------
    position, rotation
        Of the reference point, (3, 1) [m], and body to NED, (3, 3).
    """
    total = ca.fmax(ca.sum1(weight), 1)
    center, mean = (weight.T @ points).T / total, (weight.T @ body).T / total
    at = points - ca.repmat(center.T, points.shape[0], 1)
    b = body - ca.repmat(mean.T, body.shape[0], 1)
    horizontal = ca.repmat(weight, 1, 2) * b[:, :2]
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


def read(p: Symbols, u: Symbols, s: Samples, which: Any, newest: Any) -> Packet:
    """The packet of one beacon.

    Parameters
    ----------
    which
        Whether it is the packet of each beacon: 0 or 1, (4, 1).
    newest
        Whether it is the newest packet: the positions of all beacons are of that one only.
    """
    def chosen(rows: Any) -> Any:
        return (which.T @ rows).T

    position, attitude = chosen(u.ping_platform_position), chosen(u.ping_platform_attitude)
    own, arm = chosen(u.ping_beacon_position), chosen(p.beacon_offset)
    given = (p.pose_source == _REPORTED) * (ca.sumsqr(position) + ca.sumsqr(attitude) > 0)
    all_there = (p.pose_source != _OWN) * newest * (ca.sumsqr(u.packet_beacon_position) > 0)
    is_own = (given == 0) * (all_there == 0)
    heard = s.heard[:BEACONS]
    fitted, R = fit(
        ca.if_else(all_there, u.packet_beacon_position, u.ping_beacon_position),
        p.beacon_offset,
        ca.if_else(all_there, 1, heard),
    )
    position = ca.if_else(given, position, fitted)
    yaw = ca.if_else(given, attitude[2], ca.atan2(R[1, 0], R[0, 0]))
    roll = ca.if_else(given, attitude[0], ca.atan2(R[2, 1], R[2, 2]))
    pitch = ca.if_else(given, attitude[1], -ca.asin(ca.fmax(ca.fmin(R[2, 0], 1), -1)))
    (roll, variance), (pitch, _) = (surroundings.tilt(p, angle) for angle in (roll, pitch))
    return Packet(
        is_own=is_own,
        place=ca.if_else(is_own, own[:2], position[:2]),
        body=ca.if_else(is_own, arm, 0),
        arm=arm,
        heading=yaw,
        pose=Pose(
            down=ca.if_else(is_own, own[2] - arm[2], position[2]),
            roll=ca.if_else(is_own, 0, roll),
            pitch=ca.if_else(is_own, 0, pitch),
            tilt_variance=ca.if_else(is_own, p.tilt_std**2, variance),
        ),
        platform=position[:2],
        complete=(is_own == 0) + is_own * (ca.sum1(heard) >= 3),
        first_heading=yaw,
    )
