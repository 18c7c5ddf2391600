"""Studies of spaces, and of functions in place of the simulation."""

from __future__ import annotations

import json
import re
import shutil
from math import nan, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import sblcosim
from quick import one_in
from sblcosim import cli
from sblcosim.analysis import workflow
from sblcosim.analysis.space import analysis as sensitivity
from sblcosim.analysis.space import sentences as sensitivity_sentences
from sblcosim.cli.documents.by_command import document as document_of
from sblcosim.errors import ConfigurationError
from sblcosim.report import study as reports
from sblcosim.report.common import as_toml
from sblcosim.report.space import Indices
from sblcosim.study import again, campaign, runner, store, study
from sblcosim.study.study import study_of
from seams import Seam
from typer.testing import CliRunner

AROUND = {"distribution": "uniform", "range": [-pi, pi]}
GPS = {"keys": ["platform.gps_horizontal_markov_std_m"], "distribution": "log-uniform",
       "range": [0.01, 3.0]}  # fmt: skip
TICK = {"keys": ["time.sampling_time_s"], "distribution": "uniform", "range": [0.2, 0.6]}
GRADE = {"keys": ["platform.imu_grade"], "distribution": "choice",
         "levels": ["consumer", "tactical"]}  # fmt: skip
FACTORS = {"gps": GPS, "tick": TICK, "imu": GRADE}
SPACE = {"kind": "space"}


def ishigami(x1: float, x2: float, x3: float, a: float = 7.0, b: float = 0.1) -> float:
    return sin(x1) + a * sin(x2) ** 2 + b * x3**4 * sin(x1)


def of_function(**changes: Any) -> study.Study:
    return study.load({
        "name": "ishigami", "model": ishigami, "design": {"kind": "space", "base_rows": 512},
        "factors": dict.fromkeys(("x1", "x2", "x3"), AROUND), **changes,
    })  # fmt: skip


def dive(**changes: Any) -> study.Study:
    return study.load({
        "name": "space", "scenario": "realistic-dive", "fixed": {"time": {"duration_s": 12.0}},
        "design": {"kind": "space", "base_rows": 16}, "factors": FACTORS, **changes,
    })  # fmt: skip


def test_a_published_function_goes_the_way_of_a_simulation(tmp_path: Path) -> None:
    """T. Ishigami, T. Homma, 1990: indices in closed form."""
    made = of_function()
    assert repr(made) == "<Study ishigami: 3 factors, 3,072 points × 1 = 3,072 runs>"
    table = made.run(tmp_path / "out")
    assert list(table.columns[3:7]) == ["x1", "x2", "x3", "seed"]
    assert made.sample is not None
    (found,) = sensitivity.of_table(made.sample, table, "ishigami.value", transform="none")
    for name, first, total in (("x1", 0.3139, 0.5576), ("x2", 0.4424, 0.4424), ("x3", 0, 0.2437)):
        row = found.indices.loc[name]
        assert row["first_low"] <= first <= row["first_high"]
        assert row["total_low"] <= total <= row["total_high"]
    assert found.indices.loc["seed", "total"] == 0
    again_made = study_of(tmp_path / "out")
    assert again_made.points == made.points
    pd.testing.assert_frame_equal(again_made.run(tmp_path / "out"), table)  # nothing is missing
    with pytest.raises(ConfigurationError, match=r"model: must be available to do more runs"):
        again_made.run(tmp_path / "elsewhere")
    with pytest.raises(ConfigurationError, match="must hold simulated runs to repeat one"):
        again.replay(tmp_path / "out", table["run_id"][0])


def test_a_function_may_have_any_design_and_conditions(tmp_path: Path) -> None:
    made = study.load({
        "model": lambda a, b, kind: a * b + (kind == "odd"), "design": {"kind": "grid"},
        "factors": {"a": {"levels": [1, 2, 3]}, "kind": {"levels": ["odd", "even"]}},
        "conditions": {"b": {"levels": [1, 10]}},
    })  # fmt: skip
    table = made.run(tmp_path)
    expected = table["a"] * table["b"] + (table["kind"] == "odd")
    np.testing.assert_array_equal(table["<lambda>.value"], expected)


def test_a_space_is_run_with_the_seed_as_a_factor(tmp_path: Path) -> None:
    made = dive()
    table = made.run(tmp_path / "out", workers=1)
    assert len(table) == 16 * (3 + 3)
    assert table["error"].isna().all()
    assert table["run_id"].is_unique  # also where a choice is swapped for itself
    by_row = table["seed"].to_numpy().reshape(16, 6)
    assert (by_row[:, :4] == by_row[:, :1]).all()  # swapped rows keep their seed
    assert (by_row[:, 4] != by_row[:, 0]).all()  # one column swaps it
    assert np.array_equal(table["tick"] * 1e3, np.rint(table["tick"] * 1e3))
    assert set(table["imu"]) == {"consumer", "tactical"}
    groups = campaign.prepare(made).groups  # rows that share a sampling time share lanes
    assert len(groups) == table["tick"].nunique() <= len(table) / 3
    row = table.iloc[7]
    direct = sblcosim.run("realistic-dive", overrides={
        "time.duration_s": 12.0, "time.sampling_time_s": row["tick"], "seed": int(row["seed"]),
        "platform.gps_horizontal_markov_std_m": row["gps"], "platform.imu_grade": row["imu"],
    })  # fmt: skip
    assert row["coupled.absolute_total_rms_m"] == pytest.approx(
        direct.errors.loc["coupled", "absolute", "total"].rms_m, rel=1e-12
    )
    assert again.replay(tmp_path / "out", row["run_id"]).errors.equals(direct.errors)
    dive().run(tmp_path / "two", workers=2)
    names = ("out/runs.parquet", "two/runs.parquet")
    first, second = ((tmp_path / name).read_bytes() for name in names)
    assert first == second
    text = as_toml(study_of(tmp_path / "out").tables())
    (tmp_path / "again.toml").write_text(text)
    assert study.load(tmp_path / "again.toml").points == made.points


def test_a_study_that_was_begun_with_the_old_sample_is_finished_and_read_with_it(
    tmp_path: Path,
) -> None:
    """Its folder names no version, as none of its time does."""
    old = of_function(design={"kind": "space", "base_rows": 16, "sample": 1})
    whole = old.run(tmp_path / "whole")
    begun = tmp_path / "begun"
    shutil.copytree(tmp_path / "whole", begun)
    assert "sample" not in json.loads((begun / "study.json").read_text())["definition"]["study"][
        "design"
    ]
    for file in (begun / "runs.parquet", *(begun / "parts").iterdir()):
        file.unlink()
    fresh = of_function(design={"kind": "space", "base_rows": 16})
    table = fresh.run(begun)
    pd.testing.assert_frame_equal(table, whole)
    assert fresh.sample is not None
    assert not np.array_equal(fresh.sample.values["x1"], table["x1"])
    for file in ("runs.parquet", "study.json"):
        assert (begun / file).read_bytes() == (tmp_path / "whole" / file).read_bytes()
    prepared = campaign.prepare(store.as_begun(fresh, begun))
    assert runner.missing(prepared, begun).runs == 0  # as a dry run asks
    read = study_of(begun)
    assert read.sample is not None
    assert read.sample.version == 1
    (found,) = workflow.of_space(read, table, "value")
    assert found.text().count("This study has the sample of an earlier version") == 1
    assert "sample = 1" in as_toml(read.tables())
    with pytest.raises(ConfigurationError, match="is it another version of the sample"):
        workflow.of_space(fresh, table, "value")
    with pytest.raises(ConfigurationError, match="must be empty or hold results of this study"):
        of_function(design={"kind": "space", "base_rows": 16, "sample": 2}).run(begun)
    new = tmp_path / "new"
    fresh.run(new)
    assert json.loads((new / "study.json").read_text())["definition"]["study"]["design"][
        "sample"
    ] == 2
    read = study_of(new)
    assert read.sample is not None
    assert read.sample.version == 2
    assert "earlier version" not in workflow.of_space(read, fresh.run(new), "value")[0].text()


def test_a_dry_run_knows_the_sample_of_the_folder(tmp_path: Path) -> None:
    (tmp_path / "model.py").write_text("def f(x):\n    return x\n")
    space = '{keys}[design]\nkind = "space"\nbase_rows = 16\n{sample}[factors.x]\n' \
        'distribution = "uniform"\nrange = [0, 1]\n'
    file = tmp_path / "old.toml"
    file.write_text(space.format(keys='model = "model.py:f"\n', sample="sample = 1\n"))
    out = ["--out", str(tmp_path / "out")]
    assert CliRunner().invoke(cli.app, ["study", str(file), *out]).exit_code == 0
    file.write_text(space.format(keys='model = "model.py:f"\n', sample=""))
    said = CliRunner().invoke(cli.app, ["study", str(file), *out, "--dry-run"])
    assert "64 runs are in" in said.stdout, said.output


@pytest.mark.parametrize(("least", "most", "said"), [
    (0.1, 0.2, "about 1 s"), (1, 30, "about 1 to 30 s"), (89, 89, "about 89 s"),
    (89, 90, "about 89 s to 1.5 min"), (90, 90, "about 1.5 min"), (150, 150, "about 2.5 min"),
    (600, 3600, "about 10 to 60 min"), (5340, 5340, "about 89 min"), (5400, 5400, "about 1.5 h"),
    (9000, 9000, "about 2.5 h"), (100, 36_000, "about 1.7 min to 10 h"),
    (255_600, 255_600, "about 71 h"), (259_200, 259_200, "about 3 days"),
    (432_000, 432_000, "about 5 days"), (36_000, 1e8, "about 10 h to 1,157 days"),
    (120, 60, "about 2 min"),
])  # fmt: skip
@one_in(3)
def test_a_dry_run_says_how_long_in_the_unit_that_fits(
    tmp_path: Path, seam: Seam, least: float, most: float, said: str
) -> None:
    """Seconds and minutes below 90, hours below 72; the times may come in the wrong order."""
    (tmp_path / "model.py").write_text("def f(x):\n    return x\n")
    file = tmp_path / "study.toml"
    file.write_text('model = "model.py:f"\n[design]\nkind = "full"\n[factors.x]\nlevels = [0, 1]\n')
    seam.instead(runner.estimate, lambda *_: (least, most))
    out = ["--out", str(tmp_path / "out"), "--dry-run"]
    done = CliRunner().invoke(cli.app, ["study", str(file), *out])
    assert f"; {said} on this machine; nothing was run" in done.stdout, done.output


def partly(x1: float, x2: float, x3: float, far: float = 0.0) -> float:
    return x1 if x1 + x2 < far else nan


@pytest.mark.parametrize(("far", "refused"), [(5.3, False), (3.0, True)])
def test_reports_and_documents_say_which_rows_are_left_out(
    tmp_path: Path, far: float, refused: bool
) -> None:
    made = of_function(
        model=lambda x1, x2, x3: partly(x1, x2, x3, far),
        design={"kind": "space", "base_rows": 256},
    )
    made.run(tmp_path / "out")
    if refused:
        with pytest.raises(ConfigurationError, match="of at least 80 % of the base rows, got "):
            reports.analysed(tmp_path / "out").save(tmp_path / "page", other="replace")
        assert not (tmp_path / "page").exists()
        return
    found = reports.analysed(tmp_path / "out")
    found.save(tmp_path / "page", other="replace")
    assert isinstance(found.found, Indices)
    assert 0 < found.found.main.left_out < 0.2 * 256
    sentence = sensitivity_sentences.answer(found.found.main)
    assert sentence.startswith("Without ")
    document: Any = document_of(found, tmp_path)
    assert document.answer == sentence
    assert document.left_out == found.found.main.left_out / 256
    assert document.dropped == found.found.main.dropped >= found.found.main.left_out
    page = re.sub(r"\s+", " ", (tmp_path / "page" / "report.html").read_text())
    assert sentence.replace("'", "&#39;") in page
    assert f"{found.found.main.left_out} of 256 base rows are left out" in page


PROBLEMS = [
    ({"factors": {"gps": {"keys": GPS["keys"], "levels": [1, 2]}}}, "did you mean distribution = "),
    ({"factors": {"gps": {**GPS, "range": None}}}, "range: must be given for the distribution"),
    ({"factors": {"gps": {**GPS, "distribution": "log-unifrm"}}}, "did you mean 'log-uniform'"),
    ({"factors": {"gps": {**GPS, "range": [-1.0, 1.0]}}}, "range: must be above 0"),
    ({"factors": {"gps": {**GPS, "distribution": "uniform", "range": [-1.0, 1.0]}}},
     r"\[factors.gps\] range: must be within the bounds of its keys, 0 to"),
    ({"factors": {"imu": {**GRADE, "distribution": "uniform", "levels": None, "range": [0, 1]}}},
     r"\[factors.imu\] distribution: must be 'choice' for a key that is one of 'marine'"),
    ({"factors": {"imu": {**GRADE, "levels": ["consumer", "tacticl"]}}}, "imu_grade: must be 'mar"),
    ({"replicates": 2}, "replicates: must be left out in a space, where the seed is a factor"),
    ({"seeding": "common"}, "seeding: must be left out in a space"),
    ({"design": {"kind": "space", "base_rows": 100}}, "base_rows: must be a power of 2"),
    ({"design": {"kind": "space", "sample": 3}}, r"\[design\] sample: must be 1 or 2"),
    ({"design": {"kind": "full", "sample": 1}}, "kind: must be 'space' with sample, got .full."),
    ({"design": {"kind": "grid"}}, "distribution: must be left out, except in a space"),
    ({"scenario": ""}, "scenario: must be given"),
    ({"model": ishigami}, "scenario: must be left out with a model"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "message"), PROBLEMS)
def test_what_is_wrong_with_a_space_is_said(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigurationError, match=message) as caught:
        dive(**changes)
    if "model" not in changes and changes.get("design", SPACE)["kind"] == "space":
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"factors": {"x": AROUND}}, "ishigami must take the factor 'x'"),
        ({"factors": {"x1": AROUND, "x2": AROUND}}, "must have a default for 'x3'"),
        ({"factors": {n: {**AROUND, "keys": ["platform.beaufort"]} for n in ("x1", "x2", "x3")}},
         "keys: must be left out with a model"),
        ({"model": "nowhere.py:f"}, "nowhere.py"),
        ({"model": 3}, r"model: must be FILE.py:FUNCTION"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_function_is_said(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        of_function(**changes)


def test_a_space_is_reported(tmp_path: Path) -> None:
    made = dive(responses=["absolute_total_p95_m"])
    table = made.run(tmp_path / "out")
    found = reports.analysed(tmp_path / "out", "absolute_total_p95_m")
    found.save(tmp_path / "page", other="replace")
    assert isinstance(found.found, Indices)
    assert found.found.main.transform == "log"  # of errors, unless told otherwise
    assert made.sample is not None
    direct = sensitivity.of_table(made.sample, table, "coupled.absolute_total_p95_m")
    pd.testing.assert_frame_equal(found.found.main.indices, direct[0].indices)
    written = pd.read_csv(tmp_path / "page" / "indices.csv")
    assert written["factor"].tolist()[:4] == ["gps", "tick", "imu", "seed"]
    page = (tmp_path / "page" / "report.html").read_text()
    assert "log-uniform, range 0.01 to 3" in page
    document: Any = document_of(found, tmp_path)
    assert [row.factor for row in document.indices[:4]] == ["gps", "tick", "imu", "seed"]
    with pytest.raises(ConfigurationError, match="practical: must be left out for a design of"):
        reports.analysed(tmp_path / "out", practical=1.0).save(tmp_path / "other", other="replace")
    assert not (tmp_path / "other").exists()


def test_the_indices_of_a_space_are_those_over_its_conditions(tmp_path: Path) -> None:
    conditions = {"sea": {"keys": ["platform.beaufort"], "levels": [2, 4]}}
    made = dive(factors={"gps": GPS, "tick": TICK}, conditions=conditions)
    table = made.run(tmp_path)
    assert len(table) == 2 * 16 * 5
    total = "coupled.absolute_total_rms_m"
    means = (table[total][:80].to_numpy() + table[total][80:].to_numpy()) / 2
    found = workflow.of_space(made, table)[0]
    np.testing.assert_array_equal(found.values, means)
