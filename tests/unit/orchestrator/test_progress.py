"""What is told of a long work: shares that never fall, from near 0 to 1."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import pytest
import sblcosim
from made_logs import made

DIVE = "realistic-dive"
SHORT = {"time.duration_s": 6.0}
MAP = {"runs": 8, "cells": "2x2", "duration_s": 6.0, "settling_s": 2.0}
PAPER = "paper-scenario-1"

WORKS: dict[str, Callable[..., Any]] = {
    "run": lambda **k: sblcosim.run(DIVE, ["ekf"], overrides=SHORT, **k),
    "run_many": lambda **k: sblcosim.run_many(DIVE, overrides=SHORT, runs=3, **k),
    "map": lambda **k: sblcosim.map_area(PAPER, "20x20", 5.0, **MAP, **k),
    "map with a limit": lambda **k: sblcosim.map_area(
        PAPER, "20x20", 5.0, limit_m=0.38, **MAP, **k
    ),
    "distances": lambda **k: sblcosim.map_distance(
        DIVE, 40.0, 5.0, cells=3, runs=4, duration_s=6.0, settling_s=2.0, **k
    ),
    "budget": lambda **k: sblcosim.budget(PAPER, "ekf", runs=30, **k),
    "process": lambda **k: sblcosim.process(made(seconds=30), **k),
}  # fmt: skip


@pytest.mark.parametrize("name", WORKS)
def test_progress_goes_from_the_beginning_to_the_end(name: str) -> None:
    shares: list[float] = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        made = WORKS[name](progress=shares.append)
    assert shares == sorted(shares)
    assert shares[0] >= 0
    assert shares[0] < 1 or name in ("run", "process")  # these may take a moment only
    assert shares[-1] == pytest.approx(1.0)
    if name == "map with a limit":
        assert made.summary()["extra_runs"] > 0


def test_progress_of_a_comparison_names_its_scenarios() -> None:
    told: list[tuple[float, str]] = []
    sblcosim.compare(
        [PAPER, "paper-scenario-2"], ["ekf"], runs=3, overrides=SHORT,
        progress=lambda share, what: told.append((share, what)),
    )  # fmt: skip
    shares = [share for share, _ in told]
    assert shares == sorted(shares)
    assert [*dict.fromkeys(what for _, what in told)] == [
        f"simulating {PAPER}", "simulating paper-scenario-2",
    ]
    assert min(s for s, what in told if what.endswith("2")) >= 0.5
    assert shares[-1] == pytest.approx(1.0)
