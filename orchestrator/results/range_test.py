"""The table of the range test, its columns declared."""

from __future__ import annotations

from ..data.tables import Columns, TableColumn

RANGE_TEST = Columns(
    "RangeTest",
    "The ranges measured at one distance.",
    (),
    (
        TableColumn("distance_m", "True distance.", "m", type=float),
        TableColumn("pings", "Number of ranges.", type=int),
        TableColumn("mean_m", "Of the ranges.", "m", type=float),
        TableColumn("std_m", "Of the ranges.", "m", type=float),
        TableColumn("error_m", "Mean minus distance.", "m", type=float),
    ),
)
