"""The parts of a run's figures: styles of receivers, words, margins, places of labels, limits."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D
from matplotlib.text import Text
from PIL import Image
from sblcosim import style
from sblcosim.results.figures import drawing
from sblcosim.style import LINES, MARKERS, SMALL, THEMES

LIGHT = THEMES["light"]


@pytest.fixture(autouse=True)
def theme() -> Iterator[None]:
    """The settings within which all these parts are drawn."""
    with style.use("light"):
        yield


def table(rows: int) -> pd.DataFrame:
    """As many estimates."""
    return pd.DataFrame({"x_m": np.linspace(0.0, 1.0, rows)})


def looks(rows: Sequence[int]) -> dict[str, dict[str, Any]]:
    """Style of each filter of a run with a raw fix between the first and the second one."""
    names = [f"filter {i}" for i in range(len(rows))]
    tracks = {name: table(count) for name, count in zip(names, rows, strict=True)}
    order = [*names[:1], "raw", *names[1:], "multilateration"]
    all_tracks = {name: tracks.get(name, table(7)) for name in order}
    return {name: how for name, _, how in drawing.lines_of(all_tracks, LIGHT)}


# --- Styles of receivers -------------------------------------------------------------------------


@pytest.mark.parametrize("count", range(1, 13))
def test_receivers_take_colours_lines_and_then_markers_in_their_order(count: int) -> None:
    found = looks([61] * count)
    for fix in ("raw", "multilateration"):
        assert found.pop(fix) == {
            "color": LIGHT.soft, "ls": "", "marker": ".", "ms": 3, "alpha": 0.9, "mew": 0,
            "zorder": 2,
        }
    five, four = LIGHT.receivers, LINES
    assert [how["color"] for how in found.values()] == [*five, *five, *five][:count]
    assert [how["ls"] for how in found.values()] == [*four, *four, *four][:count]
    markers = [""] * 5 + ["o"] * 5 + ["s"] * 5
    assert [how["marker"] for how in found.values()] == markers[:count]
    assert {(how["lw"], how["ms"], how["zorder"]) for how in found.values()} == {(1.4, 5, 4)}


def test_a_line_has_twelve_markers_at_most_and_those_of_many_lines_are_apart() -> None:
    """The number between two markers is rounded up, the place of the first one down."""
    found = looks([61] * 5)  # 61 / 12 is a little more than 5
    starts = [found[f"filter {i}"]["markevery"] for i in range(5)]
    assert starts == [(0, 6), (1, 6), (2, 6), (3, 6), (4, 6)]
    found = looks([60, 240, 12, 0])
    steps = [found[f"filter {i}"]["markevery"] for i in range(4)]
    assert steps == [(0, 5), (5, 20), (0, 1), (0, 1)]


def test_a_single_estimate_has_the_marker_of_its_place() -> None:
    found = looks([1] * 9 + [2])
    markers = [found[f"filter {i}"]["marker"] for i in range(10)]
    assert markers == ["o", "s", "^", "D", "v", "P", "X", "o", "s", MARKERS[1]]


def picture(draw: Callable[[Axes], Any], clipped: bool = True) -> np.ndarray:
    """How much ink is at each pixel of axes of 60 x 60 pixels in a figure of 100 x 100."""
    figure = style.new_figure(1.0, 1.0, laid_out=True)
    figure.dpi = 100
    ax = figure.add_axes((0.2, 0.2, 0.6, 0.6))
    ax.set_axis_off()
    draw(ax)
    for line in ax.lines:
        line.set_clip_on(clipped)
    ax.set(xlim=(0, 60), ylim=(0, 60))
    figure.canvas.draw()
    grey = np.asarray(figure.canvas.buffer_rgba())[:, :, :3]  # type: ignore[attr-defined]
    return 1 - grey.astype(float).mean(axis=2) / 255


PLACES = np.array([(-4.0, 20), (64, 40), (25, -4), (40, 64), (15, 45), (38, 27), (np.nan, 30)])


@pytest.mark.parametrize("clipped", [True, False])
def test_dots_look_like_the_marks_of_a_line(clipped: bool) -> None:
    """Also those whose middle is a little beyond the axes, on each side."""
    how: dict[str, Any] = {"color": "#804020", "ls": "", "marker": ".", "ms": 20, "alpha": 0.6,
                           "mew": 0}  # fmt: skip
    expected = picture(lambda ax: ax.plot(*PLACES.T, **how), clipped)
    found = picture(lambda ax: drawing.add_line(ax, *PLACES.T, how), clipped)
    assert expected.sum() > 100
    assert found.sum() == pytest.approx(expected.sum(), rel=0.1)  # marks are at whole pixels
    for right, up in PLACES[:-1].astype(int) + 20:
        window = slice(99 - up - 8, 99 - up + 9), slice(right - 8, right + 9)
        assert found[window].sum() == pytest.approx(expected[window].sum(), rel=0.35)
        assert found[window].max() == pytest.approx(expected[window].max(), abs=0.02)


def test_dots_that_are_not_visible_are_not_drawn_and_a_line_is_a_line() -> None:
    def dot(ax: Axes) -> None:
        drawing.add_line(ax, [20.0], [30.0], {
            "color": "#804020", "ls": "", "marker": ".", "ms": 20,
        })  # fmt: skip

    def hidden(ax: Axes) -> None:
        dot(ax)
        ax.lines[0].set_visible(False)

    ink = picture(dot)
    rows, columns = np.indices(ink.shape) + 0.5
    assert (ink * columns).sum() / ink.sum() == pytest.approx(20 + 20, abs=0.1)
    assert (ink * rows).sum() / ink.sum() == pytest.approx(100 - 20 - 30, abs=0.1)
    assert picture(hidden).sum() == 0
    ax = style.new_figure(1, 1).add_subplot()
    drawing.add_line(ax, [1.0, 2.0], [3.0, 5.0], {"color": "#804020", "ls": "--", "zorder": 4})
    (line,) = ax.lines
    assert type(line) is Line2D
    assert line.get_xydata().tolist() == [[1, 3], [2, 5]]
    assert (line.get_linestyle(), line.get_zorder()) == ("--", 4)


@pytest.mark.parametrize(("filters", "filled"), [(1, True), (2, True), (3, False)])
def test_a_claim_is_a_band_with_edges_or_the_edges_alone(filters: int, filled: bool) -> None:
    ax = style.new_figure(3, 2).add_subplot()
    tracks = {"raw": table(3), **{f"filter {i}": table(3) for i in range(filters)}}
    t, reach = np.array([1.0, 2.0, 4.0]), np.array([0.5, 0.25, 2.0])
    how = {"color": "#804020", "ls": "--"}
    said = drawing.draw_claim(ax, t, reach, "a name", how, tracks)
    assert said == ("bands: claimed ±2σ" if filled else "thin lines: claimed ±2σ")
    (edges,) = ax.lines
    np.testing.assert_array_equal(edges.get_xdata(), [1, 2, 4, np.nan, 1, 2, 4])
    np.testing.assert_array_equal(edges.get_ydata(), [0.5, 0.25, 2, np.nan, -0.5, -0.25, -2])
    assert (edges.get_color(), edges.get_linestyle()) == ("#804020", "--")
    assert (edges.get_linewidth(), edges.get_zorder()) == (0.8, 1.5)
    assert len(ax.collections) == filled
    for band in ax.collections:
        corners = {tuple(corner) for corner in band.get_paths()[0].vertices.tolist()}
        assert {(1, 0.5), (1, -0.5), (2, 0.25), (2, -0.25), (4, 2), (4, -2)} == corners
        assert (band.get_alpha(), band.get_zorder()) == (0.12, 1)
        assert band.get_label() == "a name"
        assert band.get_linewidth()[0] == 0


def test_the_truth_is_a_thin_line_of_ink_on_top() -> None:
    for look in THEMES.values():
        assert drawing.truth_of(look) == {"color": look.ink, "lw": 0.8, "zorder": 5}


@pytest.mark.parametrize(("values", "words"), [
    ([0.0, 1e-4], ["0.0000", "0.0001"]),
    ([0.0, -9e-5], ["0", "−9e−5"]),
    ([0.0, 1e-6, 2e-6], ["0", "1e−6", "2e−6"]),
    ([0.0, 999999.0], ["0", "999999"]),
    ([-1e6, 5e5], ["−1000000", "500000"]),
    ([0.0, 2.5e6, 1e7], ["0", "2500000", "10000000"]),
    ([0.0, 12345678.0], ["0", "12345678"]),  # eight characters are not long
    ([0.0, 123456789.0], ["0", "1.23e8"]),
    ([-1234567.8, 0.0], ["−1.23e6", "0"]),
    ([0.0, 2e-10], ["0", "2e−10"]),
    ([0.0], ["0"]),
])  # fmt: skip
def test_numbers_at_ticks_are_plain_up_to_eight_characters(
    values: list[float], words: list[str]
) -> None:
    ticks = drawing.WholeTicks(useOffset=False)
    ticks.create_dummy_axis()
    ticks.axis.set_view_interval(min(values), max(values))
    assert ticks.format_ticks(values) == words


# --- Words ---------------------------------------------------------------------------------------


def test_estimates_beyond_any_limit_are_counted_by_receiver() -> None:
    inside = pd.DataFrame({"x_m": [1.0, 2.0, 3.0], "y_m": [10.0, 20.0, 30.0]})
    one = inside.assign(x_m=[0.99, 2.0, 3.0])
    two = inside.assign(x_m=[1.0, 3.01, 3.0], y_m=[10.0, 31.0, 9.0])
    limits = {"x_m": (1.0, 3.0), "y_m": (10.0, 30.0)}
    name = "a" * 20 + "b" * 20
    tracks = {"in": inside, name: two, "one": one, "none": inside[:0]}
    assert drawing.outside(tracks, limits) == (
        f"outside the figure: {'a' * 16}…{'b' * 15} (2\u00a0of\u00a03), one (1\u00a0of\u00a03)"
    )
    assert drawing.outside({"in": inside}, limits) == ""


def test_receivers_without_a_fix_are_named() -> None:
    name = "a" * 20 + "b" * 20
    tracks = {"some": table(1), name: table(0), "none": table(0)}
    assert drawing.no_fix(tracks) == f"no fix: {'a' * 16}…{'b' * 15}, none"
    assert drawing.no_fix({"some": table(1)}) == ""


@pytest.mark.parametrize(("name", "longest", "expected"), [
    ("abcdefgh", 8, "abcdefgh"), ("abcdefghi", 8, "abcd…ghi"), ("abcdefghi", 7, "abcd…hi"),
    ("abcdefghi", 6, "abc…hi"),
    ("abcdefghijklmnopqrstuvwxyz012345", 32, "abcdefghijklmnopqrstuvwxyz012345"),
    ("abcdefghijklmnopqrstuvwxyz0123456", 32, "abcdefghijklmnop…stuvwxyz0123456"),
])  # fmt: skip
def test_a_long_name_keeps_both_ends(name: str, longest: int, expected: str) -> None:
    assert drawing.short(name, longest) == expected
    assert longest != drawing.LONGEST_NAME or drawing.short(name) == expected


@pytest.mark.parametrize("size", [8.5, 20.0])
def test_the_width_of_a_text_is_that_when_it_is_drawn(size: float) -> None:
    figure = style.new_figure(9, 2)
    figure.dpi = 600
    words = "East of the platform, 95 m"
    text = figure.text(0, 0, words, fontsize=size)
    drawn = text.get_window_extent(figure.canvas.get_renderer()).width / 600  # type: ignore[attr-defined]
    assert drawing.inches(words, size) == pytest.approx(drawn, rel=0.02)
    assert drawing.inches(words) == pytest.approx(drawn * 9.5 / size, rel=0.02)


def test_a_name_is_no_shorter_than_its_room_needs() -> None:
    name = "abcdefghijklmnopqrstuvwxyz_0123456789_and_more"
    steps = [drawing.short(name, n) for n in range(32, 5, -2)]
    widths = [drawing.inches(some) for some in steps]
    assert sorted(widths, reverse=True) == widths
    for some, width in zip(steps, widths, strict=True):
        assert drawing.short_for(name, width) == some
        if len(some) > 6:
            assert drawing.short_for(name, width - 1e-6) == drawing.short(name, len(some) - 2)
    assert drawing.short_for(name, 0.1) == "abc…re"


@pytest.mark.parametrize("size", [9.5, 15.0])
def test_lines_of_a_text_are_as_long_as_there_is_room(size: float) -> None:
    words = "a mark every 5 min and the beacons as reported; depth ×2, 300 m down at 10 s each"
    for room in (0.5, 1.3, 2.0, 40.0):
        lines = drawing.wrapped(words, room, size).split("\n")
        assert " ".join(lines) == words
        for line, following in zip(lines, [*lines[1:], ""], strict=True):
            kept = {"5 min", "300 m", "10 s"} & {line}
            assert drawing.inches(line, size) <= room or " " not in line or kept
            first = " ".join(following.split()[: 2 if following[:1].isdigit() else 1])
            if first:
                assert drawing.inches(f"{line} {first}", size) > room
        assert not any(line.endswith((" 5", " 300", " 10")) for line in lines)
    width = drawing.inches("two words")
    assert drawing.wrapped("two words", width) == "two words"
    assert drawing.wrapped("two words", width - 1e-6) == "two\nwords"


# --- Panels, legend and margins ------------------------------------------------------------------


def own_panels(count: int, label: str = "", heights: Sequence[float] | None = None) -> list[Axes]:
    with style.use("light"):
        axes = drawing.panels(count, None, heights)
        for ax in axes:
            ax.plot([0.0, 1.0], [0.0, 2.0], label=label)
            ax.set_ylabel("what it is")
    return list(axes)


def test_panels_have_a_figure_of_their_heights_and_ticks_below_the_last() -> None:
    axes = own_panels(3, heights=(1.0, 2.5, 0.5))
    gaps = 2 * drawing.GAP + drawing.BOTTOM
    assert axes[0].figure.get_size_inches() == pytest.approx([drawing.WIDTH, 4.0 + gaps])
    assert own_panels(2)[0].figure.get_size_inches()[1] == pytest.approx(
        2.9 + drawing.GAP + drawing.BOTTOM
    )
    assert axes[0].get_gridspec().get_height_ratios() == (1.0, 2.5, 0.5)  # type: ignore[union-attr]
    assert [ax.xaxis.get_major_ticks()[0].tick1line.get_visible() for ax in axes] == [
        False, False, True
    ]
    for ax in axes:
        assert ax.get_xlim() == pytest.approx((-0.01, 1.01))
        assert isinstance(ax.yaxis.get_major_formatter(), drawing.WholeTicks)
    with pytest.raises(ValueError, match="axes: must be 2 axes, got 3"):
        drawing.panels(2, axes)
    assert drawing.panels(3, axes) is axes


def inches_from_the_top(ax: Axes) -> tuple[float, float]:
    """Where the title of a figure begins, and where its axes do [inch]."""
    figure: Any = ax.figure
    height, words = figure.get_figheight(), figure.get_suptitle()
    (title,) = (text for text in figure.texts if text.get_text() == words)
    assert title.get_ha() == "left"
    assert title.get_va() == "top"
    assert title.get_position()[0] == pytest.approx(ax.get_position().x0)
    return (1 - title.get_position()[1]) * height, (1 - ax.get_position().y1) * height


@pytest.mark.parametrize("label", ["", "a name"])
@pytest.mark.parametrize("lines", [1, 2])
def test_title_and_legend_stand_above_the_axes_and_the_figure_grows(
    label: str, lines: int
) -> None:
    axes = own_panels(2, label)
    figure: Any = axes[0].figure
    before = figure.get_figheight()
    parts = ("path in space", "", "no fix: ekf" + ", sequential" * 8 * (lines - 1))
    drawing.finish(axes, True, *parts)
    words = figure.get_suptitle()
    assert words.count("\n") == lines - 1
    assert words.startswith("Path in space; no fix: ekf")
    above = drawing.GAP / 2
    if label:
        legend = figure.legends[0].get_window_extent(figure.canvas.get_renderer())
        above = legend.height / figure.dpi + drawing.GAP
    title, body = inches_from_the_top(axes[0])
    assert title == pytest.approx(above)
    assert body == pytest.approx(above + lines * 1.25 * 9.5 / 72 + 0.06)
    assert figure.get_figheight() == pytest.approx(before + body)
    assert figure.get_figwidth() == drawing.WIDTH
    panel = drawing.WIDTH - drawing.LEFT - drawing.RIGHT
    for ax in axes:
        assert ax.get_position().width * drawing.WIDTH == pytest.approx(panel)


def test_long_numbers_widen_the_figure_on_the_left() -> None:
    axes = own_panels(2, "a name")
    axes[1].set_ylim(0, 2e5)
    drawing.finish(axes, True, "title")
    ticks = axes[1].get_yticks()
    longest = max(drawing.inches(f"{tick:.0f}") for tick in ticks)
    more = longest - 0.37
    assert more > 0.05
    assert drawing.longer_numbers(axes) == pytest.approx(more)
    assert drawing.longer_numbers(axes[:1]) == 0
    figure: Any = axes[0].figure
    width = figure.get_figwidth()
    assert width == pytest.approx(drawing.WIDTH + more)
    for ax in axes:
        place = ax.get_position()
        assert place.x0 * width == pytest.approx(drawing.LEFT + more)
        assert (1 - place.x1) * width == pytest.approx(drawing.RIGHT)
        figure.canvas.draw()
        pixels = ax.yaxis.label.get_window_extent()
        left = ax.bbox.x0 - pixels.x1
        assert left / figure.dpi == pytest.approx(0.5 + more, abs=0.02)


def test_titles_of_panels_have_room_above_each_of_them() -> None:
    axes = own_panels(3)
    axes[1].set_title("two\nlines", loc="left")
    figure: Any = axes[0].figure
    before = figure.get_figheight()
    drawing.finish(axes, True)
    own = 2 * 1.25 * 9.5 / 72 + 0.06
    height = before + drawing.GAP / 2 + own
    assert figure.get_figheight() == pytest.approx(height)
    assert figure.get_suptitle() == ""
    ends = [ax.get_position() for ax in axes]
    assert (1 - ends[0].y1) * height == pytest.approx(drawing.GAP / 2 + own)
    for one, other in pairwise(ends):
        assert (one.y0 - other.y1) * height == pytest.approx(drawing.GAP + own)
    assert ends[2].y0 * height == pytest.approx(drawing.BOTTOM)
    assert drawing.title_height("") == 0


def test_a_legend_beside_the_axes_takes_its_width_from_them() -> None:
    axes = own_panels(1, "a name")
    figure: Any = axes[0].figure
    before = figure.get_figheight()
    drawing.finish(axes, True, "title", beside=True)
    legend = figure.legends[0].get_window_extent(figure.canvas.get_renderer())
    place, height = axes[0].get_position(), figure.get_figheight()
    above = drawing.GAP / 2 + 1.25 * 9.5 / 72 + 0.06
    assert height == pytest.approx(before + above)
    right = (1 - place.x1) * drawing.WIDTH
    assert right == pytest.approx(drawing.RIGHT + drawing.GAP + legend.width / figure.dpi)
    pad = 0.3 * 9.5 / 72
    assert figure.bbox.width - legend.x1 == pytest.approx(pad * figure.dpi, abs=0.5)
    assert place.y1 * figure.bbox.height - legend.y1 == pytest.approx(pad * figure.dpi, abs=0.5)


@pytest.mark.parametrize("count", [2, 5, 9])
def test_a_legend_above_the_axes_has_as_few_rows_as_fit(count: int) -> None:
    axes = own_panels(1)
    names = [f"receiver number {i}" for i in range(count)]
    for name in names:
        axes[0].plot([0, 1], [1, 0], label=name)
    drawing.finish(axes, True, "title")
    figure: Any = axes[0].figure
    renderer, (legend,) = figure.canvas.get_renderer(), figure.legends
    widths = {}
    for columns in range(1, count + 1):
        other = figure.legend(legend.legend_handles, names, ncols=columns)
        widths[columns] = other.get_window_extent(renderer).width
        other.remove()
    rows = next(n for n in range(1, count + 1)
                if widths[-(-count // n)] < 0.95 * figure.bbox.width)  # fmt: skip
    assert rows == {2: 1, 5: 2, 9: 3}[count]
    assert legend.get_window_extent(renderer).width == pytest.approx(widths[-(-count // rows)])
    extent = legend.get_window_extent(renderer)
    assert (extent.x0 + extent.x1) / 2 == pytest.approx(figure.bbox.width / 2, abs=0.5)
    assert figure.bbox.height - extent.y1 == pytest.approx(0.3 * 9.5, abs=8)


@pytest.mark.parametrize("beside", [False, True])
def test_equal_labels_share_an_entry_and_long_ones_are_shortened(beside: bool) -> None:
    axes = own_panels(2, "a line and a band")
    axes[0].fill_between([0, 1], [1, 2], label="a line and a band")
    long_name = "a" * 20 + "b" * 20
    axes[1].plot([0, 1], [1, 0], label=long_name)
    drawing.finish(axes, True, beside=beside)
    (legend,) = axes[0].figure.legends  # type: ignore[union-attr]
    names = [text.get_text() for text in legend.get_texts()]
    assert names == ["a line and a band", f"{'a' * 16}…{'b' * 15}"]


def test_given_axes_have_title_and_legend_inside_the_first_one() -> None:
    with style.use("light"):
        figure = style.new_figure(9, 9)
        axes = list(figure.subplots(2))
        how: dict[str, Any] = {"ls": "", "marker": ".", "ms": 3, "color": "#804020"}
        drawing.add_line(axes[0], [0.0, 1.0], [2.0, 1.0], how | {"label": "dots"})
        axes[1].plot([0.5], [0.5], ".", label="a dot")
        axes[1].plot([0, 1], [0, 1], marker="o", ms=5, label="a line")
        title = (
            "map, with a mark every 5 min; outside the figure: ekf, coupled, ours; no fix: nobody"
        )
        drawing.finish(axes, False, "", title)
    assert not figure.legends
    assert axes[1].get_legend() is None
    legend = axes[0].get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["dots", "a dot", "a line"]
    handles: list[Any] = legend.legend_handles
    assert [handle.get_markevery() for handle in handles] == [None, [1], [1]]  # three and one
    assert [handle.get_markersize() for handle in handles] == [4, 8, 5]
    words = axes[0].get_title("left")
    assert words == drawing.wrapped("M" + title[1:], 70 * 9.5 / 130)
    assert "\n" in words
    assert figure.get_size_inches().tolist() == [9, 9]


def test_the_room_of_a_legend_is_that_of_its_longest_name() -> None:
    long_name = "a" * 20 + "b" * 20
    shown = drawing.inches(f"{'a' * 16}…{'b' * 15}")
    assert drawing.legend_width(["ekf", long_name, "raw"]) == pytest.approx(shown + 0.6)


# --- Labels of points ----------------------------------------------------------------------------

SIDES = [(1, 0.6), (1, -0.6), (-1, 0.6), (-1, -0.6), (0, 1), (0, -1), (1, 0), (-1, 0)]
"""From the best to the worst one."""
ALIGNED = {1: "left", 0: "center", -1: "right"}, {1: "bottom", 0: "center", -1: "top"}


@pytest.fixture
def sheet() -> Axes:
    """Axes of 4 x 3 inches whose coordinates are inches, away from the corner of the figure."""
    figure = style.new_figure(8, 6, laid_out=True)
    figure.dpi = 90
    ax = figure.add_axes((0.125, 0.25, 0.5, 0.5))
    ax.set(xlim=(0, 4), ylim=(0, 3))
    return ax


Label = tuple[float, float, str, str]


def placed(ax: Axes, *args: Any) -> Iterator[Label]:
    """Right, up [point] and alignment of the labels."""
    points, words = args[0], args[1]
    places = drawing.free_places(ax, np.array(points, float), words, *args[2:])
    for point, place in zip(points, places, strict=True):
        at = place["transform"].transform(point) / 90 - [1.0, 1.5] - point
        right, up = (72 * at).round(6)
        yield right, up, place["ha"], place["va"]


def expected_at(away: float, side: tuple[float, float]) -> Label:
    right, up = side
    return (away * right, round(away * up, 6), ALIGNED[0][int(np.sign(right))],
            ALIGNED[1][int(np.sign(up))])  # fmt: skip


NOTHING = np.full((1, 2), np.nan)
MIDDLE = (2.0, 1.5)


def beside(away: float, side: tuple[float, float], in_rim: float = 0.005) -> np.ndarray:
    """A place in the rim of a label that is at its place, at the corner or edge near the point."""
    offset = np.array(side) * away / 72
    return MIDDLE + offset - np.sign(side) * (0.03 - in_rim)


def test_a_label_is_at_the_first_place_that_is_free(sheet: Axes) -> None:
    def found(drawn: Any, dots: Any = None) -> Label:
        (label,) = placed(sheet, [MIDDLE], ["abcd"], np.vstack([NOTHING, *drawn]), dots)
        return label

    assert found([]) == expected_at(6, SIDES[0])
    # Two labels above each other share a corner of the ones beside the point; those have the edge.
    corners = [beside(6, side) for side in SIDES[:4]]
    for number in range(1, 4):
        assert found(corners[:number]) == expected_at(6, SIDES[number])
    assert found(corners) == expected_at(6, SIDES[4])
    ends = [MIDDLE + np.array([0.0, up]) for up in (0.06, -0.06)]
    assert found([*corners, ends[0]]) == expected_at(6, SIDES[5])
    every = [*corners, *ends]
    far = [MIDDLE + np.array([right, 0.0]) for right in (0.25, -0.25)]
    assert found(every) == expected_at(9, SIDES[0])  # those beside hide two corners
    nine = [beside(9, side) for side in SIDES[:4]]
    assert found([*every, *nine, *far]) == expected_at(9, SIDES[4])
    above = [MIDDLE + np.array([0.0, up]) for up in (0.1, -0.1)]
    assert found([*every, *nine, *far, *above]) == expected_at(13, SIDES[0])


def test_a_label_is_as_large_as_its_text_with_a_rim(sheet: Axes) -> None:
    """0.6 of the size of type across for each character, and 1.25 of it for each line."""
    first = np.array(MIDDLE) + np.array([1.0, 0.6]) * 6 / 72
    for words, across, lines in (("abcd", 4, 1), ("ab\nabcdefg\nc", 7, 3)):
        size = np.array([0.6 * across, 1.25 * lines]) * SMALL / 72
        middle = first + size / 2
        for axis in (0, 1):
            for sign in (-1, 1):
                for gap, hidden in ((-0.002, True), (0.002, False)):
                    drawn = middle.copy()
                    drawn[axis] += sign * (size[axis] / 2 + 0.03 + gap)
                    (label,) = placed(sheet, [MIDDLE], [words], drawn[None])
                    assert (label != expected_at(6, SIDES[0])) == hidden, (axis, sign, gap)


def test_some_dots_may_be_hidden_to_keep_a_label_near(sheet: Axes) -> None:
    """Twenty of them are as bad as a point of a curve, and five as half the way to the next."""
    near = np.array([beside(6, side) for side in SIDES[:4]] + [
        MIDDLE + np.array([0.0, up]) for up in (0.06, -0.06)
    ])  # fmt: skip
    for count, expected in ((4, expected_at(6, SIDES[0])), (6, expected_at(9, SIDES[0]))):
        dots = np.vstack([NOTHING, *[near] * count])
        (label,) = placed(sheet, [MIDDLE], ["abcd"], NOTHING, dots)
        assert label == expected


def test_a_label_stays_inside_the_axes(sheet: Axes) -> None:
    size = np.array([0.6 * 4, 1.25]) * SMALL / 72
    for point, side in (
        ((3.9, 1.5), (-1, 0.6)), ((3.9, 2.9), (-1, -0.6)), ((0.1, 2.9), (1, -0.6)),
        ((0.1, 0.1), (1, 0.6)),
    ):  # fmt: skip
        (label,) = placed(sheet, [point], ["abcd"], NOTHING)
        assert label == expected_at(6, side)
    right = 4 - 6 / 72 - size[0]  # of a point whose label just fits
    up = 3 - 3.6 / 72 - size[1]
    for dx, dy, side in ((-0.002, -0.002, (1, 0.6)), (0.002, -0.002, (-1, 0.6)),
                         (-0.002, 0.002, (1, -0.6))):  # fmt: skip
        (label,) = placed(sheet, [(right + dx, up + dy)], ["abcd"], NOTHING)
        assert label == expected_at(6, side)
    # Many points of a curve are better hidden than the axes left.
    curve = np.tile([3.6, 1.6], (300, 1))
    (label,) = placed(sheet, [(3.9, 1.5)], ["abcdefgh"], curve)
    assert label[2] == "right"


def test_labels_of_equal_points_are_at_different_places_whatever_they_hide(sheet: Axes) -> None:
    points = [MIDDLE, MIDDLE, MIDDLE]
    words = ["abcd", "abcdef", "abc"]
    found = [*placed(sheet, points, words, NOTHING)]
    assert [label[2:] for label in found] == [
        ("left", "bottom"), ("left", "top"), ("right", "bottom"),
    ]
    grid = np.stack(np.meshgrid(np.linspace(1, 3, 21), np.linspace(0.9, 2.1, 13)), -1)
    curve = grid.reshape(-1, 2)  # one in each tenth of an inch
    away = [(right > 1.95) & (up > 1.5) for right, up in curve]
    crowded = curve[~np.array(away)]
    boxes = []
    labels = placed(sheet, points, words, crowded)
    for label, word in zip(labels, words, strict=True):
        size = np.array([0.6 * len(word), 1.25]) * SMALL / 72
        sides = [{"left": 0, "bottom": 0, "center": -0.5}.get(how, -1) for how in label[2:]]
        corner = np.array(label[:2]) / 72 + size * sides
        boxes.append((corner, corner + size))
    for number, (low, high) in enumerate(boxes):
        for other_low, other_high in boxes[:number]:
            assert (low > other_high - 1e-9).any() or (high < other_low + 1e-9).any()


# --- Limits --------------------------------------------------------------------------------------


def estimates(*values: float, error: Sequence[float] | float = 0.1) -> pd.DataFrame:
    return pd.DataFrame({"x_m": values, "error_x_m": error})


SEEN = np.array([2.0, np.nan, 10.0])


@pytest.mark.parametrize(("tracks", "more", "expected"), [
    ({}, {}, (2.0, 10.0)),
    ({"ekf": estimates(3.0, 12.0)}, {}, (2.0, 12.0)),
    ({"ekf": estimates(1.0, np.nan)}, {}, (1.0, 10.0)),
    ({"ekf": estimates(-50.0, 99.0)}, {}, (-2.0, 14.0)),  # half the extent
    ({"ekf": estimates(-50.0, 99.0)}, {"reach": 5.0}, (-3.0, 15.0)),
    ({"ekf": estimates(-50.0, 99.0)}, {"whole": "ekf"}, (-50.0, 99.0)),
    ({"ekf": estimates(-6.0, 5.0), "other": estimates(-90.0, 70.0)}, {"whole": "ekf"},
     (-14.0, 18.0)),
    # Of raw fixes beside a filter half the reach, without one all of it.
    ({"raw": estimates(-50.0, 99.0)}, {"reach": 20.0}, (-18.0, 30.0)),
    ({"ekf": estimates(4.0), "raw": estimates(-50.0, 99.0)}, {"reach": 20.0}, (-8.0, 20.0)),
    ({"ekf": estimates(4.0), "raw": estimates(-50.0, 99.0)}, {"reach": 5.0}, (-1.0, 13.0)),
    ({"ekf": estimates(), "raw": estimates(), "multilateration": estimates(np.nan)}, {},
     (2.0, 10.0)),
])  # fmt: skip
def test_limits_contain_what_is_seen_and_the_estimates_near_it(
    tracks: dict[str, pd.DataFrame], more: dict[str, Any], expected: tuple[float, float]
) -> None:
    low, high = expected
    margin = 0.06 * (high - low)
    found = drawing.limits(SEEN, tracks, "x", **more)
    assert found == pytest.approx((low - margin, high + margin))


def test_estimates_reach_three_metres_at_least_and_limits_have_a_least_distance() -> None:
    """Half the extent of what is seen counts if it is more."""
    seen = np.array([5.0, 6.0])
    far = {"ekf": estimates(-70.0, 90.0)}
    assert drawing.limits(seen, far, "x") == pytest.approx((2 - 0.42, 9 + 0.42))
    far["raw"] = far["ekf"] * [2, 1]
    assert drawing.limits(seen, {"raw": far["raw"]}, "x", 4.0) == pytest.approx(
        (1 - 0.54, 10 + 0.54)
    )
    seen = np.array([5.0, 5.5])
    assert drawing.limits(seen, {}, "x") == pytest.approx((4.75, 5.75))
    assert drawing.limits(seen, {}, "x", least=3.5) == pytest.approx((3.5, 7.0))
    assert drawing.limits(seen, {}, "x", least=0.5) == pytest.approx((4.97, 5.53))


def test_the_limits_of_an_axis_are_of_its_own_columns() -> None:
    own = pd.DataFrame({"x_m": [50.0], "error_x_m": [9.0], "z_m": [11.5], "error_z_m": [0.1]})
    assert drawing.limits(SEEN, {"ekf": own}, "z") == pytest.approx((2 - 0.57, 11.5 + 0.57))
    tracks = {"ekf": own, "raw": own * 2, "empty": own[:0]}
    assert [c.tolist() for c in drawing.columns(tracks, "z_m")] == [[11.5]]
    fixes = {"raw": own * 2, "multilateration": own[:0]}
    assert [c.tolist() for c in drawing.columns(fixes, "z_m")] == [[23.0]]


def errors_of(*errors: float, std: Sequence[float] | None = None) -> pd.DataFrame:
    table = pd.DataFrame({"error_x_m": errors})
    return table if std is None else table.assign(std_x_m=std)


def test_errors_have_a_limit_above_them_and_above_most_bands() -> None:
    def limit(**tracks: pd.DataFrame) -> float:
        return drawing.error_limit(tracks, "error_x_m", "std_x_m")

    steps = np.arange(101.0) * (-1.0) ** np.arange(101)  # its 95th percentile is 95
    assert limit(ekf=errors_of(*steps)) == pytest.approx(110)
    assert limit(ekf=errors_of(*steps[:-1], 379.0)) == pytest.approx(1.1 * 379)
    assert limit(ekf=errors_of(*steps[:-1], -381.0)) == pytest.approx(1.1 * 380)
    assert limit(ekf=errors_of(2.0, 3.0), other=errors_of(-7.0, 1.0)) == pytest.approx(7.7)
    assert limit(ekf=errors_of(2.0), raw=errors_of(50.0)) == pytest.approx(2.2)
    assert limit(raw=errors_of(50.0)) == pytest.approx(55)
    small, claimed = np.full(101, 0.5), np.arange(101.0)
    assert limit(ekf=errors_of(*small, std=claimed)) == pytest.approx(1.1 * 2 * 90)
    assert limit(raw=errors_of(*small, std=claimed)) == pytest.approx(0.55)
    assert limit(ekf=errors_of(0.0)) == 1e-3
    assert limit() == pytest.approx(1.1)


def test_texts_of_figures_have_the_sizes_of_the_style() -> None:
    axes = own_panels(1, "a name")
    drawing.finish(axes, True, "a title")
    figure: Any = axes[0].figure
    sizes = {text.get_text(): text.get_fontsize() for text in figure.findobj(Text)}
    assert sizes["A title"] == sizes["a name"] == style.SIZE


# --- Style ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["light", "dark"])
def test_a_theme_has_its_colours_and_sizes(name: style.ThemeName) -> None:
    with style.use(name) as look:
        assert look is THEMES[name]
        figure = style.new_figure(4.0, 3.0)
        ax = figure.add_subplot()
        (line,) = ax.plot([0, 1], [0, 2])
        text = figure.text(0.5, 0.5, "$5$")
        title, label = ax.set_title("title"), ax.set_xlabel("label")
        laid_out = style.new_figure(1, 2, laid_out=True)
        figure.canvas.draw()
    assert to_hex(figure.get_facecolor()) == to_hex(ax.get_facecolor()) == look.paper
    spines = {where: spine.get_visible() for where, spine in ax.spines.items()}
    assert spines == {"left": True, "bottom": True, "top": False, "right": False}
    assert to_hex(ax.spines["left"].get_edgecolor()) == look.ink
    assert {it.get_color() for it in (text, title, label)} == {look.ink}
    assert {it.get_fontsize() for it in (text, title, label)} == {9.5}
    assert not text.get_parse_math()
    (tick, *_) = ax.xaxis.get_major_ticks()
    assert tick.gridline.get_visible()
    assert (tick.gridline.get_color(), tick.gridline.get_linewidth()) == (look.grid, 0.6)
    assert tick.label1.get_color() == look.ink
    assert ax.get_axisbelow() is True
    assert line.get_linewidth() == 1.4
    assert figure.get_layout_engine() is not None
    assert laid_out.get_layout_engine() is None
    assert laid_out.get_size_inches().tolist() == [1, 2]
    colours = style.variables(look)
    assert colours == {
        "paper": look.paper, "ink": look.ink, "grid": look.grid, "soft": look.soft,
        **{f"line-{i}": look.receivers[i] for i in range(5)},
    }


def test_given_axes_show_their_titles_and_labels_literally_but_not_their_texts() -> None:
    with mpl.rc_context({"text.parse_math": True}):
        one, other = style.new_figure(4, 3).subplots(2)
        for ax in (one, other):
            ax.set(title="$a$", xlabel="$b$", ylabel="$c$")
            ax.text(0.5, 0.5, "$d$")
        with style.use("light", one):
            pass
        assert not one.title.get_parse_math()
        assert not one.xaxis.label.get_parse_math()
        assert not one.yaxis.label.get_parse_math()
        assert one.texts[0].get_parse_math()
        assert other.title.get_parse_math()
        with style.use("light", [one, other]):
            pass
        assert not other.yaxis.label.get_parse_math()


def test_a_saved_figure_has_whole_pixels(tmp_path: Path) -> None:
    figure = style.new_figure(2.003, 1.499, laid_out=True)
    ax = figure.add_subplot()
    style.save(ax, tmp_path, "it")
    with Image.open(tmp_path / "it.png") as image:
        assert image.size == (300, 225)
    assert figure.get_size_inches() == pytest.approx([2.0, 1.5])
    head = (tmp_path / "it.svg").read_text("utf-8")[:2000]
    assert 'width="144pt" height="108pt"' in head
    assert "<dc:date>" not in head
