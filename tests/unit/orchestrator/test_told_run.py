"""A run in words: every line of receivers that did well, badly, rarely, and not at all."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from sblcosim.judge.columns import ERRORS, PERCENTILES
from sblcosim.judge.consistency import of_runs
from sblcosim.judge.definitions import MISLEADING_S
from sblcosim.results import text

FRAMES = ("absolute", "relative")
USUAL = {
    "estimates": 50, "first_fix_s": 2.5, "availability": 0.981, "update_share": 0.9,
    "beyond_claim": np.nan, "beyond_claim_longest_s": np.nan, "misleading": np.nan,
    "inconsistent": np.nan, "lost": False,
} | {
    f"{name}{part}": np.nan
    for name in ("nees_position", "relative_nees_position", "own_relative_nees_position",
                 "nees_state", "nis")
    for part in ("", "_expected", "_low", "_high", "_verdict")
}  # fmt: skip


def told(rows: dict[str, dict[str, Any]], **more: Any) -> Any:
    """A result whose receivers have these rows, and in them the RMS of each axis by frame."""
    own = {"rms": dict.fromkeys(FRAMES, (3.0, 4.0, 12.0)), "p95": (9.0, 20.0)}
    given = {name: USUAL | own | row for name, row in rows.items()}
    errors, percentiles = {}, {}
    for name, row in given.items():
        for frame, axes in row["rms"].items() if row["estimates"] else ():
            for axis, rms in zip(("x", "y", "z", "total"), (*axes, np.linalg.norm(axes)),
                                 strict=True):  # fmt: skip
                errors[name, frame, axis] = {
                    "mean_m": -rms / 2, "rms_m": rms, "std_m": rms / 4, "n": row["estimates"],
                }
            for length, most in zip(("horizontal", "total"), row["p95"], strict=True):
                percentiles[name, frame, length] = {
                    column.name: most * (1 + (i - 2) / 8)
                    for i, column in enumerate(PERCENTILES.columns)
                }
    index = {table: [column.name for column in table.index] for table in (ERRORS, PERCENTILES)}
    tables = [
        pd.DataFrame(list(found.values()), index=pd.MultiIndex.from_tuples(found, names=names))
        for found, names in zip((errors, percentiles), index.values(), strict=True)
    ]
    every: dict[str, Any] = {
        "title": "Some run", "receivers": tuple(given), "failures": {}, "origins": {},
        "remarks": (), "verdicts": {}, "motion": {}, "errors": tables[0],
        "percentiles": tables[1],
        "summary": pd.DataFrame(
            [{k: row[k] for k in USUAL} for row in given.values()], index=list(given)
        ).astype({"estimates": int}),
        "consistency": {name: row.get("verdicts", {}) for name, row in given.items()},
        "tracks": {name: row.get("track") for name, row in given.items()},
        "judged": {
            name: SimpleNamespace(
                estimates=SimpleNamespace(covariance=row.get("covariance")),
                late=np.array([False, row.get("late", True)]),
            )
            for name, row in given.items()
        },
    }  # fmt: skip
    return SimpleNamespace(**every | more)


def claiming(nees: float, *stds: float, **more: Any) -> dict[str, Any]:
    """A receiver with the verdict of a run, and standard deviations of each estimate and axis."""
    track = pd.DataFrame({
        "std_x_m": [*stds, np.nan, 99.0], "std_y_m": [*stds, 1.0, 99.0],
        "std_z_m": [*stds, 1.0, 99.0], "nees_position": [nees] * (len(stds) + 1) + [np.nan],
    })  # fmt: skip
    return {"verdicts": {"absolute": of_runs([nees])}, "track": track, **more}


def test_each_receiver_has_its_line() -> None:
    claims = {"estimates": 9, "update_share": 0.3}
    record = SimpleNamespace(values={
        "mute.update_count": np.array([0.0, 3.0, 2.0]), "mute.valid": np.zeros(3),
        "dumb.update_count": np.zeros(3),
        "acoustics.reception_count": np.array([[0, 0], [7, 5]]),
    })  # fmt: skip
    beyond = {"misleading": True, "nees_position": 27.0, "nees_position_expected": 3.0}
    result = told({
        "few": claims, "one": {"estimates": 1, "update_share": 0.25},
        "ten": claims | {"estimates": 10}, "half": claims | {"update_share": 0.5},
        "lost": claiming(3.0, 8.0, lost=True),
        "fits": claiming(3.0, 5.0, 7.0),
        "above": claiming(5.0, 5.0), "below": claiming(1.5, 9.0), "aside": claiming(5.0, 9.0),
        "never": {"covariance": np.eye(3)},
        "badly": claiming(20.0, 1.0, **beyond, beyond_claim_longest_s=MISLEADING_S),
        "long": {**beyond, "beyond_claim_longest_s": MISLEADING_S + 1},
        "mute": {"estimates": 0}, "dumb": {"estimates": 0},
        "own": {},
    }, record=record, failures={"a": "the first"}, origins={"own": {"doubts": ("it",)}},
       remarks=("own: it gives another's", "long: no doubt", "and so on"),
    )  # fmt: skip
    usual, none = "13 m RMS, 95 % within 20 m; ", "no covariance"
    assert list(text.verdicts(result)) == [
        f"own: it gives another's: {usual}{none}",
        f"few: {usual.replace('13', '9 estimates in 30 updates; 13', 1)}{none}",
        f"one: 1 estimate in 4 updates; {usual}{none}",
        f"ten: {usual}{none}", f"half: {usual}{none}",
        f"lost: lost; {usual}claims 14 m",
        f"fits: {usual}claims 11 m: looks right",
        f"above: {usual}claims 8.7 m: perhaps optimistic",
        f"below: {usual}claims 16 m: perhaps pessimistic",
        f"aside: {usual}claims 16 m: perhaps optimistic in some direction",
        f"never: {usual}its covariance is never positive definite",
        f"badly: {usual}claims 1.7 m: do not trust its covariance; misleading: 3 times as far off "
        "as it claims, direction by direction",
        f"long: {usual}{none}; misleading: for {MISLEADING_S + 1:.0f} s beyond three times what it "
        "claims",
        "mute: no estimate; update_count reached 3, but there was no valid fix when it changed; "
        "packets received from each beacon: 7, 5; look at mute.update_count, mute.valid, "
        "acoustics.reception_count in the record",
        "dumb: no estimate; update_count stayed 0; packets received from each beacon: 7, 5; look "
        "at dumb.update_count, acoustics.reception_count in the record",
        "failed: the first",
        "One run cannot tell whether a covariance is right. A study can.",
        "long: no doubt", "and so on",
    ]  # fmt: skip
    certain = told({"badly": claiming(20.0, 1.0), "none": {}})
    assert "One run" not in "".join(text.verdicts(certain))


def test_a_receiver_is_described_line_by_line() -> None:
    nees = dict(zip(("", "_expected", "_low", "_high", "_verdict"),
                    (4.5, 3.0, 2.5, 3.5, "pessimistic"), strict=True))  # fmt: skip
    result = told({
        "a": {
            "beyond_claim": 0.125, "beyond_claim_longest_s": 7.5, "inconsistent": True,
            "verdicts": {"absolute": of_runs([3.0])},
        } | {f"nees_position{part}": it for part, it in nees.items()} | {"nis": 2.0},
        "b": {"estimates": 1, "update_share": np.nan, "lost": True, "late": False}
        | {f"nis{part}": it for part, it in nees.items()},
        "c": {"lost": True, "covariance": np.eye(3)}
        | {f"nis{part}": it for part, it in (nees | {"_verdict": "optimistic"}).items()},
    }, motion={"a": "it moved"})  # fmt: skip
    band = "expected 3.00 (95 %: 2.50 to 3.50): "
    assert text.about(result, "a") == [
        "a: 50 estimates, the first at 2.5 s; a fix available 98.1 % of the time",
        "  90.0 % of the updates gave a new estimate", "  it moved",
        f"  mean NEES of the position 4.50, {band}pessimistic, errors smaller than claimed",
        "  mean NIS 2.00, of unknown degrees of freedom",
        "  covariance: looks right; one run cannot tell, because its errors are "
        "correlated",
        "  error beyond three times its claim, and 1 m, for 12.5 % of the time, at most 7.5 s "
        "without a break",
    ]  # fmt: skip
    assert text.about(result, "b") == [
        "b: 1 estimate, the first at 2.5 s; a fix available 98.1 % of the time",
        f"  mean NIS 4.50, {band}says nothing, as the run is lost",
        "  consistency unknown: no covariance", "  lost: no estimate in the last quarter",
    ]  # fmt: skip
    assert text.about(result, "c")[2:] == [
        f"  mean NIS 4.50, {band}optimistic, errors larger than claimed",
        "  consistency unknown: its covariance is never positive definite",
        "  lost: in the last quarter its error exceeds the distance to the platform",
    ]


def test_the_small_table_shows_horizontal_errors_that_differ_by_a_hundredth() -> None:
    flat = {"absolute": (3.0, 4.0, 0.0), "relative": (3.0, 4.0, 0.0)}
    result = told({
        "same": {"rms": flat, "p95": (99.0, 100.0)},
        "other": {"rms": flat, "p95": (98.0, 100.0)},
        "low": {"rms": {**flat, "relative": (3.0, 4.0, 1.0)}, "p95": (100.0, 100.0)},
        "a-very-long-name-of-a-receiver": {"rms": {"absolute": (30_000.0, 0.0, 0.0)},
                                           "p95": (2.0, 2.0)},
    })  # fmt: skip
    wide = [*text.overview(result, 80)]
    assert wide[0] == "Some run: error [m]"
    assert wide[1].split() == ["absolute", "relative"]
    assert wide[2].split() == ["RMS", "95", "%", "RMS", "95", "%"]
    names = [line[:30].rstrip() for line in wide[3:-1]]
    assert names == ["same", "other", "  horizontal", "low", "  horizontal",
                     "a-very-long-name-of-a-receiver"]  # fmt: skip
    assert wide[4].split() == ["other", "5.00", "100", "5.00", "100"]
    assert wide[5].split() == ["horizontal", "5.00", "98.0", "5.00", "98.0"]
    assert wide[6].split() == ["low", "5.00", "100", "5.10", "100"]
    assert wide[8].split()[1:] == ["30,000", "2.00", "–", "–"]
    assert wide[-1] == "relative: to the platform as it reports itself"
    assert len({len(line) for line in wide[1:-1]}) == 1
    longest = len(wide[1])
    for width in range(longest - 20, longest + 3):
        lines = [*text.overview(result, width)]
        room = max(16, min(30, 30 + width - longest))
        assert {len(line) for line in lines[1:-1]} == {longest - 30 + room}


@pytest.mark.parametrize("table", ["errors", "percentiles"])
def test_frames_stand_side_by_side_as_far_as_they_fit(table: str) -> None:
    result = told({"short": {}, "sixteen-letters-": {}, "seventeen-letters": {"rms": {
        "absolute": (3.0, 4.0, 12.0)}}, "big": {"rms": dict.fromkeys(FRAMES, (3e5, 4e6, 0.1)),
                                               "p95": (110.0, 2e6)}})  # fmt: skip
    write = getattr(text, table)
    data = getattr(result, table)
    wide = [*write(data, result.receivers, 200)]
    longest = max(map(len, wide))
    assert [*write(data, result.receivers, longest)] == wide
    narrow = [*write(data, result.receivers, longest - 1)]
    assert [*write(data, result.receivers, 1)] == narrow
    half = narrow.index("")
    assert narrow.count("") == 1
    assert "seventeen-letters" in wide
    assert "seventeen-letters" in narrow[:half]
    assert "seventeen-letters" not in narrow[half:]
    starts = {line[:17].rstrip() for line in wide} - {""}
    assert {"receiver", "short", "sixteen-letters-", "big", "seventeen-letters"} <= starts
    kinds = 4 if table == "errors" else 2
    assert len(wide) == 3 + 4 * kinds + 1
    for after, line in pairwise(wide[2:]):
        if line == "seventeen-letters":
            continue
        assert line[17:].startswith(("x ", "y ", "z ", "total", "horizontal "))
        named = line[17:].startswith(("x ", "horizontal ")) and after != "seventeen-letters"
        assert bool(line[:17].strip()) is named
        cells = line[17:].split()[1:]
        assert len(cells) == 2 * (len(ERRORS.printed) if table == "errors" else
                                  len(PERCENTILES.printed))  # fmt: skip
    shown = {cell for line in wide for cell in line.split()}
    many = {"-0.050", "-2000000", "4000000", "1000000", "75000.00", "300000.0"}
    assert shown >= (many if table == "errors" else {"82.500", "110.00", "123.75", "2e+06"})
