"""Recorded sets through the receivers; they are not in the project."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recorded_sets import RECORDED, log_of, needs_recorded
from sblcosim import identify, process

pytestmark = needs_recorded
SETTINGS: dict[str, dict[str, Any]] = {
    "goats_14": {"acoustics.range_std_m": 3.0, "acoustics.outlier_mean_m": 20.0},
    "plaza2": {"acoustics.range_std_m": 0.6, "acoustics.outlier_mean_m": 3.0,
               "acoustics.sound_speed_m_s": 1600.0, "platform.mounting_std_m": 0.05},
}  # fmt: skip
"""Noise and scale of ranges as a look at the residuals tells; nothing is from the truth."""


@pytest.mark.parametrize(
    ("name", "most", "smoothed"), [("goats_14", 6.2, 5.6), ("plaza2", 0.90, 0.45)]
)
def test_what_identify_finds_is_enough(
    name: str, most: float, smoothed: float, tmp_path: Path
) -> None:
    log = log_of(name, tmp_path)
    found = identify(log)
    rows = process(log, scenario=found.scenario(), smooth=True).receivers
    assert rows.horizontal_rms_m["long_baseline"] <= most
    assert rows.horizontal_rms_m["smoother"] <= smoothed
    assert rows.claimed_over_made[["long_baseline", "smoother"]].between(0.5, 2.2).all()
    numbers = found.numbers.set_index("parameter")
    if name == "plaza2":
        assert 0.061 < numbers.estimate["range_scale"] < 0.081
        offsets = numbers.filter(like="range_offset", axis=0)
        assert ((offsets.low < 0) & (offsets.high > 0)).all()


@pytest.mark.parametrize(
    ("name", "most", "smoothed"), [("goats_14", 6.2, 5.6), ("plaza2", 0.90, 0.45)]
)
def test_the_filter_that_process_chooses_is_as_good_as_one_set_by_hand(
    name: str, most: float, smoothed: float, tmp_path: Path
) -> None:
    processed = process(log_of(name, tmp_path), (), SETTINGS[name], smooth=True)
    rows = processed.receivers
    assert processed.main == "long_baseline"
    assert rows.horizontal_rms_m["long_baseline"] <= most
    assert 0.5 < rows.claimed_over_made["long_baseline"] < 2.2
    assert rows.horizontal_rms_m["smoother"] <= smoothed
    assert processed.restarts["long_baseline"] <= 1
    assert rows.judged["long_baseline"] > 0.9 * rows.estimates["long_baseline"]


@pytest.mark.parametrize("name", ["goats_14", "plaza2"])
def test_without_any_settings_nothing_diverges(name: str, tmp_path: Path) -> None:
    row = process(log_of(name, tmp_path)).receivers.loc["long_baseline"]
    assert row.horizontal_rms_m < {"goats_14": 7.0, "plaza2": 2.0}[name]
    assert 0.5 < row.claimed_over_made < 2.2


def test_all_ranges_that_are_far_too_short_or_too_late_are_left_out(tmp_path: Path) -> None:
    log = log_of("goats_14", tmp_path)
    assert log.truth is not None
    heard = log.receptions
    epoch = np.clip(heard.epoch_ns, log.truth.time_ns[0], log.truth.time_ns[-1])
    true, _ = log.truth.state_at(epoch)
    off = heard.range - np.linalg.norm(heard.beacon_position - true, axis=1)
    wrong = (off < -100) | (off > 40)
    processed = process(log)
    left = set(heard.line.tolist()) - set(processed.log.receptions.line.tolist())
    assert left == set(heard.line[wrong].tolist())
    assert (len(left), int((off > 40).sum())) == (12, 1)


def test_a_set_with_another_clock_is_aligned_and_says_so() -> None:
    processed = process(RECORDED / "lias_planar_mid")
    row = processed.receivers.loc["long_baseline"]
    assert row.horizontal_rms_m < 0.4  # ranges differ from the truth by 0.3 m
    assert 0.5 < row.claimed_over_made < 2.2
    assert any(line.startswith("truth: moved its clock by") for line in processed.remarks)
    offsets = processed.residuals.loc["long_baseline"].drop("depth").offset_m
    assert offsets.between(0.1, 0.3).all()


def test_a_device_that_reports_positions_only_is_shown_as_if_it_were_a_receiver(
    tmp_path: Path,
) -> None:
    processed = process(RECORDED / "waterlinked_dive")
    assert any("38 %" in line for line in processed.remarks)
    assert len(processed.made["acoustic, own axes"]) == 638
    assert (processed.tracks["acoustic, own axes"].epoch_s > 100).all()  # zeros before
    folder = processed.save(tmp_path / "out")
    assert (folder / "path.kml").is_file()
    assert (folder / "map.png").is_file()
