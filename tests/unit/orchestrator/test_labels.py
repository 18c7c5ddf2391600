"""Labels of points in figures: where there is room, and near."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from sblcosim.results.figures.drawing import free_places

SIDES = [side for side in product((1, 0, -1), repeat=2) if any(side)]


def place_of_label(drawn: Any, dots: Any = None) -> tuple[float, ...]:
    """Where a label of the origin is, right and up [point], in axes whose unit is an inch."""
    figure = Figure(figsize=(4, 4))
    ax = figure.add_axes((0, 0, 1, 1))
    ax.set_xlim(-2, 2)
    ax.set_ylim(-2, 2)
    (place,) = free_places(ax, np.zeros((1, 2)), ["label"], drawn, dots)
    right, up = place["transform"].transform((0.0, 0.0)) / figure.dpi - 2
    return tuple(np.round(72 * np.array([right, up]), 6).tolist())


@pytest.mark.parametrize("side", SIDES)
def test_a_label_is_where_nothing_else_is_drawn(side: tuple[int, int]) -> None:
    """A curve everywhere but on one side; the label is 0.4 inch wide and 0.15 high."""
    x, y = np.meshgrid(*[np.linspace(-1, 1, 161)] * 2)
    curve = np.column_stack([x.ravel(), y.ravel()])
    free = np.array([
        (s * c > 0.015) & (s * c < end) if s else np.abs(c) < 0.5 * end
        for s, c, end in zip(side, curve.T, (0.5, 0.24), strict=True)
    ]).all(axis=0)
    right, up = place_of_label(curve[~free])
    assert (np.sign(right), np.sign(up)) == side
    assert max(abs(right), abs(up)) == 6.0


def test_a_label_hides_a_dot_before_it_goes_far_from_its_point() -> None:
    assert place_of_label(np.empty((0, 2))) == (6.0, 3.6)
    below = 0.078 * np.array(SIDES)
    assert max(place_of_label(np.empty((0, 2)), below)) == 6.0
    assert max(place_of_label(np.empty((0, 2)), np.tile(below, (20, 1)))) > 6.0
