"""Formulas as MathML, which browsers show without a script, and their symbols as places to link."""

from __future__ import annotations

import re
from pathlib import PurePosixPath
from typing import Any

from docutils import nodes
from sblcosim.fmus.build.formulas import linked, of_page, symbols, used
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

TABLE = "models/SYMBOLS"
_CLOSING = re.compile(r"[.,;:!?)\]]")
_JOINED = '<span class="joined">{}&#8288;</span>'
"""A word joiner: a line may begin with no punctuation. Chromium needs a style, too."""


def inline(writer: HTML5Translator, node: nodes.math) -> None:
    """Write a formula in a line."""
    _write(writer, node, display=False)


def displayed(writer: HTML5Translator, node: nodes.math_block) -> None:
    """Write a formula on a line of its own."""
    _write(writer, node, display=True)


def _write(writer: HTML5Translator, node: nodes.Element, display: bool) -> None:
    page = writer.builder.current_docname
    folder, name = PurePosixPath(page).parent.name, PurePosixPath(page).name
    models = page.startswith("models/") or folder == "limits"
    known = of_page(folder, name) if models and page != TABLE else {}
    uri = writer.builder.get_relative_uri(page, TABLE)
    made = linked(node.astext(), display, known, f"{uri}#{{}}".format)
    after = node.next_node(nodes.Text, descend=False, siblings=True)
    joined = not display and after is not None and _CLOSING.match(after.astext())
    writer.body.append(_JOINED.format(made) if joined else made)
    raise nodes.SkipNode


def named(app: Sphinx, doctree: nodes.document) -> None:
    """Make each row of the table of symbols a place."""
    for section in doctree.findall(nodes.section) if app.env.docname == TABLE else ():
        heading = str(section.next_node(nodes.title).astext())
        for row in [*section.findall(nodes.row)] if section.parent is not doctree else ():
            for formula in list(row.findall(nodes.math))[:1]:
                for _, it in used(formula.astext(), symbols().get(heading, {})):
                    if it is not None and it.latex == formula.astext():
                        row["ids"].append(it.place)


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the renderer of formulas, and connect the places."""
    app.add_html_math_renderer("mathml", (inline, None), (displayed, None))
    app.connect("doctree-read", named)
    return {"parallel_read_safe": True}
