"""Code in texts, which a line breaks after a separator only, and output, as a terminal wraps it."""

from __future__ import annotations

import re
from html import escape
from typing import Any

from docutils import nodes
from sblcosim.layout import WIDTH, fitted
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

# After a dot, dash and the like between two words; not in a number, nor in or after --.
_PLACE = re.compile(
    r"""(?<=[\w)\]}"'…][._/:|=,(-])(?!(?<=\d\.)\d|(?<=-)[^A-Za-z])(?=[^\W_]|[{[<("'*…])"""
)
_COLUMNS = re.compile(r"\S {2,}\S")


def breakable(word: str) -> str:
    """A word of code as HTML, with the places where a line may break."""
    return "<wbr>".join(map(escape, _PLACE.split(word)))


def inline(writer: HTML5Translator, node: nodes.literal) -> None:
    """Write code in a line."""
    writer.body.append(writer.starttag(node, "code", "", CLASS="docutils literal notranslate"))
    words = (f'<span class="pre">{breakable(word)}</span>' for word in node.astext().split())
    writer.body.append(f"{' '.join(words)}</code>")
    raise nodes.SkipNode


def wrapped(app: Sphinx, doctree: nodes.document) -> None:
    """Wrap the sentences of output; its columns stay as they are."""
    for block in doctree.findall(nodes.literal_block):
        if block.get("language") == "text":
            lines = block.astext().split("\n")
            text = "\n".join(
                line if _COLUMNS.search(line.strip()) else fitted(line, WIDTH) for line in lines
            )
            block.rawsource = text  # what is not text as it was is not coloured
            block.children[:] = [nodes.Text(text)]


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect it."""
    app.add_node(nodes.literal, override=True, html=(inline, None))
    app.connect("doctree-read", wrapped)
    return {"parallel_read_safe": True}
