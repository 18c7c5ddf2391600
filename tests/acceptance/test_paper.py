"""`sblcosim paper`: the paper's numbers and ours, in one report."""

from __future__ import annotations

import itertools
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import html5lib
import pytest
from IPython.core.formatters import DisplayFormatter
from sblcosim.analysis import workflow
from sblcosim.analysis.two_level.analysis import Factorial
from sblcosim.analysis.two_level.ranking import tied
from sblcosim.cli import app
from sblcosim.report import paper
from sblcosim.report.paper.campaigns import QUICK_REPLICATES, REPLICATES
from sblcosim.study import store
from shared import shared
from typer.testing import CliRunner

INDEPENDENT = {1: (9.283, 0.031), 2: (11.061, 0.024), 3: (11.790, 0.037)}
"""Mean over all 128 points of the RMS total error and its standard error [m], by a simulation that
shares no code with ours: ``benchmarks/competitors/all_points.py --runs 64``."""
ERROR = "ekf.absolute_total_rms_m"


def command(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "sblcosim", "paper", *arguments], cwd=folder, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )


def _interrupted(folder: Path) -> dict[str, Any]:
    """Interrupt it after the first study."""
    process = command(folder)
    until = time.monotonic() + 600
    while not (folder / "paper/runs/paper-scenario-1/runs.parquet").exists():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < until
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    interrupted = (*process.communicate(timeout=600), process.returncode)
    report = (folder / "paper/report").exists()
    return {"interrupted": interrupted, "report": report}


def _finished(folder: Path) -> dict[str, Any]:
    """Give the same command again."""
    kept = folder / "paper/runs/paper-scenario-1/parts"
    before = {file.name: file.stat().st_mtime_ns for file in kept.iterdir()}
    process = command(folder)
    finished = (*process.communicate(timeout=1200), process.returncode)
    after = {file.name: file.stat().st_mtime_ns for file in kept.iterdir()}
    return {"finished": finished, "kept": before == after}


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    return shared(tmp_path_factory, "paper", _interrupted)


@pytest.fixture(scope="module")
def made(
    interrupted: tuple[Path, dict[str, Any]], tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Any]:
    """What came of it."""
    folder = interrupted[0]
    _, told = shared(tmp_path_factory, "paper-again", lambda _: _finished(folder))
    return {"folder": folder / "paper", **told}


@pytest.fixture(scope="module")
def finished(made: dict[str, Any]) -> tuple[Path, str]:
    """The folder, and what was printed."""
    out, err, code = made["finished"]
    assert (code, err) == (0, "")
    return made["folder"], out


@pytest.fixture(scope="module")
def found(finished: tuple[Path, str]) -> dict[int, Factorial]:
    runs = finished[0] / "runs"
    return {n: workflow.of_study(runs / f"paper-scenario-{n}") for n in (1, 2, 3)}


@pytest.fixture(scope="module")
def text(finished: tuple[Path, str]) -> str:
    return (finished[0] / "report" / "report.html").read_text("utf-8")


@pytest.fixture(scope="module")
def tree(text: str) -> Any:
    return html5lib.HTMLParser(strict=True, namespaceHTMLElements=False).parse(text)


def test_ctrl_c_says_how_to_go_on(interrupted: tuple[Path, dict[str, Any]]) -> None:
    _, err, code = interrupted[1]["interrupted"]
    assert code == 130
    match = re.fullmatch(
        r"interrupted; (\d+) of 28530 runs are in paper; go on with: sblcosim paper\n", err
    )
    assert match is not None, err
    assert int(match[1]) >= 6400
    assert not interrupted[1]["report"]


def test_nothing_is_done_twice(made: dict[str, Any]) -> None:
    assert made["kept"]


def test_it_says_the_answers_and_where_the_time_went(finished: tuple[Path, str]) -> None:
    out = finished[1]
    for n in (1, 2, 3):
        assert f"Scenario {n}: The RMS total error falls most with " in out
    for word in ("start-up", "simulations", "statistics", "figures", "report", "together"):
        assert re.search(rf"^{word} +\d+\.\d s$", out, re.MULTILINE)
    assert out.rstrip().endswith(str(finished[0] / "report" / "report.html"))


# --- Numbers -------------------------------------------------------------------------------------


def test_the_favourable_point_gives_table_4_within_10_percent_on_every_axis(
    finished: tuple[Path, str],
) -> None:
    runs = store.table(finished[0] / "runs" / "favourable-1")
    assert len(runs) == 50
    for axis in ("x", "y", "z", "total"):
        ours = runs[f"ekf.absolute_{axis}_rms_m"].mean()
        assert ours == pytest.approx(paper.facts()["table4"][axis], rel=0.1), axis


@pytest.mark.parametrize("name", paper.SESSIONS)
def test_the_ekf_s_row_of_table_2_is_met_within_10_percent(
    finished: tuple[Path, str], name: str
) -> None:
    runs = store.table(finished[0] / "runs" / f"harbour-{name}")
    assert len(runs) >= 500
    ours = paper.pooled(runs, "ekf")
    assert ours == pytest.approx(paper.facts()["table2"][name]["ekf"], rel=0.1)


@pytest.mark.parametrize("n", paper.SCENARIOS)
def test_the_mean_over_all_points_is_that_of_an_independent_simulation(
    finished: tuple[Path, str], n: int
) -> None:
    runs = store.table(finished[0] / "runs" / f"paper-scenario-{n}")
    assert len(runs) == 6400
    assert runs["error"].isna().all()
    mean, error = INDEPENDENT[n]
    assert 5 * error < 0.03 * mean
    assert runs[ERROR].mean() == pytest.approx(mean, rel=0.03)


def has_order(a: Factorial, order: list[str]) -> None:
    """The main effects come in an order, and surely so."""
    size = a.effects["effect"].abs()
    main = list(a.effects.index[a.effects["order"] == 1])
    for place, name in enumerate(order):
        for other in set(main) - set(order[: place + 1]):
            assert size[name] > size[other], (name, other)
            assert not tied(a, name, other), (name, other)
    # two lead by far, and act as the paper says; which of them is first is another question
    first, second, third = size[main].sort_values(ascending=False).index[:3]
    assert {first, second} == {"gps", "baseline"}
    assert size[second] > 2.5 * size[third]
    assert a.effects.loc["gps", "effect"] > 0 > a.effects.loc["baseline", "effect"]
    several = a.effects.index[a.effects["order"] == 2]
    assert size[several].idxmax() == "baseline × gps"


def is_close_third(a: Factorial, one: str, other: str) -> None:
    """Two main effects share places 3 and 4 and differ by less than what matters."""
    size = a.effects["effect"].abs()[a.effects["order"] == 1].sort_values(ascending=False)
    assert set(size.index[2:4]) == {one, other}
    assert abs(size[one] - size[other]) < paper.PRACTICAL
    assert size.iloc[3] > 2.5 * size.iloc[4]


@pytest.mark.parametrize(
    ("n", "order"),
    [(1, ["gps", "baseline"]), (2, ["gps", "baseline", "sampling_time"]),
     (3, ["baseline", "gps", "sampling_time"])],
)
def test_the_factors_have_the_paper_s_order(
    found: dict[int, Factorial], n: int, order: list[str]
) -> None:
    has_order(found[n], order)


def test_sampling_time_and_range_noise_are_a_close_third_in_scenario_1(
    found: dict[int, Factorial]
) -> None:
    is_close_third(found[1], "sampling_time", "range")


def test_the_printed_answer_ties_what_cannot_be_told_apart(
    found: dict[int, Factorial], finished: tuple[Path, str]
) -> None:
    for n in paper.SCENARIOS:
        a = found[n].readable
        ranked = a.ranked()
        main = list(ranked.index[ranked["order"] == 1])
        line = next(s for s in finished[1].splitlines() if s.startswith(f"Scenario {n}"))
        for place, (one, other) in enumerate(itertools.pairwise(main[:4])):
            joint = ", tied with " if tied(a, one, other) else "; then with "
            between = rf"{one} from [^;,]*, by [\d.]+ m[^;,]*{joint}{other} from "
            named = tied(a, one, other) or place < 2
            assert bool(re.search(between, line)) == named, (n, one, other)


# --- The report ----------------------------------------------------------------------------------


def part(tree: Any, anchor: str) -> Any:
    (section,) = [
        e for e in tree.iter()
        if (e.tag == "section" and e.get("aria-labelledby") == anchor)
        or (e.tag == "details" and e.find("div").get("id") == anchor)
    ]
    return section


def words(element: Any) -> str:
    return " ".join("".join(element.itertext()).split())


@pytest.mark.parametrize("number", [2, 4, 5, 6])
def test_every_table_of_the_paper_has_its_place(tree: Any, number: int) -> None:
    section = part(tree, f"table-{number}")
    table = section.find(".//table")
    head = [words(th) for th in table.findall(".//thead//th")]
    assert {"Quantity", "Paper", "Ours", "Ratio"} <= set(head)
    rows = table.findall(".//tbody/tr")
    paper_, ours, ratio = (head.index(word) for word in ("Paper", "Ours", "Ratio"))
    known = paper.facts()[f"table{number}"]
    if number == 2:
        expected = [x for name in paper.SESSIONS for row in ("instrument", "ekf")
                    for x in known[name][row]]
    else:
        expected = [*(known[axis] for axis in ("x", "y", "z", "total")), known["total"]]
    shown = [[words(cell) for cell in row] for row in rows]
    assert [float(cells[paper_]) for cells in shown] == expected
    for cells in shown:
        quotient = float(cells[ours]) / float(cells[paper_])
        assert float(cells[ratio]) == pytest.approx(quotient, abs=0.02)
    assert len(words(section)) > 200  # why they differ


@pytest.mark.parametrize("n", paper.SCENARIOS)
def test_the_ranges_of_table_3_have_indices_beside_the_effects(
    tree: Any, found: dict[int, Factorial], n: int
) -> None:
    """The modern answer to the paper's question: which source of error explains the variance."""
    section = part(tree, f"ranges-{n}")
    head, *rows = ([words(cell) for cell in row] for row in section.find(".//table").iter("tr"))
    shown = {row[0]: dict(zip(head, row, strict=True)) for row in rows}
    labels = found[n].labels
    assert {*shown} == {*labels.values(), "chance (the seed)"}
    totals = {
        name: float(shown[label]["Total index"].replace("−", "-"))
        for name, label in labels.items()
    }
    assert max(totals, key=lambda name: totals[name]) == "gps"
    assert totals["gps"] + totals["baseline"] > 0.6
    for name, label in labels.items():
        effect = shown[label]["Effect, low to high [m]"].replace("−", "-")
        assert float(effect) == pytest.approx(found[n].effects.loc[name, "effect"], rel=0.01)


@pytest.mark.parametrize("number", [9, *range(11, 31)])
def test_every_figure_of_the_paper_has_its_place(tree: Any, number: int) -> None:
    section = part(tree, f"place-figure-{number}")
    is_open = number in (12, 15, 19, 22, 25, 28)
    heading = section.find("h3" if is_open else "summary/h3")
    assert words(heading).startswith(f"Figure {number}: ")
    seen = section.find("figure") if is_open else section.find("summary")
    assert [e for e in seen.iter() if str(e.tag).endswith("svg")]
    assert "In the paper (section " in words(section)
    assert "Ours" in words(section)
    drawings = [e for e in section.iter() if str(e.tag).endswith("svg")]
    assert drawings
    for drawing in drawings:
        assert drawing.get("role") == "img"
        assert drawing.get("aria-label")
        assert sum(1 for _ in drawing.iter()) > 20


@pytest.mark.parametrize(("n", "figures"), [(1, (15, 12)), (2, (22, 19)), (3, (28, 25))])
def test_of_a_scenario_the_pareto_chart_is_open_beside_the_trajectory(
    tree: Any, n: int, figures: tuple[int, int]
) -> None:
    section = part(tree, f"scenario-{n}")
    first = next(e for e in section if e.tag == "div")
    assert first.get("class") == "beside"
    assert [e.get("aria-labelledby") for e in first] == [f"place-figure-{f}" for f in figures]
    inside = {e for details in section.iter("details") for e in details.iter()}
    drawn = [e for e in section.iter() if str(e.tag).endswith("svg")]
    assert sum(e not in inside for e in drawn) == 2
    summaries = {e for summary in section.iter("summary") for e in summary.iter()}
    assert all(e in summaries for e in drawn if e in inside)  # small, not hidden


@pytest.fixture(scope="module")
def again(
    finished: tuple[Path, str], tmp_path_factory: pytest.TempPathFactory
) -> tuple[str, str]:
    """The report of the same runs, made in Python, and what a notebook shows of it."""

    def make(folder: Path) -> dict[str, Any]:
        shutil.copytree(finished[0] / "runs", folder / "paper" / "runs")
        shown = paper.run(folder / "paper")
        assert repr(shown) == f"<PaperReport of 3 scenarios: {shown.report}>"
        formats, _ = DisplayFormatter().format(shown)
        return {"report": shown.report.read_text("utf-8"), "html": formats["text/html"]}

    made = shared(tmp_path_factory, "paper-in-python", make)[1]
    return made["report"], made["html"]


@pytest.mark.slow
def test_equal_runs_give_an_equal_report(again: tuple[str, str], text: str) -> None:
    assert again[0] == text


@pytest.mark.slow
def test_a_notebook_shows_the_summary_tables_the_answers_and_all_figures(
    again: tuple[str, str], tree: Any, finished: tuple[Path, str]
) -> None:
    page = html5lib.parseFragment(again[1], namespaceHTMLElements=False)
    shown = [e.get("alt") for e in page.iter("img")]
    drawn = [e.get("aria-label") for e in tree.iter() if str(e.tag).endswith("svg")]
    assert sorted(shown) == sorted(drawn)
    open_ = [len(row.findall("img")) for row in page.findall("div")]
    assert open_ == [2, 2, 2]
    summary = {words(caption) for caption in part(tree, "summary").iter("caption")}
    assert summary <= {words(heading) for heading in page.iter("h4")}
    assert len([*page.iter("table")]) == len(summary) == 2
    answers = [words(p) for p in page.findall("p") if " falls most with " in words(p)]
    assert len(answers) == 3
    assert all(re.sub(r"\s", "", a) in re.sub(r"\s", "", finished[1]) for a in answers)


def test_what_ours_has_in_common_with_the_paper_is_no_row(tree: Any) -> None:
    assert "equal" not in [words(cell) for cell in tree.iter("td")]
    said = words(part(tree, "place-figure-11"))
    assert "Ours has the same settings: depth of the receiver 2 m, packet loss 50 %, " in said


@pytest.mark.parametrize("number", [4, 5, 6])
def test_tables_4_to_6_are_beside_the_mean_over_all_points_too(tree: Any, number: int) -> None:
    section = part(tree, f"table-{number}")
    captions = [words(caption) for caption in section.iter("caption")]
    assert captions == [
        f"Table {number} and the favourable point, mean of 50 runs",
        f"Table {number} and the mean over all 128 points",
    ]
    assert "The table is no average over all levels" in words(section)


def test_the_summary_comes_first_and_has_a_sentence_for_each_scenario(tree: Any) -> None:
    first = next(iter(tree.iter("h2")))
    assert first.text == "Summary"
    answers = [words(p) for p in part(tree, "summary").findall("p") if p.get("class") == "answer"]
    assert [a[:11] for a in answers] == ["Scenario 1.", "Scenario 2.", "Scenario 3."]


def test_the_summary_says_why_the_errors_differ(tree: Any) -> None:
    """Half of the points have the larger GPS error, and their errors make the mean."""
    said = words(part(tree, "summary"))
    assert "favourable point: white GPS error 0.1 m, baseline 3 m" in said
    assert "half of them have a GPS error of 3.5 m" in said


def test_the_notes_on_indices_are_of_what_is_shown(tree: Any) -> None:
    for n in paper.SCENARIOS:
        notes = [words(p) for p in part(tree, f"ranges-{n}").iter("p") if p.get("class") == "note"]
        assert len(notes) == len(set(notes))
        assert not [note for note in notes if "Useful indices need" in note]


def test_the_report_refers_to_nothing_outside(text: str) -> None:
    assert "http:" not in text
    assert "https:" not in text
    assert not re.search(r"\bsrc=|@import|<script|<link|<iframe|srcset", text)
    targets = re.findall(r'href="([^"]*)"|url\(([^)]*)\)', text)
    assert len(targets) > 10
    for target in targets:
        assert "".join(target).startswith(("#", "data:image/png;base64,"))


def test_the_report_says_how_to_reproduce_it(tree: Any) -> None:
    again = words(part(tree, "reproduce"))
    assert "sblcosim paper" in again
    assert "seeds 1 to 6400" in again
    cells = [words(td) for td in part(tree, "reproduce").iter("td")]
    assert sum(bool(re.fullmatch("[0-9a-f]{64}", cell)) for cell in cells) >= 4
    for package in ("sblcosim", "numpy", "casadi", "fmpy"):
        assert package in again


@pytest.mark.slow
def test_quick_is_the_same_with_few_replicates(
    finished: tuple[Path, str], tmp_path: Path
) -> None:
    """On what is there already: nothing is simulated again."""
    shutil.copytree(finished[0] / "runs", tmp_path / "paper" / "runs")
    parts = set(tmp_path.rglob("parts/*.parquet"))
    process = command(tmp_path, "--quick", "--practical", "1")
    _, err = process.communicate(timeout=300)
    assert (process.returncode, err) == (0, "")
    assert set(tmp_path.rglob("parts/*.parquet")) == parts
    text = (tmp_path / "paper" / "report" / "report.html").read_text("utf-8")
    assert "1,920 runs of the studies with 5 replicates (the paper: 50)" in text
    assert "surely larger than 1\u00a0m" in text


def test_the_help_says_how_few_replicates_are_quick() -> None:
    shown = CliRunner().invoke(app, ["paper", "--help"]).stdout
    said = f"Do {QUICK_REPLICATES} replicates instead of {REPLICATES}"
    assert said in " ".join(shown.split())


# --- Bad input -----------------------------------------------------------------------------------


def refused(*arguments: str) -> str:
    done = CliRunner().invoke(app, ["paper", *arguments])
    assert done.exit_code == 2
    assert done.stdout == ""
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1
    return done.stderr


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    assert "got 'mine.txt' in it" in refused("--out", str(tmp_path))
    assert [f.name for f in tmp_path.iterdir()] == ["mine.txt"]


def test_another_study_under_our_name_is_left_alone(tmp_path: Path) -> None:
    folder = tmp_path / "paper" / "runs" / "paper-scenario-1"
    folder.mkdir(parents=True)
    (folder / "notes.txt").write_text("mine")
    assert "got 'notes.txt' in it" in refused("--out", str(tmp_path / "paper"))
    assert not (tmp_path / "paper" / "report").exists()


def test_a_file_in_the_way_is_said_so(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    refused("--out", str(tmp_path / "file"))
    refused("--out", str(tmp_path / "file" / "below"))
    assert [f.name for f in tmp_path.iterdir()] == ["file"]


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_cannot_be_written_to_is_said_so(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    try:
        refused("--out", str(tmp_path / "below"))
    finally:
        tmp_path.chmod(0o700)


def test_a_line_of_nothing_is_refused(tmp_path: Path) -> None:
    assert "practical: must be above 0" in refused("--practical", "0", "--out", str(tmp_path / "p"))
    assert not (tmp_path / "p").exists()
