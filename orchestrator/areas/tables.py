"""The table of the cells of an area, its columns declared."""

from __future__ import annotations

from ..data.tables import Columns, TableColumn

CELLS = Columns(
    "Cell",
    "A cell of an area.",
    (),
    (
        TableColumn("north_m", "North coordinate of the cell's middle.", "m"),
        TableColumn("east_m", "East coordinate of the cell's middle.", "m"),
        TableColumn("depth_m", "Depth of the cell's middle.", "m"),
        TableColumn("runs", "Runs in the cell.", type=int),
        TableColumn("p95_m", "95 % error in the cell; infinite where more than 5 % of the runs "
                    "have no estimate.", "m"),
        TableColumn("std_error_m", "Standard error of p95_m.", "m"),
        TableColumn("lost_share", "Share of the cell's own runs that are lost."),
        TableColumn("availability", "Share of the time with a fix, in the cell's own runs."),
        TableColumn("possible_p95_m", "Possible 95 % error; missing where there is no accuracy.",
                    "m"),
        TableColumn("accuracy", "Whether any accuracy is possible.", type=bool),
        TableColumn("hdop", "Horizontal dilution of precision."),
    ),
)  # fmt: skip
"""Rows of the area from south to north, each from west to east."""

DISTANCES = Columns(
    "DistanceRow",
    "Divers at a distance from the platform.",
    (),
    (
        TableColumn("depth_m", "Depth of the diver.", "m", "depth"),
        TableColumn("distance_m", "Horizontal distance from the middle of the beacons to that of "
                    "the diver's circle.", "m", "distance"),
        TableColumn("runs", "Runs at this distance.", type=int),
        TableColumn("rms_m", "RMS error, pooled over the runs; runs without an estimate are left "
                    "out.", "m", "RMS"),
        TableColumn("p95_m", "Radius that holds 95 % of the estimates; infinite where more than "
                    "5 % of the runs have none.", "m", "95 %"),
        TableColumn("std_error_m", "Standard error of p95_m.", "m"),
        TableColumn("bound_m", "p95_m plus two standard errors, for the data sheet.", "m",
                    "95 % at most"),
        TableColumn("lost_share", "Share of the runs that are lost.", heading="lost"),
        TableColumn("availability", "Share of the time with a fix."),
        TableColumn("possible_rms_m", "Possible RMS error; missing where there is no accuracy.",
                    "m", "possible RMS"),
        TableColumn("possible_p95_m", "Possible radius that holds 95 % of the estimates; missing "
                    "where there is no accuracy.", "m", "possible 95 %"),
        TableColumn("accuracy", "Whether any accuracy is possible.", type=bool),
    ),
    "errors",
)  # fmt: skip
"""Rows by depth, then by distance."""
