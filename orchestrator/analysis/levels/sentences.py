"""Sentences and printed tables of an analysis of factors with many levels."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from ...judge.definitions import LOST
from ...layout import fitted, table
from ...results.responses import defined
from ...study.design import Level
from ...words.lists import first_of, listed
from ...words.numbers import interval, measured, minus, p_value, quantity, rounded
from ...words.shares import column_percent, percent
from ..common.bounds import runs_for_t
from ..common.model import MAX_LISTED
from ..common.sentences import left_out
from .analysis import GeneralFactorial

MOST_NAMED = 3
"""Most levels or factors that a sentence names."""
UNEQUAL = 2.0
"""Ratio of standard deviations above which they are reported."""


_WITHIN = (
    " Each is the median of the differences between the two runs of a replicate that share the "
    "levels of all other factors. It is not the difference of the levels' medians."
)


def level_text(level: Level, unit: str = "") -> str:
    """A level with its unit; truth values are words."""
    if isinstance(level, bool | str):
        return str(level).lower() if isinstance(level, bool) else level
    return quantity(level, unit)


def summary(
    analysis: GeneralFactorial, most: int, verbose: bool, width: int | None, column: str
) -> str:
    """The answer, the analysis of variance, and the means of the levels; `verbose` adds the rest.

    `column` is the response's column.
    """
    a = analysis
    lost = [LOST] if a.means["lost"].notna().any() else []
    said = [*dict.fromkeys((*lost, *defined(column)))]
    level = percent(a.confidence, ".4g")
    lines = [
        answer(a),
        *warnings(a),
        "",
        f"Analysis of variance of {a.quantity}, type {'I' * a.typ}:",
        *table(_anova_rows(a), width, ("source", "df", "sum_sq", "mean_sq", "F", "p"), range(1, 6)),
        "",
        f"{a.mean_of}, {level} intervals, and the share of lost runs:",
        *table(_mean_rows(a), width, ("factor", "level", "mean", "low", "high", "runs", "lost"),
               range(2, 7)),
        "",
        f"Medians of {a.response}{f' [{a.measured_in}]' if a.measured_in else ''}, {level} "
        "intervals of each level alone by order statistics:",
        *table(_median_rows(a), width, ("factor", "level", "median", "low", "high"), range(2, 5)),
        *(["", *said] if said else []),
        *(["", *_differences(a, most, width), "", *notes(a)] if verbose else
          left_out(a.dropped, a.seeding == "common")),
    ]
    return fitted("\n".join(lines), width)


def answer(analysis: GeneralFactorial) -> str:
    """The factors that matter, and between which levels, in a few sentences.

    Each factor is named from its worst to its best level. A smaller response counts as better.
    """
    return " ".join([*([_typical(analysis)] if analysis.by_medians else []), _by_means(analysis),
                     *([] if analysis.practical is None else [_practical(analysis)])])


def _typical(analysis: GeneralFactorial) -> str:
    """The answer by medians, where means cannot be trusted."""
    a = analysis
    unit = f" {a.measured_in}" if a.measured_in else ""
    parts, same, apart = [], [], list[str]()
    for name in a.factors:
        own = a.medians[a.medians["factor"] == name]
        rows: list[Any] = [own.iloc[own["median"].argmax()], own.iloc[own["median"].argmin()]]
        worst, best = rows
        if not worst["all_low"] > best["all_high"]:
            pairs: Any = a.judged_pairs.query("factor == @name and differs")
            apart += [
                f"{name}: {_ends(a, name, pair)}, less by {rounded(abs(pair.difference))}{unit} "
                f"({_interval_of_less(pair)})" for pair in pairs.itertuples()
            ]
            if pairs.empty:
                same.append(name)
            continue
        ends = [
            f"{level_text(row['level'], a.units.get(name, ''))}, {rounded(row['median'])}{unit} "
            f"({interval(row['all_low'], row['all_high'])})" for row in rows
        ]
        parts.append((worst["median"] / max(best["median"], 1e-300),
                      f"{name} from {' to '.join(ends)}"))
    named = [text for _, text in sorted(parts, key=lambda part: -part[0])][:MOST_NAMED]
    what = f"The median {a.response}"
    lines = [f"{what} falls with {'; then with '.join(named)}."] if named else []
    if apart:
        more = len(apart) - MOST_NAMED
        rest = f"; {more} more pairs differ" if more > 0 else ""
        lines.append(f"By the medians of the pairs, {'; '.join(apart[:MOST_NAMED])}{rest}.")
    if same:
        levels = listed(same, "or", most=MOST_NAMED)
        lines.append(f"No two levels of {levels} surely differ in the median.")
    return " ".join(["The means depend on few runs, so the medians come first.", *lines])


def _interval_of_less(pair: Any) -> str:
    return interval(*sorted(map(abs, (pair.low, pair.high))))


def _practical(analysis: GeneralFactorial) -> str:
    """The number of pairs of levels that are equal, differ, or are undecided."""
    a = analysis
    limit = (f"a factor of {a.practical or 0:g}" if a.transform == "log" else
             f"±{a.practical or 0:g} {a.unit}".rstrip())
    counts = a.pairs["verdict"].value_counts()
    differ, equal, undecided = (
        int(counts.get(verdict, 0)) for verdict in ("differs", "equal", "undecided"))
    how = "Judged by medians, of" if a.by_medians else "Of"
    return (f"{how} the {len(a.pairs)} pairs of levels {differ} differ by more than {limit}, "
            f"{equal} are equal within it, and {undecided} are undecided.")


def _by_means(analysis: GeneralFactorial) -> str:
    """The answer by differences of means."""
    a = analysis
    how = "geometric mean of the " if a.transform == "log" else "mean " if a.by_medians else ""
    what = f"the {how}{a.response}"
    largest = _largest(a)
    same = [name for name in a.factors if name not in largest]
    parts: list[str] = []
    for name, row in list(largest.items())[:MOST_NAMED]:
        size, within = _size(a, row)
        first = not parts
        level = percent(a.confidence, ".4g")
        how = f" ({level} simultaneous interval {within})" if first else f" ({within})"
        parts.append(f"{name} from {_ends(a, name, row)}, by {size}{how}{_as_good(a, name, row)}")
    sentences = []
    if parts:
        more = len(largest) - len(parts)
        falls = f"{what[0].upper()}{what[1:]} falls{' most' if len(a.factors) > 1 else ''} with "
        sentences.append(falls + "; then with ".join(parts)
                         + (f"; {more} more factors change it." if more > 1 else
                            "; 1 more factor changes it." if more else "."))
        if same:
            named = listed(same, "or", most=MOST_NAMED)
            sentences.append(f"No two levels of {named} can be told apart.")
    else:
        sentences.append(f"No two levels of a factor can be told apart by {what}.")
    several = a.anova[[len(term) > 1 for term in a.terms]
                      + [False] * (len(a.anova) - len(a.terms))]
    sure = several[several["p"] < 1 - a.confidence].sort_values("sum_sq", ascending=False)
    if len(sure):
        share = sure["sum_sq"].iloc[0] / a.anova.loc["total", "sum_sq"]
        sentences.append(f"The largest interaction is {sure.index[0]} ({column_percent(share)} of "
                         "the sum of squares).")
    if a.left_out:
        sentences.append("Main effects only: the combinations of levels with runs cannot estimate "
                         f"{listed(list(a.left_out), most=MAX_LISTED)}.")
    elif len(a.factors) > 1 and max(map(len, a.terms)) == 1:
        sentences.append("Interactions are not in the model.")
    return " ".join(sentences)


def warnings(analysis: GeneralFactorial) -> list[str]:
    """Doubts about the means and their intervals: heavy tails, or too few runs."""
    a = analysis
    lines = []
    if a.ran_away:
        unit = f" {a.measured_in}" if a.measured_in else ""
        times = rounded(a.largest / a.median)
        which = f"Run {a.worst_run}" if a.worst_run else "One run"
        again = (f" To repeat it: sblcosim replay RESULTS {a.worst_run}"
                 if a.worst_run else "")
        lines.append(f"{which} has {rounded(a.largest)}{unit}, {times} times the median. Means "
                     "and their intervals depend on such runs. Transform log compares typical ones."
                     + again)
    if a.transform == "none" and a.means["low"].isna().any():
        lines.append("A mean without an interval (–) is unknown: its interval would reach below "
                     "zero, although no run does. The medians have intervals.")
    if a.heavy:
        text = (f"Heavy tails: {column_percent(a.far)} of the runs lie more than 5 robust standard "
                "deviations from the median of their combination of levels. Means therefore "
                "depend on few runs, and their intervals may be too short.")
        if a.far_log < a.far / 2:
            far = column_percent(a.far_log)
            text += (f" For the logarithms it is {far}: transform log compares "
                     "typical runs.")
        if a.worst_run and not a.ran_away:
            text += f" Run {a.worst_run} is the largest: sblcosim replay RESULTS {a.worst_run}."
        lines.append(text)
    if not np.isnan(a.skewness) and a.fewest < runs_for_t(a.skewness):
        lines.append(f"Skewed runs (skewness {minus(f'{a.skewness:.2g}')}): intervals of means "
                     f"need about {runs_for_t(a.skewness)} runs at each level (Cochran's rule). "
                     f"The level with the fewest has {a.fewest}.")
    if a.fewest < a.runs_needed:
        lines.append("If 1 run in 20 is bad, some level may have shown none, and intervals say "
                     f"nothing about bad runs. To show one, each level needs {a.runs_needed} "
                     f"runs. The level with the fewest has {a.fewest}.")
    return lines


def notes(analysis: GeneralFactorial) -> list[str]:
    """Method and quality of the model, in sentences."""
    a = analysis
    several = [len(levels) * (len(levels) - 1) // 2 for levels in a.levels.values()]
    lines = [f"{a.runs} runs of {a.combinations} combinations of levels; "
             f"R² {percent(a.r2, '.2f')}; residual standard deviation {a.rmse:.4g}."]
    lines += left_out(a.dropped, a.seeding == "common")
    if a.empty:
        lines.append(f"Levels without a run that counts: {first_of(list(a.empty), MOST_NAMED)}.")
    lines.append(
        "A mean counts each combination of the other factors' levels once, and its interval holds "
        f"for this mean alone. Intervals of differences hold for all pairs of a factor at once (up "
        f"to {max(several)}), by Bonferroni's inequality."
        + (" They are intervals of medians, by order statistics." if a.by_medians else "")
        + (_WITHIN if a.within_replicates else "")
    )
    if np.isnan(a.far):
        lines.append("Heavy tails cannot be detected, because no combination of levels has 10 "
                     "runs.")
    if a.seeding == "common":
        lines.append("The runs of a replicate share their noise. Differences are therefore paired "
                     "in each replicate, and each F has its own error, with Greenhouse and "
                     "Geisser's degrees of freedom.")
    else:
        least, largest = a.spread
        text = "F assumes equal variances; intervals do not (Welch)."
        if np.isnan(least):
            text = ("No combination of levels has two runs, so F and intervals assume equal "
                    "variances, and the error is the scatter about the model.")
        elif largest > UNEQUAL * least:
            text += (f" The standard deviations of the combinations range from {least:.3g} to "
                     f"{largest:.3g}.")
        lines.append(text)
    return lines


def _largest(analysis: GeneralFactorial) -> dict[str, Any]:
    """The largest sure difference of each factor that has one, the largest first."""
    sure = analysis.pairs[_told_apart(analysis.pairs)]
    ranked = sure.sort_values("difference", key=np.abs, ascending=False, kind="stable")
    found: dict[str, Any] = {}
    for row in ranked.itertuples():
        found.setdefault(str(row.factor), row)
    return found


def _told_apart(pairs: pd.DataFrame) -> pd.Series[bool]:
    """Whether each pair differs in its means."""
    return (pairs["low"] > 0) | (pairs["high"] < 0)


def _ends(analysis: GeneralFactorial, name: str, row: Any) -> str:
    """The worse and the better level."""
    unit = analysis.units.get(name, "")
    ends = [level_text(level, unit) for level in (row.one, row.other)]
    return " to ".join(ends if row.difference > 0 else ends[::-1])


def _as_good(analysis: GeneralFactorial, name: str, row: Any) -> str:
    """The levels that cannot be told apart from the better one."""
    best = row.other if row.difference > 0 else row.one
    pairs = analysis.pairs
    own = pairs[(pairs["factor"] == name) & ~_told_apart(pairs)]
    unit = analysis.units.get(name, "")
    tied = [level_text(b if a == best else a, unit)
            for a, b in zip(own["one"], own["other"], strict=True) if best in (a, b)]
    if not tied:
        return ""
    return f", where {listed(tied, most=MOST_NAMED)} cannot be told apart from the better level"


def _size(analysis: GeneralFactorial, row: Any) -> tuple[str, str]:
    """The size of a difference, and its interval."""
    ends = sorted(np.sign(row.difference) * np.array([row.low, row.high]))
    size = abs(row.difference)
    if analysis.transform == "log":
        size, *ends = np.exp([size, *ends])
    shown = interval(*ends)
    if analysis.transform == "log":
        return f"a factor of {rounded(size)}", shown
    return measured(size, analysis.unit), shown


def _in_unit(analysis: GeneralFactorial) -> str:
    return f" [{analysis.unit}]" if analysis.unit else ""


def _anova_rows(analysis: GeneralFactorial) -> list[tuple[str, ...]]:
    return [
        (str(name), f"{row['df']:g}",
         *("" if np.isnan(x) else minus(f"{x:.4g}") for x in (row["sum_sq"], row["mean_sq"],
                                                              row["F"])),
         "" if np.isnan(row["p"]) else p_value(row["p"]))
        for name, row in analysis.anova.iterrows()
    ]


def _mean_rows(analysis: GeneralFactorial) -> list[tuple[str, ...]]:
    rows = []
    before = ""
    row: Any
    for row in analysis.own_means.itertuples():
        name = str(row.factor)
        unit = analysis.units.get(name, "")
        rows.append((name if name != before else "", level_text(row.level, unit),
                     *map(_shown, (row.mean, row.low, row.high)),
                     f"{row.runs}", column_percent(float(row.lost))))
        before = name
    return rows


def _median_rows(analysis: GeneralFactorial) -> list[tuple[str, ...]]:
    rows = []
    before = ""
    row: Any
    for row in analysis.medians.itertuples():
        name = str(row.factor)
        rows.append((name if name != before else "",
                     level_text(row.level, analysis.units.get(name, "")),
                     *map(_shown, (row.median, row.low, row.high))))
        before = name
    return rows


def _shown(value: float) -> str:
    """A number in a table; a dash if it is unknown."""
    return "–" if np.isnan(value) else minus(f"{value:.4g}")


def _differences(analysis: GeneralFactorial, most: int, width: int | None) -> list[str]:
    """The largest differences of each factor."""
    a = analysis
    rows: list[tuple[str, ...]] = []
    for name, own in a.judged_pairs.groupby("factor", sort=False):
        ranked = own.sort_values("difference", key=np.abs, ascending=False, kind="stable")
        rows += [_difference_row(a, str(name), row) for row in ranked.head(most).itertuples()]
        if len(ranked) > most:
            rows.append((str(name), f"and {len(ranked) - most} smaller",
                         *[""] * (4 if a.practical is None else 5)))
    ratios = a.transform == "log"
    what = f"Ratios of the geometric means of {a.response}" if ratios else (
        f"Medians of the differences of {a.quantity} within a replicate{_in_unit(a)}"
        if a.within_replicates else
        f"Differences of the {'medians' if a.by_medians else 'means'} of {a.quantity}{_in_unit(a)}")
    head = ("factor", "levels", "ratio" if ratios else "difference", "low", "high", "p",
            *([] if a.practical is None else ["verdict"]))
    return [f"{what}, {percent(a.confidence, '.4g')} intervals for all pairs of a factor at once:",
            *table(rows, width, head, range(2, 6))]


def _difference_row(analysis: GeneralFactorial, name: str, row: Any) -> tuple[str, ...]:
    ratios, pair = analysis.transform == "log", pair_texts(row, analysis)
    values = ((row.ratio, row.ratio_low, row.ratio_high) if ratios else
              (row.difference, row.low, row.high))
    return (name, (" / " if ratios else " − ").join(pair), *(minus(f"{x:.4g}") for x in values),
            "" if pd.isna(row.p) else p_value(row.p),
            *([] if analysis.practical is None else [verdict_text(row.verdict, analysis)]))


def verdict_text(verdict: str, analysis: GeneralFactorial) -> str:
    """The verdict on a pair of levels, in words."""
    limit = f"{analysis.practical or 0:g}"
    within = f"a factor of {limit}" if analysis.transform == "log" else (
        f"±{limit} {analysis.unit}".rstrip())
    return verdict + (f" within {within}" if verdict == "equal" else "")


def pair_texts(row: Any, analysis: GeneralFactorial) -> tuple[str, str]:
    """The two levels of a difference."""
    unit = analysis.units.get(str(row.factor), "")
    return level_text(row.one, unit), level_text(row.other, unit)
