"""The figures in the report of a two-level study: its analysis, and the Box–Cox profile."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd
from matplotlib.axes import Axes

from ..analysis.two_level import figures as plots
from ..analysis.two_level.analysis import FIGURES as OF_ANALYSIS
from ..analysis.two_level.analysis import Factorial
from ..catalogue import Figure, by_name
from ..style import ThemeName
from .two_level import Findings


def _box_cox(
    analysis: Factorial, profile: pd.DataFrame, theme: ThemeName = "light"
) -> Axes:
    """Draw a profile that is already known."""
    return plots.plot_box_cox(analysis, theme=theme, profile=profile)


def _of_findings(figure: Figure[Factorial]) -> Figure[Findings]:
    """A figure of the analysis as a figure of the findings."""
    return Figure(
        figure.name, figure.plot,
        lambda f: figure.data(f.shown), lambda f: figure.caption(f.shown),
        lambda f: figure.alt(f.shown), lambda f: figure.condition(f.shown),
    )  # fmt: skip


FIGURES: Mapping[str, Figure[Findings]] = by_name(
    *map(_of_findings, OF_ANALYSIS.values()),
    Figure(
        "box_cox", _box_cox, lambda f: (f.shown, f.profile),
        lambda f: "Box–Cox profile: the power of the response that suits the model.",
        lambda f: "Box–Cox profile",
        lambda f: f.profile is not None,
    ),
)  # fmt: skip
