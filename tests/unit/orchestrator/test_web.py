"""What a page that plays a run back holds: the run's own numbers, in few bytes."""

from __future__ import annotations

import json
import re
import zlib
from base64 import b64decode, b64encode
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sblcosim
from made_logs import CORNERS, made
from sblcosim import ConfigurationError, Result, process
from sblcosim.data.estimates import Estimates
from sblcosim.data.record import Record
from sblcosim.data.truth import of_record
from sblcosim.explore import page as explorer
from sblcosim.judge.definitions import of_position
from sblcosim.judge.metrics import intact
from sblcosim.processing import pages
from sblcosim.processing.dive import PreparedDive
from sblcosim.scenario.scenario import load
from sblcosim.web import bundle, columns, page, playback
from seams import Seam
from shapes import SHAPES, run_of

BYTES = 1_000_000
"""Of ten minutes with four receivers."""


@pytest.fixture(scope="module")
def result() -> Result:
    return sblcosim.run("paper-scenario-1", overrides={"time.duration_s": 5.0})


def read_back(text: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """The content of a page, and its columns."""
    found = re.search(r'<script type="application/json" id="run">(.*?)</script>', text, re.DOTALL)
    assert found
    told = json.loads(found[1])
    return told, columns.unpacked(told["data"], dict(told["columns"]))


@pytest.mark.parametrize("seed", range(5))
def test_columns_of_any_integers_are_read_back(seed: int) -> None:
    draw = np.random.default_rng(seed)
    ends = 2**31 - 1
    own = {
        f"column {i}": draw.integers(-ends, draw.integers(2 - ends, ends), size)
        for i, size in enumerate(draw.integers(0, 50, 6))
    }
    own["ends"] = np.array([-ends - 1, ends, 0, -ends - 1, -1, ends])
    back = columns.unpacked(columns.packed(own), {name: len(it) for name, it in own.items()})
    assert {*back} == {*own}
    for name, it in own.items():
        np.testing.assert_array_equal(back[name], it)


def test_thousandths_are_rounded_and_what_is_unknown_or_too_large_is_kept_apart() -> None:
    given = np.array([0.0004, -0.0006, 1.2345678, np.nan, np.inf, 1e12, -1e12])
    largest = 2**31 - 1
    expected = [0, -1, 1235, columns.MISSING, columns.MISSING, largest, -largest]
    assert columns.milli(given).tolist() == expected
    assert columns.unpacked(columns.packed({}), {}) == {}


@pytest.mark.parametrize("seed", [1, 11])
@pytest.mark.parametrize("scenario", ["paper-scenario-1", "realistic-dive", "gps-buoys"])
def test_the_data_of_a_page_are_those_of_the_run(scenario: str, seed: int, tmp_path: Path) -> None:
    result = sblcosim.run(scenario, overrides={"time.duration_s": 30.0, "seed": seed})
    text = result.replay(tmp_path / "replay.html").read_text("utf-8")
    told, back = read_back(text)
    assert f"seed = {seed}" in text.partition("<pre")[2]  # the scenario, as a file
    values = result.record.values
    np.testing.assert_allclose(back["time"] / 1e3, result.record.time_ns / 1e9, atol=5.1e-4)

    def check(name: str, points: Any) -> None:
        for i, axis in enumerate("xyz"):
            np.testing.assert_allclose(back[f"{name}.{axis}"] / 1e3, points[:, i], atol=5.1e-4)

    check("diver", values["target.position"])
    for i in range(told["beacons"]):
        check(f"beacon.{i}", values["platform.beacon_position"][:, i])
        check(f"reported.{i}", values["platform.reported_beacon_position"][:, i])
    assert told["beacons"] == values["platform.beacon_position"].shape[1]
    assert [it["label"] for it in told["receivers"]] == [*result.receivers]
    assert told["arms"] == (scenario != "gps-buoys")
    for i, judged in enumerate(result.judged.values()):
        for name, times in (("epoch", judged.estimates.epoch_ns), ("since", judged.since_ns),
                            ("until", judged.until_ns)):  # fmt: skip
            np.testing.assert_allclose(back[f"{i}.{name}"] / 1e3, times / 1e9, atol=5.1e-4)
        check(f"{i}", judged.estimates.position)
        check(f"{i}.true", judged.true_position)
        L = np.zeros((len(judged.epoch_s), 3, 3))
        L[:, (0, 1, 1, 2, 2, 2), (0, 0, 1, 0, 1, 2)] = np.column_stack(
            [back[f"{i}.L{k}"] / 1e3 for k in range(6)]
        )
        P = of_position(judged.estimates.covariance)
        L[back[f"{i}.L0"] == columns.MISSING] = np.nan
        known = np.isfinite(L).all(axis=(1, 2))
        assert (known == ~np.isnan(judged.nees)).all()
        close = 2e-3 * np.sqrt(np.abs(P[known]).max()) + 1e-6
        np.testing.assert_allclose((L @ L.mT)[known], P[known], atol=close)


def test_a_covariance_that_is_none_claims_nothing() -> None:
    some = np.eye(6)[None] * np.array([4.0, -1.0, np.nan])[:, None, None]
    own = Estimates(epoch_ns=np.arange(3), position=np.zeros((3, 3)), covariance=some)
    factor = playback.factor_of(own)
    assert factor is not None
    np.testing.assert_array_equal(factor[0], 2 * np.eye(3))
    assert np.isnan(factor[1:]).all()
    alone = Estimates(epoch_ns=np.arange(1), position=np.zeros((1, 3)),
                      position_std=np.array([[1.0, 2, 3]]))  # fmt: skip
    np.testing.assert_array_equal(playback.factor_of(alone), [np.diag([1.0, 2, 3])])
    silent = Estimates(epoch_ns=np.arange(1), position=np.zeros((1, 3)))
    assert playback.factor_of(silent) is None


def noisy(n: int, receivers: int, beacons: int = 4) -> playback.Playback:
    """A run of n instants with noise in everything, also in its covariances."""
    draw = np.random.default_rng(n)
    time_ns = np.arange(n) * 10**8
    t = time_ns[:, None] / 1e9
    path = 20 * np.sin(t / [30.0, 41, 97])
    arms = 3 * draw.standard_normal((beacons, 3))
    waves = 0.3 * np.sin(t[:, None] * [1.3, 1.7, 1.1] + draw.uniform(0, 6, (beacons, 3)))
    reported = path[:, None] + arms + waves + 0.5 * draw.standard_normal((n, 1, 3))
    lower = np.tril(draw.uniform(0.5, 1.5, (n, 3, 3)).cumsum(axis=0) % 0.05 + np.eye(3))
    return playback.Playback(
        title="Noise", run="noise, seed 1", verdict=["none"], time_ns=time_ns, start_ns=0,
        stop_ns=int(time_ns[-1]), diver=path, beacons=arms + waves, reported=reported,
        receivers=[
            playback.PlayedReceiver(
                label=f"receiver {i}", epoch_ns=time_ns, since_ns=time_ns, until_ns=time_ns + 10**8,
                position=path + draw.standard_normal((n, 3)), truth=path, factor=lower,
            ) for i in range(receivers)
        ],
    )  # fmt: skip


def test_ten_minutes_of_noise_at_10_hz_with_four_receivers_are_small() -> None:
    assert len(page.render(noisy(6000, receivers=4))) < BYTES


def test_of_a_long_run_every_nth_row_is_kept_and_it_is_said() -> None:
    n, most = 4 * playback.MOST + 3, playback.MOST
    told = playback.remarks(n, {"ekf": n, "raw": most})
    assert told == ["Drawn: 1 of 5 instants, 1 of 5 estimates of ekf. The verdicts are on all of "
                    "them."]  # fmt: skip
    assert playback.remarks(most, {"ekf": most}) == []
    times = np.arange(n) * 10**9
    own = Estimates(epoch_ns=times, position=np.zeros((n, 3)))
    kept = playback.PlayedReceiver.of("ekf", own, None, times, times + 10**9)
    assert len(kept.epoch_ns) <= most
    assert kept.epoch_ns[-1] == times[-1]
    assert {*np.diff(kept.epoch_ns)} == {5 * 10**9}
    np.testing.assert_array_equal(kept.until_ns[:-1], kept.since_ns[1:])  # without gaps
    assert kept.until_ns[-1] == times[-1] + 10**9


def test_a_gap_stays_one() -> None:
    since = np.array([0, 10, 30]) * 10**9
    until = np.array([10, 20, 40]) * 10**9
    own = Estimates(epoch_ns=since, position=np.zeros((3, 3)))
    kept = playback.PlayedReceiver.of("ekf", own, None, since, until)
    np.testing.assert_array_equal(kept.until_ns, until)


@pytest.mark.parametrize("name", SHAPES)
def test_any_shape_of_run_becomes_a_page(name: str) -> None:
    record, tracks = run_of(SHAPES[name])
    told, back = read_back(page.render(of_shape(record, [*tracks])))
    assert len(back["time"]) <= playback.MOST
    assert [it["label"] for it in told["receivers"]] == [*tracks]


def of_shape(record: Record, receivers: list[str]) -> playback.Playback:
    truth = of_record(record)
    epoch = record.time_ns[1:-1:3]
    own = Estimates(epoch_ns=epoch, position=truth.state_at(epoch)[0] + 1.0)
    judged = {name: intact(name, own, truth) for name in receivers}
    words = {"title": "Shape", "run": "shape", "verdict": ["ekf: </script> & <b>"]}
    return playback.of_record(record, judged, **words)


def test_words_of_the_user_cannot_break_a_page() -> None:
    odd = '</script><script>alert("1")</script> & <b> é 潜水'
    played = noisy(10, receivers=1)
    one = playback.PlayedReceiver(**{
        name: getattr(played.receivers[0], name)
        for name in ("epoch_ns", "since_ns", "until_ns", "position")
    }, label=odd)  # fmt: skip
    text = page.render(playback.Playback(
        title=odd, run=odd, verdict=[f"{odd}: {odd}"], time_ns=played.time_ns, start_ns=0,
        stop_ns=played.stop_ns, receivers=[one],
    ))  # fmt: skip
    told, _ = read_back(text)
    assert told["title"] == told["receivers"][0]["label"] == odd
    assert text.count("</script>") == 2


def test_a_page_allows_its_own_script_and_style_and_nothing_else(
    result: Result, tmp_path: Path
) -> None:
    text = result.replay(tmp_path / "replay.html").read_text("utf-8")
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', text)
    assert policy
    rules = dict(rule.split(" ", 1) for rule in policy[1].split("; "))
    for kind, tag in (("script", "<script>"), ("style", "<style>")):
        inside = text.partition(tag)[2].partition(f"</{kind}>")[0]
        told = b64encode(sha256(inside.encode()).digest()).decode()
        assert rules[f"{kind}-src"] == f"'sha256-{told}'"
    assert rules["default-src"] == rules["base-uri"] == rules["form-action"] == "'none'"
    assert len(rules) == 5
    assert not re.search(r"(?:src|href)=|https?://(?!www\.w3\.org/)|@import|url\((?!#)", text)
    assert " style=" not in text  # the policy refuses it


def test_equal_runs_give_equal_bytes(result: Result, tmp_path: Path) -> None:
    again = sblcosim.run("paper-scenario-1", overrides={"time.duration_s": 5.0})
    pages = [it.replay(tmp_path / f"{i}.html") for i, it in enumerate((result, again))]
    assert pages[0].read_bytes() == pages[1].read_bytes()


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("run.png", r"must be a file \.html, got .*run\.png"),
        ("run", r"must be a file \.html, got .*run"),
        ("taken/run.html", r"must be a file that can be written, got .*run\.html"),
    ],
)
def test_what_cannot_be_written_is_said_and_nothing_is_left(
    name: str, why: str, result: Result, tmp_path: Path
) -> None:
    taken = tmp_path / "taken"
    taken.touch()
    with pytest.raises(ConfigurationError, match=f"replay: {why}"):
        result.replay(tmp_path / name)
    assert list(tmp_path.iterdir()) == [taken]


def test_the_page_of_an_equal_run_stays_in_its_folder(result: Result, tmp_path: Path) -> None:
    folder = result.save(tmp_path / "run", figures=False, replay=True)
    assert (folder / page.NAME).is_file()
    result.save(tmp_path / "run", figures=False, other="replace")
    alone = result.replay(tmp_path / "run" / "alone.html")
    assert (folder / page.NAME).read_bytes() == alone.read_bytes()


def test_a_run_without_receivers_has_no_page() -> None:
    record, _ = run_of(SHAPES["three_seconds"])
    with pytest.raises(ConfigurationError, match="replay: the run must have a receiver, got none"):
        of_shape(record, [])


SCRIPTS = {"web": ["web/js/replay"], "explore": [explorer.MAIN, explorer.WORKER]}
"""The first modules of the scripts of pages and their workers."""


@pytest.mark.parametrize("room", SCRIPTS)
def test_no_module_is_unused(room: str) -> None:
    folder = Path(page.__file__).parents[1] / room / "js"
    bundled = "".join(map(bundle.bundled, SCRIPTS[room]))
    own = {n for n in re.findall(r"^modules\.(\w+) = ", bundled, re.MULTILINE)
           if n.startswith(f"{room}_")}  # fmt: skip
    assert own == {f"{room}_{path.stem}" for path in folder.glob("*.js")}
    for name in own:
        text = bundle.module(name.replace(f"{room}_", f"{room}/js/", 1))
        assert text.startswith("// ")  # says what it is


@pytest.mark.parametrize("main", [it for scripts in SCRIPTS.values() for it in scripts])
def test_modules_are_bundled_each_after_those_that_it_imports(main: str) -> None:
    text = bundle.bundled(main)
    names = re.findall(r"^modules\.(\w+) = ", text, re.MULTILINE)
    assert len({*names}) == len(names)
    for use in re.finditer(r"= modules\.(\w+);", text):
        before = text[: use.start()]
        assert f"modules.{use[1]} = (() =>" in before
    assert not re.search(r"^(?:import|export)\b", text, re.MULTILINE)


@pytest.mark.parametrize(
    ("modules", "why"),
    [
        ({"a": 'import { b } from "./b.js";\n', "b": 'import { a } from "./a.js";\n'},
         "modules must not import each other, got a → b → a"),
        ({"a": 'import b from "./b.js";\n'}, r"a\.js: must be written as .*, got import b from"),
        ({"a": "export default 1;\n"}, r"a\.js: must be written as .*, got export default 1"),
        ({"a": 'import { b as c } from "./b.js";\n', "b": ""}, r"a\.js: .*got .*b as c"),
        ({"a": 'import { b, c } from "./b.js";\n', "b": "export const b = 1, c = 2;\n"},
         r"b\.js: must export c, which a\.js imports"),
    ],
)  # fmt: skip
def test_other_forms_of_modules_are_refused(modules: dict[str, str], why: str, seam: Seam) -> None:
    seam.instead(bundle.module, lambda name: modules[name])
    with pytest.raises(ValueError, match=why):
        bundle.bundled("a")


def test_the_page_of_a_log_has_what_the_log_has(tmp_path: Path) -> None:
    processed = process(made(start_s=1.7e9, seconds=120), ["long_baseline"])
    told, back = read_back(processed.replay(tmp_path / "replay.html").read_text("utf-8"))
    log, (own, *_) = processed.log, processed.made.values()
    assert log.truth is not None
    assert [told["start"], told["stop"]] == [0.0, (log.stop_ns - log.start_ns) / 1e9]
    assert [it["label"] for it in told["receivers"]] == [*processed.made]
    since = back["0.since"]
    assert (np.diff(since) >= 0).all()
    assert (back["0.until"] >= since).all()
    order = np.argsort(back["0.epoch"], kind="stable")
    position = np.column_stack([back[f"0.{axis}"][order] for axis in "xyz"]) / 1e3
    by_epoch = own.position[np.argsort(own.epoch_ns, kind="stable")]
    np.testing.assert_allclose(position, by_epoch, atol=5.1e-4)
    errors = np.column_stack([back[f"0.{a}"] - back[f"0.true.{a}"] for a in "xyz"]) / 1e3
    errors = errors[(back["0.true.x"] != columns.MISSING)]
    rms = np.sqrt((errors**2).sum(axis=1).mean())
    assert rms == pytest.approx(processed.receivers.total_rms_m["long_baseline"], abs=2e-3)
    for i, corner in enumerate(CORNERS):  # fixed
        place = np.column_stack([back[f"reported.{i}.{axis}"] for axis in "xyz"]) / 1e3
        np.testing.assert_allclose(place, np.tile(corner, (len(place), 1)), atol=5.1e-4)
    assert not any(name.startswith("beacon.") for name in back)


def test_the_page_of_a_log_without_truth_or_depth_is_written(tmp_path: Path) -> None:
    blind = process(made(truth=False, seconds=120)).replay(tmp_path / "blind.html")
    told, back = read_back(blind.read_text("utf-8"))
    assert not any(name.startswith("diver") or ".true." in name for name in back)
    assert told["error"] == "total"
    flat = process(made(plane=True, seconds=120)).replay(tmp_path / "flat.html")
    assert read_back(flat.read_text("utf-8"))[0]["error"] == "horizontal"


def test_beacons_of_a_log_stay_where_they_last_said_they_were() -> None:
    log = made(seconds=40)
    moved = log.receptions.beacon_position.copy()
    moved[20:] += 5.0
    moving = replace(log, receptions=replace(log.receptions, beacon_position=moved))
    reported = process(moving, ["long_baseline"])
    told, back = read_back(page.render(pages.played(reported)))
    at = back["time"] / 1e3 + told["start"]
    heard = reported.log.receptions
    for i in range(4):
        own = heard.beacon == i
        epochs = (heard.epoch_ns[own] - reported.log.start_ns) / 1e9
        last = np.maximum(np.searchsorted(epochs, at + 1e-6, side="right") - 1, 0)
        expected = heard.beacon_position[own][last, 0]
        np.testing.assert_allclose(back[f"reported.{i}.x"] / 1e3, expected, atol=5.1e-4)


def test_a_packed_dive_is_its_facts_and_its_numbers_and_nothing_else() -> None:
    tables = {"one": np.arange(6.0).reshape(3, 2) / 7, "none": np.empty((0, 2))}
    for size in range(9):  # of the text, whose end is filled up to 8 bytes
        facts = {"name": "é" * size}
        text = PreparedDive(load("paper-scenario-1"), facts, tables).packed(more=1)
        whole = zlib.decompress(b64decode(text))
        length = int.from_bytes(whole[:4], "little")
        sizes = {"one": [3, 2], "none": [0, 2]}
        assert json.loads(whole[4 : 4 + length]) == {**facts, "more": 1, "tables": sizes}
        start = -(-(4 + length) // 8) * 8
        assert not any(whole[4 + length : start])
        numbers = np.frombuffer(whole[start:], "<f8")
        assert numbers.tolist() == tables["one"].T.ravel().tolist()
