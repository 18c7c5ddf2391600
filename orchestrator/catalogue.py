"""Tables of figures: a row holds everything about a figure of a run or of a report.

To add a figure, write a plot function and add a row.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from . import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Subject = TypeVar("Subject")


def _no_words(subject: object) -> str:
    return ""


def _always(subject: object) -> bool:
    return True


@dataclass(frozen=True, eq=False)
class Job:
    """A figure and its data, ready to draw in this or another process.

    Attributes
    ----------
    plot
        A module-level function; it takes the arguments and a theme, and returns axes.
    """

    name: str
    plot: Callable[..., Axes | Sequence[Axes]]
    arguments: tuple[Any, ...]

    def axes(self, theme: style.ThemeName = "light") -> Axes:
        """Draw the figure; returns the first of its axes."""
        from matplotlib.axes import Axes

        axes = self.plot(*self.arguments, theme=theme)
        return axes if isinstance(axes, Axes) else axes[0]

    def svg(self) -> str:
        """Draw the figure; returns the text of an SVG file."""
        return style.svg(self.axes(), self.name)

    def save(self, folder: Path, theme: style.ThemeName = "light") -> None:
        """Draw the figure and write it into a folder as SVG and PNG."""
        style.save(self.axes(theme), folder, self.name)


@dataclass(frozen=True, eq=False)
class Figure(Generic[Subject]):
    """A figure of a subject: of a run, of the analysis of a study, or of the paper's studies.

    Attributes
    ----------
    name
        Name of its file; unique in its table.
    plot
        Function that draws it; see `Job`.
    data
        Function from the subject to the arguments of `plot`.
    caption, alt
        Functions from the subject to the caption and the alternative text.
    condition
        Function that decides whether the subject has this figure.
    """

    name: str
    plot: Callable[..., Axes | Sequence[Axes]]
    data: Callable[[Subject], tuple[Any, ...]]
    caption: Callable[[Subject], str] = _no_words
    alt: Callable[[Subject], str] = _no_words
    condition: Callable[[Subject], bool] = _always

    def job(self, subject: Subject) -> Job:
        """Combine the figure with the subject's data."""
        return Job(self.name, self.plot, self.data(subject))


AnyFigure = TypeVar("AnyFigure", bound=Figure[Any])


def by_name(*figures: AnyFigure) -> Mapping[str, AnyFigure]:
    """Make a table of figures by name.

    Raises
    ------
    ValueError
        Two figures have the same name.
    """
    rows: dict[str, AnyFigure] = {}
    for figure in figures:
        if figure.name in rows:
            raise ValueError(f"figure {figure.name!r}: the name must be unique in its table")
        rows[figure.name] = figure
    return MappingProxyType(rows)


def jobs(figures: Mapping[str, Figure[Subject]], subject: Subject) -> list[Job]:
    """The figures of a subject, in the order of the table."""
    return [figure.job(subject) for figure in figures.values() if figure.condition(subject)]
