"""Runs for an analysis of choices: conditions are combined, and receivers are a factor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from ...study.definition import Definition

BETTER_IF_LARGE = ("availability",)
"""Responses whose worst value is the smallest."""


@dataclass(frozen=True, eq=False)
class RunsOfChoices:
    """A row for each replicate of a choice, with all conditions combined and with one receiver.

    Attributes
    ----------
    table
        ``point`` (number in the design without its conditions) and ``replicate``, the factors, the
        response, and ``lost`` (share of lost runs in the row, if known).
    factors
        Names of all factors, including that of the receivers.
    response
        Column of the response.
    """

    table: pd.DataFrame
    factors: tuple[str, ...]
    response: str


def of_choices(study: Definition, table: pd.DataFrame, column: str) -> RunsOfChoices:
    """Combine the runs of all conditions, and make the receivers a factor if the study does.

    Each condition counts with its average or its worst value, as the study says. A run that is
    missing in one condition is missing in the result.

    Parameters
    ----------
    table
        Table of runs.
    column
        ``RECEIVER.RESPONSE``; if the receivers are a factor, the name of any of them.
    """
    receiver, _, response = column.partition(".")
    own = study.receiver_factor
    labels = [*dict.fromkeys(c.partition(".")[0] for c in table.columns if "." in c)]
    name = response if own is not None else column
    parts = []
    for label in [receiver] if own is None else labels:
        part = table[["point", "replicate", *study.varied]].copy()
        if own is not None:
            part[own] = label
        part[name] = table[f"{label}.{response}"].to_numpy(np.float64, na_value=np.nan)
        if f"{label}.lost" in table and response != "lost":
            part["lost"] = table[f"{label}.lost"].to_numpy(np.float64, na_value=np.nan)
        parts.append(part)
    long = pd.concat(parts, ignore_index=True)
    met = math.prod(len(c.values) for c in study.conditions.values())
    long["point"] = (long["point"] - 1) % (len(study.points.values) // met) + 1
    factors = [*study.factors]
    values = [c for c in (name, "lost") if c in long]
    worst = "min" if response in BETTER_IF_LARGE else "max"
    # Averages first: a limit for the worst condition applies to averages over the others.
    for combine, how in (("average", "mean"), ("all", worst)):
        gone = [n for n, c in study.conditions.items() if c.combine == combine]
        if gone:
            kept = [c for c in study.conditions if c in long and c not in gone]
            by = ["replicate", "point", *([] if own is None else [own]), *kept]
            long = _combined(long, by, [f for f in factors if f != own], values, name, how)
    return RunsOfChoices(long[["point", "replicate", *factors, *values]], tuple(factors), name)


def _combined(
    table: pd.DataFrame, by: Sequence[str], same: Sequence[str], values: Sequence[str],
    response: str, how: str,
) -> pd.DataFrame:
    """One row for each group of rows with equal columns; missing if one of the rows is."""
    groups = table.groupby([*by], sort=False)
    made = groups[[*same]].first() if same else groups.size().to_frame()[[]]
    for value in values:
        made[value] = groups[value].agg(how if value == response else "mean")
        made.loc[groups[value].count() < groups.size(), value] = np.nan
    return made.reset_index()
