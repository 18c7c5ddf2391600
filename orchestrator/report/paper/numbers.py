"""The paper's numbers and ours: the facts of the paper, statistics of the runs, and comparisons."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from ...analysis.space.analysis import Sensitivity
from ...analysis.two_level.ranking import ranking
from ...judge.definitions import AXES
from ...study.study import Study
from ...words.numbers import interval, number
from ...words.shares import percent
from .. import two_level as factorial
from ..page import PageTable
from ..two_level import Findings
from . import ranges
from .campaigns import SCENARIOS, SESSIONS, Progress

PRACTICAL = 0.5
"""Default of the smallest effect that matters [m]: about half of the paper's errors."""
NEAR = 0.10
"""Relative difference up to which numbers agree."""
TOTAL, MEAN = "absolute_total_rms_m", "absolute_total_mean_m"
HEAD = ("Quantity", "Paper", "Ours", "95 % interval", "Ratio", "Ours is")


@cache
def facts() -> dict[str, Any]:
    """What the paper states."""
    text = (resources.files(__package__) / "paper.toml").read_text("utf-8")
    return tomllib.loads(text)


def facts_of_figure(number: int) -> Mapping[str, Any]:
    """What the paper says of a figure."""
    figures: list[Mapping[str, Any]] = facts()["figure"]
    return next(figure for figure in figures if figure["number"] == number)


def facts_of_errors(n: int) -> tuple[int, Mapping[str, float]]:
    """Number and content of the paper's table of errors in a scenario."""
    return n + 3, facts()[f"table{n + 3}"]


@dataclass(frozen=True, eq=False)
class PaperNumbers:
    """All runs and their analyses, by scenario or session."""

    studies: Mapping[int, Study]
    runs: Mapping[int, pd.DataFrame]
    findings: Mapping[int, Findings]
    points: Mapping[int, pd.DataFrame]
    sessions: Mapping[str, pd.DataFrame]
    indices: Mapping[int, tuple[Sensitivity, ...]]


def analyse(
    studies: Mapping[str, Study], tables: Mapping[str, pd.DataFrame], practical: float,
    tell: Progress,
) -> PaperNumbers:
    """Analyse the three studies; `practical` is the smallest effect that matters [m]."""
    three, findings = {n: studies[f"paper-scenario-{n}"] for n in SCENARIOS}, {}
    for n, study in three.items():
        tell(0.5 + 0.03 * n, "analysing")
        table = tables[f"paper-scenario-{n}"]
        findings[n] = factorial.find(study, table, practical=practical)
    return PaperNumbers(
        three,
        {n: tables[f"paper-scenario-{n}"] for n in SCENARIOS},
        findings,
        {n: tables[f"favourable-{n}"] for n in SCENARIOS},
        {name: tables[f"harbour-{name}"] for name in SESSIONS},
        {n: ranges.indices(studies[f"ranges-{n}"], tables[f"ranges-{n}"]) for n in SCENARIOS},
    )


# --- Statistics ----------------------------------------------------------------------------------


def pooled(table: pd.DataFrame, receiver: str) -> tuple[float, float]:
    """Mean and standard deviation of the total error over all samples of all runs [m]."""
    weight = table[f"{receiver}.estimates"]
    mean = float((weight * table[f"{receiver}.{MEAN}"]).sum() / weight.sum())
    square = float((weight * table[f"{receiver}.{TOTAL}"] ** 2).sum() / weight.sum())
    return mean, (square - mean**2) ** 0.5


def pooled_intervals(
    table: pd.DataFrame, receiver: str
) -> tuple[tuple[float, float], tuple[float, float]]:
    """95 % intervals of what `pooled` gives, from the scatter between runs (the jackknife)."""
    weight = table[f"{receiver}.estimates"].to_numpy(np.float64)
    sums = np.stack([
        weight,
        weight * table[f"{receiver}.{MEAN}"].to_numpy(),
        weight * table[f"{receiver}.{TOTAL}"].to_numpy() ** 2,
    ])
    sums = sums[:, weight > 0]
    count = sums.shape[1]
    without = sums.sum(axis=1, keepdims=True) - sums
    mean = without[1] / without[0]
    left_out = np.stack([mean, np.sqrt(without[2] / without[0] - mean**2)])
    error = np.sqrt((count - 1) * left_out.var(axis=1))
    reach = float(stats.t.ppf(0.975, count - 1)) * error
    first, second = (
        (value - r, value + r) for value, r in zip(pooled(table, receiver), reach, strict=True)
    )
    return first, second


def average(table: pd.DataFrame, column: str) -> tuple[float, float, float]:
    """Mean over the runs, and its 95 % interval."""
    values = table[column].dropna()
    reach = float(stats.t.ppf(0.975, len(values) - 1)) * float(values.std()) / len(values) ** 0.5
    mean = float(values.mean())
    return mean, mean - reach, mean + reach


def overall(table: pd.DataFrame, column: str) -> tuple[float, float, float]:
    """Mean over all points of a balanced study, and its 95 % interval from the points' scatter."""
    groups = table.groupby("point")[column]
    mean = float(groups.mean().mean())
    error = float(np.sqrt((groups.var() / groups.size()).sum())) / groups.ngroups
    reach = float(stats.norm.ppf(0.975)) * error
    return mean, mean - reach, mean + reach


# --- Comparisons ---------------------------------------------------------------------------------


def verdict(ratio: float) -> str:
    """Whether two numbers agree, in a word or two."""
    if abs(ratio - 1) < 1e-9:
        return "equal"
    if abs(ratio - 1) <= NEAR:
        return f"within {percent(NEAR, '.0f')}"
    if ratio > 2:
        return f"{ratio:.2g} times the paper's"
    return f"{percent(abs(ratio - 1), '.0f')} {'above' if ratio > 1 else 'below'}"


def row(what: str, theirs: float, ours: float, interval: str = "–") -> tuple[str, ...]:
    """A row of `compared`: a number of the paper and ours."""
    ratio = ours / theirs
    return what, number(theirs), number(ours), interval, f"{ratio:.2f}", verdict(ratio)


def row_with_interval(
    what: str, theirs: float, ours: tuple[float, float, float]
) -> tuple[str, ...]:
    """As `row`; ours is a mean and its interval."""
    mean, low, high = ours
    return row(what, theirs, mean, interval(low, high, number))


def compared(caption: str, rows: Sequence[Sequence[str]], note: str = "") -> PageTable:
    """The paper's numbers and ours; without intervals if there are none."""
    head: Sequence[str] = HEAD
    if all(cells[3] == "–" for cells in rows):
        rows, head = [(*cells[:3], *cells[4:]) for cells in rows], (*HEAD[:3], *HEAD[4:])
    return PageTable(caption, head, rows, (len(head) - 1,), note)


def session_rows(
    table: pd.DataFrame, receiver: str, theirs: Sequence[float], what: str, unit: str = ""
) -> list[tuple[str, ...]]:
    """Rows of Table 2 for a receiver on a path: mean and standard deviation."""
    return [
        row(f"{what}: {word}{unit}", known, ours, interval(*ends, number))
        for word, known, ours, ends in zip(
            ("mean", "standard deviation"), theirs, pooled(table, receiver),
            pooled_intervals(table, receiver), strict=True,
        )
    ]


def error_rows(
    n: int, numbers: PaperNumbers
) -> tuple[list[tuple[str, ...]], list[tuple[str, ...]]]:
    """Rows of a scenario's table of errors: of the favourable point, and of all points."""
    _, table = facts_of_errors(n)
    point, whole = [], []
    for axis in (*AXES, "total"):
        column = f"ekf.absolute_{axis}_rms_m"
        name = "e_tot" if axis == "total" else f"e_{axis}"
        ours = average(numbers.points[n], column)
        point.append(row_with_interval(f"{name} [m]", table[axis], ours))
        ours = overall(numbers.runs[n], column)
        whole.append(row_with_interval(f"{name} [m]", table[axis], ours))
    ours = average(numbers.points[n], "ekf.relative_total_rms_m")
    label = "e_tot [m], relative to the platform as it reports itself"
    point.append(row_with_interval(label, table["total"], ours))
    return point, whole


def order_row(n: int, findings: Findings) -> tuple[str, ...]:
    """The paper's most influential factors and ours, in words."""
    labels = findings.study.labels
    named = [labels[name] for name in facts()["order"][str(n)]["named"]]
    ranks = ranking(findings.shown)
    groups: dict[str, list[str]] = {}
    for name, rank in ranks.items():
        groups.setdefault(rank, []).append(name)
    shown, count = [], 0
    for same in groups.values():
        if count >= len(named):
            break
        shown.append(same[0] if len(same) == 1 else f"({', '.join(same)})")
        count += len(same)
    first = list(ranks)[:count]
    if not set(named) <= set(first):
        missing = ", ".join(name for name in named if name not in first)
        return f"{n}", ", ".join(named), ", ".join(shown), f"differs: {missing} is further down"
    text = "agrees"
    if extra := [name for name in first if name not in named]:
        text += f"; {', '.join(extra)} cannot be told from the last of them"
    return f"{n}", ", ".join(named), ", ".join(shown), text
