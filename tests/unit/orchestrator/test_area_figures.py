"""What the figures of an area draw, and where: cells, contours, hatching, beacons and sizes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
import sblcosim
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize, to_hex
from matplotlib.ticker import MaxNLocator
from sblcosim.areas import figures
from sblcosim.areas.grid import Grid
from sblcosim.areas.result import AreaMap
from sblcosim.style import SIZE, THEMES

LINE = 1.25 * SIZE / 72
ROWS, COLUMNS = 4, 6
SOUTH_TO_NORTH = np.repeat(np.arange(4.0), 6)
WEST_TO_EAST = np.tile(np.arange(6.0), 4)
CROSS = np.array([[3.0, 0, 1], [-3, 0, 1], [0, 3, 1], [0, -3, 1]])


def area(
    north: tuple[float, float] = (-10.0, 30.0), east: tuple[float, float] = (5.0, 125.0),
    beacons: Any = CROSS, limit: float | None = 4.0, **columns: Any,
) -> AreaMap:
    """A map of 4 x 6 cells; errors grow by 1 m from row to row, the possible one to the east."""
    cells = pd.DataFrame({
        "runs": np.full(24, 3), "p95_m": 2.25 + SOUTH_TO_NORTH, "std_error_m": 0.1,
        "lost_share": 0.0, "accuracy": True, "possible_p95_m": 1.5 + 0.2 * WEST_TO_EAST,
        "hdop": 1.25 + 0.1 * WEST_TO_EAST + 0.01 * SOUTH_TO_NORTH,
    }).assign(**columns)
    return AreaMap(
        scenario=sblcosim.load("realistic-dive"), receiver="coupled", motion="in circles",
        settings={"error": "absolute_total", "limit_m": limit, "runs": 3}, failures={},
        grid=Grid(north, east, ROWS, COLUMNS, 5.0), cells=cells,
        beacons=np.asarray(beacons, float), origin=None,
    )  # fmt: skip


def legend_of(ax: Axes) -> list[str]:
    (legend,) = ax.figure.legends  # type: ignore[union-attr]
    return [" ".join(text.get_text().split()) for text in legend.get_texts()]


def bars_of(ax: Axes) -> list[Any]:
    return [it for it in ax.figure.axes if it.get_label() == "<colorbar>"]


# --- Sizes ---------------------------------------------------------------------------------------

SHAPES = [
    # north and east; height of a panel and ticks both ways; the same on a narrow page
    ((40.0, 120.0), (3.2 / 3, 5, 3), (1.2, 5, 4)),
    ((300.0, 30.0), (1.8 * 3.2, 1, 5), (1.8 * 3.6, 1, 5)),
    ((10.0, 100.0), (0.8, 5, 1), (1.2, 5, 1)),
    ((250.0, 100.0), (5.76, 3, 5), (6.48, 4, 5)),
]


@pytest.mark.parametrize("narrow", [False, True])
@pytest.mark.parametrize("shape", SHAPES)
def test_panels_have_the_shape_of_the_area_within_bounds(narrow: bool, shape: Any) -> None:
    (north, east), *both = shape
    limit = None if east > 100 else 4.0
    high, across, up = both[narrow]
    found = area((-10.0, north - 10), (5.0, 5.0 + east), limit=limit)
    axes = figures.plot_map(found, narrow=narrow)
    figure: Any = axes[0].figure
    titles = 0.0 if limit is None else 2 * LINE
    caption = LINE * (figure.get_supxlabel().count("\n") + 2)
    if narrow:
        legend = 1.2 * LINE * len(legend_of(axes[0]))
        size = [3.6 + 1.5, 3 * (high + 0.45 + titles) + 0.5 + legend + caption]
    else:
        size = [3 * 3.2 + 0.9 + 2.1, high + titles + 1.8 + caption]
    assert figure.get_size_inches() == pytest.approx(size)
    columns = (3, 1) if narrow else (1, 3)
    for number, ax in enumerate(axes):
        assert ax.get_gridspec().get_geometry() == columns  # type: ignore[union-attr]
        assert (ax.get_ylim(), ax.get_xlim()) == ((-10, north - 10), (5, 5 + east))
        assert ax.get_aspect() == 1
        for axis, most in ((ax.xaxis, across), (ax.yaxis, up)):
            locator: Any = axis.get_major_locator()
            np.testing.assert_array_equal(
                locator.tick_values(0, 97), MaxNLocator(most).tick_values(0, 97)
            )
        below = number == 2 or not narrow
        assert ax.get_xlabel() == ("East y [m]" if below else "")
        assert ax.get_ylabel() == ("North x [m]" if narrow or number == 0 else "")
    assert figure.get_supxlabel().replace("\n", " ") == figures.caption(found)


def test_two_maps_of_certainty_are_beside_each_other() -> None:
    found = area(lost_share=0.01 * SOUTH_TO_NORTH)
    axes = figures.plot_certainty(found)
    figure: Any = axes[0].figure
    caption = LINE * (figure.get_supxlabel().count("\n") + 2)
    size = [2 * 3.2 + 0.9 + 2.1, 3.2 / 3 + 1.8 + caption]
    assert figure.get_size_inches() == pytest.approx(size)
    assert [ax.get_title("left") for ax in axes] == ["coupled", ""]
    assert figure.get_supxlabel().startswith("realistic-dive, 5 m deep;")


# --- Cells and colours ---------------------------------------------------------------------------


def test_cells_are_where_they_are_and_unknown_ones_are_empty() -> None:
    p95 = 2.25 + SOUTH_TO_NORTH + 0.1 * WEST_TO_EAST
    p95[8] = np.inf
    for ax, column in zip(figures.plot_map(area(p95_m=p95)), ("p95_m", "possible_p95_m", "hdop"),
                          strict=True):  # fmt: skip
        mesh: Any = ax.collections[0]
        east, north = np.moveaxis(mesh.get_coordinates(), 2, 0)
        np.testing.assert_allclose(east[0], [5, 25, 45, 65, 85, 105, 125])
        np.testing.assert_allclose(north[:, 0], [-10, 0, 10, 20, 30])
        values = area(p95_m=p95).cells[column].to_numpy().reshape(4, 6)
        shown = np.ma.filled(mesh.get_array(), np.nan).reshape(4, 6)
        np.testing.assert_array_equal(shown, np.where(np.isinf(values), np.nan, values))
        assert mesh.get_cmap().name == "viridis_r"


@pytest.mark.parametrize(("factor", "logarithmic"), [(5.9, False), (6.1, True)])
def test_colours_are_logarithmic_from_six_times_the_smallest_value(
    factor: float, logarithmic: bool
) -> None:
    """Of both errors together; HDOP has colours of its own."""
    possible = np.linspace(1.0, 2.0, 24)
    p95 = np.linspace(1.5, factor, 24)
    p95[5] = np.inf
    axes = figures.plot_map(area(p95_m=p95, possible_p95_m=possible))
    scales = [ax.collections[0].norm for ax in axes]
    assert scales[0] is scales[1]
    for scale in scales[:2]:
        assert type(scale) is (LogNorm if logarithmic else Normalize)
        assert (scale.vmin, scale.vmax) == pytest.approx((1.0, factor))
    assert type(scales[2]) is Normalize
    assert (scales[2].vmin, scales[2].vmax) == pytest.approx((1.25, 1.78))
    errors, dilution = bars_of(axes[0])
    assert errors.get_xlabel() == "95 % of the absolute total errors within [m]"
    assert dilution.get_xlabel() == "HDOP [m per m of range error]"
    ticks = [t for t in errors.get_xticks() if 1 <= t <= factor]
    if logarithmic:
        assert ticks == pytest.approx([1, 2, 3, 5])
        words = errors.xaxis.get_major_formatter().format_ticks(ticks)
        assert words == ["1", "2", "3", "5"]
        assert not len(errors.xaxis.get_minorticklocs())
    narrow = bars_of(figures.plot_narrow(area())[0])
    assert [bar.get_ylabel() for bar in narrow] == [
        "95 % of the absolute total\nerrors within [m]", "HDOP [m per m\nof range error]",
    ]


def test_colours_of_noise_and_of_a_value_of_zero_are_linear() -> None:
    flat = area(p95_m=4.0, possible_p95_m=np.linspace(3.9, 4.1, 24), std_error_m=0.1)
    scale: Any = figures.plot_map(flat)[0].collections[0].norm
    assert (scale.vmin, scale.vmax) == pytest.approx((3.0, 5.0))  # 20 standard errors
    zero: Any = figures.plot_map(area(possible_p95_m=0.0))[1].collections[0].norm
    assert type(zero) is Normalize
    same: Any = figures.plot_map(area(hdop=2.0))[2].collections[0].norm
    assert (same.vmin, same.vmax) == pytest.approx((1.8, 2.2))


@pytest.mark.parametrize(("most", "top"), [(0.004, 1.0), (0.4, 40.0)])
def test_uncertainty_is_in_per_cent_from_zero_to_one_at_least(most: float, top: float) -> None:
    p95 = 2.25 + SOUTH_TO_NORTH
    found = area(std_error_m=most * p95 * (1 - WEST_TO_EAST / 10), p95_m=p95,
                 lost_share=most * WEST_TO_EAST / 5)  # fmt: skip
    axes = figures.plot_certainty(found)
    for ax, share in zip(axes, (1 - WEST_TO_EAST / 10, WEST_TO_EAST / 5), strict=True):
        mesh: Any = ax.collections[0]
        np.testing.assert_allclose(np.ravel(mesh.get_array()), 100 * most * share)
        assert (mesh.norm.vmin, mesh.norm.vmax) == pytest.approx((0, top))
    assert [bar.get_xlabel() for bar in bars_of(axes[0])] == [figures.ERROR, figures.LOSSES]
    assert list(figures.uncertain(area())) == [figures.ERROR]
    assert list(figures.uncertain(area(std_error_m=0.0, lost_share=0.5))) == [figures.LOSSES]
    assert list(figures.uncertain(area(std_error_m=np.nan))) == []
    none = figures.plot_certainty(area())
    assert none[0].figure.get_supxlabel().startswith(  # type: ignore[union-attr]
        "No run was lost. realistic-dive, 5 m deep;"
    )


# --- The requirement -----------------------------------------------------------------------------


def contours_of(ax: Axes) -> list[Any]:
    return [it for it in ax.collections if type(it).__name__ == "QuadContourSet"]


def test_contours_of_the_requirement_are_where_the_error_is_the_limit() -> None:
    """Rows are 10 m apart and errors 1 m, so the band of two standard errors is 4 m wide."""
    first, second, third = figures.plot_map(area(limit=4.0, std_error_m=0.1))
    # 4 m is 1.75 rows from the middle of the first one, 5 m from the south end.
    found = {
        round(float(np.mean(it.get_paths()[0].vertices[:, 1])), 6): it for it in contours_of(first)
    }
    assert sorted(found) == pytest.approx([10.5, 12.5, 14.5])
    for north, line in found.items():
        middle = north == 12.5
        assert line.get_linewidth()[0] == (1.4 if middle else 0.8)
        assert (line.get_linestyle()[0][1] is None) == middle
        assert line.get_edgecolor()[0].tolist() == [0, 0, 0, 1]
        (rim,) = line.get_path_effects()
        assert rim._gc == {"linewidth": 2.6 if middle else 1.8, "foreground": "#ffffff"}
        assert np.ptp(line.get_paths()[0].vertices[:, 0]) == pytest.approx(100)
    assert not contours_of(second)  # 2.5 m at most
    assert not contours_of(third)
    assert legend_of(first) == [
        "beacons, to scale", "95 % within 4.0 m", "4.0 m ± 2 standard errors",
    ]
    handles: Any = first.figure.legends[0].legend_handles  # type: ignore[union-attr]
    assert [it.get_linewidth() for it in handles[1:]] == [1.4, 0.8]


def test_the_possible_error_has_a_contour_without_a_band() -> None:
    first, second, _ = figures.plot_map(area(limit=2.0))
    assert not contours_of(first)  # 2.25 m at least
    (line,) = contours_of(second)
    east = line.get_paths()[0].vertices[:, 0]
    np.testing.assert_allclose(east, 15 + 20 * 2.5)
    assert legend_of(first) == ["beacons, to scale", "95 % within 2.0 m"]
    near = figures.plot_map(area(limit=2.2))[0]
    (band,) = contours_of(near)  # 2.05 m with two standard errors less
    assert band.get_linewidth()[0] == 0.8
    assert "95 % within 2.2 m" in legend_of(near)  # of what is possible
    certain = figures.plot_certainty(area(limit=4.0))[0]
    assert len(contours_of(certain)) == 3


def test_a_limit_that_is_the_smallest_or_largest_error_is_no_contour() -> None:
    for limit in (2.25, 5.25):
        first = figures.plot_map(area(limit=limit, std_error_m=0.0, possible_p95_m=1.0))[0]
        assert not contours_of(first)
    assert not contours_of(figures.plot_map(area(limit=None))[0])


def test_titles_have_the_share_within_the_requirement() -> None:
    first, second, third = figures.plot_map(area(limit=2.0))
    assert first.get_title("left") == "coupled\nno part within 2.0 m"
    assert second.get_title("left") == "possible\n50 % within 2.0 m"
    assert third.get_title("left") == "HDOP"
    tall = figures.plot_map(area((0.0, 300.0), (0.0, 30.0), limit=3.25))
    assert tall[0].get_title("left") == "coupled\n50 % within\n3.2 m"  # in lines of an inch
    wide = figures.plot_map(area((0.0, 300.0), (0.0, 120.0), limit=3.25))
    assert wide[0].get_title("left") == "coupled\n50 % within 3.2 m"  # of 2.3 inches
    assert [ax.get_title("left") for ax in figures.plot_map(area(limit=None))] == [
        "coupled", "possible", "HDOP",
    ]


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_cells_with_lost_runs_or_without_accuracy_are_hatched(theme: Any) -> None:
    lost = np.zeros(24)
    lost[[8, 9]] = 0.051
    lost[3] = 0.05
    found = area(lost_share=lost, accuracy=WEST_TO_EAST > 0)
    first, second, third = figures.plot_map(found, theme=theme)
    look = THEMES[theme]
    (dots,) = (it for it in contours_of(first) if it.filled)
    (stripes,) = (it for it in contours_of(second) if it.filled)
    assert (dots.hatches, stripes.hatches) == (["...."], ["////"])
    assert not [it for it in contours_of(third) if it.filled]
    for hatched, low, high in ((dots, (45, 0), (85, 10)), (stripes, (5, -10), (25, 30))):
        corners = np.vstack([path.vertices for path in hatched.get_paths()])
        assert corners.min(axis=0) == pytest.approx(low, abs=0.15)
        assert corners.max(axis=0) == pytest.approx(high, abs=0.15)
    assert legend_of(first)[-2:] == [
        "more than 5 % of the runs lost", "no accuracy is possible",
    ]
    handles: Any = first.figure.legends[0].legend_handles  # type: ignore[union-attr]
    assert [it.get_hatch() for it in handles[-2:]] == ["....", "////"]
    papers = [to_hex(it.get_facecolor()) for it in handles[-2:]]
    assert papers == ["#9a9a9a", look.paper]
    inks = [to_hex(it.get_edgecolor()) for it in handles[-2:]]
    assert inks == ["#000000", look.ink]
    assert legend_of(figures.plot_map(area(lost_share=0.05))[0])[-1] != (
        "more than 5 % of the runs lost"
    )


# --- Beacons -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("arm", "side", "kind", "turned"), [
    (3.0, 299.0, "arms", False), (3.0, 301.0, "mark", False), (9.99, 100.0, "arms", True),
    (10.01, 100.0, "apart", False), (0.3, 29.0, "arms", True), (0.3, 31.0, "mark", True),
])  # fmt: skip
def test_beacons_have_arms_unless_these_are_too_short_or_too_long(
    arm: float, side: float, kind: str, turned: bool
) -> None:
    """Shorter than a hundredth of the longer side, or longer than 10 m."""
    beacons = CROSS[:3] * np.array([arm / 3, arm / 3, 9.0])
    beacons = np.vstack([beacons, beacons[2] * [0, -1, 1]]) + np.array([4.0, -2.0, 0.0])
    sides = ((0.0, side), (0.0, 0.4 * side))
    for ax in figures.plot_map(area(*(sides[::-1] if turned else sides), beacons=beacons)):
        (marks,) = (line for line in ax.lines if line.get_marker() == "^")
        arms = [line for line in ax.lines if line is not marks]
        assert len(arms) == (4 if kind == "arms" else 0)
        for line, beacon in zip(arms, beacons, strict=False):
            np.testing.assert_allclose(line.get_xydata(), [[-2, 4], beacon[[1, 0]]], atol=1e-9)
            assert (line.get_linewidth(), line.get_zorder()) == (0.9, 4.9)
        at = [[-2.0, 4.0]] if kind == "mark" else beacons[:, [1, 0]]
        np.testing.assert_allclose(marks.get_xydata(), at, atol=1e-9)
        assert marks.get_markersize() == (5 if kind == "mark" else 3.5)
        assert marks.get_linestyle() == "None"
        words = {3.0: "4 beacons within 3.0 m", 0.3: "4 beacons within 0.30 m"}
        label = words[arm] if kind == "mark" else "beacons, to scale"
        assert " ".join(str(marks.get_label()).split()) == label
