"""Estimates that are judged without a record, with and without a truth."""

from __future__ import annotations

import numpy as np
import pytest
import sblcosim
from sblcosim.data import samples, truth
from sblcosim.data.estimates import Estimates
from sblcosim.data.record import Record
from sblcosim.data.samples import Samples
from sblcosim.data.truth import Truth
from sblcosim.errors import ConfigurationError
from sblcosim.estimation import model
from sblcosim.estimation.after import assumed
from sblcosim.judge import metrics
from sblcosim.judge.definitions import judged_by
from sblcosim.judge.without_truth import agreement, innovations, residuals
from sblcosim.results.result import Result

SECOND = 1_000_000_000
EPOCHS = np.array([1, 2, 4, 8]) * SECOND
STRAIGHT = np.column_stack([EPOCHS / SECOND, np.full(4, 2.0), np.full(4, 5.0)])
BEACONS = np.array([[10.0, 0.0, 0.0], [0.0, 10.0, 1.0], [-10.0, 0.0, 0.0]])


@pytest.fixture(scope="module")
def run() -> Result:
    return sblcosim.run("realistic-dive", ["sequential", "coupled"], {"time.duration_s": 30.0})


def heard(range_ns: np.ndarray, where: np.ndarray, off: float = 0.0) -> Samples:
    """Ranges from the beacons in turn, too long by `off`, and depths, too great by it."""
    beacon = np.arange(len(range_ns)) % 3
    return Samples(
        0, range_ns, where[:, 2] + off, range_ns, beacon,
        np.linalg.norm(where - BEACONS[beacon], axis=1) + off,
        np.zeros(len(range_ns), bool), BEACONS[beacon], np.zeros((len(range_ns), 3)),
    )


def test_of_a_run_they_are_judged_as_in_its_tables(run: Result) -> None:
    """Estimates and truth as plain tables of one's own: the same errors and NEES, to the bit."""
    values = run.record.values
    known = Truth(
        time_ns=run.record.time_ns, position=values["target.position"],
        velocity=values["target.velocity"], platform_time_ns=run.record.time_ns,
        platform_position=values["platform.position"],
        platform_error=truth.platform_errors(run.record),
    )
    given = run.record.estimates("coupled")
    own = Estimates(
        epoch_ns=given.epoch_ns, position=given.position, velocity=given.velocity,
        covariance=given.covariance, nis=given.nis, nis_degrees=given.nis_degrees,
        relative_position=given.relative_position, relative_covariance=given.relative_covariance,
        position_std=given.position_std,
    )
    judged = {"coupled": metrics.intact("coupled", own, known)}
    tracks = {"coupled": metrics.track(judged["coupled"])}
    assert tracks["coupled"].equals(run.tracks["coupled"])
    assert metrics.error_table(tracks).equals(run.errors.loc[["coupled"]])
    row = metrics.summary(judged, tracks, known).loc["coupled"]
    said = run.summary.loc["coupled"]
    for name in said.index:
        if name not in ("availability", "update_share"):
            assert row[name] == said[name] or np.isnan(row[name]), name
    assert row["availability"] == 1 - given.epoch_ns[0] / run.record.time_ns[-1]


def test_without_the_platform_there_are_absolute_errors_only() -> None:
    estimates = Estimates(
        epoch_ns=EPOCHS, position=STRAIGHT + np.array([0, 3, 4]),
        covariance=np.tile(np.eye(6), (4, 1, 1))
    )
    known = Truth(time_ns=EPOCHS, position=STRAIGHT)
    judged = {"mine": metrics.intact("mine", estimates, known)}
    tracks = {"mine": metrics.track(judged["mine"])}
    table = metrics.error_table(tracks)
    assert {frame for _, frame, _ in table.index} == {"absolute"}
    assert table.loc[("mine", "absolute", "total"), "rms_m"] == 5.0
    row = metrics.summary(judged, tracks, known).loc["mine"]
    assert row["nees_position"] == 25.0
    assert str(row["lost"]) == "<NA>"


def test_between_positions_without_velocity_the_diver_goes_straight_on() -> None:
    at = np.array([1, 3, 8]) * SECOND
    estimates = Estimates(epoch_ns=at, position=np.zeros((3, 3)))
    judged = judged_by(estimates, Truth(time_ns=EPOCHS, position=STRAIGHT))
    assert judged.true_position[:, 0].tolist() == [1.0, 3.0, 8.0]
    assert np.isnan(judged.true_velocity).all()
    outside = judged_by(
        Estimates(epoch_ns=np.array([0, 9 * SECOND]), position=np.zeros((2, 3))),
        Truth(time_ns=EPOCHS, position=STRAIGHT),
    )
    assert outside.broken.all()


@pytest.mark.parametrize(
    ("time_ns", "shape", "why"),
    [
        ([], (0, 3), "must have instants that increase, got none"),
        ([2, 1], (2, 3), "must have instants that increase, got some that do not"),
        ([1, 1], (2, 3), "must have instants that increase, got some that do not"),
        ([1, 2], (3, 3), r"each of 2 instants, got shape \(3, 3\)"),
        ([1, 2], (2, 2), r"each of 2 instants, got shape \(2, 2\)"),
    ],
)
def test_a_truth_that_is_none_is_refused(
    time_ns: list[int], shape: tuple[int, int], why: str
) -> None:
    with pytest.raises(ConfigurationError, match=why):
        Truth(time_ns=np.array(time_ns, np.int64), position=np.zeros(shape))


def test_a_record_without_the_truth_says_what_it_lacks(run: Result) -> None:
    values = {k: v for k, v in run.record.values.items() if not k.startswith("platform.")}
    with pytest.raises(ConfigurationError, match=r"record: .* got no platform\.position, "):
        truth.of_record(Record(run.record.time_ns, values))


@pytest.mark.parametrize("off", [0.0, -0.25, 2.0])
def test_residuals_are_what_is_too_long(off: float) -> None:
    estimates = Estimates(epoch_ns=EPOCHS, position=STRAIGHT)
    times = np.array([0, 1, 2, 3, 5, 6, 7, 9]) * SECOND  # the first and the last do not count
    where = np.column_stack([times / SECOND, np.full(8, 2.0), np.full(8, 5.0)])
    table = residuals(estimates, heard(times, where, off))
    assert [*table.index] == ["beacon 1", "beacon 2", "beacon 3", "depth"]
    assert table["n"].tolist() == [2, 2, 2, 6]
    np.testing.assert_allclose(table["mean_m"], off, atol=1e-12)
    np.testing.assert_allclose(table["median_m"], off, atol=1e-12)
    np.testing.assert_allclose(table["rms_m"], abs(off), atol=1e-12)


def test_residuals_of_a_run_are_those_of_a_computation_by_hand(run: Result) -> None:
    p = model.parameters(assumed(run.scenario, ()), run.record.values["target.position"][0])
    received = samples.of_record(run.record, p.beacon_offset)
    with pytest.raises(ConfigurationError, match="body: must be the positions of the beacons"):
        residuals(run.record.estimates("coupled"), received)
    table = residuals(run.record.estimates("coupled"), received, p.beacon_offset)
    # Where a packet says that its own beacon is, is what its pose and the arms say.
    own = samples.of_record(run.record, p.beacon_offset, 3)
    np.testing.assert_allclose(
        received.beacon_position(p.beacon_offset), own.position, atol=1e-9
    )
    estimates = run.record.estimates("coupled")
    k = [i for i in range(len(own.range)) if own.range_ns[i] in estimates.epoch_ns]
    assert len(k) > 15
    by_hand: dict[int, list[float]] = {}
    for i in k:
        (at,) = np.flatnonzero(estimates.epoch_ns == own.range_ns[i])
        distance = np.linalg.norm(estimates.position[at] - own.position[i])
        by_hand.setdefault(int(own.beacon[i]), []).append(own.range[i] - distance)
    for beacon, values in by_hand.items():
        row = table.loc[f"beacon {beacon + 1}"]
        assert row["n"] == len(values)
        assert row["rms_m"] == pytest.approx(np.sqrt(np.mean(np.square(values))), rel=1e-9)


def test_receivers_agree_as_far_as_they_are_apart() -> None:
    one = Estimates(epoch_ns=EPOCHS, position=STRAIGHT)
    later = np.array([3, 6, 9]) * SECOND
    other = Estimates(
        epoch_ns=later, position=np.column_stack([later / SECOND, [5.0] * 3, [9.0] * 3])
    )
    never = Estimates(epoch_ns=later + 100 * SECOND, position=np.zeros((3, 3)))
    table = agreement({"one": one, "other": other, "never": never})
    assert table.loc[("one", "other")].tolist() == [3.0, 5.0, 5.0, 2]
    assert table.loc[("one", "never"), "n"] == 0
    assert np.isnan(table.loc[("one", "never"), "total_rms_m"])
    assert agreement({"one": one}).empty
    none = Estimates(epoch_ns=np.zeros(0, np.int64), position=np.zeros((0, 3)))
    assert agreement({"one": one, "none": none})["n"].tolist() == [0]


def test_innovations_are_those_of_the_summary(run: Result) -> None:
    names = ["sequential", "coupled", "raw"]
    table = innovations({name: run.record.estimates(name) for name in names})
    assert [*table.index] == [name for name in names if run.summary.nis.notna()[name]]
    silent = Estimates(epoch_ns=EPOCHS, position=STRAIGHT)
    assert innovations({"silent": silent}).empty
    for name in table.index:
        for column in table.columns.drop("n"):
            assert table.loc[name, column] == run.summary.loc[name, column], column
