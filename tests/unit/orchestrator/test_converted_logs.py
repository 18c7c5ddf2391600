"""A log of any format, written in the project's own format and read back, is the same log."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import log_samples
import numpy as np
import pytest
import sblcosim
from made_logs import made
from sblcosim.logs.contents import contents_of
from sblcosim.logs.log import Log


def converted(log: Log, folder: Path) -> Log:
    """The log as it is read back."""
    return sblcosim.read_log(contents_of(log).save(folder, figures=False, log=True) / "log")


def sample(kind: str, folder: Path) -> Log:
    """The log of a sample."""
    make, name = log_samples.SAMPLES[kind]
    folder.mkdir()
    for file, text in make().items():
        (folder / file).write_text(text)
    return sblcosim.read_log(folder / name if name else folder)


def is_same(log: Log, back: Log) -> None:
    """All data and statements are equal, to the bit."""
    assert back.sha256() == log.sha256()
    assert (back.name, back.beacons) == (log.name, log.beacons)
    assert back.meta.model_copy(update={"name": ""}) == log.meta.model_copy(update={"name": ""})
    assert back.start_ns == log.start_ns
    assert [*back.fixes] == [*log.fixes]
    for name, fixes in log.fixes.items():
        np.testing.assert_array_equal(back.fixes[name].position, fixes.position)
        np.testing.assert_array_equal(back.fixes[name].epoch_ns, fixes.epoch_ns)
    assert not back.findings


@pytest.mark.parametrize("kind", log_samples.SAMPLES)
def test_a_log_written_and_read_back_is_the_same(tmp_path: Path, kind: str) -> None:
    log = sample(kind, tmp_path / kind)
    assert len(log.receptions) or log.fixes
    back = converted(log, tmp_path / "out")
    is_same(log, back)
    again = converted(back, tmp_path / "again")
    assert again.sha256() == log.sha256()
    for file in (tmp_path / "out" / "log").glob("*.csv"):
        assert file.read_bytes() == (tmp_path / "again" / "log" / file.name).read_bytes()


def test_a_simulated_dive_converted_keeps_its_poses_truth_and_settings(tmp_path: Path) -> None:
    result = sblcosim.run("realistic-dive", "ekf", {"time.duration_s": 20.0})
    log = sblcosim.read_log(result.save(tmp_path / "run", figures=False, log=True) / "log")
    assert log.receptions.has_pose.any()
    assert log.scenario is not None
    back = converted(log, tmp_path / "out")
    is_same(log, back)
    assert back.scenario is not None
    assert sblcosim.load(back.scenario).model_dump() == sblcosim.load(log.scenario).model_dump()


NAMES = ['say "x"', "a, b", "été", "x = [1]", "\N{GRINNING FACE}", "#1"]


def test_names_and_statements_of_any_form_are_kept(tmp_path: Path) -> None:
    log = sample("own", tmp_path / "own")
    (fixes,) = log.fixes.values()
    about = {
        "name": NAMES[0], "notes": "tab\tquote\" back\\ line\nend \x7f", "source": {
            "when": "2024", "parts": [{"a b": 1.5, "c": True}], NAMES[1]: {"deep": [1, 2]},
        },
        "beacons": dict(zip((*NAMES[1:4], "1"), log.meta.beacons.values(), strict=True)),
    }
    strange = replace(
        log, name=NAMES[0], beacons=tuple(about["beacons"]),
        meta=type(log.meta).model_validate(log.meta.model_dump() | about),
        fixes=dict.fromkeys(sorted(NAMES), fixes),
    )
    is_same(strange, converted(strange, tmp_path / "out"))


def test_the_hash_tells_logs_apart_but_not_their_names_and_lines(tmp_path: Path) -> None:
    log = sample("own", tmp_path / "own")
    (fixes,) = log.fixes.values()
    hashes = {
        log.sha256(),
        replace(log, fixes={}).sha256(),
        replace(log, fixes={"other": fixes}).sha256(),
        replace(log, beacons=("a", *log.beacons[1:])).sha256(),
        replace(log, depth=log.depth + 1e-9).sha256(),
    }
    assert len(hashes) == 5
    moved = replace(log.receptions, line=log.receptions.line + 1)
    named = log.meta.model_copy(update={"name": "x"})
    assert replace(log, receptions=moved, meta=named, name="x").sha256() == log.sha256()


def test_every_number_and_the_shape_of_every_table_is_in_the_hash(tmp_path: Path) -> None:
    log = sample("own", tmp_path / "own")
    ((name, fixes),) = log.fixes.items()
    known = {log.sha256()}
    for part, table in (("receptions", log.receptions), ("truth", log.truth), ("fixes", fixes)):
        assert table is not None
        for field in fields(table):
            old = getattr(table, field.name)
            if field.name == "line" or not isinstance(old, np.ndarray):
                continue
            new = replace(table, **{field.name: ~old if old.dtype == bool else old + 1000})
            hashed = replace(log, **{part: {name: new} if part == "fixes" else new}).sha256()
            assert hashed not in known, (part, field.name)
            known.add(hashed)
    # The last time as the first depth: the same bytes in other arrays.
    shifted = replace(log, depth_ns=log.depth_ns[:-1], depth=np.r_[log.depth_ns[-1], log.depth])
    assert shifted.sha256() not in known


def test_logs_whose_times_differ_by_a_nanosecond_are_told_apart(tmp_path: Path) -> None:
    """Of times since 1970, floats have steps of 256 ns."""
    log = sample("own", tmp_path / "own")
    assert log.truth is not None
    since = 1_780_000_000 * 10**9
    times = {
        (part, field.name): getattr(table, field.name)
        for part, table in (("receptions", log.receptions), ("truth", log.truth))
        for field in fields(table)
        if field.name.endswith("_ns") and getattr(table, field.name) is not None
    }
    assert len(times) >= 3
    for (part, name), values in times.items():
        hashes = {
            replace(log, **{part: replace(getattr(log, part), **{name: values + later})}).sha256()
            for later in (since, since + 1)
        }
        assert len(hashes) == 2, (part, name)
    dated = replace(log, depth_ns=log.depth_ns + since)
    assert replace(dated, depth_ns=dated.depth_ns + 1).sha256() != dated.sha256()


def test_only_what_there_is_gets_a_file(tmp_path: Path) -> None:
    log = made(seconds=20, plane=True)
    converted(log, tmp_path / "out")
    names = {path.name for path in (tmp_path / "out" / "log").iterdir()}
    assert names == {"receptions.csv", "truth.csv", "meta.toml", "manifest.json"}
