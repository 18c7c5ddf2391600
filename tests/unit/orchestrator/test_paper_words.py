"""The paper's numbers beside ours, computed again; and the words below its figures."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
import sblcosim
from sblcosim.analysis.two_level.analysis import analyse
from sblcosim.catalogue import by_name
from sblcosim.errors import ConfigurationError
from sblcosim.fmus.files import HIDDEN
from sblcosim.report import paper, possible
from sblcosim.report import two_level as factorial
from sblcosim.report.page import Code, PageTable, Section, Text
from sblcosim.report.paper import campaigns, comparisons, figures, numbers, ranges
from sblcosim.report.paper.figures import FIGURES, Material
from sblcosim.report.two_level import Findings
from sblcosim.study import study
from sblcosim.words.numbers import unbroken
from scipy import stats
from seams import Seam
from synthetic_record import make_record

LABELS = {"gps": "GPS error", "baseline": "baseline", "sampling_time": "sampling time",
          "loss": "packet loss"}  # fmt: skip


def four(effects: dict[str, float], noise: float = 0.3) -> Any:
    """The analysis of 16 points and 6 replicates, with these main effects and interactions."""
    points = pd.DataFrame([*product((-1.0, 1.0), repeat=4)], columns=[*LABELS])
    runs = pd.concat([points] * 6, ignore_index=True)
    y = 20 + sum(size / 2 * runs[name.split(" × ")].prod(axis=1) for name, size in effects.items())
    random = np.random.default_rng(3)
    runs["y"] = y + random.normal(0, noise, len(runs))
    return replace(analyse(runs, [*LABELS], "y", unit="m"), labels=LABELS)


def plain(text: str) -> float:
    return float(text.replace("−", "-").replace("+", "").replace(",", ""))


# --- Numbers beside each other -------------------------------------------------------------------


@pytest.mark.parametrize(("ratio", "word"), [
    (1 + 9e-10, "equal"), (1 - 9e-10, "equal"), (1 + 2e-9, "within 10 %"),
    (1 - 2e-9, "within 10 %"),
    (1.0999, "within 10 %"), (1.1001, "10 % above"), (0.9001, "within 10 %"),
    (0.8999, "10 % below"), (0.5, "50 % below"), (1.75, "75 % above"), (2.0, "100 % above"),
    (2.01, "2 times the paper's"), (3.14159, "3.1 times the paper's"),
])  # fmt: skip
def test_a_ratio_is_judged_at_its_limits(ratio: float, word: str) -> None:
    assert paper.verdict(ratio) == word


def test_a_row_has_ours_by_theirs_and_whole_digits_only_where_they_are_equal() -> None:
    assert comparisons.row("x", 2.0, 3.0) == ("x", "2", "3.00", "–", "1.50", "50 % above")
    assert comparisons.row("x", 1500.0, 1500.0) == ("x", "1,500", "1,500", "–", "1.00", "equal")
    assert comparisons.row_with_interval("x", 4.0, (3.0, 2.5, 3.25)) == (
        "x", "4", "3.00", "2.50 to 3.25", "0.75", "25 % below")
    rows = [comparisons.row("x", 2.0, 3.0), comparisons.row("y", 4.0, 4.0)]
    shown = comparisons.compared("Caption", rows, "A note.")
    assert (shown.caption, shown.note) == ("Caption", "A note.")
    assert shown.head == ("Quantity", "Paper", "Ours", "Ratio", "Ours is")
    assert shown.rows == [
        ("x", "2", "3.00", "1.50", "50 % above"), ("y", "4", "4", "1.00", "equal")
    ]
    assert tuple(shown.words) == (4,)
    one = [*rows, comparisons.row_with_interval("z", 4.0, (3.0, 2.5, 3.25))]
    shown = comparisons.compared("Caption", one)
    assert shown.head == ("Quantity", "Paper", "Ours", "95 % interval", "Ratio", "Ours is")
    assert (shown.rows, tuple(shown.words)) == (one, (5,))


def of_samples(samples: list[np.ndarray], receiver: str = "ekf") -> pd.DataFrame:
    return pd.DataFrame({
        f"{receiver}.estimates": [len(it) for it in samples],
        f"{receiver}.absolute_total_mean_m": [it.mean() if len(it) else 0.0 for it in samples],
        f"{receiver}.absolute_total_rms_m": [
            np.sqrt((it**2).mean()) if len(it) else 0.0 for it in samples
        ],
    })  # fmt: skip


def test_intervals_of_pooled_statistics_are_those_of_the_jackknife_by_hand() -> None:
    """Each session is left out once; one without an estimate is none."""
    random = np.random.default_rng(5)
    samples = [random.gamma(2, 0.7, n) for n in (3, 11, 7, 5)]
    found = numbers.pooled_intervals(of_samples([*samples, np.empty(0)]), "ekf")
    every = np.concatenate(samples)
    for value, (low, high), of in zip(
        (every.mean(), every.std()), found, (np.mean, np.std), strict=True
    ):
        left = [of(np.concatenate(samples[:i] + samples[i + 1 :])) for i in range(4)]
        error = np.sqrt(3 / 4 * np.sum((np.array(left) - np.mean(left)) ** 2))
        reach = stats.t.ppf(0.975, 3) * error
        assert (low, high) == pytest.approx((value - reach, value + reach), rel=1e-9)


def test_a_mean_over_the_runs_has_student_s_interval() -> None:
    values = pd.Series([1.0, 4.0, np.nan, 2.5, 9.0, 3.0])
    mean, low, high = numbers.average(pd.DataFrame({"y": values}), "y")
    known = values.dropna()
    assert mean == pytest.approx(3.9)
    assert (low, high) == pytest.approx(stats.t.interval(0.95, 4, 3.9, stats.sem(known)))


def test_a_mean_over_the_points_counts_each_point_once_with_the_scatter_within_it() -> None:
    y = {1: [1.0, 2.0, 6.0], 2: [10.0, 14.0], 3: [5.0, 6.0, 7.0, 10.0]}
    runs = pd.DataFrame([(point, it) for point, own in y.items() for it in own],
                        columns=["point", "y"])  # fmt: skip
    mean, low, high = numbers.overall(runs, "y")
    assert mean == pytest.approx((3 + 12 + 7) / 3)
    error = np.sqrt(sum(np.var(own, ddof=1) / len(own) for own in y.values())) / 3
    assert (low, high) == pytest.approx((mean - 1.959964 * error, mean + 1.959964 * error))


def test_the_sessions_of_each_path_are_beside_table_2() -> None:
    random = np.random.default_rng(6)
    tables = {}
    for name, sessions in (("square", 5), ("spiral", 4), ("random", 6)):
        ekf, raw = ([random.gamma(3, scale, 9) for _ in range(sessions)] for scale in (0.4, 0.7))
        tables[name] = of_samples(ekf).join(of_samples(raw, "multilateration"))
    shown = comparisons.sessions(tables)
    assert shown.caption == "Table 2: total error [m]"
    assert "over all samples of 4 sessions each" in shown.note
    rows = iter(shown.rows)
    for name, runs in tables.items():
        for label, key, receiver in (("raw fix (j = 1)", "instrument", "multilateration"),
                                     ("EKF (j = 2)", "ekf", "ekf")):
            ends = numbers.pooled_intervals(runs, receiver)
            for i, word in enumerate(("mean", "standard deviation")):
                theirs = paper.facts()["table2"][name][key][i]
                ours = numbers.pooled(runs, receiver)[i]
                what, known, own, interval, ratio, _ = next(rows)
                assert what == f"{name}, {label}: {word}"
                assert (plain(known), plain(own)) == pytest.approx((theirs, ours), rel=5e-3)
                assert float(ratio) == pytest.approx(ours / theirs, abs=0.0051)
                assert [plain(it) for it in interval.split(" to ")] == pytest.approx(
                    ends[i], rel=5e-3, abs=1e-3
                )
    assert next(rows, None) is None
    alone = paper.beside(11, tables["spiral"])
    assert [row[0].partition(",")[0] for row in alone.rows] == ["square"] * 4
    assert alone.rows[0][1] == "1.78"


@pytest.mark.parametrize("n", [1, 2, 3])
def test_errors_of_a_scenario_are_those_of_its_runs_on_every_axis(n: int) -> None:
    random = np.random.default_rng(n)
    scale = {"absolute_x": 1.1, "absolute_y": 2.3, "absolute_z": 0.4, "absolute_total": 3.1,
             "relative_total": 0.7}  # fmt: skip
    runs = pd.DataFrame({f"ekf.{name}_rms_m": size * random.gamma(9, 1 / 9, 30)
                         for name, size in scale.items()})  # fmt: skip
    runs["point"], runs["gps"] = np.repeat([1, 2, 3], 10), np.repeat([0.1, 3.5, 3.5], 10)
    known = paper.facts()[f"table{n + 3}"]
    axes = {"e_x [m]": "absolute_x", "e_y [m]": "absolute_y", "e_z [m]": "absolute_z",
            "e_tot [m]": "absolute_total",
            "e_tot [m], relative to the platform as it reports itself": "relative_total"}
    shown = comparisons.point_errors(n, runs)
    assert shown.caption == f"Table {n + 3} and the favourable point, mean of 30 runs"
    assert [row[0] for row in shown.rows] == [*axes]
    for row, column in zip(shown.rows, axes.values(), strict=True):
        theirs = known[column.rpartition("_")[2]]
        mean, low, high = numbers.average(runs, f"ekf.{column}_rms_m")
        assert row[:4] == (row[0], f"{theirs:g}", f"{mean:#.3g}", f"{low:#.3g} to {high:#.3g}")
        assert row[4] == f"{mean / theirs:.2f}"
    ratio = runs["ekf.absolute_total_rms_m"].mean() / known["total"]
    assert (f"Here its total error is {ratio:.2f} times that of Table {n + 3}" in shown.note) == (
        n > 1
    )
    every = comparisons.errors_of_all(n, runs)
    assert every.caption == f"Table {n + 3} and the mean over all 3 points"
    for row, column in zip(every.rows, [*axes.values()][:4], strict=True):
        mean, low, high = numbers.overall(runs, f"ekf.{column}_rms_m")
        assert row[2:4] == (f"{mean:#.3g}", f"{low:#.3g} to {high:#.3g}")
    small = runs["ekf.absolute_total_rms_m"][:10].mean()
    assert (f"ours is {ratio:.2g} times as large, and {small:.2g} m even over the half of the "
            "points with the small GPS error.") in every.note  # fmt: skip


# --- Factors -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("effects", "ours", "word"), [
    ({"gps": 8, "baseline": -5, "sampling_time": 3, "loss": 1},
     "GPS error, baseline, sampling time", "agrees"),
    ({"gps": 5, "baseline": -8, "sampling_time": 3}, "baseline, GPS error, sampling time",
     "agrees"),
    ({"gps": 8, "baseline": -5, "sampling_time": 1, "loss": -3},
     "GPS error, baseline, packet loss", "differs: sampling time is further down"),
    ({"gps": 1, "baseline": -5, "sampling_time": 2, "loss": -3},
     "baseline, packet loss, sampling time", "differs: GPS error is further down"),
])  # fmt: skip
def test_the_order_of_the_factors_is_beside_the_paper_s(
    effects: dict[str, float], ours: str, word: str
) -> None:
    assert comparisons.order_row(1, four(effects)) == (
        "1", "GPS error, baseline, sampling time", ours, word)


def test_factors_that_cannot_be_told_apart_are_in_brackets() -> None:
    a = four({"gps": 8, "baseline": -5, "sampling_time": 2.02, "loss": 2})
    size = a.effects["effect"].abs()
    last = sorted(("sampling_time", "loss"), key=lambda name: -size[name])
    named = ", ".join(LABELS[name] for name in last)
    assert comparisons.order_row(3, a) == (
        "3", "baseline, GPS error, sampling time", f"GPS error, baseline, ({named})",
        "agrees; packet loss cannot be told apart from the last of them")
    first = four({"gps": 5.01, "baseline": -5, "sampling_time": 2, "loss": 1})
    assert comparisons.order_row(2, first)[2].startswith("(")
    assert comparisons.order_row(2, first)[3] == "agrees"


def test_the_table_of_factors_has_the_effects_of_the_analysis() -> None:
    a = four({"gps": 8, "baseline": -5, "sampling_time": 3, "loss": 1})
    shown = comparisons.factors(2, a)
    assert tuple(shown.words) == (1,)
    for place, (row, name) in enumerate(
        zip(shown.rows, ("gps", "baseline", "sampling_time", "loss"), strict=True), 1
    ):
        effect = a.effects.loc[name]
        assert row[:3] == (LABELS[name], "–" if name == "loss" else "named", f"{place}")
        assert plain(row[3]) == pytest.approx(effect["effect"], rel=5e-3)
        assert row[3][0] == ("−" if name == "baseline" else "+")
        assert [plain(it) for it in row[4].split(" to ")] == pytest.approx(
            [effect["low"], effect["high"]], rel=6e-3
        )
        assert plain(row[5]) == pytest.approx(abs(effect["t"]), rel=5e-3)
    assert shown.note.startswith("Verdict: agrees. ")


def test_only_interactions_with_the_gps_are_listed_the_largest_first() -> None:
    a = four({"gps": 8, "gps × loss": -4, "gps × baseline": 2, "baseline × loss": 6})
    shown = comparisons.interactions(a)
    assert shown.caption == "Interactions of GPS error with the other factors"
    assert [row[0] for row in shown.rows] == [
        "GPS error × packet loss", "GPS error × baseline", "GPS error × sampling time"
    ]
    assert [row[5] for row in shown.rows] == ["significant", "significant", "not significant"]
    for row, name in zip(shown.rows, ("loss", "baseline", "sampling_time"), strict=True):
        effect = a.effects.loc[f"gps × {name}"]
        assert plain(row[2]) == pytest.approx(effect["effect"], rel=5e-3)
        assert plain(row[4]) == pytest.approx(abs(effect["t"]), rel=5e-3)


# --- Words below the figures ---------------------------------------------------------------------


def made_runs(made: study.Study, *, uneven: bool) -> pd.DataFrame:
    """Made-up runs of a study of the paper; uneven: the scatter grows with the fitted value."""
    runs = pd.concat([made.points.table().assign(replicate=i + 1) for i in range(made.replicates)],
                     ignore_index=True)  # fmt: skip
    coded = {name: np.sign(runs[name] - runs[name].mean()) for name in made.factors}
    y = 6 + 2 * coded["gps"] - coded["baseline"] + 0.8 * coded["gps"] * coded["baseline"]
    y = y + 0.5 * coded["gps"] * coded["range"] - 0.7 * coded["range"] * coded["imu"]
    noise = np.random.default_rng(8).gamma(4, 0.25, len(runs)) - 1
    error = y + 0.2 * noise * (y if uneven else 6)
    for axis, share in (("total", 1.0), ("x", 0.6), ("y", 0.7), ("z", 0.1)):
        runs[f"ekf.absolute_{axis}_rms_m"] = share * error
    runs["ekf.lost"], runs["error"] = False, None
    return runs


def made_up(*, uneven: bool) -> Findings:
    """The analysis of these runs."""
    made = study.load("paper-scenario-1").with_replicates(3)
    return factorial.find(made, made_runs(made, uneven=uneven), practical=0.5)


@pytest.fixture(scope="module")
def findings() -> Findings:
    return made_up(uneven=True)


def material(**given: Any) -> Material:
    """The data of some figures; the others have none."""
    blank: dict[str, Any] = dict.fromkeys(("numbers", "points", "session", "seas"))
    return Material(**(blank | given))


def words_below(name: str, own: Material) -> str:
    (block,) = FIGURES[name].beside(own)
    assert isinstance(block, Text)
    return block.text.replace("\N{NO-BREAK SPACE}", " ")


def test_the_three_largest_interactions_are_said(findings: Findings) -> None:
    said = words_below("figure-16", material(numbers=SimpleNamespace(findings={1: findings})))
    effects = findings.data.effects
    two = effects[effects["order"] == 2]
    order = two["effect"].abs().sort_values(ascending=False).index
    assert [set(name.split(" × ")) for name in order[:3]] == [
        {"gps", "baseline"}, {"imu", "range"}, {"gps", "range"}
    ]
    labels = findings.study.labels
    parts = []
    for name in order[:3]:
        row = two.loc[name]
        ends = (f"{row[end]:+#.3g}".replace("-", "−") for end in ("effect", "low", "high"))
        words = " × ".join(labels[factor] for factor in name.split(" × "))
        parts.append("{} ({} m, {} to {})".format(words, *ends))
    with_gps = int((two["significant"] & two.index.str.contains("gps")).sum())
    assert 2 <= with_gps < two["significant"].sum()
    assert said == (
        f"Ours: the largest are {'; '.join(parts)}. GPS error has {with_gps} significant "
        "interactions. The paper prints no sizes."
    )


@pytest.mark.parametrize("uneven", [True, False])
def test_fit_and_residuals_are_said_and_that_they_scatter_unevenly(uneven: bool) -> None:
    own = made_up(uneven=uneven)
    said = words_below("figure-18", material(numbers=SimpleNamespace(findings={1: own})))
    a = own.data
    left = a.residuals["residual"].to_numpy()
    y = a.table[a.response].to_numpy()
    r2 = 1 - (left**2).sum() / ((y - y.mean()) ** 2).sum()
    assert a.r2 == pytest.approx(r2)
    spread = left.std()
    skewness, excess = (left**3).mean() / spread**3, (left**4).mean() / spread**4 - 3
    assert said.startswith(
        f"Ours: R² {100 * r2:.1f} %, adjusted {100 * a.r2_adjusted:.1f} %, predicted "
        f"{100 * a.r2_predicted:.1f} %; skewness of the residuals {skewness:.2g}, excess kurtosis "
        f"{excess:.2g} (normal: 0)."
    )
    assert ("scatter more where the fitted value is larger" in said) == uneven
    assert a.r2 > a.r2_adjusted > a.r2_predicted


def test_the_better_levels_and_the_factors_are_below_the_others(findings: Findings) -> None:
    own = material(numbers=SimpleNamespace(findings=dict.fromkeys((1, 2, 3), findings)))
    for number, n in (("15", 1), ("22", 2), ("28", 3)):
        (shown,) = FIGURES[f"figure-{number}"].beside(own)
        assert isinstance(shown, PageTable)
        assert shown == comparisons.factors(n, findings.data)
        assert FIGURES[f"figure-{number}"].scenario == n
    assert words_below("figure-17", own) == (
        "The better levels, on average over the others: GPS error 0.1 m, baseline 3 m."
    )
    assert FIGURES["figure-17"].caption(own).startswith("Ours, as Figure 17: ")
    assert not FIGURES["scenario-1-box-cox"].beside(own)
    assert not FIGURES["scenario-1-box-cox"].caption(own).startswith("Ours")


def test_angles_in_the_sea_are_the_root_of_their_mean_squares() -> None:
    calm = make_record()
    factors = np.array([2.0, 3.0, 5.0])
    rough = replace(calm, values=calm.values | {
        "platform.attitude": calm.values["platform.attitude"] * factors
    })  # fmt: skip
    own = material(seas={2: calm, 4: rough})
    attitude = np.rad2deg(calm.values["platform.attitude"])
    one, other = (np.sqrt(np.mean((attitude * f) ** 2, axis=0)) for f in (1.0, factors))
    assert words_below("figure-9", own).startswith(
        "Ours: RMS of the angles at Beaufort 2: roll {:.1f}°, pitch {:.1f}°, yaw {:.1f}°; Beaufort "
        "4: roll {:.1f}°, pitch {:.1f}°, yaw {:.1f}°. The paper prints no angles".format(
            *one, *other)
    )
    (records,) = FIGURES["figure-9"].data(own)
    assert [*records] == ["a: Beaufort 2, wave height 0.2 m", "b: Beaufort 4, wave height 1 m"]
    assert [*records.values()] == [calm, rough]


def test_drawings_are_the_second_last_part_of_the_work(seam: Seam) -> None:
    """From 60 to 97 %, each of them the same."""
    waves = FIGURES["figure-9"]
    seam.instead(FIGURES, by_name(waves, replace(waves, name="again")))
    told: list[tuple[float, str]] = []
    seas = dict.fromkeys((2, 4), make_record())
    drawn = figures.draw(material(seas=seas), None, lambda *it: told.append(it))
    assert [*drawn] == ["figure-9", "again"]
    assert all("<svg" in text for text in drawn.values())
    assert told == [(pytest.approx(0.785), "drawing"), (pytest.approx(0.97), "drawing")]


def test_one_run_of_many_is_below_a_figure_with_its_own_numbers() -> None:
    runs = pd.DataFrame({
        "ekf.absolute_total_rms_m": [2.5, 1.0, 7.0], "ekf.absolute_total_mean_m": [1.75, 3.0, 4.0],
        "multilateration.absolute_total_mean_m": [2.125, 5.0, 6.0],
    })  # fmt: skip
    own = material(numbers=SimpleNamespace(
        points={1: runs, 2: runs.iloc[1:], 3: runs.iloc[2:]}, sessions={"square": runs}
    ))  # fmt: skip
    assert words_below("figure-11", own).startswith(
        "Ours: session 1 of 3, a square. Its mean total error is 1.75 m for the EKF (line) and "
        "2.12 m for the raw fix (dots)."
    )
    for number, n, of, total in (("14", 1, 3, 2.5), ("21", 2, 2, 1.0), ("27", 3, 1, 7.0)):
        text, shown = FIGURES[f"figure-{number}"].beside(own)
        assert isinstance(text, Text)
        assert isinstance(shown, PageTable)
        assert text.text.startswith(
            f"Ours: one run at the favourable point of Table {n + 3}, the first of {of}."
        )
        theirs = paper.facts()[f"table{n + 3}"]["total"]
        (row,) = shown.rows
        assert row[:4] == (f"Table {n + 3}, e_tot [m]; ours: RMS error of this run", f"{theirs:g}",
                           f"{total:#.3g}", f"{total / theirs:.2f}")  # fmt: skip
    paths = [words_below(name, own) for name in ("figure-12a", "figure-19b", "figure-25")]
    assert len(set(paths)) == 3
    assert all(text.startswith("Ours: the true path. The paper does not ") for text in paths)


# --- The campaigns -------------------------------------------------------------------------------

SEEDS = {
    "paper-scenario-1": 1, "paper-scenario-2": 10_001, "paper-scenario-3": 20_001,
    "favourable-1": 31_001, "favourable-2": 32_001, "favourable-3": 33_001,
    "harbour-square": 40_001, "harbour-spiral": 41_001, "harbour-random": 42_001,
    "ranges-1": 70_001, "ranges-2": 80_001, "ranges-3": 90_001,
}  # fmt: skip
"""First seeds: with others, the numbers of the published report would be others."""


@pytest.mark.parametrize(("quick", "runs"), [(False, (50, 50, 500, 256)), (True, (5, 50, 100, 32))])
def test_campaigns_have_the_seeds_and_the_numbers_of_runs_of_the_report(
    quick: bool, runs: tuple[int, ...]
) -> None:
    made = campaigns.all_campaigns(quick)
    assert {name: it.seed for name, it in made.items()} == SEEDS
    found = [
        {made[name].replicates for name in made if name.startswith(kind)}
        for kind in ("paper-", "favourable-", "harbour-")
    ]
    rows = {made[f"ranges-{n}"].design.base_rows for n in (1, 2, 3)}
    assert [*found, rows] == [{number} for number in runs]
    each, point, session, base = runs
    whole = 3 * 128 * each + 3 * point + 3 * session + 3 * base * (7 + 3)
    assert sum(map(campaigns.runs_of, made.values())) == whole
    assert {made[f"harbour-{name}"].receivers for name in paper.SESSIONS} == {
        ("ekf", "multilateration")
    }
    for n in (1, 2, 3):
        table = study.load(f"paper-scenario-{n}")
        for name, drawn in made[f"ranges-{n}"].factors.items():
            law = drawn.law
            assert law is not None
            assert law.distribution == "uniform"
            assert law.range == tuple(sorted(map(float, table.factors[name].values)))
            assert (drawn.label, drawn.unit, drawn.keys) == (
                table.factors[name].label, table.factors[name].unit, table.factors[name].keys)


def test_nothing_is_finished_in_a_new_folder(tmp_path: Path) -> None:
    assert paper.progress_of(tmp_path / "none") == (0, 28_530)
    assert paper.progress_of(tmp_path / "none", quick=True) == (0, 3330)


def test_a_folder_that_holds_something_else_is_refused(tmp_path: Path) -> None:
    campaigns.check(tmp_path / "new")
    ours = tmp_path / "ours"
    unfinished = f"{HIDDEN}{'0' * 32}"
    for name in ("runs", "report", unfinished):
        (ours / name).mkdir(parents=True)
    campaigns.check(ours)
    (ours / "b.txt").touch()
    (ours / "a.txt").touch()
    with pytest.raises(ConfigurationError, match=r"ours: must be empty or hold what 'sblcosim pap"
                       r"er' wrote, got 'a\.txt' in it$"):  # fmt: skip
        campaigns.check(ours)
    with pytest.raises(ConfigurationError, match=r"b\.txt: must be a folder or not exist yet, got"):
        campaigns.check(ours / "b.txt")
    results = tmp_path / "other" / "runs" / "favourable-2"
    (results / "parts").mkdir(parents=True)
    (results / "runs.parquet").touch()
    (results / unfinished).touch()
    campaigns.check(tmp_path / "other")
    (results / "mine.csv").touch()
    with pytest.raises(ConfigurationError, match=r"favourable-2: must be empty or hold results of "
                       r"this study, got 'mine\.csv' in it$"):  # fmt: skip
        campaigns.check(tmp_path / "other")
    page = tmp_path / "page"
    (page / "report").mkdir(parents=True)
    (page / "report" / "mine.txt").touch()
    with pytest.raises(ConfigurationError, match=r"report: must be empty .*got 'mine\.txt' in it"):
        campaigns.check(page)


def test_settings_are_said_in_words() -> None:
    assert campaigns.favourable_in_words() == (
        "white GPS error 0.1 m, baseline 3 m, sampling time 0.1 s, range 0.1 m, packet loss 0 %, "
        "IMU 10°, depth 0.1 m; speed 0.3 m/s and process noise 0.1 m²/s³, where the preset has 0.5 "
        "and 0.01"
    )
    own = sblcosim.load("harbour-square")
    assert campaigns.sessions_in_words() == (
        f"slow GPS error (Gauss–Markov, {own.platform.gps_horizontal_markov_std_m:g} m per "
        "horizontal axis, 100 s), white GPS error 0 m, baseline 3 m, sampling time 0.1 s, range "
        "0.1 m, packet loss 50 %, IMU 1°, depth 0.05 m, wave angles of 3°, variances in R, process "
        "noise 0.01 m²/s³, speed 0.5 m/s, depth 2 m"
    )


def test_progress_counts_the_runs_of_all_campaigns(tmp_path: Path) -> None:
    """Simulations are the first half of the work: 2 of 8 runs are an eighth of all."""
    made = {
        name: study.load({
            "name": name, "scenario": "harbour-square", "design": {"kind": "single"}, "seed": seed,
            "replicates": runs, "fixed": {"time.duration_s": 2.0},
        })
        for name, seed, runs in (("one", 5, 2), ("other", 50, 6))
    }  # fmt: skip
    told: list[tuple[float, str]] = []
    found = campaigns.simulate(tmp_path, made, 1, lambda *it: told.append(it))
    assert {name: table["seed"].tolist() for name, table in found.items()} == {
        "one": [5, 6], "other": [*range(50, 56)]
    }
    shares = [share for share, _ in told]
    assert shares == sorted(shares)
    assert (0.125 in shares, shares[-1]) == (True, 0.5)
    assert {word for _, word in told} == {"simulating"}


# --- The ranges ----------------------------------------------------------------------------------


def of_ranges(space: study.Study) -> pd.DataFrame:
    """Made-up runs of the ranges of Table 3."""
    assert space.sample is not None
    runs = space.sample.table()
    unit = {name: (runs[name] - runs[name].min()) / np.ptp(runs[name]) for name in space.factors}
    chance = np.random.default_rng(2).normal(0, 0.05, 200_000)[runs["seed"].to_numpy()]
    runs["ekf.absolute_total_rms_m"] = np.exp(
        1.5 * unit["gps"] - 0.8 * unit["baseline"] * unit["gps"] + 0.4 * unit["range"] + chance
    )
    runs["ekf.lost"], runs["error"], runs["replicate"] = False, None, 1
    return runs


def test_indices_of_the_ranges_are_beside_the_effects(findings: Findings) -> None:
    space = campaigns.all_campaigns(True)["ranges-1"]
    analyses = ranges.indices(space, of_ranges(space))
    answer, shown, *notes = ranges.blocks(analyses, findings)
    assert isinstance(answer, Text)
    assert answer.kind == "answer"
    assert {note.kind for note in notes if isinstance(note, Text)} <= {"note"}
    assert isinstance(shown, PageTable)
    assert shown.head == ("Factor", "Effect, low to high [m]", "First-order index",
                          "95 % interval", "Total index", "95 % interval")
    given = analyses[0].indices
    order = given["total"].sort_values(ascending=False).index
    assert order[0] == "gps"
    assert len(shown.rows) == len(order) == 8
    labels = {**space.labels, "seed": "chance (the seed)"}
    by_label = {row[0]: row for row in shown.rows}
    assert {*by_label} == {*labels.values()}
    for name, row in given.iterrows():
        cells = by_label[labels[str(name)]]
        if name == "seed":
            assert cells[1] == "–"
        else:
            effect = findings.data.effects.loc[name, "effect"]
            assert plain(cells[1]) == pytest.approx(effect, rel=5e-3)
            assert cells[1][0] == ("+" if effect > 0 else "−")
        assert plain(cells[2]) == pytest.approx(row["first"], rel=0.05, abs=1e-9)
        assert plain(cells[4]) == pytest.approx(row["total"], rel=0.05, abs=1e-9)
        for cell, of in ((cells[3], "first"), (cells[5], "total")):
            ends = [plain(it) for it in cell.split(" to ")]
            assert ends == pytest.approx([row[f"{of}_low"], row[f"{of}_high"]], rel=0.05, abs=1e-9)


# --- The whole page ------------------------------------------------------------------------------


DRAWN = ("figure-12a", "figure-12b", "figure-15", "figure-9", "scenario-1-box-cox")
SVG = '<svg xmlns="http://www.w3.org/2000/svg"><g/></svg>'


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The report of two sessions and two favourable runs, and of made-up runs of the studies.

    The studies themselves take minutes.
    """
    folder = tmp_path_factory.mktemp("whole") / "paper"
    every: dict[str, pd.DataFrame] = {}
    told: list[tuple[float, str]] = []
    short = {"time.duration_s": 5.0}

    def simulate(
        runs: Path, studies: dict[str, study.Study], workers: Any, tell: Any
    ) -> dict[str, pd.DataFrame]:
        for name, own in studies.items():
            if name.startswith("paper"):
                every[name] = made_runs(own, uneven=True)
            elif name.startswith("ranges"):
                every[name] = of_ranges(own)
            else:
                few = study.load(own.with_replicates(2).tables() | {"fixed": short})
                every[name] = few.run(runs / name, workers=1)
        return every

    def gather(runs: Path, its: numbers.PaperNumbers) -> Material:
        session = sblcosim.run("harbour-square", ["ekf", "multilateration"], short)
        point = sblcosim.run("paper-scenario-1", overrides=short)
        return Material(its, dict.fromkeys((1, 2, 3), point), session,
                        dict.fromkeys((2, 4), make_record()))  # fmt: skip

    def draw(material: Material, pool: Any, tell: Any) -> dict[str, str]:
        assert pool is None
        return dict.fromkeys(DRAWN, SVG)

    with Seam() as seam:
        seam.instead(campaigns.simulate, simulate)
        seam.instead(figures.gather, gather)
        seam.instead(figures.draw, draw)
        shown = paper.run(folder, quick=True, practical=0.75, workers=1, command="sblcosim paper x",
                          progress=lambda *it: told.append(it))  # fmt: skip
    return {"report": shown, "tables": every, "told": told, "folder": folder}


def sections_of(section: Section) -> list[Section]:
    return [section, *(it for part in section.parts for it in sections_of(part))]


def anchored(whole: dict[str, Any]) -> dict[str, Section]:
    every = [it for part in whole["report"].page.sections for it in sections_of(part)]
    assert len({it.anchor for it in every}) == len(every)
    return {it.anchor: it for it in every}


def texts(section: Section) -> list[str]:
    return [it.text.replace("\N{NO-BREAK SPACE}", " ") for it in section.blocks
            if isinstance(it, Text)]  # fmt: skip


def test_the_figures_of_a_scenario_are_in_order_and_the_open_ones_first(
    whole: dict[str, Any]
) -> None:
    page = whole["report"].page
    assert [it.anchor for it in page.sections][:6] == [
        "summary", "harbour", "scenario-1", "scenario-2", "scenario-3", "method"
    ]
    _, harbour, *scenarios, method, _ = page.sections
    assert [it.anchor for it in harbour.parts] == ["place-figure-9", "place-figure-11", "table-2"]
    for n, (section, figures_) in enumerate(
        zip(scenarios, ((15, 12, 13, 14, 16, 17, 18), (22, 19, 20, 21, 23, 24),
                        (28, 25, 26, 27, 29, 30)), strict=True), 1
    ):
        own = ["place-scenario-1-box-cox"] if n == 1 else []
        assert [it.anchor for it in section.parts] == [
            *(f"place-figure-{number}" for number in figures_), *own, f"table-{n + 3}",
            f"ranges-{n}", f"full-{n}",
        ]
        assert [it.beside for it in section.parts][:3] == [True, True, False]
        assert [it.folded for it in section.parts][:3] == [False, False, True]
        assert section.title.startswith(f"Scenario {n}: ")
        assert section.parts[-1].title == f"Scenario {n} in full"
    assert method.folded
    assert len({it.title for it in scenarios}) == 3


def test_of_an_open_figure_the_first_drawing_is_seen_and_the_others_are_beside_the_words(
    whole: dict[str, Any]
) -> None:
    found = anchored(whole)
    path = found["place-figure-12"]
    assert [it.name for it in path.blocks] == ["figure-12a"]
    (more,) = path.parts
    assert (more.anchor, more.title, more.folded) == ("words-figure-12", "Beside the paper", True)
    assert [it.name for it in more.pictures] == ["figure-12b"]
    assert texts(more)[0] == (
        "In the paper (section 5.1): reference trajectory from above and in space. Ours has the "
        "same settings: radius 15 m."
    )
    assert not [it for it in more.blocks if isinstance(it, PageTable)]
    assert [it.name for it in found["place-figure-9"].pictures] == ["figure-9"]
    session = texts(found["place-figure-11"])
    assert session[0].endswith(
        " Ours has the same settings: depth of the receiver 2 m, packet loss 50 %, speed of sound "
        "1,500 m/s."
    )
    assert session[1].startswith("Ours: session 1 of 2, a square.")
    pareto = found["words-figure-15"]
    assert texts(pareto)[0] == (
        "In the paper (section 5.1): Pareto chart. It says: GPS accuracy, baseline length and "
        "sampling time influence the error most."
    )
    assert [it.caption for it in pareto.blocks if isinstance(it, PageTable)] == [
        "Main effects: factors that the paper names as the most influential, and our effects"
    ]


def test_the_summary_has_the_numbers_of_all_tables(whole: dict[str, Any]) -> None:
    summary = anchored(whole)["summary"]
    note, *answers = (it for it in summary.blocks if isinstance(it, Text))
    assert note.text.startswith("This is a quick look with few replicates.")
    assert [it.text.partition(". ")[0] for it in answers] == [f"Scenario {n}" for n in (1, 2, 3)]
    assert {it.kind for it in answers} == {"answer"}
    report, tables = whole["report"], whole["tables"]
    for n, it in report.answers.items():
        assert answers[n - 1].text == unbroken(f"Scenario {n}. {it}")
    beside, order = (it for it in summary.blocks if isinstance(it, PageTable))
    rows = iter(beside.rows)
    column = "ekf.absolute_total_rms_m"
    for n in (1, 2, 3):
        theirs = paper.facts()[f"table{n + 3}"]["total"]
        for words, (mean, low, high) in (
            ("favourable point", numbers.average(tables[f"favourable-{n}"], column)),
            ("all 128 points", numbers.overall(tables[f"paper-scenario-{n}"], column)),
        ):
            assert next(rows) == comparisons.row_with_interval(
                f"Table {n + 3}, total error [m]: {words}", theirs, (mean, low, high)
            )
    for name in ("square", "spiral", "random"):
        theirs = paper.facts()["table2"][name]["ekf"]
        for i, word in enumerate(("mean", "standard deviation")):
            row = next(rows)
            assert row[:2] == (f"Table 2, EKF, {name}: {word} [m]", f"{theirs[i]:g}")
    assert next(rows, None) is None
    assert "Over all 128 points" in beside.note
    assert "half of them have a GPS error of 3.5 m." in beside.note
    assert campaigns.favourable_in_words() in beside.note
    assert [row[0] for row in order.rows] == ["1", "2", "3"]
    assert tuple(order.words) == (1, 2, 3)


def test_the_rest_of_the_page_says_what_was_done(whole: dict[str, Any]) -> None:
    page, found = whole["report"].page, anchored(whole)
    assert page.lead.endswith(
        "Its three factorial studies, its tables and its figures, beside ours: 1,920 runs of the "
        "studies with 5 replicates (the paper: 50), and 2 sessions on each of the three paths of "
        "Table 2."
    )
    harbour = texts(found["table-2"])
    assert campaigns.sessions_in_words() in harbour[0]
    errors = found["table-5"]
    assert [it.caption for it in errors.blocks if isinstance(it, PageTable)] == [
        "Table 5 and the favourable point, mean of 2 runs",
        "Table 5 and the mean over all 128 points",
    ]
    point = possible.of_scenario(sblcosim.load("paper-scenario-2", paper.FAVOURABLE.items()))
    assert point is not None
    absolute, relative = possible.cells(point)
    said = next(it for it in texts(errors) if it.startswith("Possible there"))
    assert f"a total error of {absolute} m, and {relative} m relative to the platform." in said
    assert said.endswith(f"density of acceleration, {point.acceleration_psd:.2g} m²/s³.")
    method = texts(found["method"])
    assert "all 128 combinations, 5 replicates. The paper writes 2^6 combinations, but its " \
        "6,400 runs are 50 × 128." in method[0]
    assert method[-1].endswith("Numbers agree if they differ by at most 10 %.")
    again = page.sections[-1]
    commands = [it.text for it in again.blocks if isinstance(it, Code)]
    assert "sblcosim paper x" in commands[0]
    assert "sblcosim analyse paper/runs/paper-scenario-1" in commands[0]
    seeds = next(it for it in texts(again) if "Seeds: " in it)
    for n, first in ((1, 1), (2, 10_001), (3, 20_001)):
        assert f"Scenario {n} seeds {first} to {first + 639} (each run has its own)" in seeds


def test_the_folder_has_the_tables_and_the_drawings_and_progress_ends(
    whole: dict[str, Any]
) -> None:
    report, folder = whole["report"], whole["folder"] / "report"
    assert report.report == folder / "report.html"
    names = {it.name for it in folder.iterdir()}
    tables = {f"scenario-{n}-{of}.{kind}" for n in (1, 2, 3)
              for of in ("effects", "anova", "indices") for kind in ("csv", "parquet")}  # fmt: skip
    assert names == {"report.html", "manifest.json", *tables, *(f"{it}.svg" for it in DRAWN)}
    effects = pd.read_parquet(folder / "scenario-2-effects.parquet")
    assert (effects["verdict"] == "matters").any()  # of 0.75 m
    assert [*report.seconds] == ["simulations", "statistics", "figures", "report"]
    assert whole["told"] == [
        *((pytest.approx(0.5 + 0.03 * n), "analysing") for n in (1, 2, 3)), (0.97, "writing"),
        (1.0, "writing"),
    ]  # fmt: skip
    assert repr(report) == f"<PaperReport of 3 scenarios: {report.report}>"
    for practical in (0.0, -1.0, np.inf, np.nan):
        with pytest.raises(ConfigurationError, match="practical: must be above 0, got"):
            paper.run(folder.parent, practical=practical)
