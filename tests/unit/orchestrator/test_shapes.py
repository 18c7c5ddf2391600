"""Figures are laid out for runs of any shape and duration: see `shapes.SHAPES`."""

from __future__ import annotations

import numpy as np
import pytest
from drawn_texts import spoiled_texts
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


@pytest.mark.parametrize(
    ("figure", "name"),
    [*OFTEN, *(pytest.param(*case, marks=pytest.mark.slow) for case in RARELY)],
)
def test_no_text_is_cut_off_or_lies_on_other_text(figure, name):
    drawn = DRAWN[figure](run_of(SHAPES[name]))[0].figure
    assert spoiled_texts(drawn) == []
    width = drawn.get_figwidth()  # equal widths: type of one size
    assert drawing.WIDTH <= width < 1.12 * drawing.WIDTH


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


def test_a_depth_that_is_drawn_nearly_to_scale_is_not_called_stretched():
    ax = plots.plot_path_3d(*run_of(SHAPES["line_2_m"]))
    assert "depth" not in ax.get_title(loc="left") + (ax.figure.get_suptitle() or "")
