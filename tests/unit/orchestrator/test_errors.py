"""What messages say about a value."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import pytest
from sblcosim.errors import (
    ConfigurationError,
    ConfigurationWarning,
    FmuError,
    nearest,
    shortened,
)


def nested(depth: int) -> list[Any]:
    value: list[Any] = []
    for _ in range(depth):
        value = [value]
    return value


@pytest.mark.parametrize(
    ("name", "known", "meant"),
    [("ekff", ["ekf", "coupled"], "ekf"), ("EKF", ["ekf", "coupled"], "ekf"), ("Q", ["q"], "q"),
     ("myfilter", ["MyFilter", "Other"], "MyFilter"), ("q", ["q_2", "Q"], "Q"), ("z", ["q"], ""),
     ("mass_KG", ["Mass_kg", "mass_kg"], "mass_kg"),
     ("speed", ["seed", "speed_m_s", "speed_of_boat_m_s"], "speed_m_s"),
     ("range", ["ranging", "range_common_std_m", "range_std_m"], "range_std_m"),
     ("total_rms_m", ["relative_total_rms_m", "absolute_total_rms_m"], "relative_total_rms_m"),
     ("total_rms", ["relative_total_rms", "relative_total_rms_m"], "relative_total_rms"),
     ("gps_std", ["gps_shared", "gps_markov_std_m", "gps_up_std_m"], "gps_up_std_m"),
     ("std_gps", ["gps_shared", "gps_up_std_m"], ""), ("a_std", ["a_m", "std_a"], "std_a"),
     ("rms", ["seed", "rmse"], "rmse"), ("seed", ["own_seed"], "own_seed"),
     ("q", ["q_of_it"], "")],
)  # fmt: skip
def test_the_nearest_name_is_found_in_any_case(name: str, known: list[str], meant: str) -> None:
    assert nearest(name, known) == (f"; did you mean {meant!r}?" if meant else "")


@pytest.mark.parametrize(
    ("value", "text"),
    [("word", "word"), (0.25, "0.25"), ([1, "a"], "[1, 'a']"), ("x" * 80, "x" * 80)],
)
def test_a_short_value_is_shown_whole(value: object, text: str) -> None:
    assert shortened(value) == text


@pytest.mark.parametrize("value", ["begin" + "x" * 300 + "end", list(range(99)), b"x" * 100])
def test_of_a_long_value_beginning_and_end_are_shown(value: object) -> None:
    text = value if isinstance(value, str) else repr(value)
    short = shortened(value)
    assert len(short) == 80
    first, _, last = short.partition("...")
    assert text.startswith(first)
    assert text.endswith(last)
    assert first
    assert last


@pytest.mark.parametrize(
    "value", [10**5000, nested(100_000), [10**5000]], ids=["digits", "depth", "list"]
)
def test_a_value_that_python_cannot_print_does_no_harm(value: object) -> None:
    assert 0 < len(shortened(value)) <= 80


def test_what_does_not_print_is_escaped_and_paths_are_texts() -> None:
    assert shortened(Path("a\nb")) == "a\\nb"
    assert shortened("a\x1b[2J\udcff") == "a\\x1b[2J\\udcff"


LONG = "x" * 3000


@pytest.mark.parametrize("kind", [ConfigurationError, FmuError, ConfigurationWarning])
@pytest.mark.parametrize("message", [
    f"key: must be short, got '{LONG}'; did you mean 'it'?", f"{LONG}.toml: no such file",
    f"key: must be short, got \"{'x ' * 900}\"", f"{'a/' * 900}.toml: no such file",
    f"key: must be a number, got {list(range(900))}", f"a: no\nkey: must be short, got {LONG}",
])  # fmt: skip
def test_no_message_shows_more_of_a_value(kind: type[Exception], message: str) -> None:
    error = kind(message)
    assert len(str(error)) < 150
    assert str(error)[:4] == message[:4]
    assert str(error).count("\n") == message.count("\n")
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


@pytest.mark.parametrize("message", [
    "/" + "long/way/to/" * 15 + "it: must be a file", "the filter's words, " * 20 + "the end",
    "must be " + ", ".join(map(repr, "abcdefghijklmnopqrstuvwxyz" * 3)) + ", got 'é'",
])  # fmt: skip
def test_paths_lists_and_sentences_are_shown_whole(message: str) -> None:
    assert str(ConfigurationError(message)) == message
