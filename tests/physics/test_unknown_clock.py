"""Clocks that nobody set: the distance is hardly known at first, and nobody claims to know it."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
import sblcosim

from .from_the_model import dive, platform

RUNS = 200
AGED = {"acoustics.clock_grade": "crystal", "acoustics.clock_sync_age_s": 1800.0}
"""The common error of all ranges is 27 m (standard deviation)."""


def runs(scenario: object, receiver: str, keys: dict[str, object]) -> pd.DataFrame:
    table = sblcosim.run_many(scenario, receiver, keys, runs=RUNS).runs.table
    own = table[[name for name in table.columns if name.startswith(f"{receiver}.")]]
    return own.rename(columns=lambda name: name.partition(".")[2])


def rms(found: pd.DataFrame) -> float:
    return float(np.sqrt((found.absolute_total_rms_m**2).mean()))


@pytest.mark.parametrize(("base", "most"), [("realistic-dive", 7.0), ("harbour-square", 4.5)])
@pytest.mark.parametrize("age", [600.0, 1800.0])
def test_coupled_does_not_believe_to_be_next_to_the_platform(
    base: str, most: float, age: float
) -> None:
    found = runs(base, "coupled", {**AGED, "acoustics.clock_sync_age_s": age})
    assert found.misleading.mean() <= 0.03
    assert (found.nees_position > 15).mean() <= 0.01
    assert found.nees_position.mean() < 3.2
    assert found.own_relative_nees_position.mean() < 3.2
    assert rms(found) < most
    assert not found.lost.any()


@pytest.mark.parametrize(("base", "median"), [("harbour-lbl", 0.6), ("gps-buoys", 0.9)])
def test_a_long_baseline_needs_no_clock(base: str, median: float) -> None:
    found = runs(base, "long_baseline", AGED)
    assert found.absolute_total_rms_m.median() < median
    assert found.absolute_total_rms_m.quantile(0.98) < 1.5
    assert found.lost.mean() <= 0.01
    assert not found.misleading.any()
    assert found.nees_position.mean() < 3.0


@pytest.mark.parametrize("away", [30.0, 100.0])
def test_differences_of_arrivals_claim_no_distance_at_first(away: float) -> None:
    """Without a common clock, from first receptions."""
    known = dive(
        {"sampling_time_s": 0.5, "duration_s": 60.0},
        {**platform(3.0), "misalignment_heading_std_deg": 0.5},
        {"ranging": "inverted", "range_std_m": 0.05, "common_clock": False,
         "loss_probability": 0.15, "sound_speed_m_s": 1530.0}, {}, start=(away, 0.0, 15.0),
    )
    tables = {**known.model_dump(exclude_unset=True), "receiver": {"acceleration_psd_m2_s3": 0.002}}
    found = runs(sblcosim.load(tables), "array", {})
    assert found.nees_position.mean() < 4.0
    assert found.misleading.mean() <= 0.04
