"""Keys of scenario files: places that the search and links find, in the tables of their page."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

PAGE = "docs/reference/scenario"


def named(app: Sphinx, doctree: nodes.document) -> None:
    """Name each row by its key, and let code that is a key lead to its row."""
    rows: dict[str, nodes.row] = {}
    for table in doctree.findall(nodes.table) if app.env.docname == PAGE else ():
        first, *others = table.findall(nodes.row)
        if first.astext().startswith("key\n"):
            table["classes"].append("keys")
            rows |= {str(next(row.findall(nodes.literal)).astext()): row for row in others}
    domain: Any = app.env.get_domain("std")
    for key, row in rows.items():
        row["ids"].append(f"key-{key}")
        domain.note_object("scenario-key", key, f"key-{key}", location=row)
        for literal in [*row.findall(nodes.literal)][1:]:
            if literal.astext() in rows and literal.parent is not None:
                link = nodes.reference("", "", refid=f"key-{literal.astext()}", internal=True)
                literal.parent.replace(literal, link)
                link += literal


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect it; ``key`` is the role of a link to a key."""
    app.add_object_type("scenario-key", "key", objname="scenario key")
    app.connect("doctree-read", named)
    return {"parallel_read_safe": True}
