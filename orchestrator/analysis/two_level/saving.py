"""The folders of an analysis and of advice: tables, figures and manifest."""

from __future__ import annotations

from pathlib import Path

from ... import artifacts, style
from . import figures
from .analysis import Factorial


def save(
    analysis: Factorial,
    directory: str | Path,
    theme: style.ThemeName = "light",
) -> Path:
    """Write the tables, the paper's four pictures (Figures 15 to 18) and a manifest."""
    with artifacts.folder(directory, about(analysis)) as folder:
        write(analysis, folder, theme)
    return Path(directory)


def about(analysis: Factorial) -> dict[str, object]:
    """Entry of the manifest."""
    return {
        "analysis": {
            "response": analysis.response, "factors": list(analysis.factors),
            "method": analysis.method, "error": analysis.error,
        }
    }


def write(
    analysis: Factorial,
    folder: Path,
    theme: style.ThemeName = "light",
) -> None:
    """As `save`, into an existing folder."""
    for name in ("effects", "anova", "main_effects", "interactions"):
        artifacts.write_table(getattr(analysis, name).reset_index(), folder, name)
    shown = analysis.readable
    style.save(figures.plot_pareto(shown, theme=theme), folder, "pareto")
    style.save(figures.plot_main_effects(shown, theme=theme), folder, "main_effects")
    for name, axes in (
        ("interactions", len(shown.factors) > 1 and figures.plot_interactions(shown, theme=theme)),
        ("residuals", figures.plot_residuals(shown, theme=theme)),
    ):
        if axes:
            style.save(axes[0], folder, name)
