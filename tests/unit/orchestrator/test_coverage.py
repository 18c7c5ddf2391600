"""How often the intervals of Sobol' indices hold them, over many samples."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from known_indices import FUNCTIONS, RARE, STEPS, Known
from numpy.typing import NDArray
from quick import one_in
from sblcosim.analysis.space import jackknife, two_values
from sblcosim.analysis.space.analysis import indices
from sblcosim.analysis.space.jackknife import IndexEstimates
from sblcosim.study.distributions import distribution_of
from sblcosim.study.space import NEWEST, DrawnFactor, SampleVersion, sample
from scipy import optimize, special, stats

Floats = NDArray[np.float64]
CONFIDENCE = 0.95
LEAST = {16: 0.85, 32: 0.85, 64: 0.88, 128: 0.88, 256: 0.88}
"""Of the samples, that are to hold an index, by base rows."""
ALL = FUNCTIONS | STEPS
SAMPLES = 200
COUNTED = 0.02
"""Indices below it are not counted."""
COLUMNS = tuple(
    DrawnFactor(f"x{i}", distribution_of("uniform", range=[0, 1])) for i in range(1, 13)
)


@cache
def drawn(
    samples: int, rows: int, seed: int = 0, version: SampleVersion = NEWEST
) -> tuple[Floats, Floats]:
    """A and B of many samples; shape of each (samples, rows, columns)."""
    all_drawn = [sample(COLUMNS, rows, 100_000 * seed + 7 * s, version) for s in range(samples)]
    u = np.stack([one.values.to_numpy().reshape(rows, -1, 12)[:, [0, -1]] for one in all_drawn])
    return u[:, :, 0], u[:, :, -1]


def held(found: IndexEstimates, known: tuple[float, ...], digit: float = 5e-4) -> Floats:
    """Share of the samples whose interval holds an index, of those that count."""
    inside = (found.low <= np.add(known, digit)) & (np.subtract(known, digit) <= found.high)
    share: Floats = inside.mean(axis=0)[np.array(known) > COUNTED]
    return share


def each(known: Known, a: Floats, b: Floats) -> Floats:
    """Share of the samples that hold each index that counts."""
    first, total = jackknife.indices(known.rows(a, b), CONFIDENCE)
    return np.append(held(first, known.first), held(total, known.total))


def by_chance(samples: int, share: float) -> float:
    """Share of the samples that hold an index, below which it is not by chance."""
    return float(stats.binom.ppf(1e-3, samples, share) / samples)


@one_in(2)
@pytest.mark.parametrize("name", ALL)
def test_intervals_hold_the_indices_of_any_function(name: str) -> None:
    a, b = drawn(SAMPLES, 64)
    for rows in (16, 64):  # more base rows continue a sample
        shares = each(ALL[name], a[:, :rows], b[:, :rows])
        assert shares.min() >= by_chance(SAMPLES, LEAST[rows])


def test_what_few_runs_show_is_held_by_wide_intervals_and_by_none_that_says_nothing() -> None:
    """With enough base rows each index is held; with fewer, no interval is that of 0 alone."""
    a, b = drawn(SAMPLES, 64)
    for rows, known in RARE.values():
        for used in (16, 32, 64):
            y = known.rows(a[:, :used], b[:, :used])
            first, total = jackknife.indices(y, CONFIDENCE)
            assert total.high.min() > 0
            if used >= rows:
                shares = np.append(held(first, known.first), held(total, known.total))
                assert shares.min() >= by_chance(SAMPLES, LEAST[used])


def test_an_interval_of_a_step_reaches_to_the_estimate_with_a_row_that_is_not_there() -> None:
    """Both runs of a pair beyond the step, with the share that likelihood does not exclude."""
    a, b = drawn(SAMPLES, 64)
    y = STEPS["step in 10%"].rows(a, b)
    beyond = y > 4
    alone = ~(beyond[..., 0] & beyond[..., 1]).any(axis=1)
    assert 0.3 < alone.mean() < 0.8
    y = y[alone]
    rows = y.shape[1]
    share = 1 - np.exp(-(stats.t.ppf(0.975, rows - 1) ** 2) / 2 / rows)
    _, total = jackknife.indices(y, CONFIDENCE)
    for one, low in zip(y, total.low[:, 0], strict=True):
        far = np.max((one - one.mean()) ** 2)
        half = np.mean((one[:, 1] - one[:, 0]) ** 2) / 2
        assert low <= half / (one[:, [0, -1]].var() + share * far) * (1 + 1e-9)


def test_a_first_order_interval_reaches_to_the_estimate_with_a_row_that_is_not_there() -> None:
    """Of what B and the runs with its column do not share, by the farthest share of all runs."""
    a, b = drawn(SAMPLES, 16)
    y = STEPS["step in 10%"].rows(a, b)
    y = y[(y[..., 0].max(axis=1) > 4) & (y[..., -1].max(axis=1) > 4)]
    rows = y.shape[1]
    first, total = jackknife.indices(y, CONFIDENCE)
    share = 1 - np.exp(-(stats.t.ppf(0.975, rows - 1) ** 2) / 2 / rows)
    reached = 0
    for one, high, most in zip(y, first.high, total.high, strict=True):
        variance = one[:, [0, -1]].var()
        far = np.sort(((one - one.mean()) ** 2).ravel())
        far = far[-int(np.ceil(share * far.size)) :].mean()
        rest = ((one[:, 1:-1] - one[:, -1:]) ** 2).mean(axis=0) / 2
        end = np.minimum(1 - rest / (variance + share * far), most)
        assert (high > end - 1e-9).all()
        reached += (np.abs(high - end)[most > end + 0.01] < 1e-9).sum()
    assert reached > len(y) / 10


def test_the_sample_of_before_would_be_noticed() -> None:
    for name in ("wing", "weights 1 to 6"):
        a, b = drawn(SAMPLES, 16, version=1)
        assert each(FUNCTIONS[name], a, b).min() < by_chance(SAMPLES, LEAST[16]) - 0.1


@pytest.mark.slow
@pytest.mark.parametrize("rows", LEAST)
def test_intervals_hold_the_indices_of_a_thousand_samples(rows: int) -> None:
    """The worst of all indices above 0.02, without an allowance for chance."""
    a, b = drawn(1000, 256, 1)
    parts = np.split(np.arange(1000), 10)  # for memory
    shares = {
        name: np.mean([each(known, a[part, :rows], b[part, :rows]) for part in parts], axis=0).min()
        for name, known in (ALL | {n: k for n, (least, k) in RARE.items() if rows >= least}).items()
    }
    least = sorted(shares, key=shares.__getitem__)
    print(f"\n{rows} base rows:", {name: round(float(shares[name]), 3) for name in least[:6]})
    assert shares[least[0]] >= LEAST[rows]


def test_what_permuting_costs_is_as_the_sources_say() -> None:
    """Standard deviation of the total indices of a sum of 4 at 64 rows, in shares of them."""
    known = FUNCTIONS["sum of 4"]
    spread = {}
    for version in (1, 2):
        totals = []
        for s in range(80):
            u = sample(COLUMNS[:4], 64, 7 * s, version).values.to_numpy().reshape(64, -1, 4)
            totals.append(jackknife.indices(known.rows(u[:, 0], u[:, -1]), 0.95)[1].value)
        spread[version] = float(np.std(totals) / 0.25)
    assert spread[1] == pytest.approx(0.04, abs=0.01)
    assert spread[2] == pytest.approx(0.18, abs=0.03)


# --- Responses of two values ---------------------------------------------------------------------

SCORES: dict[str, Callable[[Floats], Floats]] = {
    "one": lambda u: u[..., 0],
    "sum": lambda u: u[..., 0] + u[..., 1] + 0.5 * u[..., 2],
    "product": lambda u: np.prod(u[..., :4], axis=-1),
    "least": lambda u: u[..., :3].min(axis=-1),
    "largest": lambda u: u[..., :3].max(axis=-1),
    "both or none": lambda u: (u[..., 0] - 0.5) * (u[..., 1] - 0.5),
}
SHARES = (0.5, 0.1, 0.02, 0.005, 0.001)


def events(name: str, share: float, columns: int) -> Known:
    """Whether a score is among its largest, with the indices of 2¹⁶ pseudorandom base rows."""
    rng = np.random.default_rng(1)
    a, b = rng.random((2, 2**16, columns))
    limit = np.quantile(np.append(SCORES[name](a), SCORES[name](b)), 1 - share)
    made = Known(lambda u: (SCORES[name](u) > limit) * 1.0, (0.0,) * columns, (0.0,) * columns)
    y = made.rows(a, b)
    pairs = 2 * y[:, [0, -1]].var()
    first = 1 - (y[:, 1:-1] != y[:, -1:]).mean(axis=0) / pairs
    total = (y[:, 1:-1] != y[:, :1]).mean(axis=0) / pairs
    return Known(made.of, tuple(first), tuple(total))


@pytest.mark.parametrize("name", SCORES)
@pytest.mark.parametrize("share", [0.3, 0.03])
def test_intervals_hold_the_indices_of_events_of_any_share(name: str, share: float) -> None:
    known = events(name, share, 4)
    a, b = (ends[:100] for ends in drawn(SAMPLES, 64))
    for rows in (16, 64):
        y = known.rows(a[:, :rows], b[:, :rows])
        some = np.ptp(y[..., [0, -1]], axis=(1, 2)) > 0  # others are refused
        for found, of in zip(
            two_values.intervals(y[some], CONFIDENCE), (known.first, known.total), strict=True
        ):
            assert 0 <= found.low.min() <= found.high.max() <= 1
            shares = held(found, of, 0.01)  # the digits of the indices that are known
            assert min(shares, default=1) >= by_chance(int(some.sum()), 0.88)


@one_in(2)
@pytest.mark.parametrize("name", SCORES)
@pytest.mark.parametrize("share", SHARES)
def test_what_is_said_of_events_is_from_0_to_1_and_few_are_too_few(name: str, share: float) -> None:
    known = events(name, share, 4)
    for seed in range(2):
        space = sample(COLUMNS[:4], 128, seed)
        u = space.values.to_numpy()
        y = known.of(u)
        independent = y.reshape(128, -1)[:, [0, -1]]
        if np.ptp(independent) == 0:
            continue
        found = indices(space, y, "ekf.lost")
        table = found.indices
        assert table.to_numpy().min() >= 0
        assert table.to_numpy().max() <= 1
        for kind in ("first", "total"):
            assert (table[f"{kind}_low"] <= table[kind]).all()
            assert (table[kind] <= table[f"{kind}_high"]).all()
        count = int(min(independent.sum(), (1 - independent).sum()))
        assert found.text().startswith("Too few runs differ") == (count < 20)
        if count < 4:
            assert (table["total_high"] - table["total_low"])[:4].min() > 0.3


@pytest.mark.parametrize("base", [0.0, -3.0, 1e6])
def test_two_values_are_two_values_whatever_they_are(base: float) -> None:
    space = sample(COLUMNS[:2], 64)
    y = (space.values["x1"] + 0.3 * space.values["x2"] > 0.8).to_numpy(np.float64)
    found, other = (indices(space, values).indices for values in (y, base + 5 * y))
    assert np.abs(found - other).to_numpy().max() < 1e-6


@pytest.mark.parametrize("counts", [(30, 5, 29), (5, 20, 39), (2, 3, 123), (100, 12, 16)])
def test_an_interval_of_two_values_ends_where_the_likelihood_says(
    counts: tuple[int, int, int],
) -> None:
    """Of pairs that are equal with probability ρ + (1 - ρ) (p² + q²), at the best p."""
    both, either, none = counts
    pairs = np.array([(1, 1)] * both + [(0, 1)] * either + [(0, 0)] * none, np.float64)

    def height(rho: float) -> float:
        def minus(p: float) -> float:
            q = 1 - p
            chances = rho * p + (1 - rho) * p**2, 2 * (1 - rho) * p * q, rho * q + (1 - rho) * q**2
            return -float(sum(special.xlogy(counts, chances)))

        best = optimize.minimize_scalar(
            minus, bounds=(0, 1), method="bounded", options={"xatol": 1e-10}
        )
        return -float(best.fun)

    found = two_values.correlation(pairs[:, :1], pairs[:, 1:], CONFIDENCE)
    best, low, high = (float(at[0]) for at in (found.value, found.low, found.high))
    deep = stats.t.ppf((1 + CONFIDENCE) / 2, len(pairs) - 1) ** 2 / 2
    for end, limit in ((low, 0.0), (high, 1.0)):
        if end != limit:
            assert height(best) - height(end) == pytest.approx(deep, abs=1e-5)
    assert low < best < high
