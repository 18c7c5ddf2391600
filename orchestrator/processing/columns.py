"""The columns of the tables of a processed log, each declared once."""

from __future__ import annotations

from ..data.tables import Columns, TableColumn
from ..judge.columns import RECEIVER

OTHER = TableColumn("other", "Label of the other receiver", type=str)
SAMPLE = TableColumn("sample", "Name of the beacon, or depth", type=str)

RECEIVERS = Columns(
    "ProcessedReceiver",
    "What a receiver made of a log. Errors only with a truth, over the estimates for which it is "
    "known.",
    (RECEIVER,),
    (
        TableColumn("estimates", "Number of estimates", type=int),
        TableColumn("first_fix_s", "Epoch of the first estimate, from the start of the log", "s"),
        TableColumn("longest_gap_s", "Longest time between two estimates", "s"),
        TableColumn("judged", "Number of estimates with a known truth", heading="n", type=int,
                    sometimes=True),
        TableColumn("horizontal_rms_m", "RMS of the horizontal error", "m", "RMS", sometimes=True),
        TableColumn("horizontal_p95_m", "Radius that holds 95 % of the horizontal errors", "m",
                    "95 %", sometimes=True),
        TableColumn("horizontal_max_m", "Largest horizontal error", "m", "most", sometimes=True),
        TableColumn("total_rms_m", "RMS of the error with the depth; not in a plane", "m",
                    sometimes=True),
        TableColumn("total_p95_m", "Radius that holds 95 % of these errors", "m", sometimes=True),
        TableColumn("claimed_rms_m", "RMS of the horizontal error that the covariance claims, over "
                    "the same estimates", "m", "claimed", sometimes=True),
        TableColumn("claimed_over_made", "Claimed over actual RMS error", sometimes=True),
        TableColumn("nees", "Mean NEES of the horizontal position, 2 degrees of freedom",
                    sometimes=True),
        TableColumn("nis", "Mean NIS", sometimes=True),
        TableColumn("nis_expected", "Its expected value: the mean degrees of freedom",
                    sometimes=True),
        TableColumn("restarts", "Number of restarts", type=int | None, sometimes=True),
        TableColumn("failure", "Why the receiver failed", type=str | None, sometimes=True),
    ),
    title="Horizontal error",
)  # fmt: skip
RESIDUALS = Columns(
    "Residual",
    "Ranges and depths minus those of a receiver's estimates at the same times.",
    (RECEIVER, SAMPLE),
    (
        TableColumn("n", "Number of samples between the first and the last estimate", heading="n",
                    type=int),
        TableColumn("offset_m", "Median", "m", "offset"),
        TableColumn("std_m", "Robust standard deviation: 1.4826 times the median absolute "
                    "deviation", "m", "std"),
        TableColumn("slope", "Slope over the range (Theil and Sen's estimate)", heading="slope"),
        TableColumn("autocorrelation", "Correlation of one residual with the next of the same "
                    "beacon, both limited to three standard deviations", heading="lag 1"),
        TableColumn("tails", "Share beyond four robust standard deviations", heading="tails"),
    ),
    title="Residual",
)  # fmt: skip
AGREEMENT = Columns(
    "Agreement",
    "Distance between two receivers, at the epochs of the first.",
    (RECEIVER, OTHER),
    (
        TableColumn("horizontal_rms_m", "RMS of the horizontal distance", "m", "RMS"),
        TableColumn("total_rms_m", "RMS of the distance", "m"),
        TableColumn("max_m", "Largest distance", "m", "most"),
        TableColumn("n", "Number of epochs", heading="n", type=int),
    ),
    title="Distance",
)
ESTIMATES = Columns(
    "ProcessedEstimate",
    "An estimate, in the coordinates and on the clock of the log.",
    (RECEIVER,),
    (
        TableColumn("time_ns", "Epoch", "ns", type=int),
        TableColumn("epoch_s", "Epoch from the start of the log", "s"),
        TableColumn("x_m", "North", "m"),
        TableColumn("y_m", "East", "m"),
        TableColumn("z_m", "Down", "m"),
        TableColumn("std_x_m", "Standard deviation north, as claimed", "m", sometimes=True),
        TableColumn("std_y_m", "Standard deviation east, as claimed", "m", sometimes=True),
        TableColumn("std_z_m", "Standard deviation down, as claimed", "m", sometimes=True),
        TableColumn("true_x_m", "Truth north", "m", sometimes=True),
        TableColumn("true_y_m", "Truth east", "m", sometimes=True),
        TableColumn("true_z_m", "Truth down", "m", sometimes=True),
        TableColumn("error_x_m", "Error north", "m", sometimes=True),
        TableColumn("error_y_m", "Error east", "m", sometimes=True),
        TableColumn("error_z_m", "Error down", "m", sometimes=True),
        TableColumn("error_horizontal_m", "Horizontal error", "m", sometimes=True),
        TableColumn("latitude_deg", "Latitude, if the origin is known", "deg", sometimes=True),
        TableColumn("longitude_deg", "Longitude, likewise", "deg", sometimes=True),
    ),
)
TABLES = {
    "receivers": RECEIVERS, "residuals": RESIDUALS, "agreement": AGREEMENT, "estimates": ESTIMATES,
}
"""Tables by the names of their files."""
