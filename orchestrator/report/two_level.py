"""The parts of a report on a factorial study: answer, effects that matter, tables and figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Unpack

import numpy as np
import pandas as pd

from ..analysis.common.columns import RESPONSE
from ..analysis.common.options import Transform
from ..analysis.two_level.analysis import Factorial
from ..analysis.two_level.box_cox import box_cox
from ..analysis.two_level.power import detectable
from ..analysis.two_level.sentences import answer, limit_of
from ..analysis.workflow import AnalysisOptions, of_table
from ..answer import Extended
from ..errors import ConfigurationError
from ..study.design import shown as level_shown
from ..study.study import Study
from ..study.tables import FactorTable
from ..words.lists import plural
from ..words.numbers import (
    interval,
    number,
    probability,
    quantity,
    rounded,
    signed,
    unbroken,
)
from ..words.shares import column_percent, percent
from .page import Block, PageTable, Text

MOST_ROWS = 40
"""Most effects in a table."""
POWER = 0.8
LOGARITHM, SPREAD = "The logarithm of the response", "The spread of the response"
ERRORS = {"pure": "the scatter between replicates (pure error)",
          "residual": "the scatter about the model (residual, with its lack of fit)"}
BOX_COX = "The Box–Cox profile"
FEW = 10
"""Degrees of freedom below which intervals are rough."""
MAX_LISTED = 3
"""Most undecided effects that a sentence lists."""


@dataclass(frozen=True, eq=False, repr=False)
class Findings(Extended):
    """All analyses of a factorial study.

    Attributes
    ----------
    data, shown
        The analysis with the names of columns, and with the labels for people.
    log, spread
        Analyses of the logarithm of the response and of its spread, with labels; None where there
        is none.
    profile
        Box–Cox profile.
    detectable
        Smallest effect that is detected with a probability of `POWER`, by term.
    missing
        The reason for each of these that is None.
    """

    study: Study
    data: Factorial
    shown: Factorial
    log: Factorial | None
    spread: Factorial | None
    profile: pd.DataFrame | None
    detectable: pd.Series[float]
    missing: tuple[str, ...]

    @property
    def main(self) -> Factorial:
        """The analysis with the names of columns."""
        return self.data


def find(
    study: Study, table: pd.DataFrame, response: str = RESPONSE, **choices: Unpack[AnalysisOptions]
) -> Findings:
    """Analyse a study in all the ways that a report shows.

    Raises
    ------
    ConfigurationError
        For the reasons of `sblcosim.analysis.of_study`.
    """
    data = of_table(study, table, response, **choices)
    shown = data.readable
    missing: list[str] = []

    def attempt(what: str, compute: Callable[[], Any]) -> Any:
        if data.transform != "none":
            return None
        try:
            return compute()
        except ConfigurationError:
            missing.append(f"{what} {_why_not(what, data)}.")
            return None

    def again(transform: Transform) -> Factorial:
        other: AnalysisOptions = {**choices, "transform": transform, "practical": None}
        return of_table(study, table, response, **other).readable

    return Findings(
        study,
        data,
        shown,
        attempt(LOGARITHM, lambda: again("log")),
        attempt(SPREAD, lambda: again("spread")),
        attempt(BOX_COX, lambda: box_cox(shown)),
        detectable(shown, POWER),
        tuple(missing),
    )


def _why_not(what: str, a: Factorial) -> str:
    """Why an analysis is impossible, for readers who did not ask for it."""
    y = a.table[a.response]
    fewest, need = int(a.points["runs"].min()), 3 if a.seeding == "common" else 2
    if what == SPREAD and fewest < need:
        return (f"cannot be analysed: each design point needs at least {need} runs, and there "
                f"{plural(fewest, 'is', 'are')} {fewest}")
    if what == SPREAD:
        return "cannot be analysed: at some design points the runs are equal"
    if (y <= 0).any():
        return f"cannot be analysed: the response is not above zero in all runs ({number(y.min())})"
    if what == BOX_COX:
        return "cannot be computed: the model has as many terms as there are runs"
    return "cannot be analysed: it is the same in all runs"


# --- Sentences -----------------------------------------------------------------------------------


def what_matters(analysis: Factorial) -> str:
    """How many effects are significant, and which of them matter."""
    effects = analysis.ranked()
    significant = int(effects["significant"].sum())
    text = f"{significant} of {len(effects)} effects are statistically significant"
    if analysis.practical is None:
        if significant > len(effects) / 2:
            text += ". With many runs, almost all are, whether they matter or not"
        return f"{text}. No smallest effect that matters was given (option --practical)."
    line = limit_of(analysis)
    groups = {
        verdict: list(effects.index[effects["verdict"] == verdict])
        for verdict in ("matters", "undecided", "too small")
    }
    if groups["matters"]:
        text += (f". {len(groups['matters'])} matter, as they are surely larger than {line}: "
                 f"{', '.join(groups['matters'])}")
    else:
        text += f". None is surely larger than {line}"
    parts = [f"{text}."]
    if groups["undecided"]:
        named, rest = groups["undecided"][:MAX_LISTED], len(groups["undecided"]) - MAX_LISTED
        more = f" and {rest} smaller ones" if rest > 0 else ""
        parts.append(f"More runs are needed to decide about {', '.join(named)}{more}.")
    if groups["too small"]:
        parts.append(f"{len(groups['too small'])} are too small to matter, significant or not.")
    return " ".join(parts)


def unit(analysis: Factorial) -> str:
    """Unit of the response after a space."""
    return f" {analysis.unit}" if analysis.unit else ""


def direction(analysis: Factorial) -> str:
    """The better level of each factor with a significant effect; less of the response is better."""
    parts = []
    for name in analysis.ranked().index:
        row = analysis.effects.loc[name]
        if row["order"] == 1 and row["significant"]:
            low, high = analysis.levels[name]
            better = low if row["effect"] > 0 else high
            parts.append(f"{name} {quantity(better, analysis.units.get(name, ''))}")
    return f"The better levels, on average over the others: {', '.join(parts)}." if parts else ""


def box_cox_sentence(profile: pd.DataFrame) -> str:
    """The best power, with advice."""
    powers = profile["lambda"]
    best = float(powers.to_numpy()[profile["log_likelihood"].argmax()])
    inside = powers[profile["inside"]]
    low, high = inside.min(), inside.max()
    lowest = f"{low:.2g}" + (" or below" if low == powers.min() else "")
    highest = f"{high:.2g}" + (" or above" if high == powers.max() else "")
    if low <= 1 <= high:
        advice = "the response suits the model as it is"
    elif low <= 0 <= high:
        advice = "its logarithm would suit the model"
    elif abs(best) < abs(best - 1):
        advice = "its logarithm suits the model better than the response itself"
    else:
        advice = "the response itself suits the model better than its logarithm"
    return unbroken(f"Box–Cox: λ = {best:.2g}, interval {lowest} to {highest}; {advice}.")


# --- Tables --------------------------------------------------------------------------------------


def factor_table(study: Study) -> PageTable:
    """Factors and levels."""
    rows = []
    for name, factor in (study.factors | study.conditions).items():
        levels = _levels(factor)
        label = study.labels[name]
        if name in study.conditions:
            label += f" (condition, {study.conditions[name].combine})"
        rows.append((label, levels, study.units[name] or "–", ", ".join(factor.all_keys), name))
    return PageTable(
        "Factors", ("Factor", "Levels", "Unit", "Keys of the scenario", "Column"), rows, (3, 4)
    )


def _levels(factor: FactorTable) -> str:
    """The levels of a factor, or the distribution of its values."""
    law = factor.law
    if law is None or law.distribution == "choice":
        settings = factor.settings
        return " / ".join(
            level_shown(v) + ("" if settings[v] or factor.keys else " (the scenario as it is)")
            for v in factor.values
        )
    numbers = law.model_dump(exclude_none=True, exclude={"distribution"})
    shown = (
        f"{name} {' to '.join(f'{v:g}' for v in value) if name == 'range' else f'{value:g}'}"
        for name, value in numbers.items()
    )
    return f"{law.distribution}, {', '.join(shown)}"


def effect_table(findings: Findings) -> PageTable:
    """The effects, the largest first, with all that is known about each."""
    a = findings.shown
    ranked = a.ranked()
    level = f"{a.confidence:.4g}".removeprefix("0.")
    own = f" [{a.unit}]" if a.unit else ""
    head = ["Effect", f"Low to high{own}", f"{level} % interval{own}", "t", "p", "Share",
            f"Detectable{own}"]
    if a.transform != "none":
        head.append("Ratio")
    if "verdict" in ranked:
        head.append("In practice")
    rows = []
    for name, row in ranked.head(MOST_ROWS).iterrows():
        cells = [str(name), signed(row["effect"]), interval(row["low"], row["high"], signed),
                 number(row["t"]), probability(row["p"]), column_percent(row["share"]),
                 number(findings.detectable[str(name)], 2)]
        if a.transform != "none":
            cells.append(_ratio(row))
        if "verdict" in ranked:
            cells.append(str(row["verdict"]))
        rows.append(cells)
    rest = len(ranked) - len(rows)
    note = (
        "Effect of a factor: change of the mean from its low to its high level. Effect of an "
        "interaction A × B: half the difference between the effect of A at the high level of B and "
        "that at the low level of B. Share: share of the total sum of squares. Detectable: true "
        f"effect that would be found with a probability of {percent(POWER, '.0f')}."
        + (f" {rest} smaller effects are not shown." if rest else "")
    )
    return PageTable(f"Effects on the {a.quantity}", head, rows,
                 (len(head) - 1,) if "verdict" in ranked else (), note)


def ratio_table(findings: Findings) -> PageTable | None:
    """Effects on the logarithm of the response and on its spread, as ratios of high to low."""
    a, log, spread = findings.shown, findings.log, findings.spread
    if log is None and spread is None:
        return None
    head = ["Effect", *(["Ratio of the response", "p"] if log is not None else []),
            *(["Ratio of its spread", "p"] if spread is not None else [])]
    first = log if log is not None else spread
    assert first is not None
    rows = []
    for name in first.ranked().index[:MOST_ROWS]:
        cells = [str(name)]
        for other in (log, spread):
            if other is not None:
                row = other.effects.loc[name]
                cells += [_ratio(row), probability(row["p"])]
        rows.append(cells)
    rest = len(first.effects) - len(rows)
    note = (
        "Ratios of the high level to the low level, with intervals. Above 1: more at the high "
        "level."
        + (" Ratios of the response come from its logarithm; they are ratios of geometric means."
           if log is not None else "")
        + (" Ratios of its spread come from ln s, where s is the standard deviation of the runs of "
           "a point."
           if spread is not None else "")
        + "".join(
            f" Degrees of freedom {of}: {number(other.df, 3)}"
            + (". That is few: these intervals are wide and rough." if other.df < FEW else ".")
            for of, other in (("for the response", log), ("for its spread", spread))
            if other is not None
        )
        + (f" {rest} smaller ones are not shown." if rest else "")
    )
    sources = [*([f"the logarithm of the {a.response}"] if log is not None else []),
               *([f"the spread of the {a.response}"] if spread is not None else [])]
    return PageTable(f"Ratios, from {' and from '.join(sources)}", head, rows, (), note)


def _ratio(row: Mapping[str, float] | pd.Series[Any]) -> str:
    return f"{rounded(row['ratio'])} ({interval(row['ratio_low'], row['ratio_high'])})"


def anova_table(a: Factorial) -> PageTable:
    """Analysis of variance, the largest terms first."""
    terms = a.ranked().index[:MOST_ROWS]
    rest = a.anova.index.difference(a.effects.index, sort=False)
    rows = [
        (str(name), number(row["ss"], 4), number(row["df"], 5), number(row["ms"], 4),
         number(row["f"], 4), probability(row["p"]))
        for name, row in a.anova.loc[[*terms, *rest]].iterrows()
    ]
    return PageTable("Analysis of variance",
                 ("Source", "Sum of squares", "df", "Mean square", "F", "p"), rows)


def model_table(findings: Findings) -> PageTable:
    """The model as a whole."""
    a = findings.shown
    rows: list[tuple[str, str]] = [
        ("Runs", f"{a.runs:,}" + (f", {a.dropped:,} left out" if a.dropped else "")),
        ("Design points", str(len(a.points))),
        ("Terms", str(len(a.effects))),
        ("Overall mean", f"{number(a.overall_mean, 4)}{unit(a)}"),
        *([("Error of the effects from", ERRORS[a.error] + (
            "" if np.isnan(a.sigma) else f"; standard deviation {number(a.sigma, 4)}{unit(a)}"
        ))] if a.error else []),
        ("Reference line t", f"{number(a.reference, 4)} ({number(a.df, 5)} degrees of freedom)"),
    ]
    if np.isfinite(a.r2_adjusted):
        known = np.isfinite(a.r2_predicted)
        predicted = unbroken(percent(a.r2_predicted, ".2f")) if known else "–"
        rows += [
            ("R²", percent(a.r2, ".2f")), ("R² adjusted", percent(a.r2_adjusted, ".2f")),
            ("R² predicted", predicted),
            ("Residual standard deviation", f"{number(a.rmse, 4)}{unit(a)}"),
        ]
    for word, test in (("Lack of fit", a.lack_of_fit), ("Curvature", a.curvature)):
        if test is not None:
            rows.append((word, f"F({test.df:.4g}, {test.df_error:.4g}) = {test.f:.4g}, "
                               f"p {probability(test.p)}"))
    if a.lenth is not None:
        rows += [
            (words, f"{number(size, 4)}{unit(a)}") for words, size in (
                ("Pseudo standard error (PSE)", a.lenth.pse),
                ("Margin of error (ME)", a.lenth.me),
                ("Simultaneous margin (SME)", a.lenth.sme),
            )
        ]
    note = "" if a.lenth is None else (
        "Lenth's method takes the error of an effect, the PSE, from the small effects. A single "
        "effect is significant if it exceeds the ME. The largest of all effects is significant if "
        "it exceeds the SME."
    )
    return PageTable("The model", ("Quantity", "Value"), rows, (1,), note)


def tables(findings: Findings) -> list[Block]:
    """All tables, with sentences where they are needed."""
    a = findings.shown
    blocks: list[Block] = [effect_table(findings), model_table(findings)]
    if (ratios := ratio_table(findings)) is not None:
        blocks.insert(1, ratios)
    if a.lack_of_fit is not None and a.lack_of_fit.p < 1 - a.confidence:
        blocks.append(Text(
            "The lack of fit is significant: there are interactions of more factors than the model "
            "has. The effects do not change, because the design is balanced. Their intervals "
            + ("come from the scatter between replicates, which does not include it"
               if a.error == "pure" else "are wider than necessary")
            + ". The model does not predict all single points.", "note"))
    blocks.append(anova_table(a))
    if findings.profile is not None:
        blocks.append(Text(box_cox_sentence(findings.profile)))
    blocks += [Text(text, "note") for text in findings.missing]
    if a.aliases:
        blocks.append(PageTable(
            "Aliased terms: each line applies to the sum of its terms", ("Term", "Aliased with"),
            [(term, ", ".join(same)) for term, same in a.aliases.items()], (1,)))
    return blocks


# --- Figures -------------------------------------------------------------------------------------


def get_ready() -> None:
    """Do nothing. A process that calls this has imported the modules that drawing needs."""


def summary(findings: Findings) -> list[Block]:
    """The answer, the effects that matter, and the better levels."""
    blocks: list[Block] = [
        Text(unbroken(answer(findings.shown)), "answer"),
        Text(unbroken(what_matters(findings.shown))),
    ]
    if text := direction(findings.shown):
        blocks.append(Text(unbroken(text)))
    return blocks
