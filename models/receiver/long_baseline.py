"""A Kalman filter for widely spaced beacons with errors of their own: on the bottom, or buoys.

Every sample is used once, at its own epoch. Ranges may be late. A filter that is wrong restarts.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import casadi as ca

from ..declaration import number_of
from ..equations import Equations, Loop, Symbols, Values
from . import bank, estimate, field, lateness, least_squares, measurements, mirror, turn
from .estimate import pack, unpack
from .field import CLOCK, POSITION, SPEED, VELOCITY
from .least_squares import symmetric
from .measurements import DEPTH, Samples, with_beacons
from .steps import Map
from .surroundings import Measurement, sounding_variance
from .variables import INITIALISATION

_PRIOR = number_of(INITIALISATION, "prior")
_MOVED = 0.1
"""A beacon that has moved by more than this fraction of its distance has been relocated."""
_WIDE = 0.42
"""Spread across a range, as a share of its length, above which its second order says little."""
_LARGE = 5.0
"""Standard deviation of the clock [m] above which a fix begins in the middle of the beacons."""
_NEAR = 30.0
"""Least prior of the diver about the middle of the beacons, north and east [m]."""
KEPT = tuple(range(estimate.STATES))
"""The states whose covariance is output: position and velocity."""


def _unknown(p: Symbols) -> Any:
    """Variances of all states before any measurement, (n, 1); 0 for the diver's position."""
    variances = ca.SX.zeros(field.states(p.beacons))
    for i, std in field.prior_stds(p).items():
        variances[i] = std**2
    for i in VELOCITY:
        variances[i] = p.prior_velocity_std**2
    return variances


def _initial(p: Symbols, w: Symbols, t: Any) -> Values:
    n = field.states(p.beacons)
    mean, variances = ca.SX.zeros(n), _unknown(p)
    mean[list(POSITION)], mean[list(VELOCITY)] = p.prior_position, p.prior_velocity
    for i in POSITION:
        variances[i] = p.prior_position_std**2
    return {
        **measurements.initial(p, t),
        **estimate.initial(t),
        "ready": p.initialisation == _PRIOR,
        **bank.initial(p, mean, ca.diag(variances), t, len(KEPT)),
        "anchor": ca.SX.zeros(p.beacons, 3),
        "sample": ca.SX.zeros(_SAMPLE + p.beacons),
        "heard": ca.SX.zeros(bank.ROWS, 3),
        "score": 0,
        **turn.initial(t),
        "restarts": 0,
        "passes": 0,
        "damping": 0,
        "fix": ca.SX.zeros(3),
        "course": ca.SX.zeros(3),
        "spread": ca.SX.zeros(6),
        "common": ca.SX.zeros(5),
        **mirror.initial(t),
    }


def _samples(x: Symbols, u: Symbols) -> Samples:
    return with_beacons(x, u, u.ping_beacon_position)


def _tick(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any, k: Any) -> Values:
    s = _samples(x, u)
    update = s.any_new * x.ready
    start = s.any_new * s.enough * (x.ready == 0)
    return {
        "ready": x.ready + start,
        "update_count": x.update_count + update + start,
        "seen": ca.if_else(x.ready, x.seen, s.mark),
        "epoch": ca.if_else(start, s.newest, x.epoch),
        "nis": ca.if_else(update, 0, x.nis),
        "nis_degrees": ca.if_else(update, 0, x.nis_degrees),
        "passes": least_squares.PASSES * start,
        "kind": mirror.HERE,
        "damping": least_squares.FIRST_DAMPING,
    }


def _unprocessed(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Any:
    return x.ready * (x.passes == 0) * _samples(x, u).any_new


_SAMPLE = 10
"""Numbers of a sample besides its beacon: `_sample`."""


def _sample(x: Symbols) -> SimpleNamespace:
    """The sample at hand.

    Attributes
    ----------
    pending
        Whether the filters have not used it yet.
    is_depth, z
        Whether it is a reading of the depth sensor or a range, and its value [m].
    pause
        Time since the sample before [s].
    known, about, which
        Reported position of the beacon of a range, the position at which to take derivatives
        [m], each a list, and which of the beacons it is, (N, 1).
    """
    v = x.sample
    return SimpleNamespace(
        pending=v[0], is_depth=v[1], z=v[2], pause=v[3], known=[v[4], v[5], v[6]],
        about=[v[7], v[8], v[9]], which=v[_SAMPLE:],
    )


def _read(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """Take the oldest sample; of equal epochs the depth, so that ranges are linearised better."""
    s = _samples(x, u)
    n = s.count
    pending = [ca.if_else(s.new[i], s.epoch[i], s.newest + 1) for i in range(n + 1)]
    oldest = ca.mmin(ca.vertcat(*pending))
    is_depth = pending[DEPTH] <= oldest
    which, taken, z, known = [], is_depth, s.z[DEPTH], ca.SX.zeros(1, 3)
    for i in range(n):
        this = (pending[i] <= oldest) * (taken == 0)
        which.append(this)
        taken += this
        z = ca.if_else(this, s.z[i], z)
        known = ca.if_else(this, s.beacons[i, :], known)
    epoch = ca.fmax(oldest, x.epoch)
    pause = epoch - x.epoch
    first = x.mean[0, :]
    place = first[list(POSITION)] + pause * first[list(VELOCITY)]
    about = _anchored(x, which, known, place)
    return {
        "epoch": epoch,
        "sample": ca.vertcat(1, is_depth, z, pause, known.T, about.T, *which),
        "anchor": ca.vertcat(*(
            ca.if_else(this, about, x.anchor[i, :]) for i, this in enumerate(which)
        )),
    }


def _pending(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Any:
    """Whether a row processes the sample."""
    taking_part = ca.if_else(x.row == bank.EXTRA, x.other, bank.learned(p))
    return _sample(x).pending * ca.fmax(x.row == 0, taking_part)


def _filter(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """Process the sample with one filter of the bank."""
    s, n = _sample(x), field.states(p.beacons)
    phi, noise = field.transition(ca, p, s.pause, bank.psd(p, x))
    mean, P = _predicted(x, phi, noise, n)
    elements = [mean[i] for i in range(n)]
    row = _either(s.is_depth, field.depth(p, elements), field.range_(
        ca, p, elements, s.known, [s.which[i] for i in range(p.beacons)], s.about
    ))
    H = ca.SX(n, 1)
    for i, value in row.row.items():
        H[i] = value
    c = P @ H
    bend, spread = _curved(P, H)
    S = ca.fmax(ca.dot(H, c), 0) + row.variance + ca.if_else(s.is_depth, 0, spread)
    innovation = s.z - row.value - ca.if_else(s.is_depth, 0, bend)
    punctual, other = lateness.densities(p, innovation, S)
    density = punctual + other
    share = ca.if_else(s.is_depth, 1, punctual / density)
    # A filter that learns how the diver moves needs no score of turns.
    counts = (s.is_depth == 0) * (bank.learned(p) == 0)
    turned = turn.told(p, x, innovation, S, density, counts, follows=x.row == bank.EXTRA)
    K = c / S
    used = (turned.again == 0) * share
    P += used * ((1 - share) * innovation**2 - S) * (K @ K.T)
    P = turn.widened(p, P, turned, POSITION, VELOCITY)
    return {
        "mean": mean + used * innovation * K,
        "covariance": pack(symmetric(P)),
        "weight": bank.weighed(x, density, s.is_depth == 0),
        "heard": ca.vertcat(
            share, lateness.wrong(innovation, share, density), used * innovation**2 / S
        ),
        **turned.states,
    }


def _curved(P: Any, H: Any) -> tuple[Any, Any]:
    """Mean and variance of what the curvature of a wavefront adds to a range.

    Next to the line of the beacons a range has no slope across it, and only its curvature tells how
    far off the diver is.
    """
    place = list(POSITION)
    P, u = P[place, place], H[place]
    u /= ca.sqrt(ca.fmax(ca.sumsqr(u), 1e-30))
    length = ca.fmax(H[SPEED], 1)
    v = P @ u
    along = ca.dot(u, v)
    across = ca.trace(P) - along
    valid = 1 / (1 + (across / (_WIDE * length) ** 2) ** 2)
    square = ca.sumsqr(P) - 2 * ca.sumsqr(v) + along**2
    return valid * 0.5 * across / length, valid * 0.5 * square / length**2


def _settle(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """What the sample means for all filters: weights, doubts, a restart."""
    s, sample = _samples(x, u), _sample(x)
    weight, begins = bank.normalised(x), x.begins
    share, short, nis = ca.vertsplit((weight[: bank.MODELS].T @ x.heard[: bank.MODELS, :]).T)
    # A range that is too short is not late: a filter that knows of the turn reads it again.
    score = lateness.score(p, x.score, share, short * (begins == 0), sample.is_depth == 0)
    anew = (score > lateness.LIMIT) * s.enough * (begins == 0)
    done = ca.fmax(ca.vertcat(sample.which, sample.is_depth) * (x.again == 0), anew)
    ranged = (sample.is_depth == 0) * (x.again == 0)
    last = (ca.sum1(s.new) <= 1) * (x.again == 0)
    side = mirror.settled(x, weight, ranged, anew, last, s.enough)
    resets = ca.fmax(anew, side["beginning"] > 0)
    return {
        "sample": ca.vertcat(0, x.sample[1:]),
        "seen": ca.if_else(done, s.mark, x.seen),
        "epoch": ca.if_else(anew, s.newest, x.epoch),
        "weight": weight,
        "score": ca.if_else(ca.fmax(resets, begins), 0, score),
        "doubt": ca.if_else(resets, 0, x.doubt),
        "nis": x.nis + nis,
        "nis_degrees": x.nis_degrees + (x.again == 0) * (share > 0.5),
        **side,
    }


def _anchored(x: Symbols, which: Any, known: Any, place: Any) -> Any:
    """Reported position of a beacon, first or, if relocated, current: derivatives are taken there.

    Derivatives at a changing estimate would make the filter believe that it observes rotation and
    scale of diver and beacons together, which no range shows (first-estimates Jacobian: G. P.
    Huang, A. I. Mourikis, S. I. Roumeliotis, Int. J. Robot. Res. 29, 2010, 502-528).
    """
    first = sum(this * x.anchor[i, :] for i, this in enumerate(which))
    distance = ca.sumsqr(place - known)
    moved = ca.sumsqr(known - first) > _MOVED**2 * distance
    return ca.if_else(ca.fmax(ca.sumsqr(first) == 0, moved), known, first)


def _predicted(x: Symbols, phi: Any, noise: Any, n: int) -> tuple[Any, Any]:
    Phi, Q = Map(phi).matrix(n), ca.SX(n, n)
    for (i, j), value in noise.items():
        Q[i, j] = Q[j, i] = value
    return Phi @ x.mean, symmetric(Phi @ unpack(x.covariance, n) @ Phi.T + Q)


def _either(condition: Any, one: Measurement, other: Measurement) -> Measurement:
    rows = {
        i: ca.if_else(condition, one.row.get(i, 0), other.row.get(i, 0))
        for i in sorted({*one.row, *other.row})
    }
    return Measurement(
        ca.if_else(condition, one.value, other.value), rows,
        ca.if_else(condition, one.variance, other.variance),
    )


def _anew(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """A pass of a fix from the latest receptions; the clock is what their ranges have in common.

    Speed of sound and errors of beacons count as their noise. The fix is therefore less certain
    than it might be, and independent of these, which keep their priors.
    """
    s = _samples(x, u)
    there = x.kind == mirror.THERE
    here = _here(x)
    every = _variances(p, s, here.position, p.clock_std**2)
    image = mirror.reflected(here, s, least_squares.weights(s, every))
    middle = least_squares.middle(s)
    # Squares of ranges with a large error in common say nothing.
    first = ca.if_else(
        p.clock_std > _LARGE, ca.vertcat(middle[:2], s.z[DEPTH]), least_squares.closed_form(s)
    )
    position = ca.if_else(x.begun, x.fix, ca.if_else(there, image.position, first))
    course = ca.if_else(there, image.velocity, 0)
    s = mirror.moving(s, course)
    clock = sounding_variance(p.clock_std)
    weight = least_squares.weights(s, _variances(p, s, position, 0))
    far = ca.fmax(ca.mmax(s.heard[:DEPTH] * s.z[:DEPTH]), _NEAR)
    known = least_squares.Common(
        least_squares.reciprocal(clock), middle, least_squares.reciprocal(far**2)
    )
    result = least_squares.improve(
        position, x.damping, lambda place: least_squares.together(place, s, weight, known)
    )
    fix = result.taken
    doubt = ca.fmax(fix.cost / ca.fmax(least_squares.degrees(s), 1), 1)
    last = ca.fmax(result.done, x.passes == 1)
    return {
        "begun": last == 0,
        "fix": fix.position,
        "course": course,
        "spread": pack(doubt * least_squares.inverse(fix.information)),
        "common": ca.vertcat(fix.common, fix.alone, fix.lean),
        "beginning": last * (x.kind == mirror.HERE),
        "looking": last * there,
        "damping": result.damping,
        "passes": ca.if_else(last, 0, x.passes - 1),
    }


def _here(x: Symbols) -> mirror.Side:
    """Where the bank is."""
    mean, P = bank.mixture(x, POSITION)
    return mirror.Side(mean[list(POSITION)], mean[list(VELOCITY)], ca.trace(P))


def _variances(p: Symbols, s: Samples, position: Any, clock: Any) -> Any:
    """Variances of the latest samples at a position, (N + 1, 1): what is common is noise, too.

    Parameters
    ----------
    clock
        Variance of the clock [m²]; 0 if its error is known.
    """
    length = ca.vertcat(*(
        measurements.distance(position, s.beacons[i, :])[0] for i in range(s.count)
    ))
    common = clock + p.beacon_error_std**2 + p.beacon_noise_std**2
    ranges = sounding_variance(p.range_std) + common + (p.sound_speed_std * length) ** 2
    depths = sounding_variance(p.depth_std) + p.depth_bias_std**2
    motion = p.prior_velocity_std * (s.newest - s.epoch)
    return ca.vertcat(ranges, depths) + motion**2


def _look(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    s, here = _samples(x, u), _here(x)
    there = mirror.Side(x.fix, x.course, ca.trace(unpack(x.spread, 3)))
    return mirror.looked(p, x, s, _variances(p, s, here.position, p.clock_std**2), here, there)


def _begins(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Any:
    return (x.beginning > 0) * ca.fmax(x.beginning != mirror.THERE, x.row == bank.EXTRA)


def _begin(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """Let a filter begin at the fix, or where the one on the other side is."""
    place = list(POSITION)
    mean, P = ca.SX.zeros(field.states(p.beacons)), ca.diag(_unknown(p))
    mean[place], mean[list(VELOCITY)] = x.fix, x.course
    own = unpack(x.spread, 3)
    common, alone, lean = x.common[0], x.common[1], x.common[2:]
    mean[CLOCK] = common
    P[place, place] = own
    P[place, CLOCK] = -own @ lean
    P[CLOCK, place] = P[place, CLOCK].T
    P[CLOCK, CLOCK] = alone + ca.dot(lean, own @ lean)
    taken, here = x.beginning == mirror.TAKEN, x.beginning == mirror.HERE
    return {
        "mean": ca.if_else(taken, x.every.mean[bank.EXTRA, :].T, mean),
        "covariance": ca.if_else(taken, x.every.covariance[bank.EXTRA, :].T, pack(P)),
        "weight": bank.begun_of(p, x),
        "beginning": ca.if_else(x.row == bank.ROWS - 1, 0, x.beginning),
        "mixed": ca.if_else(x.beginning == mirror.THERE, x.mixed, x.epoch),
        "looked": ca.if_else(here, x.epoch - mirror.EVERY, x.looked),
        "fresh": ca.if_else(here, 1, x.fresh),
        "nis": ca.if_else(here, 0, x.nis),
        "nis_degrees": ca.if_else(here, 0, x.nis_degrees),
    }


def _output(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Values:
    mean, P = bank.estimate(p, x, 0, KEPT)
    kept = list(KEPT)
    there, P_there = x.mean[bank.EXTRA, :].T, unpack(x.covariance[bank.EXTRA, :].T, mean.numel())
    mean, P = mirror.both(x, mean, P[kept, kept], there, P_there[kept, kept])
    return {
        **estimate.outputs(x, mean[: estimate.STATES], P),
        **estimate.of_clock(p, x, mean[CLOCK], mean[SPEED]),
        "motion_psd": ca.if_else(bank.learned(p), x.believed, p.acceleration_psd),
    }


EQUATIONS = Equations(
    initial=_initial,
    tick=_tick,
    output=_output,
    iterate=(
        Loop("process", _unprocessed, _read, inner=(
            Loop("filter", _pending, _filter, each=(*bank.STATES, "heard")),
            Loop("settle", lambda p, x, u, t: _sample(x).pending, _settle),
        )),
        Loop("anew", lambda p, x, u, t: x.passes, _anew),
        Loop("look", lambda p, x, u, t: x.looking, _look),
        Loop("begin", _begins, _begin, each=bank.STATES),
        *bank.loops(KEPT),
    ),
)
