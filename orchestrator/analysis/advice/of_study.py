"""Advice on a study, from its folder of results and the costs of its levels."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from ...errors import ConfigurationError, nearest, quoted
from ...results.responses import RESPONSES, readable, unit_of
from ...scenario.reading import parse, read_text, shown
from ...study import store
from ...study.design import Level
from ...study.study import Study, study_of
from ..common.columns import RESPONSE, column_of, needed, words
from ..common.conditions import of_choices
from .advice import PERCENTILE, Advice, advise
from .costs import of_levels


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
    """Find the cheapest design of a study that is good enough; see `advise`.

    A run counts as lost if the receiver is *lost* in it.

    Parameters
    ----------
    costs
        Cost of each level of each factor, in the order of the study or by name: a TOML file
        (``gps = [900, 40]``) or a mapping.

    Raises
    ------
    ConfigurationError
        For the reasons of `of_study`, or because the costs do not fit the study.
    """
    study = study_of(results)
    table = store.table(results, needed(study, response, receiver))
    prices = _prices(study, costs)
    points = table[~table["point"].isin(_centre(study))]
    column = column_of(table, response, receiver)
    chosen = of_choices(study, points, column)
    found = advise(
        chosen.table, chosen.factors, chosen.response, prices, limit=limit,
        percentile=percentile, contamination=contamination, confidence=confidence,
        unit=unit_of(column), lost="lost" if "lost" in chosen.table else None,
    )
    return found.labelled(study.labels, _label(found.response, table))


def _label(response: str, table: pd.DataFrame) -> str:
    """The response in words."""
    if "." in response:
        return words(response, table)
    known = RESPONSES.get(response)  # without a receiver if the receivers are a factor
    return readable(response) if known is None else known.words


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
