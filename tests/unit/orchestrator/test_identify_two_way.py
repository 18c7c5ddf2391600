"""Two-way ranges of a log are identified as such: ranging, noise, losses of legs, turn-around."""

from __future__ import annotations

import warnings
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sblcosim
from made_logs import made
from sblcosim.errors import ConfigurationError
from sblcosim.identification.run import identify

KEYS = {"acoustics.ranging": "two_way", "acoustics.turnaround_s": 0.05,
        "acoustics.loss_probability": 0.15}


@cache
def found(**changes: Any) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        more = {k.replace("__", "."): v for k, v in changes.items()}
        run = sblcosim.run("harbour-lbl", overrides={**KEYS, **more})
        return identify(run)


def test_a_two_way_run_gives_its_device_back() -> None:
    """The share of lost ranges is that of both legs, 1 - 0.85²; the key is that of one."""
    answer = found(acoustics__turnaround_std_s=1e-4)
    it = {n.parameter: n for n in answer.device.numbers}
    noise = np.hypot(0.1, 1500 / 2 * 1e-4)
    assert it["range_std"].low < noise < it["range_std"].high
    assert it["loss_share"].low < 1 - 0.85**2 < it["loss_share"].high
    scenario = answer.scenario()
    a = scenario.acoustics
    assert a.ranging == "two_way"
    assert a.loss_probability == pytest.approx(0.15, abs=0.04)
    assert np.hypot(a.range_std_m, 750 * a.turnaround_std_s) == pytest.approx(noise, rel=0.1)
    assert "acoustics.clock_offset_s" not in answer.overrides()
    idle = {key for key in answer.overrides() if tuple(key.split(".")) in scenario.idle()}
    assert idle <= {"acoustics.outlier_mean_m"}


def test_a_delay_of_answers_is_found_as_one() -> None:
    """3e-3 s is 2.25 m in every range."""
    a = found(acoustics__processing_delay_s=3e-3).scenario().acoustics
    net = a.processing_delay_s - a.processing_delay_correction_s
    assert net == pytest.approx(3e-3, abs=1e-3)


def test_bursts_of_ranges_become_those_of_a_leg() -> None:
    answer = found(acoustics__loss_burst_length=6.0, acoustics__loss_probability=0.2, seed=3)
    burst = answer.overrides()["acoustics.loss_burst_length"]
    assert 3.5 < burst < 10.0
    assert answer.scenario().acoustics.loss_burst_length == burst


def log_of(folder: Path, kinds: str) -> Any:
    """A log of times of flight; ``kinds`` is one letter for each range, t or o."""
    folder.mkdir()
    source = made(seconds=200, truth=False)
    heard = source.receptions
    wait = 0.05
    rows = ["epoch_ns,beacon,time_of_flight_s,turn_around_s,kind"]
    for i in range(len(heard)):
        two = kinds[i % len(kinds)] == "t"
        flight = heard.range[i] / 1500
        rows.append(
            f"{heard.epoch_ns[i]},{source.beacons[heard.beacon[i]]},"
            f"{2 * flight + wait if two else flight:.9f},{wait},{'two-way' if two else 'one-way'}"
        )
    (folder / "receptions.csv").write_text("\n".join(rows) + "\n")
    depth = [f"{t},{d}" for t, d in zip(source.depth_ns, source.depth, strict=True)]
    (folder / "depth.csv").write_text("\n".join(["time_ns,depth_m", *depth]) + "\n")
    places = [f'"{name}" = {heard.beacon_position[heard.beacon == i][0].tolist()}'
              for i, name in enumerate(source.beacons)]
    (folder / "meta.toml").write_text("\n".join(["[beacons]", *places]) + "\n")
    return sblcosim.read_log(folder)


def test_a_log_of_round_trips_writes_the_ranging_into_its_scenario(tmp_path: Path) -> None:
    log = log_of(tmp_path / "log", "t")
    assert (log.kinds, log.turnaround_s) == ({"two-way": 1.0}, pytest.approx(0.05))
    scenario = identify(log).scenario()
    assert scenario.acoustics.ranging == "two_way"
    assert scenario.acoustics.turnaround_s == pytest.approx(0.05)
    assert scenario.acoustics.turnaround_bias_std_s > 0
    one = identify(log_of(tmp_path / "one", "o")).scenario()
    assert one.acoustics.ranging == "one_way"
    assert one.acoustics.range_std_m == pytest.approx(scenario.acoustics.range_std_m, rel=1e-3)


def test_a_scenario_of_others_gets_the_ranging_of_the_log(tmp_path: Path) -> None:
    log = log_of(tmp_path / "log", "t")
    base = sblcosim.load("harbour-lbl")
    assert identify(log, scenario=base).scenario().acoustics.ranging == "two_way"


def test_a_log_of_both_kinds_is_refused_in_one_line(tmp_path: Path) -> None:
    log = log_of(tmp_path / "log", "tto")
    with pytest.raises(ConfigurationError, match="must have ranges of one kind") as caught:
        identify(log)
    assert "\n" not in str(caught.value)
    assert "67 % two-way ranges" in str(caught.value)
    assert identify(log, scenario="harbour-lbl").scenario().acoustics.ranging == "one_way"
