"""A Kalman filter of the diver, the platform and the errors of their sensors, together.

Every sample is used once, at its own epoch. Ranges may be late. Corrections follow the arc about
the platform. A filter that is wrong restarts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import pi
from typing import Any

import casadi as ca

from ..declaration import number_of
from ..equations import Equations, Loop, Symbols, Values
from . import (
    arc,
    estimate,
    lateness,
    least_squares,
    measurements,
    pose,
    start,
    surroundings,
    waves,
)
from .estimate import pack, unpack
from .least_squares import symmetric
from .measurements import DEPTH, Samples, with_beacons
from .steps import Correction, Map, Step
from .surroundings import (
    CLOCK,
    HEADING,
    HEADING_ERROR,
    PLATFORM,
    POSITION,
    SPEED,
    STATES,
    VELOCITY,
    VERTICAL_ERROR,
    Measurement,
)
from .variables import INITIALISATION
from .waves import Heave, Swing

_PRIOR = number_of(INITIALISATION, "prior")
_FAR_STD = 30.0
"""Prior of the platform about its first packet [m]; a larger one changes nothing."""
_ANYWHERE = 10.0
"""Prior of the heading before the first packet [rad]."""


def initial(p: Symbols, w: Symbols, t: Any) -> Values:
    """All states of the filter at the start."""
    stds = ca.SX.zeros(STATES)
    for i, std in surroundings.prior_stds(p).items():
        stds[i] = std
    for i in POSITION:
        stds[i] = p.prior_position_std
    for i in VELOCITY:
        stds[i] = p.prior_velocity_std
    mean = ca.SX.zeros(STATES)
    mean[list(POSITION)] = p.prior_position
    mean[list(VELOCITY)] = p.prior_velocity
    return {
        **measurements.initial(p, t),
        **estimate.initial(t),
        "ready": p.initialisation == _PRIOR,
        "located": 0,
        "mean": mean,
        "covariance": pack(ca.diag(stds**2)),
        "platform_down": 0,
        **_states_of(waves.no_heave(p), waves.no_swing(p)),
        "pose_epoch": t,
        "arm": ca.SX.zeros(p.beacons, 3),
        **pose.NOTHING.states,
        "score": 0,
        "restarts": 0,
        "passes": 0,
        "damping": 0,
    }


def _tick(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any, k: Any) -> Values:
    s = with_beacons(x, u, u.ping_beacon_position)
    update = s.any_new * x.ready
    return {
        "update_count": x.update_count + update,
        "nis": ca.if_else(update, 0, x.nis),
        "nis_degrees": ca.if_else(update, 0, x.nis_degrees),
    }


def unprocessed(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Any:
    """Whether there is a sample that has not been used."""
    return with_beacons(x, u, u.ping_beacon_position).any_new


def _process(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    return processed(p, x, u)[0]


def processed(p: Symbols, x: Symbols, u: Symbols) -> tuple[dict[str, Any], list[Step]]:
    """Process the oldest sample; a depth and a packet of one epoch together, the depth first.

    The first fix waits for the platform and for the last of the new samples.

    Returns
    -------
    states, steps
        The changed states, and the steps that the mean and its error go through, except for the
        first placement of the platform.
    """
    s = with_beacons(x, u, u.ping_beacon_position)
    oldest, depth, packet, chosen, z = _oldest(s)
    newest = oldest >= ca.mmax(s.epoch[:DEPTH])
    epoch = ca.fmax(oldest, x.epoch)
    using = x.ready * (x.passes == 0)

    phi, noise = surroundings.transition(ca, p, epoch - x.epoch)
    mean, P, moved = _predicted(x, phi, noise)
    drift = surroundings.drift(p, phi, noise)
    beside = _waves_later(p, x, mean, epoch - x.epoch, drift)
    said = pose.read(p, u, s, chosen, newest, pose.later(x, drift))
    mean, P, located = _located(mean, P, said, packet, x.located)

    depth_used = depth * using
    mean, P, depth_nis, sounded = _sounded(p, mean, P, s.z[DEPTH], depth_used)
    # Several packets of one epoch hold the same pose, errors included.
    fresh = packet * (1 - (oldest == x.pose_epoch) * (said.is_own == 0))
    mean, P, heave, sunk = _floated(p, mean, P, beside[0], said, fresh)
    mean, P, swing, posed = _platform_updated(p, mean, P, beside[1], said, fresh * located)
    ranged = packet * located * using
    mean, P, share, range_nis, heard = _range_updated(p, mean, P, said, swing, z, ranged)

    score = lateness.score(p, x.score, share, ranged)
    too_fast = ca.sumsqr(mean[list(VELOCITY)]) > p.speed_limit**2
    known = s.enough * located
    wrong = ca.fmax(score > lateness.LIMIT, too_fast) * using * known
    first = (x.ready == 0) * known * (ca.sum1(s.new) <= packet + depth)
    anew = ca.fmax(first, wrong)
    arm = ca.repmat(_turned_arm(said).T, s.count, 1)
    changed = {
        "ready": x.ready + first,
        "update_count": x.update_count + first,
        "seen": ca.if_else(ca.vertcat(chosen, depth), s.mark, x.seen),
        "epoch": epoch,
        "mean": mean,
        "covariance": pack(P),
        "located": located,
        "pose_epoch": ca.if_else(packet, oldest, x.pose_epoch),
        "platform_down": ca.if_else(packet, said.pose.down, x.platform_down),
        **_states_of(heave, swing),
        "arm": ca.if_else(ca.repmat(chosen, 1, 3), arm, x.arm),
        **said.own.states,
        "score": ca.if_else(wrong, 0, score),
        "restarts": x.restarts + wrong,
        "nis": x.nis + depth_nis + range_nis,
        "nis_degrees": x.nis_degrees + depth_used + ranged * (share > 0.5),
        "passes": ca.if_else(anew, least_squares.PASSES, x.passes),
        "damping": ca.if_else(anew, least_squares.FIRST_DAMPING, x.damping),
    }
    return changed, [moved, sounded, sunk, *posed, *heard]


def _sounded(
    p: Symbols, mean: Any, P: Any, z: Any, weight: Any
) -> tuple[Any, Any, Any, Correction]:
    """Apply a reading of the depth sensor; returns mean, P, nis and step like `_update`."""
    row = surroundings.depth(p, _elements(mean))
    d, P, nis, step = _update(P, ca.SX.zeros(STATES), row, z - row.value, weight)
    return mean + d, P, nis, step


def _oldest(s: Samples) -> tuple[Any, Any, Any, Any, Any]:
    """The oldest epoch, whether it has a depth and a packet, the packet's beacon and its range."""
    pending = [ca.if_else(s.new[i], s.epoch[i], s.newest + 1) for i in range(s.count + 1)]
    oldest = ca.mmin(ca.vertcat(*pending))
    which, packet, z = [], ca.SX(0), ca.SX(0)
    for i in range(s.count):  # the first of equal epochs
        this = (pending[i] <= oldest) * (packet == 0)
        which.append(this)
        packet += this
        z = ca.if_else(this, s.z[i], z)
    return oldest, pending[DEPTH] <= oldest, packet, ca.vertcat(*which), z


def _elements(mean: Any) -> list[Any]:
    return [mean[i] for i in range(STATES)]


def _turned_arm(said: pose.Packet) -> Any:
    """The beacon's arm with its packet's tilt, at a heading of 0, (3, 1)."""
    at_zero = [ca.SX(0)] * STATES
    arm = [said.arm[i] for i in range(3)]
    return ca.vertcat(*surroundings.arm_of(ca, at_zero, said.pose, arm))


def _predicted(
    x: Symbols, phi: Mapping[tuple[int, int], Any], noise: Mapping[tuple[int, int], Any]
) -> tuple[Any, Any, Map]:
    """The state and its covariance after a transition, and Φ."""
    moved = Map(phi)
    Phi, Q = moved.matrix(STATES), ca.SX(STATES, STATES)
    for (i, j), value in noise.items():
        Q[i, j] = Q[j, i] = value
    P = unpack(x.covariance, STATES)
    return Phi @ x.mean, symmetric(Phi @ P @ Phi.T + Q), moved


def _located(
    mean: Any, P: Any, said: pose.Packet, packet: Any, located: Any
) -> tuple[Any, Any, Any]:
    """Place the platform where its first complete packet says."""
    first = packet * said.complete * (located == 0)
    # Own positions are rotated by ψ + e_ψ.
    apart = ca.if_else(said.is_own, P[HEADING_ERROR, HEADING_ERROR], 0)
    variances = {
        **dict.fromkeys(PLATFORM, _FAR_STD**2),
        HEADING: ca.if_else(said.is_own, said.heading_variance, _ANYWHERE**2) + apart,
    }
    values = {
        PLATFORM[0]: said.platform[0], PLATFORM[1]: said.platform[1],
        HEADING: said.first_heading - ca.if_else(said.is_own, mean[HEADING_ERROR], 0),
    }
    mean, P = ca.SX(mean), ca.SX(P)
    for i, variance in variances.items():
        mean[i] = ca.if_else(first, values[i], mean[i])
        for j in range(STATES):
            P[i, j] = P[j, i] = ca.if_else(first, variance if i == j else 0, P[i, j])
    P[HEADING, HEADING_ERROR] = P[HEADING_ERROR, HEADING] = ca.if_else(
        first, -apart, P[HEADING, HEADING_ERROR]
    )
    return mean, P, ca.fmax(located, first)


def _gain(P: Any, row: Measurement) -> tuple[Any, Any]:
    """P H' and S = H P H' + R of a scalar measurement."""
    H = ca.SX(STATES, 1)
    for i, value in row.row.items():
        H[i] = value
    c = P @ H
    return c, ca.fmax(ca.dot(H, c), 0) + row.variance


def _update(
    P: Any, d: Any, row: Measurement, innovation: Any, weight: Any
) -> tuple[Any, Any, Any, Correction]:
    """Add a linear scalar measurement to a correction d that has not been applied yet.

    Returns
    -------
    d, P, nis, step
        Including the measurement where weight is 1.
    """
    c, S = _gain(P, row)
    rest = innovation - sum(value * d[i] for i, value in row.row.items())
    share = weight / S
    step = Correction(row.row, c, share * rest, -share)
    return d + share * rest * c, symmetric(P - share * (c @ c.T)), share * rest**2, step


def heave_of(x: Symbols) -> Heave:
    """The platform's depth, from the states."""
    return Heave(x.heave, x.heave_share, x.heave_variance)


def _swing_of(x: Symbols) -> Swing:
    return Swing(
        ca.vertsplit(x.swing), x.swing_share, ca.vertsplit(x.swing_turned), x.swing_variance
    )


def _states_of(heave: Heave, swing: Swing) -> Values:
    return {
        "heave": heave.down, "heave_share": heave.share, "heave_variance": heave.variance,
        "swing": ca.vertcat(*swing.tilt), "swing_share": swing.share,
        "swing_turned": ca.vertcat(*swing.turned), "swing_variance": swing.variance,
    }


def _waves_later(
    p: Symbols, x: Symbols, mean: Any, dt: Any, drift: tuple[Any, Any, Any]
) -> tuple[Heave, Swing]:
    """Heave and swing after dt; `mean` is the predicted state."""
    now, then = _elements(mean), _elements(x.mean)
    moved = [a - b for a, b in zip(waves.causes(now), waves.causes(then), strict=True)]
    sunk = now[VERTICAL_ERROR] - then[VERTICAL_ERROR]
    return (
        waves.heave_later(ca, p, heave_of(x), dt, sunk, drift[2]),
        waves.swing_later(ca, p, _swing_of(x), dt, moved, drift[:2]),
    )


def _floated(
    p: Symbols, mean: Any, P: Any, heave: Heave, said: pose.Packet, weight: Any
) -> tuple[Any, Any, Heave, Map]:
    """Apply the reported depth of the platform.

    It corrects g_z alone: what other states have in common with g_z, ranges have told them.
    """
    z, n = said.pose.down, VERTICAL_ERROR
    row = waves.down_after(ca, p, heave, said.pose.own, [said.arm[i] for i in range(2)])
    slope = row.row[n]
    gain = weight * slope * P[n, n] / (slope**2 * P[n, n] + row.variance)
    kept = 1 - gain * slope
    mean, P = ca.SX(mean), ca.SX(P)
    mean[n] += gain * (z - row.value - slope * mean[n])
    for i in range(STATES):
        P[i, n] = P[n, i] = kept * P[n, i]
    return mean, P, waves.heaved(heave, row, z, weight), Map({(n, n): kept})


def _platform_updated(
    p: Symbols, mean: Any, P: Any, swing: Swing, said: pose.Packet, weight: Any
) -> tuple[Any, Any, Swing, list[Step]]:
    """Apply what a packet says about the platform as one correction."""
    x = _elements(mean)
    d = ca.SX.zeros(STATES)
    body = [said.body[i] for i in range(3)]
    spread = P[HEADING, HEADING] + 2 * P[HEADING, HEADING_ERROR] + P[HEADING_ERROR, HEADING_ERROR]
    steps: list[Step] = []
    # Rounding may leave less than 0 of a variance that was very large.
    known = surroundings.places(ca, p, x, body, ca.fmax(spread, 0))
    for i, row in enumerate(waves.places_after(x, known, body[2], swing)):
        d, P, _, step = _update(P, d, row, said.place[i] - row.value, weight)
        steps.append(step)
    row = surroundings.heading(ca, p, x)
    off = said.heading - row.value
    wrapped = off - 2 * pi * ca.floor((off + pi) / (2 * pi))
    d, P, _, step = _update(P, d, row, wrapped, weight * (said.is_own == 0))
    mean, P, turn = arc.retract(mean, P, d)
    swing = waves.swung(x, known, [said.place[i] for i in range(2)], body[2], swing, weight)
    return mean, P, swing, [*steps, step, turn]


def _range_updated(
    p: Symbols, mean: Any, P: Any, said: pose.Packet, swing: Swing, z: Any, weight: Any
) -> tuple[Any, Any, Any, Any, list[Step]]:
    """Apply a range that may be late, along the arc and to second order.

    Returns
    -------
    mean, P, share, nis, steps
        ``share`` is the probability that the range is not late.
    """
    x, lever = _elements(mean), said.body[2]
    moved = replace(
        said.pose, swing=tuple(lever * tilt for tilt in swing.at(x)),
        swing_variance=lever**2 * swing.variance,
    )
    row = surroundings.range_(ca, p, x, moved, [said.arm[i] for i in range(3)])
    row = waves.range_after(row, lever, swing)
    bent = arc.bent(arc.about(mean, P), row)
    c, S = _gain(P, bent)
    innovation = z - bent.value
    share = lateness.punctual(p, innovation, S)
    kept = weight * share
    K = c / S
    d = kept * innovation * K
    widened = kept * (1 - share) * innovation**2
    P = symmetric(P + (widened - kept * S) * (K @ K.T))
    step = Correction(bent.row, c, kept * innovation / S, (widened - kept * S) / S**2)
    mean, P, turn = arc.retract(mean, P, d)
    return mean, P, share, kept * innovation**2 / S, [step, turn]


def _output(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Values:
    return outputs(p, x, x.mean, unpack(x.covariance, STATES), heave_of(x))


def outputs(p: Symbols, x: Symbols, state: Any, P: Any, heave: Heave) -> Values:
    """All outputs of an estimate.

    Parameters
    ----------
    x
        Holds what `estimate.outputs` needs, ``mean`` for clock and speed of sound, and
        ``restarts``.
    state, P, heave
        State and covariance of the estimate, and the platform's depth.
    """
    seen = arc.about(state, P)
    shift, more = arc.moments(seen, P)
    order = [i for pair in zip(POSITION, VELOCITY, strict=True) for i in pair]
    mean = state[order]
    covariance = P[order, order]
    relative = ca.SX.zeros(3, 3)
    relative[:2, :2] = arc.relative(P) + more
    deeper = P[:, 2] + heave.share * P[:, VERTICAL_ERROR]
    crossing = deeper[list(POSITION[:2])] - deeper[list(PLATFORM)]
    relative[:2, 2], relative[2, :2] = crossing, crossing.T
    relative[2, 2] = deeper[2] + heave.share * deeper[VERTICAL_ERROR] + heave.variance
    horizontal = [0, 2]
    mean[horizontal] += shift
    covariance[horizontal, horizontal] += more + p.gps_bias_std**2 * ca.SX.eye(2)
    down = heave.down - heave.share * state[VERTICAL_ERROR]
    platform = ca.vertcat(state[list(PLATFORM)], down)
    there = x.update_count > 0
    return {
        **estimate.outputs(x, mean, covariance),
        "relative_position": ca.if_else(there, mean[[0, 2, 4]] - platform, 0),
        "relative_covariance": ca.if_else(there, relative, 0),
        "platform_position": platform,
        **estimate.of_clock(p, x, x.mean[CLOCK], x.mean[SPEED]),
    }


EQUATIONS = Equations(
    initial=initial,
    tick=_tick,
    output=_output,
    iterate=(Loop("process", unprocessed, _process), start.anew()),
)
