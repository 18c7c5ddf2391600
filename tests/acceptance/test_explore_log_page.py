"""A recorded dive in the page of a scenario, in a real browser: dropped, changed and closed."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import BROWSER, Tab
from made_logs import made, written
from sblcosim import process
from sblcosim.explore.contents import contents
from sblcosim.explore.page import render, write_dive
from sblcosim.fmus.build import compiler
from sblcosim.logs.log import Log
from sblcosim.processing.dive import recorded_dive
from sblcosim.scenario.scenario import load

pytestmark = [
    pytest.mark.skipif(BROWSER is None, reason="needs Chromium"),
    pytest.mark.skipif(compiler.zig() is None, reason="needs ziglang"),
    pytest.mark.filterwarnings("ignore"),
]
RECEIVERS = ("coupled", "ekf")
HELPERS = """
const $ = (id) => document.getElementById(id);
const change = (control, value) => {
  control.value = value;
  for (const name of ["input", "change"]) control.dispatchEvent(new Event(name, { bubbles: true }));
};
const field = (path) => $("controls").querySelector(`[data-path="${path}"]`);
const settle = async () => { for (let i = 0; i < 4; i++) await frame(); };
const until = async (holds) => { for (let i = 0; i < 3000 && !holds(); i++) await sleep(20); };
const drop = async (id, name, text) => {
  const dataTransfer = new DataTransfer();
  dataTransfer.items.add(new File([text], name));
  $(id).dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true, cancelable: true }));
  await sleep(300);
  await settle();
};
const last = () => page.stage.run.receivers.map(({ label, position: p }) =>
  [label, p.x.length, p.x.at(-1), p.y.at(-1), p.z.at(-1)]);
const words = (id) => $(id).textContent;
const seen = (id) => $(id).checkVisibility();
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page, and the log of a dive with another GPS in another sea."""
    folder = tmp_path_factory.mktemp("log_page")
    told = contents(load("realistic-dive"), RECEIVERS, lanes=(2,))
    (folder / "page.html").write_text(render(told), "utf-8")
    keys = {"platform.gps_grade": "sbas", "time.duration_s": 60.0, "seed": 9}
    written(folder / "run", "realistic-dive", RECEIVERS, overrides=keys)
    return folder


def text_of(log: Log | Path, folder: Path) -> str:
    found = recorded_dive(log, RECEIVERS)
    return write_dive(found.scenario, folder / "dive.json", RECEIVERS, found).read_text()


@pytest.fixture
def browsing(folder: Path, tmp_path: Path) -> Iterator[Callable[..., Tab]]:
    """Open a page; in the end, it must not have complained."""
    tabs: list[Tab] = []

    def open_(file: Path = folder / "page.html", width: int = 1400, link: str = "") -> Tab:
        tab = Tab(tmp_path, width, 844 if width < 500 else 1000)
        tabs.append(tab)
        tab.open(file, link)
        return tab

    try:
        yield open_
        for tab in tabs:
            assert tab.complaints == []
    finally:
        for tab in tabs:
            tab.close()


def same_ends(found: list[Any], log: Log | Path, given: dict[str, Any]) -> None:
    expected = process(log, RECEIVERS, given)
    assert [it[0] for it in found] == [*expected.made]
    for label, count, *end in found:
        assert count == len(expected.made[label])
        np.testing.assert_array_equal(end, expected.made[label].position[-1], err_msg=label)


def test_a_dropped_dive_is_replayed_with_its_settings_until_it_is_closed(
    folder: Path, browsing: Callable[..., Tab]
) -> None:
    text = text_of(folder / "run" / "log", folder)
    shown = browsing().run(f"""{HELPERS}
      change(field("acoustics.loss_probability").querySelector("input[type=text]"), "0.4");
      await settle();
      const before = [page.explorer.link(), last()];
      await drop("map", "dive.json", {json.dumps(text)});
      const first = {{ last: last(), map: words("of-map"), command: words("log-command"),
        tables: words("log-tables"), said: words("log-said"), loss: page.explorer.value(
          "acoustics.loss_probability"), seen: [seen("draw"), seen("log-close"), seen("within")] }};
      change(field("acoustics.range_std_m").querySelector("input[type=text]"), "0.5");
      await settle();
      const second = {{ last: last(), command: words("log-command"), said: words("log-said"),
        tables: words("log-tables") }};
      $("reset-all").click();
      await settle();
      const third = {{ last: last(), said: words("log-said"), tables: words("log-tables") }};
      await until(() => words("so-far") === "400 dives");
      const verdict = words("within");
      $("log-close").click();
      await settle();
      return {{ before, first, second, third, verdict, after: [page.explorer.link(), last()],
        seen: [seen("draw"), seen("log-close")], map: words("of-map"),
        tables: seen("log-tables") }};
    """)
    log = folder / "run" / "log"
    same_ends(shown["first"]["last"], log, {})
    same_ends(shown["second"]["last"], log, {"acoustics.range_std_m": 0.5})
    assert shown["second"]["said"].endswith("settings changed here: acoustics.range_std_m")
    assert shown["third"] == {it: shown["first"][it] for it in ("last", "said", "tables")}
    changed = process(log, RECEIVERS, {"acoustics.range_std_m": 0.5}).receivers.loc["coupled"]
    found = f"coupled{changed.total_p95_m:.1f} m{changed.total_rms_m:.1f} m"
    assert found in shown["second"]["tables"]
    assert shown["second"]["tables"] != shown["first"]["tables"]
    assert shown["first"]["map"] == "The recorded dive: A realistic dive"
    assert shown["first"]["loss"] == 0.25
    assert shown["first"]["seen"] == [False, True, True]
    assert "those of the log's own scenario" in shown["first"]["said"]
    row = process(log, RECEIVERS).receivers.loc["coupled"]
    assert f"coupled{row.total_p95_m:.1f} m{row.total_rms_m:.1f} m" in shown["first"]["tables"]
    assert "beacon 4" in shown["first"]["tables"]
    start = f"sblcosim process {log}"
    assert shown["first"]["command"] == f"{start} --receiver coupled --receiver ekf"
    assert shown["second"]["command"].startswith(f"{start} --set acoustics.range_std_m=0.5 ")
    assert shown["verdict"].endswith(" m")
    assert shown["after"] == shown["before"]
    assert shown["seen"] == [True, False]
    assert shown["map"] == "One dive"
    assert shown["tables"] is False


def test_what_is_no_dive_is_refused_beside_the_control_and_changes_nothing(
    folder: Path, browsing: Callable[..., Tab]
) -> None:
    good = text_of(made(seconds=60), folder)
    files = {"receptions.csv": "a,b\n1,2\n", "dive.json": good.replace('"data": "', '"data": "A')}
    shown = browsing().run(f"""{HELPERS}
      await until(() => words("so-far") === "400 dives");
      const before = [page.explorer.toml(), page.stage.run, words("within")], told = [];
      for (const [name, text] of Object.entries({json.dumps(files)})) {{
        await drop("log", name, text);
        told.push([words("log-problem"), seen("log-problem"), page.explorer.toml() === before[0],
          page.stage.run === before[1], words("within") === before[2], words("of-map")]);
      }}
      await drop("map", "path.csv", "north_m,east_m,down_m\\n0,0,2\\n9,9,2\\n");
      const path = page.explorer.pathPoints;
      await drop("log", "good.json", {json.dumps(good)});
      change(field("time.ekf_ratio").querySelector("input[type=text]"), "2");
      await settle();
      return {{ told, path, after: [seen("log-problem"), words("of-map")] }};
    """)
    for name, (sentence, *rest) in zip(files, shown["told"], strict=True):
        assert sentence.startswith(f"{name}: must be a recorded dive as 'sblcosim explore --log")
        assert rest == [True, True, True, True, "One dive"]
    assert shown["path"] == [[0, 0, 2], [9, 9, 2]]
    assert shown["after"] == [False, "The recorded dive: made"]


def test_a_page_of_a_dive_takes_the_settings_of_a_link_and_comes_back_to_its_dive(
    folder: Path, browsing: Callable[..., Tab], tmp_path: Path
) -> None:
    log = folder / "run" / "log"
    found = recorded_dive(log, RECEIVERS)
    told = contents(found.scenario, RECEIVERS, lanes=(2,), dive=found)
    (tmp_path / "page.html").write_text(render(told), "utf-8")
    other = text_of(made(seconds=60), folder)
    given = {"acoustics.range_std_m": 0.5}
    shown = browsing(tmp_path / "page.html", link=json.dumps({"given": given})).run(f"""{HELPERS}
      await settle();
      const before = last();
      await drop("log", "dive.json", {json.dumps(other)});
      const dropped = [words("of-map"), seen("within")];
      $("log-close").click();
      await settle();
      const after = last();
      $("log-close").click();
      await settle();
      return {{ before, dropped, after, link: page.explorer.link(),
        end: [words("of-map"), seen("log-close"), seen("within")] }};
    """)
    same_ends(shown["before"], log, given)
    assert shown["dropped"] == ["The recorded dive: made", False]
    assert shown["after"] == shown["before"]
    assert "range_std_m" in shown["link"]
    assert shown["end"] == ["One dive", False, True]


@pytest.mark.parametrize("width", [390, 900, 1400])
def test_a_page_of_a_log_without_scenario_and_truth_shows_only_that(
    width: int, browsing: Callable[..., Tab], tmp_path: Path
) -> None:
    log = made(truth=False, seconds=100)
    found = recorded_dive(log, RECEIVERS)
    told = contents(found.scenario, RECEIVERS, lanes=(2,), dive=found)
    (tmp_path / "page.html").write_text(render(told), "utf-8")
    shown = browsing(tmp_path / "page.html", width).run(f"""{HELPERS}
      await settle();
      return {{ last: last(), map: words("of-map"), errors: words("of-errors"),
        seen: [seen("within"), seen("causes"), seen("histogram"), seen("log-close"), seen("seed")],
        tables: words("log-tables"), others: words("log-others"),
        wide: document.documentElement.scrollWidth, most: innerWidth }};
    """)
    same_ends(shown["last"], log, {})
    assert shown["seen"] == [False] * 5
    assert shown["errors"] == "What is claimed over time"
    assert "coupled, ekf" in shown["tables"]
    assert "0.000 ± 0.000" not in shown["tables"]  # the depth of raw is that of the log
    assert "sblcosim identify LOG" in shown["others"]
    assert shown["wide"] <= shown["most"]
