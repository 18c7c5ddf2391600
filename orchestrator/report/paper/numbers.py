"""The paper's numbers and ours: the facts of the paper, and statistics of the runs."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from ...analysis.space.analysis import Sensitivity
from ...study.study import Study
from .. import two_level as factorial
from ..two_level import Findings
from . import ranges
from .campaigns import SCENARIOS, SESSIONS, Progress

PRACTICAL = 0.5
"""Default of the smallest effect that matters [m]: about half of the paper's errors."""
TOTAL, MEAN = "absolute_total_rms_m", "absolute_total_mean_m"


@cache
def facts() -> dict[str, Any]:
    """All facts that the paper states."""
    text = (resources.files(__package__) / "paper.toml").read_text("utf-8")
    return tomllib.loads(text)


def facts_of_figure(number: int) -> Mapping[str, Any]:
    """The facts that the paper states about a figure."""
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
    """95 % intervals of the values of `pooled`, from the scatter between runs (the jackknife)."""
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
