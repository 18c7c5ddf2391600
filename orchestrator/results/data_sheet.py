"""The sentence for a data sheet: how large errors are in 95 % of the estimates, where, and when."""

from __future__ import annotations

from math import ceil, log

from ..scenario.conditions import conditions
from ..scenario.scenario import Scenario
from ..words.lists import counted
from ..words.numbers import meters_at_most

SHARE = 0.95
"""Of the estimates."""
CERTAIN = 2.0
"""Standard errors by which the sentence's length is more than the estimated one."""
LEAST_RUNS = ceil(log(1 - SHARE) / log(SHARE))
"""Runs of which, with 95 % confidence, one at least is beyond what 95 % of all runs are within: 59.
From fewer, no bound is known that assumes nothing of the runs."""
_KINDS = {
    "absolute_total": "",
    "absolute_horizontal": " horizontally",
    "relative_total": " relative to the platform",
    "relative_horizontal": " relative to the platform, horizontally",
}
"""Errors of a length, behind it."""


def sentence(
    receiver: str, bound_m: float, where: str, scenario: Scenario, runs: str, error: str
) -> str:
    """The sentence.

    Parameters
    ----------
    bound_m
        What 95 % of the lengths are within: the estimate and `CERTAIN` standard errors [m].
    where
        Distance and depth, in words.
    scenario
        Names the conditions.
    runs
        How many there were, in words.
    error
        Which length, of `sblcosim.simulation.masters.lanes_driver.LENGTHS`.
    """
    parts = [where, *conditions(scenario), runs]
    return (
        f"{receiver}: 95 % of the estimates are within {meters_at_most(bound_m)}{_KINDS[error]} "
        f"{', '.join(parts)}"
    )


def too_few(runs: int, where: str = "", least: int = LEAST_RUNS) -> str:
    """That there is no sentence from so few runs."""
    more = f"{least} are needed, {least - runs} more"
    return f"no data-sheet sentence from {counted(runs, 'run')}{where}: {more}"


NOTE = (
    "the data-sheet sentence has the 95 % error plus two standard errors, rounded up; it includes "
    "lost runs"
)
"""What its length is."""
