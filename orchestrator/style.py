"""Style of the figures: colours that colour-blind readers can tell apart, light or dark.

Matplotlib is imported when something is drawn: a run may leave that to another process.
"""

from __future__ import annotations

import hashlib
import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np

from .errors import check_choice

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ThemeName = Literal["light", "dark"]


@dataclass(frozen=True, slots=True)
class Theme:
    """Colours of a figure.

    Attributes
    ----------
    ink
        Text, axes and the truth.
    soft
        Raw fixes and other background elements.
    receivers
        Colours of Okabe and Ito's palette (https://jfly.uni-koeln.de/color/) with enough contrast
        on this paper, in the order of the receivers.
    """

    paper: str
    ink: str
    grid: str
    soft: str
    receivers: tuple[str, ...]


THEMES: dict[ThemeName, Theme] = {
    "light": Theme(
        "#ffffff", "#000000", "#dddddd", "#808080",
        ("#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00"),
    ),
    "dark": Theme(
        "#14171a", "#f2f2f2", "#3a3f44", "#b0b0b0",
        ("#e69f00", "#56b4e9", "#009e73", "#cc79a7", "#f0e442"),
    ),
}
SIZE = 9.5
"""Size of text [point]."""
SMALL = 8.5
"""Size of text that must be smaller than the rest [point]."""
LINES = ("-", (0, (5, 1.5)), (0, (1.5, 1)), (0, (6, 1.5, 1.5, 1.5)))
"""Line styles of the receivers, so that no figure depends on colour alone."""
MARKERS = ("", "o", "s", "^", "D", "v", "P", "X")
"""Markers on the receivers' lines; the next one is used each time the colours repeat."""
PLAIN = {"parse_math": False, "usetex": False}
"""Properties of text that is shown literally."""


def named(theme: ThemeName) -> Theme:
    """Look up a theme by name.

    Raises
    ------
    ConfigurationError
        There is no such theme.
    """
    check_choice("theme", theme, THEMES)
    return THEMES[theme]


def variables(look: Theme) -> dict[str, str]:
    """A theme's colours, by the names of CSS variables in pages."""
    colours = {"paper": look.paper, "ink": look.ink, "grid": look.grid, "soft": look.soft}
    return colours | {f"line-{i}": colour for i, colour in enumerate(look.receivers)}


@contextmanager
def use(theme: ThemeName, axes: Axes | Sequence[Axes] | None = None) -> Iterator[Theme]:
    """Draw in a theme; Matplotlib's settings are restored afterwards.

    Text is shown literally: names come from the user, and a dollar sign must not start a formula.

    Parameters
    ----------
    axes
        Existing axes, whose labels and titles were created under other settings.

    Raises
    ------
    ConfigurationError
        There is no such theme.
    """
    from matplotlib import rc_context
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.text import Text

    look = named(theme)
    settings: Any = {
        "figure.facecolor": look.paper,
        "figure.constrained_layout.use": True,
        "axes.facecolor": look.paper,
        "axes.edgecolor": look.ink,
        "axes.labelcolor": look.ink,
        "axes.titlecolor": look.ink,
        "axes.titlesize": "medium",
        "axes.grid": True,
        "axes.axisbelow": True,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "grid.color": look.grid,
        "grid.linewidth": 0.6,
        "text.color": look.ink,
        "text.parse_math": False,
        "text.usetex": False,
        "axes.formatter.use_mathtext": False,
        "axes.formatter.useoffset": False,
        "xtick.color": look.ink,
        "ytick.color": look.ink,
        "legend.frameon": False,
        "font.size": SIZE,
        "lines.linewidth": 1.4,
    }
    with rc_context(settings):
        for ax in (axes,) if isinstance(axes, Axes) else () if axes is None else axes:
            inside = ax.get_children()
            titles = [c for c in inside if isinstance(c, Text) and c not in ax.texts]
            for text in (*titles, *(c.label for c in inside if isinstance(c, Axis))):
                text.set(**PLAIN)
        yield look


def new_figure(width: float, height: float, *, laid_out: bool = False) -> Figure:
    """A figure of a given size [inch] that is not registered with pyplot.

    Within `use`, Matplotlib makes room for everything outside the axes, unless the caller has
    `laid_out` the figure.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    layout: Any = "none" if laid_out else None
    figure = Figure(figsize=(width, height), layout=layout)
    FigureCanvasAgg(figure)
    return figure


def _figure_of(axes: Axes) -> Figure:
    return cast("Figure", axes.figure)  # not a subfigure: we have none


def save(axes: Axes, folder: Path, name: str) -> None:
    """Write the figure of these axes as SVG and PNG; equal figures give equal bytes."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure = _figure_of(axes)
    figure.dpi = 150
    width, height = np.round(150 * figure.get_size_inches()) / 150  # whole pixels
    figure.set_size_inches(width, height)
    # Use the canvas directly: Figure.savefig draws everything twice.
    agg: Any = FigureCanvasAgg(figure)
    # A lower level than usual takes half the time, and makes the file a twentieth larger.
    agg.print_png(folder / f"{name}.png", metadata={"Software": None},
                  pil_kwargs={"compress_level": 3})
    figure.set_layout_engine("none")  # the layout is final now
    (folder / f"{name}.svg").write_text(svg(axes, name), "utf-8")


def svg(axes: Axes, name: str) -> str:
    """The figure of these axes as the text of an SVG file."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    figure = _figure_of(axes)
    figure.dpi = 150  # resolution of rasterised point clouds
    stream = io.StringIO()
    with rc_context({"svg.hashsalt": name}):
        canvas: Any = FigureCanvasSVG(figure)
        canvas.print_svg(stream, metadata={"Date": None})
    return _with_own_ids(stream.getvalue(), name)


# Each pattern begins with a literal, which is faster to search in long texts.
_ID = re.compile(r' id="([A-Za-z]+[0-9a-f]{10})(?=")')
_REFERENCE = re.compile(r'#([A-Za-z]+[0-9a-f]{10})(?=[")])')


def _with_own_ids(text: str, name: str) -> str:
    """Replace Matplotlib's ids with ids that depend only on the figure's name and their order.

    Matplotlib hashes the bounds of axes, whose last bits differ from process to process.
    """
    own = {
        old: old[:-10] + hashlib.sha256(f"{name} {n}".encode()).hexdigest()[:10]
        for n, old in enumerate(dict.fromkeys(_ID.findall(text)))
    }

    def renamed(found: re.Match[str]) -> str:
        return found[0].replace(found[1], own[found[1]]) if found[1] in own else found[0]

    return _REFERENCE.sub(renamed, _ID.sub(renamed, text))
