"""The keys of a scenario that a device decides, and how its answer says it."""

from __future__ import annotations

from typing import Any

import matplotlib.figure
import numpy as np
import pytest
import sblcosim
from matplotlib.colors import to_rgb
from sblcosim.identification.device import NONE_LATE, NOT, TURNS, YES, Device, Number, Told
from sblcosim.identification.figures import plot_residuals
from sblcosim.identification.fit import Fit
from sblcosim.identification.innovations import PRIOR, Filtered, Ranges
from sblcosim.identification.result import Identified
from sblcosim.style import THEMES
from scipy import stats
from scipy.integrate import trapezoid

BEACON = np.array([0, 2, 2, 0, 2, 2])
INNOVATION = np.array([0.1, -0.2, 0.3, 7.0, -8.0, 9.0])
VARIANCE = np.array([0.01, 0.04, 0.09, 0.16, 0.25, 0.36])


def number(parameter: str, estimate: float | None, told: Told = YES, low: Any = None,
           high: Any = None, unit: str = "m", explanation: str = "why") -> Number:
    return Number(parameter, estimate, low, high, unit, told, explanation)


def identified(
    *numbers: Number, keys: Any = None, place_std: float | None = None, name: str = "harbour-lbl",
    **more: Any,
) -> Identified:
    """The answer of a device whose other numbers are not told."""
    given = {n.parameter: n for n in numbers}
    usual = ("range_std", "late_share", "late_mean", "range_scale", "loss_share", "loss_burst")
    rows = [given.pop(name, number(name, None, NOT)) for name in usual]
    ranges = Ranges(np.arange(6.0), BEACON, np.zeros(6), np.zeros((6, 3)), np.zeros(6),
                    np.zeros(6), dict.fromkeys(PRIOR, 0.0), 3)
    motion = Fit(("range_std", "late_share", "late_mean", "acceleration_psd"),
                 np.array([np.log(0.11), np.log(0.2 / 0.8), np.log(3.0), -4.0]), np.eye(4), 0.0, 1)
    shown = {"innovation": INNOVATION[None], "variance": VARIANCE[None]}
    device = Device(
        [*rows, *given.values()], ranges,
        Filtered(np.zeros(1), shown, np.zeros((1, 8)), np.zeros((1, 8, 8))), motion,
        {0: 0.5, 2: -0.25}, ["the device has a remark"], place_std=place_std,
    )
    return Identified("dive", device, sblcosim.load(name, keys or {}), **more)


TWO_WAY = {"acoustics.ranging": "two_way"}


def test_numbers_that_are_told_are_keys_of_the_scenario() -> None:
    told = [
        number("range_std", 0.12), number("late_share", 0.07), number("late_mean", 2.5),
        number("loss_share", 0.19), number("depth_std", 0.03), number("gps_std", 0.4),
        number("gps_markov_std", 1.2), number("gps_correlation_time", 33.0),
        number("range_offset[1]", 0.3), number("range_offset[3]", -0.9),
        number("range_scale", 0.02, low=0.01, high=0.03),
    ]
    common = {
        "acoustics.outlier_probability": 0.07, "acoustics.outlier_mean_m": 2.5,
        "target.depth_std_m": 0.03, "platform.gps_horizontal_std_m": 0.4,
        "platform.gps_horizontal_markov_std_m": 1.2, "platform.gps_correlation_time_s": 33.0,
        "acoustics.range_std_m": 0.11,  # of the motion: a device without memory
    }
    one_way = identified(*told)
    assumed = one_way.base.acoustics.assumed_sound_speed_m_s
    common["acoustics.sound_speed_m_s"] = assumed / 1.02
    assert one_way.overrides() == pytest.approx({
        **common, "acoustics.loss_probability": 0.19, "acoustics.clock_offset_s": -0.3 / assumed,
    })
    for sign in (1, -1):  # a delay of the answer, or its correction
        offsets = [number("range_offset[1]", sign * 0.3), number("range_offset[3]", sign * 0.9)]
        both = identified(*told[:8], *offsets, told[-1], keys=TWO_WAY).overrides()
        assert both == pytest.approx({
            **common, "acoustics.loss_probability": 0.1, "acoustics.turnaround_std_s": 0.0,
            "acoustics.processing_delay_s": max(sign * 1.2 / assumed, 0.0),
            "acoustics.processing_delay_correction_s": max(-sign * 1.2 / assumed, 0.0),
        })


def test_numbers_that_are_not_told_keep_their_keys() -> None:
    assert identified().overrides() == {}
    assert identified(keys=TWO_WAY).overrides() == {}
    untold = [number(name, 0.1, NOT, 0.05, 0.2) for name in (
        "range_std", "late_share", "late_mean", "depth_std", "range_scale", "gps_std",
        "gps_markov_std", "range_offset[1]")]
    assert identified(*untold).overrides() == {}
    assert identified(number("late_share", 0.07)).overrides() == {}  # not without its mean
    assert identified(number("gps_correlation_time", 9.0)).overrides() == {}
    for one, key in (("gps_std", "std_m"), ("gps_markov_std", "markov_std_m")):
        keys = identified(number(one, 0.4), number("gps_correlation_time", 9.0)).overrides()
        assert keys == {f"platform.gps_horizontal_{key}": 0.4, "platform.gps_correlation_time_s": 9}
    assert identified(number("range_std", 0.3)).overrides() == pytest.approx(
        {"acoustics.range_std_m": 0.11})
    assert identified(number("range_std", 0.3), keys=TWO_WAY).overrides() == pytest.approx(
        {"acoustics.range_std_m": 0.11, "acoustics.turnaround_std_s": 0.0})


@pytest.mark.parametrize(("low", "high", "there"), [
    (0.01, 0.03, True), (-0.03, -0.01, True), (-0.01, 0.03, False), (0.0, 0.03, False),
    (-0.03, 0.0, False), (None, 0.03, False), (0.01, None, False),
])  # fmt: skip
def test_a_scale_counts_if_its_interval_does_not_hold_zero(
    low: float | None, high: float | None, there: bool
) -> None:
    keys = identified(number("range_scale", 0.02, low=low, high=high)).overrides()
    assert ("acoustics.sound_speed_m_s" in keys) == there


def test_places_of_fixed_beacons_are_known_as_the_ranges_tell() -> None:
    for name, keys in (("harbour-lbl", {"platform.mounting_std_m": 0.3}), ("harbour-wakes", {})):
        own = name == "harbour-lbl"
        found = identified(name=name, keys=keys, place_std=0.7).overrides()
        assert found == ({"platform.mounting_std_m": 0.7} if own else {})
        assert identified(name=name, keys=keys).overrides() == {}


def test_what_arrivals_of_a_ping_share_stays_with_the_noise_of_a_range() -> None:
    inverted = {"acoustics.ranging": "inverted"}
    for keys, shared in (
        ({**inverted, "acoustics.range_common_std_m": 0.25}, True),
        ({**inverted, "acoustics.arrivals_shared": True}, True),
        ({**inverted, "acoustics.range_common_std_m": 0.25, "acoustics.arrivals_shared": True},
         True),
        (inverted, False), ({}, False), (TWO_WAY, False),
    ):
        found = identified(number("range_std", 0.3), keys=keys)
        assert ("acoustics.range_std_m" not in found.overrides()) == shared
        a = found.base.acoustics
        assert found.remarks == ["the device has a remark", *[
            "not in this log: how much of the noise all arrivals of a ping share; "
            f"acoustics.range_std_m ({a.range_std_m:g} m) and range_common_std_m "
            f"({a.range_common_std_m:g} m) stay those of harbour-lbl"
        ] * shared]


# --- Losses ---------------------------------------------------------------------------------------

BURST = "acoustics.loss_burst_length"


def lossy(share: float | None, low: Any, estimate: Any, high: Any, keys: Any = None) -> Any:
    return identified(
        number("loss_share", share, NOT), number("loss_burst", estimate, NOT, low, high), keys=keys,
    ).overrides().get(BURST)


def test_losses_come_in_bursts_if_their_length_is_not_that_of_chance() -> None:
    """Of a quarter that is lost by chance, 4/3 are lost in a row."""
    for low, high, there in ((1.1, 1.4, False), (1.34, 1.9, True), (1.1, 1.33, True),
                             (4 / 3, 1.9, False), (1.1, 4 / 3, False), (1.33, 1.34, False)):
        assert lossy(0.25, low, 1.2, high) == (1.2 if there else None)
    for lacking in ((None, 2.0, 2.5, 3.0), (0.25, None, 2.5, 3.0), (0.25, 2.0, None, 3.0),
                    (0.25, 2.0, 2.5, None), (1.0, 2.0, 2.5, 3.0)):
        assert lossy(*lacking) is None
    assert lossy(0.25, 0.5, 0.8, 0.9) == 1.0
    assert lossy(0.25, 2.0, 2.5, 3.0) == 2.5
    assert lossy(0.8, 1.5, 2.0, 3.0) == pytest.approx(4.0)  # or more would be lost after a loss


@pytest.mark.parametrize(("share", "burst"), [(0.3, 2.6), (0.12, 5.0), (0.55, 3.1)])
def test_bursts_of_a_leg_make_those_of_the_ranges(share: float, burst: float) -> None:
    """A range is lost with either leg; losses of a leg begin so often that p of it are lost."""
    length = lossy(share, burst - 0.1, burst, burst + 0.2, TWO_WAY)
    p = 1 - np.sqrt(1 - share)
    begins = p / ((1 - p) * length)
    assert share / ((1 - share) * (1 - (1 - begins) ** 2)) == pytest.approx(burst)


def test_bursts_of_a_leg_have_a_length_of_one_or_more() -> None:
    assert lossy(0.3, 0.1, 0.2, 0.3, TWO_WAY) == 1.0
    assert lossy(0.96, 1.1, 1.2, 1.3, TWO_WAY) == pytest.approx(0.8 / 0.2)  # of a leg, 0.8 are lost
    assert lossy(0.0, 1.1, 1.2, 1.3, TWO_WAY) == 1.0


# --- What it says ---------------------------------------------------------------------------------

NOISE = number("range_std", 0.1234, low=0.1, high=0.15678)
UNTOLD = "The log does not tell the noise of a range"
KNOWN = "A range has a noise of 0.123 m (0.1 to 0.157 m)"


@pytest.mark.parametrize(("numbers", "noise", "late", "told"), [
    ([], UNTOLD, "late ranges: not in this log", 0),
    ([NOISE], KNOWN, "late ranges: not in this log", 1),
    ([number("range_std", 0.1, NOT, 0.1, 0.2)], UNTOLD, "late ranges: not in this log", 0),
    ([number("range_std", 0.1, YES, None, 0.2)], UNTOLD, "late ranges: not in this log", 1),
    ([number("range_std", 0.1, YES, 0.1, None)], UNTOLD, "late ranges: not in this log", 1),
    ([NOISE, number("late_share", 0.0712, TURNS)], KNOWN,
     "late ranges: not told apart from turns", 1),
    ([number("late_share", None, NONE_LATE)], UNTOLD,
     "late ranges: no late ranges beyond noise", 0),
    ([NOISE, number("late_share", 0.0712), number("late_mean", 2.345)], KNOWN,
     "7.1 % are late, by 2.3 m on average", 3),
    ([NOISE, number("late_share", 0.0712), number("late_mean", 2.345, NOT)], KNOWN,
     "7.1 % are late", 2),
    ([number("late_share", 0.0712), number("late_mean", None)], UNTOLD, "7.1 % are late", 2),
    ([number("late_share", None), number("late_mean", 2.0)], UNTOLD, "late ranges: yes", 2),
])  # fmt: skip
def test_the_answer_in_two_sentences(
    numbers: list[Number], noise: str, late: str, told: int
) -> None:
    found = identified(*numbers)
    assert found.answer == f"{noise}; {late}. The log tells {told} of 6 numbers of the device."


def test_the_table_of_the_numbers_in_full() -> None:
    found = identified(
        NOISE, number("range_offset[12]", -12345.678, YES, -2e4, 1.0, "m", "constant"),
        number("gps_std", 0.5, NOT, 0.25, None, "long unit", "vague"), said=("a gap",),
    )
    nothing = "                          m          not in this log: why"
    assert found.text().splitlines() == [
        found.answer, "  a gap", "  the device has a remark", "",
        "number             estimate    from     to  unit       told by the log",
        "range_std             0.123     0.1  0.157  m          yes",
        f"late_share        {nothing}", f"late_mean         {nothing}",
        f"range_scale       {nothing}", f"loss_share        {nothing}",
        f"loss_burst        {nothing}",
        "range_offset[12]  -1.23e+04  -2e+04      1  m          yes",
        "gps_std                 0.5    0.25         long unit  not in this log: vague",
    ]
    lines = found.text(verbose=True).splitlines()
    assert lines[5].endswith("m          yes: why")
    assert lines[11].endswith("m          yes: constant")
    assert found.to_json()["correlation"] == {"1": 0.5, "3": -0.25}
    assert found.title == "The device of dive"


# --- Its figure -----------------------------------------------------------------------------------


@pytest.mark.parametrize("beacons", [(), ("north", "mid", "south")])
def test_the_figure_shows_residuals_of_each_beacon_by_its_name(beacons: tuple[str, ...]) -> None:
    found = identified(beacons=beacons)
    (job,) = found.figures
    residuals, std, share, mean = job.arguments
    names = (beacons[0], beacons[2]) if beacons else ("1", "3")
    assert [*residuals] == [*names]
    assert residuals[names[0]].tolist() == [0.1, 7.0]
    assert residuals[names[1]].tolist() == [-0.2, 0.3, -8.0, 9.0]
    assert std == pytest.approx(np.sqrt(0.125))
    assert (share, mean) == pytest.approx((0.2, 3.0))


def test_histograms_have_the_density_of_punctual_and_of_late_ranges() -> None:
    """And tell how many residuals are beyond them."""
    rng = np.random.default_rng(3)
    std, share, mean = 0.4, 0.3, 1.5
    low, high = -6 * std, 6 * std + 2 * share * mean
    many = rng.normal(0, std, 500)
    values = {"A": many, "B": np.array([low, high, low - 1e-6, high + 1e-6, high + 9.0, 0.0]),
              "C": many[:40]}
    figure = matplotlib.figure.Figure()
    axes = figure.subplots(3)
    plot_residuals(values, std, share, mean, axes)
    assert [[text.get_text() for text in ax.texts] for ax in axes] == [
        ["beacon A"], ["beacon B, 3 beyond"], ["beacon C"]]
    assert [ax.get_xlabel() for ax in axes] == ["", "", "Range − expected range [m]"]
    t = np.linspace(0, 20 * mean, 6_001)
    late = stats.expon(scale=mean).pdf(t)
    for ax, of in zip(axes, values.values(), strict=True):
        assert ax.get_xlim() == pytest.approx((low, high))
        assert ax.get_ylabel() == "Density [1/m]"
        x, density = ax.lines[0].get_data()
        assert x[[0, -1]] == pytest.approx([low, high])
        for at, value in zip(x[::57], density[::57], strict=True):
            excess = trapezoid(late * stats.norm(0, std).pdf(at - t), t)
            expected = (1 - share) * stats.norm(0, std).pdf(at) + share * excess
            assert value == pytest.approx(expected, rel=1e-4, abs=1e-6)
        counts, edges = np.histogram(of, bins=60, range=(low, high), density=True)
        bars = ax.patches
        assert [bar.get_height() for bar in bars] == pytest.approx(counts.tolist())
        assert [bar.get_x() for bar in bars] == pytest.approx(edges[:-1].tolist())
        colours = {to_rgb(bar.get_facecolor()) for bar in bars}
        assert colours == {to_rgb(THEMES["light"].receivers[0])}
        x, y = ax.texts[0].get_position()
        assert 0.9 < x < 1
        assert 0.9 < y < 1


def test_a_figure_of_its_own_has_a_panel_of_an_inch_for_each_beacon() -> None:
    values = {name: np.array([0.1, -0.2]) for name in "ABC"}
    axes = plot_residuals(values, 0.4, 0.3, 1.5)
    figure = axes[0].figure
    tall = [ax.get_position().height * figure.get_size_inches()[1] for ax in axes]
    assert tall == pytest.approx([1.0] * 3, rel=0.05)
    assert [text.get_text() for text in figure.texts] == ["Residuals of the ranges by beacon"]
