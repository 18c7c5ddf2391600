"""What is said of an estimate, defined once: truth, error, broken, NEES, inconsistent, late, lost.

The tables of a run (`sblcosim.results.metrics`) and the sums of a study (`sblcosim.results.sums`)
are built on this module; the C of the lanes master (``c/lanes_master.c``) follows it to the last
bit, and says where it cannot know.

**Epoch.** An estimate is judged at its epoch, which may be anywhere within the run. An epoch is the
recorded instant whose time in seconds it is; any other is rounded to the nearest nanosecond.

**Truth.** At an instant of the target's own it is the recorded state, bit by bit; in between the
cubic Hermite polynomial through the states at both ends. The platform's position and the error of
what it reports hold until its next instant.

**Error.** Estimate minus truth (the paper's equation 10 has the opposite sign), north, east, down,
in two frames:

- *absolute*: ``x̂ − x``;
- *relative* to the platform: the absolute error minus the mean over the beacons of reported minus
  true position, so that an error of GPS which moves all beacons alike does not count.

**Broken** is an estimate whose epoch lies outside of the run, or whose errors' squares are not
finite.

**NEES** is ``eᵀ P⁻¹ e``, where P is positive definite: each pivot of ``P = L D Lᵀ`` is above 10⁻¹⁴
of its diagonal element.

**Inconsistent** is a run whose mean NEES of the position lies above its 95 % band; unknown without
any NEES.

**Percentile** p of the errors' lengths, horizontal or total, is the order statistic x₍⌈p n / 100⌉₎
of the n estimates that count: 50 % of the horizontal error is CEP50, 95 % is R95.

**Late** is an estimate whose epoch lies in the last quarter of the run. **Lost** is a run without
one, or in which the RMS of their errors exceeds that of the true distance to the platform.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from ..simulation.record import Estimates, Record

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Nanoseconds = NDArray[np.int64]

AXES = ("x", "y", "z")
FRAMES = ("absolute", "relative")
POSITION_STATES = [0, 2, 4]
"""Places of the position in the state (x, vx, y, vy, z, vz)."""
CONFIDENCE = 0.95
PIVOT = 1e-14
"""Least share of a diagonal element that is left of it as a pivot; as ``PIVOT`` in the C."""
PERCENTAGES = (50, 67, 95, 100)
"""Order statistics of the errors that are shipped; 100 is the largest."""
TRUTH = (
    "target.position", "target.velocity", "platform.position", "platform.beacon_position",
    "platform.reported_beacon_position",
)
"""What `judge` needs of a record, beside the receiver's ports."""


@dataclass(frozen=True, eq=False)
class Judged:
    """A receiver's m estimates beside the truth, in the order in which they could be read.

    Attributes
    ----------
    estimates
        What was judged.
    epoch_s
        Their epochs [s]; shape (m,).
    broken, late
        Shape (m,).
    true_position, true_velocity
        [m], [m/s]; shape (m, 3); NaN where the epoch lies outside of the run.
    platform_error
        Mean over the beacons of reported minus true position [m]; shape (m, 3).
    error, relative
        In the two frames [m]; shape (m, 3).
    square, relative_square, distance_square
        Of the lengths of the errors, and of the true distance to the platform [m²]; shape (m,).
    nees
        Of the absolute position; shape (m,); NaN without a covariance that is positive definite.
    """

    estimates: Estimates
    epoch_s: Floats
    broken: Flags
    late: Flags
    true_position: Floats
    true_velocity: Floats
    platform_error: Floats
    error: Floats
    relative: Floats
    square: Floats
    relative_square: Floats
    distance_square: Floats
    nees: Floats


def judge(record: Record, receiver: str) -> Judged:
    """Hold a receiver's estimates against the truth; see the definitions above.

    Parameters
    ----------
    record
        With `TRUTH` and the ports of the receiver.
    """
    estimates = record.estimates(receiver)
    time, epoch = record.time_ns, estimates.epoch_ns
    inside = (time[0] <= epoch) & (epoch <= time[-1])
    own = record.own("target")
    known = epoch[inside]

    def of_run(values: Floats) -> Floats:
        """Values at the epochs within the run; NaN at the others."""
        everywhere = np.full((len(epoch), *values.shape[1:]), np.nan)
        everywhere[inside] = values
        return everywhere

    position, velocity = map(of_run, state_at(
        time[own], recorded(record, "target.position")[own],
        recorded(record, "target.velocity")[own], known,
    ))  # fmt: skip
    off = of_run(held_at(time, platform_errors(record), known))
    platform = of_run(held_at(time, recorded(record, "platform.position"), known))
    epoch_s = epoch / 1e9
    with np.errstate(invalid="ignore", over="ignore"):
        error = estimates.position - position
        relative = error - off
        square, relative_square = square_of(error), square_of(relative)
        P = estimates.covariance
        return Judged(
            estimates,
            epoch_s,
            broken=~(square + relative_square < np.inf),
            late=late_from_ns(int(time[0]), int(time[-1])) / 1e9 <= epoch_s,
            true_position=position,
            true_velocity=velocity,
            platform_error=off,
            error=error,
            relative=relative,
            square=square,
            relative_square=relative_square,
            distance_square=square_of(position - platform),
            nees=np.full(len(epoch), np.nan) if P is None else nees(error, of_position(P)),
        )


def chosen(judged: Judged, which: Flags) -> Judged:
    """Some of the estimates."""

    def some(thing: Any) -> Any:
        return None if thing is None else thing[which]

    estimates = judged.estimates
    kept = Estimates(**{f.name: some(getattr(estimates, f.name)) for f in fields(estimates)})
    own = {f.name: some(getattr(judged, f.name)) for f in fields(judged) if f.name != "estimates"}
    return Judged(kept, **own)


def length_squares(judged: Judged) -> dict[str, Floats]:
    """Squares of the lengths of the errors [m²], by the names of `LENGTHS`; shape (m,)."""
    squares = {}
    for frame, error, total in (
        ("absolute", judged.error, judged.square),
        ("relative", judged.relative, judged.relative_square),
    ):
        squares[f"{frame}_horizontal"] = error[:, 0] * error[:, 0] + error[:, 1] * error[:, 1]
        squares[f"{frame}_total"] = total
    return squares


def percentile_column(percentage: int) -> str:
    """Column of an order statistic: ``p95_m``, or ``max_m`` for 100."""
    return "max_m" if percentage == 100 else f"p{percentage}_m"


def order_statistics(values: Floats, percentages: Sequence[int]) -> Floats:
    """The order statistics x₍⌈p n / 100⌉₎ of n values: the least that p % do not exceed.

    Parameters
    ----------
    values
        Shape (n,).
    percentages
        1 to 100; 100 is the largest value.

    Returns
    -------
    Floats
        Shape (len(percentages),); NaN without any value.
    """
    n = len(values)
    if n == 0:
        return np.full(len(percentages), np.nan)
    found: Floats = np.sort(values)[[-(-p * n // 100) - 1 for p in percentages]]
    return found


def state_at(
    time_ns: Nanoseconds, position: Floats, velocity: Floats, epoch_ns: Nanoseconds
) -> tuple[Floats, Floats]:
    """True position and velocity at given epochs.

    At a recorded instant it is the recorded value, bit by bit; in between the cubic Hermite
    polynomial through the recorded positions and velocities at both ends.

    Parameters
    ----------
    time_ns
        Recorded instants [ns], increasing; shape (n,).
    position, velocity
        Recorded motion [m], [m/s]; shape (n, 3).
    epoch_ns
        Epochs within the recorded time [ns]; shape (m,).

    Returns
    -------
    position, velocity
        [m], [m/s]; shape (m, 3).

    Raises
    ------
    ValueError
        An epoch lies outside the recorded time.
    """
    if epoch_ns.size and not (time_ns[0] <= epoch_ns.min() and epoch_ns.max() <= time_ns[-1]):
        raise ValueError("epochs must lie within the recorded time")
    right = np.searchsorted(time_ns, epoch_ns)
    exact = time_ns[right] == epoch_ns
    left = np.where(exact, right, right - 1)
    step = np.where(exact, 1, time_ns[right] - time_ns[left])
    h = (step * 1e-9)[:, None]
    u = ((epoch_ns - time_ns[left]) / step)[:, None]
    p0, p1, v0, v1 = position[left], position[right], velocity[left], velocity[right]
    secant = (p1 - p0) / h
    # p = p0 + h (v0 u + b u² + a u³), with a and b from p(1) = p1 and dp/du(1) = h v1
    b = 3 * secant - 2 * v0 - v1
    a = v0 + v1 - 2 * secant
    between = p0 + h * u * (v0 + u * (b + u * a))
    return (
        np.where(exact[:, None], p0, between),
        np.where(exact[:, None], v0, v0 + u * (2 * b + u * 3 * a)),
    )


def held_at(time_ns: Nanoseconds, values: Floats, epoch_ns: Nanoseconds) -> Floats:
    """Recorded values at the last instant that is not after each epoch; shape (m, …)."""
    held: Floats = values[np.searchsorted(time_ns, epoch_ns, side="right") - 1]
    return held


def recorded(record: Record, name: str) -> Floats:
    """Recorded values of ``"component.variable"`` as floats; shape (n, …)."""
    return record.values[name].astype(np.float64, copy=False)


def platform_errors(record: Record) -> Floats:
    """Mean over the beacons of reported minus true position [m] at all instants; shape (n, 3)."""
    reported = recorded(record, "platform.reported_beacon_position")
    beacon = recorded(record, "platform.beacon_position")
    beacons = beacon.shape[1]
    error = np.zeros((len(record), 3))
    for j in range(beacons):  # in this order, as in the C
        error += reported[:, j] - beacon[:, j]
    error *= 1.0 / beacons
    return error


def square_of(v: Floats) -> Floats:
    """Squared lengths of vectors (m, 3), added in this order."""
    result: Floats = v[:, 0] * v[:, 0] + v[:, 1] * v[:, 1] + v[:, 2] * v[:, 2]
    return result


def of_position(covariance: Floats) -> Floats:
    """Of the state's covariance (m, 6, 6) what belongs to the position; shape (m, 3, 3)."""
    P: Floats = covariance[np.ix_(range(len(covariance)), POSITION_STATES, POSITION_STATES)]
    return P


def nees(error: Floats, covariance: Floats) -> Floats:
    """Normalised estimation error squared, eᵀ P⁻¹ e, by P = L D Lᵀ.

    Parameters
    ----------
    error
        Shape (m, d).
    covariance
        Shape (m, d, d), in the units of the error; its upper triangle is read.

    Returns
    -------
    nees
        Shape (m,); NaN where the covariance is not positive definite to working precision.
    """
    d = error.shape[1]
    # P[i][j], j ≤ i, becomes what is left of it after the pivots so far; y = L⁻¹ e.
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
    """Two-sided 95 % band of the mean of independent chi-square samples; NaN without any.

    Parameters
    ----------
    degrees
        Degrees of freedom of all samples together; a number or an array.
    samples
        Number of samples.

    Notes
    -----
    The errors of one run follow each other and are not independent, so the mean of a consistent
    filter leaves this band more often than once in twenty runs. It is a yardstick, not a test; a
    test takes the mean over runs at one epoch.
    """
    tail = (1 - CONFIDENCE) / 2
    some = (np.asarray(samples) > 0) & (np.asarray(degrees) > 0)
    n, dof = np.where(some, samples, 1), np.where(some, degrees, 1)
    low, high = (np.where(some, chdtri(dof, p) / n, np.nan)[()] for p in (1 - tail, tail))
    return low, high


def in_order(values: Floats) -> float:
    """The sum, one after another as in the C: NumPy's own adds in another order."""
    return float(np.add.accumulate(np.append(0.0, values))[-1])


def inconsistent(mean_nees: Any, samples: Any) -> tuple[Any, Any]:
    """Which runs claim too much: mean NEES of the position above its band, and which are known.

    Parameters
    ----------
    mean_nees, samples
        Of each run, the number of estimates with a NEES, too; numbers or arrays.

    Returns
    -------
    inconsistent, known
        What is not known is not inconsistent.
    """
    known = samples > 0
    with np.errstate(invalid="ignore"):
        return known & (mean_nees > chi_square_band(3 * samples, samples)[1]), known


def late_from_ns(start_ns: int, stop_ns: int) -> int:
    """Where the last quarter of a run begins [ns]."""
    return stop_ns - (stop_ns - start_ns) // 4


def lost(estimates: Any, error_square: Any, distance_square: Any) -> Any:
    """Which runs are lost, by the sums over their late estimates; numbers or arrays."""
    return (estimates == 0) | (error_square > distance_square)
