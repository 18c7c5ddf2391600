"""The page in which a realistic dive is explored: ```` ```{explorer} ```` shows it in a page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from docutils import nodes
from sblcosim.explore.page import write
from sblcosim.scenario.scenario import load
from sphinx.util.docutils import SphinxDirective

SCENARIO, RECEIVERS = "realistic-dive", ("coupled", "ekf")
NAME = "explore.html"
SHOWN = """<p><a href="{page}">In a window of its own</a></p>
<iframe class="explorer" src="{page}" title="A realistic dive, to explore" loading="lazy"></iframe>
"""


class Explorer(SphinxDirective):
    """The page, in a frame."""

    def run(self) -> list[nodes.Node]:
        up = "../" * self.env.docname.count("/")
        return [nodes.raw("", SHOWN.format(page=f"{up}{NAME}"), format="html")]


def explorer(app: Any) -> list[Any]:
    """Write the page into the site."""
    if app.builder.format == "html":
        write(load(SCENARIO), Path(app.outdir) / NAME, RECEIVERS)
    return []


def setup(app: Any) -> dict[str, Any]:
    """Pages that are not made from documents are written after all others."""
    app.add_directive("explorer", Explorer)
    app.connect("html-collect-pages", explorer)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
