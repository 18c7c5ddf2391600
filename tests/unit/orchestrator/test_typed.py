"""Values as people type them, and the units that they may have."""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Iterator

import pytest
from sblcosim.errors import ConfigurationError
from sblcosim.models import COMPONENTS
from sblcosim.models.declaration import UNITS
from sblcosim.models.platform.gps import GRADES
from sblcosim.models.target.variables import TRAJECTORIES
from sblcosim.scenario import typed
from sblcosim.scenario.likes import LIKES
from sblcosim.scenario.units import SYMBOLS, spellings, unit_of

NAMES = ([*GRADES], [*TRAJECTORIES.values()], [*LIKES])


def test_the_unit_of_a_key_is_that_of_its_variable() -> None:
    """Also of suffixes that end like shorter ones."""
    found = {
        variable.key: (unit_of(variable.key), variable.unit)
        for component in COMPONENTS.values() for variable in component.of("parameter")
    }  # fmt: skip
    assert len(found) > 100
    for key, (unit, name) in found.items():
        assert unit == ("" if name is None else SYMBOLS[UNITS[name].suffix]), key
    assert unit_of("clock_walk_psd_m2_s") == "m²/s"
    assert [unit_of(key) for key in ("latitude_deg", "gps_grade", "s")] == ["°", "", ""]


def written(values: list[list[float]], unit: str, rng: random.Random) -> str:
    """Rows of numbers as somebody may type them."""
    def number(value: float) -> str:
        text = rng.choice((f"{value:g}", f"{value:+g}", f"{value:e}"))
        return text.replace("-", rng.choice("-−")) if "e" not in text else text

    between = rng.choice((", ", " ", " , ", "  "))
    own = rng.choice(("", *spellings(unit)))
    # A unit of letters and one of signs may stand at the number or after a space.
    end = rng.choice(("", " ")) + (own.upper() if rng.random() < 0.2 else own) if own else ""
    each = rng.random() < 0.5
    rows = [between.join(number(v) + (end if each else "") for v in row) for row in values]
    if len(rows) == 1:
        whole = rng.choice(("{}", "[{}]", "({})", " {} ")).format(rows[0])
    else:
        whole = rng.choice((
            "; ".join(rows), ";".join(rows), "[" + ", ".join(f"[{row}]" for row in rows) + "]",
            ", ".join(f"({row})" for row in rows), " ".join(f"[{row}]" for row in rows),
        ))  # fmt: skip
    return whole + ("" if each else end)


@pytest.mark.parametrize("seed", range(300))
def test_numbers_are_read_however_they_are_typed(seed: int) -> None:
    rng = random.Random(seed)
    unit = rng.choice([*SYMBOLS.values(), ""])
    rows = [
        [float(f"{rng.uniform(-50, 50):.3g}") for _ in range(3)]
        for _ in range(rng.choice((1, 1, 3, 8)))
    ]
    text = written(rows, unit, rng)
    assert typed.rows(text, unit) == (rows[0] if len(rows) == 1 else rows), text
    assert typed.numbers(text, unit) == [value for row in rows for value in row]
    assert typed.are_numbers(text)
    one = written([rows[0][:1]], unit, rng)
    assert typed.number(one, unit) == rows[0][0]


def test_a_whole_number_stays_one() -> None:
    assert type(typed.number("3")) is int
    assert type(typed.number("3.0")) is float


@pytest.mark.parametrize("text", ["", " ", "fast", "5 kg", "5 cs", "1,,2", "nan", "inf", "1 2 x",
                                  "0x10", "1-2", "m", "[]", "--3", "1..2"])  # fmt: skip
@pytest.mark.parametrize("read", [typed.number, typed.numbers, typed.rows])
def test_what_is_no_number_is_refused_with_its_unit(read: Callable[..., object], text: str) -> None:
    with pytest.raises(ConfigurationError) as wrong:
        read(text, "m")
    assert re.fullmatch("must be (a number|numbers) in m, got (.*)", str(wrong.value))
    assert str(wrong.value).endswith(repr(text))


@pytest.mark.parametrize(
    ("text", "found"),
    [("5 cm", [0.05]), ("5CM", [0.05]), ("3 mm", [0.003]), ("10, 20, 50 cm", [0.1, 0.2, 0.5]),
     ("10 cm 2 m 5 mm", [0.1, 2.0, 0.005]), ("[[10cm, 2m], [1, 2 cm]]", [0.1, 2.0, 0.01, 0.02])],
)  # fmt: skip
def test_a_length_may_be_in_smaller_units(text: str, found: list[float]) -> None:
    """A unit is that of the numbers before it that have none."""
    assert typed.numbers(text, "m") == found


def test_a_number_without_a_unit_after_smaller_ones_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="must have the unit of each number, got"):
        typed.numbers("5 cm 2", "m")
    with pytest.raises(ConfigurationError, match="must be a number in s, got '5 cm'"):
        typed.number("5 cm", "s")


@pytest.mark.parametrize("text", ["0,5", "7,5 m", "0,5 0,5 1,0", "0,5, 0,5, 1", "1 2 3; 0,5 1 2",
                                  "-0,5"])  # fmt: skip
def test_a_decimal_comma_is_not_taken_for_a_list(text: str) -> None:
    with pytest.raises(ConfigurationError, match="must have a point before decimals"):
        typed.numbers(text, "m")
    assert typed.numbers(text.replace(", ", " ").replace(",", "."), "m")


def test_one_number_is_one() -> None:
    for text in ("1 2", "1; 2", "[1, 2]"):
        with pytest.raises(ConfigurationError, match="must be a number in s, got"):
            typed.number(text, "s")


def spelled(name: str) -> Iterator[str]:
    """A name as people type it."""
    for text in (name, name.upper(), name.title(), f" {name} ", f"'{name}'", f'"{name}"'):
        for mark in "_- ":
            yield re.sub("[_-]", mark, text)


@pytest.mark.parametrize("names", NAMES, ids=lambda names: names[0])
def test_a_name_is_read_in_any_case_and_short(names: list[str]) -> None:
    for name in names:
        assert {typed.name(text, names) for text in spelled(name)} == {name}
        alone = next(n for n in range(1, len(name) + 1)
                     if sum(it.startswith(name[:n]) for it in names) == 1 or n == len(name))
        assert typed.name(name[:alone].upper(), names) == name


@pytest.mark.parametrize("names", NAMES, ids=lambda names: names[0])
def test_a_wrong_name_is_answered_with_the_nearest(names: list[str]) -> None:
    for name in names:
        wrong = name[:-2] + name[-1] + "x"
        with pytest.raises(ConfigurationError) as error:
            typed.name(wrong.upper(), names)
        said = str(error.value)
        assert said.startswith(f"must be {names[0]}, ")
        assert f", got {wrong.upper()!r}; did you mean " in said
        assert re.search(r"did you mean '(.*)'\?", said)[1] in names  # type: ignore[index]


def test_what_fits_several_names_is_refused() -> None:
    for text in ("", "s", "_"):
        with pytest.raises(ConfigurationError, match="must be "):
            typed.name(text, TRAJECTORIES.values())


def test_a_synonym_is_read_and_suggested() -> None:
    also = {"rtk": "rtk_fixed"}
    for text in ("rtk", "RTK", "Rtk"):
        assert typed.name(text, GRADES, also) == "rtk_fixed"
    with pytest.raises(ConfigurationError, match="or a number, got 'rtkk'; did you mean 'rtk'"):
        typed.name("rtkk", GRADES, also, "a number")
