"""Progress of studies whose points differ in length: each run counts as many times as it steps."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from sblcosim.simulation import execution
from sblcosim.simulation.how import How
from sblcosim.study import batch, campaign, definition, runner, study
from seams import Seam

STEPS = (20, 50, 4, 10)
"""Of the runs of each point: 2 s or 5 s, at 0.1 s or 0.5 s."""


def uneven(**changes: Any) -> definition.Study:
    return study.load({
        "name": "uneven", "scenario": "paper-scenario-1", "replicates": 3,
        "factors": {
            "length": {"keys": ["time.duration_s"], "levels": [2.0, 5.0]},
            "tick": {"keys": ["time.sampling_time_s"], "levels": [0.1, 0.5]},
        },
        **changes,
    })  # fmt: skip


def together(runs: Sequence[campaign.CampaignRun]) -> list[int]:
    """Steps of the runs of each point, in the order of the points."""
    return [STEPS[p] * n for p in range(4) if (n := sum(run.place == p for run in runs))]


def one_by_one(runs: Sequence[campaign.CampaignRun]) -> list[int]:
    return [STEPS[p] for p in range(4) for run in runs if run.place == p]


@pytest.mark.parametrize("master", [None, "native"])
def test_the_share_that_is_done_is_that_of_the_steps(master: str | None) -> None:
    shares: list[float] = []
    how = How(master, workers=1, progress=shares.append)
    made = campaign.prepare(uneven(), how)
    runs = campaign.batch(made, 1, 3)[2:-1]
    table = batch.simulate(made, runs, how)
    steps = together(runs) if master is None else one_by_one(runs)
    done = np.array([*accumulate(steps)]) / sum(steps)
    told = np.array(shares)
    np.testing.assert_allclose(told[np.append(True, np.diff(told) > 0)], done, rtol=1e-12)
    assert table["error"].isna().all()
    # The first estimate comes after an update or two.
    share = table["ekf.availability"] * table["length"] / table["tick"]
    missing = table["length"] / table["tick"] - share
    assert missing.round(9).between(0.0, 3.0).all()


def test_sound_runs_in_lanes_are_not_done_again(seam: Seam) -> None:
    def never(*_: Any) -> Any:
        raise AssertionError("a run was done alone")

    seam.instead(execution.survive, never)
    made = campaign.prepare(uneven(replicates=1))
    table = batch.simulate(made, campaign.batch(made, 1, 1), How(workers=1))
    assert table["error"].isna().all()


@pytest.mark.parametrize("kept", [True, False])
def test_parts_of_a_study_count_by_their_steps(kept: bool, tmp_path: Path, seam: Seam) -> None:
    """In a folder or without one, two replicates at a time."""
    seam.tuned(batch=8)
    shares: list[float] = []
    how = How(workers=1, progress=shares.append)
    if kept:
        runner.carry_out(uneven(), tmp_path / "out", how)
        assert shares.pop() == 1.0
    else:
        runner.simulated(uneven(), how)
    made = campaign.prepare(uneven())
    steps = [n for first in (1, 3) for n in together(campaign.batch(made, first, 2))]
    done = np.array([*accumulate(steps)]) / (3 * sum(STEPS))
    told = np.array(shares)
    np.testing.assert_allclose(told[np.append(True, np.diff(told) > 0)], done, rtol=1e-12)


def test_runs_one_by_one_are_stored_a_few_at_a_time(tmp_path: Path) -> None:
    made = uneven(replicates=18, factors={
        "arm": {"keys": ["platform.arm_length_m"], "levels": [0.4, 3.0]}
    }, fixed={"time": {"duration_s": 0.5}})  # fmt: skip
    how = How("native", workers=2)
    prepared = campaign.prepare(made, how)
    assert runner.kept_together(prepared, how) == 2 * runner.KEPT_ALONE == 8
    runner.carry_out(made, tmp_path / "out", how)
    parts = sorted((tmp_path / "out" / "parts").glob("*.parquet"))
    assert [len(pd.read_parquet(part)) for part in parts] == [32, 4]
