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
        TableColumn("scenario", "Name, or ``all scenarios``, where a seed's value is the mean "
                    "over the scenarios.", type=str),
        TableColumn("receiver", "Label of the receiver.", type=str),
        TableColumn("response", _RESPONSE, type=str),
        TableColumn("runs", "Number of seeds.", type=int),
        TableColumn("failed", "Number of these without a response.", type=int),
        TableColumn("mean", "Mean of the others; for an RMS response the mean of the runs' RMS."),
        TableColumn("rms_over_runs", "Root of the mean of the runs' mean squares; over all "
                    "scenarios the mean of theirs; null if the response is not an RMS."),
        TableColumn("std", "Standard deviation over the runs."),
        TableColumn("median", "Median over the runs."),
        TableColumn("least", "Smallest value of the runs."),
        TableColumn("most", "Largest value of the runs."),
        TableColumn("low", "Lower end of the 95 % interval of the mean; null if there are too few "
                    "runs."),
        TableColumn("high", "Upper end of the 95 % interval of the mean."),
        TableColumn("within", "95th percentile over the runs; null if more have failed."),
        TableColumn("within_upper", "Upper 95 % confidence bound of within; null with fewer than "
                    "59 runs."),
        TableColumn("tail", "Share of the squares about the median that the worst runs make, 1 in "
                    "20."),
        TableColumn("tail_runs", "Number of these worst runs.", type=int),
        TableColumn("heavy_tailed", "Whether they contribute so large a part that a mean says "
                    "little.",
                    type=bool),
        TableColumn("lost", "Number of lost runs, over all scenarios in the rows of all.",
                    type=int),
        TableColumn("lost_low", "Lower end of the 95 % interval of the share of lost runs; null "
                    "over all scenarios."),
        TableColumn("lost_high", "Upper end of the interval of the share of lost runs."),
        TableColumn("misleading", "Number of misleading runs, over all scenarios in the rows of "
                    "all; null without NEES.", type=int | None),
        TableColumn("misleading_low", "Lower end of the 95 % interval of the share of misleading "
                    "runs; null over all scenarios, and without NEES."),
        TableColumn("misleading_high", "Upper end of the interval of the share of misleading "
                    "runs."),
        TableColumn("misleading_known", "Number of runs with a NEES, of which they are a share.",
                    type=int),
        TableColumn("covariance", "What the runs say about the covariance.",
                    type=Literal["in band", "optimistic", "pessimistic", "one run", "unknown"]),
        TableColumn("covariance_factor", "True standard deviation over the claimed one; above 1 is "
                    "optimistic."),
        TableColumn("covariance_words", "The verdict on the covariance as a sentence.", type=str),
        TableColumn("nees_runs", "Number of seeds with a NEES.", type=int),
    ),
)  # fmt: skip
DIFFERENCES = Columns(
    "PairedDifference",
    "A response of a receiver minus that of another; less is better.",
    (),
    (
        TableColumn("scenario", "Name, or ``all scenarios``.", type=str),
        TableColumn("response", _RESPONSE, type=str),
        TableColumn("one", "Label of the first receiver.", type=str),
        TableColumn("other", "Label of the other one.", type=str),
        TableColumn("runs", "Number of seeds.", type=int),
        TableColumn("wins", "Runs in which the first one is better.", type=int),
        TableColumn("losses", "Runs in which it is worse.", type=int),
        TableColumn("verdict", "Verdict on the first receiver.",
                    type=Literal["better", "worse", "equal", "undecided"]),
        TableColumn("share_low", "Lower bound of the share of all dives in which the better one "
                    "is better; null if neither surely is."),
        TableColumn("median", "Median of the differences."),
        TableColumn("low", "Lower end of the interval of the median, which holds simultaneously "
                    "with all others; null if there is none."),
        TableColumn("high", "Upper end of the interval of the median."),
        TableColumn("mean", "Mean of the differences."),
        TableColumn("mean_low", "Lower end of the interval of the mean; null where its "
                    "assumptions do not hold, or the verdict is undecided."),
        TableColumn("mean_high", "Upper end of the interval of the mean."),
        TableColumn("least", "Smallest number of runs for a verdict.", type=int),
        TableColumn("mean_least", "Smallest number of runs for an interval of the mean.", type=int),
        TableColumn("runs_needed", "Estimated number of runs for a decision.",
                    type=int | None),
    ),
)  # fmt: skip
