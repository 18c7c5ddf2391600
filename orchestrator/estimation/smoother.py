"""The smoother: the most probable track of a whole run, by Gauss-Newton on all samples at once.

Each pass is a linear problem about the latest trajectory ℓ. A range r counts as r − h(ℓ) + H ℓ,
with variance R/λ, where λ is the probability that it is punctual, given its residual there
(expectation-maximisation). The fixed point is the maximum of the posterior. The covariance of the
states is that of the linear problem there. For a position on an arc about the platform, the moments
of a banana are added (`sblcosim.estimation.outcome`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from sblcosim.models.receiver.surroundings import POSITION

from ..data.estimates import Integers
from ..data.samples import Samples
from ..shown import Shown
from . import late, linear, model
from .linear import Floats, Moments, Problem

PASSES = 20
"""Maximum number of passes."""
CLOSE = 1e-3
"""A pass that moves no position by more than this many m is the last."""


@dataclass(frozen=True, eq=False, repr=False)
class Track(Shown):
    """Result of the smoother for a run.

    Attributes
    ----------
    epochs_ns
        Epochs [ns]; shape (n,).
    mean, covariance
        Of the states of `sblcosim.models.receiver.waves` at these epochs; (n, 22), (n, 22, 22).
    punctual
        Probability that each range is punctual, in the order of the samples; shape (m,).
    steps_m
        Largest change of position in each pass [m].
    """

    epochs_ns: Integers
    mean: Floats
    covariance: Floats
    punctual: Floats
    steps_m: tuple[float, ...]

    @property
    def converged(self) -> bool:
        """Whether the last pass moved no position by more than `CLOSE`."""
        return self.steps_m[-1] < CLOSE


def smooth(p: Any, samples: Samples, trajectory: Floats, passes: int = PASSES) -> Track:
    """Find the most probable track.

    Parameters
    ----------
    p
        Parameters of `coupled`; see `sblcosim.estimation.model.parameters`.
    trajectory
        Starting point: states at the epochs of the samples; shape (n, 22). The positions should be
        close; the motion does not matter.
    passes
        Maximum number of passes.
    """
    frame = model.problem(p, samples, trajectory[0])
    at = trajectory
    moments: Moments
    steps: list[float] = []
    punctual = np.ones(len(samples.range))
    for turn in range(passes):
        rows = model.rows(p, samples, at)
        if turn:
            punctual = late.share(p, rows.residual[rows.is_range], rows.variance[rows.is_range])
        moments = linear.smooth(
            linearised(frame, rows, at, punctual),
            # The first trajectory is not smooth: samples that do not fit it may still be good.
            None if turn else lambda nu, S: float(late.share(p, nu, S)),
            rows.is_range,
        )
        move = (moments.mean - at)[:, list(POSITION)]
        steps.append(float(np.sqrt((move**2).sum(axis=1).max())))
        at = moments.mean
        if turn and steps[-1] < CLOSE:
            break
    return Track(samples.epochs_ns, moments.mean, moments.covariance, punctual, tuple(steps))


def linearised(frame: Problem, rows: model.Rows, at: Floats, punctual: Floats) -> Problem:
    """The linear problem about a trajectory."""
    variance = rows.variance.copy()
    variance[rows.is_range] /= punctual
    return replace(
        frame,
        first=np.searchsorted(rows.node, np.arange(len(at) + 1)),
        H=rows.H,
        z=rows.residual + np.einsum("mi,mi->m", rows.H, at[rows.node]),
        R=variance,
    )
