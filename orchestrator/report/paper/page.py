"""The paper beside our results: `sblcosim paper`.

It runs the paper's three factorial studies, the sessions of its Table 2 and the favourable point
that fits its Table 4. It analyses them, and writes one report with the paper's Tables 2 and 4 to 6
and its Figures 9 and 11 to 30. The numbers of the paper are in ``paper.toml``.
"""

from __future__ import annotations

import re
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np
from sblcosim.fmus.stopping import interruptible

from ... import artifacts
from ...analysis.two_level.sentences import answer
from ...errors import ConfigurationError, resolved
from ...scenario.scenario import load as load_scenario
from ...shown import Shown
from ...study import store
from ...words.numbers import unbroken
from ...words.shares import percent
from .. import possible
from .. import two_level as factorial
from ..common import DEFINITIONS, method, reproduce, seeding
from ..page import Block, Page, PagePicture, PageTable, Section, Text, brief, render
from ..parts import folded
from ..study import REPORT
from . import ranges
from .campaigns import (
    FAVOURABLE,
    PAGES,
    RUNS,
    SCENARIOS,
    SESSIONS,
    Progress,
    all_campaigns,
    check,
    favourable_in_words,
    sessions_in_words,
    simulate,
)
from .comparisons import (
    NEAR,
    Row,
    compared,
    errors_of_all,
    order_row,
    point_errors,
    row_with_interval,
    session_rows,
    sessions,
    stated,
)
from .figures import FIGURES, OPEN, Material, PaperFigure, draw, gather, painters
from .numbers import (
    PRACTICAL,
    TOTAL,
    PaperNumbers,
    analyse,
    average,
    facts,
    facts_of_errors,
    facts_of_figure,
    overall,
)


@dataclass(frozen=True, eq=False, repr=False)
class PaperReport(Shown):
    """The paper's results and ours. A notebook shows its summary tables, answers and figures.

    Attributes
    ----------
    report
        The HTML file.
    page
        The content of the file.
    answers
        A sentence for each scenario.
    seconds
        Processing time of each step [s].
    """

    report: Path
    page: Page
    answers: Mapping[int, str]
    seconds: Mapping[str, float]

    def _gist(self) -> str:
        return f"of {len(self.answers)} scenarios: {self.report}"

    def _repr_html_(self) -> str:
        return brief(self.page)


@interruptible
def run(
    out: str | Path,
    *,
    quick: bool = False,
    practical: float = PRACTICAL,
    workers: int | None = None,
    command: str = "sblcosim paper",
    progress: Progress | None = None,
    started: float | None = None,
) -> PaperReport:
    """Do the missing runs of all campaigns, and write the report.

    Parameters
    ----------
    out
        Folder. The folder of an earlier call is completed.
    quick
        Do few replicates.
    practical
        Smallest effect that matters [m].
    workers
        Number of workers for simulations and figures; default: all cores.
    command
        The command line, for the report.
    progress
        Function that is called with the finished share and a word for the current task.
    started
        Start of the command on the clock `time.perf_counter`, to include the start-up time.

    Raises
    ------
    ConfigurationError
        The folder holds something else or cannot be written to, or a number is out of range.
    """
    folder = resolved(out)
    check(folder)
    if not 0 < practical < np.inf:
        raise ConfigurationError(f"practical: must be above 0, got {practical}")
    seconds = {} if started is None else {"start-up": time.perf_counter() - started}
    tell = progress or _silently
    with painters(workers) as pool:
        studies = {
            name: store.as_begun(study, folder / RUNS / name)
            for name, study in all_campaigns(quick).items()
        }
        with _clock(seconds, "simulations"):
            tables = simulate(folder / RUNS, studies, workers, tell)
        with _clock(seconds, "statistics"):
            numbers = analyse(studies, tables, practical, tell)
        with _clock(seconds, "figures"):
            material = gather(folder / RUNS, numbers)
            drawings = draw(material, pool, tell)
            if pool is not None:
                pool.shutdown()
    with _clock(seconds, "report"):
        tell(0.97, "writing")
        page = _page(material, drawings, folder, command, quick)
        _write(folder / PAGES, page, numbers, drawings)
        tell(1.0, "writing")
    return PaperReport(folder / PAGES / REPORT, page, _answers(numbers), seconds)


def _answers(numbers: PaperNumbers) -> dict[int, str]:
    return {n: answer(findings.shown) for n, findings in numbers.findings.items()}


def _silently(share: float, doing: str) -> None:
    pass


@contextmanager
def _clock(seconds: dict[str, float], name: str) -> Iterator[None]:
    started = time.perf_counter()
    yield
    seconds[name] = time.perf_counter() - started


def _page(
    material: Material, drawings: Mapping[str, str], folder: Path, command: str, quick: bool
) -> Page:
    numbers = material.numbers
    runs = sum(len(table) for table in numbers.runs.values())
    lead = (
        f"{facts()['citation']}. Its three factorial studies, its tables and its figures, beside "
        f"ours: {runs:,} runs of the studies with {numbers.studies[1].replicates} replicates (the "
        f"paper: {facts()['study']['replicates']}), and {len(numbers.sessions['square'])} sessions "
        "on each of the three paths of Table 2."
    )
    sections = [
        Section("Summary", "summary", _summary(numbers, quick)),
        Section("The harbour and the sea", "harbour", [], [
            *_figures(None, material, drawings),
            Section("Table 2: sessions in the harbour", "table-2", _harbour(numbers), folded=True),
        ]),
        *(_scenario(n, material, drawings) for n in SCENARIOS),
        Section("Method", "method", _method(numbers), folded=True),
        _again(numbers, folder, command),
    ]
    return Page("The paper and our results side by side", lead, sections,
                f"sblcosim {artifacts.software()['sblcosim']}")


def _summary(numbers: PaperNumbers, quick: bool) -> list[Block]:
    blocks: list[Block] = []
    if quick:
        blocks.append(Text("This is a quick look with few replicates. Intervals are wide. Without "
                           "--quick, more factors can be told apart.", "note"))
    for n, text in _answers(numbers).items():
        blocks.append(Text(unbroken(f"Scenario {n}. {text}"), "answer"))
    rows: list[Row] = []
    points = len(numbers.studies[1].points.values)
    coarse = numbers.runs[1]["gps"].max()
    for n in SCENARIOS:
        table, theirs = facts_of_errors(n)
        what = f"Table {table}, total error [m]"
        for words, ours in (
            ("favourable point", average(numbers.points[n], f"ekf.{TOTAL}")),
            (f"all {points} points", overall(numbers.runs[n], f"ekf.{TOTAL}")),
        ):
            rows.append(row_with_interval(f"{what}: {words}", theirs["total"], ours))
    for name in SESSIONS:
        rows += session_rows(numbers.sessions[name], "ekf", facts()["table2"][name]["ekf"],
                             f"Table 2, EKF, {name}", " [m]")
    blocks.append(compared(
        "The paper's numbers and ours", rows,
        "The paper does not say which runs its Tables 4 to 6 average. Ours are near them at one "
        f"favourable point: {favourable_in_words()}. Over all {points} points, all combinations of "
        f"the levels of its Table 3, ours are larger: half of them have a GPS error of {coarse:g} "
        "m. It differs from packet to packet, and so moves the beacons against each other.",
    ))
    blocks.append(PageTable("Factors that influence the error most, the largest effect first",
                        ("Scenario", "Paper", "Ours", "Verdict"),
                        [order_row(n, numbers.findings[n].data) for n in SCENARIOS], (1, 2, 3),
                        "Factors in brackets cannot be told apart by the size of their effects."))
    return blocks


def _harbour(numbers: PaperNumbers) -> list[Block]:
    return [
        Text("The paper gives sea state, depth, loss and sound speed of its sessions. We chose the "
             f"other settings to come near its EKF rows: {sessions_in_words()}."),
        sessions(numbers.sessions),
        Text("The EKF's errors come from a slow GPS error that all beacons share. Their standard "
             "deviation is half of their mean, as for a two-dimensional Gaussian error."),
    ]


def _figures(
    scenario: int | None, material: Material, drawings: Mapping[str, str]
) -> list[Section]:
    """The paper's figures of a scenario, or of the harbour: the open ones, then all others."""
    own = [f for f in FIGURES.values() if f.scenario == scenario and f.label]
    own.sort(key=lambda figure: (figure.number, figure.label))
    found = {
        number: _figure(number, list(same), material, drawings)
        for number, same in groupby(own, key=lambda figure: figure.number)
    }
    return [found[number] for number in dict.fromkeys((*OPEN, *found)) if number in found]


def _figure(
    number: int, figures: Sequence[PaperFigure], material: Material, drawings: Mapping[str, str]
) -> Section:
    """A figure of the paper: our drawings, the paper's facts, and ours."""
    known = facts_of_figure(number)
    text = f"In the paper (section {known['section']}): {known['shows']}."
    if "says" in known:
        text += f" It says: {known['says']}."
    rows = stated(number)
    if same := [f"{what} {value}" for what, value, *_, verdict in rows if verdict == "equal"]:
        shown = [re.sub(r" \[(.*)\] (.*)", r" \2 \1", setting) for setting in same]
        text += unbroken(f" Ours has the same settings: {', '.join(shown)}.")
    words: list[Block] = [Text(text)]
    if different := [row for row in rows if row[-1] != "equal"]:
        words.append(compared(f"Figure {number} in numbers", different))
    words += figures[0].beside(material)
    drawn = _pictures(figures, material, drawings)
    heading, anchor = f"Figure {number}: {known['shows']}", f"place-figure-{number}"
    if number not in OPEN:
        return Section(heading, anchor, [*drawn, *words], folded=True)
    more = Section("Beside the paper", f"words-figure-{number}", [*drawn[1:], *words], folded=True)
    return Section(heading, anchor, drawn[:1], [more], beside=True)


def _pictures(
    figures: Sequence[PaperFigure], material: Material, drawings: Mapping[str, str]
) -> list[PagePicture]:
    return [
        PagePicture(f.name, drawings[f.name], f.caption(material), f.alt(material))
        for f in figures
        if f.name in drawings
    ]


def _scenario(n: int, material: Material, drawings: Mapping[str, str]) -> Section:
    findings = material.numbers.findings[n]
    title = findings.study.title.rpartition(": ")[2]
    table, _ = facts_of_errors(n)
    ours = [f for f in FIGURES.values() if f.scenario == n and not f.label]
    sections = [
        *_figures(n, material, drawings),
        *folded(_pictures(ours, material, drawings)),
        Section(f"Table {table}: average errors", f"table-{table}", _errors(n, material.numbers),
                folded=True),
        Section("Over the whole ranges of Table 3: Sobol' indices", f"ranges-{n}",
                ranges.blocks(material.numbers.indices[n], findings), folded=True),
        Section(f"Scenario {n} in full", f"full-{n}", factorial.tables(findings), folded=True),
    ]
    return Section(f"Scenario {n}: {title}", f"scenario-{n}", factorial.summary(findings), sections)


def _errors(n: int, numbers: PaperNumbers) -> list[Block]:
    """The scenario's table of errors, beside the favourable point and the mean over all points."""
    return [
        Text("The paper calls them average values and does not say over what. They obey e_tot² = "
             "e_x² + e_y² + e_z², as RMS errors do. Ours are therefore RMS errors of a run, "
             f"averaged over runs. The favourable point: {favourable_in_words()}."),
        point_errors(n, numbers.points[n]),
        *_possible(n),
        errors_of_all(n, numbers.runs[n]),
    ]


def _possible(n: int) -> list[Block]:
    """The possible error at the favourable point, from one run."""
    point = possible.of_scenario(load_scenario(f"paper-scenario-{n}", FAVOURABLE.items()))
    if point is None:
        return []
    absolute, relative = possible.cells(point)
    return [Text(f"Possible there, with the packets of one run: a total error of {absolute} m, and "
                 f"{relative} m relative to the platform. This is a yardstick: the posterior "
                 f"Cramér-Rao recursion with the path's own density of acceleration, "
                 f"{point.acceleration_psd:.2g} m²/s³.")]



def _method(numbers: PaperNumbers) -> list[Block]:
    study = facts()["study"]
    points = len(numbers.studies[1].points.values)
    return [
        Text(f"Design: seven factors at two levels, all {points} combinations, "
             f"{numbers.studies[1].replicates} replicates. The paper writes "
             f"{study['combinations_printed']} combinations, but its "
             f"{study['runs_per_scenario']:,} runs are {study['replicates']} × {points}."),
        Text("Settings: the preset paper-literal, in the shipped scenarios paper-scenario-1 to 3. "
             "Their files mark the values that the paper does not give. The preset was fixed "
             "before any table was compared, and is not tuned to the tables. The favourable point "
             "and the settings of the harbour are readings of Tables 4 and 2, and are marked as "
             "such."),
        Text(method(numbers.findings[1].shown)), Text(DEFINITIONS),
        Text("The model has all main effects and interactions of two factors. Whole intervals "
             "decide what matters in practice: an effect matters if its interval lies beyond the "
             "smallest effect that matters, and is too small if its interval lies within."),
        Text("Ratio: our number divided by the paper's. Numbers agree if they differ by at most "
             f"{percent(NEAR, '.0f')}."),
        factorial.factor_table(numbers.studies[1]),
    ]


def _again(numbers: PaperNumbers, folder: Path, command: str) -> Section:
    lines = [
        f"The folder {RUNS} has the results of all runs. After an interruption, the same command "
        "continues. Seeds: " + "; ".join(
            f"Scenario {n} {seeding(study)}" for n, study in numbers.studies.items()) + ".",
    ]
    fmus: dict[str, str] = {}
    for path in sorted((folder / RUNS).iterdir()):
        fmus |= store.described(path)["definition"]["fmus"]
    return reproduce([command, f"sblcosim analyse {folder.name}/{RUNS}/paper-scenario-1"],
                     lines, fmus)


def _write(
    folder: Path, page: Page, numbers: PaperNumbers, drawings: Mapping[str, str]
) -> None:
    about = {"paper": {"citation": facts()["citation"],
                       "replicates": numbers.studies[1].replicates}}
    with artifacts.folder(folder, about) as part:
        (part / REPORT).write_text(render(page), "utf-8")
        for name, svg in drawings.items():
            (part / f"{name}.svg").write_text(svg, "utf-8")
        for n, findings in numbers.findings.items():
            for name in ("effects", "anova"):
                table = getattr(findings.data, name).reset_index()
                artifacts.write_table(table, part, f"scenario-{n}-{name}")
            main = numbers.indices[n][0].indices.reset_index()
            artifacts.write_table(main, part, f"scenario-{n}-indices")
