"""Reports in a real browser, without a network. Skipped where there is no Chromium."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import html5lib
import pytest
from browser import BROWSER, browse
from sblcosim import style
from sblcosim.cli import app
from sblcosim.report.page import Page, PagePicture, Section, render
from typer.testing import CliRunner

pytestmark = pytest.mark.skipif(BROWSER is None, reason="needs Chromium")

STUDY = """
name = "small"
scenario = "paper-scenario-1"
replicates = 4
fixed = { "time.duration_s" = 10.0 }
[factors.baseline]
label = "baseline"
unit = "m"
keys = ["platform.arm_length_m"]
levels = [0.4, 3.0]
[factors.gps]
label = "GPS error"
unit = "m"
keys = ["platform.gps_horizontal_std_m"]
levels = [0.1, 3.5]
[factors.range]
label = "range error"
unit = "m"
keys = ["acoustics.range_std_m"]
levels = [0.1, 1.0]
"""
PROBE = """<!DOCTYPE html><title>probe</title><pre id="found"></pre>
<iframe id="a" width="390" height="800" src="report.html#points"></iframe>
<iframe id="b" width="1400" height="800" src="report.html"></iframe>
<script>
addEventListener("load", () => setTimeout(() => {
  const found = {};
  for (const name of ["a", "b"]) {
    const w = document.getElementById(name).contentWindow, d = w.document;
    const root = d.documentElement, colour = (e, p) => w.getComputedStyle(e)[p];
    const drawings = [...d.querySelectorAll("figure svg, .picture svg")];
    const small = [...d.querySelectorAll(".picture svg")];
    const folded = [...d.querySelectorAll("details")];
    const opened = folded.filter(e => e.open).map(e => e.querySelector(".folded").id);
    const height = root.scrollHeight;
    const closed = small.map(s => s.getBoundingClientRect().toJSON());
    folded.forEach(e => { e.open = true; });
    const wide = [...d.querySelectorAll(".scroll")].filter(e => e.scrollWidth > e.clientWidth + 1);
    found[name] = {
      small: closed.map((before, i) => {
        const after = small[i].getBoundingClientRect();
        return [before.width, before.height, after.width, small[i].viewBox.baseVal.width * 96 / 72];
      }),
      opened, height, whole: root.scrollHeight,
      wide: wide.length,
      figures: wide.filter(e => e.querySelector("svg")).length,
      unsaid: wide.filter(e => !e.previousElementSibling?.matches("p.hint")
        || colour(e.previousElementSibling, "display") == "none").map(e => e.ariaLabel),
      code: [...d.querySelectorAll("pre")].filter(e => e.scrollWidth > e.clientWidth + 1).length,
      width: root.clientWidth, needed: root.scrollWidth,
      loaded: w.performance.getEntriesByType("resource").length,
      paper: colour(d.body, "backgroundColor"), ink: colour(d.body, "color"),
      drawings: drawings.length,
      scale: Math.min(...drawings.map(  // 1: an inch of the drawing is an inch of the page
        s => s.getBoundingClientRect().width / s.viewBox.baseVal.width * 72 / 96)),
      empty: drawings.filter(s => s.getBBox().width < 50 || s.getBBox().height < 50).length,
      text: colour(drawings[0], "fill"),
      colours: [...new Set(drawings.flatMap(s => [...s.querySelectorAll("path")].map(
        p => colour(p, "stroke"))))],
    };
  }
  document.getElementById("found").textContent = JSON.stringify(found);
}, 500));
</script>
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("browser")
    (place / "small.toml").write_text(STUDY)
    for arguments in (
        ["study", str(place / "small.toml"), "--out", str(place / "small")],
        ["analyse", str(place / "small"), "--out", str(place / "shown"), "--practical", "1"],
    ):
        done = CliRunner().invoke(app, arguments)
        assert done.exit_code == 0, done.output
    (place / "shown" / "probe.html").write_text(PROBE)
    return place / "shown"


def rgb(colour: str) -> str:
    return f"rgb({', '.join(str(int(colour[i : i + 2], 16)) for i in (1, 3, 5))})"


@pytest.mark.parametrize(("theme", "scheme"), [("light", 1), ("dark", 0)])
def test_a_report_renders_alone_in_both_themes_and_fits_narrow_and_wide_windows(
    folder: Path, theme: Any, scheme: int
) -> None:
    dom, complaints = browse(
        folder, f"--blink-settings=preferredColorScheme={scheme}", "--virtual-time-budget=20000",
        "--dump-dom", (folder / "probe.html").as_uri(),
    )
    assert complaints == ""
    tree = html5lib.parse(dom, namespaceHTMLElements=False)
    found = json.loads(tree.find(".//pre").text)
    look = style.THEMES[theme]
    assert found["a"]["opened"] == ["points"]  # by the link into it
    assert found["b"]["opened"] == []
    assert found["b"]["height"] < 0.5 * found["b"]["whole"]
    assert found["a"]["wide"] > 0
    assert found["b"]["scale"] * style.SMALL >= 8  # points
    for window, widest in (("a", 185), ("b", 260)):
        assert len(found[window]["small"]) == 3
        for width, height, opened, whole in found[window]["small"]:
            assert 60 < width < widest
            assert 60 < height <= 12 * 16
            assert opened == pytest.approx(whole, rel=0.01)
    for window in found.values():
        assert window["unsaid"] == []
        assert window["figures"] == window["code"] == 0
        assert window["needed"] <= window["width"]
        assert window["loaded"] == 0
        assert window["paper"] == rgb(look.paper)
        assert window["ink"] == window["text"] == rgb(look.ink)
        assert window["drawings"] == 5
        assert window["empty"] == 0
        assert rgb(look.receivers[0]) in window["colours"]
        other = style.THEMES["dark" if theme == "light" else "light"]
        only = {*other.receivers, other.grid} - {*look.receivers, look.grid}
        assert not {rgb(colour) for colour in only} & set(window["colours"])


BESIDE = """<!DOCTYPE html><title>probe</title><pre id="found"></pre>
<iframe id="a" width="390" height="800" src="report.html"></iframe>
<iframe id="b" width="1400" height="800" src="report.html"></iframe>
<script>
addEventListener("load", () => setTimeout(() => {
  const found = {};
  for (const name of ["a", "b"]) {
    const d = document.getElementById(name).contentDocument, root = d.documentElement;
    found[name] = {
      width: root.clientWidth, needed: root.scrollWidth,
      at: [...d.querySelectorAll("figure svg")].map(s => s.getBoundingClientRect().toJSON()),
      scale: [...d.querySelectorAll("figure svg")].map(
        s => s.getBoundingClientRect().width / s.viewBox.baseVal.width * 72 / 96),
    };
  }
  document.getElementById("found").textContent = JSON.stringify(found);
}, 500));
</script>
"""


def test_figures_stand_beside_each_other_where_there_is_room(tmp_path: Path) -> None:
    pictures = [
        PagePicture(name, style.svg(style.new_figure(width, 6.0).subplots(), name), "C", "A")
        for name, width in (("pareto", 6.4), ("path", 7.2))
    ]
    parts = [Section(one.name, f"at-{one.name}", [one], beside=True) for one in pictures]
    text = render(Page("P", "L", [Section("S", "s", parts=parts)]))
    (tmp_path / "report.html").write_text(text, "utf-8")
    (tmp_path / "probe.html").write_text(BESIDE, "utf-8")
    dom, complaints = browse(
        tmp_path, "--virtual-time-budget=20000", "--dump-dom", (tmp_path / "probe.html").as_uri()
    )
    assert complaints == ""
    found = json.loads(html5lib.parse(dom, namespaceHTMLElements=False).find(".//pre").text)
    for window in found.values():
        assert window["needed"] <= window["width"]
        for place in window["at"]:
            assert 0 <= place["left"] < place["right"] <= window["width"]
    left, right = found["b"]["at"]
    assert left["right"] < right["left"]
    assert left["top"] == right["top"]
    assert min(found["b"]["scale"]) * style.SMALL >= 8  # points
    first, second = found["a"]["at"]
    assert first["bottom"] < second["top"]


def test_all_of_a_report_is_printed(folder: Path) -> None:
    """As much as if every part had been opened before."""
    text = (folder / "report.html").read_text("utf-8")
    assert "<details>" in text
    opened = folder / "opened.html"
    opened.write_text(text.replace("<details>", "<details open>"), "utf-8")
    pages = []
    for page in (folder / "report.html", opened):
        printed = folder / f"{page.stem}.pdf"
        browse(folder, f"--print-to-pdf={printed}", page.as_uri())
        content = printed.read_bytes()
        assert content.startswith(b"%PDF")
        pages.append(len(re.findall(rb"/Type /Page\b", content)))
    assert 3 <= pages[0] == pages[1] <= 20


QUESTION = """
name = "small"
title = "Which GPS, and how long a baseline, for a telephone?"
scenario = "paper-scenario-1"
response = "total_rms_m"
limit = 1.0
share = 0.9
most_runs = 1000
settling_time_s = 4.0
currency = "€"
fixed = { "time.duration_s" = 8.0 }
[choices.gps]
label = "GPS error"
keys = ["platform.gps_horizontal_std_m"]
levels = [0.1, 1.0, 3.5]
costs = [500000, 1000, 200]
[choices.baseline]
keys = ["platform.arm_length_m"]
levels = [0.4, 3.0]
costs = [100, 600]
"""
WINDOWS = """<!DOCTYPE html><title>probe</title><pre id="found"></pre>
<iframe id="a" width="390" height="800" src="report.html"></iframe>
<iframe id="b" width="1400" height="800" src="report.html"></iframe>
<script>
addEventListener("load", () => setTimeout(() => {
  const found = {};
  for (const name of ["a", "b"]) {
    const w = document.getElementById(name).contentWindow, d = w.document;
    const drawings = [...d.querySelectorAll("figure svg")].map(s => s.getBoundingClientRect().width
      / s.viewBox.baseVal.width * 72 / 96);
    const frame = d.querySelector("table").parentElement;
    const edge = frame.getBoundingClientRect().right;
    found[name] = {
      drawings,
      seen: [...d.querySelector("table thead").querySelectorAll("th")]
        .filter(e => e.getBoundingClientRect().right <= edge + 1).map(e => e.textContent),
      hint: w.getComputedStyle(frame.previousElementSibling).display,
      width: d.documentElement.clientWidth, needed: d.documentElement.scrollWidth,
    };
  }
  document.getElementById("found").textContent = JSON.stringify(found);
}, 500));
</script>
"""


def test_an_answer_can_be_read_on_a_telephone(tmp_path: Path) -> None:
    """Its figure has text of a legible size, and its table shows first what decides."""
    (tmp_path / "small.toml").write_text(QUESTION, "utf-8")
    out = tmp_path / "small"
    done = CliRunner().invoke(app, ["require", str(tmp_path / "small.toml"), "--out", str(out)])
    assert done.exit_code == 0, done.output
    (out / "answer" / "probe.html").write_text(WINDOWS)
    dom, complaints = browse(
        out / "answer", "--virtual-time-budget=20000", "--dump-dom",
        (out / "answer" / "probe.html").as_uri(),
    )
    assert complaints == ""
    tree = html5lib.parse(dom, namespaceHTMLElements=False)
    found = json.loads(tree.find(".//pre").text)
    wide, narrow = "b", "a"
    for window, drawn in ((wide, 0), (narrow, 1)):
        scales = found[window]["drawings"]
        assert scales[1 - drawn] == 0  # the other one is not shown
        assert scales[drawn] * style.SMALL >= 8  # points
        assert found[window]["needed"] <= found[window]["width"]
    head = ["GPS error · baseline", "Verdict", "90 % within [m]", "Cost"]
    assert found[narrow]["seen"][:4] == head
    assert found[narrow]["hint"] == "block"
    assert len(found[wide]["seen"]) == 7
