"""The rows of a device, of parameters that are given: what is told, in which words, from where."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from sblcosim.data.samples import Samples
from sblcosim.errors import ConfigurationError
from sblcosim.identification.batch import refined
from sblcosim.identification.device import (
    MOST_RANGES,
    MOST_READINGS,
    NONE_LATE,
    NOT,
    TURNS,
    YES,
    Assumed,
    Device,
    Number,
    device_of,
)
from sblcosim.identification.fit import Fit, fit, without_late
from sblcosim.identification.innovations import OFFSET, SCALE, evaluate
from sblcosim.identification.path import noise_of, smoothed, start
from sblcosim.identification.places import place_std
from sblcosim.identification.positions import PositionParts, parts
from sblcosim.identification.swings import CarrierSwing
from scipy import stats
from seams import Seam

Z = stats.norm.ppf(0.975)
LOGS = {
    "range_std": np.log(0.1), "late_share": -2.2, "late_mean": 0.4, "acceleration_psd": -5.5,
    "turn_rate": -3.2, "turn_std": -0.8, "range_walk": -4.1,
}  # fmt: skip
STDS = {
    "range_std": 0.07, "late_share": 0.31, "late_mean": 0.23, "acceleration_psd": 0.21,
    "turn_rate": 0.27, "turn_std": 0.19, "range_walk": 0.17,
}  # fmt: skip
BEACONS = np.array([[30.0, 22.0, 14.0], [-35.0, 41.0, 12.5], [-27.0, -33.0, 13.0],
                    [45.0, -38.0, 15.5]])
N = 64


def heard(n: int = N, late: int = 5, **changes: Any) -> Samples:
    """A diver on an arc; some ranges are late by 3 m; depth readings at other times."""
    rng = np.random.default_rng(3)
    time = 2.0 * np.arange(1, n + 1)
    beacon = np.array([0, 2, 1, 3])[np.arange(n) % 4]
    track = np.column_stack([14 * np.sin(time / 40), 9 * np.cos(time / 40), np.full(n, 8.0)])
    ranges = np.linalg.norm(track - BEACONS[beacon], axis=1) + 0.1 * rng.normal(size=n)
    ranges[n - 3 - 5 * np.arange(late)] += 3.0
    depth_ns = np.rint(1e9 * np.linspace(0.7, time[-1], 40)).astype(np.int64)
    made = Samples(
        0, depth_ns, 8 + 0.05 * rng.normal(size=40), np.rint(1e9 * time).astype(np.int64), beacon,
        ranges, np.zeros(n, bool), BEACONS[beacon], np.zeros((n, 3)),
    )
    return replace(made, **changes)


def chosen(
    turns: bool = False, walks: bool = False, stds: Mapping[str, float] | None = None,
    **logs: float,
) -> Fit:
    """A fit with these coordinates and standard deviations."""
    names = ["range_std", "late_share", "late_mean", "acceleration_psd"]
    names += ["turn_rate", "turn_std"] * turns + ["range_walk"] * walks
    at = np.array([{**LOGS, **logs}[name] for name in names])
    std = np.array([{**STDS, **(stds or {})}[name] for name in names])
    return Fit(tuple(names), at, np.diag(std**2), -7.0, 6 if turns else 1)


PUNCTUAL = chosen(range_std=np.log(0.2))
"""What is found if no range is late."""
OF_DEPTH = chosen(range_std=np.log(0.06), acceleration_psd=-7.5, stds={"range_std": 0.11})


BEGUN: dict[bytes, Any] = {}


def begun(*given: Any) -> Any:
    """The start, which takes its time, of ranges that may have come before."""
    key = b"".join(np.asarray(one).tobytes() for one in given)
    if key not in BEGUN:
        BEGUN[key] = start(*given)
    return BEGUN[key]


class Bench:
    """Identifies devices, with given fits in place of those that are searched for."""

    def __init__(self, seam: Seam) -> None:
        self.seam = seam
        self.found, self.of_depth = chosen(), OF_DEPTH
        self.parts: Callable[..., PositionParts | None] = lambda *given: None
        self.asked: list[Any] = []
        seam.instead(start, begun)
        seam.instead(parts, lambda *given: self.parts(*given))
        seam.instead(fit, self.fit)
        seam.instead(without_late, self.without_late)

    def fit(self, ranges: Any, noise: float, late: bool = True, walk: bool = True) -> Fit:
        assert late == walk
        self.asked.append((ranges, noise))
        return self.found if late else self.of_depth

    def without_late(self, ranges: Any, noise: float, found: Fit) -> Fit:
        assert (ranges, noise) == self.asked[-1]
        assert found is self.found
        return PUNCTUAL

    def device(self, found: Fit, samples: Samples | None = None, **known: Any) -> Device:
        self.found = found
        given = heard() if samples is None else samples
        body = ARMS if given.has_pose.any() else None
        return device_of(given, body, Assumed(**known))

    def rows(self, found: Fit, samples: Samples | None = None, **known: Any) -> dict[str, Number]:
        return {n.parameter: n for n in self.device(found, samples, **known).numbers}


@pytest.fixture
def bench(seam: Seam) -> Bench:
    return Bench(seam)


ARMS = np.array([[3.0, 1.0, 2.0], [-2.0, 4.0, 1.5], [-4.0, -3.0, 2.5], [5.0, -2.0, 1.0]])


def on_board(n: int = N, pose: Any = True) -> Samples:
    """The same on the arms of a boat that wanders, with its pose."""
    at = np.arange(n)
    wander = np.column_stack([5 + 0.3 * np.sin(at / 5), 7 + 0.2 * np.cos(at / 9), 0.1 + 0 * at])
    return heard(n, has_pose=np.full(n, pose), position=wander)


def interval(row: Number) -> tuple[float, float, float]:
    assert None not in (row.estimate, row.low, row.high)
    return row.estimate, row.low, row.high  # type: ignore[return-value]


def about(log: float, std: float) -> Any:
    """A number whose logarithm is known so."""
    return pytest.approx(np.exp([log, log - Z * std, log + Z * std]), rel=1e-5)


def said(row: Number) -> tuple[str, str, str]:
    return row.unit, row.told, row.explanation


def alike(number: int) -> Any:
    """Waves in the ranges of each beacon."""
    return 0.6 * np.sin(2 * np.pi * np.arange(number) / 40)


@pytest.mark.parametrize("waves", [False, True])
def test_noise_and_late_ranges_with_their_intervals(bench: Bench, waves: bool) -> None:
    given = heard()
    if waves:
        given = replace(given, range=given.range + alike(N))
    device = bench.device(chosen(), given)
    rows = {n.parameter: n for n in device.numbers}
    assert (device.wider > 1.1) == waves
    assert waves or device.wider == 1
    # What the model leaves out is 2 % of the noise.
    noise = np.hypot(0.07 * device.wider, 0.02)
    assert interval(rows["range_std"]) == about(np.log(0.1), noise)
    assert said(rows["range_std"]) == ("m", YES, "noise of a range")
    share = 1 / (1 + np.exp(2.2))
    t = stats.t.ppf(0.975, share * N - 1) * device.wider
    logit = -2.2 + np.array([0, -1, 1]) * 0.31 * t
    assert interval(rows["late_share"]) == pytest.approx(1 / (1 + np.exp(-logit)), rel=1e-5)
    assert said(rows["late_share"]) == ("", YES, "share of ranges that are late")
    assert interval(rows["late_mean"]) == about(0.4, 0.23 * t / Z)
    assert said(rows["late_mean"]) == ("m", YES, "their mean excess")
    assert [*rows][:3] == ["range_std", "late_share", "late_mean"]
    assert interval(rows["acceleration_psd"]) == about(-5.5, 0.21 * device.wider)
    assert said(rows["acceleration_psd"]) == (
        "m²/s³", YES, "density of the diver's white acceleration"
    )


def test_a_number_is_told_if_its_logarithm_is_known_to_a_half(bench: Bench) -> None:
    for name, what in (("acceleration_psd", "density of the diver's white acceleration"),
                       ("range_std", "noise of a range")):
        least = 0.02 if name == "range_std" else 0.0
        for std, told in ((0.4999, YES), (0.5001, NOT)):
            own = np.sqrt(std**2 - least**2)
            row = bench.rows(chosen(stds={name: own}))[name]
            vague = "" if told == YES else ": only known to a factor of 2.7"
            assert (row.told, row.explanation) == (told, what + vague)
            assert interval(row) == about(LOGS[name], std)
    # Of a share, to one and a half of its odds.
    t = stats.t.ppf(0.975, N / (1 + np.exp(2.2)) - 1) / Z
    row = bench.rows(chosen(stds={"late_share": 1.4999 / t}))["late_share"]
    assert row.told == YES
    row = bench.rows(chosen(stds={"late_share": 1.5001 / t}))["late_share"]
    assert said(row) == ("", NOT, "share of ranges that are late: 0.0058 to 0.68")


def test_late_ranges_are_told_from_three_of_three_times_the_noise(bench: Bench) -> None:
    def late(given: Samples | None = None, **logs: float) -> bool:
        rows = bench.rows(chosen(**logs), given)
        first = rows["late_share"]
        if first.told == YES:
            assert rows["range_std"].estimate == pytest.approx(0.1)
            return True
        assert rows["range_std"].estimate == pytest.approx(0.2)
        for name, unit in (("late_share", ""), ("late_mean", "m")):
            assert rows[name] == Number(
                name, None, None, None, unit, NONE_LATE,
                "fewer than 3, or within 3 times the noise",
            )
        return False

    assert late(late_mean=np.log(0.3001))
    assert not late(late_mean=np.log(0.2999))
    few = 3 / N
    assert late(late_share=np.log(few / (1 - few)) + 1e-6)
    assert not late(late_share=np.log(few / (1 - few)) - 1e-6)
    assert [late(heard(late=k)) for k in (2, 3, 4)] == [False, True, True]


def test_of_a_single_late_range_the_tails_are_the_widest(bench: Bench) -> None:
    few = 1.5 / 32
    given = heard(32, late=3)
    row = bench.rows(chosen(late_share=np.log(few / (1 - few))), given)["late_share"]
    assert row.told == NONE_LATE
    few = 3.2 / 32
    row = bench.rows(chosen(late_share=np.log(few / (1 - few))), given)["late_mean"]
    assert interval(row) == about(0.4, 0.23 * stats.t.ppf(0.975, 2.2) / Z)


def test_what_turns_and_walks_do_not_tell(bench: Bench) -> None:
    known = {"offset_std": 0.4, "scale_std": 0.02}
    turning, walking = (bench.device(chosen(**{what: True}), **known)
                        for what in ("turns", "walks"))
    rows = {n.parameter: n for n in turning.numbers}
    assert said(rows["late_share"]) == ("", TURNS, "a turn resembles a late range at first")
    assert said(rows["late_mean"]) == ("m", TURNS, "a turn resembles a late range at first")
    assert said(rows["acceleration_psd"]) == (
        "m²/s³", TURNS, "the diver moves by turns, with little between them"
    )
    assert interval(rows["turn_rate"]) == about(-3.2, 0.27 * turning.wider)
    assert interval(rows["turn_std"]) == about(-0.8, 0.19 * turning.wider)
    assert said(rows["turn_rate"]) == ("1/s", YES, "turns a second")
    assert said(rows["turn_std"]) == ("m/s", YES, "change of the velocity at a turn, per axis")
    assert rows["range_walk"] == Number(
        "range_walk", None, None, None, "m/√s", NOT,
        "constant offsets explain the ranges as well",
    )
    assert not any("walk" in line for line in turning.remarks)
    steady = {n.parameter: n for n in walking.numbers}
    assert interval(steady["range_walk"]) == about(-4.1, 0.17 * walking.wider)
    assert said(steady["range_walk"]) == ("m/√s", YES, "walk of a beacon's offset in a second")
    assert steady["range_offset[2]"].explanation == "error of the ranges to this beacon at the end"
    assert rows["range_offset[2]"].explanation == "constant error of the ranges to this beacon"
    assert walking.remarks[0] == (
        "offsets walk during the log, as where errors depend on the place: they are those of its "
        "end"
    )
    for name, unit in (("turn_rate", "1/s"), ("turn_std", "m/s")):
        assert steady[name] == Number(
            name, None, None, None, unit, NOT, "steady motion explains the ranges as well"
        )


def test_swings_of_a_platform_add_to_the_motion(bench: Bench) -> None:
    swings = (CarrierSwing(0.03, 0.4),)
    why = "the platform's own swings add to the diver's motion"
    for turns in (False, True):
        row = bench.rows(chosen(turns=turns), on_board(), swings=swings)["acceleration_psd"]
        assert said(row) == ("m²/s³", NOT, why)
        assert bench.rows(chosen(turns=turns), swings=swings)["acceleration_psd"].told != NOT
    row = bench.rows(chosen(turns=True), on_board(), swings=swings)["turn_std"]
    assert row.told == YES
    assert bench.rows(chosen(), on_board())["acceleration_psd"].told == YES


@pytest.mark.parametrize("walks", [False, True])
def test_scale_and_offsets_are_those_of_the_filter_and_wider(bench: Bench, walks: bool) -> None:
    given = heard()
    given = replace(given, range=given.range + alike(N))
    kept = given.beacon != 1
    given = replace(given, range_ns=given.range_ns[kept], beacon=given.beacon[kept],
                    range=given.range[kept], has_pose=given.has_pose[kept],
                    position=given.position[kept], attitude=given.attitude[kept])
    device = bench.device(chosen(walks=walks), given, offset_std=0.4, scale_std=0.02)
    own = evaluate(device.ranges, device.motion.parameters[None])
    mean, P = own.mean[0], own.covariance[0]
    std = np.sqrt(np.diag(P))
    wider = device.wider * 1.15 * (1 + std[SCALE] / 0.05)
    assert std[SCALE] > 0.005
    rows = {n.parameter: n for n in device.numbers}
    for name, i in (("range_scale", SCALE), ("range_offset[1]", OFFSET),
                    ("range_offset[3]", OFFSET + 2), ("range_offset[4]", OFFSET + 3)):
        expected = mean[i] + np.array([0, -1, 1]) * Z * std[i] * wider
        assert interval(rows[name]) == pytest.approx(expected, rel=1e-5)
    assert "range_offset[2]" not in rows
    assert said(rows["range_scale"]) == ("", YES, "share by which ranges are too long")
    assert device.correlation == pytest.approx({
        b: P[SCALE, OFFSET + b] / std[SCALE] / std[OFFSET + b] for b in (0, 2, 3)
    })


def test_a_scale_is_told_if_one_offset_differs_from_it_enough(bench: Bench) -> None:
    """Of a diver who hardly moves, distances do not vary but to a beacon that is near."""
    words = "at these distances they are alike (correlation of scale and offset {:.2f})"
    seen = set()
    for step in (1, 4, 8):
        n, number = N, np.arange(N)
        near = np.array([[4.0, 3.0, 9.0], *BEACONS[1:]])
        beacon = number % 4
        track = np.column_stack([0.05 * step * np.sin(number / 9), 0.05 * step * np.cos(number / 5),
                                 np.full(n, 8.0)])
        ranges = np.linalg.norm(track - near[beacon], axis=1)
        ranges += 0.05 * np.random.default_rng(8).normal(size=n)
        given = heard(beacon=beacon, range=ranges, position=near[beacon])
        device = bench.device(chosen(range_std=np.log(0.05)), given, scale_std=0.3)
        rows = {n.parameter: n for n in device.numbers}
        values = [device.correlation[b] for b in range(4)]
        least = min(values, key=abs)
        for name, own in (("range_scale", least),
                          *((f"range_offset[{b + 1}]", values[b]) for b in range(4))):
            told = NOT if abs(own) > 0.95 else YES
            assert rows[name].told == told, (name, own)
            seen.add((name, told))
            if told == NOT:
                assert rows[name].explanation == words.format(own)
    assert len(seen) >= 6


def test_residuals_that_resemble_each_other_widen_all_intervals(bench: Bench) -> None:
    given = heard(200)
    given = replace(given, range=given.range + alike(200))
    device = bench.device(chosen(), given)
    shown = evaluate(device.ranges, device.motion.parameters[None]).by_range
    residual = np.clip(shown["innovation"][0] / np.sqrt(shown["variance"][0]), -3, 3)
    each = [residual[device.ranges.beacon == b] for b in range(4)]
    each = [one - one.mean() for one in each]
    power = np.var(residual)
    likeness = []
    for lag in range(1, 20):
        products = np.concatenate([one[:-lag] * one[lag:] for one in each])
        likeness.append((products.sum() / len(products) / power, 3 / np.sqrt(len(products))))
    until = next(i for i, (own, noise) in enumerate(likeness) if own < noise)
    total = sum(own for own, _ in likeness[:until])
    assert until > 0
    assert device.wider == pytest.approx(np.sqrt(1 + 2 * total), rel=1e-9)
    assert device.remarks[-1] == (
        f"residuals of a beacon are correlated in time ({likeness[0][0]:.2f} with the one before): "
        f"intervals are {device.wider:.1f} times as wide as if they were independent"
    )
    assert bench.device(chosen()).wider == 1.0


def test_the_ranges_in_the_order_of_their_arrival_with_what_is_known(bench: Bench) -> None:
    given = heard()
    known = {
        "sound_speed": 12.0, "place_std": 0.31, "place_down_std": 0.17, "offset_std": 0.6,
        "scale_std": 0.04, "depth_bias_std": 0.09, "clock_walk_psd": 2e-5,
        "place_noise_std": 0.07, "place_down_noise_std": 0.11,
    }  # fmt: skip
    device = bench.device(chosen(), given, **known)
    g = device.ranges
    arrival = given.range_ns / 1e9 + given.range / 12.0
    order = np.argsort(arrival)
    assert (np.diff(order) < 0).any()
    assert g.time == pytest.approx(arrival[order])
    assert g.beacon.tolist() == given.beacon[order].tolist()
    assert g.range == pytest.approx(given.range[order])
    assert g.place == pytest.approx(given.position[order])
    std, psd = np.exp([np.log(0.06), -7.5])
    deep, variance = smoothed(given.depth_ns / 1e9, given.depth, std, psd)
    assert g.down == pytest.approx(np.interp(g.time, given.depth_ns / 1e9, deep))
    assert g.down_variance == pytest.approx(np.full(N, variance))
    assert g.beacons == 4
    noise = noise_of(g.time, g.range, g.beacon)
    assert bench.asked[-1][1] == noise
    at, unsure = start(g.time, g.beacon, g.range, g.place, g.down, noise)
    assert g.prior == pytest.approx({
        "north": at[0], "east": at[1], "velocity_north": at[2], "velocity_east": at[3],
        "position_std": unsure + 0.6, "velocity_std": 1.0, "clock_std": 0.0, "clock_walk": 2e-5,
        "scale_std": 0.04, "depth_bias_std": 0.09, "offset_std": 0.6, "place_std": 0.31,
        "place_down_std": 0.17, "place_noise_std": 0.07, "place_down_noise_std": 0.11,
    })
    far = bench.device(chosen(), given, **{**known, "offset_std": 3.0}).ranges.prior
    assert far["position_std"] - g.prior["position_std"] == pytest.approx(1.0 - 0.6)
    assert far["offset_std"] == 3.0
    # Without depth, at the mean depth of the beacons, and nothing down is uncertain.
    flat = replace(given, depth=given.depth[:9], depth_ns=given.depth_ns[:9])
    device = bench.device(chosen(), flat, **known)
    assert device.ranges.down == pytest.approx(np.full(N, given.position[:, 2].mean()))
    assert not device.ranges.down_variance.any()
    zero = {"depth_bias_std": 0.0, "place_down_std": 0.0, "place_down_noise_std": 0.0}
    assert {name: device.ranges.prior[name] for name in zero} == zero
    assert device.ranges.prior["place_std"] == 0.31
    assert device.ranges.prior["place_noise_std"] == 0.07


def test_of_a_platform_positions_are_relative_to_it(bench: Bench) -> None:
    given = replace(on_board(), attitude=np.tile([0.0, 0.0, np.pi / 2], (N, 1)))
    device = bench.device(chosen(), given)
    turned = np.column_stack([-ARMS[:, 1], ARMS[:, 0], ARMS[:, 2] + 0.1])
    assert device.ranges.place == pytest.approx(turned[device.ranges.beacon])
    assert device.remarks[0] == (
        "positions are relative to the platform, whose own motion counts as the diver's"
    )
    assert device.remarks[-1] == (
        "late ranges are perhaps known less well than their intervals say: of 30 simulated dives "
        "by platforms drawn at random, the intervals held the true share in 71 %, the true mean "
        "in 73 %"
    )
    for untold in (bench.device(chosen(turns=True), given), bench.device(chosen())):
        assert not any(line.startswith("late ranges are perhaps") for line in untold.remarks)


def test_all_ranges_are_taken_at_once_on_a_platform_without_turns(bench: Bench) -> None:
    asked: list[Any] = []
    answers: list[Any] = [None]

    def spied(ranges: Any, parameters: Any, begin: Any) -> Any:
        asked.append(parameters.tolist())
        return answers[0]

    bench.seam.instead(refined, spied)
    rows = bench.rows(chosen(), on_board())
    assert asked == [chosen().parameters.tolist()]
    for name in ("range_scale", "range_offset[1]", "range_offset[4]"):
        assert said(rows[name])[1:] == (
            NOT, "no track fits all ranges with them: many values are as probable"
        )
    bench.device(chosen(turns=True), on_board())
    bench.device(chosen(walks=True), on_board())
    bench.device(chosen())
    assert len(asked) == 1
    begin = bench.device(chosen()).of_ranges
    moved = begin.mean.copy()
    moved[0, SCALE] = 0.123
    answers[0] = replace(begin, mean=moved)
    assert bench.rows(chosen(), on_board())["range_scale"].estimate == 0.123


def test_buoys_that_report_places_do_not_tell_their_ranges(bench: Bench) -> None:
    bench.seam.instead(place_std, lambda ranges, found: 0.77)
    still = heard()
    for by, told in ((9e-7, True), (1.1e-6, False)):
        moved = still.position.copy()
        moved[9, 1] += by
        device = bench.device(chosen(), replace(still, position=moved))
        assert device.place_std == (0.77 if told else None)
        rows = {n.parameter: n for n in device.numbers}
        names = ("range_std", "late_share", "late_mean", "range_scale", "range_offset[3]",
                 "range_walk")
        why = "the errors of the beacons' own reported positions add to those of the ranges"
        for name in names:
            assert (rows[name].explanation == why) == (not told)
            assert told or rows[name].told == NOT
        assert rows["depth_std"].told == rows["acceleration_psd"].told == YES
    device = bench.device(chosen(), on_board())
    assert device.place_std is None
    assert {n.parameter: n.told for n in device.numbers}["range_std"] == YES


def test_readings_of_depth(bench: Bench) -> None:
    given = heard()
    few = {"depth_ns": given.depth_ns[:9], "depth": given.depth[:9]}
    device = bench.device(chosen(), replace(given, **few))
    row = {n.parameter: n for n in device.numbers}["depth_std"]
    assert row == Number(
        "depth_std", None, None, None, "m", NOT, "there are fewer than 10 depth readings"
    )
    assert device.remarks[0] == "no depth in this log: the diver is taken to stay at one depth"
    assert len(bench.asked) == 1
    ten = {"depth_ns": given.depth_ns[:10], "depth": given.depth[:10]}
    row = bench.rows(chosen(), replace(given, **ten))["depth_std"]
    assert interval(row) == about(np.log(0.06), 0.11)
    assert said(row) == ("m", YES, "noise of a depth reading")
    series, noise = bench.asked[1]
    assert series.time.tolist() == (given.depth_ns[:10] / 1e9).tolist()
    assert not series.place[:, 1:].any()
    far = np.abs(given.depth[:10] - series.place[:, 0])  # from that far in the north
    assert far.min() > 1e5
    assert series.range == pytest.approx(far, abs=1e-6, rel=1e-12)
    assert not series.down.any()
    assert not series.down_variance.any()
    assert noise == pytest.approx(noise_of(series.time, given.depth[:10], series.beacon))
    assert {k: v for k, v in series.prior.items() if v} == {
        "north": given.depth[0], "position_std": 1.0, "velocity_std": 0.5
    }
    # Turns of the depth make the smooth path follow them.
    bench.of_depth = chosen(turns=True, acceleration_psd=-7.5)
    down = bench.device(chosen(), given).ranges.down
    density = np.exp(-7.5) + np.exp(-3.2) * np.exp(-0.8) ** 2
    path = smoothed(given.depth_ns / 1e9, given.depth, 0.1, density)[0]
    assert down == pytest.approx(np.interp(given.range_ns / 1e9 + given.range / 1500,
                                           given.depth_ns / 1e9, path))


@pytest.mark.parametrize(("more", "every"), [(0, 1), (1, 2)])
def test_of_many_readings_of_depth_every_second_tells_their_noise(
    bench: Bench, more: int, every: int
) -> None:
    n = MOST_READINGS + more
    time = np.arange(n) * 4 * 10**7
    depth = 8 + np.sin(np.arange(n))
    bench.device(chosen(), heard(depth_ns=time, depth=depth))
    series, noise = bench.asked[0]
    assert series.time == pytest.approx(time[::every] / 1e9)
    assert noise == pytest.approx(noise_of(time[::every] / 1e9, depth[::every], series.beacon))


def test_of_many_ranges_whole_rounds_are_used_and_that_is_said(bench: Bench) -> None:
    n = MOST_RANGES + 1
    device = bench.device(chosen(), heard(n))
    assert len(device.ranges.time) == 6_001
    assert "6,001 of 12,001 ranges are used, in whole rounds" in device.remarks
    assert not any("whole rounds" in line for line in bench.device(chosen()).remarks)


def test_pings_that_are_lost(bench: Bench) -> None:
    rows = bench.rows(chosen())
    assert said(rows["loss_share"]) == (
        "", YES, "share of pings lost, of one every 8 s from each beacon"
    )
    assert rows["loss_share"].estimate == 0.0
    assert rows["loss_burst"] == Number(
        "loss_burst", None, None, None, "pings", NOT, "no ping is missing"
    )
    given = heard()
    kept = ~np.isin(np.arange(N), [20, 24, 41])
    some = replace(given, **{name: getattr(given, name)[kept] for name in (
        "range_ns", "beacon", "range", "has_pose", "position", "attitude")})
    rows = bench.rows(chosen(), some)
    assert rows["loss_share"].estimate == pytest.approx(3 / (N - 4))
    assert rows["loss_burst"].estimate == pytest.approx(1.5)
    assert said(rows["loss_burst"]) == ("pings", YES, "mean number lost in a row")
    rng = np.random.default_rng(1)
    odd = given.range_ns + rng.integers(-1_900_000_000, 1_900_000_000, N)
    rows = bench.rows(chosen(), replace(given, range_ns=odd))
    for name, unit in (("loss_share", ""), ("loss_burst", "pings")):
        assert rows[name] == Number(
            name, None, None, None, unit, NOT, "pings come at no regular interval"
        )
    slots = bench.rows(chosen(), slot_s=4.0)["loss_share"]
    assert slots.explanation == "share of pings lost, of one every 4 s from each beacon"
    assert slots.estimate == pytest.approx(0.5, abs=0.02)


def test_parts_of_reported_positions(bench: Bench) -> None:
    """Ends of 95 % intervals of the logarithms of white part, slow part and its time."""
    names = ("gps_std", "gps_markov_std", "gps_correlation_time")
    at, half = np.array([-2.0, -0.5, 1.2]), np.array([0.2, 0.3, 0.4])
    asked: list[Any] = []

    def rows(there: tuple[bool, bool] = (True, True), span: float = 1e4, half: Any = half,
             **known: Any) -> list[Number]:
        def given(series: Any, swings: Any = ()) -> PositionParts:
            asked.append((series, swings))
            return PositionParts(at, np.array([at - half, at + half]), there, span)

        bench.parts = given
        all_rows = bench.rows(chosen(), on_board(), **known)
        return [all_rows[name] for name in names]

    found = rows()
    assert [it.unit for it in found] == ["m", "m", "s"]
    for row, own, by in zip(found, at, half, strict=True):
        assert interval(row) == pytest.approx(np.exp([own, own - by, own + by]))
        assert row.told == YES
    what = ["white part of the reported positions",
            "slow part, the platform's own motion included", "its correlation time"]
    assert [it.explanation for it in found] == what
    swings = (CarrierSwing(0.03, 0.4),)
    assert [it.explanation for it in rows(swings=swings)] == [
        what[0], "slow part, without the platform's swings", what[2]
    ]
    ((series, given),) = asked[-1:]
    ((time, position),) = series
    assert time == pytest.approx(2.0 * np.arange(1, N + 1))
    assert position == pytest.approx(on_board().position[:, :2])
    assert given == swings
    # A part that is not there, and a log of less than 12 correlation times.
    assert [it.told for it in rows((False, True))] == [NOT, YES, YES]
    assert rows((False, True))[0].explanation == "the positions show no white part"
    assert [(it.told, it.explanation) for it in rows((True, False))[1:]] == [
        (NOT, "the positions show no slow part")] * 2
    longest = 12 * np.exp(1.2 + 0.4)
    assert [it.told for it in rows(span=1.001 * longest)] == [YES] * 3
    short = rows(span=0.999 * longest)
    assert [it.told for it in short] == [YES, NOT, NOT]
    assert short[2].explanation == "its correlation time may be too long for this log"
    # Known to a factor below e^(1.96 · 0.5).
    for i, row in enumerate(rows(half=0.499 * Z * np.ones(3))):
        assert (row.told, row.explanation) == (YES, what[i])
    for i, row in enumerate(rows(half=0.501 * Z * np.ones(3))):
        assert (row.told, row.explanation) == (NOT, f"{what[i]}: only known to a factor of 2.7")


def test_why_positions_tell_nothing(bench: Bench) -> None:
    few, still = "too few positions are reported", "reported positions do not change"

    def why(given: Samples) -> str:
        rows = bench.rows(chosen(), given)
        (one,) = {rows[n].explanation for n in ("gps_std", "gps_markov_std",
                                                 "gps_correlation_time")}
        assert [rows[n].unit for n in ("gps_std", "gps_markov_std", "gps_correlation_time")] == [
            "m", "m", "s"]
        return one

    assert why(heard(116)) == few  # 29 of each beacon
    assert why(heard(117)) == still
    board = replace(on_board(), position=np.full((N, 3), 2.0))
    for count, told in ((29, few), (30, still)):
        assert why(replace(board, has_pose=np.arange(N) < count)) == told


def test_the_fewest_ranges_and_the_most_beacons(bench: Bench) -> None:
    assert bench.device(chosen(), heard(30)).ranges.beacons == 4
    for given, got in ((heard(29), "29 to 4"), (replace(heard(), beacon=np.arange(N) % 2),
                                                 "64 to 2")):
        with pytest.raises(ConfigurationError) as refused:
            bench.device(chosen(), given)
        assert str(refused.value) == (
            "log: must have 30 ranges to three beacons or more, to identify a device, got " + got
        )
    most = replace(heard(), beacon=np.arange(N) % 16)
    assert bench.device(chosen(), most).ranges.beacons == 16
    with pytest.raises(ConfigurationError) as refused:
        bench.device(chosen(), replace(heard(), beacon=np.arange(N) % 17))
    assert str(refused.value) == "log: must have at most 16 beacons, got 17"


def test_two_offsets_of_unequal_uncertainty_differ_by_what_that_does_not_explain(
    bench: Bench,
) -> None:
    """With two, it is half of the squared difference minus the mean of the variances."""
    device = bench.device(chosen())
    for apart, found in ((1.8, np.sqrt(1.8**2 / 2 - (0.1**2 + 0.3**2) / 2)), (0.5, 0.0)):
        rows = [Number(f"range_offset[{b}]", at, at - Z * std, at + Z * std, "m", YES, "")
                for b, at, std in ((1, 0.4, 0.1), (3, 0.4 + apart, 0.3))]
        assert replace(device, numbers=rows).offsets_std == pytest.approx(found, rel=1e-5)


def test_what_is_usual_of_a_device_of_which_nothing_is_known(bench: Bench) -> None:
    """Five metres, a tenth of the distance, half a decimetre of depth, 1 mm of clock in 1 s."""
    prior = bench.device(chosen()).ranges.prior
    usual = {"offset_std": 5.0, "scale_std": 0.1, "depth_bias_std": 0.05, "clock_walk": 0.001**2}
    assert {name: prior[name] for name in usual} == pytest.approx(usual)
    assert not any(value for name, value in prior.items() if name.startswith("place"))
    arrival = heard().range_ns / 1e9 + heard().range / 1500.0
    assert bench.device(chosen()).ranges.time == pytest.approx(np.sort(arrival), abs=1e-9)
