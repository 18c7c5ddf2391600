"""The documentation site: built without a network and without a warning, and whole."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from html import unescape
from html.parser import HTMLParser
from importlib.metadata import packages_distributions, requires
from pathlib import Path
from types import ModuleType
from typing import Any
from urllib.parse import unquote, urlsplit

import pytest
import sblcosim
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from sblcosim import analysis, limits, study
from sblcosim.cli import app
from sblcosim.cli.documents.by_command import DOCUMENTS, schema
from sblcosim.fmus.build.formulas import FONTS
from sblcosim.judge.columns import TABLES
from sblcosim.judge.definitions import AXES
from sblcosim.report.paper.numbers import facts_of_errors, facts_of_figure
from sblcosim.results import more
from sblcosim.results.responses import RESPONSES
from sblcosim.scenario.scenario import Scenario, load
from sblcosim.study.definition import Definition
from sblcosim.study.tables import ConditionTable, DesignTable, FactorTable
from shared import shared
from typer.main import get_command

from .test_browser import BROWSER, browse

pytest.importorskip("sphinx_gallery", reason="needs the extra docs")
from sphinx.util.inventory import InventoryFile

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
EXPLORER = "explore.html"
"""A part of the first page; `test_explore_page.py` is about what it has."""
BESIDE = ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md", "models", "fmus",
          "orchestrator", "tests", "tools", "examples")  # fmt: skip
"""What is a page of the site, or what pages lead to."""
NO_NETWORK = """
import socket

def connect(self, address, connect=socket.socket.connect):
    if self.family != socket.AF_UNIX and address[0] not in ("127.0.0.1", "::1", "localhost"):
        raise AssertionError(f"the site must be built without a network, got {address}")
    return connect(self, address)

socket.socket.connect = connect
"""
ONLY_THE_EXTRAS = """
from importlib.machinery import PathFinder

def find_spec(name, path=None, target=None, found=PathFinder.find_spec):
    return None if name.partition(".")[0] in {absent!r} else found(name, path, target)

PathFinder.find_spec = find_spec
"""


class Html(HTMLParser):
    """The identifiers, the links and the parts of a page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.ids: set[str] = set()
        self.links: list[str] = []
        self.parts: list[str] = []
        self.feed(path.read_text("utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name == "id":
                self.ids.add(value or "")
            elif name == "href" and tag == "a":
                self.links.append(value or "")
            elif name in ("src", "href", "srcset", "data", "poster"):
                self.parts.append(value or "")


@dataclass(frozen=True)
class Site:
    """A built site: its folder, its pages, and all that it defines, by kind and name."""

    folder: Path
    pages: Mapping[Path, Html]
    objects: Mapping[str, Any]


INSTALLED = {canonicalize_name(it) for names in packages_distributions().values() for it in names}
"""Packages that are installed."""


def needed(name: str, extras: frozenset[str], found: dict[str, frozenset[str]]) -> None:
    """Add a package with its extras, and all that they require, to what was found."""
    if name in found and extras <= found[name]:
        return
    found[name] = found.get(name, frozenset()) | extras
    for line in (requires(name) or []) if name in INSTALLED else []:
        one = Requirement(line)
        if one.marker is None or any(one.marker.evaluate({"extra": e}) for e in ("", *extras)):
            needed(canonicalize_name(one.name), frozenset(one.extras), found)


def absent() -> list[str]:
    """Modules here that what the README installs for the site does not bring along."""
    named = re.search(r"pip install\s+'\.\[([\w,]*docs[\w,]*)\]'", (ROOT / "README.md").read_text())
    assert named is not None
    found: dict[str, frozenset[str]] = {}
    needed("sblcosim", frozenset(named[1].split(",")), found)
    modules = packages_distributions().items()
    return sorted(it for it, names in modules if not {*map(canonicalize_name, names)} & {*found})


def alone(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python in a folder, without a network and with what the README installs for the site."""
    (folder / "guard").mkdir()
    guard = NO_NETWORK + ONLY_THE_EXTRAS.format(absent=absent())
    (folder / "guard" / "sitecustomize.py").write_text(guard)
    path = os.pathsep.join([str(folder / "guard"), *filter(None, [os.environ.get("PYTHONPATH")])])
    return subprocess.run(
        [sys.executable, *arguments], cwd=folder, capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": path},
    )  # fmt: skip


DRAW = """
from sphinx.application import Sphinx

Sphinx(".", "docs", "out", "trees", "dummy", warningiserror=True, keep_going=True)
"""
"""Sphinx draws the gallery before it reads anything."""


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the documents with the gallery, which takes half of the time."""

    def draw(folder: Path) -> dict[str, Any]:
        ignored = shutil.ignore_patterns("made", "__pycache__")
        shutil.copytree(DOCS, folder / "docs", ignore=ignored)
        beside(folder)
        done = alone(folder, "-c", DRAW)
        assert done.returncode == 0, done.stderr[-5000:]
        return {}

    return shared(tmp_path_factory, "gallery", draw)[0]


def beside(folder: Path) -> None:
    """Copy what the pages are beside the documents; links between them are followed by path."""
    for name in BESIDE:
        if (ROOT / name).is_dir():
            ignored = shutil.ignore_patterns("__pycache__", "ready")
            shutil.copytree(ROOT / name, folder / name, ignore=ignored)
        else:
            shutil.copy(ROOT / name, folder / name)


def built(folder: Path, drawn: Path) -> Site:
    """Build the site from a copy of the documents and the gallery."""
    shutil.copytree(drawn / "docs", folder / "docs")
    beside(folder)
    done = alone(folder, "-m", "sphinx", "-W", "--keep-going", "-n", "-c", "docs", ".", "html")
    assert done.returncode == 0, done.stderr[-5000:]
    html = folder / "html"
    pages = {path: Html(path) for path in html.rglob("*.html") if path != html / EXPLORER}
    return Site(html, pages, InventoryFile.loads((html / "objects.inv").read_bytes(), uri="").data)


def test_the_build_has_no_network(tmp_path: Path) -> None:
    done = alone(tmp_path, "-c", "import urllib.request as u; u.urlopen('http://192.0.2.1')")
    assert "the site must be built without a network" in done.stderr


def test_the_build_has_only_what_the_readme_installs(tmp_path: Path) -> None:
    assert {"pytest", "gtsam", "distributed"} <= {*absent()}
    assert alone(tmp_path, "-c", "import sphinx, casadi, sblcosim").returncode == 0
    other = tmp_path / "other"
    other.mkdir()
    assert "No module named 'distributed'" in alone(other, "-c", "import distributed").stderr


@pytest.mark.slow
def test_every_page_of_the_gallery_is_drawn(drawn: Path) -> None:
    pages = {path.stem for path in DOCS.glob("gallery/*.py")}
    made = drawn / "docs" / "made" / "gallery"
    assert {path.stem for path in made.glob("*.py")} == pages
    assert len(pages) == 25


@pytest.mark.slow
def test_the_site_is_built_and_whole(tmp_path: Path, drawn: Path) -> None:
    """One test, so that several workers do not build it several times."""
    site = built(tmp_path, drawn)
    every_document_is_a_page(site)
    every_page_of_the_gallery_has_its_figure(site)
    every_number_of_the_paper_is_beside_ours(site)
    the_last_lines_of_a_page_change_its_figure(site)
    every_key_of_a_scenario_is_in_the_reference(site)
    every_command_and_option_is_in_the_reference(site)
    every_document_of_json_is_in_the_reference(site)
    every_column_of_a_run_is_in_the_reference(site)
    every_public_name_is_in_the_reference(site)
    the_pages_need_nothing_from_elsewhere(site)
    the_first_page_has_the_explorer(site)
    links_within_the_site_lead_somewhere(site)
    formulas_are_typeset_and_lead_to_their_symbols(site)
    outputs_are_wrapped_as_on_a_terminal(site)
    every_page_fits_narrow_and_wide_windows(site)


def outputs_are_wrapped_as_on_a_terminal(site: Site) -> None:
    """Lines of sentences; those with columns stay."""
    count = 0
    for page in site.pages:
        for block in re.findall(r'<div class="highlight-text.*?</pre>', page.read_text("utf-8"),
                                re.DOTALL):  # fmt: skip
            for line in unescape(re.sub(r"<[^>]*>", "", block)).splitlines():
                count += line.startswith("  ")
                assert len(line) <= 80 or re.search(r"\S {2,}\S", line), f"{page}: {line}"
    assert count > 10


def test_every_page_can_be_read_in_the_repository() -> None:
    """Without what only the site shows, a page begins with a sentence and has no directive."""
    pages = [*DOCS.rglob("*.md"), *ROOT.glob("models/**/*.md")]
    assert len(pages) > 40
    for path in (page for page in pages if "made" not in page.parts):
        text = re.sub(r"<!--.*?-->", "", path.read_text("utf-8"), flags=re.DOTALL)
        assert not re.search(r"^\s*(```|:::)+\s*\{", text, re.MULTILINE), path
        title, _, rest = text.strip().partition("\n")
        assert title.startswith("# "), path
        first = re.sub(r"\s+", " ", rest.strip().split("\n\n")[0])
        if not first.startswith(("```", "##")):  # a command or a part may come first
            assert len(first.split()) > 4, path
    first = re.sub(r"<!--.*?-->", "", (DOCS / "index.md").read_text("utf-8"), flags=re.DOTALL)
    assert "simulates" in first.split("```")[0]
    assert "[README](../README.md)" in first


def every_document_is_a_page(site: Site) -> None:
    rooms = (ROOT / name for name in BESIDE if (ROOT / name).is_dir())
    readmes = [path for room in rooms for path in room.rglob("README.md")]
    readmes += ROOT.glob("models/**/*.md")
    assert len(readmes) > 25
    written = [*DOCS.rglob("*.md"), *DOCS.rglob("*.ipynb"), *readmes]
    drawn = [DOCS / "made" / p.relative_to(DOCS) for p in DOCS.glob("gallery/*.py")]
    assert len(drawn) == 25
    for path in (*(p for p in written if "made" not in p.parts), *drawn):
        page = site.folder / path.relative_to(ROOT).with_suffix(".html")
        assert page in site.pages, path
    assert "docs/index.html" in (site.folder / "index.html").read_text("utf-8")


def every_page_of_the_gallery_has_its_figure(site: Site) -> None:
    for path in DOCS.glob("gallery/*.py"):
        file = site.folder / "docs" / "made" / "gallery" / f"{path.stem}.html"
        html = site.pages[file]
        assert "Warning:" not in file.read_text("utf-8"), path.stem
        shown = [Path(part).name for part in html.parts if "sphx_glr" in part]
        drawn = [block for block in blocks(path) if drawing(block)]
        assert sorted(shown) == sorted(
            f"sphx_glr_{path.stem}_{n:03}{theme}.svg"
            for n in range(1, len(drawn) + 1) for theme in ("", "-dark")
        )  # fmt: skip


def blocks(path: Path) -> list[str]:
    """The blocks of code of a page of the gallery."""
    return path.read_text("utf-8").partition('\n"""\n')[2].split("# %%")


def drawing(block: str) -> bool:
    """Whether a block shows a figure."""
    return "plot_" in block.strip().splitlines()[-1]


WITH_NUMBERS = ("errors along x, y and z, and the total error", "Pareto chart", "main effects")
"""What figures show that the paper gives errors or influential factors for."""
NAMES_INTERACTIONS = 29
"""The one figure with whose interactions the paper deals in its text."""


def every_number_of_the_paper_is_beside_ours(site: Site) -> None:
    for path in DOCS.glob("gallery/figure_*.py"):
        number = int(path.stem.removeprefix("figure_"))
        facts = facts_of_figure(number)
        page = site.folder / "docs" / "made" / "gallery" / f"{path.stem}.html"
        text = unescape(re.sub(r"<[^>]*>", "", page.read_text("utf-8")))
        expected = "states" in facts or facts["shows"] in WITH_NUMBERS
        assert ("Paper" in text) == (expected or number == NAMES_INTERACTIONS), path
        assert "prints no number" not in text
        for what, value in facts.get("states", {}).items():
            assert re.search(rf"{re.escape(what)} +{value:,g} ", text), what
        if facts["shows"] == WITH_NUMBERS[0]:
            for axis, error in {**facts_of_errors(facts["scenario"])[1]}.items():
                if axis in (*AXES, "total"):
                    symbol = "e_tot" if axis == "total" else f"e_{axis}"
                    assert re.search(rf"{symbol} \[m\] +{error} ", text), symbol


def the_last_lines_of_a_page_change_its_figure(site: Site) -> None:
    for path in DOCS.glob("gallery/*.py"):
        assert drawing(blocks(path)[-1]), path
        drawn = sorted((site.folder / "_images").glob(f"sphx_glr_{path.stem}_???.svg"))
        assert drawn[-1].read_text("utf-8") != drawn[0].read_text("utf-8")
        assert len({re.sub(r"_\d{3}\b", "", it.read_text("utf-8")) for it in drawn}) == len(drawn)


def every_key_of_a_scenario_is_in_the_reference(site: Site) -> None:
    known = site.objects["std:scenario-key"]
    for table, field in Scenario.model_fields.items():
        inner = getattr(field.annotation, "model_fields", None)
        for name in [table] if inner is None else [f"{table}.{key}" for key in inner]:
            assert known[name].uri.startswith("docs/reference/scenario.html"), name


def commands(group: Any, above: str) -> Iterator[tuple[str, Any]]:
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, f"{above} {name}")
        else:
            yield f"{above} {name}", command


def every_command_and_option_is_in_the_reference(site: Site) -> None:
    all_commands = dict(commands(get_command(app), "sblcosim"))
    assert len(all_commands) > 15
    text = (DOCS / "reference" / "commands.md").read_text("utf-8")
    headings = site.pages[site.folder / "docs" / "reference" / "commands.html"].ids
    for name, command in all_commands.items():
        assert name.removeprefix("sblcosim ").replace(" ", "-") in headings, name
        listed = text.partition(f"\n## {name.removeprefix('sblcosim ')}\n")[2].partition("\n## ")[0]
        for parameter in command.params:
            if not parameter.hidden and parameter.name != "help":
                typed = [o for o in parameter.opts if o.startswith("-")] or [parameter.metavar]
                for option in typed:
                    pattern = rf"^\| `[^`]*{re.escape(option)}(?![\w-])"
                    assert re.search(pattern, listed, re.MULTILINE), option


def every_document_of_json_is_in_the_reference(site: Site) -> None:
    page = site.folder / "docs" / "reference" / "json.html"
    text = page.read_text("utf-8").replace("<wbr>", "")
    assert ">--dry-run</span>" in text  # and no dash
    for command in DOCUMENTS:
        assert command in site.pages[page].ids
        said = schema(command)
        for name, part in {"": said, **said["$defs"]}.items():
            assert not name or name.lower() in site.pages[page].ids
            for field in part["properties"]:
                assert f'<span class="pre">{field}</span>' in text, f"{command}: {name}.{field}"


def every_column_of_a_run_is_in_the_reference(site: Site) -> None:
    page = site.folder / "docs" / "reference" / "results.html"
    text = page.read_text("utf-8").replace("<wbr>", "")
    for table in TABLES.values():
        for column in (*table.index, *table.columns):
            assert f'<span class="pre">{column.name}</span>' in text, column.name


def every_public_name_is_in_the_reference(site: Site) -> None:
    kinds = [kind for kind in site.objects if kind.startswith("py:")]
    for package in (sblcosim, study, analysis, limits):
        for name in set(package.__all__) - {"__version__"}:
            full = f"{package.__name__}.{name}"
            assert any(full in site.objects[kind] for kind in kinds), full


START: dict[str, Any] = {"receiver": {"type": "sequential"}}


def test_what_a_default_follows_from_moves_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    from reference import FOLLOWS

    moved = {
        "time.sampling_time_s": 0.5, "time.ekf_ratio": 2, "seed": 7, "fmi": 3,
        "acoustics.range_std_m": 0.7, "target.depth_std_m": 0.7,
        "target.waypoint_m": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]],
        "acoustics.sampling_time_s": 0.05, "receiver.update_interval_s": 0.5,
    }  # fmt: skip
    for name, sources in FOLLOWS.items():
        table, _, key = name.partition(".")
        if key == "fmi" or not set(sources) <= set(moved):
            continue  # of a component it is empty, until a system is made; test_assumptions.py
        for source in sources:
            before, after = (
                getattr(getattr(load(keys), table), key)
                for keys in (START, nested(START, source, moved[source]))
            )
            assert before != after, f"{name} does not follow from {source}"


def nested(tables: dict[str, Any], name: str, value: Any) -> dict[str, Any]:
    """Tables with another value of a key."""
    table, _, key = name.rpartition(".")
    return tables | ({table: tables.get(table, {}) | {key: value}} if table else {key: value})


def the_pages_need_nothing_from_elsewhere(site: Site) -> None:
    for path, html in site.pages.items():
        for part in html.parts:
            assert not urlsplit(part).netloc, f"{path.relative_to(site.folder)}: {part}"
    found = 0
    for path in site.folder.rglob("*.css"):
        text = path.read_text("utf-8")
        for part in re.findall(r"url\(\s*['\"]?([^'\")]*)|@import\s+(\S+)", text):
            assert not urlsplit("".join(part)).netloc, f"{path.relative_to(site.folder)}: {part}"
            found += 1
    assert found


def the_first_page_has_the_explorer(site: Site) -> None:
    assert f"../{EXPLORER}" in site.pages[site.folder / "docs" / "index.html"].parts
    text = (site.folder / EXPLORER).read_text("utf-8")
    assert "<title>A realistic dive</title>" in text
    assert not Html(site.folder / EXPLORER).parts  # nothing is outside of it


def links_within_the_site_lead_somewhere(site: Site) -> None:
    followed = 0
    for path, html in site.pages.items():
        for link in html.links:
            url = urlsplit(link)
            if not url.scheme and not url.netloc:
                target = (path.parent / unquote(url.path)).resolve() if url.path else path
                assert target.is_file(), f"{path.relative_to(site.folder)}: {link}"
                if url.fragment and target in site.pages:
                    ids = site.pages[target].ids
                    assert unquote(url.fragment) in ids, f"{path.relative_to(site.folder)}: {link}"
                    followed += 1
    assert followed > 1000


def formulas_are_typeset_and_lead_to_their_symbols(site: Site) -> None:
    texts = [page.read_text("utf-8") for page in site.pages]
    assert not any("<mo>&#x0007C;</mo>" in text for text in texts)  # a bar of another height
    assert any('form="prefix">&#x0007C;</mo>' in text for text in texts)
    assert not any(re.search(r"</math>(</a>)?[.,;]", text) for text in texts)  # may be broken
    rows = site.pages[site.folder / "models" / "SYMBOLS.html"].ids
    assert sum(name.startswith("symbol-") for name in rows) > 200
    for path in site.pages:
        code = re.compile(r"<(pre|code|script|style)\b.*?</\1>", re.DOTALL)
        text = code.sub("", path.read_text("utf-8"))
        visible = re.sub(r"<[^>]*>", "", text)
        assert "$" not in visible, f"{path}: {visible[visible.index('$') - 40 :][:80]}"
        assert "\\frac" not in visible, path
    for name in ("models/target/README", "models/receiver/coupled", "orchestrator/limits/README"):
        html = site.pages[site.folder / f"{name}.html"]
        assert sum("SYMBOLS.html#symbol" in link for link in html.links) > 20, name


PROBE = r"""<!DOCTYPE html><title>probe</title><pre id="found"></pre><script>
const pages = PAGES, SOUGHT = WORDS, found = {};
const wide = e => e.scrollWidth > e.clientWidth + 1;
const lines = (d, e) => {
  const range = d.createRange();
  range.selectNodeContents(e);
  return range.getBoundingClientRect().height / parseFloat(getComputedStyle(e).lineHeight);
};
function brokenOptions(d) {  // options of commands that stand in more than one line
  const found = [], inner = "p, pre, li, dt, td, h1, h2, h3";
  for (const e of d.querySelectorAll(`article :is(${inner})`)) {
    if (e.querySelector(inner)) continue;
    const walker = d.createTreeWalker(e, NodeFilter.SHOW_TEXT), places = [];
    let text = "";
    for (let node; node = walker.nextNode(); text += node.data)
      for (let i = 0; i < node.length; i++) places.push([node, i]);
    for (const option of text.matchAll(/(?<![\w-])--[a-zA-Z][\w-]*/g)) {
      const range = d.createRange(), [last, i] = places[option.index + option[0].length - 1];
      range.setStart(...places[option.index]);
      range.setEnd(last, i + 1);
      const boxes = [...range.getClientRects()].filter(it => it.width);
      if (boxes.some(it => Math.abs(it.top - boxes[0].top) > 5)) found.push(option[0]);
    }
  }
  return found;
}
function sought(d, words) {  // the names that the field of search leaves for these words
  const field = d.querySelector("input.filter");
  field.value = words;
  field.dispatchEvent(new Event("input"));
  return [...d.querySelectorAll("article tbody td:first-child, article dl.py .descname")].filter(
    e => e.getBoundingClientRect().height).map(e => e.textContent.trim());
}
const tall = e => e.getBoundingClientRect().height;
const rgba = text => {
  const it = text.match(/[\d.]+/g).map(Number), unit = text.startsWith("color(") ? 255 : 1;
  return [...it.slice(0, 3).map(v => v * unit), it[3] ?? 1];
};
const over = (a, b) => [0, 1, 2].map(i => a[i] * a[3] + b[i] * (1 - a[3])).concat(1);
const light = c => [.2126, .7152, .0722].reduce((sum, share, i) => {
  const v = c[i] / 255;
  return sum + share * (v <= .03928 ? v / 12.92 : ((v + .055) / 1.055) ** 2.4);
}, 0);
function pale(d) {  // text that hardly stands out from what is behind it
  return [...d.querySelectorAll("article *")].filter(e => {
    const box = e.getBoundingClientRect();
    const own = [...e.childNodes].some(n => n.nodeType == 3 && n.textContent.trim());
    if (!own || !box.width || getComputedStyle(e).visibility != "visible") return false;
    let behind = [255, 255, 255, 1];
    const around = [];
    for (let a = e; a; a = a.parentElement) around.unshift(a);
    for (const a of around) behind = over(rgba(getComputedStyle(a).backgroundColor), behind);
    const both = [light(over(rgba(getComputedStyle(e).color), behind)), light(behind)];
    return (Math.max(...both) + .05) / (Math.min(...both) + .05) < 3;
  }).map(e => e.textContent.trim().slice(0, 30));
}
async function look(page, width) {
  const frame = Object.assign(document.createElement("iframe"), { width, height: 900, src: page });
  const loaded = new Promise(done => { frame.onload = done; });
  document.body.append(frame);
  await loaded;
  const d = frame.contentDocument, root = d.documentElement;
  const article = d.querySelector("article").getBoundingClientRect();
  const around = e => e.closest(".table-wrapper, .cell_output") ?? e;
  const scrolls = e => getComputedStyle(around(e)).overflowX == "auto";
  found[`${page} ${width}`] = {
    needed: root.scrollWidth, width: root.clientWidth, height: root.scrollHeight,
    code: [...d.querySelectorAll(".commands pre")].filter(wide).length,
    columns: [...d.querySelectorAll("article pre")].filter(e => !e.closest(".commands")).filter(
      e => ["whiteSpace", "overflowX", "maxHeight"].map(it => getComputedStyle(e)[it])
        != "pre,auto,none").length,
    broken: [...d.querySelectorAll("code .pre")].filter(
      e => !e.querySelector("wbr") && e.getClientRects().length > 1).map(e => e.textContent),
    hidden: [...d.querySelectorAll("pre, .table-wrapper, div.formula, div.figure")].filter(
      e => wide(e) && getComputedStyle(e).overflowX == "auto"
        && getComputedStyle(e).scrollbarWidth != "auto").length,
    pale: pale(d),
    rows: new Set([...d.querySelectorAll("table.rows tbody tr")].map(
      e => getComputedStyle(e).display)).values().toArray(),
    unnamed: [...d.querySelectorAll(
      "table.rows td:not(:first-child, .keys td:nth-child(2))")].filter(
      e => getComputedStyle(e).display == "block"
        && getComputedStyle(e, "::before").content == "none"
    ).map(e => e.textContent.trim().slice(0, 30)),
    stuck: [...d.querySelectorAll("table")].filter(
      e => e.getBoundingClientRect().right > article.right + 1 && !scrolls(e)).length,
    options: brokenOptions(d),
    sought: (SOUGHT[page] ?? []).map(words => [words, sought(d, words)]),
    squeezed: [...d.querySelectorAll("article td")].filter(
      e => getComputedStyle(e).display == "table-cell" && e.clientWidth < 130 && lines(d, e) > 7
    ).map(e => e.textContent.trim().slice(0, 30)),
    brackets: [...d.querySelectorAll("mtable + mo")].map(
      e => tall(e) / tall(e.previousElementSibling)),
    fields: d.querySelectorAll("input.filter").length, article: article.width,
  };
  frame.remove();
}
addEventListener("load", async () => {
  for (const page of pages) for (const width of [390, 1400]) await look(page, width);
  document.getElementById("found").textContent = JSON.stringify(found);
});
</script>"""


PUBLIC = [
    f"{package.__name__}.{name}" for package in (sblcosim, study, analysis, limits)
    for name in package.__all__ if not name.startswith("__")
]  # fmt: skip
SOUGHT = {
    "docs/reference/python.html": [*PUBLIC, "xyzzy"],
    "docs/reference/scenario.html": ["wave_height_m", "gps horizontal markov", "xyzzy"],
}
"""What is sought on the pages of the reference."""


def every_page_fits_narrow_and_wide_windows(site: Site) -> None:
    if BROWSER is None:
        return
    pages = sorted(path.relative_to(site.folder).as_posix() for path in site.pages)
    pages = [page for page in pages if page.startswith(("docs/", "models/", "orchestrator/"))]
    assert len(pages) > 60
    probe = PROBE.replace("PAGES", json.dumps(pages)).replace("WORDS", json.dumps(SOUGHT))
    (site.folder / "probe.html").write_text(probe, "utf-8")
    for scheme in (1, 0):  # light and dark
        fits(pages, site, scheme)


def fits(pages: list[str], site: Site, scheme: int) -> None:
    printed, _ = browse(
        site.folder, f"--blink-settings=preferredColorScheme={scheme}",
        "--virtual-time-budget=600000", "--dump-dom", "probe.html",
    )  # fmt: skip
    seen = json.loads(unescape(re.findall(r'<pre id="found">(.*?)</pre>', printed, re.DOTALL)[0]))
    assert len(seen) == 2 * len(pages)
    for name, it in seen.items():
        assert it["options"] == [], f"{name}: options that are broken"
        assert it["squeezed"] == [], f"{name}: texts in narrow columns"
        assert it["unnamed"] == [], f"{name}: cells without the name of their column"
        assert it["rows"] in ([], ["block" if it["width"] < 400 else "table-row"]), name
        assert it["broken"] == [], f"{name}: code that is broken within a word"
        assert it["hidden"] == 0, f"{name}: no bar to move by what is wider than its place"
        assert it["pale"] == [], f"{name}: text that can hardly be read"
        assert it["code"] == 0, f"{name}: commands that are cut off"
        assert it["needed"] <= it["width"], f"{name}: wider than the window"
        assert it["stuck"] == 0, f"{name}: a table that is cut off"
        assert it["columns"] == 0, f"{name}: columns of an output that are wrapped"
        if it["width"] > 400 and not name.startswith("docs/made"):
            assert it["article"] > 750, f"{name}: leaves the width unused"
    if mathematical_fonts():
        brackets = seen["models/receiver/coupled.html 1400"]["brackets"]
        assert len(brackets) > 3
        assert min(brackets) > 0.9
    scenario, narrow = (seen[f"docs/reference/scenario.html {width}"] for width in (1400, 390))
    assert scenario["height"] < 21000
    assert narrow["height"] < 35000
    assert narrow["rows"] == seen["models/platform/README.html 390"]["rows"] == ["block"]
    for page, words in SOUGHT.items():
        for width in (390, 1400):
            assert seen[f"{page} {width}"]["fields"] == 1
            finds_what_is_sought(seen[f"{page} {width}"]["sought"], words)


def finds_what_is_sought(found: list[tuple[str, list[str]]], words: list[str]) -> None:
    """Some of the names, and of a public name its definition."""
    assert [one for one, _ in found] == words
    for one, names in found:
        assert bool(names) == (one != "xyzzy"), one
        assert len(names) < 200, one
        module, _, name = one.rpartition(".")
        if one in PUBLIC and not isinstance(getattr(sys.modules[module], name), ModuleType):
            assert name in names, one


def mathematical_fonts() -> set[str]:
    """The fonts of formulas that are installed."""
    if shutil.which("fc-list") is None:
        return set()
    listed = subprocess.run(["fc-list", ":", "family"], capture_output=True, text=True, check=True)
    return {it for it in re.findall(r'"(.*?)"', FONTS) if it in listed.stdout}


def test_every_public_name_says_what_it_is() -> None:
    text = (DOCS / "reference" / "python.md").read_text("utf-8")
    rows = re.findall(r"^\| `(\w+)` \| *(.*?) *\|$", text, re.MULTILINE)
    assert len(rows) > 20
    assert [name for name, words in rows if not words] == []


def test_every_key_of_a_study_is_in_the_reference() -> None:
    text = (DOCS / "reference" / "study.md").read_text("utf-8")
    for table in (Definition, FactorTable, ConditionTable, DesignTable):
        for key in table.model_fields:
            assert f"\n| `{key}` |" in text, key


def test_every_response_is_in_the_reference() -> None:
    text = (DOCS / "reference" / "results.md").read_text("utf-8")
    named = set(re.findall(r"`([\w{}…]+)`", text))
    made = [name for name, *_ in more.rows("RESPONSES")]  # of these the site makes a table
    for response in RESPONSES.keys() - made:
        framed = re.sub(r"^(absolute|relative|own_relative)_", "{frame}_", response)
        axis = re.sub("_([xyz]|total)_", "_{axis}_", framed)
        length = re.sub("_(horizontal|total)_", "_{length}_", framed)
        assert {response, axis, length} & named, response
