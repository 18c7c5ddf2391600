"""How restless the diver is: q of the motion for each stretch of a run, from the smoothed track.

With noise of the covariance q Q̄ in each step, the smoother knows the most probable noise ŵ = −q Q̄ λ
of each, and how much of it was measured, the trace of q Q̄ Λ. Over a stretch, q is such that the
energy ŵᵀ (q Q̄)⁻¹ ŵ is the number of directions of noise that were measured (D. J. C. MacKay,
Bayesian interpolation, Neural Computation 4, 1992, 415-447), and `EXPECTED` directions more in
which the noise is as it was expected. Only the horizontal axes count: the depth sensor is so
precise that it would decide, about the vertical alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from sblcosim.models.receiver.surroundings import POSITION, VELOCITY

from ..data.samples import Samples
from . import model
from .linear import Floats, Moments

STRETCH_S = 10.0
"""Length of a stretch [s]: about the time of a turn."""
EXPECTED = 4.0
"""Number of directions of noise for which the expected q counts in each stretch."""
_LEAST, _MOST = 1e-4, 10.0
"""Bounds of q [m²/s³]."""
_HORIZONTAL = [*POSITION[:2], *VELOCITY[:2]]


@dataclass(frozen=True, eq=False)
class Motion:
    """The stretches of a run.

    Attributes
    ----------
    expected
        q that is expected [m²/s³].
    unit
        Q̄ of the step to each epoch, horizontal; shape (n, 4, 4).
    stretch
        Index of the stretch of each epoch; shape (n,).
    """

    expected: float
    unit: Floats
    stretch: model.Indices

    @classmethod
    def of(cls, p: Any, samples: Samples) -> Self:
        """The stretches of a run; q of the parameters is expected."""
        epochs = samples.epochs_ns

        def noise(psd: float) -> Floats:
            _, Q, which = model.transitions(
                p, samples.start_ns, epochs, np.full(len(epochs), psd)
            )
            horizontal: Floats = Q[:, _HORIZONTAL][:, :, _HORIZONTAL][which]
            return horizontal

        stretch = ((epochs - epochs[0]) / 1e9 // STRETCH_S).astype(np.intp)
        return cls(float(p.acceleration_psd), noise(1.0) - noise(0.0), stretch)

    def relearned(self, psd: Floats, moments: Moments) -> Floats:
        """q in the step to each epoch [m²/s³], from what was assumed and what came of it."""
        lean = moments.lean[:, _HORIZONTAL]
        weight = moments.weight[:, _HORIZONTAL][:, :, _HORIZONTAL]
        energy = psd**2 * np.einsum("ki,kij,kj->k", lean, self.unit, lean)
        measured = psd * np.einsum("kij,kji->k", self.unit, weight)
        energy, measured = (np.bincount(self.stretch, it) for it in (energy, measured))
        learned = (EXPECTED * self.expected + energy) / (EXPECTED + np.maximum(measured, 0))
        return np.asarray(np.clip(learned, _LEAST, _MOST)[self.stretch])
