"""The Parquet files of a study: what is read of them, and what the whole table is for."""

from __future__ import annotations

import hashlib
import shutil
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from pyarrow import parquet
from sblcosim.analysis.common import columns
from sblcosim.errors import ConfigurationError, DamageWarning
from sblcosim.report import study as reports
from sblcosim.study import campaign, definition, parts, runner, store, study
from seams import Seam

RUNS = 40_000


def small(**changes: Any) -> definition.Study:
    """Two points, four replicates, runs of 2 s."""
    return study.load(
        {
            "name": "small",
            "scenario": "paper-scenario-1",
            "fixed": {"time": {"duration_s": 2.0}},
            "replicates": 4,
            "factors": {"arm": {"keys": ["platform.arm_length_m"], "levels": [0.4, 3.0]}},
            **changes,
        }
    )


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results in four parts."""
    out = tmp_path_factory.mktemp("whole") / "out"
    with Seam() as seam:
        seam.tuned(batch=2)
        small().run(out)
    assert len(stored(out)) == 4
    return out


@pytest.fixture
def out(whole: Path, tmp_path: Path) -> Path:
    """A copy that may be damaged."""
    return Path(shutil.copytree(whole, tmp_path / "out"))


@pytest.fixture(scope="module")
def large(whole: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same runs again and again, with run ids of their own, in parts as they are written."""
    out = tmp_path_factory.mktemp("large") / "out"
    asked = campaign.prepare(small(replicates=RUNS // 2))
    store.open_folder(out, asked)
    few = store.table(whole)
    for first in range(0, RUNS // 2, 2000):
        made = pd.concat([few] * 500, ignore_index=True)
        made["replicate"] = first + 1 + np.arange(len(made)) // 2
        made["seed"] = 2 * first + 1 + np.arange(len(made))
        made["run_id"] = [f"{seed:016x}" for seed in made["seed"]]
        runs = [campaign.CampaignRun(0, first + 1, 1, made["run_id"][0])]
        parts.write(out, asked, runs, made)
    return out


def stored(out: Path) -> list[Path]:
    return sorted((out / "parts").glob("*.parquet"))


def flip(path: Path, bit: int) -> None:
    content = bytearray(path.read_bytes())
    content[bit // 8] ^= 1 << bit % 8
    path.write_bytes(content)


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Rows read of each column."""
    rows: Counter[str] = Counter()
    original = parquet.ParquetFile.read

    def counted(file: parquet.ParquetFile, *given: Any, **named: Any) -> pa.Table:
        arrow = original(file, *given, **named)
        rows.update(dict.fromkeys(arrow.column_names, len(arrow)))
        return arrow

    monkeypatch.setattr(parquet.ParquetFile, "read", counted)
    return rows


def test_an_analysis_reads_each_column_that_it_needs_once_and_no_other(
    out: Path, tmp_path: Path, read: Counter[str]
) -> None:
    reports.analysed(out).save(tmp_path / "analysis", other="replace")
    needed = {
        "run_id", "replicate", "point", "run_order", "seed", "arm", "error",
        "ekf.absolute_total_rms_m", "ekf.nees_position", "ekf.own_relative_nees_position",
        "ekf.inconsistent", "ekf.lost", "ekf.misleading",
    }  # fmt: skip
    assert read == dict.fromkeys(needed, 8)


def test_going_on_with_a_finished_study_reads_what_tells_the_runs(
    large: Path, read: Counter[str], tmp_path: Path
) -> None:
    out = Path(shutil.copytree(large, tmp_path / "out"))
    runner.carry_out(small(replicates=RUNS // 2), out)
    assert read["ekf.updates"] == RUNS  # for the table of all runs, which was not there
    read.clear()
    runner.carry_out(small(replicates=RUNS // 2), out)
    assert read == {"run_id": RUNS, "replicate": RUNS, "point": RUNS}


def test_no_run_becomes_a_python_object(large: Path) -> None:
    asked = campaign.prepare(small(replicates=RUNS // 2))
    runner.missing(asked, large)  # whatever is made once
    before = sys.getallocatedblocks()
    found = store.finished(large)
    missing = runner.missing(asked, large)
    table = store.table(large, columns.needed(asked.study))  # type: ignore[arg-type]
    made = sys.getallocatedblocks() - before
    assert made < RUNS / 10
    assert (len(found), missing.runs, len(table)) == (RUNS, 0, RUNS)
    # Pandas before 3 has texts as objects, each once; they are among the blocks above.
    assert {name for name in table if table[name].dtype == object} <= {"error"}


def test_the_whole_table_has_the_same_bytes_from_whatever_parts(
    out: Path, whole: Path, tmp_path: Path, seam: Seam
) -> None:
    """Written at once or grown, in several groups of rows."""
    seam.tuned(group=3)
    small().run(tmp_path / "at once")  # in one part
    once = (tmp_path / "at once" / "runs.parquet").read_bytes()
    assert parquet.ParquetFile(pa.BufferReader(once)).num_row_groups == 3
    for number in (1, 3, 4):
        small(replicates=number).run(tmp_path / "grown")
    assert len(stored(tmp_path / "grown")) == 3
    assert (tmp_path / "grown" / "runs.parquet").read_bytes() == once
    pd.testing.assert_frame_equal(
        store.table(tmp_path / "grown"), pd.read_parquet(whole / "runs.parquet"), check_exact=True
    )


def test_a_table_that_is_not_as_it_was_written_stands_for_nothing(out: Path, whole: Path) -> None:
    right = store.table(whole)
    forged = right.assign(**{"ekf.absolute_total_rms_m": 0.0})
    forged.to_parquet(out / "runs.parquet")
    pd.testing.assert_frame_equal(store.table(out), right, check_exact=True)
    small().run(out)
    assert (out / "runs.parquet").read_bytes() == (whole / "runs.parquet").read_bytes()


def test_a_table_that_cannot_be_read_is_not_needed(out: Path, whole: Path) -> None:
    (out / "runs.parquet").unlink()
    (out / "runs.parquet").mkdir()
    pd.testing.assert_frame_equal(store.table(out), store.table(whole), check_exact=True)


def test_a_damaged_part_counts_as_missing_although_its_runs_are_in_the_table(out: Path) -> None:
    flip(stored(out)[2], 9999)
    asked = campaign.prepare(small())
    assert runner.missing(asked, out).by_point == (1, 1)
    assert len(store.finished(out)) == 6
    with pytest.raises(ConfigurationError, match="must be as it was written, got other bytes"):
        store.table(out)
    with pytest.warns(DamageWarning):
        assert len(small().run(out)) == 8


def as_of_old(out: Path, first: int = 0) -> None:
    """Take from a folder, or its later parts, what earlier versions did not write."""
    for path in stored(out)[first:]:
        stream = pa.BufferOutputStream()
        parquet.write_table(parquet.read_table(path).replace_schema_metadata(None), stream)
        content = stream.getvalue().to_pybytes()
        path.unlink()
        name = parts.named(path.stem.rpartition("-")[0], content)
        (path.parent / name).write_bytes(content)
    said = store.described(out)
    del said["table"]
    (out / "study.json").write_bytes(store.sealed(said))


def test_a_folder_of_old_is_read_and_completed(out: Path, whole: Path) -> None:
    as_of_old(out)
    pd.testing.assert_frame_equal(store.table(out), store.table(whole), check_exact=True)
    asked = campaign.prepare(small(replicates=5))
    assert runner.missing(asked, out).by_point == (1, 1)
    before = stored(out)
    assert len(small(replicates=5).run(out)) == 10
    assert set(before) < set(stored(out))
    assert len(stored(out)) == 5


def test_the_whole_table_says_whose_runs_it_holds_if_all_parts_do(out: Path) -> None:
    said = b"sblcosim.campaign"
    assert said in parquet.read_schema(out / "runs.parquet").metadata
    as_of_old(out, 2)
    small().run(out)
    assert len(store.finished(out)) == 8
    assert said not in (parquet.read_schema(out / "runs.parquet").metadata or {})


def test_runs_of_another_study_in_a_part_count_for_nothing(
    out: Path, tmp_path: Path
) -> None:
    """Whether their part says whose they are or not."""
    small(seed=77, replicates=5).run(tmp_path / "other")
    for old in (False, True):
        if old:
            as_of_old(tmp_path / "other")
        (foreign,) = stored(tmp_path / "other")
        shutil.copy(foreign, out / "parts")
        missing = runner.missing(campaign.prepare(small(replicates=5)), out)
        assert missing.by_point == (1, 1), old
        (out / "parts" / foreign.name).unlink()


def test_run_ids_must_be_ours(out: Path) -> None:
    (path, *_) = stored(out)
    arrow = parquet.read_table(path)
    for wrong in (["x" * 16] * 2, ["abc"] * 2):
        index = arrow.schema.get_field_index("run_id")
        stream = pa.BufferOutputStream()
        parquet.write_table(arrow.set_column(index, "run_id", pa.array(wrong)), stream)
        content = stream.getvalue().to_pybytes()
        other = path.parent / parts.named("000009-x", content)
        other.write_bytes(content)
        with pytest.raises(ConfigurationError, match="run_id: must be 16 hexadecimal digits"):
            store.table(out)
        other.unlink()


def test_texts_as_levels_of_factors_are_kept(out: Path) -> None:
    """In parts and in the whole table; nothing here takes a factor for a number."""
    there = store.open_folder(out, campaign.prepare(small()))
    made = store.table(out).assign(arm=["a", "bc"] * 4)
    for path in there.paths:
        path.unlink()
    runs = [campaign.CampaignRun(0, 1, 1, made["run_id"][0])]
    written = parts.write(out, campaign.prepare(small()), runs, made)
    store.save(parts.Parts(out, (written,), frozenset()))
    assert parquet.read_table(out / "runs.parquet")["arm"].to_pylist() == ["a", "bc"] * 4
    assert store.table(out)["arm"].tolist() == ["a", "bc"] * 4


def test_the_description_tells_the_hash_of_the_table(out: Path) -> None:
    said = store.described(out)["table"]
    assert said["sha256"] == hashlib.sha256((out / "runs.parquet").read_bytes()).hexdigest()
    assert said["parts"] == [path.name for path in stored(out)]


def test_columns_are_chosen_of_all_names(out: Path) -> None:
    seen: list[str] = []

    def chosen(names: Sequence[str]) -> list[str]:
        seen[:] = names
        return ["ekf.nis", "arm"]

    assert list(store.table(out, chosen)) == ["arm", "ekf.nis"]
    assert seen == list(store.table(out))


def apart(out: Path, pieces: Sequence[pd.DataFrame]) -> Path:
    """A folder of the small study with its runs in other parts."""
    asked = campaign.prepare(small())
    store.open_folder(out, asked)
    for made in pieces:
        place, replicate = int(made["point"].iloc[0]) - 1, int(made["replicate"].iloc[0])
        runs = [campaign.CampaignRun(place, replicate, 1, made["run_id"].iloc[0])]
        parts.write(out, asked, runs, made)
    return out


def test_runs_that_are_not_in_order_or_twice_make_the_same_table(
    whole: Path, tmp_path: Path, seam: Seam
) -> None:
    seam.tuned(group=3)
    rows = store.table(whole)
    once = apart(tmp_path / "once", [rows])
    late = [rows[:4], rows[4:5], pd.concat([rows[5:6], rows[7:]]), rows[6:7]]
    twice, between_groups = [rows[:5], rows[2:]], [rows[:6], rows[4:]]
    for number, pieces in enumerate(([rows[::2], rows[1::2]], twice, between_groups, late)):
        other = apart(tmp_path / str(number), pieces)
        for folder in (once, other):
            assert len(small().run(folder)) == len(rows)
        assert (other / "runs.parquet").read_bytes() == (once / "runs.parquet").read_bytes()


def test_a_column_of_which_a_later_part_says_more_is_in_the_whole_table(
    whole: Path, tmp_path: Path, seam: Seam
) -> None:
    """Whole numbers at first, and then fractions, in a later group of rows."""
    seam.tuned(group=3)
    rows = store.table(whole)
    more = rows.assign(**{"ekf.updates": rows["ekf.updates"].astype(float) + 0.5})
    out = apart(tmp_path / "out", [rows[:4], more[4:]])
    small().run(out)
    right = pd.concat([rows[:4], more[4:]], ignore_index=True)
    pd.testing.assert_frame_equal(pd.read_parquet(out / "runs.parquet"), right, check_exact=True)


def test_columns_of_which_half_the_values_come_again_are_packed(
    whole: Path, tmp_path: Path
) -> None:
    """All others are noise, for which packing only takes time."""
    rows = store.table(whole)
    columns = {"all": [0, 1, 2, 3, 4, 5, 6, 7], "most": [0, 1, 2, 3, 4, 0, 0, 0],
               "half": [0, 1, 2, 3, 0, 1, 2, 3], "few": [0, 1, 0, 1, 0, 1, 0, 1]}
    given = {f"ekf.{name}": np.array(column, float) for name, column in columns.items()}
    out = apart(tmp_path / "out", [rows.assign(**given)])
    there, _ = parts.looked_through(out, {})
    parts.save(there)
    (part,) = stored(out)

    def packed(path: Path) -> list[tuple[bool, str]]:
        group = parquet.ParquetFile(path).metadata.row_group(0)
        found = {c.path_in_schema: c for c in map(group.column, range(group.num_columns))}
        return [
            (found[name].has_dictionary_page, found[name].compression) for name in given
        ]

    assert [dictionary for dictionary, _ in packed(part)] == [False, False, True, True]
    plain, short = (False, "UNCOMPRESSED"), (True, "SNAPPY")
    assert packed(out / "runs.parquet") == [plain, plain, short, short]


def test_a_study_may_have_more_parts_than_a_process_may_open_files(
    whole: Path, tmp_path: Path
) -> None:
    resource = pytest.importorskip("resource")
    folder = Path("/proc/self/fd")
    if not folder.exists():
        pytest.skip("does not say what is open")
    rows = store.table(whole)
    pieces = [rows.assign(replicate=rows["replicate"] + 4 * n) for n in range(40)]
    for n, made in enumerate(pieces):
        made["run_id"] = [f"{16 * n + k:016x}" for k in range(len(made))]
    out = apart(tmp_path / "out", pieces)
    there, _ = parts.looked_through(out, {})
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    taken = {int(name.name) for name in folder.iterdir()}
    free = [number for number in range(len(taken) + 21) if number not in taken]
    resource.setrlimit(resource.RLIMIT_NOFILE, (free[20], limits[1]))
    try:
        parts.save(there)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)
    assert len(pd.read_parquet(out / "runs.parquet")) == 40 * len(rows)


def test_rows_in_any_order_are_put_in_that_of_replicates_and_points(tmp_path: Path) -> None:
    """By their keys alone, whichever of the two is not in order, and each run once."""
    rng = np.random.default_rng(3)
    replicate, point = np.repeat([1, 2, 3], 4), np.tile([0, 1, 2, 3], 3)
    ids = np.array([f"{i:016x}" for i in range(12)])

    def table(rows: Any) -> pd.DataFrame:
        columns = {"replicate": replicate[rows], "point": point[rows], "run_id": ids[rows]}
        return pd.DataFrame(columns)

    def read_back(rows: Any) -> pd.DataFrame:
        path = tmp_path / "part.parquet"
        table(rows).to_parquet(path)
        return parts.table(parts.Parts(tmp_path, (path,), frozenset()))

    inside, between, twice = np.arange(12), np.arange(12), np.append(np.arange(12), 5)
    inside[[4, 5]] = 5, 4  # points of a replicate
    between[[3, 4]] = 4, 3  # replicates
    orders = [inside, between, twice, *(rng.permutation(12) for _ in range(20))]
    for rows in orders:
        pd.testing.assert_frame_equal(read_back(rows), table(np.arange(12)))
    gaps = np.flatnonzero(rng.random(12) < 0.5)
    pd.testing.assert_frame_equal(read_back(gaps), table(gaps))


@pytest.mark.parametrize("rows", [40, 41, 3 * parts.SAMPLE])
def test_what_repeats_itself_in_half_of_its_rows_is_kept_as_a_dictionary(
    rows: int, tmp_path: Path
) -> None:
    """Whether it does is judged by the first rows alone."""
    seen = min(rows, parts.SAMPLE)
    half = np.arange(rows) % (seen // 2)
    more = np.arange(rows) % (seen // 2 + 1)
    made = pd.DataFrame(
        {
            "run_id": [f"{n:016x}" for n in range(rows)], "error": None, "one": 1.5,
            "half": half, "more": more, "late": np.maximum(np.arange(rows) - seen + 1, 0) / 7,
        }
    )
    asked = campaign.prepare(small())
    written = parts.write(_folder(tmp_path), asked, [campaign.CampaignRun(0, 1, 1, "a")], made)
    file = parquet.ParquetFile(written)
    chunks = [file.metadata.row_group(0).column(n) for n in range(len(file.schema.names))]
    kept = {c.path_in_schema for c in chunks if c.has_dictionary_page}
    assert kept == {"error", "one", "half", "late"}


def _folder(at: Path) -> Path:
    (at / parts.PARTS).mkdir()
    return at
