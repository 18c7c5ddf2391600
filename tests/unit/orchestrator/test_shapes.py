"""Figures are laid out for runs of any shape and duration: see `shapes.SHAPES`."""

from __future__ import annotations

import numpy as np
import pytest
from drawn_texts import spoiled_texts
from quick import one_in
from sblcosim import style
from sblcosim.results.figures import drawing
from sblcosim.results.figures import run as plots
from shapes import SHAPES, run_of

DRAWN = {
    "map": lambda run: [plots.plot_path(*run)],
    "space": lambda run: [plots.plot_path_3d(*run)],
    "axes": lambda run: plots.plot_axes(*run),
    "errors": lambda run: plots.plot_errors(*run),
}
OFTEN = [("map", name) for name in SHAPES] + [
    (figure, name)
    for figure, turn in (("space", 0), ("axes", 1), ("errors", 2))
    for name in list(SHAPES)[turn::3]
]
RARELY = [(f, n) for f in DRAWN for n in SHAPES if (f, n) not in OFTEN]
NEAR_RAW = [n for n, s in SHAPES.items() if "raw" in s.receivers and s.raw_noise_m < 13]


@one_in(2)
@pytest.mark.parametrize(
    ("figure", "name"),
    [*OFTEN, *(pytest.param(*case, marks=pytest.mark.slow) for case in RARELY)],
)
def test_no_text_is_cut_off_or_lies_on_other_text(figure, name):
    drawn = DRAWN[figure](run_of(SHAPES[name]))[0].figure
    assert spoiled_texts(drawn) == []
    width = drawn.get_figwidth()  # equal widths: type of one size
    assert drawing.WIDTH <= width < 1.12 * drawing.WIDTH


@one_in(2)
@pytest.mark.parametrize("name", SHAPES)
def test_all_of_the_first_receiver_is_within_the_axes_over_time(name):
    run = run_of(SHAPES[name])
    main = run[1][SHAPES[name].receivers[0]]
    for ax, axis in zip(plots.plot_axes(*run), "xyz", strict=True):
        low, high = sorted(ax.get_ylim())
        assert main[f"{axis}_m"].between(low, high).all()


@pytest.mark.parametrize("name", NEAR_RAW)
def test_raw_fixes_are_on_the_map_but_for_outliers(name):
    run = run_of(SHAPES[name])
    ax, raw = plots.plot_path(*run), run[1]["raw"]
    on = raw["x_m"].between(*ax.get_ylim()) & raw["y_m"].between(*ax.get_xlim())
    assert on.mean() > 0.97


@one_in(2)
@pytest.mark.parametrize("name", SHAPES)
def test_marks_in_time_are_labelled_where_they_are(name):
    """Within a third of an inch; and no mark where the path is too short on paper for any."""
    ax = plots.plot_path(*run_of(SHAPES[name]))
    figure = ax.figure
    figure.draw_without_rendering()
    marks = [line for line in ax.lines if line.get_marker() in ("o", "s") and line.zorder > 5]
    points = np.vstack([line.get_xydata() for line in marks])
    at = ax.transData.transform(points) / figure.dpi
    for text in ax.texts:
        box = text.get_window_extent()
        low, high = np.array([box.p0, box.p1]) / figure.dpi
        gap = np.fmax(np.fmax(low - at, at - high), 0)
        assert np.hypot(*gap.T).min() < 1 / 3, text.get_text()
    if name.startswith("rest"):
        assert "mark" not in figure.get_suptitle()


@pytest.mark.parametrize(("name", "unit"), [
    ("three_seconds", "s"), ("straight_east_95_m", "s"), ("north_2_km", "min"),
    ("ten_hours", "h"),
])  # fmt: skip
def test_the_time_axis_has_the_unit_of_the_duration(name, unit):
    shape = SHAPES[name]
    ax = plots.plot_axes(*run_of(shape))[-1]
    assert ax.get_xlabel() == f"Time [{unit}]"
    low, high = ax.get_xlim()
    ticks = [t for t in ax.get_xticks() if low <= t <= high]
    assert 3 <= len(ticks) <= 11
    seconds = {"s": 1, "min": 60, "h": 3600}[unit]
    words = ax.xaxis.get_major_formatter().format_ticks(ticks)
    np.testing.assert_allclose([float(w) * seconds for w in words], ticks, atol=1e-9)


def moments(name):
    """The labels of the marks in time on the map of a shape, in order, and its title."""
    ax = plots.plot_path(*run_of(SHAPES[name]))
    words = [text.get_text() for text in ax.texts]
    return sorted(w for w in words if w[0].isdigit()), ax.figure.get_suptitle()


def test_marks_in_time_are_where_the_diver_moves_and_a_rest_has_one():
    """No heap of marks where the diver waits before or after the dive, or on the way."""
    marks, title = moments("moves_for_a_while")
    assert "with a mark every 5 min" in title
    assert marks == ["15 min", "20 min"]  # of two hours, the diver moves from 10 to 25 min
    marks, title = moments("stops_on_its_way")
    assert "with a mark every 2 min" in title
    assert marks == ["2–6 min"]


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("figure", [plots.plot_path, plots.plot_path_3d])
def test_labels_on_curves_have_a_rim_of_paper(figure, theme):
    ax = figure(*run_of(SHAPES["rest"]), theme=theme)
    assert ax.texts
    for text in ax.texts:
        (rim,) = text.get_path_effects()
        assert rim._gc == {"linewidth": 2.4, "foreground": style.named(theme).paper}


@pytest.mark.parametrize("name", ["deep", "vertical"])
def test_errors_beside_a_deep_dive_are_on_the_map(name):
    record, tracks = run_of(SHAPES[name])
    ax = plots.plot_path(record, tracks)
    assert "outside" not in ax.figure.get_suptitle()
    for table in tracks.values():
        assert (table["x_m"].between(*ax.get_ylim()) & table["y_m"].between(*ax.get_xlim())).all()


@pytest.mark.parametrize(("values", "words"), [
    ([-10.0, 0.0, 10.0], ["−10", "0", "10"]),
    ([0.0, 0.0005], ["0.0000", "0.0005"]),
    ([0.0, 5e8, 1e9], ["0", "5e8", "1e9"]),
    ([-1.5e-7, 0.0], ["−1.5e−7", "0"]),
    ([4700000.0, 4700100.0], ["4700000", "4700100"]),
    ([4700000010.0, 4700000020.0], ["4700000010", "4700000020"]),  # rounded, they would be equal
    ([], []),
])  # fmt: skip
def test_numbers_at_ticks_need_no_power_of_ten_beside_the_axis(values, words):
    ticks = drawing.WholeTicks(useOffset=False)
    ticks.create_dummy_axis()
    assert ticks.format_ticks(values) == words
    assert ticks.get_offset() == ""


@pytest.mark.parametrize("power", range(-9, 13))
@pytest.mark.parametrize("first", [0.0, 1.0, -3.0])
def test_the_number_at_a_tick_is_its_value(power, first):
    values = [(first + step) * 10.0**power for step in (0.0, 0.5, 1.0, 1.5)]
    ticks = drawing.WholeTicks(useOffset=False)
    ticks.create_dummy_axis()
    ticks.axis.set_view_interval(values[0], values[-1])
    words = [word.replace("\N{MINUS SIGN}", "-") for word in ticks.format_ticks(values)]
    assert [float(word) for word in words] == pytest.approx(values, rel=1e-9)


def test_few_samples_of_the_waves_are_drawn_over_a_longer_time():
    record, _ = run_of(SHAPES["ten_hours"])  # a sample every 120 s
    ax = plots.plot_inclination(record)[0]
    assert len(ax.lines[0].get_xdata()) == plots.LEAST_SAMPLES + 1
    assert "first 3600 s, sampled every 120 s" in ax.figure.get_suptitle()


def test_a_depth_that_is_drawn_nearly_to_scale_is_not_called_stretched():
    ax = plots.plot_path_3d(*run_of(SHAPES["line_2_m"]))
    assert "depth" not in ax.get_title(loc="left") + (ax.figure.get_suptitle() or "")
