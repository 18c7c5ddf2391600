"""A recorded dive in a page has the estimates of `sblcosim process`, to the last bit."""

from __future__ import annotations

import base64
import json
import re
import shlex
import subprocess
import sys
import zlib
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from explored import NEEDS, answers
from made_logs import CORNERS, changed, made, written
from quick import few, one_in
from sblcosim import ConfigurationError, listings, process, read_log
from sblcosim.explore.contents import contents
from sblcosim.explore.page import write_dive
from sblcosim.logs.folder import write
from sblcosim.logs.log import Log
from sblcosim.models import RECEIVERS
from sblcosim.processing.dive import recorded_dive
from sblcosim.processing.processed import Processed
from sblcosim.scenario.scenario import load
from sblcosim.web.playback import factor_of
from seams import Seam

pytestmark = NEEDS
ALL = (*RECEIVERS,)
FEW = ("long_baseline", "ekf")


@pytest.fixture(scope="module")
def told() -> Mapping[str, Any]:
    """A page with all receivers, of a scenario that is that of no log here."""
    return contents(load("realistic-dive", {"acoustics.range_std_m": 0.7}), ALL, lanes=(2,))


def replayed(
    told: Mapping[str, Any], folder: Path, log: Any, receivers: tuple[str, ...],
    given: Mapping[str, Any] | None = None, chosen: tuple[str, ...] | None = None, **asked: Any,
) -> dict[str, Any]:
    """What the page makes of a log that was prepared for some receivers, with changed settings."""
    found = recorded_dive(log, receivers, **asked)
    file = write_dive(found.scenario, folder / "dive.json", receivers, found)
    job = {"file": str(file), "given": given or {}, "receivers": chosen or receivers}
    (answer,) = answers(told, [{"replay": job}], folder)
    return answer["replay"]  # type: ignore[no-any-return]


def same_estimates(found: Mapping[str, Any], expected: Processed) -> int:
    """Compare all that is drawn of the receivers; the number of estimates."""
    assert "run" in found, found
    shown = {it["label"]: it for it in found["run"]["receivers"]}
    assert shown.keys() == expected.made.keys()
    start, count = expected.log.start_ns, 0
    for label, own in expected.made.items():
        mine = shown[label]
        for name, times in (("epoch", own.epoch_ns), ("since", own.available_ns),
                            ("until", own.until_ns)):
            assert times is not None
            times_s = np.array(mine[name], float)
            np.testing.assert_array_equal(np.rint(times_s * 1e9), times - start, f"{label} {name}")
        np.testing.assert_array_equal(axes(mine["position"]), own.position, err_msg=label)
        factor = factor_of(own)
        assert factor is not None
        rows, columns = (0, 1, 1, 2, 2, 2), (0, 0, 1, 0, 1, 2)
        np.testing.assert_array_equal(
            np.array(mine["factor"], float).T.reshape(-1, 6), factor[:, rows, columns])
        count += len(own)
    return count


def axes(track: Mapping[str, Any]) -> np.ndarray[Any, Any]:
    return np.array([track[axis] for axis in "xyz"], float).T


# --- Simulated dives ------------------------------------------------------------------------------


@pytest.mark.parametrize("scenario", few(
    listings.scenarios(), quick=["usbl-boat"]))
def test_every_simulated_dive_has_its_own_estimates(
    scenario: str, told: Mapping[str, Any], tmp_path: Path
) -> None:
    """In the page of another scenario, whose settings are replaced by those of the log.

    Temperatures of the water are only in the page of their own scenario.
    """
    _, log = written(tmp_path / "run", scenario, [*ALL])
    found = replayed(told, tmp_path, log, ALL)
    if "acoustics.temperature_C" in contents(load(scenario), ALL, lanes=(2,))["given"]:
        assert "temperature_C: must be that of the scenario in a page" in found["refused"]
        found = replayed(contents(load(scenario), ALL, lanes=(2,)), tmp_path, log, ALL)
    assert same_estimates(found, process(log, ALL)) > 1000


CHANGES: tuple[Mapping[str, Any], ...] = (
    {"acoustics.range_std_m": 0.4, "acoustics.outlier_probability": 0.2},
    {"platform.gps_grade": "rtk_fixed", "acoustics.assumed_sound_speed_m_s": 1520.0},
    {"receiver.initialisation": "prior", "receiver.prior_position_m": [1.0, 2.0, 3.0]},
    {"receiver.prior": "true"},
)


@pytest.mark.parametrize("given", CHANGES)
def test_changed_settings_are_those_of_overrides(
    given: Mapping[str, Any], told: Mapping[str, Any], tmp_path: Path
) -> None:
    keys = {"time.duration_s": 60.0}
    _, log = written(tmp_path / "run", "realistic-dive", ["coupled"], overrides=keys)
    receivers = ("coupled", "ekf", "fixed_lag")
    found = replayed(told, tmp_path, log, ("coupled",), given, receivers)
    same_estimates(found, process(log, receivers, given.items()))
    words = shlex.split(found["command"]["text"])
    sets = [words[i + 1] for i, word in enumerate(words) if word == "--set"]
    assert words[:3] == ["sblcosim", "process", str(log)]
    same_estimates(found, process(log, receivers, sets))
    with pytest.raises(AssertionError):
        same_estimates(found, process(log, receivers))


def test_a_key_that_is_taken_away_needs_the_file_of_the_page(
    told: Mapping[str, Any], tmp_path: Path
) -> None:
    keys = {"time.duration_s": 60.0}
    _, log = written(tmp_path / "run", "realistic-dive", ["coupled"], overrides=keys)
    found = replayed(told, tmp_path, log, ("coupled",), {"acoustics.outlier_probability": None})
    assert found["command"] == {
        "file": True, "text": f"sblcosim process {log} --receiver coupled",
        "changed": ["acoustics.outlier_probability"],
    }
    (log / "scenario.toml").write_text(found["toml"])
    same_estimates(found, process(log, "coupled"))


def test_an_update_interval_for_which_a_dive_was_not_prepared_is_refused(
    told: Mapping[str, Any], tmp_path: Path
) -> None:
    keys = {"time.duration_s": 40.0}
    _, log = written(tmp_path / "run", "realistic-dive", ["ekf"], overrides=keys)
    found = replayed(told, tmp_path, log, ("ekf",), {"time.ekf_ratio": 4})
    assert found["wrong"].startswith("[receiver] update_interval_s: must be 1 s, for which")
    again = replayed(told, tmp_path, log, ("ekf",), overrides={"time.ekf_ratio": 4})
    same_estimates(again, process(log, "ekf", {"time.ekf_ratio": 4}))
    assert "--set time.ekf_ratio=4" in again["command"]["text"]


# --- Logs of devices ------------------------------------------------------------------------------


def faulty(folder: Path) -> Log:
    """A gap, repeated lines, lines out of order, short ranges, two in an interval, no truth."""
    log = changed(made(truth=False), [50, 161], -30.0)
    heard = log.receptions
    kept = (heard.arrival_ns < 100e9) | (heard.arrival_ns > 130e9)
    times = heard.arrival_ns.copy()
    times[203:] -= 4_100_000_000
    log = replace(log, receptions=replace(heard, arrival_ns=times, epoch_ns=times).chosen(kept))
    folder.mkdir()
    write(log, folder)
    file = folder / "receptions.csv"
    lines = file.read_text().splitlines()
    file.write_text("\n".join([*lines[:40], *lines[30:40], *lines[40:]]) + "\n")
    return read_log(folder)


def of_buoys() -> Log:
    log = made(seconds=200)
    place = log.receptions.beacon_position + np.sin(np.arange(200) / 30)[:, None] * [1.0, 0.5, 0.0]
    return replace(log, receptions=replace(log.receptions, beacon_position=place))


def silent() -> Log:
    """A minute without anything, a truth with one more gap, and an end after the last range."""
    log = made(meta={"stop_ns": 320_000_000_000})
    assert log.truth is not None

    def outside(times: Any) -> Any:
        return (times < 100e9) | (times > 160e9)

    kept, deep = outside(log.receptions.arrival_ns), outside(log.depth_ns)
    known = log.truth.time_ns
    truth = outside(known) & ((known < 200e9) | (known > 215e9))
    return replace(
        log, receptions=log.receptions.chosen(kept), depth_ns=log.depth_ns[deep],
        depth=log.depth[deep],
        truth=replace(log.truth, time_ns=log.truth.time_ns[truth],
                      position=log.truth.position[truth]),
    )


LINE = np.array([[40.0, 0, 8], [0, 0, 8], [-40, 0, 8], [80, 0, 8]])
"""Beacons on a line, off which the raw fix knows next to nothing."""
LOGS: Mapping[str, Callable[[Path], Log]] = {
    "faulty": faulty,
    "silent": lambda _: silent(),
    "plane": lambda _: made(plane=True, seconds=200),
    "far": lambda _: made(origin=(6_054_000.0, 448_000.0, 0.0), start_s=1.7e9, seconds=200),
    "line": lambda _: made(beacons=LINE, seconds=200),
    "buoys": lambda _: of_buoys(),
    "slow truth": lambda _: made(meta={"clock": {"truth": {"offset_s": 3.5}}}),
    "own clock": lambda _: made(meta={"clock": {"truth": "estimate"}}, seconds=200),
}


@pytest.mark.parametrize("name", LOGS)
@one_in(2)
def test_logs_of_devices_have_the_estimates_of_process(
    name: str, told: Mapping[str, Any], tmp_path: Path
) -> None:
    log, receivers = LOGS[name](tmp_path / "log"), (*FEW, "coupled", "fixed_lag")
    expected = process(log, receivers)
    found = replayed(told, tmp_path, log, receivers)
    assert same_estimates(found, expected) > 500
    same_tables(found["tables"], expected)
    assert {*found["said"]} <= {*expected.remarks}
    if name == "faulty":
        assert any("after the last range" in it for it in expected.remarks)
        assert sum("left out" in it for it in found["said"]) == 2
        assert any("waited for the next update" in it for it in found["said"])
        assert found["run"]["diver"] is None
    if name == "line":
        assert any("whose claimed deviation" in it for it in expected.remarks)
    given = {"acoustics.range_std_m": 0.35, "target.depth_std_m": 0.2}
    other = replayed(told, tmp_path, log, FEW, given)
    same_estimates(other, process(log, FEW, given))
    assert f"--scenario {told['name']}.toml" in other["command"]["text"]
    file = tmp_path / f"{told['name']}.toml"
    file.write_text(other["toml"])
    same_estimates(other, process(log, FEW, scenario=file))


def same_tables(found: Mapping[str, Any], expected: Processed) -> None:
    for label, row in expected.receivers.iterrows():
        names = {"n": "estimates", "first": "first_fix_s", "claimed": "claimed_rms_m"}
        if expected.truth is not None:
            kind = "horizontal" if expected.log.meta.dimension == 2 else "total"
            names |= {"judged": "judged", "rms": f"{kind}_rms_m", "p95": f"{kind}_p95_m",
                      "horizontal": "horizontal_rms_m"}
        same_numbers(found["receivers"][label], row, names)
    for (label, sample), row in expected.residuals.iterrows():
        names = {"n": "n", "offset": "offset_m", "std": "std_m"}
        same_numbers(found["residuals"][label][sample], row, names)
    for pair in found["agreement"]:
        row = expected.agreement.loc[(pair["receiver"], pair["other"])]
        same_numbers(pair, row, {"n": "n", "horizontal": "horizontal_rms_m", "most": "max_m"})


def same_numbers(found: Mapping[str, Any], row: Any, names: Mapping[str, str]) -> None:
    mine = [np.nan if found[name] is None else found[name] for name in names]
    theirs = [float(row[name]) for name in names.values()]
    np.testing.assert_allclose(mine, theirs, rtol=1e-6, atol=1e-6, err_msg=str([*names]))


def test_differences_of_arrivals_are_replayed(told: Mapping[str, Any], tmp_path: Path) -> None:
    keys = {"acoustics.ranging": "inverted", "acoustics.common_clock": False,
            "time.duration_s": 100.0}
    _, log = written(tmp_path / "run", "realistic-dive", ["coupled"], overrides=keys)
    receivers = ("coupled", "sequential")
    found = replayed(told, tmp_path, log, receivers)
    expected = process(log, receivers)
    same_estimates(found, expected)
    same_tables(found["tables"], expected)
    wrong = replayed(told, tmp_path, log, receivers, {"acoustics.common_clock": True})
    assert "differences of arrivals" in wrong["wrong"]


@pytest.mark.slow
def test_more_beacons_than_places_and_fewer(tmp_path: Path) -> None:
    for count, receiver in ((3, "coupled"), (10, "sequential")):
        angles = np.linspace(0, 6, count)
        beacons = np.stack([40 * np.cos(angles), 40 * np.sin(angles), 10 + angles], axis=1)
        log = made(beacons=beacons)
        page = contents(load("realistic-dive"), (receiver,), [min(count, 8)], lanes=(2,))
        same_estimates(replayed(page, tmp_path, log, (receiver,)), process(log, receiver))
    arms = [[3.0, 0.0, 1.0], [0.0, 3.0, 1.0], [0.0, -3.0, 1.0]]
    page = contents(load("realistic-dive"), ("coupled",), [3], lanes=(2,))
    found = replayed(page, tmp_path, made(), ("coupled",), {
        "platform.beacons": 3, "platform.beacon_m": arms,
    })  # fmt: skip
    assert found["wrong"].endswith("must be as many as in the recorded dive, 4, got 3")


def test_a_page_without_the_beacons_of_a_log_says_so(
    told: Mapping[str, Any], tmp_path: Path
) -> None:
    found = replayed(told, tmp_path, made(beacons=CORNERS[:3]), FEW)
    assert found["refused"] == "[platform] beacons: must be one of 4 in this page, got 3"


# --- Files ----------------------------------------------------------------------------------------


def test_files_that_are_none_or_damaged_are_refused(
    told: Mapping[str, Any], tmp_path: Path
) -> None:
    found = recorded_dive(made(seconds=40), FEW)
    file = write_dive(found.scenario, tmp_path / "dive.json", FEW, found)
    good = json.loads(file.read_text())
    data = good["data"]
    files = {
        "receptions.csv": "arrival_ns,epoch_ns\n", "": "", "[1, 2]": "[1, 2]", "null": "null",
        "cut": file.read_text()[:300], "other": json.dumps({**good, "format": "sblcosim dive 2"}),
        "damaged": json.dumps({**good, "data": f"{data[:400]}{data[404:]}"}),
        "short": json.dumps({**good, "data": data[:400]}),
        "changed": json.dumps({**good, "data": f"{data[:800]}AAAA{data[804:]}"}),
    }
    jobs = []
    for i, text in enumerate(files.values()):
        (tmp_path / f"{i}.json").write_text(text)
        jobs.append({"replay": {"file": str(tmp_path / f"{i}.json")}, "ask": ["link"]})
    for name, answer in zip(files, answers(told, jobs, tmp_path), strict=True):
        words = answer["replay"]["wrong"]
        assert words.startswith("must be a recorded dive as 'sblcosim explore --log LOG"), name
        assert "\n" not in words
        assert answer["link"] == ""
    ends = [it["replay"]["wrong"].rpartition(", got ")[2] for it in answers(told, jobs, tmp_path)]
    assert ends == [
        *["a file of another kind"] * 2, "other content", "a file of another kind",
        "a file of another kind", "the format 'sblcosim dive 2'", *["a damaged one"] * 3,
    ]


def test_equal_logs_give_equal_files(tmp_path: Path) -> None:
    texts = set()
    for name in ("one.json", "two.json"):
        found = recorded_dive(made(seconds=40), FEW)
        texts.add(write_dive(found.scenario, tmp_path / name, FEW, found).read_text())
    assert len(texts) == 1


def test_a_log_that_is_too_long_for_a_page_is_refused(seam: Seam) -> None:
    seam.tuned(dive_instants=30)
    with pytest.raises(ConfigurationError, match="must have 3 to 30 instants with something new"):
        recorded_dive(made(seconds=40))


def test_the_command_writes_a_dive_and_a_page_with_it(tmp_path: Path) -> None:
    _, log = written(tmp_path / "run", "harbour-square", ["ekf"])
    command = [sys.executable, "-m", "sblcosim", "explore", "--log", str(log), "--no-open"]
    for file in ("dive.json", "page.html"):
        done = subprocess.run([*command, "--beacons", "4", "--out", file], cwd=tmp_path,
                              capture_output=True, text=True, check=True)
        assert done.stdout == f"written to {file}\n"
    alone = json.loads((tmp_path / "dive.json").read_text())
    text = (tmp_path / "page.html").read_text("utf-8")
    (held,) = re.findall('id="contents">(.*?)</script>', text)
    contents_of = zlib.decompress(base64.b64decode(json.loads(held)["packed"]))
    assert json.loads(contents_of)["dive"] == alone
    wrong = subprocess.run([*command, "--out", "page.txt"], cwd=tmp_path, capture_output=True,
                           text=True)
    assert wrong.returncode == 2
    assert "explore: must be a file .html" in wrong.stderr
