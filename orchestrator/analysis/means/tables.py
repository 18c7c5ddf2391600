"""The table of means, its columns declared."""

from __future__ import annotations

from ...data.tables import Columns, TableColumn

MEANS = Columns(
    "Mean",
    "Mean response at a level of a factor, with all others at their base.",
    (),
    (
        TableColumn("factor", "Name of the factor; empty for a study without factors.",
                    heading="factor", type=str),
        TableColumn("value", "The level.", heading="value"),
        TableColumn("runs", "Number of runs at the level.", heading="runs", type=int),
        TableColumn("mean", "Mean of the response.", heading="mean"),
        TableColumn("std", "Standard deviation of the runs.", heading="std"),
        TableColumn("low", "Lower end of the 95 % interval of the mean.", heading="low"),
        TableColumn("high", "Upper end of the 95 % interval of the mean.", heading="high"),
    ),
)
