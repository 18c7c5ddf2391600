"""The table of the cells of an area, its columns declared."""

from __future__ import annotations

from ..data.tables import Columns, TableColumn

CELLS = Columns(
    "Cell",
    "A cell of an area.",
    (),
    (
        TableColumn("north_m", "Of its middle.", "m"),
        TableColumn("east_m", "Of its middle.", "m"),
        TableColumn("depth_m", "Of its middle.", "m"),
        TableColumn("runs", "In it.", type=int),
        TableColumn("p95_m", "Its 95 % error; infinite where more than 5 % of the runs have no "
                    "estimate.", "m"),
        TableColumn("std_error_m", "Of the 95 % error.", "m"),
        TableColumn("lost_share", "Share of its own runs that are lost."),
        TableColumn("availability", "Share of the time with a fix, of its own runs."),
        TableColumn("possible_p95_m", "What is possible; missing where there is no accuracy.",
                    "m"),
        TableColumn("accuracy", "Whether any accuracy is possible.", type=bool),
        TableColumn("hdop", "Horizontal dilution of precision."),
    ),
)  # fmt: skip
"""Rows of the area from south to north, each from west to east."""
