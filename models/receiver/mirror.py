"""Whether the diver is on the other side of the beacons, where the ranges nearly fit as well.

Beacons nearly on a line, or the two that have been heard lately, have a mirror image of the diver.
Each time it is due, a fix is sought from there. Where the ranges may as well come from it, a second
filter begins there and processes the same samples. The likelihood of the ranges decides.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import casadi as ca

from ..equations import Symbols, Values
from . import bank, lateness, least_squares
from .measurements import DEPTH, Samples, predicted

EVERY = 12.0
"""Time between looks at the other side [s]."""
_TAKES, _LEAVES = 4.0, 8.0
"""Log-likelihood ratios with which the other side takes over, and with which it is given up."""
_PAST = 5.0
"""What ranges before the latest ones say against the other side, if there are any [1]."""
_PASSES = 2
"""Passes of a fix there: it begins close to one, or there is none."""
_FITTED = 1.5
"""What a fix gains on average by fitting three coordinates to its own samples [1]."""
_APART = 2.0
"""Distance to the other side in standard deviations, below which it is the same side."""

HERE, THERE, TAKEN = 1, 2, 3
"""What begins: the bank at a fix, the filter on the other side at one, or the bank where it is."""


def initial(t: Any) -> Values:
    """The states of the other side at the start time."""
    return {"kind": HERE, "looking": 0, "looked": t, "other": 0, "lead": 0, "beginning": 0,
            "fresh": 0, "begun": 0}


def share(x: Symbols) -> Any:
    """Probability that the diver is on the other side."""
    return x.other / (1 + ca.exp(-x.lead))


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
    """The mirror image about the line that is nearest to the beacons."""
    w = weight[:DEPTH]
    place = s.beacons[:, :2]
    mean = (w.T @ place).T / ca.fmax(ca.sum1(w), 1e-30)
    off = place - ca.repmat(mean.T, s.count, 1)
    along = ca.dot(w, off[:, 0] ** 2 - off[:, 1] ** 2)
    across = 2 * ca.dot(w, off[:, 0] * off[:, 1])
    length = ca.fmax(ca.sqrt(along**2 + across**2), 1e-30)
    turned = ca.vertcat(ca.horzcat(along, across), ca.horzcat(across, -along)) / length
    return Side(
        ca.vertcat(mean + turned @ (here.position[:2] - mean), here.position[2]),
        ca.vertcat(turned @ here.velocity[:2], here.velocity[2]),
        here.spread,
    )


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
