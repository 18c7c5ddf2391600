"""What receivers of a log are given, tick after tick, and how what they gave is judged."""

from __future__ import annotations

import base64
import json
import zlib
from collections import deque
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sblcosim
from made_logs import made
from sblcosim import process
from sblcosim.data.estimates import Estimates
from sblcosim.data.truth import Truth
from sblcosim.logs.columns import KINDS
from sblcosim.logs.log import Log, Receptions
from sblcosim.models.declaration import number_of
from sblcosim.models.receiver.variables import INITIALISATION
from sblcosim.processing import quality
from sblcosim.processing.dive import PreparedDive, recorded_dive
from sblcosim.processing.knowing import longest_of, silences, that_know
from sblcosim.processing.pages import played as page_of
from sblcosim.processing.playing import plane_of, played, start_of
from sblcosim.processing.processed import Processed
from sblcosim.processing.running import decided, placed, ports_of, start_of_truth
from sblcosim.processing.settings import PRIOR, settled
from sblcosim.tracks.place import Origin

NS = 10**9
START = 1000 * NS
NAMES = ("A", "B", "C", "D")


def receptions(count: int = 40, beacons: int = 4, seed: int = 1, packet: bool = True) -> Receptions:
    """Packets that arrive in heaps, with numbers that are all different."""
    rng = np.random.default_rng(seed)
    arrival = START + np.sort(rng.integers(0, 12 * NS, count))
    shape = (count, 3)
    posed = rng.random(count) < 0.5
    return Receptions(
        arrival_ns=arrival, epoch_ns=arrival - rng.integers(1, NS // 2, count),
        beacon=rng.integers(0, beacons, count), kind=np.zeros(count, np.intp),
        range=rng.uniform(10, 90, count), beacon_position=rng.normal(0, 30, shape),
        has_pose=posed, platform_position=rng.normal(0, 9, shape) * posed[:, None],
        platform_attitude=rng.normal(0, 1, shape) * posed[:, None],
        packet=rng.normal(0, 30, (count, beacons, 3)) * packet,
        line=np.arange(count) + 2,
    )


def log_of(heard: Receptions, beacons: int = 4, plane: bool = False, **meta: Any) -> Log:
    base = made(seconds=8)
    rng = np.random.default_rng(2)
    depth_ns = START + np.sort(rng.integers(-NS, 13 * NS, 25))
    stated = base.meta.model_copy(update={"dimension": 2 if plane else 3, **meta})
    return replace(
        base, meta=stated, beacons=NAMES[:beacons], receptions=heard, truth=None,
        depth_ns=depth_ns[:0] if plane else depth_ns,
        depth=np.zeros(0) if plane else rng.uniform(3, 9, 25),
    )


def told_tick_by_tick(log: Log, interval: int, slots: list[int], newest: bool) -> dict[str, Any]:
    """The ports at every tick, by handing one packet after another over.

    Parameters
    ----------
    slots
        Place of the beacon of each reception.
    """
    heard = log.receptions
    start = log.start_ns - (interval if log.meta.start_ns is None else 0)
    flat = log.meta.dimension == 2
    depths: deque[Any] = deque(zip(log.depth_ns.tolist(), log.depth.tolist(), strict=True))
    waiting: dict[int, deque[int]] = {slot: deque() for slot in range(4)}
    arriving = deque(range(len(heard)))
    names = ("range", "range_epoch", "arrival_epoch", "count")
    state: dict[str, Any] = {name: np.zeros(4) for name in names}
    state |= {name: np.zeros((4, 3)) for name in ("place", "packet", "pose", "attitude")}
    state |= {"depth": 0.0, "depth_epoch": 0.0}
    newest_packet = -1
    rows = []
    tick = 0
    while True:
        now = start + tick * interval
        while arriving and heard.arrival_ns[arriving[0]] <= now:
            i = arriving.popleft()
            waiting[slots[i]].append(i)
        given = []
        for slot, own in waiting.items():
            while own:
                given.append((own.popleft(), slot))
                if not newest:
                    break  # the others wait
        for i, slot in sorted(given):
            state["range"][slot] = heard.range[i]
            state["range_epoch"][slot] = (heard.epoch_ns[i] - start) / NS
            state["arrival_epoch"][slot] = (heard.arrival_ns[i] - start) / NS
            state["count"][slot] += 1
            state["place"][slot] = heard.beacon_position[i]
            state["pose"][slot] = heard.platform_position[i]
            state["attitude"][slot] = heard.platform_attitude[i]
            if i < newest_packet:
                continue  # it had to wait, and a packet that is newer was given before
            newest_packet = i
            state["packet"][: heard.packet.shape[1]] = heard.packet[i]
            if flat:
                state["depth"] = np.median(heard.beacon_position[:, 2])
                state["depth_epoch"] = (heard.epoch_ns[i] - start) / NS
        while depths and depths[0][0] < now:  # a reading takes until the next tick
            time, state["depth"] = depths.popleft()
            state["depth_epoch"] = (time - start) / NS
        rows.append({name: np.copy(value) for name, value in state.items()})
        if now >= log.stop_ns and not arriving and not any(waiting.values()):
            return {name: np.stack([row[name] for row in rows]) for name in state}
        tick += 1


PORTS = {
    "range": "range", "range_epoch": "range_epoch", "arrival_epoch": "arrival_epoch",
    "reception_count": "count", "ping_beacon_position": "place",
    "packet_beacon_position": "packet", "ping_platform_position": "pose",
    "ping_platform_attitude": "attitude", "depth": "depth", "depth_epoch": "depth_epoch",
}  # fmt: skip


@pytest.mark.parametrize("newest", [False, True])
@pytest.mark.parametrize("interval", [300_000_000, 1_500_000_000])
@pytest.mark.parametrize("kind", ["usual", "stated", "plane", "three"])
def test_ports_are_those_of_packets_handed_over_one_by_one(
    kind: str, interval: int, newest: bool
) -> None:
    beacons = 3 if kind == "three" else 4
    heard = receptions(beacons=beacons, seed=len(kind))
    span = {"start_ns": START - 3 * NS, "stop_ns": START + 20 * NS} if kind == "stated" else {}
    log = log_of(heard, beacons, plane=kind == "plane", **span)
    given = played(log, interval, 4, newest=newest)
    assert given.start_ns == start_of(log, interval)
    assert given.start_ns == log.start_ns - (0 if kind == "stated" else interval)
    told = told_tick_by_tick(log, interval, heard.beacon.tolist(), newest)
    count = len(told["depth"])
    assert given.time_ns[-1] == (count - 1) * interval
    assert given.time_ns[:2].tolist() == [0, interval]
    at = np.searchsorted(given.time_ns, np.arange(count) * interval, side="right") - 1
    for port, name in PORTS.items():
        np.testing.assert_allclose(
            given.values[port][at], told[name], rtol=1e-13, atol=1e-12, err_msg=port
        )
    changes = np.any([
        np.any(np.diff(told[name], axis=0).reshape(count - 1, -1) != 0, axis=1)
        for name in PORTS.values()
    ], axis=0)  # fmt: skip
    listed = {0, 1, count - 1, *(np.flatnonzero(changes) + 1).tolist()}
    assert (given.time_ns // interval).tolist() == sorted(listed)
    assert given.slot.tolist() == heard.beacon.tolist()
    ticks = given.time_ns[given.tick]
    assert (ticks >= heard.arrival_ns - given.start_ns).all()
    if newest:
        assert (ticks - (heard.arrival_ns - given.start_ns) < interval).all()
        kept = {(t, b) for t, b in zip(ticks.tolist(), heard.beacon.tolist(), strict=True)}
        assert (given.waited, given.replaced) == (0, len(heard) - len(kept))
    else:
        due = -((given.start_ns - heard.arrival_ns) // interval)
        assert given.waited == (ticks // interval > due).sum()
        assert given.replaced == 0


def test_a_packet_without_places_or_of_too_many_beacons_has_none() -> None:
    log = log_of(receptions(packet=False))
    assert not played(log, NS, 4).values["packet_beacon_position"].any()
    wide = log_of(receptions())
    shown = played(wide, NS, 3).values["packet_beacon_position"]
    assert shown.shape[1:] == (3, 3)
    assert not shown.any()
    assert played(wide, NS, 5).values["packet_beacon_position"][-1, :4].all()


def test_a_beacon_takes_the_place_of_the_one_that_was_used_longest_ago() -> None:
    heard = receptions(9)
    order = np.array([0, 1, 2, 0, 3, 1, 0, 2, 3])
    log = log_of(replace(heard, beacon=order))
    # 3 takes that of 1, which takes that of 2, which takes that of 3, which takes that of 1
    assert played(log, NS, 3).slot.tolist() == [0, 1, 2, 0, 1, 2, 0, 1, 2]
    assert played(log, NS, 4).slot.tolist() == order.tolist()


def test_a_log_without_ranges_has_the_depths_alone() -> None:
    nothing = receptions().chosen(np.zeros(40, bool))
    log = log_of(nothing)
    given = played(log, NS, 4)
    assert given.values["range"].shape == (len(given.time_ns), 4)
    assert not given.values["range"].any()
    assert given.values["ping_beacon_position"].shape == (len(given.time_ns), 4, 3)
    assert given.values["depth"][-1] == log.depth[-1]
    assert plane_of(log) == 0.0


# --- What receivers are told beside the ports -----------------------------------------------------


def test_ports_count_from_the_origin_and_fixed_beacons_have_a_platform() -> None:
    log = made(seconds=24, origin=(5300.0, -2600.0, 0.0))
    packet = np.tile(log.receptions.beacon_position[:4], (24, 1, 1))
    packet[2] = 0.0
    log = replace(log, receptions=replace(log.receptions, packet=packet))
    ready = settled(log)
    given, plain = ports_of(ready), played(ready.log, ready.interval_ns, 4)
    np.testing.assert_array_equal(ready.origin, [5000.0, -3000.0, 0.0])
    for name in ("ping_beacon_position", "packet_beacon_position"):
        shown = plain.values[name].any(axis=-1)
        assert not shown.all()
        np.testing.assert_array_equal(
            given.values[name][shown], plain.values[name][shown] - ready.origin
        )
        assert not given.values[name][~shown].any()
    heard = given.values["reception_count"] > 0
    assert not heard.all()
    np.testing.assert_array_equal(
        given.values["ping_platform_position"],
        np.where(heard[..., None], [300.0, 400.0, 14.0], 0.0),
    )
    assert (given.time_ns == plain.time_ns).all()


def test_what_the_log_decides_of_a_receiver() -> None:
    beacons = np.array([[40.0, 40, 14], [-40, 40, 12], [-41, -40, 16]])
    ready = settled(made(seconds=24, beacons=beacons))
    assert ready.platform is not None
    np.testing.assert_array_equal(ready.platform, [-14.0, 13.0, 14.0])
    wider = replace(ready, slots=5, interval_ns=250_000_000)
    values = decided(wider, True, 0.2)
    arms = np.reshape(values["beacon_offset"], (5, 3))
    np.testing.assert_allclose(arms[:3], beacons - [-14.0, 13.0, 14.0])
    np.testing.assert_allclose(arms[3:], [arms[2]] * 2)
    assert values["update_interval"] == 0.25
    assert values["initialisation"] == PRIOR
    assert ready.window is not None
    assert values["prior_position"] == tuple(ready.window.position.tolist())
    without = replace(wider, window=None, platform=None)
    first = number_of(INITIALISATION, "first_receptions")
    assert decided(without, True, 0.2) == {"update_interval": 0.25, "initialisation": first}
    assert decided(without, False, 0.2) == {"update_interval": 0.25}
    simulated = replace(without, newest=True, origin=np.array([10.0, 20.0, 0.0]))
    truth = made(seconds=24, beacons=beacons).truth
    assert truth is not None
    start = truth.position[0] - [10.0, 20.0, 0.0]
    np.testing.assert_array_equal(start_of_truth(simulated), start)
    assert decided(simulated, True, 0.2) == {
        "initialisation": PRIOR, "prior_velocity": (0.0, 0.0, 0.0),
        "prior_position": tuple(start.tolist()), "update_interval": 0.25,
    }  # fmt: skip
    assert decided(simulated, False, 0.2) == {"update_interval": 0.25}
    np.testing.assert_array_equal(start_of_truth(without), [0.0, 0.0, 0.0])


def test_estimates_come_back_to_the_times_and_places_of_the_log() -> None:
    own = Estimates(
        epoch_ns=np.array([1, 5]), position=np.arange(6.0).reshape(2, 3),
        available_ns=np.array([2, 7]), until_ns=np.array([7, 9]),
        platform_position=np.ones((2, 3)),
    )
    found = placed(own, 100, np.array([10.0, 20.0, 30.0]))
    assert found.epoch_ns.tolist() == [101, 105]
    assert found.available_ns.tolist() == [102, 107]
    assert found.until_ns.tolist() == [107, 109]
    assert found.position.tolist() == [[10, 21, 32], [13, 24, 35]]
    assert found.platform_position.tolist() == [[11, 21, 31]] * 2
    bare = placed(Estimates(epoch_ns=own.epoch_ns, position=own.position), 1, np.zeros(3))
    assert bare.available_ns is bare.until_ns is bare.platform_position is None


# --- Estimates that know next to nothing ----------------------------------------------------------


def silent_log(times: list[float], beacons: list[int], kind: int = 0) -> Log:
    n = len(times)
    log = made(seconds=n)
    ns = np.round(np.array(times) * NS).astype(np.int64)
    heard = replace(
        log.receptions, arrival_ns=ns, epoch_ns=ns, beacon=np.array(beacons),
        kind=np.full(n, kind), range=np.linspace(20, 50, n),
    )
    return replace(log, receptions=heard, depth_ns=ns, depth=np.full(n, 5.0))


def test_a_silence_ends_with_the_third_beacon() -> None:
    times = [0, 1, 2, 3, 13.5, 14, 15, 16, 17, 60, 61, 62, 63]
    log = silent_log(times, [0, 1, 2, 3, 2, 2, 1, 2, 3, 0, 1, 0, 1])
    found, limit_s = silences(log)
    assert limit_s == 10.0
    assert found.tolist() == [
        [13 * NS, 17 * NS], [27 * NS, 2**62], [73 * NS, 2**62]
    ]  # fmt: skip


@pytest.mark.parametrize(("gap", "silent"), [(20.0, False), (20.1, True)])
def test_where_ranges_are_rare_a_silence_is_ten_times_as_long_as_usual(
    gap: float, silent: bool
) -> None:
    times = [*np.arange(0, 40, 2.0), *(38 + gap + np.arange(0, 40, 2.0))]
    log = silent_log(times, [i % 4 for i in range(40)])
    found, limit_s = silences(log)
    assert limit_s == 20.0
    assert len(found) == 1 + silent
    if silent:
        assert found[0].tolist() == [58 * NS, round((38 + gap + 4) * NS)]


def claimed(times: Any, size: Any) -> Estimates:
    """Estimates with a claimed horizontal deviation, three fifths of it north."""
    std = np.broadcast_to(np.asarray(size, float), (len(times),))[:, None] * [0.6, 0.8, 7.0]
    ns = np.round(np.asarray(times, float) * NS).astype(np.int64)
    return Estimates(epoch_ns=ns, position=np.ones((len(ns), 3)), position_std=std)


def test_what_is_left_out_after_a_silence_and_what_knows_less_than_a_range() -> None:
    times = [*range(20), *range(50, 80)]
    log = silent_log(times, [i % 4 for i in range(50)])
    assert longest_of(log) == 50.0
    size = np.ones(60)
    epochs = np.r_[np.arange(20.0), 28, 29.0, 29.5, 51, np.arange(52.0, 80), np.full(8, 79.5)]
    size[4] = 49.9
    size[5] = 50.1
    size[[24, 25, 26]] = [5.1, 4.9, 8.0]  # at 52, 53 and 54 s
    own, other = claimed(epochs, size), claimed(epochs[6:20], 1.0)
    kept, said = that_know(log, {"mine": own, "other": other})
    left = sorted({*epochs.tolist()} - {*(kept["mine"].epoch_ns / NS).tolist()})
    assert left == [5.0, 29.5, 51.0, 52.0]
    assert kept["other"] is other
    assert said == [
        "mine: 3 estimates left out, more than 10 s after the last range, and before 3 beacons "
        "were heard again and claims were at most 5 times as large as usual",
        "mine: 1 estimate left out, whose claimed deviation is above 50 m, the longest range",
    ]
    differences = replace(log, receptions=replace(
        log.receptions, kind=np.full(50, KINDS.index("difference"))))  # fmt: skip
    assert longest_of(differences) == np.inf
    assert 5.0 in (that_know(differences, {"mine": own})[0]["mine"].epoch_ns / NS)
    bare = replace(own, position_std=None)
    assert sorted({*epochs.tolist()}
                  - {*(that_know(log, {"a": bare})[0]["a"].epoch_ns / NS)}) == [29.5, 51.0]
    lost = claimed([29.5, 40.0, 51.0], 1.0)
    assert len(that_know(log, {"a": lost})[0]["a"]) == 0


# --- Residuals and errors -------------------------------------------------------------------------


def straight(count: int = 20, step_s: float = 1.0) -> Estimates:
    """A line through places that are not in the order of time."""
    time_s = step_s * np.arange(float(count))
    position = np.column_stack([3 + 0.5 * time_s, 4 - 0.25 * time_s, 5 + 0 * time_s])
    order = np.argsort(np.cos(7 * time_s))
    ns = np.round(time_s * NS).astype(np.int64)
    return Estimates(epoch_ns=ns[order], position=position[order])


def test_residuals_are_ranges_minus_those_between_estimates() -> None:
    times = [-0.5, 0.0, 0.25, 3.75, 9.5, 18.999, 19.0, 19.5]
    log = silent_log(times, [0, 1, 2, 3, 0, 1, 2, 3])
    which, off = quality.residuals_of(log, straight())
    assert which.tolist() == [False, *[True] * 6, False]
    t = np.array(times)[which][:, None]
    place = np.hstack([3 + 0.5 * t, 4 - 0.25 * t, 5 + 0 * t])
    length = np.linalg.norm(place - log.receptions.beacon_position[which], axis=1)
    np.testing.assert_allclose(off, log.receptions.range[which] - length, rtol=1e-12)
    signed = replace(log.receptions, kind=np.array([0, 0, 5, 0, 5, 0, 0, 5]))
    middle = quality.middles_of(signed)
    np.testing.assert_array_equal(middle, signed.beacon_position)  # each of a ping of its own
    _, apart = quality.residuals_of(replace(log, receptions=signed), straight())
    # A difference to the middle, which is the beacon itself, is 0.
    zero = np.where(signed.kind[which] == 5, log.receptions.range[which], off)
    np.testing.assert_allclose(apart, zero, rtol=1e-12)


def test_the_middle_of_the_beacons_is_that_of_the_packet_or_of_those_that_heard_the_ping() -> None:
    heard = receptions(6)
    packet = heard.packet.copy()
    packet[2] = 0.0
    packet[3:] = 0.0
    heard = replace(heard, epoch_ns=np.array([7, 3, 7, 3, 3, 9]), packet=packet)
    p = heard.beacon_position
    by_hand = [
        packet[0].mean(axis=0), packet[1].mean(axis=0), (p[0] + p[2]) / 2,
        (p[1] + p[3] + p[4]) / 3, (p[1] + p[3] + p[4]) / 3, p[5],
    ]
    np.testing.assert_allclose(quality.middles_of(heard), by_hand)


@pytest.mark.parametrize(("count", "share", "length", "said"), [
    (9, 1.0, 40.0, None), (10, 1.0, 40.0, "40 m, at ranges of 80 m"),
    (12, 0.069, 100.0, None), (12, 0.071, 100.0, "7.6 m, at ranges of 108 m"),
    (12, 0.2, 14.0, None), (12, 0.2, 16.0, "4.0 m, at ranges of 20 m"),
])  # fmt: skip
def test_ranges_that_do_not_fit_by_7_percent_or_by_3_m_are_said(
    count: int, share: float, length: float, said: str | None
) -> None:
    log = silent_log([0.5 * i for i in range(count)], [i % 4 for i in range(count)])
    still = Estimates(
        epoch_ns=np.array([0, 100 * NS]), position=np.array([[length, 0, 0], [length, 0, 0]])
    )
    off = share * length if said is None or length == 40.0 else share * length / (1 - share)
    ranges = np.full(count, length + off)
    heard = replace(log.receptions, beacon_position=np.zeros((count, 3)), range=ranges)
    found = quality.misfit(replace(log, receptions=heard), still)
    assert found == ([] if said is None else [
        f"ranges do not fit the beacons: half of the residuals are above {said}; check the units "
        "of the ranges and the depths, and the places of the beacons"
    ])  # fmt: skip


@pytest.mark.parametrize(("depth", "posed", "kind", "words"), [
    ([40.0, 40.0, 40.0], False, "one-way",
     "check the units of the ranges and the depths, and the places of the beacons"),
    ([40.0, 40.0, 40.0], True, "one-way", "check the units of the ranges, the depths and the "
     "platform's angles, and the places of the beacons"),
    ([], True, "one-way",
     "check the units of the ranges and the platform's angles, and the places of the beacons"),
    ([900.0, -60.5, 3.0], True, "one-way", "the depth is wrong, perhaps its unit: half of its "
     "readings are above 60 m, but ranges and beacons allow 60 m at most"),
    ([59.5, -59.5, 900.0], False, "one-way",
     "check the units of the ranges and the depths, and the places of the beacons"),
    ([900.0, 900.0, 900.0], False, "difference",
     "check the units of the ranges and the depths, and the places of the beacons"),
])  # fmt: skip
def test_what_may_be_wrong_where_ranges_do_not_fit_is_named(
    depth: list[float], posed: bool, kind: str, words: str
) -> None:
    log = silent_log([0.5 * i for i in range(12)], [i % 4 for i in range(12)])
    still = Estimates(
        epoch_ns=np.array([0, 100 * NS]), position=np.array([[20.0, 0, 0], [20.0, 0, 0]])
    )
    places = np.zeros((12, 3))
    places[0, 2] = 10.0
    heard = replace(
        log.receptions, beacon_position=places, range=np.full(12, 50.0),
        has_pose=np.full(12, posed), kind=np.full(12, KINDS.index(kind)),
    )
    log = replace(log, receptions=heard, depth=np.array(depth),
                  depth_ns=np.arange(len(depth)) * NS)
    (line,) = quality.misfit(log, still)
    assert line.endswith(f" m; {words}")


def test_errors_gaps_and_claims_of_a_receiver_by_hand() -> None:
    time_s = np.array([4.0, 1.5, 9.0, 2.0])
    truth = Truth(time_ns=np.array([0, 6 * NS]), position=np.array([[0.0, 0, 2], [6.0, 12, 2]]))
    off = np.array([[3.0, 4.0, 12.0], [1.0, 0.0, 0.0], [50.0, 0, 0], [0.0, 2.0, 1.5]])
    position = np.column_stack([time_s, 2 * time_s, np.full(4, 2.0)]) + off
    P = np.tile(np.diag([4.0, 99, 5.0, 99, 100, 99]), (4, 1, 1))
    P[:, 0, 2] = P[:, 2, 0] = 1.0
    claim = np.array([1.0, 4.0, 9.0, 2.0])
    P *= claim[:, None, None]
    P[1, 4, 4], P[3, 4, 4] = -1.0, 0.0
    own = Estimates(
        epoch_ns=(time_s * NS).astype(np.int64), position=position, covariance=P,
        nis=np.array([1.0, 2.0, np.nan, 4.0]), nis_degrees=np.array([2, 3, 2, 0]),
    )
    log = silent_log([0.5, 9.0], [0, 1])
    row = quality.row_of(log, own, truth)
    level = np.linalg.inv([[4.0, 1.0], [1.0, 5.0]])
    each = [off[i, :2] @ level @ off[i, :2] / claim[i] for i in (0, 1, 3)]
    made_m = np.sqrt((25 + 1 + 4) / 3)
    assert row == {
        "estimates": 4, "first_fix_s": 1.0, "longest_gap_s": 5.0, "judged": 3,
        "horizontal_rms_m": pytest.approx(made_m), "horizontal_p95_m": 5.0,
        "horizontal_max_m": 5.0, "total_rms_m": pytest.approx(np.sqrt((169 + 1 + 6.25) / 3)),
        "total_p95_m": 13.0, "claimed_rms_m": pytest.approx(np.sqrt(9 * 7 / 3)),
        "claimed_over_made": pytest.approx(np.sqrt(21) / made_m),
        "nees": pytest.approx(np.mean(each)), "nis": 1.5, "nis_expected": 2.5,
    }  # fmt: skip
    assert quality.std_of(own)[0].tolist() == [2.0, np.sqrt(5.0), 10.0]
    assert np.isnan(quality.std_of(own)[1, 2])
    assert quality.std_of(own)[3, 2] == 0.0
    flat = replace(log, meta=log.meta.model_copy(update={"dimension": 2}))
    assert not any("total" in name for name in quality.row_of(flat, own, truth))
    alone = quality.row_of(log, own, None)
    assert set(alone) == {"estimates", "first_fix_s", "longest_gap_s", "claimed_rms_m", "nis",
                          "nis_expected"}  # fmt: skip
    assert alone["claimed_rms_m"] == pytest.approx(np.sqrt(9 * 16 / 4))
    one = quality.row_of(log, own.chosen(np.array([2])), truth)
    assert one["judged"] == 0
    assert np.isnan(one["longest_gap_s"])
    assert set(one) == {"estimates", "first_fix_s", "longest_gap_s", "judged"}
    table = quality.table_of(log, own, truth, Origin(50.0, 8.0, 0.0))
    np.testing.assert_allclose(table[["x_m", "y_m", "z_m"]], position)
    np.testing.assert_allclose(table.epoch_s, time_s - 0.5)
    np.testing.assert_allclose(
        table[["error_x_m", "error_y_m", "error_z_m"]], np.where(time_s[:, None] < 9, off, np.nan)
    )
    np.testing.assert_allclose(table.error_horizontal_m, [5.0, 1.0, np.nan, 2.0])
    np.testing.assert_allclose(
        table[["true_x_m", "true_y_m", "true_z_m"]],
        np.where(time_s[:, None] < 9, position - off, np.nan),
    )
    np.testing.assert_allclose(table.std_y_m, np.sqrt(5.0 * claim))
    np.testing.assert_allclose(table.latitude_deg, 50 + position[:, 0] / 111_229, atol=2e-6)
    np.testing.assert_allclose(table.longitude_deg, 8 + position[:, 1] / 71_696, atol=2e-6)
    assert "latitude_deg" not in quality.table_of(log, own, None)


def test_a_table_of_residuals_has_a_row_for_each_beacon_and_for_the_depth() -> None:
    log = silent_log([0.5 * i for i in range(20)], [i % 3 for i in range(20)])
    own = straight()
    found = quality.residuals(log, {"a": own, "none": own.chosen(np.zeros(0, np.intp))})
    assert [*found.index] == [("a", "B0"), ("a", "B1"), ("a", "B2"), ("a", "depth")]
    assert found.n.tolist() == [7, 7, 6, 20]
    assert found.offset_m["a", "depth"] == pytest.approx(0.0)
    which, off = quality.residuals_of(log, own)
    assert which.all()
    assert found.offset_m["a", "B1"] == np.median(off[1::3])
    assert np.isnan(found.slope["a", "depth"])
    nothing = quality.residuals(log, {})
    assert not len(nothing)
    assert [*nothing.columns] == [*found.columns]


def test_a_row_of_residuals_with_outliers_by_hand() -> None:
    """About the median, 0.5: -1, 0, 1 and so on; two are clipped to three deviations."""
    about = np.array([-1.0, 0, 1, 1, 0, -1, 40, 0, 0, 1, -1, 0, 5.94, -5.92, 1, -1, 0, 1, -1, -3])
    row = quality.described(about + 0.5, None)
    std = 1.4826
    assert row["std_m"] == pytest.approx(std)
    assert row["offset_m"] == pytest.approx(0.5)
    clipped = np.clip(about, -3 * std, 3 * std)
    clipped -= clipped.mean()
    lag = sum(a * b for a, b in zip(clipped[1:], clipped[:-1], strict=True))
    assert row["autocorrelation"] == pytest.approx(lag / (clipped @ clipped))
    assert row["tails"] == pytest.approx(2 / 20)  # 4 deviations are 5.93
    flat = quality.described(np.full(5, 2.0), np.arange(5.0))
    assert flat["slope"] == 0.0
    assert np.isnan(flat["tails"])
    assert np.isnan(flat["autocorrelation"])
    two = quality.described(np.array([1.0, 2.0]), np.array([5.0, 9.0]))
    assert np.isnan(two["slope"])
    three = quality.described(np.array([1.0, 2.0, 5.0]), np.array([5.0, 9.0, 9.0]))
    assert three["slope"] == pytest.approx(5 / 8)  # of 1/4 and 4/4
    assert np.isnan(quality.described(np.array([1.0, 2.0, 5.0]), np.full(3, 9.0))["slope"])


def test_how_alike_residuals_are_by_hand() -> None:
    """Bartlett's weights over forty lags; sizes above three deviations count as three."""
    rng = np.random.default_rng(4)
    beacon = rng.integers(0, 3, 150)
    off = rng.standard_normal(150).cumsum() / 4
    power = total = 0.0
    for one in range(3):
        own = np.clip(off[beacon == one], -3, 3)
        own = own - own.mean()
        power += own @ own
        for lag in range(1, 41):
            pairs = sum(own[i] * own[i - lag] for i in range(lag, len(own)))
            total += (1 - lag / 41) * pairs
    assert np.abs(off).max() > 3
    assert quality.resemblance(beacon, off) == pytest.approx(np.sqrt(1 + 2 * total / power))
    assert quality.resemblance(beacon, np.zeros(150)) == 1.0
    wave = np.tile([1.0, -1.0], 60)
    assert quality.resemblance(np.zeros(120, int), wave) < 0.2
    long = np.random.default_rng(5).standard_normal(1000)
    slow = np.convolve(long, np.ones(80) / 9, "same")  # hundred lags, of a thousand residuals
    slow = slow / 3
    own = np.clip(slow, -3, 3) - np.clip(slow, -3, 3).mean()
    lags = [own[lag:] @ own[:-lag] * (1 - lag / 100) for lag in range(1, 100)]
    expected = np.sqrt(1 + 2 * sum(lags) / (own @ own))
    assert quality.resemblance(np.zeros(1000, int), slow) == pytest.approx(expected, rel=1e-9)


def test_at_its_end_a_smoother_knows_what_a_filter_knows() -> None:
    """It has learned a motion of its own, so that they are not quite alike."""
    done = process(made(seconds=60), ["long_baseline"], smooth=True)
    ends = [done.made[label].covariance[-1] for label in ("long_baseline", "smoother")]
    of_filter, of_smoother = (P[0, 0] + P[2, 2] for P in ends)
    assert 0.65 < of_smoother / of_filter < 1.1


# --- A page ---------------------------------------------------------------------------------------


def test_a_page_shows_where_beacons_last_said_that_they_were() -> None:
    times = [1.0, 2.0, 3.0, 4.0, 5.0]
    log = silent_log(times, [2, 0, 2, 0, 2])
    place = np.arange(15.0).reshape(5, 3)
    log = replace(log, receptions=replace(log.receptions, beacon_position=place), truth=None)
    own = Estimates(
        epoch_ns=np.array([4, 2, 3]) * NS, position=np.arange(9.0).reshape(3, 3),
        available_ns=np.array([4, 5, 4]) * NS, until_ns=np.array([5, 6, 5]) * NS,
    )
    done = Processed(log=log, scenario=sblcosim.load("harbour-lbl"), made={"mine": own})
    page = page_of(done)
    assert page.time_ns.tolist() == [t * NS for t in (1, 2, 3, 4, 5)]
    assert (page.start_ns, page.stop_ns, page.zero_ns) == (NS, 5 * NS, NS)
    assert page.reported is not None
    np.testing.assert_array_equal(page.reported[:, 2], place[[0, 0, 2, 2, 4]])
    np.testing.assert_array_equal(page.reported[:, 0], place[[1, 1, 1, 3, 3]])
    assert np.isnan(page.reported[:, [1, 3]]).all()
    (receiver,) = page.receivers
    assert (receiver.epoch_ns // NS).tolist() == [3, 4, 2]
    assert (receiver.since_ns // NS).tolist() == [4, 4, 5]
    assert page.run == "log made"
    assert page.axes == ("North", "East")
    assert (page.error, page.diver) == ("total", None)
    truth = Truth(time_ns=np.array([0, 10]) * NS, position=np.array([[0.0, 0, 0], [20.0, 10, 5]]))
    flat = replace(log, meta=log.meta.model_copy(update={"dimension": 2}), truth=truth)
    page = page_of(replace(done, log=flat, truth=truth))
    assert page.error == "horizontal"
    assert page.time_ns.tolist() == [t * NS for t in (0, 1, 2, 3, 4, 5, 10)]
    np.testing.assert_allclose(page.diver, np.outer([0, 1, 2, 3, 4, 5, 10], [2.0, 1.0, 0.5]))


def unpacked(text: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Facts and tables of a packed dive, read as a page does."""
    whole = zlib.decompress(base64.b64decode(text))
    size = int.from_bytes(whole[:4], "little")
    facts = json.loads(whole[4 : 4 + size])
    at, tables = -(-(4 + size) // 8) * 8, {}
    for name, (rows, columns) in facts["tables"].items():
        own = np.frombuffer(whole, "<f8", rows * columns, at)
        tables[name] = own.reshape(columns, rows).T
        at += 8 * rows * columns
    assert at == len(whole)
    return facts, tables


@pytest.mark.parametrize("pad", range(8))
def test_a_packed_dive_is_its_facts_and_its_numbers(pad: int) -> None:
    given = {"a": np.arange(6.0).reshape(2, 3), "b": np.full((5, 1), -0.1)}
    dive = PreparedDive(sblcosim.load("harbour-lbl"), {"x": "y" * pad}, given)
    facts, tables = unpacked(dive.packed(more=[1, 2]))
    assert facts == {"x": "y" * pad, "more": [1, 2], "tables": {"a": [2, 3], "b": [5, 1]}}
    for name, table in given.items():
        np.testing.assert_array_equal(tables[name], table)


def test_a_dive_for_a_page_has_what_receivers_are_given_and_the_truth() -> None:
    log = made(seconds=40, start_s=100.0, origin=(5300.0, -2600.0, 0.0))
    dive = recorded_dive(log, (), {"acoustics.range_std_m": 0.25})
    ready = settled(log, None, {"acoustics.range_std_m": 0.25})
    given = ports_of(ready)
    facts, tables = dive.facts, dive.tables
    assert dive.scenario.acoustics.range_std_m == 0.25
    assert facts["command"] == {
        "log": "made", "scenario": None, "mapping": None, "set": {"acoustics.range_std_m": "0.25"}
    }  # fmt: skip
    assert facts["zero_ns"] == str(101 * NS)
    assert (facts["start_ns"], facts["interval_ns"]) == (-NS, NS)
    assert facts["origin"] == [5000.0, -3000.0, 0.0]
    assert facts["truth_gap_ns"] == 10 * NS
    assert (facts["beacons"], facts["names"]) == (4, ["B0", "B1", "B2", "B3"])
    assert (facts["log"], facts["title"], facts["rough"], facts["simulated"]) == (
        "made", "made", True, False
    )
    assert not facts["plane"]
    assert not facts["differences"]
    longest = log.receptions.range.max()
    assert facts["knowing"] == {
        "longest": longest, "usual": 5.0, "silences": [[49 * NS, 2**53]]
    }  # fmt: skip
    told = decided(ready, True, 0.0)
    assert facts["parameters"]["told"]["prior_position"] == [*told["prior_position"]]
    np.testing.assert_array_equal(tables["time"][:, 0], given.time_ns)
    for name, own in given.values.items():
        np.testing.assert_array_equal(tables[name], own.reshape(len(own), -1))
    heard, truth = log.receptions, log.truth
    assert truth is not None
    np.testing.assert_array_equal(tables["heard.epoch"][:, 0], np.arange(40) * NS)
    np.testing.assert_array_equal(tables["heard.range"][:, 0], heard.range)
    np.testing.assert_array_equal(tables["heard.place"], heard.beacon_position)
    np.testing.assert_array_equal(tables["depth.epoch"][:, 0], log.depth_ns - 101 * NS)
    np.testing.assert_array_equal(tables["truth.time"][:, 0], truth.time_ns - 101 * NS)
    np.testing.assert_array_equal(tables["truth.position"], truth.position)
    assert "truth.velocity" not in tables
    assert "heard.middle" not in tables
    bare = recorded_dive(replace(log, truth=None))
    assert not any(name.startswith("truth") for name in bare.tables)


# --- The result -----------------------------------------------------------------------------------


def nothing() -> Estimates:
    return Estimates(epoch_ns=np.zeros(0, np.int64), position=np.zeros((0, 3)))


def result(**more: Any) -> Processed:
    log = made(seconds=24, start_s=7.0)
    truth = log.truth
    assert truth is not None
    off, aside = np.add(truth.position, [0.3, 0.4, 1.2]), truth.position - [0.0, 0.8, 0.0]
    own = Estimates(epoch_ns=truth.time_ns[2:20], position=off[2:20])
    other = Estimates(epoch_ns=truth.time_ns[5:9], position=aside[5:9])
    keys: dict[str, Any] = {
        "log": log, "scenario": sblcosim.load("harbour-lbl"), "truth": truth,
        "made": {"none": nothing(), "mine": own, "other": other, "raw": nothing()},
        "restarts": {"mine": 3}, "failures": {"bad": "bad: it is broken"},
        "origins": {"mine": {"type": "ekf"}}, "interval_ns": 250_000_000,
        "said": ["first"], "doubts": ["second"], "asked": {"smooth": False},
    }
    return Processed(**(keys | more))


def test_a_result_says_what_failed_and_what_gave_nothing() -> None:
    done = result()
    assert done.main == "mine"
    assert done.problems == [
        "bad: it is broken", "none: must give at least one estimate, got none"
    ]  # fmt: skip
    rows = done.receivers
    assert [*rows.index] == ["none", "mine", "other", "raw", "bad"]
    assert rows.estimates.tolist() == [0, 18, 4, 0, 0]
    assert rows.restarts["mine"] == 3
    assert rows.restarts.isna().sum() == 4
    assert rows.failure["bad"] == "bad: it is broken"
    assert rows.horizontal_rms_m["mine"] == pytest.approx(0.5)
    assert rows.total_rms_m["mine"] == pytest.approx(1.3)
    assert rows.horizontal_rms_m["other"] == pytest.approx(0.8)
    assert repr(done) == "<Processed of made: none, mine, other, raw>"
    assert done.has_residuals
    assert done.remarks == ["first"]
    assert result(made={"raw": nothing()}).main == ""
    assert not result(made={"raw": nothing()}).has_residuals


def test_a_result_as_plain_data() -> None:
    done = result()
    found = done.to_json()
    plain = ("log", "dimension", "beacons", "ranges", "duration_s", "has_truth", "remarks",
             "doubts")  # fmt: skip
    assert [found[name] for name in plain] == [
        "made", 3, ["B0", "B1", "B2", "B3"], 24, 23.0, True, ["first"], ["second"]
    ]  # fmt: skip
    assert set(found["residuals"]) == {"mine", "other"}
    assert set(found["residuals"]["mine"]) == {"B0", "B1", "B2", "B3", "depth"}
    assert found["residuals"]["mine"]["depth"]["offset_m"] == pytest.approx(-1.2, abs=0.1)
    apart = found["agreement"]["mine"]["other"]
    assert apart["horizontal_rms_m"] == pytest.approx(np.hypot(0.3, 1.2))
    assert apart["n"] == 4
    assert found["receivers"]["bad"]["failure"] == "bad: it is broken"
    assert not result(truth=None).to_json()["has_truth"]
    told = done.manifest()
    assert (told["processed"], told["interval_s"], told["asked"]) == ("made", 0.25,
                                                                      {"smooth": False})
    assert told["receivers"][1] == {"label": "mine", "type": "ekf"}
    assert told["log_sha256"] == done.log.sha256()
    assert "target" not in told["scenario"]
    assert "platform" in told["scenario"]
    assert set(done.tables) == {"estimates", "receivers", "residuals", "agreement"}
    table = done.tables["estimates"]
    assert table.columns[0] == "receiver"
    assert table.receiver.tolist() == ["mine"] * 18 + ["other"] * 4
    assert table.epoch_s.tolist()[:2] == [2.0, 3.0]
    assert result(made={}).estimates.columns.tolist() == ["receiver"]


def test_what_is_along_axes_of_its_own_is_apart() -> None:
    """A device's positions are forward and starboard; those of receivers are north and east."""
    plain = result()
    log = plain.log
    frame = log.meta.frame.model_copy(update={"own_axes": ("usbl",)})
    own = plain.made["other"]
    turned = replace(log, fixes={"usbl": own}, meta=log.meta.model_copy(update={"frame": frame}))
    done = result(log=turned, made={"mine": plain.made["mine"], "usbl": own})
    assert [*done.along(True)] == ["usbl"]
    assert [*done.along(False)] == ["mine"]
    assert done.remarks[-1] == (
        "usbl (forward, starboard) and mine (north, east) are not compared, and not on one map: "
        "their axes differ"
    )
    assert not done.truth_axes
    assert done.on_map(False)[2] is done.truth
    assert done.on_map(True)[2] is None
    assert "error_x_m" in done.tracks["mine"]
    assert "error_x_m" not in done.tracks["usbl"]
    assert not len(done.agreement)
    assert [path.name for path in done.paths] == ["truth", "mine"]
    assert {job.name for job in done.figures} == {
        "map", "map_own_axes", "errors", "residuals_by_time", "residuals_by_range"
    }  # fmt: skip
    alone = result(log=turned, made={"usbl": own})
    assert not alone.has_residuals
    assert [path.name for path in alone.paths] == ["truth", "usbl"]
    assert {job.name for job in alone.figures} == {"map_own_axes", "errors"}
    assert alone.remarks == ["first"]
    assert [path.name for path in result(truth=None).paths] == ["none", "mine", "other", "raw"]
