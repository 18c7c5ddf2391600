"""The mixing of an interacting multiple model, written a second time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def mixed(
    weights: np.ndarray, chances: np.ndarray, means: np.ndarray, covariances: Sequence[np.ndarray],
    stay: float,
) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Weights, means and covariances of the filters after it (Blom and Bar-Shalom, 1988).

    Parameters
    ----------
    chances
        Of each filter after a change.
    stay
        Probability of no change.
    """
    n = len(weights)
    transitions = stay * np.eye(n) + (1 - stay) * chances
    ahead = transitions.T @ weights
    share = transitions * weights[:, None] / ahead
    after = share.T @ means
    off = means[:, None] - after[None]
    spread = [
        sum(share[i, j] * (P + np.outer(off[i, j], off[i, j])) for i, P in enumerate(covariances))
        for j in range(n)
    ]
    return ahead, after, spread
