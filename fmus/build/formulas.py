"""Formulas of Markdown texts as MathML, and the symbols in them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from latex2mathml.converter import convert
from markdown_it import MarkdownIt
from mdit_py_plugins.dollarmath import dollarmath_plugin

FONTS = (
    '"Cambria Math", "STIX Two Math", "Latin Modern Math", "Libertinus Math", '
    '"DejaVu Math TeX Gyre", math'
)
"""Fonts with large brackets, as a list in CSS: browsers do not find them by the name "math"."""
EVERYWHERE = "Everywhere"
"""Heading of the symbols that mean the same on all pages."""
_GREEK = (
    "alpha|beta|gamma|delta|(?:var)?epsilon|zeta|eta|(?:var)?theta|iota|kappa|lambda|mu|nu|xi|pi|"
    "rho|sigma|tau|upsilon|(?:var)?phi|chi|psi|omega|Gamma|Delta|Theta|Lambda|Xi|Phi|Psi|Omega|ell"
)
_SYMBOL = re.compile(
    r"(?P<base>(?:\\(?:hat|bar|dot)\{[^{}]*\}|\\mathcal\{\w\}|\\(?:" + _GREEK + r")(?![A-Za-z])"
    r"|(?<![\\A-Za-z])[A-Za-z](?![A-Za-z]))'?)"
    r"(?:_(?P<index>\{[^{}]*\}|\\[A-Za-z]+|[\w+-]))?"
)
_FUNCTION = re.compile(
    r"(?P<before></m[a-z]+>)?(?P<name><mi>[a-z]{2,}</mi>)(?P<after><(?!/)m[a-z]+)"
)
_SPACE = '<mspace width="0.167em" />'
"""A thin space, which browsers do not put beside the name of a function."""
_ROW = re.compile(r"^\| \$(?P<latex>[^$]+)\$ \| (?P<unit>.*?) \| (?P<words>.*?) \|$", re.MULTILINE)
_INDICES = set("ijkKnNxyzhvp0123456789+-,")
"""What an index is made of: which one of several, or which part of a vector or a matrix."""


@dataclass(frozen=True)
class Symbol:
    """A row of the table of symbols, and its place on a page."""

    latex: str
    unit: str
    words: str
    place: str


@cache
def symbols() -> Mapping[str, Mapping[str, Symbol]]:
    """The table of symbols, by heading and name: `symbols()["Receiver"]["S"]`."""
    text = files("sblcosim.models").joinpath("SYMBOLS.md").read_text("utf-8")
    found: dict[str, Mapping[str, Symbol]] = {}
    for part in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        heading = part.partition("\n")[0]
        found[heading] = {
            name: Symbol(row["latex"], row["unit"], row["words"], _place(heading, name))
            for row in _ROW.finditer(part) for name, _ in _named(row["latex"])
        }  # fmt: skip
    return found


def of_page(folder: str, page: str = "") -> Mapping[str, Symbol]:
    """The symbols that a page may use: those of all pages, of its folder's, and its own.

    Its own are in the sections whose headings name it, with its folder or without.
    """
    heading = folder.replace("_", " ").capitalize()
    found = {**symbols()[EVERYWHERE], **symbols().get(heading, {})}
    for named, section in symbols().items():
        if {page, f"{folder}/{page}"} & {*named.split(", ")}:
            found |= section
    return found


def used(latex: str, known: Mapping[str, Symbol]) -> Iterator[tuple[str, Symbol | None]]:
    """The symbols in a formula, each with its row; None if the table does not have it.

    A symbol with an index that has no row of its own is looked up without the index.
    """
    for name, base in _named(latex):
        yield name, known.get(name, known.get(base))


def mathml(latex: str, display: bool = False) -> str:
    """A formula as MathML.

    Raises
    ------
    ValueError
        The formula has a command that is not known.
    """
    # The converter shows a command that it does not know as it is. It makes bars operators, with
    # spaces around them, unless they are a pair.
    paired = latex.strip().replace(r"\lvert", r"\left|").replace(r"\rvert", r"\right|")
    made = convert(paired, display="block" if display else "inline")
    if "\\" in made:
        raise ValueError(f"a formula must have known commands only, got {latex.strip()!r}")
    return _FUNCTION.sub(_spaced, made)


def _spaced(found: re.Match[str]) -> str:
    """The name of a function with spaces beside it, except before a bracket or after an operator.
    """
    before, after = found["before"] or "", found["after"]
    left = _SPACE if before and before != "</mo>" else ""
    right = "" if after in ("<mo", "<mrow") else _SPACE
    return f"{before}{left}{found['name']}{right}{after}"


def linked(
    latex: str, display: bool, known: Mapping[str, Symbol], link: Callable[[str], str]
) -> str:
    """A formula as HTML that leads to its symbol, or to the table if it has several."""
    made = mathml(latex, display)
    places = {row.place for _, row in used(latex, known) if row is not None}
    if places:
        place = places.pop() if len(places) == 1 else "symbols"
        made = f'<a class="formula" href="{link(place)}">{made}</a>'
    return f'<div class="formula">{made}</div>\n' if display else made


def parser(render: Callable[[str, bool], str]) -> MarkdownIt:
    """A parser of Markdown with tables and formulas, and without raw HTML."""

    def renderer(content: str, options: Mapping[str, Any]) -> str:
        return render(content, bool(options["display_mode"]))

    made = MarkdownIt("commonmark", {"html": False}).enable("table")
    return made.use(dollarmath_plugin, renderer=renderer, double_inline=True, allow_labels=False)


def _named(latex: str) -> Iterator[tuple[str, str]]:
    """Names of the symbols in a formula, with index and without."""
    plain = re.sub(r"_\{\\text\{(\w+)\}\}", r"_{\1}", latex)
    plain = re.sub(r"\\(?:text|operatorname|mathsf|mathrm|begin|end)\{[^}]*\}", " ", plain)
    for found in _SYMBOL.finditer(plain):
        index = re.sub(r"[{}\s]", "", found["index"] or "")
        base = re.sub(r"\s", "", found["base"])
        yield (f"{base}_{index}" if index else base), (base if set(index) <= _INDICES else "")


def _place(heading: str, name: str) -> str:
    return "symbol-" + re.sub(r"[^A-Za-z0-9]+", "-", f"{heading}-{name}")
