from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
from sblcosim import style
from sblcosim.errors import ConfigurationError
from sblcosim.result import Result
from synthetic_record import make_record

FIGURES = ("path_xy", "path_xyz", "axes", "errors", "inclination")


class Settings:
    """Stands for a scenario."""

    title = "A hand-made dive <1>"

    def model_dump(self, mode):
        assert mode == "json"
        return {"speed_m_s": 0.5}

    def dump_toml(self):
        return "speed_m_s = 0.5\n"


@pytest.fixture
def result():
    record = make_record(
        {"ekf": np.array([[3.0, 4, 0]]), "raw": np.array([[0.0, 0, 2]])},
        platform_error=(3.0, 0.0, 0.0),
    )
    return Result(
        "dive", Settings(), record, ("ekf", "raw"), fmus={"ekf": "ab12"}, seeds={"target": 7},
        update_interval_ns=100_000_000,
    )


def test_tables_hold_each_receiver(result):
    assert result.record.shape[0] == 101
    assert "target.position[1]" in result.record
    assert list(result.estimates) == ["ekf", "raw"]
    assert result.errors.loc[("ekf", "absolute", "total"), "rms_m"] == pytest.approx(5)
    assert result.errors.loc[("ekf", "relative", "total"), "rms_m"] == pytest.approx(4)
    assert result.summary.loc["raw", "update_share"] == 1


def test_text_shows_both_frames_of_each_receiver_and_what_its_filter_claims(result):
    text = str(result)
    assert text.startswith("A hand-made dive")
    (total,) = [line for line in text.splitlines() if line.split()[:1] == ["total"]][:1]
    assert total.split() == ["total", "5.000", "5.000", "0.000", "4.000", "4.000", "0.000"]
    assert "ekf: 99 estimates, the first at 0.1 s; a fix available 98.0 % of the time" in text
    assert "mean NEES of the position 100.00 (2.54 to 3.50: optimistic)" in text
    assert "inconsistent" in text
    assert "independent samples" in text
    assert all(len(line) <= 120 for line in text.splitlines())


def test_html_shows_the_table_and_escapes_the_title(result):
    html = result._repr_html_()
    assert "A hand-made dive &lt;1&gt;" in html
    assert html.count("<table") == 1
    assert "5.000" in html


def test_json_is_plain_and_holds_errors_and_summary(result):
    data = json.loads(json.dumps(result.to_json(), allow_nan=False))
    assert data["scenario_name"] == "dive"
    assert data["errors"]["ekf"]["absolute"]["x"]["rms_m"] == pytest.approx(3)
    assert data["errors"]["ekf"]["absolute"]["x"]["n"] == 99
    assert data["summary"]["ekf"]["inconsistent"] is True


def test_saved_folder_is_complete(result, tmp_path):
    folder = result.save(tmp_path / "run")
    present = {path.name for path in folder.iterdir()}
    tables = ("record", "estimates", "errors", "summary")
    assert present == {
        "manifest.json", "scenario.toml",
        *(f"{name}.{kind}" for name in FIGURES for kind in ("svg", "png")),
        *(f"{name}.{kind}" for name in tables for kind in ("csv", "parquet")),
    }
    assert all(path.stat().st_size > 0 for path in folder.iterdir())
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["scenario"] == {"speed_m_s": 0.5}
    assert manifest["fmus"] == {"ekf": "ab12"}
    assert manifest["seeds"] == {"target": 7}
    assert {"sblcosim", "python", "numpy", "casadi", "fmpy"} <= set(manifest["software"])
    assert set(manifest["files"]) == present - {"manifest.json"}
    assert str(tmp_path) not in (folder / "manifest.json").read_text()


def test_saved_tables_are_those_of_the_result(result, tmp_path):
    folder = result.save(tmp_path / "run", figures=False)
    pd.testing.assert_frame_equal(pd.read_parquet(folder / "record.parquet"), result.record)
    errors = pd.read_csv(folder / "errors.csv")
    pd.testing.assert_frame_equal(
        errors.set_index(["receiver", "frame", "axis"]), result.errors, check_dtype=False
    )
    estimates = pd.read_parquet(folder / "estimates.parquet")
    assert estimates["receiver"].unique().tolist() == ["ekf", "raw"]
    assert len(estimates) == 2 * 99


def test_same_result_saved_twice_gives_the_same_bytes(result, tmp_path):
    folders = [result.save(tmp_path / name) for name in ("a", "b")]
    for path in folders[0].iterdir():
        assert path.read_bytes() == (folders[1] / path.name).read_bytes(), path.name


def test_error_while_saving_leaves_nothing(result, tmp_path, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(style, "save", interrupt)
    with pytest.raises(KeyboardInterrupt):
        result.save(tmp_path / "run")
    assert not list(tmp_path.iterdir())


def test_foreign_folder_is_refused(result, tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(ConfigurationError):
        result.save(tmp_path)


def test_plots_are_those_of_the_run(result):
    assert result.plot_path().get_xlabel() == "East y [m]"
    assert result.plot_path_3d().get_zlabel() == "Depth z [m]"
    assert len(result.plot_axes()) == 3
    assert len(result.plot_errors(frame="relative")) == 4
    assert len(result.plot_inclination()) == 3


def test_plain_scenario_without_a_title_goes_by_its_name():
    result = Result("dive", {"speed_m_s": 0.5}, make_record(), ("ekf",))
    assert str(result).startswith("dive\n")
    assert np.isnan(result.summary.loc["ekf", "update_share"])
