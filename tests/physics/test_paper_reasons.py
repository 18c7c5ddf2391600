"""Why our errors differ from the paper's: the numbers on the page about the paper."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import sblcosim

TEXT = (Path(__file__).parents[2] / "docs" / "howto" / "paper.md").read_text("utf-8")
PAGE = " ".join(TEXT.split())
IMU = {"platform.imu_tilt_std_deg": 10.0, "platform.imu_heading_std_deg": 10.0}
Q = {"receiver.acceleration_psd_m2_s3": 0.1}
COARSE = {"platform.gps_horizontal_std_m": 3.5}
SLOW = {"platform.gps_horizontal_markov_std_m": 3.5, "platform.gps_correlation_time_s": 100.0}
SHORT = {"platform.arm_length_m": 0.4}


def numbers(pattern: str) -> list[str]:
    found = re.search(pattern, PAGE)
    assert found is not None, pattern
    return [*found.groups()]


def mean_rms(overrides: dict[str, float]) -> float:
    """Mean of the RMS errors of the paper's filter over 100 runs [m]."""
    many = sblcosim.run_many("paper-scenario-1", ["ekf"], overrides, runs=100)
    return float(many.tables["runs"]["ekf.absolute_total_rms_m"].mean())


@pytest.mark.parametrize(
    ("pattern", "points"),
    [
        (r"error of ([\d.]+) m, the mean of 100 runs. With an IMU error of 10° it has ([\d.]+) m, "
         r"and with q = 0.1 m²/s³ as well, ([\d.]+) m", [{}, IMU, IMU | Q]),
        (r"T = 0.1 s is ([\d.]+) m with arms of 3 m, and ([\d.]+) m with arms of 0.4 m",
         [COARSE, COARSE | SHORT]),
        (r"moves all beacons alike: ([\d.]+) m and ([\d.]+) m", [SLOW, SLOW | SHORT]),
    ],
)  # fmt: skip
def test_the_page_on_the_paper_says_what_these_points_give(
    pattern: str, points: list[dict[str, float]]
) -> None:
    shown = numbers(pattern)
    for said, point in zip(shown, points, strict=True):
        digits = len(said.partition(".")[2])
        assert f"{mean_rms(point):.{digits}f}" == said, point
