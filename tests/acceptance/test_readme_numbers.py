"""The README's numbers are those of the runs that it names."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest
import sblcosim

ROOT = Path(__file__).parents[2]
README = " ".join((ROOT / "README.md").read_text("utf-8").split())


def drawing() -> ModuleType:
    """The script that draws the first picture."""
    spec = importlib.util.spec_from_file_location("draw", ROOT / "docs" / "draw.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def rms(result: sblcosim.Result, receiver: str) -> float:
    return float(result.errors.rms_m[receiver, "absolute", "total"])


def test_the_first_picture_is_the_run_that_its_caption_names() -> None:
    draw = drawing()
    assert f"--seed {draw.SEED}`*" in README
    assert f"Of {draw.RUNS} seeds" in README
    result = draw.run()
    caption = r"RMS error of ([\d.]+) m in this run, and the paper's `ekf` ([\d.]+) m"
    said = re.search(caption, README)
    assert said is not None
    shown = [f"{rms(result, name):.1f}" for name in draw.RECEIVERS]
    assert [*said.groups()] == shown
    assert f"RMS error of {shown[0]} m in this run, the other of {shown[1]} m" in README  # alt


@pytest.mark.slow
def test_the_first_picture_is_a_typical_run() -> None:
    draw = drawing()
    seed, medians = draw.choose()
    assert seed == draw.SEED
    said = " m and ".join(f"{medians[name]:.1f}" for name in draw.RECEIVERS)
    assert f"nearest to the medians of both filters, {said} m" in README


def test_the_first_command_prints_what_the_readme_says() -> None:
    result = sblcosim.run("paper-scenario-1")
    assert f"There `ekf` has an RMS error of {rms(result, 'ekf'):.2f} m" in README
    scenario = sblcosim.load("paper-scenario-1")
    assert "a GPS error of 0.1 m, ten pings per second and no loss" in README
    assert scenario.platform.gps_horizontal_std_m == 0.1
    assert scenario.time.sampling_time_s == 0.1
    assert scenario.acoustics.loss_probability == 0.0
