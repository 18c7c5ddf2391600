"""From a study to its answer, by the command line."""

from __future__ import annotations

import json
from pathlib import Path

import html5lib
import pandas as pd
import pytest
from sblcosim.analysis import workflow
from sblcosim.cli import app
from sblcosim.errors import ConfigurationError
from sblcosim.study import campaign, store, study
from typer.testing import CliRunner

STUDY = """
name = "small"
scenario = "paper-scenario-1"
replicates = 3

[fixed]
"time.duration_s" = 20.0

[design]
kind = "full"

[factors.gps]
keys = ["platform.gps_horizontal_std_m"]
levels = [0.1, 3.5]

[factors.depth]
keys = ["target.depth_std_m"]
levels = [0.01, 0.1]
"""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("analyse")
    (folder / "small.toml").write_text(STUDY)
    done = CliRunner().invoke(
        app, ["study", str(folder / "small.toml"), "--out", str(folder / "small")]
    )
    assert done.exit_code == 0, done.output
    return folder / "small"


def test_the_large_factor_is_found_and_written(results: Path) -> None:
    done = CliRunner().invoke(app, ["analyse", str(results)])
    assert done.exit_code == 0, done.output
    assert "The RMS total error falls most with gps from 3.5" in done.stdout
    folder = results.with_name("small-analysis")
    effects = pd.read_csv(folder / "effects.csv", index_col=0)
    runs = pd.read_parquet(results / "runs.parquet")
    means = runs.groupby("gps")["ekf.absolute_total_rms_m"].mean()
    assert effects.loc["gps", "effect"] == pytest.approx(means[3.5] - means[0.1], rel=1e-9)
    for name in ("pareto", "main_effects", "interactions", "residuals"):
        assert (folder / f"{name}.svg").stat().st_size > 1000
        assert (folder / f"{name}.png").stat().st_size > 1000


@pytest.mark.parametrize(
    ("option", "said"),
    [((), "the scatter between replicates (pure error)"),
     pytest.param(
         ("--error", "residual"), "the scatter about the model (residual, with its lack of fit)",
         marks=pytest.mark.slow,
     )],
)
def test_it_says_where_the_error_of_the_effects_is_from(
    results: Path, tmp_path: Path, option: tuple[str, ...], said: str
) -> None:
    out = tmp_path / "out"
    done = CliRunner().invoke(
        app, ["analyse", str(results), "--order", "1", "--verbose", "--out", str(out), *option]
    )
    assert done.exit_code == 0, done.output
    assert f"errors from {said}" in done.stdout
    assert said in (out / "report.html").read_text("utf-8")
    kind = option[1] if option else "pure"
    assert json.loads((out / "manifest.json").read_text())["analysis"]["error"] == kind


def test_unknown_names_are_answered_with_the_valid_ones(results: Path) -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'absolute_total_rms_m'"):
        workflow.of_study(results, "absolute_total_rms")
    with pytest.raises(ConfigurationError, match="receiver: must be ekf"):
        workflow.of_study(results, receiver="efk")
    for option in ("--transform", "--error"):
        done = CliRunner().invoke(app, ["analyse", str(results), option, "cube"])
        assert done.exit_code == 2
        assert done.stderr.startswith(f"error: {option}: must be ")


def test_the_cheapest_design_that_is_good_enough_is_named(results: Path) -> None:
    """A dear GPS is bought when the limit asks for it, and not otherwise."""
    costs = results.parent / "costs.toml"
    costs.write_text("gps = [900, 40]  # of 0.1 and 3.5 m\ndepth = [30, 10]\n")
    table = store.table(results)
    means = table.groupby("gps")["ekf.absolute_total_rms_m"].max()
    assert means[0.1] < means[3.5]
    chosen = {}
    for name, limit in (("strict", 5 * means[0.1]), ("loose", 50 * means[3.5])):
        out = results.parent / name
        done = CliRunner().invoke(
            app, ["advise", str(results), "--costs", str(costs), "--limit", str(limit),
                  "--percentile", "20", "--out", str(out)],
        )  # fmt: skip
        assert done.exit_code == 0, done.output
        assert done.output.startswith("The cheapest point with a 20th percentile of ")
        assert "Each of the 4 points needs 86 runs. There are 3, so 83 " in done.output
        assert {p.name for p in out.iterdir()} >= {"front.svg", "front.png", "points.csv"}
        campaign = pd.read_parquet(out / "points.parquet")
        chosen[name] = campaign[campaign["meets"]].iloc[0]
    assert (chosen["strict"]["gps"], chosen["strict"]["cost"]) == (0.1, 910)
    assert (chosen["loose"]["gps"], chosen["loose"]["cost"]) == (3.5, 50)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("gsp = [1, 2]", "must be costs of factors of the study, got 'gsp'; did you mean 'gps'?"),
        ("gps = [1]", "gps: must have a cost for each of the levels 0.1, 3.5, got 1"),
        ("gps = 3", "gps: must be an array of costs, or a table by level, got 3"),
        ("gps = [1, 'a']", "gps: must be numbers, finite and not negative, got 'a' for 3.5"),
        ("gps = [1, ", "must be a value of TOML ("),
        (None, "no such file"),
    ],
)
def test_costs_that_do_not_fit_are_refused_in_one_line(
    results: Path, tmp_path: Path, text: str | None, message: str
) -> None:
    costs = tmp_path / "costs.toml"
    if text is not None:
        costs.write_text(text)
    done = CliRunner().invoke(
        app, ["advise", str(results), "--costs", str(costs), "--out", str(tmp_path / "out")]
    )
    assert done.exit_code == 2
    assert message in done.output
    assert done.output.count("\n") == 1
    assert not (tmp_path / "out").exists()


# --- Reports -------------------------------------------------------------------------------------


def reported(folder: Path, text: str, *options: str) -> tuple[str, str]:
    """What analyse prints of a study, and its report."""
    (folder / "own.toml").write_text(text)
    for arguments in (
        ["study", str(folder / "own.toml"), "--out", str(folder / "own")],
        ["analyse", str(folder / "own"), *options],
    ):
        done = CliRunner().invoke(app, arguments)
        assert done.exit_code == 0, done.output
    html = (folder / "own-analysis" / "report.html").read_text("utf-8")
    html5lib.HTMLParser(strict=True).parse(html)
    return done.stdout, html


LABELLED = STUDY.replace(
    "[factors.gps]", '[factors.gps]\nlabel = "GPS error"\nunit = "m"'
).replace("[factors.depth]", '[factors.depth]\nlabel = "depth error"\nunit = "m"')


def test_people_read_labels_and_data_keep_columns(tmp_path: Path) -> None:
    out, html = reported(tmp_path, LABELLED, "--practical", "0.5")
    assert "The RMS total error falls most with GPS error from 3.5 m to 0.1 m, by " in out
    assert "RMS total error" in out
    assert "GPS error 0.1\u00a0m" in html
    effects = pd.read_csv(tmp_path / "own-analysis" / "effects.csv", index_col=0)
    assert list(effects.index[:2]) == ["gps", "depth"]
    drawing = (tmp_path / "own-analysis" / "pareto.svg").read_text()
    assert "<!-- GPS error -->" in drawing
    for word in ("Summary", "Analysis of variance", "R² predicted", "Detectable", "Box–Cox",
                 "Ratio of its spread", "In practice", "How to reproduce"):
        assert word in html
    assert html.count("<figure") == 2  # of the part that is open
    assert html.count('class="picture"') == 3  # small, of the folded parts
    assert "http" not in html


def test_figures_come_before_tables_and_each_point_says_what_went_wrong(tmp_path: Path) -> None:
    _, html = reported(tmp_path, LABELLED)
    assert html.index('id="pareto"') < html.index('id="main_effects"') < html.index("<table")
    tree = html5lib.parse(html, namespaceHTMLElements=False)
    (part,) = [e for e in tree.iter("div") if e.get("id") == "points"]
    head, *rows = (["".join(c.itertext()) for c in row] for row in part.iter("tr"))
    assert head == ["Point", "GPS error", "depth error", "Runs", "ekf: mean RMS [m]",
                    "ekf: inconsistent", "ekf: lost", "ekf: misleading"]
    runs = store.table(tmp_path / "own").groupby("point")
    for row, (point, mine) in zip(rows, runs, strict=True):
        levels = [f"{mine[name].iloc[0]:g} m" for name in ("gps", "depth")]
        shares = [f"{100 * mine[f'ekf.{name}'].astype(float).mean():.1f} %"
                  for name in ("inconsistent", "lost", "misleading")]
        assert row[:4] == [str(point), *levels, "3"]
        assert float(row[4]) == pytest.approx(mine["ekf.absolute_total_rms_m"].mean(), rel=0.01)
        assert [cell.partition(" (")[0] for cell in row[5:]] == shares
        assert ["–" in cell for cell in row[5:]] == [False, False, True]  # an interval


def test_the_study_in_a_report_is_the_same_study(tmp_path: Path) -> None:
    _, html = reported(tmp_path, LABELLED)
    tree = html5lib.parse(html, namespaceHTMLElements=False)
    *_, file, commands = ("".join(code.itertext()) for code in tree.iter("code"))
    assert commands.splitlines()[0] == f"sblcosim study small.toml --out {tmp_path / 'own'}"
    (tmp_path / "small.toml").write_text(file)
    again = study.load(tmp_path / "small.toml")
    assert campaign.prepare(again).definition() == json.loads(
        (tmp_path / "own" / "study.json").read_text()
    )["definition"]
    assert (again.replicates, again.labels["gps"]) == (3, "GPS error")


def test_an_analysis_in_python_reads_as_on_the_command_line(tmp_path: Path) -> None:
    out, _ = reported(tmp_path, LABELLED)
    found = workflow.of_study(tmp_path / "own")
    assert out.startswith(str(found))
    assert list(found.effects.index[:2]) == ["gps", "depth"]
    names = [text.get_text() for text in found.plot_pareto().axes[0].get_yticklabels()]
    assert "GPS error" in names


def test_an_unreplicated_study_says_in_words_what_it_cannot_have(tmp_path: Path) -> None:
    text = STUDY.replace("replicates = 3", "replicates = 1")
    text += '\n[factors.range]\nkeys = ["acoustics.range_std_m"]\nlevels = [0.1, 1.0]\n'
    out, html = reported(tmp_path, text, "--order", "3", "--verbose")
    why = "each design point needs at least 2 runs"
    assert f"The spread of the response cannot be analysed: {why}" in html
    assert "The Box–Cox profile cannot be computed" in html
    assert "absolute_total_rms_m" not in html
    assert "Pareto chart of the size of the effects in m, all 7 effects" in html
    assert "pseudo standard error" in out
    assert "gps from 3.5 m to 0.1 m" in out  # unit of the key


def test_centre_points_show_curvature_in_the_report(tmp_path: Path) -> None:
    _, html = reported(
        tmp_path, STUDY.replace('kind = "full"', 'kind = "full"\ncentre_points = 2')
    )
    assert "Curvature" in html


def test_a_fraction_s_report_names_what_is_aliased(tmp_path: Path) -> None:
    text = STUDY.replace('kind = "full"', 'kind = "fraction"\ngenerators = ["C=AB"]')
    text += '\n[factors.range]\nkeys = ["acoustics.range_std_m"]\nlevels = [0.1, 1.0]\n'
    out, html = reported(tmp_path, text, "--verbose")
    assert "are negligible: the design points cannot tell gps from " in out
    assert "Main effects only" in out
    assert "Aliased terms" in html
    refused = CliRunner().invoke(
        app, ["analyse", str(tmp_path / "own"), "--order", "2", "--out", str(tmp_path / "x")]
    )
    assert refused.exit_code == 2
    assert "(--order 1)" in refused.stderr
    assert "gps × depth" in html


def test_a_sweep_s_report_shows_the_error_at_each_level(tmp_path: Path) -> None:
    text = STUDY.replace('kind = "full"', 'kind = "sweep"')
    text = text.replace("levels = [0.1, 3.5]", "levels = [0.1, 1.0, 3.5]")
    out, html = reported(tmp_path, text)
    assert "This is a sweep and not a factorial design" in out
    assert "This is a sweep and not a factorial design" in html
    means = pd.read_csv(tmp_path / "own-analysis" / "means.csv")
    runs = pd.read_parquet(tmp_path / "own" / "runs.parquet")
    mine = runs[(runs["gps"] == 1.0)]["ekf.absolute_total_rms_m"].mean()
    row = means[(means["factor"] == "gps") & (means["value"] == 1.0)].iloc[0]
    assert row["mean"] == pytest.approx(mine, rel=1e-12)
    assert html.count("<figure") == 1
    refused = CliRunner().invoke(
        app, ["analyse", str(tmp_path / "own"), "--order", "1", "--out", str(tmp_path / "x")]
    )
    assert refused.exit_code == 2
    assert "must be a two-level factorial design" in refused.stderr
    assert not (tmp_path / "x").exists()


def test_a_study_without_factors_says_that_there_is_nothing_to_analyse(tmp_path: Path) -> None:
    text = STUDY[: STUDY.index("[factors.gps]")].replace('"full"', '"single"')
    out, html = reported(tmp_path, text)
    assert "The study has no factors, so there are no effects to analyse." in out
    assert "The study has no factors" in html
