"""Figures of the gallery: what the last line of a block returns, for light and dark screens."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from sblcosim.report.page import variables
from sblcosim.report.paper.numbers import facts_of_figure
from sblcosim.shown import Picture
from sblcosim.style import THEMES, svg

MOST_POINTS = 2000
"""Points of a cloud that are drawn one by one; more become a picture."""
IMAGE = """
.. container:: figure only-{theme}

   .. image:: /{path}
      :alt: {alt}
"""


def scraper(
    block: Any, block_vars: Mapping[str, Any], gallery_conf: Mapping[str, Any]
) -> str:
    """Write the figure as SVG, in both themes; the reStructuredText that shows them."""
    picture = block_vars["example_globals"].get("___")
    if not isinstance(picture, Picture | Axes):
        return ""
    axes = picture.axes[0] if isinstance(picture, Picture) else picture
    thumbnail = Path(next(block_vars["image_path_iterator"]))
    light = thumbnail.with_suffix(".svg")
    dark = light.with_name(f"{light.stem}-dark.svg")
    figure: Any = axes.figure
    for line in figure.findobj(Line2D):
        if line.get_linestyle() == "None" and len(line.get_xdata()) > MOST_POINTS:
            line.set_rasterized(True)
    drawing = svg(axes, light.stem)
    figure.savefig(thumbnail, dpi=110)
    light.write_text(drawing, "utf-8")
    dark.write_text(darkened(drawing), "utf-8")
    title = Path(block_vars["src_file"]).read_text("utf-8").splitlines()[1]
    source = Path(gallery_conf["src_dir"])
    shown = "".join(
        IMAGE.format(path=path.relative_to(source).as_posix(), alt=title, theme=theme)
        for theme, path in (("light", light), ("dark", dark))
    )
    return shown + (in_the_paper(title) if light.stem.endswith("_001") else "")


def in_the_paper(title: str) -> str:
    """What the paper says of a figure, below ours; nothing for a figure that it does not have."""
    if not title.startswith("Figure "):
        return ""
    number = int(title.removeprefix("Figure ").partition(":")[0])
    facts = facts_of_figure(number)
    text = f"\n**In the paper** (section {facts['section']}): {facts['shows']}."
    return f"{text} It says: {facts['says']}.\n" if "says" in facts else f"{text}\n"


def darkened(drawing: str) -> str:
    """A drawing in the light theme, in the colours of the dark one."""
    light, dark = (variables(THEMES[name]) for name in ("light", "dark"))
    for name, colour in light.items():
        drawing = drawing.replace(colour, f"[{name}]")
    for name, colour in dark.items():
        drawing = drawing.replace(f"[{name}]", colour)
    # Matplotlib does not write what is black
    return drawing.replace("<svg ", f'<svg fill="{dark["ink"]}" ', 1)
