"""Ranks of effects by size, with ties for effects that cannot be told apart."""

from __future__ import annotations

import numpy as np

from .analysis import Factorial


def tied(analysis: Factorial, one: str, other: str) -> bool:
    """Whether the sizes of two effects differ by no more than chance allows."""
    a, b = (analysis.effects.loc[name] for name in (one, other))
    if analysis.replicate_effects is not None:
        each = analysis.replicate_effects
        gap = np.sign(a.effect) * each[one] - np.sign(b.effect) * each[other]
        error = float(gap.std(ddof=1)) / np.sqrt(len(gap))
    else:
        error = float(np.hypot(a.std_error, b.std_error))
    return bool(abs(abs(a.effect) - abs(b.effect)) <= analysis.reference * error)


def tied_groups(analysis: Factorial, names: list[str]) -> list[list[str]]:
    """Terms, the largest first, in groups that cannot be told apart from their first term."""
    groups = []
    while names:
        groups.append([n for n in names if n == names[0] or tied(analysis, names[0], n)])
        names = [n for n in names if n not in groups[-1]]
    return groups


def ranking(analysis: Factorial) -> dict[str, str]:
    """Rank of each main effect by its size. Effects that cannot be told apart share their ranks."""
    ranked = analysis.ranked()
    ranks: dict[str, str] = {}
    for same in tied_groups(analysis, [str(n) for n in ranked.index[ranked["order"] == 1]]):
        first, last = len(ranks) + 1, len(ranks) + len(same)
        ranks |= dict.fromkeys(same, f"{first}" if first == last else f"{first} to {last}")
    return ranks
