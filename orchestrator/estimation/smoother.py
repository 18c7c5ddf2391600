"""The smoother: the most probable track of a whole run, by Gauss-Newton on all samples at once.

Each pass is a linear problem about the latest trajectory ℓ. A range r counts as r − h(ℓ) + H ℓ,
with variance R/λ, where λ is the probability that it is punctual, given its residual there
(expectation-maximisation). The fixed point is the maximum of the posterior. The covariance of the
states is that of the linear problem there. For a position on an arc about the platform, the moments
of a banana are added (`sblcosim.estimation.outcome`).

**Annealing.** A track that is some metres off has residuals of metres: all good ranges seem late,
and the passes end where they begin. In the first passes, the variances of the ranges are therefore
multiplied by `HEAT`, ever less (A. Blake, A. Zisserman, Visual Reconstruction, 1987).

**Length of a step.** Passes that go to and fro are shortened, those that creep are lengthened, by
the change from one to the next (B. M. Irons, R. C. Tuck, Int. J. Numer. Meth. Engng. 1, 1969).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from sblcosim.models.receiver.surroundings import POSITION

from ..data.estimates import Integers
from ..data.samples import Samples
from ..shown import Shown
from . import late, linear, model, restless
from .linear import Floats, Moments, Problem

PASSES = 60
"""Maximum number of passes."""
CLOSE = 1e-3
"""A pass that moves no position by more than this many m is the last."""
HEAT = (1000.0, 300.0, 100.0, 30.0, 10.0, 3.0)
"""Factors on the variances of ranges in the first passes."""
_SHORTEST, _LONGEST = 0.1, 3.0
"""Bounds of a step's length, as a share of the full one."""
_LEAST = 0.05
"""Smallest variance of a residual, as a share of that of the range."""


@dataclass(frozen=True, eq=False, repr=False)
class Track(Shown):
    """Result of the smoother for a run.

    Attributes
    ----------
    epochs_ns
        Epochs [ns]; shape (n,).
    mean, covariance
        Of the states of `sblcosim.models.receiver.surroundings` at these epochs; (n, d), (n, d, d)
        with d states.
    punctual
        Probability that each range is punctual, in the order of the samples; shape (m,).
    residual
        Of each range, divided by its standard deviation, punctual or not, and that of the track
        taken off; shape (m,).
    psd
        q of the diver's motion in the step to each epoch [m²/s³]; shape (n,).
    steps_m
        Largest change of position in each pass [m].
    """

    epochs_ns: Integers
    mean: Floats
    covariance: Floats
    punctual: Floats
    residual: Floats
    psd: Floats
    steps_m: tuple[float, ...]

    @property
    def converged(self) -> bool:
        """Whether the last pass moved no position by more than `CLOSE`."""
        return self.steps_m[-1] < CLOSE


def smooth(
    p: Any, samples: Samples, trajectory: Floats, passes: int = PASSES, *, learns: bool = False
) -> Track:
    """Find the most probable track.

    Parameters
    ----------
    p
        Parameters of `coupled`; see `sblcosim.estimation.model.settled`.
    trajectory
        Starting point: states at the epochs of the samples; shape (n, d). The positions should be
        close; the motion does not matter.
    passes
        Maximum number of passes.
    learns
        Whether q of the diver's motion is learned for each stretch, from that of the parameters on;
        see `sblcosim.estimation.restless`.
    """
    epochs = samples.epochs_ns
    psd = np.full(len(epochs), float(p.acceleration_psd))
    motion = restless.Motion.of(p, samples) if learns else None
    at, heated = trajectory, len(HEAT[: passes - 1])
    moments: Moments
    steps: list[float] = []
    stride = _Stride()
    for turn in range(passes):
        heat = HEAT[turn] if turn < heated else 1.0
        rows = model.rows(p, samples, at)
        variance = rows.variance[rows.is_range] * heat
        punctual = late.share(p, rows.residual[rows.is_range], variance)
        frame = model.problem(p, samples, trajectory[0], psd)
        moments = linear.smooth(linearised(frame, rows, at, punctual / heat))
        move = moments.mean - at
        steps.append(_farthest(move))
        last = turn > heated and steps[-1] < CLOSE
        at = moments.mean if turn < heated or last else at + stride.after(move) * move
        if last:
            break
        if motion is not None and turn >= heated:
            psd = motion.relearned(psd, moments)
    return _track(p, samples, at, moments, psd, tuple(steps))


def _farthest(move: Floats) -> float:
    """Length of the longest change of a position [m]."""
    return float(np.sqrt((move[:, list(POSITION)] ** 2).sum(axis=1).max()))


class _Stride:
    """Length of the next step, as a share of the full one, from the change between two passes."""

    def __init__(self) -> None:
        self._length, self._before = 1.0, np.zeros(0)

    def after(self, move: Floats) -> float:
        now = move[:, list(POSITION)].ravel()
        if len(self._before):
            change = self._before - now
            square = max(float(change @ change), 1e-30)
            self._length *= float(self._before @ change) / square
            self._length = min(max(self._length, _SHORTEST), _LONGEST)
        self._before = now
        return self._length


def _track(
    p: Any, samples: Samples, at: Floats, moments: Moments, psd: Floats, steps: tuple[float, ...]
) -> Track:
    """The track with what it makes of the ranges."""
    rows = model.rows(p, samples, at)
    node, H = rows.node[rows.is_range], rows.H[rows.is_range]
    residual, variance = rows.residual[rows.is_range], rows.variance[rows.is_range]
    punctual = late.share(p, residual, variance)
    own = np.einsum("mi,mij,mj->m", H, moments.covariance[node], H)
    spread = np.maximum(variance / punctual - own, _LEAST * variance / punctual)
    return Track(
        samples.epochs_ns, at, moments.covariance, punctual, residual / np.sqrt(spread), psd, steps,
    )


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
