"""The README's numbers are those of the runs that it names."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import sblcosim
from sblcosim.report import paper

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
    assert f"The paper's Table 4 has {paper.facts()['table4']['total']} m" in README
    assert scenario.platform.gps_horizontal_std_m == 0.1
    assert scenario.time.sampling_time_s == 0.1
    assert scenario.acoustics.loss_probability == 0.0


LAST_ROW = {
    "platform.gps_horizontal_std_m": 3.5, "time.sampling_time_s": 1.0,
    "acoustics.loss_probability": 0.25,
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("row", "scenario", "overrides"),
    [("`realistic-dive`", "realistic-dive", {}), ("`harbour-square`", "harbour-square", {}),
     ("the path of the paper's Scenario 1", "paper-scenario-1", LAST_ROW)],
)  # fmt: skip
def test_the_table_is_that_of_2000_runs(
    row: str, scenario: str, overrides: dict[str, float]
) -> None:
    assert "over 2,000 runs, ± half of the 95 % interval" in README
    cells = re.findall(r"([\d.]+) ± ([\d.]+) \(([\d.,]+)\)", README.partition(f"| {row}")[2])[:3]
    receivers = ("coupled", "sequential", "ekf")
    runs = sblcosim.run_many(scenario, [*receivers], overrides, runs=2000).tables["runs"]
    for receiver, cell in zip(receivers, cells, strict=True):
        half, nees = (float(number.replace(",", "")) for number in cell[1:])
        weight = runs[f"{receiver}.estimates"] / runs[f"{receiver}.estimates"].mean()
        square = runs[f"{receiver}.absolute_total_rms_m"] ** 2
        mean = float((weight * square).mean())
        digits = len(cell[0].partition(".")[2])
        assert f"{mean**0.5:.{digits}f}" == cell[0], receiver
        error = float((weight * (square - mean)).std()) / len(runs) ** 0.5
        assert 1.96 * error / (2 * mean**0.5) == pytest.approx(half, rel=0.3), receiver
        of_runs = runs[f"{receiver}.nees_position"].to_numpy()
        assert float(np.average(of_runs, weights=weight)) == pytest.approx(nees, rel=0.1), receiver
