"""Figures of Sobol' indices: what they draw is what the analysis says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.container import ErrorbarContainer
from matplotlib.text import Text
from sblcosim.analysis.space import figures
from sblcosim.analysis.space.analysis import Sensitivity, indices
from sblcosim.study.distributions import distribution_of
from sblcosim.study.space import DrawnFactor, sample
from sblcosim.style import new_figure

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
