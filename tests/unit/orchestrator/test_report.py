"""Pages, and what reports say."""

from __future__ import annotations

import ast
import re
from base64 import b64decode
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import html5lib
import numpy as np
import pandas as pd
import pytest
from sblcosim import style
from sblcosim.analysis.two_level import figures
from sblcosim.analysis.two_level.analysis import analyse
from sblcosim.analysis.two_level.ranking import ranking
from sblcosim.catalogue import by_name
from sblcosim.data.record import Record
from sblcosim.errors import ConfigurationError
from sblcosim.report import paper
from sblcosim.report import two_level as factorial
from sblcosim.report.page import (
    Code,
    Page,
    PagePicture,
    PageTable,
    Section,
    Text,
    brief,
    inline,
    render,
)
from sblcosim.report.paper.campaigns import FAVOURABLE, all_campaigns
from sblcosim.report.paper.figures import FIGURES, plot_waves
from sblcosim.scenario.scenario import load
from sblcosim.study import study
from synthetic_record import make_record

LABELS = {"gps": "GPS error", "arm": "baseline", "loss": "packet loss"}


def table(effects: dict[str, float], replicates: int = 10, noise: float = 1.0) -> pd.DataFrame:
    points = pd.DataFrame(list(product((-1.0, 1.0), repeat=3)), columns=["gps", "arm", "loss"])
    runs = pd.concat([points] * replicates, ignore_index=True)
    y = 20 + sum(size / 2 * runs[name] for name, size in effects.items())
    error = np.random.default_rng(1).normal(0, noise, len(runs))
    return runs.assign(y=y + error, replicate=np.repeat(np.arange(replicates), len(points)))


def analysed(effects: dict[str, float], **options: Any) -> Any:
    return analyse(table(effects), ["gps", "arm", "loss"], "y", unit="m", **options).named(LABELS)


# --- Names ---------------------------------------------------------------------------------------


def test_names_for_people_are_everywhere_in_an_analysis_and_numbers_stay() -> None:
    plain = analyse(table({"gps": 4}), ["gps", "arm", "loss"], "y")
    shown = plain.named(LABELS, {"gps": "m"}, "error")
    assert shown.factors == ("GPS error", "baseline", "packet loss")
    assert "GPS error × packet loss" in shown.effects.index
    assert "GPS error × packet loss" in shown.anova.index
    assert shown.units == {"GPS error": "m"}
    assert set(shown.points) >= set(shown.factors)
    assert set(shown.main_effects["factor"]) == set(shown.factors)
    assert set(shown.interactions["first"]) == {"GPS error", "baseline"}
    assert "error" in shown.table
    np.testing.assert_array_equal(plain.effects["effect"], shown.effects["effect"])
    text = str(shown)
    assert "GPS error" in text
    assert "gps" not in text


def test_aliases_have_names_for_people() -> None:
    points = pd.DataFrame(
        [(a, b, a * b) for a, b in product((-1, 1), repeat=2)], columns=["gps", "arm", "loss"]
    )
    runs = pd.concat([points] * 3, ignore_index=True)
    runs["y"] = runs["gps"] + np.random.default_rng(1).normal(0, 0.1, len(runs))
    shown = analyse(runs, ["gps", "arm", "loss"], "y", order=1).named(LABELS)
    assert shown.aliases["GPS error"] == ("baseline × packet loss",)


def test_common_random_numbers_have_names_for_people() -> None:
    shown = analyse(table({"gps": 4}), ["gps", "arm", "loss"], "y", seeding="common").named(LABELS)
    assert "GPS error × baseline" in shown.replicate_effects.columns


def test_figures_show_labels_and_units() -> None:
    shown = analyse(table({"gps": 4}), ["gps", "arm", "loss"], "y").named(LABELS, {"gps": "m"})
    axes = figures.plot_main_effects(shown)
    names = [text.get_text().replace("\n", " ") for text in axes.get_xticklabels(minor=True)]
    assert names == ["GPS error [m]", "baseline", "packet loss"]


@pytest.mark.parametrize("quick", [True, False])
def test_campaigns_of_the_paper_share_no_seed(quick: bool) -> None:
    seeds = [
        {made.run_seed(point, replicate) for point in range(1, 1 + len(made.points.values))
         for replicate in range(1, 1 + made.replicates)}
        for made in all_campaigns(quick).values()
    ]  # fmt: skip
    assert len(set[int]().union(*seeds)) == sum(map(len, seeds))


def test_the_shipped_studies_have_labels_and_units() -> None:
    for n in (1, 2, 3):
        loaded = study.load(f"paper-scenario-{n}")
        assert all(f.label for f in loaded.factors.values())
        units = {name for name, unit in loaded.units.items() if not unit}
        assert units == {"packet_loss"}  # a probability


def test_a_factor_without_a_unit_has_that_of_its_keys() -> None:
    made = study.load({
        "name": "units", "scenario": "paper-scenario-1", "replicates": 1,
        "design": {"kind": "full"},
        "factors": {
            "speed": {"keys": ["target.speed_m_s"], "levels": [0.3, 1.0]},
            "tilt": {"keys": ["platform.imu_tilt_std_deg", "platform.imu_heading_std_deg"],
                     "levels": [1.0, 10.0]},
            "loss": {"keys": ["acoustics.loss_probability"], "levels": [0.0, 0.1]},
            "noise": {"keys": ["receiver.acceleration_psd_m2_s3"], "levels": [0.1, 1.0]},
            "own": {"keys": ["acoustics.range_std_m"], "unit": "metre", "levels": [0.1, 1.0]},
        },
    })
    assert made.units == {"speed": "m/s", "tilt": "°", "loss": "", "noise": "m²/s³",
                          "own": "metre"}


# --- Sentences -----------------------------------------------------------------------------------


def test_factors_whose_effects_cannot_be_told_apart_share_a_place() -> None:
    shown = analysed({"gps": 8, "arm": 2, "loss": -2})
    assert ranking(shown) == {
        "GPS error": "1", "baseline": "2 to 3", "packet loss": "2 to 3"
    }
    apart = analysed({"gps": 8, "arm": 5, "loss": -2})
    assert list(ranking(apart).values()) == ["1", "2", "3"]


def test_what_is_significant_and_what_matters_are_told_apart() -> None:
    shown = analysed({"gps": 8, "arm": 1}, practical=3.0)
    text = factorial.what_matters(shown)
    assert "1 matter, as they are surely larger than 3 m: GPS error." in text
    assert text.startswith(f"{shown.effects['significant'].sum()} of 6 effects are statistically")
    assert shown.effects.loc["baseline", "verdict"] == "too small"
    assert "No smallest effect that matters was given" in factorial.what_matters(analysed({}))


def test_the_better_level_is_the_one_with_the_smaller_response() -> None:
    shown = analysed({"gps": 8, "arm": -5})
    assert factorial.direction(shown).startswith(
        "The better levels, on average over the others: GPS error −1, baseline 1"
    )


@pytest.mark.parametrize(
    ("ratio", "word"),
    [(1.0, "equal"), (0.91, "within 10 %"), (1.09, "within 10 %"), (1.26, "26 % above"),
     (0.74, "26 % below"), (10.6, "11 times the paper's")],
)
def test_a_ratio_is_judged_in_words(ratio: float, word: str) -> None:
    assert paper.verdict(ratio) == word


# --- The paper's numbers -------------------------------------------------------------------------


def test_every_figure_of_the_paper_is_in_the_data_once() -> None:
    numbers = [figure["number"] for figure in paper.facts()["figure"]]
    assert numbers == [9, *range(11, 31)]
    assert all(figure["section"] and figure["shows"] for figure in paper.facts()["figure"])


def test_every_figure_of_the_paper_has_a_row_in_the_table_of_figures() -> None:
    numbers = {figure["number"] for figure in paper.facts()["figure"]}
    assert {figure.number for figure in FIGURES.values() if figure.label} == numbers
    for figure in paper.facts()["figure"]:
        rows = [row for row in FIGURES.values() if row.number == figure["number"]]
        assert {row.scenario for row in rows} == {figure.get("scenario")}


def test_seas_stand_side_by_side_on_scales_that_hold_them_all() -> None:
    calm = make_record()
    rough = Record(calm.time_ns, calm.values | {
        "platform.attitude": -3 * calm.values["platform.attitude"]
    })  # fmt: skip
    limits = [ax.get_ylim() for ax in plot_waves({"calm": calm, "rough": rough})]
    reach = np.rad2deg(np.abs(rough.values["platform.attitude"]).max())
    assert limits == [pytest.approx((-1.1 * reach, 1.1 * reach))] * 6


def test_two_figures_of_a_table_cannot_have_one_name() -> None:
    figure = next(iter(FIGURES.values()))
    with pytest.raises(ValueError, match=f"'{figure.name}': the name must be unique"):
        by_name(figure, figure)


def test_the_paper_s_total_errors_are_rms_like() -> None:
    for place in (4, 5, 6):
        known = paper.facts()[f"table{place}"]
        total = np.sqrt(known["x"] ** 2 + known["y"] ** 2 + known["z"] ** 2)
        assert total == pytest.approx(known["total"], abs=0.01)


def test_the_gallery_s_point_is_the_favourable_one() -> None:
    found = 0
    for path in (Path(__file__).parents[3] / "docs" / "gallery").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "point":
                number = int(path.stem.removeprefix("figure_"))
                name = f"paper-scenario-{paper.facts_of_figure(number)['scenario']}"
                point = load(name, ast.literal_eval(node.value)).given()
                assert point == load(name, paper.FAVOURABLE.items()).given(), path
                found += 1
    assert found == 6


@pytest.mark.parametrize("number", [figure["number"] for figure in paper.facts()["figure"]])
def test_what_the_paper_states_is_beside_ours(number: int) -> None:
    states = paper.facts_of_figure(number).get("states", {})
    if not states:
        with pytest.raises(ConfigurationError, match=r"figure: must be 9|, got nothing$"):
            paper.beside(number)
        return
    rows = paper.beside(number).rows
    assert [row[0] for row in rows] == [*states]
    assert [float(row[1].replace(",", "")) for row in rows] == [*map(float, states.values())]
    assert {row[-1] for row in rows} == {"equal"}


def of_runs(**errors: float) -> pd.DataFrame:
    """Runs with errors around these, at two points."""
    noise = np.random.default_rng(2).normal(1, 0.01, 40)
    columns = {f"ekf.{name}_rms_m": value * noise for name, value in errors.items()}
    about = {"point": np.repeat([1, 2], 20), "gps": np.repeat([0.1, 3.5], 20)}
    return pd.DataFrame({**about, **columns})


def test_the_page_of_the_gallery_has_the_favourable_point() -> None:
    page = (Path(__file__).parents[3] / "docs/howto/gallery.md").read_text("utf-8")
    point = ast.literal_eval(page.partition("\nbest = ")[2].partition("\n}")[0] + "}")
    assert point == {f"{t}.{key}": it for t, keys in FAVOURABLE.items() for key, it in keys.items()}


def test_the_page_of_the_gallery_says_how_many_effects_are_tested() -> None:
    page = (Path(__file__).parents[3] / "docs/howto/gallery.md").read_text("utf-8")
    factors = len(study.load("paper-scenario-1").points.factors)
    pairs = factors * (factors - 1) // 2
    words = f"Scenario 1 has {factors + pairs} tests ({factors} factors and their {pairs} pairs)"
    assert words in " ".join(page.split())


@pytest.mark.parametrize(("n", "figure"), [(1, 14), (2, 21), (3, 27)])
def test_the_table_of_errors_of_a_scenario_is_beside_ours(n: int, figure: int) -> None:
    known = paper.facts()[f"table{n + 3}"]
    runs = of_runs(absolute_x=known["x"], absolute_y=2 * known["y"], absolute_z=known["z"],
                   absolute_total=known["total"], relative_total=1.0)  # fmt: skip
    shown = paper.beside(figure, runs)
    assert [float(row[1]) for row in shown.rows[:4]] == [known[a] for a in ("x", "y", "z", "total")]
    assert [float(row[4]) for row in shown.rows[:4]] == pytest.approx([1, 2, 1, 1], abs=0.01)
    assert ("not a proof" in shown.note) == (n == 1)
    assert ("was chosen for Scenario 1" in shown.note) == (n > 1)
    over_all = paper.beside(figure + 3, runs)
    assert [row[:2] for row in over_all.rows] == [row[:2] for row in shown.rows[:4]]
    assert over_all.caption == f"Table {n + 3} and the mean over all 2 points"
    assert "no average over all levels" in over_all.note


def test_the_factors_that_the_paper_names_are_beside_ours() -> None:
    factors = {"gps": "GPS error", "baseline": "baseline", "sampling_time": "sampling time"}
    runs = table({"gps": 8, "arm": -5, "loss": 1}).rename(
        columns={"arm": "baseline", "loss": "sampling_time"}
    )
    shown = paper.beside(15, replace(analyse(runs, list(factors), "y"), labels=factors))
    assert [row[:3] for row in shown.rows] == [
        ("GPS error", "named", "1"), ("baseline", "named", "2"), ("sampling time", "named", "3")
    ]
    assert "Verdict: agrees." in shown.note
    named = paper.beside(29, replace(analyse(runs, list(factors), "y"), labels=factors))
    assert {row[0] for row in named.rows} == {"GPS error × baseline", "GPS error × sampling time"}
    assert {row[1] for row in named.rows} == {"named"}


FIGURES_WITH_NUMBERS = {
    9: "left out", 11: "left out or a table of runs", 12: "left out", 14: "a table of runs",
    15: "an analysis", 17: "a study's table", 21: "a table of runs", 22: "an analysis",
    24: "a study's table", 27: "a table of runs", 28: "an analysis", 29: "an analysis",
    30: "a study's table",
}  # fmt: skip


@pytest.mark.parametrize("number", range(1, 32))
@pytest.mark.parametrize("ours", [object(), pd.DataFrame({"seed": [1]}), table({"gps": 1})])
def test_what_cannot_be_beside_the_paper_is_refused(number: int, ours: Any) -> None:
    with pytest.raises(ConfigurationError) as refused:
        paper.beside(number, ours)
    if number not in FIGURES_WITH_NUMBERS:
        listed = " or ".join(map(str, FIGURES_WITH_NUMBERS))
        assert str(refused.value) == f"figure: must be {listed}, got {number}"
    else:
        words, got = str(refused.value).split(f", for Figure {number}, got ")
        assert words.startswith(f"ours: must be {FIGURES_WITH_NUMBERS[number]}")
        assert got.startswith(f"a {type(ours).__name__}")


def test_pooled_statistics_are_those_of_all_samples() -> None:
    samples = [np.array([1.0, 2.0, 4.0]), np.array([3.0])]
    runs = pd.DataFrame(
        {
            "ekf.estimates": [3, 1],
            "ekf.absolute_total_mean_m": [s.mean() for s in samples],
            "ekf.absolute_total_rms_m": [np.sqrt((s**2).mean()) for s in samples],
        }
    )
    every = np.concatenate(samples)
    assert paper.pooled(runs, "ekf") == pytest.approx((every.mean(), every.std()))


def test_intervals_of_pooled_statistics_cover_the_truth_as_often_as_they_say() -> None:
    rng = np.random.default_rng(1)
    inside = np.zeros(2)
    for _ in range(300):
        level = rng.gamma(4, 0.25, (60, 1))  # a session has a level of its own
        samples = level * rng.gamma(4, 0.25, (60, 100))
        runs = pd.DataFrame({
            "ekf.estimates": 100,
            "ekf.absolute_total_mean_m": samples.mean(axis=1),
            "ekf.absolute_total_rms_m": np.sqrt((samples**2).mean(axis=1)),
        })
        # variance of a product of two independent gammas of mean 1 and variance 1/4
        truth = (1.0, np.sqrt(1.25**2 - 1))
        inside += [low < value < high for value, (low, high) in
                   zip(truth, paper.pooled_intervals(runs, "ekf"), strict=True)]
    assert (inside / 300 > 0.88).all()


# --- Pages ---------------------------------------------------------------------------------------


def picture(name: str = "one") -> PagePicture:
    shown = analysed({"gps": 8})
    svg = style.svg(figures.plot_pareto(shown), name)
    return PagePicture(name, svg, "A caption", 'Bars, "quoted" & more')


def page() -> Page:
    blocks = [
        Text("a < b & c", "answer"), Code("sblcosim <x>"), picture(),
        PageTable("T", ("A", "B"), [("x", "1"), ("<y>", "2")], note="note"),
    ]
    parts = [
        Section("T", "t", [picture("two")], beside=True), Section("U", "u", beside=True),
        Section("F", "f", [Code("deep")], folded=True),
        Section("P", "p", [picture("small"), Text("below")], folded=True),
    ]
    return Page("Title & more", "Lead", [Section("S", "s", blocks, parts)], "foot")


def test_a_page_is_valid_html_and_keeps_the_text() -> None:
    text = render(page())
    html5lib.HTMLParser(strict=True).parse(text)
    assert "a &lt; b &amp; c" in text
    assert "<title>Title &amp; more</title>" in text
    assert '<html lang="en">' in text
    assert "&lt;y&gt;" in text


def test_of_a_folded_section_the_heading_is_seen_and_its_anchor_is_within() -> None:
    """A browser opens it for a link to something inside, and not for one to itself."""
    tree = html5lib.parse(render(page()), namespaceHTMLElements=False)
    folded = next(tree.iter("details"))
    assert folded.get("open") is None
    assert folded.find("summary/h3").text == "F"
    inner = folded.find("div")
    assert inner.get("id") == "f"
    assert inner.find("pre/code").text == "deep"
    assert tree.find(".//section/div/section/h3").text == "T"


def test_a_folded_picture_is_seen_small_and_opens_its_section() -> None:
    tree = html5lib.parse(render(page()), namespaceHTMLElements=False)
    _, folded = tree.iter("details")
    summary, below = folded.find("summary"), folded.find("div")
    assert summary.find("h3").text == "P"
    (drawing,) = summary.findall("span[@class='picture']")
    assert drawing.get("id") == "small"
    assert len([e for e in drawing.iter() if str(e.tag).endswith("svg")]) == 1
    assert not [e for e in below.iter() if str(e.tag).endswith("svg")]  # it is there once
    captions = ["".join(p.itertext()).partition(" (")[0] for p in below.iter("p")]
    assert captions == ["A caption", "below"]


def test_parts_of_a_kind_stand_together() -> None:
    tree = html5lib.parse(render(page()), namespaceHTMLElements=False)
    rows = [(e.get("class"), len(e)) for e in tree.findall(".//main/section/div")
            if e.get("class") in ("beside", "below", "small")]
    assert rows == [("beside", 2), ("below", 1), ("small", 1)]


def test_a_notebook_shows_the_open_tables_and_the_figures_of_a_report() -> None:
    text = brief(page())
    tree = html5lib.HTMLParser(strict=True, namespaceHTMLElements=False).parseFragment(text)
    assert [h.text for h in tree.iter("h4")] == ["Title & more", "T"]
    assert [td.text for td in tree.iter("td")] == ["x", "1", "<y>", "2"]  # of an open section
    assert [p.text for p in tree.iter("p")] == ["note", "a < b & c"]  # and the answers
    images = {e.get("alt"): e for e in tree.iter("img")}
    assert {*images} == {'Bars, "quoted" & more'}
    (row,) = tree.findall("div")
    assert len(row.findall("img")) == 2  # what is open in the report
    (folded,) = tree.findall("details")
    assert folded.find("summary").text == "P"
    head, _, data = folded.find("img").get("src").partition(",")
    assert head == "data:image/svg+xml;base64"
    assert b64decode(data).decode() == picture("small").svg


def test_a_table_prints_and_shows_itself() -> None:
    shown = PageTable("What", ("Name", "Number", "Words"), [("a", "1", "x <y>"), ("b", "20", "z")],
                      (2,), "A note.")  # fmt: skip
    assert str(shown) == (
        "What\n\nName  Number  Words\na          1  x <y>\nb         20  z\n\nA note."
    )
    tree = html5lib.parseFragment(shown._repr_html_(), namespaceHTMLElements=False)
    assert [td.text for td in tree.iter("td")] == ["a", "1", "x <y>", "b", "20", "z"]
    assert [p.text for p in tree.iter("p")] == ["A note."]
    assert "<p>" not in replace(shown, note="")._repr_html_()
    assert str(replace(shown, note="")).endswith("z")


def test_what_is_folded_is_printed() -> None:
    printed = render(page()).partition("@media print {\n")[2]
    assert "details::details-content { content-visibility: visible; block-size: auto; }" in printed


@pytest.mark.parametrize(
    ("widths", "words", "said"),
    [((10, 10), (), None), ((30, 30), (), "hint"), ((60, 70), (), "hint always"),
     ((10, 90), (1,), None), ((30, 90), (1,), "hint"), ((4, 9, 9), (1, 2), "hint")],
)
def test_a_table_that_may_not_fit_says_so(
    widths: tuple[int, ...], words: tuple[int, ...], said: str | None
) -> None:
    cells = ["wordy " * (n // 6) if i in words else "x" * n for i, n in enumerate(widths)]
    wide = PageTable("T", "ABC"[: len(cells)], [cells], words)
    text = render(Page("P", "L", [Section("S", "s", [wide])]))
    tree = html5lib.parse(text, namespaceHTMLElements=False)
    hints = [p.get("class") for p in tree.iter("p") if "hint" in (p.get("class") or "")]
    assert hints == ([said] if said else [])


def test_identifiers_in_a_page_are_unique() -> None:
    found = re.findall(r'\bid="([^"]*)"', render(page()))
    assert len(found) > 20
    assert len(set(found)) == len(found)
    text = render(page())
    targets = re.findall(r'(?:href="#|url\(#)([^")]*)', text)
    assert targets
    assert {*targets} <= {*found}


def test_a_page_refers_to_nothing_outside() -> None:
    text = render(page())
    assert "http" not in text
    assert not re.search(r"\bsrc=|@import|<script|<link", text)
    targets = re.findall(r'href="([^"]*)"', text)
    assert targets
    assert all(target.startswith(("#", "data:image/png")) for target in targets)


def test_a_figure_s_colours_are_variables_of_both_themes() -> None:
    svg = inline(picture())
    assert not re.search(r"#[0-9a-f]{6}\b", svg)
    names = set(re.findall(r"var\(--([\w-]+)\)", svg))
    assert {"paper", "ink", "line-0"} <= names
    text = render(page())
    for look in style.THEMES.values():
        assert f"--paper: {look.paper};" in text
    # last, so that paper is light whatever the screen is
    assert text.rindex("@media print { ") > text.index("@media (prefers-color-scheme: dark) { ")


def test_a_figure_says_what_it_is_to_those_who_do_not_see_it() -> None:
    assert 'role="img" aria-label="Bars, &#34;quoted&#34; &amp; more"' in inline(picture())


def test_a_table_s_headers_belong_to_rows_and_columns() -> None:
    tree = html5lib.parse(render(page()), namespaceHTMLElements=False)
    (found,) = tree.findall(".//table")
    assert [th.get("scope") for th in found.findall(".//th")] == ["col", "col", "row", "row"]
    assert "".join(found.find("caption").itertext()) == "T"


def test_a_picture_of_a_cloud_is_inside_the_page() -> None:
    runs = pd.concat([table({"gps": 4})] * 20, ignore_index=True)
    shown = analyse(runs, ["gps", "arm", "loss"], "y")
    svg = style.svg(figures.plot_residuals(shown)[0], "cloud")
    assert 'href="data:image/png;base64,' in inline(PagePicture("cloud", svg, "c", "a"))


@pytest.mark.parametrize("dark", [False, True])
def test_the_shadow_at_the_edge_of_a_wide_table_leaves_its_numbers_readable(dark: bool) -> None:
    """Text on the darkest part of the shadow has the contrast of WCAG 2, level AAA."""
    text = render(Page("P", "L", [Section("S", "s")]))
    light, night, *_ = re.findall(r":root {[^}]*}", text)
    values = dict(re.findall(r"--(\w+): ([^;]*);", night if dark else light))
    grey, *_, share = map(int, re.findall(r"\d+", values["shade"]))
    ink, paper = (
        [int(values[name][i : i + 2], 16) for i in (1, 3, 5)] for name in ("ink", "paper")
    )
    under = [paper[i] + (grey - paper[i]) * share / 100 for i in range(3)]

    def luminance(colour: list[Any]) -> float:
        linear = [((c / 255 + 0.055) / 1.055) ** 2.4 for c in colour]
        return float(np.dot(linear, [0.2126, 0.7152, 0.0722]))

    low, high = sorted(map(luminance, (ink, under)))
    assert (high + 0.05) / (low + 0.05) >= 7
