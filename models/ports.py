"""The ports between components, defined once for both ends of each connection."""

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
    output("reported_beacon_position", "Positions that the beacons broadcast, NED: true ones plus "
           "the errors of GPS, IMU and installation", "m", shape=(BEACONS, 3)),
)
REPORTED_POSE = (
    output("reported_position", "Position of the reference point by GPS, NED", "m", shape=(3,)),
    output("reported_attitude", "Roll, pitch, yaw by IMU", "rad", shape=(3,)),
)
DEPTH = (
    output("depth", "Newest reading of the depth sensor; 0 before the first", "m",
           variability="discrete"),
    output("depth_epoch", "Time of that reading; the start time before the first", "s",
           variability="discrete"),
)
RECEPTION = (
    output("range", "Newest range to each beacon", "m", shape=(BEACONS,), variability="discrete"),
    output("range_epoch", "Time of the ping that gave each range; the start time before the first",
           "s", shape=(BEACONS,), variability="discrete"),
    output("reception_count", "Number of packets received from each beacon", shape=(BEACONS,),
           type="Int32", start=0),
    output("ping_beacon_position", "Where each beacon said it was in its newest received packet, "
           "NED", "m", shape=(BEACONS, 3), variability="discrete"),
    output("packet_beacon_position", "Positions of all beacons in the newest received packet, NED",
           "m", shape=(BEACONS, 3), variability="discrete"),
)
PING_POSE = (
    output("ping_platform_position", "Where the platform said it was in the newest received packet "
           "of each beacon, NED", "m", shape=(BEACONS, 3), variability="discrete"),
    output("ping_platform_attitude", "Roll, pitch, yaw that the platform said it had in that "
           "packet", "rad", shape=(BEACONS, 3), variability="discrete"),
    output("arrival_epoch", "Time at which that packet arrived; the start time before the first",
           "s", shape=(BEACONS,), variability="discrete"),
)
ESTIMATE = (
    output("valid", "Whether there has been a fix", type="Boolean", start=False),
    output("update_count", "Number of valid estimates so far", type="Int32", start=0),
    output("epoch", "Time to which the estimate belongs", "s", variability="discrete"),
    output("position", "Estimated position of the receiver, NED", "m", shape=(3,),
           variability="discrete"),
    output("velocity", "Estimated velocity of the receiver, NED", "m/s", shape=(3,),
           variability="discrete"),
    output("position_std", "Standard deviations of the estimated position, NED", "m", shape=(3,),
           variability="discrete"),
    output("covariance", "Covariance of (x, vx, y, vy, z, vz), the order of the paper's state, in "
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
    output("clock_offset", "Estimated receiver's clock minus the beacons'", "s",
           variability="discrete"),
    output("sound_speed", "Estimated speed of sound", "m/s", variability="discrete"),
    output("restart_count", "Number of times the receiver has started anew", type="Int32", start=0),
)
"""What a receiver may say of the system around it."""
REQUIRED_ESTIMATE = ("epoch", "position", "update_count")
"""Outputs that every receiver must have. The others are optional, but their meaning is fixed."""


def ports(variables: Iterable[Variable], causality: Causality, prefix: str = ""
          ) -> tuple[Variable, ...]:
    """The ports as declared at one end, e.g. ``target_position`` as an input."""
    return tuple(
        replace(v, name=prefix + v.name, causality=causality) for v in variables
    )


def terminal(name: str, kind: TerminalKind, description: str, variables: Iterable[Variable]
             ) -> Terminal:
    """A terminal whose member names are the names of the variables."""
    members: Mapping[str, str] = {v.name: v.name for v in variables}
    return Terminal(name, kind, description, members)


BROADCAST = (
    terminal("beacons", "beacons", "Where the beacons are, and what they say of it",
             BEACON_POSITIONS),
    terminal("reported_pose", "reported_pose", "The pose that the platform broadcasts",
             REPORTED_POSE),
)
"""Terminals between the platform and the acoustics."""
