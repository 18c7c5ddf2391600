"""Figures of Sobol' indices: what they draw is what the analysis says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.container import ErrorbarContainer
from matplotlib.text import Text
from sblcosim.analysis.space import figures
from sblcosim.analysis.space.analysis import Sensitivity, indices
from sblcosim.study.distributions import distribution_of
from sblcosim.study.space import DrawnFactor, sample
from sblcosim.style import THEMES, new_figure

DRAWN = sample(
    (
        DrawnFactor(
            "gps", distribution_of("log-uniform", range=[0.05, 5]), label="GPS error", unit="m"
        ),
        DrawnFactor("arm", distribution_of("uniform", range=[1, 3])),
        DrawnFactor("grade", distribution_of("choice", levels=["good", "bad $x$"])),
        DrawnFactor("ticks", distribution_of("choice", levels=[1, 4])),
    ),
    64,
)  # fmt: skip


def found(transform="log", *, flag: bool = False) -> Sensitivity:
    x = DRAWN.values
    y = x["gps"] ** 0.5 / x["arm"] * (1 + (x["grade"] == "good")) * x["ticks"]
    y = (y > 1).astype(float) if flag else y
    return indices(DRAWN, y.to_numpy(), "ekf.lost" if flag else "ekf.error_m", transform=transform)


FOUND = found()


def texts(figure) -> list[Text]:
    figure.draw_without_rendering()
    return [t for t in figure.findobj(Text) if t.get_text() and t.get_visible()]


def test_bars_are_as_long_as_the_indices_and_lines_are_the_intervals() -> None:
    ax = figures.plot_indices(FOUND)
    bars, lines = ([c for c in ax.containers if isinstance(c, ErrorbarContainer) is wanted]
                   for wanted in (False, True))
    table = FOUND.ranked().iloc[::-1]
    for kind, drawn, line in zip(("first", "total"), bars, lines, strict=True):
        assert [bar.get_width() for bar in drawn] == table[kind].tolist()
        ends = np.array([s[:, 0] for s in line[2][0].get_segments()])
        assert ends == pytest.approx(table[[f"{kind}_low", f"{kind}_high"]].to_numpy())
    names = [t.get_text() for t in ax.get_yticklabels()]
    assert sorted(names) == ["GPS error", "arm", "chance (the seed)", "grade", "ticks"]
    assert ax.get_title("left") == "Sobol' indices of ln ekf.error_m"
    assert ax.get_xlim()[1] >= 1


def test_each_factor_has_a_panel_with_its_unit_and_scale() -> None:
    panels = [p for p in figures.plot_scatter(FOUND) if p.axison]
    assert [p.get_xlabel() for p in panels] == ["GPS error [m]", "arm", "grade", "ticks"]
    assert [p.get_xscale() for p in panels] == ["log", "linear", "linear", "linear"]
    assert {p.get_yscale() for p in panels} == {"log"}
    assert panels[0].get_ylabel() == "ekf.error_m [m]"
    row = FOUND.indices.loc["gps"]
    assert panels[0].get_title("left") == f"first {row['first']:.2f}, total {row['total']:.2f}"
    assert [t.get_text() for t in panels[2].get_xticklabels()] == ["good", "bad $x$"]
    assert [t.get_text() for t in panels[3].get_xticklabels()] == ["1", "4"]
    raw = [p for p in figures.plot_scatter(found("none")) if p.axison]
    assert {p.get_yscale() for p in raw} == {"linear"}


def test_the_points_are_the_independent_runs() -> None:
    y = FOUND.values.copy()
    y[3] = np.nan  # the first base row is left out
    part = indices(DRAWN, y, "ekf.error_m", transform="log")
    panel = figures.plot_scatter(part)[1]
    points = panel.lines[0].get_xydata()
    first = [(i + 1) * 7 for i in range(63)]
    runs = [*first, *(i + 6 for i in first)]
    assert (points[:, 0] == DRAWN.values["arm"].to_numpy()[runs]).all()
    assert (points[:, 1] == y[runs]).all()


def test_the_means_are_those_of_the_level() -> None:
    panel = figures.plot_scatter(FOUND)[2]
    (container,) = panel.containers
    means = container[0].get_ydata()
    runs = np.arange(64) * 7
    runs = np.concatenate([runs, runs + 6])
    grade = DRAWN.values["grade"].to_numpy()[runs]
    for mean, level in zip(means, ("good", "bad $x$"), strict=True):
        assert mean == pytest.approx(np.exp(np.log(FOUND.values[runs][grade == level]).mean()))
    flag = found("none", flag=True)
    labels = figures.plot_scatter(flag)[0].get_legend_handles_labels()[1]
    assert labels == ["share of similar runs, 95 % intervals", "independent runs"][::-1]


def test_conditional_means_have_equally_many_values() -> None:
    x = np.random.default_rng(1).uniform(size=1000)
    centres, means, errors = figures.conditional_mean(x, x**2)
    assert len(centres) == figures.MOST_BINS
    assert means == pytest.approx(centres**2, abs=0.01)
    third = np.sort(x)[100:150] ** 2
    assert (means[2], errors[2]) == pytest.approx((third.mean(), third.std(ddof=1) / 50**0.5))
    few = figures.conditional_mean(x[:40], x[:40])
    assert len(few[0]) == 2
    same = np.repeat([1.0, 2.0, 3.0], 100)
    centres, means, _ = figures.conditional_mean(same, same**2)
    assert centres.tolist() == [1, 2, 3]
    assert means.tolist() == [1, 4, 9]


@pytest.mark.parametrize("low_high", [(0.05, 5), (1.1, 1.4), (0.2, 3), (1e-6, 1e6), (3, 3.0001)])
def test_logarithmic_axes_have_plain_numbers(low_high: tuple[float, float]) -> None:
    factor = DrawnFactor("x", distribution_of("log-uniform", range=low_high))
    drawn = sample([factor], 64)
    panel = figures.plot_scatter(indices(drawn, drawn.values["x"].to_numpy()))[0]
    panel.figure.draw_without_rendering()
    shown = [t.get_text() for t in panel.get_xticklabels() if t.get_text()]
    low, high = panel.get_xlim()
    inside = [float(t) for t in shown if low <= float(t) <= high]
    assert 2 <= len(inside) <= 13
    assert not any("$" in t for t in shown)
    # Neither end is far from a number, and no decade is without one.
    ends = np.log10([x := panel.lines[0].get_xdata()][0][[x.argmin(), x.argmax()]])
    gaps = np.diff(np.unique([*ends, *np.clip(np.log10(inside), *ends)]))
    assert gaps.max() <= min(1.0, 0.5 * np.ptp(ends)) + 1e-9


def test_bars_of_indices_stand_in_pairs_with_the_largest_total_on_top() -> None:
    ax = figures.plot_indices(FOUND)
    names = list(FOUND.ranked().index[::-1])
    bars = [c for c in ax.containers if not isinstance(c, ErrorbarContainer)]
    look = THEMES["light"]
    for drawn, up, colour in zip(bars, (0.18, -0.18), look.receivers, strict=False):
        for row, bar in enumerate(drawn):
            assert bar.get_y() + bar.get_height() / 2 == pytest.approx(row + up)
            assert bar.get_height() == pytest.approx(0.36)
            assert to_hex(bar.get_facecolor()) == colour
    lines = [c for c in ax.containers if isinstance(c, ErrorbarContainer)]
    for drawn, up in zip(lines, (0.18, -0.18), strict=True):
        ends = np.array(drawn[2][0].get_segments())
        np.testing.assert_allclose(ends[:, 0, 1], np.arange(len(names)) + up)
    assert ax.get_yticks().tolist() == list(range(len(names)))
    assert FOUND.ranked()["total"].iloc[0] == FOUND.ranked()["total"].max()
    assert ax.figure.get_size_inches() == pytest.approx([4.8, 1.7 + 0.5 * len(names)])
    assert ax.get_xlabel() == "Share of the variance;\nlines: 95 % intervals"


def test_panels_of_factors_are_in_a_column_or_in_two_if_there_are_many() -> None:
    for count, columns, width in ((3, 1, 4.2), (6, 1, 4.2), (7, 2, 5.4)):
        names = "abcdefg"[:count]
        even = distribution_of("uniform", range=[1, 3])
        drawn = sample([DrawnFactor(name, even) for name in names], 64)
        y = drawn.values.to_numpy() @ np.arange(1.0, count + 1)
        panels = figures.plot_scatter(indices(drawn, y, "ekf.error_m"))
        rows = -(-count // columns)
        assert panels[0].get_gridspec().get_geometry() == (rows, columns)
        assert panels[0].figure.get_size_inches() == pytest.approx([width, 0.9 + 2.3 * rows])
        assert [panel.axison for panel in panels] == [True] * count + [False] * (
            rows * columns - count
        )
        assert [panel.get_ylabel() for panel in panels[:count]] == [
            "ekf.error_m [m]" if number % columns == 0 else "" for number in range(count)
        ]


@pytest.mark.parametrize("count", [64, 512])
def test_runs_of_a_level_are_spread_and_many_points_are_small(count: int) -> None:
    drawn = sample(DRAWN.factors, count)
    x = drawn.values
    y = (x["gps"] ** 0.5 / x["arm"] * (1 + (x["grade"] == "good")) * x["ticks"]).to_numpy()
    panels = figures.plot_scatter(indices(drawn, y, "ekf.error_m", transform="log"))
    points = panels[2].lines[0]
    rows = 2 * count
    assert len(points.get_xdata()) == rows
    many = rows > 1000
    assert (points.get_markersize(), points.get_rasterized()) == ((3, True) if many else (5, False))
    assert points.get_alpha() == 0.5
    beside = points.get_xdata() - np.round(points.get_xdata())
    assert 0.2 < abs(beside).max() <= 0.25
    assert abs(beside.mean()) < 0.05
    (means,) = panels[2].containers
    grade = drawn.values["grade"].to_numpy()
    base = np.arange(count) * 7
    runs = np.concatenate([base, base + 6])
    bars = means[2][0].get_segments()
    assert means[0].get_linestyle() == "None"
    assert panels[0].containers[0][0].get_linestyle() == "-"
    for place, level, bar in zip((0, 1), ("good", "bad $x$"), bars, strict=True):
        logs = np.log(y[runs][grade[runs] == level])
        reach = 1.959964 * logs.std(ddof=1) / np.sqrt(len(logs))
        ends = np.exp([logs.mean() - reach, logs.mean() + reach])
        # Lengths are those of the ends on the axis.
        np.testing.assert_allclose(bar, [(place, ends[0]), (place, ends[1])], rtol=1e-5)


@pytest.mark.parametrize(("rows", "bins"), [(31, 1), (32, 2), (48, 3), (319, 19), (400, 20)])
def test_a_bin_has_sixteen_runs_and_there_are_twenty_at_most(rows: int, bins: int) -> None:
    x = np.random.default_rng(2).permutation(np.arange(float(rows)))
    centres, means, errors = figures.conditional_mean(x, 2 * x + 1)
    assert len(centres) == len(means) == len(errors) == bins
    cuts = np.round(np.linspace(0, rows, bins + 1)[1:-1]).astype(int)
    parts = np.split(np.arange(float(rows)), cuts)
    np.testing.assert_allclose(centres, [np.median(part) for part in parts])
    np.testing.assert_allclose(means, [2 * part.mean() + 1 for part in parts])
    np.testing.assert_allclose(
        errors, [2 * part.std(ddof=1) / np.sqrt(len(part)) for part in parts]
    )
    one = figures.conditional_mean(np.array([1.0, 2.0, 2.0]), np.array([5.0, 1.0, 2.0]),
                                   discrete=True)  # fmt: skip
    assert one[1].tolist() == [5.0, 1.5]
    assert np.isnan(one[2][0])
    assert one[2][1] == pytest.approx(0.5)


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_no_text_is_small(theme) -> None:
    named = replace(FOUND, label="RMS total error " * 6)
    for picture in (named.plot_indices(theme=theme), named.plot_scatter(theme=theme)):
        assert min(t.get_fontsize() for t in texts(picture.figure)) >= 8


def test_they_draw_into_given_axes() -> None:
    ax = new_figure(5, 5).add_subplot()
    assert FOUND.plot_indices(ax).axes == (ax,)
    axes = list(new_figure(9, 3).subplots(1, 4))
    assert FOUND.plot_scatter(axes).axes == tuple(axes)
