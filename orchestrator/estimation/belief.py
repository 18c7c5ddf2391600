"""Whether a track can be believed: what its passes, its residuals and the filter say against it.

A track is not believable if one of these holds:

- the passes have not converged;
- more ranges do not fit than may be late: over the whole run, `UNFIT` more than the probability of
  late ones; in a stretch, `UNFIT_IN_STRETCH` of all;
- the mean square of the residuals, each divided by its standard deviation, which is 1 if the model
  is right, is above `SQUARE` over the whole run, or above `SQUARE_IN_STRETCH` in a stretch;
- the filter does not know the diver's bearing from the platform in most of its estimates, with a
  variance above `sblcosim.models.receiver.surroundings.WIDEST`. The posterior is then a ring, or
  has several summits. The smoother stands on one of them and cannot tell which.

Stretches are `STRETCH_S` long; one with fewer than `FEWEST` ranges says nothing. The reverse does
not follow: an error that all ranges share, such as that of a clock, leaves no residuals.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..data import bearing
from ..data.estimates import Estimates
from ..data.samples import Samples
from ..words.shares import rough_percent
from .linear import Floats
from .smoother import Track

UNFIT = 0.25
"""Share of ranges that may be late beside those that are expected to be."""
UNFIT_IN_STRETCH = 0.5
"""Share of the ranges of a stretch that may be late."""
SQUARE, SQUARE_IN_STRETCH = 2.0, 4.0
"""Largest mean square of the normalised residuals of a run, and of a stretch."""
STRETCH_S = 60.0
"""Length of a stretch [s]."""
FEWEST = 8
"""Least number of ranges in a stretch that counts."""


def doubts(p: Any, samples: Samples, track: Track, filtered: Estimates) -> tuple[str, ...]:
    """What speaks against a track, as parts of a sentence; nothing if it is believable.

    Parameters
    ----------
    filtered
        Estimates of the filter that gave the first track.
    """
    if not track.converged:
        return (f"it has not converged in {len(track.steps_m)} passes", *_bearing(filtered))
    return (*_ranges(p, samples, track), *_bearing(filtered))


def _ranges(p: Any, samples: Samples, track: Track) -> Iterator[str]:
    unfit, square = 1 - track.punctual, track.residual**2
    if unfit.mean() > p.outlier_probability + UNFIT:
        yield f"{rough_percent(float(unfit.mean()))} of the ranges do not fit"
    elif square.mean() > SQUARE:
        yield f"the residuals of the ranges are {np.sqrt(square.mean()):.2g} times what is expected"
    else:
        yield from _stretches(samples, unfit, square)


def _stretches(samples: Samples, unfit: Floats, square: Floats) -> Iterator[str]:
    """The first stretch in which ranges do not fit."""
    since = (samples.range_ns - samples.start_ns) / 1e9
    stretch = (since // STRETCH_S).astype(np.intp)
    number = np.maximum(np.bincount(stretch), 1)
    unfit, square = (np.bincount(stretch, it) / number for it in (unfit, square))
    bad = (number >= FEWEST) & ((unfit > UNFIT_IN_STRETCH) | (square > SQUARE_IN_STRETCH))
    if bad.any():
        begin = STRETCH_S * int(np.flatnonzero(bad)[0])
        yield f"the ranges from {begin:g} s to {begin + STRETCH_S:g} s do not fit"


def _bearing(filtered: Estimates) -> Iterator[str]:
    unknown = bearing.is_unknown(filtered)
    if unknown is not None and len(unknown) and unknown.mean() > 0.5:
        yield "the diver's bearing from the platform is unknown in most of the run"
