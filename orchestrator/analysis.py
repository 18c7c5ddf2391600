"""From a study's results to the answer: which factor matters, as tables and pictures."""

from __future__ import annotations

from pathlib import Path

from . import artifacts, campaign, factorial_plots, style
from .errors import ConfigurationError, nearest
from .factorial import Factorial, Transform, analyse

RESPONSE = "absolute_total_rms_m"
"""The paper's: RMS of the total error."""


def of_study(
    results: str | Path,
    response: str = RESPONSE,
    *,
    receiver: str | None = None,
    order: int | None = None,
    transform: Transform = "none",
    practical: float | None = None,
) -> Factorial:
    """Analyse the runs in a folder of results; see `sblcosim.factorial.analyse`.

    Parameters
    ----------
    response
        A column of the table of runs, without the receiver's name.
    receiver
        Whose; default: the first.

    Raises
    ------
    ConfigurationError
        There are no runs, no such receiver or response, or the design cannot be analysed so.
    """
    study, table = campaign.study_of(results), campaign.table(results)
    responses = [c for c in table.columns if "." in c]
    receivers = list(dict.fromkeys(c.partition(".")[0] for c in responses))
    chosen = receivers[0] if receiver is None else receiver
    if chosen not in receivers:
        raise ConfigurationError(
            f"receiver: must be {', '.join(receivers)}, got {chosen!r}{nearest(chosen, receivers)}"
        )
    known = [c.partition(".")[2] for c in responses if c.startswith(f"{chosen}.")]
    if response not in known:
        raise ConfigurationError(
            f"response: must be one of {', '.join(known)}, got {response!r}"
            f"{nearest(response, known)}"
        )
    return analyse(
        table, list(study.factors), f"{chosen}.{response}", order=order, transform=transform,
        practical=practical, seeding=study.seeding, unit="m" if response.endswith("_m") else "",
    )


def save(
    analysis: Factorial, directory: str | Path, theme: style.ThemeName = "light"
) -> Path:
    """Write the tables, the paper's four pictures (Figures 15 to 18) and a manifest."""
    about = {"analysis": {"response": analysis.response, "factors": list(analysis.factors)}}
    with artifacts.folder(directory, about) as folder:
        for name in ("effects", "anova", "main_effects", "interactions"):
            artifacts.write_table(getattr(analysis, name).reset_index(), folder, name)
        style.save(factorial_plots.plot_pareto(analysis, theme=theme), folder, "pareto")
        style.save(factorial_plots.plot_main_effects(analysis, theme=theme), folder, "main_effects")
        for name, axes in (
            ("interactions", factorial_plots.plot_interactions(analysis, theme=theme)),
            ("residuals", factorial_plots.plot_residuals(analysis, theme=theme)),
        ):
            if axes:
                style.save(axes[0], folder, name)
    return Path(directory)
