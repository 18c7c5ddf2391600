"""The page inside the FMU is complete and stands alone."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser
from typing import get_args

import pytest
from sblcosim.fmus.build.documentation import index_html, markdown
from sblcosim.fmus.standard import Fmi
from sblcosim.models import COMPONENTS
from sblcosim.models.declaration import Component
from sblcosim.models.equations import Model
from sblcosim.models.loading import load

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
    assert "is refused" in index_html(model(COMPONENTS["acoustics"]), 2)
    assert "a step may have any length" in index_html(model(COMPONENTS["target"]), 2)


def test_markdown_keeps_formulas_as_typed() -> None:
    text = r"with $a_i * b * \{c\}$ and *stress*" "\n\n$$\nx_k^* = \\Phi x_{k-1}^*\n$$\n"
    html = markdown(text)
    assert r"<code>a_i * b * \{c\}</code> and <em>stress</em>" in html
    assert r"<code>x_k^* = \Phi x_{k-1}^*</code>" in html


def test_markdown_is_embedded_below_the_title_and_without_raw_html() -> None:
    html = markdown("# EKF\n\n| a | b |\n|---|---|\n| 1 | 2 |\n\n<script>x</script>\n")
    assert "<h2>EKF</h2>" in html
    assert "<td>1</td>" in html
    assert "<script>" not in html
