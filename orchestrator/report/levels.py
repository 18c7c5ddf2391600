"""The part of a study's report for a grid: factors with any number of levels."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from ..analysis.levels import sentences
from ..analysis.levels.analysis import FIGURES, GeneralFactorial
from ..judge.definitions import LOST
from ..study.study import Study
from ..words.numbers import interval, number, probability
from ..words.shares import percent
from .common import DEFINITIONS
from .page import PageTable, Text
from .parts import StudySections, pictures
from .two_level import factor_table

MOST_ROWS = 60
"""Most pairs of levels in a table of the page; the file has all."""


def parts(study: Study, analysis: GeneralFactorial, drawn: Path | None) -> StudySections:
    """Sentences, figures and tables of a grid; `drawn` is a folder with finished figures."""
    a = analysis.readable
    return StudySections(
        f"Which level is best: {study.name}",
        sentences.answer(a),
        sentences.warnings(a),
        pictures(FIGURES, a, drawn),
        [*([_medians(a), _means(a)] if a.by_medians else [_means(a), _medians(a)]), _pairs(a),
         _anova(a)],
        [*(Text(line) for line in sentences.notes(a)), Text(DEFINITIONS),
         Text(f"Settling time: {study.settling_time_s:g} s."), factor_table(study)],
        a.runs,
    )  # fmt: skip


def _level(a: GeneralFactorial, row: pd.Series, column: str) -> str:
    return sentences.level_text(row[column], a.units.get(str(row["factor"]), ""))


def _means(a: GeneralFactorial) -> PageTable:
    rows = [
        (str(row["factor"]), _level(a, row, "level"), number(row["mean"], 4),
         interval(row["low"], row["high"], number), number(row["runs"], 6),
         "–" if pd.isna(row["lost"]) else percent(row["lost"], ".3g"))
        for _, row in a.own_means.iterrows()
    ]  # fmt: skip
    head = ("Factor", "Level", a.mean_of, "Interval", "Runs", "Lost")
    return PageTable("Means of the levels", head, rows, (1,), LOST)


def _medians(a: GeneralFactorial) -> PageTable:
    rows = [
        (str(row["factor"]), _level(a, row, "level"), number(row["median"], 4),
         interval(row["low"], row["high"], number))
        for _, row in a.medians.iterrows()
    ]  # fmt: skip
    unit = f" [{a.measured_in}]" if a.measured_in else ""
    head = ("Factor", "Level", f"Median {a.response}{unit}", "Interval")
    note = ("Medians of all runs at the level. The intervals come from order statistics, assume "
            "nothing about the runs' distribution, and each hold for one level alone. The answer "
            "has wider intervals, which hold for all levels of a factor at once.")
    return PageTable("Medians of the levels", head, rows, (1,), note)


def _pairs(a: GeneralFactorial) -> PageTable:
    own = f" [{a.unit}]" if a.unit else ""
    by = "difference" if a.by_medians else "t"
    ordered = a.judged_pairs.sort_values(by, key=abs, ascending=False, kind="stable")
    ordered = ordered.head(MOST_ROWS)
    rows = [
        (str(row["factor"]), f"{_level(a, row, 'one')} less {_level(a, row, 'other')}",
         number(row["difference"], 4), interval(row["low"], row["high"], number),
         probability(row["p"]),
         *([] if a.practical is None else [sentences.verdict_text(row["verdict"], a)]))
        for _, row in ordered.iterrows()
    ]  # fmt: skip
    what = "Median difference within a replicate" if a.within_replicates else (
        f"Difference{' of medians' if a.by_medians else ''}")
    head = ("Factor", "Levels", f"{what}{own}", f"Simultaneous interval{own}",
            "p, adjusted", *([] if a.practical is None else ["Verdict"]))
    note = "" if len(ordered) == len(a.pairs) else (
        f"The {len(ordered)} clearest of {len(a.pairs)} pairs; pairs.csv has all."
    )
    return PageTable("Pairs of levels", head, rows, (1,), note)


def _anova(a: GeneralFactorial) -> PageTable:
    rows = [
        (str(source), number(row["df"]), number(row["sum_sq"], 4), number(row["mean_sq"], 4),
         number(row["F"]), probability(row["p"]))
        for source, row in a.anova.iterrows()
    ]  # fmt: skip
    head = ("Source", "df", "Sum of squares", "Mean square", "F", "p")
    return PageTable(f"Analysis of variance, type {'I' * a.typ}", head, rows)
