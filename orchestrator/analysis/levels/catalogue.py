"""The figures of an analysis of factors with many levels: what each shows, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from ...catalogue import Figure, by_name
from ...lazy import Module

if TYPE_CHECKING:
    from .analysis import GeneralFactorial

plots = Module("sblcosim.analysis.levels.figures")


def _of(analysis: GeneralFactorial) -> tuple[GeneralFactorial]:
    return (analysis,)


FIGURES: Mapping[str, Figure[GeneralFactorial]] = by_name(
    Figure(
        "main_effects", plots.later("plot_means"), _of,
        lambda a: f"{a.shown_of} at each level; bars are its interval alone." if a.by_medians else (
            f"{a.mean_of} at each level, every combination of the others counted "
            "once; bars are the intervals of these means alone."
        ),
        lambda a: f"{'Medians' if a.by_medians else 'Means'} of {a.quantity} by level of "
        f"{', '.join(a.factors)}",
    ),
    Figure(
        "pairs", plots.later("plot_pairs"), _of,
        lambda a: "Differences of levels, with intervals that hold for all pairs of a factor at "
        "once: what leaves zero differs.",
        lambda a: "Differences of pairs of levels with simultaneous intervals",
    ),
    Figure(
        "interactions", plots.later("plot_interactions"), _of,
        lambda a: f"Interactions: mean {a.quantity} at pairs of levels. Lines that are not "
        "parallel are an interaction.",
        lambda a: "Interaction plots of pairs of factors",
        lambda a: len(a.factors) > 1,
    ),
)  # fmt: skip
"""The figures of a grid."""
