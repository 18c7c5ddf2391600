from __future__ import annotations

import io
import re
from dataclasses import replace
from itertools import combinations, product

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex
from matplotlib.text import Text
from sblcosim import style
from sblcosim.analysis.advice.advice import advise
from sblcosim.analysis.advice.figures import plot_front
from sblcosim.analysis.means import analysis as sweep
from sblcosim.analysis.two_level import figures as plots
from sblcosim.analysis.two_level.analysis import Factorial, analyse
from sblcosim.words.numbers import rounded
from scipy import stats

ALL = (
    plots.plot_pareto, plots.plot_interactions, plots.plot_main_effects, plots.plot_residuals
)


def experiment(replicates: int, order: int, centre: int = 0) -> Factorial:
    points = pd.DataFrame(list(product((1.0, 3.0), repeat=3)), columns=["gps", "arm", "loss"])
    runs = pd.concat([points] * replicates + [points[:1] * 0 + 2.0] * centre, ignore_index=True)
    noise = np.random.default_rng(1).normal(0, 0.3, len(runs))
    y = 5 + 2 * runs["gps"] - runs["arm"] * runs["gps"] + noise
    order_of_runs = np.random.default_rng(2).permutation(len(runs)) + 1
    table = runs.assign(y=y, run_order=order_of_runs)
    return analyse(table, ["gps", "arm", "loss"], "y", order=order, unit="m")


def sweep_means(analysis: Factorial, ax=None):
    """The means of a sweep over the same factors."""
    factors = list(analysis.factors)
    base = [analysis.levels[name][0] for name in factors]
    found = sweep.means(analysis.table, factors, analysis.response, base)
    given = None if ax is None else [ax] * len(factors)
    return sweep.plot_means(found, analysis.response, dict(analysis.units), given)


def front(analysis: Factorial, ax=None):
    """Cost and accuracy of the same points."""
    found = advise(analysis.table, analysis.factors, analysis.response, {}, unit="$5$")
    return plot_front(found, ax)


@pytest.fixture(scope="module")
def replicated() -> Factorial:
    return experiment(3, 2)


def test_pareto_has_the_largest_on_top_and_the_line_at_t(replicated):
    ax = plots.plot_pareto(replicated)
    names = [text.get_text() for text in ax.get_yticklabels()]
    expected = replicated.effects["t"].abs().sort_values()
    assert names == list(expected.index)
    widths = sorted(bar.get_width() for bar in ax.patches)
    np.testing.assert_allclose(widths, expected)
    assert replicated.reference in [line.get_xdata()[0] for line in ax.lines]


def test_pareto_says_how_many_it_leaves_out(replicated):
    ax = plots.plot_pareto(replicated, most=4)
    assert len(ax.patches) == 4
    assert ax.get_title("left") == "Effects on y, 4 of 6"


def test_pareto_shows_lenth_s_margins_where_nothing_is_left_over():
    analysis = experiment(1, 3)
    ax = plots.plot_pareto(analysis)
    assert analysis.lenth is not None
    assert [line.get_xdata()[0] for line in ax.lines] == [analysis.lenth.me, analysis.lenth.sme]
    drawn = io.StringIO()
    ax.figure.savefig(drawn, format="svg")
    lines = [line for line in drawn.getvalue().splitlines() if "stroke-width: 1.2" in line]
    assert len(lines) == 4, "the two margins, and their keys"
    dashes = [re.search(r"stroke-dasharray: [\d.,]+", line) for line in lines]
    assert len({found[0] for found in dashes if found}) == 2
    assert max(bar.get_width() for bar in ax.patches) == pytest.approx(
        analysis.effects["effect"].abs().max()
    )


def test_main_effects_are_the_means_around_the_overall_mean(replicated):
    ax = plots.plot_main_effects(replicated)
    mean, *lines = ax.lines
    assert mean.get_ydata()[0] == replicated.overall_mean
    assert replicated.unit == "m"
    assert mean.get_label() == f"overall mean {rounded(replicated.overall_mean)} m"
    means = [line for line in lines if line.get_marker() == "o"]
    drawn = np.concatenate([line.get_ydata(orig=False) for line in means])
    np.testing.assert_allclose(drawn, replicated.main_effects["mean"])


def test_main_effects_have_the_intervals_of_means():
    """As from the textbook: s t(df) / √n about the mean of the n runs at a level."""
    analysis = experiment(4, 2)
    table = analysis.table
    cells = table.groupby(list(analysis.factors))["y"]
    df = len(table) - cells.ngroups
    s = np.sqrt(((table["y"] - cells.transform("mean")) ** 2).sum() / df)
    n = len(table) / 2
    bar = plots.plot_main_effects(analysis).collections[0].get_segments()[0]
    mean = analysis.main_effects["mean"].iloc[0]
    reach = stats.t.ppf(0.975, df) * s / np.sqrt(n)
    np.testing.assert_allclose(sorted(bar[:, 1]), [mean - reach, mean + reach])


@pytest.mark.parametrize(("shift", "ends"), [(0.0, True), (-50.0, False)])
def test_bars_of_a_response_that_is_never_below_zero_end_there(shift, ends):
    points = pd.DataFrame(list(product((1.0, 3.0), repeat=2)) * 3, columns=["gps", "arm"])
    y = np.array([0, 0, 1, 0.2, 9, 0, 0.1, 0, 0, 80, 0, 3]) + shift
    analysis = analyse(points.assign(y=y), ["gps", "arm"], "y", unit="m")
    bars = plots.plot_main_effects(analysis).collections[0].get_segments()
    least = min(bar[:, 1].min() for bar in bars)
    assert (least == pytest.approx(0, abs=1e-12)) if ends else (least < shift)


def test_centre_points_are_drawn_among_the_main_effects():
    analysis = experiment(2, 2, centre=3)
    centre = plots.plot_main_effects(analysis).lines[-1]
    assert centre.get_label() == "centre points"
    expected = analysis.table.loc[analysis.table["gps"] == 2, "y"].mean()
    np.testing.assert_allclose(centre.get_ydata(), expected)


def test_interaction_panels_have_the_means_of_each_pair_of_levels(replicated):
    panels = plots.plot_interactions(replicated)
    runs = replicated.table
    low_arm, high_arm = panels[3].lines  # second row, first column: arm's lines over gps
    for line, arm in ((low_arm, 1.0), (high_arm, 3.0)):
        expected = runs[runs["arm"] == arm].groupby("gps")["y"].mean()
        np.testing.assert_allclose(line.get_ydata(), expected)


def test_residuals_are_drawn_against_fits_and_the_stored_run_order(replicated):
    normal, _, fits, order = plots.plot_residuals(replicated)
    table = replicated.residuals
    np.testing.assert_array_equal(fits.lines[-1].get_xdata(), table["fit"])
    np.testing.assert_array_equal(order.lines[-1].get_xdata(), table["run_order"])
    np.testing.assert_array_equal(order.lines[-1].get_ydata(), table["residual"])
    np.testing.assert_array_equal(normal.lines[0].get_xdata(), np.sort(table["residual"]))


LIGHT = style.THEMES["light"]


def test_bars_of_effects_have_the_colour_of_their_sign_and_a_row_each(replicated):
    ax = plots.plot_pareto(replicated)
    order = replicated.effects["t"].abs().sort_values()
    names = [text.get_text() for text in ax.get_yticklabels()]
    assert ax.get_yticks().tolist() == list(range(6))
    for bar in ax.patches:
        row = round(bar.get_y() + 0.35)
        assert bar.get_y() == pytest.approx(row - 0.35)
        assert bar.get_height() == pytest.approx(0.7)
        assert bar.get_width() == pytest.approx(order[names[row]])
        rises = replicated.effects.loc[names[row], "effect"] > 0
        assert to_hex(bar.get_facecolor()) == LIGHT.receivers[0 if rises else 1]
        assert (bar.get_hatch() or "") == ("" if rises else "///")
    assert {replicated.effects.loc[name, "effect"] > 0 for name in names} == {True, False}
    assert ax.get_ylim() == pytest.approx((-0.35 - 0.02 * 5.7, 5.35 + 0.02 * 5.7))
    assert ax.figure.get_size_inches() == pytest.approx([6.4, 1.8 + 6 * 0.25])
    (line,) = ax.lines
    t = stats.t.ppf(0.975, replicated.df)
    assert [*line.get_xdata()] == pytest.approx([t, t])
    assert [text.get_text() for text in ax.figure.legends[0].get_texts()] == [
        "positive effect: larger at the high level", "negative effect: smaller",
        f"t(0.975, {replicated.df:g}) = {t:.3f}",
    ]
    assert ax.get_xlabel() == "Standardised effect |t|"
    assert ax.get_title("left") == "Effects on y"
    few = plots.plot_pareto(replicated, most=5)
    assert [text.get_text() for text in few.get_yticklabels()] == list(order.index[1:])
    assert plots.plot_pareto(replicated, most=6).get_title("left") == "Effects on y"
    lenth = plots.plot_pareto(experiment(1, 3))
    margins = [text.get_text() for text in lenth.figure.legends[0].get_texts()][2:]
    both = experiment(1, 3).lenth
    assert margins == [f"ME {both.me:.3g} m (Lenth)", f"SME {both.sme:.3g} m"]
    assert lenth.get_xlabel() == "|effect| on y [m]"


def test_an_endless_bar_is_twice_as_long_as_the_longest_other_one():
    runs = pd.DataFrame(list(product((1.0, 3.0), repeat=2)) * 3, columns=["gps", "arm"])
    analysis = analyse(runs.assign(y=runs["gps"]), ["gps", "arm"], "y")
    effects = analysis.effects.copy()
    effects["t"] = [np.inf, -7.0, *[np.nan] * (len(effects) - 2)]
    made = replace(analysis, effects=effects)
    ax = plots.plot_pareto(made)
    assert sorted(bar.get_width() for bar in ax.patches)[-2:] == [7.0, 14.0]
    assert ax.get_xlim() == pytest.approx((0, 1.2 * max(7.0, made.reference)))
    effects["t"] = [np.inf, *[np.nan] * (len(effects) - 1)]
    alone = plots.plot_pareto(replace(analysis, effects=effects))
    assert max(bar.get_width() for bar in alone.patches) == 2.0
    assert alone.get_xlim() == pytest.approx((0, 1.2 * max(1.0, made.reference)))


@pytest.mark.parametrize(("count", "side"), [(2, 2.3), (3, 1.6), (4, 1.6), (5, 1.15)])
def test_interactions_have_panels_below_each_other_with_one_scale(count, side):
    names = ["gps", "arm", "loss", "sea", "ship"][:count]
    runs = pd.DataFrame(list(product((1.0, 3.0), repeat=count)) * 2, columns=names)
    y = runs.to_numpy() @ np.arange(1.0, count + 1) + 0.5 * runs["gps"] * runs["arm"]
    noise = np.random.default_rng(1).normal(0, 0.1, len(runs))
    analysis = analyse(runs.assign(y=y + noise), names, "y", order=2, unit="m")
    panels = plots.plot_interactions(analysis)
    figure = panels[0].figure
    width = 1.2 + side * count
    assert figure.get_size_inches() == pytest.approx([width, 0.8 + 0.4 + side * (count - 1)])
    grid = panels[0].get_gridspec()
    assert grid.get_geometry() == (count, count)
    assert grid.get_height_ratios() == pytest.approx([0.4 / side] + [1.0] * (count - 1))
    means = [
        analysis.table[(analysis.table[a] == x) & (analysis.table[b] == z)]["y"].mean()
        for a, b in combinations(names, 2) for x, z in product((1.0, 3.0), repeat=2)
    ]  # fmt: skip
    low, high = min(means), max(means)
    for row, column in product(range(count), range(count)):
        panel = panels[row * count + column]
        assert panel.axison == (column < row)
        if column < row:
            assert panel.get_xlim() == pytest.approx((-0.35, 1.35))
            assert panel.get_ylim() == pytest.approx(
                (low - 0.08 * (high - low), high + 0.08 * (high - low))
            )
            labels = [word for text in panel.get_xticklabels() if (word := text.get_text())]
            assert labels == (["1", "3"] if row == count - 1 else [])
            name = "Mean y [m]" if column == 0 and row == max(count // 2, 1) else ""
            assert panel.get_ylabel() == name
            one, other = panel.lines
            assert (one.get_marker(), other.get_marker()) == ("o", "s")
            assert (one.get_color(), other.get_color()) == LIGHT.receivers[:2]
            for line, value in ((one, 1.0), (other, 3.0)):
                part = analysis.table[analysis.table[names[row]] == value]
                expected = part.groupby(names[column])["y"].mean()
                np.testing.assert_allclose(line.get_ydata(), expected)
                assert line.get_xdata().tolist() == [0, 1]
                assert line.get_markersize() == 4
        elif column == row:
            words = [(text.get_text(), *text.get_position()) for text in panel.texts]
            height = 0.56 if row else 0.1
            keys = [("1", 0.48, 0.4), ("3", 0.48, pytest.approx(0.16))] if row else []
            assert words == [(names[row], 0.5, height), *keys]
            assert [line.get_xydata().tolist() for line in panel.lines] == [
                [[0.08, y], [0.4, y]] for _, _, y in keys
            ]
        else:
            assert not panel.lines
    assert figure.get_suptitle().replace("\n", " ") == (
        "Interactions: mean y [m] at each pair of levels"
    )


def test_main_effects_stand_side_by_side_with_names_below(replicated):
    ax = plots.plot_main_effects(replicated)
    assert ax.get_xticks().tolist() == [0, 1, 2, 3, 4, 5]
    assert [text.get_text() for text in ax.get_xticklabels()] == ["1", "3"] * 3
    assert ax.get_xticks(minor=True).tolist() == [0.5, 2.5, 4.5]
    assert [text.get_text() for text in ax.get_xticklabels(minor=True)] == ["gps", "arm", "loss"]
    lines = [line for line in ax.lines if line.get_marker() == "o"]
    assert [line.get_xdata(orig=False).tolist() for line in lines] == [[0, 1], [2, 3], [4, 5]]
    assert ax.figure.get_size_inches() == pytest.approx([1.2 + 3 * 0.95, 3.8])
    assert ax.get_ylabel() == "Mean y [m]"
    assert ax.get_title("left") == "Main effects on y"
    two = experiment(2, 2, centre=3)
    marks = plots.plot_main_effects(two).lines[-1]
    assert marks.get_xdata().tolist() == [0.5, 2.5, 4.5]
    single = analyse(two.table[two.table["gps"] != 2], ["gps", "arm"], "y", unit="m")
    assert plots.plot_main_effects(single).figure.get_size_inches()[0] == 4.0
    long_name = "height of the antenna above the deck"
    named = replicated.named({"gps": long_name}, {"gps": "m"}, "y")
    for own, width in ((True, 13), (False, 9)):
        given = None if own else style.new_figure(8, 4).subplots()
        words = plots.plot_main_effects(named, given).get_xticklabels(minor=True)[0].get_text()
        assert words.replace("\n", " ") == f"{long_name} [m]"
        lines = words.split("\n")
        assert max(map(len, lines)) <= width
        assert len(f"{lines[0]} {lines[1].split()[0]}") > width


def of_residuals(analysis, count):
    """The analysis with other residuals, that are not normal and not in order."""
    rng = np.random.default_rng(4)
    table = pd.DataFrame({
        "residual": rng.permutation(np.linspace(-1.0, 3.0, count)), "fit": rng.normal(5, 2, count),
        "run_order": rng.permutation(count) + 1,
    })
    return replace(analysis, residuals=table)


@pytest.mark.parametrize("count", [9, 400, 1000, 1001])
def test_residuals_are_compared_with_a_normal_distribution(replicated, count):
    """Blom's plotting positions; axes show the probabilities that are near."""
    analysis = of_residuals(replicated, count)
    normal, histogram, fits, order = plots.plot_residuals(analysis)
    residual = np.sort(analysis.residuals["residual"])
    dots, line = normal.lines
    shares = (np.arange(count) + 0.625) / (count + 0.25)
    np.testing.assert_allclose(dots.get_xdata(), residual)
    np.testing.assert_allclose(stats.norm.cdf(dots.get_ydata()), shares)
    ends = stats.norm.ppf(shares[[0, -1]])
    np.testing.assert_allclose(line.get_ydata(), ends)
    np.testing.assert_allclose(line.get_xdata(), residual.std() * ends)
    known = [0.01, 0.1, 1, 5, 20, 50, 80, 95, 99, 99.9, 99.99]
    expected = [p for p in known if abs(stats.norm.ppf(p / 100)) < ends[1] + 0.5]
    assert [text.get_text() for text in normal.get_yticklabels()] == [f"{p:g}" for p in expected]
    np.testing.assert_allclose(normal.get_yticks(), stats.norm.ppf(np.array(expected) / 100))
    bins = {9: 7, 400: 40, 1000: 40, 1001: 40}[count]
    assert len(histogram.patches) == bins
    many = count > 1000
    for panel in (normal, fits, order):
        (mine,) = (it for it in panel.lines if it.get_marker() == ".")
        assert (mine.get_markersize(), mine.get_alpha()) == ((3, 0.5) if many else (6, 1.0))
        assert bool(mine.get_rasterized()) == many
        assert len(mine.get_xdata()) == count
    for panel in (fits, order):
        assert [*panel.lines[0].get_ydata()] == [0, 0]
        assert panel.lines[0]._unscaled_dash_pattern == style.LINES[1]
    titles = [panel.get_title("left") for panel in (normal, histogram, fits, order)]
    assert titles == ["Normal probability", "Histogram", "Against fitted values",
                      "Against run order"]  # fmt: skip
    assert [panel.get_xlabel() for panel in (normal, histogram, fits, order)] == [
        "Residual [m]", "Residual [m]", "Fitted value [m]", "Run order (random)",
    ]
    assert normal.figure.get_suptitle() == "Residuals of y"


def test_of_very_many_residuals_one_is_drawn_in_each_place(replicated):
    """Those that lie within a five-hundredth of the panel, both ways, are one dot."""
    analysis = of_residuals(replicated, 20_000)
    assert len(plots.plot_residuals(analysis)[2].lines[-1].get_xdata()) == 20_000
    places = np.array(list(product(np.arange(0.1, 100), repeat=2)))  # the middles of some cells
    east, north = np.array([[0.15, 0.0], [0.0, 0.15]])
    parts = [places, places + 0.05, places + east, places + north]
    fit, residual = np.vstack([*parts, [[0.0, 0.0], [100.0, 100.0]]]).T
    table = pd.DataFrame({
        "fit": fit, "residual": residual, "run_order": np.arange(len(fit)) % 7,
    })
    fits = plots.plot_residuals(replace(replicated, residuals=table))[2]
    expected = np.vstack([parts[0], parts[2], parts[3], [[100.0, 100.0]]])
    np.testing.assert_array_equal(fits.lines[-1].get_xydata(), expected)


def test_the_profile_of_the_transform_has_its_interval_and_its_best_power(replicated):
    profile = pd.DataFrame({
        "lambda": [-1.0, -0.5, 0.25, 1.0, 2.0], "log_likelihood": [-9.0, -4.0, -2.0, -3.5, -8.0],
        "inside": [False, True, True, True, False],
    })
    ax = plots.plot_box_cox(replicated, profile=profile)
    (span,) = ax.patches
    extent = span.get_extents().transformed(ax.transData.inverted())
    assert extent.intervalx == pytest.approx((-0.5, 1.0))
    assert span.get_alpha() == 0.25
    curve, best, logarithm, response = ax.lines
    assert curve.get_ydata().tolist() == [-7, -2, 0, -1.5, -6]
    assert [line.get_xdata()[0] for line in (best, logarithm, response)] == [0.25, 0, 1]
    words = [text.get_text() for text in ax.figure.legends[0].get_texts()]
    assert words == ["95 % interval", "best λ = 0.25"]
    assert [(text.get_text(), text.xy) for text in ax.texts] == [
        ("logarithm", (0, 0.02)), ("response", (1, 0.02)),
    ]


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("plot", ALL)
def test_figures_are_saved_in_both_themes(replicated, plot, theme, tmp_path):
    drawn = plot(replicated, theme=theme)
    first = drawn[0] if isinstance(drawn, list) else drawn
    style.save(first, tmp_path, "figure")
    assert (tmp_path / "figure.png").stat().st_size > 5000
    assert first.figure.get_facecolor() == pytest.approx(
        (1, 1, 1, 1) if theme == "light" else (0x14 / 255, 0x17 / 255, 0x1A / 255, 1)
    )


@pytest.mark.parametrize("plot", ALL)
def test_figures_go_into_the_place_they_are_given(replicated, plot):
    figure = style.new_figure(8, 4)
    left, right = figure.subplots(1, 2)
    drawn = plot(replicated, right)
    panels = drawn if isinstance(drawn, list) else [drawn]
    figure.draw_without_rendering()
    assert all(panel.figure is figure for panel in panels)
    assert all(panel.get_position().x0 > left.get_position().x1 - 1e-9 for panel in panels)


def has_data(drawn):
    panels = drawn if isinstance(drawn, list) else [drawn]
    panels[0].figure.draw_without_rendering()
    return any(panel.has_data() for panel in panels)


@pytest.mark.parametrize("plot", ALL)
def test_figures_of_a_saturated_design_are_drawn(plot):
    assert has_data(plot(experiment(1, 3)))


@pytest.mark.parametrize("plot", ALL)
def test_figures_of_a_single_factor_are_drawn(plot):
    runs = pd.DataFrame({"gps": [1.0, 3.0] * 4, "y": [1.0, 2, 1.1, 2.2, 0.9, 1.9, 1.2, 2.1]})
    there_is_some = plot is not plots.plot_interactions  # a single factor has none
    assert has_data(plot(analyse(runs, ["gps"], "y"))) == there_is_some


def test_pareto_lets_a_bar_without_scatter_leave_the_figure():
    runs = pd.DataFrame(list(product((1.0, 3.0), repeat=2)) * 3, columns=["gps", "arm"])
    analysis = analyse(runs.assign(y=runs["gps"]), ["gps", "arm"], "y")
    assert np.isinf(analysis.effects.loc["gps", "t"])
    ax = plots.plot_pareto(analysis)
    arm, gps = sorted(bar.get_width() for bar in ax.patches)[-2:]
    assert arm == 0
    assert gps > 0
    ax.figure.draw_without_rendering()


EVERY = (*ALL, plots.plot_box_cox, sweep_means, front)


def figure_of(drawn):
    return (drawn[0] if isinstance(drawn, list) else drawn).figure


@pytest.mark.parametrize("plot", EVERY)
def test_no_text_is_under_eight_points(replicated, plot):
    figure = figure_of(plot(replicated))
    figure.draw_without_rendering()
    for text in figure.findobj(Text):
        assert text.get_fontsize() >= 8, text.get_text()


@pytest.mark.parametrize("plot", EVERY)
def test_no_legend_covers_anything(replicated, plot):
    figure = figure_of(plot(replicated))
    figure.draw_without_rendering()
    assert not any(ax.get_legend() for ax in figure.axes)
    for legend in figure.legends:
        top = legend.get_window_extent().y1
        assert all(top <= ax.get_tightbbox().y0 for ax in figure.axes)


def test_points_of_the_front_say_what_is_new_after_the_cheaper_one_before(replicated):
    costs = {"gps": {1.0: 100.0, 3.0: 0.0}, "arm": {1.0: 0.0, 3.0: 5.0}}
    found = advise(replicated.table, replicated.factors, replicated.response, costs)
    drawn = plot_front(found)
    points = found.points[found.points["front"]].sort_values("cost")
    assert len(points) > 1
    before: dict[str, float] = {}
    rows = points[list(found.factors)].to_dict("records")
    for text, levels in zip(drawn.texts, rows, strict=True):
        new = {f"{name} {value:g}" for name, value in levels.items() if before.get(name) != value}
        assert set(text.get_text().splitlines()) == new
        before = levels
    drawn.figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in drawn.texts]
    for one, other in combinations(boxes, 2):
        assert not one.overlaps(other)
    for box in boxes:
        assert not any(box.contains(*xy) for xy in drawn.transData.transform(
            found.points[["cost", "estimate"]]))


@pytest.mark.parametrize("own", [True, False])
@pytest.mark.parametrize("plot", EVERY)
def test_a_label_is_never_read_as_a_formula(replicated, plot, own):
    analysis = replicated.named(
        {"gps": r"$\frac{", "arm": "a $5$ arm", "loss": r"\$"}, {"gps": "$5$"}, r"y of $5$ $\frac{"
    )
    ax = None if own else style.new_figure(8, 4).subplots(1, 2)[1]
    drawn = plot(analysis, ax)
    figure = (drawn[0] if isinstance(drawn, list) else drawn).figure
    figure.draw_without_rendering()  # with the settings of whoever draws it
    for text in figure.findobj(Text):
        if "$" in text.get_text():
            assert not text.get_parse_math()
