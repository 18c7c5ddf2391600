"""The columns of a run's tables, each declared once.

The declarations define the DataFrames and their files, printed tables, notebook views, the
documents of ``--json`` with their JSON schemas, and the tables of the reference.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np

from ..data.estimates import Floats
from ..data.tables import Columns, TableColumn
from .definitions import (
    AXES,
    BEYOND_M,
    FRAMES,
    MISLEADING_NEES,
    MISLEADING_S,
    PERCENTAGES,
    POSITION_STATES,
    PREFIXES,
    Judged,
    errors_of,
    nees,
    of_position,
    percentile_column,
)

CovarianceVerdict = Literal["consistent", "optimistic", "pessimistic", "unknown"]
"""Verdicts of `metrics.verdict` on a mean NEES or NIS."""


RECEIVER = TableColumn("receiver", "Label of the receiver", type=str)
FRAME = TableColumn("frame", "Reference of the error", type=Literal[FRAMES])
AXIS = TableColumn("axis", "Axis of the error", heading="axis", type=Literal[(*AXES, "total")])
LENGTH = TableColumn("length", "Kind of length", heading="error", type=Literal["horizontal",
"total"])

ERRORS = Columns(
    "Statistics",
    "Statistics of an error over all estimates.",
    (RECEIVER, FRAME, AXIS),
    (
        TableColumn("mean_m", "Mean: signed for an axis, of the length for the total", "m", "mean",
                    of=lambda e: e.mean()),
        TableColumn("rms_m",
                    "Root mean square; squared, the axes add up to the total", "m",
                    "RMS", of=lambda e: np.sqrt((e * e).mean())),
        TableColumn("std_m", "Standard deviation about the mean: rms² = mean² + std²", "m", "std",
                    of=lambda e: e.std()),
        TableColumn("n", "Number of estimates", type=int, of=len, without=0),
    ),
    title="Error",
)  # fmt: skip
"""Functions of the errors of an axis, or of their lengths [m], over all estimates that count."""


def _percentile(p: int) -> TableColumn:
    rank = f"of n errors, the one with rank {p / 100:g} n, rounded up"
    words = "Largest error" if p == 100 else f"Radius that holds {p} % of the estimates: {rank}"
    return TableColumn(percentile_column(p), words, "m", "all" if p == 100 else f"{p} %")


PERCENTILES = Columns(
    "Percentiles",
    "Percentiles of the length of an error; the horizontal p50 is CEP50.",
    (RECEIVER, FRAME, LENGTH),
    tuple(map(_percentile, PERCENTAGES)),
    title="Within",
)


@dataclass(frozen=True)
class ChiSquare:
    """A NEES or NIS whose mean has a band and a verdict in the summary.

    Attributes
    ----------
    name
        Name of the column of estimates.
    words, description
        Its name in words, and the description of its mean.
    degrees
        Degrees of freedom; None if each estimate has its own.
    """

    name: str
    words: str
    description: str
    degrees: int | None

    def columns(self) -> Iterator[TableColumn]:
        """Columns of the summary for it (see `metrics.of_chi_square`)."""
        name, verdict = self.name, CovarianceVerdict | None
        yield TableColumn(name, self.description)
        yield TableColumn(f"{name}_expected", "Expected value for a right covariance")
        yield TableColumn(f"{name}_low", "Lower limit of its 95 % band")
        yield TableColumn(f"{name}_high", "Upper limit of its 95 % band")
        yield TableColumn(f"{name}_verdict", "Verdict: the mean against the band", type=verdict)


CHI_SQUARES = (
    ChiSquare("nees_position", "NEES of the position", "Mean NEES of the absolute position", 3),
    ChiSquare("relative_nees_position", "relative NEES of the position",
              "Mean NEES of the position relative to the reported platform", 3),
    ChiSquare("own_relative_nees_position", "own relative NEES of the position",
              "Mean NEES of the receiver's own relative position", 3),
    ChiSquare("nees_state", "NEES of the state", "Mean NEES of position and velocity", 6),
    ChiSquare("nis", "NIS", "Mean NIS", None),
)  # fmt: skip

SUMMARY = Columns(
    "Summary",
    "Availability and consistency of a receiver; null for one that failed before the end.",
    (RECEIVER,),
    (
        TableColumn("estimates", "Number of valid estimates", type=int | None),
        TableColumn("first_fix_s", "Epoch of the first valid estimate", "s"),
        TableColumn("availability", "Share of the time with an estimate available"),
        TableColumn("update_share", "Share of the updates that gave a new estimate"),
        *(column for one in CHI_SQUARES for column in one.columns()),
        TableColumn("inconsistent", "NEES of the position is above its band; null without NEES",
                    type=bool | None),
        TableColumn("lost", "No good estimate in the last quarter", type=bool | None),
        TableColumn("beyond_claim", "Share of the time with an error beyond three times what is "
                    f"claimed and more than {BEYOND_M:g} m; null without NEES"),
        TableColumn("beyond_claim_longest_s", "Longest such time without a break", "s"),
        TableColumn("misleading", f"Beyond its claim for more than {MISLEADING_S:g} s without a "
                    f"break, or RMS error above {BEYOND_M:g} m with a mean NEES above "
                    f"{MISLEADING_NEES:g}; null without NEES", type=bool | None),
        TableColumn("failure", "Why the receiver failed", type=str | None, sometimes=True),
    ),
)  # fmt: skip


# --- Estimates: functions of `Judged`; None if a receiver has no such column ----------------------


def _claimed_std(judged: Judged) -> Floats | None:
    estimates, P = judged.estimates, judged.estimates.covariance
    if estimates.position_std is not None or P is None:
        return estimates.position_std
    return np.sqrt(P[:, POSITION_STATES, POSITION_STATES])


def _own_std(judged: Judged) -> Floats | None:
    P = judged.estimates.relative_covariance
    if judged.own_relative_nees is None or P is None:
        return None
    variances = np.diagonal(P, axis1=1, axis2=2)
    return np.sqrt(np.where(variances >= 0, variances, np.nan))


def _position_nees(judged: Judged) -> Floats | None:
    return None if judged.estimates.covariance is None else judged.nees


def _relative_nees(judged: Judged) -> Floats | None:
    P = judged.estimates.covariance
    if P is None or judged.relative is None:
        return None
    return nees(judged.relative, of_position(P))


def _state_nees(judged: Judged) -> Floats | None:
    estimates, P = judged.estimates, judged.estimates.covariance
    if P is None or estimates.velocity is None:
        return None
    # the paper's order: position, then velocity, for each axis
    pairs = np.stack([judged.error, estimates.velocity - judged.true_velocity], axis=2)
    return nees(pairs.reshape(-1, 6), P)


def _own_nees(judged: Judged) -> Floats | None:
    known = judged.estimates.relative_covariance is not None
    return judged.own_relative_nees if known else None


def _error(frame: str, judged: Judged) -> Floats | None:
    return errors_of(judged).get(frame, (None, None))[0]


def _length(frame: str, judged: Judged) -> Floats | None:
    square = errors_of(judged).get(frame, (None, None))[1]
    return None if square is None else np.sqrt(square)


def _component(of: Callable[[Judged], Floats | None], i: int, judged: Judged) -> Floats | None:
    values = of(judged)
    return None if values is None else values[:, i]


def _by_axis(
    prefix: str, description: str, of: Callable[[Judged], Floats | None]
) -> Iterator[TableColumn]:
    for i, axis in enumerate(AXES):
        yield TableColumn(f"{prefix}{axis}_m", description, "m", of=partial(_component, of, i))


def _errors() -> Iterator[TableColumn]:
    for frame in FRAMES:
        words = f"{frame.replace('_', ' ').capitalize()} error"
        yield from _by_axis(f"{PREFIXES[frame]}error_", words, partial(_error, frame))
        total = f"{PREFIXES[frame]}error_total_m"
        yield TableColumn(total, f"Length of the {words.lower()}", "m", of=partial(_length, frame))


ESTIMATES = Columns(
    "Estimate",
    "A valid estimate and the truth.",
    (RECEIVER,),
    (
        TableColumn("epoch_s", "Time to which the estimate belongs", "s", of=lambda j: j.epoch_s),
        *_by_axis("", "Estimate", lambda j: j.estimates.position),
        *_by_axis("true_", "Truth at that epoch", lambda j: j.true_position),
        *_errors(),
        *_by_axis("std_", "Standard deviation claimed by the receiver", _claimed_std),
        TableColumn("nees_position", "NEES of the absolute error, 3 degrees of freedom",
                    of=_position_nees),
        TableColumn("relative_nees_position", "NEES of the relative error, 3 degrees of freedom",
                    of=_relative_nees),
        TableColumn("nees_state",
                    "NEES of the errors of position and velocity, 6 degrees of freedom",
                    of=_state_nees),
        *_by_axis("own_relative_std_", "Standard deviation that the receiver claims for its own "
                  "relative position", _own_std),
        TableColumn("own_relative_nees_position",
                    "NEES of the own relative error, 3 degrees of freedom", of=_own_nees),
        TableColumn("nis", "Normalised sum of the squared innovations",
                    of=lambda j: j.estimates.nis),
        TableColumn("nis_degrees", "Degrees of freedom of the NIS",
                    of=lambda j: j.estimates.nis_degrees),
    ),
)  # fmt: skip
"""Columns that a receiver lacks, or that need an unknown true platform motion, are left out."""
TABLES = {"errors": ERRORS, "percentiles": PERCENTILES, "summary": SUMMARY, "estimates": ESTIMATES}
"""Tables by the names of their files."""
