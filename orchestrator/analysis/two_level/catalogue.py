"""The figures of a two-level analysis, the paper's four kinds: what each shows, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from ...catalogue import Figure, by_name
from ...lazy import Module

if TYPE_CHECKING:
    from .analysis import Factorial

plots = Module("sblcosim.analysis.two_level.figures")

MOST_BARS = 20
"""Effects that a Pareto chart shows at most."""


def _analysis(analysis: Factorial) -> tuple[Factorial]:
    return (analysis,)


def _pareto(a: Factorial) -> str:
    count, shown = len(a.effects), min(len(a.effects), MOST_BARS)
    part = f"the {shown} largest of {count} effects" if shown < count else f"all {count} effects"
    if a.lenth is None:
        return (f"Pareto chart of the standardised effects |t|, {part}. What crosses the line is "
                "significant; hatched bars are negative effects.")
    own = f" in {a.unit}" if a.unit else ""
    return (f"Pareto chart of the size of the effects{own}, {part}. What crosses the margin of "
            "error (ME) is significant if looked at alone, what crosses the simultaneous one (SME) "
            "also as one of many; hatched bars are negative effects.")


def _largest(a: Factorial) -> str:
    top = ", ".join(map(str, a.ranked().index[:3]))
    return f"Pareto chart; the largest effects are {top}"


FIGURES: Mapping[str, Figure[Factorial]] = by_name(
    Figure("pareto", plots.later("plot_pareto"), _analysis, _pareto, _largest),
    Figure(
        "main_effects", plots.later("plot_main_effects"), _analysis,
        lambda f: f"Main effects: mean {f.quantity} at both levels of each factor"
        f"{', with its interval' if f.replicate_effects is None else ''}, "
        "and the overall mean.",
        lambda f: f"Main effects; overall mean {f.overall_mean:.3g}"
        f"{f.unit and f' {f.unit}'}",
    ),
    Figure(
        "interactions", plots.later("plot_interactions"), _analysis,
        lambda f: f"Interactions: mean {f.quantity} at each pair of levels. "
        "Lines that are not parallel are an interaction.",
        lambda f: "Matrix of interaction plots, one for each pair of factors",
        lambda f: len(f.factors) > 1,
    ),
    Figure(
        "residuals", plots.later("plot_residuals"), _analysis,
        lambda f: "Residuals: normal probability, histogram, against fits, and against the "
        "random run order.",
        lambda f: "Four plots of the residuals",
    ),
)  # fmt: skip
