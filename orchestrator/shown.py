"""How objects are displayed: a line, public names only, and one picture in a notebook."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from html import escape
from typing import TYPE_CHECKING, Any

from .words.lists import plural

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MOST = 6
"""Arrays and collections with more elements are shown by their size."""


class Shown:
    """An object whose `repr` is one line, and whose `dir` has public names only."""

    def _gist(self) -> str:
        """What the line says after the name of the class; for a dataclass, its fields."""
        return ", ".join(_fields(self))

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self._gist()}>"

    def __dir__(self) -> list[str]:
        return public(super().__dir__())


def public(names: Iterable[str]) -> list[str]:
    """The names without a leading underscore."""
    return [name for name in names if not name.startswith("_")]


def _fields(instance: Any) -> Iterator[str]:
    for field in fields(instance) if is_dataclass(instance) else ():
        value = getattr(instance, field.name)
        shape = getattr(value, "shape", None)
        if shape:
            yield f"{field.name} ({'×'.join(map(str, shape))})"
        elif isinstance(value, Mapping | Sequence) and len(value) > _MOST:
            yield f"{field.name} ({len(value)})"
        elif value is not None:
            yield f"{field.name}={value!r}"


_LEFT = ' style="text-align: left"'


class Listing(Shown, Mapping[str, str]):
    """Names, each with a sentence: a mapping that prints as a table."""

    def __init__(self, entries: Mapping[str, str]) -> None:
        self._entries = dict(entries)

    def __getitem__(self, name: str) -> str:
        return self._entries[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __repr__(self) -> str:
        width = max(map(len, self), default=0)
        return "\n".join(f"{name:{width}}  {words}" for name, words in self.items())

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><th{_LEFT}>{escape(name)}</th><td{_LEFT}>{escape(words)}</td></tr>"
            for name, words in self.items()
        )
        return f"<table>{rows}</table>"


class Picture(Shown):
    """A drawn figure: a notebook shows it once, without any magic; `savefig` writes it.

    Attributes
    ----------
    figure
        Matplotlib's figure.
    axes
        The axes of the figure, for changes.
    """

    def __init__(
        self, axes: Axes | Sequence[Axes], given: Axes | Sequence[Axes] | None = None
    ) -> None:
        from matplotlib.axes import Axes

        self.axes: tuple[Axes, ...] = (axes,) if isinstance(axes, Axes) else tuple(axes)
        figure: Any = self.axes[0].figure
        self.figure: Figure = figure.figure  # of a subfigure: the whole
        self._given = given is not None

    def _gist(self) -> str:
        width, height = self.figure.get_size_inches()
        panels = sum(ax.axison for ax in self.axes)
        return f"of {panels} {plural(panels, 'panel')}, {width:g} × {height:g} inch"

    def savefig(self, *arguments: Any, **options: Any) -> None:
        """Write the figure to a file; see `matplotlib.figure.Figure.savefig`."""
        self.figure.savefig(*arguments, **options)

    def _repr_png_(self) -> tuple[bytes, dict[str, int]] | None:
        """The picture, sharp on dense screens; given axes are shown by their owner."""
        if self._given:
            return None
        stream = io.BytesIO()
        self.figure.savefig(stream, format="png", dpi=2 * _SCREEN_DPI)
        width, height = (round(inch * _SCREEN_DPI) for inch in self.figure.get_size_inches())
        return stream.getvalue(), {"width": width, "height": height}


_SCREEN_DPI = 100
"""Pixels of a notebook per inch of a figure."""


def page(title: str, *parts: str) -> str:
    """HTML for a notebook: a heading and its parts. It has no colours, so it suits any theme."""
    return f"<h4>{escape(title)}</h4>{''.join(parts)}"


def folded(summary: str, content: str) -> str:
    """HTML that is folded under a line."""
    return f"<details><summary>{escape(summary)}</summary>{content}</details>"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """HTML of a table of texts."""
    heads = "".join(f"<th>{escape(word)}</th>" for word in head)
    lines = ("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in rows)
    return f"<table><tr>{heads}</tr>{''.join(f'<tr>{line}</tr>' for line in lines)}</table>"


def verbatim(text: str) -> str:
    """HTML of lines as they are; long ones are broken."""
    return f'<pre style="white-space: pre-wrap">{escape(text)}</pre>'
