"""Whether the diver is on the other side of the beacons, where the ranges nearly fit as well.

Beacons nearly on a line, or the two that have been heard lately, have a mirror image of the diver.
Each time it is due, a fix is sought from the best image about the line of two beacons. Where the
ranges may as well come from it, a second filter begins there and processes the same samples. The
likelihood of the ranges decides.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from itertools import combinations
from typing import Any

import casadi as ca

from ..equations import Symbols, Values
from . import bank, lateness, least_squares
from .measurements import DEPTH, Samples, predicted

EVERY = 4.0
"""Time between looks at the other side [s]."""
_TAKES, _LEAVES = 4.0, 8.0
"""Log-likelihood ratios with which the other side takes over, and with which it is given up."""
_PAST = 4.0
"""What ranges before the latest ones say against the other side, if there are any [1]."""
_PASSES = 2
"""Passes of a fix there: it begins close to one, or there is none."""
_INDEPENDENT = 0.4
"""Share of a log-likelihood ratio that counts in a claim: ranges have errors in common, of the
speed of sound and of the survey."""
_FITTED = 1.5
"""What a fix gains on average by fitting three coordinates to its own samples [1]."""
_APART = 1.4
"""Distance to the other side in standard deviations, below which it is the same side."""

_ODD = 20.0
"""Largest weighted square of a residual that counts: beyond, a range is late."""
_NONE = 1e9
"""Misfit of an image that is none."""

HERE, THERE, TAKEN = 1, 2, 3
"""What begins: the bank at a fix, the filter on the other side at one, or the bank where it is."""


def initial(t: Any) -> Values:
    """The states of the other side at the start time."""
    return {"kind": HERE, "looking": 0, "looked": t, "other": 0, "lead": 0, "beginning": 0,
            "fresh": 0, "begun": 0}


def share(x: Symbols, counts: float = 1.0) -> Any:
    """Probability that the diver is on the other side, if a share of what the ranges say counts."""
    return x.other / (1 + ca.exp(-counts * x.lead))


def both(x: Symbols, mean: Any, P: Any, there: Any, P_there: Any) -> tuple[Any, Any]:
    """Mean, and second moments about it as the claim has them, of both sides together.

    Parameters
    ----------
    mean, P
        Of the bank, (n, 1), and the covariance of its first states, (k, k).
    there, P_there
        The same on the other side.
    """
    own, claimed, off = share(x), share(x, _INDEPENDENT), there - mean
    first = off[: P.shape[0]]
    apart = (1 - claimed) * own**2 + claimed * (1 - own) ** 2
    return (
        ca.if_else(x.other, mean + own * off, mean),
        ca.if_else(x.other, P + claimed * (P_there - P) + apart * (first @ first.T), P),
    )


def settled(
    x: Symbols, weight: Any, ranged: Any, anew: Any, last: Any, enough: Any
) -> Values:
    """What a sample means for the other side.

    Parameters
    ----------
    weight
        The bank's weights after the sample; that of the extra row is the density of a range there.
    ranged
        Whether the sample is a range that has been used.
    anew
        Whether the bank begins again at a fix.
    last
        Whether this is the last of the new samples.
    enough
        Whether the latest samples suffice for a fix.
    """
    ahead = ca.log(weight[bank.EXTRA]) - ca.log(bank.total(x))
    lead = x.lead + ca.if_else(ranged * x.other, ahead, 0)
    takes = x.other * (lead > _TAKES) * (anew == 0) * last
    other = x.other * (lead >= -_LEAVES) * (takes == 0) * (anew == 0)
    due = (x.other == 0) * (anew == 0) * last * enough * (x.epoch - x.looked >= EVERY)
    begins = ca.fmax(anew, due)
    return {
        "other": other,
        "lead": ca.if_else(other, lead, 0),
        "looked": ca.if_else(ca.fmax(due, takes), x.epoch, x.looked),
        "kind": ca.if_else(due, THERE, HERE),
        "beginning": ca.if_else(takes, TAKEN, 0),
        "passes": ca.if_else(anew, least_squares.PASSES, ca.if_else(due, _PASSES, x.passes)),
        "damping": ca.if_else(begins, least_squares.FIRST_DAMPING, x.damping),
        "restarts": x.restarts + ca.fmax(anew, takes),
    }


@dataclass(frozen=True, slots=True)
class Side:
    """Where the diver may be.

    Attributes
    ----------
    position, velocity
        NED [m] and [m/s], (3, 1).
    spread
        Sum of the variances of the position's coordinates [m²].
    """

    position: Any
    velocity: Any
    spread: Any


def reflected(here: Side, s: Samples, weight: Any) -> Side:
    """The mirror image about the line of two beacons that fits the latest ranges best."""
    image, least = here, ca.SX(_NONE)
    for i, j in combinations(range(s.count), 2):
        along = (s.beacons[j, :2] - s.beacons[i, :2]).T
        length = ca.fmax(ca.sumsqr(along), 1e-30)
        back = 2 * (along @ along.T) / length - ca.SX.eye(2)
        origin = s.beacons[i, :2].T
        place = ca.vertcat(origin + back @ (here.position[:2] - origin), here.position[2])
        found = Side(place, ca.vertcat(back @ here.velocity[:2], here.velocity[2]), here.spread)
        apart = ca.sumsqr(place - here.position) > _APART**2 * here.spread
        cost = ca.if_else(apart * s.heard[i] * s.heard[j], misfit(found, s, weight), _NONE)
        image = Side(*(
            ca.if_else(cost < least, getattr(found, f.name), getattr(image, f.name))
            for f in fields(Side)
        ))
        least = ca.fmin(cost, least)
    return image


def misfit(side: Side, s: Samples, weight: Any) -> Any:
    """Weighted squares of the residuals of the latest ranges; one alone counts up to a limit."""
    s, total = moving(s, side.velocity), ca.SX(0)
    for i, (value, _) in enumerate(predicted(side.position, s)[:DEPTH]):
        total += ca.fmin(weight[i] * (s.z[i] - value) ** 2, _ODD)
    return total


def moving(s: Samples, velocity: Any) -> Samples:
    """The samples as a diver with this velocity has them from where he is at the newest."""
    age = s.newest - s.epoch
    z = ca.vertcat(s.z[:DEPTH], s.z[DEPTH] + velocity[2] * age[DEPTH])
    return replace(s, beacons=s.beacons + age[:DEPTH] @ velocity.T, z=z)


def evidence(p: Symbols, place: Side, s: Samples, variances: Any) -> Any:
    """Log-likelihood of the latest ranges."""
    s, total = moving(s, place.velocity), ca.SX(0)
    for i, (value, _) in enumerate(predicted(place.position, s)[:DEPTH]):
        density = sum(lateness.densities(p, s.z[i] - value, variances[i]))
        total += s.heard[i] * ca.log(density)
    return total


def looked(
    p: Symbols, x: Symbols, s: Samples, variances: Any, here: Side, there: Side
) -> Values:
    """Whether a filter begins at the fix on the other side.

    Parameters
    ----------
    variances
        Those of the latest samples [m²], (N + 1, 1).
    """
    lead = evidence(p, there, s, variances) - evidence(p, here, s, variances) - _FITTED
    lead -= ca.if_else(x.fresh, 0, _PAST)
    apart = ca.sumsqr(there.position - here.position) > _APART**2 * (here.spread + there.spread)
    other = (lead > -_LEAVES) * apart
    return {
        "looking": 0, "fresh": 0, "other": other, "lead": ca.if_else(other, lead, 0),
        "beginning": ca.if_else(other, THERE, 0),
    }
