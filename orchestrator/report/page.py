"""A report as one HTML file, which needs no network and no other file.

Its content is data (a `Page` of `Section`). Its look is in ``report.html.jinja`` and
``report.css``. Figures are drawn once. Their colours become CSS variables, so the same drawing
suits light paper, dark paper and print.
"""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from itertools import groupby
from typing import Literal

import jinja2
from markupsafe import escape

from .. import layout, shown
from ..style import THEMES, ThemeName, named, variables

NARROW, WIDEST = 40, 125
"""Width of a table that fits a telephone, and the page at its widest [characters]."""


@dataclass(frozen=True, slots=True)
class Text:
    """A paragraph. A ``note`` is smaller, an ``answer`` stands out."""

    text: str
    kind: Literal["plain", "note", "answer"] = "plain"


@dataclass(frozen=True, slots=True)
class Code:
    """Commands, line by line."""

    text: str


@dataclass(frozen=True, slots=True)
class PageTable:
    """A table.

    Attributes
    ----------
    head
        Headings of the columns.
    rows
        Cells; the first cell of a row is its heading.
    words
        Columns with words instead of numbers, besides the first one.
    note
        Text below the table.
    """

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    words: tuple[int, ...] = ()
    note: str = ""

    @property
    def characters(self) -> int:
        """Approximate least width [characters]; headings and words are wrapped."""
        total = 0
        for i, (head, *cells) in enumerate(zip(self.head, *self.rows, strict=True)):
            lines = " ".join([head, *cells]).split() if i in self.words else [*head.split(), *cells]
            least = 17 if i in self.words else 0  # as in the style sheet
            total += 3 + max([least, *map(len, lines)])
        return total

    def __str__(self) -> str:
        right = [i for i in range(1, len(self.head)) if i not in self.words]
        table = "\n".join(layout.table(self.rows, layout.WIDTH, self.head, right))
        parts = filter(None, [self.caption, table, self.note])
        return layout.fitted("\n\n".join(parts), layout.WIDTH)

    def _repr_html_(self) -> str:
        return shown.page(self.caption, shown.table(self.head, self.rows), *(
            [f"<p>{escape(self.note)}</p>"] if self.note else []
        ))


@dataclass(frozen=True, slots=True)
class PagePicture:
    """A figure: the text of an SVG file, its caption, and a text for readers who cannot see it.

    `name` is unique in the page. A narrow page shows the picture `narrow` instead.
    """

    name: str
    svg: str
    caption: str
    alt: str
    narrow: PagePicture | None = None


Block = Text | Code | PageTable | PagePicture
_KINDS = {Text: "text", Code: "code", PageTable: "table", PagePicture: "picture"}


@dataclass(frozen=True, slots=True)
class Section:
    """A heading with blocks and parts; `anchor` is unique in the page.

    A folded section shows only its heading and its pictures, which are small. It is opened by its
    heading, by a picture, by a link to its anchor or to something in it, by the browser's search,
    and in print.

    Attributes
    ----------
    beside
        Whether it stands beside its neighbours of this kind, where there is room.
    """

    title: str
    anchor: str
    blocks: Sequence[Block] = ()
    parts: Sequence[Section] = ()
    folded: bool = False
    beside: bool = False

    @property
    def pictures(self) -> list[PagePicture]:
        """The figures among its blocks."""
        return [block for block in self.blocks if isinstance(block, PagePicture)]

    @property
    def figures(self) -> list[PagePicture]:
        """All figures in it and in its parts."""
        return [*self.pictures, *(figure for part in self.parts for figure in part.figures)]

    @property
    def open_figures(self) -> list[PagePicture]:
        """The figures in it and in its parts that are not folded."""
        within = (figure for part in self.parts for figure in part.open_figures)
        return [] if self.folded else [*self.pictures, *within]

    @property
    def arrangement(self) -> Literal["beside", "small", "below"]:
        """How it stands among its neighbours: beside them, as a small picture, or below them."""
        if self.folded:
            return "small" if self.pictures else "below"
        return "beside" if self.beside else "below"

    @property
    def rows(self) -> list[tuple[str, list[Section]]]:
        """Its parts: those in a row that are arranged alike, and how."""
        found = groupby(self.parts, key=lambda part: part.arrangement)
        return [(arrangement, list(parts)) for arrangement, parts in found]


@dataclass(frozen=True, slots=True)
class Page:
    """A report: title, lead and sections, the summary first."""

    title: str
    lead: str
    sections: Sequence[Section]
    foot: str = ""


def render(page: Page) -> str:
    """The HTML file's text."""
    return _environment().get_template("report.html.jinja").render(page=page)


def brief(page: Page) -> str:
    """HTML for a notebook: tables, answers and figures. Tables in folded parts are left out."""
    return _environment().get_template("notebook.html.jinja").render(page=page)


def inline(picture: PagePicture, theme: ThemeName = "light") -> str:
    """A figure's SVG element for use within HTML, its colours as CSS variables.

    Parameters
    ----------
    theme
        Theme of the drawing.
    """
    text = picture.svg[picture.svg.index("<svg") :]
    text = re.sub(r"\s*<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r"\s*<style[^>]*>.*?</style>", "", text, flags=re.DOTALL)
    text = re.sub(r"<!--.*?-->\s*", "", text, flags=re.DOTALL)
    text = text.replace("xlink:href", "href")
    text = re.sub(r"[ \n]+(xmlns(:\w+)?|version)=\"[^\"]*\"", "", text)
    # identifiers are unique only within a file
    text = re.sub(r'\bid="([^"]*)"', rf'id="{picture.name}-\1"', text)
    text = re.sub(r'href="#([^"]*)"', rf'href="#{picture.name}-\1"', text)
    text = re.sub(r"url\(#([^)]*)\)", rf"url(#{picture.name}-\1)", text)
    # nothing refers to these groups
    text = re.sub(rf'<g id="{picture.name}-[a-zA-Z0-9_]*">', "<g>", text)
    for variable, colour in variables(named(theme)).items():
        text = text.replace(colour, f"var(--{variable})")
    attributes = f'role="img" aria-label="{escape(picture.alt)}"'
    return text.replace("<svg", f"<svg {attributes}", 1).strip()


@cache
def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(_template),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["inline"] = inline
    environment.filters["base64"] = lambda text: b64encode(text.encode()).decode()
    environment.globals["css"] = _template("report.css")
    environment.globals["themes"] = {name: variables(look) for name, look in THEMES.items()}
    environment.globals |= {"wide": NARROW, "wider": WIDEST}
    environment.globals["kind"] = lambda block: _KINDS[type(block)]
    return environment


def _template(name: str) -> str:
    return (resources.files("sblcosim.report") / name).read_text("utf-8")
