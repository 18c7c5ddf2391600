import random

import numpy as np
import pytest
from sblcosim.fmus.host.nanoseconds import SECOND, is_whole_ns, nanoseconds, settled, text_of


@pytest.mark.parametrize(
    ("time_ns", "text"),
    [
        (0, "0 s"),
        (1, "0.000000001 s"),
        (100_000_000, "0.1 s"),
        (90_000_000_000, "90 s"),
        (-1_500_000_000, "-1.5 s"),
        (10**18 + 1, "1000000000.000000001 s"),
    ],
)
def test_a_time_is_written_in_seconds_without_rounding(time_ns, text):
    assert text_of(time_ns) == text


@pytest.mark.parametrize(
    ("seconds", "ns"),
    [
        (0.0, 0),
        (0.1, 100_000_000),
        (2.01, 2_010_000_000),
        (8.2, 8_200_000_000),
        (0.29, 290_000_000),
        (np.float64(2.01), 2_010_000_000),
        (0.21 / 5, 42_000_000),
        (1e-9, 1),
        (0.9e-9, 1),
        (2 / 3, 666_666_667),
        (3_999_999_999.1, 3_999_999_999_100_000_000),
        (5, 5 * SECOND),
    ],
)
def test_a_time_is_rounded_to_nanoseconds(seconds: float, ns: int) -> None:
    assert nanoseconds(seconds) == ns


def test_every_time_written_in_nanoseconds_is_read_as_it_was_written() -> None:
    numbers = random.Random(1)
    for _ in range(10_000):
        ns = numbers.randrange(10 ** numbers.randrange(1, 16))
        assert nanoseconds(ns / SECOND) == ns
        assert nanoseconds(float(f"{ns}e-9")) == ns


@pytest.mark.parametrize("whole", [0.042, 0.1, 0.15, 1.0, 2.01, 94.2])
def test_a_time_within_four_units_in_the_last_place_is_its_nanosecond(whole: float) -> None:
    for direction in (-np.inf, np.inf):
        time = whole
        for _ in range(4):
            time = float(np.nextafter(time, direction))
            assert is_whole_ns(time)
            assert settled(time) == whole
        for _ in range(9):  # ulps halve below a power of two
            time = float(np.nextafter(time, direction))
        assert not is_whole_ns(time)
        assert settled(time) == time


@pytest.mark.parametrize("seconds", [0.1234567891, 1 / 3, 1e-10])
def test_other_times_stay_as_they_are(seconds: float) -> None:
    assert not is_whole_ns(seconds)
    assert settled(seconds) == seconds
