"""Parts of the sentences of an answer: numbers, bounds, missing runs, errors to be rid of."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

from ..comparison.statistics import share_interval
from .limiting import Limiting
from .sequential import MOST_RUNS, Rule


def figure(value: float) -> str:
    """A value in a table."""
    return f"{value:.3g}" if isfinite(value) else "–"


def span(low: float, high: float) -> str:
    """The bounds of a percentile, as far as there are any."""
    ends = [(low, "≥"), (high, "≤")]
    return ", ".join(f"{sign} {figure(end)}" for end, sign in ends if isfinite(end)) or "–"


def counted(number: int, verb: str) -> str:
    """How many do something."""
    return f"{number} {verb}{'s' if number == 1 else ''}"


def joined(names: Sequence[str]) -> str:
    """Names for a sentence."""
    *most, last = names
    return f"{', '.join(most)} and {last}" if most else last


def missing(rule: Rule, passed: int, runs: int) -> str:
    """How many runs would decide an arm of which so many have passed."""
    needed = rule.runs_to_decide(passed, runs)
    if needed is not None:
        return f"If its share stayed so, {needed:,} runs of it would decide it."
    text = f"If its share stayed so, not even {MOST_RUNS:,} runs of it would decide it."
    ends = share_interval(passed, runs)
    at_ends = [rule.runs_to_decide(end * runs, runs) for end in ends]
    if None in at_ends:
        return text
    low, high = (f"{100 * end:.4g} %" for end in ends)
    return (
        f"{text} But after {runs:,} runs the share may as well be {low} or {high} (95 % interval): "
        f"then {at_ends[0]:,} or {at_ends[1]:,} would."
    )


def enough(found: Limiting, limit: float) -> str:
    """Without which errors a design that fails would do."""
    if not found.enough:
        return "Not even without all of them would it do."
    alone = [name for name, value in found.without.items() if value <= limit]
    if len(alone) > 1:
        return f"It would do without any one of {joined(alone)}."
    if alone:
        return f"It would do without {alone[0]} alone."
    few = joined(found.enough)
    return f"It would do without {few} together, but not without one of them alone."
