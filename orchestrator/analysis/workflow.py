"""From a study's results to the answer: which factor matters, as tables and pictures."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
import pandas as pd
from sblcosim.fmus.stopping import interruptible

from .. import artifacts, style
from ..errors import ConfigurationError, nearest, quoted
from ..results.consistency import NEES_COLUMNS
from ..results.responses import (
    ALL_PERCENTILES,
    ON_REQUEST,
    PERCENTILES,
    RESPONSES,
    readable,
    unit_of,
)
from ..scenario.reading import parse, read_text, shown
from ..study import store
from ..study.batch import VALUE
from ..study.design import Level
from ..study.parts import Wanted
from ..study.study import Study, study_of
from . import figures
from .advice import PERCENTILE, Advice, advise
from .conditions import of_choices
from .costs import of_levels
from .factorial import Factorial, analyse
from .general import GeneralFactorial, judged
from .general import analyse as analyse_levels
from .options import Error, Transform
from .sensitivity import Sensitivity
from .sensitivity import of_table as of_sample

RESPONSE = "absolute_total_rms_m"
"""RMS of the total error, as in the paper."""


ALWAYS = (*NEES_COLUMNS.values(), RESPONSE, "inconsistent", "lost")
"""Responses of each receiver that a report shows, whatever is analysed."""


def default_response(study: Study) -> str:
    """What is analysed if nobody says."""
    return RESPONSE if study.model is None else VALUE


class AnalysisOptions(TypedDict, total=False):
    """Options of `of_study` that have defaults."""

    receiver: str | None
    order: int | None
    transform: Transform
    error: Error
    practical: float | None


def of_study(
    results: str | Path,
    response: str = RESPONSE,
    *,
    receiver: str | None = None,
    order: int | None = None,
    transform: Transform = "none",
    error: Error = "pure",
    practical: float | None = None,
) -> Factorial:
    """Analyse the runs in a folder of results; see `sblcosim.analysis.factorial.analyse`.

    The tables have the columns' names; what is printed or drawn has the study's labels.

    Parameters
    ----------
    response
        A column of the table of runs, without the receiver's name.
    receiver
        Receiver of the response; default: the first.

    Raises
    ------
    ConfigurationError
        There are no runs, no such receiver or response, or the design cannot be analysed so.
    """
    study = study_of(results)
    table = store.table(results, needed(study, response, receiver))
    return of_table(
        study, table, response, receiver=receiver, order=order, transform=transform, error=error,
        practical=practical,
    )


@interruptible
def of_table(
    study: Study,
    table: pd.DataFrame,
    response: str = RESPONSE,
    *,
    receiver: str | None = None,
    order: int | None = None,
    transform: Transform = "none",
    error: Error = "pure",
    practical: float | None = None,
) -> Factorial:
    """As `of_study`, for a study and its runs."""
    if study.design.kind not in FACTORIAL:
        raise ConfigurationError(
            f"{study.name}: must be a two-level factorial design ({' or '.join(FACTORIAL)}) for an "
            f"analysis of effects, got kind {study.design.kind!r}"
        )
    column = column_of(table, response, receiver)
    chosen = in_choices(study, table, column)
    analysis = analyse(
        chosen, list(study.factors), column, order=order, transform=transform, error=error,
        practical=practical, seeding=study.seeding, unit=unit_of(column),
    )
    return replace(
        analysis, units=study.units, labels=study.labels, label=words(column, table)
    )


def of_grid(
    study: Study,
    table: pd.DataFrame,
    response: str = RESPONSE,
    *,
    receiver: str | None = None,
    order: int | None = None,
    transform: Transform = "none",
    practical: float | None = None,
) -> GeneralFactorial:
    """Analyse a design of any levels; see `sblcosim.analysis.general.analyse`.

    Conditions are put together first, and receivers that are a factor are one here.
    """
    column = column_of(table, response, receiver)
    chosen = of_choices(study, table, column)
    found = analyse_levels(
        chosen.table, chosen.factors, chosen.response,
        order=min(2, len(chosen.factors)) if order is None else order, transform=transform,
        seeding=study.seeding,
        levels={name: study.factors[name].values for name in chosen.factors},
        labels={name: study.labels[name] for name in chosen.factors},
        units={name: study.units[name] for name in chosen.factors},
        label=words(column, table, of_all=study.receiver_factor is not None),
        unit=unit_of(column), practical=practical,
    )  # fmt: skip
    return _with_worst_run(found, study, table, column)


def _with_worst_run(
    found: GeneralFactorial, study: Study, table: pd.DataFrame, column: str
) -> GeneralFactorial:
    """The same with the run that has the largest response, of any receiver that is a level."""
    if "run_id" not in table:
        return found
    own = column.partition(".")[2]
    columns = [column] if study.receiver_factor is None else [
        name for name in table.columns if name.partition(".")[2] == own
    ]
    values = table[columns].to_numpy(np.float64, na_value=np.nan)
    each = np.where(np.isfinite(values), values, -np.inf).max(axis=1)
    row = int(each.argmax())
    worst = str(table["run_id"].iloc[row])
    # Of runs put together the largest is less: whether medians stand first can change with it.
    return judged(replace(found, largest=float(each[row]), worst_run=worst))


def of_space(
    study: Study,
    table: pd.DataFrame,
    response: str = RESPONSE,
    *,
    receiver: str | None = None,
    transform: Transform | None = None,
) -> tuple[Sensitivity, ...]:
    """Sobol' indices of a response, and of whether its receiver is lost.

    Parameters
    ----------
    transform
        None: the logarithm of what is simulated, and what a function returns as it is.
    """
    assert study.sample is not None
    column = column_of(table, response, receiver)
    if transform is None:
        positive = bool((table[column].dropna().to_numpy(np.float64) > 0).all())
        transform = "log" if study.model is None and positive else "none"
    if transform == "spread":
        raise ConfigurationError("transform: must be none or log for a space, got 'spread'")
    runs = table
    if study.conditions:  # which share the seeds of the sample
        lost = {"lost": f"{column.partition('.')[0]}.lost"}
        runs = in_choices(study, table, column).rename(columns=lost)
        runs["seed"] = study.sample.seeds[runs["point"].to_numpy(np.int64) - 1]
    return tuple(
        replace(found, label=words(found.response, table))
        for found in of_sample(study.sample, runs, column, transform=transform)
    )


FACTORIAL = ("full", "fraction")
"""Kinds of designs that have effects."""


def needed(study: Study, response: str = RESPONSE, receiver: str | None = None) -> Wanted:
    """Choose the columns that analyses and reports of a response need.

    Raises
    ------
    ConfigurationError
        When it chooses: there is no such receiver or response.
    """
    own = ("point", "replicate", "run_order", "seed", "error", *study.varied,
           *(["run_id"] if study.design.kind == "grid" else []))

    def chosen(names: Sequence[str]) -> list[str]:
        asked = _named(names, response, receiver).partition(".")[2]  # of all, to compare them
        return [
            name for name in names
            if name in own or name.partition(".")[2] in (*ALWAYS, asked)
        ]

    return chosen


def column_of(table: pd.DataFrame, response: str = RESPONSE, receiver: str | None = None) -> str:
    """Column of a response in a table of runs.

    Raises
    ------
    ConfigurationError
        There is no such receiver or response, or it is unknown in all runs.
    """
    column = _named(list(table.columns), response, receiver)
    if table[column].isna().all():
        chosen, _, response = column.partition(".")
        needs = RESPONSES[response].needs if response in RESPONSES else ""
        why = f"; no estimate of {chosen} has a {needs}" if needs else ""
        raise ConfigurationError(f"{column}: must be known in some runs, got none{why}")
    return column


def _named(names: Sequence[str], response: str, receiver: str | None) -> str:
    """Column of a response among the names of all columns."""
    responses = [c for c in names if "." in c]
    receivers = list(dict.fromkeys(c.partition(".")[0] for c in responses))
    owner, _, own = response.partition(".")
    if own and owner in receivers and receiver in (None, owner):
        receiver, response = owner, own  # named as in the table
    chosen = receivers[0] if receiver is None else receiver
    if chosen not in receivers:
        raise ConfigurationError(
            f"receiver: must be {', '.join(receivers)}, got {quoted(chosen)}"
            + nearest(chosen, receivers)
        )
    known = [c.partition(".")[2] for c in responses if c.startswith(f"{chosen}.")]
    if response not in known:
        raise ConfigurationError(
            f"response: must be a column of the table of runs without its receiver, got "
            f"{quoted(response)}{_hint(response, known)}; docs/reference/results.md lists all"
        )
    return f"{chosen}.{response}"


def _hint(response: str, known: Sequence[str]) -> str:
    """What was meant, or how a study gets percentiles."""
    other = re.search(r"_p\d+(_|$)|percentile", response) and not PERCENTILES.keys() & {*known}
    if response not in ON_REQUEST and not other:
        default = f"absolute_{response}"  # as a question names it
        return f"; did you mean {default!r}?" if default in known else nearest(response, known)
    asked = response if response in ON_REQUEST else ALL_PERCENTILES
    return f"; this study has none, its file must say responses = [\"{asked}\"] for it"


def in_choices(study: Study, table: pd.DataFrame, column: str) -> pd.DataFrame:
    """The runs with a column of numbers; those of all conditions put together."""
    if study.conditions:
        return of_choices(study, table, column).table
    return in_numbers(table, column)


def in_numbers(table: pd.DataFrame, column: str) -> pd.DataFrame:
    """The same table with a column of numbers, NaN where a value is missing."""
    return table.assign(**{column: table[column].to_numpy(np.float64, na_value=np.nan)})


def words(column: str, table: pd.DataFrame, *, of_all: bool = False) -> str:
    """A response for people to read, with its receiver if there are several, but ``of_all``."""
    receiver, _, response = column.partition(".")
    known = RESPONSES.get(response)
    text = readable(response) if known is None else known.words
    several = len({c.partition(".")[0] for c in table.columns if "." in c}) > 1
    return f"{text} of {receiver}" if several and not of_all else text


def readable_advice(advice: Advice, results: str | Path) -> Advice:
    """The same with the labels of the study in a folder of results."""
    study = study_of(results)
    if "." in advice.response:
        text = words(advice.response, store.table(results, needed(study, advice.response)))
    else:  # of any receiver, where the receivers are a factor
        known = RESPONSES.get(advice.response)
        text = readable(advice.response) if known is None else known.words
    return advice.named(study.labels, text)


def advice_on_study(
    results: str | Path,
    costs: str | Path | Mapping[str, Any],
    response: str = RESPONSE,
    *,
    receiver: str | None = None,
    limit: float | None = None,
    percentile: float | None = PERCENTILE,
    contamination: float = 0.05,
    confidence: float = 0.95,
) -> Advice:
    """Which design is the cheapest that is good enough; see `sblcosim.analysis.advice.advise`.

    Runs in which the receiver is *lost* count as such.

    Parameters
    ----------
    costs
        By factor: the cost of each of its levels, in the order of the study or by name; a TOML
        file (``gps = [900, 40]``) or a mapping.

    Raises
    ------
    ConfigurationError
        As `of_study`; or the costs do not fit the study.
    """
    study = study_of(results)
    table = store.table(results, needed(study, response, receiver))
    prices = _prices(study, costs)
    points = table[~table["point"].isin(_centre(study))]
    column = column_of(table, response, receiver)
    chosen = of_choices(study, points, column)
    return advise(
        chosen.table, chosen.factors, chosen.response, prices, limit=limit,
        percentile=percentile, contamination=contamination, confidence=confidence,
        unit=unit_of(column), lost="lost" if "lost" in chosen.table else None,
    )


def _prices(
    study: Study, costs: str | Path | Mapping[str, Any]
) -> dict[str, dict[Level, float]]:
    """Cost of each level by factor, from a file or a mapping."""
    where, given = ("costs", dict(costs)) if isinstance(costs, Mapping) else _read(Path(costs))
    for name in given:
        if name not in study.factors:
            raise ConfigurationError(
                f"{where}: must be costs of factors of the study, got {quoted(name)}"
                f"{nearest(str(name), study.factors)}"
            )
    return {
        name: of_levels(f"{where}: {name}", values, study.factors[name].values)
        for name, values in given.items()
    }


def _centre(study: Study) -> list[int]:
    """Numbers of the centre points."""
    return [number for number, centre in enumerate(study.points.centre, 1) if centre]


def _read(path: Path) -> tuple[str, dict[str, Any]]:
    return shown(path), parse(shown(path), read_text(path, (), "costs"))


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
