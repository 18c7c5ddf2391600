"""The sums of a recorded run are those that the lanes master makes while it goes on."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sblcosim
from sblcosim import lanes, metrics
from sblcosim.masters import execute
from sblcosim.plan import resolve
from sblcosim.reduction import SUMS, responses, sums_of

RECEIVERS = ("ekf", "sequential", "multilateration")


@pytest.mark.parametrize(
    ("scenario", "overrides"),
    [
        ("paper-scenario-1", {"time.duration_s": 20.0}),
        ("paper-scenario-3", {"time.duration_s": 20.0, "acoustics.loss_probability": 0.25}),
        ("realistic-dive", {"time.duration_s": 60.0}),
        ("realistic-dive", {"time.duration_s": 60.0, "time.ekf_ratio": 5}),
    ],
)
def test_a_record_gives_the_sums_of_the_lanes_to_the_last_bit(
    scenario: str, overrides: dict[str, Any]
) -> None:
    plan = resolve(sblcosim.load(scenario, overrides).system(RECEIVERS))
    settling = 5_000_000_000
    outcome = lanes.execute(plan, {}, settling_ns=settling, lanes=1)
    record = execute(plan, master="native")
    for receiver in RECEIVERS:
        np.testing.assert_array_equal(
            sums_of(record, receiver, settling), outcome.sums[receiver][0], err_msg=receiver
        )
    assert outcome.sums["ekf"][0][SUMS.index("nees_estimates")] > 0


def test_estimates_that_are_not_finite_or_of_an_unknown_epoch_are_broken() -> None:
    plan = resolve(
        sblcosim.load("paper-scenario-1", {"time.duration_s": 20.0}).system(["ekf"])
    )
    record = execute(plan, master="native")
    good = responses(sums_of(record, "ekf")[None], plan.stop_ns)
    assert not good.broken[0]
    values = dict(record.values)
    values["ekf.position"] = values["ekf.position"].copy()
    values["ekf.position"][50, 0] = np.nan
    values["ekf.epoch"] = values["ekf.epoch"].copy()
    values["ekf.epoch"][100] += 0.01
    values["ekf.epoch"][150] -= 7.0  # longer ago than the truth is remembered
    sums = sums_of(replace(record, values=values), "ekf")
    assert sums[SUMS.index("broken")] == 3
    assert responses(sums[None], plan.stop_ns).estimates[0] == good.estimates[0] - 3


def test_the_inconsistent_runs_are_those_of_the_metrics() -> None:
    for gps in (0.1, 3.5):
        plan = resolve(
            sblcosim.load(
                "paper-scenario-1",
                {"time.duration_s": 20.0, "platform.gps_horizontal_std_m": gps,
                 "receiver.measurement_noise": "variance"},
            ).system(["ekf"])
        )
        record = execute(plan, master="native")
        summary = metrics.summary(record, {"ekf": metrics.track(record, "ekf")})
        ours = responses(sums_of(record, "ekf")[None], plan.stop_ns)
        assert bool(ours.inconsistent[0]) == bool(summary.loc["ekf", "inconsistent"])
        assert bool(ours.lost[0]) == bool(summary.loc["ekf", "lost"])
