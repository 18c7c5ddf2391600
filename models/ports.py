"""Ports between components, defined once for both ends of each connection."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from .declaration import Causality, Dimension, Terminal, TerminalKind, Variable, output

BEACONS = Dimension(4, "beacons", 3, 8)
"""Number of beacons of a system: a constant of the build."""

MOTION = (
    output("position", "True position of the receiver, NED", "m", shape=(3,)),
    output("velocity", "True velocity of the receiver, NED", "m/s", shape=(3,)),
)
BEACON_POSITIONS = (
    output("beacon_position", "True positions of the beacons, NED", "m", shape=(BEACONS, 3)),
    output("reported_beacon_position", "Beacon positions as broadcast, NED: true positions plus "
           "errors of GPS, IMU and installation", "m", shape=(BEACONS, 3)),
)
REPORTED_POSE = (
    output("reported_position", "GPS position of the reference point, NED", "m", shape=(3,)),
    output("reported_attitude", "Roll, pitch, yaw from the IMU", "rad", shape=(3,)),
)
DEPTH = (
    output("depth", "Newest reading of the depth sensor; 0 before the first", "m",
           variability="discrete"),
    output("depth_epoch", "Time of that reading; the start time before the first", "s",
           variability="discrete"),
)
RECEPTION = (
    output("range", "Newest range to each beacon", "m", shape=(BEACONS,), variability="discrete"),
    output("range_epoch", "Time to which each range belongs; the start time before the first", "s",
           shape=(BEACONS,), variability="discrete"),
    output("reception_count", "Number of packets received from each beacon", shape=(BEACONS,),
           type="Int32", start=0),
    output("ping_beacon_position", "Reported position of each beacon in the newest packet "
           "received from it, NED", "m", shape=(BEACONS, 3), variability="discrete"),
    output("packet_beacon_position", "Positions of all beacons in the newest packet received, NED",
           "m", shape=(BEACONS, 3), variability="discrete"),
)
PING_POSE = (
    output("ping_platform_position", "Position of the platform in the newest packet received "
           "from each beacon, NED", "m", shape=(BEACONS, 3), variability="discrete"),
    output("ping_platform_attitude", "Roll, pitch, yaw of the platform in that "
           "packet", "rad", shape=(BEACONS, 3), variability="discrete"),
    output("arrival_epoch", "Arrival time of that packet; the start time before the first",
           "s", shape=(BEACONS,), variability="discrete"),
)
ESTIMATE = (
    output("valid", "Whether there is an estimate yet", type="Boolean", start=False),
    output("update_count", "Number of valid estimates so far", type="Int32", start=0),
    output("epoch", "Time to which the estimate belongs", "s", variability="discrete"),
    output("position", "Estimated position of the receiver, NED", "m", shape=(3,),
           variability="discrete"),
    output("velocity", "Estimated velocity of the receiver, NED", "m/s", shape=(3,),
           variability="discrete"),
    output("position_std", "Standard deviations of the estimated position, NED", "m", shape=(3,),
           variability="discrete"),
    output("covariance", "Covariance of (x, vx, y, vy, z, vz), ordered as the paper's state, in "
           "SI units", shape=(6, 6), variability="discrete"),
    output("nis", "Normalised innovation squared of the newest update", variability="discrete"),
    output("nis_degrees", "Number of scalar measurements in that update", type="Int32", start=0),
)
SYSTEM = (
    output("relative_position", "Estimated position of the receiver minus that of the platform, "
           "NED", "m", shape=(3,), variability="discrete"),
    output("relative_covariance", "Covariance of that difference, in m2", shape=(3, 3),
           variability="discrete"),
    output("platform_position", "Estimated position of the platform's reference point, NED", "m",
           shape=(3,), variability="discrete"),
    output("clock_offset", "Estimated offset of the receiver's clock from the beacons' clock", "s",
           variability="discrete"),
    output("sound_speed", "Estimated speed of sound", "m/s", variability="discrete"),
    output("restart_count", "Number of restarts of the receiver", type="Int32", start=0),
    output("motion_psd", "Power spectral density of the receiver's acceleration per axis: learned, "
           "or as given", "m2/s3", variability="discrete"),
)
"""Outputs by which a receiver reports on the system around it."""
REQUIRED_ESTIMATE = ("epoch", "position", "update_count")
"""Outputs that every receiver must have. All others are optional, but their meaning is fixed."""


def ports(variables: Iterable[Variable], causality: Causality, prefix: str = ""
          ) -> tuple[Variable, ...]:
    """The ports as declared at one end, for example ``target_position`` as an input."""
    return tuple(
        replace(v, name=prefix + v.name, causality=causality) for v in variables
    )


def terminal(name: str, kind: TerminalKind, description: str, variables: Iterable[Variable]
             ) -> Terminal:
    """A terminal whose members have the names of the variables."""
    members: Mapping[str, str] = {v.name: v.name for v in variables}
    return Terminal(name, kind, description, members)


BROADCAST = (
    terminal("beacons", "beacons", "Beacon positions, true and as broadcast",
             BEACON_POSITIONS),
    terminal("reported_pose", "reported_pose", "The pose that the platform broadcasts",
             REPORTED_POSE),
)
"""Terminals between the platform and the acoustics."""
