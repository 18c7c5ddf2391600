"""Inverted ranging over many seeds: near the bound where everything is drawn from the model."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from sblcosim import limits
from sblcosim.results.sums import responses
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.resolve import resolve

from .from_the_model import dive, platform
from .test_coupled_seeds import TRUTH, judged, simulated

pytestmark = pytest.mark.slow
RUNS = 800
BOUNDED = 100
"""Runs over which the bound is averaged; it varies by little."""


@pytest.mark.parametrize(("arm", "noise", "resolution", "heading"), [
    (3.0, 0.05, 0.0, 0.0), (0.4, 0.05, 0.0, 0.0), (3.0, 0.02, 0.15, 0.0), (3.0, 0.05, 0.0, 3.0),
])
def test_where_motion_errors_and_biases_are_drawn_it_is_near_the_bound(
    arm: float, noise: float, resolution: float, heading: float
) -> None:
    """The clock, the speed of sound and the alignment of the frame are drawn for each run."""
    scenario = dive(
        {"sampling_time_s": 0.5, "duration_s": 60.0},
        {**platform(arm), "misalignment_heading_std_deg": heading},
        {"ranging": "inverted", "range_std_m": noise, "range_resolution_m": resolution,
         "loss_probability": 0.15, "clock_offset_std_s": 2e-4, "sound_speed_m_s": 1530.0},
        {"acceleration_psd_m2_s3": 0.002},
    )
    rng = np.random.default_rng(1)
    speeds = 1500.0 / (1 - 30.0 / 1530.0 * rng.standard_normal(RUNS))
    plan = resolve(connect(scenario, "coupled"))
    outcome = simulated(plan, RUNS, False, TRUTH, **{"acoustics.sound_speed": speeds})
    rms, nees, lost = judged(plan, outcome)
    table = responses(outcome.sums["coupled"], plan.stop_ns - plan.start_ns)
    of_runs: NDArray[np.float64] = np.asarray(table.absolute_total_rms_m) ** 2
    error = float(of_runs.std() / np.sqrt(RUNS) / (2 * rms**2))
    bound = float(np.sqrt(np.mean([
        limits.reference(outcome.record(i), scenario).verdict().absolute_rms ** 2
        for i in range(BOUNDED)
    ])))
    ratio = rms / bound
    print(arm, noise, resolution, heading,
          f"{rms:.3f} {bound:.3f} {ratio:.3f} ± {error:.3f} {nees:.2f}")
    assert lost == 0.0
    assert ratio < 1.1 + 2 * error * ratio
    assert 2.8 < nees < 3.3
