"""The paper beside our results: `sblcosim paper`.

Runs the paper's three factorial studies, the sessions of its Table 2 and the favourable point that
fits its Table 4, analyses them, and writes one report in which each of its Tables 2 and 4 to 6 and
its Figures 9 and 11 to 30 has a place. The numbers of the paper are in ``paper.toml``.
"""

from __future__ import annotations

import os
import time
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib import resources
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from sblcosim.fmus.files import is_hidden
from sblcosim.models.platform.beaufort import LEVELS
from scipy import stats

from ... import artifacts
from ...analysis.fit import answer, places
from ...api import run as run_scenario
from ...errors import ConfigurationError
from ...results import figures
from ...results.definitions import AXES, recorded
from ...scenario.scenario import load as load_scenario
from ...simulation.record import Record
from ...study import runner, store
from ...study import study as studies
from ...study.design import TIMES
from ...study.executors import begin, deferring_sigint
from ...study.study import Study
from ...style import ThemeName, new_figure, use
from .. import factorial
from ..common import DEFINITIONS, method, reproduce, seeding
from ..factorial import Findings, Job, number, signed, span
from ..page import Block, Page, Picture, Section, Table, Text, render
from ..study import REPORT

Progress = Callable[[float, str], None]
SCENARIOS = (1, 2, 3)
SEAS = (2, 4)
"""Beaufort numbers of Figure 9."""
SESSIONS = ("square", "spiral", "random")
RUNS, PAGES = "runs", "report"
"""Folders below the one that is asked for."""
REPLICATES, QUICK_REPLICATES = 50, 5
SESSION_RUNS, QUICK_SESSION_RUNS = 500, 100
POINT_RUNS = 50
PRACTICAL = 0.5
"""Smallest effect that matters if nobody says otherwise [m]: about half of the paper's errors."""
NEAR = 0.10
"""Relative difference up to which numbers agree."""
UNEVEN = 0.1
"""Rank correlation of fit and size of the residual from which on the scatter is not even."""
TOTAL, MEAN = "absolute_total_rms_m", "absolute_total_mean_m"

FAVOURABLE: dict[str, dict[str, float]] = {
    "time": {"sampling_time_s": 0.1},
    "target": {"speed_m_s": 0.3, "depth_std_m": 0.1},
    "platform": {
        "arm_length_m": 3.0, "gps_horizontal_std_m": 0.1,
        "imu_tilt_std_deg": 10.0, "imu_heading_std_deg": 10.0,
    },
    "acoustics": {"range_std_m": 0.1, "loss_probability": 0.0},
    "receiver": {"acceleration_psd_m2_s3": 0.1},
}
"""The design point that fits the paper's Table 4, with what else was changed of the preset."""
@cache
def facts() -> dict[str, Any]:
    """What the paper states."""
    text = (resources.files(__package__) / "paper.toml").read_text("utf-8")
    return tomllib.loads(text)


@dataclass(frozen=True, eq=False)
class Outcome:
    """What came of `run`.

    Attributes
    ----------
    report
        The HTML file.
    answers
        A sentence for each scenario.
    seconds
        Where the time went.
    """

    report: Path
    answers: Mapping[int, str]
    seconds: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Numbers:
    """All runs and their analyses, by scenario or session."""

    studies: Mapping[int, Study]
    runs: Mapping[int, pd.DataFrame]
    findings: Mapping[int, Findings]
    points: Mapping[int, pd.DataFrame]
    sessions: Mapping[str, pd.DataFrame]


def plans(quick: bool = False) -> dict[str, Study]:
    """The campaigns, by the names of their folders."""
    replicates = QUICK_REPLICATES if quick else REPLICATES
    made = {
        f"paper-scenario-{n}": studies.load(f"paper-scenario-{n}").with_replicates(replicates)
        for n in SCENARIOS
    }
    for n in SCENARIOS:
        made[f"favourable-{n}"] = studies.load({
            "name": f"favourable-{n}", "title": f"Favourable point of Scenario {n}",
            "scenario": f"paper-scenario-{n}", "fixed": FAVOURABLE, "design": {"kind": "single"},
            "replicates": POINT_RUNS, "seed": 30001 + 1000 * n,
        })
    for place, name in enumerate(SESSIONS):
        made[f"harbour-{name}"] = studies.load({
            "name": f"harbour-{name}", "title": f"Sessions of Table 2: {name}",
            "scenario": f"harbour-{name}", "receivers": ["ekf", "multilateration"],
            "design": {"kind": "single"}, "seed": 40001 + 1000 * place,
            "replicates": QUICK_SESSION_RUNS if quick else SESSION_RUNS,
        })
    return made


def _favourable_in_words() -> str:
    point = load_scenario("paper-scenario-1", FAVOURABLE)
    preset = load_scenario("paper-scenario-1")
    return (
        f"{_sensors(point)}; speed {point.target.speed_m_s:g} m/s and process noise "
        f"{point.receiver.acceleration_psd_m2_s3:g} m²/s³, where the preset has "
        f"{preset.target.speed_m_s:g} and {preset.receiver.acceleration_psd_m2_s3:g}"
    )


def _sessions_in_words() -> str:
    session = load_scenario("harbour-square")
    platform, target = session.platform, session.target
    return (
        f"GPS error that varies slowly (Gauss–Markov, {platform.gps_horizontal_markov_std_m:g} m "
        f"per horizontal axis, {platform.gps_correlation_time_s:g} s), {_sensors(session)}, wave "
        f"angles of {platform.roll_amplitude_deg:g}°, R of variances, process noise "
        f"{session.receiver.acceleration_psd_m2_s3:g} m²/s³, speed {target.speed_m_s:g} m/s, "
        f"depth {target.depth_start_m:g} m"
    )


def _sensors(scenario: Any) -> str:
    platform, acoustics = scenario.platform, scenario.acoustics
    return (
        f"white GPS error {platform.gps_horizontal_std_m:g} m, baseline "
        f"{platform.arm_length_m:g} m, sampling time {scenario.time.sampling_time_s:g} s, range "
        f"{acoustics.range_std_m:g} m, packet loss {acoustics.loss_probability:.0%}, IMU "
        f"{platform.imu_tilt_std_deg:g}°, depth {scenario.target.depth_std_m:g} m"
    )


def run(
    out: str | Path,
    *,
    quick: bool = False,
    practical: float = PRACTICAL,
    workers: int | None = None,
    command: str = "sblcosim paper",
    progress: Progress | None = None,
    started: float | None = None,
) -> Outcome:
    """Do what is missing of all campaigns, and write the report.

    Parameters
    ----------
    out
        Folder; one of an earlier call is completed.
    quick
        Few replicates.
    practical
        Smallest effect that matters [m].
    workers
        For simulations and figures; default: all cores.
    command
        With which this was asked for, for the report.
    progress
        Called with the share that is done, and a word for what is being done.
    started
        When the command was started, as `time.perf_counter` counts, for where the time went.

    Raises
    ------
    ConfigurationError
        The folder is not one of ours or cannot be written to, or a number is not as it must be.
    """
    folder = Path(out).resolve()
    check(folder)
    if not 0 < practical < np.inf:
        raise ConfigurationError(f"practical: must be above 0, got {practical}")
    seconds: dict[str, float] = {} if started is None else {
        "start-up": time.perf_counter() - started
    }

    def tell(share: float, doing: str) -> None:
        if progress is not None:
            progress(share, doing)

    with _painters(workers) as pool:
        with _clock(seconds, "simulations"):
            tables = _simulate(folder / RUNS, plans(quick), workers, tell)
        with _clock(seconds, "statistics"):
            numbers = _analyse(plans(quick), tables, practical, tell)
        with _clock(seconds, "figures"):
            drawings = _draw(_jobs(folder / RUNS, numbers), pool, tell)
            if pool is not None:
                pool.shutdown()
    with _clock(seconds, "report"):
        tell(0.97, "writing")
        page = _page(numbers, drawings, folder, command, quick)
        _write(folder / PAGES, page, numbers, drawings)
        tell(1.0, "writing")
    answers = {n: answer(found.shown) for n, found in numbers.findings.items()}
    return Outcome(folder / PAGES / REPORT, answers, seconds)


def check(folder: Path) -> None:
    """Refuse a folder with something else in it, or that cannot be written to.

    Raises
    ------
    ConfigurationError
        So it is.
    """
    if folder.is_dir():
        foreign = sorted(
            f.name
            for f in folder.iterdir()
            if f.name not in (RUNS, PAGES) and not is_hidden(f.name)
        )
        if foreign:
            raise ConfigurationError(
                f"{folder}: must be empty or hold what 'sblcosim paper' wrote, got {foreign[0]!r} "
                "in it"
            )
    elif os.path.lexists(folder):
        raise ConfigurationError(f"{folder}: must be a folder or not exist yet, got a file")
    for name in plans():
        place = folder / RUNS / name
        if place.is_dir() and not (place / store.STUDY).exists():
            for file in sorted(place.iterdir()):
                if file.name in (store.PARTS, store.RUNS) or is_hidden(file.name):
                    continue
                raise ConfigurationError(
                    f"{place}: must be empty or hold results of this study, got {file.name!r} in it"
                )
    artifacts.check(folder / PAGES)


def progress_of(out: str | Path, quick: bool = False) -> tuple[int, int]:
    """Runs that are there, and runs in all."""
    folder = Path(out).resolve() / RUNS
    wanted = plans(quick)
    runs = {name: len(s.plan.points) * s.replicates for name, s in wanted.items()}
    done = sum(min(len(store.finished(folder / name)), number) for name, number in runs.items())
    return done, sum(runs.values())


@contextmanager
def _clock(seconds: dict[str, float], name: str) -> Iterator[None]:
    started = time.perf_counter()
    yield
    seconds[name] = time.perf_counter() - started


def _simulate(
    folder: Path, wanted: Mapping[str, Study], workers: int | None, tell: Progress
) -> dict[str, pd.DataFrame]:
    total = sum(len(s.plan.points) * s.replicates for s in wanted.values())
    tables, passed = {}, 0
    for name, study in wanted.items():
        mine = len(study.plan.points) * study.replicates

        def report(share: float, passed: int = passed, mine: int = mine) -> None:
            tell(0.5 * (passed + share * mine) / total, "simulating")

        tables[name] = runner.run(study, folder / name, workers=workers, progress=report)
        passed += mine
    return tables


def _analyse(
    wanted: Mapping[str, Study], tables: Mapping[str, pd.DataFrame], practical: float,
    tell: Progress,
) -> Numbers:
    made, findings = {n: wanted[f"paper-scenario-{n}"] for n in SCENARIOS}, {}
    for n, study in made.items():
        tell(0.5 + 0.03 * n, "analysing")
        table = tables[f"paper-scenario-{n}"]
        findings[n] = factorial.find(study, table, practical=practical)
    return Numbers(
        made,
        {n: tables[f"paper-scenario-{n}"] for n in SCENARIOS},
        findings,
        {n: tables[f"favourable-{n}"] for n in SCENARIOS},
        {name: tables[f"harbour-{name}"] for name in SESSIONS},
    )


# --- Numbers beside each other -------------------------------------------------------------------


def pooled(table: pd.DataFrame, receiver: str) -> tuple[float, float]:
    """Mean and standard deviation of the total error over all samples of all runs [m]."""
    weight = table[f"{receiver}.estimates"]
    mean = float((weight * table[f"{receiver}.{MEAN}"]).sum() / weight.sum())
    square = float((weight * table[f"{receiver}.{TOTAL}"] ** 2).sum() / weight.sum())
    return mean, (square - mean**2) ** 0.5


def pooled_intervals(
    table: pd.DataFrame, receiver: str
) -> tuple[tuple[float, float], tuple[float, float]]:
    """95% intervals of what `pooled` gives, from the scatter between runs (the jackknife)."""
    weight = table[f"{receiver}.estimates"].to_numpy(np.float64)
    sums = np.stack([
        weight,
        weight * table[f"{receiver}.{MEAN}"].to_numpy(),
        weight * table[f"{receiver}.{TOTAL}"].to_numpy() ** 2,
    ])
    sums = sums[:, weight > 0]
    count = sums.shape[1]
    without = sums.sum(axis=1, keepdims=True) - sums
    mean = without[1] / without[0]
    left_out = np.stack([mean, np.sqrt(without[2] / without[0] - mean**2)])
    error = np.sqrt((count - 1) * left_out.var(axis=1))
    reach = float(stats.t.ppf(0.975, count - 1)) * error
    first, second = (
        (value - r, value + r) for value, r in zip(pooled(table, receiver), reach, strict=True)
    )
    return first, second


def average(table: pd.DataFrame, column: str) -> tuple[float, float, float]:
    """Mean over the runs, and its 95% interval."""
    values = table[column].dropna()
    reach = float(stats.t.ppf(0.975, len(values) - 1)) * float(values.std()) / len(values) ** 0.5
    mean = float(values.mean())
    return mean, mean - reach, mean + reach


def overall(table: pd.DataFrame, column: str) -> tuple[float, float, float]:
    """Mean over all points of a balanced study, and its 95% interval from the points' scatter."""
    groups = table.groupby("point")[column]
    mean = float(groups.mean().mean())
    error = float(np.sqrt((groups.var() / groups.size()).sum())) / groups.ngroups
    reach = float(stats.norm.ppf(0.975)) * error
    return mean, mean - reach, mean + reach


def verdict(ratio: float) -> str:
    """Whether two numbers agree, in a word or two."""
    if abs(ratio - 1) < 1e-9:
        return "equal"
    if abs(ratio - 1) <= NEAR:
        return f"within {NEAR:.0%}"
    percent = abs(ratio - 1)
    if ratio > 2:
        return f"{ratio:.2g} times the paper's"
    return f"{percent:.0%} {'above' if ratio > 1 else 'below'}"


def _compared(caption: str, rows: Sequence[Sequence[str]], note: str = "") -> Table:
    """The paper's numbers and ours; without intervals if there are none."""
    head: Sequence[str] = HEAD
    if all(row[3] == "–" for row in rows):
        rows, head = [(*row[:3], *row[4:]) for row in rows], (*HEAD[:3], *HEAD[4:])
    return Table(caption, head, rows, (len(head) - 1,), note)


def _row(what: str, theirs: float, ours: float, interval: str = "–") -> tuple[str, ...]:
    ratio = ours / theirs
    return what, number(theirs), number(ours), interval, f"{ratio:.2f}", verdict(ratio)


HEAD = ("Quantity", "Paper", "Ours", "95% interval", "Ratio", "Ours is")


# --- Figures -------------------------------------------------------------------------------------


def plot_waves(records: Mapping[str, Record], theme: ThemeName = "light") -> Sequence[Axes]:
    """Inclination of the platform in several seas, side by side on equal scales."""
    with use(theme):
        figure = new_figure(9.4, 5.2)
        grid = figure.subplots(3, len(records), sharex=True, sharey=True, squeeze=False)
    for place, (title, record) in enumerate(records.items()):
        figures.plot_inclination(record, list(grid[:, place]), theme=theme)
        grid[0, place].set_title(title, loc="left")
        if place:
            for panel in grid[:, place]:
                panel.set_ylabel("")
    reach = max(
        float(np.abs(np.rad2deg(recorded(r, "platform.attitude"))).max()) for r in records.values()
    )
    grid[0, 0].set_ylim(-1.1 * reach, 1.1 * reach)
    return list(grid.flat)


def _sea(beaufort: int) -> Record:
    """The platform in a sea of the shipped table of waves."""
    tables = load_scenario("harbour-square").given()
    platform = {
        key: value for key, value in tables["platform"].items()
        if not key.startswith(("roll_", "pitch_", "yaw_"))
    }
    tables["platform"] = platform | {"beaufort": beaufort}
    tables["time"] = tables["time"] | {"duration_s": figures.INCLINATION_WINDOW_S}
    return run_scenario(tables).record


def _jobs(folder: Path, numbers: Numbers) -> dict[str, Job]:
    """All figures: those of the paper by their numbers, ours by their names."""
    made: dict[str, Job] = {}

    def add(name: str, function: Callable[..., Any], *arguments: Any) -> None:
        made[name] = Job(name, function, arguments)

    for n in SCENARIOS:
        # the slow ones first
        own = {job.name: job for job in factorial.jobs(numbers.findings[n])}
        places = STATISTICS[n]
        for name in ("interactions", "residuals", "pareto", "main_effects", "box_cox"):
            if name in own:
                title = places.get(name, f"scenario-{n}-{name.replace('_', '-')}")
                add(title, own[name].function, *own[name].arguments)
    for n in SCENARIOS:
        results = folder / f"favourable-{n}"
        found = runner.replay(results, str(numbers.points[n].iloc[0]["run_id"]))
        tracks = {"EKF": found.estimates["ekf"]}
        path, coordinates, errors = PATHS[n]
        if n == 3:
            add(path, figures.plot_path_3d, found.record, {})
        else:
            add(f"{path}a", figures.plot_path, found.record, {})
            add(f"{path}b", figures.plot_path_3d, found.record, {})
        add(coordinates, figures.plot_axes, found.record, tracks)
        add(errors, figures.plot_errors, found.record, tracks)
    session = runner.replay(
        folder / "harbour-square", str(numbers.sessions["square"].iloc[0]["run_id"])
    )
    tracks = {"EKF": session.estimates["ekf"], "raw": session.estimates["multilateration"]}
    add("figure-11", figures.plot_path, session.record, tracks)
    seas = {
        f"{word}: Beaufort {b}, wave height {LEVELS[b].wave_height:g} m": _sea(b)
        for word, b in zip("ab", SEAS, strict=True)
    }
    add("figure-9", plot_waves, seas)
    return made


STATISTICS: dict[int, dict[str, str]] = {
    1: {"pareto": "figure-15", "interactions": "figure-16", "main_effects": "figure-17",
        "residuals": "figure-18"},
    2: {"pareto": "figure-22", "interactions": "figure-23", "main_effects": "figure-24"},
    3: {"pareto": "figure-28", "interactions": "figure-29", "main_effects": "figure-30"},
}
PATHS = {
    1: ("figure-12", "figure-13", "figure-14"),
    2: ("figure-19", "figure-20", "figure-21"),
    3: ("figure-25", "figure-26", "figure-27"),
}


@contextmanager
def _painters(workers: int | None) -> Iterator[Executor | None]:
    """Processes that draw, started early because that takes a second or two; None for one core."""
    count = min(workers or os.cpu_count() or 1, 4)
    if count == 1:
        yield None
        return
    with ProcessPoolExecutor(count, get_context("spawn"), begin) as pool:
        try:
            with deferring_sigint():
                for _ in range(count):
                    pool.submit(factorial.number, 0.0)  # they import what they need
            yield pool
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def _draw(jobs: Mapping[str, Job], pool: Executor | None, tell: Progress) -> dict[str, str]:
    """The figures' SVG texts."""
    results = (map if pool is None else pool.map)(factorial.draw, jobs.values())
    drawings: dict[str, str] = {}
    for i, (name, svg) in enumerate(zip(jobs, results, strict=True), 1):
        drawings[name] = svg
        tell(0.6 + 0.37 * i / len(jobs), "drawing")
    return drawings


# --- The page ------------------------------------------------------------------------------------


def _page(
    numbers: Numbers, drawings: Mapping[str, str], folder: Path, command: str, quick: bool
) -> Page:
    study = facts()["study"]
    replicates = numbers.studies[1].replicates
    runs = sum(len(table) for table in numbers.runs.values())
    lead = (
        f"{facts()['citation']}. Its three factorial studies, its tables and its figures, beside "
        f"ours: {runs:,} runs of the studies with {replicates} replicates (the paper: "
        f"{study['replicates']}), {len(numbers.sessions['square'])} sessions of each of the three "
        f"paths of Table 2."
    )
    sections = [
        Section("Summary", "summary", _summary(numbers, quick)),
        _harbour(numbers, drawings),
        *(_scenario(n, numbers, drawings) for n in SCENARIOS),
        Section("Method", "method", _method(numbers)),
        _again(numbers, folder, command),
    ]
    return Page("The paper and our results side by side", lead, sections,
                f"sblcosim {artifacts.software()['sblcosim']}")


def _summary(numbers: Numbers, quick: bool) -> list[Block]:
    blocks: list[Block] = []
    if quick:
        blocks.append(Text("A quick look with few replicates: intervals are wide, and some factors "
                           "cannot be told apart that can be without --quick.", "note"))
    for n, found in numbers.findings.items():
        blocks.append(Text(factorial.minus(f"Scenario {n}. {answer(found.shown)}"), "answer"))
        blocks.append(Text(factorial.minus(factorial.what_matters(found.shown))))
    rows: list[Sequence[str]] = []
    for n in SCENARIOS:
        number_, table = _table_of(n)
        ours, low, high = average(numbers.points[n], f"ekf.{TOTAL}")
        rows.append(_row(f"Table {number_}, total error [m]: favourable point", table["total"],
                         ours, span(low, high, number)))
        ours, low, high = overall(numbers.runs[n], f"ekf.{TOTAL}")
        rows.append(_row(f"Table {number_}, total error [m]: all 128 points", table["total"],
                         ours, span(low, high, number)))
    for name in SESSIONS:
        rows += _sessions(numbers.sessions[name], "ekf", facts()["table2"][name]["ekf"],
                          f"Table 2, EKF, {name}", " [m]")
    blocks.append(_compared("The paper's numbers and ours", rows))
    rows = []
    for n in SCENARIOS:
        rows.append(_order_row(n, numbers.findings[n]))
    blocks.append(Table("Factors that influence the error most, the largest effect first",
                        ("Scenario", "Paper", "Ours", "Verdict"), rows, (1, 2, 3),
                        "Factors in brackets cannot be told apart by the size of their effects."))
    return blocks


def _table_of(n: int) -> tuple[int, Mapping[str, Any]]:
    place = n + 3
    return place, facts()[f"table{place}"]


def _order_row(n: int, found: Findings) -> tuple[str, ...]:
    """The paper's most influential factors and ours, in words."""
    labels = found.study.labels
    named = [labels[name] for name in facts()["order"][str(n)]["named"]]
    ranks = places(found.shown)
    groups: dict[str, list[str]] = {}
    for name, rank in ranks.items():
        groups.setdefault(rank, []).append(name)
    shown, count = [], 0
    for same in groups.values():
        if count >= len(named):
            break
        shown.append(same[0] if len(same) == 1 else f"({', '.join(same)})")
        count += len(same)
    first = list(ranks)[: count]
    if not set(named) <= set(first):
        missing = ", ".join(name for name in named if name not in first)
        return f"{n}", ", ".join(named), ", ".join(shown), f"differs: {missing} is further down"
    text = "agrees"
    if extra := [name for name in first if name not in named]:
        text += f"; {', '.join(extra)} cannot be told from the last of them"
    return f"{n}", ", ".join(named), ", ".join(shown), text


def _harbour(numbers: Numbers, drawings: Mapping[str, str]) -> Section:
    rows = []
    for name in SESSIONS:
        facts_ = facts()["table2"][name]
        for label, key, receiver in (("raw fix (j = 1)", "instrument", "multilateration"),
                                     ("EKF (j = 2)", "ekf", "ekf")):
            rows += _sessions(numbers.sessions[name], receiver, facts_[key], f"{name}, {label}")
    count = len(numbers.sessions["square"])
    table = _compared(
        "Table 2: total error [m]", rows,
        f"Ours: mean and standard deviation over all samples of {count} sessions each; "
        "intervals from the scatter between sessions.")
    blocks: list[Block] = [
        Text(f"The paper gives sea state, depth, loss and sound speed of its sessions; the rest "
             f"was chosen to come near its EKF rows: {_sessions_in_words()}."),
        table,
        Text("The EKF's errors are those of a GPS error that all beacons share and that varies "
             "slowly: its standard deviation is half of its mean, as a two-dimensional Gaussian "
             "error has it."),
        Text("The row j = 1 is the track of the paper's real receiver in the water, or a raw fix; "
             "which of them is not said. Ours is the fix without a filter, from simulation: what "
             "a real channel adds is not in it, so that it is smaller."),
    ]
    seas = [Figure(9), Figure(11)]
    angles = [np.sqrt((np.rad2deg(recorded(_sea(b), "platform.attitude")) ** 2).mean(axis=0))
              for b in SEAS]
    rms = "; ".join(
        f"Beaufort {b}: roll {a[0]:.1f}°, pitch {a[1]:.1f}°, yaw {a[2]:.1f}°"
        for b, a in zip(SEAS, angles, strict=True)
    )
    square = numbers.sessions["square"].iloc[0]
    shown = {
        9: [Text(f"Ours: RMS of the angles in {rms}. The paper prints no angles: amplitudes, "
                 "frequencies and phases of its waves are not given.")],
        11: [Text(f"Ours: session 1 of {count}, a square, its mean total error "
                  f"{square[f'ekf.{MEAN}']:.2f} m for the EKF (line) and "
                  f"{square[f'multilateration.{MEAN}']:.2f} m for the raw fix (dots). The paper "
                  "does not say which of its sessions it shows.")],
    }
    sea = {f"wave height {word} [m]": LEVELS[beaufort].wave_height
           for word, beaufort in zip("ab", SEAS, strict=True)}
    ours = {9: sea | {f"Beaufort {word}": b for word, b in zip("ab", SEAS, strict=True)},
            11: _session_settings()}
    return Section("The harbour and the sea", "harbour", [], [
        Section("Table 2: sessions in the harbour", "table-2", blocks),
        *(figure.section(drawings, shown[figure.number], ours[figure.number]) for figure in seas),
    ])


def _sessions(
    table: pd.DataFrame, receiver: str, theirs: Sequence[float], what: str, unit: str = ""
) -> list[tuple[str, ...]]:
    """Rows of Table 2 for a receiver on a path: mean and standard deviation."""
    return [
        _row(f"{what}: {word}{unit}", known, ours, span(*ends, number))
        for word, known, ours, ends in zip(
            ("mean", "standard deviation"), theirs, pooled(table, receiver),
            pooled_intervals(table, receiver), strict=True,
        )
    ]


def _session_settings() -> dict[str, float]:
    scenario = load_scenario("harbour-square")
    return {
        "depth of the receiver [m]": scenario.target.depth_start_m,
        "packet loss [%]": 100 * scenario.acoustics.loss_probability,
        "speed of sound [m/s]": scenario.acoustics.sound_speed_m_s,
    }


@dataclass(frozen=True)
class Figure:
    """A figure of the paper, by its number."""

    number: int

    @property
    def facts(self) -> Mapping[str, Any]:
        """What the paper says of it."""
        found: Mapping[str, Any] = next(
            f for f in facts()["figure"] if f["number"] == self.number
        )
        return found

    def section(
        self,
        drawings: Mapping[str, str],
        blocks: Sequence[Block],
        ours: Mapping[str, float] | None = None,
        caption: str = "",
        alt: str = "",
    ) -> Section:
        """Its place in the report: what the paper states, ours, and the drawing."""
        known = self.facts
        name = f"figure-{self.number}"
        where = f"section {known['section']}"
        text = f"In the paper ({where}): {known['shows']}."
        if "says" in known:
            text += f" It says: {known['says']}."
        elif "states" not in known and not ours:
            text += " It prints no number with it."
        made: list[Block] = [Text(text)]
        states = known.get("states", {})
        rows = [
            _row(what, float(theirs), float((ours or {})[what]))
            for what, theirs in states.items()
        ]
        if rows:
            made.append(_compared(f"Figure {self.number} in numbers", rows))
        shows = known["shows"]
        title = f"Figure {self.number}: {shows}"
        caption = f"Ours, as Figure {self.number}: {caption or shows}"
        made += [*blocks, *(
            Picture(key, drawings[key], f"{caption}{word}", alt or f"Ours: {shows}{word}")
            for key, word in ((name, ""), (f"{name}a", " (a)"), (f"{name}b", " (b)"))
            if key in drawings
        )]
        return Section(title, f"place-{name}", made)


def _scenario(n: int, numbers: Numbers, drawings: Mapping[str, str]) -> Section:
    found, names = numbers.findings[n], STATISTICS[n]
    a = found.shown
    title = found.study.title.rpartition(": ")[2]
    place, _ = _table_of(n)
    run_ = numbers.points[n].iloc[0]
    point = (f"Ours: one run at the favourable point of Table {place}, the first of "
             f"{len(numbers.points[n])}. The paper does not say which run it shows.")
    theirs = facts()[f"table{place}"]["total"]
    sections = [
        Section(f"Table {place}: average errors", f"table-{place}", _averages(n, numbers))
    ]
    radius = {"radius [m]": load_scenario(f"paper-scenario-{n}").target.radius_m}
    extra: dict[int, list[Block]] = {
        0: [Text("Ours: the true path. " + (
            "Its centre and where it begins are not given." if n == 1 else
            "Radius, turns and length are not given." if n == 2 else
            "How it is drawn by lot is not given; ours has straight legs of random lengths and "
            "directions."))],
        1: [Text(point)],
        2: [Text(point), _compared(
            "Total error",
            [_row(f"Table {place}, e_tot [m]; ours: RMS of this run", theirs, run_[f"ekf.{TOTAL}"])]
        )],
    }
    for i, name in enumerate(PATHS[n]):
        sections.append(_figure(name).section(drawings, extra[i], radius))
    shown: dict[str, list[Block]] = {
        "pareto": [_ranking(n, found)],
        "interactions": [Text(_interactions(found))],
        "main_effects": [Text(factorial.direction(a))],
        "residuals": [Text(_residuals(found))],
    }
    for name, where in names.items():
        drawn = factorial.picture(found, name, "")
        sections.append(
            _figure(where).section(drawings, shown[name], caption=drawn.caption, alt=drawn.alt)
        )
    beyond = factorial.tables(found)
    for name in ("residuals", "box_cox"):
        key = f"scenario-{n}-{name.replace('_', '-')}"
        if key in drawings:
            drawn = factorial.picture(found, name, drawings[key])
            beyond.append(Picture(key, drawn.svg, drawn.caption, drawn.alt))
    sections.append(Section(f"Scenario {n} in full", f"full-{n}", beyond))
    return Section(
        f"Scenario {n}: {title}", f"scenario-{n}", factorial.summary(found), sections
    )


def _figure(name: str) -> Figure:
    return Figure(int(name.rpartition("-")[2]))


def _residuals(found: Findings) -> str:
    """What the residuals say about the model."""
    a = found.shown
    residuals = a.residuals
    skewness, kurtosis = (float(f(residuals["residual"])) for f in (stats.skew, stats.kurtosis))
    text = (f"Ours: R² {a.r2:.1%}, adjusted {a.r2_adjusted:.1%}, predicted {a.r2_predicted:.1%}; "
            f"skewness of the residuals {skewness:.2g}, excess kurtosis "
            f"{kurtosis:.2g} (normal: 0).")
    if residuals["fit"].corr(residuals["residual"].abs(), method="spearman") > UNEVEN:
        text += (" They scatter more where the fitted value is larger, so that the intervals in "
                 "metres are an average over the points; the ratios below, from the logarithm, "
                 "suffer less from it.")
    return factorial.minus(text)


def _averages(n: int, numbers: Numbers) -> list[Block]:
    place, table = _table_of(n)
    rows, full = [], []
    for axis in (*AXES, "total"):
        column = f"ekf.absolute_{axis}_rms_m"
        name = "e_tot" if axis == "total" else f"e_{axis}"
        ours, low, high = average(numbers.points[n], column)
        rows.append(_row(f"{name} [m]", table[axis], ours, span(low, high, number)))
        ours, low, high = overall(numbers.runs[n], column)
        full.append(_row(f"{name} [m]", table[axis], ours, span(low, high, number)))
    relative, low, high = average(numbers.points[n], "ekf.relative_total_rms_m")
    rows.append(_row("e_tot [m], relative to the platform", table["total"], relative,
                     span(low, high, number)))
    count = len(numbers.points[n])
    first = average(numbers.points[n], f"ekf.{TOTAL}")[0] / table["total"]
    if n == 1:
        reading = (
            "This is a consistent reading of the table for Scenario 1, not a proof: the paper does "
            "not say which runs it averages."
        )
    else:
        reading = (
            f"The same point, which was chosen for Scenario 1, gives a total error of "
            f"{first:.2f} times that of Table {place}: path, speed and filter tuning of this "
            "scenario are not given, and nothing was tuned to it."
        )
    runs = numbers.runs[n]
    gps = numbers.studies[n].factors["gps"]
    better = runs[runs["gps"] == gps.levels[0]]
    fine = overall(better, f"ekf.{TOTAL}")[0]
    whole = overall(runs, f"ekf.{TOTAL}")[0]
    return [
        Text(f"The paper calls them average values and does not say over what; they obey e_tot² = "
             f"e_x² + e_y² + e_z², as RMS errors do, and so ours are RMS errors of a run, then "
             f"averaged. The favourable point: {_favourable_in_words()}."),
        _compared(f"Table {place} and the favourable point, mean of {count} runs", rows),
        Text(reading),
        _compared(
            f"Table {place} and the mean over all {len(numbers.studies[n].plan.points)} points",
            full),
        Text(f"The table is no average over all levels: ours is {whole / table['total']:.2g} times "
             f"as large, and {fine:.2g} m even over the half of the points with the small GPS "
             "error. In no reading of what the paper leaves open that was tried does such an "
             "average come near it."),
    ]


def _ranking(n: int, found: Findings) -> Table:
    """The paper's most influential factors beside the size of ours."""
    a = found.shown
    labels = found.study.labels
    named = {labels[name] for name in facts()["order"][str(n)]["named"]}
    rows = []
    for name, place in places(a).items():
        row: Any = a.effects.loc[name]
        rows.append((name, "named" if name in named else "–", place, signed(row["effect"]),
                     span(row["low"], row["high"]), number(abs(row["t"]))))
    return Table(
        "Main effects: which the paper names as the most influential, and the size of ours",
        ("Factor", "Paper", "Our place", "Effect [m]", "95% interval [m]", "|t|"), rows, (1,),
        f"Verdict: {_order_row(n, found)[3]}. Where several factors share places, the sizes of "
        "their effects cannot be told apart. The paper prints no sizes.")


def _interactions(found: Findings) -> str:
    a = found.shown
    ranked = a.ranked()
    several = ranked[ranked["order"] == 2]
    top = [
        f"{name} ({signed(row['effect'])}{factorial.unit(a)}, "
        f"{span(row['low'], row['high'])})" for name, row in several.head(3).iterrows()
    ]
    gps = found.study.labels["gps"]
    names = several.index[several["significant"].astype(bool)]
    with_gps = [name for name in names if gps in str(name).split(TIMES)]
    return (
        f"Ours: the largest are {'; '.join(top)}. {gps} has {len(with_gps)} interactions that "
        f"are significant. The paper prints no sizes."
    )


def _method(numbers: Numbers) -> list[Block]:
    study = facts()["study"]
    points = len(numbers.studies[1].plan.points)
    return [
        Text(f"Design: seven factors at two levels, all {points} combinations, "
             f"{numbers.studies[1].replicates} replicates. The paper writes "
             f"{study['combinations_printed']} combinations, but its "
             f"{study['runs_per_scenario']:,} runs are {study['replicates']} × {points}."),
        Text("Settings: the preset paper-literal, in the shipped scenarios paper-scenario-1 to 3, "
             "where what the paper does not give is marked. It was fixed before any table was "
             "compared, and nothing in it is tuned to the tables. The favourable point and the "
             "harbour's settings are readings of Tables 4 and 2, said to be so where they stand."),
        Text(method(numbers.findings[1].shown)), Text(DEFINITIONS),
        Text("The model has all main effects and interactions of two factors. What matters in "
             "practice is decided by whole intervals: an effect matters if its interval lies "
             "beyond the smallest effect that matters, and is too small if it lies within."),
        Text(f"Ratio: ours over the paper's. Numbers agree if they are within {NEAR:.0%}."),
        factorial.factor_table(numbers.studies[1]),
    ]


def _again(numbers: Numbers, folder: Path, command: str) -> Section:
    lines = [
        f"Results of all runs are in the folder {RUNS}; the command goes on where it was "
        "interrupted. Seeds: " + "; ".join(
            f"Scenario {n} {seeding(study)}" for n, study in numbers.studies.items()) + ".",
    ]
    fmus: dict[str, str] = {}
    for path in sorted((folder / RUNS).iterdir()):
        fmus |= store.described(path)["definition"]["fmus"]
    return reproduce([command, f"sblcosim analyse {folder.name}/{RUNS}/paper-scenario-1"],
                     lines, fmus)


def _write(
    folder: Path, page: Page, numbers: Numbers, drawings: Mapping[str, str]
) -> None:
    about = {"paper": {"citation": facts()["citation"],
                       "replicates": numbers.studies[1].replicates}}
    with artifacts.folder(folder, about) as place:
        (place / REPORT).write_text(render(page), "utf-8")
        for name, svg in drawings.items():
            (place / f"{name}.svg").write_text(svg, "utf-8")
        for n, found in numbers.findings.items():
            for name in ("effects", "anova"):
                table = getattr(found.data, name).reset_index()
                artifacts.write_table(table, place, f"scenario-{n}-{name}")
