from __future__ import annotations

import io
import re
from itertools import combinations, product

import numpy as np
import pandas as pd
import pytest
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
