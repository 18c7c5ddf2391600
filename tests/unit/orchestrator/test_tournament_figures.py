"""What the figure of a tournament draws, and where: runs of each receiver, and differences."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from sblcosim.comparison.tournament.figures import Panel, plot_tournament
from sblcosim.layout import filled
from sblcosim.style import THEMES, new_figure, use

LIGHT = THEMES["light"]
NAN = float("nan")
FOUR = Panel(
    "a place", ("best", "near", "far", "a_receiver_with_a_name_of_forty_letters_"),
    np.array([
        [0.5, 0.8, 1.2, 2.0, 1.0], [0.6, 0.9, 1.4, 2.2, 1.1], [1.0, 2.0, 3.5, 9.0, 3.0],
        [0.4, 1.0, 1.6, 2.5, 1.25],
    ]),
    np.array([[0.1, 0.05, 0.15], [2.0, 1.5, 2.75], [0.25, -0.5, 0.75]]),
    ("equal", "worse", "undecided"),
)  # fmt: skip


def marks(ax: Axes) -> dict[float, Any]:
    """The mark in each row."""
    return {float(line.get_ydata()[0]): line for line in ax.lines if line.get_zorder() == 4}


def bars(ax: Axes, width: float) -> dict[float, tuple[float, float]]:
    """Ends of the bars of a width in each row."""
    return {
        float(line.get_ydata()[0]): tuple(line.get_xdata()) for line in ax.lines
        if line.get_linewidth() == width and len(set(line.get_ydata())) == 1
        and line.get_zorder() != 4
    }  # fmt: skip


def test_each_receiver_has_its_row_with_median_middle_half_and_most_of_its_runs() -> None:
    left, right = plot_tournament([FOUR], "total error", "m", 0.2)
    assert bars(left, 0.9) == {0: (0.5, 2.0), 1: (0.6, 2.2), 2: (1.0, 9.0), 3: (0.4, 2.5)}
    assert bars(left, 5) == {0: (0.8, 1.2), 1: (0.9, 1.4), 2: (2.0, 3.5), 3: (1.0, 1.6)}
    assert {row: it.get_xdata()[0] for row, it in marks(left).items()} == {
        0: 1.0, 1: 1.1, 2: 3.0, 3: 1.25,
    }
    for mark in marks(left).values():
        assert (mark.get_marker(), mark.get_markersize()) == ("o", 5)
        assert (mark.get_markerfacecolor(), mark.get_markeredgecolor()) == (LIGHT.paper, LIGHT.ink)
        assert mark.get_markeredgewidth() == 1.2
    for ax in (left, right):
        assert ax.get_ylim() == (3.5, -0.5)
        assert ax.get_yticks().tolist() == [0, 1, 2, 3]
    names = [text.get_text() for text in left.get_yticklabels()]
    assert names == ["best", "near", "far", "a_receiver_with_…_forty_letters_"]
    assert left.get_title("left") == "a place"
    assert left.get_xlim()[0] == 0
    assert left.get_xlabel().replace("\n", " ") == "total error [m], 5 to 95 % of runs"
    figure: Any = left.figure
    assert figure.get_size_inches() == pytest.approx([7.2, 0.75 + 4 * 0.27 + 1.0])


def test_differences_have_the_mark_of_their_verdict_and_a_bar() -> None:
    _, right = plot_tournament([FOUR], "total error", "m", 0.2)
    red, blue, _, *_ = LIGHT.receivers
    assert bars(right, 1.6) == {1: (0.05, 0.15), 2: (1.5, 1.5), 3: (-0.5, 0.75)}
    found = {
        row: (it.get_xdata()[0], it.get_marker(), it.get_color(), it.get_markerfacecolor())
        for row, it in marks(right).items()
    }  # fmt: skip
    # Six times the median difference is 1.5, which is also 1.5 times the best median.
    assert found == {
        1: (0.1, "D", blue, LIGHT.paper), 2: (1.5, ">", red, red),
        3: (0.25, "o", LIGHT.soft, LIGHT.paper),
    }
    assert {it.get_markersize() for it in marks(right).values()} == {5.5}
    (band,) = right.patches
    assert band.get_extents().transformed(right.transData.inverted()).intervalx == pytest.approx(
        (-0.2, 0.2)
    )
    zero = [line for line in right.lines if tuple(line.get_xdata()) == (0.0, 0.0)]
    assert len(zero) == 1
    assert right.get_xlabel().replace("\n", " ") == (
        "median difference from best [m], 95 % all at once"
    )
    alone = Panel("x", FOUR.receivers[:2], FOUR.spread[:2], np.array([[0.3, NAN, NAN]]), ("worse",))
    _, bare = plot_tournament([alone], "share", "")
    assert bare.get_xlabel().replace("\n", " ") == "median difference from best"
    assert not bars(bare, 1.6)
    assert not bare.patches


@pytest.mark.parametrize(("best", "differences", "edge"), [
    (1.0, [0.1, 0.25, 4.0], 1.5), (0.5, [0.1, 0.25, 4.0], 1.5), (2.0, [0.1, 0.25, 4.0], 3.0),
    (1.0, [0.1, 1.0, 4.0], None), (0.0, [0.1, 0.25, 4.0], None), (0.1, [-4.0, 0.1, 0.2], 1.2),
])  # fmt: skip
def test_what_is_far_from_the_best_stands_at_the_edge_with_its_number(
    best: float, differences: list[float], edge: float | None
) -> None:
    """Beyond six times the median difference and one and a half times the best median."""
    spread = np.tile([0.0, 0.0, 0.0, 0.0, best], (4, 1))
    ends = np.array([[middle, middle - 0.5, middle + 0.5] for middle in differences])
    panel = Panel("x", FOUR.receivers, spread, ends, ("better", "worse", "better"))
    _, right = plot_tournament([panel], "error", "m")
    found = marks(right)
    far = [edge is not None and abs(it) > edge for it in differences]
    shown = [np.sign(it) * (edge or 0) if out else it
             for it, out in zip(differences, far, strict=True)]  # fmt: skip
    assert [found[row].get_xdata()[0] for row in (1, 2, 3)] == pytest.approx(shown)
    usual = ["^", "s", "^"]
    expected = [(">" if it > 0 else "<") if out else mark
                for it, out, mark in zip(differences, far, usual, strict=True)]  # fmt: skip
    assert [found[row].get_marker() for row in (1, 2, 3)] == expected
    limit = np.inf if edge is None else edge
    for row, (_, low, high) in enumerate(ends, 1):
        assert bars(right, 1.6)[row] == pytest.approx(
            (max(low, -limit), min(high, limit)) if low < limit and high > -limit else
            (np.clip(low, -limit, limit), np.clip(high, -limit, limit))
        )
    assert [(text.get_text(), text.get_ha()) for text in right.texts] == [
        (f"{it:g}", "right" if it > 0 else "left")
        for it, out in zip(differences, far, strict=True) if out
    ]
    colours = LIGHT.receivers
    assert [found[row].get_color() for row in (1, 2, 3)] == [colours[2], colours[0], colours[2]]


@pytest.mark.parametrize(("ratio", "scale"), [(49.0, "linear"), (51.0, "log")])
def test_errors_that_differ_by_more_than_fifty_times_are_on_a_logarithmic_axis(
    ratio: float, scale: str
) -> None:
    spread = np.array([[0.2, 0.3, 0.4, 0.5, 0.35], [0.3, 0.5, 0.9, 0.2 * ratio, 0.7]])
    panel = Panel("x", ("a", "b"), spread, np.empty((0, 3)), ())
    (ax,) = plot_tournament([panel], "error", "m")
    assert ax.get_xscale() == scale
    spread[0, 0] = 0.0  # zeros do not count
    (ax,) = plot_tournament([panel], "error", "m")
    assert ax.get_xscale() == "linear"


def legend_of(ax: Axes) -> list[str]:
    (legend,) = ax.figure.legends  # type: ignore[union-attr]
    return [text.get_text() for text in legend.get_texts()]


def test_the_key_has_what_is_drawn() -> None:
    runs = ["circle: median of the runs", "thick bar: middle half of the runs",
            "thin line: 5 to 95 % of the runs"]  # fmt: skip
    last = ["bar: 95 % interval of the difference", "like the best; right of it: worse"]
    axes = plot_tournament([FOUR], "error", "m", 0.2)
    assert legend_of(axes[0]) == [
        *runs, "worse than the best", "undecided", "equal for practical purposes", *last,
        "grey: within ±0.2 m, does not matter",
    ]
    assert axes[0].figure.legends[0]._ncols == 2  # type: ignore[union-attr]
    better = Panel("x", ("a", "b"), FOUR.spread[:2], np.array([[-1.0, NAN, NAN]]), ("better",))
    axes = plot_tournament([better], "share", "", 0.5)
    assert legend_of(axes[0]) == [
        *runs, "better here", last[1], "grey: within ±0.5, does not matter",
    ]
    alone = Panel("x", ("a",), np.array([[1.0, 1, 1, 1, 1]]), np.empty((0, 3)), ())
    axes = plot_tournament([alone], "error", "m", 0.5)
    assert len(axes) == 1
    assert legend_of(axes[0]) == runs[:1]
    half = Panel("x", ("a",), np.array([[1.0, 1, 2, 2, 1]]), np.empty((0, 3)), ())
    assert legend_of(plot_tournament([half], "error", "m")[0]) == runs
    thin = Panel("x", ("a",), np.array([[1.0, 2, 2, 3, 2]]), np.empty((0, 3)), ())
    assert legend_of(plot_tournament([thin], "error", "m")[0]) == [runs[0], runs[2]]


@pytest.mark.parametrize(("practical", "named"), [(0.0018, False), (0.0024, True)])
def test_a_band_too_narrow_to_be_seen_is_not_in_the_key(practical: float, named: bool) -> None:
    """Its width must be more than 0.4 % of the axis."""
    panel = Panel("x", ("a", "b"), FOUR.spread[:2], np.array([[0.5, 0.0, 0.9]]), ("worse",))
    axes = plot_tournament([panel], "error", "m", practical)
    span = np.ptp(axes[1].get_xlim())
    assert span == pytest.approx(0.9 * 1.12, abs=0.01)
    assert any("grey" in word for word in legend_of(axes[0])) == named


def test_places_are_below_each_other_with_heights_of_their_receivers() -> None:
    two = Panel("another", ("near", "best"), FOUR.spread[:2], FOUR.difference[:1], ("worse",))
    axes = plot_tournament([FOUR, two], "error", "m")
    figure: Any = axes[0].figure
    heights = [0.75 + 4 * 0.27, 0.75 + 2 * 0.27]
    assert figure.get_size_inches() == pytest.approx([7.2, sum(heights) + 1])
    grid: Any = axes[0].get_gridspec()
    assert grid.get_geometry() == (2, 2)
    assert grid.get_height_ratios() == pytest.approx(heights)
    assert [ax.get_title("left") for ax in axes] == ["a place", "", "another", ""]
    assert axes[3].get_xlabel().replace("\n", " ").startswith("median difference from near")
    assert axes[2].get_ylim() == (1.5, -0.5)
    with pytest.raises(ValueError, match="axes: must be 4 axes, got 3"):
        plot_tournament([FOUR, two], "error", "m", axes=axes[:3])


@pytest.mark.parametrize("width", [4.0, 12.0])
def test_labels_and_ticks_have_the_room_of_the_axes(width: float) -> None:
    with use("light"):
        figure = new_figure(width, 3.0, laid_out=True)
        axes = [figure.add_axes((0.1, 0.3, 0.4, 0.6)), figure.add_axes((0.55, 0.3, 0.4, 0.6))]
    plot_tournament([FOUR], "total error of the receivers", "m", axes=axes)
    room = 0.4 * width
    label = "total error of the receivers [m], 5 to 95 % of runs"
    assert axes[0].get_xlabel() == filled(label, int(18 * room))
    locator: Any = axes[0].xaxis.get_major_locator()
    assert locator._nbins == {4.0: 3, 12.0: 10}[width]
    assert axes[1].get_legend() is not None
    assert not figure.legends


def test_the_key_in_given_axes_is_in_the_last_of_them() -> None:
    figure = new_figure(9.0, 9.0)
    axes = list(figure.subplots(2, 2).flat)
    other = figure.add_axes((0.9, 0.9, 0.05, 0.05))
    plot_tournament([FOUR, FOUR], "error", "m", axes=axes)
    assert [ax.get_legend() is not None for ax in (*axes, other)] == [
        False, False, False, True, False,
    ]  # fmt: skip


def look_of(line: Any) -> tuple[Any, ...]:
    """Colours, width and mark of a line."""
    mark = line.get_marker()
    if mark in ("", "None", None):
        return line.get_color(), line.get_linewidth()
    return (mark, line.get_markersize(), line.get_markeredgewidth(), line.get_markerfacecolor(),
            line.get_markeredgecolor())  # fmt: skip


def test_the_key_looks_like_what_is_drawn() -> None:
    near = np.array([[0.1, 0.05, 0.15], [0.9, 0.75, 1.0], [0.25, -0.5, 0.75]])
    panel = Panel("x", FOUR.receivers, FOUR.spread, near, FOUR.verdicts)
    left, right = plot_tournament([panel], "error", "m", 0.2)
    (legend,) = left.figure.legends  # type: ignore[union-attr]
    words = [text.get_text().partition(":")[0] for text in legend.get_texts()]
    key = {word: look_of(it) for word, it in zip(words, legend.get_lines(), strict=False)}
    drawn = {look_of(line) for ax in (left, right) for line in ax.lines}
    for word, look in key.items():
        assert look in drawn or word == "like the best; right of it", word
    red, blue, *_ = LIGHT.receivers
    assert key["thick bar"] == (blue, 5)
    assert key["thin line"] == (LIGHT.ink, 0.9)
    assert key["bar"] == (LIGHT.soft, 1.6)
    assert key["like the best; right of it"][:2] == ("|", 11)
    # One mark for each verdict, and the best one's line.
    assert key["equal for practical purposes"][0] == "D"
    colours = {look for look in map(look_of, right.lines) if len(look) == 2}
    assert colours == {(LIGHT.ink, 1.0), (blue, 1.6), (red, 1.6), (LIGHT.soft, 1.6)}
    assert {look_of(line) for line in left.lines if line.get_zorder() != 4} == {
        (LIGHT.ink, 0.9), (blue, 5),
    }  # fmt: skip
    (band,) = right.patches
    (shown,) = legend.get_patches()
    assert shown.get_facecolor() == band.get_facecolor()
