"""The folder of a study's results: nothing damaged is taken for a result, nothing is lost."""

from __future__ import annotations

import json
import os
import random
import shutil
import subprocess
import sys
import time
import warnings
import zipfile
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest
from pyarrow import parquet
from sblcosim.errors import ConfigurationError, ConfigurationWarning, DamageWarning
from sblcosim.fmus.build.factory import build
from sblcosim.simulation.how import How
from sblcosim.study import again, campaign, definition, runner, store, study
from sblcosim.study import parts as stored
from seams import Seam

FLIPS = 300


def test_a_part_without_its_columns_is_one_line(tmp_path: Path) -> None:
    runner.run(small(), tmp_path)
    (part, *_) = parts(tmp_path)
    short = parquet.read_table(part).drop_columns(["replicate"])
    stream = pa.BufferOutputStream()
    parquet.write_table(short, stream)
    content = stream.getvalue().to_pybytes()
    (part.parent / stored.named(part.stem.rpartition("-")[0], content)).write_bytes(content)
    with pytest.raises(ConfigurationError, match=r"must have a column replicate, got none$"):
        store.table(tmp_path)


def small(**changes: Any) -> definition.Study:
    """Two points, two replicates, runs of 2 s."""
    return study.load(
        {
            "name": "small",
            "scenario": "paper-scenario-1",
            "fixed": {"time": {"duration_s": 2.0}},
            "replicates": 2,
            "factors": {"arm": {"keys": ["platform.arm_length_m"], "levels": [0.4, 3.0]}},
            **changes,
        }
    )


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results in two parts."""
    out = tmp_path_factory.mktemp("whole") / "out"
    with Seam() as seam:
        seam.tuned(batch=2)
        small().run(out)
    assert len(list((out / "parts").iterdir())) == 2
    return out


@pytest.fixture
def out(whole: Path, tmp_path: Path) -> Path:
    """A copy that may be damaged."""
    return Path(shutil.copytree(whole, tmp_path / "out"))


def parts(out: Path) -> list[Path]:
    return sorted((out / "parts").glob("*.parquet"))


def flip(content: bytes, bit: int) -> bytes:
    changed = bytearray(content)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


def flips(content: bytes, seed: int) -> list[bytes]:
    """The content with one bit flipped, at random places and everywhere in its end."""
    bits = range(8 * len(content))
    places = [*random.Random(seed).sample(bits, FLIPS), *bits[-64:]]
    return [flip(content, bit) for bit in places]


def test_every_flipped_bit_of_a_part_is_found(out: Path) -> None:
    path = parts(out)[0]
    good = path.read_bytes()
    for content in (*flips(good, 1), b"", good[:-1], good + b"\0"):
        path.write_bytes(content)
        assert not stored.is_intact(path)
        assert len(store.finished(out)) == 2
    for refused in (store.table, lambda place: again.replay(place, "a")):
        with pytest.raises(ConfigurationError) as caught:
            refused(out)
        assert str(caught.value) == (
            f"{path}: must be as it was written, got other bytes; 'sblcosim study' with the same "
            "study and folder repeats its runs"
        )
    path.write_bytes(good)
    assert len(store.table(out)) == 4


@pytest.mark.parametrize("damage", ["flipped", "torn", "empty"])
def test_a_damaged_part_is_set_aside_and_its_runs_are_done_again(
    out: Path, whole: Path, damage: str
) -> None:
    path = parts(out)[1]
    good = path.read_bytes()
    bad = {"flipped": flip(good, 8 * len(good) - 77), "torn": good[:1000], "empty": b""}[damage]
    path.write_bytes(bad)
    with pytest.warns(DamageWarning) as told:
        missing = runner.missing(campaign.prepare(small()), out, tell=True)
    assert (missing.runs, missing.by_point) == (2, (1, 1))
    assert [str(w.message) for w in told] == [
        f"{path}: must be as it was written, got other bytes; its runs count as missing"
    ]
    with pytest.warns(DamageWarning) as told:
        small().run(out)
    assert [str(w.message) for w in told] == [
        f"{path}: must be as it was written, got other bytes; it is now in damaged/, and its runs "
        "are repeated"
    ]
    assert (out / "parts" / "damaged" / path.name).read_bytes() == bad
    assert path.read_bytes() == good
    assert (out / "runs.parquet").read_bytes() == (whole / "runs.parquet").read_bytes()


def test_a_part_that_is_gone_is_named_and_its_runs_are_done_again(out: Path, whole: Path) -> None:
    path = parts(out)[0]
    path.unlink()
    with pytest.raises(ConfigurationError) as caught:
        store.table(out)
    assert str(caught.value) == (
        f"{path}: must be there, as study.json names it, got no such file; 'sblcosim study' with "
        "the same study and folder repeats its runs"
    )
    assert runner.missing(campaign.prepare(small()), out, tell=True).runs == 2
    small().run(out)
    assert (out / "runs.parquet").read_bytes() == (whole / "runs.parquet").read_bytes()
    assert len(store.table(out)) == 4


def test_the_table_is_made_from_the_parts_each_time(out: Path, whole: Path) -> None:
    good = (whole / "runs.parquet").read_bytes()
    (out / "runs.parquet").write_bytes(flip(good, 999))
    small().run(out)
    assert (out / "runs.parquet").read_bytes() == good


def test_every_flipped_bit_of_what_the_folder_says_is_found_or_means_nothing(out: Path) -> None:
    path = out / "study.json"
    good, said = path.read_bytes(), store.described(out)
    for content in flips(good, 2):
        path.write_bytes(content)
        try:
            assert store.described(out) == said
        except ConfigurationError as error:
            assert "\n" not in str(error)  # noqa: PT017


@pytest.mark.parametrize(
    "text",
    [
        "", "{", "[]", "3", '"text"', "null", "{}", '{"format": 2}', '{"format": 2, "sha256": 3}',
        '{"format": 2, "sha256": {}, "definition": []}', "[" * 100_000, '{"a":' * 100_000,
        '{"format": ' + "9" * 5000 + "}", '{"format": NaN}', "\udcff",
    ],
)  # fmt: skip
def test_damaged_but_valid_json_is_refused_in_one_line(out: Path, text: str) -> None:
    (out / "study.json").write_bytes(text.encode("utf-8", "surrogateescape"))
    for refused in (
        store.table, study.study_of, small().run,
        lambda place: runner.missing(campaign.prepare(small()), place),
        lambda place: again.replay(place, "a"),
    ):
        with pytest.raises(ConfigurationError, match=r"study\.json: must ") as caught:
            refused(out)
        assert "\n" not in str(caught.value)
        assert len(str(caught.value)) < 400


@pytest.mark.parametrize("number", [1, 3, "2", None])
def test_another_format_is_refused_even_if_it_is_sound(out: Path, number: object) -> None:
    content = store.described(out)
    (out / "study.json").write_bytes(store.sealed({**content, "format": number}))
    for refused in (store.table, small().run):
        with pytest.raises(ConfigurationError, match="must have format 2, got another"):
            refused(out)


def test_what_a_folder_says_is_written_again_if_it_is_lost(out: Path, whole: Path) -> None:
    (out / "study.json").unlink()
    small(replicates=1).run(out)
    assert (out / "study.json").read_bytes() == (whole / "study.json").read_bytes()
    (out / "study.json").unlink()
    with pytest.raises(ConfigurationError, match="must hold results of this study, got run"):
        small(seed=77).run(out)


def test_fewer_replicates_leave_the_number_in_the_folder(out: Path, whole: Path) -> None:
    for number in (1, 2):
        assert len(small(replicates=number).run(out)) == 2 * number
        assert json.loads((out / "study.json").read_text())["replicates"] == 2
        assert study.study_of(out).replicates == 2
        assert (out / "runs.parquet").read_bytes() == (whole / "runs.parquet").read_bytes()


def test_runs_that_two_processes_did_count_once(
    out: Path, whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small().run(tmp_path / "other")  # in one part
    (other,) = parts(tmp_path / "other")
    shutil.copy(other, out / "parts" / other.name)
    assert len(parts(out)) == 3
    table = small().run(out)
    assert table["run_id"].is_unique
    assert len(table) == len(store.finished(out)) == 4
    assert (out / "runs.parquet").read_bytes() == (whole / "runs.parquet").read_bytes()
    missing = runner.missing(campaign.prepare(small(replicates=3)), out)
    assert (missing.runs, missing.by_point) == (2, (1, 1))


def test_a_run_of_a_changed_fmu_of_the_same_name_is_not_replayed(tmp_path: Path) -> None:
    mine = tmp_path / "mine.fmu"
    shutil.copy(build("ekf"), mine)
    table = small(receivers=[str(mine)], replicates=1).run(tmp_path / "out")
    run_id = table["run_id"][0]
    assert again.replay(tmp_path / "out", run_id).receivers[0] == "mine"
    with zipfile.ZipFile(mine, "a") as archive:
        archive.writestr("documentation/note.txt", "changed")
    with pytest.raises(ConfigurationError, match="with the original FMUs and files"):
        again.replay(tmp_path / "out", run_id)


def test_another_process_at_work_is_told(out: Path) -> None:
    script = (
        "import sys\nfrom pathlib import Path\nfrom sblcosim.study import store\n"
        "with store.at_work(Path(sys.argv[1])):\n    print(flush=True)\n    sys.stdin.read()\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", script, str(out)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert process.stdout is not None
    process.stdout.readline()
    with pytest.warns(ConfigurationWarning, match="one study at a time, but another"):
        small().run(out)
    process.kill()
    process.communicate()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        small().run(out)
    assert not [name for name in os.listdir(out) if name.startswith(".")]


def test_any_number_of_replicates_is_counted_at_once(
    out: Path, seam: Seam
) -> None:
    made: list[int] = []
    original = runner.batch

    def counted(*arguments: Any) -> Any:
        runs = original(*arguments)
        made.append(len(runs))
        return runs

    seam.instead(runner.batch, counted)
    huge = campaign.prepare(small(replicates=530_000_000))
    missing = runner.missing(huge, out)
    assert missing.runs == huge.runs - 4 == 1_059_999_996
    assert missing.steps == huge.steps - 4 * 20
    low, high = runner.estimate(huge, missing, How(workers=1))
    assert 1e3 < low < high
    assert sum(made) < 100_000


class Clock:
    """A machine on which a step takes a microsecond of each of two processors, if it is idle."""

    def __init__(self, loads: list[float]) -> None:
        self.loads = loads
        self.wall = self.processor = 0.0
        self.sizes: list[int] = []

    def simulate(self, made: Any, runs: Any, *_: object) -> None:
        self.sizes.append(len(runs))
        seconds = 1e-6 * sum(runner.steps_of(made, runs))
        self.processor += 2 * seconds
        self.wall += seconds * (self.loads.pop(0) if self.loads else 1.0)


@pytest.mark.parametrize(
    ("loads", "busiest"),
    [
        ([], 1.0),  # idle
        ([1000.0], 1.0),  # libraries take long to load
        ([1, 1, 1, 1, 1, 1, 1, 1, 1000.0], 1.0),  # one stall
        ([20.0] * 50, 20.0),  # a busy machine
    ],
)
def test_an_estimate_is_a_range_that_no_stall_moves(
    monkeypatch: pytest.MonkeyPatch, seam: Seam, tmp_path: Path, loads: list[float], busiest: float
) -> None:
    made = campaign.prepare(small(replicates=1_000_000))
    missing = runner.missing(made, tmp_path / "out")
    clock = Clock(loads)
    seam.instead(runner.simulate, clock.simulate)
    monkeypatch.setattr(time, "perf_counter", lambda: clock.wall)
    monkeypatch.setattr(time, "process_time", lambda: clock.processor)
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    low, high = runner.estimate(made, missing)
    true = 1e-6 * missing.steps
    assert low == pytest.approx(true / runner.MARGIN)
    assert high == pytest.approx(true * runner.MARGIN * busiest)
    assert clock.sizes.count(clock.sizes[-1]) == runner.SAMPLES


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"scenario": "paper-scenario-2"}, "scenario"),
        ({"seed": 9}, "seed"),
        ({"receivers": ["sequential"]}, "receivers"),
        ({"settling_time_s": 1.0, "design": {"centre_points": 1}}, "settling_time_s, design"),
    ],
)
def test_another_study_is_told_by_what_differs(
    out: Path, changes: dict[str, Any], words: str
) -> None:
    with pytest.raises(ConfigurationError) as caught:
        runner.missing(campaign.prepare(small(**changes)), out)
    assert set(str(caught.value).partition(" with other ")[2].split(", ")) == set(words.split(", "))


def test_a_file_is_no_folder_of_results(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("precious")
    with pytest.raises(ConfigurationError, match="out: must be a folder or not exist yet, got a"):
        runner.missing(campaign.prepare(small()), tmp_path / "out")


def test_a_folder_knows_its_whole_study(tmp_path: Path) -> None:
    asked = small(design={"centre_points": 1}, seeding="common", title="Arms", replicates=1)
    asked.run(tmp_path / "out")
    found = study.study_of(tmp_path / "out")
    assert (found.design, found.seeding, found.title) == (asked.design, "common", "Arms")
    assert found.points.values == asked.points.values
