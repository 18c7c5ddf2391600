"""What a figure writes, where, and which of it is cut off or lies on other text."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pytest
from matplotlib.path import Path
from matplotlib.text import Text

EDGE = 0.75
"""How far text may reach into other text or over the edge: the air about letters [pixel]."""


def drawn_texts(figure: Any) -> list[tuple[str, np.ndarray]]:
    """Each text that is drawn, and the corners of the box about it [pixel], shape (4, 2)."""
    found: list[tuple[str, np.ndarray]] = []
    draw = Text.draw

    def noted(self: Text, renderer: Any, *args: Any, **kwargs: Any) -> None:
        draw(self, renderer, *args, **kwargs)
        if self.get_visible() and self.get_text().strip():
            found.append((self.get_text(), _corners(self, renderer)))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Text, "draw", noted)
        figure.dpi = 150  # as in a file
        figure.canvas.draw()
    return found


def _corners(text: Text, renderer: Any) -> np.ndarray:
    extent = text.get_window_extent(renderer)
    turned = np.deg2rad(text.get_rotation())
    size = np.array([extent.width, extent.height])
    if abs(np.sin(2 * turned)) > 1e-3:
        size = np.array(renderer.get_text_width_height_descent(
            text.get_text(), text.get_fontproperties(), ismath=False
        )[:2])  # fmt: skip
    else:
        turned = 0.0
    half = np.fmax(size / 2 - EDGE, 0.1)
    turn = np.array([[np.cos(turned), -np.sin(turned)], [np.sin(turned), np.cos(turned)]])
    middle = np.array([extent.x0 + extent.x1, extent.y0 + extent.y1]) / 2
    return middle + (half * [[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ turn.T


def spoiled_texts(figure: Any) -> list[str]:
    """Texts that are cut off, and pairs of texts that overlap."""
    texts = drawn_texts(figure)
    size = figure.bbox.size
    spoiled = [
        f"{word!r} is cut off" for word, box in texts
        if box.min() < 0 or (box > size).any()
    ]  # fmt: skip
    boxes = [(word, Path(np.vstack([box, box[:1]])), box) for word, box in texts]
    for (one, first, a), (other, second, b) in combinations(boxes, 2):
        apart = (a.max(axis=0) < b.min(axis=0)).any() or (b.max(axis=0) < a.min(axis=0)).any()
        if not apart and first.intersects_path(second, filled=True):
            spoiled.append(f"{one!r} lies on {other!r}")
    return spoiled
