"""The table of verdicts on covariances, its columns declared."""

from __future__ import annotations

from typing import Literal

from ..data.tables import Columns, TableColumn

VERDICTS = Columns(
    "CovarianceAtPoint",
    "What the runs at a point of a study say about a receiver's covariance.",
    (),
    (
        TableColumn("receiver", "Label of the receiver.", type=str),
        TableColumn("frame", "Frame of the error.", type=Literal["absolute", "own_relative"]),
        TableColumn("point", "Number of the point.", type=int),
        TableColumn("verdict", "Verdict on the covariance.",
                    type=Literal["in band", "optimistic", "pessimistic", "one run", "unknown"]),
        TableColumn("factor", "True standard deviation over the claimed one; above 1 is "
                    "optimistic."),
        TableColumn("runs", "Number of runs with a NEES.", type=int),
        TableColumn("mean_nees", "Mean NEES over the runs."),
        TableColumn("basis", "Statistic that is compared with 3, the median if a few runs dominate "
                    "the mean.",
                    type=Literal["mean", "median"]),
        TableColumn("centre", "Value of this statistic."),
        TableColumn("low", "Lower end of its 95 % interval."),
        TableColumn("high", "Upper end of its 95 % interval."),
        TableColumn("runs_far_above", "Number of runs above what normal errors explain.",
                    type=int),
        TableColumn("runs_needed", "Number of runs that reveal a factor of 1.1.", type=int | None),
        TableColumn("lost_share", "Share of lost runs. Where many are lost, a covariance that is "
                    "not optimistic is unknown."),
        TableColumn("words", "The verdict as a sentence.", type=str),
    ),
    more="a column for the level of each factor",
)  # fmt: skip
