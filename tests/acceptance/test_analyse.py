"""From a study to its answer, by the command line."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest
from sblcosim import analysis
from sblcosim.cli import app
from sblcosim.errors import ConfigurationError
from typer.testing import CliRunner

STUDY = """
name = "small"
scenario = "paper-scenario-1"
replicates = 3

[fixed]
"time.duration_s" = 20.0

[design]
kind = "full"

[factors.gps]
keys = ["platform.gps_horizontal_std_m"]
levels = [0.1, 3.5]

[factors.depth]
keys = ["target.depth_std_m"]
levels = [0.01, 0.1]
"""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("analyse")
    (folder / "small.toml").write_text(STUDY)
    done = CliRunner().invoke(
        app, ["study", str(folder / "small.toml"), "--out", str(folder / "small")]
    )
    assert done.exit_code == 0, done.output
    return folder / "small"


def test_the_large_factor_is_found_and_written(results: Path) -> None:
    done = CliRunner().invoke(app, ["analyse", str(results)])
    assert done.exit_code == 0, done.output
    assert "Largest main effects gps" in done.stdout.replace("\n", " ")
    folder = results.with_name("small-analysis")
    effects = pd.read_csv(folder / "effects.csv", index_col=0)
    runs = pd.read_parquet(results / "runs.parquet")
    means = runs.groupby("gps")["ekf.absolute_total_rms_m"].mean()
    assert effects.loc["gps", "effect"] == pytest.approx(means[3.5] - means[0.1], rel=1e-9)
    for name in ("pareto", "main_effects", "interactions", "residuals"):
        assert (folder / f"{name}.svg").stat().st_size > 1000
        assert (folder / f"{name}.png").stat().st_size > 1000


def test_unknown_names_are_answered_with_the_valid_ones(results: Path) -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'absolute_total_rms_m'"):
        analysis.of_study(results, "absolute_total_rms")
    with pytest.raises(ConfigurationError, match="receiver: must be ekf"):
        analysis.of_study(results, receiver="efk")
    done = CliRunner().invoke(app, ["analyse", str(results), "--transform", "cube"])
    assert done.exit_code == 2
