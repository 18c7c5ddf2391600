"""What is possible: each formula computed in a second way, and against published numbers."""

from __future__ import annotations

from dataclasses import replace
from math import erfc, exp, isfinite, pi, sqrt
from types import SimpleNamespace
from typing import Any

import direct_bound
import numpy as np
import pytest
import sblcosim
from sblcosim import limits
from sblcosim.data.record import Record
from sblcosim.judge import possible
from sblcosim.limits import parameters, recursion, unknown, verdict
from sblcosim.models import COMPONENTS
from sblcosim.models.receiver.receivers.array import COMPONENT as ARRAY
from sblcosim.models.receiver.receivers.coupled import COMPONENT as COUPLED
from sblcosim.models.receiver.receivers.long_baseline import COMPONENT as LONG_BASELINE
from sblcosim.models.receiver.waves import STATES
from sblcosim.scenario.arrangement import has_own_errors
from sblcosim.scenario.error_sources import UNMODELLED
from sblcosim.scenario.scenario import load
from sblcosim.scenario.schema import rows

NS = 10**9
DEPTH = 5.0


def a_record(n: int = 30, step_s: float = 1.0, heard: bool = True) -> Record:
    """A diver on an arc, a platform that swings; a packet and a depth at each instant but 0.

    Beacons speak in turn, about the platform 0.5 m deep; every fifth packet is lost.
    """
    k = np.arange(n)
    t = k * step_s
    position = np.column_stack([15 * np.cos(t / 30), 15 * np.sin(t / 30), DEPTH + 0 * t])
    velocity = np.column_stack([-0.5 * np.sin(t / 30), 0.5 * np.cos(t / 30), 0 * t])
    epoch, count = np.zeros((n, 4)), np.zeros((n, 4), int)
    for i in range(1, n):
        epoch[i], count[i] = epoch[i - 1], count[i - 1]
        if heard and i % 5:
            epoch[i, (i - 1) % 4], count[i, (i - 1) % 4] = t[i], count[i, (i - 1) % 4] + 1
    return Record(
        (t * NS).astype(np.int64),
        {
            "target.position": position,
            "target.velocity": velocity,
            "target.depth_epoch": t if heard else 0 * t,
            "platform.position": np.column_stack([np.sin(t / 9), np.cos(t / 7), 0.1 * np.sin(t)]),
            "platform.attitude": 0.1 * np.sin(np.outer(t, [1.9, 1.6, 0.3])),
            "acoustics.range_epoch": epoch,
            "acoustics.reception_count": count,
        },
    )


def stacked(
    model: recursion.ReceiverModel, epochs: recursion.Epochs, position: Any, q: float
) -> Any:
    """Covariances of the last epoch from all equations at once, without a recursion.

    Unknowns are the initial state and the noise of every interval, whitened; the state of epoch k
    is a linear function of them, and each measurement one equation.
    """
    n = len(position)
    size = STATES * (n + 1)
    information = np.eye(size)
    state = np.zeros((STATES, size))
    p = SimpleNamespace(**vars(model.parameters) | {"acceleration_psd": q})
    state[:, :STATES] = root(direct_bound.prior(model, p))
    for k in range(n):
        Phi, Q = direct_bound.transition(model, p, epochs.step_s[k])
        state = Phi @ state
        state[:, STATES * (k + 1) : STATES * (k + 2)] += root(Q)
        H, R, there = direct_bound.measured(
            model, p, position[k], epochs.platform[k], epochs.attitude[k], epochs.beacons,
            (epochs.readings[k], epochs.packets[k], epochs.heard[k]),
        )
        H = H @ state
        information += (H.T * (there / R)) @ H
    return direct_bound.marginals(model, p, state @ np.linalg.solve(information, state.T))


def root(P: Any) -> Any:
    values, vectors = np.linalg.eigh(P)
    return vectors * np.sqrt(np.fmax(values, 0))


@pytest.mark.parametrize("scenario", ["realistic-dive", "paper-scenario-1"])
def test_the_recursion_agrees_with_all_epochs_at_once(scenario: str) -> None:
    settled = load(scenario)
    record = a_record(13)
    bound = limits.reference(record, settled, acceleration_psd=0.002)
    epoch, heard, depth = limits.run.events_of(record, None)
    model = parameters.model_of(settled, 0.002)
    position, epochs = limits.run.epochs_along(record, model, epoch, heard, depth)
    absolute, relative = stacked(model, epochs, position, 0.002)
    for mine, theirs in ((bound.absolute[-1], absolute), (bound.relative[-1], relative)):
        np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-9 * absolute[0, 0])


@pytest.mark.parametrize(
    ("std", "probability", "mean", "expected"), [(0.1, 0.05, 1.0, 0.915), (0.1, 0.1, 3.0, 0.869)]
)
def test_the_fisher_factor_of_known_cases(
    std: float, probability: float, mean: float, expected: float
) -> None:
    assert limits.fisher_factor(std, probability, mean) == pytest.approx(expected, abs=5e-4)


@pytest.mark.parametrize("distribution", ["exponential", "half_normal"])
@pytest.mark.parametrize(("probability", "mean"), [(0.05, 1.0), (0.3, 0.15)])
def test_the_fisher_factor_by_monte_carlo(
    distribution: str, probability: float, mean: float
) -> None:
    """The score's mean square over drawn errors; its derivative is by differences of log f."""
    std, n = 0.1, 400_000
    rng = np.random.default_rng(1)
    excess = (rng.exponential(mean, n) if distribution == "exponential"
              else mean * sqrt(pi / 2) * np.abs(rng.normal(size=n)))
    late = rng.random(n) < probability
    error = std * rng.normal(size=n) + np.where(late, excess, 0)
    grid = np.linspace(-8 * std, 8 * std + 20 * mean, 40_001)
    f = np.array([density(e, std, probability, mean, distribution) for e in grid])
    score = np.gradient(np.log(np.fmax(f, 1e-300)), grid)
    by_draws = std**2 * np.mean(np.interp(error, grid, score) ** 2)
    factor = limits.fisher_factor(std, probability, mean, distribution)
    assert factor == pytest.approx(by_draws, abs=0.008)
    assert f.sum() * (grid[1] - grid[0]) == pytest.approx(1, abs=1e-3)


def density(e: float, std: float, probability: float, mean: float, distribution: str) -> float:
    """The contaminated density, written with erfc or integrated over the excess."""
    normal = exp(-(e**2) / 2 / std**2) / std / sqrt(2 * pi)
    if distribution == "exponential":
        late = (exp(min(std**2 / 2 / mean**2 - e / mean, 700))
                * erfc((std / mean - e / std) / sqrt(2)) / 2 / mean)
    else:
        scale = mean * sqrt(pi / 2)
        w = sqrt(std**2 + scale**2)
        late = exp(-(e**2) / 2 / w**2) / w / sqrt(2 * pi) * erfc(-scale * e / std / w / sqrt(2))
    return (1 - probability) * normal + probability * late


def test_the_fisher_factor_at_its_ends() -> None:
    assert limits.fisher_factor(0.1, 0.0, 1.0) == 1.0
    assert limits.fisher_factor(0.1, 0.05, 0.0) == 1.0
    assert limits.fisher_factor(0.0, 0.05, 1.0) == 0.95
    for distribution in ("exponential", "half_normal"):
        assert limits.fisher_factor(0.1, 0.05, 2e-4, distribution) == pytest.approx(1, abs=1e-4)
        assert limits.fisher_factor(1e-6, 0.05, 0.9, distribution) == pytest.approx(0.95, abs=1e-3)


@pytest.mark.parametrize(("arm", "clock"), [(3.0, 37.0), (0.4, 334.0)])
def test_the_dilution_of_an_unknown_clock(arm: float, clock: float) -> None:
    """Beside the closed form: at 15 m the radial one grows from 0.52 to these."""
    beacons = limits.cross(arm)
    x = [15.0, 0.0, DEPTH]
    assert limits.hdop(x, beacons).radial == pytest.approx(0.52, abs=0.01)
    assert limits.hdop(x, beacons, unknown_clock=True).radial == pytest.approx(clock, rel=0.01)


@pytest.mark.parametrize("clock", [False, True])
def test_the_dilution_is_the_inverse_of_the_normal_matrix(clock: bool) -> None:
    rng = np.random.default_rng(3)
    for count in (3, 4, 7):
        beacons = np.column_stack([rng.normal(0, 3, (count, 2)), rng.normal(0.5, 0.2, count)])
        x = rng.normal(0, 8, (5, 6, 3)) + np.array([0, 0, 6])
        result = limits.hdop(x, beacons, unknown_clock=clock)
        assert result.horizontal.shape == (5, 6)
        for at in np.ndindex(5, 6):
            o = x[at] - beacons
            H = (o / np.linalg.norm(o, axis=1)[:, None])[:, :2]
            if clock:
                H = np.column_stack([H, np.ones(count)])
            C = np.linalg.inv(H.T @ H)[:2, :2]
            e = x[at][:2] - beacons[:, :2].mean(0)
            e = e / np.linalg.norm(e)
            assert result.horizontal[at] == pytest.approx(sqrt(np.trace(C)), rel=1e-6)
            assert result.radial[at] == pytest.approx(sqrt(e @ C @ e), rel=1e-6)
            t = np.array([-e[1], e[0]])
            assert result.cross[at] == pytest.approx(sqrt(t @ C @ t), rel=1e-6)


@pytest.mark.parametrize("depth", [0.0, 4.5])
@pytest.mark.parametrize(("reach", "each", "mean"), [(5.0, 0.02, 0.012), (20.0, 0.0013, 0.001)])
@pytest.mark.parametrize("arm", [0.4, 3.0])
def test_the_closed_form_is_the_dilution_of_precision(
    arm: float, reach: float, each: float, mean: float, depth: float
) -> None:
    """At so many arms, within `each` in every direction and within `mean` over all of them."""
    numeric, formula = round_about(arm, reach, depth)
    for one, other in (
        (numeric.cross, formula.fix_cross), (numeric.radial, formula.fix_radial),
        (numeric.horizontal, np.hypot(formula.fix_cross, formula.fix_radial)),
    ):
        if depth == 0.0 or arm > 1:  # there, the diver may also be steeply below
            np.testing.assert_allclose(one, other, rtol=each)
        assert sqrt(np.mean(one**2)) == pytest.approx(sqrt(np.mean(other**2)), rel=max(mean, 0.004))


def round_about(arm: float, reach: float, depth: float) -> tuple[Any, Any]:
    angles = np.linspace(0, 2 * pi, 48, endpoint=False)
    offset = np.column_stack([np.cos(angles), np.sin(angles), 0 * angles]) * reach * arm
    offset[:, 2] = depth
    centre = np.array([0, 0, 0.5])
    numeric = limits.hdop(offset + centre, limits.cross(arm))
    return numeric, limits.closed_form(offset, limits.Conditions(1.0, 0.1, 2 * arm**2))


def test_among_the_beacons_the_closed_form_is_coarse() -> None:
    """12 % in the HDOP where the diver is as far away as the beacons are."""
    numeric, formula = round_about(3.0, 1.0, 4.5)
    whole = np.hypot(formula.fix_cross, formula.fix_radial)
    np.testing.assert_allclose(numeric.horizontal, whole, rtol=0.12)
    assert (numeric.horizontal > 1.07 * whole).all()


def test_the_dilution_at_15_m() -> None:
    """27.7 and 3.7 times the range's error across, for arms of 0.4 and 3 m."""
    for arm, expected in ((0.4, 27.7), (3.0, 3.69)):
        c = limits.closed_form([15.0, 0.0, DEPTH - 0.5], limits.Conditions(1.0, 0.1, 2 * arm**2))
        assert c.fix_cross == pytest.approx(expected, rel=0.005)
        numeric = limits.hdop([15.0, 0.0, DEPTH], limits.cross(arm))
        assert numeric.cross == pytest.approx(expected, rel=0.02)


def test_the_dilution_below_the_platform_is_the_distance_over_the_arm() -> None:
    """However steep: G is 2 (a/r)² times the identity."""
    for depth in np.logspace(-3, 8, 12):
        found = limits.hdop([0.0, 0.0, 0.5 + depth], limits.cross(3.0))
        over = np.hypot(depth, 3.0) / 3.0
        each = np.sqrt(0.5) * over
        np.testing.assert_allclose(
            [found.horizontal, found.radial, found.cross], [over, each, each], rtol=1e-6
        )


def test_no_fix_is_an_infinite_dilution() -> None:
    for beacons in ([[3, 0, 0.5], [-3, 0, 0.5]], [[0.0, 0, 0.5]], np.tile([1.0, 2, 0.5], (4, 1))):
        result = limits.hdop([15.0, 0.0, 5.0], beacons)
        assert np.isinf([result.horizontal, result.radial, result.cross]).all()
    above = limits.hdop([0.0, 0.0, 5.0], limits.cross(3.0))
    assert np.isfinite([above.horizontal, above.radial, above.cross]).all()
    assert np.isinf(limits.hdop([0.0, 0.0, 0.5], np.tile([0, 0, 0.5], (4, 1))).horizontal)
    # known distances to two beacons off the line between them: a fix, up to its mirror image
    assert isfinite(limits.hdop([15.0, 1.0, 5.0], [[3, 0, 0.5], [0, 3, 0.5]]).horizontal)


def test_the_steady_state_is_that_of_a_long_recursion() -> None:
    """A double integrator that is observed often: sqrt 2 q^1/4 (R T)^3/4."""
    q, R, T = 0.002, 0.3, 0.05
    Phi, Q = np.array([[1, T], [0, 1]]), q * np.array([[T**3 / 3, T**2 / 2], [T**2 / 2, T]])
    P = np.eye(2)
    for _ in range(4000):
        P = Phi @ P @ Phi.T + Q
        before = P[0, 0]
        P = P - np.outer(P[:, 0], P[0]) / (P[0, 0] + R)
    formula = limits.steady.steady_variance(q, np.array(R * T))
    assert (P[0, 0] + before) / 2 == pytest.approx(float(formula), rel=0.005)


@pytest.mark.parametrize(("together", "slots"), [(1, 5), (5, 1), (2, 2.5)])
def test_the_closed_form_by_hand(together: int, slots: float) -> None:
    """Five beacons; the formulas as they are published, each term in its own line."""
    b, std, depth_std, T, loss, q = 2.0, 0.3, 0.2, 0.5, 0.2, 0.004
    found = limits.closed_form([6.0, -8.0, 5.0], limits.Conditions(
        std, depth_std, 5 * b**2 / 2, beacons=5, slot=T, loss=loss, acceleration_psd=q,
        common_std=0.7, heading_std=0.03, heading_noise_std=0.06, together=together,
    ))  # fmt: skip
    reach, distance = 10.0, sqrt(125.0)
    between = slots * T / 0.8
    fix_cross = std * distance / (b * sqrt(2.5))
    fix_radial = std * distance / (sqrt(5) * reach)
    across = fix_cross**2 * between + (reach * 0.06) ** 2 * T / 0.8
    variances = [
        sqrt(2) * q**0.25 * density**0.75
        for density in (across, fix_radial**2 * between, depth_std**2 * T)
    ]
    turned = (reach * 0.03) ** 2
    by_hand = limits.ClosedForm(
        cross=sqrt(variances[0] + turned), radial=sqrt(variances[1]), depth=sqrt(variances[2]),
        relative=sqrt(sum(variances) + turned),
        absolute=sqrt(sum(variances) + turned + 2 * 0.7**2),
        fix_cross=fix_cross, fix_radial=fix_radial,
    )  # fmt: skip
    for name, value in vars(by_hand).items():
        assert getattr(found, name) == pytest.approx(value, rel=1e-12), name


def test_the_closed_form_over_a_grid_and_at_its_ends() -> None:
    c = limits.Conditions(0.1, 0.01, 18.0, slot=1.0, loss=0.25, common_std=1.2, heading_std=0.05)
    north, east = np.meshgrid(np.linspace(-20, 20, 5), np.linspace(-20, 20, 7))
    grid = limits.closed_form(np.stack([north, east, 0 * north + 4.5], axis=-1), c)
    assert grid.absolute.shape == (7, 5)
    one = limits.closed_form([20.0, 20.0, 4.5], c)
    assert grid.absolute[-1, -1] == pytest.approx(float(one.absolute), rel=1e-12)
    assert one.absolute**2 == pytest.approx(one.relative**2 + 2 * 1.44)
    assert c.round == pytest.approx(4 / 0.75)
    for odd in (
        limits.Conditions(0.0, 0.0, 18.0), limits.Conditions(0.1, 0.1, 18.0, loss=1.0),
        limits.Conditions(0.1, 0.1, 0.0), limits.Conditions(0.1, 0.1, 18.0, acceleration_psd=0.0),
    ):
        for at in ([0.0, 0.0, 0.0], [0.0, 0.0, 4.0], [10.0, 0.0, 0.0]):
            result = limits.closed_form(at, odd)
            assert not any(np.isnan(v).any() for v in vars(result).values())


def test_the_path_of_a_random_motion_has_its_own_density() -> None:
    rng = np.random.default_rng(5)
    q, step = 0.004, 0.1
    t = np.arange(200_000) * step
    v = np.cumsum(rng.normal(0, sqrt(q * step), (len(t), 3)), axis=0)
    assert limits.path_psd(t, v, 0.5) == pytest.approx(q, rel=0.1)


def test_the_path_of_a_circle_has_a_fixed_point() -> None:
    """|dv| = 2 v sin(w tau/2) at the lag tau = (R T/q)^1/4."""
    t, v, radius, density = np.arange(0, 300, 0.1), 0.5, 15.0, 0.73
    w = v / radius
    velocity = v * np.column_stack([-np.sin(w * t), np.cos(w * t), 0 * t])
    q = limits.path_psd(t, velocity, density)
    tau = (density / q) ** 0.25
    assert q == pytest.approx((2 * v * np.sin(w * tau / 2)) ** 2 / 2 / tau, rel=1e-3)


def test_a_straight_path_needs_none() -> None:
    t = np.arange(0, 100, 0.5)
    assert limits.path_psd(t, np.tile([0.5, 0, 0], (len(t), 1)), 0.7) == 0.0
    assert limits.path_psd(t[:2], np.zeros((2, 3)), 0.7) == 0.0
    assert limits.path_psd(t, np.zeros((len(t), 3)), 0.0) == 0.0


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"acoustics.range_std_m": 0.0, "target.depth_std_m": 0.0},
        {"acoustics.loss_probability": 1.0},
        {"platform.gps_horizontal_markov_std_m": 0.0, "platform.gps_horizontal_std_m": 0.0},
        {"platform.arm_length_m": 0.001},
        {"acoustics.clock_offset_s": 0.0, "acoustics.sound_speed_m_s": 1500.0},
    ],
)
@pytest.mark.parametrize("heard", [True, False])
def test_odd_inputs_give_numbers(changes: dict[str, Any], heard: bool) -> None:
    scenario = load("realistic-dive", changes)
    record = a_record(20, heard=heard)
    bound = limits.reference(record, scenario, at_ns=record.time_ns)
    assert len(bound.epoch_ns) == 20
    for P in (bound.absolute, bound.relative):
        assert np.isfinite(P).all()
        assert (np.linalg.eigvalsh(P) > -1e-9).all()
    assert np.isfinite(bound.bearing_std).all()
    assert bound.verdict() is not None


def test_two_beacons_alone_give_numbers() -> None:
    record = a_record(20)
    record.values["acoustics.reception_count"][:, 2:] = 0  # type: ignore[index]
    bound = limits.reference(record, load("realistic-dive"))
    every = limits.reference(a_record(20), load("realistic-dive"))
    assert np.isfinite(bound.absolute).all()
    found, all_of_them = bound.verdict(), every.verdict()
    assert found is not None
    assert all_of_them is not None
    assert found.absolute_rms > all_of_them.absolute_rms


def test_numbers_that_overflow_are_no_verdict() -> None:
    many, too_many = ({"platform.gps_horizontal_std_m": std} for std in (1e100, 1e200))
    found = limits.reference(a_record(20), load("realistic-dive", many)).verdict()
    assert found is not None
    assert isfinite(found.absolute_rms)
    assert limits.reference(a_record(20), load("realistic-dive", too_many)).verdict() is None


def test_without_any_epoch_there_is_no_verdict() -> None:
    bound = limits.reference(a_record(20, heard=False), load("realistic-dive"))
    assert len(bound.epoch_ns) == 0
    assert bound.verdict() is None
    assert limits.reference(a_record(20), load("realistic-dive")).verdict(np.zeros(0, int)) is None


def test_a_packet_of_its_own_beacon_says_less() -> None:
    scenario, record = load("realistic-dive"), a_record(60)
    full, own = (limits.reference(record, scenario, own_beacon=o) for o in (False, True))
    less, more = own.verdict(), full.verdict()
    assert less is not None
    assert more is not None
    assert 1.0 < less.absolute_rms / more.absolute_rms < 2.0


def test_only_a_motion_of_the_model_has_a_bound() -> None:
    record = a_record(20)
    drawn = load({"target": {"trajectory": "white_noise_acceleration",
                             "acceleration_psd_m2_s3": 0.005}, "time": {"duration_s": 20.0}})
    bound = limits.reference(record, drawn)
    assert (bound.kind, bound.acceleration_psd) == ("bound", 0.005)
    assert limits.reference(record, drawn, acceleration_psd=0.01).kind == "reference"
    assert limits.reference(record, load("realistic-dive")).kind == "reference"


def test_a_smaller_density_promises_more() -> None:
    scenario, record = load("realistic-dive"), a_record(60)
    rms = []
    for q in (0.0, 0.001, 0.01, 0.1):
        found = limits.reference(record, scenario, acceleration_psd=q).verdict()
        assert found is not None
        rms.append(found.relative_rms)
    assert rms == sorted(rms)


def ring(bearing: float, radial: float, reach: float = 15.0) -> bool:
    """Whether an arc with these standard deviations [rad], [m] is a ring, north of the platform."""
    P = np.diag([radial**2, (reach * bearing) ** 2, 0.01])[None]
    offset = np.array([[reach, 0.0, 4.5]])
    made = verdict.limits_of(np.zeros(1, np.int64), P, P, offset, 0.01, False)
    assert made.bearing_std[0] == pytest.approx(min(bearing, pi), rel=1e-9)
    return bool(made.ring[0])


def test_a_ring_is_wide_and_thin() -> None:
    assert not ring(0.27, 0.5)
    assert ring(0.45, 0.5)
    assert not ring(0.45, 5.0)  # as thick as it is wide: a place, if a vague one
    assert not ring(1.0, 0.5, reach=0.3)  # beside the platform


def test_what_a_verdict_says() -> None:
    some = verdict.Possible("bound", 2.126, 1.31, 0.1, True, 0.001)
    assert str(some) == "possible: 2.13 m RMS (bound)"
    assert some.to_json()["absolute_rms_m"] == 2.126
    assert some.to_json()["without"] == []
    less = replace(some, without=("mounting_std_m", "imu_tilt_step_deg"))
    assert str(less) == "possible: 2.13 m RMS (bound; without: mounting_std_m, imu_tilt_step_deg)"
    assert less.to_json()["without"] == ["mounting_std_m", "imu_tilt_step_deg"]
    none = verdict.Possible("reference", 8.1, 8.0, 0.52, False, 0.004)
    assert "no accuracy" in str(none)
    assert "8.1" not in str(none)
    assert none.to_json()["absolute_rms_m"] is None
    assert none.to_json()["accuracy"] is False


def test_the_epochs_of_a_receiver_are_those_not_after() -> None:
    record = a_record(10)
    bound = limits.reference(record, load("realistic-dive"))
    np.testing.assert_array_equal(bound.at(np.array([0, NS, 2 * NS - 1, 2 * NS])), [0, 0, 0, 1])


def test_parameters_are_the_true_ones() -> None:
    scenario = load("realistic-dive")
    p = parameters.parameters(scenario, 0.002)
    assert isinstance(p, SimpleNamespace)
    assert p.range_std == pytest.approx(0.1 / sqrt(0.915), rel=1e-3)  # not the receiver's 0.5
    assert (p.depth_std, p.depth_bias_std, p.acceleration_psd) == (0.05, 0.05, 0.002)
    assert p.clock_std == pytest.approx(1.35)
    assert p.imu_heading_error_std == pytest.approx(np.deg2rad(3))
    assert p.sound_speed_std == pytest.approx(30 / 1530)


MEASURED = (
    "frequency", "phase", "sampling_time", "correlation_time", "temperature_rate", "step_time",
    "mean_position", "mean_heading", "heave", "roll", "pitch", "beacon_m", "beacon_depth",
    "beacon_scale", "packet_angle", "loss_burst", "water_depth", "wave_period", "boat_",
)
"""Parts of keys: where things are, how they move, and when, is in the record of a run."""


@pytest.mark.parametrize("ranging", ["one_way", "two_way", "inverted"])
@pytest.mark.parametrize("source", ["realistic-dive", "gps-buoys", "harbour-lbl"])
@pytest.mark.filterwarnings("ignore::sblcosim.errors.NoEffectWarning")
def test_every_error_is_in_the_model_or_named(source: str, ranging: str) -> None:
    """A key of the platform or the acoustics that is changed changes the model, or is said."""
    warm = {"imu_temperature_offset_K": 1.0, "mean_heading_deg": 10.0}
    base = load(source, {
        "acoustics.ranging": ranging,
        **({"platform": warm} if source == "realistic-dive" else {}),
    })
    own = has_own_errors(base.platform)
    receiver = LONG_BASELINE if own else ARRAY if ranging == "inverted" else COUPLED
    known, told = vars(parameters.parameters(base, 0.01, receiver)), unknown.left_out(base)
    assert told == ()
    named = set()
    for table in ("platform", "acoustics"):
        for v in COMPONENTS[table].of("parameter"):
            if v.type != "Float64" or any(part in v.key for part in MEASURED):
                continue
            if v.key == "turnaround_s":  # the diver knows it
                continue
            value = getattr(getattr(base, table), v.key)
            new = tuple(x + 0.011 for x in value) if v.shape else value + 0.011
            changed = load(base, {f"{table}.{v.key}": rows(v, new)})
            if has_own_errors(changed.platform) != own:
                continue  # another model
            moves = own and "_amplitude" in v.key
            received = v.key in (
                "loss_probability", "surface_echo_probability", "shadow_loss_probability"
            )
            if moves or (table, v.key) in changed.idle() or received:
                assert unknown.left_out(changed) == ()
                continue
            in_model = vars(parameters.parameters(changed, 0.01, receiver)) != known
            assert in_model == (unknown.left_out(changed) == ()), v.key
            named |= {*unknown.left_out(changed)}
    all_of_platform = {
        key.removeprefix("platform.") for key in UNMODELLED
        if key.startswith("platform.") or ranging == "two_way"
    }
    expected = {"realistic-dive": all_of_platform, "harbour-lbl": {"mounting_error_m"}}
    assert named == expected.get(source, set())


@pytest.mark.parametrize("distance", [20.0, 59.0, 100.0, 300.0, 1000.0])
@pytest.mark.filterwarnings("ignore::sblcosim.errors.NoEffectWarning")
def test_an_unknown_start_tells_nothing_however_far_the_diver_is(distance: float) -> None:
    """As with a prior of 10 km. One of 30 m would make 16.1 m at 300 m 14.5 m."""
    record = sblcosim.run("realistic-dive", "multilateration", {
        "target.trajectory": "semicircle", "target.depth_start_m": 5.0, "time.duration_s": 60.0,
        "target.radius_m": distance, "acoustics.ranging": "inverted",
    }).record
    scenario = load("realistic-dive")
    wide = load(scenario, {
        "receiver.initialisation": "prior", "receiver.prior_position_m": [0.0, 0.0, 5.0],
        "receiver.prior_position_std_m": 1e4,
    })
    unknown_, known = (limits.reference(record, it, acceleration_psd=0.01).verdict().absolute_rms
                       for it in (scenario, wide))
    assert unknown_ == pytest.approx(known, rel=0.005)


def test_what_is_left_out_is_beside_what_is_possible() -> None:
    drifts = load("realistic-dive", {"platform.imu_heading_drift_deg_s": 1e-3})
    record = a_record()
    limit = limits.reference(record, drifts)
    assert limit.without == ("imu_heading_drift_deg_s",)
    found = limit.verdict()
    assert found is not None
    (line,) = possible.lines({"ekf": found})
    assert line.endswith("(reference; without: imu_heading_drift_deg_s)")
    assert any(note.startswith("Without: ") for note in possible.notes({"ekf": found}))
    exact = limits.reference(record, load("realistic-dive")).verdict()
    assert exact is not None
    assert replace(found, without=(), left_out={}) == exact
    assert not any(note.startswith("Without: ") for note in possible.notes({"ekf": exact}))
