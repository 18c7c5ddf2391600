from __future__ import annotations

import re
from itertools import combinations

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Text
from mpl_toolkits.mplot3d import proj3d
from PIL import Image
from sblcosim import style
from sblcosim.data.arms import LONGEST_ARM, are_far
from sblcosim.data.record import Record
from sblcosim.errors import ConfigurationError
from sblcosim.limits.verdict import Limits
from sblcosim.results.figures import drawing
from sblcosim.results.figures import run as plots
from synthetic_record import make_record, silent, track

pytestmark = pytest.mark.filterwarnings(
    "error::UserWarning",  # of a failed layout
    "ignore::DeprecationWarning",  # of libraries for each other, some of which are both
)
RECEIVERS = ("ekf", "sequential", "raw")
SEEN = {
    "by most": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                   [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                     [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
                   [0.004733, 0.691367, 0.303900]],
}  # fmt: skip
"""Matrices of linear RGB."""


@pytest.fixture
def run():
    rng = np.random.default_rng(4)
    record = make_record({name: rng.normal(0, 0.2, (99, 3)) for name in RECEIVERS})
    return record, {name: track(record, name) for name in RECEIVERS}


def figures(record, tracks, theme="light"):
    return {
        "path": [plots.plot_path(record, tracks, theme=theme)],
        "path_3d": [plots.plot_path_3d(record, tracks, theme=theme)],
        "axes": plots.plot_axes(record, tracks, theme=theme),
        "errors": plots.plot_errors(record, tracks, theme=theme),
        "inclination": plots.plot_inclination(record, theme=theme),
        "range_test": plots.plot_range_test(
            np.array([0.0, 50, 100]), np.array([0.1, 50.1, 99.9]), np.full(3, 0.1), (0.1, 0.998),
            theme=theme,
        ),
    }


def luminance(colour):
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4
              for c in to_rgb(colour)]
    return np.dot(linear, [0.2126, 0.7152, 0.0722])


def contrast(a, b):
    low, high = sorted((luminance(a), luminance(b)))
    return (high + 0.05) / (low + 0.05)


def legend_of(ax):
    return [text.get_text() for text in ax.figure.legends[0].get_texts()]


def title_of(ax):
    return " ".join(ax.figure.get_suptitle().split())


def labels_of(ax):
    return {text.get_text() for text in ax.texts}


def colour_blind(colour, kind):
    """CIELAB of a colour as seen by people; Machado, Oliveira and Fernandes 2009, severity 1."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in to_rgb(colour)]
    rgb = np.clip(np.array(SEEN[kind]) @ linear, 0, 1)
    xyz = np.array([[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750],
                    [0.0193339, 0.1191920, 0.9503041]]) @ rgb / [0.95047, 1, 1.08883]
    x, y, z = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def test_map_has_east_to_the_right_and_north_up_at_equal_scale(run):
    record, tracks = run
    ax = plots.plot_path(record, tracks)
    truth = next(line for line in ax.lines if line.get_label() == "true path")
    position = record.values["target.position"]
    np.testing.assert_array_equal(truth.get_xdata(), position[:, 1])
    np.testing.assert_array_equal(truth.get_ydata(), position[:, 0])
    assert ax.get_aspect() == 1
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("East y [m]", "North x [m]")
    assert {"start", "end"} <= labels_of(ax)


def test_every_receiver_is_in_every_figure_of_estimates(run):
    for name in ("path", "path_3d", "axes", "errors"):
        assert set(RECEIVERS) <= set(legend_of(figures(*run)[name][0]))


def test_raw_fix_is_dots_and_filters_are_lines_that_differ_in_colour_and_style(run):
    lines = {line.get_label(): line for line in plots.plot_path(*run).lines}
    assert lines["raw"].get_linestyle() == "None"
    assert lines["raw"].get_marker() == "."
    ekf, sequential = lines["ekf"], lines["sequential"]
    assert ekf.get_color() != sequential.get_color()
    assert ekf.get_linestyle() != sequential.get_linestyle()


def test_depth_grows_downwards(run):
    record, tracks = run
    bottom, top = plots.plot_axes(record, tracks)[2].get_ylim()
    assert bottom > top
    low, high = plots.plot_path_3d(record, tracks).get_zlim()
    assert low > high


def test_axes_over_time_name_coordinate_and_unit(run):
    axes = plots.plot_axes(*run)
    assert [ax.get_ylabel() for ax in axes] == ["North x [m]", "East y [m]", "Depth z [m]"]
    assert axes[-1].get_xlabel() == "Time [s]"


def test_errors_come_with_two_sigma_of_each_filter(run):
    record, tracks = run
    axes = plots.plot_errors(record, tracks)
    assert len(axes) == 4
    for ax in axes[:3]:
        bands = [band.get_paths()[0].vertices[:, 1] for band in ax.collections]
        edges = [line for line in ax.lines if line.get_zorder() == 1.5]
        assert len(bands) == len(edges) == 2
        for band in (*bands, *(np.array(line.get_ydata()) for line in edges)):
            assert np.nanmax(band) == pytest.approx(2 * 0.5)
            assert np.nanmin(band) == pytest.approx(-2 * 0.5)
        assert {line.get_color() for line in edges} == set(style.THEMES["light"].receivers[:2])
        # above all bands, so that none covers another's edge
        assert max(band.get_zorder() for band in ax.collections) < 1.5
    assert not axes[3].collections
    assert axes[3].get_ylim()[0] == 0


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_what_many_filters_claim_are_lines_and_not_one_grey(count):
    record = make_record()
    tracks = {f"ekf-{n}": track(record, "ekf") for n in range(count)}
    ax = plots.plot_errors(record, tracks)[0]
    assert len(ax.collections) == (count if count <= 2 else 0)
    edges = [line for line in ax.lines if line.get_zorder() == 1.5]
    assert len({line.get_color() for line in edges}) == len(edges) == count
    word = "bands" if count <= 2 else "thin lines"
    assert f"{word}: claimed ±2σ" in title_of(ax)


def test_errors_relative_to_the_platform_are_drawn_as_such():
    record = make_record(platform_error=(0.25, 0.0, 0.0))
    tracks = {"ekf": track(record, "ekf")}
    for frame, error in (("absolute", 1.0), ("relative", 0.75)):
        ax = plots.plot_errors(record, tracks, frame=frame)[0]
        line = next(line for line in ax.lines if line.get_label() == "ekf")
        np.testing.assert_allclose(line.get_ydata(), error)
        title = title_of(ax)
        assert ("relative to the platform as it reports itself" in title) == (frame == "relative")


def test_own_relative_errors_are_drawn_of_who_has_them_with_their_own_bands():
    record = make_record({"ekf": np.ones((1, 3)), "other": np.ones((1, 3))})
    away = record.values["target.position"][record.values["ekf.update_count"]]
    values = {
        **record.values, "ekf.relative_position": away + 0.25,
        "ekf.relative_covariance": np.tile(np.diag([4.0, 4.0, 4.0]), (101, 1, 1)),
    }
    record = type(record)(record.time_ns, values)
    tracks = {name: track(record, name) for name in ("ekf", "other")}
    ax = plots.plot_errors(record, tracks, frame="own_relative")[0]
    (line,) = [line for line in ax.lines if not line.get_label().startswith("_")]
    assert line.get_label() == "ekf"
    np.testing.assert_allclose(line.get_ydata(), 0.25)
    (band,) = ax.collections
    assert band.get_paths()[0].vertices[:, 1].max() == pytest.approx(4.0)
    title = title_of(ax)
    assert "relative to the platform's true position, by the receiver's own account" in title
    with pytest.raises(ConfigurationError, match="which needs an output relative_position"):
        plots.plot_errors(record, {"other": tracks["other"]}, frame="own_relative")


def test_wild_raw_fixes_do_not_squeeze_the_filter_and_are_admitted_to():
    raw = np.full((99, 3), 0.1)
    raw[50] = 1e4
    record = make_record({"ekf": np.full((99, 3), 0.1), "raw": raw})
    tracks = {name: track(record, name) for name in ("ekf", "raw")}
    ax = plots.plot_errors(record, tracks)[0]
    assert ax.get_ylim()[1] < 2
    assert "outside the figure: raw (1 of 99)" in title_of(ax)
    assert "ekf" not in title_of(ax)
    assert plots.plot_path(record, tracks).get_ylim()[1] < 20


def test_estimate_that_runs_away_leaves_the_figures_and_they_say_so():
    record = make_record({"ekf": np.linspace(0, 1e6, 99)[:, None] * [1, 1, 1]})
    tracks = {"ekf": track(record, "ekf")}
    path = plots.plot_path(record, tracks)
    assert np.ptp(path.get_xlim()) < 100
    space = plots.plot_path_3d(record, tracks)
    for ax in (path, space):
        assert "outside the figure: ekf (98 of 99)" in title_of(ax)
    second = {"steady": track(make_record({"steady": np.zeros((1, 3))}), "steady"), **tracks}
    ax = plots.plot_axes(record, second)[0]
    assert np.ptp(ax.get_ylim()) < 100
    assert "outside the figure: ekf (98 of 99)" in title_of(ax)
    assert plots.plot_axes(record, tracks)[0].get_ylim()[1] > 1e6  # the main one is never cut


def drawn_inside(legend, figure):
    extent = legend.get_window_extent()
    return 0 <= extent.x0 < extent.x1 <= figure.bbox.width and extent.y1 <= figure.bbox.height


@pytest.mark.parametrize(
    "names",
    [("ekf", "LastBeacon", "sequential", "raw"),
     ("a_name_" * 12, *(f"another_filter_{i}" for i in range(6)))],
)
def test_legend_of_many_receivers_is_inside_of_the_figure(names):
    record = make_record({name: np.zeros((1, 3)) for name in names})
    for axes in figures(record, {name: track(record, name) for name in names}).values():
        figure = axes[0].figure
        figure.draw_without_rendering()
        for legend in figure.legends:
            assert drawn_inside(legend, figure)


def test_long_name_is_shortened_in_the_legend_by_its_middle():
    names = ("first_" * 20 + "v1", "first_" * 20 + "v2")
    record = make_record({name: np.zeros((1, 3)) for name in names})
    tracks = {name: track(record, name) for name in names}
    words = legend_of(plots.plot_errors(record, tracks)[0])
    assert len(words) == 2
    for name, word in zip(names, words, strict=True):
        begin, end = word.split("…")
        assert len(word) <= 32
        assert name.startswith(begin)
        assert name.endswith(end)


def test_no_two_of_many_receivers_look_equal():
    names = [f"filter {i}" for i in range(12)]
    record = make_record({name: np.zeros((1, 3)) for name in names})
    ax = plots.plot_path_3d(record, {name: track(record, name) for name in names})
    lines = [line for line in ax.lines if line.get_label() in names]
    looks = [(line.get_color(), line.get_marker()) for line in lines]
    assert len(set(looks)) == 12
    assert [line.get_marker() for line in lines[:5]] == [""] * 5


def test_truth_lies_thinly_on_top_of_the_estimates_in_path_and_axes(run):
    record, tracks = run
    for ax in (plots.plot_path(record, tracks), plots.plot_path_3d(record, tracks),
               plots.plot_axes(record, tracks)[0]):
        lines = {line.get_label(): line for line in ax.lines}
        truth = lines.get("true path") or lines["truth"]
        for name in ("ekf", "sequential"):
            assert truth.get_zorder() > lines[name].get_zorder()
            assert truth.get_linewidth() < lines[name].get_linewidth()


def with_path(position):
    record = make_record()
    return Record(record.time_ns, {**record.values, "target.position": position})


def test_start_and_end_of_a_closed_path_share_their_text():
    turn = np.linspace(0, 2 * np.pi, 101)
    circle = np.column_stack([15 * np.sin(turn), 15 * np.cos(turn), np.full(101, 5.0)])
    for position, words in ((circle, {"start, end"}), (circle[:50], {"start", "end"})):
        rows = np.resize(np.arange(len(position)), 101) if len(position) == 101 else np.minimum(
            np.arange(101), 49
        )
        record = with_path(position[rows])
        for draw in (plots.plot_path, plots.plot_path_3d):
            labels = labels_of(draw(record, {}))
            assert {label for label in labels if not label[0].isdigit()} == words


def test_path_in_space_marks_its_ends_and_states_that_depth_is_stretched():
    flat = np.linspace(0, 1, 101)[:, None] * [100.0, 40.0, 4.0]
    ax = plots.plot_path_3d(with_path(flat), {})
    assert {"o", "s"} <= {line.get_marker() for line in ax.lines}
    times = 0.35 * np.ptp(ax.get_ylim()) / np.ptp(ax.get_zlim())
    assert times > 5
    assert title_of(ax) == f"Path in space; depth ×{times:.2g}"


def test_path_in_space_at_equal_scale_speaks_of_no_stretching():
    dive = np.linspace(0, 1, 101)[:, None] * [10.0, 10.0, 20.0]
    assert "depth ×" not in title_of(plots.plot_path_3d(with_path(dive), {}))


def test_path_in_space_is_not_clipped_to_the_axes_square(run):
    assert not any(line.get_clip_on() for line in plots.plot_path_3d(*run).lines)


@pytest.mark.parametrize(("swing", "name"), [(0.01, "beacons"), (2.0, "beacons (mean)")])
def test_beacons_of_a_moving_platform_are_named_as_a_mean(swing, name):
    record = make_record()
    beacons = record.values["platform.beacon_position"].copy()
    beacons[:, :, 0] += swing * np.sin(record.time_ns / 1e9)[:, None]
    record = Record(record.time_ns, {**record.values, "platform.beacon_position": beacons})
    for draw in (plots.plot_path, plots.plot_path_3d):
        assert legend_of(draw(record, {}))[0] == name


def test_coarsely_sampled_waves_are_dots_and_the_title_says_so(run):
    record, _ = run
    assert "sampled" not in title_of(plots.plot_inclination(record)[0])
    coarse = Record(record.time_ns * 10, record.values)
    ax = plots.plot_inclination(coarse)[0]
    assert ax.lines[0].get_linestyle() == "None"
    assert title_of(ax).endswith("first 60 s, sampled every 1 s")


def test_inclination_is_in_degrees_and_says_if_it_is_cut_off(run):
    record, _ = run
    axes = plots.plot_inclination(record, window_s=5.0)
    assert [ax.get_ylabel() for ax in axes] == ["Roll [°]", "Pitch [°]", "Yaw [°]"]
    roll = axes[0].lines[0]
    np.testing.assert_allclose(
        roll.get_ydata(), np.rad2deg(record.values["platform.attitude"][:51, 0])
    )
    assert "first 5 s" in title_of(axes[0])
    assert "first" not in title_of(plots.plot_inclination(record)[0])


def test_what_the_platform_reports_of_its_angles_is_under_its_motion(run):
    record, _ = run
    assert len(plots.plot_inclination(record)) == 3  # it reports nothing else
    wrong = record.values["platform.attitude"] + np.deg2rad([0.5, -1.0, 359.0])
    record = Record(record.time_ns, {**record.values, "platform.reported_attitude": wrong})
    *_, errors = plots.plot_inclination(record)
    found = {line.get_label(): line.get_ydata() for line in errors.lines[:3]}
    for name, error in {"roll": 0.5, "pitch": -1.0, "yaw": -1.0}.items():
        np.testing.assert_allclose(found[name], error, atol=1e-9)
    assert errors.get_ylabel() == "Reported − true [°]"
    assert len(plots.plot_inclination(record, list(Figure().subplots(3)))) == 3


# --- Maps ----------------------------------------------------------------------------------------


def test_the_platform_as_reported_stands_beside_the_true_one():
    off = np.array([1.0, 2.0, 0.0])
    record = make_record(platform_error=tuple(off))
    ax = plots.plot_path(record, {"ekf": track(record, "ekf")})
    lines = {line.get_label(): np.array(line.get_xydata()) for line in ax.lines}
    true, reported = lines["beacons"], lines["beacons as reported (mean)"]
    np.testing.assert_allclose(reported - true, [off[[1, 0]]] * 2)
    np.testing.assert_allclose(lines["platform as reported"], [off[[1, 0]]] * 101, atol=1e-12)
    exact = plots.plot_path(make_record(), {})
    assert not any("reported" in word for word in legend_of(exact))


def test_dots_of_the_platform_do_not_hide_its_beacons_on_small_maps():
    record = make_record(platform_error=(1.0, 2.0, 0.0))

    def dot(count: int) -> float:
        tracks = {f"filter {i}": track(record, "ekf") for i in range(count)}
        lines = plots.plot_path(record, tracks).lines
        return next(line for line in lines if line.get_label() == "platform as reported").get_ms()

    assert dot(5) < dot(1) / 2


def test_the_legend_tells_dots_from_a_mark_in_time(run):
    """One large dot would be a mark every so often."""
    record = make_record(platform_error=(1.0, 2.0, 0.0))
    raw = make_record({"raw": np.random.default_rng(1).normal(0, 0.2, (99, 3))})
    ax = plots.plot_path(record, {"raw": track(raw, "raw")})
    mark = next(x for x in ax.lines if x.get_marker() == "o" and len(x.get_xdata()) > 1)
    (legend,) = ax.figure.legends
    names = [text.get_text() for text in legend.get_texts()]
    shown = dict(zip(names, legend.legend_handles, strict=True))
    for name in ("platform as reported", "raw"):
        dots = shown[name]
        assert len(dots.get_xdata()) == 3
        assert dots.get_markevery() is None  # all three are drawn
        assert dots.get_markersize() / 2 < mark.get_markersize()  # a point's radius is a quarter


def test_beacons_in_space_stand_above_their_places_on_the_floor():
    record = make_record()
    ax = plots.plot_path_3d(record, {})
    floor = ax.get_zlim()[0]
    beacons = record.values["platform.beacon_position"][0]
    drops = [np.array(line.get_data_3d()).T for line in ax.lines if line.get_marker() == "."]
    assert len(drops) == len(beacons)
    for (north, east, down), drop in zip(beacons, drops, strict=True):
        np.testing.assert_allclose(drop, [[east, north, down], [east, north, floor]], atol=1e-9)
        assert floor > down


def test_arrowheads_point_where_the_diver_goes_and_marks_say_when(run):
    record, _ = run  # north at 0.5 m/s for 10 s
    ax = plots.plot_path(record, {})
    (arrows,) = ax.collections
    np.testing.assert_allclose(np.column_stack([arrows.U, arrows.V]), [[0, 1]] * 5, atol=1e-9)
    assert labels_of(ax) == {"start", "2 s", "4 s", "6 s", "8 s", "end"}
    assert title_of(ax) == "Map, with a mark every 2 s"
    marks = next(x for x in ax.lines if x.get_marker() == "o" and len(x.get_xdata()) > 1)
    np.testing.assert_allclose(marks.get_xydata(), [[10, 0.5 * t] for t in (2, 4, 6, 8)])


@pytest.mark.parametrize(("start_s", "factor", "marks_s", "title"), [
    (3.2, 1.0, [6, 8, 10, 12], "2 s"), (-3.7, 1.0, [-2, 0, 2, 4], "2 s"),
    (100.0, 0.1, [100.2, 100.4, 100.6, 100.8], "0.2 s"), (1000.0, 30.0, [1080, 1140, 1200, 1260],
                                                         "1 min"),
])  # fmt: skip
def test_marks_in_time_are_at_whole_multiples_wherever_a_run_starts(
    run, start_s, factor, marks_s, title
):
    """And none within half a step of the start, or a quarter of one of the end."""
    time_s = start_s + factor * run[0].time_ns / 1e9
    record = Record((1e9 * time_s).round().astype(np.int64), run[0].values)
    ax = plots.plot_path(record, {})
    assert title_of(ax) == f"Map, with a mark every {title}"
    marks = next(x for x in ax.lines if x.get_marker() == "o" and len(x.get_xdata()) > 1)
    north = [0.5 * (t - start_s) / factor for t in marks_s]
    np.testing.assert_allclose(marks.get_ydata(), north, atol=1e-9)


def test_a_diver_at_rest_has_no_direction():
    record = with_path(np.tile([1.0, 2.0, 3.0], (101, 1)))
    assert not plots.plot_path(record, {}).collections


def inches_of(text):
    if hasattr(text, "get_position_3d"):  # a text in space has its place in the plane while drawn
        flat = proj3d.proj_transform(*text.get_position_3d(), text.axes.get_proj())
        Text.set_position(text, flat[:2])
    extent = text.get_window_extent(text.figure.canvas.get_renderer())
    return extent.transformed(text.figure.dpi_scale_trans.inverted())


@pytest.mark.parametrize("draw", [plots.plot_path, plots.plot_path_3d])
def test_labels_stand_off_the_curves_and_off_each_other(draw):
    turn = np.linspace(0, 6 * np.pi, 101)
    spiral = np.column_stack([turn * np.sin(turn), turn * np.cos(turn), 2 + turn / 4])
    record = with_path(spiral)
    ax = draw(record, {"ekf": track(record, "ekf")})
    ax.figure.draw_without_rendering()
    boxes = [inches_of(text) for text in ax.texts]
    truth = next(line for line in ax.lines if line.get_label() == "true path")
    curve = truth.get_transform().transform(truth.get_xydata()) / ax.figure.dpi
    assert len(boxes) >= 2
    for box in boxes:
        assert not any(box.contains(*point) for point in curve)
    for one, other in combinations(boxes, 2):
        assert not one.overlaps(other)


def test_more_than_three_filters_have_a_map_each_on_common_axes():
    names = ("a", "b", "c", "d", "raw")
    record = make_record({name: np.full((99, 3), 0.1) for name in names})
    tracks = {name: track(record, name) for name in names}
    first = plots.plot_path(record, tracks)
    maps = [ax for ax in first.figure.axes if ax.axison]
    assert [ax.get_title("left") for ax in maps] == list(names)
    assert len({(ax.get_xlim(), ax.get_ylim()) for ax in maps}) == 1
    colours = [{line.get_color() for line in ax.lines} for ax in maps[:4]]
    for own, colour in zip(colours, style.THEMES["light"].receivers, strict=False):
        assert own & set(style.THEMES["light"].receivers) == {colour}
    together = plots.plot_path(record, dict(list(tracks.items())[:3]))
    assert len(together.figure.axes) == 1
    given = Figure().add_subplot()
    assert plots.plot_path(record, tracks, given) is given
    assert len(given.figure.axes) == 1


def boxes(axes):
    """Left, lower, right and upper ends of axes in their figure [inch]."""
    size = axes[0].figure.get_size_inches()
    ends = np.array([ax.get_position(original=True).get_points() for ax in axes])
    return (ends * size).reshape(len(axes), 4)


def test_panels_have_their_heights_and_the_figure_its_margins(run):
    found = figures(*run)
    heights = {"axes": [1.45] * 3, "errors": [1.45] * 4, "range_test": [2.5, 1.3]}
    heights["inclination"] = [1.45] * len(found["inclination"])
    for name, expected in heights.items():
        left, low, right, high = boxes(found[name]).T
        assert high - low == pytest.approx(expected), name
        assert low[:-1] - high[1:] == pytest.approx([drawing.GAP] * (len(low) - 1)), name
        assert low[-1] == pytest.approx(drawing.BOTTOM), name
        assert left == pytest.approx(np.full(len(low), drawing.LEFT)), name
        assert right == pytest.approx(np.full(len(low), drawing.WIDTH - drawing.RIGHT)), name


@pytest.mark.parametrize("count", [4, 5, 6])
def test_maps_beside_and_above_each_other_are_equally_far_apart(count):
    names = "abcdef"[:count]
    record = make_record({name: np.full((99, 3), 0.1) for name in names})
    tracks = {name: track(record, name) for name in names}
    axes = plots.plot_path(record, tracks).figure.axes
    rows, columns = axes[0].get_gridspec().get_geometry()
    places = boxes(axes).reshape(rows, columns, 4)
    left, low, right, high = np.moveaxis(places, 2, 0)
    assert left[:, 1:] - right[:, :-1] == pytest.approx(np.full((rows, columns - 1), drawing.GAP))
    between = drawing.GAP + drawing.title_height("a name")
    assert low[:-1] - high[1:] == pytest.approx(np.full((rows - 1, columns), between))
    assert left[:, 0] == pytest.approx(np.full(rows, drawing.LEFT))
    assert low[-1] == pytest.approx(np.full(columns, drawing.BOTTOM))


@pytest.mark.parametrize("depth", [0.0, 5.0, 40.0])
def test_the_box_in_space_fills_the_figure(depth):
    path = np.linspace(0, 1, 101)[:, None] * [30.0, 20.0, depth]
    ax = plots.plot_path_3d(with_path(path), {})
    ax.figure.draw_without_rendering()
    low, high = np.array(ax.get_tightbbox(ax.figure.canvas.get_renderer()).get_points())
    legend = ax.figure.legends[0].get_window_extent()
    assert low.min() >= 0
    assert high[0] <= ax.figure.bbox.width
    assert (high[0] - low[0]) / ax.figure.bbox.width > 2 / 3
    assert (high[1] - low[1]) / legend.y0 > 2 / 3


def test_the_title_in_space_is_as_far_from_the_top_whatever_the_height():
    found = []
    for depth in (0.0, 5.0, 40.0):
        path = np.linspace(0, 1, 101)[:, None] * [30.0, 20.0, depth]
        figure = plots.plot_path_3d(with_path(path), {}).figure
        words = figure.get_suptitle()
        (title,) = (text for text in figure.findobj(Text) if text.get_text() == words)
        found.append((figure.bbox.height - title.get_window_extent().y1) / figure.dpi)
    assert found == pytest.approx([found[0]] * 3, abs=1e-6)


def test_dots_are_one_element_of_an_svg_and_are_seen_in_both_files(run, tmp_path):
    record, tracks = run
    ax = plots.plot_path(record, {"raw": tracks["raw"]})
    style.save(ax, tmp_path, "dots")
    assert (tmp_path / "dots.svg").read_text().count("<use") < 200
    grey = np.array(Image.open(tmp_path / "dots.png").convert("RGB"), dtype=int)
    dots = (abs(grey - 0x8C) < 16).all(axis=2)
    assert dots.sum() > 500


def test_range_test_shows_what_is_left_over():
    distance = np.array([0.0, 50, 100])
    above, below = plots.plot_range_test(distance, distance + 0.2, np.full(3, 0.1), (0.2, 1.0))
    assert above.get_ylabel() == "Measured range [m]"
    assert below.get_xlabel() == "True distance [m]"
    assert not any("…" in word for word in legend_of(above))
    line = next(line for line in below.lines if line.get_label() == "fitted line")
    np.testing.assert_allclose(line.get_ydata(), 0.2)


def test_figures_draw_into_given_axes_and_return_them(run):
    record, tracks = run
    figure = Figure()
    ax = figure.add_subplot()
    assert plots.plot_path(record, tracks, ax) is ax
    panels = list(Figure().subplots(4))
    assert list(plots.plot_errors(record, tracks, panels)) == panels
    assert panels[0].get_legend() is not None
    with pytest.raises(ValueError, match="must be 3 axes, got 4"):
        plots.plot_axes(record, tracks, panels)


def test_no_text_is_under_eight_points(run):
    for axes in figures(*run).values():
        axes[0].figure.draw_without_rendering()
        for text in axes[0].figure.findobj(Text):
            assert text.get_fontsize() >= 8, text.get_text()


def test_global_settings_of_matplotlib_stay_as_they_were(run, tmp_path):
    before = dict(mpl.rcParams)
    style.save(figures(*run, theme="dark")["path"][0], tmp_path, "x")
    assert dict(mpl.rcParams) == before


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_colours_stand_out_from_their_paper(theme):
    look = style.THEMES[theme]
    assert contrast(look.ink, look.paper) > 15
    assert min(contrast(colour, look.paper) for colour in look.receivers[:3]) > 3


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("kind", SEEN)
def test_the_colour_blind_tell_lines_and_dots_apart(theme, kind):
    """2.3 is just noticeable side by side; thin lines take several times that."""
    look = style.THEMES[theme]
    lines = [colour_blind(colour, kind) for colour in (look.ink, *look.receivers)]
    dots = colour_blind(look.soft, kind)
    apart = [np.linalg.norm(a - b) for a, b in combinations(lines, 2)]
    assert min(apart) > 15
    assert min(np.linalg.norm(dots - line) for line in lines) > 9  # that are no lines, besides


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_figures_have_the_paper_of_their_theme(run, theme):
    for axes in figures(*run, theme=theme).values():
        assert axes[0].figure.get_facecolor()[:3] == to_rgb(style.THEMES[theme].paper)


def test_saved_figures_are_the_same_bytes_each_time(run, tmp_path):
    for turn in ("a", "b"):
        (tmp_path / turn).mkdir()
        for name, axes in figures(*run).items():
            style.save(axes[0], tmp_path / turn, name)
    files = sorted((tmp_path / "a").iterdir())
    assert len(files) == 12
    for file in files:
        content = file.read_bytes()
        assert content == (tmp_path / "b" / file.name).read_bytes(), file.name
        assert content.startswith(b"\x89PNG" if file.suffix == ".png" else b"<?xml")


def test_run_without_a_fix_has_its_time_axis_and_says_so():
    record = silent("ekf")
    drawn = figures(record, {"ekf": track(record, "ekf")})
    for axes in drawn.values():
        axes[0].figure.draw_without_rendering()
    for name in ("path", "path_3d", "axes", "errors"):
        ax = drawn[name][0]
        assert "no fix: ekf" in title_of(ax)
    for name in ("axes", "errors"):
        np.testing.assert_allclose(drawn[name][-1].get_xlim(), [-0.1, 10.1])


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_a_single_estimate_is_a_mark(run, theme):
    """A line through one point would be nothing, and so would be a band."""
    record, tracks = run
    one = {name: table.iloc[:1] for name, table in tracks.items()}
    drawn = figures(record, one, theme)
    for name in ("path", "path_3d", "axes", "errors"):
        for ax in drawn[name]:
            for label in ("ekf", "sequential"):
                (line,) = (it for it in ax.lines if it.get_label() == label)
                assert line.get_marker() in style.MARKERS[1:], (name, label)
    assert "band" not in title_of(drawn["errors"][0])


def test_single_estimates_of_many_receivers_are_different_marks(run):
    many = {f"filter {i}": run[1]["ekf"].iloc[:1] for i in range(3 * len(style.MARKERS))}
    marks = [how["marker"] for _, _, how in drawing.lines_of(many, style.named("light"))]
    visible = len(style.MARKERS) - 1
    assert "" not in marks
    for first in range(len(marks) - visible + 1):
        assert len({*marks[first : first + visible]}) == visible


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("away", [0.0, 96.0])
def test_beacons_are_far_beyond_the_longest_arm(axis, away):
    ends = away + np.outer([1.0, -1.0], LONGEST_ARM * np.eye(3)[axis])
    assert not are_far(ends)
    assert are_far(ends + np.outer([1.0, -1.0], 1e-9 * np.eye(3)[axis]))


def test_run_without_a_fix_speaks_of_no_bands():
    record = silent("ekf")
    count = len(record.time_ns)
    each = np.tile(np.eye(3), (count, 1, 1))
    possible = Limits(record.time_ns, each, each, np.zeros(count), np.zeros(count, bool), 0.01,
                      is_bound=False)
    ax = plots.plot_errors(record, {"ekf": track(record, "ekf")}, reference=possible)[0]
    assert "band" not in title_of(ax)
    assert legend_of(ax) == ["ekf"]


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_raw_dots_stand_out_from_their_paper(run, theme):
    line = next(x for x in plots.plot_path(*run, theme=theme).lines if x.get_label() == "raw")
    paper, alpha = np.array(to_rgb(style.THEMES[theme].paper)), line.get_alpha()
    assert contrast(alpha * np.array(to_rgb(line.get_color())) + (1 - alpha) * paper, paper) > 3


def test_a_name_that_begins_with_an_underscore_is_in_the_legend():
    record = make_record({"_mine": np.zeros((1, 3))})
    ax = plots.plot_errors(record, {"_mine": track(record, "_mine")})[0]
    assert [word.strip("\u200b") for word in legend_of(ax)] == ["_mine"]
    ax.figure.draw_without_rendering()


@pytest.mark.parametrize("own", [True, False])
def test_a_name_is_never_read_as_a_formula(own):
    names = (r"$\frac{", r"costs $5$ or \$6", "raw")
    record = make_record({name: np.full((99, 3), 1e3) for name in names})
    tracks = {name: track(record, name) for name in names}
    with mpl.rc_context({"axes.formatter.use_mathtext": True}):
        for draw, count in ((plots.plot_path, 1), (plots.plot_axes, 3), (plots.plot_errors, 4)):
            given = list(Figure(figsize=(20, 20)).subplots(count, squeeze=False).flat)
            drawn = draw(record, tracks, None if own else given if count > 1 else given[0])
            figure = np.atleast_1d(drawn)[0].figure
            figure.draw_without_rendering()
            user_s = [text for text in figure.findobj(Text) if "$5" in text.get_text()]
            assert user_s
            for text in user_s:
                assert not text.get_parse_math()
        plots.plot_path_3d(record, tracks).figure.draw_without_rendering()


def test_equal_figures_have_equal_ids_whatever_the_last_bits_of_their_layout():
    def drawn(shift):
        axes = style.new_figure(4, 3).add_axes((0.1 + shift, 0.1, 0.8, 0.8))
        axes.plot([1, 3, 2], marker="o")
        return style.svg(axes, "name")

    assert drawn(0.0) == drawn(1e-15)
    text = drawn(0.0)
    ids = set(re.findall(r'id="(\w+)"', text))
    used = set(re.findall(r'url\(#(\w+)\)|href="#([\w-]+)"', text))
    assert {one or two for one, two in used} <= {*ids, *re.findall(r'id="([\w-]+)"', text)}
    other = style.svg(style.new_figure(4, 3).add_axes((0.1, 0.1, 0.8, 0.8)), "other")
    clips = re.findall(r'<clipPath id="(\w+)"', text)
    assert clips
    assert not set(clips) & set(re.findall(r'id="(\w+)"', other))  # several are in one report


@pytest.mark.parametrize("label", ["multilateration", "ekf"])
@pytest.mark.parametrize("factor", [3.5, 4.5, 7.5, 50.0])
def test_outliers_of_the_raw_fix_leave_the_limits_alone(label: str, factor: float) -> None:
    """Those whose error is more than four times that of 95 %; a filter has none."""
    errors = np.array([*np.full(99, 0.1), 0.1 * factor])
    table = pd.DataFrame({"x_m": [*np.linspace(0, 1, 99), -30.0], "error_x_m": errors})
    low, high = drawing.limits(np.array([0.0, 1.0]), {label: table}, "x", reach=100.0)
    assert (low < -30) == (label == "ekf" or factor < 4)
    assert high == pytest.approx(1.0 - min(low, 0.0) - 30 if low < -30 else 1.06, abs=0.01)
