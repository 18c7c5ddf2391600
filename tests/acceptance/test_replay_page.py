"""The page that plays a run back, in a real browser without a network.

Skipped where there is no Chromium.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
import sblcosim
from browser import BROWSER, Tab
from quick import few, one_in
from sblcosim import Result, style
from sblcosim.cli import app
from sblcosim.explore.contents import refuse
from sblcosim.judge.definitions import of_position
from sblcosim.scenario.labels import FIXES
from sblcosim.scenario.scenario import load
from sblcosim.study import store
from sblcosim.web.page import write
from sblcosim.web.playback import Playback, PlayedReceiver
from sblcosim.words.numbers import measured, meters
from scipy.interpolate import CubicHermiteSpline
from typer.testing import CliRunner

pytestmark = pytest.mark.skipif(BROWSER is None, reason="needs Chromium")

HALF_A_CENTIMETRE = 0.005 + 0.002  # what is shown, from whole millimetres of estimate and truth
SHORT = {"time.duration_s": 60.0}
SIX: dict[str, Any] = {
    "platform.beacons": 6, "time.duration_s": 60.0,
}
STUDY = """
name = "small"
scenario = "paper-scenario-1"
replicates = 3
fixed = { "time.duration_s" = 10.0 }
[factors.baseline]
keys = ["platform.arm_length_m"]
levels = [0.4, 3.0]
"""
RUNS: dict[str, tuple[str, tuple[str, ...], dict[str, Any]]] = {
    "platform": ("realistic-dive", ("coupled", "ekf"), SHORT),
    "quick": ("paper-scenario-1", (), {"time.duration_s": 20.0}),
    "bottom": ("harbour-lbl", (), SHORT),
    "buoys": ("gps-buoys", (), SHORT),
    "sea": ("realistic-sea", (), SHORT),
    "six": ("realistic-dive", (), SIX),
}
HELPERS = """
const $ = (id) => document.getElementById(id);
const all = (selector) => [...document.querySelectorAll(selector)];
const change = (control, value) => {
  control.value = value;
  for (const name of ["input", "change"]) control.dispatchEvent(new Event(name, { bubbles: true }));
};
const seek = (t) => change($("time"), t);
const pixels = (id) => {
  const { width, height } = $(id), pen = new OffscreenCanvas(width, height).getContext("2d");
  pen.drawImage($(id), 0, 0);
  return pen.getImageData(0, 0, width, height).data;
};
const near = (id, colour) => {
  const data = pixels(id), [r, g, b] = [1, 3, 5].map((i) => parseInt(colour.slice(i, i + 2), 16));
  let count = 0;
  for (let i = 0; i < data.length; i += 4) {
    count += Math.abs(data[i] - r) + Math.abs(data[i + 1] - g) + Math.abs(data[i + 2] - b) < 12;
  }
  return count;
};
const print = (id) => pixels(id).reduce((sum, v, i) => (sum * 31 + v + i) % 1000000007, 7);
"""


@cache
def result_of(name: str, seed: int) -> Result:
    scenario, receivers, changes = RUNS[name]
    return sblcosim.run(scenario, receivers, overrides={**changes, "seed": seed})


def page_of(name: str, folder: Path, seed: int = 1) -> tuple[Result, Path]:
    result = result_of(name, seed)
    return result, result.replay(folder / "replay.html")


def number(text: str) -> float:
    return float("nan") if text == "–" else float(text.replace("−", "-"))


@pytest.fixture
def browsing(tmp_path: Path) -> Iterator[Callable[..., Tab]]:
    """Open a page in a browser; in the end, it must not have complained, nor asked for more."""
    tabs: list[tuple[Tab, Path]] = []

    def open_(page: Path, width: int = 1400, link: str = "", **options: bool) -> Tab:
        tab = Tab(tmp_path, width, 844 if width < 500 else 1000, **options)
        tabs.append((tab, page))
        tab.open(page, link)
        return tab

    try:
        yield open_
        for tab, page in tabs:
            assert tab.complaints == []
            assert [address.partition("#")[0] for address in tab.asked] == [page.as_uri()]
    finally:
        for tab, _ in tabs:
            tab.close()


@pytest.mark.parametrize("seed", few([1, 7, 19], quick=[1]))
@pytest.mark.parametrize("name", few(RUNS, quick=["platform"]))
def test_the_numbers_shown_at_a_time_are_those_of_the_run(
    name: str, seed: int, tmp_path: Path, browsing: Callable[..., Tab]
) -> None:
    result, page = page_of(name, tmp_path, seed)
    stop = result.record.time_ns[-1] / 1e9
    at = np.random.default_rng(seed).uniform(0, stop, 20)
    times = sorted({*np.round(at, 3).tolist(), 0.0, float(stop)})
    shown = browsing(page).run(f"""{HELPERS}
      const cells = (what) => all(`[data-cell="${{what}}"]`).map((e) => e.textContent);
      return {{ names: all("tbody label span").map(e => e.textContent),
        at: {json.dumps(times)}.map((t) => {{
          seek(t);
          return {{ clock: $("clock").textContent, error: cells("error"), claim: cells("claim"),
            position: ["x", "y", "z"].map(cells),
            truth: all("[data-truth]").map((e) => e.textContent) }};
        }}) }};
    """)
    assert shown["names"] == [*result.receivers]
    compared = 0
    for t, told in zip(times, shown["at"], strict=True):
        assert told["clock"] == f"{t:.1f} s"
        position, _ = result.truth.state_at(np.array([round(t * 1e9)]))
        assert [number(x) for x in told["truth"]] == pytest.approx(position[0], abs=0.05)
        for i, judged in enumerate(result.judged.values()):
            since, until = judged.since_ns / 1e9, judged.until_ns / 1e9
            which = np.flatnonzero((since <= t) & ((t < until) | (t == stop)))[-1:]
            if not len(which):
                assert told["error"][i] == told["claim"][i] == told["position"][0][i] == "–"
                continue
            (k,) = which
            error = float(np.sqrt(judged.square[k]))
            assert number(told["error"][i]) == pytest.approx(error, abs=HALF_A_CENTIMETRE)
            own = [number(axis[i]) for axis in told["position"]]
            assert own == pytest.approx(judged.estimates.position[k], abs=HALF_A_CENTIMETRE)
            compared += 1
    assert compared > len(times)


@pytest.mark.parametrize("seed", few([2, 3, 4], quick=[2]))
def test_what_is_claimed_holds_95_percent_of_normal_errors(
    seed: int, tmp_path: Path, browsing: Callable[..., Tab]
) -> None:
    result, page = page_of("platform", tmp_path, seed)
    shown = browsing(page).run(f"""{HELPERS}
      const found = {{}};
      for (const {{ value }} of $("kind").options) {{
        change($("kind"), value);
        found[value] = ["claim", "error"].map(
          (what) => all(`#receiver-0 [data-cell="${{what}}"]`)[0].textContent);
      }}
      return found;
    """)
    judged = result.judged["coupled"]
    assert judged.estimates.covariance is not None
    P, error = of_position(judged.estimates.covariance)[-1], judged.error[-1]
    draws = np.random.default_rng(seed).multivariate_normal(np.zeros(3), P, 200_000)
    of = {"total": [0, 1, 2], "horizontal": [0, 1], "x": [0], "y": [1], "z": [2]}
    assert {*shown} == {*of}
    for kind, axes in of.items():
        lengths = np.linalg.norm(draws[:, axes], axis=1)
        claim, off = map(number, shown[kind])
        assert claim == pytest.approx(np.quantile(lengths, 0.95), rel=0.03, abs=0.01)
        expected = error[axes[0]] if len(axes) == 1 else float(np.linalg.norm(error[axes]))
        assert off == pytest.approx(expected, abs=HALF_A_CENTIMETRE)


@pytest.mark.parametrize("view", ["plan", "space"])
@pytest.mark.parametrize("name", few(["platform", "six", "buoys"], quick=["platform", "buoys"]))
def test_the_map_shows_all_where_it_is(
    name: str, view: str, tmp_path: Path, browsing: Callable[..., Tab]
) -> None:
    result, page = page_of(name, tmp_path)
    at = 41
    values = {key: value[at] for key, value in result.record.values.items()}
    time_ns = result.record.time_ns[at]
    points = {"diver": values["target.position"][None],
              "true": values["platform.beacon_position"],
              "reported": values["platform.reported_beacon_position"]}  # fmt: skip
    filters = [it for it in result.receivers if it not in FIXES]
    for label in filters:
        judged = result.judged[label]
        (k,) = np.flatnonzero((judged.since_ns <= time_ns) & (time_ns < judged.until_ns))
        points[label] = judged.estimates.position[k][None]
    asked = json.dumps({key: value.tolist() for key, value in points.items()})
    found = browsing(page, link=f"t={time_ns / 1e9}&view={view}").run(f"""
      const {{ view, run, state, look }} = replay;
      const pen = new modules.web_pen.SvgPen(view.width, view.height);
      modules.web_map.drawMap(pen, view, run, state, look);
      const places = Object.entries({asked}).map(
        ([name, points]) => [name, points.map((p) => view.project(...p))]);
      return {{ svg: pen.toString(), places: Object.fromEntries(places) }};
    """)
    places = {key: np.array(value) for key, value in found["places"].items()}
    look = style.THEMES["light"]
    triangle = r'<path d="M(\S+) (\S+)L[^LMZ]+L[^LMZ]+Z" fill="{}"/>'
    circle = r'<path d="M(\S+) (\S+)a{0} {0} [^"]*" fill="{1}"/>'
    shapes = {"true": (triangle.format(look.ink), (0, 5)),
              "reported": (triangle.format(look.paper), (0, -5)),
              "diver": (circle.format(5.5, look.paper), (5.5, 0))}  # fmt: skip
    for label, colour in zip(filters, look.receivers, strict=False):
        shapes[label] = (circle.format(5, colour), (5, 0))
    for key, (shape, shift) in shapes.items():
        drawn = np.array(re.findall(shape, found["svg"]), float).reshape(-1, 2) + shift
        np.testing.assert_allclose(drawn, places[key], atol=0.2)
    arms = re.findall(r'<path d="M[^LMZ]+L[^LMZ]+" [^>]*stroke="#000000" stroke-width="1.5"',
                      found["svg"])  # fmt: skip
    expected = 0 if name == "buoys" else len(places["true"])
    assert len(arms) == expected + (view == "space")  # and the bar of the scale


def test_nothing_is_shown_of_a_receiver_while_no_estimate_of_it_stands(
    tmp_path: Path, browsing: Callable[..., Tab]
) -> None:
    second = 10**9
    time = np.arange(31) * second
    path = np.column_stack([time / second, 0 * time, 5 + 0 * time])
    since = np.array([2, 4, 20]) * second
    gappy = PlayedReceiver(
        label="ekf", epoch_ns=since, since_ns=since, until_ns=np.array([4, 9, 30]) * second,
        position=path[[2, 4, 20]], truth=path[[2, 4, 20]] + 1,
    )
    page = write(Playback(
        title="Gap", run="gap", verdict=["ekf: rests"], start_ns=0, stop_ns=30 * second,
        time_ns=time, diver=path, receivers=[gappy],
    ), tmp_path / "gap.html")  # fmt: skip
    shown = browsing(page).run(f"""{HELPERS}
      return [0, 1.9, 2, 8.9, 9, 19.9, 20, 29.9, 30].map((t) => {{
        seek(t);
        const cell = (what) => all(`[data-cell="${{what}}"]`)[0].textContent;
        return [cell("error"), cell("x"), $("map").ariaLabel.split("; ")[1]];
      }});
    """)
    none, some = ["–", "–", "ekf has no estimate"], "ekf is off by 1.73 m"
    second_, last = ["1.73", "4.00", some], ["1.73", "20.00", some]
    assert shown == [none, none, ["1.73", "2.00", some], second_, none, none, last, last, last]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_an_ellipse_is_that_of_the_covariance_from_above_and_in_space(
    seed: int, tmp_path: Path, browsing: Callable[..., Tab]
) -> None:
    _, page = page_of("platform", tmp_path)
    draw = np.random.default_rng(seed)
    L = np.tril(draw.normal(size=(3, 3)))
    middle = draw.normal(size=3)
    azimuth, elevation = draw.uniform(-3, 3), draw.uniform(0.1, 1.4)
    seen = browsing(page).run(f"""
      const view = replay.view, found = {{}};
      for (const [name, look] of [["plan", () => view.plan()],
                                  ["space", () => view.look({azimuth}, {elevation})]]) {{
        look();
        found[name] = {{ scale: view.scale, middle: view.project(...{middle.tolist()}),
          axes: [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]].map((p) => view.project(...p)),
          outline: view.outline({middle.tolist()}, {L.tolist()}, 2.5) }};
      }}
      return found;
    """)
    for name, it in seen.items():
        *ends, zero = np.array(it["axes"])
        M = (np.array(ends) - zero).T / it["scale"] * [[1], [-1]]  # right and up
        np.testing.assert_allclose(M @ M.T, np.eye(2), atol=1e-9)  # a turned view, to scale
        if name == "plan":
            np.testing.assert_allclose(M, [[0, 1, 0], [1, 0, 0]], atol=1e-9)
        else:
            assert M[1, 2] == pytest.approx(-np.cos(elevation))  # depth is down
            np.testing.assert_allclose(M[0], [-np.sin(azimuth), np.cos(azimuth), 0], atol=1e-9)
        away = (np.array(it["outline"]) - it["middle"]) / it["scale"] * [1, -1]
        P = M @ L @ L.T @ M.T
        reach = np.einsum("ni,ij,nj->n", away, np.linalg.inv(P), away)
        np.testing.assert_allclose(reach, 2.5**2, rtol=1e-6)
        assert np.ptp(np.unwrap(np.arctan2(*away.T))) == pytest.approx(2 * np.pi, rel=1e-6)


def test_motion_is_that_of_the_record_and_smooth_or_held_between(
    tmp_path: Path, browsing: Callable[..., Tab]
) -> None:
    result, page = page_of("sea", tmp_path)
    values, time = result.record.values, result.record.time_ns / 1e9
    found = browsing(page).run("""
      const { run } = replay, { pointAt, wavePointAt } = modules.web_data;
      const at = (share) => Array.from(run.time.slice(0, -1), (t, i) => {
        const when = t + share * (run.time[i + 1] - t);
        return [pointAt(run.diver, run.time, when), wavePointAt(run.beacons[1], run.time, when),
          pointAt(run.reported[1], run.time, when, true)];
      });
      return [at(0), at(0.4)];
    """)
    exact, between = (np.array(it).swapaxes(0, 1) for it in found)
    diver = values["target.position"]
    true, told = (values[f"platform.{which}beacon_position"][:, 1] for which in ("", "reported_"))
    for own, record in zip(exact, (diver, true, told), strict=True):
        np.testing.assert_allclose(own, record[:-1], atol=6e-4)
    np.testing.assert_allclose(between[0], diver[:-1] + 0.4 * np.diff(diver, axis=0), atol=2e-3)
    np.testing.assert_allclose(between[2], told[:-1], atol=6e-4)
    slope = np.gradient(true, time, axis=0)  # at inner instants the slope of Catmull and Rom
    cubic = CubicHermiteSpline(time, true, slope)(time[:-1] + 0.4 * np.diff(time))
    np.testing.assert_allclose(between[1][1:-1], cubic[1:-1], atol=2e-3)


def test_of_lengths_and_times_people_read_what_they_are(
    tmp_path: Path, browsing: Callable[..., Tab]
) -> None:
    _, page = page_of("quick", tmp_path)
    found = browsing(page).run("""
      const { clock, metres, unitOf } = modules.web_words, { roundStep, ticks } = modules.web_pen;
      return { clock: [[8.04, 60], [125.4, 3600], [3725, 9999], [-3, 60], [-65, 3600]].map(
          (it) => clock(...it)),
        metres: [1.005, -0.004, -2.5, NaN, 1234.567].map(metres),
        unit: [60, 1200, 10800].map((span) => unitOf(span).name),
        steps: [0.03, 0.2, 1, 3, 7].map(roundStep), ticks: ticks(-0.5, 1, 0.5) };
    """)
    assert found["clock"] == ["8.0 s", "2:05", "1:02:05", "−3.0 s", "−1:05"]
    assert found["metres"] == ["1.00", "0.00", "−2.50", "–", "1234.57"]
    assert found["unit"] == ["s", "min", "h"]
    assert found["steps"] == pytest.approx([0.05, 0.2, 1, 5, 10])
    assert found["ticks"] == [-0.5, 0, 0.5, 1]


TIME = "return replay.player.time"


def test_keys_and_buttons_play_it_and_move_its_time(
    tmp_path: Path, browsing: Callable[..., Tab]
) -> None:
    result, page = page_of("platform", tmp_path)
    stop = result.record.time_ns[-1] / 1e9
    tab = browsing(page, link="t=33")
    step = max(stop / 400, 0.1)
    assert tab.run(TIME) == 33.0
    for keys, time in (
        (["Home"], 0.0), (["ArrowRight", "ArrowRight"], 2 * step), (["ArrowLeft"], step),
        (["End"], stop), (["ArrowRight"], stop), (["Home", "ArrowLeft"], 0.0),
    ):
        for key in keys:
            tab.key(key)
        assert tab.run(TIME) == pytest.approx(time)
    tab.run("document.getElementById('time').focus()")
    tab.key("PageUp")
    tab.key("ArrowUp")
    assert tab.run(TIME) == pytest.approx(stop / 20 + step)
    playing = "return [replay.player.playing, document.getElementById('play').ariaLabel]"
    tab.run(f"{HELPERS} change($('speed'), '10')")
    tab.key(" ")
    assert tab.run(playing) == [True, "Pause"]
    before = tab.run(TIME)
    rate = tab.run(
        "const t = performance.now(), from = replay.player.time; await sleep(700); await frame();"
        "return (replay.player.time - from) / (performance.now() - t) * 1000"
    )
    assert 3.0 < rate < 11.0
    tab.key(" ")
    assert tab.run(playing) == [False, "Play"]
    paused = tab.run(TIME)
    assert paused > before
    assert tab.run(f"await sleep(200); {TIME}") == paused
    tab.run("document.querySelector('input[type=checkbox]').focus()")
    tab.key(" ")
    assert tab.run(playing) == [False, "Play"]
    assert not tab.run("return document.querySelector('input[type=checkbox]').checked")
    tab.run(f"{HELPERS} change($('speed'), '100'); replay.player.seek(replay.run.stop - 1)")
    tab.run("document.getElementById('time').focus()")
    tab.key(" ")
    end = "for (let i = 0; i < 500 && replay.player.playing; i++) await frame();"
    assert tab.run(f"{end} {TIME}") == stop
    assert tab.run(playing) == [False, "Play"]
    found = tab.run("location.hash = 't=12.5&view=space&error=x'; await sleep(50); await frame();"
                    "return [replay.player.time, document.getElementById('kind').value,"
                    " document.getElementById('space').getAttribute('aria-pressed')]")
    assert found == [12.5, "x", "true"]
    again = "document.getElementById('play').click(); return replay.player.time"
    assert tab.run(f"replay.player.seek(1e9); {again}") == 0.0


@pytest.mark.parametrize("touch", [False, True])
def test_a_click_or_a_finger_on_the_errors_moves_the_time(
    touch: bool, tmp_path: Path, browsing: Callable[..., Tab]
) -> None:
    result, page = page_of("platform", tmp_path)
    stop = result.record.time_ns[-1] / 1e9
    tab = browsing(page, 390 if touch else 1400, touch=touch)
    at = ("document.getElementById('errors').scrollIntoView({ block: 'center' });"
          "const box = document.getElementById('errors').getBoundingClientRect();"
          "return [0.25, 0.75].map((share) => [box.left + replay.plot.x(replay.run.start"
          " + share * replay.span), box.top + 60])")
    first, second = tab.run(at)
    move = tab.touch if touch else tab.drag
    move(first)
    assert tab.run(f"await frame(); {TIME}") == pytest.approx(0.25 * stop, abs=0.01 * stop)
    move(first, second)
    assert tab.run(f"await frame(); {TIME}") == pytest.approx(0.75 * stop, abs=0.01 * stop)
    words = tab.run("return document.getElementById('time').getAttribute('aria-valuetext')")
    assert re.match(r"45\.\d s of 60.0 s; coupled is off by ", words)


@pytest.mark.parametrize("dark", [False, True])
def test_a_receiver_can_be_hidden_in_map_and_errors(
    dark: bool, tmp_path: Path, browsing: Callable[..., Tab]
) -> None:
    _, page = page_of("platform", tmp_path)
    tab = browsing(page, dark=not dark)
    tab.dark(dark)  # while it is shown
    look = style.THEMES["dark" if dark else "light"]
    first, second = look.receivers[:2]
    found = tab.run(f"""{HELPERS}
      await frame();
      const both = ["{first}", "{second}"];
      const counts = () => ["map", "errors"].map((id) => both.map((colour) => near(id, colour)));
      const box = all("[data-receiver='1']")[0], found = {{ before: counts() }};
      found.paper = getComputedStyle(all(".player")[0]).backgroundColor;
      box.click(); found.hidden = counts(); found.words = $("map").ariaLabel;
      box.click(); found.shown = counts();
      return found;
    """)
    rgb = ", ".join(str(int(look.paper[i : i + 2], 16)) for i in (1, 3, 5))
    assert found["paper"] == f"rgb({rgb})"
    assert np.min(found["before"]) > 20
    assert found["shown"] == found["before"]
    for own, other in found["hidden"]:
        assert own > 20
        assert other == 0
    assert "coupled" in found["words"]
    assert "ekf" not in found["words"]


@pytest.mark.parametrize("name", few(RUNS, quick=RUNS.keys() - {"six"}))
@pytest.mark.parametrize("width", [390, 1400])
@one_in(3)
def test_it_fits_the_window_and_is_seen_from_above_and_in_space(
    name: str, width: int, tmp_path: Path, browsing: Callable[..., Tab]
) -> None:
    _, page = page_of(name, tmp_path)
    tab = browsing(page, width, touch=width < 500)
    found = tab.run(f"""{HELPERS}
      const root = document.documentElement, outside = all("button, input, select, td, canvas, li");
      return {{ width: root.clientWidth, needed: root.scrollWidth,
        outside: outside.map((e) => e.getBoundingClientRect()).filter((at) => at.width
          && (at.left < -0.5 || at.right > root.clientWidth + 0.5)).length,
        player: all(".player")[0].getBoundingClientRect().bottom - innerHeight,
        unnamed: all("button, input, select, canvas").filter((e) => !(e.ariaLabel
          || e.textContent.trim() || e.closest("label")?.textContent.trim())).length }};
    """)
    assert found["needed"] <= found["width"]
    assert found["outside"] == found["unnamed"] == 0
    assert found["player"] <= 1  # always in sight
    box = tab.run("const map = document.getElementById('map').getBoundingClientRect();"
                  "return [map.left, map.top, map.width, map.height]")
    x, y = box[0] + box[2] / 2, box[1] + box[3] / 2
    drag = tab.touch if width < 500 else tab.drag

    def seen(act: Callable[[], object]) -> int:
        act()
        return int(tab.run(f"await frame(); {HELPERS} return print('map')"))

    def press(button: str) -> Callable[[], object]:
        return lambda: tab.run(f"document.getElementById('{button}').click()")

    def sideways() -> None:
        drag((x, y), (x + 30, y + 2), (x + 50, y + 4))

    plan = seen(lambda: None)
    assert seen(sideways) == plan
    nearer, moved = seen(press("nearer")), seen(sideways)
    assert seen(press("whole")) == plan
    space, turned = seen(press("space")), seen(sideways)
    assert seen(press("space")) == plan
    assert len({plan, nearer, moved, space, turned}) == 5


def test_pictures_are_saved_as_png_and_svg(
    tmp_path: Path, browsing: Callable[..., Tab]
) -> None:
    result, page = page_of("platform", tmp_path)
    found = browsing(page, link="t=30").run(f"""{HELPERS}
      const saved = {{}}, found = {{}};
      let blob;
      URL.createObjectURL = (made) => {{ blob = made; return "#t=30"; }};
      HTMLAnchorElement.prototype.click = function () {{ saved[this.download] = blob; }};
      for (const button of all("[data-save]")) {{ button.click(); await sleep(300); }}
      for (const [name, blob] of Object.entries(saved)) {{
        if (name.endsWith("png")) {{
          const image = await createImageBitmap(blob);
          const pen = new OffscreenCanvas(image.width, image.height).getContext("2d");
          pen.drawImage(image, 0, 0);
          const corner = pen.getImageData(image.width / 2, image.height / 2, image.width / 2,
            image.height / 2).data;
          found[name] = [image.width, image.height, new Set(new Uint32Array(corner.buffer)).size];
        }} else found[name] = await blob.text();
      }}
      return found;
    """)
    kinds = ("png", "svg")
    assert {*found} == {f"{it}-30s.{kind}" for it in ("map", "errors") for kind in kinds}
    for name in ("map", "errors"):
        svg = found[f"{name}-30s.svg"]
        root = ElementTree.fromstring(svg)
        size = [int(root.attrib[side]) for side in ("width", "height")]
        *pixels, colours = found[f"{name}-30s.png"]
        assert pixels == [2 * length for length in size]
        assert colours > 20  # in the lower right quarter: all is drawn to scale
        words = " ".join(root.itertext())
        assert f"{result.title}, at 30.0 s" in words
        assert all(receiver in words for receiver in result.receivers)
        assert style.THEMES["light"].receivers[0] in svg
        assert "NaN" not in svg


def test_the_command_writes_the_page_with_the_verdict_of_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, browsing: Callable[..., Tab]
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["run", "realistic-dive", "--set", "time.duration_s=30", "--no-figures", "--seed", "5"]
    ran = CliRunner().invoke(app, [*words, "--replay", "--out", "dive"])
    assert ran.exit_code == 0, ran.output
    page = tmp_path / "dive" / "replay.html"
    assert "replay.html" in json.loads((page.parent / "manifest.json").read_text())["files"]
    found = browsing(page.rename(tmp_path / "alone.html")).run(f"""{HELPERS}
      return {{ title: all("h1")[0].textContent, run: all("header p")[0].textContent,
        verdict: all(".verdict li").map((e) => e.textContent.trim()) }};
    """)
    assert found["title"] == "A realistic dive"
    assert found["run"] == "realistic-dive, seed 5"
    verdict = ran.stdout.split("\n\n")[0]
    assert " ".join(found["verdict"]).split() == verdict.split()


def test_the_worst_run_of_the_best_receiver_of_a_comparison_can_be_played(
    tmp_path: Path, browsing: Callable[..., Tab]
) -> None:
    words = ["compare", "realistic-dive", "harbour-square", "--receiver", "ekf", "--receiver",
             "coupled", "--runs", "6", "--set", "time.duration_s=40", "--no-figures", "--replay",
             "--seed", "4"]  # fmt: skip
    ran = CliRunner().invoke(app, [*words, "--out", str(tmp_path / "both"), "--json"])
    assert ran.exit_code == 0, ran.output
    best = json.loads(ran.stdout)["receivers"][0]
    table = pd.read_parquet(tmp_path / "both" / "runs.parquet")
    worst = table.loc[table[f"{best}.absolute_total_rms_m"].idxmax()]
    told = browsing(tmp_path / "both" / "worst.html").run(
        f"{HELPERS} return all('header p').concat(all('.verdict li')).map((e) => e.textContent)"
    )
    assert told[0] == f"{worst['scenario']}, seed {worst['seed']}"
    reached = next(line.strip() for line in told if line.strip().startswith(f"{best}: "))
    assert meters(worst[f"{best}.absolute_total_rms_m"]) in reached


def test_the_report_of_a_study_says_how_to_play_its_worst_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, browsing: Callable[..., Tab]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("small.toml").write_text(STUDY, "utf-8")
    for words in (["study", "small.toml", "--out", "runs"], ["analyse", "runs", "--out", "page"]):
        done = CliRunner().invoke(app, words)
        assert done.exit_code == 0, done.output
    report = Path("page/report.html").read_text("utf-8")
    command = re.search(r"sblcosim (replay runs \S+ --replay)", report)
    assert command
    done = CliRunner().invoke(app, [*command[1].split(), "--out", "worst", "--no-figures"])
    assert done.exit_code == 0, done.output
    table = store.table("runs")
    largest = table["ekf.absolute_total_rms_m"].max()
    assert f"The largest value is {measured(largest, 'm')}" in report
    browsing(tmp_path / "worst" / "replay.html")
    errors = pd.read_csv("worst/errors.csv").set_index(["receiver", "frame", "axis"])
    assert errors.rms_m["ekf", "absolute", "total"] == pytest.approx(largest, rel=1e-12)
    run = command[1].split()[2]
    assert f"sblcosim explore runs/{run}/scenario.toml" in report
    refuse(load(tmp_path / "worst" / "scenario.toml"))  # a page may have it


def test_of_many_runs_the_typical_and_the_worst_one_can_be_played(
    tmp_path: Path, browsing: Callable[..., Tab]
) -> None:
    short = ["--set", "time.duration_s=30", "--no-figures", "--runs", "5", "--seed", "3"]
    out = ["--out", str(tmp_path / "many"), "--json"]
    ran = CliRunner().invoke(app, ["run", "realistic-dive", *short, "--replay", *out])
    assert ran.exit_code == 0, ran.output
    drawn = json.loads(ran.stdout)["drawn"]
    assert {*drawn} == {"typical", "worst"}
    for which, one in drawn.items():
        page = tmp_path / "many" / which / "replay.html"
        assert "replay.html" in json.loads((page.parent / "manifest.json").read_text())["files"]
        told = browsing(page).run(f"{HELPERS} return document.body.textContent")
        assert f"realistic-dive, seed {one['seed']}" in told
        assert f"{one['rms_m']:.1f} m RMS" in told
