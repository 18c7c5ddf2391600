"""What the figures of a run draw, and where: coordinates, errors, angles, ranges and maps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from matplotlib.quiver import Quiver
from mpl_toolkits.mplot3d import proj3d  # type: ignore[import-untyped]
from sblcosim import style
from sblcosim.data.record import Record
from sblcosim.limits.verdict import Limits
from sblcosim.results.figures import drawing, maps
from sblcosim.results.figures import run as plots
from sblcosim.style import THEMES
from synthetic_record import BEACONS, make_record, track

LIGHT = THEMES["light"]
TIME_S = np.arange(101) * 0.1


def with_values(record: Record, **values: Any) -> Record:
    """The record with some columns replaced; two underscores in a name stand for a dot."""
    return Record(record.time_ns, record.values | {
        name.replace("__", "."): np.asarray(value, float) for name, value in values.items()
    })  # fmt: skip


def later(record: Record, start_s: float, factor: float = 1.0) -> Record:
    """The record with other times."""
    time_s = start_s + factor * record.time_ns / 1e9
    return Record((1e9 * time_s).round().astype(np.int64), record.values)


def line_of(ax: Axes, label: str) -> Any:
    (found,) = (line for line in ax.lines if line.get_label() == label)
    return found


def title_of(ax: Axes) -> str:
    return " ".join(ax.figure.get_suptitle().split())  # type: ignore[union-attr]


def widths(limits: Sequence[float], margin: float) -> tuple[float, float]:
    low, high = limits
    return low - margin * (high - low), high + margin * (high - low)


# --- Coordinates and errors over time ------------------------------------------------------------


def test_coordinates_are_drawn_over_the_epochs_within_their_limits() -> None:
    """North is from 0 to 5 m, and the estimates of the first filter are 7 m beside it."""
    errors = {"raw": [[20.0, 1, 2]], "ekf": [[7.0, -0.1, 0.1]], "other": [[-9.0, 2.0, 9.0]]}
    record = make_record({name: np.array(it) for name, it in errors.items()})
    tracks = {name: track(record, name) for name in errors}
    axes = plots.plot_axes(record, tracks)
    truth = record.values["target.position"]
    for i, ax in enumerate(axes):
        np.testing.assert_allclose(line_of(ax, "truth").get_xdata(), TIME_S)
        np.testing.assert_allclose(line_of(ax, "truth").get_ydata(), truth[:, i])
        for name, (error,) in errors.items():
            np.testing.assert_allclose(line_of(ax, name).get_xdata(), TIME_S[1:100])
            np.testing.assert_allclose(line_of(ax, name).get_ydata(), truth[1:100, i] + error[i])
    # The first filter is all there, another one as far as half the extent, a raw fix as far as 3 m.
    high = 0.5 * 9.9 + 7
    north = -high / 2, high + 3
    assert axes[0].get_ylim() == pytest.approx(widths(north, 0.06))
    assert axes[1].get_ylim() == pytest.approx(widths((9.9, 12.0), 0.06))
    assert axes[2].get_ylim() == pytest.approx(widths((8.1, 5.0), 0.06))
    assert [ax.get_ylabel() for ax in axes] == ["North x [m]", "East y [m]", "Depth z [m]"]
    outside = int((0.5 * TIME_S[1:100] + 20 > axes[0].get_ylim()[1]).sum())
    assert f"raw ({outside}\u00a0of\u00a099), other (99\u00a0of\u00a099)".replace(
        "\u00a0", " ") in title_of(axes[0])
    one = plots.plot_axes(record, {"raw": tracks["raw"]})
    assert one[0].get_ylim()[1] > 20 + 0.5 * 9.9  # without a filter it is a raw fix
    flat = plots.plot_axes(record, {})
    assert flat[2].get_ylim() == pytest.approx((5.25, 4.75))


def test_errors_have_zero_in_the_middle_and_the_total_begins_there() -> None:
    record = make_record({"ekf": np.array([[1.0, -3.0, 2.0]]), "raw": np.array([[2.0, 1.0, 4.0]])},
                         variance=0.09)  # fmt: skip
    tracks = {name: track(record, name) for name in ("ekf", "raw")}
    axes = plots.plot_errors(record, tracks)
    total = np.sqrt(14)
    for ax, error, raw in zip(axes, (1, -3, 2, total), (2, 1, 4, np.sqrt(21)), strict=True):
        np.testing.assert_allclose(line_of(ax, "ekf").get_xdata(), TIME_S[1:100])
        np.testing.assert_allclose(line_of(ax, "ekf").get_ydata(), error)
        np.testing.assert_allclose(line_of(ax, "raw").get_ydata(), raw)
        top = 1.1 * abs(error)
        assert ax.get_ylim() == pytest.approx((0 if error == total else -top, top))
        zero = [line for line in ax.lines if [*line.get_ydata()] == [0, 0]]
        assert len(zero) == (error != total)
        for line in zero:
            assert (line.get_color(), line.get_linewidth()) == (LIGHT.ink, 0.8)
            assert line.get_zorder() == 2
    assert [ax.get_ylabel() for ax in axes] == [
        "Error in x [m]", "Error in y [m]", "Error in z [m]", "Total error [m]",
    ]
    assert title_of(axes[0]) == (
        "Estimate minus truth; bands: claimed ±2σ; outside the figure: raw (99 of 99)"
    )
    two = plots.plot_errors(record, {"ekf": tracks["ekf"].iloc[:2]})[0]
    assert len(two.collections) == 1


def test_what_was_possible_is_drawn_from_the_first_estimate_on() -> None:
    record = make_record({"late": np.zeros((1, 3)), "early": np.zeros((1, 3))})
    tracks = {"late": track(record, "late").iloc[30:], "early": track(record, "early").iloc[12:],
              "none": track(record, "early").iloc[:0]}  # fmt: skip
    count = len(record.time_ns)
    each = np.tile(np.eye(3), (count, 1, 1))
    possible = Limits(record.time_ns, each, each, np.zeros(count), np.zeros(count, bool), 0.01,
                      is_bound=False)
    ax = plots.plot_errors(record, tracks, reference=possible)[0]
    own = {name: len(table) for name, table in tracks.items()}
    more = [line for line in ax.lines if line.get_label() not in own and line.get_zorder() != 1.5]
    times = np.concatenate([
        *(np.asarray(line.get_xdata(), float) for line in more if len(line.get_xdata()) > 2),
        *(band.get_paths()[0].vertices[:, 0] for band in ax.collections),
    ])  # fmt: skip
    assert np.nanmin(times) == pytest.approx(1.3)


@pytest.mark.parametrize(("span_s", "unit", "seconds", "tick"), [
    (4.0, "s", 1, 0.5), (8.9, "s", 1, 1), (9.1, "s", 1, 2), (40.0, "s", 1, 5),
    (91.0, "s", 1, 20), (1199.0, "s", 1, 200), (1200.0, "min", 60, 300),
    (2700.0, "min", 60, 300), (10799.0, "min", 60, 1200), (10800.0, "h", 3600, 1800),
    (9 * 3600.0, "h", 3600, 3600), (40 * 3600.0, "h", 3600, 5 * 3600),
])  # fmt: skip
def test_a_time_axis_has_its_unit_and_nine_steps_at_most(
    span_s: float, unit: str, seconds: float, tick: float
) -> None:
    """From 20 minutes on it is in minutes, and from 3 hours on in hours."""
    axes = list(style.new_figure(5, 5).subplots(3))
    plots.scale_time(axes, 720.0, 720.0 + span_s)
    for ax in axes:
        assert ax.get_xlim() == pytest.approx((720 - 0.01 * span_s, 720 + 1.01 * span_s))
    ax = axes[-1]
    assert [it.get_xlabel() for it in axes] == ["", "", f"Time [{unit}]"]
    ticks = np.array([t for t in ax.get_xticks() if ax.get_xlim()[0] <= t <= ax.get_xlim()[1]])
    assert np.diff(ticks) == pytest.approx(np.full(len(ticks) - 1, tick))
    words = ax.xaxis.get_major_formatter().format_ticks(ticks.tolist())
    assert words == [f"{t / seconds:.10g}" for t in ticks]
    record = later(make_record(), -50.0, span_s / 10)
    assert plots.unit_of(record) == (unit, seconds)
    plots.time_axis(axes, record)
    assert ax.get_xlim() == pytest.approx((-50 - 0.01 * span_s, -50 + 1.01 * span_s))
    assert ax.xaxis.get_major_formatter()(-5.0 * seconds) == "−5"


# --- Angles of the platform, and ranges ----------------------------------------------------------


def angles(record: Record, degrees: Any, **more: Any) -> Record:
    return with_values(record, platform__attitude=np.deg2rad(degrees), **more)


def test_angles_have_panels_of_one_scale_about_their_middles() -> None:
    turn = np.linspace(0, 2 * np.pi, 101)
    swing = np.column_stack([3 + 10 * np.sin(turn), 2 * np.cos(turn), 40 + 5 * np.sin(turn)])
    record = later(angles(make_record(), swing), 500.0)
    axes = plots.plot_inclination(record)
    for i, (ax, middle) in enumerate(zip(axes, (3, 0, 40), strict=True)):
        assert ax.get_ylim() == pytest.approx((middle - 11.5, middle + 11.5))
        (line,) = ax.lines
        assert line.get_color() == LIGHT.receivers[i]
        assert (line.get_marker(), line.get_linestyle()) == (".", "-")
        np.testing.assert_allclose(line.get_xdata(), 500 + TIME_S)
        np.testing.assert_allclose(line.get_ydata(), swing[:, i])
    assert title_of(axes[0]) == "Inclination of the platform"
    assert axes[-1].get_xlabel() == "Time [s]"
    short = plots.plot_inclination(record, window_s=7.5)
    assert title_of(short[0]) == "Inclination of the platform, first 7.5 s"
    assert len(short[0].lines[0].get_xdata()) == 76
    assert short[0].get_ylim() == pytest.approx((3 - 11.5, 3 + 11.5))
    # Thirty intervals at least.
    shortest = plots.plot_inclination(record, window_s=2.9)
    assert title_of(shortest[0]) == "Inclination of the platform, first 3 s"
    assert len(shortest[0].lines[0].get_xdata()) == 31
    calm = plots.plot_inclination(angles(make_record(), 0.04 * swing))[1]
    assert calm.get_ylim() == pytest.approx((-0.5, 0.5))


@pytest.mark.parametrize(("rows", "factor", "marker", "style_of_line"), [
    (199, 1.0, ".", "-"), (200, 1.0, "None", "-"), (150, 2.5, ".", "-"), (150, 2.6, ".", "None"),
])  # fmt: skip
def test_few_samples_of_angles_have_marks_and_those_too_rare_no_line(
    rows: int, factor: float, marker: str, style_of_line: str
) -> None:
    """Above a quarter of a second between samples, a line would show other waves."""
    time_ns = (np.arange(rows) * factor * 1e8).round().astype(np.int64)
    record = Record(time_ns, {"platform.attitude": np.zeros((rows, 3))})
    (ax, *_) = plots.plot_inclination(record, window_s=1e4)
    (line,) = ax.lines
    assert (line.get_marker(), line.get_linestyle()) == (marker, style_of_line)
    sampled = ", sampled every 0.26 s" if factor == 2.6 else ""
    assert title_of(ax) == f"Inclination of the platform{sampled}"


def test_reported_angles_are_compared_around_the_circle() -> None:
    swing = np.column_stack([np.linspace(0, 5, 101), np.linspace(3, -2, 101), np.full(101, 170)])
    said = swing + np.array([0.5, -1.5, 20.0])
    said[:, 2] -= 360
    record = angles(make_record(), swing, platform__reported_attitude=np.deg2rad(said))
    axes = plots.plot_inclination(record, window_s=8.0)
    errors = axes[3]
    for i, (name, error) in enumerate({"roll": 0.5, "pitch": -1.5, "yaw": 20.0}.items()):
        line = line_of(errors, name)
        np.testing.assert_allclose(line.get_ydata(), error)
        np.testing.assert_allclose(line.get_xdata(), TIME_S[:81])
        assert line.get_color() == LIGHT.receivers[i]
        assert line.get_linewidth() == 1
    (zero,) = (line for line in errors.lines if [*line.get_ydata()] == [0, 0])
    assert (zero.get_color(), zero.get_linewidth(), zero.get_zorder()) == (LIGHT.ink, 0.8, 2)
    assert len({str(line_of(errors, name).get_linestyle()) for name in ("roll", "pitch")}) == 2
    given = list(style.new_figure(5, 5).subplots(4))
    exact = plots.plot_inclination(angles(make_record(), swing), given)
    np.testing.assert_allclose(line_of(exact[3], "yaw").get_ydata(), 0, atol=1e-9)
    assert plots.plot_inclination(record, list(style.new_figure(5, 5).subplots(3)))[2].lines


def test_ranges_are_drawn_over_distance_with_what_is_left_over() -> None:
    distance, mean = np.array([10.0, 50, 200]), np.array([10.4, 50.1, 199.0])
    std = np.array([0.1, 0.2, 0.3])
    above, below = plots.plot_range_test(distance, mean, std, (0.5, 0.99))
    ends = [0, 208]
    ideal = line_of(above, "range = distance")
    assert (ideal.get_xdata().tolist(), ideal.get_ydata().tolist()) == (ends, ends)
    assert (ideal.get_color(), ideal.get_linewidth()) == (LIGHT.ink, 1)
    marks = line_of(above, "mean range, ± standard deviation")
    np.testing.assert_array_equal(marks.get_xydata(), np.column_stack([distance, mean]))
    assert (marks.get_marker(), marks.get_markersize()) == ("o", 4.5)
    (bars,) = below.containers
    np.testing.assert_allclose(bars[0].get_ydata(), mean - distance)
    segments = np.array(bars[2][0].get_segments())
    np.testing.assert_allclose(segments[:, 0, 1], mean - distance - std)
    np.testing.assert_allclose(segments[:, 1, 1], mean - distance + std)
    np.testing.assert_allclose(segments[:, 0, 0], distance)
    fitted = line_of(below, "fitted line")
    np.testing.assert_allclose(fitted.get_xdata(), ends)
    np.testing.assert_allclose(fitted.get_ydata(), [0.5, 0.5 - 0.01 * 208])
    assert fitted.get_color() == LIGHT.receivers[1]
    assert fitted.get_linestyle() == "--"
    assert [*below.get_xlim()] == ends
    assert below.get_ylabel() == "Range − distance [m]"
    assert title_of(above) == "Ranges at known distances"
    (zero,) = (line for line in below.lines if [*line.get_ydata()] == [0, 0])
    assert zero.get_color() == LIGHT.ink


# --- Maps ----------------------------------------------------------------------------------------

NORTH_EAST = {"x_m": (-20.0, 60.0), "y_m": (5.0, 25.0)}
"""80 m to the north, 20 m to the east."""


def test_limits_of_a_map_reach_as_far_in_all_directions() -> None:
    seen = np.array([[0.0, 5.0, 1.0], [40.0, 7.0, 2.0]])
    far = pd.DataFrame({
        "x_m": [-99.0, 99.0], "y_m": [-99.0, 99.0], "z_m": [-99.0, 99.0], "error_x_m": 0.1,
        "error_y_m": 0.1, "error_z_m": 0.1,
    })
    found = maps.limits_of(seen, {"ekf": far}, "xyz")
    assert list(found) == ["x_m", "y_m", "z_m"]
    assert found["x_m"] == pytest.approx(widths((-20, 60), 0.06))
    assert found["y_m"] == pytest.approx(widths((-15, 27), 0.06))
    assert found["z_m"] == pytest.approx(widths((-19, 22), 0.06))
    deep = np.array([[0.0, 5.0, 1.0], [4.0, 7.0, 101.0]])
    assert maps.limits_of(deep, {"ekf": far}, "xy")["x_m"] == pytest.approx(widths((-50, 54), 0.06))


def test_widened_limits_keep_their_middle_and_are_never_narrower() -> None:
    assert maps.widened((2.0, 6.0), 10.0) == (-1.0, 9.0)
    assert maps.widened((2.0, 6.0), 3.0) == (2.0, 6.0)


FREE = 7.2 - 0.72 - 0.12
"""Width of the figure between its margins [inch]."""


@pytest.mark.parametrize(("north", "east", "count", "legend", "wide", "high", "is_beside"), [
    (30.0, 30.0, 1, 2.0, FREE, 6.2, False),  # the largest height
    (15.0, 30.0, 1, 2.0, FREE, FREE / 2, False),
    (3.0, 30.0, 1, 2.0, FREE, FREE / 3.2, False),  # the flattest
    (60.0, 30.0, 1, 2.0, FREE - 2.12, 6.2, True),
    (60.0, 30.0, 1, FREE - 0.12 - 3.11, FREE - (FREE - 3.11), 6.2, True),  # it just fits beside
    (60.0, 30.0, 1, FREE - 0.12 - 3.09, FREE, 6.2, False),
    (30.0, 10.0, 2, 2.0, (FREE - 0.12) / 2, 3.6, False),
    (6.0, 10.0, 2, 2.0, (FREE - 0.12) / 2, 0.6 * (FREE - 0.12) / 2, False),
    (1.0, 10.0, 5, 2.0, (FREE - 0.24) / 3, (FREE - 0.24) / 6, False),
])  # fmt: skip
def test_a_sheet_has_maps_of_the_shape_of_the_data_within_bounds(
    north: float, east: float, count: int, legend: float, wide: float, high: float, is_beside: bool
) -> None:
    limits = {"x_m": (7.0, 7.0 + north), "y_m": (-5.0, -5.0 + east)}
    sheet = maps.Sheet(limits, count, legend)
    assert (sheet.wide, sheet.high) == pytest.approx((wide, high))
    assert sheet.beside == is_beside
    assert sheet.scale == pytest.approx(min(wide / east, high / north))
    for column, size, middle in (("x_m", high, 7 + north / 2), ("y_m", wide, -5 + east / 2)):
        low, top = sheet.limits[column]
        assert top - low == pytest.approx(size / sheet.scale)
        assert (low + top) / 2 == pytest.approx(middle)


@pytest.mark.parametrize(("count", "rows", "columns"), [
    (1, 1, 1), (2, 1, 2), (3, 2, 2), (4, 2, 2), (5, 2, 3), (6, 2, 3), (7, 3, 3), (10, 4, 3),
])  # fmt: skip
def test_maps_are_in_rows_of_two_or_three(count: int, rows: int, columns: int) -> None:
    sheet = maps.Sheet({"x_m": (0.0, 40.0), "y_m": (0.0, 50.0)}, count, 2.0)
    axes = sheet.axes()
    figure: Any = axes[0].figure
    assert len(axes) == count
    assert axes[0].get_gridspec().get_geometry() == (rows, columns)  # type: ignore[union-attr]
    title = 1.25 * 9.5 / 72 + 0.06
    height = 0.5 + rows * sheet.high + (rows - 1) * (0.12 + title)
    assert figure.get_size_inches() == pytest.approx([7.2, height])
    for number, ax in enumerate(figure.axes):
        assert ax.axison == (number < count)
    for number, ax in enumerate(axes):
        assert isinstance(ax.xaxis.get_major_formatter(), drawing.WholeTicks)
        assert isinstance(ax.yaxis.get_major_formatter(), drawing.WholeTicks)
        below = number + columns >= count
        assert ax.xaxis.get_major_ticks()[0].label1.get_visible() == below
        first = number % columns == 0
        assert ax.yaxis.get_major_ticks()[0].label1.get_visible() == first
    maps.name_axes(axes, "up", "right")
    for number, ax in enumerate(axes):
        assert ax.get_xlabel() == ("right" if number // columns == rows - 1 else "")
        assert ax.get_ylabel() == ("up" if number % columns == 0 else "")


def test_a_map_has_as_many_ticks_as_there_is_room_for() -> None:
    """Numbers below each other take 0.4 inch, those beside each other their width and 0.35 inch."""
    for north, east, count in ((30.0, 30.0, 1), (3.0, 30.0, 1), (90.0, 10.0, 8), (2e5, 1e5, 8)):
        sheet = maps.Sheet({"x_m": (0.0, north), "y_m": (0.0, east)}, count, 2.0)
        ax = sheet.axes()[0]
        longest = max(drawing.inches(f"{end:.0f}") for end in sheet.limits["y_m"])
        for room, each, limits, axis in (
            (sheet.wide, longest + 0.35, sheet.limits["y_m"], ax.xaxis),
            (sheet.high, 0.4, sheet.limits["x_m"], ax.yaxis),
        ):
            bins = min(max(int(room / each), 2), 9)
            step = np.diff(axis.get_major_locator().tick_values(*limits))[0]
            fine = step / 10 ** np.floor(np.log10(step) + 1e-9)
            assert min(abs(fine - each_fine) for each_fine in (1, 2, 2.5, 5)) < 1e-6
            steps = sorted(a * 10.0**b for a in (1, 2, 2.5, 5) for b in range(-3, 7))
            smallest = next(s for s in steps if np.ptp(limits) / s <= bins + 1)
            assert smallest * 0.999 < step < 2.6 * smallest


def platform_of(record: Record) -> maps.Platform:
    return maps.Platform(record, record.values["target.position"])


def test_beacons_that_move_less_than_their_marks_are_called_beacons() -> None:
    """By a fiftieth of the extent of path and beacons, seen from above."""
    path = np.column_stack([np.linspace(0, 50, 101), np.zeros(101), np.linspace(0, 400, 101)])
    for sway, name in ((0.98, "beacons"), (1.08, "beacons (mean)")):
        beacons = np.tile(BEACONS, (101, 1, 1))
        beacons[:, 2, 1] += sway * np.cos(np.arange(101) * np.pi)
        record = with_values(make_record(), target__position=path,
                             platform__beacon_position=beacons)  # fmt: skip
        assert platform_of(record).name == name
        # The extent is 53 m, from the beacon in the south to the north end of the path.


def test_the_platform_is_known_from_the_means_of_its_beacons() -> None:
    off = np.array([0.5, -2.0, 0.25])
    drift = np.linspace(-1, 1, 101)[:, None, None] * [0.1, 0.2, 0.0]
    record = make_record(platform_error=tuple(off))
    reports = record.values["platform.reported_beacon_position"] + drift
    platform = platform_of(with_values(record, platform__reported_beacon_position=reports))
    np.testing.assert_allclose(platform.true, BEACONS)
    np.testing.assert_allclose(platform.reported, BEACONS + off)
    middle = BEACONS.mean(axis=0) + off
    np.testing.assert_allclose(platform.centres, middle + drift[:, 0], atol=1e-12)
    assert (platform.is_exact, platform.is_far, platform.dotted) == (False, False, True)
    assert platform.names == ["beacons", "beacons as reported (mean)", "platform as reported"]
    exact = platform_of(make_record())
    assert (exact.is_exact, exact.is_far, exact.dotted) == (True, False, False)
    assert exact.names == ["beacons"]
    apart = [30.0, 20.0, 1.0]
    buoys = np.tile(BEACONS * apart, (101, 1, 1))
    far = platform_of(with_values(record, platform__beacon_position=buoys,
                                  platform__reported_beacon_position=buoys + off))  # fmt: skip
    assert (far.is_exact, far.is_far, far.dotted) == (False, True, False)
    assert far.names == ["beacons", "beacons as reported (mean)"]


@pytest.mark.parametrize(("rows", "shown"), [(500, 500), (501, 251), (1001, 334)])
def test_five_hundred_reports_of_the_platform_are_shown_at_most(rows: int, shown: int) -> None:
    steps = np.arange(float(rows))
    reports = BEACONS + steps[:, None, None]
    values = {"platform.beacon_position": np.tile(BEACONS, (rows, 1, 1)),
              "platform.reported_beacon_position": reports}  # fmt: skip
    record = Record(np.arange(rows) * 100_000_000, values)
    centres = maps.Platform(record, np.zeros((rows, 3))).centres
    every = {500: 1, 501: 2, 1001: 3}[rows]
    np.testing.assert_allclose(centres[:, 0], steps[::every])
    assert len(centres) == shown


def test_arms_go_from_the_middle_to_each_beacon_which_has_the_mark() -> None:
    record = make_record(platform_error=(0.5, -2.0, 0.25))
    ax = plots.plot_path(record, {})
    middle, off = BEACONS.mean(axis=0), np.array([0.5, -2.0, 0.25])
    for marker, shift, label, paper in (
        ("^", 0 * off, "beacons", LIGHT.soft),
        ("v", off, "beacons as reported (mean)", LIGHT.paper),
    ):
        arms = [line for line in ax.lines if line.get_marker() == marker]
        assert [line.get_label() == label for line in arms] == [True, False, False, False]
        for line, beacon in zip(arms, BEACONS, strict=True):
            ends = np.array([middle, beacon]) + shift
            np.testing.assert_allclose(line.get_xydata(), ends[:, [1, 0]], atol=1e-12)
            assert line.get_markevery() == [-1]
            assert (line.get_markersize(), line.get_linewidth(), line.get_zorder()) == (6, 1, 3)
            assert (line.get_color(), line.get_markerfacecolor()) == (LIGHT.ink, paper)
            assert line.is_dashed() == (marker == "v")
    dots = line_of(ax, "platform as reported")
    np.testing.assert_allclose(dots.get_xydata()[7], (middle + off)[[1, 0]])
    assert (dots.get_markersize(), dots.get_alpha(), dots.get_zorder()) == (2.2, 0.9, 2.5)
    many = {f"filter {i}": track(make_record(), "ekf") for i in range(4)}
    small = plots.plot_path(record, many)
    assert line_of(small, "platform as reported").get_markersize() == pytest.approx(2.2 * 4 / 9)
    assert line_of(small, "beacons").get_markersize() == 4
    buoys = np.tile(BEACONS * [30.0, 20.0, 1.0], (101, 1, 1))
    apart = plots.plot_path(with_values(make_record(), platform__beacon_position=buoys,
                                        platform__reported_beacon_position=buoys), {})
    far = [line for line in apart.lines if line.get_marker() == "^"]
    for line, beacon in zip(far, buoys[0], strict=True):
        assert line.get_xydata().tolist() == [beacon[[1, 0]].tolist()]
        assert line.get_linestyle() == "None"


def test_a_map_contains_the_path_and_the_platform_true_and_as_reported() -> None:
    record = make_record(platform_error=(0.0, -30.0, 0.0))  # 33 m to the west of the middle
    ax = plots.plot_path(record, {})
    low, high = ax.get_xlim()
    assert low == pytest.approx(-33 - 0.06 * 43)
    assert high == pytest.approx(10 + 0.06 * 43)
    given = style.new_figure(5, 5).add_subplot()
    plots.plot_path(record, {}, given)
    assert given.get_ylim() == pytest.approx(widths((-3, 5), 0.06))
    assert given.get_xlim() == pytest.approx(widths((-33, 10), 0.06))
    assert given.get_legend() is not None
    assert given.get_title("left").startswith("Map")


def on_a_map(path: Any, span_s: float, wide: float = 100.0) -> Axes:
    """A path on given axes of 5.6 inches that are `wide` [m], with beacons in the corners."""
    with style.use("light"):
        figure = style.new_figure(7, 7, laid_out=True)
        ax = figure.add_axes((0.1, 0.1, 0.8, 0.8))
    corners = np.array([(1, 1, 0), (1, -1, 0), (-1, 1, 0), (-1, -1, 0)]) * wide / 2 / 1.12
    beacons = np.tile(corners, (101, 1, 1))
    record = with_values(later(make_record(), 0.0, span_s / 10), target__position=path,
                         platform__beacon_position=beacons,
                         platform__reported_beacon_position=beacons)  # fmt: skip
    plots.plot_path(record, {}, ax)
    assert ax.get_xlim() == pytest.approx((-wide / 2, wide / 2))
    return ax


def marks_of(ax: Axes) -> Any:
    """Marks in time on the path, without its ends."""
    (marks,) = (line for line in ax.lines if line.get_marker() == "o" and line.zorder == 5.5)
    return marks


def straight(length: float) -> np.ndarray:
    return np.column_stack([np.zeros(101), np.linspace(-0.5, 0.5, 101) * length, np.zeros(101)])


@pytest.mark.parametrize(("room", "span_s", "said"), [
    (1.99, 60.0, ""), (2.01, 60.0, "30 s"), (2.99, 60.0, "30 s"), (3.01, 60.0, "20 s"),
    (5.99, 60.0, "20 s"), (6.01, 60.0, "10 s"), (9.0, 60.0, "10 s"),
    (2.01, 80.0, "1 min"), (2.01, 79.0, ""), (2.01, 2500.0, "30 min"), (2.5, 12000.0, "2 h"),
    (3.5, 10000.0, "1 h"), (6.5, 0.59, "0.1 s"), (6.5, 1.19, "0.2 s"),
    (6.5, 2.9, "0.5 s"), (6.5, 119.0, "20 s"), (6.5, 719.0, "2 min"),
])  # fmt: skip
def test_marks_in_time_are_as_many_as_the_path_has_room_for(
    room: float, span_s: float, said: str
) -> None:
    """One for 0.4 inch of it, but six at most, and none if a single step takes most of the way."""
    ax = on_a_map(straight(room * 0.4 / 5.6 * 100), span_s)
    title = " ".join(ax.get_title("left").split())
    assert title == ("Map" + (f", with a mark every {said}" if said else ""))
    assert (len(marks_of(ax).get_xdata()) > 0) == bool(said)


def test_marks_of_a_path_to_and_fro_are_no_more_than_those_of_its_extent() -> None:
    """Two and a half times."""
    for room, said in ((2.4, "20 s"), (2.41, "10 s")):
        turns = room / 2.5 * 0.4 / 5.6 * 100 * (np.arange(101) % 2 - 0.5)
        diagonal = np.column_stack([0.6 * turns, 0.8 * turns, np.zeros(101)])
        ax = on_a_map(diagonal * 2.5, 60.0)
        assert ax.get_title("left") == f"Map, with a mark every {said}"


def test_marks_and_ends_of_a_path_have_their_looks_and_places() -> None:
    ax = on_a_map(straight(60.0), 60.0)
    marks = marks_of(ax)
    np.testing.assert_allclose(marks.get_xdata(), np.arange(10, 60, 10) - 30.0)
    assert (marks.get_markersize(), marks.get_color()) == (3.5, LIGHT.ink)
    ends = {line.get_marker(): line for line in ax.lines if line.get_zorder() == 6}
    assert ends["o"].get_xydata().tolist() == [[-30, 0]]
    assert ends["s"].get_xydata().tolist() == [[30, 0]]
    for line in ends.values():
        assert (line.get_markersize(), line.get_markerfacecolor()) == (7, LIGHT.paper)
    found = {text.get_text(): text.get_position() for text in ax.texts}
    assert found == {
        "start": (-30, 0), "end": (30, 0),
        **{f"{t} s": pytest.approx((t - 30.0, 0.0)) for t in (10, 20, 30, 40, 50)},
    }
    assert {(text.get_fontsize(), text.get_zorder()) for text in ax.texts} == {(8.5, 7)}
    (arrows,) = (it for it in ax.collections if isinstance(it, Quiver))
    np.testing.assert_allclose(arrows.X, np.arange(5, 60, 10) - 30.0)
    np.testing.assert_allclose(arrows.Y, 0, atol=1e-12)
    np.testing.assert_allclose(arrows.U, 1)
    np.testing.assert_allclose(arrows.V, 0, atol=1e-12)


def test_arrowheads_are_of_one_length_and_turn_with_the_path() -> None:
    """To the east in 30 s, a rest of 30 s, and north in 30 s; the marks are every 20 s."""
    at = [0.0, 30, 60, 90]
    t = np.linspace(0, 90, 101)
    path = np.column_stack([
        np.interp(t, at, [-10, -10, -10, 40]), np.interp(t, at, [-40, 10, 10, 10]), 0 * t,
    ])  # fmt: skip
    ax = on_a_map(path, 90.0)
    assert ax.get_title("left") == "Map, with a mark every 20 s"
    (arrows,) = (it for it in ax.collections if isinstance(it, Quiver))
    np.testing.assert_allclose(arrows.U, [1, 1, 0], atol=0.01)
    np.testing.assert_allclose(arrows.V, [0, 0, 1], atol=0.01)
    np.testing.assert_allclose(arrows.X, [-40 + 50 / 3, 10, 10], atol=0.4)
    np.testing.assert_allclose(arrows.Y, [-10, -10, -10 + 50 / 3], atol=0.4)
    labels = {text.get_text() for text in ax.texts}
    assert "40–60 s" in labels or "40 s" in labels


@pytest.mark.parametrize(("across", "up", "words"), [
    (0.44, 0.0, {"start, end"}), (0.46, 0.0, {"start", "end"}), (0.0, 0.17, {"start, end"}),
    (0.0, -0.19, {"start", "end"}), (-0.44, 0.17, {"start, end"}),
])  # fmt: skip
def test_ends_near_each_other_share_a_label(across: float, up: float, words: set[str]) -> None:
    """Within 0.45 inch across and 0.18 inch up, when drawn."""
    turn = np.linspace(0, 2 * np.pi, 101)
    metres = 100 / 5.6
    share = np.linspace(0, 1, 101)
    path = np.column_stack([
        3 * np.sin(turn) + up * metres * share, 3 * np.cos(turn) + across * metres * share,
        np.zeros(101),
    ])  # fmt: skip
    ax = on_a_map(path, 60.0)
    labels = {text.get_text() for text in ax.texts}
    assert {label for label in labels if not label[0].isdigit()} == words


def test_maps_of_each_receiver_have_its_name_and_its_line_alone() -> None:
    errors = {name: np.array([[shift, 0.0, 0.0]])
              for shift, name in enumerate(("a", "b", "raw", "c", "d" * 60))}
    record = make_record(errors)
    tracks = {name: track(record, name) for name in errors}
    first = plots.plot_path(record, tracks)
    axes = [ax for ax in first.figure.axes if ax.axison]
    assert [ax.get_title("left")[:3] for ax in axes] == ["a", "b", "raw", "c", "ddd"]
    assert drawing.inches(axes[4].get_title("left")) <= axes[4].bbox.width / first.figure.dpi
    for shift, (ax, table) in enumerate(zip(axes, tracks.values(), strict=True)):
        norths = [line.get_ydata() for line in ax.lines if len(line.get_ydata()) == len(table)]
        assert len(norths) == 1
        np.testing.assert_allclose(norths[0], 0.5 * TIME_S[1:100] + shift)
    three = {name: tracks[name] for name in ("a", "b", "raw", "c")}
    assert len(plots.plot_path(record, three).figure.axes) == 1


# --- In space ------------------------------------------------------------------------------------


def in_space(
    path: np.ndarray, tracks: Mapping[str, pd.DataFrame] | None = None, **values: Any
) -> Any:
    record = with_values(make_record(), target__position=path, **values)
    return plots.plot_path_3d(record, tracks or {})


def test_space_has_limits_of_its_own_and_is_not_too_narrow() -> None:
    """Its narrower side is 0.35 of its longest one at least, and so is its height."""
    share = np.linspace(0, 1, 101)[:, None]
    ax = in_space(share * [100.0, 0.0, 4.0])
    north = widths((-3, 100), 0.06)
    longest = north[1] - north[0]
    assert ax.get_ylim() == pytest.approx(north)
    middle = 0.0
    assert ax.get_xlim() == pytest.approx((middle - 0.175 * longest, middle + 0.175 * longest))
    depth = widths((0, 4), 0.06)
    assert ax.get_zlim() == pytest.approx(depth[::-1])
    stretch = 0.35 * longest / (depth[1] - depth[0])
    assert title_of(ax) == f"Path in space; depth ×{stretch:.2g}"
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_zlabel()) == (
        "East y [m]", "North x [m]", "Depth z [m]",
    )


def test_estimates_beyond_the_box_are_not_drawn_in_space() -> None:
    record = make_record({"ekf": np.array([[1.0, 0, 0]])})
    tracks = {"ekf": track(record, "ekf")}
    tracks["ekf"].loc[10, "z_m"] = 500.0
    ax = plots.plot_path_3d(record, tracks)
    east, north, depth = line_of(ax, "ekf").get_data_3d()
    assert [np.isnan(it).nonzero()[0].tolist() for it in (east, north, depth)] == [[10]] * 3
    np.testing.assert_allclose(np.delete(north, 10), np.delete(0.5 * TIME_S[1:100] + 1, 10))
    np.testing.assert_allclose(np.delete(east, 10), 10)
    assert "outside the figure: ekf (1 of 99)" in title_of(ax)


@pytest.mark.parametrize("extent", [(30.0, 20.0, 5.0), (10.0, 12.0, 90.0), (80.0, 5.0, 30.0)])
def test_the_box_in_space_fills_the_figure_but_for_its_margins(
    extent: tuple[float, float, float]
) -> None:
    """0.5 inch on the left, 1.0 on the right, 0.8 below and 0.1 above; 6 inches high at most."""
    ax = in_space(np.linspace(0, 1, 101)[:, None] * extent)
    figure = ax.figure
    figure.draw_without_rendering()
    corners = np.array(list(product(ax.get_xlim(), ax.get_ylim(), ax.get_zlim())))
    flat = np.column_stack(proj3d.proj_transform(*corners.T, ax.get_proj())[:2])
    inches = ax.transData.transform(flat) / figure.dpi
    (left, bottom), (right, top) = inches.min(axis=0), inches.max(axis=0)
    width, height = figure.get_size_inches()
    legend = figure.legends[0].get_window_extent()
    above = legend.height / figure.dpi + 0.12 + 1.25 * 9.5 / 72 + 0.06
    assert bottom == pytest.approx(0.8)
    assert left - 0.5 == pytest.approx(width - 1.0 - right)
    assert height - top == pytest.approx(above + 0.1)
    assert (width, height - above <= 6.0 + 1e-9) == (7.2, True)
    assert left == pytest.approx(0.5) or height - above == pytest.approx(6.0)


def test_space_has_marks_at_the_ends_and_beacons_with_arms() -> None:
    ax = in_space(np.linspace(0, 1, 101)[:, None] * [30.0, 20.0, 5.0])
    ends = {line.get_marker(): line for line in ax.lines if line.get_zorder() == 6}
    assert np.ravel(ends["o"].get_data_3d()).tolist() == [0, 0, 0]
    assert np.ravel(ends["s"].get_data_3d()).tolist() == [20, 30, 5]
    for line in ends.values():
        assert (line.get_markersize(), line.get_color()) == (6, LIGHT.ink)
    middle = BEACONS.mean(axis=0)
    arms = [line for line in ax.lines if line.get_marker() == "^"]
    assert [line.get_label() == "beacons" for line in arms] == [True, False, False, False]
    for line, beacon in zip(arms, BEACONS, strict=True):
        east, north, depth = line.get_data_3d()
        np.testing.assert_allclose(np.column_stack([north, east, depth]), [middle, beacon])
        assert (line.get_markevery(), line.get_linestyle()) == ([-1], "-")
    buoys = np.tile(BEACONS * [30.0, 20.0, 1.0], (101, 1, 1))
    far = in_space(np.linspace(0, 1, 101)[:, None] * [30.0, 20.0, 5.0],
                   platform__beacon_position=buoys)  # fmt: skip
    assert {x.get_linestyle() for x in far.lines if x.get_marker() == "^"} == {"None"}


def test_the_narrow_sides_of_the_box_have_few_ticks() -> None:
    """Fewer on a side that is shorter than 0.6 of the longest; numbers are clear of the names."""
    ax = in_space(np.linspace(0, 1, 101)[:, None] * [97.0, 47.0, 20.0])
    assert np.ptp(ax.get_xlim()) < 0.6 * np.ptp(ax.get_ylim())
    shown = [
        sum(min(limits) <= t <= max(limits) for t in ticks)
        for ticks, limits in ((ax.get_xticks(), ax.get_xlim()), (ax.get_yticks(), ax.get_ylim()))
    ]  # fmt: skip
    assert shown == [3, 5]
    for axis in (ax.xaxis, ax.yaxis):
        numbers = axis.get_major_formatter().format_ticks(axis.get_majorticklocs())
        assert axis.labelpad == pytest.approx(50 * max(map(drawing.inches, numbers)) - 2)
