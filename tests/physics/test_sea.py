"""A sea with a spectrum and a mooring: what many long runs show of what they are drawn from."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from itertools import pairwise
from math import atan2, degrees, e, exp, pi, radians, sqrt
from typing import Any

import numpy as np
import pytest
import sblcosim
from numpy.typing import NDArray
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters import lanes
from sblcosim.simulation.resolve import resolve

Array = NDArray[np.float64]
RUNS = 200
SMALL = {"raft_size": 0.1, "raft_draught": 0.0}
"""A body that follows all waves."""
BEAUFORT = {2: 0.2, 3: 0.6, 4: 1.0, 5: 2.0}
SLOPES = {1.6: (2.2, 3.9, 4.6, 5.5), 3.0: (1.4, 3.2, 3.9, 4.9), 6.0: (0.6, 2.1, 3.0, 4.1)}
"""Inclination by size of the body at these seas [deg]: middle of what others state."""


def runs(
    duration: float, step: float = 0.25, *, seed: int = 1, **parameters: Any
) -> Mapping[str, Array]:
    """Attitude [rad] and position [m], (runs, instants, 3), for arrays of parameters [SI]."""
    fixed = {"platform.motion": "spectrum", "platform.wave_height_m": 1.0}
    scenario = sblcosim.load("paper-scenario-1", {
        **fixed, "time.duration_s": duration, "time.sampling_time_s": step,
        **{f"platform.{a}_amplitude_deg": 0.0 for a in ("roll", "pitch", "yaw")},
    })  # fmt: skip
    plan = resolve(connect(scenario, "multilateration", tell_idle=False))
    count = max([RUNS, *(len(v) for v in parameters.values() if np.ndim(v))])
    values = {"seed": np.arange(seed, seed + count), **parameters}
    every = {f"platform.{k}": np.broadcast_to(v, (count,)).copy() for k, v in values.items()}
    outcome = lanes.execute(plan, every, record=["platform.attitude", "platform.position"])
    return {
        "attitude": outcome.values["platform.attitude"],
        "position": outcome.values["platform.position"],
    }


def known(values: Array) -> tuple[float, float]:
    """Mean over runs, and its standard error."""
    return float(values.mean()), float(values.std(ddof=1) / sqrt(len(values)))


def density(w: Array, height: float, period: float, enhancement: float) -> Array:
    """JONSWAP spectrum of the elevation [m² s], normalised by numbers instead of a formula."""
    peak = 2 * pi / period
    width = np.where(w > peak, 0.09, 0.07)
    shape = w**-5.0 * np.exp(-1.25 * (peak / w) ** 4)
    shape *= enhancement ** np.exp(-(((w - peak) / (width * peak)) ** 2) / 2)
    scaled: Array = height**2 / 16 * shape / np.trapezoid(shape, w)
    return scaled


GRID = np.linspace(0.02, 40.0, 200_001)
"""Angular frequencies for integrals [rad/s]."""


def expected_slope(height: float, size: float) -> float:
    """RMS of the slope in a fully developed sea [rad], as an integral."""
    number = GRID**2 / 9.81
    answer = number * np.sinc(number * size / 2 / pi) * np.exp(-number * 0.1)
    spectrum = density(GRID, height, 5.0 * sqrt(height), 1.0)
    return sqrt(np.trapezoid(spectrum * answer**2, GRID))


def test_inclination_by_beaufort_is_that_of_the_spectrum_and_of_others() -> None:
    cases = [(size, height) for size in SLOPES for height in BEAUFORT.values()]
    size, height = (np.repeat(column, RUNS) for column in zip(*cases, strict=True))
    found = runs(120.0, 0.5, raft_size=size, wave_height=height)
    squares = (found["attitude"][..., :2] ** 2).sum(-1).mean(-1).reshape(len(cases), RUNS)
    others = [degrees_ for row in SLOPES.values() for degrees_ in row]
    for (size, height), runs_, middle in zip(cases, squares, others, strict=True):
        mean, error = known(runs_)
        assert degrees(sqrt(mean)) == pytest.approx(middle, rel=0.1)
        assert mean == pytest.approx(expected_slope(height, size) ** 2, abs=4 * error, rel=0.01)


@pytest.mark.parametrize(("enhancement", "scatter"), [(1.0, 0.12), (3.3, 0.3)])
def test_the_height_is_the_significant_height(enhancement: float, scatter: float) -> None:
    """Four times the standard deviation of the surface; a run's variance scatters about it."""
    found = runs(600.0, 0.5, wave_height=2.0, wave_peak_enhancement=enhancement, **SMALL)
    mean, error = known(found["position"][..., 2].var(-1))
    assert mean == pytest.approx(0.25, abs=4 * error)
    assert error * sqrt(RUNS) < scatter * mean


def of_minutes(slope: Array, step: float) -> float:
    """Standard deviation of a minute's RMS slope within a run, in parts of its mean; RMS."""
    minute = round(60 / step)
    each = slope[:, : slope.shape[1] // minute * minute].reshape(len(slope), -1, minute)
    slopes = np.sqrt((each**2).mean(-1))
    return sqrt(((slopes.std(1, ddof=1) / slopes.mean(1)) ** 2).mean())


@pytest.mark.parametrize("height", [0.2, 1.0])
def test_groups_of_few_waves_are_as_regular_as_the_page_says(height: float) -> None:
    """By 3-4 %, with waves of the raft's length; a sea of 800 waves of random height has 8-9 %."""
    step, period, size = 0.5, 5.0 * sqrt(height), 1.6
    found = runs(1200.0, step, wave_height=height)["attitude"]
    along = found[..., 0] + found[..., 1]  # waves from ahead only pitch
    assert 0.025 < of_minutes(along, step) < 0.045
    rng = np.random.default_rng(1)
    longest, shortest = 2 * pi * 0.6 / period, max(2 * pi * 5 / period, sqrt(2 * pi * 9.81 / size))
    edges = np.geomspace(longest, shortest, 801)
    time = np.arange(0.0, 1200.0, step)
    sea = []
    for _ in range(30):
        w = np.exp(rng.uniform(*np.log([edges[:-1], edges[1:]])))
        number = w**2 / 9.81
        follows = np.sinc(number * size / 2 / pi) * np.exp(-number * 0.1)
        energy = np.interp(w, GRID, density(GRID, height, period, 1.0)) * w * np.diff(np.log(edges))
        size_of = number * follows * np.sqrt(2 * energy * rng.exponential(size=800))
        phases = rng.uniform(0, 2 * pi, 800)
        sea.append(size_of @ np.cos(w[:, None] * time + phases[:, None]))
    assert 0.075 < of_minutes(np.array(sea), step) < 0.1


@pytest.mark.parametrize(("keys", "scatter"), [
    ({"wave_height": 1.0}, 2.5), ({"wave_height": 1.0, "wave_peak_enhancement": 3.3}, 7.0),
    ({"wave_height": 2.0, **SMALL}, 5.0),
    ({"wave_height": 2.0, **SMALL, "wave_peak_enhancement": 3.3}, 13.0),
])  # fmt: skip
def test_the_height_of_a_run_scatters_as_the_page_says(
    keys: dict[str, float], scatter: float
) -> None:
    up = runs(600.0, 0.5, **keys)["position"][..., 2].std(-1)
    assert 100 * up.std() / up.mean() == pytest.approx(scatter, rel=0.3)


@pytest.mark.parametrize("enhancement", [1.0, 3.3])
def test_the_energy_of_each_band_is_that_of_the_spectrum(enhancement: float) -> None:
    """Of heave and of slope, in a sea that comes from between ahead and abeam."""
    step, period, size = 0.25, 6.0, 2.0
    found = runs(
        1024.0, step, wave_height=1.5, wave_period=period, wave_peak_enhancement=enhancement,
        wave_direction=2.0, raft_size=size,
    )  # fmt: skip
    n = 4096
    window = np.hanning(n)
    w = 2 * pi * np.fft.rfftfreq(n, step)

    def energy(values: Array) -> Array:
        """Energy at each frequency, (runs, frequencies)."""
        transformed = np.fft.rfft(values[:, :n] * window, axis=1)
        power: Array = 2 * np.abs(transformed) ** 2 / (n * (window**2).sum())
        return power

    heave = energy(found["position"][..., 2])
    slope = sum(energy(found["attitude"][..., i]) for i in (0, 1))
    number = GRID**2 / 9.81
    moved = np.sinc(number * size / 2 / pi) * np.exp(-number * 0.1)
    spectrum = density(GRID, 1.5, period, enhancement) * moved**2
    edges = 2 * pi / period * np.array([0.7, 0.9, 1.1, 1.4, 2.0, 3.0])
    for low, high in pairwise(edges):
        inside, own = ((low <= it) & (it < high) for it in (GRID, w))
        for power, of in ((heave, spectrum), (slope, spectrum * number**2)):
            mean, error = known(power[:, own].sum(1))
            wanted = np.trapezoid(of[inside], GRID[inside])
            assert mean == pytest.approx(wanted, abs=4 * error + 0.01 * wanted), (low, high)


def phase(of: Array, to: Array, step: float = 0.5, period: float = 5.0) -> tuple[float, float]:
    """By how much the first leads the second at the peak [deg], and their coherence; all runs."""
    w = 2 * pi * np.fft.rfftfreq(of.shape[1], step)
    peak = np.abs(w * period / (2 * pi) - 1) < 0.1
    window = np.hanning(of.shape[1])
    a, b = (np.fft.rfft(values * window)[:, peak] for values in (of, to))
    cross = (a * b.conj()).sum()
    both = (np.abs(a) ** 2).sum() * (np.abs(b) ** 2).sum()
    return degrees(atan2(cross.imag, cross.real)), float(abs(cross) / sqrt(both))


@pytest.mark.parametrize(("heading", "leads"), [(0.0, 90.0), (pi, -90.0)])
def test_pitch_leads_heave_by_a_quarter_in_long_waves_from_ahead(
    heading: float, leads: float
) -> None:
    """The bow rises before the crest arrives; in waves from astern after it has passed."""
    found = runs(
        600.0, 0.5, wave_period=12.0, wave_peak_enhancement=3.3, wave_direction=pi,
        mean_heading=heading, wave_spreading=radians(5.0),
    )  # fmt: skip
    up, pitch = -found["position"][..., 2], found["attitude"][..., 1]
    angle, coherence = phase(pitch, up, period=12.0)
    assert angle == pytest.approx(leads, abs=1.0)
    assert coherence > 0.95
    # The water, and what floats in it, moves with the waves under a crest: here to the south.
    south = np.gradient(-found["position"][..., 0], axis=1)
    assert phase(south, up, period=12.0)[0] == pytest.approx(0, abs=1)


@pytest.mark.parametrize("heading", [0.0, 0.7])
def test_waves_from_abeam_roll_and_the_spread_ones_pitch_as_well(heading: float) -> None:
    spread = 0.5
    found = runs(
        300.0, 0.5, wave_direction=heading + pi / 2, mean_heading=heading,
        wave_spreading=np.repeat([0.0, spread], RUNS),
    )  # fmt: skip
    roll, pitch = ((found["attitude"][..., i] ** 2).mean(-1).reshape(2, RUNS) for i in (0, 1))
    assert pitch[0].max() < 1e-20 < roll[0].min()
    mean, error = known(pitch[1] / (roll[1] + pitch[1]).mean())
    assert mean == pytest.approx((1 - exp(-2 * spread**2)) / 2, abs=4 * error)
    # Waves run to starboard: port has risen, a positive roll, before the crest is amidships.
    assert phase(found["attitude"][:RUNS, :, 0], -found["position"][:RUNS, :, 2])[0] \
        == pytest.approx(90.0, abs=2.0)


@cache
def moored(tick: float, time: float = 20.0) -> Array:
    """North and east of a platform in a calm sea [m], every 5 s; (runs, instants, 2)."""
    found = runs(600.0, tick, wave_height=0.0, watch_circle=3.0, mooring_time=time)
    every: Array = found["position"][:, :: round(5.0 / tick), :2]
    return every


@pytest.mark.parametrize("tick", [0.25, 1.0, 5.0])
def test_the_drift_of_a_mooring_is_as_declared_for_every_tick(tick: float) -> None:
    place, std, time = moored(tick), 3.0 / 2.4477, 20.0
    mean, error = known((place**2).mean((1, 2)))
    assert mean == pytest.approx(std**2, abs=4 * error)
    mean, error = known((np.hypot(*np.moveaxis(place, 2, 0)) < 3.0).mean(1))
    assert mean == pytest.approx(0.95, abs=4 * error)
    for lag in (5.0, time, 3 * time):
        n = round(lag / 5.0)
        mean, error = known((place[:, n:] * place[:, :-n]).mean((1, 2)))
        assert mean == pytest.approx(
            std**2 * (1 + lag / time) * e ** (-lag / time), abs=4 * error
        ), lag
    mean, error = known((place[:, :, 0] * place[:, :, 1]).mean(1))
    assert mean == pytest.approx(0.0, abs=4 * error)


def test_a_moored_platform_has_a_velocity() -> None:
    """Its place is smooth from tick to tick and between them."""
    found = runs(60.0, 0.25, wave_height=0.0, watch_circle=3.0, mooring_time=20.0)["position"]
    velocity = np.diff(found[..., :2], axis=1) / 0.25
    mean, error = known((velocity**2).mean((1, 2)))
    assert mean == pytest.approx((3.0 / 2.4477 / 20.0) ** 2, abs=4 * error)
    assert np.abs(np.diff(velocity, axis=1)).max() < 0.05
