import pytest
from sblcosim.system import text_of


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
