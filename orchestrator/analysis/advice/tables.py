"""The table of the points of a design by cost, its columns declared."""

from __future__ import annotations

from ...data.tables import Columns, TableColumn

POINTS = Columns(
    "DesignPoint",
    "A point of the design, with the runs at it.",
    (),
    (
        TableColumn("cost", "Sum of the costs of its levels.", heading="cost", type=float),
        TableColumn("runs", "At it.", heading="runs", type=int),
        TableColumn("lost", "Of these, lost or without a finite response.", heading="lost",
                    type=int),
        TableColumn("lost_upper", "Bound of the share of lost runs.",
                    heading="share lost, at most"),
        TableColumn("estimate", "Of the percentile, or of the mean."),
        TableColumn("upper", "Its bound; null where there is none.", heading="upper bound"),
        TableColumn("front", "No other point is cheaper and better.", type=bool),
        TableColumn("meets", "Whether it surely meets the limit.", heading="meets", type=bool),
    ),
    more="a column for the level of each factor",
)
