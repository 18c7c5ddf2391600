"""The tables of what is in a log, their columns declared."""

from __future__ import annotations

from ..data.tables import Columns, TableColumn


def _in_time(what: str) -> tuple[TableColumn, ...]:
    """What is counted of ranges and of values alike, and when they came."""
    return (
        TableColumn("left_out", "Number that are left out.", heading="left out", type=int),
        TableColumn("repeated", "Number of these that were only read again.", heading="repeated",
                    type=int),
        TableColumn("used_share", f"Share of its {what} that can be used.", heading="used"),
        TableColumn("rate_Hz", f"{what.capitalize()} per second, from the first to the last.", "Hz",
                    "rate"),
        TableColumn("gaps", "Number of pauses longer than five times the median, those at the ends "
                    "of the log included.", heading="gaps", type=int),
        TableColumn("longest_gap_s", f"Longest time between two {what}, or gap at an end of the "
                    "log.", "s", "longest"),
        TableColumn("first_s", "Time of the first, from the start of the log.", "s"),
        TableColumn("last_s", "Time of the last.", "s"),
    )


BEACONS = Columns(
    "HeardBeacon",
    "The ranges of one beacon.",
    (),
    (
        TableColumn("beacon", "Name of the beacon.", heading="beacon", type=str),
        TableColumn("ranges", "Number of ranges that can be used.", heading="ranges", type=int),
        *_in_time("ranges"),
        TableColumn("shortest_m", "Shortest range.", "m", "from"),
        TableColumn("median_m", "Median range.", "m", "median"),
        TableColumn("longest_m", "Longest range.", "m", "to"),
    ),
    unit="",
)
SERIES = Columns(
    "LoggedSeries",
    "The depths, the truth, or the positions that a device has computed itself.",
    (),
    (
        TableColumn("series", "``depth``, ``truth``, or ``fixes`` with the name of the device.",
                    heading="series", type=str),
        TableColumn("values", "Number of values that can be used.", heading="values", type=int),
        *_in_time("values"),
    ),
    unit="",
)
FLAWS = Columns(
    "LoggedFlaw",
    "Lines of the source that could not be used as they stand.",
    (),
    (
        TableColumn("file", "File with these entries.", heading="file", type=str),
        TableColumn("flaw", "What is wrong with the entries.", heading="flaw", type=str),
        TableColumn("used", "Whether they are corrected and used.", heading="used",
                    type=bool),
        TableColumn("entries", "Number of entries; a line may have several.", heading="entries",
                    type=int),
        TableColumn("lines", "Numbers of the lines, from 1, with blanks between them.",
                    heading="lines", type=str),
    ),
)
