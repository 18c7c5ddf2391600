"""The smoother and the particle filter over 50 seeds; docs/howto/look-back.md has these numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
import sblcosim
from sblcosim.estimation.after import prepared

SEEDS = range(1, 51)
Case = tuple[str, dict[str, Any]]
REALISTIC: Case = ("realistic-dive", {})


def paper(
    gps: float, arm: float, T: float, ranges: float, loss: float, imu: float
) -> Case:
    """The paper's Scenario 1 with other levels; q is 0.01 m²/s³ there."""
    return "paper-scenario-1", {
        "platform.gps_horizontal_std_m": gps, "platform.arm_length_m": arm,
        "time.sampling_time_s": T, "acoustics.range_std_m": ranges,
        "acoustics.loss_probability": loss, "platform.imu_tilt_std_deg": imu,
        "platform.imu_heading_std_deg": imu,
    }


def heard(result: sblcosim.Result, label: str, since_s: float) -> pd.DataFrame:
    table = result.tracks[label]
    return table[table["epoch_s"] >= since_s]


def rms_and_nees(tables: list[pd.DataFrame]) -> tuple[float, float]:
    """Over all epochs of all runs."""
    whole = pd.concat(tables)
    return (
        float(np.sqrt((whole["error_total_m"] ** 2).mean())), float(whole["nees_position"].mean())
    )


def since_s(run: sblcosim.Result) -> float:
    """When three beacons had been heard."""
    first = prepared(run)[2].enough_ns()
    assert first is not None
    return first / 1e9


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "rms_m", "nees"),
    [
        (REALISTIC, 1.73, 2.9),
        (paper(3.5, 3.0, 1.0, 0.1, 0.25, 1.0), 0.57, 2.4),
        (paper(0.1, 3.0, 0.1, 0.1, 0.0, 1.0), 0.11, 2.3),
        (paper(0.1, 0.4, 1.0, 0.1, 0.25, 1.0), 1.20, 2.0),
    ],
)
def test_the_smoother_over_50_seeds(case: Case, rms_m: float, nees: float) -> None:
    tables, others = [], []
    for seed in SEEDS:
        run = sblcosim.run(case[0], "coupled", {**case[1], "seed": seed})
        result, since = sblcosim.smooth(run).result, since_s(run)
        tables.append(heard(result, "smoother", since))
        others.append(heard(result, "coupled", since))
    found, expected = rms_and_nees(tables), rms_and_nees(others)
    print(case, "smoother", found, "coupled", expected)
    assert found[0] == pytest.approx(rms_m, rel=0.05)
    assert found[1] == pytest.approx(nees, abs=0.4)
    assert found[0] < expected[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "rms_m"),
    [
        (paper(0.1, 0.4, 1.0, 0.1, 0.25, 1.0), 2.43),
        (paper(0.1, 3.0, 1.0, 1.0, 0.5, 1.0), 3.89),
        (paper(3.5, 0.4, 1.0, 1.0, 0.5, 10.0), 13.96),
    ],
)
def test_particles_are_no_better_than_coupled(case: Case, rms_m: float) -> None:
    tables, others = [], []
    for seed in SEEDS:
        run = sblcosim.run(case[0], "coupled", {**case[1], "seed": seed})
        result, since = sblcosim.research.particle_filter(run, seed=seed), since_s(run)
        tables.append(heard(result, "particle_filter", since))
        others.append(heard(result, "coupled", since))
    found, expected = rms_and_nees(tables), rms_and_nees(others)
    print(case, "particles", found, "coupled", expected)
    assert found[0] == pytest.approx(rms_m, rel=0.05)
    assert found[0] > 0.93 * expected[0]
