"""A Kalman filter of the diver, the platform and the errors of their sensors, together.

Every sample is used once, at its own epoch. Ranges may be late. Corrections follow the arc about
the platform. A filter that is wrong restarts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import pi
from typing import Any

import casadi as ca

from ..declaration import number_of
from ..equations import Equations, Loop, Symbols, Values
from . import (
    arc,
    bank,
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
from .measurements import with_beacons
from .steps import Correction, Map, Step
from .surroundings import (
    CLOCK,
    HEADING,
    HEADING_ERROR,
    PLATFORM,
    POSITION,
    SPEED,
    VELOCITY,
    VERTICAL_ERROR,
    Measurement,
)
from .taking import (
    ALONE,
    SAMPLE,
    StateModel,
    heave_of,
    pending,
    reading,
    sample_of,
    split,
    unprocessed,
)
from .variables import INITIALISATION
from .waves import Heave, Swing

_PRIOR = number_of(INITIALISATION, "prior")
_FAR_STD = 30.0
"""Prior of the platform about its first packet [m]; a larger one changes nothing."""
_ANYWHERE = 10.0
"""Prior of the heading before the first packet [rad]."""
_CHALLENGE, _LEAD = 60.0, 4.0
"""Time between challenges [s], and the log-likelihood ratio with which a challenger takes over."""
KEPT = (*POSITION, *VELOCITY, *PLATFORM, VERTICAL_ERROR)
"""The states whose covariance is output."""


def initial(p: Symbols, w: Symbols, t: Any, model: StateModel = ALONE) -> Values:
    """All states of the filter at the start."""
    stds = ca.SX.zeros(model.states)
    for i, std in model.prior_stds(p).items():
        stds[i] = std
    for i in POSITION:
        stds[i] = p.prior_position_std
    for i in VELOCITY:
        stds[i] = p.prior_velocity_std
    mean = ca.SX.zeros(model.states)
    mean[list(POSITION)] = p.prior_position
    mean[list(VELOCITY)] = p.prior_velocity
    phi, noise = model.around(ca, p, ca.SX(0))
    heave, swing = waves.no_heave(p), waves.no_swing(p)
    return {
        **measurements.initial(p, t),
        **estimate.initial(t),
        "ready": p.initialisation == _PRIOR,
        "located": 0,
        **bank.initial(p, mean, ca.diag(stds**2), t, len(KEPT)),
        "platform_down": 0,
        "heave": ca.vertcat(*heave.numbers),
        "swing": ca.vertcat(*swing.numbers),
        "before": ca.vertcat(*heave.numbers, *swing.numbers),
        "pose_epoch": t,
        "arm": ca.SX.zeros(p.beacons, 3),
        **pose.NOTHING.states,
        "sample": ca.SX.zeros(len(SAMPLE)),
        "packet": ca.SX.zeros(pose.NUMBERS),
        "around": ca.SX.zeros(len(phi) + len(noise)),
        "share": 0,
        "short": 0,
        "fast": 0,
        "score": 0,
        "restarts": 0,
        **start.initial(),
    }


def ticked(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any, k: Any) -> Values:
    s = with_beacons(x, u, u.ping_beacon_position)
    update = s.any_new * x.ready
    return {
        "update_count": x.update_count + update,
        "nis": ca.if_else(update, 0, x.nis),
        "nis_degrees": ca.if_else(update, 0, x.nis_degrees),
    }


def taking_part(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Any:
    """Whether a row processes the sample; all but the first wait for a start."""
    taking_part = ca.if_else(x.row == bank.EXTRA, p.watch, bank.learned(p))
    return pending(x) * ca.fmax(x.row == 0, taking_part * x.ready)


def filtered(
    p: Symbols, x: Symbols, u: Symbols, part: Any, model: StateModel = ALONE,
    ranged: Callable[..., tuple[Any, Any, Heard, list[Step]]] | None = None,
) -> tuple[dict[str, Any], list[Step]]:
    """Process a sample with one filter of the bank: the depth first.

    Parameters
    ----------
    part
        Share of this filter in what is said of all of them.
    ranged
        What its ranges do, with the arguments of `range_updated`, which is the default.

    Returns
    -------
    states, steps
        The changed states, and the steps that the mean and its error go through, except for the
        first placement of the platform.
    """
    sample, said = sample_of(x), pose.packet(x.packet)
    phi, noise = surroundings.white_acceleration(bank.psd(p, x), sample.pause, POSITION, VELOCITY)
    known, grown = model.around(ca, p, sample.pause)
    keys = [(phi, key) for key in known] + [(noise, key) for key in grown]
    for i, (elements, key) in enumerate(keys):
        elements[key] = x.around[i]
    mean, P, moved = _predicted(x, phi, noise)
    mean, P = _located(mean, P, said, sample.placing)
    mean, P, depth_nis, sounded = _sounded(p, mean, P, u.depth, sample.sounding)
    mean, P, sunk = _floated(p, mean, P, said, waves.heave_of(split(x.before)[:3]),
                             sample.floating)
    mean, P, posed = _platform_updated(p, mean, P, said, waves.swing_of(split(x.before)[3:]),
                                       sample.posing)
    mean, P, heard, steps = (ranged or range_updated)(
        p, mean, P, said, waves.swing_of(split(x.swing)), sample.range, sample.ranging
    )
    too_fast = ca.sumsqr(mean[list(VELOCITY)]) > p.speed_limit**2
    changed = {
        "mean": mean,
        "covariance": pack(P),
        "weight": bank.weighed(x, heard.density, sample.ranging),
        "share": x.share + part * heard.share,
        "short": x.short + part * heard.short,
        "fast": x.fast + part * too_fast,
        "nis": x.nis + part * depth_nis + part * heard.nis,
    }
    return changed, [moved, sounded, sunk, *posed, *steps]


def _filter(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    return filtered(p, x, u, x.weight * (x.row < bank.MODELS))[0]


def settle(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """What a sample means for all filters: weights, doubts, a start."""
    sample = sample_of(x)
    score = lateness.score(p, x.score, x.share, x.short, sample.ranging)
    wrong = ca.fmax(score > lateness.LIMIT, x.fast > 0.5) * sample.using * sample.enough
    return {
        "sample": ca.vertcat(0, x.sample[1:]),
        "weight": bank.normalised(x),
        "ready": x.ready + sample.first,
        "update_count": x.update_count + sample.first,
        "score": ca.if_else(wrong, 0, score),
        "restarts": x.restarts + wrong,
        "nis_degrees": x.nis_degrees + sample.sounding + sample.ranging * (x.share > 0.5),
        **start.begun(x, ca.fmax(sample.first, wrong)),
    }


def settle_watched(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """The same, with the second opinion."""
    sample = sample_of(x)
    changed = settle(p, x, u, w, t)
    watching = p.watch * sample.using * (changed["passes"] == 0)
    better = ca.log(x.weight[bank.EXTRA]) - ca.log(bank.total(x))
    lead = ca.if_else(watching * sample.ranging, x.lead + better, x.lead)
    takes = watching * (lead > _LEAD)
    due = watching * (takes == 0) * sample.last * sample.enough * (
        x.epoch - x.challenged >= _CHALLENGE
    )
    return {
        **changed,
        "restarts": changed["restarts"] + takes,
        "score": ca.if_else(takes, 0, changed["score"]),
        "lead": ca.if_else(ca.fmax(takes, due), 0, lead),
        "challenged": ca.if_else(ca.fmax(takes, due), x.epoch, x.challenged),
        "passes": ca.if_else(due, least_squares.PASSES, changed["passes"]),
        "damping": ca.if_else(due, least_squares.FIRST_DAMPING, changed["damping"]),
        "kind": ca.if_else(due, start.CHALLENGER, start.ALL),
        "beginning": ca.if_else(takes, start.TAKEN, x.beginning),
    }


def _sounded(
    p: Symbols, mean: Any, P: Any, z: Any, weight: Any
) -> tuple[Any, Any, Any, Correction]:
    """Apply a reading of the depth sensor; returns mean, P, nis and step like `updated`."""
    row = surroundings.depth(p, split(mean))
    d, P, nis, step = updated(P, ca.SX.zeros(P.shape[0]), row, z - row.value, weight)
    return mean + d, P, nis, step


def _predicted(
    x: Symbols, phi: Mapping[tuple[int, int], Any], noise: Mapping[tuple[int, int], Any]
) -> tuple[Any, Any, Map]:
    """The state and its covariance after a transition, and Φ."""
    moved = Map(phi)
    n = x.mean.numel()
    Phi, Q = moved.matrix(n), ca.SX(n, n)
    for (i, j), value in noise.items():
        Q[i, j] = Q[j, i] = value
    P = unpack(x.covariance, n)
    return Phi @ x.mean, symmetric(Phi @ P @ Phi.T + Q), moved


def _located(mean: Any, P: Any, said: pose.Packet, first: Any) -> tuple[Any, Any]:
    """Place the platform where its first complete packet says."""
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
        for j in range(P.shape[0]):
            P[i, j] = P[j, i] = ca.if_else(first, variance if i == j else 0, P[i, j])
    P[HEADING, HEADING_ERROR] = P[HEADING_ERROR, HEADING] = ca.if_else(
        first, -apart, P[HEADING, HEADING_ERROR]
    )
    return mean, P


def gain(P: Any, row: Measurement) -> tuple[Any, Any]:
    """P H' and S = H P H' + R of a scalar measurement."""
    H = ca.SX(P.shape[0], 1)
    for i, value in row.row.items():
        H[i] = value
    c = P @ H
    return c, ca.fmax(ca.dot(H, c), 0) + row.variance


def updated(
    P: Any, d: Any, row: Measurement, innovation: Any, weight: Any
) -> tuple[Any, Any, Any, Correction]:
    """Add a linear scalar measurement to a correction d that has not been applied yet.

    Returns
    -------
    d, P, nis, step
        Including the measurement where weight is 1.
    """
    c, S = gain(P, row)
    rest = innovation - sum(value * d[i] for i, value in row.row.items())
    share = weight / S
    step = Correction(row.row, c, share * rest, -share)
    return d + share * rest * c, symmetric(P - share * (c @ c.T)), share * rest**2, step


def _floated(
    p: Symbols, mean: Any, P: Any, said: pose.Packet, heave: Heave, weight: Any
) -> tuple[Any, Any, Map]:
    """Apply the reported depth of the platform.

    It corrects g_z alone: what other states have in common with g_z, ranges have told them.
    """
    n = VERTICAL_ERROR
    row = waves.down_after(ca, p, heave, said.pose.own, split(said.arm))
    slope = row.row[n]
    gain = weight * slope * P[n, n] / (slope**2 * P[n, n] + row.variance)
    kept = 1 - gain * slope
    mean, P = ca.SX(mean), ca.SX(P)
    mean[n] += gain * (said.pose.down - row.value - slope * mean[n])
    for i in range(P.shape[0]):
        P[i, n] = P[n, i] = kept * P[n, i]
    return mean, P, Map({(n, n): kept})


def _platform_updated(
    p: Symbols, mean: Any, P: Any, said: pose.Packet, swing: Swing, weight: Any
) -> tuple[Any, Any, list[Step]]:
    """Apply what a packet says about the platform as one correction."""
    x = split(mean)
    d = ca.SX.zeros(P.shape[0])
    body = split(said.body)
    spread = P[HEADING, HEADING] + 2 * P[HEADING, HEADING_ERROR] + P[HEADING_ERROR, HEADING_ERROR]
    steps: list[Step] = []
    # Rounding may leave less than 0 of a variance that was very large.
    known = surroundings.places(ca, p, x, body, ca.fmax(spread, 0))
    for i, row in enumerate(waves.places_after(x, known, body[2], swing)):
        d, P, _, step = updated(P, d, row, said.place[i] - row.value, weight)
        steps.append(step)
    row = surroundings.heading(ca, p, x)
    off = said.heading - row.value
    wrapped = off - 2 * pi * ca.floor((off + pi) / (2 * pi))
    d, P, _, step = updated(P, d, row, wrapped, weight * (said.is_own == 0))
    mean, P, turn = arc.retract(mean, P, d)
    return mean, P, [*steps, step, turn]


@dataclass(frozen=True, slots=True)
class Heard:
    """What a filter makes of a range.

    Attributes
    ----------
    share, short
        Probabilities that it is punctual, and that it is too short.
    density
        Density of the innovation [1/m].
    nis
        Normalised innovation squared, as far as the range is punctual.
    """

    share: Any
    short: Any
    density: Any
    nis: Any


def range_updated(
    p: Symbols, mean: Any, P: Any, said: pose.Packet, swing: Swing, z: Any, weight: Any
) -> tuple[Any, Any, Heard, list[Step]]:
    """Apply a range that may be late, along the arc and to second order."""
    x, lever = split(mean), said.body[2]
    moved = replace(
        said.pose, swing=tuple(lever * tilt for tilt in swing.at(x)),
        swing_variance=lever**2 * swing.variance,
    )
    row = surroundings.range_(ca, p, x, moved, split(said.arm))
    row = waves.range_after(row, lever, swing)
    bent = arc.bent(arc.about(mean, P), row)
    d, P, heard, step = weighed(p, P, bent, z - bent.value, weight)
    mean, P, turn = arc.retract(mean, P, d)
    return mean, P, heard, [step, turn]


def weighed(
    p: Symbols, P: Any, row: Measurement, innovation: Any, weight: Any
) -> tuple[Any, Any, Heard, Correction]:
    """The correction by a range that may be late, where weight is 1.

    Returns
    -------
    d, P, heard, step
        The correction of the mean, which is not applied here.
    """
    c, S = gain(P, row)
    punctual, other = lateness.densities(p, innovation, S)
    share = punctual / (punctual + other)
    kept = weight * share
    K = c / S
    d = kept * innovation * K
    widened = kept * (1 - share) * innovation**2
    P = symmetric(P + (widened - kept * S) * (K @ K.T))
    step = Correction(row.row, c, kept * innovation / S, (widened - kept * S) / S**2)
    heard = Heard(share, (1 - share) * (innovation < 0), punctual + other,
                  kept * innovation**2 / S)
    return d, P, heard, step


def _output(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Values:
    mean, P = bank.estimate(p, x, 0, KEPT)
    return outputs(p, x, mean, P, heave_of(x))


def outputs(p: Symbols, x: Symbols, state: Any, P: Any, heave: Heave) -> Values:
    """All outputs of an estimate.

    Parameters
    ----------
    x
        Holds what `estimate.outputs` needs, ``restarts`` and ``believed``.
    state, P, heave
        State and covariance of the estimate (only the rows and columns `KEPT` are used), and the
        platform's depth.
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
        **estimate.of_clock(p, x, state[CLOCK], state[SPEED]),
        "motion_psd": ca.if_else(bank.learned(p), x.believed, p.acceleration_psd),
    }


EQUATIONS = Equations(
    initial=initial,
    tick=ticked,
    output=_output,
    iterate=(
        Loop("process", unprocessed, reading(0), inner=(
            Loop("filter", taking_part, _filter, each=bank.STATES),
            Loop("settle", lambda p, x, u, t: pending(x), settle_watched),
        )),
        *start.anew(0),
        *bank.loops(KEPT),
    ),
)
