"""`coupled` beside the bound, where everything is drawn from the model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import sblcosim
from numpy.typing import NDArray
from sblcosim import limits
from sblcosim.results.sums import responses
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.resolve import resolve

from .test_coupled_seeds import TRUTH, judged, simulated

_BOUNDED = 100
"""Runs over which the bound is averaged; it varies by little."""


@dataclass(frozen=True)
class Found:
    """RMS error over the bound, the standard error of that ratio, mean NEES, share of lost runs."""

    ratio: float
    error: float
    nees: float
    lost: float

    @property
    def is_near(self) -> bool:
        """Whether the ratio is at most 1.1, within two standard errors."""
        return self.ratio < 1.1 + 2 * self.error


def found_in(
    scenario: sblcosim.Scenario, runs: int, receiver: str = "coupled", **varied: Any
) -> Found:
    """Many runs of a scenario with motion from the model, each with its own seed."""
    plan = resolve(connect(scenario, receiver))
    outcome = simulated(plan, runs, False, TRUTH, **varied)
    rms, nees, lost = judged(plan, outcome, receiver)
    table = responses(outcome.sums[receiver], plan.stop_ns - plan.start_ns)
    of_runs: NDArray[np.float64] = np.asarray(table.absolute_total_rms_m) ** 2
    error = float(of_runs.std() / np.sqrt(runs) / (2 * rms**2))
    bound = float(np.sqrt(np.mean([
        limits.reference(outcome.record(i), scenario).verdict().absolute_rms ** 2
        for i in range(_BOUNDED)
    ])))
    found = Found(rms / bound, error * rms / bound, nees, lost)
    print(found)
    return found
