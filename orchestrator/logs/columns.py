"""The columns of a log's tables, each declared once."""

from __future__ import annotations

from typing import Literal

from ..data.tables import Columns, TableColumn

KINDS = ("one-way", "two-way", "range", "pseudorange", "inverted", "difference")
"""Kinds of receptions: how the epoch of a range follows from its arrival (`epoch_ns`)."""
SIGNED = "difference"
"""The kind whose ranges may be negative."""
FROM_DIVER = ("inverted", SIGNED)
"""Kinds of ranges for which the diver pings and the beacons listen."""
AT_ARRIVAL = ("range", *FROM_DIVER)
"""Kinds of ranges that belong to the time of the arrival."""
OF_RANGING = {"one_way": "one-way", "two_way": "two-way", "inverted": "inverted"}
"""Kinds of ranges by the key ``acoustics.ranging``; without a common clock they are `SIGNED`."""
FARTHEST = 1e6
"""Longest range, and largest coordinate, that counts as a number [m]."""
TIMES = "int64"
"""Type of times: whole nanoseconds of the log's clock."""

RECEPTIONS = Columns(
    "Reception",
    "A packet that the receiver heard.",
    (),
    (
        TableColumn("arrival_ns", "Time of the arrival; ``time_ns`` is another name", "ns",
                    type=int, sometimes=True),
        TableColumn("epoch_ns", "Time to which the range belongs, where the device knows it: that "
                    "of the ping", "ns", type=int, sometimes=True),
        TableColumn("beacon", "Name of the beacon", type=str),
        TableColumn("kind", "How the range was measured. The epoch is the arrival minus the travel "
                    "time for ``one-way``, the default, and ``pseudorange``, minus half of the "
                    "round trip and of the turn-around for ``two-way``, and the arrival itself for "
                    "``range``, and for ``inverted`` and ``difference``, where the diver pings and "
                    "the beacons listen: the mean arrival of the ``ping``, if numbered. A "
                    "``difference`` counts from the arrival at the middle of the beacons, without "
                    "a common clock. One of",
                    type=Literal[KINDS], sometimes=True),
        TableColumn("range_m", "Range; it takes precedence over a time of flight", "m",
                    type=float, sometimes=True),
        TableColumn("time_of_flight_s", "Time of flight; both ways with the turn-around if the "
                    "kind is ``two-way``", "s", type=float, sometimes=True),
        TableColumn("turn_around_s", "Time between hearing and answering of a beacon that is asked",
                    "s", type=float, sometimes=True),
        TableColumn("ping", "Number that the receptions of one emission share", type=int,
                    sometimes=True),
        TableColumn("tag", "Name of the device that was located", type=str, sometimes=True),
        *(TableColumn(f"reported_{axis}_m", "Position of the beacon as its packet reports it, "
                      "north, east, down; without it, that of ``[beacons]`` in meta.toml", "m",
                      type=float, sometimes=True) for axis in "ned"),
        TableColumn("reported_std_m", "Standard deviation of that position, as reported", "m",
                    type=float, sometimes=True),
        *(TableColumn(f"platform_{axis}_m", "Position of the platform in the packet, north, east, "
                      "down", "m", type=float, sometimes=True) for axis in "ned"),
        *(TableColumn(f"platform_{angle}_rad", "Attitude of the platform in the packet: roll, "
                      "pitch, yaw", "rad", type=float, sometimes=True)
          for angle in ("roll", "pitch", "yaw")),
        TableColumn("valid", "Whether the device calls the range valid", type=bool, sometimes=True),
        TableColumn("quality", "Quality as the device reports it; it is kept, not used",
                    type=float, sometimes=True),
        TableColumn("repeated", "Whether the value was only read again, and not measured anew",
                    type=bool, sometimes=True),
        TableColumn("line", "Line in the source", type=int, sometimes=True),
    ),
    more="Positions of all beacons in the packet, `packet_NAME_n_m`, `packet_NAME_e_m` and "
    "`packet_NAME_d_m`.",
)  # fmt: skip
DEPTH = Columns(
    "Depth",
    "A reading of the depth sensor.",
    (),
    (
        TableColumn("time_ns", "Time of the reading", "ns", type=int),
        TableColumn("depth_m", "Depth below the surface", "m", type=float),
        TableColumn("line", "Line in the source", type=int, sometimes=True),
    ),
)
TRUTH = Columns(
    "Truth",
    "A true position of the diver.",
    (),
    (
        TableColumn("time_ns", "Time, on the log's clock or one of its own (``[clock.truth]``)",
                    "ns", type=int),
        *(TableColumn(f"{axis}_m", "North, east, down", "m", type=float) for axis in "ned"),
        *(TableColumn(f"velocity_{axis}_m_s", "Velocity north, east, down, in m/s", "", type=float,
                      sometimes=True) for axis in "ned"),
        TableColumn("std_m", "Standard deviation of the position", "m", type=float, sometimes=True),
        TableColumn("line", "Line in the source", type=int, sometimes=True),
    ),
)
FIXES = Columns(
    "Fix",
    "A position that a device has computed itself.",
    (),
    (
        TableColumn("time_ns", "Time of the position", "ns", type=int),
        TableColumn("device", "Name of the device", type=str, sometimes=True),
        *(TableColumn(f"{axis}_m", "North, east, down", "m", type=float) for axis in "ned"),
        TableColumn("std_m", "Standard deviation per axis, as the device reports it", "m",
                    type=float, sometimes=True),
        TableColumn("valid", "Whether the device calls the position valid", type=bool,
                    sometimes=True),
        TableColumn("repeated", "Whether the value was only read again, and not measured anew",
                    type=bool, sometimes=True),
        TableColumn("line", "Line in the source", type=int, sometimes=True),
    ),
)
TABLES = {"receptions": RECEPTIONS, "depth": DEPTH, "truth": TRUTH, "fixes": FIXES}
"""The tables of a log, by the names of their files."""
