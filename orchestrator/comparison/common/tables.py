"""The tables of many runs, their columns declared: levels of responses, and paired differences."""

from __future__ import annotations

from typing import Literal

from ...data.tables import Columns, TableColumn

_RESPONSE = "Column of the table of runs, without the receiver's name."

LEVELS = Columns(
    "Level",
    "A response of a receiver over the runs of a scenario, or over all of them.",
    (),
    (
        TableColumn("scenario", "Or ``all scenarios``, where a seed's value is the mean over the "
                    "scenarios.", type=str),
        TableColumn("receiver", "Its label.", type=str),
        TableColumn("response", _RESPONSE, type=str),
        TableColumn("runs", "Seeds.", type=int),
        TableColumn("failed", "Of those, without a response.", type=int),
        TableColumn("mean", "Of the others; of an RMS response the mean of the runs' RMS."),
        TableColumn("rms_over_runs", "Root of the mean over the runs of their mean squares, over "
                    "all scenarios the mean of theirs; null if the response is no RMS."),
        TableColumn("std", "Standard deviation of the runs."),
        TableColumn("median", "Of the runs."),
        TableColumn("least", "Of the runs."),
        TableColumn("most", "Of the runs."),
        TableColumn("low", "Of the 95 % interval of the mean; null if there are too few runs."),
        TableColumn("high", "Of the 95 % interval of the mean."),
        TableColumn("within", "95th percentile over the runs; null if more have failed."),
        TableColumn("within_upper", "Its 95 % upper bound; null with fewer than 59 runs."),
        TableColumn("tail", "Share of the squares about the median that the worst runs make, 1 in "
                    "20."),
        TableColumn("tail_runs", "Number of these worst runs.", type=int),
        TableColumn("heavy_tailed", "Whether they make so much that a mean says little.",
                    type=bool),
        TableColumn("lost", "Runs, over all scenarios where it is of all.", type=int),
        TableColumn("lost_low", "Of the 95 % interval of the share of lost runs; null over all "
                    "scenarios."),
        TableColumn("lost_high", "As lost_low."),
        TableColumn("covariance", "What the runs say of it.",
                    type=Literal["in band", "optimistic", "pessimistic", "one run", "unknown"]),
        TableColumn("covariance_factor", "True standard deviation over the claimed one; above 1 is "
                    "optimistic."),
        TableColumn("covariance_words", "The same as a sentence.", type=str),
        TableColumn("nees_runs", "Seeds with a NEES.", type=int),
    ),
)  # fmt: skip
DIFFERENCES = Columns(
    "PairedDifference",
    "A response of a receiver minus that of another; less is better.",
    (),
    (
        TableColumn("scenario", "Or ``all scenarios``.", type=str),
        TableColumn("response", _RESPONSE, type=str),
        TableColumn("one", "Label of the first receiver.", type=str),
        TableColumn("other", "Label of the other one.", type=str),
        TableColumn("runs", "Seeds.", type=int),
        TableColumn("wins", "Runs in which the first one is better.", type=int),
        TableColumn("losses", "Runs in which it is worse.", type=int),
        TableColumn("verdict", "Of the first one.",
                    type=Literal["better", "worse", "equal", "undecided"]),
        TableColumn("share_low", "Of all dives, at least, in which the better one is better; null "
                    "if neither surely is."),
        TableColumn("median", "Of the differences."),
        TableColumn("low", "Of the interval of the median, which holds at once with all others; "
                    "null if there is none."),
        TableColumn("high", "As low."),
        TableColumn("mean", "Of the differences."),
        TableColumn("mean_low", "Of the interval of the mean; null where its assumptions do not "
                    "hold, or undecided."),
        TableColumn("mean_high", "As mean_low."),
        TableColumn("least", "Runs that a verdict takes at least.", type=int),
        TableColumn("mean_least", "Runs that an interval of the mean takes at least.", type=int),
        TableColumn("runs_needed", "Estimated number of runs that would decide.",
                    type=int | None),
    ),
)  # fmt: skip
