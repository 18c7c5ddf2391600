"""The page inside the FMU is complete and stands alone."""

from __future__ import annotations

import re
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser
from pathlib import Path
from typing import get_args

import pytest
from quick import one_in
from sblcosim.fmus.build.documentation import index_html, markdown
from sblcosim.fmus.build.formulas import FONTS, mathml, of_page, symbols, used
from sblcosim.fmus.standard import Fmi
from sblcosim.models import COMPONENTS
from sblcosim.models.declaration import Component
from sblcosim.models.equations import Model
from sblcosim.models.loading import load

ROOT = Path(__file__).parents[3]
VERSIONS = get_args(Fmi)


def model(component: Component) -> Model:
    """A model without equations: the page takes only feedthrough from them."""
    return Model(component, variants={}, states={}, draws=(), advance=(), iterate=())


class Page(HTMLParser):
    """Collects the cells of all tables, and checks that the tags match."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.rows: list[list[str]] = []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag: str, attrs: object) -> None:
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")
        if tag not in ("meta", "br", "hr", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "td" in self.open or "th" in self.open:
            self.rows[-1][-1] += data


@one_in(2)
@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("name", COMPONENTS)
def test_page_lists_every_variable_with_its_unit_and_legend(name: str, fmi: Fmi) -> None:
    component = COMPONENTS[name]
    # The table of the variables comes first; tables of the README may have the same names.
    listed = [row for row in Page(index_html(model(component), fmi)).rows if row]
    rows = {row[0]: row for row in reversed(listed)}
    for variable in component:
        row = rows[variable.name]
        assert row[1].startswith(variable.type)
        assert row[3] == (variable.unit or "")
        assert row[-1] == variable.legend


def test_page_shows_starts_and_ranges() -> None:
    page = Page(index_html(model(COMPONENTS["target"]), 2))
    rows = {row[0]: row for row in page.rows if row}
    assert rows["spiral_radius"][4:6] == ["2.5, 25.0", "0.0 … 100000.0"]
    assert rows["radius"][4:6] == ["15.0", "0.01 … 100000.0"]
    assert rows["depth_std"][4:6] == ["0.1", "≥ 0.0"]
    assert rows["waypoint"][4] == "0.0"


@pytest.mark.parametrize("name", COMPONENTS)
def test_page_loads_nothing_from_elsewhere(name: str) -> None:
    page = index_html(model(COMPONENTS[name]), 3)
    assert not re.search(r"<(script|link|img|iframe)\b|@import|url\(", page)
    assert "prefers-color-scheme: dark" in page


def test_text_of_the_declaration_is_escaped() -> None:
    component = replace(COMPONENTS["range_model"], description="a < b & <script>")
    page = index_html(replace(load("range_model"), component=component), 2)
    assert "a &lt; b &amp; &lt;script&gt;" in page


def test_page_tells_feedthrough_from_its_absence() -> None:
    assert "directional derivatives are provided" in index_html(load("range_model"), 2)
    assert "No output depends on an input" in index_html(model(COMPONENTS["ekf"]), 2)


def test_only_components_with_inputs_refuse_a_step_with_a_tick_inside() -> None:
    assert "refuses a step" in index_html(model(COMPONENTS["acoustics"]), 2)
    assert "a step may have any length" in index_html(model(COMPONENTS["target"]), 2)


def test_formulas_are_mathml_and_not_read_as_emphasis() -> None:
    text = r"with $a_i * b * \{c\}$ and *stress*" "\n\n$$\nx_k^* = \\Phi x_{k-1}^*\n$$\n"
    html = markdown(text)
    assert html.count("<math") == 2
    assert "<em>stress</em>" in html
    assert html.count("<em>") == 1
    assert "$" not in html


def test_a_formula_with_an_unknown_command_is_refused() -> None:
    with pytest.raises(ValueError, match=r"known commands only, got '\\\\nonsense x'"):
        markdown(r"$\nonsense x$")


TYPES = re.compile(r"(Float64|Int32|Boolean|String)(\[\d+\])*|name\[i(,j)?\]")
ELSEWHERE = re.compile(r"\.py\b|\.md\b|\.toml\b|sblcosim|scenario|tests?/|benchmarks/|<!--")


def names(component: Component) -> set[str]:
    """What the documentation of an FMU may name: what is in it."""
    said = {component.name, *(variable.name for variable in component)}
    for variable in component:
        said |= set((variable.choices or {}).values())
    for terminal in component.terminals:
        said |= {terminal.name, *terminal.members, *terminal.members.values()}
    return said


@pytest.mark.parametrize("name", COMPONENTS)
def test_the_page_names_only_what_is_in_the_fmu(name: str) -> None:
    page = index_html(model(COMPONENTS[name]), 3)
    codes = {unescape(code) for code in re.findall(r"<code>(.*?)</code>", page, re.DOTALL)}
    strange = {c for c in codes if not TYPES.fullmatch(c)} - names(COMPONENTS[name]) - {name}
    assert strange == set()
    visible = unescape(re.sub(r"<style>.*?</style>|<[^!][^>]*>", "", page, flags=re.DOTALL))
    assert not ELSEWHERE.search(visible), ELSEWHERE.search(visible)
    others = COMPONENTS.keys() - {name, "target", "platform", "acoustics"}
    assert not [other for other in others if "_" in other and other in visible]
    ids = set(re.findall(r' id="([^"]+)"', page))
    assert {*re.findall(r' href="#([^"]+)"', page)} <= ids
    assert not re.search(r' href="[^#]', page)


@pytest.mark.parametrize("name", COMPONENTS)
def test_the_page_has_the_formulas_and_their_symbols(name: str) -> None:
    page = index_html(model(COMPONENTS[name]), 3)
    assert page.count("<math") >= 5
    assert "$" not in page
    assert 'id="symbols"' in page
    assert f"math {{ font-family: {FONTS}; }}" in page


WRITTEN = sorted(
    path for path in [*ROOT.glob("models/*/*.md"), ROOT / "orchestrator" / "limits" / "README.md"]
)


@pytest.mark.parametrize("path", WRITTEN, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_formula_is_typeset_and_its_symbols_are_in_the_table(path: Path) -> None:
    known = of_page(path.parent.name, path.stem)
    formulas: list[str] = []

    def render(latex: str, display: bool) -> str:
        assert mathml(latex, display)
        formulas.append(latex)
        return ""

    html = markdown(path.read_text("utf-8"), render)
    assert formulas
    assert "$" not in html
    missing = {(n, f) for f in formulas for n, row in used(f, known) if row is None}
    assert missing == set()
    prose = re.sub(r"<code>.*?</code>", "", html, flags=re.DOTALL)
    assert not re.search(r"[α-ωΓ-Ω√∂∫Σᵀ₀-₉\u0302\u0304\u0307]|<pre>", prose), "typed, not typeset"
    assert "SYMBOLS.md" in html
    people = re.findall(r"[(;] ?\$[A-Z]\$\. [A-Z]\w+", path.read_text("utf-8"))
    assert people == [], "names of people are no formulas"


def test_a_symbol_that_is_not_in_the_table_is_found() -> None:
    known = of_page("range_model")
    found = dict(used(r"\hat{r}_{\text{odd}} = \frac{x_i}{\zeta} + \operatorname{Var} s'", known))
    assert {name for name, row in found.items() if row is None} == {r"\hat{r}_odd", r"\zeta", "s'"}
    assert {"x_i"} == {name for name, row in found.items() if row is not None}


def test_every_row_of_the_table_is_a_symbol_with_a_unit() -> None:
    text = (ROOT / "models" / "SYMBOLS.md").read_text("utf-8")
    rows = [line for line in text.splitlines() if line.startswith("| $")]
    assert len(rows) == sum(len(section) for section in symbols().values())
    assert all(it.unit and it.words for section in symbols().values() for it in section.values())


def test_a_symbol_of_all_pages_has_one_meaning() -> None:
    for it in symbols()["Everywhere"].values():
        assert not re.search(r";|\bor\b", it.words), it


TERMS = ("turn", "slot", "late", "outlier", "bearing", "raft", "own position", "tilt",
         "heading", "GPS", "mounting", "clock", "range", "spiral", "leg", "track", "round",
         "platform", "speed of sound", "copy", "packet", "loss")  # fmt: skip
"""What only some of the components have."""


@pytest.mark.parametrize("name", COMPONENTS)
def test_a_symbol_means_only_what_its_page_is_about(name: str) -> None:
    component = COMPONENTS[name]
    page = re.sub(r"<style>.*?</style>", "", index_html(model(component), 3), flags=re.DOTALL)
    text, _, table = page.partition('id="symbols"')
    text, table = (unescape(re.sub(r"<[^>]+>", " ", it)).casefold() for it in (text, table))
    assert len(table) > 100
    strange = [it for it in TERMS if it.casefold() in table and it.casefold() not in text]
    assert strange == []


def test_a_section_of_several_pages_is_that_of_each() -> None:
    meanings = {page: of_page("receiver", page) for page in ("ekf", "fixed_lag", "long_baseline")}
    both = ("punctual", "own positions")
    for page, words in (("ekf", ()), ("long_baseline", both[:1]), ("fixed_lag", both)):
        said = " ".join(row.words for row in meanings[page].values())
        lines = [row.words for name, row in meanings[page].items() if name in ("h", r"\lambda")]
        assert [it for it in both if any(it in line for line in lines)] == [*words], said
    assert meanings["ekf"]["y"].words == "east"


@pytest.mark.parametrize(("latex", "shown"), [
    (r"-m \ln u", "−m ln u"), (r"\cos 2u", "cos 2u"), (r"2\sin(u)", "2 sin(u)"),
    (r"\cos u \sin v", "cos u sin v"), (r"x \exp\left(v\right)", "x exp(v)"),
    (r"\sqrt{2} \ln u", "2 ln u"), (r"= \ln u", "=ln u"),
])  # fmt: skip
def test_the_name_of_a_function_stands_apart_from_what_is_beside_it(
    latex: str, shown: str
) -> None:
    text = re.sub(r"<mspace[^>]*>", " ", mathml(latex))
    assert unescape(re.sub(r"<[^>]+>", "", text)) == shown


def test_bars_are_a_pair_that_encloses_and_no_operators() -> None:
    made = mathml(r"\lvert v \rvert < c / \lvert d \rvert")
    found = re.findall(r"<mo([^>]*)>&#x0007C;</mo>", made)
    assert [re.findall(r'form="(\w+)"', it) for it in found] == [["prefix"], ["postfix"]] * 2


def test_markdown_is_embedded_below_the_title_and_without_raw_html() -> None:
    html = markdown("# EKF\n\n| a | b |\n|---|---|\n| 1 | 2 |\n\n<script>x</script>\n")
    assert "<h2>EKF</h2>" in html
    assert "<td>1</td>" in html
    assert "<script>" not in html
