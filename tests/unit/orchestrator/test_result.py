from __future__ import annotations

import html
import json
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from pyarrow import parquet
from sblcosim import style
from sblcosim.catalogue import jobs
from sblcosim.data.description import RunDescription
from sblcosim.data.record import Record
from sblcosim.errors import ConfigurationError
from sblcosim.results.result import FIGURES as FIGURES_OF_A_RUN
from sblcosim.results.result import Result
from sblcosim.results.text import overview
from sblcosim.scenario.scenario import shipped
from synthetic_record import make_record, silent

FIGURES = ("path_xy", "path_xyz", "axes", "errors", "inclination")


class Settings:
    """Stands for a scenario."""

    title = "A hand-made dive <1>"

    def model_dump(self, mode):
        assert mode == "json"
        return {"speed_m_s": 0.5}

    def dump_toml(self, folder=None):
        return "speed_m_s = 0.5\n"


@pytest.fixture
def result():
    record = make_record(
        {"ekf": np.array([[3.0, 4, 0]]), "raw": np.array([[0.0, 0, 2]])},
        platform_error=(3.0, 0.0, 0.0),
    )
    description = RunDescription(
        "dive", Settings(), ("ekf", "raw"), fmus={"ekf": "ab12"}, seeds={"target": 7}
    )
    return Result(description, record, update_interval_ns=100_000_000)


def told(result):
    return result.text(verbose=True)


def run_of(receivers, record):
    return Result(RunDescription("dive", {}, receivers), record)


def test_tables_hold_each_receiver(result):
    assert result.table.shape[0] == 101
    assert "target.position[1]" in result.table
    assert list(result.tracks) == ["ekf", "raw"]
    assert [*result.estimates.groupby("receiver", sort=False).groups] == ["ekf", "raw"]
    for name, table in result.estimates.groupby("receiver"):
        own = result.tracks[str(name)]
        pd.testing.assert_frame_equal(table[own.columns].reset_index(drop=True), own)
    assert result.errors.loc[("ekf", "absolute", "total"), "rms_m"] == pytest.approx(5)
    assert result.errors.loc[("ekf", "relative", "total"), "rms_m"] == pytest.approx(4)
    assert result.summary.loc["raw", "update_share"] == 1


def without(record, *ports, **values):
    kept = {name: v for name, v in record.values.items() if name not in ports}
    return Record(record.time_ns, {**kept, **values})


def test_of_a_receiver_without_covariance_it_is_said_that_consistency_is_unknown(result):
    assert "consistency unknown" not in told(result)
    record = without(result.record, "ekf.covariance")
    bare = run_of(("ekf", "raw"), record)
    assert "  consistency unknown: no covariance\n" in told(bare)
    assert "consistency unknown" in bare._repr_html_()
    flags = {name: row["inconsistent"] for name, row in bare.to_json()["summary"].items()}
    assert flags == {"ekf": None, "raw": True}
    json.dumps(bare.to_json(), allow_nan=False)
    useless = {"ekf.covariance": np.zeros((101, 6, 6))}
    bad = run_of(("ekf", "raw"), without(result.record, **useless))
    assert "  consistency unknown: its covariance is never positive definite\n" in told(bad)


def test_the_written_summary_of_a_receiver_without_covariance_misses_the_flag(result, tmp_path):
    record = without(result.record, "ekf.covariance")
    run_of(("ekf", "raw"), record).save(tmp_path / "out", figures=False)
    column = parquet.read_table(tmp_path / "out" / "summary.parquet")["inconsistent"]
    assert (str(column.type), column.to_pylist()) == ("bool", [None, True])


def test_a_receiver_without_an_estimate_is_a_problem_in_words():
    record = silent("ekf")
    heard = np.zeros((101, 4), np.int32)
    heard[-1] = [3, 0, 2, 1]
    record = without(record, **{"acoustics.reception_count": heard})
    result = run_of(("ekf",), record)
    why = (
        "update_count stayed 0; packets received from each beacon: 3, 0, 2, 1; look at "
        "ekf.update_count, ekf.valid, acoustics.reception_count in the record"
    )
    assert result.problems == [f"ekf: must give at least one estimate, got none; {why}"]
    text = told(result)
    assert f"ekf: no estimate; {why}" in text
    assert "nan" not in text.lower()


def test_a_receiver_that_is_never_valid_is_a_problem_that_says_so(result):
    invalid = without(result.record, **{"ekf.valid": np.zeros(101, bool)})
    (problem,) = run_of(("ekf", "raw"), invalid).problems
    assert problem.startswith(
        "ekf: must give at least one estimate, got none; update_count reached 99, but there was no "
        "valid fix when it changed; look at ekf.update_count, ekf.valid in the record"
    )


def test_the_raw_fix_runs_along_and_may_have_no_estimate(result):
    invalid = without(result.record, **{"raw.valid": np.zeros(101, bool)})
    bare = run_of(("ekf", "raw"), invalid)
    assert bare.problems == []
    assert "raw: no estimate" in told(bare)


def test_text_shows_both_frames_of_each_receiver_and_what_its_filter_claims(result):
    text = told(result)
    assert "\n\nA hand-made dive <1>\n\nError [m]" in text
    (total,) = [line for line in text.splitlines() if line.split()[:1] == ["total"]][:1]
    assert total.split() == ["total", "5.000", "5.000", "0.000", "4.000", "4.000", "0.000"]
    assert "ekf: 99 estimates, the first at 0.1 s; a fix available 98.0 % of the time" in text
    assert "100.0 % of the updates gave a new estimate" in text
    comparison = "expected 3.00 (95 %: 2.54 to 3.50): optimistic, errors larger than claimed"
    assert f"mean NEES of the position 100.00, {comparison}" in text
    assert f"mean relative NEES of the position 64.00, {comparison}" in text
    assert "mean NIS 5.00, expected 5.00 (95 %: 4.40 to 5.64): consistent\n" in text


def test_one_run_is_said_to_be_no_proof_of_a_covariance(result):
    words = "  covariance: looks optimistic by a factor of 5.77; one run cannot tell, because "
    assert words in told(result)
    right = make_record({"ekf": np.array([[np.sqrt(0.75), 0, 0]])})
    assert "  covariance: looks right; one run cannot tell" in told(run_of(("ekf",), right))
    assert "one run cannot tell" not in told(run_of(("ekf",), make_record(optional_ports=False)))


@pytest.fixture
def with_own(result):
    """The EKF says where it is from the platform, off by (1, 2, 2) m; the raw fix does not."""
    position = result.record.values["target.position"]
    count = result.record.values["ekf.update_count"]
    record = without(
        result.record,
        **{
            "ekf.relative_position": position[count] + np.array([1.0, 2.0, 2.0]),
            "ekf.relative_covariance": np.tile(3.0 * np.eye(3), (101, 1, 1)),
        },
    )
    return Result(result.description, record)


def test_own_relative_errors_are_beside_the_others_and_absent_of_whom_has_none(with_own):
    assert with_own.errors.loc[("ekf", "own_relative", "total"), "rms_m"] == pytest.approx(3)
    assert with_own.percentiles.loc[("ekf", "own_relative", "total"), "max_m"] == pytest.approx(3)
    for table in (with_own.errors, with_own.percentiles):
        assert ("raw", "own_relative") not in table.index.droplevel(2)
    assert with_own.summary.loc["ekf", "own_relative_nees_position"] == pytest.approx(3)
    assert with_own.summary.loc["ekf", "own_relative_nees_position_verdict"] == "consistent"
    assert np.isnan(with_own.summary.loc["raw", "own_relative_nees_position"])
    data = json.loads(json.dumps(with_own.to_json(), allow_nan=False))
    assert data["errors"]["ekf"]["own_relative"]["y"]["rms_m"] == pytest.approx(2)
    assert "own_relative" not in data["errors"]["raw"]
    assert set(data["consistency"]["ekf"]) == {"absolute", "own_relative"}
    assert set(data["consistency"]["raw"]) == {"absolute"}


def test_both_relative_errors_are_named_apart_wherever_they_stand(with_own, result):
    text = told(with_own)
    assert len(re.findall(r"absolute +relative to the platform\n", text)) == 2
    assert len(re.findall(r" {6,}relative to the platform's\n +true position, own acc", text)) == 2
    own = text.partition("relative to the platform's\n")[2].partition("\n\n")[0]
    totals = [line.split() for line in own.splitlines() if line.split()[:1] == ["total"]]
    assert totals == [["total", "3.000", "3.000", "0.000"]]  # and no rows for who has none
    wide = with_own.text(verbose=True, width=120)
    assert len(re.findall(r"relative to the platform +relative to the platform's\n", wide)) == 2
    totals = [line.split() for line in wide.splitlines() if line.split()[:1] == ["total"]]
    assert totals[1][-3:] == ["–", "–", "–"]
    assert "mean own relative NEES of the position 3.00" in text
    assert "covariance relative to the platform: looks right; one run" in text
    assert text.count("by the receiver's own account") == 1
    page = html.unescape(with_own._repr_html_())
    assert "relative to the platform as it reports itself" in page
    assert "relative to the platform's true position, by the receiver's own account" in page
    assert "own account" not in told(result)
    assert "own account" not in result._repr_html_()
    assert told(result).count("as it reports itself") == 3
    few = str(with_own).splitlines()[-1]
    assert few == (
        "relative: to the platform as it reports itself; own relative: to its true position, by "
        "own account"
    )
    assert "own" not in str(result)


def test_text_says_what_its_numbers_mean(result):
    for page in (told(result), html.unescape(result._repr_html_())):
        for words in (
            "x, y, z are north, east, down",
            "error = estimate − truth",
            "total = length of the 3-D error",
            "less the mean beacon error (reported − true) at the estimate's epoch",
            "raw is the multilateration fix",
            "NEES is of the absolute error",
            "independent samples",
        ):
            assert page.count(words) == 1


def test_text_explains_only_what_is_there():
    text = told(run_of(("ekf",), make_record(optional_ports=False)))
    assert "north, east, down" in text
    assert "raw" not in text
    assert "NEES" not in text


def test_small_errors_are_pessimistic_in_words():
    text = told(run_of(("ekf",), make_record({"ekf": np.array([[0.1, 0, 0]])})))
    assert "pessimistic, errors smaller than claimed" in text


def test_nis_of_unknown_degrees_is_not_compared():
    record = make_record()
    values = {name: v for name, v in record.values.items() if name != "ekf.nis_degrees"}
    k = np.arange(101.0)
    values["ekf.nis"] = np.where(k % 7 == 3, np.nan, k)
    text = told(run_of(("ekf",), Record(record.time_ns, values)))
    mean = k[2:][k[2:] % 7 != 3].mean()
    assert f"mean NIS {mean:.2f}, of unknown degrees of freedom" in text


def test_long_labels_keep_the_table_s_columns_in_line():
    labels = ("a_receiver_with_a_rather_long_name", "ekf")
    record = make_record(dict.fromkeys(labels, np.ones((1, 3))))
    lines = told(run_of(labels, record)).splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("receiver"))
    head, name, *table = lines[start : start + 10]
    assert name == labels[0]
    assert {len(line) for line in table} == {len(head)}
    assert head.index("axis") == table[0].index("x ") == table[4].index("x ")


def test_the_first_lines_are_a_verdict_for_each_receiver(result):
    lines = str(result).splitlines()
    assert lines[0] == (
        "ekf: 5.0 m RMS, 95 % within 5.0 m; claims 0.87 m: do not trust its covariance; "
        "misleading: 5.77 times as far off as it claims, direction by direction"
    )
    assert lines[1].startswith("raw: 2.0 m RMS, 95 % within 2.0 m; claims 0.87 m: ")
    right = make_record({"ekf": np.array([[0.5, 0.5, 0.5]]), "raw": np.array([[1.0, 0, 0]])})
    fits, less = str(run_of(("ekf", "raw"), right)).splitlines()[:2]
    assert fits.endswith("claims 0.87 m: looks right")
    assert less.endswith("claims 0.87 m: perhaps optimistic")
    small = str(run_of(("ekf",), make_record({"ekf": np.array([[0.1, 0, 0]])})))
    assert small.splitlines()[0].endswith("claims 0.87 m: perhaps pessimistic")
    bare = without(result.record, "ekf.covariance")
    assert str(run_of(("ekf",), bare)).startswith("ekf: 5.0 m RMS, 95 % within 5.0 m; no covar")
    silent = without(result.record, **{"ekf.valid": np.zeros(101, bool)})
    assert str(run_of(("ekf",), silent)).startswith("ekf: no estimate; update_count reached 99")
    far = run_of(("ekf",), make_record({"ekf": np.array([[50.0, 0, 0]])}))
    assert str(far).startswith("ekf: lost; 50 m RMS")


def test_a_lost_receiver_is_not_said_to_look_right():
    errors = {"ekf": np.array([[50.0, 0, 0]])}
    wide = str(run_of(("ekf",), make_record(errors, variance=900.0))).splitlines()[0]
    assert wide == "ekf: lost; 50 m RMS, 95 % within 50 m; claims 52 m"
    small = str(run_of(("ekf",), make_record(errors))).splitlines()[0]
    assert "; claims 0.87 m: do not trust its covariance; misleading: 57.7 times as far" in small


def test_one_run_is_said_not_to_tell_unless_it_does(result):
    telling = "One run cannot tell whether a covariance is right. A study can.\n"
    sure = make_record({"ekf": np.array([[3.0, 4, 0]])})
    assert telling not in str(run_of(("ekf",), sure))
    assert telling in str(run_of(("ekf",), make_record({"ekf": np.array([[1.0, 0, 0]])})))
    assert telling not in str(run_of(("ekf",), make_record(optional_ports=False)))


def test_errors_where_the_covariance_has_none_are_of_its_shape():
    flat = np.diag([100.0, 1, 0.04, 1, 0.04, 1])  # position and velocity of each axis
    record = make_record({"ekf": np.array([[0.0, 0.5, 0]])})
    own = {"ekf.covariance": np.tile(flat, (101, 1, 1))}
    result = run_of(("ekf",), without(record, "ekf.position_std", **own))
    assert result.consistency["ekf"]["absolute"].factor > 1.1
    assert str(result).splitlines()[0].endswith("claims 10 m: perhaps optimistic in some direction")


def test_explanations_and_consistency_are_told_on_request(with_own):
    short = str(with_own)
    for words in ("NEES", "north, east, down", "available", "Reference", "by the receiver's own"):
        assert words not in short
        assert (words in told(with_own)) == (words != "Reference")  # nothing is possible here
    assert told(with_own).startswith(short.partition("\n\n")[0])


def test_the_first_screen_is_the_verdicts_and_one_small_table(with_own):
    """At most 24 lines of 60 columns, with the one that says where it is written."""
    lines = with_own.text(width=60).splitlines()
    assert len(lines) < 24
    assert max(map(len, lines)) <= 60
    assert not any(word in with_own.text() for word in ("axis", "67 %", "Within"))
    start = next(i for i, line in enumerate(lines) if line.endswith("error [m]"))
    heads, columns, *rows = (
        line for line in lines[start + 1 : -2] if not line.startswith("  horizontal")
    )
    assert heads.split() == ["absolute", "relative", "own", "relative"]
    assert columns.split() == ["RMS", "95", "%"] * 3
    assert len({len(line) for line in (heads, columns, *rows)}) == 1
    for receiver, row in zip(with_own.receivers, rows, strict=True):
        name, rms, within, *_ = row.split()
        assert name == receiver
        error = with_own.errors.loc[(receiver, "absolute", "total"), "rms_m"]
        assert float(rms) == pytest.approx(error, rel=5e-3)
        most = with_own.percentiles.loc[(receiver, "absolute", "total"), "p95_m"]
        assert float(within) == pytest.approx(most, rel=5e-3)


def test_the_horizontal_error_is_told_first_only_where_it_differs():
    flat, deep = (
        str(run_of(("ekf",), make_record({"ekf": np.array([[3.0, 4.0, down]])})))
        for down in (0.1, 3.0)
    )
    assert "horizontal" not in flat
    (row,) = [line.split() for line in deep.splitlines() if "horizontal" in line]
    assert row == ["horizontal", "5.00", "5.00", "5.00", "5.00"]


@pytest.mark.parametrize(("width", "name"), [
    (80, "a_receiver_with_a_rather_long_name"), (60, "a_receiver_with_…ather_long_name"),
    (50, "a_receiver_…_long_name"), (40, "a_receiv…ng_name"), (30, "a_receiv…ng_name"),
])  # fmt: skip
def test_names_are_shortened_to_what_the_columns_leave(width: int, name: str) -> None:
    labels = ("a_receiver_with_a_rather_long_name", "ekf")
    result = run_of(labels, make_record(dict.fromkeys(labels, np.ones((1, 3)))))
    rows = [line for line in overview(result, width) if "   1." in line]
    assert rows[0].startswith(f"{name}   1.73")
    assert {len(row) for row in rows} == {len(name) + 28}


@pytest.mark.parametrize("width", [60, 72, 80, 100, 120, 200])
def test_text_fits_the_width(with_own, width):
    text = with_own.text(verbose=True, width=width)
    assert max(map(len, text.splitlines())) <= width
    words = with_own.text(verbose=True, width=1000).split()
    assert set(words) == {"–", *text.split()}


def test_text_counts_one_estimate_as_one():
    errors = np.zeros((2, 3))[:1]
    record = make_record({"ekf": np.vstack([errors, errors])})
    values = {**record.values, "ekf.update_count": np.minimum(
        record.values["ekf.update_count"], 1
    )}
    text = told(run_of(("ekf",), Record(record.time_ns, values)))
    assert "ekf: 1 estimate, the first" in text


def test_text_says_why_a_receiver_is_lost():
    far = run_of(("ekf",), make_record({"ekf": np.array([[50.0, 0, 0]])}))
    assert "lost: in the last quarter its error exceeds the distance" in told(far)
    quiet = run_of(("ekf",), make_record({"ekf": np.zeros((40, 3))}))
    assert "lost: no estimate in the last quarter\n" in told(quiet)
    assert "exceeds" not in told(quiet)


def test_html_shows_the_table_and_escapes_the_title(result):
    page = result._repr_html_()
    assert "A hand-made dive &lt;1&gt;" in page
    assert page.count("<table") == 3
    assert "5.000" in page


def test_json_is_plain_and_holds_errors_and_summary(result):
    data = json.loads(json.dumps(result.to_json(), allow_nan=False))
    assert data["scenario_name"] == "dive"
    assert data["errors"]["ekf"]["absolute"]["x"]["rms_m"] == pytest.approx(3)
    assert data["errors"]["ekf"]["absolute"]["x"]["n"] == 99
    assert data["percentiles"]["ekf"]["absolute"]["total"]["max_m"] == pytest.approx(5)
    assert data["summary"]["ekf"]["inconsistent"] is True
    verdict = data["consistency"]["ekf"]["absolute"]
    assert (verdict["verdict"], verdict["runs"], verdict["low"]) == ("one run", 1, None)
    assert verdict["factor"] == pytest.approx(np.sqrt(100 / 3))
    assert verdict["words"].startswith("looks optimistic by a factor of 5.77; one run cannot tell")


def test_a_platform_at_rest_has_no_figure_of_its_angles():
    moving = make_record({"ekf": np.ones((1, 3))})
    still = {"platform.attitude": np.tile([0.0, 0.0, 0.3], (101, 1))}
    for record, drawn in (
        (moving, True),
        (without(moving, **still), False),
        (without(moving, **still, **{"platform.reported_attitude": np.zeros((101, 3))}), True),
    ):
        names = [job.name for job in jobs(FIGURES_OF_A_RUN, run_of(("ekf",), record))]
        assert ("inclination" in names) == drawn
        assert len(names) == 4 + drawn


def test_saved_folder_is_complete(result, tmp_path):
    folder = result.save(tmp_path / "run")
    present = {path.name for path in folder.iterdir()}
    tables = ("record", "estimates", "errors", "percentiles", "summary")
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
    pd.testing.assert_frame_equal(pd.read_parquet(folder / "record.parquet"), result.table)
    errors = pd.read_csv(folder / "errors.csv")
    pd.testing.assert_frame_equal(
        errors.set_index(["receiver", "frame", "axis"]), result.errors, check_dtype=False
    )
    estimates = pd.read_parquet(folder / "estimates.parquet")
    assert estimates["receiver"].unique().tolist() == ["ekf", "raw"]
    assert len(estimates) == 2 * 99


def test_same_result_saved_twice_gives_the_same_bytes(result, tmp_path):
    folders = [result.save(tmp_path / name) for name in ("a", "b")]
    first, second = ({path.name: path.read_bytes() for path in f.iterdir()} for f in folders)
    assert len(first) > 10
    assert first.keys() == second.keys()
    assert [name for name in first if first[name] != second[name]] == []


def test_error_while_saving_leaves_nothing(result, tmp_path, seam):
    def interrupt(*_):
        raise KeyboardInterrupt

    seam.instead(style.save, interrupt)
    with pytest.raises(KeyboardInterrupt):
        result.save(tmp_path / "run")
    assert not list(tmp_path.iterdir())


def test_foreign_folder_is_refused(result, tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(ConfigurationError):
        result.save(tmp_path)


def test_plots_are_those_of_the_run(result):
    assert result.plot_path().axes[0].get_xlabel() == "East y [m]"
    assert result.plot_path_3d().axes[0].get_zlabel() == "Depth z [m]"
    assert len(result.plot_axes().axes) == 3
    assert len(result.plot_errors(frame="relative").axes) == 4
    assert len(result.plot_inclination().axes) == 3


def test_plain_scenario_without_a_title_goes_by_its_name():
    result = Result(RunDescription("dive", {"speed_m_s": 0.5}, ("ekf",)), make_record())
    assert "\n\ndive: error [m]\n" in str(result)
    assert "\n\ndive\n\n" in told(result)
    assert np.isnan(result.summary.loc["ekf", "update_share"])


def test_example_of_the_docstring_names_a_scenario_that_exists():
    (name,) = re.findall(r'run\("([^"]+)"\)', Result.__doc__)
    assert name in shipped()


def test_manifest_and_file_tell_what_the_receivers_were(result, tmp_path):
    origins = {"ekf": {"python": "Mine", "parameters": {}}, "raw": {"type": "multi"}}
    description = replace(
        result.description, origins=origins, remarks=("simulated half of it",)
    )
    result = Result(description, result.record)
    folder = result.save(tmp_path / "run", figures=False)
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["receivers"] == [
        {"label": "ekf", "python": "Mine", "parameters": {}},
        {"label": "raw", "type": "multi"},
    ]
    assert (folder / "scenario.toml").read_text().startswith("# The receiver of the run, Mine, was")
    for text in (told(result), result._repr_html_(), json.dumps(result.to_json())):
        assert "simulated half of it" in text
