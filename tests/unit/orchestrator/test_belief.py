"""What speaks against a track: its passes, its residuals, and a filter that knows no bearing."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from model_dive import dive, parameters
from quick import one_in
from sblcosim.data.estimates import Estimates
from sblcosim.data.samples import Samples
from sblcosim.estimation import belief, outcome, smoother

EPOCHS = 240


def doubts(
    p: Any, samples: Samples, at: np.ndarray, passes: int = smoother.PASSES
) -> tuple[str, ...]:
    """Of the track from a start, beside a filter whose covariances are those of the track."""
    track = smoother.smooth(p, samples, at, passes)
    filtered = outcome.of_states(p, samples, track.mean, track.covariance)
    return belief.doubts(p, samples, track, filtered)


@one_in(2)
@pytest.mark.parametrize("seed", range(10))
def test_nothing_speaks_against_a_track_of_the_model(seed: int) -> None:
    p = parameters()
    samples, truth = dive(p, seed, EPOCHS)
    assert doubts(p, samples, truth) == ()


def test_passes_that_have_not_converged() -> None:
    p = parameters()
    samples, truth = dive(p, 1, EPOCHS)
    assert doubts(p, samples, truth, 3) == ("it has not converged in 3 passes",)


def test_a_beacon_that_measures_too_much() -> None:
    """And too little: no clock explains both."""
    p = parameters()
    samples, truth = dive(p, 2, EPOCHS, loss=0.0, late=0.0)
    off = 4.0 * (samples.beacon == 0) - 4.0 * (samples.beacon == 1)
    said = doubts(p, replace(samples, range=samples.range + off), truth)
    assert any("of the ranges do not fit" in it for it in said)


def test_a_stretch_in_which_ranges_do_not_fit() -> None:
    p = parameters()
    samples, truth = dive(p, 3, EPOCHS, loss=0.0, late=0.0)
    seconds = samples.range_ns / 1e9
    rough = (seconds >= 120) & (seconds < 180)
    off = np.random.default_rng(3).uniform(-6, 6, len(seconds)) * rough
    said = doubts(p, replace(samples, range=samples.range + off), truth)
    assert said == ("the ranges from 120 s to 180 s do not fit",)


def test_noise_that_is_larger_than_was_told() -> None:
    """Up to three of its standard deviations, no range of its own is a misfit."""
    p = parameters(range_std_m=0.05, outlier_probability=0.0)
    samples, truth = dive(p, 4, EPOCHS, loss=0.0, late=0.0)
    rng = np.random.default_rng(4)
    noisy = samples.range + 0.15 * rng.choice([-1.0, 1.0], len(samples.range))
    said = doubts(p, replace(samples, range=noisy), truth)
    assert any("times what is expected" in it for it in said)


@pytest.mark.parametrize(("bearing_std", "known"), [(0.5, True), (1.3, True), (1.6, False)])
def test_a_filter_that_knows_no_bearing(bearing_std: float, known: bool) -> None:
    p = parameters()
    samples, truth = dive(p, 5, EPOCHS)
    track = smoother.smooth(p, samples, truth)
    y = np.array([12.0, 5.0])
    across = np.array([-y[1], y[0]])
    P = np.eye(6)
    P[::2, ::2][:2, :2] = bearing_std**2 * np.outer(across, across)
    filtered = Estimates(
        epoch_ns=samples.epochs_ns, position=truth[:, :3],
        covariance=np.tile(P, (len(truth), 1, 1)),
        relative_position=np.tile([*y, 6.0], (len(truth), 1)),
    )
    said = belief.doubts(p, samples, track, filtered)
    assert (said == ()) is known
    if not known:
        assert "bearing" in said[0]


def told(
    punctual: np.ndarray, residual: np.ndarray, late: float = 0.0, ns: np.ndarray | None = None
) -> tuple[str, ...]:
    """Of ranges, 100 in a second if nothing else is said, from 5 s on."""
    ranges = 5_000_000_000 + (10_000_000 * np.arange(len(punctual)) if ns is None else ns)
    samples: Any = SimpleNamespace(range_ns=ranges, start_ns=5_000_000_000)
    track: Any = SimpleNamespace(converged=True, punctual=punctual, residual=residual)
    filtered = Estimates(epoch_ns=ranges[:1], position=np.zeros((1, 3)))
    return belief.doubts(SimpleNamespace(outlier_probability=late), samples, track, filtered)


def test_a_whole_run_is_doubted_beyond_a_share_and_a_size() -> None:
    ones, none = np.ones(64), np.zeros(64)
    some = np.arange(64) < 32  # half of them, as 1/4 may be late beside 1/4 that are expected to be
    assert told(1.0 - some, none, 0.25) == ()
    assert told(1.0 - some, none, 0.24) == ("50 % of the ranges do not fit",)
    assert told(1.0 - (np.arange(64) < 33), none, 0.25) == ("52 % of the ranges do not fit",)
    assert told(ones, 2.0 * some) == ()
    assert told(ones, 2.0 * some + none - 0.0625 * ~some) == (
        "the residuals of the ranges are 1.4 times what is expected",
    )


def test_a_stretch_is_doubted_beyond_a_share_or_a_size_and_from_eight_ranges_on() -> None:
    each = np.array([100, 8, 0, 7, 9])
    begin = np.repeat(np.arange(5), each) * 60
    ns = 1_000_000_000 * begin + np.concatenate([
        np.linspace(0, 59_999_999_999, n).astype(np.int64) for n in each
    ])
    ones, none, second = np.ones(124), np.zeros(124), begin == 60
    half = second & (np.cumsum(second) <= 4)
    said = ("the ranges from 60 s to 120 s do not fit",)
    assert told(1.0 - half, none, ns=ns) == ()
    assert told(1.0 - half - 0.01 * second, none, ns=ns) == said
    assert told(ones, 2.0 * second, ns=ns) == ()
    assert told(ones, 2.001 * second, ns=ns) == said
    assert told(ones, 2.001 * second - 2.001 * (begin == 240), ns=ns) == said
    few = begin == 180
    assert told(1.0 - few, 3.0 * few, ns=ns) == ()


def test_a_bearing_is_unknown_in_most_estimates_from_more_than_half_on() -> None:
    y, across = np.array([12.0, 5.0]), np.array([-5.0, 12.0])
    for unknown, doubted in ((3, False), (4, True)):
        P = np.tile(np.eye(6), (6, 1, 1))
        P[:unknown, ::2, ::2][:, :2, :2] = 4.0 * np.outer(across, across)
        filtered = Estimates(
            epoch_ns=np.arange(6), position=np.zeros((6, 3)), covariance=P,
            relative_position=np.tile([*y, 6.0], (6, 1)),
        )
        track: Any = SimpleNamespace(converged=False, steps_m=[1.0, 2.0])
        nothing: Any = None
        said = belief.doubts(nothing, nothing, track, filtered)
        assert said[0] == "it has not converged in 2 passes"
        assert len(said) == 1 + doubted
