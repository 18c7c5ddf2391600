"""The parts that the figures of all analyses share: panels, legends, and labels with units."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import product
from textwrap import fill
from typing import Any, Protocol

from matplotlib.axes import Axes

from ...style import new_figure


class Quantified(Protocol):
    """An analysis of a quantity."""

    @property
    def unit(self) -> str:
        """Unit of the quantity; empty if it has none."""

    @property
    def quantity(self) -> str:
        """The analysed quantity."""


def add_legend(ax: Axes, own: bool, handles: Sequence[Any] | None = None) -> None:
    """Add a legend that hides nothing: in a new figure it is below the axes."""
    given = {} if handles is None else {"handles": handles}
    if own:
        ax.figure.legend(loc="outside lower center", ncols=2, **given)
    else:
        ax.legend(loc="best", **given)


def panels_in(
    rows: int,
    columns: int,
    width: float,
    height: float,
    ax: Axes | None,
    heights: Sequence[float] | None = None,
) -> list[Axes]:
    """Panels in a new figure, or in the place of `ax`, which disappears."""
    if ax is None:
        panels = new_figure(width, height).subplots(rows, columns, squeeze=False,
                                                    height_ratios=heights)
        return list(panels.flat)
    spec = ax.get_subplotspec()
    if spec is None:
        raise ValueError("ax: must be in a grid of axes, such as those of Figure.subplots")
    ax.set_axis_off()
    grid = spec.subgridspec(rows, columns, height_ratios=heights)
    figure = ax.figure
    return [figure.add_subplot(grid[i, j]) for i, j in product(range(rows), range(columns))]


def with_unit(factor: str, units: Mapping[str, str]) -> str:
    """A factor with its unit."""
    unit = units.get(factor)
    return f"{factor} [{unit}]" if unit else factor


def quantity_of(analysis: Quantified) -> str:
    """The analysed quantity with its unit."""
    return f"{analysis.quantity} [{analysis.unit}]" if analysis.unit else analysis.quantity


def wrapped(name: str, width: int) -> str:
    """The name in lines of at most `width` characters, broken at spaces, dots and underscores."""
    return re.sub(r"([_.]) ", r"\1", fill(re.sub(r"([_.])", r"\1 ", name), width))
