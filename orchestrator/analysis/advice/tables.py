"""The table of the points of a design by cost, its columns declared."""

from __future__ import annotations

from ...data.tables import Columns, TableColumn

POINTS = Columns(
    "DesignPoint",
    "A point of the design, and its runs.",
    (),
    (
        TableColumn("cost", "Sum of the costs of its levels.", heading="cost", type=float),
        TableColumn("runs", "Number of runs at the point.", heading="runs", type=int),
        TableColumn("lost", "Number of runs that are lost or have no finite response.",
                    heading="lost", type=int),
        TableColumn("lost_upper", "Upper bound of the share of lost runs.",
                    heading="share lost, at most"),
        TableColumn("estimate", "Estimate of the percentile, or of the mean."),
        TableColumn("upper", "Upper bound of it; null where there is none.",
                    heading="upper bound"),
        TableColumn("front", "Whether no other point is cheaper and better.", type=bool),
        TableColumn("meets", "Whether it surely meets the limit.", heading="surely meets",
                    type=bool),
    ),
    more="a column for the level of each factor",
)
