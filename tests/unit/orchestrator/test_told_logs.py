"""What is said of a processed log, in whole sentences, and where everything in its figures is."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
import sblcosim
from made_logs import made, on_a_boat
from matplotlib.figure import Figure
from sblcosim.data.estimates import Estimates
from sblcosim.data.truth import Truth
from sblcosim.processing import figures, quality
from sblcosim.processing.align import Alignment, aligned, moved
from sblcosim.processing.playing import played
from sblcosim.processing.remarks import remarks
from sblcosim.processing.settings import settled
from sblcosim.processing.text import of_log, verdicts
from sblcosim.scenario.sources import Choice

NS = 10**9


# --- Texts ----------------------------------------------------------------------------------------


def told(
    receivers: dict[str, Any], *, dimension: int = 3, truth: Any = None, residuals: Any = None,
    agreement: Any = None, main: str = "", remarks: Any = (), source: str = "",
) -> Any:
    """What a text needs of a processed log."""
    log = made(seconds=9)
    meta = log.meta.model_copy(update={"dimension": dimension})
    names = ["receiver", "sample"]
    empty = pd.DataFrame({"n": []}, index=pd.MultiIndex.from_tuples([], names=names))
    return SimpleNamespace(
        log=replace(log, meta=meta, source=source), truth=truth, main=main,
        receivers=pd.DataFrame.from_dict(receivers, orient="index"),
        residuals=empty if residuals is None else residuals,
        agreement=empty if agreement is None else agreement, remarks=list(remarks),
    )


ROW = {"estimates": 1234, "judged": 1200, "first_fix_s": 3.25, "longest_gap_s": 2.0,
       "horizontal_rms_m": 2.0,
       "horizontal_p95_m": 3.6, "horizontal_max_m": 5.0, "total_rms_m": 2.5, "total_p95_m": 4.4,
       "claimed_rms_m": 2.2, "claimed_over_made": 1.1}  # fmt: skip


@pytest.mark.parametrize(("changes", "dimension", "words"), [
    ({}, 3, "2.5 m RMS (2.0 m horizontally), 95 % within 4.4 m; claims 2.2 m horizontally"),
    ({}, 2, "2.0 m RMS, 95 % within 3.6 m; claims 2.2 m horizontally"),
    ({"total_rms_m": 2.05}, 3,
     "2.0 m RMS (2.0 m horizontally), 95 % within 4.4 m; claims 2.2 m horizontally"),
    ({"total_rms_m": 2.03}, 3, "2.0 m RMS, 95 % within 4.4 m; claims 2.2 m horizontally"),
    ({"claimed_over_made": 0.499}, 2,
     "2.0 m RMS, 95 % within 3.6 m; claims 2.2 m horizontally: too little, by a factor of 2"),
    ({"claimed_over_made": 0.5}, 2, "2.0 m RMS, 95 % within 3.6 m; claims 2.2 m horizontally"),
    ({"claimed_over_made": 2.0}, 2, "2.0 m RMS, 95 % within 3.6 m; claims 2.2 m horizontally"),
    ({"claimed_over_made": 2.01}, 2,
     "2.0 m RMS, 95 % within 3.6 m; claims 2.2 m horizontally: too much, by a factor of 2.01"),
    ({"claimed_over_made": 0.1}, 2,
     "2.0 m RMS, 95 % within 3.6 m; claims 2.2 m horizontally: too little, by a factor of 10"),
    ({"claimed_rms_m": np.nan}, 2, "2.0 m RMS, 95 % within 3.6 m"),
    ({"claimed_over_made": np.nan}, 2, "2.0 m RMS, 95 % within 3.6 m; claims 2.2 m horizontally"),
    ({"horizontal_rms_m": np.nan, "claimed_rms_m": np.nan}, 2,
     "1,234 estimates, the first after 3.25 s"),
    ({"nis": 18.0, "nis_expected": 2.0, "claimed_rms_m": np.nan}, 2,
     "2.0 m RMS, 95 % within 3.6 m; its innovations are 3 times as large as it expects"),
    ({"nis": 6.1, "nis_expected": 2.0, "claimed_rms_m": np.nan}, 2,
     "2.0 m RMS, 95 % within 3.6 m; its innovations are 1.75 times as large as it expects"),
    ({"nis": 6.0, "nis_expected": 2.0, "claimed_rms_m": np.nan}, 2, "2.0 m RMS, 95 % within 3.6 m"),
    ({"horizontal_rms_m": 50.0, "total_rms_m": 51.0, "total_p95_m": 99.0, "claimed_rms_m": np.nan},
     3, "51 m RMS, 95 % within 99 m"),
    ({"horizontal_rms_m": 50.0, "total_rms_m": 51.1, "total_p95_m": 99.0, "claimed_rms_m": np.nan},
     3, "51 m RMS (50 m horizontally), 95 % within 99 m"),
    ({"restarts": 3, "claimed_rms_m": np.nan}, 2,
     "2.0 m RMS, 95 % within 3.6 m; restarted 3 times"),
    ({"restarts": 1, "claimed_rms_m": np.nan}, 2, "2.0 m RMS, 95 % within 3.6 m; restarted 1 time"),
    ({"restarts": 0, "claimed_rms_m": np.nan}, 2, "2.0 m RMS, 95 % within 3.6 m"),
    ({"estimates": 0, "failure": "it is broken"}, 3, "failed: it is broken"),
    ({"estimates": 0, "failure": np.nan}, 3, "no estimate"),
])  # fmt: skip
def test_a_verdict_is_a_sentence(changes: dict[str, Any], dimension: int, words: str) -> None:
    found = told({"mine": ROW | changes, "other": ROW}, dimension=dimension)
    assert next(iter(verdicts(found))) == f"mine: {words}"


def test_a_claim_without_a_truth_is_not_judged() -> None:
    row = {key: ROW[key] for key in ("estimates", "first_fix_s", "claimed_rms_m")}
    assert [*verdicts(told({"mine": row}))] == [
        "mine: 1,234 estimates, the first after 3.25 s; claims 2.2 m horizontally"
    ]


def test_a_long_name_is_shortened_to_what_a_table_leaves() -> None:
    """Five columns of 5, 4, 4, 4 and 7 characters, two apart, leave 26 of 60."""
    found = told({"a receiver with a very long name": ROW}, truth=made(seconds=9).truth)
    lines = of_log(found, width=60).splitlines()
    at = lines.index("Horizontal error [m]")
    assert [len(line) for line in lines[at + 1 : at + 3]] == [60, 60]
    assert lines[at + 2].startswith("a receiver ")
    assert "…" in lines[at + 2][:26]


def residuals_of(*labels: str) -> pd.DataFrame:
    rows = {}
    for i, label in enumerate(labels):
        for j, sample in enumerate(("B0", "buoy with a long name", "depth")):
            if (i, j) == (1, 1):
                continue
            rows[label, sample] = {
                "n": 1200 + j, "offset_m": -0.0421 * (1 + i) + j, "std_m": (0.05, 0.5, 5.0)[j],
                "slope": np.nan if j == 2 else 0.00123, "autocorrelation": -0.25,
                "tails": 0.0123,
            }
    table = pd.DataFrame.from_dict(rows, orient="index")
    table.index = pd.MultiIndex.from_tuples([*rows], names=["receiver", "sample"])
    return table


def test_residuals_of_one_receiver_are_a_table() -> None:
    found = told({"mine": ROW}, residuals=residuals_of("mine"), main="mine")
    lines = of_log(found).splitlines()
    at = lines.index("Residual [m]")
    assert lines[at + 1].split() == ["n", "offset", "std", "slope", "lag", "1", "tails"]
    assert [line.split() for line in lines[at + 2 : at + 5]] == [
        ["mine", "–", "B0", "1,200", "−0.0421", "0.0500", "0.00123", "−0.250", "1.2", "%"],
        ["mine", "–", "buoy", "with", "a", "long", "name", "1,201", "0.958", "0.500", "0.00123",
         "−0.250", "1.2", "%"],
        ["mine", "–", "depth", "1,202", "1.96", "5.00", "–", "−0.250", "1.2", "%"],
    ]  # fmt: skip
    assert len({len(line) for line in lines[at + 1 : at + 5]}) == 1
    both = told({"mine": ROW}, residuals=residuals_of("mine", "raw"), main="mine")
    assert not any(line.startswith("raw") for line in of_log(both).splitlines())
    assert any(line.startswith("raw") for line in of_log(both, verbose=True).splitlines())


def test_residuals_of_several_receivers_stand_beside_each_other() -> None:
    """Deviations have two digits; a sample without residuals has a dash."""
    found = told({"mine": ROW}, residuals=residuals_of("mine", "another"), main="mine")
    lines = of_log(found).splitlines()
    at = lines.index("Residual [m]: offset ± std")
    assert lines[at + 1 : at + 5] == [
        "                            mine         another",
        "B0                −0.042 ± 0.050  −0.084 ± 0.050",
        lines[at + 3],
        "depth                  2.0 ± 5.0       1.9 ± 5.0",
    ]
    cells = lines[at + 3].split()
    assert cells[-4:] == ["0.96", "±", "0.50", "–"]
    assert len(lines[at + 3]) == 48
    assert lines[at + 3].startswith("buoy")
    narrow = of_log(found, width=40).splitlines()
    begin = narrow.index("Residual [m]: offset ± std")
    assert [line.split() for line in narrow[begin + 1 : begin + 9 : 4]] == [["mine"], ["another"]]
    assert narrow[begin + 9] == ""
    wide = told({"a": ROW}, residuals=residuals_of(*(f"receiver{i}" for i in range(5))), main="a")
    exactly = 16 + 3 * 16
    for width, count in ((exactly, 3), (exactly - 1, 2)):
        text = of_log(wide, width=width).splitlines()
        assert len(text[text.index("Residual [m]: offset ± std") + 1].split()) == count
        assert sum(line.startswith("B0") for line in text) == -(-5 // count)


@pytest.mark.parametrize(("std", "words"), [
    (0.0994, "0.123 ± 0.099"), (0.0996, "0.12 ± 0.10"), (0.994, "0.12 ± 0.99"),
    (0.996, "0.1 ± 1.0"), (0.0995, "0.12 ± 0.10"), (0.995, "0.1 ± 1.0"),
])  # fmt: skip
def test_a_deviation_has_two_digits(std: float, words: str) -> None:
    table = residuals_of("a", "b").iloc[[0, 3]].assign(std_m=std, offset_m=0.123)
    lines = of_log(told({"a": ROW}, residuals=table, main="a")).splitlines()
    (line,) = (it for it in lines if it.startswith("B0"))
    assert [it.strip() for it in line[2:].split("  ") if it.strip()] == [words, words]
    table = table.assign(offset_m=-0.0001)
    zero = of_log(told({"a": ROW}, residuals=table, main="a"))
    assert f"0.{'0' * (len(words.split('.')[1].split()[0]))} ±" in zero
    assert "−0" not in zero


def test_what_follows_the_tables() -> None:
    agreement = pd.DataFrame.from_dict({
        ("mine", "other"): {"horizontal_rms_m": 1.5, "total_rms_m": 2.0, "max_m": 3.25, "n": 40},
        ("mine", "gone"): {"horizontal_rms_m": np.nan, "total_rms_m": np.nan, "max_m": np.nan,
                           "n": 0},
    }, orient="index")  # fmt: skip
    agreement = agreement.astype({"n": int})
    no_truth = (
        "There is no truth: residuals and agreement tell whether ranges, depths and receivers "
        "contradict each other, not how far off the estimates are."
    )
    found = told({"mine": ROW}, agreement=agreement, remarks=["first", "second"])
    lines = of_log(found).splitlines()
    assert lines[0].startswith("mine: 2.5 m RMS")
    assert lines[1] == ""
    assert lines[2] == "Distance [m]"
    assert lines[3].split() == ["RMS", "most", "n"]
    assert lines[4].split() == ["mine", "–", "other", "1.50", "3.25", "40"]
    assert lines[5:] == ["", no_truth, "first", "second"]
    nothing = of_log(told({"mine": ROW}, agreement=agreement.iloc[1:])).splitlines()
    assert nothing[2:] == ["There is no truth, and nothing to compare the estimates with."]
    alone = of_log(told({"mine": ROW}, residuals=residuals_of("mine"), main="mine"))
    assert alone.endswith(no_truth)
    verbose = of_log(told({"mine": ROW}), verbose=True).splitlines()
    assert verbose[-1] == (
        "Residual: range minus that of the estimates; offset is the median, std is robust, slope "
        "is over the range, tails are beyond four std."
    )
    truth = made(seconds=9).truth
    known = told({"mine": ROW}, agreement=agreement, truth=truth, source="dive/x")
    lines = of_log(known).splitlines()
    assert lines[2] == "Horizontal error [m]"
    assert lines[3].split() == ["n", "RMS", "95", "%", "most", "claimed"]
    assert lines[4].split() == ["mine", "1,200", "2.00", "3.60", "5.00", "2.20"]
    assert lines[5:] == ["", "log: dive/x (made)"]
    assert "Distance [m]" in of_log(known, verbose=True)


@pytest.mark.parametrize(("by", "words"), [
    (Alignment(), ""),
    (Alignment(2.5), "truth: moved its clock by +2.50 s, as meta.toml says"),
    (Alignment(0.0, estimated=(True, False)),
     "truth: moved its clock by 0 s, so that it fits mine best; errors are what then remains"),
    (Alignment(0.0, -0.5, (1.25, -30.0, 0.125), (False, True)),
     "truth: moved its frame by a turn of −28.6° and (+1.25, −30.0, +0.125) m, so that it fits "
     "mine best; errors are what then remains"),
    (Alignment(-1.5, 0.25, (0.0, 2.0, 0.0), (True, True), (-160.25, 12.5)),
     "truth: moved its clock by −1.50 s and its frame by a turn of +14.3° and (0, +2.00, 0) m, so "
     "that it fits mine best; errors are what then remains; other offsets of its clock, between "
     "−160 s and +12.5 s, fit nearly as well"),
])  # fmt: skip
def test_what_was_done_to_a_truth_is_said(by: Alignment, words: str) -> None:
    assert by.told("mine") == words


def test_a_truth_is_moved_by_its_offset_its_turn_and_its_shift() -> None:
    truth = Truth(time_ns=np.array([1, 3]) * NS, position=np.array([[3.0, 4.0, 5.0], [0, 1, 2]]),
                  velocity=np.array([[1.0, 2.0, 3.0], [0, 1, 0]]))  # fmt: skip
    found = moved(truth, Alignment(-0.25, np.arctan2(4, 3), (10.0, 20.0, 30.0)))
    assert found.time_ns.tolist() == [750_000_000, 2_750_000_000]
    np.testing.assert_allclose(found.position, [[8.6, 24.8, 35], [9.2, 20.6, 32]])
    np.testing.assert_allclose(found.velocity, [[-1.0, 2.0, 3.0], [-0.8, 0.6, 0.0]])
    bare = moved(replace(truth, velocity=None), Alignment(1.0))
    assert bare.velocity is None
    np.testing.assert_array_equal(bare.position, truth.position)


@pytest.mark.parametrize(("count", "fits"), [(29, False), (30, True)])
def test_a_frame_is_that_of_least_squares_where_all_fit(count: int, fits: bool) -> None:
    """At least thirty estimates; and as the sum of distances, it does not follow a tenth."""
    log = made(seconds=60)
    truth = log.truth
    assert truth is not None
    meta = log.meta.model_copy(
        update={"frame": log.meta.frame.model_copy(update={"truth": "estimate"})}
    )
    by = Alignment(0.0, 1.2, (40.0, -70.0, 3.0), (False, True))
    part = np.arange(5, 5 + count)
    seen = moved(truth, by).position[part].copy()
    seen[::10] += [30.0, -20.0, 4.0]
    found = aligned(
        replace(log, meta=meta), Estimates(epoch_ns=truth.time_ns[part], position=seen)
    )
    assert (found is not None) == fits
    if found is not None:
        assert found[1].estimated == (False, True)
        assert found[1].turn_rad == pytest.approx(1.2, abs=1e-5)
        np.testing.assert_allclose(found[1].shift_m, by.shift_m, atol=1e-4)


NOBODY = Choice({}, {})


def test_where_the_settings_are_from_and_what_carries_the_beacons() -> None:
    ready = settled(made(seconds=24))
    given = played(ready.log, ready.interval_ns, 4)
    assert remarks(ready, Choice({"a": "coupled", "b": "long_baseline"}, {}), given) == [
        f"{ready.said}; fixed beacons",
        "a: the fixed beacons count as those of a platform without motion and errors",
    ]
    late = replace(given, waited=1234)
    many = replace(ready, slots=3, interval_ns=250_000_000)
    assert remarks(many, NOBODY, late)[1:] == [
        "1,234 ranges waited for the next update, as receivers take one of a beacon in 0.25 s",
        "4 beacons share the 3 places of the receivers, by latest use",
    ]
    assert remarks(replace(ready, arrangement="buoys"), NOBODY, given)[0].endswith(
        "; beacons that move on their own, as below buoys"
    )
    assert remarks(replace(ready, arrangement="platform"), NOBODY, given)[0].endswith(
        "; beacons on one platform, whose pose the packets report"
    )


@pytest.mark.parametrize(("radius", "changes", "said"), [
    (2.05, {}, True), (1.95, {}, False), (7.3, {"gps_horizontal_bias_std_m": 3.5}, True),
    (6.9, {"gps_horizontal_bias_std_m": 3.5}, False),
    (6.9, {"surge_amplitude_m": 2.1, "sway_amplitude_m": 2.8}, False),
    (7.3, {"surge_amplitude_m": 2.1, "sway_amplitude_m": 2.8}, True),
    (6.9, {"gps_horizontal_markov_std_m": 2.1, "gps_horizontal_std_m": 2.8}, False),
    (7.3, {"gps_horizontal_markov_std_m": 2.1, "gps_horizontal_std_m": 2.8}, True),
])  # fmt: skip
def test_a_boat_that_is_twice_as_far_away_as_its_settings_say_is_said(
    radius: float, changes: dict[str, float], said: bool
) -> None:
    nothing = dict.fromkeys((
        "gps_horizontal_std_m", "gps_horizontal_markov_std_m", "gps_horizontal_bias_std_m",
        "surge_amplitude_m", "sway_amplitude_m",
    ), 0.0)  # fmt: skip
    log = on_a_boat(seconds=40)
    angle = np.arange(40) * np.pi / 20
    place = radius * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    log = replace(log, receptions=replace(log.receptions, platform_position=place))
    keys = {f"platform.{key}": value for key, value in (nothing | changes).items()}
    ready = settled(log, sblcosim.load("realistic-dive", keys))
    lines = [it for it in remarks(ready, NOBODY, played(log, 10**9, 4)) if "platform:" in it]
    assert lines == ([
        f"platform: 95 % of its reported positions spread over {radius:.1f} m, but in the settings "
        "it stays at its place, so receivers take that for errors of its GPS: set "
        'platform.motion = "spectrum" and platform.watch_circle_m'
    ] if said else [])  # fmt: skip
    assert not any("platform:" in it for it in
                   remarks(replace(ready, newest=True), NOBODY, played(log, 10**9, 4)))


@pytest.mark.parametrize(("alike", "said"), [(3.0, False), (3.01, True)])
def test_residuals_that_are_alike_are_said_with_their_factor(alike: float, said: bool) -> None:
    ready = replace(settled(made(seconds=24)), alike=alike)
    lines = remarks(ready, NOBODY, played(ready.log, 10**9, 4))[1:]
    assert lines == [
        "ranges: errors of a beacon are correlated in time, but receivers expect independent ones: "
        "their claims may be too small, perhaps by a factor of 3.0"
    ] * said


@pytest.mark.parametrize(("count", "depth_is", "plane", "words"), [
    (100, "sensor", False, "all 100 readings are the same, as if not measured: receivers take it "
     "as measured, so if it is wrong, their claims are too small"),
    (99, "sensor", False, None),
    (40, "none", False, "not measured: receivers take it as measured, so if it is wrong, their "
     "claims are too small"),
    (200, "truth", False, "made of the truth, so errors are those of a device with such a depth"),
    (200, "none", True, None),
])  # fmt: skip
def test_a_depth_that_was_not_measured_is_said(
    count: int, depth_is: str, plane: bool, words: str | None
) -> None:
    ready = settled(made(seconds=24, plane=plane))
    meta = ready.log.meta.model_copy(update={"depth_is": depth_is})
    log = replace(ready.log, depth_ns=np.arange(count) * NS, depth=np.full(count, 7.0), meta=meta)
    lines = remarks(replace(ready, log=log), NOBODY, played(log, 10**9, 4))[1:]
    assert lines == ([] if words is None else [f"depth: {words}"])


# --- Figures --------------------------------------------------------------------------------------


def axes(count: int) -> list[Any]:
    figure = Figure(figsize=(8, 2 * count))
    return [*figure.subplots(count, squeeze=False)[:, 0]]


def drawn(ax: Any, label: str) -> Any:
    (line,) = (it for it in ax.lines if it.get_label() == label)
    return line


def scattered(seed: int, count: int = 50, std: float = 0.5) -> Any:
    """A log of 60 s, its truth, and estimates with errors and claims."""
    log = made(seconds=60, start_s=500.0)
    truth = log.truth
    assert truth is not None
    rng = np.random.default_rng(seed)
    which = np.arange(3, 3 + count)
    error = rng.normal(0, 1, (count, 3)) * [1.0, 2.0, 0.3]
    P = np.tile(np.diag([1.44, 1, 4.0, 1, 0.09, 1]), (count, 1, 1)) * std**2
    own = Estimates(
        epoch_ns=truth.time_ns[which], position=truth.position[which] + error, covariance=P
    )
    return log, truth, own, error


def test_errors_are_drawn_over_time_with_two_deviations() -> None:
    log, truth, own, error = scattered(1)
    raw = replace(own, position=own.position + 9.0, covariance=None)
    tracks = {label: quality.table_of(log, it, truth) for label, it in
              (("mine", own), ("raw", raw))}  # fmt: skip
    panels = axes(4)
    assert [*figures.plot_errors(log, tracks, panels)] == panels
    epoch = (own.epoch_ns - log.start_ns) / NS
    labels = ["Error north [m]", "Error east [m]", "Error down [m]", "Horizontal [m]"]
    assert [ax.get_ylabel() for ax in panels] == labels
    for i, std in enumerate((0.6, 1.0, 0.15)):
        line = drawn(panels[i], "mine")
        np.testing.assert_allclose(line.get_xdata(), epoch)
        np.testing.assert_allclose(line.get_ydata(), error[:, i], atol=1e-9)
        (band,) = panels[i].collections
        heights = band.get_paths()[0].vertices[:, 1]
        assert (heights.min(), heights.max()) == pytest.approx((-2 * std, 2 * std))
        top = max(np.percentile(np.abs(error[:, i]), 99), np.median(np.abs(error[:, i] + 9)))
        assert panels[i].get_ylim() == pytest.approx((-1.1 * top, 1.1 * top))
    level = np.hypot(error[:, 0], error[:, 1])
    np.testing.assert_allclose(drawn(panels[3], "mine").get_ydata(), level)
    of_raw = np.hypot(error[:, 0] + 9, error[:, 1] + 9)
    top = 1.1 * max(np.percentile(level, 99), np.median(of_raw))
    assert panels[3].get_ylim() == pytest.approx((0, top))
    for ax in panels:
        assert -1.2 < ax.get_xlim()[0] <= 0 < 59 <= ax.get_xlim()[1] < 60.2
    title = " ".join(panels[0].get_title(loc="left").split())
    beyond = (of_raw > top).sum()
    assert f"outside, horizontally: raw ({beyond} of 50)" in title
    flat = replace(log, meta=log.meta.model_copy(update={"dimension": 2}))
    level_only = axes(3)
    figures.plot_errors(flat, tracks, level_only)
    assert [ax.get_ylabel() for ax in level_only] == [labels[0], labels[1], labels[3]]


def test_errors_that_are_nowhere_known_have_axes_of_a_metre() -> None:
    log, truth, own, _ = scattered(2)
    late = Truth(time_ns=truth.time_ns + 900 * NS, position=truth.position)
    panels = axes(4)
    figures.plot_errors(log, {"mine": quality.table_of(log, own, late)}, panels)
    assert [ax.get_ylim() for ax in panels] == [pytest.approx((-1.1, 1.1))] * 3 + [
        pytest.approx((0, 1.1))]  # fmt: skip


@pytest.mark.parametrize("by", ["time", "range"])
def test_residuals_are_drawn_by_beacon(by: str) -> None:
    log, truth, _, _ = scattered(3)
    exact = Estimates(epoch_ns=truth.time_ns[10:50], position=truth.position[10:50])
    heard = log.receptions
    (ax,) = axes(1)
    figures.plot_residuals(log, "mine", exact, by, [ax])
    off = heard.range - np.linalg.norm(truth.position - heard.beacon_position, axis=1)
    kept = np.arange(10, 50)
    for i, marker in enumerate("os^D"):
        own = kept[heard.beacon[kept] == i]
        line = drawn(ax, f"B{i}")
        over = (heard.epoch_ns[own] - log.start_ns) / NS if by == "time" else heard.range[own]
        np.testing.assert_allclose(line.get_xdata(), over)
        np.testing.assert_allclose(line.get_ydata(), off[own], atol=1e-9)
        assert line.get_marker() == marker
        assert (line.get_markersize(), line.get_alpha(), line.get_linestyle()) == (3.5, 0.8, "None")
        assert line.get_markeredgewidth() == 0.9
    colours = {drawn(ax, f"B{i}").get_color() for i in range(4)}
    assert len(colours) == 4
    low, high = np.percentile(off[kept], [0.5, 99.5])
    margin = 0.15 * (high - low)
    assert ax.get_ylim() == pytest.approx((low - margin, high + margin))
    assert ax.get_ylabel() == "Residual [m]"
    assert ax.get_title(loc="left").startswith("Ranges minus those of mine, by beacon")
    (zero,) = (it for it in ax.lines if [*it.get_ydata()] == [0, 0])
    assert (zero.get_linestyle(), zero.get_linewidth()) == ("-", 0.8)
    if by == "range":
        assert ax.get_xlabel() == "Range [m]"
        ends = heard.range[kept].min(), heard.range[kept].max()
        margin = 0.02 * (ends[1] - ends[0])
        assert ax.get_xlim() == pytest.approx((ends[0] - margin, ends[1] + margin))
    else:
        assert -1.2 < ax.get_xlim()[0] <= 0 < 59 <= ax.get_xlim()[1] < 60.2
    one = replace(heard, range=heard.range + 5.0)
    (above,) = axes(1)
    figures.plot_residuals(replace(log, receptions=one), "mine", exact, by, [above])
    low, high = 0.0, float(np.percentile(off[kept] + 5, 99.5))
    assert above.get_ylim() == pytest.approx((-0.15 * high, 1.15 * high))
    wild = heard.range.copy()
    wild[[20, 30, 40]] -= [50.0, 60.0, 70.0]
    (some,) = axes(1)
    figures.plot_residuals(replace(log, receptions=replace(heard, range=wild)), "mine", exact, by,
                           [some])  # fmt: skip
    floor = np.percentile(np.r_[np.delete(off[kept], [10, 20, 30]), -50.0, -60, -70], 0.5)
    assert some.get_ylim()[0] < floor


def test_residuals_that_are_all_zero_or_none_have_an_axis_all_the_same() -> None:
    log, truth, _, _ = scattered(3)
    none = Estimates(epoch_ns=np.zeros(0, np.int64), position=np.zeros((0, 3)))
    (ax,) = axes(1)
    figures.plot_residuals(log, "mine", none, "time", [ax])
    assert ax.get_ylim() == pytest.approx((-1.3, 1.3))
    heard = log.receptions
    exact = np.linalg.norm(truth.position - heard.beacon_position, axis=1)
    own = Estimates(epoch_ns=truth.time_ns, position=truth.position)
    (ax,) = axes(1)
    zero = replace(log, receptions=replace(heard, range=exact))
    figures.plot_residuals(zero, "mine", own, "time", [ax])
    assert ax.get_ylim() == pytest.approx((-1e-3, 1e-3), rel=1e-3)


def test_more_than_eight_beacons_are_said_and_not_drawn() -> None:
    angle = np.arange(10) * 2 * np.pi / 10
    ring = np.column_stack([50 * np.cos(angle), 50 * np.sin(angle), np.full(10, 12.0)])
    log = made(seconds=60, beacons=ring)
    assert log.truth is not None
    own = Estimates(epoch_ns=log.truth.time_ns, position=log.truth.position)
    (ax,) = axes(1)
    figures.plot_residuals(log, "mine", own, "time", [ax])
    labels = ax.get_legend_handles_labels()[1]
    assert labels == [f"B{i}" for i in range(8)]
    assert "2 beacons are not shown" in ax.get_title(loc="left")


def test_a_map_without_truth_holds_beacons_and_most_estimates() -> None:
    log, truth, own, _ = scattered(4)
    far = own.position.copy()
    far[7] += [500.0, -900.0, 0.0]
    table = quality.table_of(log, replace(own, position=far), None)
    (ax,) = axes(1)
    assert figures.plot_map(log, {"mine": table}, None, ax) is ax
    corners = np.array([[40.0, 40], [-40, 40], [-40, -40], [40, -40]])
    beacons = drawn(ax, "beacons")
    np.testing.assert_allclose(beacons.get_xdata(), corners[:, 1])
    np.testing.assert_allclose(beacons.get_ydata(), corners[:, 0])
    assert (beacons.get_marker(), beacons.get_markersize()) == ("^", 7)
    line = drawn(ax, "mine")
    np.testing.assert_allclose(line.get_xdata(), far[:, 1])
    np.testing.assert_allclose(line.get_ydata(), far[:, 0])
    low, high = (np.percentile(far[:, :2], q, axis=0) for q in (1, 99))
    low, high = np.minimum(low, -40), np.maximum(high, 40)
    margin = 0.06 * (high - low).max()
    assert ax.get_ylim() == pytest.approx((low[0] - margin, high[0] + margin))
    assert ax.get_xlim() == pytest.approx((low[1] - margin, high[1] + margin))
    assert "outside the figure: mine (1 of 50)" in ax.get_title(loc="left")
    (known,) = axes(1)
    figures.plot_map(log, {"mine": table}, truth, known)
    path = drawn(known, "truth")
    np.testing.assert_allclose(path.get_xdata(), truth.position[:, 1])
    np.testing.assert_allclose(path.get_ydata(), truth.position[:, 0])


def test_many_receivers_have_maps_of_their_own_with_common_axes() -> None:
    log, truth, own, _ = scattered(6)
    tracks = {
        f"r{i}": quality.table_of(log, replace(own, position=own.position + i), truth)
        for i in range(5)
    }
    first = figures.plot_map(log, tracks, truth)
    panels = [ax for ax in first.figure.axes if ax.lines][:5]
    assert panels[0] is first
    assert [ax.get_title(loc="left").split(";")[0] for ax in panels[1:]] == ["r1", "r2", "r3", "r4"]
    for ax, table in zip(panels, tracks.values(), strict=True):
        lines = [it for it in ax.lines if len(it.get_xdata()) == 50]
        assert len(lines) == 1
        np.testing.assert_allclose(lines[0].get_xdata(), table["y_m"])
        np.testing.assert_allclose(lines[0].get_ydata(), table["x_m"])
        assert ax.get_xlim() == first.get_xlim()
        assert ax.get_ylim() == first.get_ylim()


def test_the_map_of_a_diver_who_stays_at_one_beacon_is_a_metre_wide() -> None:
    log, _, own, _ = scattered(5)
    place = np.tile([3.0, -4.0, 5.0], (50, 1))
    heard = replace(log.receptions, beacon_position=np.tile([3.0, -4.0, 5.0], (60, 1)))
    table = quality.table_of(log, replace(own, position=place), None)
    (ax,) = axes(1)
    figures.plot_map(replace(log, receptions=heard), {"mine": table}, None, ax)
    assert ax.get_xlim() == pytest.approx((-4.5, -3.5))
    assert ax.get_ylim() == pytest.approx((2.5, 3.5))
