"""Recorded sets, which are not in the project: see ``README.md``."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from sblcosim import read_log
from sblcosim.logs.log import Log

RECORDED = Path(os.environ.get("SBLCOSIM_RECORDED", "recorded-sets"))
"""Folder of the sets; tests that need it are skipped where it is missing."""
needs_recorded = pytest.mark.skipif(
    not (RECORDED / "goats_14_ranges.csv").is_file(), reason="no recorded sets here"
)
IN_THE_PLANE = """
dimension = 2
[mapping]
axes = "enu"
[mapping.receptions]
file = "{0}_ranges.csv"
reported = ["beacon_x_m", "beacon_y_m"]
kind = "range"
[mapping.truth]
file = "{0}_truth.csv"
position = ["x_m", "y_m"]
"""


def log_of(name: str, folder: Path) -> Log:
    """A set in a plane, by a mapping that is written into a folder."""
    mapping = folder / f"{name}.toml"
    mapping.write_text(IN_THE_PLANE.format(name))
    return read_log(RECORDED, mapping)
