"""The table of means, its columns declared."""

from __future__ import annotations

from ...data.tables import Columns, TableColumn

MEANS = Columns(
    "Mean",
    "Mean response at a level of a factor, the others at their base.",
    (),
    (
        TableColumn("factor", "Empty for a study without factors.", heading="factor", type=str),
        TableColumn("value", "The level.", heading="value"),
        TableColumn("runs", "At the level.", heading="runs", type=int),
        TableColumn("mean", "Of the response.", heading="mean"),
        TableColumn("std", "Standard deviation of the runs.", heading="std"),
        TableColumn("low", "Of the 95 % interval of the mean.", heading="low"),
        TableColumn("high", "Of the 95 % interval of the mean.", heading="high"),
    ),
)
