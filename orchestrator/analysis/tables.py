"""The table of verdicts on covariances, its columns declared."""

from __future__ import annotations

from typing import Literal

from ..data.tables import Columns, TableColumn

VERDICTS = Columns(
    "CovarianceAtPoint",
    "What the runs at a point of a study say of a receiver's covariance.",
    (),
    (
        TableColumn("receiver", "Its label.", type=str),
        TableColumn("frame", "Of the covariance.", type=Literal["absolute", "own_relative"]),
        TableColumn("point", "Number of the point.", type=int),
        TableColumn("verdict", "Of the covariance.",
                    type=Literal["in band", "optimistic", "pessimistic", "one run", "unknown"]),
        TableColumn("factor", "True standard deviation over the claimed one; above 1 is "
                    "optimistic."),
        TableColumn("runs", "With a NEES.", type=int),
        TableColumn("mean_nees", "Over the runs."),
        TableColumn("basis", "What is compared with 3; the median if few runs make the mean.",
                    type=Literal["mean", "median"]),
        TableColumn("centre", "That mean or median."),
        TableColumn("low", "Of its 95 % interval."),
        TableColumn("high", "Of its 95 % interval."),
        TableColumn("runs_far_above", "Runs beyond what normal errors explain.", type=int),
        TableColumn("runs_needed", "To tell a factor of 1.1.", type=int | None),
        TableColumn("lost_share", "Of the runs; where many are lost, a covariance that is not "
                    "optimistic is unknown."),
        TableColumn("words", "All this as a sentence.", type=str),
    ),
    more="a column for the level of each factor",
)  # fmt: skip
