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

from ..data.estimates import Integers
from ..data.samples import Samples
from ..shown import Shown
from . import late, linear, model, restless
from .linear import Floats, Moments, Problem
from .model import ON_PLATFORM, RunModel

PASSES = 60
"""Maximum number of passes."""
CLOSE = 1e-3
"""A pass that moves no position by more than this many m is the last."""
HEAT = (1000.0, 300.0, 100.0, 30.0, 10.0, 3.0)
"""Factors on the variances of ranges in the first passes."""
LEARNING = 12
"""Number of passes after these in which q is learned. Later ones keep it, and converge."""
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
        Of the d states of the model at these epochs: `sblcosim.models.receiver.waves`, or
        `sblcosim.estimation.field`; (n, d), (n, d, d).
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
    p: Any, samples: Samples, trajectory: Floats, passes: int = PASSES, *, learns: bool = False,
    of: RunModel = ON_PLATFORM,
) -> Track:
    """Find the most probable track.

    Parameters
    ----------
    p
        Parameters of the model's receiver; see `sblcosim.estimation.model.settled`.
    trajectory
        Starting point: states at the epochs of the samples; shape (n, d). The positions should be
        close; the motion does not matter.
    passes
        Maximum number of passes.
    learns
        Whether q of the diver's motion is learned for each stretch, from that of the parameters on;
        see `sblcosim.estimation.restless`.
    of
        The model.
    """
    epochs = samples.epochs_ns
    psd = np.full(len(epochs), float(p.acceleration_psd))
    stretches = restless.Stretches.of(p, samples, of) if learns else None
    at, heated = trajectory, len(HEAT[: passes - 1])
    moments: Moments
    steps: list[float] = []
    stride = _Stride(of)
    for turn in range(passes):
        heat = HEAT[turn] if turn < heated else 1.0
        rows = model.rows(p, samples, at, of)
        variance = rows.variance[rows.is_range] * heat
        punctual = late.share(p, rows.residual[rows.is_range], variance)
        frame = model.problem(p, samples, trajectory[0], psd, of)
        moments = linear.smooth(linearised(frame, rows, at, punctual / heat))
        move = moments.mean - at
        steps.append(_farthest(move, of))
        last = turn > heated and steps[-1] < CLOSE
        at = moments.mean if turn < heated or last else at + stride.after(move) * move
        if last:
            break
        if stretches is not None and heated <= turn < heated + LEARNING:
            psd = stretches.relearned(psd, moments)
    ranges = model.rows(p, samples, at, of)
    return _track(p, samples.epochs_ns, ranges, at, moments, psd, tuple(steps))


def _farthest(move: Floats, of: RunModel) -> float:
    """Length of the longest change of a position [m]."""
    return float(np.sqrt((move[:, list(of.position)] ** 2).sum(axis=1).max()))


class _Stride:
    """Length of the next step, as a share of the full one, from the change between two passes."""

    def __init__(self, of: RunModel) -> None:
        self._position = list(of.position)
        self._length, self._before = 1.0, np.zeros(0)

    def after(self, move: Floats) -> float:
        now = move[:, self._position].ravel()
        if len(self._before):
            change = self._before - now
            shrunk = float(self._before @ change)
            # One that grows on its way is far from its end, not beyond it.
            factor = shrunk / float(change @ change) if shrunk > 0 else 2.0
            self._length = min(max(self._length * factor, _SHORTEST), _LONGEST)
        self._before = now
        return self._length


def _track(
    p: Any, epochs_ns: Integers, rows: model.ScalarRows, at: Floats, moments: Moments, psd: Floats,
    steps: tuple[float, ...],
) -> Track:
    """The track with what it makes of the ranges."""
    node, H = rows.node[rows.is_range], rows.H[rows.is_range]
    residual, variance = rows.residual[rows.is_range], rows.variance[rows.is_range]
    punctual = late.share(p, residual, variance)
    own = np.einsum("mi,mij,mj->m", H, moments.covariance[node], H)
    spread = np.maximum(variance / punctual - own, _LEAST * variance / punctual)
    return Track(
        epochs_ns, at, moments.covariance, punctual, residual / np.sqrt(spread), psd, steps,
    )


def linearised(frame: Problem, rows: model.ScalarRows, at: Floats, punctual: Floats) -> Problem:
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
