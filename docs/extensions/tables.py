"""Tables with sentences: on a small screen each row is a block, with names before its cells."""

from __future__ import annotations

from html import escape
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

LONG = 30
"""Characters of a cell that a small screen has no room for beside two other columns."""


def blocks(app: Sphinx, doctree: nodes.document) -> None:
    """Mark the tables of three or more columns with sentences, and tell each cell its column."""
    for table in doctree.findall(nodes.table):
        head, *rows = ([*row.findall(nodes.entry)] for row in table.findall(nodes.row))
        if len(head) < 3 or not any(len(it.astext()) > LONG for row in rows for it in row[1:]):
            continue
        table["classes"].append("rows")
        for row in rows:
            for column, cell in zip(head[1:], row[1:], strict=True):
                cell["label"] = column.astext()


def labelled(writer: HTML5Translator, node: nodes.entry) -> None:
    """Write the begin of a cell."""
    HTML5Translator.visit_entry(writer, node)
    if node.get("label"):
        writer.body[-1] = writer.body[-1].replace(">", f' data-label="{escape(node["label"])}">', 1)


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect it."""
    app.add_node(nodes.entry, override=True, html=(labelled, HTML5Translator.depart_entry))
    app.connect("doctree-read", blocks)
    return {"parallel_read_safe": True}
