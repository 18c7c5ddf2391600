"""The figures in the report of a study: the paper's four kinds, and the Box–Cox profile."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd
from matplotlib.axes import Axes

from ..analysis.two_level import figures as plots
from ..analysis.two_level.analysis import Factorial
from ..results.figures.catalogue import Figure, by_name
from ..style import ThemeName
from .two_level import Findings, unit


def _analysis(findings: Findings) -> tuple[Factorial]:
    return (findings.shown,)


def _pareto(findings: Findings) -> str:
    a = findings.shown
    count, shown = len(a.effects), min(len(a.effects), plots.MOST_BARS)
    part = f"the {shown} largest of {count} effects" if shown < count else f"all {count} effects"
    if a.lenth is None:
        return (f"Pareto chart of the standardised effects |t|, {part}. What crosses the line is "
                "significant; hatched bars are negative effects.")
    own = f" in {a.unit}" if a.unit else ""
    return (f"Pareto chart of the size of the effects{own}, {part}. What crosses the margin of "
            "error (ME) is significant if looked at alone, what crosses the simultaneous one (SME) "
            "also as one of many; hatched bars are negative effects.")


def _largest(findings: Findings) -> str:
    top = ", ".join(map(str, findings.shown.ranked().index[:3]))
    return f"Pareto chart; the largest effects are {top}"


def _box_cox(
    analysis: Factorial, profile: pd.DataFrame, theme: ThemeName = "light"
) -> Axes:
    """The profile that is known already."""
    return plots.plot_box_cox(analysis, theme=theme, profile=profile)


FIGURES: Mapping[str, Figure[Findings]] = by_name(
    Figure("pareto", plots.plot_pareto, _analysis, _pareto, _largest),
    Figure(
        "main_effects", plots.plot_main_effects, _analysis,
        lambda f: f"Main effects: mean {f.shown.quantity} at both levels of each factor"
        f"{', with its interval' if f.shown.replicate_effects is None else ''}, "
        "and the overall mean.",
        lambda f: f"Main effects; overall mean {f.shown.overall_mean:.3g}"
        f"{unit(f.shown)}",
    ),
    Figure(
        "interactions", plots.plot_interactions, _analysis,
        lambda f: f"Interactions: mean {f.shown.quantity} at each pair of levels. "
        "Lines that are not parallel are an interaction.",
        lambda f: "Matrix of interaction plots, one for each pair of factors",
        lambda f: len(f.shown.factors) > 1,
    ),
    Figure(
        "residuals", plots.plot_residuals, _analysis,
        lambda f: "Residuals: normal probability, histogram, against fits, and against the "
        "random run order.",
        lambda f: "Four plots of the residuals",
    ),
    Figure(
        "box_cox", _box_cox, lambda f: (f.shown, f.profile),
        lambda f: "Box–Cox profile: which power of the response suits the model.",
        lambda f: "Box–Cox profile",
        lambda f: f.profile is not None,
    ),
)  # fmt: skip
