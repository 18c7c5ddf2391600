"""The page in which a realistic dive is explored, as a part of the site's first page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sblcosim.explore.page import write
from sblcosim.scenario.scenario import load

SCENARIO, RECEIVERS = "realistic-dive", ("coupled", "ekf")
NAME = "explore.html"


def explorer(app: Any) -> list[Any]:
    """Write the page into the site."""
    if app.builder.format == "html":
        write(load(SCENARIO), Path(app.outdir) / NAME, RECEIVERS)
    return []


def setup(app: Any) -> dict[str, Any]:
    """Pages that are not made from documents are written after all others."""
    app.connect("html-collect-pages", explorer)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
