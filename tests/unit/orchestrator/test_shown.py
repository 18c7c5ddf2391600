"""What people see of objects: a line, public names, and one picture in a notebook."""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import Any

import made_logs
import numpy as np
import pandas as pd
import pytest
import sblcosim
from IPython.core.completer import IPCompleter, provisionalcompleter
from IPython.core.formatters import DisplayFormatter
from IPython.core.interactiveshell import InteractiveShell
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from sblcosim import limits
from sblcosim.calibrate import calibrate
from sblcosim.data.description import RunDescription
from sblcosim.logs.contents import contents_of
from sblcosim.results.responses import Run
from sblcosim.results.result import Result
from sblcosim.shown import Listing, Picture
from synthetic_record import make_record, silent

DIVE = {"time.duration_s": 20.0}
STUDY = {
    "scenario": {"target": {"trajectory": "straight_line"}, "time": {"duration_s": 2.0}},
    "name": "arms <1>",
    "replicates": 3,
    "factors": {
        "arm": {"keys": ["platform.arm_length_m"], "levels": [0.4, 3.0], "label": "Arm <2>"},
        "loss": {"keys": ["acoustics.loss_probability"], "levels": [0.0, 0.5]},
    },
}


@pytest.fixture(scope="module")
def things(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """One of each that users get."""
    folder = tmp_path_factory.mktemp("study") / "arms"
    result = sblcosim.run("realistic-dive", "coupled", DIVE)
    smoothed = sblcosim.smooth(result)
    study = sblcosim.study.load(STUDY)
    study.run(folder)
    costs = {"arm": [100.0, 200.0], "loss": [5.0, 0.0]}
    setting = limits.conditions(sblcosim.load("realistic-dive"), acceleration_psd=0.001)
    grid = np.tile([10.0, 0.0, 5.0], (30, 20, 1))
    run = Run(result.record, "coupled")
    dive = made_logs.made(seconds=60)
    return {
        "log": dive,
        "contents": contents_of(dive),
        "processed": sblcosim.process(dive, "sequential"),
        "device": sblcosim.identify(dive),
        "path of a diver": result.paths[0],
        "result": result,
        "description": result.description,
        "record": result.record,
        "record estimates": result.record.estimates("coupled"),
        "limits": result.limits,
        "smoothed": smoothed,
        "track": smoothed.track,
        "estimates": smoothed.result.made["smoother"],
        "run": run,
        "judged": run.used,
        "study": study,
        "scenario": result.scenario,
        "analysis": sblcosim.analysis.of_study(folder),
        "advice": sblcosim.analysis.advice_on_study(folder, costs, limit=5.0),
        "calibration": calibrate(pings=5),
        "hdop": limits.hdop(grid, limits.cross(3.0)),
        "closed form": limits.closed_form(grid, setting),
        "picture": result.plot_path(),
        "estimate": sblcosim.Estimate(2.0, np.zeros(3), covariance=np.eye(6)),
    }


KINDS = (
    "result", "description", "record", "record estimates", "limits", "smoothed", "track",
    "estimates", "run", "judged", "study", "scenario", "analysis", "advice", "calibration", "hdop",
    "closed form", "picture", "estimate", "log", "contents", "processed", "device",
    "path of a diver",
)  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_repr_is_one_line_that_names_the_class(things: dict[str, Any], kind: str) -> None:
    text = repr(things[kind])
    assert text.startswith(f"<{type(things[kind]).__name__} ")
    assert text.endswith(">")
    assert "\n" not in text
    assert len(text) <= 320
    assert "array(" not in text


@pytest.mark.parametrize("kind", KINDS)
def test_dir_has_public_names_only(things: dict[str, Any], kind: str) -> None:
    names = dir(things[kind])
    assert names
    assert not [name for name in names if name.startswith("_")]
    assert len(names) <= 65
    assert all(hasattr(things[kind], name) for name in names)


def test_the_line_of_a_result_has_the_rms_of_each_receiver(things: dict[str, Any]) -> None:
    result: Result = things["result"]
    rms = result.errors.xs(("absolute", "total"), level=("frame", "axis"))["rms_m"]
    said = f"realistic-dive: RMS error coupled {rms['coupled']:.2f} m, raw {rms['raw']:.2f} m"
    assert repr(result) == f"<Result {said}>"
    assert said.split(" coupled")[0] in repr(things["smoothed"])
    assert "smoother: " in repr(things["smoothed"])


def test_the_line_of_a_result_says_what_went_wrong() -> None:
    nothing = Result(RunDescription("dive", {}, ("ekf",)), silent("ekf"))
    assert repr(nothing) == "<Result dive: RMS error ekf without an estimate>"
    described = RunDescription("dive", {}, ("ekf", "mine"))
    failed = Result(described, make_record(), failures={"mine": "mine: it crashed"})
    assert repr(failed) == "<Result dive: RMS error ekf 1.00 m, mine failed>"
    record = make_record()
    record.values["ekf.position"][50] = np.nan
    broken = Result(RunDescription("dive", {}, ("ekf",)), record)
    assert repr(broken) == "<Result dive: with a broken estimate; see errors>"


def test_lines_are_true(things: dict[str, Any]) -> None:
    found = things["limits"].verdict()
    assert f"of {len(things['limits'].epoch_ns)} epochs: {found}" in repr(things["limits"])
    assert "of 21 instants, 0 to 20 s: target, platform, acoustics" in repr(things["record"])
    assert repr(things["study"]) == "<Study arms <1>: 2 factors, 4 points × 3 = 12 runs>"
    assert repr(things["scenario"]) == "<Scenario realistic-dive: A realistic dive>"
    assert "mean (19×22)" in repr(things["track"])
    assert repr(things["estimate"]) == "<Estimate at 2.0 s: epoch, position, covariance>"
    first = things["analysis"].ranked()["effect"].iloc[0]
    assert f"of 12 runs, effects on {things['analysis'].response}: " in repr(things["analysis"])
    assert f" {first:+.3g}, " in repr(things["analysis"])
    assert things["advice"].statistic in repr(things["advice"])
    speed = things["calibration"].known_distance.value
    assert f"speed of sound: {speed:.1f} ± " in repr(things["calibration"])


def test_an_identified_device_says_which_beacon_has_which_number(things: dict[str, Any]) -> None:
    said = "numbers of the beacons: 1 is B0, 2 is B1, 3 is B2, 4 is B3"
    assert said in things["device"].remarks


PAGES = (
    "result", "smoothed", "study", "analysis", "advice", "calibration", "contents", "processed",
    "device",
)


@pytest.mark.parametrize("kind", PAGES)
def test_pages_are_whole_and_have_no_colours(things: dict[str, Any], kind: str) -> None:
    import html5lib

    page = things[kind]._repr_html_()
    html5lib.HTMLParser(strict=True).parseFragment(page)
    for fixed in ("color", "#fff", "background", "<script", "<style", "nan", 'border="1"'):
        assert fixed not in page
    assert "<1>" not in page
    assert "<2>" not in page


def test_the_page_of_a_result_begins_with_a_row_for_each_receiver(things: dict[str, Any]) -> None:
    result: Result = things["result"]
    shown, _, folded = result._repr_html_().partition("<details>")
    (table,) = pd.read_html(io.StringIO(shown), index_col=0)
    assert table.index.tolist()[-2:] == ["coupled", "raw"]
    rms = float(result.errors.loc[("coupled", "absolute", "total"), "rms_m"])  # type: ignore[arg-type]
    within = result.percentiles.loc[("coupled", "absolute", "total"), "p95_m"]
    numbers = table.loc["coupled"].to_numpy(float)[:2]
    assert numbers.tolist() == pytest.approx([rms, within], abs=6e-3)
    assert folded.count("<details>") == 2  # the rest is folded, too
    assert folded.count("<table") == 2


def shown(thing: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """What a notebook would show, without any magic."""
    formats, about = DisplayFormatter().format(thing)
    return formats, about


PLOTS = ("plot_path", "plot_path_3d", "plot_axes", "plot_errors", "plot_inclination")


@pytest.mark.parametrize("name", PLOTS)
def test_a_plot_is_one_picture(things: dict[str, Any], name: str) -> None:
    picture = getattr(things["result"], name)()
    formats, about = shown(picture)
    assert formats.keys() == {"text/plain", "image/png"}
    assert formats["text/plain"].startswith("<Picture of ")
    png = formats["image/png"]
    assert png.startswith(b"\x89PNG")
    size = struct.unpack(">II", png[16:24])
    shown_size = about["image/png"]["width"], about["image/png"]["height"]
    assert size == pytest.approx([2 * length for length in shown_size], abs=2)
    inches = picture.figure.get_size_inches()
    assert shown_size == pytest.approx([100 * inch for inch in inches], abs=1)
    assert all(ax.figure is picture.figure for ax in picture.axes)


@pytest.mark.parametrize("name", ["pareto", "main_effects", "interactions", "residuals", "box_cox"])
def test_a_plot_of_an_analysis_is_one_picture(things: dict[str, Any], name: str) -> None:
    picture = getattr(things["analysis"], f"plot_{name}")()
    assert "image/png" in shown(picture)[0]


def test_other_plots_are_pictures(things: dict[str, Any]) -> None:
    assert "image/png" in shown(things["calibration"].plot())[0]
    assert "image/png" in shown(things["smoothed"].plot_path())[0]
    assert "image/png" in shown(things["contents"].plot())[0]


def test_axes_of_the_user_are_shown_by_who_made_them(things: dict[str, Any]) -> None:
    figure = Figure()
    FigureCanvasAgg(figure)
    ax = figure.subplots()
    picture = things["result"].plot_path(ax)
    assert picture.figure is figure
    assert picture.axes == (ax,)
    assert shown(picture)[0].keys() == {"text/plain"}
    inner = figure.subfigures().subplots(3, 1)
    assert things["result"].plot_axes(inner).figure is figure


def test_a_picture_can_be_saved(things: dict[str, Any], tmp_path: Path) -> None:
    picture = things["result"].plot_errors(theme="dark")
    assert isinstance(picture, Picture)
    picture.figure.savefig(tmp_path / "errors.png")
    assert (tmp_path / "errors.png").stat().st_size > 10_000


def test_a_listing_is_a_mapping_that_prints_as_a_table() -> None:
    listing = Listing({"long-name": "First", "b": "Second <2>"})
    assert list(listing) == ["long-name", "b"]
    assert listing["b"] == "Second <2>"
    assert repr(listing) == str(listing) == "long-name  First\nb          Second <2>"
    assert ">b</th>" in listing._repr_html_()
    assert ">Second &lt;2&gt;</td>" in listing._repr_html_()
    assert (len(listing), repr(Listing({}))) == (2, "")


def test_completion_offers_public_names(things: dict[str, Any]) -> None:
    names = {**things, "sblcosim": sblcosim, "platform": things["scenario"].platform}

    def after(text: str) -> list[str]:
        completer = IPCompleter(InteractiveShell.instance(), namespace=names, use_jedi=False)
        with provisionalcompleter():
            return [c.text for c in completer.completions(text, len(text))]

    assert {".run", ".scenarios", ".PythonComponent", ".Overrides"} <= {*after("sblcosim.")}
    assert {*after("result.plot_")} == {f".{name}" for name in PLOTS}
    assert ".arm_length_m" in after("platform.a")
    assert len(after("result.")) <= 47
