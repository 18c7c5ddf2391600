"""Runs as an analysis of choices needs them: conditions put together, receivers as a factor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from ...study.definition import Definition

BETTER_IF_LARGE = ("availability",)
"""Responses of which the worst is the smallest."""


@dataclass(frozen=True, eq=False)
class RunsOfChoices:
    """A row for each run of a choice: of all conditions together, with one receiver.

    Attributes
    ----------
    table
        ``point`` (of the design without its conditions) and ``replicate``, the factors, the
        response, and ``lost`` (share of the runs in the row, if known).
    factors
        Names of all factors, that of the receivers among them.
    response
        Column of the response.
    """

    table: pd.DataFrame
    factors: tuple[str, ...]
    response: str


def of_choices(study: Definition, table: pd.DataFrame, column: str) -> RunsOfChoices:
    """Put the runs of all conditions together, and let the receivers be a factor if they are one.

    What counts of the conditions is their average or the worst, as each of them says; a run that is
    missing in one of them is missing altogether.

    Parameters
    ----------
    table
        Of runs.
    column
        ``RECEIVER.RESPONSE``; if the receivers are a factor, of any of them.
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
    # Averages first: what must hold in all conditions must hold on the average of the others.
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
    """One row for each group of rows, which agree in some columns; missing where one of them is."""
    groups = table.groupby([*by], sort=False)
    made = groups[[*same]].first() if same else groups.size().to_frame()[[]]
    for value in values:
        made[value] = groups[value].agg(how if value == response else "mean")
        made.loc[groups[value].count() < groups.size(), value] = np.nan
    return made.reset_index()
