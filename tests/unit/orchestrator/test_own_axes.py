"""Positions along the axes of a boat with an unknown direction are not taken for north and east."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import log_samples
import numpy as np
import pytest
import sblcosim
from sblcosim.data.estimates import Estimates
from sblcosim.logs.log import Log
from sblcosim.processing.processed import Processed

SAID = "are forward, starboard and down, not north and east: their direction is not in the log"


def read(folder: Path, polls: list[dict[str, Any]], about: str = "") -> Log:
    """The log of a capture."""
    (folder / "dive.jsonl").write_text("".join(json.dumps(it) + "\n" for it in polls))
    (folder / "meta.toml").write_text(about)
    return sblcosim.read_log(folder / "dive.jsonl")


def processed(log: Log) -> Processed:
    """The log with positions of a receiver, without running one."""
    time = log.receptions.epoch_ns[::4]
    own = Estimates(epoch_ns=time, position=np.ones((len(time), 3)))
    return Processed(log=log, scenario=sblcosim.load("harbour-lbl"), made={"it": own, **log.fixes})


def test_a_capture_without_a_direction(tmp_path: Path) -> None:
    log = read(tmp_path, log_samples.polls())
    assert log.meta.frame.own_axes == ("beacons", "acoustic raw")
    assert any(SAID in it and "acoustic raw and the beacons" in it for it in log.remarks)
    found = processed(log)
    assert [*found.agreement.index] == [("it", "acoustic raw")]
    assert {label for label, _ in found.residuals.index} == {"it", "acoustic raw"}
    assert found.remarks[-1] == (
        "it, acoustic raw (forward, starboard) and global (north, east) are not compared, and not "
        "on one map: their axes differ"
    )
    assert [path.name for path in found.paths] == ["global"]
    assert "latitude_deg" in found.tracks["global"]
    assert "latitude_deg" not in found.tracks["it"]
    assert [job.name for job in found.figures][:2] == ["map", "map_own_axes"]
    found.save(tmp_path / "out", figures=False)
    names = [it["properties"]["name"] for it in json.loads(
        (tmp_path / "out" / "path.geojson").read_text())["features"]]
    assert {*names} == {"global"}


def test_a_capture_with_a_direction_is_compared(tmp_path: Path) -> None:
    master = {"lat": log_samples.ORIGIN[0], "lon": log_samples.ORIGIN[1], "orientation": 0.0}
    polls = [
        it for k in range(log_samples.PINGS)
        for it in ({"time_ns": log_samples.time_ns(k) - 1, "path": "position/master",
                    "body": master},)
    ]
    log = read(tmp_path, sorted([*log_samples.polls(), *polls], key=lambda it: it["time_ns"]))
    assert log.meta.frame.own_axes == ()
    found = processed(log)
    assert len(found.agreement) == 3
    assert not any("not compared" in it for it in found.remarks)
    assert [path.name for path in found.paths] == ["it", "acoustic raw", "global"]


def test_beacons_placed_by_hand_are_along_north(tmp_path: Path) -> None:
    places = "\n".join(
        f"R{i} = {list(at)}" for i, at in enumerate(log_samples.BEACONS.values())
    )
    log = read(tmp_path, log_samples.polls(receivers=False), f"[beacons]\n{places}\n")
    assert log.meta.frame.own_axes == ("acoustic raw",)
    assert [*processed(log).agreement.index] == [("it", "global")]
    own = '[frame]\nown_axes = ["beacons", "acoustic raw"]\n'
    log = read(tmp_path, log_samples.polls(receivers=False), f"{own}[beacons]\n{places}\n")
    assert [*processed(log).agreement.index] == [("it", "acoustic raw")]


@pytest.mark.parametrize("place", [True, False])
def test_without_anything_along_north_there_is_no_map_of_the_earth(
    tmp_path: Path, place: bool
) -> None:
    polls = [it for it in log_samples.polls() if it["path"] != "/api/v1/position/global"]
    origin = "[origin]\nlatitude_deg = 60.0\nlongitude_deg = 5.0\n"
    found = processed(read(tmp_path, polls, origin if place else ""))
    folder = found.save(tmp_path / "out", trajectories="tum")
    names = {path.name for path in folder.iterdir()}
    assert {"map_own_axes.png", "path-it.tum", "path-acoustic_raw.tum"} <= names
    assert not {"path.geojson", "path.kml", "path.gpx", "map.png"} & names
    said = "there are no files for maps: no position is along north and east"
    assert (said in found.remarks) == place


def test_an_excerpt_of_positions(tmp_path: Path) -> None:
    for name, text in log_samples.excerpt().items():
        (tmp_path / name).write_text(text)
    found = sblcosim.process(tmp_path)
    assert len(found.agreement) == 0
    assert "There is no truth, and nothing to compare the estimates with." in found.text()
    assert "acoustic, own axes (forward, starboard) and global (north" in found.remarks[-1]
    axes = {job.name: job for job in found.figures}
    assert [*axes] == ["map", "map_own_axes"]


def test_axes_of_maps_say_what_they_are(tmp_path: Path) -> None:
    from sblcosim.processing.figures import plot_map

    found = processed(read(tmp_path, log_samples.polls()))
    north, own = (plot_map(*found.on_map(own_axes)) for own_axes in (False, True))
    assert north.get_xlabel() == "East y [m]"
    assert own.get_ylabel() == "Forward x [m]"
    labels = [{text.get_text() for text in ax.figure.legends[0].get_texts()} for ax in (north, own)]
    assert labels == [{"global"}, {"beacons", "it", "acoustic raw"}]
