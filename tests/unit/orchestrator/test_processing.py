"""Receivers on logs: `sblcosim.process`, the player, settings, alignment and what is told."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sblcosim
from made_logs import CORNERS, changed, in_folder, made, on_a_boat, written
from quick import few, one_in
from sblcosim import ConfigurationError, identify, listings, process, read_log
from sblcosim.cli.documents.by_command import document
from sblcosim.data.estimates import Estimates
from sblcosim.data.truth import Truth
from sblcosim.logs.log import Log
from sblcosim.models import RECEIVERS
from sblcosim.processing import figures, quality
from sblcosim.processing.align import Alignment, aligned, moved
from sblcosim.processing.knowing import that_know
from sblcosim.processing.playing import played
from sblcosim.processing.quality import described, resemblance, row_of
from sblcosim.processing.running import ran
from sblcosim.processing.settings import MOST_TICKS, arrangement_of, settled, start_values
from sblcosim.words.numbers import minus, signed
from seams import Seam

RIG = """\
import numpy as np
import sblcosim

class Fix(sblcosim.Receiver):
    def update(self, samples):
        fix = self.fix(samples)
        return None if fix is None else sblcosim.Estimate(samples[-1].epoch, fix)

class Broken(sblcosim.Receiver):
    def update(self, samples):
        raise RuntimeError("no")
"""


# --- The same estimates as in the simulation ------------------------------------------------------


@pytest.mark.parametrize("scenario", listings.scenarios())
@one_in(3)
def test_a_simulated_dive_gives_its_own_estimates_to_the_bit(
    scenario: str, tmp_path: Path
) -> None:
    run, log = written(tmp_path / "run", scenario, [*RECEIVERS])
    processed = process(log, [*RECEIVERS])
    assert set(processed.made) == set(run.receivers)
    for label in run.receivers:
        own = run.record.estimates(label).columns()
        again = processed.made[label].columns()
        assert len(own["epoch_ns"]) > 10
        for name, values in own.items():
            assert np.array_equal(values, again[name], equal_nan=True), (label, name)


@pytest.mark.parametrize("keys", [
    {"time.ekf_ratio": 4},
    {"acoustics.packet_content": "own_beacon"},
    {"acoustics.packet_content": "all_beacons"},
    {"acoustics.packet_bits": 96},
    {"acoustics.ranging": "two_way", "acoustics.turnaround_s": 0.1},
    {"acoustics.ranging": "inverted", "acoustics.range_resolution_m": 0.01},
    {"acoustics.ranging": "inverted", "acoustics.range_common_std_m": 0.1,
     "acoustics.arrivals_shared": True},
    pytest.param({"platform.beacons": 3}, marks=pytest.mark.slow),
    pytest.param({"platform.beacons": 8, "acoustics.schedule": "simultaneous"},
                 marks=pytest.mark.slow),
    {"time.sampling_time_s": 0.1, "acoustics.loss_probability": 0.6},
    {"receiver.type": "sequential", "receiver.initialisation": "first_receptions"},
])  # fmt: skip
def test_the_same_holds_for_other_packets_beacons_and_intervals(
    keys: dict[str, Any], tmp_path: Path
) -> None:
    known = {"time.duration_s": 60.0, "target.trajectory": "random_path"}
    receivers = ["sequential", "coupled"]
    if "acoustics.range_common_std_m" in keys:
        receivers = ["array", "coupled"]
    run, log = written(tmp_path / "run", "realistic-dive", receivers, overrides=known | keys)
    processed = process(log, receivers)
    for label in run.receivers:
        own, again = run.record.estimates(label), processed.made[label]
        assert len(own) > 5
        assert np.array_equal(own.position, again.position), label
        assert np.array_equal(own.epoch_ns, again.epoch_ns), label


def test_its_errors_are_those_of_the_run(tmp_path: Path) -> None:
    run, log = written(tmp_path / "run", "realistic-dive", ["coupled"])
    row = process(log, ["coupled"]).receivers.loc["coupled"]
    total = run.errors.loc[("coupled", "absolute", "total"), "rms_m"]
    assert row.total_rms_m == pytest.approx(total, rel=1e-4)  # the truth is on its own ticks only
    assert row.total_p95_m == pytest.approx(
        run.percentiles.loc[("coupled", "absolute", "total"), "p95_m"], rel=1e-3
    )
    assert row.nis == pytest.approx(run.summary.loc["coupled", "nis"])


def test_a_recorded_track_needs_its_file_no_longer(tmp_path: Path) -> None:
    track = tmp_path / "track.csv"
    rows = [f"{t},{0.3 * t},{5 + 0.1 * t},4" for t in range(0, 61, 5)]
    track.write_text("time_s,north_m,east_m,down_m\n" + "\n".join(rows) + "\n")
    keys = {"target.trajectory": "file", "target.track_file": str(track)}
    run, log = written(tmp_path / "run", "realistic-dive", ["coupled"], overrides=keys)
    track.unlink()
    own, again = run.record.estimates("coupled"), process(log, ["coupled"]).made["coupled"]
    assert np.array_equal(own.position, again.position)


# --- Logs of devices ------------------------------------------------------------------------------


def test_fixed_beacons_give_errors_near_what_was_put_in() -> None:
    processed = process(made(), ["long_baseline", "coupled", "sequential"])
    rows = processed.receivers
    assert rows.loc["long_baseline", "horizontal_rms_m"] < 0.5
    assert rows.loc["coupled", "horizontal_rms_m"] < 1.0
    assert (rows.loc[["long_baseline", "coupled"], "claimed_over_made"] > 0.5).all()
    assert processed.main == "long_baseline"
    assert any("usual values" in line and "fixed beacons" in line for line in processed.remarks)
    assert any(line.startswith("coupled: the fixed beacons count") for line in processed.remarks)


def test_the_default_receiver_follows_what_carries_the_beacons() -> None:
    fixed = made(seconds=60)
    assert arrangement_of(fixed) == "fixed"
    assert process(fixed).main == "long_baseline"
    drifting = replace(fixed, receptions=replace(
        fixed.receptions,
        beacon_position=fixed.receptions.beacon_position
        + np.linspace(0, 1, len(fixed.receptions))[:, None] * [1, 0, 0],
    ))  # fmt: skip
    assert arrangement_of(drifting) == "buoys"
    assert process(drifting).main == "long_baseline"


def test_ranges_far_too_short_are_left_out_and_told() -> None:
    log = made(seconds=240)
    wrong = np.arange(20, 60, 4)  # those of the first beacon
    short = changed(log, wrong, -25.0)
    processed = process(short)
    (told,) = [line for line in processed.remarks if "too short" in line]
    assert told.startswith(f"receptions: {len(wrong)} lines left out")
    assert str(int(log.receptions.line[wrong[0]])) in told
    assert len(processed.log.receptions) == len(log.receptions) - len(wrong)
    assert processed.receivers.horizontal_rms_m["long_baseline"] < 0.5
    late = process(changed(log, wrong, +25.0))
    assert not any("too short" in line for line in late.remarks)
    assert len(late.log.receptions) == len(log.receptions)


@pytest.mark.parametrize("seed", [10, 11])
@pytest.mark.parametrize(
    "scenario", ["harbour-random", "harbour-lbl", "gps-buoys", "realistic-dive", "harbour-spiral"]
)
def test_ranges_of_a_dive_that_are_only_late_are_all_kept(
    scenario: str, seed: int, tmp_path: Path
) -> None:
    log = bare(tmp_path / "run", scenario, seed=seed)
    ready = settled(log)
    assert len(ready.log.receptions) == len(log.receptions) > 300
    assert ready.window is not None
    assert log.truth is not None
    begin = np.clip(ready.window.begin_ns + log.start_ns, *log.truth.time_ns[[0, -1]])
    true = log.truth.state_at(np.array([begin]))[0][0]
    assert np.linalg.norm(ready.window.position - true) < 10.0


@pytest.mark.parametrize(("share", "told"), [(1.0, False), (0.95, False), (0.8, True), (0.1, True)])
def test_errors_are_of_the_estimates_whose_truth_is_known(share: float, told: bool) -> None:
    whole = made(seconds=100)
    assert whole.truth is not None
    known = int(share * len(whole.truth.time_ns))
    truth = replace(
        whole.truth, time_ns=whole.truth.time_ns[:known], position=whole.truth.position[:known]
    )
    found = process(replace(whole, truth=truth), "long_baseline")
    row = found.receivers.loc["long_baseline"]
    epoch = found.made["long_baseline"].epoch_ns
    judged = int(((epoch >= truth.time_ns[0]) & (epoch <= truth.time_ns[-1])).sum())
    assert row["judged"] == judged
    said = "errors are of the estimates whose truth is known: "
    remarks = [it.removeprefix(said) for it in found.remarks if it.startswith(said)]
    assert bool(remarks) == told
    assert all(f"{judged} of {len(epoch)} of long_baseline" in it for it in remarks)
    lines = found.text().splitlines()
    first = lines[lines.index("Horizontal error [m]") + 2]
    assert first.split()[:2] == ["long_baseline", str(judged)]


@pytest.mark.parametrize("odd", ["One-Way", "sideways"])
def test_too_few_beacons_for_a_reason_are_told_with_it(odd: str, tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.mkdir()
    (log / "meta.toml").write_text(
        "[beacons]\nA = [0, 0, 9]\nB = [50, 0, 9]\nC = [0, 50, 9]\nD = [50, 50, 9]\n"
    )
    rows = [f"{k}000000000,{'ABCD'[k % 4]},30,{odd if k % 2 else 'one-way'}" for k in range(40)]
    (log / "receptions.csv").write_text("\n".join(["arrival_ns,beacon,range_m,kind", *rows]))
    (log / "depth.csv").write_text("time_ns,depth_m\n0,3\n39000000000,3\n")
    with pytest.raises(ConfigurationError) as caught:
        process(log, "long_baseline")
    assert str(caught.value).endswith(
        "must have ranges of at least 3 beacons, got 2; receptions.csv: 20 lines left out: a kind "
        "of range that is none of one-way, two-way, range, pseudorange, inverted and difference "
        "(lines 3, 5, 7, 9, 11, …)"
    )


def test_a_log_in_a_plane_is_told_horizontally() -> None:
    processed = process(made(plane=True))
    row = processed.receivers.loc["long_baseline"]
    assert row.horizontal_rms_m < 0.5
    assert "total_rms_m" not in processed.receivers
    assert "RMS, 95 %" in processed.answer
    assert "horizontally)" not in processed.answer
    assert "depth" not in processed.residuals.loc["long_baseline"].index


def test_beacons_on_one_pole_are_at_one_place_of_a_plane() -> None:
    poles = np.vstack([CORNERS[:3], CORNERS[:1] - [0, 0, 3]])
    log = made(plane=True, beacons=poles)
    assert process(log).receivers.horizontal_rms_m["long_baseline"] < 0.5
    it = {n.parameter: n for n in identify(log).device.numbers}
    assert it["range_std"].estimate == pytest.approx(0.1, rel=0.2)


def test_estimates_that_know_less_than_a_range_are_left_out_and_told(seam: Seam) -> None:
    plain = process(made())
    own = plain.made["long_baseline"]
    assert own.covariance is not None
    wide = own.covariance.copy()
    wide[7] *= 1e8
    wide[9, 2, 2] = 1e8

    def ran_so(*given: Any) -> Any:
        found = ran(*given)
        vague = replace(found.estimates["long_baseline"], covariance=wide)
        return replace(found, estimates={**found.estimates, "long_baseline": vague})

    seam.instead(ran, ran_so)
    processed = process(made())
    assert len(processed.made["long_baseline"]) == len(own) - 2
    assert len(processed.made["raw"]) == len(plain.made["raw"])
    (told,) = (line for line in processed.remarks if "claimed deviation" in line)
    assert told.startswith("long_baseline: 2 estimates left out")
    assert not any("claimed deviation" in line for line in plain.remarks)


@pytest.mark.parametrize(("size", "std"), [(2.5, 0.025), (7.0, 0.07), (40.0, 0.3), (400.0, 0.3)])
def test_places_of_beacons_close_together_are_known_better(size: float, std: float) -> None:
    close = CORNERS * [size / 80, size / 80, 1]
    platform = settled(made(beacons=close)).scenario.platform
    assert platform.mounting_std_m == pytest.approx(std)


@pytest.mark.parametrize("sign", [1, -1])
def test_places_are_known_no_better_than_their_ranges_fit(sign: int) -> None:
    """The straight lines take up a part of the offsets of the beacons."""
    close = CORNERS * [7 / 80, 7 / 80, 1]
    log = made(beacons=close, offsets=sign * np.array([0.1, -0.1, 0.1, -0.1]))
    assert 0.1 < settled(log).scenario.platform.mounting_std_m < 0.25


def test_positions_far_from_zero_change_nothing() -> None:
    near = process(made())
    far = process(made(origin=(6_054_000.0, 448_000.0, 0.0)))
    shift = far.made["long_baseline"].position - near.made["long_baseline"].position
    assert np.abs(shift - [6_054_000, 448_000, 0]).max() < 1e-5


def test_times_far_from_zero_change_nothing() -> None:
    near, far = process(made()), process(made(start_s=1_700_000_000.0))
    one, other = (it.made["long_baseline"] for it in (near, far))
    assert np.array_equal(one.position, other.position)
    assert np.array_equal(one.epoch_ns + 1_700_000_000 * 10**9, other.epoch_ns)


def test_more_than_eight_beacons_share_the_places() -> None:
    angle = np.arange(12) * 2 * np.pi / 12
    ring = np.column_stack([50 * np.cos(angle), 50 * np.sin(angle), np.full(12, 12.0)])
    processed = process(made(beacons=ring, seconds=360))
    assert processed.main == "sequential"
    assert processed.receivers.horizontal_rms_m["sequential"] < 1.5
    assert any("12 beacons share the 8 places" in line for line in processed.remarks)
    assert len(processed.residuals.loc["sequential"].index) == 13  # with the depth


def test_a_beacon_takes_the_place_of_the_one_that_is_silent_for_longest() -> None:
    log = made(seconds=10)
    order = np.array([0, 1, 2, 0, 3, 0, 2, 1, 0, 3])
    log = replace(log, receptions=replace(log.receptions, beacon=order))
    # 3 takes the place of 1, which is 1; then 1 that of 3 again, and 3 that of 2.
    assert played(log, 10**9, 3).slot.tolist() == [0, 1, 2, 0, 1, 0, 2, 1, 0, 2]
    assert played(log, 10**9, 4).slot.tolist() == order.tolist()


def test_a_gap_of_minutes_is_survived() -> None:
    log = made(seconds=900, turning=0.005)
    heard = log.receptions
    kept = (heard.arrival_ns < 300e9) | (heard.arrival_ns > 600e9)
    some = log.depth_ns < 300_000_000_000
    processed = process(replace(
        log, receptions=heard.chosen(kept),
        depth_ns=log.depth_ns[some | (log.depth_ns > 600_000_000_000)],
        depth=log.depth[some | (log.depth_ns > 600_000_000_000)],
    ))  # fmt: skip
    row = processed.receivers.loc["long_baseline"]
    assert 295 < row.longest_gap_s < 315  # its claims settle first
    error = processed.tracks["long_baseline"]
    assert error.error_horizontal_m[error.epoch_s > 620].max() < 2.0


def test_two_ranges_of_a_beacon_in_an_interval_wait_and_are_counted() -> None:
    log = made(seconds=120)
    processed = process(log, interval_s=10.0)
    (told,) = [line for line in processed.remarks if "waited for the next update" in line]
    count = int(told.split()[0])
    given = played(log, 10_000_000_000, 4)
    assert count == given.waited > 60
    assert given.replaced == 0
    newest = played(log, 10_000_000_000, 4, newest=True)
    assert newest.waited == 0
    kept = np.diff(newest.values["reception_count"], axis=0, prepend=0) > 0
    assert newest.replaced == len(log.receptions) - kept.sum() > 60


def test_each_range_is_played_once_and_in_its_order() -> None:
    log = made(seconds=200)
    given = played(log, 1_500_000_000, 4)
    count = given.values["reception_count"]
    steps = np.diff(count, axis=0, prepend=0)
    assert steps.sum() == len(log.receptions)
    assert steps.max() == 1
    for beacon in range(4):
        new = steps[:, beacon] > 0
        own = log.receptions.range[log.receptions.beacon == beacon]
        assert np.array_equal(given.values["range"][new, beacon], own)
    arrival = log.receptions.arrival_ns - given.start_ns
    assert (given.time_ns[given.tick] >= arrival).all()


STEPS_NS = [s * 10**n for n in range(6, 11) for s in (1, 2, 5)][:-2]
"""1, 2 or 5 · 10ⁿ, from a millisecond to 10 s."""


@pytest.mark.parametrize("spacing_ns", [
    *STEPS_NS, *(round(1.3 * it) for it in STEPS_NS), *(it - 1000 for it in STEPS_NS), 37 * 10**9,
])  # fmt: skip
def test_receptions_have_ticks_of_their_own_1_2_or_5_times_a_power_of_ten_apart(
    spacing_ns: int,
) -> None:
    """The largest step that is no longer than the time between receptions."""
    log = made(seconds=40, speed=0.01)
    ns = spacing_ns * np.arange(1, 41)
    heard = replace(log.receptions, arrival_ns=ns, epoch_ns=ns)
    ready = settled(replace(log, receptions=heard, depth_ns=ns, truth=None))
    expected = max([it for it in STEPS_NS if it <= spacing_ns], default=STEPS_NS[0])
    assert ready.interval_ns == expected
    assert ready.scenario.time.sampling_time_s == pytest.approx(expected / 1e9)


def test_more_ticks_than_a_receiver_can_run_are_refused() -> None:
    log = made(seconds=60)
    span = log.stop_ns - log.start_ns
    fits, too_short = -(-span // MOST_TICKS), span // (MOST_TICKS + 1)
    assert settled(log, interval_s=fits / 1e9).interval_ns == fits
    with pytest.raises(ConfigurationError, match=f"interval: must make at most {MOST_TICKS:,} tic"):
        settled(log, interval_s=too_short / 1e9)


def bare(folder: Path, scenario: str, **keys: Any) -> Log:
    """The log of a simulated dive as a device would have written it: without settings and start."""
    _, log = written(folder, scenario, ["sequential"], overrides=keys)
    told = read_log(log)
    return replace(told, scenario=None, meta=told.meta.model_copy(
        update={"start_ns": None, "stop_ns": None}))  # fmt: skip


def sailing(log: Log, speed: float) -> Log:
    """A log in which boat and diver sail to the north-east as well [m/s]."""
    assert log.truth is not None
    heard, truth = log.receptions, log.truth

    def gone(time_ns: Any) -> Any:
        return np.outer((time_ns - log.start_ns) / 1e9, [0.8 * speed, 0.6 * speed, 0.0])

    moved_on = replace(
        heard, beacon_position=heard.beacon_position + gone(heard.epoch_ns),
        platform_position=heard.platform_position + gone(heard.epoch_ns),
    )
    there = replace(truth, position=truth.position + gone(truth.time_ns))
    return replace(log, receptions=moved_on, truth=there)


@pytest.mark.parametrize("beacons", few([4, 6], quick=[4]))
def test_arms_of_a_platform_come_from_its_packets(beacons: int, tmp_path: Path) -> None:
    log = bare(tmp_path / "run", "realistic-dive", **{"platform.beacons": beacons})
    assert arrangement_of(log) == "platform"
    processed = process(log)
    asked = sblcosim.load("realistic-dive", {"platform.beacons": beacons})
    own = asked.assumptions(["beacon_offset", "gps_std"])["beacon_offset_m"]
    assert np.allclose(processed.scenario.platform.beacon_m, own, atol=1e-3)
    assert processed.main == "coupled"
    assert processed.receivers.total_rms_m["coupled"] < 4.0
    stated = log.meta.model_copy(
        update={"arms_m": {name: (1.0, float(i), 0.5) for i, name in enumerate(log.beacons)}}
    )
    told = process(replace(log, meta=stated)).scenario.platform.beacon_m
    assert tuple(told[:6]) == (1.0, 0.0, 0.5, 1.0, 1.0, 0.5)


@pytest.mark.parametrize("speed", [0.0, 0.05, 0.8])
def test_a_boat_that_drifts_or_sails_is_no_error_of_its_gps(speed: float, tmp_path: Path) -> None:
    log = bare(tmp_path / "run", "realistic-dive", **{"time.duration_s": 300.0})
    log = sailing(log, speed)
    processed = process(log)
    assert processed.scenario.platform.watch_circle_m >= 120.0 * speed
    assert processed.receivers.horizontal_rms_m["coupled"] < 4.0
    assert processed.receivers.claimed_over_made["coupled"] > 0.5


def test_settings_that_leave_a_sailing_boat_at_its_place_are_doubted(tmp_path: Path) -> None:
    log = bare(tmp_path / "run", "realistic-dive")
    told = [
        [line for line in process(sailing(log, speed), scenario="realistic-dive").remarks
         if line.startswith("platform: ")] for speed in (0.0, 0.8)
    ]
    assert not told[0]
    (line,) = told[1]
    assert "platform.watch_circle_m" in line


def test_estimates_in_silences_are_left_out_and_said() -> None:
    log = made()
    heard = log.receptions
    kept = (heard.epoch_ns < 100e9) | ((heard.epoch_ns > 200e9) & (heard.epoch_ns < 280e9))
    processed = process(replace(log, receptions=heard.chosen(kept)))
    time_s = np.sort(processed.made["long_baseline"].epoch_ns) / 1e9
    last, first, before_the_end = 99, 203, 279
    ends = [last + 10, before_the_end + 10]
    assert first <= time_s[time_s > ends[0] + 0.1].min() < first + 12  # a few ranges settle it
    assert {ends[0] - 1, ends[1] - 1} <= {*time_s.round().tolist()}
    assert time_s[-1] <= ends[1] + 0.1
    (line,) = (it for it in processed.remarks if it.startswith("long_baseline: "))
    assert line.endswith(" estimates left out, more than 10 s after the last range, and before 3 "
                         "beacons were heard again and claims were at most 5 times as large as "
                         "usual")


@pytest.mark.parametrize(("share", "mean"), [(0.0, 8.0), (0.04, 3.0), (0.04, 8.0), (0.1, 8.0)])
def test_late_ranges_of_a_log_say_how_late_they_are(share: float, mean: float) -> None:
    log = made(seconds=1200)
    rng = np.random.default_rng(7)
    late = np.where(rng.random(1200) < share, rng.exponential(mean, 1200), 0.0)
    ready = settled(changed(log, slice(None), late))
    acoustics = ready.scenario.acoustics
    if share == 0:
        assert acoustics.outlier_mean_m == pytest.approx(5 * acoustics.range_std_m)
    else:
        assert 0.7 * mean < acoustics.outlier_mean_m < 1.4 * mean


def test_four_late_ranges_do_not_say_how_late_they_are() -> None:
    log = made(seconds=600)
    for count in (4, 5):
        where = np.arange(count) * 110 + 50
        acoustics = settled(changed(log, where, 6.0)).scenario.acoustics
        usual = 5 * acoustics.range_std_m
        expected = usual if count == 4 else 6 - usual
        assert acoustics.outlier_mean_m == pytest.approx(expected, rel=0.1)


def test_ranges_of_a_log_count_as_known_to_a_centimetre_at_best() -> None:
    found = [settled(made(std=std, turning=1e-6)) for std in (0.0, 0.005, 0.1)]
    exact, fine, usual = (it.scenario.acoustics.range_std_m for it in found)
    assert exact == fine == 0.01
    assert 0.05 < usual < 0.15
    assert all("range noise 0.010 m, " in it.said for it in found[:2])


@pytest.mark.parametrize("claims", [True, False])
def test_after_a_silence_estimates_count_from_the_first_usual_claim(claims: bool) -> None:
    """Wide claims at 20 and 30 s are not after a silence; those at 203 and 204 s are, that at
    206 s comes after a usual one."""
    log = made()
    heard = log.receptions
    kept = (heard.epoch_ns < 100e9) | (heard.epoch_ns > 200e9)
    log = replace(log, receptions=heard.chosen(kept))
    time_s = np.array([*range(20, 100), *range(203, 230)])
    covariance = np.tile(np.eye(6) * 0.01, (len(time_s), 1, 1))
    for at, factor in ((20, 60.0), (30, 6.0), (203, 60.0), (204, 6.0), (205, 4.0), (206, 6.0)):
        covariance[time_s == at] *= factor**2
    own = Estimates(
        epoch_ns=time_s * 10**9, position=np.ones((len(time_s), 3)),
        covariance=covariance if claims else None,
    )
    kept_s = that_know(log, {"mine": own})[0]["mine"].epoch_ns / 1e9
    assert {*time_s} - {*kept_s} == ({203, 204} if claims else set())


@pytest.mark.parametrize("by_m", [0.0, 4.0])
def test_a_beacon_that_is_not_at_its_place_makes_places_uncertain(by_m: float) -> None:
    log = made(seconds=500)
    heard = log.receptions
    places = heard.beacon_position + by_m * (heard.beacon == 0)[:, None] * [0.7, -0.7, 0.0]
    log = replace(log, receptions=replace(heard, beacon_position=places))
    found = identify(log)
    key = "platform.mounting_std_m"
    assert (key in found.overrides()) == (by_m > 0)
    claims = process(log, scenario=found.scenario()).receivers.claimed_over_made["long_baseline"]
    assert 0.5 < claims < 2.5
    if by_m:
        of_an_axis = by_m * 0.7 / 2  # root of the mean square over four beacons
        assert found.overrides()[key] == pytest.approx(of_an_axis, rel=0.3)
        as_said = process(log, (), {key: 0.3}, scenario=found.scenario()).receivers
        assert as_said.claimed_over_made["long_baseline"] < 0.4


def test_the_device_of_a_platform_is_identified_without_its_scenario(tmp_path: Path) -> None:
    log = bare(tmp_path / "run", "realistic-dive", **{"target.trajectory": "random_path",
                                                      "time.duration_s": 900.0})  # fmt: skip
    noise = sblcosim.identify(log).numbers.set_index("parameter").loc["range_std"]
    assert noise.low < 0.1 < noise.high < 0.2


def test_buoys_without_settings_are_followed(tmp_path: Path) -> None:
    log = bare(tmp_path / "run", "gps-buoys")
    assert arrangement_of(log) == "buoys"
    assert process(log).receivers.total_rms_m["long_baseline"] < 2.0


# --- Without a truth ------------------------------------------------------------------------------


def test_without_a_truth_there_are_residuals_and_agreement_and_no_errors() -> None:
    processed = process(made(truth=False), ["long_baseline", "sequential"])
    assert processed.truth is None
    assert not any("rms" in name and "claimed" not in name for name in processed.receivers)
    assert "error_horizontal_m" not in processed.tracks["sequential"]
    assert "There is no truth" in processed.text()
    assert processed.agreement.loc[("long_baseline", "sequential"), "horizontal_rms_m"] < 2.0
    assert {job.name for job in processed.figures} == {
        "map", "residuals_by_time", "residuals_by_range",
    }
    for table in processed.tables.values():
        assert not table.isna().all().any(), "a column of nothing"


def test_residuals_show_offset_scale_and_tails_by_beacon() -> None:
    log = made(seconds=800, offsets=np.array([0.0, 0.0, 3.0, 0.0]), std=0.05, turning=0.01)
    late = changed(log, np.arange(3, 800, 40), 4.0)
    keys = {"acoustics.range_std_m": 0.5, "platform.mounting_std_m": 0.001,
            "acoustics.clock_offset_std_s": 0.0, "acoustics.sound_speed_m_s": 1500.0}  # fmt: skip
    table = process(late, ["sequential"], keys).residuals.loc["sequential"]
    assert table.offset_m["B2"] == table.offset_m.drop("depth").max()
    assert table.offset_m["B2"] > 0.5
    assert table.tails["B3"] > table.tails["B1"]
    assert (table.n.drop("depth") > 150).all()


# --- Truth on a clock or in a frame of its own ----------------------------------------------------


@pytest.mark.parametrize("offset", [-12.5, 3.25, 86_400.0])
def test_the_clock_of_a_truth_is_found(offset: float) -> None:
    log = made(seconds=400)
    assert log.truth is not None
    late = replace(log.truth, time_ns=log.truth.time_ns - round(offset * 1e9))
    meta = log.meta.model_copy(update={
        "clock": log.meta.clock.model_copy(update={
            "truth": log.meta.clock.truth.model_copy(update={"offset_s": "estimate"})})})
    processed = process(replace(log, truth=late, meta=meta))
    (told,) = [line for line in processed.remarks if line.startswith("truth: moved its clock")]
    assert "errors are what then remains" in told
    assert processed.truth is not None
    assert abs((processed.truth.time_ns - log.truth.time_ns) / 1e9).max() < 0.5
    assert processed.receivers.horizontal_rms_m["long_baseline"] < 0.6


@pytest.mark.parametrize(("clock", "turn"), [(-7.5, 0.0), (500.0, 0.0), (41.25, -2.1)])
def test_outliers_do_not_move_a_clock_or_a_frame(clock: float, turn: float) -> None:
    log = made(seconds=200)
    truth = log.truth
    assert truth is not None
    rng = np.random.default_rng(2)
    seen = truth.position + rng.normal(0.0, 0.05, truth.position.shape)
    seen[rng.random(len(seen)) < 0.35] += [15.0, -9.0, 1.0]
    by = Alignment(clock, turn, (4.0, -3.0, 0.5))
    back = Alignment(-clock, -turn, (0.0, 0.0, 0.0))
    shift = np.array(by.shift_m) if turn else np.zeros(3)
    other = replace(truth, position=truth.position - shift)
    stated = clock if turn else "estimate"  # on an arc, a turn may be a later clock
    clocks = {"truth": log.meta.clock.truth.model_copy(update={"offset_s": stated})}
    frames = {"truth": "estimate"} if turn else {}
    meta = log.meta.model_copy(update={
        "clock": log.meta.clock.model_copy(update=clocks),
        "frame": log.meta.frame.model_copy(update=frames),
    })  # fmt: skip
    given = replace(log, truth=moved(other, back), meta=meta)
    found = aligned(given, Estimates(epoch_ns=truth.time_ns, position=seen))
    assert found is not None
    assert found[1].estimated == (not turn, bool(turn))
    assert found[1].offset_s == pytest.approx(clock, abs=0.03)
    assert found[1].turn_rad == pytest.approx(turn, abs=0.01)
    np.testing.assert_allclose(found[0].position, truth.position, atol=0.3)
    np.testing.assert_allclose(found[1].shift_m, shift, atol=0.3)


@pytest.mark.parametrize(
    "offset", [-86_400.0, 86_400.0, 300.0, 365.0, -365.0, 390.0, -390.0, 399.0, -399.0, 401.0]
)
def test_a_truth_of_another_time_has_a_clock_of_its_own(offset: float) -> None:
    """Before or after the log, or with hardly a tenth of it, if meta.toml does not say its offset.

    Within the log, its clock is believed.
    """
    log = made(seconds=400, start_s=1.7e9)
    truth = log.truth
    assert truth is not None
    moved_on = replace(truth, time_ns=truth.time_ns + round(offset * 1e9))
    estimates = Estimates(epoch_ns=truth.time_ns, position=truth.position)
    found = aligned(replace(log, truth=moved_on), estimates)
    assert found is not None
    assert found[1].estimated == (abs(offset) > 360, False)
    assert found[1].offset_s == pytest.approx(-offset if abs(offset) > 360 else 0.0, abs=0.1)


@pytest.mark.parametrize("offset", [0.0, 100.0, -200.0, 275.0, -285.0, 330.0, -399.0])
def test_the_clock_of_a_truth_is_found_however_little_it_overlaps(offset: float) -> None:
    log = made(seconds=400, turning=0.005)
    truth = log.truth
    assert truth is not None
    meta = log.meta.model_copy(update={
        "clock": log.meta.clock.model_copy(update={
            "truth": log.meta.clock.truth.model_copy(update={"offset_s": "estimate"})})})
    moved_on = replace(truth, time_ns=truth.time_ns + round(offset * 1e9))
    estimates = Estimates(epoch_ns=truth.time_ns, position=truth.position)
    found = aligned(replace(log, truth=moved_on, meta=meta), estimates)
    assert found is not None
    assert found[1].offset_s == pytest.approx(-offset, abs=0.1)


@pytest.mark.parametrize("offset", [0.0, 3.0, -40.0])
@pytest.mark.parametrize("first", [100, 4700])
def test_the_clock_of_a_truth_of_hours_is_looked_for_near_its_own(
    first: int, offset: float
) -> None:
    """A logger that ran long before or after the dive: its middle is far from that of the log."""
    time = np.arange(5000) * 10**9
    angle = 2e-4 * np.arange(5000.0)
    path = 500 * np.column_stack([np.sin(angle), 1 - np.cos(angle), 0 * angle])
    log = made(seconds=200, start_s=float(first))
    its_own = log.meta.clock.truth.model_copy(update={"offset_s": "estimate"})
    meta = log.meta.model_copy(
        update={"clock": log.meta.clock.model_copy(update={"truth": its_own})}
    )
    truth = Truth(time_ns=time - round(offset * 1e9), position=path)
    part = slice(first, first + 200)
    found = aligned(
        replace(log, truth=truth, meta=meta), Estimates(epoch_ns=time[part], position=path[part])
    )
    assert found is not None
    assert found[1].offset_s == pytest.approx(offset, abs=0.1)


@pytest.mark.parametrize(("frame", "rounds", "says"), [
    ("estimate", 0.8, True), ("same", 0.8, False), ("same", 2.5, True),
])
def test_a_clock_that_could_be_another_one_is_said_to_be(
    frame: str, rounds: float, says: bool
) -> None:
    """On a circle, a turn is a later clock; round after round, a later one fits as well."""
    log = made(seconds=400)
    angle = np.linspace(0.0, rounds * 2 * np.pi, 400)
    circle = np.column_stack([20 * np.cos(angle), 20 * np.sin(angle), 0 * angle + 5])
    seen = circle + np.random.default_rng(4).normal(0.0, 0.2, circle.shape)
    time = log.start_ns + 10**9 * np.arange(400)
    meta = log.meta.model_copy(update={
        "clock": log.meta.clock.model_copy(update={
            "truth": log.meta.clock.truth.model_copy(update={"offset_s": "estimate"})}),
        "frame": log.meta.frame.model_copy(update={"truth": frame}),
    })  # fmt: skip
    given = replace(log, truth=Truth(time_ns=time, position=circle), meta=meta)
    found = aligned(given, Estimates(epoch_ns=time, position=seen))
    assert found is not None
    told = found[1].told("coupled")
    assert ("; other offsets of its clock, between " in told) == says
    assert (found[1].alike_s is not None) == says
    if says:
        low, high = found[1].alike_s
        assert high - low > 120
        assert rounds < 1 or sorted({abs(round(low)), abs(round(high))}) == [160]
        assert f"between {signed(low, 3)} s and {signed(high, 3)} s, fit nearly" in told


def test_the_frame_of_a_truth_is_found() -> None:
    log = made(seconds=400)
    assert log.truth is not None
    turn = np.deg2rad(130.0)
    R = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    other = replace(log.truth, position=log.truth.position @ R.T + [100.0, -20.0, 3.0])
    meta = log.meta.model_copy(
        update={"frame": log.meta.frame.model_copy(update={"truth": "estimate"})}
    )
    processed = process(replace(log, truth=other, meta=meta))
    assert any("its frame by a turn of −130" in line for line in processed.remarks)
    assert processed.truth is not None
    assert np.abs(processed.truth.position - log.truth.position).max() < 1.0


@pytest.mark.parametrize("speed", [0.0, 0.5])
def test_the_frame_of_a_truth_is_found_from_a_boat_with_a_pose(speed: float) -> None:
    log = sailing(on_a_boat(seconds=600, std=0.05), speed)
    assert log.truth is not None
    meta = log.meta.model_copy(
        update={"frame": log.meta.frame.model_copy(update={"truth": "estimate"})}
    )
    other = moved(log.truth, Alignment(0.0, 2.2, (1000.0, -300.0, 7.0)))
    processed, same = process(replace(log, truth=other, meta=meta)), process(log)
    (told,) = [line for line in processed.remarks if line.startswith("truth: moved its frame")]
    assert "by a turn of −126° and (" in told
    assert ", −7.00) m, so that it fits coupled best; errors are what then remains" in told
    assert processed.truth is not None
    assert np.abs(processed.truth.position - log.truth.position).max() < 0.3
    made_errors = [it.receivers.horizontal_rms_m["coupled"] for it in (processed, same)]
    assert made_errors[0] == pytest.approx(made_errors[1], rel=0.2)


def test_a_truth_that_says_its_offset_is_believed() -> None:
    log = made(seconds=100)
    assert log.truth is not None
    late = replace(log.truth, time_ns=log.truth.time_ns - 2_000_000_000)
    clock = log.meta.clock.truth.model_copy(update={"offset_s": 2.0})
    meta = log.meta.model_copy(
        update={"clock": log.meta.clock.model_copy(update={"truth": clock})}
    )
    processed = process(replace(log, truth=late, meta=meta))
    assert processed.truth is not None
    assert np.array_equal(processed.truth.time_ns, log.truth.time_ns)
    assert any("+2.00 s, as meta.toml says" in line for line in processed.remarks)


def test_estimates_in_gaps_of_the_truth_are_not_judged() -> None:
    log = made(seconds=300)
    assert log.truth is not None
    time = log.truth.time_ns / 1e9
    known = (time < 100) | (time > 200)
    gappy = Truth(time_ns=log.truth.time_ns[known], position=log.truth.position[known])
    row = process(replace(log, truth=gappy)).receivers.loc["long_baseline"]
    assert row.estimates - row.judged == pytest.approx(100, abs=3)


def test_a_truth_is_known_between_points_of_at_most_10_s() -> None:
    second = 10**9
    truth = Truth(time_ns=np.array([0, 10, 25]) * second, position=np.zeros((3, 3)))
    epochs = np.array([-1, 0, 5, 10, 17, 25, 26]) * second
    found = quality.known(truth, epochs)
    assert found.tolist() == [False, True, True, True, False, True, False]


def test_too_few_estimates_align_nothing() -> None:
    log = made(seconds=20)
    clock = log.meta.clock.truth.model_copy(update={"offset_s": "estimate"})
    meta = log.meta.model_copy(
        update={"clock": log.meta.clock.model_copy(update={"truth": clock})}
    )
    processed = process(replace(log, meta=meta))
    assert processed.truth is None
    assert any(line.startswith("truth: not used") for line in processed.remarks)


@one_in(2)
@pytest.mark.parametrize("estimated", ["clock", "frame", "both"])
@pytest.mark.parametrize("first", [0, 150, 300])
@pytest.mark.parametrize(("seconds", "fits"), [(40, False), (100, False), (140, True)])
def test_a_truth_of_a_small_part_of_the_estimates_aligns_nothing(
    estimated: str, first: int, seconds: int, fits: bool
) -> None:
    """Three tenths of the estimates must be within it."""
    log = made(seconds=400, turning=0.005)
    truth = log.truth
    assert truth is not None
    first = min(first, 400 - seconds)
    part = slice(first, first + seconds)
    short = Truth(time_ns=truth.time_ns[part], position=truth.position[part])
    clock, frame = log.meta.clock, log.meta.frame
    if estimated != "frame":
        its_own = clock.truth.model_copy(update={"offset_s": "estimate"})
        clock = clock.model_copy(update={"truth": its_own})
    if estimated != "clock":
        frame = frame.model_copy(update={"truth": "estimate"})
    meta = log.meta.model_copy(update={"clock": clock, "frame": frame})
    estimates = Estimates(epoch_ns=truth.time_ns, position=truth.position)
    found = aligned(replace(log, truth=short, meta=meta), estimates)
    assert (found is not None) == fits
    if found is not None and estimated == "clock":
        assert found[1].offset_s == pytest.approx(0.0, abs=0.1)


def test_moving_a_truth_turns_its_velocity_too() -> None:
    truth = Truth(
        time_ns=np.array([0, 1]), position=np.array([[1.0, 0, 0], [2, 0, 0]]),
        velocity=np.array([[1.0, 0, 0], [1, 0, 0]]),
    )
    log = made(seconds=60)
    found = aligned(log, process(log).made["long_baseline"])
    assert found is not None
    turned = moved(truth, replace(found[1], turn_rad=np.pi / 2, shift_m=(0, 0, 1)))
    assert np.allclose(turned.position, [[0, 1, 1], [0, 2, 1]])
    assert turned.velocity is not None
    assert np.allclose(turned.velocity, [[0, 1, 0], [0, 1, 0]])


# --- Receivers of the user, failures and refusals -------------------------------------------------


def test_python_receivers_from_files_run_beside_ours(tmp_path: Path) -> None:
    rig = tmp_path / "rig.py"
    rig.write_text(RIG)
    processed = process(made(seconds=60), ["long_baseline", f"{rig}:Fix", f"{rig}:Broken"])
    assert len(processed.made["Fix"]) > 40
    assert "Broken" not in processed.made
    assert "RuntimeError" in processed.failures["Broken"]
    assert processed.problems
    assert processed.receivers.failure["Broken"] == processed.failures["Broken"]


def test_an_fmu_of_a_file_runs_as_by_its_name(tmp_path: Path) -> None:
    from sblcosim.fmus.build.factory import build

    fmu = build("sequential", 3)
    copied = tmp_path / "other.fmu"
    copied.write_bytes(fmu.read_bytes())
    log = made(seconds=80)
    both = process(log, {"ours": "sequential", "theirs": copied})
    assert len(both.made["theirs"]) == len(both.made["ours"])


@pytest.mark.parametrize(("log", "words"), [
    (made(seconds=40, beacons=CORNERS[:2]), "ranges of at least 3 beacons, got 2"),
    (replace(made(seconds=40), depth=np.zeros(0), depth_ns=np.zeros(0, np.int64)),
     "must have readings of depth, or dimension = 2"),
    (replace(made(seconds=40), receptions=made(seconds=40).receptions.chosen(np.zeros(40, bool))),
     "must have ranges to be processed, got none"),
])  # fmt: skip
def test_a_log_that_no_receiver_can_use_is_refused(log: Log, words: str) -> None:
    with pytest.raises(ConfigurationError) as refusal:
        process(log)
    assert words in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_scenario_for_other_beacons_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="as many beacons as the log, 3, got 4"):
        process(made(seconds=60, beacons=CORNERS[:3]), scenario="harbour-lbl")


def test_a_scenario_gives_the_settings_and_is_named() -> None:
    processed = process(made(seconds=60), scenario="harbour-lbl")
    assert any("those of 'harbour-lbl'" in line for line in processed.remarks)
    assert processed.scenario.acoustics.outlier_mean_m == 2.0


# --- The smoother, files and documents ------------------------------------------------------------


def test_the_smoother_is_better_than_the_filter_it_began_with() -> None:
    processed = process(made(seconds=300), ["long_baseline"], smooth=True)
    rms = processed.receivers.horizontal_rms_m
    assert rms["smoother"] < rms["long_baseline"]
    assert list(processed.made) == ["long_baseline", "smoother", "raw"]
    without = process(made(seconds=300), ["sequential"], smooth=True)
    assert without.receivers.horizontal_rms_m["smoother"] == pytest.approx(rms["smoother"])


@pytest.mark.parametrize("scenario", ["realistic-dive", "harbour-square"])
def test_the_smoother_of_a_simulated_log_is_that_of_the_run(scenario: str, tmp_path: Path) -> None:
    run, log = written(tmp_path / "run", scenario, ["coupled"])
    own = sblcosim.smooth(run).result.made["smoother"]
    again = process(log, ["coupled"], smooth=True).made["smoother"]
    assert np.allclose(own.position, again.position, atol=1e-6)
    assert len(own) == len(again)


def test_a_folder_has_tables_figures_and_settings_that_can_be_used_again(tmp_path: Path) -> None:
    log = made(seconds=60)
    processed = process(log)
    folder = processed.save(tmp_path / "out")
    names = {path.name for path in folder.iterdir()}
    assert {
        "estimates.csv", "receivers.csv", "residuals.csv", "map.png", "errors.svg", "scenario.toml",
        "manifest.json",
    } <= names
    again = process(log, scenario=folder / "scenario.toml")
    assert np.array_equal(
        again.made["long_baseline"].position, processed.made["long_baseline"].position
    )
    text = document(processed, folder).text()
    assert json.loads(text)["receivers"]["long_baseline"]["estimates"] > 40


def test_equal_logs_give_equal_bytes(tmp_path: Path) -> None:
    folders = [process(made(seconds=60)).save(tmp_path / name) for name in ("a", "b")]
    for path in sorted(folders[0].iterdir()):
        if path.name != "manifest.json":
            assert path.read_bytes() == (folders[1] / path.name).read_bytes(), path.name


def test_a_package_has_no_log(tmp_path: Path) -> None:
    run = sblcosim.run("harbour-square", "sequential")
    bare = replace(run.description, scenario={"package": "x"}, asked=None)
    other = type(run)(bare, run.record, run.update_interval_ns)
    with pytest.raises(ConfigurationError, match="log: must be of a run of a scenario"):
        other.save(tmp_path / "out", figures=False, log=True)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "name", ["receptions.csv", "depth.csv", "truth.csv", "meta.toml", "scenario.toml"]
)
def test_a_written_log_that_was_edited_says_so(name: str, tmp_path: Path) -> None:
    _, log = written(tmp_path / "run", "harbour-square", ["sequential"])
    assert process(log, ["sequential"]).log.remarks == ()
    (log / name).write_text((log / name).read_text("utf-8") + "\n", "utf-8")
    told = process(log, ["sequential"]).remarks
    assert f"{name} was edited or damaged after it was written" in told


def test_a_log_without_beacons_has_a_map_without_them() -> None:
    log = made(seconds=40)
    own = process(log).made["long_baseline"]
    none = log.receptions.chosen(np.zeros(40, bool))
    bare = replace(log, receptions=none, beacons=(), fixes={"device": own})
    processed = process(bare)
    assert processed.main == "device"
    (figure,) = [job for job in processed.figures if job.name == "map"]
    labels = figure.axes().get_legend_handles_labels()[1]
    assert labels == ["truth", "device"]
    assert processed.receivers.horizontal_rms_m["device"] < 1.0


def test_settings_in_the_folder_are_right_for_every_receiver(tmp_path: Path) -> None:
    log = made(seconds=80)
    both = process(log, ["ekf", "long_baseline"])
    again = process(log, ["long_baseline"], scenario=both.save(tmp_path / "o") / "scenario.toml")
    one, other = both.made["long_baseline"], again.made["long_baseline"]
    assert np.array_equal(one.position, other.position)


def test_what_identify_finds_is_a_scenario_for_process(tmp_path: Path) -> None:
    log = made(seconds=600, std=0.3, turning=0.01)
    found = sblcosim.identify(log)
    noise = found.numbers.set_index("parameter").loc["range_std"]
    assert noise.told == "yes"
    assert noise.low < 0.3 < noise.high
    folder = found.save(tmp_path / "device", figures=False)
    rough, known = process(log), process(log, scenario=folder / "scenario.toml")
    assert known.scenario.acoustics.range_std_m == pytest.approx(noise.estimate, rel=0.5)
    rms = [it.receivers.horizontal_rms_m["long_baseline"] for it in (rough, known)]
    assert rms[1] < 1.1 * rms[0]


def test_identify_and_process_agree_on_what_is_too_short() -> None:
    short = changed(made(seconds=300), np.arange(20, 60, 4), -25.0)
    told = [line for line in sblcosim.identify(short).remarks if "too short" in line]
    assert told == [line for line in process(short).remarks if "too short" in line]
    assert len(told) == 1


def test_the_folder_of_a_run_is_named_with_its_log(tmp_path: Path) -> None:
    _, log = written(tmp_path / "run", "harbour-square", ["sequential"])
    with pytest.raises(ConfigurationError, match=r"did you mean '.*run/log'"):
        read_log(log.parent)


@pytest.mark.parametrize("change", [
    lambda log: changed(log, slice(0, 1), 1e-9),
    lambda log: replace(log, depth=log.depth + 1e-9),
    lambda log: replace(log, truth=None),
    lambda log: replace(log, meta=log.meta.model_copy(update={"sound_speed_m_s": 1499.0})),
])  # fmt: skip
def test_another_log_of_the_same_name_replaces_no_result(change: Any, tmp_path: Path) -> None:
    log = made(seconds=60)
    process(log).save(tmp_path / "o", figures=False)
    process(log).save(tmp_path / "o", figures=False)
    with pytest.raises(ConfigurationError, match="got that of another"):
        process(change(log)).save(tmp_path / "o", figures=False)
    with pytest.raises(ConfigurationError, match="got that of another"):
        process(log, interval_s=2.0).save(tmp_path / "o", figures=False)


def test_a_row_of_residuals_by_hand() -> None:
    length = np.arange(10.0, 110.0)
    wave = np.tile([0.1, -0.1], 50)  # each follows the opposite one
    row = described(2.0 + 0.03 * (length - length.mean()) + 0 * wave, length)
    assert row["slope"] == pytest.approx(0.03)
    assert row["offset_m"] == pytest.approx(2.0)
    assert row["autocorrelation"] > 0.9
    row = described(wave, length)
    assert row["autocorrelation"] == pytest.approx(-0.99)
    assert row["std_m"] == pytest.approx(0.14826)
    assert row["tails"] == 0.0
    wave[[3, 50]] = 5.0
    assert described(wave, length)["tails"] == pytest.approx(0.02)
    assert np.isnan(described(wave, None)["slope"])


def test_a_row_of_errors_by_hand() -> None:
    log = made(seconds=4)
    assert log.truth is not None
    off = np.array([[3.0, 4.0, 0.0], [0.0, 0.0, 12.0], [0.0, -5.0, 0.0], [-1.0, 0.0, 0.0]])
    P = np.zeros((4, 6, 6))
    P[:, 0, 0], P[:, 2, 2], P[:, 4, 4] = 4.0, 12.0, 100.0
    own = Estimates(
        epoch_ns=log.truth.time_ns, position=log.truth.position + off, covariance=P,
        nis=np.array([1.0, 2.0, 3.0, np.nan]), nis_degrees=np.array([1, 1, 2, 0]),
    )
    row = row_of(log, own, log.truth)
    assert row["horizontal_rms_m"] == pytest.approx((51 / 4) ** 0.5)
    assert row["horizontal_max_m"] == 5.0
    assert row["total_rms_m"] == pytest.approx((195 / 4) ** 0.5)
    assert row["total_p95_m"] == 12.0
    assert row["claimed_rms_m"] == pytest.approx(4.0)
    assert row["claimed_over_made"] == pytest.approx(4 / (51 / 4) ** 0.5)
    assert row["nees"] == pytest.approx((9 / 4 + 16 / 12 + 0 + 25 / 12 + 1 / 4) / 4)
    assert (row["nis"], row["nis_expected"]) == (2.0, pytest.approx(4 / 3))


def test_a_claim_that_is_wrong_is_told_with_its_factor() -> None:
    processed = process(made(seconds=120), ["sequential"])
    own = processed.made["sequential"]
    assert own.covariance is not None
    made_m = processed.receivers.horizontal_rms_m["sequential"]
    claimed = processed.receivers.claimed_rms_m["sequential"]
    wrong = ((0.25, "too little, by a factor of 4"), (5.0, "too much, by a factor of 5"))
    for factor, words in wrong:
        scale = (factor * made_m / claimed) ** 2
        other = replace(own, covariance=own.covariance * scale)
        told = replace(processed, made={"sequential": other}).answer
        assert f": {words}" in told
    fair = replace(own, covariance=own.covariance * (made_m / claimed) ** 2)
    assert "factor" not in replace(processed, made={"sequential": fair}).answer


def test_the_prior_is_three_times_as_wide_as_the_window_says() -> None:
    ready = settled(made(seconds=60, std=1.0))
    assert ready.window is not None
    values = start_values(ready, 0.01)
    assert values["prior_position_std"] == pytest.approx(3 * ready.window.std.max())
    assert values["prior_position"] == tuple(ready.window.position)
    assert start_values(ready, 100.0)["prior_position_std"] == 100.0


def test_the_smoother_is_the_same_far_from_zero() -> None:
    near, far = (
        process(made(seconds=80, origin=origin), smooth=True).made["smoother"].position
        for origin in ((0, 0, 0), (6_054_000, 448_000, 0))
    )
    assert np.abs(far - near - [6_054_000, 448_000, 0]).max() < 1e-4


@pytest.mark.parametrize("origin", [(0.0, 0.0, 12.0), (6_054_000.0, 448_000.0, 0.0)])
def test_a_device_is_the_same_wherever_its_beacons_are(origin: Any) -> None:
    here, there = (
        sblcosim.identify(made(plane=True, seconds=300, origin=it)).numbers.set_index("parameter")
        for it in ((0, 0, 0), origin)
    )
    told = here.told == "yes"
    assert told["range_std"]
    assert (there.told == here.told).all()
    for name in ("estimate", "low", "high"):
        near, far = (it[name][told].to_numpy(float) for it in (here, there))
        np.testing.assert_allclose(far, near, rtol=0.02, atol=1e-3)


def test_residuals_that_resemble_the_ones_before_make_claims_wider() -> None:
    random = np.random.default_rng(1)
    white, beacon = random.standard_normal(40_000), np.tile(np.arange(4), 10_000)
    assert resemblance(beacon, white) == pytest.approx(1, abs=0.1)
    slow = white.reshape(-1, 4).copy()
    for i in range(1, len(slow)):
        slow[i] = 0.5 * slow[i - 1] + np.sqrt(0.75) * slow[i]
    # its spectrum at zero: (1 + 0.5) / (1 - 0.5), less what late lags take away
    assert resemblance(beacon, slow.ravel()) == pytest.approx(np.sqrt(3), rel=0.05)


def test_claims_are_doubted_where_errors_of_ranges_last() -> None:
    log = made(seconds=1200)
    slow = np.zeros((300, 4))
    random = np.random.default_rng(3)
    for i in range(1, len(slow)):
        slow[i] = 0.98 * slow[i - 1] + 0.1 * random.standard_normal(4)
    doubts = [
        [line for line in process(it).remarks if "correlated in time" in line]
        for it in (log, changed(log, slice(None), slow.ravel()))
    ]
    assert not doubts[0]
    (line,) = doubts[1]
    assert line.startswith("ranges: ")
    assert 3 < float(line.rpartition(" ")[2]) < 8


@pytest.mark.parametrize(("depth_is", "same", "said"), [
    ("sensor", False, None),
    ("sensor", True, "depth: all 300 readings are the same, as if not measured"),
    ("none", False, "depth: not measured"),
    ("truth", True, "depth: made of the truth"),
])  # fmt: skip
def test_a_depth_that_no_sensor_gave_is_said(depth_is: str, same: bool, said: str | None) -> None:
    log = made(meta={"depth_is": depth_is})
    if same:
        log = replace(log, depth=np.full(len(log.depth), 8.0))
    lines = [line for line in process(log).remarks if line.startswith("depth: ")]
    assert [line.startswith(str(said)) for line in lines] == [True] * (said is not None)


def test_the_smoother_claims_more_where_errors_of_ranges_last() -> None:
    log = made(seconds=600)
    slow = np.zeros((150, 4))
    steps = np.random.default_rng(2).standard_normal(slow.shape)
    for i in range(1, len(slow)):
        slow[i] = 0.95 * slow[i - 1] + 0.3 * steps[i]
    heard = log.receptions
    off = replace(log, receptions=replace(heard, range=heard.range + slow.ravel()))
    settings = {"acoustics.range_std_m": 0.3, "receiver.acceleration_psd_m2_s3": 1e-4}
    done = process(off, (), settings, smooth=True)
    assert any("correlated in time" in line for line in done.remarks)
    assert 0.5 < done.receivers.claimed_over_made["smoother"] < 2.2
    same = process(log, (), settings, smooth=True)
    assert not any("correlated" in line for line in same.remarks)


def test_more_beacons_than_places_are_not_smoothed() -> None:
    angle = np.arange(9) * 2 * np.pi / 9
    ring = np.column_stack([50 * np.cos(angle), 50 * np.sin(angle), np.full(9, 12.0)])
    with pytest.raises(ConfigurationError, match="smooth: must be left out with more than 8"):
        process(made(beacons=ring, seconds=60), smooth=True)


def test_no_receiver_begins_with_the_truth_of_a_recorded_log() -> None:
    """A scenario may ask for the true start, which a simulation alone knows."""
    log = made(seconds=40)
    assert log.truth is not None
    scenario = sblcosim.load("harbour-lbl", {"receiver.prior": "true"})
    moved_truth = replace(log.truth, position=np.add(log.truth.position, [30.0, 0.0, 0.0]))
    for some in (log, replace(log, receptions=log.receptions.chosen(np.arange(40) % 4 < 3))):
        one, other = (
            process(replace(some, truth=truth), ["sequential"], scenario=scenario, smooth=True)
            for truth in (log.truth, moved_truth)
        )
        for label, own in one.made.items():
            assert np.array_equal(own.position, other.made[label].position), label


def test_residuals_of_several_filters_stand_side_by_side() -> None:
    done = process(made(truth=False), ["long_baseline", "ekf", "sequential", "coupled"])
    lines = done.text(width=80).splitlines()
    begin = lines.index("Residual [m]: offset ± std")
    table = lines[begin : lines.index("", begin)]
    heads = [line.split() for line in table if line.startswith(" ")]
    assert [it for head in heads for it in head] == [*done.made]  # and raw
    assert max(map(len, table)) <= 80
    row = done.residuals.loc["coupled", "B1"]
    assert f"{minus(f'{row.offset_m:.3f}')} ± {row.std_m:.3f}" in "\n".join(table)
    assert "slope" in done.text(verbose=True)
    assert "slope" in process(made(truth=False)).text()


def test_a_log_is_called_by_its_path_and_its_own_name(tmp_path: Path) -> None:
    folder = in_folder(tmp_path / "dive")
    (folder / "depth.csv").unlink()
    (folder / "meta.toml").write_text('name = "My device"\n')
    with pytest.raises(ConfigurationError, match=r"dive \(My device\): must have readings"):
        process(folder)
    assert read_log(folder).called == f"{folder} (My device)"
    (folder / "meta.toml").write_text('name = "dive"\n')
    assert read_log(folder).called == str(folder)


def test_the_figure_of_a_device_has_the_names_of_the_beacons() -> None:
    found = identify(made(seconds=120))
    (figure,) = (job for job in found.figures if job.name == "residuals")
    texts = [text.get_text() for ax in figure.axes().figure.axes for text in ax.texts]
    assert [text.split(",")[0] for text in texts] == [f"beacon B{i}" for i in range(4)]


def test_the_axis_of_residuals_holds_zero_and_nearly_all_of_them() -> None:
    log = made(seconds=120, scale=1.1)
    ranges = changed(log, np.arange(120) == 60, 40.0)
    estimates = process(log).made["long_baseline"]
    (ax,) = figures.plot_residuals(ranges, "long_baseline", estimates)
    low, high = ax.get_ylim()
    assert low < 0 < high < 40
    assert "1 of" in ax.get_title(loc="left") or "1 of" in ax.figure.texts[0].get_text()


def test_the_truth_of_a_log_is_a_path_and_its_errors_are_drawn_over_the_whole_log() -> None:
    log = made(seconds=120)
    done = process(log)
    for ax in figures.plot_errors(log, done.tracks):
        assert ax.get_xlim() == pytest.approx((-1.2, 121.2), abs=1.1)
    names = [path.name for path in done.paths]
    assert names == ["truth", *done.made]
