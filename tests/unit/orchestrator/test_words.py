"""How numbers, shares and lists are written."""

from __future__ import annotations

import ast
import re
from itertools import pairwise
from math import inf, nan
from pathlib import Path

import numpy as np
import pytest
from sblcosim.words.lists import counted, doing, first_of, listed, plural
from sblcosim.words.numbers import (
    bounds,
    interval,
    measured,
    meters,
    meters_at_most,
    minus,
    number,
    ordinal,
    quantity,
    rounded,
    short_length,
    signed,
    unbroken,
    with_unit,
)
from sblcosim.words.shares import (
    column_percent,
    percent,
    percent_at_least,
    percent_at_most,
    rough_percent,
    whole_percent,
)

ORCHESTRATOR = Path(__file__).parents[3] / "orchestrator"


@pytest.mark.parametrize(
    ("length", "text"),
    [(0.0123, "0.012 m"), (0.0995, "0.10 m"), (0.995, "1.0 m"), (9.949, "9.9 m"), (9.95, "10 m"),
     (12345.6, "12,346 m"), (1.2345e13, "1.2e+13 m"), (0.0, "0.000 m"), (float("nan"), "– m")],
)  # fmt: skip
def test_lengths_have_two_digits_that_mean_something(length: float, text: str) -> None:
    assert meters(length) == text


ROOT = Path(__file__).parents[3]


def test_percentiles_are_spoken_as_people_do():
    spoken = [ordinal(p) for p in (1, 2, 3, 11, 12, 13, 22, 90, 91, 97.5)]
    assert " ".join(spoken) == "1st 2nd 3rd 11th 12th 13th 22nd 90th 91st 97.5th"


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0489, "0.0489"), (-3.456, "−3.46"), (1500.0, "1,500"), (float("nan"), "–"),
     (float("inf"), "∞"), (3.2e9, "3.2e+09")],
)
def test_numbers_are_for_people(value: float, text: str) -> None:
    assert number(value) == text


@pytest.mark.parametrize(
    ("share", "text"), [(0.0, "0.0 %"), (1e-5, "< 0.1 %"), (0.0123, "1.2 %"), (1.0, "100.0 %")]
)
def test_a_small_share_is_not_none(share: float, text: str) -> None:
    assert column_percent(share) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (1.2, "1.20"), (-0.01234, "−0.0123"), (1234.5, "1,234"), (999.4, "999"),
     (-1e-7, "−1.00e−07"), (nan, "–"), (inf, "∞"), (-inf, "−∞"), (np.float64(2.5), "2.50")],
)  # fmt: skip
def test_rounded_numbers_show_their_digits(value: float, text: str) -> None:
    assert rounded(value) == text
    assert signed(value) == ("+" if value > 0 else "") + text
    assert measured(value, "m") == (text if text == "–" else f"{text} m")
    assert measured(value, "") == text


def test_intervals_and_bounds_end_in_dashes_where_there_are_none() -> None:
    assert interval(-1.0, 2.0, unit="m") == "−1.00 to 2.00 m"
    assert interval(1.0, 2.0, signed) == "+1.00 to +2.00"
    assert interval(nan, nan) == "–"
    assert [bounds(1.0, 2.0), bounds(-inf, 2.0), bounds(-inf, inf)] == ["≥ 1, ≤ 2", "≤ 2", "–"]
    assert number(None) == "–"


def test_units_and_signs_of_given_numbers() -> None:
    assert [quantity(-3.0, "°"), quantity(-3.0, "m"), quantity(3, ""), quantity("ekf", "m")] == [
        "−3°", "−3 m", "3", "ekf"]  # fmt: skip
    assert [measured(2.0, "°"), measured(2.0, "m"), with_unit("x", "°"), with_unit("x", "")] == [
        "2.00°", "2.00 m", "x°", "x"]  # fmt: skip
    assert minus("a-b 2-3 -4 1e-05") == "a-b 2-3 −4 1e−05"
    assert unbroken("-2 m, 3 s, 4 more") == "−2\u00a0m, 3\u00a0s, 4 more"
    assert [*map(meters_at_most, (0.1231, 1.21, 12.1, 2e6))] == [
        "0.13 m", "1.3 m", "13 m", "2.0e+06 m"]  # fmt: skip
    assert [*map(short_length, (0.05, 1.0, 2e4, nan))] == ["0.050 m", "1.00 m", "2.0e+04 m", ""]


def test_shares_in_per_cent() -> None:
    assert [percent(0.95), percent(0.95, ".1f"), percent(0.995, ".4g")] == [
        "95 %", "95.0 %", "99.5 %"]  # fmt: skip
    assert [*map(rough_percent, (0.0, 0.0123, 0.0995, 0.5))] == ["0 %", "1.2 %", "10 %", "50 %"]
    assert [*map(rough_percent, (0.99, 0.995, 0.9999, 1))] == ["99 %", "99.5 %", "99.9 %", "100 %"]
    assert [whole_percent(x) for x in (-0.001, -0.03, 0.126, nan)] == ["0 %", "−3 %", "13 %", ""]
    assert [percent_at_least(0.9899), percent_at_least(0.9999), percent_at_most(0.011)] == [
        "98 %", "99.9 %", "2 %"]  # fmt: skip
    assert [*map(column_percent, (0.0, 4e-4, 7e-4, 0.1234))] == [
        "0.0 %", "< 0.1 %", "0.1 %", "12.3 %"]  # fmt: skip


@pytest.mark.parametrize(
    ("names", "text"), [("a", "a"), ("ab", "a and b"), ("abc", "a, b and c")]
)
def test_lists_in_sentences(names: str, text: str) -> None:
    assert listed(list(names)) == text
    assert listed(names, "or") == text.replace("and", "or")
    assert listed(names, most=3) == text


def test_of_long_lists_the_rest_is_counted() -> None:
    assert listed("abcd", most=3) == "a, b, c and 1 more"
    assert listed("abcde", most=4, shown=3, rest="others") == "a, b, c and 2 others"
    assert first_of("abc", 3, "; ") == "a; b; c"
    assert first_of("abcde", 3) == "a, b, c and 2 more"


def test_words_agree_with_their_number() -> None:
    assert [counted(1, "run"), counted(2000, "run"), counted(0, "run")] == [
        "1 run", "2,000 runs", "0 runs"]  # fmt: skip
    assert [plural(1, "is", "are"), plural(2, "is", "are")] == ["is", "are"]
    assert [doing(1, "fail"), doing(3, "fail")] == ["1 fails", "3 fail"]


def test_no_other_module_writes_per_cents_or_plurals_by_hand() -> None:
    per_cents = r"\{-?100 \* [^{}]*\} ?%"
    plurals = r"""\{(?:''|"") if[^{}]*else ['"]s['"]\}"""
    by_hand = re.compile(f"{per_cents}|{plurals}")
    found = [
        f"{path.relative_to(ORCHESTRATOR)}: {match[0]}"
        for path in ORCHESTRATOR.rglob("*.py")
        for match in by_hand.finditer(path.read_text("utf-8"))
        if path.parent.name != "words"
    ]
    assert found == []


def percentages_without_space(text: str) -> list[str]:
    """String formats and words of a module in which a per cent sign touches its number."""
    found: list[str] = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FormattedValue) and node.format_spec is not None:
            spec = ast.unparse(node.format_spec).strip("f'\"")
            found += [f"{node.lineno}: {spec}"] if spec in ("%", ",%") else []
        elif isinstance(node, ast.JoinedStr):
            found += [
                f"{one.lineno}: }}%" for one, after in pairwise(node.values)
                if isinstance(one, ast.FormattedValue) and isinstance(after, ast.Constant)
                and str(after.value).startswith("%")
            ]  # fmt: skip
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            found += [f"{node.lineno}: {some}" for some in re.findall(r"\d%(?!\w)", node.value)]
            found += [f"{node.lineno}: {some}" for some in re.findall(r"{[^{}]*\D%}", node.value)]
    return found


@pytest.mark.parametrize("words", [
    "f'{x:.1%}'", "f'{x:g}%'", "'95% of the runs'", "'about 5%.'", "'{:.0%}'.format",
    "'{x:.2%} of it'",
])  # fmt: skip
def test_percentages_that_touch_their_sign_are_found(words):
    assert len(percentages_without_space(words)) == 1
    assert not percentages_without_space("f'{x:g} % of {y}, 95 %' % 'width=100%d'")


def test_percentages_have_one_style_everywhere():
    """A number, a space and the sign: see `sblcosim.words.shares`."""
    found = [
        f"{path.relative_to(ROOT)}:{some}"
        for room in ("orchestrator", "models", "fmus", "tools", "docs", "examples")
        for path in sorted((ROOT / room).rglob("*.py")) if path.name != "log_lines.py"
        for some in percentages_without_space(path.read_text("utf-8"))
    ]
    rooms = ("docs", "orchestrator", "models", "fmus")
    pages = [*ROOT.glob("*.md"), *(path for room in rooms for path in (ROOT / room).rglob("*.md"))]
    found += [f"{path.relative_to(ROOT)}: {some}" for path in pages
              for some in re.findall(r"\d%(?!\w).*", path.read_text("utf-8"))]
    assert found == []
