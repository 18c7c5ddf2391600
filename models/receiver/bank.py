"""Several filters side by side that expect different motion: an interacting multiple model.

A diver who turns, stops and goes on does not move with white acceleration of one density q. Each
filter of the bank assumes another q. The likelihood of the ranges weighs them. The depth takes no
part: its sensor is so precise that it would decide, about the vertical alone. Now and then the
filters are mixed, as if the diver kept to one q for `MEMORY` on average, and then changed to any
of them, by `CHANCES` (H. A. P. Blom, Y. Bar-Shalom, IEEE Trans. Autom. Control 33, 1988, 780-783).

A bank has a row for each filter: the states "mean", "covariance" (its upper triangle) and "weight".
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, log
from types import SimpleNamespace
from typing import Any

import casadi as ca

from ..equations import Loop, Symbols, Values
from .estimate import pack, unpack
from .least_squares import symmetric

PSDS = (0.03, 0.003, 0.3, 3.0)
"""Density q that each filter assumes [m²/s³]."""
CHANCES = (0.5, 0.15, 0.25, 0.1)
"""Chance of each q at a start and after a change: divers seldom move as the outer ones say."""
MEMORY = 40.0
"""Mean time for which a diver keeps to one q [s]."""
EVERY = 4.0
"""Time between mixings [s]: a tenth of the memory, so that what they cost is shared by many
ranges."""
MODELS = len(PSDS)
EXTRA = MODELS
"""A row of its own use for each receiver: not weighed, not mixed."""
ROWS = MODELS + 1
STATES = ("mean", "covariance", "weight")
"""The states that have a row for each filter."""


def learned(p: Symbols) -> Any:
    """Whether the density of the acceleration is learned: 0 or 1."""
    return p.acceleration_psd < 0


def psd(p: Symbols, x: Symbols) -> Any:
    """The density that a row assumes [m²/s³]; the extra row, what is believed."""
    own = x.believed
    for n, value in enumerate(PSDS):
        own = ca.if_else(x.row == n, value, own)
    return ca.if_else(learned(p), own, p.acceleration_psd)


def begun(p: Symbols) -> Any:
    """Weights at a start, (ROWS, 1)."""
    alone = [1.0, *[0.0] * MODELS]
    usual = [*CHANCES, 0.0]
    return ca.if_else(learned(p), ca.SX(usual), ca.SX(alone))


def begun_of(p: Symbols, x: Symbols) -> Any:
    """Weight of a row at a start."""
    return _own(begun(p), x)


def _own(each: Any, x: Symbols) -> Any:
    """The number of a row among those of the filters."""
    return sum(each[k] * (x.row == k) for k in range(MODELS))


def row_of(x: Symbols, row: int) -> Symbols:
    """The states as a loop over the filters sees them in one of the rows."""
    own = {name: getattr(x, name)[row, :].T for name in STATES}
    return SimpleNamespace(**{**x.__dict__, **own, "row": row})


def initial(p: Symbols, mean: Any, P: Any, t: Any, kept: int) -> Values:
    """The states of a bank at the start: all filters alike.

    Parameters
    ----------
    kept
        Number of states whose covariance is output.
    """
    n = mean.numel()
    return {
        "mean": ca.repmat(mean.T, ROWS, 1),
        "covariance": ca.repmat(pack(P).T, ROWS, 1),
        "weight": begun(p),
        "believed": _GEOMETRIC,
        "shown": ca.SX.zeros(n + kept * (kept + 1) // 2),
        "average": ca.SX.zeros(n + n * (n + 1) // 2),
        "shown_epoch": t,
        "mixed": t,
        "stay": 0,
        "mixing": 0,
    }


def weighed(x: Symbols, density: Any, ranged: Any) -> Any:
    """Weight of a row after a range whose innovation has this density; not normalised.

    That of the extra row is the density itself.
    """
    before = ca.if_else(x.row == EXTRA, 1, x.weight)
    return before * ca.if_else(ranged, density, 1)


def total(x: Symbols) -> Any:
    """Density of a range in the mixture, from the weights before they are normalised."""
    return ca.sum1(x.weight[:MODELS])


def normalised(x: Symbols) -> Any:
    """The weights with a sum of 1, (ROWS, 1)."""
    return ca.vertcat(x.weight[:MODELS] / total(x), x.weight[EXTRA])


def mixture(x: Symbols, chosen: Sequence[int]) -> tuple[Any, Any]:
    """Mean of all states, and covariance of the chosen ones, over the weighted filters."""
    places = _places(x.mean.shape[1])
    mean = sum(x.weight[k] * x.mean[k, :].T for k in range(MODELS))
    off = [x.mean[k, :].T - mean for k in range(MODELS)]
    P = ca.SX.zeros(len(chosen), len(chosen))
    for a, i in enumerate(chosen):
        for b, j in list(enumerate(chosen))[a:]:
            at = places[min(i, j), max(i, j)]
            P[a, b] = P[b, a] = sum(
                x.weight[k] * (x.covariance[k, at] + off[k][i] * off[k][j]) for k in range(MODELS)
            )
    return mean, P


def _places(n: int) -> dict[tuple[int, int], int]:
    """Place in an upper triangle of each element."""
    pairs = ((i, j) for i in range(n) for j in range(i, n))
    return {pair: place for place, pair in enumerate(pairs)}


def estimate(p: Symbols, x: Symbols, row: int, kept: Sequence[int]) -> tuple[Any, Any]:
    """Mean, and covariance of the kept states: of one row, or of the mixture if q is learned."""
    n = x.mean.shape[1]
    own = unpack(x.covariance[row, :].T, n)[list(kept), list(kept)]
    all_of_them = x.shown
    P = ca.SX.zeros(n, n)
    P[list(kept), list(kept)] = unpack(
        ca.if_else(learned(p), all_of_them[n:], pack(own)), len(kept)
    )
    return ca.if_else(learned(p), all_of_them[:n], x.mean[row, :].T), P


def loops(kept: Sequence[int]) -> tuple[Loop, ...]:
    """What happens after all samples of a tick: the mixture, and now and then the mixing.

    Parameters
    ----------
    kept
        States whose covariance is output; none: the mixture itself is not output.
    """

    def show(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
        mean, P = mixture(x, kept)
        return {
            **({"shown": ca.vertcat(mean, pack(P))} if kept else {}),
            "shown_epoch": x.epoch,
            "believed": ca.exp(sum(x.weight[k] * log(PSDS[k]) for k in range(MODELS))),
        }

    def average(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
        mean, P = mixture(x, range(x.mean.shape[1]))
        return {
            "average": ca.vertcat(mean, pack(P)),
            "stay": ca.exp(-(x.epoch - x.mixed) / MEMORY),
            "mixed": x.epoch,
            "mixing": 1,
        }

    def mix(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
        # Of what comes to this q, the share `own` had it before.
        weight = x.stay * x.weight + (1 - x.stay) * _own(ca.SX(CHANCES), x)
        own = x.stay * x.weight / weight
        n = x.mean.numel()
        mean, P = x.average[:n], x.average[n:]
        off = x.mean - mean
        return {
            "mean": mean + own * off,
            "covariance": P + own * (x.covariance - P)
            + own * (1 - own) * pack(symmetric(off @ off.T)),
            "weight": weight,
            "mixing": x.row < MODELS - 1,
        }

    def several(p: Symbols, x: Symbols) -> Any:
        return learned(p) * x.ready * (x.passes == 0)

    return (
        Loop("show", lambda p, x, u, t: several(p, x) * (x.epoch != x.shown_epoch), show),
        Loop("average", lambda p, x, u, t: several(p, x) * (x.epoch - x.mixed >= EVERY), average),
        Loop("mix", lambda p, x, u, t: x.mixing * (x.row < MODELS), mix, each=STATES),
    )


_GEOMETRIC = exp(sum(c * log(q) for c, q in zip(CHANCES, PSDS, strict=True)))
"""What is believed before any range: the geometric mean [m²/s³]."""
