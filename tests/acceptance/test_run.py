"""The whole from a scenario to its results."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import sblcosim
from sblcosim.models.declaration import output
from sblcosim.models.ports import ESTIMATE, REQUIRED_ESTIMATE
from sblcosim.results.result import Result
from sblcosim.scenario.scenario import shipped

SHORT = {"time.duration_s": 20.0}


@pytest.fixture(scope="module")
def paper() -> Result:
    return sblcosim.run("paper-scenario-1")


def total(result: Result, receiver: str) -> float:
    return float(result.errors.loc[(receiver, "absolute", "total"), "rms_m"])


def test_the_ekf_of_scenario_1_beats_the_raw_fix_and_is_good_to_some_decimetres(
    paper: Result,
) -> None:
    assert paper.receivers == ("ekf", "raw")
    assert 0.05 < total(paper, "ekf") < 0.5
    assert total(paper, "ekf") < 0.7 * total(paper, "raw") < 1.0


def test_the_run_ends_with_the_semicircle(paper: Result) -> None:
    path = paper.table[[f"target.position[{i}]" for i in (1, 2, 3)]].to_numpy()
    assert path[0] == pytest.approx([15.0, 0.0, 5.0])
    assert path[-1] == pytest.approx([-15.0, 0.0, 5.0], abs=0.05)
    assert np.linalg.norm(path[:, :2], axis=1) == pytest.approx(15.0)
    assert paper.table["time_s"].iloc[-1] == pytest.approx(np.pi * 15 / 0.5, abs=0.1)


def test_the_prior_of_scenario_1_is_the_true_start(paper: Result) -> None:
    first = paper.tracks["ekf"].iloc[0]
    assert first["epoch_s"] == 0.1
    assert first["error_total_m"] < 0.2


def test_a_saved_run_holds_record_manifest_and_figures(paper: Result, tmp_path: Path) -> None:
    folder = paper.save(tmp_path / "run")
    written = {file.name for file in folder.iterdir()}
    figures = ("path_xy", "path_xyz", "axes", "errors", "inclination")
    assert {f"{figure}.{kind}" for figure in figures for kind in ("svg", "png")} <= written
    record = pd.read_parquet(folder / "record.parquet")
    pd.testing.assert_frame_equal(record, paper.table)
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["seeds"] == {"target": 1, "platform": 1, "acoustics": 1}
    assert set(manifest["fmus"]) == {"target", "platform", "acoustics", "ekf", "raw"}
    again = sblcosim.run(tomllib.loads((folder / "scenario.toml").read_text()))
    pd.testing.assert_frame_equal(again.table, paper.table, check_exact=True)


@pytest.mark.parametrize("name", shipped())
def test_every_shipped_scenario_gives_fixes_on_both_fmi_versions(name: str) -> None:
    two = sblcosim.run(name, overrides=SHORT)
    three = sblcosim.run(name, overrides=SHORT, fmi=3)
    assert (two.summary["availability"] > 0.6).all()
    pd.testing.assert_frame_equal(two.table, three.table, check_exact=True)


def test_equal_seeds_give_equal_records_and_different_seeds_do_not() -> None:
    one, same, other = (
        sblcosim.run("harbour-random", overrides={**SHORT, "seed": seed}) for seed in (3, 3, 4)
    )
    pd.testing.assert_frame_equal(one.table, same.table, check_exact=True)
    for column in ("target.position[1]", "acoustics.range[1]", "platform.reported_position[1]"):
        assert (one.table[column] != other.table[column]).mean() > 0.5


def test_receivers_side_by_side_equal_receivers_alone() -> None:
    names = ("ekf", "sequential", "multilateration")
    together = sblcosim.run("realistic-dive", names).table
    for name in names:
        alone = sblcosim.run("realistic-dive", name).table
        own = [column for column in alone if column.startswith(f"{name}.")]
        rest = [column for column in alone if column.startswith(("target.", "acoustics."))]
        assert own
        pd.testing.assert_frame_equal(alone[own], together[own], check_exact=True)
        pd.testing.assert_frame_equal(alone[rest], together[rest], check_exact=True)


def test_a_mapping_gives_receivers_their_labels() -> None:
    both = sblcosim.run("realistic-dive", {"gated": "sequential", "plain": "ekf"})
    assert both.receivers == ("gated", "plain", "raw")
    assert total(both, "gated") != total(both, "plain")


class Anchored:
    """A diver who does not move, in place of the Target."""

    variables = (
        output("position", "", "m", shape=(3,)),
        output("velocity", "", "m/s", shape=(3,)),
        output("depth", "", "m", variability="discrete"),
        output("depth_epoch", "", "s", variability="discrete"),
    )

    def initialise(self, start_ns: int, parameters: Mapping[str, Any]) -> dict[str, Any]:
        return self.do_step(start_ns, 0, {})

    def do_step(self, time_ns: int, step_ns: int, inputs: Mapping[str, Any]) -> dict[str, Any]:
        return {
            "position": (8.0, -3.0, 4.0),
            "velocity": (0.0, 0.0, 0.0),
            "depth": 4.0,
            "depth_epoch": time_ns / 1e9,
        }


def test_a_python_object_can_stand_in_for_a_component() -> None:
    calm = {
        "time": {"duration_s": 10.0},
        "acoustics": {"range_std_m": 0.0},
        "receiver": {"depth_std_m": 0.01, "range_std_m": 0.01},
    }
    result = sblcosim.run(calm, "sequential", components={"target": Anchored})
    assert (result.table["target.position[1]"] == 8.0).all()
    assert result.tracks["sequential"]["error_total_m"].iloc[-1] < 1e-3


def test_a_target_that_does_not_tell_when_its_path_ends_needs_a_duration() -> None:
    with pytest.raises(sblcosim.ConfigurationError, match="duration_s: must be a number"):
        sblcosim.run({}, components={"target": Anchored})


@pytest.mark.parametrize(
    "overrides",
    [
        {"time.ekf_ratio": 4},
        {"target.sampling_time_s": 1.0},
        {"time.sampling_time_s": 0.3},
        {"platform.sampling_time_s": 5.0, "target.interval_s": 0.05},
    ],
)
def test_sensors_channel_and_receiver_may_have_their_own_rates(overrides: dict[str, Any]) -> None:
    result = sblcosim.run("harbour-square", ("ekf", "sequential"), {**SHORT, **overrides})
    assert (result.summary["availability"] > 0.6).all()
    assert total(result, "sequential") < 5.0


def test_a_run_reports_its_progress() -> None:
    shares: list[float] = []
    sblcosim.run("paper-scenario-1", overrides=SHORT, progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_what_a_run_was_given_is_in_its_scenario() -> None:
    changed = sblcosim.run("paper-scenario-1", "sequential", SHORT, fmi=3)
    again = sblcosim.run(changed.scenario)
    assert again.scenario.receiver.type == "sequential"
    assert changed.fmus == again.fmus
    pd.testing.assert_frame_equal(again.table, changed.table, check_exact=True)


def test_a_receiver_in_python_is_told_in_the_folder(tmp_path: Path) -> None:
    class Still:
        """A receiver that believes the diver to be at the origin."""

        variables = tuple(v for v in ESTIMATE if v.name in REQUIRED_ESTIMATE)

        def initialise(self, start_ns: int, parameters: Mapping[str, Any]) -> dict[str, Any]:
            self.count = 0
            return self.do_step(start_ns, 0, {})

        def do_step(self, time_ns: int, step_ns: int, inputs: Mapping[str, Any]) -> dict[str, Any]:
            self.count += 1
            return {"epoch": time_ns / 1e9, "position": (0.0, 0.0, 0.0), "update_count": self.count}

    folder = sblcosim.run("paper-scenario-1", Still, SHORT).save(tmp_path / "run", figures=False)
    receivers = json.loads((folder / "manifest.json").read_text())["receivers"]
    assert [(r["label"], "Still" in r.get("python", "")) for r in receivers] == [
        ("Still", True),
        ("raw", False),
    ]
    assert "Still, was in Python" in (folder / "scenario.toml").read_text().splitlines()[0]
