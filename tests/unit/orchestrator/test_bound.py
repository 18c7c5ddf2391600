"""The recursion in C beside a direct one, and beside small cases by hand."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from math import sqrt
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import direct_bound
import numpy as np
import pytest
import sblcosim
from sanitized import is_clean
from sblcosim.areas import motion
from sblcosim.areas.grid import grid_of
from sblcosim.areas.possible import possible
from sblcosim.comparison.budget import bound as budget_bound
from sblcosim.errors import SblcosimError
from sblcosim.fmus.build import bound, compiler
from sblcosim.limits import parameters, places, recursion, run
from sblcosim.limits.path import circle_psd
from sblcosim.limits.recursion import Epochs, ReceiverModel
from sblcosim.limits.verdict import rms
from sblcosim.models.ports import BEACONS
from sblcosim.models.receiver.bound import BOUNDS
from sblcosim.scenario.scenario import load
from seams import Seam

DIVE, LBL = "realistic-dive", "harbour-lbl"


def close(mine: Any, theirs: Any, relative: float = 1e-9) -> None:
    """Covariances, each to a part of its own trace."""
    for one, other in zip(mine, theirs, strict=True):
        size = np.trace(other, axis1=-2, axis2=-1)[..., None, None]
        assert np.isfinite(one).all()
        assert (np.abs(one - other) <= relative * size).all()


def a_case(seed: int) -> tuple[ReceiverModel, Epochs, Any, Any]:
    """Anything that the recursion takes: model, packets, gaps, parameters, places."""
    draw = np.random.default_rng(seed)
    name = ("platform", "field")[seed % 2]
    count, n, divers = int(draw.integers(3, 9)), 14, int(draw.integers(1, 12))
    given = parameters.model_of(load(DIVE if name == "platform" else LBL), 0.0).parameters
    p = SimpleNamespace(**vars(given))
    for key in BOUNDS[name].parameters:
        value = getattr(p, key)
        still = not key.endswith("_time") and draw.random() < 0.2  # some errors are not there
        setattr(p, key, 0.0 if still else (value or 0.1) * float(np.exp(draw.normal())))
    situation = {
        "pings": 1.0, "speed": float(draw.normal(0, 0.01)), "known_start": bool(draw.integers(2)),
        "own_beacon": bool(draw.integers(2)) and name == "platform",
    }  # fmt: skip
    there = draw.choice([0.0, 0.25, 1.0, 2.5], (n, count + 2))
    epochs = Epochs(
        step_s=np.fmax(draw.normal(0.5, 0.7, n), 0.0), readings=there[:, 0],
        packets=there[:, 1], heard=there[:, 2:], platform=draw.normal(0, 2, (n, 3)),
        attitude=draw.normal(0, 0.3, (n, 3)), beacons=draw.normal(0, 5, (n, count, 3)),
    )  # fmt: skip
    position = draw.normal((0, 0, 12), 10, (n, divers, 3))
    return ReceiverModel(name, p, situation), epochs, position, np.exp(draw.normal(-5, 2, divers))


@pytest.mark.parametrize("seed", range(24))
def test_it_is_that_of_dense_matrices_and_automatic_derivatives(seed: int) -> None:
    model, epochs, position, q = a_case(seed)
    expected = direct_bound.covariances(model, epochs, position, q)
    close(recursion.covariances(model, epochs, position, q), expected)


@pytest.mark.parametrize("seed", [0, 1])
def test_epochs_that_are_not_kept_count_all_the_same(seed: int) -> None:
    case = a_case(seed)
    every = recursion.covariances(*case)
    for keep in ([3], [0, 7, 12], [13], [*range(14)]):
        some = recursion.covariances(*case, np.array(keep))
        for one, other in zip(some, every, strict=True):
            np.testing.assert_array_equal(one, other[keep])


def lanes_here() -> list[int]:
    """Numbers of lanes that this processor can do."""
    found = []
    for lanes in (1, 2, 4, 8):
        try:
            recursion.covariances(*a_case(0), None, lanes)
        except SblcosimError:
            break
        found.append(lanes)
    return found


@pytest.mark.parametrize("seed", [2, 3])
def test_every_number_of_lanes_gives_the_same_bits(seed: int) -> None:
    model, epochs, position, q = a_case(seed)
    position = np.repeat(position, 3, axis=1)[:, :11]
    q = np.linspace(0.001, 0.1, position.shape[1])
    expected = recursion.covariances(model, epochs, position, q, None, 1)
    assert 2 in lanes_here()
    for lanes in (0, *lanes_here()):
        found = recursion.covariances(model, epochs, position, q, None, lanes)
        np.testing.assert_array_equal(found, expected)
    alone = recursion.covariances(model, epochs, position[:, 4:5], q[4:5])
    np.testing.assert_array_equal(alone, np.array(expected)[:, :, 4:5])


@pytest.mark.slow
def test_another_compiler_gives_the_same_bits(seam: Seam) -> None:
    zig = compiler.zig()
    if zig is None or zig.identity == compiler.find().identity:
        pytest.skip("there is only one compiler")
    expected = [recursion.covariances(*a_case(seed)) for seed in range(6)]
    other = bound.library(zig)
    assert other != bound.library()
    seam.instead(recursion.library.library, lambda: other)
    seam.forgets(recursion)
    for seed in range(6):
        for lanes in lanes_here():
            found = recursion.covariances(*a_case(seed), None, lanes)
            np.testing.assert_array_equal(found, expected[seed])


SANITIZED = """
from test_bound import BEACONS, a_case, recursion
beacons = set()
for seed in range(12):
    model, epochs, position, q = a_case(seed)
    beacons.add((model.name, epochs.heard.shape[1]))
    for lanes in (1, 2):
        recursion.covariances(model, epochs, position, q, None, lanes)
assert {("platform", BEACONS.most), ("field", BEACONS.most)} <= beacons, beacons
"""


@pytest.mark.slow
def test_it_touches_no_memory_that_is_not_its_own(tmp_path: Path) -> None:
    """Under AddressSanitizer and UndefinedBehaviourSanitizer, with as many beacons as there are."""
    is_clean(SANITIZED, tmp_path)


def test_what_is_too_much_is_refused() -> None:
    model, epochs, position, q = a_case(0)
    many = BEACONS.most + 1
    more = replace(epochs, heard=np.ones((14, many)), beacons=np.zeros((14, many, 3)))
    with pytest.raises(SblcosimError, match=f"must have at most {BEACONS.most} beacons"):
        recursion.covariances(model, more, position, q)
    with pytest.raises(SblcosimError, match="a number of lanes that this processor supports"):
        recursion.covariances(model, epochs, position, q, None, 3)


# --- By hand -------------------------------------------------------------------------------------


def quiet(name: str, **numbers: float) -> ReceiverModel:
    """A model without any errors but those that are given."""
    p = dict.fromkeys(BOUNDS[name].parameters, 0.0)
    p |= {key: 1.0 for key in p if key.endswith("_time")}
    situation = {"pings": 1.0, "speed": 0.0, "own_beacon": False, "known_start": True}
    return ReceiverModel(name, SimpleNamespace(**p | numbers), situation)


def one_epoch(offset: Any, reading: float = 0.0, packet: float = 0.0, heard: float = 0.0) -> Any:
    """A diver that far from the only beacon, on a platform at the origin; at once, q = 0."""
    return Epochs(
        np.zeros(1), np.full(1, reading), np.full((1, 1), heard), np.full(1, packet),
        np.zeros(3), np.zeros(3), np.zeros((1, 3)),
    ), np.array(offset, float)[None, None], np.zeros(1)  # fmt: skip


def posterior(variance: float, noise: float) -> float:
    return 1 / (1 / variance + 1 / noise)


def sounding(std: float) -> float:
    """The least variance of a range or of a depth is that of 1 mm."""
    return max(std, 1e-3) ** 2


AFLOAT = {"prior_position_std": 2.0, "heave_std": 1.5, "gps_vertical_std": 0.7,
          "gps_vertical_error_std": 0.4}  # fmt: skip
REPORT = 0.7**2 + 0.4**2
"""Variance of a reported depth of the platform: white and slow error."""


def test_a_vertical_gps_error_is_in_what_is_relative_alone() -> None:
    """The depth of the platform is known from its heave and from what it reports."""
    model = quiet("platform", **AFLOAT, depth_std=0.5, gps_bias_std=0.3)
    depth = posterior(4.0, 0.25)
    for packet, platform in ((0.0, 1.5**2), (1.0, posterior(1.5**2, REPORT))):
        (absolute,), (relative,) = (
            P[:, 0] for P in recursion.covariances(
                model, *one_epoch([3, 4, 5], reading=1.0, packet=packet)
            )
        )
        np.testing.assert_allclose(np.diag(absolute), [4.09, 4.09, depth], rtol=1e-12)
        assert relative[2, 2] == pytest.approx(depth + platform, rel=1e-12)


def test_a_range_from_below_has_the_vertical_gps_noise_and_one_from_the_side_has_not() -> None:
    """Below, x_z + g_z is measured with σ_r² + σ_gv²."""
    model = quiet("platform", **AFLOAT, range_std=0.1)
    below, aside = (
        [P[0, 0] for P in recursion.covariances(model, *one_epoch(at, packet=1.0, heard=1.0))]
        for at in ([0, 0, 9], [9, 0, 0])
    )
    prior = np.diag([4.0, 0.16, 2.25])  # x_z, g_z, h
    H, R = np.array([[0, 1, 1], [1, 1, 0]]), np.diag([0.49, 0.01 + 0.49])
    P = prior - prior @ H.T @ np.linalg.solve(H @ prior @ H.T + R, H @ prior)
    assert below[0][2, 2] == pytest.approx(P[0, 0], rel=1e-12)
    difference = np.array([1, 0, -1])
    assert below[1][2, 2] == pytest.approx(difference @ P @ difference, rel=1e-12)
    # North of the platform, whose place is known to 1 cm
    assert aside[1][0, 0] == pytest.approx(posterior(4 + posterior(900, 1e-4), 0.01), rel=1e-4)
    assert aside[1][2, 2] == pytest.approx(4.0 + posterior(2.25, REPORT), rel=1e-12)


@pytest.mark.parametrize("lever", [0.0, 2.0])
def test_tilt_moves_a_beacon_that_says_where_it_is_and_no_more(lever: float) -> None:
    """It is in the report of the beacon's place, and a range has the same of it."""
    p = {"prior_position_std": 2.0, "range_std": 0.1, "gps_std": 0.3, "tilt_std": 0.2}
    model = quiet("platform", **p)
    model = replace(model, situation={**model.situation, "own_beacon": True})
    epochs, position, q = one_epoch([9, 0, lever], heard=1.0)
    epochs = replace(epochs, beacons=np.array([[[0.0, 0.0, lever]]]))
    (absolute,), (relative,) = (P[:, 0] for P in recursion.covariances(model, epochs, position, q))
    prior = np.diag([4.0, 900.0, 0.04])  # x, p, t
    H, R = np.array([[0, 1, lever], [1, -1, -lever]]), np.diag([0.09, 0.01])
    P = prior - prior @ H.T @ np.linalg.solve(H @ prior @ H.T + R, H @ prior)
    assert absolute[0, 0] == pytest.approx(P[0, 0], rel=1e-9)
    assert relative[0, 0] == pytest.approx(P[0, 0] - 2 * P[0, 1] + P[1, 1], rel=1e-9)


@pytest.mark.parametrize(
    ("direction", "axis", "slow", "white"),
    [((1, 0, 0), 0, 0.3, 0.2), ((0, -1, 0), 1, 0.3, 0.2), ((0, 0, 1), 2, 0.8, 0.6)],
)
def test_beacons_of_their_own_have_one_noise_along_the_water_and_another_upwards(
    direction: Any, axis: int, slow: float, white: float
) -> None:
    model = quiet("field", prior_position_std=2.0, range_std=0.1, beacon_error_std=0.3,
                  beacon_vertical_error_std=0.8, beacon_noise_std=0.2,
                  beacon_vertical_noise_std=0.6)  # fmt: skip
    epochs, position, q = one_epoch(np.array(direction) * 50.0, heard=1.0)
    (absolute,), _ = (P[:, 0] for P in recursion.covariances(model, epochs, position, q))
    expected = np.full(3, 4.0)
    expected[axis] = posterior(4.0, 0.01 + slow**2 + white**2)
    np.testing.assert_allclose(np.diag(absolute), expected, rtol=1e-12)


@pytest.mark.parametrize("there", [0.25, 1.0, 3.0])
def test_a_part_of_a_packet_is_that_part_of_its_information(there: float) -> None:
    model = quiet("field", prior_position_std=2.0, range_std=0.5)
    epochs, position, q = one_epoch([50, 0, 0], heard=there)
    (absolute,), _ = (P[:, 0] for P in recursion.covariances(model, epochs, position, q))
    assert absolute[0, 0] == pytest.approx(posterior(4.0, sounding(0.5) / there), rel=1e-12)


@pytest.mark.parametrize("count", [3, 4, 8])
def test_slots_by_hand(count: int) -> None:
    """10 s, a packet in four is lost, T = 2 s: four slots, as the end is not sampled."""
    changes = {"time.duration_s": 10.0, "time.sampling_time_s": 2.0, "platform.beacons": count,
               "acoustics.loss_probability": 0.25}  # fmt: skip
    given = load("paper-scenario-1", changes)
    model = parameters.model_of(given, 0.0)
    turns = places.epochs_of(given, model, 10.0)
    assert turns.step_s.tolist() == [2.0] * 4
    order = np.array(given.acoustics.slot_order) - 1
    np.testing.assert_array_equal(turns.heard, 0.75 * np.eye(count)[order[np.arange(4) % count]])
    assert turns.packets.tolist() == [0.75] * 4
    assert turns.readings.tolist() == [1.0] * 4
    at_once = load("paper-scenario-1", changes | {"acoustics.schedule": "simultaneous"})
    together = places.epochs_of(at_once, model, 10.0)
    assert (together.heard == 0.75).all()
    assert together.heard.shape == (4, count)
    np.testing.assert_allclose(together.packets, 1 - 0.25**count)  # lost if all are


def test_slots_that_count_together_lose_nothing(seam: Seam) -> None:
    given = load("paper-scenario-1", {"time.duration_s": 100.0, "time.sampling_time_s": 0.5})
    one_by_one = places.epochs_of(given, parameters.model_of(given, 0.0), 100.0)
    kept = np.array([60, 61, 198])
    every = places.groups_of(199, kept, 0.5)
    np.testing.assert_array_equal(every, np.arange(200))
    np.testing.assert_array_equal(places.combined(one_by_one, every).step_s, one_by_one.step_s)
    seam.tuned(most_steps=50)
    groups = places.groups_of(199, kept, 0.5)
    few = places.combined(one_by_one, groups)
    sizes = np.diff(groups)
    assert few.readings.tolist() == sizes.tolist()
    assert sizes.sum() == 199
    assert len(sizes) < 110
    assert sizes[np.searchsorted(groups, kept)].tolist() == [1, 1, 1]
    np.testing.assert_allclose(few.heard.sum(0), one_by_one.heard.sum(0))
    assert few.packets.sum() == pytest.approx(one_by_one.packets.sum())
    begins, ends = groups[:-1] * 0.5 + 0.5, groups[1:] * 0.5
    np.testing.assert_allclose(np.cumsum(few.step_s), (begins + ends) / 2)


@pytest.mark.parametrize("count", [3, 5, 8])
def test_rounded_beacons_tell_a_place_with_the_mean_of_their_roundings(count: int) -> None:
    """Packets with the places of N beacons, each rounded by itself, by simulation."""
    step, gps = 0.5, 0.2
    given = load(DIVE, {
        "platform.beacons": count, "platform.gps_horizontal_std_m": gps,
        "acoustics.packet_content": "all_beacons", "acoustics.packet_resolution_m": step,
    })  # fmt: skip
    draw = np.random.default_rng(count)
    true = draw.normal(0, 20, (20_000, count, 1)) * np.ones(2)
    rounded = np.round((true + draw.uniform(0, step, true.shape)) / step) * step
    error = (rounded - true).mean(axis=1)
    p = parameters.model_of(given, 0.0).parameters
    assert sqrt(p.gps_std**2 - gps**2) == pytest.approx(step / sqrt(12 * count), rel=1e-9)
    assert sqrt(p.gps_std**2 - gps**2) == pytest.approx(error.std() / sqrt(2), rel=0.02)


# --- Of maps and budgets -------------------------------------------------------------------------

CIRCLE = motion.Circle(3.0, 0.3)
SPAN = (10.0, 30.0)


def circling(name: str, changes: Any) -> Any:
    return motion.circling(sblcosim.load(name, changes), CIRCLE, 5.0, SPAN[1])


def slots_of(scenario: Any, centre: Any, until_s: float) -> tuple[Epochs, Any]:
    """Slots and places of a diver, one after another as the scenario says."""
    a, count = scenario.acoustics, scenario.beacons
    rows = []
    for slot in range(round(until_s / a.sampling_time_s) - 1):
        received = 1.0 - a.loss_probability
        heard = np.zeros(count)
        if a.schedule == "simultaneous":
            heard[:] = received
            packet = 1.0 - np.prod(1.0 - heard)
        else:
            heard[a.slot_order[slot % count] - 1] = packet = received
        rows.append((heard, packet))
    heard, packets = map(np.array, zip(*rows, strict=True))
    time = a.sampling_time_s * np.arange(1, len(rows) + 1)
    angle = CIRCLE.speed * time / CIRCLE.radius
    circle = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    model = parameters.model_of(scenario, 0.0)
    heading = np.deg2rad(scenario.platform.mean_heading_deg)
    body = np.reshape(parameters.parameters(scenario).beacon_offset, (-1, 3))
    turn = np.array([[np.cos(heading), -np.sin(heading), 0], [np.sin(heading), np.cos(heading), 0],
                     [0, 0, 1]])
    middle = np.array(scenario.platform.mean_position_m, float)
    beacons = body @ turn.T + middle if model.own_errors else body
    ones = np.ones(len(rows))
    epochs = Epochs(ones * a.sampling_time_s, ones, heard, packets, middle,
                    np.array([0.0, 0.0, heading]), beacons)
    return epochs, centre + CIRCLE.radius * circle


@pytest.mark.parametrize("error", [f"{frame}_{what}" for frame in ("absolute", "relative")
                                   for what in ("horizontal", "total")])
@pytest.mark.parametrize(
    ("name", "changes"),
    [
        (DIVE, {"target.depth_std_m": 20.0}),
        (DIVE, {"target.depth_std_m": 20.0, "acoustics.schedule": "simultaneous",
                "platform.beacons": 6, "acoustics.loss_probability": 0.4}),
        (LBL, {"target.depth_std_m": 20.0}),
        (LBL, {"target.depth_std_m": 20.0, "acoustics.schedule": "simultaneous",
               "acoustics.loss_probability": 0.6}),
    ],
)  # fmt: skip
def test_what_is_possible_in_a_cell_by_drawn_errors(
    name: str, changes: dict[str, Any], error: str
) -> None:
    """From slots told one by one, a direct recursion, and errors drawn from its covariances; the
    depth is known so badly that what is horizontal is another length."""
    moving = circling(name, changes)
    grid = grid_of("40x60", 5.0, (2, 3), [4.0, -3.0])
    found = possible(moving, grid, CIRCLE, error, SPAN)
    q = circle_psd(CIRCLE.speed, CIRCLE.radius, places.noise_densities(moving, grid.centres), 30.0)
    model = parameters.model_of(moving, 0.0)
    draw = np.random.default_rng(4)
    for cell in (0, 4):
        epochs, position = slots_of(moving, grid.centres[cell], SPAN[1])
        frames = direct_bound.covariances(model, epochs, position[:, None], q[cell : cell + 1])
        P = frames[0 if error.startswith("absolute") else 1][:, 0]
        late = P[np.cumsum(epochs.step_s) >= SPAN[0] - 1e-9]
        roots = np.linalg.cholesky(late)
        errors = np.einsum("nij,nmj->nmi", roots, draw.normal(size=(len(late), 20_000, 3)))
        axes = 2 if error.endswith("horizontal") else 3
        expected = np.quantile(np.linalg.norm(errors[..., :axes], axis=-1), 0.95)
        assert found.percentile[cell] == pytest.approx(expected, rel=0.012)
        other = np.quantile(np.linalg.norm(errors[..., : 5 - axes], axis=-1), 0.95)
        assert abs(expected / other - 1) > 0.03  # or nothing would notice


def test_a_map_does_not_depend_on_threads() -> None:
    moving = circling(DIVE, {})
    grid = grid_of("60x60", 5.0, (15, 20), [0.0, 0.0])  # more cells than a thread takes at once
    path, q = partial(CIRCLE.position, grid.centres), np.linspace(0.001, 0.02, grid.count)
    one, many = (places.covariances(moving, path, q, SPAN, workers) for workers in (1, 5))
    np.testing.assert_array_equal(one.absolute, many.absolute)
    np.testing.assert_array_equal(one.relative, many.relative)


def direct_rms(result: Any, q: float, receiver: str) -> tuple[float, float]:
    """What is possible at a receiver's epochs, from the packets that the record tells of."""
    record, given = result.record, result.scenario
    epochs_ns = record.estimates(receiver).epoch_ns
    events: dict[int, list[float]] = {int(t): [0.0] * (1 + given.beacons) for t in epochs_ns}
    count = record.values["acoustics.reception_count"]
    for i in range(1, len(record)):
        for beacon in np.flatnonzero(count[i] > count[i - 1]):
            epoch = round(record.values["acoustics.range_epoch"][i, beacon] * 1e9)
            events.setdefault(epoch, [0.0] * (1 + given.beacons))[1 + beacon] = 1.0
        depth = [round(t * 1e9) for t in record.values["target.depth_epoch"][i - 1 : i + 1].ravel()]
        if depth[1] > depth[0]:
            events.setdefault(depth[1], [0.0] * (1 + given.beacons))[0] = 1.0
    times = np.array(sorted(events))
    there = np.array([events[t] for t in times.tolist()])
    model = parameters.model_of(given, q)
    position, along = run.epochs_along(record, model, times, there[:, 1:], there[:, 0])
    frames = direct_bound.covariances(model, along, position[:, None], np.array([q]))
    at = np.searchsorted(times, epochs_ns)
    return rms(frames[0][at, 0]), rms(frames[1][at, 0])


@pytest.mark.parametrize("name", [DIVE, "gps-buoys"])
def test_the_bound_without_packet_loss_is_that_of_a_run_without(name: str) -> None:
    """A budget's switch that changes what is received is looked at along a run of its own."""
    lossless = {"acoustics.loss_probability": 0.0}
    base = load(name, {"time.duration_s": 40.0, "acoustics.loss_probability": 0.5})
    switches = {"all": {}, "loss": lossless, "noise": {"acoustics.range_std_m": 0.01}}
    q = 0.004
    found = budget_bound.bounds(base, switches, 3, q)
    assert found is not None
    for switch, changes in switches.items():
        receptions = {"acoustics.loss_probability": base.acoustics.loss_probability} | changes
        squares = []
        for seed in range(3, 3 + budget_bound.BOUND_RUNS):
            result = sblcosim.run(name, "multilateration",
                                  {"time.duration_s": 40.0, "seed": seed} | receptions)
            squares.append(np.square(direct_rms(result, q, "multilateration")))
        for frame, mean in zip(("absolute", "own_relative"), np.mean(squares, 0), strict=True):
            assert found.squares[frame][switch] == pytest.approx(mean, rel=1e-8)
    assert found.squares["absolute"]["loss"] < 0.95 * found.squares["absolute"]["all"]
