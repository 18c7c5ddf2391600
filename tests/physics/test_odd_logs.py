"""Claims of receivers on logs with several things wrong in each: neither lost nor dishonest."""

from __future__ import annotations

import pytest
from odd_logs import ODD, odd_log
from sblcosim import identify, process

LEAST, MOST = 0.5, 2.2
"""Claimed over made horizontal error that is honest."""
SEEDS = range(100, 130)


def judged(seed: int) -> tuple[float, float]:
    """Error over the reach of the beacons, and claimed over made error, with what a log tells."""
    drawn = odd_log(seed)
    found = process(drawn.log, scenario=identify(drawn.log).scenario())
    row = found.receivers.loc[found.main]
    print(f"{seed}: {drawn.odd}: {row.horizontal_rms_m:.2f} m, {row.claimed_over_made:.2f}")
    assert row.judged > 0.5 * row.estimates
    return row.horizontal_rms_m / drawn.reach, row.claimed_over_made


@pytest.mark.slow
def test_claims_on_odd_logs_are_honest() -> None:
    errors, claims = zip(*map(judged, SEEDS), strict=True)
    assert max(errors) < 0.4
    assert LEAST <= min(claims) < max(claims) <= MOST


@pytest.mark.parametrize("seed", [
    pytest.param(108, id="misplaced", marks=pytest.mark.slow), pytest.param(130, id="walk, gaps"),
    pytest.param(204, id="surveyed well", marks=pytest.mark.slow),
    pytest.param(334, id="misplaced, another track", marks=pytest.mark.slow),
])  # fmt: skip
def test_claims_on_some_of_them_are(seed: int) -> None:
    error, claim = judged(seed)
    assert error < 0.2
    assert LEAST <= claim <= MOST


def test_the_logs_of_the_seeds_have_all_that_can_be_wrong() -> None:
    assert {it for seed in SEEDS for it in odd_log(seed).odd} == {*ODD}
