"""A Kalman filter for widely spaced beacons with errors of their own: on the bottom, or buoys.

Every sample is used once, at its own epoch. Ranges may be late. A filter that is wrong restarts.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from ..declaration import number_of
from ..equations import Equations, Loop, Symbols, Values
from . import estimate, field, lateness, least_squares, measurements, turn
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
        "mean": mean,
        "covariance": pack(ca.diag(variances)),
        "anchor": ca.SX.zeros(p.beacons, 3),
        "score": 0,
        "doubt": 0,
        "ranged": t,
        "pause": 0,
        "restarts": 0,
        "passes": 0,
        "damping": 0,
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
        "damping": least_squares.FIRST_DAMPING,
    }


def _unprocessed(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Any:
    return x.ready * (x.passes == 0) * _samples(x, u).any_new


def _process(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """The oldest sample; of equal epochs the depth, so that ranges are linearised better."""
    s = _samples(x, u)
    n = s.count
    pending = [ca.if_else(s.new[i], s.epoch[i], s.newest + 1) for i in range(n + 1)]
    oldest = ca.mmin(ca.vertcat(*pending))
    is_depth = pending[DEPTH] <= oldest
    which, taken, z, known = [], is_depth, ca.SX(0), ca.SX.zeros(1, 3)
    for i in range(n):
        this = (pending[i] <= oldest) * (taken == 0)
        which.append(this)
        taken += this
        z = ca.if_else(this, s.z[i], z)
        known = ca.if_else(this, s.beacons[i, :], known)
    epoch = ca.fmax(oldest, x.epoch)
    phi, noise = field.transition(ca, p, epoch - x.epoch)
    mean, P = _predicted(x, phi, noise, field.states(n))
    elements = [mean[i] for i in range(field.states(n))]
    about = _anchored(x, which, known, mean)
    row = _either(is_depth, field.depth(p, elements), field.range_(
        ca, p, elements, [known[i] for i in range(3)], which, [about[i] for i in range(3)]
    ))
    H = ca.SX(field.states(n), 1)
    for i, value in row.row.items():
        H[i] = value
    c = P @ H
    S = ca.fmax(ca.dot(H, c), 0) + row.variance
    innovation = ca.if_else(is_depth, s.z[DEPTH], z) - row.value
    punctual, other = lateness.densities(p, innovation, S)
    share = ca.if_else(is_depth, 1, punctual / (punctual + other))
    turned = turn.told(p, x, epoch, innovation, S, punctual + other)
    begins = turned.begins * (is_depth == 0)
    # A range that is too short is not late: a filter that knows of the turn reads it again.
    again = begins * (innovation < 0)
    short = (1 - share) * (innovation < 0) * (begins == 0)
    score = lateness.score(p, x.score, share, short, is_depth == 0)
    anew = (score > lateness.LIMIT) * s.enough * (begins == 0)
    K = c / S
    used = (again == 0) * share
    P += used * ((1 - share) * innovation**2 - S) * (K @ K.T)
    P = turn.widened(p, P, turned, begins, POSITION, VELOCITY)
    done = ca.fmax(ca.vertcat(*which, is_depth) * (again == 0), anew)
    return {
        "seen": ca.if_else(done, s.mark, x.seen),
        "epoch": ca.if_else(anew, s.newest, epoch),
        "mean": mean + used * innovation * K,
        "covariance": pack(symmetric(P)),
        "anchor": ca.vertcat(*(
            ca.if_else(this, about, x.anchor[i, :]) for i, this in enumerate(which)
        )),
        "score": ca.if_else(ca.fmax(anew, begins), 0, score),
        "doubt": ca.if_else(is_depth, x.doubt, ca.if_else(anew, 0, turned.doubt)),
        "ranged": ca.if_else(ca.fmax(is_depth, again), x.ranged, epoch),
        "pause": ca.if_else(is_depth, x.pause, turned.pause),
        "restarts": x.restarts + anew,
        "nis": x.nis + used * innovation**2 / S,
        "nis_degrees": x.nis_degrees + (used > 0.5),
        "passes": ca.if_else(anew, least_squares.PASSES, x.passes),
        "damping": ca.if_else(anew, least_squares.FIRST_DAMPING, x.damping),
    }


def _anchored(x: Symbols, which: Any, known: Any, mean: Any) -> Any:
    """Reported position of a beacon, first or, if relocated, current: derivatives are taken there.

    Derivatives at a changing estimate would make the filter believe that it observes rotation and
    scale of diver and beacons together, which no range shows (first-estimates Jacobian: G. P.
    Huang, A. I. Mourikis, S. I. Roumeliotis, Int. J. Robot. Res. 29, 2010, 502-528).
    """
    first = sum(this * x.anchor[i, :] for i, this in enumerate(which))
    distance = ca.sumsqr(mean[list(POSITION)].T - known)
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
    """A pass of a fix from the latest receptions; the ranges' common error counts as their noise.

    The fix is therefore less certain than it might be, and independent of clock and beacons, which
    keep their priors.
    """
    s = _samples(x, u)
    place = list(POSITION)
    position = ca.if_else(
        x.passes == least_squares.PASSES, least_squares.closed_form(s), x.mean[place]
    )
    length = ca.vertcat(*(
        measurements.distance(position, s.beacons[i, :])[0] for i in range(s.count)
    ))
    common = p.clock_std**2 + p.beacon_error_std**2 + p.beacon_noise_std**2
    ranges = sounding_variance(p.range_std) + common + (p.sound_speed_std * length) ** 2
    depths = sounding_variance(p.depth_std) + p.depth_bias_std**2
    motion = p.prior_velocity_std * (s.newest - s.epoch)
    weight = least_squares.weights(s, ca.vertcat(ranges, depths) + motion**2)
    result = least_squares.improve(position, x.damping, s, weight)
    doubt = ca.fmax(result.cost / ca.fmax(least_squares.degrees(s), 1), 1)
    mean, P = ca.SX.zeros(field.states(p.beacons)), ca.diag(_unknown(p))
    mean[place] = result.position
    P[place, place] = doubt * least_squares.inverse(result.information)
    return {
        "mean": mean,
        "covariance": pack(P),
        "damping": result.damping,
        "passes": ca.if_else(result.done, 0, x.passes - 1),
        "nis": 0,
        "nis_degrees": 0,
    }


def _output(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Values:
    P = unpack(x.covariance, field.states(p.beacons))
    return {
        **estimate.outputs(x, x.mean[: estimate.STATES], P[: estimate.STATES, : estimate.STATES]),
        **estimate.of_clock(p, x, x.mean[CLOCK], x.mean[SPEED]),
    }


EQUATIONS = Equations(
    initial=_initial,
    tick=_tick,
    output=_output,
    iterate=(
        Loop("process", _unprocessed, _process),
        Loop("anew", lambda p, x, u, t: x.passes, _anew),
    ),
)
