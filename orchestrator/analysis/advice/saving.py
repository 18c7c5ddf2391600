"""The folder of advice: table, figure and manifest."""

from __future__ import annotations

from pathlib import Path

from ... import artifacts, style
from . import figures
from .advice import Advice


def save_advice(
    advice: Advice,
    directory: str | Path,
    theme: style.ThemeName = "light",
    shown: Advice | None = None,
) -> Path:
    """Write the table of points, the figure of cost and accuracy, and a manifest.

    `shown` is the same for people, for the figure.
    """
    about = {
        "advice": {
            "response": advice.response, "limit": advice.limit, "percentile": advice.percentile,
            "contamination": advice.contamination, "confidence": advice.confidence,
        }
    }
    with artifacts.folder(directory, about) as folder:
        artifacts.write_table(advice.points, folder, "points")
        axes = figures.plot_front(advice if shown is None else shown, theme=theme)
        style.save(axes, folder, "front")
    return Path(directory)
