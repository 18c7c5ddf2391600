"""Rotations between the body frame and north-east-down (NED)."""

from __future__ import annotations

from typing import Any

import casadi as ca


def rotation(attitude: Any) -> Any:
    """Rotation matrix from body coordinates to NED: R = Rz(yaw) Ry(pitch) Rx(roll).

    Parameters
    ----------
    attitude
        Roll, pitch, yaw [rad] (column of 3). Body frame: x forward, y to starboard, z down.

    Returns
    -------
    3 × 3 matrix of CasADi expressions.
    """
    roll, pitch, yaw = ca.vertsplit(attitude)
    cr, sr = ca.cos(roll), ca.sin(roll)
    cp, sp = ca.cos(pitch), ca.sin(pitch)
    cy, sy = ca.cos(yaw), ca.sin(yaw)
    return ca.vertcat(
        ca.horzcat(cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        ca.horzcat(sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        ca.horzcat(-sp, cp * sr, cp * cr),
    )
