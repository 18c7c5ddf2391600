"""Times of a log: units, dates, the nearest nanosecond, and the range that counts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
from sblcosim.logs.times import (
    LATEST,
    MISSING,
    NAMES,
    date_of,
    fast,
    in_nanoseconds,
    of_date,
    of_dates,
    scaled,
    whole,
)

S = 10**9


@pytest.mark.parametrize("make", [
    lambda it: np.array(it, np.int64), lambda it: pd.Series(it), list,
    lambda it: [*map(str, it)], lambda it: pd.Series([*map(str, it)], dtype=object),
])  # fmt: skip
def test_times_are_nearer_to_zero_than_146_years(make: Any) -> None:
    given = [LATEST - 1, LATEST, 1 - LATEST, -LATEST, 0, -2, 2]
    assert LATEST == 4_611_686_018_427_387_904
    assert whole(make(given)).tolist() == [LATEST - 1, MISSING, 1 - LATEST, MISSING, 0, -2, 2]
    assert MISSING < -LATEST
    assert whole(make(given)).dtype == np.int64


def test_decimals_beyond_the_range_are_no_times() -> None:
    most = LATEST // S  # 4,611,686,018 s
    given = [f"{most}.427387903", f"{most}.427387904", f"-{most}.427387903", f"-{most}.427387904"]
    assert scaled(given, S).tolist() == [LATEST - 1, MISSING, 1 - LATEST, MISSING]
    assert scaled([most, most + 1, float(most + 1)], S).tolist() == [most * S, MISSING, MISSING]


def test_numbers_are_in_the_unit_and_rounded_to_the_nearest_nanosecond() -> None:
    """Halves go to the even one, as everywhere."""
    given = [3, np.int64(-4), 2.5, np.float32(0.5), " 1.25 ", "+.5", "-7.", "2.0004", "2.0005",
             "2.0015", "2e3", "1.5E-3"]  # fmt: skip
    assert scaled(given, 1000).tolist() == [
        3000, -4000, 2500, 500, 1250, 500, -7000, 2000, 2000, 2002, 2_000_000, 2,
    ]
    assert scaled(np.array([3, -4]), 1000).tolist() == [3000, -4000]
    assert scaled(pd.Series([3, 5]), 1000).tolist() == [3000, 5000]


def test_numbers_of_nanoseconds_must_be_whole() -> None:
    given = ["2.0", "2.5", 2.0, 2.5, "3e2", "000000000000000000005", f"{5:041}", f"{5:040}", True,
             np.True_, False, b"1", "٣"]  # fmt: skip
    assert scaled(given, 1).tolist() == [
        2, MISSING, 2, MISSING, 300, 5, MISSING, 5, MISSING, MISSING, MISSING, MISSING, MISSING,
    ]
    assert scaled(["1e999", "1e-999", "nan", float("nan"), float("inf")], 1).tolist() == (
        [MISSING] * 5
    )
    assert scaled(["1e-999"], S).tolist() == [0]


def test_a_column_of_words_becomes_numbers_only_as_a_whole() -> None:
    index = [7, 5, 9]
    found = fast(pd.Series(["1", "-2", "3"], index, dtype=object))
    assert (found.dtype, found.index.tolist(), found.tolist()) == (np.int64, index, [1, -2, 3])
    found = fast(pd.Series(["1.5", "", "3"], index, dtype=object))
    assert found.dtype == np.float64
    assert found.index.tolist() == index
    np.testing.assert_array_equal(found, [1.5, np.nan, 3])
    for words in (["1", "x", "3"], ["0x1", "2", "3"], ["1", 2, "3"], ["1", None, "3"], [1, 2, 3]):
        given = pd.Series(words, index, dtype=object)
        assert fast(given) is given
    for given in (pd.Series([], dtype=object), pd.Series([1.5, 2.5])):
        assert fast(given) is given


@pytest.mark.parametrize(("text", "expected"), [
    ("1970-01-02T01:02:03.5Z", 86_400 * S + 3723 * S + S // 2),
    ("1970-01-01 00:00:00,25z", S // 4), ("1969-12-31T23:59:59.25Z", -3 * S // 4),
    ("1970-01-01T00:00:00.000000001 Z", 1), ("1970-01-01T00:00:00.0000000014Z", 1),
    ("1970-01-01T00:00:00.000000001501Z", 2), (" 1970-01-01T01:00:00+01:00 ", 0),
    ("1970-01-01T00:00:00-00:30", 1800 * S), ("1970-01-01T00:00:07 +0000", 7 * S),
    ("2116-02-20T23:53:38.427387903Z", LATEST - 1), ("2116-02-20T23:53:38.427387904Z", MISSING),
    ("1970-01-01T00:00:60Z", MISSING), ("1970-02-30T00:00:00Z", MISSING), (7, MISSING),
])  # fmt: skip
def test_dates_have_parts_of_seconds_and_zones(text: Any, expected: int) -> None:
    assert of_date(text) == expected
    assert of_dates([text, "1970-01-01T00:00:05Z"]).tolist() == [expected, 5 * S]


def test_a_date_without_a_zone_may_be_taken_as_utc() -> None:
    assert of_date("1970-01-01T00:00:05") == MISSING
    assert of_date("1970-01-01T00:00:05", zone=False) == 5 * S
    assert of_date("1970-01-01T01:00:05+01", zone=False) == 5 * S


@pytest.mark.parametrize(("time_ns", "expected"), [
    (S * 86_400 * 59 + 3723 * S + 999_999_999, "1970-03-01 01:02:03 UTC"),
    (-1, "1969-12-31 23:59:59 UTC"), (1_700_000_000 * S, "2023-11-14 22:13:20 UTC"),
])
def test_dates_are_told_in_whole_seconds(time_ns: int, expected: str) -> None:
    assert date_of(time_ns) == expected


def test_times_of_a_table_become_nanoseconds_whatever_their_unit() -> None:
    table = pd.DataFrame({
        "time_us": ["3", "4.5"], "time_s": [7, 8], "arrival_ms": [2, 3], "epoch": [
            "1970-01-01T00:00:05Z", "never"], "other_s": [1, 2],
    })  # fmt: skip
    found = in_nanoseconds(table)
    assert [*found] == [*table, "time_ns", "arrival_ns", "epoch_ns"]
    assert found["time_ns"].tolist() == [3000, 4500]  # the finer unit
    assert found["arrival_ns"].tolist() == [2_000_000, 3_000_000]
    assert found["epoch_ns"].tolist() == [5 * S, MISSING]
    assert [*table] == ["time_us", "time_s", "arrival_ms", "epoch", "other_s"]
    given = pd.DataFrame({"time_ns": [1], "time_s": [2], "time": ["1970-01-01T00:00:05Z"]})
    assert in_nanoseconds(given) is given
    seconds = in_nanoseconds(pd.DataFrame({"epoch_s": ["0.000000007"], "epoch": ["x"]}))
    assert seconds["epoch_ns"].tolist() == [7]


def test_names_of_columns_with_times() -> None:
    assert len(NAMES) == 15
    assert {*NAMES} == {
        f"{name}{end}" for name in ("time", "arrival", "epoch")
        for end in ("", "_ns", "_us", "_ms", "_s")
    }
