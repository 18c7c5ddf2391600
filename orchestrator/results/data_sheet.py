"""The sentence for a data sheet: how large errors are in 95 % of the estimates, where, and when."""

from __future__ import annotations

from math import ceil, log

from ..scenario.conditions import conditions
from ..scenario.scenario import Scenario
from ..words.lists import counted
from ..words.numbers import meters_at_most

SHARE = 0.95
"""Share of the estimates that the sentence is about."""
CERTAIN = 2.0
"""Standard errors that the sentence adds to the estimated length."""
LEAST_RUNS = ceil(log(1 - SHARE) / log(SHARE))
"""Runs from which, with 95 % confidence, at least one exceeds the 95th percentile of all runs: 59.
With fewer, there is no bound that assumes nothing about the runs."""
_KINDS = {
    "absolute_total": "",
    "absolute_horizontal": " horizontally",
    "relative_total": " relative to the platform",
    "relative_horizontal": " relative to the platform, horizontally",
}
"""What follows the length, by kind of error."""


def sentence(
    receiver: str, bound_m: float, where: str, scenario: Scenario, runs: str, error: str
) -> str:
    """The sentence.

    Parameters
    ----------
    bound_m
        Radius that holds 95 % of the estimates, plus `CERTAIN` standard errors [m].
    where
        Distance and depth, in words.
    scenario
        The scenario, for the conditions.
    runs
        The number of runs, in words.
    error
        Kind of length, from `sblcosim.simulation.masters.lanes_driver.LENGTHS`.
    """
    parts = [where, *conditions(scenario), runs]
    return (
        f"{receiver}: 95 % of the estimates are within {meters_at_most(bound_m)}{_KINDS[error]} "
        f"{', '.join(parts)}"
    )


def too_few(runs: int, where: str = "", least: int = LEAST_RUNS) -> str:
    """The sentence that says how many more runs are needed."""
    more = f"{least} are needed, {least - runs} more"
    return f"no data-sheet sentence from {counted(runs, 'run')}{where}: {more}"


NOTE = (
    "the data-sheet sentence has the 95 % error plus two standard errors, rounded up; it includes "
    "lost runs"
)
"""What the length in the sentence includes."""
