"""The figures of `sblcosim paper`: a row for each in `FIGURES`, and the functions behind the rows.

To add a figure, write the function that draws it, and its row. A row with a label stands for that
figure of the paper. A row without a label is an additional figure of its scenario.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from sblcosim.fmus import stopping
from sblcosim.models.platform.beaufort import LEVELS
from scipy import stats

from ...catalogue import Figure, Job, by_name
from ...catalogue import jobs as jobs_of
from ...data.record import Record
from ...data.truth import recorded
from ...results.figures import run as plots
from ...results.result import Result
from ...study.again import replay
from ...study.design import INTERACTION_SIGN
from ...study.executors import deferring_signals, processes
from ...style import ThemeName, new_figure, use
from ...words.numbers import interval, signed, unbroken
from ...words.shares import percent
from .. import two_level as factorial
from ..page import Block, Text
from ..two_level import Findings
from ..two_level_figures import FIGURES as STUDY_FIGURES
from .campaigns import SCENARIOS, SEAS, Progress, sea
from .comparisons import compared, factors, row
from .numbers import MEAN, TOTAL, PaperNumbers, facts_of_errors, facts_of_figure

OPEN = (15, 12, 22, 19, 28, 25)
"""Numbers of the paper's figures that are open in the report: for each scenario, the Pareto chart
beside the trajectory."""
UNEVEN = 0.1
"""Rank correlation of fit and size of the residual above which the scatter is uneven."""


@dataclass(frozen=True, eq=False)
class Material:
    """The data of the figures.

    Attributes
    ----------
    points
        A run at the favourable point of each scenario.
    session
        A session in the harbour.
    seas
        The platform in waves, by Beaufort number.
    """

    numbers: PaperNumbers
    points: Mapping[int, Result]
    session: Result
    seas: Mapping[int, Record]


def gather(folder: Path, numbers: PaperNumbers) -> Material:
    """Simulate the runs of the figures again, with full records.

    Parameters
    ----------
    folder
        Folder of the campaigns.
    """

    def first_of(campaign: str, table: pd.DataFrame) -> Result:
        return replay(folder / campaign, str(table.iloc[0]["run_id"]))

    return Material(
        numbers,
        {n: first_of(f"favourable-{n}", numbers.points[n]) for n in SCENARIOS},
        first_of("harbour-square", numbers.sessions["square"]),
        {beaufort: sea(beaufort) for beaufort in SEAS},
    )


def _no_blocks(material: Material) -> Sequence[Block]:
    return ()


@dataclass(frozen=True, eq=False, kw_only=True)
class PaperFigure(Figure[Material]):
    """A figure of the report.

    Attributes
    ----------
    scenario
        Number of the scenario; None for the harbour.
    label
        Label of the paper's figure, such as ``12a``; empty if the paper has no such figure.
    beside
        Function that makes the words below the figure.
    """

    scenario: int | None = None
    label: str = ""
    beside: Callable[[Material], Sequence[Block]] = _no_blocks

    @property
    def number(self) -> int:
        """Number of the paper's figure; 0 if there is none."""
        return int(self.label.rstrip("ab") or 0)


# --- The sea and the harbour ---------------------------------------------------------------------


def plot_waves(records: Mapping[str, Record], theme: ThemeName = "light") -> Sequence[Axes]:
    """Inclination of the platform in several seas, side by side on equal scales."""
    with use(theme):
        figure = new_figure(9.4, 5.2)
        grid = figure.subplots(3, len(records), sharex=True, sharey=True, squeeze=False)
    for column, (title, record) in enumerate(records.items()):
        plots.plot_inclination(record, list(grid[:, column]), theme=theme)
        grid[0, column].set_title(title, loc="left")
        if column:
            for panel in grid[:, column]:
                panel.set_ylabel("")
    reach = max(
        float(np.abs(np.rad2deg(recorded(r, "platform.attitude"))).max()) for r in records.values()
    )
    grid[0, 0].set_ylim(-1.1 * reach, 1.1 * reach)
    return list(grid.flat)


def _seas(material: Material) -> tuple[dict[str, Record]]:
    return ({
        f"{word}: Beaufort {b}, wave height {LEVELS[b].wave_height:g} m": material.seas[b]
        for word, b in zip("ab", SEAS, strict=True)
    },)


def _sea_text(material: Material) -> list[Block]:
    parts = []
    for beaufort in SEAS:
        angles = np.rad2deg(recorded(material.seas[beaufort], "platform.attitude"))
        roll, pitch, yaw = np.sqrt((angles**2).mean(axis=0))
        parts.append(f"Beaufort {beaufort}: roll {roll:.1f}°, pitch {pitch:.1f}°, yaw {yaw:.1f}°")
    return [Text(f"Ours: RMS of the angles at {'; '.join(parts)}. The paper prints no angles, nor "
                 "amplitudes, frequencies and phases of its waves.")]


def _session(material: Material) -> tuple[Record, dict[str, pd.DataFrame]]:
    tracks = material.session.tracks
    return material.session.record, {"EKF": tracks["ekf"], "raw": tracks["multilateration"]}


def _session_text(material: Material) -> list[Block]:
    sessions = material.numbers.sessions["square"]
    square = sessions.iloc[0]
    return [Text(f"Ours: session 1 of {len(sessions)}, a square. Its mean total error is "
                 f"{square[f'ekf.{MEAN}']:.2f} m for the EKF (line) and "
                 f"{square[f'multilateration.{MEAN}']:.2f} m for the raw fix (dots). The paper "
                 "does not say which of its sessions it shows.")]


# --- The run at the favourable point -------------------------------------------------------------


def _path(n: int, material: Material) -> tuple[Record, dict[str, pd.DataFrame]]:
    return material.points[n].record, {}


def _track(n: int, material: Material) -> tuple[Record, dict[str, pd.DataFrame]]:
    return material.points[n].record, {"EKF": material.points[n].tracks["ekf"]}


_NOT_GIVEN = {
    1: "The paper does not give its centre or its first point.",
    2: "The paper does not give radius, turns and length.",
    3: "The paper does not say how it draws its random path. Ours has straight legs of random "
    "lengths and directions.",
}


def _path_text(n: int, material: Material) -> list[Block]:
    return [Text(f"Ours: the true path. {_NOT_GIVEN[n]}")]


def _point_text(n: int, material: Material) -> list[Block]:
    table, _ = facts_of_errors(n)
    return [Text(f"Ours: one run at the favourable point of Table {table}, the first of "
                 f"{len(material.numbers.points[n])}. The paper does not say which run it shows.")]


def _errors_text(n: int, material: Material) -> list[Block]:
    table, theirs = facts_of_errors(n)
    ours = material.numbers.points[n].iloc[0][f"ekf.{TOTAL}"]
    what = f"Table {table}, e_tot [m]; ours: RMS error of this run"
    return [
        *_point_text(n, material),
        compared("Total error", [row(what, theirs["total"], ours)]),
    ]


# --- The studies ---------------------------------------------------------------------------------


def _factors(n: int, findings: Findings) -> Block:
    return factors(n, findings.data)


def _interactions(n: int, findings: Findings) -> Block:
    """The largest interactions."""
    a = findings.shown
    ranked = a.ranked()
    several = ranked[ranked["order"] == 2]
    top = [
        f"{name} ({signed(effect['effect'])}{factorial.unit(a)}, "
        f"{interval(effect['low'], effect['high'], signed)})"
        for name, effect in several.head(3).iterrows()
    ]
    gps = findings.study.labels["gps"]
    names = several.index[several["significant"].astype(bool)]
    with_gps = [name for name in names if gps in str(name).split(INTERACTION_SIGN)]
    return Text(
        f"Ours: the largest are {'; '.join(top)}. {gps} has {len(with_gps)} significant "
        f"interactions. The paper prints no sizes."
    )


def _better_levels(n: int, findings: Findings) -> Block:
    return Text(factorial.direction(findings.shown))


def _residuals(n: int, findings: Findings) -> Block:
    """Residuals and fit of the model, in words."""
    a = findings.shown
    residuals = a.residuals
    skewness, kurtosis = (float(f(residuals["residual"])) for f in (stats.skew, stats.kurtosis))
    r2, adjusted, predicted = (
        percent(r2, ".1f") for r2 in (a.r2, a.r2_adjusted, a.r2_predicted)
    )
    text = (f"Ours: R² {r2}, adjusted {adjusted}, predicted {predicted}; "
            f"skewness of the residuals {skewness:.2g}, excess kurtosis "
            f"{kurtosis:.2g} (normal: 0).")
    if residuals["fit"].corr(residuals["residual"].abs(), method="spearman") > UNEVEN:
        text += (" The residuals scatter more where the fitted value is larger, so the intervals "
                 "in metres are an average over the points. The ratios below come from the "
                 "logarithm and suffer less from it.")
    return Text(unbroken(text))


# --- The table -----------------------------------------------------------------------------------


def _figure(
    label: str,
    plot: Callable[..., Any],
    data: Callable[[Material], tuple[Any, ...]],
    beside: Callable[[Material], Sequence[Block]],
) -> PaperFigure:
    """A drawing beside a figure of the paper, with the paper's words as its caption."""
    figure = label.rstrip("ab")
    words = facts_of_figure(int(figure))["shows"] + (f" ({label[-1]})" if label != figure else "")
    return PaperFigure(
        name=f"figure-{label}", label=label, plot=plot, data=data, beside=beside,
        caption=lambda _: f"Ours, as Figure {figure}: {words}",
        alt=lambda _: f"Ours: {words}",
    )


def _of_point(
    n: int,
    label: str,
    plot: Callable[..., Any],
    data: Callable[[int, Material], tuple[Any, ...]],
    beside: Callable[[int, Material], Sequence[Block]],
) -> PaperFigure:
    """A drawing of the run at the favourable point of a scenario."""
    figure = _figure(label, plot, partial(data, n), partial(beside, n))
    return replace(figure, scenario=n)


def _of_study(
    n: int, kind: str, label: str = "", beside: Callable[[int, Findings], Block] | None = None
) -> PaperFigure:
    """A drawing of a scenario's study: a row of `two_level_figures.FIGURES`."""
    figure = STUDY_FIGURES[kind]
    prefix = f"Ours, as Figure {label}: " if label else ""

    def findings_of(material: Material) -> Findings:
        return material.numbers.findings[n]

    return PaperFigure(
        name=f"figure-{label}" if label else f"scenario-{n}-{kind.replace('_', '-')}",
        scenario=n,
        label=label,
        plot=figure.plot,
        data=lambda material: figure.data(findings_of(material)),
        caption=lambda material: prefix + figure.caption(findings_of(material)),
        alt=lambda material: figure.alt(findings_of(material)),
        condition=lambda material: figure.condition(findings_of(material)),
        beside=lambda material: [beside(n, findings_of(material))] if beside else [],
    )


FIGURES: Mapping[str, PaperFigure] = by_name(
    # drawn in this order, the slow ones first
    _of_study(1, "interactions", "16", _interactions),
    _of_study(1, "residuals", "18", _residuals),
    _of_study(1, "pareto", "15", _factors),
    _of_study(1, "main_effects", "17", _better_levels),
    _of_study(1, "box_cox"),
    _of_study(2, "interactions", "23", _interactions),
    _of_study(2, "residuals"),
    _of_study(2, "pareto", "22", _factors),
    _of_study(2, "main_effects", "24", _better_levels),
    _of_study(2, "box_cox"),
    _of_study(3, "interactions", "29", _interactions),
    _of_study(3, "residuals"),
    _of_study(3, "pareto", "28", _factors),
    _of_study(3, "main_effects", "30", _better_levels),
    _of_study(3, "box_cox"),
    _of_point(1, "12a", plots.plot_path, _path, _path_text),
    _of_point(1, "12b", plots.plot_path_3d, _path, _path_text),
    _of_point(1, "13", plots.plot_axes, _track, _point_text),
    _of_point(1, "14", plots.plot_errors, _track, _errors_text),
    _of_point(2, "19a", plots.plot_path, _path, _path_text),
    _of_point(2, "19b", plots.plot_path_3d, _path, _path_text),
    _of_point(2, "20", plots.plot_axes, _track, _point_text),
    _of_point(2, "21", plots.plot_errors, _track, _errors_text),
    _of_point(3, "25", plots.plot_path_3d, _path, _path_text),
    _of_point(3, "26", plots.plot_axes, _track, _point_text),
    _of_point(3, "27", plots.plot_errors, _track, _errors_text),
    _figure("11", plots.plot_path, _session, _session_text),
    _figure("9", plot_waves, _seas, _sea_text),
)


# --- Drawing -------------------------------------------------------------------------------------


@contextmanager
def painters(workers: int | None) -> Iterator[Executor | None]:
    """Processes that draw; None on one core. They start early, as that takes a second or two."""
    count = min(workers or os.cpu_count() or 1, 4)
    if count == 1:
        yield None
        return
    with processes(count) as pool:
        with deferring_signals():
            for _ in range(count):
                pool.submit(factorial.get_ready)
        yield pool


def draw(material: Material, pool: Executor | None, tell: Progress) -> dict[str, str]:
    """The SVG texts of the figures, by name."""
    jobs = jobs_of(FIGURES, material)
    results = (
        map(Job.svg, jobs) if pool is None
        else map(stopping.result, [pool.submit(Job.svg, job) for job in jobs])
    )
    drawings: dict[str, str] = {}
    for i, (job, svg) in enumerate(zip(jobs, results, strict=True), 1):
        drawings[job.name] = svg
        tell(0.6 + 0.37 * i / len(jobs), "drawing")
    return drawings
