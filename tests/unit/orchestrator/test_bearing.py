"""Whether a receiver knows the diver's bearing from the platform, and what is said if not."""

from __future__ import annotations

from dataclasses import replace
from math import cos, sin
from pathlib import Path

import numpy as np
import pytest
import sblcosim
from made_logs import written
from sblcosim import process
from sblcosim.data import bearing
from sblcosim.data.estimates import Estimates
from sblcosim.judge.without_truth import unknown_bearings


def seen(std: float, count: int = 40, distance: float = 20.0) -> Estimates:
    """Estimates whose bearing has this standard deviation [rad], in every direction."""
    epochs = np.arange(count) * 10**9
    along = np.linspace(0.0, 6.0, count)
    y = distance * np.column_stack([np.cos(along), np.sin(along), np.full(count, 0.3)])
    P = np.zeros((count, 6, 6))
    for i, angle in enumerate(along):
        outwards = np.array([cos(angle), sin(angle)])
        across = np.array([-sin(angle), cos(angle)])
        flat = (std * distance) ** 2 * np.outer(across, across) + 900 * np.outer(outwards, outwards)
        P[i, ::2, ::2][:2, :2] = flat
    return Estimates(epoch_ns=epochs, position=y, covariance=P, relative_position=y)


@pytest.mark.parametrize(("std", "unknown"), [(0.1, False), (1.4, False), (1.43, True), (9, True)])
def test_a_bearing_is_unknown_above_a_variance_of_two(std: float, unknown: bool) -> None:
    found = bearing.is_unknown(seen(std))
    assert found is not None
    assert found.shape == (40,)
    assert set(found.tolist()) == {unknown}


@pytest.mark.parametrize(("across_m", "unknown"), [(1.0, False), (2.8, False), (2.9, True)])
def test_next_to_the_platform_a_small_ring_misleads_nobody(across_m: float, unknown: bool) -> None:
    found = bearing.is_unknown(seen(across_m / 0.1, distance=0.1))
    assert set(found.tolist()) == {unknown}


def test_it_is_said_of_a_receiver_that_often_does_not_know_it() -> None:
    known, unknown = seen(0.1), seen(3.0)
    some = {n: replace(known, covariance=np.concatenate([unknown.covariance[:n],
                                                         known.covariance[n:]])) for n in (2, 3)}
    without = replace(unknown, relative_position=None)
    none = replace(unknown, covariance=None)
    said = [*unknown_bearings({"a": known, "b": some[2], "c": some[3], "d": without, "e": none,
                              "f": unknown})]
    assert [it.partition(" ")[0] for it in said] == ["c", "f"]
    assert "in 8 % of its estimates" in said[0]
    assert "in 100 % of its estimates" in said[1]


@pytest.mark.slow
def test_a_run_and_its_log_say_it(tmp_path: Path) -> None:
    """Three beacons on short arms, of which most packets are lost: the diver is on a ring."""
    run, log = written(tmp_path, "paper-scenario-1", "coupled", overrides={
        "seed": 1, "platform.beacons": 3, "platform.arm_length_m": 0.3, "time.duration_s": 120.0,
        "acoustics.range_std_m": 3.0, "acoustics.loss_probability": 0.8,
        "time.sampling_time_s": 1.0,
    })  # fmt: skip
    (said,) = (it for it in run.remarks if "bearing" in it)
    assert said.startswith("coupled does not know the diver's bearing from the platform in ")
    assert said in str(run)
    assert [it for it in process(log, ["coupled"]).remarks if "bearing" in it] == [said]
    usual = sblcosim.run("paper-scenario-1", "coupled", {"seed": 1, "time.duration_s": 60.0})
    assert not any("bearing" in it for it in usual.remarks)
