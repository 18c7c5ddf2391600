"""The tables of a report, read back from its HTML, have the numbers of their frames."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import html5lib
import numpy as np
import pandas as pd
import pytest
import sblcosim
from sblcosim import require
from sblcosim.report import study as reports
from sblcosim.report.two_level import box_cox_sentence
from sblcosim.study import runner, store
from sblcosim.study.study import load
from scipy.stats import binomtest
from seams import Seam

H = "{http://www.w3.org/1999/xhtml}"
FACTORS = {"noise": ("acoustics.range_std_m", [0.05, 0.5, 1.5]),
           "arm": ("platform.arm_length_m", [0.4, 4.0])}
FAILED = (2, 5)
"""Rows of runs that have failed in the tables that are analysed here."""


def study_file(kind: str, folder: Path, more: str = "") -> Path:
    text = (f'scenario = "harbour-square"\nreplicates = 7\n{more}\n[fixed]\n'
            f'time.duration_s = 8.0\n[design]\nkind = "{kind}"\n')
    if kind == "space":
        text = text.replace("replicates = 7\n", "") + "base_rows = 16\n"
    for name, (key, levels) in FACTORS.items() if kind != "single" else ():
        own = levels if kind in ("grid", "sweep") else [levels[0], levels[-1]]
        said = f'distribution = "uniform"\nrange = {own}' if kind == "space" else f"levels = {own}"
        text += f'[factors.{name}]\nkeys = ["{key}"]\n{said}\n'
    file = folder / f"{kind}.toml"
    file.write_text(text, "utf-8")
    return file


def invented(table: pd.DataFrame, kind: str) -> pd.DataFrame:
    """A table of runs with other numbers: scattered, some lost, some failed."""
    rng = np.random.default_rng(len(table))
    table = table.copy()
    for name in table:
        if name.endswith(".lost") or name.endswith(".inconsistent"):
            table[name] = (rng.random(len(table)) < 0.3).astype(float)
        elif "nees" in name:  # points that claim too little, right, and too much
            scale = np.array([0.1, 1.0, 10.0])[table["point"].to_numpy(int) % 3]
            table[name] = 3.0 * scale * rng.chisquare(300, len(table)) / 300
        elif name.endswith("_m"):
            level = table["noise"].astype(float) if "noise" in table else 1.0
            table[name] = np.exp(rng.normal(0.0, 0.4, len(table))) * (1.0 + level)
    if kind != "space":
        for name in [name for name in table if "." in str(name)]:
            table[name] = table[name].astype("boolean" if table[name].dtype == bool else float)
            table.loc[list(FAILED), name] = pd.NA if table[name].dtype == "boolean" else np.nan
        table.loc[list(FAILED), "error"] = "the FMU has failed"
    return table


Report = tuple[dict[str, tuple[str, pd.DataFrame]], Path, pd.DataFrame]


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Report]:
    """Tables of a report by caption, its folder, and the runs; made once for each kind."""
    made: dict[Any, Report] = {}

    def get(kind: str, **options: Any) -> Report:
        key = (kind, *options.items())
        if key not in made:
            folder = tmp_path_factory.mktemp(kind)
            definition = load(study_file(kind, folder))
            runner.run(definition, folder / "runs", workers=1)
            whole = invented(store.table(folder / "runs"), kind)
            with Seam() as seam:
                seam.instead(store.table, lambda _, columns=None: whole.copy())
                reports.analysed(folder / "runs", **options).save(folder / "out", other="replace")
            made[key] = (tables((folder / "out" / reports.REPORT).read_text("utf-8")),
                         folder / "out", whole)
        return made[key]

    return get


# --- Reading back --------------------------------------------------------------------------------


def tables(html: str) -> dict[str, tuple[str, pd.DataFrame]]:
    """Each table of a page by its caption: all cells as texts, with the heads as columns."""
    document = html5lib.parse(html)
    found = {}
    for table in document.iter(f"{H}table"):
        caption = "".join(table.find(f"{H}caption").itertext()).strip()
        head = [_text(cell) for cell in table.find(f"{H}thead").iter(f"{H}th")]
        rows = [
            [_text(cell) for cell in row if cell.tag in (f"{H}th", f"{H}td")]
            for row in table.find(f"{H}tbody").iter(f"{H}tr")
        ]
        assert caption not in found
        found[caption] = (caption, pd.DataFrame(rows, columns=head))
    return found


def _text(cell: Any) -> str:
    return re.sub(r"[\s\u00a0]+", " ", "".join(cell.itertext())).strip()


def value(text: str) -> float:
    """The number that a cell shows."""
    text = text.replace("−", "-").replace(",", "").replace("+", "").removesuffix(" m")
    if text in ("–", ""):
        return np.nan
    if text.startswith("<"):
        return 0.0
    if text.endswith("%"):
        return float(text.removesuffix("%")) / 100.0
    return float(text)


def span(text: str) -> tuple[float, float]:
    """The ends of an interval."""
    if text == "–":
        return np.nan, np.nan
    low, high = text.split(" to ")
    return value(low), value(high)


def same(shown: float, true: float, text: str) -> bool:
    """Whether a number of a page is that of a frame, to the digits that are shown."""
    if np.isnan(shown) or pd.isna(true):
        return bool(np.isnan(shown) and pd.isna(true))
    mantissa = re.sub(r"e.*", "", text.replace(",", "").rstrip("%m "))
    decimals = len(mantissa.partition(".")[2])
    exponent = int(text.partition("e")[2] or 0) if "e" in text else 0
    unit = 10.0 ** (exponent - decimals) * (0.01 if text.endswith("%") else 1.0)
    digits = len(re.sub(r"\D", "", mantissa).lstrip("0"))
    trailing = 0 if "." in mantissa else max(0, digits - 3)
    return abs(shown - true) <= 0.5001 * unit * 10**trailing or (
        text.startswith("<") and true < float(text.removeprefix("< "))
    )


def agree(cells: Any, frame: Any, what: str) -> None:
    """All numbers of a column are those of a frame's column."""
    texts, truth = list(cells), list(frame)
    assert len(texts) == len(truth), what
    for text, true in zip(texts, truth, strict=True):
        assert same(value(text), true, text.replace("−", "-")), f"{what}: {text} for {true}"


def spans_agree(cells: Any, low: Any, high: Any, what: str) -> None:
    texts = [(text if text != "–" else "– to –").split(" to ") for text in cells]
    agree([one for one, _ in texts], low, f"{what}, low")
    agree([other for _, other in texts], high, f"{what}, high")


def checked(shown: pd.DataFrame, frame: pd.DataFrame, columns: Mapping[str, Any]) -> None:
    """Each column of a table by what it shows; every one must be known.

    Parameters
    ----------
    columns
        By position, as heads repeat: the frame's column, a pair of columns of an interval, or None
        for words that are compared elsewhere.
    """
    assert len(shown.columns) == len(columns), list(shown.columns)
    for i, (head, of) in enumerate(zip(shown.columns, columns.values(), strict=True)):
        cells = shown.iloc[:, i]
        if isinstance(of, tuple):
            spans_agree(cells, frame[of[0]], frame[of[1]], head)
        elif of is not None:
            agree(cells, frame[of], head)


def named(found: Mapping[str, Any], start: str) -> pd.DataFrame:
    (frame,) = [shown for caption, shown in found.values() if caption.startswith(start)]
    return frame


def csv(folder: Path, name: str) -> pd.DataFrame:
    return pd.read_parquet(folder / f"{name}.parquet")


# --- The tables ----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["full", "grid", "sweep", "single"])
def test_points_are_means_over_the_runs_that_have_not_failed(
    report: Callable[..., Report], kind: str
) -> None:
    found, _, runs = report(kind)
    shown = named(found, "Design points")
    good = runs[runs["error"].isna()]
    assert len(good) < len(runs)
    points = sorted(set(good["point"]))
    agree(shown["Point"], points, "point")
    agree(shown["Runs"], [sum(good["point"] == p) for p in points], "runs")
    columns = [c for c in shown if ": " in c]
    assert columns
    for column in columns:
        receiver, _, words = column.partition(": ")
        name = {"mean RMS [m]": "absolute_total_rms_m"}.get(words, words)
        each = [good.loc[good["point"] == p, f"{receiver}.{name}"].dropna() for p in points]
        agree(shown[column].str.partition(" (")[0], [own.mean() for own in each], column)
        if name == "misleading":
            for cell, own in zip(shown[column], each, strict=True):
                # Clopper and Pearson's, from SciPy's own test.
                exact = binomtest(int(own.sum()), len(own)).proportion_ci(0.95, "exact")
                low, high = (int(it) for it in cell.partition(" (")[2][:-1].split("–"))
                assert low <= 100 * exact.low < low + 1
                assert high - 1 < 100 * exact.high <= high
        assert column.endswith("[m]") or all("%" in c or c == "0" for c in shown[column]), column


def test_effects_of_two_levels(report: Callable[..., Report]) -> None:
    found, folder, runs = report("full", practical=0.2)
    effects = csv(folder, "effects").sort_values("t", key=abs, ascending=False, kind="stable")
    shown = named(found, "Effects on")
    order = list(shown["Effect"])
    assert sorted(order) == sorted(effects["term"])
    effects = effects.set_index("term").loc[order]
    checked(
        shown.drop(columns=[c for c in shown if c.startswith("Detectable")]), effects,
        {"Effect": None, "size": "effect", "interval": ("low", "high"), "t": "t", "p": "p",
         "Share": "share", "In practice": None},
    )  # fmt: skip
    assert list(shown["In practice"]) == list(effects["verdict"])
    good = runs[runs["error"].isna()]
    response = good["ekf.absolute_total_rms_m"]
    for name, (_, levels) in FACTORS.items():  # high less low, each point once
        by_level = [
            response[good[name] == level].groupby(good["point"]).mean().mean()
            for level in (levels[0], levels[-1])
        ]
        cell = shown.loc[shown["Effect"] == name].iloc[0, 1]
        assert value(cell) == pytest.approx(by_level[1] - by_level[0], abs=0.1), name
    anova = csv(folder, "anova").set_index("source")
    shown = named(found, "Analysis of variance")
    rows = anova.loc[shown["Source"]]
    checked(shown, rows, {"Source": None, "Sum of squares": "ss", "df": "df", "Mean square": "ms",
                          "F": "f", "p": "p"})  # fmt: skip
    model = named(found, "The model").set_index("Quantity")["Value"]
    assert model["Runs"].split(",")[0] == f"{len(good)}"
    mean = good.groupby("point")["ekf.absolute_total_rms_m"].mean().mean()
    assert float(model["Overall mean"].split()[0]) == pytest.approx(mean, rel=0.1)


@pytest.mark.parametrize("options", [{}, {"practical": 0.3}], ids=["", "practical"])
def test_tables_of_a_grid(report: Callable[..., Report], options: dict[str, Any]) -> None:
    found, folder, runs = report("grid", **options)
    good = runs[runs["error"].isna()]
    checked(named(found, "Means of the levels"), csv(folder, "main_effects"),
            {"Factor": None, "Level": "level", "mean": "mean", "Interval": ("low", "high"),
             "Runs": "runs", "Lost": "lost"})  # fmt: skip
    checked(named(found, "Medians of the levels"), csv(folder, "medians"),
            {"Factor": None, "Level": "level", "median": "median",
             "Interval": ("low", "high")})  # fmt: skip
    for row in csv(folder, "medians").itertuples():
        mine = good.loc[good[row.factor] == row.level, "ekf.absolute_total_rms_m"]
        assert row.median == pytest.approx(mine.median())
    for row in csv(folder, "main_effects").itertuples():
        mine = runs.loc[runs[row.factor] == row.level]
        assert row.runs == mine["error"].isna().sum()
        gone = mine["error"].notna() | (mine["ekf.lost"] == 1)  # without a response it is lost, too
        assert row.lost == pytest.approx(gone.mean())
    pairs = csv(folder, "pairs")
    shown = named(found, "Pairs of levels")
    by_words = {f"{r.one:g} m less {r.other:g} m": r for r in pairs.itertuples()}
    rows = pd.DataFrame([by_words[words]._asdict() for words in shown["Levels"]])
    assert list(shown["Factor"]) == list(rows["factor"])
    columns: dict[str, Any] = {"Factor": None, "Levels": None, "difference": "difference",
                               "interval": ("low", "high"), "p": "p"}
    checked(shown, rows, columns | ({"Verdict": None} if options else {}))
    anova = csv(folder, "anova").set_index("source")
    table = named(found, "Analysis of variance")
    checked(table, anova.loc[table["Source"]],
            {"Source": None, "df": "df", "Sum of squares": "sum_sq", "Mean square": "mean_sq",
             "F": "F", "p": "p"})  # fmt: skip


def test_the_sign_of_a_difference_is_that_of_the_first_level_less_the_second(
    report: Callable[..., Report],
) -> None:
    found, _, runs = report("grid")
    shown = named(found, "Pairs of levels")
    good = runs[runs["error"].isna()]
    for factor, levels, cell in shown.iloc[:, :3].itertuples(index=False):
        one, other = (
            good.loc[good[factor] == value(level), "ekf.absolute_total_rms_m"].mean()
            for level in levels.split(" less ")
        )
        if abs(one - other) > 0.3:
            assert np.sign(value(cell)) == np.sign(one - other), levels


@pytest.mark.parametrize("kind", ["sweep", "single"])
def test_means_of_a_sweep_and_of_no_factors(report: Callable[..., Report], kind: str) -> None:
    found, folder, runs = report(kind)
    (shown,) = [t for c, t in found.values() if any("Standard deviation" in h for h in t.columns)]
    means = csv(folder, "means")
    first = {} if kind == "single" else {"Factor": None, "Level": "value"}
    checked(shown, means, first | {"Runs": "runs", "mean": "mean", "interval": ("low", "high"),
                                   "std": "std"})  # fmt: skip
    if kind == "single":
        good = runs.loc[runs["error"].isna(), "ekf.absolute_total_rms_m"]
        assert means["std"][0] == pytest.approx(good.std(ddof=1))
        assert means["mean"][0] == pytest.approx(good.mean())


def test_indices_of_a_space(report: Callable[..., Report]) -> None:
    found, folder, _ = report("space")
    indices = csv(folder, "indices")
    captions = [c for c in found if c.startswith("Sobol")]
    assert len(captions) == indices["response"].nunique() == 2
    for caption, response in zip(captions, indices["response"].unique(), strict=True):
        mine = indices[indices["response"] == response].set_index("factor")
        shown = found[caption][1]
        rows = mine.loc[[{"chance (the seed)": "seed"}.get(n, n) for n in shown["Factor"]]]
        checked(shown, rows, {"Factor": None, "First order": "first",
                              "Interval": ("first_low", "first_high"), "Total": "total",
                              "Interval of it": ("total_low", "total_high")})  # fmt: skip


def test_a_cell_that_is_wrong_is_noticed() -> None:
    for text, true in (("1.23", 1.2349), ("−4.5", -4.46), ("12 %", 0.1234), ("< 0.0001", 5e-5),
                       ("1,235", 1234.6), ("1.2e-05", 1.23e-5), ("–", np.nan), ("120", 119.6)):
        assert same(value(text), true, text.replace("−", "-")), text
    for text, true in (("1.23", 1.24), ("−4.5", 4.46), ("12 %", 12.34), ("< 0.0001", 5e-3),
                       ("1,235", 1244.6), ("1.2e-05", 1.3e-5), ("–", 0.0), ("120", 118.0)):
        assert not same(value(text), true, text.replace("−", "-")), text


@pytest.mark.parametrize("kind", ["full", "grid", "single"])
def test_covariances_count_points_by_verdict(report: Callable[..., Report], kind: str) -> None:
    found, folder, _ = report(kind)
    shown = named(found, "Are the covariances right?").iloc[0]
    verdicts = csv(folder, "consistency")
    verdicts = verdicts[(verdicts["receiver"] == "ekf") & (verdicts["frame"] == "absolute")]
    assert (shown["Receiver"], shown["Error"]) == ("ekf", "absolute")
    counted = verdicts["verdict"].value_counts()
    assert value(shown["Points"]) == len(verdicts)
    assert value(shown["In band"]) == counted.get("in band", 0)
    assert value(shown["Unknown"]) == counted.get("one run", 0) + counted.get("unknown", 0)
    assert value(shown["Runs per point"]) == verdicts["runs"].min()
    assert same(value(shown["Runs needed"]), verdicts["runs_needed"].max(), shown["Runs needed"])
    for word, inverse in (("optimistic", False), ("pessimistic", True)):
        cell = shown[f"{word.capitalize()}, by a factor of"]
        number, _, factors = cell.partition(", ")
        assert value(number) == counted.get(word, 0)
        mine = verdicts.loc[verdicts["verdict"] == word, "factor"]
        mine = 1.0 / mine if inverse else mine
        if len(mine):
            ends = span(factors) if " to " in factors else (value(factors), value(factors))
            assert ends == pytest.approx((mine.min(), mine.max()), rel=6e-3)


@pytest.mark.parametrize("kind", ["grid", "single"])
def test_what_is_possible_is_that_of_each_point(report: Callable[..., Report], kind: str) -> None:
    found, folder, runs = report(kind)
    shown = named(found, "What is possible")
    study = load(folder.parent / f"{kind}.toml")
    good = runs[runs["error"].isna()]
    squares = (good["ekf.absolute_total_rms_m"] ** 2).groupby(good["point"]).mean()
    agree(shown["RMS, ekf"], np.sqrt(squares), "root of the mean square over the runs")
    for place, row in shown.iterrows():
        point = int(str(place)) + 1
        scenario = study.base.override(study.overrides(point).items())
        run = sblcosim.run(scenario.override({"seed": study.run_seed(point, 1)}))
        possible = run.verdicts["raw"]
        for head, true in (
            ("Reference", possible.absolute_rms),
            ("Reference, relative to the platform", possible.relative_rms),
        ):
            cell = row[head]
            assert cell == "none" if not possible.accuracy else same(value(cell), true, cell)


def test_the_table_of_factors_has_their_levels_and_keys(report: Callable[..., Report]) -> None:
    found, _, _ = report("grid")
    shown = named(found, "Factors").set_index("Factor")
    for name, (key, levels) in FACTORS.items():
        row = shown.loc[name]
        assert [float(level) for level in row["Levels"].split(" / ")] == levels
        assert (row["Unit"], row["Keys of the scenario"], row["Column"]) == ("m", key, name)


def test_designs_of_an_answer(tmp_path: Path) -> None:
    question = tmp_path / "small.toml"
    question.write_text(
        'scenario = "harbour-square"\nfixed = {time = {duration_s = 12.0}}\nsettling_time_s = 4.0\n'
        'response = "total_rms_m"\nlimit = 2.0\nshare = 0.8\nmost_runs = 400\n'
        '[choices.noise]\nkeys = ["acoustics.range_std_m"]\nlevels = [0.05, 0.3, 1.5]\n'
        "costs = [500, 100, 20]\n", "utf-8",
    )  # fmt: skip
    answer = require.decide(question, tmp_path / "answer", workers=1)
    (file,) = (tmp_path / "answer").rglob("report.html")
    found = tables(file.read_text("utf-8"))
    designs = answer.designs
    assert len(set(designs["verdict"])) > 1
    shown = named(found, "All designs")
    by_level = {f"{row.noise:g}": row for row in designs.itertuples()}
    shown_cells = shown.set_index(shown.columns[0])
    assert len(shown_cells) == len(designs)
    for name, cells in shown_cells.iterrows():
        row: Any = by_level[re.findall(r"[\d.]+", str(name))[0]]
        assert cells["Verdict"] == row.verdict
        assert value(cells["Runs"]) == row.runs
        assert value(re.sub(r"[^\d.]", "", cells["Cost"])) == row.cost
        within = cells["80 % within [m]"]
        assert within == "lost" if np.isinf(row.estimate) else same(
            value(within), row.estimate, within
        )
        passed = cells["Within 2 m"]
        assert same(value(passed), row.passed / row.runs, passed)
        ends = dict(re.findall(r"([≥≤]) ([\d.]+)", cells["Surely [m]"]))
        expected = {"≥": row.lower, "≤": row.upper}
        for sign, other in (("≥", "suffices"), ("≤", "fails")):
            is_shown = np.isfinite(expected[sign]) and row.verdict != other
            assert (sign in ends) == is_shown
            if is_shown:
                assert same(float(ends[sign]), expected[sign], ends[sign])
        low, high = (expected[sign] for sign in "≥≤")
        assert not low > row.estimate
        assert not high < row.estimate


@pytest.mark.parametrize(("best", "inside", "words"), [
    (0.5, (0.0, 1.0), "interval 0 to 1; the response suits the model as it is"),
    (0.5, (0.5, 1.0), "interval 0.5 to 1; the response suits the model as it is"),
    (0.0, (-0.5, 0.5), "interval -0.5 to 0.5; its logarithm would suit the model"),
    (-0.5, (-0.5, 0.0), "interval -0.5 to 0; its logarithm would suit the model"),
    (-1.0, (-2.0, -0.5), "interval -2 or below to -0.5; its logarithm suits the model better than "
                         "the response itself"),
    (0.0, (0.5, 0.5), "interval 0.5 to 0.5; its logarithm suits the model better than the response "
                      "itself"),
    (0.5, (0.0, 0.5), "interval 0 to 0.5; its logarithm would suit the model"),
    (1.0, (1.0, 1.5), "interval 1 to 1.5; the response suits the model as it is"),
    (0.5, (0.5, 0.5), "interval 0.5 to 0.5; the response itself suits the model better than its "
                      "logarithm"),
    (1.5, (1.5, 2.0), "interval 1.5 to 2 or above; the response itself suits the model better than "
                      "its logarithm"),
])  # fmt: skip
def test_the_advice_on_a_power_follows_from_its_interval(
    best: float, inside: tuple[float, float], words: str
) -> None:
    powers = np.arange(-2.0, 2.25, 0.5)
    profile = pd.DataFrame({
        "lambda": powers, "log_likelihood": -((powers - best) ** 2),
        "inside": (powers >= inside[0]) & (powers <= inside[1]),
    })
    said = box_cox_sentence(profile).replace("\N{NO-BREAK SPACE}", " ").replace("−", "-")
    assert said == f"Box–Cox: λ = {best:.2g}, {words}."


@pytest.mark.parametrize(("kind", "title", "points"), [
    ("full", "Which factor matters: full", 4), ("grid", "Which level is best: grid", 6),
    ("sweep", "What the runs say: sweep", 6), ("single", "What the runs say: single", 1),
])  # fmt: skip
def test_a_page_says_what_failed_and_how_to_see_the_worst_run(
    report: Callable[..., Report], kind: str, title: str, points: int
) -> None:
    _, folder, runs = report(kind, **({"practical": 0.2} if kind == "full" else {}))
    document = html5lib.parse((folder / reports.REPORT).read_text("utf-8"))
    words = _text(document)
    counted = f"{points} point{'s' * (points > 1)}"
    good = runs["error"].isna().sum()
    assert good == len(runs) - 2 == 7 * points - 2
    assert f"{good} runs at {counted}; 2 of them failed." in words
    assert title in words
    column = "ekf.absolute_total_rms_m"
    worst = runs.loc[runs[column].idxmax()]
    assert (
        f"The largest value is {worst[column]:#.3g} m, in the run with seed {worst['seed']} at "
        f"point {worst['point']}. This command repeats the run"
    ) in words
    results, run = folder.parent / "runs", worst["run_id"]
    commands = ["".join(code.itertext()) for code in document.iter(f"{H}code")]
    assert f"sblcosim replay {results} {run} --replay" in commands
    assert f"sblcosim explore runs/{run}/scenario.toml" in commands
    (again,) = (it for it in commands if it.startswith("sblcosim study"))
    assert again == f"sblcosim study {kind}.toml --out {results}\nsblcosim analyse {results}"
    (file,) = (it for it in commands if "[design]" in it)
    one, other = load(tomllib.loads(file)), load(folder.parent / f"{kind}.toml")
    assert (one.points, one.replicates, one.name) == (other.points, other.replicates, kind)
    assert one.base.given() == other.base.given()
    assert [one.overrides(i + 1) for i in range(points)] == [
        other.overrides(i + 1) for i in range(points)
    ]
    seeds = f"seeds 1 to {7 * points} (each run has its own)"
    assert f"{counted}, 7 replicates; {seeds}." in words
    confidence = " The intervals and the reference line have a confidence of 0.95."
    assert f"Settling time: 0 s.{confidence * (kind == 'full')}" in words
