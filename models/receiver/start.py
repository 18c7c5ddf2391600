"""How `coupled` starts and restarts: a fix from the latest receptions alone.

The platform is where the filter has it, the diver is unknown. The common error of all ranges, B = β
+ κρ at a distance ρ, is estimated with its prior and eliminated from the equations. With weights w,
residuals e and its information 1/σ_B², it is Σwe / W with W = Σw + 1/σ_B². Clock and speed of sound
take their shares of it, σ_β²/σ_B² and σ_κ²ρ/σ_B².
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca

from ..equations import Loop, Symbols, Values
from . import bank, least_squares
from .estimate import pack, unpack
from .least_squares import Normal, adjugate, reciprocal, symmetric
from .measurements import DEPTH, Samples, distance, with_beacons
from .ping import LEAST_ARRIVAL_STD, UNTIMED_STD, Ping
from .surroundings import (
    CLOCK,
    DEPTH_BIAS,
    HEADING,
    PLATFORM,
    PLATFORM_VELOCITY,
    POSITION,
    SPEED,
    VELOCITY,
    VERTICAL_ERROR,
    sounding_variance,
)

_FAR_STD = 30.0
"""Least prior of the diver about the platform, north and east [m]: see `_near`."""
_UNTIMED = 50.0
"""First guess of the distance if the time of the ping is unknown [m]."""
_MEDIAN = 0.6745
"""Median of the length of a number with a normal distribution, over its standard deviation."""
_FITS = 9.0
"""Weighted squares by which a fix further out may fit worse: a late range makes as much."""
_LEAST_OFFSET_STD = 1e-3
"""Smallest standard deviation of the common error of all ranges [m]."""


ALL, CHALLENGER, TAKEN = 1, 2, 3
"""Which filters begin: all at the fix, only the challenger, or all where the challenger is."""
_FIXED = 21
"""Numbers of a `_Fixed`."""


def initial() -> Values:
    """The states of a start, at the start time."""
    return {
        "passes": 0, "damping": 0, "fix": ca.SX.zeros(3), "fixed": ca.SX.zeros(_FIXED),
        "kind": ALL, "beginning": 0, "challenged": 0, "lead": 0,
    }


def begun(x: Symbols, anew: Any) -> Values:
    """The states that make the loops of `anew` run."""
    return {
        "passes": ca.if_else(anew, least_squares.PASSES, x.passes),
        "damping": ca.if_else(anew, least_squares.FIRST_DAMPING, x.damping),
        "kind": ALL,
    }


def anew(row: int, ping: Ping | None = None) -> tuple[Loop, Loop]:
    """Loops that compute the diver from the latest receptions, and begin all filters there.

    Parameters
    ----------
    row
        The filter of the bank that knows where the platform is.
    ping
        States that all ranges of a ping share, if the filters have them.
    """

    def step(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
        return _pass(p, x, u, x.mean[row, :].T, ping)

    def begin(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
        mean, covariance = _joined(
            p, x.every.mean[row, :].T, x.every.covariance[row, :].T, _fixed(x.fixed),
            x.platform_down, ping,
        )
        taken = x.beginning == TAKEN
        anew = x.beginning == ALL
        other = bank.EXTRA
        return {
            "mean": ca.if_else(taken, x.every.mean[other, :].T, mean),
            "covariance": ca.if_else(taken, x.every.covariance[other, :].T, covariance),
            "weight": bank.begun_of(p, x),
            "beginning": ca.if_else(x.row == bank.ROWS - 1, 0, x.beginning),
            "mixed": ca.if_else(x.beginning == CHALLENGER, x.mixed, x.epoch),
            "challenged": ca.if_else(anew, x.epoch, x.challenged),
            "lead": 0,
            "nis": ca.if_else(anew, 0, x.nis),
            "nis_degrees": ca.if_else(anew, 0, x.nis_degrees),
        }

    def begins(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Any:
        return (x.beginning > 0) * ca.fmax(x.beginning != CHALLENGER, x.row == bank.EXTRA)

    return (
        Loop("anew", lambda p, x, u, t: x.passes, step),
        Loop("begin", begins, begin, each=bank.STATES),
    )


def _placed(x: Symbols, u: Symbols, mean: Any) -> Samples:
    """The samples, with each beacon where the filter has it at the sample's epoch."""
    s = with_beacons(x, u, u.ping_beacon_position)
    c, sn = ca.cos(mean[HEADING]), ca.sin(mean[HEADING])
    rows = []
    for i in range(s.count):
        age = s.newest - s.epoch[i]
        arm = x.arm[i, :]
        rows.append(ca.horzcat(
            mean[PLATFORM[0]] - age * mean[PLATFORM_VELOCITY[0]] + c * arm[0] - sn * arm[1],
            mean[PLATFORM[1]] - age * mean[PLATFORM_VELOCITY[1]] + sn * arm[0] + c * arm[1],
            x.platform_down - mean[VERTICAL_ERROR] + arm[2],
        ))
    return replace(s, beacons=ca.vertcat(*rows))


def _timed(p: Symbols, s: Samples, ping: Ping) -> Any:
    """Ranges and depth, (N + 1, 1) [m]; ranges without a common clock as if from `_UNTIMED`."""
    heard = s.heard[:DEPTH]
    ranges = s.z[:DEPTH]
    mean = ca.dot(heard, ranges) / ca.fmax(ca.sum1(heard), 1)
    untimed = ranges - mean + _UNTIMED
    return ca.vertcat(ca.if_else(ping.timed(p), ranges, untimed), s.z[DEPTH])


def _near(p: Symbols, s: Samples, ping: Ping | None) -> Any:
    """Information of the diver's prior about the platform, north and east [1/m²].

    It counts where ranges say nothing. Its standard deviation grows with them, as one of 30 m would
    draw a diver nearer who is far away.
    """
    longest = ca.mmax(s.heard[:DEPTH] * s.z[:DEPTH])
    std = ca.fmax(longest - _FAR_STD, _FAR_STD)
    if ping:
        std = ca.if_else(ping.timed(p), std, UNTIMED_STD)
    return reciprocal(std**2)


@dataclass(frozen=True, slots=True)
class Offset:
    """The common error of all ranges: the clock's offset, and the speed of sound at the diver.

    Attributes
    ----------
    variance
        Prior [m²].
    clock, speed, ping
        Shares of the offset, once it is known, due to β [1], κ [1/m], and to what the ranges of a
        ping share besides [1].
    """

    variance: Any
    clock: Any
    speed: Any
    ping: Any


def _offset(p: Symbols, length: Any, ping: Ping | None) -> Offset:
    """The common offset of ranges of a given length [m]: β + κ length."""
    speed = p.sound_speed_std**2 * length
    variance = p.clock_std**2 + speed * length + _LEAST_OFFSET_STD**2
    common = ca.SX(0)
    if ping:
        common = ping.variance(p)
        variance += common + ping.late_together(p) * _late_variance(p)
    share = reciprocal(variance)
    return Offset(variance, p.clock_std**2 * share, speed * share, common * share)


def _late_variance(p: Symbols) -> Any:
    """Mean square of the excess of late ranges, averaged over all ranges [m²]."""
    return 2 * p.outlier_probability * p.outlier_mean**2


def _lateness(p: Symbols, s: Samples, motion: Any) -> Any:
    """Added variance of possibly late ranges, 2πm², if three or more share about one time [m²].

    A late range among them shifts bearing and offset, and seems to fit. Where ranges arrive one
    after another, most of their noise is the diver's unknown `motion` [m] in between.
    """
    together = ca.sum1(s.heard[:DEPTH] * (motion[:DEPTH] < p.range_std)) >= 3
    return together * _late_variance(p)


@dataclass(frozen=True, slots=True)
class _Fixed:
    """What a fix is made of, for all filters that begin with it.

    Attributes
    ----------
    position, information, alone, lean, value
        As in `Normal`; ``value`` is what its ranges have in common.
    doubt
        Factor of the samples' information: less than 1 where they disagree.
    depth_weight, near
        Information of the depth reading, and of the prior about the platform [1/m²].
    offset
        Prior and shares of the common offset.
    """

    position: Any
    information: Any
    value: Any
    alone: Any
    lean: Any
    doubt: Any
    depth_weight: Any
    near: Any
    offset: Offset

    @property
    def numbers(self) -> Any:
        """All numbers as a column."""
        return ca.vertcat(
            self.position, pack(self.information), self.value, self.alone, self.lean, self.doubt,
            self.depth_weight, self.near,
            self.offset.variance, self.offset.clock, self.offset.speed, self.offset.ping,
        )


def _fixed(numbers: Any) -> _Fixed:
    return _Fixed(
        numbers[:3], unpack(numbers[3:9], 3), numbers[9], numbers[10], numbers[11:14],
        numbers[14], numbers[15], numbers[16],
        Offset(numbers[17], numbers[18], numbers[19], numbers[20]),
    )


def _pass(p: Symbols, x: Symbols, u: Symbols, mean: Any, ping: Ping | None) -> Values:
    s = _placed(x, u, mean)
    if ping:
        s = replace(s, z=_timed(p, s, ping))
    begins = x.passes == least_squares.PASSES
    position = ca.if_else(begins, least_squares.closed_form(s), x.fix)
    platform = ca.vertcat(mean[list(PLATFORM)], x.platform_down - mean[VERTICAL_ERROR])
    offset = _offset(p, distance(position, platform.T)[0], ping)
    prior = reciprocal(offset.variance)
    motion = p.prior_velocity_std * (s.newest - s.epoch)
    late = _lateness(p, s, motion)
    noise = sounding_variance(p.range_std)
    if ping:
        late = late * (1 - ping.late_together(p))
        noise = sounding_variance(p.range_std, LEAST_ARRIVAL_STD)
    variances = ca.vertcat(
        ca.repmat(noise + late, s.count, 1),
        sounding_variance(p.depth_std) + p.depth_bias_std**2,
    )
    weight = least_squares.weights(s, variances + motion**2)

    known = least_squares.Common(prior, platform, _near(p, s, ping))

    def linearised(place: Any) -> Normal:
        return least_squares.together(place, s, weight, known)

    result = least_squares.improve(position, x.damping, linearised)
    last = ca.fmax(result.done, x.passes == 1)
    fix = outward(result.taken, known, last, linearised)
    degrees = ca.fmax(ca.sum1(s.heard[:DEPTH]) - 2, 1)
    # Samples that disagree get less weight. The assumption that the diver is near does not.
    doubt = reciprocal(ca.fmax(fix.cost / degrees, 1))
    fixed = _Fixed(
        fix.position, fix.information, fix.common, fix.alone, fix.lean, doubt, weight[DEPTH],
        known.near, offset,
    )
    return {
        "fix": fix.position,
        "fixed": fixed.numbers,
        "beginning": last * x.kind,
        "damping": result.damping,
        "passes": ca.if_else(last, 0, x.passes - 1),
    }


def outward(
    fix: Normal, known: least_squares.Common, last: Any, linearised: Callable[[Any], Normal]
) -> Normal:
    """A final fix, but not nearer than where the diver is as likely to be nearer as farther.

    Unless the clock is known, ranges of a short baseline hardly tell the distance. The best fit is
    often next to the platform, where derivatives seem to tell it.
    """
    likely = ca.fmin(_MEDIAN * ca.sqrt(reciprocal(known.prior + known.near)), _UNTIMED)
    away = fix.position[:2] - known.middle[:2]
    length = ca.sqrt(ca.fmax(ca.sumsqr(away), 1e-6))
    place = known.middle[:2] + away * (ca.fmax(length, likely) / length)
    there = linearised(ca.vertcat(place, fix.position[2]))
    fits = there.cost < fix.cost + _FITS
    return least_squares.chosen(last * (length < likely) * fits, there, fix)


def _joined(
    p: Symbols, before: Any, covariance: Any, fix: _Fixed, platform_down: Any, ping: Ping | None
) -> tuple[Any, Any]:
    """The diver from a fix, the platform from the filter before: mean and packed covariance.

    Besides the fix's own error, the diver moves with the platform and rotates with its heading, and
    around it as the beacons tilt.
    """
    offset, doubt = fix.offset, fix.doubt
    y = fix.position[:2] - before[list(PLATFORM)]
    near = ca.diag(ca.SX([1, 1, 0])) * fix.near
    cofactors, determinant = adjugate(doubt * (fix.information - near) + near)
    own = cofactors / determinant
    parts = {CLOCK: offset.clock, SPEED: offset.speed}
    if ping:
        parts[ping.common] = offset.ping
    n_states = before.numel()
    P = ca.SX(unpack(covariance, n_states))
    sunk = P[VERTICAL_ERROR, VERTICAL_ERROR]
    fresh = {**dict.fromkeys(VELOCITY, p.prior_velocity_std**2), DEPTH_BIAS: p.depth_bias_std**2,
             CLOCK: p.clock_std**2, SPEED: p.sound_speed_std**2, VERTICAL_ERROR: sunk,
             **({ping.common: ping.variance(p)} if ping else {})}
    mean = ca.SX(before)
    mean[list(POSITION)] = fix.position
    for i in (*VELOCITY, DEPTH_BIAS, *parts):
        mean[i] = parts.get(i, 0) * fix.value

    kept = [i for i in range(n_states) if i not in (*POSITION, *fresh)]
    for i in (*POSITION, *fresh):
        for j in range(n_states):
            P[i, j] = P[j, i] = fresh.get(i, 0) if i == j else 0
    along = ca.SX(2, len(kept))  # derivatives of the diver's north and east by the kept states
    for n in range(2):
        along[n, kept.index(PLATFORM[n])] = 1
    along[0, kept.index(HEADING)], along[1, kept.index(HEADING)] = -y[1], y[0]
    if ping:
        deep = fix.position[2] - platform_down
        for state, shift in ping.swung(y, deep, before[HEADING], ca).items():
            along[:, kept.index(state)] = shift
    crossing = along @ P[kept, kept]
    P[list(POSITION), list(POSITION)] = own
    P[list(POSITION[:2]), list(POSITION[:2])] += crossing @ along.T
    P[list(POSITION[:2]), kept] = crossing
    P[kept, list(POSITION[:2])] = crossing.T
    _correlate(p, P, own, fix, parts)
    return mean, pack(symmetric(P))


def _correlate(p: Symbols, P: Any, own: Any, fix: _Fixed, parts: Mapping[int, Any]) -> None:
    """Add to P what the fix makes of the errors of its samples.

    Parameters
    ----------
    own
        Covariance of the fix's own error, (3, 3) [m²].
    parts
        Shares of the common offset by state.
    """
    offset, doubt, depth_weight = fix.offset, fix.doubt, fix.depth_weight
    sunk = P[VERTICAL_ERROR, VERTICAL_ERROR]
    # Errors. Offset: -lean' times the error of the position, plus what its own residuals leave.
    # Position: the sensor's bias, through the depth reading, and the platform's depth. An error
    # common to the platform and the reading would be the diver's. Clock and speed: their shares of
    # the offset.
    by_depth = own[:, 2] * (doubt * depth_weight)
    by_bias = -own[:, 2] * (doubt * depth_weight * p.depth_bias_std**2)
    P[list(POSITION), DEPTH_BIAS], P[DEPTH_BIAS, list(POSITION)] = by_bias, by_bias.T
    by_sink = by_depth - ca.SX([0, 0, 1])
    P[list(POSITION), list(POSITION)] += sunk * (by_sink @ by_sink.T)
    P[list(POSITION), VERTICAL_ERROR] = sunk * by_sink
    P[VERTICAL_ERROR, list(POSITION)] = sunk * by_sink.T
    column = -own @ fix.lean
    tilted = -ca.dot(fix.lean, by_depth)
    learnt = fix.alone + ca.dot(fix.lean, own @ fix.lean) - offset.variance
    for i, part in parts.items():
        with_position = part * (column + sunk * tilted * by_sink)
        P[list(POSITION), i], P[i, list(POSITION)] = with_position, with_position.T
        P[i, VERTICAL_ERROR] = P[VERTICAL_ERROR, i] = part * sunk * tilted
        P[i, DEPTH_BIAS] = P[DEPTH_BIAS, i] = -part * ca.dot(fix.lean, by_bias)
        for j, other in parts.items():
            P[i, j] += part * other * (learnt + sunk * tilted**2)
