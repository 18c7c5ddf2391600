"""The filter `coupled` for beacons that all hear one ping: its arrivals are used together.

They share errors (`ping`), which are states. All arrivals of a ping are linearised at one state,
and the state is corrected once, along the arc. The arrival that is earliest, compared with what the
filter expects, comes first: a range may be late, but never early, so the others are late beside it.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import casadi as ca

from ..equations import Equations, Loop, Symbols, Values
from . import arc, bank, coupled, pose, start, surroundings, taking
from .coupled import Heard
from .measurements import with_beacons
from .ping import STATES, Ping
from .steps import Step
from .surroundings import CLOCK, Measurement
from .waves import Swing

PING = Ping(surroundings.STATES)
_LEAST_VARIANCE = 1e-12
"""Of c as measured [m²]."""
_LATER = 1e9
"""Larger than any innovation [m]."""


def _told(p: Symbols) -> Symbols:
    """The parameters, with the white part of the tilt's error as that of a pose."""
    return SimpleNamespace(**{**vars(p), "imu_tilt_std": p.imu_tilt_noise_std})


def _around(m: Any, p: Any, dt: Any) -> tuple[Any, ...]:
    """`surroundings.around`, with the states of a ping."""
    both = zip(surroundings.around(m, p, dt), PING.transition(m, p, dt), strict=True)
    return tuple({**one, **other} for one, other in both)


_MODEL = taking.StateModel(
    surroundings.STATES + STATES,
    lambda p: {**surroundings.prior_stds(p), **PING.prior_stds(ca, p)},
    _around,
    together=True,
)


def _initial(p: Symbols, w: Symbols, t: Any) -> Values:
    return {
        **coupled.initial(_told(p), w, t, _MODEL),
        "arrivals": ca.SX.zeros(p.beacons, 2),
        "shares": ca.SX.zeros(p.beacons),
    }


def _read(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """The oldest sample, with the ranges of all arrivals of its epoch."""
    s = with_beacons(x, u, u.ping_beacon_position)
    there = taking.arriving(s)
    return {
        **taking.reading(0, _MODEL)(_told(p), x, u, w, t),
        "arrivals": ca.horzcat(there, ca.if_else(there, s.z[:-1], 0)),
        "shares": ca.SX.zeros(p.beacons),
    }


def _filter(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    part = x.weight * (x.row < bank.MODELS)
    shares: list[Any] = []

    def ranged(
        p: Symbols, mean: Any, P: Any, said: pose.Packet, swing: Swing, z: Any, weight: Any
    ) -> tuple[Any, Any, Heard, list[Step]]:
        mean, P, heard, of_each = pinged(p, x, mean, P, said, weight)
        shares.append(of_each)
        return mean, P, heard, []

    changed = coupled.filtered(_told(p), x, u, part, _MODEL, ranged)[0]
    return {**changed, "shares": x.shares + part * shares[0]}


def pinged(
    p: Symbols, x: Symbols, mean: Any, P: Any, said: pose.Packet, weight: Any
) -> tuple[Any, Any, Heard, Any]:
    """Apply all arrivals of a ping.

    The earliest one says what they have in common, c, and nothing else: nothing is known of c at
    first. The others, each of which may be late beside it, say where the diver is seen. Then c gets
    its prior, as if it were measured to be 0: it may be too large, where the ping is late as a
    whole. With its prior before, a doubt whether the ping is late would be one about its bearing,
    which is known a hundred times better.

    Returns
    -------
    mean, P, heard, shares
        ``shares``: the probability of each arrival that it is punctual, (N, 1).
    """
    n = p.beacons
    state = taking.split(mean)
    there, z = x.arrivals[:, 0] * weight, x.arrivals[:, 1]
    seen = arc.about(mean, P, (CLOCK, PING.common))
    rows = [
        arc.bent(seen, PING.range_(ca, p, state, said.pose, taking.split(p.beacon_offset[i, :].T)))
        for i in range(n)
    ]
    off = ca.vertcat(*(z[i] - row.value for i, row in enumerate(rows)))
    earliest = ca.mmin(ca.if_else(there, off, _LATER))
    # If the time of the ping is unknown, the earliest arrival is as expected.
    known = p.common_clock
    off = off - ca.if_else(known, 0, earliest)
    earliest = ca.if_else(known, earliest, 0)
    leads, any_there = [], ca.SX(0)
    for i in range(n):  # the first of equal ones
        leads.append(there[i] * (off[i] <= earliest) * (any_there == 0))
        any_there += leads[-1]

    d, P = _begun(P, _chosen(rows, leads), earliest, any_there)
    shares, short, density, nis = ca.SX.zeros(n), ca.SX(0), ca.SX(1), ca.SX(0)
    for i, row in enumerate(rows):
        use = there[i] * (1 - leads[i])
        d, P, heard = _further(p, P, d, row, off[i], use)
        shares[i] = use * heard.share
        short += use * heard.short
        density = density * ca.if_else(use, heard.density, 1)
        nis += heard.nis
    # Its variance is not 0, even where there is no ping and nothing in common.
    variance = ca.fmax(p.range_common_std**2, _LEAST_VARIANCE)
    prior = Measurement(0, {PING.common: -1}, variance)
    d, P, heard = _further(p, P, d, prior, 0, any_there * known)
    mean, P, _ = arc.retract(mean, P, d)
    others = ca.fmax(ca.sum1(there) - 1, 1)
    several = ca.sum1(there) > 1
    share = ca.if_else(known, heard.share, 1)
    return mean, P, Heard(
        ca.fmin(ca.if_else(several, ca.sum1(shares) / others, 1), share),
        ca.fmax(short / others, ca.if_else(known, heard.short, 0)),
        density * ca.if_else(known, heard.density, 1), nis + heard.nis,
    ), shares + known * share * ca.vertcat(*leads)


def _begun(P: Any, row: Measurement, innovation: Any, there: Any) -> tuple[Any, Any]:
    """d and P after the first arrival, if nothing at all is known of c before.

    Then c is what the range exceeds its expectation by, with the error of both, and nothing else
    becomes better known: the limit of a Kalman update for a prior variance of c without bound.
    """
    n, c = P.shape[0], PING.common
    H = ca.SX(n, 1)
    for i, value in row.row.items():
        H[i] = value if i != c else 0
    P = ca.SX(P)
    for i in range(n):  # it has nothing in common with the past
        if i != c:
            P[i, c] = P[c, i] = 0
    crossing = P @ H
    after = ca.SX(P)
    for i in range(n):
        after[i, c] = after[c, i] = -crossing[i]
    after[c, c] = ca.fmax(ca.dot(H, crossing), 0) + row.variance
    d = ca.SX.zeros(n)
    d[c] = ca.if_else(there, innovation, 0)
    return d, ca.if_else(there, after, P)


def _further(
    p: Symbols, P: Any, d: Any, row: Measurement, innovation: Any, weight: Any
) -> tuple[Any, Any, Heard]:
    """Add a measurement that may be late to a correction d that has not been applied yet."""
    rest = innovation - sum(value * d[i] for i, value in row.row.items())
    more, P, heard, _ = coupled.weighed(p, P, row, rest, weight)
    return d + more, P, heard


def _chosen(rows: list[Measurement], flags: list[Any]) -> Measurement:
    """The row whose flag is 1, or the last one, of which a weight of 0 makes nothing."""
    def of(values: list[Any]) -> Any:
        found = values[-1]
        for flag, value in zip(flags[:-1], values[:-1], strict=True):
            found = ca.if_else(flag, value, found)
        return found

    return Measurement(
        of([row.value for row in rows]),
        {key: of([row.row[key] for row in rows]) for key in rows[0].row},
        of([row.variance for row in rows]),
    )


def _settle(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    sample = taking.sample_of(x)
    punctual = ca.sum1(x.arrivals[:, 0] * (x.shares > 0.5))
    return {
        **coupled.settle_watched(p, x, u, w, t),
        "nis_degrees": x.nis_degrees + sample.sounding + sample.ranging * punctual,
    }


def _output(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Values:
    mean, P = bank.estimate(p, x, 0, coupled.KEPT)
    return coupled.outputs(p, x, mean, P, taking.heave_of(x))


EQUATIONS = Equations(
    initial=_initial,
    tick=coupled.ticked,
    output=_output,
    iterate=(
        Loop("process", taking.unprocessed, _read, inner=(
            Loop("filter", coupled.taking_part, _filter, each=bank.STATES),
            Loop("settle", lambda p, x, u, t: taking.pending(x), _settle),
        )),
        *start.anew(0, PING),
        *bank.loops(coupled.KEPT),
    ),
)
