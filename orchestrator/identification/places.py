"""How well the places of fixed beacons are known, as their ranges tell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..data.estimates import Floats
from .fit import Fit
from .innovations import Ranges, likelihoods

_TIMES = 2.0 ** np.arange(-4, 4)
"""Uncertainties that are tried, over the one that is assumed."""
_WIDTH = 1.1
"""Standard deviation of the logarithm of the uncertainty, before the log."""
_VAGUE = 0.5
"""Standard deviation of the logarithm above which the log does not tell the uncertainty."""


def place_std(ranges: Ranges, found: Fit) -> float | None:
    """Uncertainty of the places, horizontal [m]; None: the log does not tell it.

    Receivers have no offset of each beacon: errors of its place take it up. The likelihood is
    therefore that of beacons without offsets, but with a common one. Depths of beacons, which a
    gauge tells, are known as well as assumed or better. The result is the root of the
    mean square over the uncertainties that are tried, by their posterior probability.
    """
    assumed, prior = ranges.prior["place_std"], ranges.prior
    if assumed <= 0:
        return None
    shared = {"clock_std": prior["offset_std"], "offset_std": 0.0}
    at = found.parameters[None]
    likelihood = np.array([
        likelihoods(
            replace(ranges, prior={
                **prior, **shared, "place_std": times * assumed,
                "place_down_std": min(times, 1.0) * prior["place_down_std"],
            }), at, found.hypotheses,
        )[0]
        for times in _TIMES.tolist()
    ])
    posterior = likelihood - 0.5 * (np.log(_TIMES) / _WIDTH) ** 2
    # Far from there, another track may fit as well: only the first maximum counts.
    peak = int(np.flatnonzero(_TIMES == 1.0)[0])
    while (best := _highest(posterior, peak)) != peak:
        peak = best
    posterior[peak:] = np.minimum.accumulate(posterior[peak:])
    posterior[: peak + 1] = np.minimum.accumulate(posterior[peak::-1])[::-1]
    weight = np.exp(posterior - posterior[peak])
    weight /= weight.sum()
    mean = float(weight @ np.log(_TIMES))
    if not weight @ (np.log(_TIMES) - mean) ** 2 <= _VAGUE**2:
        return None
    return assumed * float(np.sqrt(weight @ _TIMES**2))


def _highest(values: Floats, at: int) -> int:
    """Place of the highest of a value and its neighbours."""
    first = max(at - 1, 0)
    return first + int(values[first : at + 2].argmax())
