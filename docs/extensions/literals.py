"""Code in texts, which a line breaks after a separator only, and blocks of code.

A block wraps if it holds commands only. Others scroll, as do commands with aligned comments. What
a terminal prints has its sentences wrapped as there. No option of a command is broken.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from html import escape
from itertools import pairwise
from typing import Any

from docutils import nodes
from pygments.lexers.shell import BashLexer
from pygments.token import Name, Text
from sblcosim.layout import WIDTH, fitted
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

# After a dot, dash and the like between two words; not in a number, nor in or after --.
_PLACE = re.compile(
    r"""(?<=[\w)\]}"'…][._/:|=,(-])(?!(?<=\d\.)\d|(?<=-)[^A-Za-z])(?=[^\W_]|[{[<("'*…])"""
)
_COLUMNS = re.compile(r"\S {2,}\S")
_OPTION = re.compile(r"(?<![\w-])--?[a-zA-Z][\w-]*")


def breakable(word: str) -> str:
    """A word of code as HTML, with the places where a line may break."""
    options = [option.span() for option in _OPTION.finditer(word)]
    places = [at for at in (it.start() for it in _PLACE.finditer(word))
              if not any(start < at < end for start, end in options)]  # fmt: skip
    parts = (word[i:j] for i, j in pairwise([0, *places, len(word)]))
    return "<wbr>".join(map(escape, parts))


class Commands(BashLexer):
    """Lines of a shell, whose options have a token of their own, so that no line breaks them."""

    def get_tokens_unprocessed(
        self, text: str, stack: tuple[str, ...] = ("root",)
    ) -> Iterator[tuple[int, Any, str]]:
        """The tokens of the shell, in which the options are names of attributes."""
        for start, kind, value in super().get_tokens_unprocessed(text, stack):
            option = _OPTION.fullmatch(value) if kind is Text else None
            yield start, Name.Attribute if option else kind, value


def inline(writer: HTML5Translator, node: nodes.literal) -> None:
    """Write code in a line."""
    writer.body.append(writer.starttag(node, "code", "", CLASS="docutils literal notranslate"))
    words = (f'<span class="pre">{breakable(word)}</span>' for word in node.astext().split())
    writer.body.append(f"{' '.join(words)}</code>")
    raise nodes.SkipNode


def wrapped(app: Sphinx, doctree: nodes.document) -> None:
    """Let commands wrap, and the sentences of output; columns stay as they are."""
    for block in doctree.findall(nodes.literal_block):
        lines = block.astext().split("\n")
        if block.get("language") == "sh" and not any(map(_COLUMNS.search, lines)):
            block["classes"].append("commands")
        if block.get("language") == "text":
            text = "\n".join(
                line if _COLUMNS.search(line.strip()) else fitted(line, WIDTH) for line in lines
            )
            block.rawsource = text  # what is not text as it was is not coloured
            block.children[:] = [nodes.Text(text)]


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect it."""
    app.add_lexer("sh", Commands)
    app.add_node(nodes.literal, override=True, html=(inline, None))
    app.connect("doctree-read", wrapped)
    return {"parallel_read_safe": True}
