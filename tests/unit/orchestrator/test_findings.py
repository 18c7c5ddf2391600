"""Sentences and tables in the report of a two-level study, from runs that were made up."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from sblcosim.analysis.two_level.power import detectable
from sblcosim.report import means, points
from sblcosim.report import two_level as factorial
from sblcosim.report.page import PageTable, Text
from sblcosim.report.two_level import Findings
from sblcosim.study.study import Study, load
from scipy import stats

FACTORS = {
    "gps": ("GPS error", "platform.gps_horizontal_std_m", (0.1, 3.5)),
    "arm": ("baseline", "platform.arm_length_m", (0.4, 3.0)),
    "noise": ("range error", "acoustics.range_std_m", (0.05, 0.5)),
}
Y = "ekf.absolute_total_rms_m"


def asked(replicates: int = 4, **more: Any) -> Study:
    return load({
        "name": "made-up", "scenario": "paper-scenario-1", "replicates": replicates,
        "factors": {
            name: {"label": label, "keys": [key], "levels": [*levels]}
            for name, (label, key, levels) in FACTORS.items()
        },
        **more,
    })  # fmt: skip


def runs_of(study: Study, *, seed: int = 4, scale: float = 0.15, triple: float = 0.0) -> Any:
    """Runs whose logarithm is linear in the factors; ``triple``: an interaction of all three."""
    runs = pd.concat([study.points.table().assign(replicate=i + 1)
                      for i in range(study.replicates)], ignore_index=True)  # fmt: skip
    coded = {name: np.sign(runs[name] - np.mean(FACTORS[name][2])) for name in FACTORS}
    logs = 1 + 0.6 * coded["gps"] - 0.3 * coded["arm"] + 0.1 * coded["noise"]
    logs = logs + triple * coded["gps"] * coded["arm"] * coded["noise"]
    noise = np.random.default_rng(seed).normal(0, 1, len(runs))
    runs[Y] = np.exp(logs + scale * (1 + 0.5 * coded["noise"]) * noise)
    runs["ekf.lost"], runs["error"] = False, None
    return runs


def found(practical: float | None = 1.0, replicates: int = 4, **more: Any) -> Findings:
    made = asked(replicates)
    choices: Any = {} if practical is None else {"practical": practical}
    return factorial.find(made, runs_of(made, **more), **choices)


@pytest.fixture(scope="module")
def findings() -> Findings:
    return found()


def plain(text: str) -> float:
    return float(text.replace("−", "-").replace("+", "").replace(",", ""))


def ends(text: str) -> list[float]:
    return [plain(end) for end in text.split(" to ")]


def said(text: str) -> str:
    return text.replace("\N{NO-BREAK SPACE}", " ")


# --- Sentences -----------------------------------------------------------------------------------


@pytest.mark.parametrize("practical", [0.05, 0.5, 1.0, 3.2, 50.0])
def test_effects_matter_by_their_whole_intervals(practical: float) -> None:
    a = found(practical).shown
    ranked = a.effects.reindex(a.effects["effect"].abs().sort_values(ascending=False).index)
    low, high = ranked["low"], ranked["high"]
    matters = (low >= practical) | (high <= -practical)
    small = (low > -practical) & (high < practical)
    groups = [[*ranked.index[rows]] for rows in (matters, ~matters & ~small, small)]
    significant = ((low > 0) | (high < 0)).sum()
    expected = f"{significant} of 6 effects are statistically significant"
    expected += (
        f". {len(groups[0])} matter, as they are surely larger than {practical:g} m: "
        f"{', '.join(groups[0])}." if groups[0] else
        f". None is surely larger than {practical:g} m."
    )
    if groups[1]:
        rest = f" and {len(groups[1]) - 3} smaller ones" if len(groups[1]) > 3 else ""
        expected += f" More runs are needed to decide about {', '.join(groups[1][:3])}{rest}."
    if groups[2]:
        expected += f" {len(groups[2])} are too small to matter, significant or not."
    assert factorial.what_matters(a) == expected


def test_each_kind_of_sentence_is_reached() -> None:
    some, none = (factorial.what_matters(found(it).shown) for it in (1.0, 50.0))
    assert " smaller ones." in factorial.what_matters(found(0.05, scale=1.5).shown)
    assert ". None is surely larger than 50 m. 6 are too small" in none
    assert " matter, as they are surely larger than 1 m: GPS error" in some


@pytest.mark.parametrize(("scale", "almost_all"), [(0.01, True), (1.5, False)])
def test_without_a_size_that_matters_many_significant_effects_are_no_news(
    scale: float, almost_all: bool
) -> None:
    a = found(None, scale=scale).shown
    significant = int(((a.effects["low"] > 0) | (a.effects["high"] < 0)).sum())
    assert (significant > 3) == almost_all
    news = ". With many runs, almost all are, whether they matter or not" * almost_all
    assert factorial.what_matters(a) == (
        f"{significant} of 6 effects are statistically significant{news}. No smallest effect that "
        "matters was given (option --practical)."
    )


def test_the_summary_has_the_answer_what_matters_and_the_better_levels(findings: Findings) -> None:
    answer, matters, better = factorial.summary(findings)
    assert [it.kind for it in (answer, matters, better) if isinstance(it, Text)] == [
        "answer", "plain", "plain"
    ]
    assert isinstance(better, Text)
    effects = findings.shown.effects
    assert {*effects.index[(effects["order"] == 1) & effects["significant"].astype(bool)]} >= {
        "GPS error", "baseline"
    }
    third = ", range error 0.05 m" * bool(effects.loc["range error", "significant"])
    assert said(better.text) == (
        f"The better levels, on average over the others: GPS error 0.1 m, baseline 3 m{third}."
    )
    nothing = found(scale=40.0)
    assert factorial.direction(nothing.shown) == ""
    assert len(factorial.summary(nothing)) == 2


# --- Tables --------------------------------------------------------------------------------------


def test_the_table_of_effects_has_all_that_is_known(findings: Findings) -> None:
    shown = factorial.effect_table(findings)
    a = findings.shown
    assert tuple(shown.head) == (
        "Effect", "Low to high [m]", "95 % interval [m]", "t", "p", "Share", "Detectable [m]",
        "In practice",
    )  # fmt: skip
    assert tuple(shown.words) == (7,)
    order = a.effects["effect"].abs().sort_values(ascending=False).index
    assert [row[0] for row in shown.rows] == [*order]
    power = detectable(a, 0.8)
    for row in shown.rows:
        effect = a.effects.loc[row[0]]
        assert plain(row[1]) == pytest.approx(effect["effect"], rel=5e-3)
        assert row[1][0] in "+−"
        assert ends(row[2]) == pytest.approx([effect["low"], effect["high"]], rel=6e-3, abs=6e-4)
        assert plain(row[3]) == pytest.approx(effect["t"], rel=6e-3)
        assert float(row[5].removesuffix(" %")) == pytest.approx(100 * effect["share"], abs=0.051)
        assert plain(row[6]) == pytest.approx(power[row[0]], rel=0.05)
        assert row[7] == effect["verdict"]
    assert "found with a probability of 80 %." in shown.note
    assert "smaller effects are not shown" not in shown.note
    logs = factorial.find(findings.study, runs_of(findings.study), transform="log")
    shown = factorial.effect_table(logs)
    assert shown.head[7:] == ["Ratio"]
    assert tuple(shown.words) == ()
    row = next(row for row in shown.rows if row[0] == "GPS error")
    effect = logs.shown.effects.loc["GPS error", "effect"]
    assert row[7].startswith(f"{np.exp(effect):#.3g} (")
    assert (logs.log, logs.spread, logs.profile) == (None, None, None)


def test_ratios_are_those_of_geometric_means_and_of_standard_deviations(findings: Findings) -> None:
    """Effects on ln y, and on ln s of the runs of a point."""
    shown = factorial.ratio_table(findings)
    assert shown is not None
    assert shown.caption == (
        f"Ratios, from the logarithm of the {findings.shown.response} and from the spread of the "
        f"{findings.shown.response}"
    )
    assert tuple(shown.head) == (
        "Effect", "Ratio of the response", "p", "Ratio of its spread", "p")
    runs = runs_of(findings.study)
    points = runs.groupby("point")
    logs = points[Y].apply(lambda y: np.log(y).mean())
    spread = np.log(points[Y].std(ddof=1))
    levels = points[[*FACTORS]].first()
    for name, (label, _, (low, high)) in FACTORS.items():
        row = next(row for row in shown.rows if row[0] == label)
        for cell, of in ((row[1], logs), (row[3], spread)):
            ratio = np.exp(of[levels[name] == high].mean() - of[levels[name] == low].mean())
            value, _, interval = cell.partition(" (")
            assert plain(value) == pytest.approx(ratio, rel=5e-3)
            least, most = ends(interval.removesuffix(")"))
            assert least < ratio < most
    assert [row[0] for row in shown.rows][:3] == ["GPS error", "baseline", "range error"]
    assert "Degrees of freedom for the response: 24." in shown.note
    # eight points have seven degrees of freedom, and one is left by six effects
    assert "for its spread: 1. That is few: these intervals are wide and rough." in shown.note
    assert "smaller ones are not shown" not in shown.note
    only = factorial.ratio_table(replace(findings, spread=None))
    assert only is not None
    assert tuple(only.head) == ("Effect", "Ratio of the response", "p")
    assert "ln s" not in only.note
    other = factorial.ratio_table(replace(findings, log=None))
    assert other is not None
    assert tuple(other.head) == ("Effect", "Ratio of its spread", "p")
    assert "geometric" not in other.note
    assert [len(row) for row in other.rows] == [3] * 6
    assert factorial.ratio_table(replace(findings, log=None, spread=None)) is None


@pytest.mark.parametrize(("runs", "few"), [(2, True), (3, False)])
def test_fewer_than_ten_degrees_of_freedom_are_few(runs: int, few: bool) -> None:
    shown = factorial.ratio_table(replace(found(replicates=runs), spread=None))
    assert shown is not None
    assert (f"for the response: {8 * (runs - 1)}. That is few" in shown.note) == few


def test_the_model_as_a_whole_is_in_a_table(findings: Findings) -> None:
    a = findings.shown
    shown = factorial.model_table(findings)
    values = dict(shown.rows)
    y = runs_of(findings.study)[Y]
    groups = runs_of(findings.study).groupby("point")[Y]
    assert [*values][:6] == ["Runs", "Design points", "Terms", "Overall mean",
                             "Error of the effects from", "Reference line t"]  # fmt: skip
    assert (values["Runs"], values["Design points"], values["Terms"]) == ("32", "8", "6")
    assert values["Overall mean"] == f"{y.mean():.4g} m"
    pure = np.sqrt(groups.var(ddof=1).mean())
    assert values["Error of the effects from"] == (
        f"the scatter between replicates (pure error); standard deviation {pure:.4g} m"
    )
    assert values["Reference line t"] == f"{stats.t.ppf(0.975, 24):.4g} (24 degrees of freedom)"
    left = a.residuals["residual"]
    r2 = 1 - (left**2).sum() / ((y - y.mean()) ** 2).sum()
    assert values["R²"] == f"{100 * r2:.2f} %"
    assert values["R² adjusted"] == f"{100 * (1 - (1 - r2) * 31 / 25):.2f} %"
    assert values["R² predicted"] == f"{100 * a.r2_predicted:.2f} %"
    assert values["Residual standard deviation"] == f"{np.sqrt((left**2).sum() / 25):.4g} m"
    lack = ((groups.transform("mean") - (y - left)) ** 2).sum()
    f = lack / pure**2
    assert values["Lack of fit"].startswith(f"F(1, 24) = {f:.4g}, p ")
    assert shown.note == ""
    gone = runs_of(findings.study)
    gone.loc[[3, 9], [Y, "error"]] = [np.nan, "it gave up"]
    fewer = factorial.find(findings.study, gone)
    assert dict(factorial.model_table(fewer).rows)["Runs"] == "30, 2 left out"


def test_of_a_single_replicate_the_small_effects_are_the_error() -> None:
    made = asked(1)
    own = factorial.find(made, runs_of(made), order=3)
    lenth = own.shown.lenth
    assert lenth is not None
    shown = factorial.model_table(own)
    values = dict(shown.rows)
    for words, size in (("Pseudo standard error (PSE)", lenth.pse),
                        ("Margin of error (ME)", lenth.me),
                        ("Simultaneous margin (SME)", lenth.sme)):  # fmt: skip
        assert values[words] == f"{size:.4g} m"
    assert "R²" not in values
    assert shown.note.startswith("Lenth's method takes the error of an effect, the PSE,")
    assert own.missing[0] == (
        "The spread of the response cannot be analysed: each design point needs at least 2 runs, "
        "and there is 1."
    )
    assert own.missing[1:] == (
        "The Box–Cox profile cannot be computed: the model has as many terms as there are runs.",
    )


def test_what_cannot_be_analysed_is_said_with_its_reason() -> None:
    made = asked()
    zero = runs_of(made)
    zero.loc[5, Y] = 0.0
    assert factorial.find(made, zero).missing[0] == (
        "The logarithm of the response cannot be analysed: the response is not above zero in all "
        "runs (0)."
    )
    same = runs_of(made)
    same.loc[same["point"] == 2, Y] = 1.5
    (why,) = factorial.find(made, same).missing
    assert why == (
        "The spread of the response cannot be analysed: at some design points the runs are equal."
    )
    common = asked(2, seeding="common")
    reasons = factorial.find(common, runs_of(common)).missing
    assert "each design point needs at least 3 runs, and there are 2." in reasons[0]


@pytest.mark.parametrize("triple", [0.0, 0.4])
@pytest.mark.parametrize("error", ["pure", "residual"])
def test_a_significant_lack_of_fit_is_said_once(triple: float, error: Any) -> None:
    made = asked()
    own = factorial.find(made, runs_of(made, triple=triple, scale=0.3), error=error)
    assert own.shown.lack_of_fit is not None
    significant = own.shown.lack_of_fit.p < 0.05
    assert significant == (triple > 0)
    blocks = factorial.tables(own)
    captions = [it.caption for it in blocks if isinstance(it, PageTable)]
    assert [it.partition(",")[0].partition(" on")[0] for it in captions] == [
        "Effects", "Ratios", "The model", "Analysis of variance"
    ]
    notes = [it.text for it in blocks if isinstance(it, Text) and "lack of fit" in it.text]
    assert len(notes) == significant
    for text in notes:
        assert ("come from the scatter between replicates" in text) == (error == "pure")
        assert ("are wider than necessary" in text) == (error == "residual")
    (power,) = (it.text for it in blocks if isinstance(it, Text) and "Box–Cox" in it.text)
    assert power == factorial.box_cox_sentence(own.profile)


def test_the_analysis_of_variance_ends_with_the_error(findings: Findings) -> None:
    shown = factorial.anova_table(findings.shown)
    anova = findings.shown.anova
    order = findings.shown.effects["effect"].abs().sort_values(ascending=False).index
    assert [row[0] for row in shown.rows] == [
        *order, *(name for name in anova.index if name not in order)
    ]
    for source, square, df, mean, ratio, _ in shown.rows:
        row = anova.loc[source]
        assert plain(square) == pytest.approx(row["ss"], rel=1e-3)
        assert plain(df) == row["df"]
        assert mean == "–" or plain(mean) == pytest.approx(row["ss"] / row["df"], rel=1e-3)
        assert ratio == "–" or plain(ratio) == pytest.approx(row["f"], rel=1e-3)


def test_of_many_effects_the_largest_forty_are_shown() -> None:
    """Nine factors have 45 effects with their pairs."""
    keys = {
        "a": "platform.gps_horizontal_std_m", "b": "platform.arm_length_m",
        "c": "acoustics.range_std_m", "d": "platform.imu_tilt_std_deg",
        "e": "platform.imu_heading_std_deg", "f": "target.depth_std_m",
        "g": "acoustics.loss_probability", "h": "target.speed_m_s", "k": "target.radius_m",
    }  # fmt: skip
    made = load({
        "name": "nine", "scenario": "paper-scenario-1", "replicates": 1,
        "design": {"kind": "fraction", "resolution": 5},
        "factors": {name: {"keys": [key], "levels": [0.1, 0.3]} for name, key in keys.items()},
    })  # fmt: skip
    runs = made.points.table().assign(replicate=1)
    runs[Y] = 5 + runs["a"] * runs["b"] + np.random.default_rng(1).normal(0, 0.01, len(runs))
    runs["ekf.lost"], runs["error"] = False, None
    own = factorial.find(made, runs, order=2)
    assert len(own.shown.effects) == 45
    shown = factorial.effect_table(own)
    assert len(shown.rows) == 40
    assert shown.note.endswith(" 5 smaller effects are not shown.")
    ratios = factorial.ratio_table(own)
    assert ratios is not None
    assert len(ratios.rows) == 40
    assert ratios.note.endswith(" 5 smaller ones are not shown.")
    rows = factorial.anova_table(own.shown).rows
    assert len(rows) == 40 + len(own.shown.anova) - 45


def test_factors_and_conditions_are_in_the_table_of_factors() -> None:
    made = load({
        "name": "x", "scenario": "paper-scenario-1", "replicates": 2, "design": {"kind": "grid"},
        "factors": {
            "boat": {"label": "boat", "levels": {
                "ship": {"platform": {"arm_length_m": 5.0}}, "own": {}}},
            "loss": {"keys": ["acoustics.loss_probability"], "levels": [0.0, 0.125]},
        },
        "conditions": {"sea": {"label": "sea state", "keys": ["platform.beaufort"],
                               "levels": [2, 4], "combine": "all"}},
    })  # fmt: skip
    shown = factorial.factor_table(made)
    assert [tuple(row) for row in shown.rows] == [
        ("boat", "ship / own (the scenario as it is)", "–", "platform.arm_length_m", "boat"),
        ("loss", "0 / 0.125", "–", "acoustics.loss_probability", "loss"),
        ("sea state (condition, all)", "2 / 4", made.units["sea"] or "–", "platform.beaufort",
         "sea"),
    ]  # fmt: skip
    space = load({
        "name": "y", "scenario": "paper-scenario-1",
        "design": {"kind": "space", "base_rows": 16},
        "factors": {
            "gps": {"keys": ["platform.gps_horizontal_std_m"], "distribution": "normal",
                    "mean": 1.5, "std": 0.25, "range": [0.5, 3.0]},
            "arm": {"keys": ["platform.arm_length_m"], "distribution": "choice",
                    "levels": [0.4, 3.0]},
        },
    })  # fmt: skip
    assert [row[1] for row in factorial.factor_table(space).rows] == [
        "normal, range 0.5 to 3, mean 1.5, std 0.25", "0.4 / 3"
    ]


# --- One factor at a time ------------------------------------------------------------------------


def swept(factors: dict[str, Any], replicates: int = 3, **more: Any) -> tuple[Study, pd.DataFrame]:
    """A sweep of a scenario, and its runs: the larger the level, the larger the error."""
    kind = "sweep" if factors else "single"
    made = load({"name": "swept", "scenario": "harbour-square", "replicates": replicates,
                 "design": {"kind": kind}, "factors": factors, **more})  # fmt: skip
    runs = pd.concat([made.points.table().assign(replicate=i + 1) for i in range(replicates)],
                     ignore_index=True)  # fmt: skip
    size = sum((runs[name] for name in made.factors), start=1.0)
    runs[Y] = size + np.random.default_rng(3).normal(0, 0.05, len(runs))
    runs["ekf.lost"], runs["error"] = False, None
    return made, runs


NOISE = {"keys": ["acoustics.range_std_m"], "label": "range error", "levels": [0.5, 0.1, 1.5]}
ARM = {"keys": ["platform.arm_length_m"], "label": "baseline", "levels": [3.0, 1.0, 6.0]}


def test_a_sweep_says_where_each_factor_is_best_and_worst() -> None:
    made, runs = swept({"noise": NOISE, "arm": ARM})
    own = (made.base.acoustics.range_std_m, made.base.platform.arm_length_m)
    assert [*own] == [0.1, 3.0] == [*made.sweep_base]
    found = means.find(made, runs, Y)
    at = {
        (name, level): runs.loc[(runs[name] == level) & (runs[other] == base), Y]
        for name, levels, other, base in (("noise", (0.1, 0.5, 1.5), "arm", 3.0),
                                          ("arm", (1.0, 3.0, 6.0), "noise", 0.1))
        for level in levels
    }  # fmt: skip
    assert [*zip(found.table["factor"], found.table["value"], strict=True)] == [*at]
    low, mid, high = (f"{at['noise', it].mean():.3g}" for it in (0.1, 0.5, 1.5))
    assert low < mid < high
    ends_ = [f"{at['arm', it].mean():.3g}" for it in (1.0, 6.0)]
    assert found.answer == (
        "Mean RMS total error, one factor at a time: with range error it is lowest, "
        f"{low} m, at 0.1 m and highest, {high} m, at 1.5 m; with baseline it is lowest, "
        f"{ends_[0]} m, at 1 m and highest, {ends_[1]} m, at 6 m. This is a sweep and not a "
        "factorial design, so it has no interactions and no effects to test."
    )
    assert found.runs == len(runs) == 15
    parts = means.parts(found, None)
    assert (parts.title, parts.heading) == ("What the runs say: swept", "Means at each level")
    (shown,) = parts.tables
    assert isinstance(shown, PageTable)
    assert shown.caption == "RMS total error"
    assert tuple(shown.head) == ("Factor", "Level", "Runs", "Mean [m]", "95 % interval [m]",
                                 "Standard deviation [m]")  # fmt: skip
    assert shown.note == (
        "These rows share their runs, with all factors at the scenario's own values: range error "
        "0.1 m, baseline 3 m."
    )
    for row, ((name, level), y) in zip(shown.rows, at.items(), strict=True):
        reach = stats.t.ppf(0.975, 2) * y.std(ddof=1) / np.sqrt(3)
        assert tuple(row[:4]) == (
            {"noise": "range error", "arm": "baseline"}[name], f"{level:g} m", "3",
            f"{y.mean():.4g}",
        )  # fmt: skip
        assert ends(row[4]) == pytest.approx([y.mean() - reach, y.mean() + reach], rel=6e-3)
        assert plain(row[5]) == pytest.approx(y.std(ddof=1), rel=6e-3)
    (picture,) = parts.pictures
    assert picture.caption == (
        "Mean RMS total error at each level. Bars are the intervals of the means."
    )
    assert isinstance(parts.method[-1], PageTable)
    assert isinstance(parts.method[0], Text)
    assert "at each level, the other factors at the scenario's own values" in parts.method[0].text
    words = found.text()
    assert words.startswith(f"{found.answer}\n\n")
    assert f"{at['noise', 0.5].mean():.4g}" in words
    assert found.to_json()["runs"] == 18  # the base is in a row of each factor
    alone, its = swept({"noise": NOISE})
    (shown,) = means.parts(means.find(alone, its, Y), None).tables
    assert isinstance(shown, PageTable)
    assert shown.note == ""


def test_without_factors_there_is_one_mean() -> None:
    made, runs = swept({}, 5, settling_time_s=2.5)
    runs.loc[2, Y] = np.nan
    found = means.find(made, runs, Y)
    y = runs[Y].dropna()
    reach = stats.t.ppf(0.975, 3) * y.std(ddof=1) / 2
    assert found.answer == (
        f"Mean RMS total error {y.mean():.4g} m, {y.mean() - reach:.3g} to {y.mean() + reach:.3g} "
        "m. The study has no factors, so there are no effects to analyse."
    )
    assert found.runs == 4
    parts = means.parts(found, None)
    assert (parts.heading, [*parts.pictures]) == ("Mean", [])
    (shown,) = parts.tables
    assert isinstance(shown, PageTable)
    assert (len(shown.rows), len(shown.head)) == (1, 4)
    assert [it.text for it in parts.method if isinstance(it, Text)][::2] == [
        "Means over the runs; the intervals are Student's.", "Settling time: 2.5 s."
    ]
    assert not [it for it in parts.method if isinstance(it, PageTable)]


# --- The points ----------------------------------------------------------------------------------


def test_points_have_the_means_of_their_runs_and_shares_with_their_intervals() -> None:
    made = asked(20, factors={"gps": {"label": "GPS error", "levels": [0.1, 3.5],
                                      "keys": ["platform.gps_horizontal_std_m"]}})
    runs = pd.concat([made.points.table().assign(replicate=i + 1) for i in range(20)],
                     ignore_index=True)  # fmt: skip
    runs["error"] = [None, *["it gave up"] * 2, *[None] * 37]
    runs[Y] = 2.0 + runs["gps"] + runs["replicate"] / 100
    for flag, every in (("inconsistent", 4), ("lost", 5), ("misleading", 3)):
        runs[f"ekf.{flag}"] = pd.array(runs["replicate"] % every == 0, "boolean")
    runs.loc[:9, "ekf.misleading"] = pd.NA
    runs["other.lost"] = pd.NA
    (shown,) = points.tables(made, runs)
    assert isinstance(shown, PageTable)
    assert shown.head == ("Point", "GPS error", "Runs", "ekf: mean RMS [m]", "ekf: inconsistent",
                          "ekf: lost", "ekf: misleading")  # fmt: skip
    good = runs[runs["error"].isna()]
    for row, point, gps in zip(shown.rows, (1, 2), (0.1, 3.5), strict=True):
        mine = good[good["point"] == point]
        assert tuple(row[:3]) == (f"{point}", f"{gps:g} m", f"{len(mine)}") == (
            f"{point}", f"{gps:g} m", "19")
        assert row[3] == f"{mine[Y].mean():.3g}"
        shares = [100 * mine[f"ekf.{of}"].mean() for of in ("inconsistent", "lost", "misleading")]
        assert list(row[4:6]) == [f"{it:.1f} %" for it in shares[:2]]
        known = mine["ekf.misleading"].dropna()
        exact = stats.binomtest(int(known.sum()), len(known)).proportion_ci(0.95, "exact")
        assert len(known) == 15
        assert row[6] == (f"{shares[2]:.1f} % ({np.floor(100 * exact.low):.0f}–"
                          f"{np.ceil(100 * exact.high):.0f})")  # fmt: skip
    assert points.tables(made, runs.assign(error="it gave up")) == []
    assert points.tables(made, runs[["point", "error", "gps", "other.lost"]]) == []
