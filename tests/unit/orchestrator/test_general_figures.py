from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from matplotlib.text import Text
from sblcosim import style
from sblcosim.analysis.levels import figures
from sblcosim.analysis.levels.analysis import GeneralFactorial, analyse

LONG = [f"Manufacturer no. {i} long-range model {letter * 3}" for i, letter in
        enumerate("ABCDEFGHIJKL")]
SEA = ["calm", "slight", "rough", "very_rough_sea_state"]
ALL = (figures.plot_means, figures.plot_pairs, figures.plot_interactions)


@pytest.fixture(scope="module")
def analysis() -> GeneralFactorial:
    rng = np.random.default_rng(1)
    table = pd.DataFrame({
        "gps": rng.choice([5.0, 1.0, 0.1], 1500), "transceiver $x$": rng.choice(LONG, 1500),
        "sea": rng.choice(SEA, 1500),
    })
    slope = 1 + 0.5 * (table["sea"] == "rough")
    return analyse(
        table.assign(y=slope * table["gps"] + rng.normal(0, 0.8, 1500)), list(table), "y", unit="m",
        units={"gps": "m"}, label="RMS of the total absolute error",
        levels={"gps": [0.1, 1.0, 5.0], "transceiver $x$": LONG, "sea": SEA},
    ).readable


def test_means_have_a_row_per_level_with_its_interval(analysis: GeneralFactorial) -> None:
    panels = figures.plot_means(analysis)
    assert [len(panel.get_yticks()) for panel in panels] == [3, 12, 4]
    for panel, (_, own) in zip(panels, analysis.means.groupby("factor", sort=False), strict=True):
        container = panel.containers[0]
        np.testing.assert_allclose(container.lines[0].get_xdata(), own["mean"])
        segments = np.array(container.lines[2][0].get_segments())
        np.testing.assert_allclose(segments[:, :, 0], own[["low", "high"]])
    assert [text.get_text() for text in panels[0].get_yticklabels()] == ["0.1 m", "1 m", "5 m"]
    assert panels[0].get_ylim()[0] > panels[0].get_ylim()[1]  # the first level is on top
    assert len({panel.get_xlim() for panel in panels}) == 1
    assert panels[-1].get_xlabel().replace("\n", " ") == "Mean RMS of the total absolute error [m]"


def test_pairs_have_the_largest_on_top_and_a_line_at_zero(analysis: GeneralFactorial) -> None:
    panels = figures.plot_pairs(analysis)
    for panel, (name, own) in zip(panels, analysis.pairs.groupby("factor", sort=False),
                                  strict=True):
        assert [0.0, 0.0] in [list(line.get_xdata()) for line in panel.lines]
        drawn = {round(float(x), 9) for container in panel.containers
                 for x in container.lines[0].get_xdata()}
        largest = own["difference"].sort_values(key=np.abs, ascending=False)
        assert drawn == {round(float(x), 9) for x in largest.head(figures.MOST_PAIRS)}
        some = ", 15 of 66 pairs" if len(own) == 66 else ""
        assert panel.get_title("left") == f"{name}{some}"
    assert panels[0].get_yticklabels()[0].get_text() == "0.1 m − 5 m"
    sure = panels[2].containers[0].lines[0].get_xdata()
    own = analysis.pairs[(analysis.pairs["factor"] == "sea") & analysis.pairs["differs"]]
    np.testing.assert_allclose(np.sort(sure), np.sort(own["difference"]))


@pytest.mark.parametrize("differ", [True, False])
def test_the_key_of_pairs_has_what_is_drawn(analysis: GeneralFactorial, differ: bool) -> None:
    pairs = analysis.pairs[analysis.pairs["differs"] == differ]
    panels = figures.plot_pairs(replace(analysis, pairs=pairs))
    (legend,) = panels[0].figure.legends
    words = [text.get_text() for text in legend.get_texts()]
    assert words == ["differ" if differ else "cannot be told apart"]


def test_interactions_are_lines_of_the_factor_with_fewer_levels(
    analysis: GeneralFactorial,
) -> None:
    panels = figures.plot_interactions(analysis)
    assert len(panels) == 6  # three, each with its key
    panel, key = panels[2], panels[3]
    assert panel.get_title("left") == "sea; lines: gps [m]"
    cells = analysis.cells[(analysis.cells["first"] == "gps") & (analysis.cells["second"] == "sea")]
    for container, level in zip(panel.containers, analysis.levels["gps"], strict=True):
        expected = cells.loc[cells["first_level"] == level, "mean"]
        np.testing.assert_allclose(container.lines[0].get_xdata(), expected)
    assert [text.get_text() for text in key.get_legend().get_texts()] == ["0.1 m", "1 m", "5 m"]
    assert panels[0].get_title("left") == "transceiver $x$; lines: gps [m]"


def height_of(names: list[str]) -> float:
    """Height of a panel with these rows [inch]."""
    return 0.55 + 0.09 * len(names) + 0.17 * sum(1 + name.count("\n") for name in names)


def test_rows_have_the_height_of_their_lines(analysis: GeneralFactorial) -> None:
    """A name in several lines has 0.65 more of a row for each of them."""
    panels = figures.plot_means(analysis)
    rows = [[text.get_text() for text in panel.get_yticklabels()] for panel in panels]
    assert any("\n" in name for name in rows[1])
    assert rows[2] == ["calm", "slight", "rough", "very_rough_sea_\nstate"]
    for panel, names in zip(panels, rows, strict=True):
        at, top = [], 0.0
        for name in names:
            high = 1 + 0.65 * name.count("\n")
            at.append(top + high / 2)
            top += high
        np.testing.assert_allclose(panel.get_yticks(), at)
        assert panel.get_ylim() == pytest.approx((top + 0.1, -0.1))
        np.testing.assert_allclose(panel.containers[0].lines[0].get_ydata(), at)
    heights = [height_of(names) for names in rows]
    assert panels[0].get_gridspec().get_height_ratios() == pytest.approx(heights)  # type: ignore[union-attr]
    assert panels[0].figure.get_size_inches() == pytest.approx([4.0, sum(heights) + 0.9 + 0.6])
    assert [panel.get_title("left") for panel in panels] == ["gps [m]", "transceiver $x$", "sea"]
    for panel, (_, own) in zip(panels, analysis.means.groupby("factor", sort=False), strict=True):
        (line,) = (it for it in panel.lines if len({*it.get_xdata()}) == 1
                   and [*it.get_ydata()] == [0, 1])  # fmt: skip
        assert line.get_xdata()[0] == pytest.approx(own["mean"].mean())
    words = [text.get_text() for text in panels[0].figure.legends[0].get_texts()]  # type: ignore[union-attr]
    assert words == ["mean, 95 % interval", "mean of the levels"]


def test_pairs_that_differ_have_filled_marks_in_their_rows(analysis: GeneralFactorial) -> None:
    panels = figures.plot_pairs(analysis)
    look = style.THEMES["light"]
    for panel, (_, own) in zip(panels, analysis.pairs.groupby("factor", sort=False), strict=True):
        shown = own.sort_values("difference", key=np.abs, ascending=False, kind="stable").head(15)
        at = panel.get_yticks()
        marks = {}
        for container in panel.containers:
            line = container.lines[0]
            for x, y in line.get_xydata():
                marks[round(y, 6)] = (x, line)
            segments = np.array(container.lines[2][0].get_segments())
            for (low, y), (high, _) in segments:
                row = shown.iloc[int(np.argmin(abs(at - y)))]
                assert (low, high) == pytest.approx((row["low"], row["high"]))
        assert len(marks) == len(at) == len(shown)
        for y, (_, row) in zip(at, shown.iterrows(), strict=True):
            x, line = marks[round(y, 6)]
            assert x == pytest.approx(row["difference"])
            differs = bool(row["differs"])
            assert line.get_marker() == ("o" if differs else "s")
            assert line.get_color() == (look.receivers[0] if differs else look.soft)
            assert line.get_markerfacecolor() == (look.receivers[0] if differs else look.paper)
    names = [text.get_text() for text in panels[1].get_yticklabels()]
    for name in names:  # two long names are on lines of their own
        one, other = name.split("\n− ")
        assert max(map(len, f"{one}\n{other}".split("\n"))) <= 20
    assert panels[2].get_yticklabels()[-1].get_text().count("−") == 1
    assert panels[-1].get_xlabel().replace("\n", " ") == (
        "Difference of mean RMS of the total absolute error [m]"
    )


@pytest.mark.parametrize(("levels", "bars"), [(4, True), (5, False)])
def test_up_to_four_lines_have_intervals_and_stand_beside_each_other(
    levels: int, bars: bool
) -> None:
    rng = np.random.default_rng(3)
    table = pd.DataFrame({
        "a": np.repeat(np.arange(7), 60), "b": np.tile(np.arange(levels), 105)[:420],
    })
    table["y"] = table["a"] * 0.3 + table["b"] + rng.normal(0, 0.5, len(table))
    found = analyse(table, ["b", "a"], "y")
    panel, key = figures.plot_interactions(found)
    assert panel.get_title("left") == "a; lines: b"
    rows = np.arange(7) + 0.5
    cells = found.cells
    look = style.THEMES["light"]
    lines = [it for it in panel.lines if len(it.get_xdata()) == 7 and it.get_marker() in "os^DvPX"]
    assert len(lines) == levels
    for number, line in enumerate(lines):
        shift = 0.12 * (number - 1.5) if bars else 0.0
        np.testing.assert_allclose(line.get_ydata(), rows + shift)
        own = cells[cells["first_level"] == number]
        np.testing.assert_allclose(line.get_xdata(), own["mean"])
        assert line.get_marker() == style.MARKERS[1 + number]
        assert line.get_color() == look.receivers[number]
        assert line.get_markersize() == 4.5
    assert len(panel.containers) == (levels if bars else 0)
    for number, container in enumerate(panel.containers):
        own = cells[cells["first_level"] == number]
        segments = np.array(container.lines[2][0].get_segments())
        np.testing.assert_allclose(segments[:, :, 0], own[["low", "high"]])
    assert not key.axison
    assert [text.get_text() for text in key.get_legend().get_texts()] == [
        str(level) for level in range(levels)
    ]
    assert panel.get_xlabel() == "Mean y"


@pytest.mark.parametrize(("names", "columns"), [
    (["ab", "abcd"], 2), (["a", "b", "abcd", "c"], 3), (["abcde", "a", "b"], 2),
    (["abcdefghi", "a", "b"], 2), (["abcdefghij", "a", "b"], 1),
])  # fmt: skip
def test_the_key_of_lines_has_as_many_columns_as_fit(names: list[str], columns: int) -> None:
    rng = np.random.default_rng(3)
    count = 20 * len(names)
    table = pd.DataFrame({
        "a": np.tile(["p", "q", "r", "s", "t"], count), "b": np.repeat(names, 100),
    })
    table["y"] = rng.normal(5, 0.5, len(table))
    panels = figures.plot_interactions(analyse(table, ["a", "b"], "y", levels={"b": names}))
    legend = panels[1].get_legend()
    assert legend is not None
    assert legend._ncols == columns
    rows = -(-len(names) // columns)
    heights = [height_of(["p"] * 5), 0.1 + 0.21 * rows]
    assert panels[0].get_gridspec().get_height_ratios() == pytest.approx(heights)  # type: ignore[union-attr]


@pytest.mark.parametrize("plot", ALL)
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_all_text_is_inside_the_figure_and_large_enough(
    analysis: GeneralFactorial, plot, theme: style.ThemeName
) -> None:
    panels = plot(analysis, theme=theme)
    figure = panels[0].figure
    assert figure.get_size_inches()[0] * 96 <= 390  # pixels of a narrow screen
    figure.draw_without_rendering()
    width, height = figure.bbox.size
    ink = style.THEMES[theme].ink
    hidden = [
        label for panel in panels for label in panel.get_xticklabels()
        if not panel.axison or not panel.get_xlim()[0] <= label.get_position()[0]
        <= panel.get_xlim()[1]
    ] + [label for panel in panels if not panel.axison for label in panel.get_yticklabels()]
    for text in figure.findobj(Text):
        box = text.get_window_extent()
        if text.get_text() and box.width and text not in hidden:
            assert text.get_fontsize() >= 8
            assert -1 <= box.x0 < box.x1 <= width + 1, text.get_text()
            assert -1 <= box.y0 < box.y1 <= height + 1, text.get_text()
            assert text.get_color() == ink


@pytest.mark.parametrize("plot", ALL)
def test_rows_do_not_overlap(analysis: GeneralFactorial, plot) -> None:
    panels = plot(analysis)
    panels[0].figure.draw_without_rendering()
    for panel in panels:
        boxes = [label.get_window_extent() for label in panel.get_yticklabels()] if panel.axison \
            else []
        for above, below in pairwise(boxes):
            assert above.y0 >= below.y1 - 1


@pytest.mark.parametrize("plot", ALL)
def test_given_axes_are_replaced(analysis: GeneralFactorial, plot) -> None:
    from matplotlib.figure import Figure

    ax = Figure(figsize=(8, 20)).subplots()
    panels = plot(analysis, ax)
    assert not ax.axison
    assert all(panel.figure is ax.figure for panel in panels)


def test_many_factors_show_their_surest_interactions() -> None:
    rng = np.random.default_rng(2)
    table = pd.DataFrame({name: rng.integers(0, 3, 900) for name in "abcde"})
    table["y"] = table["c"] * table["e"] + rng.normal(0, 0.5, 900)
    panels = figures.plot_interactions(analyse(table, list("abcde"), "y"))
    titles = [panel.get_title("left") for panel in panels[::2]]
    assert len(titles) == figures.MOST_PANELS
    assert "c; lines: e" in titles
    assert panels[0].figure.get_suptitle() == "Interactions, 6 of 10 pairs of factors"


def test_a_single_factor_has_no_interactions_to_draw(analysis: GeneralFactorial) -> None:
    table = pd.DataFrame({"a": [0, 0, 1, 1, 2, 2], "y": [1.0, 2, 3, 4, 5, 7]})
    one = analyse(table, ["a"], "y")
    picture = one.plot_means()
    assert repr(picture).startswith("<Picture of 1 panel,")
    with pytest.raises(ValueError, match="two factors"):
        one.plot_interactions()


def test_medians_are_drawn_where_means_rest_on_few_runs() -> None:
    rng = np.random.default_rng(5)
    table = pd.DataFrame({"a": np.repeat(["x", "y"], 40), "y": rng.uniform(1.0, 3.0, 80)})
    assert analyse(table, ["a"], "y").plot_means().figure.axes[-1].get_xlabel() == "Mean y"
    table.loc[3, "y"] = 2436.0
    panel = analyse(table, ["a"], "y").plot_means().figure.axes[-1]
    assert panel.get_xlabel() == "Median y"
    assert panel.get_xlim()[1] < 5.0
