"""Sentences and printed tables of a two-level analysis."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...layout import fitted, table
from ...results.responses import defined
from ...words.lists import first_of
from ...words.numbers import interval, measured, p_value, quantity, rounded, signed
from ...words.shares import column_percent, percent
from ..common.model import MAX_LISTED
from ..common.sentences import left_out
from .analysis import Factorial
from .ranking import tied_groups
from .tables import EFFECTS


def summary(
    analysis: Factorial, most: int, verbose: bool = False, width: int | None = None,
    column: str = "",
) -> str:
    """The answer, then the `most` largest effects.

    Parameters
    ----------
    column
        Column of the response, if the analysis has its label.
    verbose
        Add standard errors, t and p, and the method.
    width
        Columns to fit into; None: sentences are not wrapped.
    """
    shown = analysis.ranked().head(most)
    columns = ["effect", "low", "high", *(["std_error", "t", "p"] if verbose else []), "share"]
    columns += [c for c in ("ratio", "verdict") if c in shown]
    formats: dict[str, Any] = {
        "share": column_percent, "p": p_value, "t": "{:.2f}".format, "verdict": str,
    }  # fmt: skip
    rows = [
        (str(term), *(formats.get(str(c), "{:.4g}".format)(value) for c, value in row.items()))
        for term, row in zip(shown.index, shown[columns].to_dict(orient="records"), strict=True)
    ]
    rest = len(analysis.effects) - len(shown)
    lines = [
        answer(analysis),
        "",
        f"Effects on {analysis.quantity}, {percent(analysis.confidence, '.4g')} intervals:",
        *table(rows, width, ("", *map(EFFECTS.head, columns)), range(1, len(columns) + 1)),
        *([f"and {rest} smaller"] if rest else []),
        *(["undecided: the interval includes effects that matter and effects that do not; more "
           "runs decide"]
          if "verdict" in shown and (shown["verdict"] == "undecided").any() else []),
        *(["", *notes(analysis)] if verbose else
          left_out(analysis.dropped, analysis.seeding == "common")),
        *defined(column or analysis.response),
    ]
    return fitted("\n".join(lines), width)


def answer(analysis: Factorial, most: int = 3) -> str:
    """The effects that matter, in a few sentences: the largest main effects and interaction.

    Each factor is named from its worse to its better level. A smaller response counts as better.
    Factors whose effects cannot be told apart share a rank. Ranks are named until there are `most`
    factors.
    """
    a = analysis
    ranked = a.ranked()
    worth = ranked["significant"].astype(bool)
    what = {"none": "", "log": "geometric mean of the ", "spread": "spread of the "}[a.transform]
    what = f"the {what}{a.response}"
    if not worth.any():
        return f"No effect on {what} can be told apart from noise."
    if "verdict" in ranked:
        worth &= ranked["verdict"] != "too small"
        if not worth.any():
            return (f"No effect on {what} is large enough to matter: those that can be told apart "
                    f"from noise are smaller than {limit_of(a)}.")
    single, several = ranked[worth & (ranked["order"] == 1)], ranked[worth & (ranked["order"] > 1)]
    method = " by Lenth's method" if a.lenth else ""
    level = f"{percent(a.confidence, '.4g')} interval{method}"
    parts: list[str] = []
    named: list[str] = []
    for same in tied_groups(a, [str(name) for name in single.index]):
        if len(named) >= most:
            break
        shown, rest, words = same[: most + 1], len(same) - most - 1, list[str]()
        named += shown
        for name in shown:
            size, within = _reach(a, name)
            first = not parts and not words
            words.append(
                f"{name} from {_worse_to_better(a, name)}, by {size}"
                + (f" on average ({level} {within})" if first else f" ({within})")
            )
        text = ", tied with ".join(words)
        parts.append(text + (f", and with {rest} more" if rest > 0 else ""))
    if parts:
        falls = f"{what[0].upper()}{what[1:]} falls{' most' if len(a.factors) > 1 else ''}"
        sentences = [f"{falls} with {'; then with '.join(parts)}."]
    else:
        sentences = [f"No single factor surely changes {what}."]
    if len(several):
        name = str(several.index[0])
        named.append(name)
        size, within = _signed(a, name)
        how = "" if parts else f"{level} "
        sentences.append(f"The largest interaction is {name} ({size}, {how}{within}).")
    same_as = [f"{name} from {' and '.join(a.aliases[name])}" for name in named
               if name in a.aliases]
    if same_as:
        sentences.append(
            "This holds if interactions that are not in the model are negligible: the design "
            f"points cannot tell {'; '.join(same_as)}."
        )
    elif len(a.factors) > 1 and max(map(len, a.terms)) == 1:
        sentences.append("Interactions are not in the model.")
    return " ".join(sentences)


def limit_of(analysis: Factorial) -> str:
    """The smallest effect that matters, in words."""
    assert analysis.practical is not None
    if analysis.transform != "none":
        return f"a factor of {np.exp(analysis.practical):.3g}"
    return f"{analysis.practical:g} {analysis.unit}".rstrip()


def _worse_to_better(analysis: Factorial, name: str) -> str:
    low, high = (quantity(x, analysis.units.get(name, "")) for x in analysis.levels[name])
    row: Any = analysis.effects.loc[name]
    return f"{high} to {low}" if row.effect > 0 else f"{low} to {high}"


def _reach(analysis: Factorial, name: str) -> tuple[str, str]:
    """The decrease of the response at the better level, and its interval."""
    row: Any = analysis.effects.loc[name]
    ends = sorted(np.sign(row.effect) * np.array([row.low, row.high]))
    if analysis.transform != "none":
        size, *ends = np.exp([abs(row.effect), *ends])
        return f"a factor of {rounded(size)}", interval(*ends)
    return measured(abs(row.effect), analysis.unit), interval(*ends)


def _signed(analysis: Factorial, name: str) -> tuple[str, str]:
    """An effect and its interval; a ratio for logarithms."""
    row: Any = analysis.effects.loc[name]
    if analysis.transform != "none":
        return f"×{rounded(row.ratio)}", interval(row.ratio_low, row.ratio_high)
    unit = f" {analysis.unit}" if analysis.unit else ""
    return f"{signed(row.effect)}{unit}", interval(row.low, row.high)


def notes(analysis: Factorial) -> list[str]:
    """Method, quality and tests of the model, in sentences."""
    a = analysis
    points = len(a.points)
    how = {
        "ols": "ordinary least squares, errors from the "
        + ("scatter between replicates (pure error)" if a.error == "pure" else
           "scatter about the model (residual, with its lack of fit)")
        + f", {a.df:g} degrees of freedom",
        "replicates": f"effects in each of {a.df + 1:g} replicates and their scatter, because the "
        "runs of a replicate share their noise",
        "lenth": "Lenth's pseudo standard error, because no run is left to estimate the error from",
    }[a.method]
    lines = [
        f"{a.runs} {'values' if a.transform == 'spread' else 'runs'} at {points} points, "
        f"{len(a.effects)} terms; {how}."
    ]
    lines += left_out(a.dropped, a.seeding == "common")
    if np.isfinite(a.r2_adjusted):
        known = np.isfinite(a.r2_predicted)
        predicted = f", predicted {percent(a.r2_predicted, '.2f')}" if known else ""
        lines.append(f"R² {percent(a.r2, '.2f')}, adjusted {percent(a.r2_adjusted, '.2f')}"
                     f"{predicted}; residual standard deviation {a.rmse:.4g}"
                     + (" of the jackknife values." if a.transform == "spread"
                        and a.seeding == "common" else "."))
    if a.lenth is not None:
        unit = f" {a.unit}" if a.unit else ""
        lines.append(
            f"Lenth: the pseudo standard error is {a.lenth.pse:.4g}{unit}. A single effect is "
            f"significant above {a.lenth.me:.4g}{unit}, the largest of all above "
            f"{a.lenth.sme:.4g}{unit}."
        )
    for word, test in (("Lack of fit", a.lack_of_fit), ("Curvature", a.curvature)):
        if test is not None:
            lines.append(f"{word}: F({test.df:.4g}, {test.df_error:.4g}) = {test.f:.4g}, "
                         f"p {p_value(test.p) if test.p < 1e-300 else f'= {p_value(test.p)}'}.")
    if a.practical is not None:
        lines.append(f"An effect matters if its whole interval lies beyond {limit_of(a)}.")
    if a.reduced:
        lines.append("Main effects only: the design points cannot tell the interactions of two "
                     "factors apart.")
    if a.aliases:
        pairs = [f"{term} with {', '.join(same)}" for term, same in a.aliases.items()]
        lines.append(f"Aliased: {first_of(pairs, MAX_LISTED, '; ')}.")
    return lines
