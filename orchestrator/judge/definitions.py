"""Definitions: truth, error, broken, NEES, inconsistent, percentile, late, lost, misleading.

The tables of a run (`sblcosim.judge.metrics`) and the sums of a study (`sblcosim.results.sums`) are
built on this module. The lanes master in C (``c/lanes_master.c``) matches it to the last bit and
counts the estimates that it cannot judge.

**Epoch.** An estimate is judged at its epoch, which may be any time within the run. An epoch equal
to the time in seconds of a recorded instant is that instant. Any other is rounded to the nearest
nanosecond.

**Truth.** At one of the target's own instants, the truth is the recorded state, to the bit. Between
instants it is the cubic Hermite polynomial through the states at both ends. The platform's position
and the error of its reports hold until its next instant.

**Error.** Estimate minus truth (the paper's equation 10 has the opposite sign), north, east, down,
in three frames:

- *absolute*: ``x̂ − x``;
- *relative* to the platform as it reports itself: the absolute error minus the mean over the
  beacons of reported minus true position, so that a GPS error common to all beacons does not
  count. A receiver that filters out GPS noise is therefore charged with the noise it removed;
- *own relative*, to the platform's true position, as the receiver itself estimates it: ``d̂ − (x −
p)``, with its output ``relative_position`` d̂ and the true position p of the platform's reference
point. Receivers without that output have no such error.

**Broken**: an estimate whose epoch lies outside the run, or whose squared errors are not finite in
one of its frames.

**NEES**: ``eᵀ P⁻¹ e``. For the own relative error, P is the output ``relative_covariance``. P must
be positive definite: each pivot of ``P = L D Lᵀ`` is above 10⁻¹⁴ of its diagonal element.

**Inconsistent**: a run whose mean position NEES lies above its 95 % band; unknown without any NEES.

**Percentile** p of the lengths of the errors, horizontal or total: the order statistic x₍⌈p n /
100⌉₎ of the n estimates that count. 50 % of the horizontal error is CEP50, 95 % is R95.

**Late**: an estimate whose epoch lies in the last quarter of the run. **Lost**: a run without late
estimates, or one in which their RMS error exceeds the RMS true distance to the platform.

**Beyond the claim**: an estimate whose position NEES is above `BEYOND_NEES` and whose error is
longer than `BEYOND_M`. The NEES is the squared Mahalanobis distance of the error, and has a
chi-square distribution with 3 degrees of freedom if the covariance is right (Y. Bar-Shalom, X. R.
Li, T. Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, section 5.4).
`BEYOND_NEES` is the quantile that as many errors of a right covariance exceed as normal errors
exceed 3σ in one dimension, 0.27 %. An estimate without NEES claims nothing, and is not beyond it.
Smaller errors than `BEYOND_M` mislead nobody, whatever is claimed.

**Stands**: an estimate stands from the instant at which it becomes available until the next one
does, the receiver marks it as not valid, or the run ends. One that was made after the run stands
from its epoch to that of the next one, the last to the end of the run. The *time beyond the claim*
is the time for which estimates beyond it stand, as a share of the run's time after the settling
time. The *longest* is the longest such time without a break. Both are unknown without any NEES.

**Misleading**: a run whose longest time beyond the claim exceeds `MISLEADING_S`, or whose mean
position NEES exceeds `MISLEADING_NEES` while its RMS error exceeds `BEYOND_M`; unknown without any
NEES. Navigation calls such information hazardously misleading: the claim is the protection level,
`BEYOND_M` the alert limit, `MISLEADING_S` the time to alert. Of right covariances, at most 1 run in
40 has a mean NEES above `MISLEADING_NEES`, even if its error stays the same throughout.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from ..data.estimates import Estimates, Flags, Floats, Integers
from ..data.record import Record
from ..data.truth import Truth, of_record
from ..lazy import Module
from ..shown import Shown

special = Module("scipy.special")

MANY_LOST = 0.05
"""Share of lost runs that 95 % of the estimates do not show."""
LOST = (
    "A run is lost if, in its last quarter, it has no estimate or is off by more than the distance "
    "from diver to platform."
)
"""What the share of lost runs counts, in words for people."""
BEYOND_NEES = 14.156413609126688
"""NEES of an error at three times what is claimed: the quantile erf(3/√2) of chi-square with 3
degrees of freedom; same as ``BEYOND_NEES`` in the C code."""
BEYOND_M = 1.0
"""Length of the smallest error that can mislead [m]; same as ``BEYOND_M`` in the C code. It is
about what a diver can reach, and that of the included question `one-metre`."""
MISLEADING_NEES = 15.0
"""Mean NEES of a misleading run: five times what is expected."""
MISLEADING_S = 20.0
"""Time beyond the claim without a break in a misleading run [s]."""
MISLEADING = (
    f"A run is misleading if its error is more than {BEYOND_M:g} m and beyond three times what is "
    f"claimed (NEES above {BEYOND_NEES:.3g}) for more than {MISLEADING_S:g} s without a break, or "
    f"its RMS error more than {BEYOND_M:g} m and its mean NEES above {MISLEADING_NEES:g}."
)
"""What the share of misleading runs counts, in words for people."""

AXES = ("x", "y", "z")
FRAMES = ("absolute", "relative", "own_relative")
PREFIXES = {"absolute": "", "relative": "relative_", "own_relative": "own_relative_"}
"""Prefixes of the names of a frame's columns and sums."""
FRAME_WORDS = {
    "absolute": "absolute",
    "relative": "relative to the platform as it reports itself",
    "own_relative": "relative to the platform's true position, by the receiver's own account",
}
OWN_PORT = "relative_position"
"""Output of receivers that have own relative errors."""
POSITION_STATES = [0, 2, 4]
"""Indices of the position in the state (x, vx, y, vy, z, vz)."""
CONFIDENCE = 0.95
PIVOT = 1e-14
"""Smallest usable pivot, as a share of its diagonal element; same as ``PIVOT`` in the C code."""
PERCENTAGES = (50, 67, 95, 100)
"""Percentages of the percentiles; 100 is the largest error."""


@dataclass(frozen=True, eq=False, repr=False)
class Judged(Shown):
    """A receiver's m estimates and the truth, in the order in which they became available.

    Attributes
    ----------
    estimates
        The estimates themselves.
    epoch_s
        Epochs [s]; shape (m,).
    broken, late
        Flags as defined above; shape (m,).
    since_ns, until_ns
        When each estimate stands [ns]; shape (m,).
    true_position, true_velocity
        NED [m], [m/s]; shape (m, 3); NaN where the epoch lies outside the run.
    platform_error
        Mean over the beacons of reported minus true position [m]; shape (m, 3).
    error, relative
        Errors in the absolute and the relative frame [m]; shape (m, 3).
    square, relative_square, distance_square
        Squared lengths of the errors, and squared true distance to the platform [m²]; shape (m,).
        Quantities relative to the platform are None if its true motion is unknown.
    nees
        NEES of the absolute position; shape (m,); NaN without a positive definite covariance.
    own_relative, own_relative_square, own_relative_nees
        Errors [m] in the own relative frame, shape (m, 3), their squared lengths [m²] and NEES,
        shape (m,); None for a receiver without them.
    """

    estimates: Estimates
    epoch_s: Floats
    broken: Flags
    late: Flags
    since_ns: Integers
    until_ns: Integers
    true_position: Floats
    true_velocity: Floats
    platform_error: Floats | None
    error: Floats
    relative: Floats | None
    square: Floats
    relative_square: Floats | None
    distance_square: Floats | None
    nees: Floats
    own_relative: Floats | None = None
    own_relative_square: Floats | None = None
    own_relative_nees: Floats | None = None

    def _gist(self) -> str:
        return f"of {len(self.epoch_s)} estimates"


def judge(record: Record, receiver: str) -> Judged:
    """Compare a receiver's estimates in a record, which contains `TRUTH`, with that truth."""
    return judged_by(record.estimates(receiver), of_record(record))


def judged_by(estimates: Estimates, truth: Truth) -> Judged:
    """Compare estimates with the truth; see the definitions above."""
    epoch = estimates.epoch_ns
    inside = (truth.start_ns <= epoch) & (epoch <= truth.stop_ns)
    known = epoch[inside]

    def of_run(values: Floats) -> Floats:
        """Expand values at the epochs within the run to all epochs; other values are NaN."""
        everywhere = np.full((len(epoch), *values.shape[1:]), np.nan)
        everywhere[inside] = values
        return everywhere

    position, velocity = map(of_run, truth.state_at(known))
    about = truth.platform_at(known)
    platform, off = (None, None) if about is None else map(of_run, about)
    epoch_s = epoch / 1e9
    since_ns, until_ns = standing(estimates, truth.stop_ns)
    with np.errstate(invalid="ignore", over="ignore"):
        error = estimates.position - position
        square = square_of(error)
        relative = None if off is None else error - off
        relative_square = None if relative is None else square_of(relative)
        P = estimates.covariance
        away = None if platform is None else position - platform
        own_error, own_square, own_nees = _own_relative(estimates, away)
        finite = (square if relative_square is None else square + relative_square) < np.inf
        if own_square is not None:
            finite &= own_square < np.inf
        return Judged(
            estimates,
            epoch_s,
            broken=~finite,
            late=late_from_ns(truth.start_ns, truth.stop_ns) / 1e9 <= epoch_s,
            since_ns=since_ns,
            until_ns=until_ns,
            true_position=position,
            true_velocity=velocity,
            platform_error=off,
            error=error,
            relative=relative,
            square=square,
            relative_square=relative_square,
            distance_square=None if away is None else square_of(away),
            nees=np.full(len(epoch), np.nan) if P is None else nees(error, of_position(P)),
            own_relative=own_error,
            own_relative_square=own_square,
            own_relative_nees=own_nees,
        )


def _own_relative(
    estimates: Estimates, away: Floats | None
) -> tuple[Floats, Floats, Floats] | tuple[None, None, None]:
    """Own relative errors [m], their squared lengths [m²] and NEES; None if unknown.

    Parameters
    ----------
    away
        True position minus the platform's true position [m]; shape (m, 3).
    """
    if estimates.relative_position is None or away is None:
        return None, None, None
    error = estimates.relative_position - away
    P = estimates.relative_covariance
    claimed = np.full(len(error), np.nan) if P is None else nees(error, P)
    return error, square_of(error), claimed


def standing(estimates: Estimates, stop_ns: int) -> tuple[Integers, Integers]:
    """When each estimate stands [ns], as defined above."""
    since, until = estimates.available_ns, estimates.until_ns
    if since is None or until is None:
        since = estimates.epoch_ns
        until = np.maximum(since, np.append(since[1:], stop_ns)[: len(since)])
    return since, until


def chosen(judged: Judged, which: Flags) -> Judged:
    """The selected estimates."""
    values = {f.name: getattr(judged, f.name) for f in fields(judged) if f.name != "estimates"}
    own: dict[str, Any] = {n: None if v is None else v[which] for n, v in values.items()}
    return Judged(judged.estimates.chosen(which), **own)


def horizontal_square(x: Floats, y: Floats) -> Floats:
    """Square of the horizontal length [m²], summed in the order of the C code."""
    return x * x + y * y


def errors_of(judged: Judged) -> dict[str, tuple[Floats, Floats]]:
    """Errors [m], shape (m, 3), and their squared lengths [m²], by frame."""
    errors = {"absolute": (judged.error, judged.square)}
    if judged.relative is not None and judged.relative_square is not None:
        errors["relative"] = (judged.relative, judged.relative_square)
    if judged.own_relative is not None and judged.own_relative_square is not None:
        errors["own_relative"] = (judged.own_relative, judged.own_relative_square)
    return errors


def length_squares(judged: Judged) -> dict[str, Floats]:
    """Squared lengths of the errors [m²], for example ``absolute_horizontal``; shape (m,)."""
    squares = {}
    for frame, (error, total) in errors_of(judged).items():
        squares[f"{frame}_horizontal"] = horizontal_square(error[:, 0], error[:, 1])
        squares[f"{frame}_total"] = total
    return squares


def percentile_column(percentage: int) -> str:
    """Column name of a percentile: ``p95_m``, or ``max_m`` for 100."""
    return "max_m" if percentage == 100 else f"p{percentage}_m"


def order_statistics(values: Floats, percentages: Sequence[int]) -> Floats:
    """Order statistics x₍⌈p n / 100⌉₎ of n values: the smallest that p % do not exceed.

    Parameters
    ----------
    values
        Shape (n,).
    percentages
        1 to 100; 100 is the largest value.

    Returns
    -------
    Floats
        Shape (len(percentages),); NaN if there are no values.
    """
    n = len(values)
    if n == 0:
        return np.full(len(percentages), np.nan)
    ranks = -(-n * np.array(percentages, np.int64) // 100)
    statistics: Floats = np.sort(values)[ranks - 1]
    return statistics


def square_of(v: Floats) -> Floats:
    """Squared lengths of vectors (m, 3), summed in a fixed order."""
    result: Floats = v[:, 0] * v[:, 0] + v[:, 1] * v[:, 1] + v[:, 2] * v[:, 2]
    return result


def of_position(covariance: Floats) -> Floats:
    """Position block of the state's covariance (m, 6, 6); shape (m, 3, 3)."""
    P: Floats = covariance[np.ix_(range(len(covariance)), POSITION_STATES, POSITION_STATES)]
    return P


def nees(error: Floats, covariance: Floats) -> Floats:
    """Normalised estimation error squared, eᵀ P⁻¹ e, with P = L D Lᵀ.

    Parameters
    ----------
    error
        Shape (m, d).
    covariance
        Shape (m, d, d), in units of the error; only the upper triangle is read.

    Returns
    -------
    nees
        Shape (m,); NaN where the covariance is not positive definite to working precision.
    """
    d = error.shape[1]
    # P[i][j], j ≤ i, is the Schur complement after the pivots so far; y = L⁻¹ e.
    P = [[covariance[:, j, i] for j in range(i + 1)] for i in range(d)]
    y = [error[:, i] for i in range(d)]
    usable = np.ones(len(error), bool)
    result = np.zeros(len(error))
    with np.errstate(all="ignore"):
        for k in range(d):
            pivot = P[k][k]
            usable &= PIVOT * covariance[:, k, k] < pivot
            inverse = 1.0 / pivot
            for i in range(k + 1, d):
                y[i] = y[i] - P[i][k] * inverse * y[k]
                for j in range(k + 1, i + 1):
                    P[i][j] = P[i][j] - P[j][k] * inverse * P[i][k]
            square = y[k] * y[k]
            result = result + (square * inverse if k < d - 1 else square / pivot)
    return np.where(usable, result, np.nan)


def chi_square_band(degrees: Any, samples: Any) -> tuple[Any, Any]:
    """Two-sided 95 % band of the mean of independent chi-square samples; NaN without samples.

    Parameters
    ----------
    degrees
        Total degrees of freedom of all samples; a number or an array.
    samples
        Number of samples; a number or an array.

    Notes
    -----
    The errors in one run are correlated in time, so the mean of a consistent filter leaves this
    band in more than one run in twenty. It is a yardstick, not a test. A test takes the mean over
    many runs at one epoch.
    """
    tail = (1 - CONFIDENCE) / 2
    some = (np.asarray(samples) > 0) & (np.asarray(degrees) > 0)
    n, dof = np.where(some, samples, 1), np.where(some, degrees, 1)
    low, high = (np.where(some, special.chdtri(dof, p) / n, np.nan)[()] for p in (1 - tail, tail))
    return low, high


def in_order(values: Floats) -> float:
    """Sum in sequence, as the C code does; NumPy's own sum adds in a different order."""
    return float(np.add.accumulate(np.append(0.0, values))[-1])


def inconsistent(mean_nees: Any, samples: Any) -> tuple[Any, Any]:
    """Whether runs are inconsistent: their mean position NEES lies above its band.

    Parameters
    ----------
    mean_nees, samples
        Mean NEES of each run, and the number of estimates with a NEES; numbers or arrays.

    Returns
    -------
    inconsistent, known
        Flags; an unknown run is not flagged as inconsistent.
    """
    known = samples > 0
    with np.errstate(invalid="ignore"):
        return known & (mean_nees > chi_square_band(3 * samples, samples)[1]), known


def late_from_ns(start_ns: int, stop_ns: int) -> int:
    """Start of the last quarter of a run [ns]."""
    return stop_ns - (stop_ns - start_ns) // 4


def lost(estimates: Any, error_square: Any, distance_square: Any) -> Any:
    """Whether runs are lost, from sums over their late estimates; numbers or arrays."""
    return (estimates == 0) | (error_square > distance_square)


def beyond_claim(judged: Judged, distance_m: float = BEYOND_M) -> Flags:
    """Whether each estimate is beyond its claim; shape (m,).

    Parameters
    ----------
    distance_m
        Length of the smallest error that counts [m].
    """
    beyond: Flags = (judged.nees > BEYOND_NEES) & (judged.square > distance_m**2)
    return beyond


def times_standing(judged: Judged, which: Flags) -> tuple[int, int]:
    """For how long the selected estimates stand [ns], and the longest time without a break."""
    since, until = judged.since_ns[which], judged.until_ns[which]
    if not len(since):
        return 0, 0
    lengths = until - since
    first = np.append(True, since[1:] != until[:-1])
    return int(lengths.sum()), int(np.add.reduceat(lengths, np.flatnonzero(first)).max())


def misleading(mean_nees: Any, rms_m: Any, longest_s: Any) -> Any:
    """Whether runs are misleading, if they have a NEES; numbers or arrays.

    Parameters
    ----------
    mean_nees, rms_m, longest_s
        Mean position NEES of each run, its RMS error [m], and its longest time beyond the claim
        without a break [s].
    """
    with np.errstate(invalid="ignore"):
        far_off = (mean_nees > MISLEADING_NEES) & (rms_m > BEYOND_M)
        return far_off | (longest_s > MISLEADING_S)
