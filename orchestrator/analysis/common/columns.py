"""The columns of a table of runs that an analysis needs, and their descriptions."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import pandas as pd

from ...errors import ConfigurationError, nearest, quoted
from ...judge.consistency import NEES_COLUMNS
from ...results.responses import ALL_PERCENTILES, ON_REQUEST, PERCENTILES, RESPONSES, readable
from ...study.batch import VALUE
from ...study.parts import Wanted
from ...study.study import Study
from .conditions import of_choices

RESPONSE = "absolute_total_rms_m"
"""RMS of the total error, as in the paper."""


ALWAYS = (*NEES_COLUMNS.values(), RESPONSE, "inconsistent", "lost", "misleading")
"""Responses of each receiver that every report shows."""


def default_response(study: Study) -> str:
    """The response that is analysed by default."""
    return RESPONSE if study.model is None else VALUE


def needed(study: Study, response: str = RESPONSE, receiver: str | None = None) -> Wanted:
    """Choose the columns that analyses and reports of a response need.

    Raises
    ------
    ConfigurationError
        Raised when the columns are chosen: there is no such receiver or response.
    """
    own = ("point", "replicate", "run_order", "seed", "error", *study.varied,
           *(["run_id"] if study.design.kind == "grid" else []))

    def chosen(names: Sequence[str]) -> list[str]:
        asked = _named(names, response, receiver).partition(".")[2]  # for all receivers
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
    """Find the column of a response among all names of columns."""
    responses = [c for c in names if "." in c]
    receivers = list(dict.fromkeys(c.partition(".")[0] for c in responses))
    owner, _, own = response.partition(".")
    if own and owner in receivers and receiver in (None, owner):
        receiver, response = owner, own  # with the column's name in the table
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
    """The intended response, or how a study gets percentiles."""
    other = re.search(r"_p\d+(_|$)|percentile", response) and not PERCENTILES.keys() & {*known}
    if response not in ON_REQUEST and not other:
        default = f"absolute_{response}"  # the short name in a question
        return f"; did you mean {default!r}?" if default in known else nearest(response, known)
    asked = response if response in ON_REQUEST else ALL_PERCENTILES
    return f"; this study has none, for which its file must say responses = [\"{asked}\"]"


def in_choices(study: Study, table: pd.DataFrame, column: str) -> pd.DataFrame:
    """The runs with a column of numbers, with the runs of all conditions combined."""
    if study.conditions:
        return of_choices(study, table, column).table
    return in_numbers(table, column)


def in_numbers(table: pd.DataFrame, column: str) -> pd.DataFrame:
    """The table with a column as numbers, NaN where a value is missing."""
    return table.assign(**{column: table[column].to_numpy(np.float64, na_value=np.nan)})


def words(column: str, table: pd.DataFrame, *, of_all: bool = False) -> str:
    """A response in words, with its receiver if there are several, unless ``of_all``."""
    receiver, _, response = column.partition(".")
    known = RESPONSES.get(response)
    text = readable(response) if known is None else known.words
    several = len({c.partition(".")[0] for c in table.columns if "." in c}) > 1
    return f"{text} of {receiver}" if several and not of_all else text
