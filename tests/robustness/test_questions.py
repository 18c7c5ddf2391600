"""Damaged question files: a question, or lines that name what is wrong."""

from __future__ import annotations

import random
from pathlib import Path

import mutators
import pytest
from sblcosim import require
from sblcosim.errors import ConfigurationError

QUESTION = """
title = "Which GPS, and how long a baseline?"
scenario = "paper-scenario-1"
response = "total_rms_m"
limit = 1.0
share = 0.9
confidence = 0.95
most_runs = 5000
settling_time_s = 10.0
currency = "€"
[fixed]
"time.duration_s" = 20.0
[choices.gps]
label = "GPS"
keys = ["platform.gps_horizontal_std_m"]
levels = [0.1, 1.0, 3.5]
costs = { "0.1" = 500, "1" = 100, "3.5" = 20 }
[choices.baseline]
keys = ["platform.arm_length_m"]
levels = [0.4, 3.0]
costs = [10, 60]
[conditions.loss]
keys = ["acoustics.loss_probability"]
levels = [0.0, 0.25]
combine = "all"
"""


@pytest.mark.parametrize("cases", [range(250), pytest.param(range(250, 5000),
                                                            marks=pytest.mark.slow)])  # fmt: skip
def test_any_damage_to_a_file_is_said_in_lines(tmp_path: Path, cases: range) -> None:
    file = tmp_path / "mine.toml"
    refused = 0
    for number in cases:
        damaged = mutators.toml(random.Random(f"1 {number}"), QUESTION)
        file.write_bytes(damaged.encode(errors="surrogatepass"))
        said = ""
        try:
            require.load(file)
        except ConfigurationError as error:
            said = str(error)
        refused += bool(said)
        assert all(0 < len(line) < 1000 for line in said.splitlines()), damaged
        assert "factors" not in said or "factors" in damaged, said
    assert 0.1 < refused / len(cases) < 0.9
