"""The analysis that a study's design asks for, from its folder of results."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TypedDict

import numpy as np
import pandas as pd
from sblcosim.fmus.stopping import interruptible

from ..errors import ConfigurationError
from ..results.responses import unit_of
from ..study import store
from ..study.study import Study, study_of
from .common.columns import RESPONSE, column_of, in_choices, needed, words
from .common.conditions import of_choices
from .common.options import Error, Transform
from .levels.analysis import GeneralFactorial, judged
from .levels.analysis import analyse as analyse_levels
from .space.analysis import Sensitivity
from .space.analysis import of_table as of_sample
from .two_level.analysis import Factorial, analyse

FACTORIAL = ("full", "fraction")
"""Kinds of designs that have effects."""


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
    """Analyse the runs in a folder of results; see `sblcosim.analysis.two_level.analysis.analyse`.

    Tables have the names of columns. Texts and figures have the study's labels.

    Parameters
    ----------
    response
        A column of the table of runs, without the receiver's name.
    receiver
        Receiver of the response; default: the first.

    Raises
    ------
    ConfigurationError
        There are no runs, there is no such receiver or response, or the design has no effects.
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
    """Like `of_study`, for a study and its runs."""
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
    """Analyse a design of any levels; see `sblcosim.analysis.levels.analysis.analyse`.

    The runs of all conditions are first combined. Receivers may be a factor.
    """
    column = column_of(table, response, receiver)
    chosen = of_choices(study, table, column)
    analysis = analyse_levels(
        chosen.table, chosen.factors, chosen.response,
        order=min(2, len(chosen.factors)) if order is None else order, transform=transform,
        seeding=study.seeding,
        levels={name: study.factors[name].values for name in chosen.factors},
        labels={name: study.labels[name] for name in chosen.factors},
        units={name: study.units[name] for name in chosen.factors},
        label=words(column, table, of_all=study.receiver_factor is not None),
        unit=unit_of(column), practical=practical,
    )  # fmt: skip
    return _with_worst_run(analysis, study, table, column)


def _with_worst_run(
    analysis: GeneralFactorial, study: Study, table: pd.DataFrame, column: str
) -> GeneralFactorial:
    """A copy with the run that has the largest response of any receiver that is a level."""
    if "run_id" not in table:
        return analysis
    own = column.partition(".")[2]
    columns = [column] if study.receiver_factor is None else [
        name for name in table.columns if name.partition(".")[2] == own
    ]
    values = table[columns].to_numpy(np.float64, na_value=np.nan)
    each = np.where(np.isfinite(values), values, -np.inf).max(axis=1)
    row = int(each.argmax())
    worst = str(table["run_id"].iloc[row])
    # Combined runs have a smaller maximum, so medians may now come first.
    return judged(replace(analysis, largest=float(each[row]), worst_run=worst))


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
        Default: the logarithm for simulations, none for the values of a function.
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
        replace(sobol, label=words(sobol.response, table))
        for sobol in of_sample(study.sample, runs, column, transform=transform)
    )
