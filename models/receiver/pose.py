"""The platform's pose as a packet says it: by itself, or by the positions of its beacons."""

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
_KNOWN = 0.12
"""Variance of a heading with which to begin [rad²]."""
_ENOUGH = 12
"""Number of own positions with which to begin, whatever the heading."""
_UNKNOWN = pi**2 / 3
"""Variance of a heading of which nothing is known [rad²]."""


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
    platform, first_heading, heading_variance
        Where the reference point is, (2, 1) [m], with which heading [rad], and the variance of that
        as far as it follows from the beacons' own positions [rad²].
    complete
        Whether that is good enough to begin with. An own position alone is not.
    total, count
        Sum of all own positions so far, north and east, (4, 2) [m], and number of each, (4, 1).
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
    total: Any
    count: Any


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


def read(p: Symbols, x: Symbols, u: Symbols, s: Samples, which: Any, newest: Any) -> Packet:
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
    # What own positions say, averaged: a single one of a poor GPS turns the platform anywhere.
    count = x.place_count + which
    total = x.place_total + ca.diag(which) @ u.ping_beacon_position[:, :2]
    mean = ca.horzcat(total / ca.repmat(ca.fmax(count, 1), 1, 2), u.ping_beacon_position[:, 2])
    fitted, R = fit(
        ca.if_else(all_there, u.packet_beacon_position, mean),
        p.beacon_offset,
        ca.if_else(all_there, 1, count > 0),
    )
    square = ca.sum2(p.beacon_offset[:, :2] ** 2)
    variance = ca.fmax(p.gps_std, LEAST_GPS_STD) ** 2 / ca.fmax(ca.dot(square, count), 1e-12)
    position = ca.if_else(given, position, fitted)
    yaw = ca.if_else(given, attitude[2], ca.atan2(R[1, 0], R[0, 0]))
    roll = ca.if_else(given, attitude[0], ca.atan2(R[2, 1], R[2, 2]))
    pitch = ca.if_else(given, attitude[1], -ca.asin(ca.fmax(ca.fmin(R[2, 0], 1), -1)))
    (roll, tilt_variance), (pitch, _) = (surroundings.tilt(p, angle) for angle in (roll, pitch))
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
            tilt_variance=ca.if_else(is_own, p.tilt_std**2, tilt_variance),
        ),
        platform=position[:2],
        first_heading=yaw,
        heading_variance=ca.fmin(variance, _UNKNOWN),
        complete=ca.fmax(is_own == 0, (ca.sum1(count > 0) >= 3) * ca.fmax(
            variance < _KNOWN, ca.sum1(count) >= _ENOUGH
        )),
        total=total,
        count=count,
    )
