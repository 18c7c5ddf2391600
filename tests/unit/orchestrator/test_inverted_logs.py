"""Logs say how ranges were measured: one-way, two-way, inverted, or differences of arrivals."""

from __future__ import annotations

import shutil
import warnings
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import sblcosim
from made_logs import made, written
from sblcosim import process
from sblcosim.errors import ConfigurationError
from sblcosim.identification.run import identify
from sblcosim.logs.contents import contents_of
from sblcosim.logs.log import Log
from sblcosim.scenario.scenario import load, shipped

BOAT = "usbl-boat"
UNTIMED = {"acoustics.common_clock": False}
KINDS = {"one_way": "one-way", "two_way": "two-way", "inverted": "inverted"}


@cache
def dive(folder: Path, seconds: float, timed: bool = True) -> tuple[Any, Path]:
    """A run off the USBL's boat, and its log."""
    keys = {"time.duration_s": seconds, **({} if timed else UNTIMED)}
    return written(folder, BOAT, ["array"], overrides=keys)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("dives")


@pytest.mark.parametrize("name", shipped())
def test_the_log_of_a_shipped_scenario_says_how_its_ranges_were_measured(
    name: str, tmp_path: Path
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        seconds = 4 * load(name).time.sampling_time_s
        _, log = written(tmp_path / "run", name, ["multilateration"],
                         overrides={"time.duration_s": seconds, "acoustics.loss_probability": 0.0,
                                    "acoustics.loss_burst_length": 1.0})
    kind = KINDS[load(name).acoustics.ranging]
    found = sblcosim.read_log(log)
    assert found.kinds == {kind: 1.0}
    assert not found.findings
    columns = pd.read_csv(log / "receptions.csv").columns
    assert ("kind" in columns) == (kind != "one-way")


@pytest.mark.parametrize("timed", [True, False])
def test_processing_gives_the_estimates_of_the_run_to_the_bit(timed: bool, folder: Path) -> None:
    run, log = dive(folder / str(timed), 30.0, timed)
    processed = process(log, ["array"])
    for label in run.receivers:
        own, again = run.record.estimates(label).columns(), processed.made[label].columns()
        assert len(own["epoch_ns"]) > 20
        for name, values in own.items():
            assert np.array_equal(values, again[name], equal_nan=True), (label, name)


def test_residuals_of_differences_are_beside_the_middle_of_the_beacons(folder: Path) -> None:
    _, log = dive(folder / "False", 30.0, False)
    processed = process(log, ["array"])
    rows = processed.residuals.loc["array"].drop("depth")
    assert rows.offset_m.abs().max() < 0.002  # arrivals are told to 1 mm
    assert rows.std_m.max() < 0.003
    assert not any("do not fit" in line for line in processed.remarks)
    heard = processed.log.receptions
    bare = replace(processed.log, receptions=replace(heard, packet=0 * heard.packet))
    from sblcosim.processing.quality import residuals

    alike = residuals(bare, {"array": processed.made["array"]}).loc["array"].drop("depth")
    assert alike.offset_m.to_numpy() == pytest.approx(rows.offset_m.to_numpy(), abs=1e-4)


@pytest.mark.parametrize(("timed", "words"), [
    (True, " inverted ranges of 4 beacons, "), (False, " differences of arrivals of 4 beacons, "),
])
def test_what_is_in_a_log_says_so(timed: bool, words: str, folder: Path, tmp_path: Path) -> None:
    _, log = dive(folder / str(timed), 30.0, timed)
    found = sblcosim.log(log)
    kind = "inverted" if timed else "difference"
    assert words in found.answer
    assert found.to_json()["kinds"] == {kind: 1.0}
    again = sblcosim.read_log(found.save(tmp_path / "out", figures=False, log=True) / "log")
    assert again.kinds == found.log.kinds
    assert again.sha256() == found.log.sha256()
    assert again.receptions.range.min() < 0.0 or timed


def test_the_word_is_part_of_the_log_and_the_default_is_not() -> None:
    plain = made(seconds=20)
    assert plain.kinds == {"one-way": 1.0}
    assert " 20 ranges of" in contents_of(plain).answer
    number = np.zeros(len(plain.receptions), np.intp)
    mixed = replace(plain, receptions=replace(plain.receptions, kind=number + [1, 4] * 10))
    assert " 20 ranges (50 % two-way, 50 % inverted) of" in contents_of(mixed).answer
    assert mixed.sha256() != plain.sha256()


def _table(folder: Path, kind: str, rows: list[str], head: str) -> Log:
    folder.mkdir()
    lines = [f"{head},kind", *(f"{row},{kind}" for row in rows)]
    (folder / "receptions.csv").write_text("\n".join(lines) + "\n")
    places = [f"{name} = [{n}, {e}, 1]" for name, n, e in (("a", 0, 0), ("b", 3, 0), ("c", 0, 3))]
    (folder / "meta.toml").write_text("\n".join(["dimension = 2", "[beacons]", *places]) + "\n")
    return sblcosim.read_log(folder)


def test_the_epoch_is_the_mean_arrival_of_a_ping(tmp_path: Path) -> None:
    rows = ["1000,a,15,1", "1600,b,15,1", "1003,c,15,1", "9000,a,15,2", "9100,b,15,"]
    log = _table(tmp_path / "log", "inverted", rows, "arrival_ns,beacon,range_m,ping")
    heard = log.receptions
    assert heard.epoch_ns.tolist() == [1201, 1201, 1201, 9000, 9100]
    assert heard.arrival_ns.tolist() == [1000, 1003, 1600, 9000, 9100]
    one = _table(tmp_path / "one", "one-way", rows, "arrival_ns,beacon,range_m,ping")
    assert (one.receptions.arrival_ns - one.receptions.epoch_ns == 10_000_000).all()


@pytest.mark.parametrize(("kind", "used"), [("inverted", 2), ("difference", 3)])
def test_only_a_difference_may_be_negative(kind: str, used: int, tmp_path: Path) -> None:
    rows = ["1000,a,0.1", "1001,b,-0.2", "1003,c,0.1"]
    log = _table(tmp_path / "log", kind, rows, "arrival_ns,beacon,range_m")
    assert len(log.receptions) == used


def _bare(log: Path, folder: Path) -> Path:
    """The log without its scenario."""
    shutil.copytree(log, folder)
    for name in ("scenario.toml", "manifest.json"):
        (folder / name).unlink()
    return folder


def test_differences_need_a_scenario_that_has_them(folder: Path, tmp_path: Path) -> None:
    _, log = dive(folder / "False", 30.0, False)
    bare = _bare(log, tmp_path / "bare")
    for act in (process, identify):
        with pytest.raises(ConfigurationError, match="must come with a scenario, as its diff") as e:
            act(bare)
        assert "\n" not in str(e.value)
    with pytest.raises(ConfigurationError, match=f"{BOAT}: must have acoustics.ranging = 'inve"):
        process(bare, scenario=BOAT)
    made_by = process(bare, ["array"], scenario=BOAT, overrides=UNTIMED)
    assert len(made_by.made["array"]) > 10


def test_differences_do_not_tell_their_device(folder: Path) -> None:
    run, log = dive(folder / "False", 30.0, False)
    for source in (run, log):
        with pytest.raises(ConfigurationError, match="to tell its device, got differences of"):
            identify(source)


def test_what_arrivals_share_is_not_in_a_log(folder: Path) -> None:
    _, log = dive(folder / "60", 60.0)
    found = identify(log)
    assert any("not in this log: how much of the noise all arrivals" in it for it in found.remarks)
    assert "acoustics.range_std_m" not in found.overrides()
    acoustics = found.scenario().acoustics
    assert (acoustics.range_std_m, acoustics.range_common_std_m) == (0.001, 0.1)


def test_an_inverted_log_writes_the_ranging_into_its_scenario(folder: Path, tmp_path: Path) -> None:
    keys = {"acoustics.ranging": "inverted", "time.duration_s": 200.0,
            "time.sampling_time_s": 1.0}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        _, log = written(tmp_path / "run", "harbour-lbl", ["multilateration"], overrides=keys)
        found = identify(_bare(log, tmp_path / "bare"))
    a = found.scenario().acoustics
    assert a.ranging == "inverted"
    noise = load("harbour-lbl").acoustics.range_std_m
    assert a.range_std_m == pytest.approx(noise, rel=0.25)
    # Arms of five centimetres tell no path, and the answer says so.
    usbl = identify(_bare(dive(folder / "60", 60.0)[1], tmp_path / "usbl"))
    assert any("path is not from the log" in it for it in usbl.remarks)
