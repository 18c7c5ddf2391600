from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import warnings
from itertools import count
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from quick import one_in
from sblcosim import artifacts, manifests
from sblcosim.errors import ConfigurationError
from sblcosim.fmus import files


def write(path, text="one"):
    with artifacts.folder(path, {"run": 1}) as folder:
        (folder / f"{text}.txt").write_text(text)


def test_folder_has_its_files_and_a_manifest_that_lists_them(tmp_path):
    write(tmp_path / "deep" / "run")
    manifest = json.loads((tmp_path / "deep" / "run" / "manifest.json").read_text())
    assert manifest["run"] == 1
    assert manifest["files"] == ["one.txt"]
    assert manifest["software"]["numpy"] == np.__version__
    assert [p.name for p in (tmp_path / "deep").iterdir()] == ["run"]


def test_earlier_result_is_replaced_as_a_whole(tmp_path):
    write(tmp_path / "run", "one")
    write(tmp_path / "run", "two")
    assert sorted(p.name for p in (tmp_path / "run").iterdir()) == ["manifest.json", "two.txt"]
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError, SystemExit])
def test_nothing_is_left_behind_by_an_interrupted_run(tmp_path, error):
    def interrupted():
        with artifacts.folder(tmp_path / "run", {}) as folder:
            (folder / "half.txt").write_text("half")
            raise error

    with pytest.raises(error):
        interrupted()
    assert not list(tmp_path.iterdir())


def test_interrupted_run_leaves_the_earlier_result_alone(tmp_path):
    write(tmp_path / "run")
    before = {p.name: p.read_bytes() for p in (tmp_path / "run").iterdir()}

    def interrupted():
        with artifacts.folder(tmp_path / "run", {}):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert {p.name: p.read_bytes() for p in (tmp_path / "run").iterdir()} == before
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("name", ["thesis.tex", "manifest.json", "subfolder/file"])
def test_folder_with_something_foreign_is_refused_and_untouched(tmp_path, name):
    foreign = tmp_path / "run" / name
    foreign.parent.mkdir(parents=True)
    foreign.write_text("{}")
    with pytest.raises(ConfigurationError, match="must be empty or hold nothing but an earlier"):
        write(tmp_path / "run")
    assert foreign.read_text() == "{}"
    assert len(list(tmp_path.iterdir())) == 1


def test_result_that_somebody_added_to_is_refused(tmp_path):
    write(tmp_path / "run")
    (tmp_path / "run" / "notes.md").write_text("mine")
    with pytest.raises(ConfigurationError, match=r"'notes\.md'"):
        write(tmp_path / "run")
    assert (tmp_path / "run" / "one.txt").exists()


def test_empty_folder_may_be_filled(tmp_path):
    (tmp_path / "run").mkdir()
    write(tmp_path / "run")
    assert (tmp_path / "run" / "one.txt").exists()


def test_file_in_the_way_is_refused(tmp_path):
    (tmp_path / "run").write_text("a file")
    with pytest.raises(ConfigurationError, match="must be a folder or not exist yet, got a file"):
        write(tmp_path / "run")
    with pytest.raises(ConfigurationError, match="must be a folder that can be made and written"):
        write(tmp_path / "run" / "below")


def test_table_comes_back_from_both_files_bit_by_bit(tmp_path):
    values = np.random.default_rng(5).normal(size=200) * 10.0 ** np.arange(-100, 100)
    table = pd.DataFrame({"x[1,2]": values, "count": np.arange(200), "valid": values > 0})
    artifacts.write_table(table, tmp_path, "t")
    pd.testing.assert_frame_equal(pd.read_parquet(tmp_path / "t.parquet"), table)
    with (tmp_path / "t.csv").open(newline="") as file:
        head, *rows = csv.reader(file)
    assert head == table.columns.tolist()
    assert [float(row[0]) for row in rows] == values.tolist()


def test_a_column_of_texts_and_numbers_is_written_as_texts(tmp_path):
    table = pd.DataFrame({"level": pd.Series(["rtk_fixed", 0.4, 3, None], dtype=object),
                          "gated": pd.Series([True, False, 0.5, None], dtype=object),
                          "mean": [1.0, 2.0, 3.0, 4.0]})
    before = table.copy(deep=True)
    artifacts.write_table(table, tmp_path, "levels")
    back = pd.read_parquet(tmp_path / "levels.parquet")
    assert back["level"].tolist()[:3] == ["rtk_fixed", "0.4", "3"]
    assert back["gated"].tolist()[:3] == ["True", "False", "0.5"]
    assert back[["level", "gated"]].isna().to_numpy().tolist() == [*[[False] * 2] * 3, [True] * 2]
    pd.testing.assert_frame_equal(table, before)
    pd.testing.assert_series_equal(back["mean"], table["mean"])


def test_a_column_of_one_kind_of_values_keeps_it_where_some_are_missing(tmp_path):
    table = pd.DataFrame({"flag": pd.Series([True, None, False], dtype=object),
                          "count": pd.Series([1, None, 3], dtype=object)})
    artifacts.write_table(table, tmp_path, "kinds")
    back = pd.read_parquet(tmp_path / "kinds.parquet")
    assert back["flag"].tolist() == [True, None, False]
    assert back["count"].dropna().tolist() == [1, 3]


def test_plain_data_is_what_json_knows():
    value = {"a": np.float64(1.5), 2: (np.int64(3), np.nan), "b": np.bool_(True),
             "c": {"d": np.inf, "e": np.array([1, 2])}, "f": None, "g": "word"}
    plain = artifacts.plain(value)
    assert plain == {"a": 1.5, "2": [3, None], "b": True, "c": {"d": None, "e": [1, 2]},
                     "f": None, "g": "word"}
    json.dumps(plain, allow_nan=False)


def test_an_empty_folder_is_filled_and_stays_what_it_is(tmp_path):
    (tmp_path / "run").mkdir(mode=0o700)
    before = (tmp_path / "run").stat()
    write(tmp_path / "run")
    after = (tmp_path / "run").stat()
    assert (after.st_ino, after.st_mode) == (before.st_ino, before.st_mode)
    assert {p.name for p in (tmp_path / "run").iterdir()} == {"one.txt", "manifest.json"}
    write(tmp_path / "run", "two")
    assert (tmp_path / "run").stat().st_mode == before.st_mode
    assert {p.name for p in (tmp_path / "run").iterdir()} == {"two.txt", "manifest.json"}
    assert [p.name for p in tmp_path.iterdir()] == ["run"]


@pytest.mark.parametrize("number", [0, 1, 2])
def test_an_empty_folder_is_empty_again_after_an_interruption(tmp_path, monkeypatch, number):
    (tmp_path / "run").mkdir()
    rename, calls = Path.rename, count()

    def interrupted(self, target):
        if next(calls) == number:
            raise KeyboardInterrupt
        return rename(self, target)

    def fill():
        with artifacts.folder(tmp_path / "run", {}) as folder:
            (folder / "a.txt").write_text("a")
            (folder / "b.txt").write_text("b")
            monkeypatch.setattr(Path, "rename", interrupted)

    with pytest.raises(KeyboardInterrupt):
        fill()
    assert list((tmp_path / "run").iterdir()) == []


def test_the_place_is_checked_without_touching_it(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("a file")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.tex").write_text("mine")
    for place, message in {
        "file": "must be a folder or not exist yet",
        "file/below/it": "can be made and written to, got Not a directory",
        "full": "must be empty",
    }.items():
        with pytest.raises(ConfigurationError, match=message):
            artifacts.check(tmp_path / place)
    artifacts.check(tmp_path / "deep" / "run")
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != tmp_path)
    with pytest.raises(ConfigurationError, match="got Permission denied"):
        artifacts.check(tmp_path / "deep" / "run")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "full"]


def test_a_failure_to_write_is_told_in_one_line(tmp_path):
    def full():
        with artifacts.folder(tmp_path / "run", {}):
            raise OSError(28, "No space left on device")

    with pytest.raises(ConfigurationError, match=r"got No space left on device$"):
        full()
    assert list(tmp_path.iterdir()) == []


def draft(path, about, other, text="one"):
    with artifacts.draft(path, {"run": about}, other) as made:
        (made.folder / f"{text}.txt").write_text(text)
    return made.path


def test_another_result_is_refused_or_gets_the_next_number(tmp_path):
    first = draft(tmp_path / "run", 1, "number")
    assert first == tmp_path / "run"
    with pytest.raises(ConfigurationError, match="got that of another; --force"):
        draft(tmp_path / "run", 2, "refuse")
    assert draft(tmp_path / "run", 2, "number") == tmp_path / "run-2"
    assert draft(tmp_path / "run", 3, "number") == tmp_path / "run-3"
    assert draft(tmp_path / "run", 2, "number", "again") == tmp_path / "run-2"
    assert draft(tmp_path / "run", 1, "refuse", "again") == tmp_path / "run"
    files = {p.name: {f.name for f in p.iterdir()} for p in tmp_path.iterdir()}
    again, once = ({f"{name}.txt", "manifest.json"} for name in ("again", "one"))
    assert files == {"run": again, "run-2": again, "run-3": once}
    assert draft(tmp_path / "run", 2, "replace") == tmp_path / "run"
    assert json.loads((tmp_path / "run" / "manifest.json").read_text())["run"] == 2


def test_a_number_is_found_when_another_process_is_quicker(tmp_path):
    with artifacts.draft(tmp_path / "run", {"run": 1}, "number") as made:
        draft(tmp_path / "run", 2, "number")
    assert made.path == tmp_path / "run-2"
    with (
        pytest.raises(ConfigurationError, match="another"),
        artifacts.draft(tmp_path / "new", {"run": 1}, "refuse"),
    ):
        draft(tmp_path / "new", 2, "refuse")
    assert json.loads((tmp_path / "new" / "manifest.json").read_text())["run"] == 2
    assert sorted(os.listdir(tmp_path)) == ["new", "run", "run-2"]


@pytest.mark.parametrize("other", ["replace", "number", "refuse"])
def test_an_empty_folder_that_got_the_same_result_meanwhile_is_replaced(tmp_path, other):
    (tmp_path / "run").mkdir()
    with artifacts.draft(tmp_path / "run", {"run": 1}, other) as made:
        (made.folder / "new.txt").write_text("new")
        draft(tmp_path / "run", 1, "replace")
    assert made.path == tmp_path / "run"
    assert (made.path / "new.txt").read_text() == "new"
    assert os.listdir(tmp_path) == ["run"]


def test_an_empty_folder_that_another_process_has_filled_is_not_filled_twice(tmp_path):
    (tmp_path / "run").mkdir()
    with artifacts.draft(tmp_path / "run", {"run": 1}, "number") as made:
        draft(tmp_path / "run", 2, "number")
    assert made.path == tmp_path / "run-2"
    assert sorted(os.listdir(tmp_path)) == ["run", "run-2"]
    assert json.loads((tmp_path / "run" / "manifest.json").read_text())["run"] == 2


KILLED = """
import os, pathlib, signal, sys
from sblcosim import artifacts, manifests
path, number = pathlib.Path(sys.argv[1]), int(sys.argv[2])
rename = pathlib.Path.rename
count = 0
def killed(self, target):
    global count
    if count == number:
        os.kill(os.getpid(), signal.SIGKILL)
    count += 1
    return rename(self, target)
pathlib.Path.rename = killed
with artifacts.folder(path, {"run": 2}) as folder:
    for name in "abc":
        (folder / f"{name}.txt").write_text("new")
"""


@pytest.mark.skipif(os.name == "nt", reason="there is no SIGKILL")
@pytest.mark.parametrize("number", range(4))
@pytest.mark.parametrize("before", ["empty", "result"])
@one_in(3)
def test_a_kill_in_the_last_moment_leaves_what_was_before(tmp_path, before, number):
    run = tmp_path / "run"
    if before == "empty":
        run.mkdir()
    else:
        write(run)
    kept = sorted(os.listdir(run))
    ended = subprocess.run([sys.executable, "-c", KILLED, str(run), str(number)], check=False)
    if before == "result" and number > 1:
        assert ended.returncode == 0  # two are all
        return
    assert ended.returncode == -signal.SIGKILL
    artifacts.check(run)
    assert sorted(os.listdir(run)) == kept
    assert os.listdir(tmp_path) == ["run"]


@pytest.mark.parametrize(
    "text", ["[]", '{"files": 3}', '{"files": [[1]]}', '{"files": null}', "{}"]
)
def test_a_manifest_that_is_none_of_ours_is_somebody_elses_file(tmp_path, text):
    write(tmp_path / "run")
    (tmp_path / "run" / "manifest.json").write_text(text)
    must = r"must be empty or hold nothing but an earlier result, got 'manifest\.json' in it"
    with pytest.raises(ConfigurationError, match=must):
        write(tmp_path / "run")


@pytest.mark.parametrize(
    "text", ["", "{", "[" * 100_000, '{"sha256": 3}', '{"files": [], "hashes": {}}', "\udcff"]
)
def test_a_damaged_manifest_is_named_and_nothing_is_removed(tmp_path, text):
    write(tmp_path / "run")
    path = tmp_path / "run" / "manifest.json"
    path.write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(ConfigurationError) as caught:
        write(tmp_path / "run")
    assert str(caught.value).startswith(f"{path}: must be as it was written, got ")
    assert "\n" not in str(caught.value)
    assert (tmp_path / "run" / "one.txt").is_file()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes")
def test_a_pipe_in_the_place_of_a_file_is_not_waited_for(tmp_path):
    write(tmp_path / "run")
    text = str(tmp_path / "run" / "one.txt")
    for name, told in (("one.txt", [text]), ("manifest.json", [])):
        (tmp_path / "run" / name).unlink()
        os.mkfifo(tmp_path / "run" / name)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            manifests.tell(tmp_path / "run", "the folder is written anew")
        assert [str(w.message).partition(": ")[0] for w in caught] == told
    with pytest.raises(ConfigurationError, match="must be empty or hold nothing but an earlier"):
        write(tmp_path / "run")


def test_a_result_within_a_result_is_of_its_hashes(tmp_path):
    def nested(text="one"):
        with artifacts.folder(tmp_path / "run", {}) as folder:
            write(folder / "inner", text)

    def said():
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            nested()
        return [str(w.message).partition(": ")[0] for w in caught]

    nested()
    assert said() == []
    inner = tmp_path / "run" / "inner"
    (inner / "one.txt").write_text("two")
    assert said() == [str(inner / "one.txt")]
    assert said() == []
    files.remove(inner)
    write(inner, "two")  # sound, but another one
    assert said() == [str(inner / "manifest.json")]


def test_deep_folders_are_one_line_or_there(tmp_path):
    deep = tmp_path.joinpath(*["d"] * 1200)
    write(deep)
    assert (deep / "manifest.json").is_file()
    with pytest.raises(ConfigurationError, match="File name too long"):
        write(tmp_path.joinpath(*["d"] * 2040))
    os.system(f"rm -r '{tmp_path}/d'")  # pytest cannot
