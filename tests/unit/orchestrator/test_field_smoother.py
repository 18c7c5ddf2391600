"""The smoother for beacons on the bottom and buoys, with offsets and a scale of the ranges."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sblcosim
from sblcosim.data import samples
from sblcosim.errors import ConfigurationError
from sblcosim.estimation import field, model, smoother
from sblcosim.estimation.after import assumed
from sblcosim.models.receiver.field import POSITION, SPEED, error
from sblcosim.results.result import Result

SHORT = {"time.duration_s": 90.0}
OFFSETS = np.array([0.8, -1.1, 0.3, 1.4])


@pytest.fixture(scope="module", params=["gps-buoys", "harbour-lbl"])
def run(request: pytest.FixtureRequest) -> Result:
    q = {"receiver.acceleration_psd_m2_s3": 0.003}
    return sblcosim.run(request.param, "long_baseline", SHORT | q)


def with_ranges(
    run: Result, offsets: np.ndarray | float = 0.0, scale: float = 1.0
) -> Result:
    """The run with other ranges, without the receivers that had them as they were."""
    values = {
        name: values for name, values in run.record.values.items()
        if not name.startswith("long_baseline.")
    }
    values["acoustics.range"] = values["acoustics.range"] * scale + offsets
    description = replace(run.description, receivers=["raw"])
    return Result(description, replace(run.record, values=values), run.update_interval_ns)


def rms_and_nees(smoothed: sblcosim.Smoothed) -> tuple[float, float]:
    table = smoothed.result.tracks["smoother"]
    return (
        float(np.sqrt((table["error_total_m"] ** 2).mean())), float(table["nees_position"].mean())
    )


def dive(run: Result, offset_std: float = 0.0) -> tuple[Any, samples.Samples]:
    scenario = assumed(run.scenario, (), "long_baseline")
    start = run.record.values["target.position"][0]
    p = field.with_unknowns(
        model.parameters(scenario, start, field.IN_FIELD.component), offset_std, 0.0
    )
    return p, samples.of_record(run.record, np.zeros((4, 3)), samples.OWN)


def test_the_rows_are_the_derivatives_of_the_ranges(run: Result) -> None:
    p, received = dive(run, 1.0)
    rng = np.random.default_rng(1)
    at = field.trajectory(run.record, "long_baseline", p, received)
    at[:, 9:] = rng.normal(0, 0.5, at[:, 9:].shape)
    rows = model.rows(p, received, at, field.IN_FIELD)
    for i in range(field.states(p)):
        step = np.zeros(field.states(p))
        step[i] = 1e-5
        two = [model.rows(p, received, at + s * step, field.IN_FIELD).residual for s in (1, -1)]
        np.testing.assert_allclose((two[1] - two[0]) / 2e-5, rows.H[:, i], atol=1e-5)


def test_each_beacon_has_its_offset(run: Result) -> None:
    p, received = dive(run, 1.0)
    at = field.trajectory(run.record, "long_baseline", p, received)
    off = at.copy()
    off[:, field.offsets(p)] = OFFSETS
    one, other = (model.rows(p, received, x, field.IN_FIELD) for x in (at, off))
    difference = (one.residual - other.residual)[one.is_range]
    np.testing.assert_allclose(difference, OFFSETS[received.beacon], atol=1e-9)


def test_it_is_better_than_the_filter(run: Result) -> None:
    smoothed = sblcosim.smooth(run)
    assert smoothed.believable
    rms, nees = rms_and_nees(smoothed)
    errors = run.errors.xs("total", level="axis").xs("absolute", level="frame")
    assert rms < errors.rms_m["long_baseline"]
    assert nees < 9
    origin = smoothed.result.origins["smoother"]["parameters"]
    assert origin.keys() == {v.name for v in field.IN_FIELD.component.of("parameter")}


def test_the_receiver_is_run_on_the_record_where_it_was_not_in_the_run(run: Result) -> None:
    alone = sblcosim.smooth(with_ranges(run))
    assert np.array_equal(alone.track.mean, sblcosim.smooth(run).track.mean)


def test_the_error_of_each_beacon_is_estimated(run: Result) -> None:
    smoothed = sblcosim.smooth(run)
    truth = run.record.values["platform.beacon_position"][-1]
    said = run.record.values["acoustics.ping_beacon_position"][-1]
    for i in range(4):
        down = error(i)[2]
        spread = np.sqrt(smoothed.track.covariance[-1, down, down])
        off = smoothed.track.mean[-1, down] - (truth - said)[i, 2]
        assert abs(off) < 4 * np.hypot(spread, 0.3)


def test_offsets_of_the_ranges_are_estimated(run: Result) -> None:
    off = with_ranges(run, OFFSETS)
    told, untold = sblcosim.smooth(off, range_offset_std_m=1.0), sblcosim.smooth(off)
    assert rms_and_nees(told)[1] < 9
    assert rms_and_nees(told)[1] < 0.7 * rms_and_nees(untold)[1]
    p, _ = dive(run)
    found = told.track.mean[-1, field.offsets(p)]
    # The clock shares what is common to all.
    assert np.abs((found - found.mean()) - (OFFSETS - OFFSETS.mean())).max() < 1.0


def test_a_scale_of_the_ranges_is_estimated(run: Result) -> None:
    scaled = with_ranges(run, scale=1.08)
    told, untold = sblcosim.smooth(scaled, range_scale_std=0.1), sblcosim.smooth(scaled)
    assert rms_and_nees(told)[0] < rms_and_nees(untold)[0]
    plain = sblcosim.smooth(run).track.mean[-1, SPEED]
    assert told.track.mean[-1, SPEED] == pytest.approx(1.08 * (1 + plain) - 1, abs=0.02)


def test_the_track_is_where_the_gradient_is_zero(run: Result) -> None:
    """A first trajectory some metres off leads to the same track."""
    p, received = dive(run)
    at = field.trajectory(run.record, "long_baseline", p, received)
    off = at.copy()
    off[:, list(POSITION)] += [4.0, -3.0, 1.0]
    one, other = (smoother.smooth(p, received, x, of=field.IN_FIELD) for x in (at, off))
    assert one.converged
    assert other.converged
    move = (one.mean - other.mean)[len(at) // 4 :, list(POSITION)]
    assert np.abs(move).max() < 0.1


@pytest.mark.parametrize("key", ["range_offset_std_m", "range_scale_std"])
def test_unknowns_of_the_ranges_must_be_of_beacons_with_their_own_errors(
    run: Result, key: str
) -> None:
    with pytest.raises(ConfigurationError, match=f"{key}: must be at least 0, got -1"):
        sblcosim.smooth(run, **{key: -1.0})
    with pytest.raises(ConfigurationError, match=f"{key}: must be at least 0, got nan"):
        sblcosim.smooth(run, **{key: float("nan")})
    boat = sblcosim.run("realistic-dive", "coupled", {"time.duration_s": 20.0})
    with pytest.raises(ConfigurationError, match=f"{key}: must be 0 for beacons on one platform"):
        sblcosim.smooth(boat, **{key: 0.5})
