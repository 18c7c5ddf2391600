"""The page in which a scenario is explored, in a real browser without a network.

Skipped where there is no Chromium or no compiler for WebAssembly.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import sblcosim
from browser import BROWSER, FIREFOX, Fox, Tab
from explored import values
from quick import few
from sblcosim.comparison.many.run import run_many
from sblcosim.errors import SblcosimError
from sblcosim.explore.contents import contents
from sblcosim.explore.page import render
from sblcosim.fmus.build import compiler
from sblcosim.models.settings.presets import DECLARED, preset
from sblcosim.scenario.error_sources import SOURCES
from sblcosim.scenario.scenario import load
from sblcosim.tracks.place import Origin

pytestmark = [
    pytest.mark.skipif(BROWSER is None, reason="needs Chromium"),
    pytest.mark.skipif(compiler.zig() is None, reason="needs ziglang"),
    pytest.mark.filterwarnings("ignore"),
]
NAME, DIVES = "realistic-dive", 100
HELPERS = """
const $ = (id) => document.getElementById(id);
const all = (selector) => [...document.querySelectorAll(selector)];
const change = (control, value) => {
  if (control.type === "checkbox") control.checked = value; else control.value = value;
  for (const name of ["input", "change"]) control.dispatchEvent(new Event(name, { bubbles: true }));
};
const field = (path) => $("controls").querySelector(`[data-path="${path}"]`);
const found = (path) => { change($("search"), path.split(".")[1].replaceAll("_", " "));
  return $("found").querySelector(`[data-path="${path}"]`); };
const settle = async () => { await frame(); await frame(); };
const until = async (holds) => { for (let i = 0; i < 3000 && !holds(); i++) await sleep(20); };
const computed = () => until(() => !document.body.classList.contains("computing"));
"""
GPX = """<gpx><trk><trkseg>
<trkpt lat="42.5" lon="14.2"><ele>-3</ele></trkpt>
<trkpt lat="42.5003" lon="14.2"></trkpt>
<trkpt lat="42.5003" lon="14.1996"><ele>-7.5</ele></trkpt>
</trkseg></trk></gpx>"""


@pytest.fixture(scope="module")
def told() -> Mapping[str, Any]:
    return contents(load(NAME), ("coupled", "ekf"), lanes=(2,))


@pytest.fixture(scope="module")
def page(told: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("explore") / "explore.html"
    file.write_text(render(told), "utf-8")
    return file


@pytest.fixture
def browsing(page: Path, tmp_path: Path) -> Iterator[Callable[..., Tab]]:
    """Open a page in a browser; in the end, it must not have complained, nor asked for more."""
    tabs: list[Tab] = []

    def open_(link: str = "", width: int = 1400, file: Path = page, **options: bool) -> Tab:
        tab = Tab(tmp_path, width, 844 if width < 500 else 1000, **options)
        tabs.append(tab)
        tab.open(file, link.removeprefix("#"))
        return tab

    try:
        yield open_
        for tab in tabs:
            assert tab.complaints == []
            asked = {it.partition("#")[0] for it in tab.asked if not it.startswith("blob:")}
            assert asked == {page.as_uri()}
    finally:
        for tab in tabs:
            tab.close()


def test_what_is_shown_are_the_numbers_of_the_command_line(
    browsing: Callable[..., Tab], tmp_path: Path
) -> None:
    """Settings changed by hand: the verdict, the histogram's dives and the dive on the map."""
    shown = browsing().run(f"""{HELPERS}
      change($("count"), "{DIVES}");
      const before = $("within").textContent;
      change(field("acoustics.range_std_m").querySelector("input[type=range]"), 12);
      change(field("platform.gps_grade").querySelector("select"), "sbas");
      change(field("target.speed_m_s").querySelector("input[type=text]"), "0.55");
      change($("seed"), "11");
      await settle();
      await until(() => $("so-far").textContent === "{DIVES} dives");
      const [receiver] = page.stage.run.receivers, last = receiver.epoch.length - 1;
      return {{ before, toml: page.explorer.toml(), command: $("command").textContent,
        within: $("within").textContent, half: $("half").textContent,
        compared: all("#compared [data-receiver]").map((it) => [it.dataset.receiver,
          ...[...it.querySelectorAll("td")].map((cell) => cell.textContent)]),
        best: [$("best").textContent, $("best-note").textContent], holds: $("holds").textContent,
        blue: all("#controls .changed").map((it) => it.dataset.path), which: $("which").textContent,
        map: $("map").getAttribute("aria-label"),
        last: ["x", "y", "z"].map((k) => receiver.position[k][last]) }};
    """)
    file = tmp_path / "scenario.toml"
    file.write_text(shown["toml"])
    assert shown["command"].startswith("sblcosim run ")
    assert "--receiver coupled --receiver ekf" in shown["command"]
    assert "11" in shown["which"]
    result = sblcosim.run(file, ["coupled", "ekf"])
    assert result.scenario.seed == 11
    np.testing.assert_array_equal(result.judged["coupled"].estimates.position[-1], shown["last"])
    many = run_many(load(file), ("coupled", "ekf"), runs=DIVES)
    assert shown["within"] == f"{many.within_m['coupled']:.1f} m" != shown["before"]
    assert shown["holds"] == "holds"
    compared = {name: cells for name, *cells in shown["compared"]}
    rms = {it: many.runs.table[f"{it}.absolute_total_rms_m"] for it in ("coupled", "ekf")}
    for name, claim in (("coupled", "holds"), ("ekf", "too small")):
        row = many.runs.level(NAME, name)
        counts = [f"{row[it]} of {DIVES}" if row[it] else "none" for it in ("lost", "misleading")]
        assert compared[name][0] == f"{many.within_m[name]:.1f} m"
        assert compared[name][2:5] == [claim, *counts]
    better = int((rms["ekf"] < rms["coupled"]).sum())
    assert compared["ekf"][5] == (f"{better} of {DIVES}" if better else "none")
    assert shown["best"] == ["coupled", f"better than ekf in {DIVES - better} of {DIVES} dives"]
    assert {*shown["blue"]} >= {
        "acoustics.range_std_m", "platform.gps_grade", "platform.gps_horizontal_markov_std_m",
        "target.speed_m_s",
    }


SHORT = json.dumps({"receivers": ["ekf"], "given": {"target.waypoint_m": [5, -5, 4, 5, 5, 4]}})
"""A dive of one leg, so that it takes little time."""


def test_the_verdict_before_a_change_is_beside_the_new_one(browsing: Callable[..., Tab]) -> None:
    tab = browsing(SHORT)
    shown = tab.run(f"""{HELPERS}
      const done = () => until(() => $("so-far").textContent === "{DIVES} dives");
      change($("count"), "{DIVES}");
      await computed();
      const told = () => [$("within").textContent, $("was").textContent,
        $("before").hidden || getComputedStyle($("before")).visibility === "hidden"];
      const seen = {{ first: told() }};
      const set = async (name, act) => {{
        act();
        await settle();
        seen[`${{name}} at once`] = told();
        await done();
        seen[name] = told();
      }};
      const type = (path, text) => change(field(path).querySelector("input[type=text]"), text);
      await set("noise", () => type("acoustics.range_std_m", "3"));
      await computed();
      seen.told = $("told").textContent;
      await set("grade", () => change(
        field("platform.gps_grade").querySelector("select"), "rtk_fixed"));
      await set("several", () => {{
        type("acoustics.range_std_m", "0.1");
        type("acoustics.loss_probability", "0.5");
        page.explorer.unset("platform.gps_grade");
        page.explorer.setArms([[4, 0, 1], [0, 4, 1], [-4, 0, 1], [0, -4, 1]]);
        change($("seed"), "9");
      }});
      await set("receiver", () => change($("main-receiver"), "coupled"));
      await set("refused", () => type("acoustics.loss_probability", "7"));
      return seen;
    """)
    first = shown["first"]
    assert first[1:] == ["", True]
    assert shown["noise at once"][1:] == ["", True]  # what is seen beside it is of before
    assert shown["noise"][1:] == [f"was {first[0]} with range noise 0.1 m", False]
    assert shown["noise"][0] != first[0]
    assert f"it was {first[0]} with range noise 0.1 m." in shown["told"]
    assert shown["grade"][1] == f"was {shown['noise'][0]} with GPS as given"
    within = shown["grade"][0]
    assert shown["several"][1].startswith(f"was {within} with GPS RTK, fixed, range noise 3 m and ")
    assert shown["several"][1].endswith(" 3 other settings")
    assert shown["receiver"][1] == f"was {shown['several'][0]} with ekf"
    assert shown["refused"][1:] == [shown["receiver"][1], False]


def test_a_change_is_undone(browsing: Callable[..., Tab]) -> None:
    """By keys; undoing is a change, too."""
    tab = browsing(SHORT)
    before, within = tab.run(f"""{HELPERS}
      change($("count"), "{DIVES}");
      await until(() => $("so-far").textContent === "{DIVES} dives");
      return [page.explorer.link(), $("within").textContent];
    """)
    changed = tab.run(f"""{HELPERS}
      change(field("platform.gps_grade").querySelector("select"), "standalone");
      await settle();
      await until(() => $("so-far").textContent === "{DIVES} dives");
      $("undo-change").focus();
      return [page.explorer.link(), $("within").textContent];
    """)
    undone = f"""{HELPERS}
      const focus = document.activeElement.id;
      await settle();
      await until(() => $("so-far").textContent === "{DIVES} dives");
      const told = [page.explorer.link(), $("within").textContent, $("was").textContent, focus];
      $("undo-change").focus();
      return told;
    """
    tab.key("Enter")
    was = f"was {changed[1]} with GPS Standalone"
    assert tab.run(undone) == [before, within, was, "verdict"]
    tab.key("Enter")
    assert tab.run(undone)[:2] == changed


def test_one_line_of_the_verdict_stays_in_sight(browsing: Callable[..., Tab]) -> None:
    """It covers neither much of a phone nor what has the focus."""
    shown = browsing(SHORT, width=390, touch=True).run(f"""{HELPERS}
      change($("count"), "{DIVES}");
      await computed();
      const line = $("glance"), first = line.hidden, more = {{}};
      change(field("acoustics.range_std_m").querySelector("input[type=text]"), "3");
      scrollTo(0, document.documentElement.scrollHeight);
      await until(() => !line.hidden && $("was").textContent);
      field("acoustics.range_std_m").querySelector("input[type=text]").focus();
      await settle();
      const box = line.getBoundingClientRect();
      const under = document.activeElement.getBoundingClientRect();
      const told = [line.textContent, $("within").textContent, $("was").textContent];
      scrollTo(0, 0);
      await until(() => line.hidden);
      return {{ first, top: box.top, height: box.height, under: under.top, told,
        end: line.hidden, read: line.getAttribute("aria-hidden") }};
    """)
    assert [shown["first"], shown["end"], shown["read"]] == [True, True, "true"]
    assert shown["top"] == 0
    assert 20 < shown["height"] < 0.06 * 844
    assert shown["under"] >= shown["height"]
    line, within, was = shown["told"]
    assert line.split() == ["95", "%", "within", *within.split(), *was.split(), "ekf"]


def test_controls_causes_and_devices_have_the_same_names(browsing: Callable[..., Tab]) -> None:
    """A control of a source of error has its name, or one that begins with it."""
    shown = browsing().run(f"""
      const {{ causeOf, deviceOf }} = modules.explore_names;
      const sources = {json.dumps({it.name: [
          [*level] for part in it.parts for level in part.better.items()]
          for it in SOURCES.values()})};
      return {{ controls: page.fields.map(({{ path, name }}) => [path, name]),
        causes: Object.keys(sources).map((it) => [it, causeOf(it)]),
        devices: Object.entries(sources).filter(([, levels]) => levels.length).map(
          ([it, levels]) => deviceOf(it, levels.map(
            ([word, to]) => ({{ word, to, from: 3 * to }})))) }};
    """)
    names, controls = dict(shown["causes"]), dict(shown["controls"])
    assert len({*names.values()}) == len(names)
    assert all(it[0].isupper() for it in names.values())
    compared = 0
    for source in SOURCES.values():
        keys = {key for part in source.parts for key in part.keys}
        for path, name in controls.items():
            table, _, key = path.partition(".")
            # The keys of an IMU are of two sources, heading and tilt.
            presets = DECLARED[key].values if key in DECLARED and key != "imu_grade" else ()
            own = {path, *(f"{table}.{it}" for value in presets for it in preset(key, value))}
            if own & keys:
                assert name.partition(", ")[0] == names[source.name], path
                compared += 1
    assert compared > 8
    for it in shown["devices"]:
        assert it["device"]
        assert "undefined" not in f"{it}"
        assert len({*it["device"].split(", ")}) == len(it["device"].split(", "))
    noise = {"device": "a better range measurement", "detail": "noise 0.02 m instead of 0.06 m"}
    assert noise in shown["devices"]


def test_a_receiver_keeps_its_colour(browsing: Callable[..., Tab]) -> None:
    """Whichever others are shown, and whichever is the diver's."""
    shown = browsing(SHORT).run(f"""{HELPERS}
      const looks = [];
      for (const some of [["ekf"], ["coupled", "ekf"], ["coupled"], ["ekf", "coupled"]]) {{
        page.receivers.choose(some);
        await settle();
        looks.push(...page.stage.run.receivers.map(({{ label, colour, dash }}) =>
          [label, JSON.stringify([colour, dash])]));
      }}
      return looks;
    """)
    assert len(shown) == 6 + 4
    assert len({tuple(it) for it in shown}) == 3
    assert len({look for _, look in shown}) == 3


def test_lengths_have_two_digits_down_to_millimetres(browsing: Callable[..., Tab]) -> None:
    texts = browsing().run("""
      const { length } = modules.explore_phrases;
      return [0, 1e-5, 0.0042, 0.0417, 0.417, 0.996, 4.17, 99.4, 123.4, 2e4, NaN].map(length);
    """)
    assert texts == ["0 m", "under 1 mm", "0.004 m", "0.042 m", "0.42 m", "1.0 m", "4.2 m",
                     "99.4 m", "123 m", "more than 10 km", "–"]


BITS = """
const bits = (it) => {
  const bytes = new Uint8Array(it.buffer, it.byteOffset, it.byteLength);
  let text = "";
  for (let i = 0; i < bytes.length; i += 8192)
    text += String.fromCharCode(...bytes.subarray(i, i + 8192));
  return btoa(text);
};
"""


@pytest.mark.skipif(FIREFOX is None, reason="needs Firefox")
def test_firefox_gives_the_bits_of_the_command_line(page: Path, tmp_path: Path) -> None:
    """From a file, with workers: the record of a dive and the errors of many, and pictures."""
    fox = Fox(tmp_path)
    try:
        fox.open(page)
        shown = fox.run(f"""{HELPERS} {BITS}
          change($("count"), "{DIVES}");
          change(field("platform.gps_grade").querySelector("select"), "sbas");
          change($("seed"), "11");
          await settle();
          await until(() => $("so-far").textContent === "{DIVES} dives");
          const {{ receivers }} = page.summary, {{ values }} = page.explorer.record();
          const drawn = (id) => new Set($(id).getContext("2d").getImageData(
            0, 0, $(id).width, $(id).height).data).size;
          return {{ toml: page.explorer.toml(), within: $("within").textContent,
            best: $("best").textContent,
            record: Object.fromEntries(Object.entries(values).map(([key, it]) => [key, bits(it)])),
            each: Object.fromEntries(Object.entries(receivers).map(([key, {{ each }}]) => [key, [
              bits(Float64Array.from(each.rms)), bits(Float64Array.from(each.p95))]])),
            colours: ["map", "errors", "histogram"].map(drawn), problem: $("problem").textContent,
            wide: document.documentElement.scrollWidth <= innerWidth }};
        """)
    finally:
        fox.close()
    file = tmp_path / "scenario.toml"
    file.write_text(shown["toml"])
    record = sblcosim.run(file, ["coupled", "ekf"]).record.values
    assert shown["record"].keys() == record.keys()
    for name, expected in record.items():
        np.testing.assert_array_equal(values(shown["record"][name], expected), expected, name)
    many = run_many(load(file), ("coupled", "ekf"), runs=DIVES)
    for name in ("coupled", "ekf"):
        for found, kind in zip(shown["each"][name], ("rms", "p95"), strict=True):
            expected = many.runs.table[f"{name}.absolute_total_{kind}_m"].to_numpy()
            np.testing.assert_array_equal(values(found, expected), expected)
    assert shown["within"] == f"{many.within_m['coupled']:.1f} m"
    assert shown["best"] == "coupled"
    assert min(shown["colours"]) > 20
    assert shown["problem"] == ""
    assert shown["wide"]


def test_receivers_are_compared_and_chosen_where_they_are_compared(
    browsing: Callable[..., Tab]
) -> None:
    """In the end a dive of 8 s: no receiver is called the best without a reason."""
    shown = browsing(json.dumps({"receivers": ["ekf"]})).run(f"""{HELPERS}
      change($("count"), "{DIVES}");
      await settle();
      await until(() => $("so-far").textContent === "{DIVES} dives");
      const row = (name) => document.querySelector(`#compared [data-receiver=${{name}}]`);
      const told = () => [page.explorer.receivers, all("#compared [data-receiver]").filter(
        (it) => it.querySelector("td").textContent).map((it) => it.dataset.receiver),
        $("main-receiver").value, row("coupled").classList.contains("own"),
        $("best-note").textContent];
      const alone = told();
      change(row("coupled").querySelector("input"), true);
      await settle();
      await until(() => $("so-far").textContent === "{DIVES} dives");
      const two = told();
      row("coupled").querySelector("button").click();
      await settle();
      const used = [...told(), document.activeElement.getAttribute("aria-label")];
      change(field("platform.gps_grade").querySelector("select"), "rtk_fixed");
      page.explorer.apply({{ given: {{ "time.duration_s": 8 }} }});
      page.changed();
      await settle();
      await until(() => $("so-far").textContent === "{DIVES} dives");
      return {{ alone, two, used, words: $("words-lost").textContent,
        explained: all("#compared .note").every((it) => it.textContent.length > 20),
        short: [$("best").textContent, $("best-note").textContent] }};
    """)
    assert shown["alone"][:4] == [["ekf"], ["ekf", "raw"], "ekf", False]
    assert shown["alone"][4].endswith(f"of {DIVES} dives (not tried: coupled)")
    assert shown["two"][:4] == [["ekf", "coupled"], ["ekf", "coupled", "raw"], "ekf", False]
    assert shown["two"][4].endswith(f"of {DIVES} dives")
    assert shown["used"][0] == ["coupled", "ekf"]
    assert shown["used"][2:4] == ["coupled", True]
    assert shown["used"][5] == "Use ekf"
    assert shown["explained"]
    assert "in its last quarter" in shown["words"]
    assert shown["short"] == ["coupled or ekf", "no difference that is clear of chance"]


@pytest.mark.slow
@pytest.mark.parametrize("width", few([1400, 390], quick=[390]))
def test_receivers_for_other_beacons_are_doubted(browsing: Callable[..., Tab], width: int) -> None:
    before, after, seen = browsing(width=width).run(f"""{HELPERS}
      change($("count"), "{DIVES}");
      await computed();
      const doubt = document.querySelector("[data-doubt=coupled]");
      const before = doubt.textContent;
      page.explorer.apply({{ given: {{ "platform.gps_shared": false }} }});
      page.changed();
      await until(() => doubt.textContent);
      return [before, doubt.textContent, doubt.checkVisibility()];
    """)
    assert before == ""
    assert after.startswith("For beacons on one platform, which share the errors of its GPS and")
    assert "here each buoy has its own GPS" in after
    assert seen


@pytest.mark.slow
def test_what_is_possible_is_beside_errors_of_the_same_kind(
    browsing: Callable[..., Tab], tmp_path: Path
) -> None:
    """RMS errors of the first dives: what is possible, and what receivers have."""
    shown = browsing().run(f"""{HELPERS}
      change($("count"), "{DIVES}");
      change(field("acoustics.loss_probability").querySelector("input[type=text]"), "0.6");
      await settle();
      await computed();
      const shown = ["possible", "reached", "reach", "told"].map((id) => [id, $(id).textContent]);
      return {{ toml: page.explorer.toml(), ...Object.fromEntries(shown) }};
    """)
    (tmp_path / "scenario.toml").write_text(shown["toml"])
    scenario = load(tmp_path / "scenario.toml")
    assert scenario.acoustics.loss_probability == 0.6
    squares = [
        sblcosim.run(scenario.override({"seed": scenario.seed + i}), ["coupled", "ekf"])
        .verdicts["coupled"].absolute_rms ** 2 for i in range(8)
    ]  # fmt: skip
    best = np.mean(squares) ** 0.5
    many = run_many(scenario, ("coupled", "ekf"), runs=8).runs
    rms = {it: many.level(NAME, it)["rms_over_runs"] for it in ("coupled", "ekf")}
    assert shown["possible"] == f"{best:.1f} m"
    has = f"coupled has {rms['coupled']:.1f} m in the first 8 dives"
    assert shown["reached"] == f"RMS error of a perfect receiver; {has}"
    assert (
        f"RMS error of about {best:.1f} m. There, coupled has {rms['coupled']:.1f} m, "
        f"ekf {rms['ekf']:.1f} m and raw"
    ) in shown["reach"]
    assert shown["told"].endswith(shown["reach"])


REACHED = (
    ({"platform.mounting_std_m": 0.5}, "2.1 m", "leaves out where the beacons are mounted; with"),
    ({"platform.arm_length_m": 0.05, "target.speed_m_s": 1.0}, "none",
     "places all around the platform fit."),
    ({"acoustics.ranging": "inverted", "acoustics.common_clock": False,
      "platform.arm_length_m": 0.3}, "none", "without a common clock, only the bearing is known"),
    ({"acoustics.loss_probability": 1.0}, "–", "and coupled has none."),
    ({"time.duration_s": 25_000.0}, "–", "for dives of up to 40,000 instants and estimates."),
)  # fmt: skip
"""Keys, and what a page then shows."""


@pytest.mark.slow
def test_a_page_says_why_nothing_is_possible(browsing: Callable[..., Tab]) -> None:
    tab = browsing()
    for given, figure, words in REACHED:
        found = tab.run(f"""{HELPERS}
          page.explorer.reset();
          const refused = page.explorer.apply({{ given: {json.dumps(given)} }});
          $("reach").textContent = "…";
          page.changed();
          await settle();
          await until(() => $("reach").textContent !== "…");
          return [refused, $("possible").textContent, $("reach").textContent];
        """)
        assert found[:2] == [None, figure], (given, found)
        assert words in found[2], found


def test_what_limits_the_receiver_and_what_to_buy_first_are_those_of_its_causes(
    browsing: Callable[..., Tab]
) -> None:
    """A dive of one leg, so that it takes little time; with a GPS that decides everything."""
    shown = browsing(json.dumps({"given": {
        "target.waypoint_m": [5, -5, 4, 5, 5, 4], "platform.gps_horizontal_markov_std_m": 9.0,
    }})).run(f"""{HELPERS}
      change($("count"), "{DIVES}");
      await computed();
      const rows = all("#causes li").map((it) => [
        ...[...it.querySelectorAll("b")].slice(0, 2).map((b) => b.textContent), it.textContent]);
      const within = parseFloat($("within").textContent);
      change(field("platform.gps_grade").querySelector("select"), "rtk_fixed");
      await settle();
      await computed();
      return {{ rows, buy: $("buy").textContent, within, told: $("told").textContent,
        note: $("causes-note").textContent }};
    """)
    assert shown["rows"][0][0] == "GPS"
    assert float(shown["rows"][0][1].strip("− %")) > 50
    assert "RTK GPS" in shown["rows"][0][2]
    assert shown["within"] > 5
    assert "RTK GPS" not in shown["buy"]  # it is bought
    assert shown["buy"] in shown["told"]
    assert "128 dives each" in shown["note"]


@pytest.mark.slow
def test_water_is_computed_where_one_looks_and_told_from_a_limit(
    browsing: Callable[..., Tab]
) -> None:
    """Zoomed out, they grow; zoomed in, they get finer; a little changes nothing.

    Colours of settings that have changed are said to be old, until they are computed again.
    """
    shown = browsing(json.dumps({"receivers": ["ekf"]})).run(f"""{HELPERS}
      const pictured = () => {{
        const {{ width, height }} = $("map");
        const pen = new OffscreenCanvas(width, height).getContext("2d");
        pen.drawImage($("map"), 0, 0);
        const data = pen.getImageData(0, 0, width, height).data, found = new Set();
        for (let i = 0; i < data.length; i += 4 * 97) found.add(data.slice(i, i + 3).join());
        return found.size;
      }};
      const done = async () => {{
        await until(() => / depth$/.test($("water-words").textContent));
        const {{ north, east, size }} = page.water.cells;
        return [north[0] - size / 2, north.at(-1) + size / 2, east[0] - size / 2,
          east.at(-1) + size / 2, size];
      }};
      const before = pictured();
      const seen = () => {{
        const {{ view }} = page.stage, [south, west] = view.under(0, view.height);
        const [north, east] = view.under(view.width, 0);
        return [south, north, west, east];
      }};
      const colours = () => {{ const found = new Set(); const pen = {{ save() {{}}, restore() {{}},
        beginPath() {{}}, moveTo() {{}}, lineTo() {{}}, closePath() {{}}, stroke() {{}},
        fill() {{ found.add(this.fillStyle); }} }};
        page.stage.state.under(pen, page.stage.view); return found.size; }};
      $("colour").click();
      const first = await done(), many = colours(), cells = page.water.cells.values;
      const coloured = [before, pictured(), $("colour").getAttribute("aria-pressed"),
        $("water-scale").hidden, cells.length, cells.filter(Number.isFinite).length];
      const {{ values }} = page.water.cells, limit = [...values].sort((a, b) => a - b)[
        values.length >> 1].toFixed(1);
      change($("water-limit"), limit.replace(".", ","));
      const two = [colours(), $("water-words").textContent,
        values.filter((it) => it <= limit).length / values.length,
        page.stage.state.under.legend.map((it) => it.label), limit];
      change($("water-limit"), "-1");
      const wrong = [$("water-problem").textContent, $("water-limit").getAttribute("aria-invalid"),
        colours()];
      change($("water-limit"), "");
      const none = [colours(), $("water-problem").hidden];
      page.stage.view.magnify(1.3);
      page.stage.drawMap();
      await sleep(600);
      const near = await done();
      for (let i = 0; i < 4; i++) $("farther").click();
      await until(() => /computing|done/.test($("water-words").textContent));
      const wide = await done(), view = seen();
      for (let i = 0; i < 6; i++) $("nearer").click();
      await until(() => page.water.grid.size < wide[4]);
      const fine = page.water.grid.size;
      await done();
      const known = page.water.cells.values;
      change(field("acoustics.range_std_m").querySelector("input[type=text]"), "0.2");
      await settle();
      const old = [$("water-words").textContent, page.water.cells.values === known,
        $("colour").getAttribute("aria-pressed")];
      await done();
      const again = [page.water.cells.values.length, page.water.cells.values === known];
      change(field("acoustics.range_std_m").querySelector("input[type=text]"), "0.3");
      await until(() => page.water.grid); // coloured again, and interrupted by other dives
      change($("count"), "{DIVES}");
      await done();
      page.explorer.apply({{ given: {{ "acoustics.water_depth_m": 9 }} }});
      page.changed();
      await settle();
      $("colour").click();
      return {{ first, coloured, many, two, wrong, none, near, wide, view, fine, old, again,
        after: [page.stage.state.under, $("colour").getAttribute("aria-pressed"),
          $("water-scale").hidden] }};
    """)
    before, pictured, *rest, n, known = shown["coloured"]
    assert pictured > 2 * before
    assert rest == ["true", False]
    assert known == n > 100
    assert shown["many"] > 20
    assert shown["two"][0] == 2
    within = shown["two"][2]
    assert 0 < within < 1
    assert shown["two"][1].startswith(f"{100 * within:.0f} % of the water shown is within it")
    assert shown["two"][3][-2:] == [f"95 % error within {shown['two'][4]} m", "beyond"]
    assert shown["wrong"] == ["limit: must be a number above 0, got '-1'", "true", 2]
    assert shown["none"] == [shown["many"], True]
    assert shown["near"] == shown["first"]
    south, north, west, east, size = shown["wide"]
    assert size > 2 * shown["first"][4]
    np.testing.assert_allclose([south, north, west, east], shown["view"], atol=size)
    assert shown["fine"] < size / 2
    assert shown["old"][0].startswith("out of date")
    assert shown["old"][1:] == [True, "true"]
    assert shown["again"][0] > 100
    assert not shown["again"][1]
    assert shown["after"] == [None, "false", True]


@pytest.mark.slow
def test_water_by_what_is_possible(browsing: Callable[..., Tab]) -> None:
    """With the same limit, legend and words; of a boat under way there is a sentence."""
    shown = browsing(SHORT).run(f"""{HELPERS}
      const done = async () => {{
        await until(() => page.water.cells && page.water.cells.done === page.water.cells.n);
        return [$("water-words").textContent, [...page.water.cells.values]];
      }};
      const legend = () => page.stage.state.under.legend.map((it) => it.label);
      $("colour").click();
      const seen = {{ label: $("water-what").labels.length, error: await done() }};
      change($("water-what"), "possible");
      seen.possible = await done();
      seen.legend = legend();
      change($("water-limit"), "2.5");
      seen.limit = [$("water-words").textContent, legend()];
      const {{ cells }} = page.water;
      page.water.take({{ ...cells, values: cells.values.map((it, i) => i % 2 ? Infinity : it) }});
      seen.none = $("water-words").textContent;
      change(field("acoustics.range_std_m").querySelector("input[type=text]"), "2");
      await settle();
      seen.old = $("water-words").textContent;
      await until(() => !page.water.isOld);
      seen.again = await done();
      page.explorer.set("platform.boat_speed_m_s", 0.5);
      page.changed();
      await until(() => $("water-words").textContent.startsWith("a boat"));
      seen.boat = [$("water-words").textContent, page.water.cells];
      return seen;
    """)
    assert shown["label"] == 1
    assert shown["error"][0].startswith("95 % error of ekf at ")
    words, values = shown["possible"]
    assert words.startswith("95 % error of a perfect receiver at ")
    assert np.mean(np.array(values) < shown["error"][1]) > 0.9
    assert all(it.startswith("possible 95 % error ") for it in shown["legend"])
    share = 100 * np.mean(np.array(values) <= 2.5)
    assert shown["limit"][0].startswith(f"{share:.0f} % of the water shown is within it: 95 % ")
    assert shown["limit"][1] == ["possible 95 % error within 2.5 m", "beyond"]
    assert "no accuracy in 50 % of it" in shown["none"]
    assert shown["old"].startswith("out of date")
    assert np.mean(np.array(shown["again"][1]) > values) > 0.9
    assert shown["boat"] == [
        "a boat under way leaves every place, so no place has an error of its own", None]


@pytest.mark.slow
def test_what_is_possible_is_computed_by_workers(browsing: Callable[..., Tab]) -> None:
    """Not by the page; work of a worker that ends is done again, with the same numbers."""
    shown = browsing(SHORT).run(f"""{HELPERS}
      await computed();
      const first = await page.explorer.possible(), send = Worker.prototype.postMessage;
      const sent = [], {{ Engine }} = modules.wasm_engine, {{ Instance }} = WebAssembly;
      const record = Engine.prototype.record;
      Engine.prototype.record = function (plan, seed) {{
        if (plan.components.length > 1) throw new Error("a dive on the page");
        return record.call(this, plan, seed); // how long the path is
      }};
      WebAssembly.Instance = function () {{ throw new Error("a bound on the page"); }};
      Worker.prototype.postMessage = function (message, ...rest) {{
        if (message.task && sent.push(message.task) === 1) this.terminate();
        send.call(this, message, ...rest);
      }};
      const again = await page.explorer.possible();
      Worker.prototype.postMessage = send;
      Object.assign(WebAssembly, {{ Instance }});
      Engine.prototype.record = record;
      return {{ sent, same: JSON.stringify(first) === JSON.stringify(again), dives: again.dives }};
    """)
    assert shown["same"]
    assert shown["dives"] == 8
    assert shown["sent"] == ["possible"] * 9


def test_labels_of_the_histogram_never_cover_each_other(browsing: Callable[..., Tab]) -> None:
    """Receivers at random, in pictures of any width."""
    shown = browsing().run("""
      const { marksOf } = modules.explore_histogram, found = [];
      let state = 7;
      const random = () => (state = (state * 16807) % 2147483647) / 2147483647;
      for (let i = 0; i < 500; i++) {
        const width = 150 + 700 * random(), end = 0.1 + 20 * random();
        const receivers = Array.from({ length: 1 + Math.floor(7 * random()) }, (_, k) => (
          { label: ["ekf", "coupled", "long_baseline"][k % 3], p95: end * random() ** 0.3 }));
        found.push([width, receivers.length, marksOf(receivers, (m) => 12 + (width - 24) * m / end,
          width, (text) => 6.5 * text.length).map((it) => [it.row, it.from, it.to, it.at])]);
      }
      return found;
    """)
    for width, count, marks in shown:
        assert len(marks) == count
        for i, (row, start, end, at) in enumerate(marks):
            assert min(abs(start - at), abs(end - at)) == pytest.approx(5)
            assert end <= width or start - 10 - (end - start) < 0
            assert all(other[0] != row or end < other[1] or other[2] < start for other in marks[:i])


def test_every_figure_is_saved_as_png_and_svg(browsing: Callable[..., Tab]) -> None:
    found = browsing(json.dumps({"given": {"target.waypoint_m": [5, -5, 4, 5, 5, 4]}})).run(f"""
      {HELPERS}
      change($("count"), "{DIVES}");
      await settle();
      await computed();
      const saved = {{}}, texts = {{}};
      let blob;
      URL.createObjectURL = (it) => {{ blob = it; return "blob:none"; }};
      HTMLAnchorElement.prototype.click = function () {{ saved[this.download] = blob; }};
      const buttons = all("[data-save]");
      for (const button of buttons) button.click();
      await until(() => Object.keys(saved).length === buttons.length);
      for (const [name, it] of Object.entries(saved))
        texts[name] = name.endsWith("svg") ? await it.text() : (await createImageBitmap(it)).width;
      return {{ texts, figures: all("canvas, #causes, #beacons-picture").length, causes:
        all("#causes li b").map((it) => it.textContent) }};
    """)
    texts = found["texts"]
    assert len(texts) == 2 * found["figures"] == 10
    for name, text in texts.items():
        if name.endswith("png"):
            assert text > 400, name
            continue
        ElementTree.fromstring(text)
        assert "NaN" not in text
        assert "undefined" not in text
        words = {"causes": [*found["causes"], "95 % interval", "what limits coupled"],
                 "dives": ["95 % within", f"errors of {DIVES} dives"],
                 "beacons": ["1: 3, 0, 0.5 m", "grid 1 m", "forward"]}
        for it in words.get(name.removesuffix(".svg"), []):
            assert f">{it}<" in text or it in text, (name, it)


def test_a_worker_that_ends_is_replaced(page: Path, tmp_path: Path) -> None:
    tab = Tab(tmp_path)
    try:
        tab.call("Page.addScriptToEvaluateOnNewDocument", source="""
          window.workers = [];
          window.Worker = class extends Worker {
            constructor(...of) { super(...of); workers.push(this); }
          };""")
        tab.open(page)
        shown = tab.run(f"""{HELPERS}
          change($("count"), "{DIVES}");
          await until(() => $("so-far").textContent === "{DIVES} dives");
          const before = $("within").textContent, count = workers.length;
          for (const it of workers)
            it.dispatchEvent(new ErrorEvent("error", {{ message: "no memory" }}));
          change($("count"), "400");
          change($("count"), "{DIVES}");
          await settle();
          await until(() => $("so-far").textContent === "{DIVES} dives");
          return [before, $("within").textContent, workers.length > count, $("problem").hidden];
        """)
    finally:
        tab.close()
    assert shown[0] == shown[1] != "…"
    assert shown[2:] == [True, True]


def test_a_worker_that_hangs_is_replaced(
    page: Path, browsing: Callable[..., Tab], tmp_path: Path
) -> None:
    """The first one loops for ever from its second message on; waits of seconds are shortened."""
    tab, script = Tab(tmp_path), f"""{HELPERS}
      change($("count"), "{DIVES}");
      await until(() => $("so-far").textContent === "{DIVES} dives");
      return [$("within").textContent, $("half").textContent, window.workers > 1,
        $("problem").hidden];"""
    try:
        tab.call("Page.addScriptToEvaluateOnNewDocument", source="""
          window.workers = 0;
          window.Worker = class extends Worker {
            constructor(address) {
              const loop = `let n = 0;
                onmessage = () => { while (n); n = 1; postMessage({ id: 1 }); };`;
              super(workers++ ? address : URL.createObjectURL(new Blob([loop])));
            }
          };
          const wait = window.setTimeout;
          window.setTimeout = (act, ms, ...of) => wait(act, ms < 1000 ? ms : ms / 10, ...of);""")
        tab.open(page)
        shown = tab.run(script)
    finally:
        tab.close()
    assert shown[2:] == [True, True]
    assert shown[:2] == browsing().run(script)[:2]


REFUSED = {
    "acoustics.loss_probability": "1.5",
    "platform.gps_horizontal_markov_std_m": "much",
    "time.ekf_ratio": "1.5",
    "time.sampling_time_s": "-1",
    "acoustics.slot_order": "[1, 2, 9, 4]",
    "platform.beacon_m": "[[0, 0, 1], [0, 0, 1]]",
    "seed": "-1",
}


def test_nonsense_is_refused_beside_its_field_in_the_words_of_a_scenario_file(
    browsing: Callable[..., Tab]
) -> None:
    shown = browsing().run(f"""{HELPERS}
      const told = [];
      for (const [path, text] of Object.entries({json.dumps(REFUSED)})) {{
        const own = path === "seed" ? $("seed-field") : found(path);
        const input = own.querySelector("input, select");
        const toml = page.explorer.toml(), good = input.value;
        const problem = own.querySelector(".refused");
        change(input, text);
        await settle();
        const refused = [problem.hidden, input.value, input.getAttribute("aria-invalid"),
          page.explorer.toml() === toml, input.getAttribute("aria-describedby") === problem.id];
        const sentence = problem.textContent;
        change(input, good);
        await settle();
        told.push([path, sentence, refused, [problem.hidden, input.getAttribute("aria-invalid")]]);
      }}
      return told;
    """)
    assert [path for path, *_ in shown] == [*REFUSED]
    for path, sentence, refused, after in shown:
        text = REFUSED[path]
        with pytest.raises(SblcosimError) as why:
            load(NAME, {path: json.loads(text) if text[0] in "[-1" else text})
        assert str(why.value).partition(": ")[2].partition(", got")[0] in sentence, path
        assert refused == [False, text, "true", True, True], path
        assert after == [True, "false"], path


def test_a_contradiction_stays_beside_its_field_until_another_key_resolves_it(
    browsing: Callable[..., Tab]
) -> None:
    shown = browsing().run(f"""{HELPERS}
      const packet = found("acoustics.packet_duration_s");
      const told = () => packet.querySelector(".refused").textContent;
      const set = async (path, text) => {{
        change(field(path).querySelector("input[type=text]"), text);
        await settle();
        const own = field(path).querySelector(".refused");
        return [own.hidden, page.explorer.value(path), told(),
          page.explorer.given.get("acoustics.packet_duration_s") ?? null];
      }};
      change(packet.querySelector("input"), "4");
      await settle();
      const refused = told();
      return {{ refused, other: await set("acoustics.loss_probability", "0.4"),
        solved: await set("time.sampling_time_s", "5") }};
    """)
    assert "at most the time between pings, 1 s, got 4 s" in shown["refused"]
    assert shown["other"] == [True, 0.4, shown["refused"], None]
    assert shown["solved"] == [True, 5.0, "", 4.0]


def test_every_key_of_a_scenario_has_a_field_that_shows_its_value(
    told: Mapping[str, Any], browsing: Callable[..., Tab]
) -> None:
    shown = browsing().run(f"""{HELPERS}
      return page.explorer.keys.map((key) => {{
        const own = found(key.path);
        const control = own?.querySelector("input, select");
        return [key.path, control?.type === "checkbox" ? control.checked : control?.value,
          page.explorer.value(key.path), own?.textContent.includes(key.words)];
      }});
    """)
    assert [path for path, *_ in shown] == [key["path"] for key in told["keys"]]
    for path, text, value, words in shown:
        assert words, path
        if isinstance(value, bool):
            assert text is value, path
        elif isinstance(value, (int, float)):
            assert float(text) == value, path


def test_a_link_carries_all_settings(browsing: Callable[..., Tab]) -> None:
    changes = {"platform.beaufort": 5, "acoustics.loss_probability": 0.4, "time.ekf_ratio": 4,
               "platform.imu_grade": "tactical", "acoustics.motion_during_travel": False}
    typed = {path: str(value).lower() for path, value in changes.items()}
    first = browsing().run(f"""{HELPERS}
      for (const [path, text] of Object.entries({json.dumps(typed)})) {{
        const input = found(path).querySelector("input, select");
        change(input, input.type === "checkbox" ? text === "true" : text);
      }}
      change($("seed"), "23");
      change($("main-receiver"), "ekf");
      await settle();
      return [page.explorer.link(), page.explorer.toml(), $("command").textContent,
        page.changes.all];
    """)
    assert {*changes} <= {*first[3]}
    again = browsing(first[0]).run(f"""{HELPERS}
      const told = [page.explorer.link(), page.explorer.toml(), $("command").textContent,
        page.changes.all, $("reset-all").hidden];
      $("reset-all").click();
      await settle();
      return [...told, page.explorer.link(), all(".changed").length, $("reset-all").hidden];
    """)
    assert again[:4] == first
    assert again[4:] == [False, "", 0, True]


def test_a_link_that_does_not_fit_says_why(browsing: Callable[..., Tab]) -> None:
    link = json.dumps({"given": {"acoustics.loss_probability": 3}})
    shown = browsing(link).run(f"""{HELPERS}
      return [$("problem").textContent, page.explorer.link()];
    """)
    assert "must be at most 1.0, got 3" in shown[0]
    assert shown[1] == ""


def test_beacons_and_sliders_can_be_moved_by_keys(browsing: Callable[..., Tab]) -> None:
    tab = browsing()
    tab.run(f"{HELPERS} all('#beacons-picture .beacon')[0].focus();")
    for _ in range(3):
        tab.key("ArrowRight")
        tab.run(f"{HELPERS} await settle();")
    arms = tab.run("return [page.explorer.arms, document.activeElement.getAttribute('aria-label')]")
    assert arms[0][0] == [3.0, 0.3, 0.5]
    assert "0.3 m right" in arms[1]
    tab.run(f"{HELPERS} field('acoustics.loss_probability').querySelector('[type=range]').focus();")
    tab.key("ArrowRight")
    value = "return page.explorer.value('acoustics.loss_probability')"
    lost = tab.run(f"{HELPERS} await settle(); {value}")
    assert lost == 0.3
    back = tab.run(f"""{HELPERS} field('acoustics.loss_probability').querySelector('.back').click();
      $("reset-beacons").click(); await settle();
      return [page.explorer.value('acoustics.loss_probability'), page.explorer.link()]""")
    assert back == [0.25, ""]


def test_beacons_are_dragged_and_a_path_is_drawn(
    browsing: Callable[..., Tab], tmp_path: Path
) -> None:
    tab = browsing()
    x, y = tab.run(f"""{HELPERS}
      $("beacons-picture").scrollIntoView({{ block: "center" }});
      const box = all("#beacons-picture circle:not(.reach)")[1].getBoundingClientRect();
      return [box.left + box.width / 2, box.top + box.height / 2];
    """)
    tab.drag((x, y), (x - 10, y), (x - 20, y + 15))
    arms = tab.run(f"{HELPERS} await settle(); return page.explorer.arms")
    assert arms[1][1] < 2.9
    assert arms[1][0] < -0.1
    box = tab.run(f"""{HELPERS} $("dive").scrollIntoView(); change($("path-depth"), "4.5");
      $("draw").click(); await settle();
      const {{ left, top }} = $("sketch").getBoundingClientRect(); return [left, top]""")
    places = [(60, 60), (200, 60), (340, 300)]
    tab.drag(*((box[0] + px, box[1] + py) for px, py in places))
    shown = tab.run(f"""{HELPERS} const view = page.stage.view;
      const wanted = {json.dumps(places)}.map((it) => view.under(...it));
      $("draw").click(); await settle(); return {{ wanted, points: page.explorer.pathPoints,
        toml: page.explorer.toml(), hidden: $("sketch").hasAttribute("hidden") }}""")
    assert shown["hidden"]
    points = np.array(shown["points"])
    assert np.all(points[:, 2] == 4.5)
    np.testing.assert_allclose(points[:, :2], shown["wanted"], atol=0.01)
    (tmp_path / "scenario.toml").write_text(shown["toml"])
    assert [*load(tmp_path / "scenario.toml").target.waypoint_m][: points.size] == [*points.ravel()]


def test_points_that_are_used_end_a_drawing(browsing: Callable[..., Tab]) -> None:
    tab = browsing()
    assert tab.run(f"""{HELPERS}
      $("draw").click(); await settle();
      const before = [$("sketch").hasAttribute("hidden"), $("draw").textContent];
      $("points").value = "0, 0, 3\\n5, 9, 4";
      $("use-points").click(); await settle();
      return [before, [$("sketch").hasAttribute("hidden"), $("draw").textContent],
        page.explorer.pathPoints];
    """) == [[False, "Use this path"], [True, "Draw a path"], [[0, 0, 3], [5, 9, 4]]]


@pytest.mark.parametrize(("words", "path"), [
    ("echoes", "acoustics.outlier_probability"), ("late ranges", "acoustics.outlier_probability"),
    ("compass", "platform.imu_heading_bias_deg"), ("arms", "platform.arm_length_m"),
    ("pings lost", "acoustics.loss_probability"), ("range_std", "acoustics.range_std_m"),
    ("clocks", "acoustics.clock_offset_s"),
])
def test_settings_are_found_by_the_words_of_their_controls(
    words: str, path: str, browsing: Callable[..., Tab]
) -> None:
    assert browsing().run(f"""{HELPERS}
      change($("search"), "{words}");
      return Boolean($("found").querySelector('[data-path="{path}"]'));
    """)


def test_paths_are_read_from_files(browsing: Callable[..., Tab]) -> None:
    shown = browsing().run(f"""{HELPERS}
      const open = async (name, text) => {{
        await page.path.open(new File([text], name));
        await settle();
        const problem = $("path-problem");
        return [page.explorer.pathPoints, problem.hidden ? "" : problem.textContent];
      }};
      return [
        await open("a.csv", "time_s,north_m,east_m,down_m\\n0,1,2,3\\n9,4.5,-5,6\\n"),
        await open("b.gpx", {json.dumps(GPX)}),
        await open("c.csv", "a,b\\n1,2\\n"),
        await open("d.csv", "north_m;east_m;down_m\\n1;2;3\\n4;x;6\\n"),
        await open("e.gpx", "<gpx"),
      ];
    """)
    assert shown[0] == [[[1.0, 2.0, 3.0], [4.5, -5.0, 6.0]], ""]
    geographic = np.array([[42.5, 14.2, -3.0], [42.5003, 14.2, -4.5], [42.5003, 14.1996, -7.5]])
    there = Origin(42.5, 14.2, 0.0).local(geographic)
    np.testing.assert_allclose(np.array(shown[1][0])[:, :2], there[:, :2], atol=0.02)
    np.testing.assert_allclose(np.array(shown[1][0])[[0, 2], 2], [3.0, 7.5])
    assert "c.csv: must have the columns north_m, east_m, down_m or" in shown[2][1]
    assert "d.csv: line 3: east_m must be a number, got 'x'" in shown[3][1]
    assert "e.gpx: must be a whole GPX file" in shown[4][1]
    assert shown[4][0] == shown[1][0]


def test_arms_of_the_platform_take_moved_beacons_back(browsing: Callable[..., Tab]) -> None:
    """After a beacon was moved, a length of the arms has an effect again: on a cross."""
    shown = browsing().run(f"""{HELPERS}
      const own = field("platform.arm_length_m"), told = () => [own.hidden, page.explorer.arms];
      const arms = page.explorer.arms;
      arms[0][1] = 1;
      await page.beacons.place([...arms, [2, 2, 0.5]].slice(0, 4));
      await settle();
      const moved = told();
      change(own.querySelector("input[type=text]"), "5");
      await settle();
      return {{ moved, back: told(), changed: page.changes.all,
        problem: own.querySelector(".refused").textContent }};
    """)
    assert shown["moved"] == [False, [[3, 1, 0.5], [0, 3, 0.5], [-3, 0, 0.5], [0, -3, 0.5]]]
    assert shown["back"] == [False, [[5, 0, 0.5], [0, 5, 0.5], [-5, 0, 0.5], [0, -5, 0.5]]]
    assert shown["changed"] == ["platform.arm_length_m"]
    assert shown["problem"] == ""


def test_what_a_control_means_is_told_to_those_who_ask(browsing: Callable[..., Tab]) -> None:
    tab = browsing()
    shown = tab.run(f"""{HELPERS}
      const buttons = all("#controls .what"), about = (it) => $(it.getAttribute("aria-controls"));
      buttons[1].focus();
      return [buttons.length, all("#controls .field").length, buttons.every((it) =>
        about(it).hidden && about(it).textContent.length > 20), buttons.map(
          (it) => it.getAttribute("aria-label"))];
    """)
    assert shown[0] == shown[1] > 12
    assert shown[2]
    assert len({*shown[3]}) == shown[0]
    asked = """const it = document.activeElement, about = document.getElementById(
      it.getAttribute("aria-controls")); return [about.checkVisibility(), about.textContent,
      it.getAttribute("aria-expanded")]"""
    tab.key("Enter")
    assert tab.run(asked)[0::2] == [True, "true"]
    assert "drifts" in tab.run(asked)[1]
    tab.key("Enter")
    assert tab.run(asked)[0::2] == [False, "false"]


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("width", [1400, 390])
def test_the_page_fits_its_window_and_every_control_has_a_name(
    width: int, dark: bool, browsing: Callable[..., Tab]
) -> None:
    shown = browsing(width=width, dark=dark, touch=width < 500).run(f"""{HELPERS}
      change($("search"), "gps");
      await until(() => $("so-far").textContent.endsWith("dives"));
      const {{ breakable }} = modules.explore_dom; // the longest name
      for (const it of all("#compared b")) it.replaceChildren(...breakable("long_baseline"));
      await settle();
      const named = (it) => it.getAttribute("aria-label") || it.labels?.[0]?.textContent.trim()
        || (it.tagName === "BUTTON" && it.textContent.trim());
      const visible = all("button, input, select, textarea, canvas, [tabindex]")
        .filter((it) => it.checkVisibility() && it.tagName !== "PRE");
      return {{ wide: document.documentElement.scrollWidth, count: visible.length,
        nameless: visible.filter((it) => !named(it)).map((it) => it.outerHTML),
        paper: getComputedStyle(document.querySelector("section")).backgroundColor,
        canvases: all("canvas").map((it) => it.width) }};
    """)
    assert shown["wide"] <= width
    assert shown["count"] > 40
    assert shown["nameless"] == []
    assert shown["paper"] == ("rgb(20, 23, 26)" if dark else "rgb(255, 255, 255)")
    assert min(shown["canvases"]) > 100


def test_figures_keep_their_heights(browsing: Callable[..., Tab]) -> None:
    tab = browsing()
    tab.run(f"{HELPERS} await computed();")
    for width in (1393, 1134):  # there, a bitmap is higher than its frame
        tab.call(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=900, deviceScaleFactor=1, mobile=False,
        )
        before, after = tab.run("""
          const heights = () =>
            [...document.querySelectorAll("canvas")].map((it) => it.clientHeight);
          for (let i = 0; i < 10; i++) await frame();
          const before = heights();
          for (let i = 0; i < 10; i++) await frame();
          return [before, heights()];
        """)
        assert before == after, width


def test_a_browser_without_webassembly_gets_a_sentence(page: Path, tmp_path: Path) -> None:
    tab = Tab(tmp_path)
    try:
        tab.call("Page.addScriptToEvaluateOnNewDocument", source="delete globalThis.WebAssembly")
        tab.call("Page.navigate", url=page.as_uri())
        problem = tab.run(f"{HELPERS} await until(() => $('problem')?.textContent); "
                          "return $('problem').textContent")
    finally:
        tab.close()
    assert problem == "This page cannot simulate here: this browser has no WebAssembly"


@pytest.mark.slow
def test_pages_have_other_numbers_of_beacons_and_modules_for_browsers_without_vectors(
    tmp_path: Path
) -> None:
    """Such a browser refuses to compile modules with vectors: the smaller ones take their place."""
    told = contents(load(NAME), ("ekf",), beacons=(5,))
    file, files = tmp_path / "explore.html", []
    file.write_text(render(told), "utf-8")
    for refused in ("", """
          const compile = WebAssembly.compile;
          WebAssembly.compile = async (bytes) => {
            const module = await compile(bytes);
            const [own] = WebAssembly.Module.customSections(module, "sblcosim");
            if (own && JSON.parse(new TextDecoder().decode(own)).lanes > 1)
              throw new WebAssembly.CompileError("no vectors");
            return module;
          };"""):
        tab = Tab(tmp_path)
        try:
            tab.call("Page.addScriptToEvaluateOnNewDocument", source=refused)
            tab.open(file)
            files.append(tab.run(f"""{HELPERS}
              change($("count"), "{DIVES}");
              $("add-beacon").click();
              await until(() => all("#beacons-rows tr").length === 5);
              await settle();
              await until(() => $("so-far").textContent === "{DIVES} dives");
              const [receiver] = page.stage.run.receivers;
              return [page.explorer.toml(), page.explorer.arms.length, $("within").textContent,
                $("add-beacon").disabled, [...receiver.position.x]];
            """))
            assert tab.complaints == []
        finally:
            tab.close()
    (toml, arms, within, last, north), other = files
    assert other == files[0]
    assert arms == 5
    assert last  # there are no modules for six
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(toml)
    result = sblcosim.run(scenario, ["ekf"])
    np.testing.assert_array_equal(result.judged["ekf"].estimates.position[:, 0], north)
    many = run_many(load(scenario), ("ekf",), runs=DIVES)
    assert within == f"{many.within_m['ekf']:.1f} m"
