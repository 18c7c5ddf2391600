"""Messages of ROS 2 with positions: their definitions, and their bytes (CDR, little-endian).

`Odometry` has position and velocity in the frame ``map``: east, north, up of the origin (REP 103,
REP 105). Its child frame moves with the diver and keeps the axes of ``map``, so orientation and
angular velocity are exactly those of no turn. `NavSatFix` has latitude, longitude and height above
the ellipsoid.
"""

from __future__ import annotations

from collections.abc import Iterator
from struct import pack

import numpy as np

from ..data.estimates import Floats, Integers
from .frames import enu, enu_covariance

MAP = "map"
ODOMETRY, NAV_SAT_FIX = "nav_msgs/msg/Odometry", "sensor_msgs/msg/NavSatFix"
UNKNOWN, DIAGONAL_KNOWN, KNOWN = 0, 2, 3
"""Types of a fix's covariance."""
STATUS_FIX, NO_SERVICE = 0, 0
"""There is a position; it is from no satellite."""
LAST_NS = (2**31 - 1) * 10**9
"""Last time of a stamp [ns]: its seconds have 32 bits."""
_ENCAPSULATION = b"\x00\x01\x00\x00"

_HEADER = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
}
_PARTS = {
    ODOMETRY: {
        "": "std_msgs/Header header\nstring child_frame_id\n"
            "geometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist",
        **_HEADER,
        "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose\nfloat64[36] covariance",
        "geometry_msgs/Pose":
            "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
        "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
        "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
        "geometry_msgs/TwistWithCovariance": "geometry_msgs/Twist twist\nfloat64[36] covariance",
        "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular",
        "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    },
    NAV_SAT_FIX: {
        "": "uint8 COVARIANCE_TYPE_UNKNOWN=0\nuint8 COVARIANCE_TYPE_APPROXIMATED=1\n"
            "uint8 COVARIANCE_TYPE_DIAGONAL_KNOWN=2\nuint8 COVARIANCE_TYPE_KNOWN=3\n"
            "std_msgs/Header header\nsensor_msgs/NavSatStatus status\nfloat64 latitude\n"
            "float64 longitude\nfloat64 altitude\nfloat64[9] position_covariance\n"
            "uint8 position_covariance_type",
        **_HEADER,
        "sensor_msgs/NavSatStatus":
            "int8 STATUS_NO_FIX=-1\nint8 STATUS_FIX=0\nint8 STATUS_SBAS_FIX=1\n"
            "int8 STATUS_GBAS_FIX=2\nuint16 SERVICE_GPS=1\nuint16 SERVICE_GLONASS=2\n"
            "uint16 SERVICE_COMPASS=4\nuint16 SERVICE_GALILEO=8\nint8 status\nuint16 service",
    },
}  # fmt: skip


def definition(message: str) -> str:
    """The definition of a message and of all messages in it, as MCAP wants it (``ros2msg``)."""
    parts = [f"MSG: {name}\n{text}" if name else text for name, text in _PARTS[message].items()]
    return f"\n{'=' * 80}\n".join(parts) + "\n"


def odometry(
    child: str, stamp_ns: Integers, position: Floats, velocity: Floats | None,
    covariance: Floats | None, velocity_covariance: Floats | None,
) -> Iterator[bytes]:
    """Messages of position and velocity; unknown velocities are NaN, unknown covariances 0.

    Parameters
    ----------
    child
        Name of the child frame.
    stamp_ns
        Times since 1970 [ns]; shape (n,).
    position, velocity, covariance, velocity_covariance
        NED; shapes (n, 3) and (n, 3, 3).
    """
    count = len(stamp_ns)
    speeds = np.full((count, 3), np.nan) if velocity is None else velocity
    values = np.column_stack([
        enu(position), np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)), _of_pose(covariance, count),
        enu(speeds), np.zeros((count, 3)), _of_pose(velocity_covariance, count),
    ])  # fmt: skip
    head = bytearray(8)  # of the stamp
    _add_text(head, MAP)
    _add_text(head, child)
    _align(head, 8)
    for stamp, row in zip(stamp_ns.tolist(), values.astype("<f8"), strict=True):
        yield _ENCAPSULATION + _stamp(stamp) + head[8:] + row.tobytes()


def fixes(
    frame: str, stamp_ns: Integers, geographic: Floats, covariance: Floats | None
) -> Iterator[bytes]:
    """Messages of latitude [°], longitude [°] and height [m].

    Parameters
    ----------
    frame
        Name of the frame that is there.
    stamp_ns
        Times since 1970 [ns]; shape (n,).
    geographic
        Rows of latitude, longitude, height; shape (n, 3).
    covariance
        NED [m²]; shape (n, 3, 3).
    """
    count = len(stamp_ns)
    kinds, own = _known(covariance, count)
    values = np.column_stack([geographic, own.reshape(count, 9)])
    head = bytearray(8)
    _add_text(head, frame)
    head += pack("<b", STATUS_FIX)
    _align(head, 2)
    head += pack("<H", NO_SERVICE)
    _align(head, 8)
    for stamp, row, kind in zip(
        stamp_ns.tolist(), values.astype("<f8"), kinds.tolist(), strict=True
    ):
        yield _ENCAPSULATION + _stamp(stamp) + head[8:] + row.tobytes() + pack("<B", kind)


def _known(covariance: Floats | None, count: int) -> tuple[Integers, Floats]:
    """Type of each covariance, and the covariances in ENU with 0 for what is not known."""
    if covariance is None:
        return np.full(count, UNKNOWN), np.zeros((count, 3, 3))
    turned = enu_covariance(covariance)
    variances = np.isfinite(np.diagonal(turned, axis1=1, axis2=2)).all(axis=1)
    whole = np.isfinite(turned).all(axis=(1, 2))
    kinds = np.where(whole, KNOWN, np.where(variances, DIAGONAL_KNOWN, UNKNOWN))
    turned[~variances] = 0.0
    return kinds, np.where(np.isfinite(turned), turned, 0.0)


def _of_pose(covariance: Floats | None, count: int) -> Floats:
    """Covariances of position and turn, row by row; shape (n, 36)."""
    whole = np.zeros((count, 6, 6))
    whole[:, :3, :3] = _known(covariance, count)[1]
    return whole.reshape(count, 36)


def _stamp(time_ns: int) -> bytes:
    return pack("<iI", *divmod(time_ns, 10**9))


def _add_text(body: bytearray, text: str) -> None:
    _align(body, 4)
    content = text.encode() + b"\x00"
    body += pack("<I", len(content)) + content


def _align(body: bytearray, size: int) -> None:
    body += bytes(-len(body) % size)
