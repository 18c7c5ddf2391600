from __future__ import annotations

import csv
import json

import numpy as np
import pandas as pd
import pytest
from sblcosim import artifacts
from sblcosim.errors import ConfigurationError


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


def test_plain_data_is_what_json_knows():
    value = {"a": np.float64(1.5), 2: (np.int64(3), np.nan), "b": np.bool_(True),
             "c": {"d": np.inf, "e": np.array([1, 2])}, "f": None, "g": "word"}
    plain = artifacts.plain(value)
    assert plain == {"a": 1.5, "2": [3, None], "b": True, "c": {"d": None, "e": [1, 2]},
                     "f": None, "g": "word"}
    json.dumps(plain, allow_nan=False)
