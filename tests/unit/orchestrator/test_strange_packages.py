"""Packages of any make are run as the standard says: SSP 2.0.1, the sections named in each test.

All numbers but those of temperatures are sums of few powers of two, so that every way to compute
them gives the same bits; the blocks are those of `made_packages`.
"""

from __future__ import annotations

import itertools
import re
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest
import sblcosim
from made_packages import (
    UNITS,
    bindings,
    block,
    bound,
    connectors,
    described,
    entry,
    linear,
    link,
    mapping,
    packed,
    parameters,
    part,
    series,
    step,
    system,
    tag,
)
from quick import one_in
from sblcosim.cli import app
from sblcosim.data.record import Record
from sblcosim.errors import ConfigurationWarning
from typer.testing import CliRunner

Stranger = Callable[[int], Path]
QUARTERS = step(0.25) + tag("ssd:DefaultExperiment", startTime=0, stopTime=1)
"""Four steps."""
M = dict.fromkeys(("k", "c", "d", "a", "b", "gained", "integral", "total"), "m")


@pytest.fixture
def made(stranger: Stranger, tmp_path: Path) -> Callable[..., Path]:
    """Writes a package with blocks whose variables are without units ("block.fmu") and in m."""

    def write(root: str, after: str = QUARTERS, fmi: int = 2, **files: bytes | str) -> Path:
        blocks = {"block__fmu": block(stranger, fmi), "metres__fmu": block(stranger, fmi, M)}
        return packed(tmp_path / "made.ssp", described(root, after), **{**blocks, **files})

    return write


def run(path: Path) -> Record:
    """The record, without a warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", ConfigurationWarning)
        return sblcosim.run(path).record


def through(name: str, into: str = "input", out: str = "output") -> str:
    """A system without elements: its input is its output."""
    return system(name, [], [link(".out", ".into")], connectors(into=into, out=out))


def integral(inputs: list[float], h: float = 0.25) -> list[float]:
    """What integrates the inputs of the steps."""
    return [0.0, *itertools.accumulate(h * value for value in inputs)]


# --- Ten packages, and what they give by hand -----------------------------------------------------


@pytest.mark.parametrize("turned", [*itertools.product([False, True], repeat=3)])
def test_the_ends_of_a_connection_are_written_in_any_order(
    turned: tuple[bool, ...], made: Callable[..., Path]
) -> None:
    """Start and end "do not denote directionality" (Connections); nor need connectors be told."""
    told, fmi = sum(turned) % 2, 3 if turned[0] else 2
    ends = [(".go", "a.a"), ("a.gained", "b.a"), ("b.integral", ".out")]
    links = [link(*(pair[::-1] if turn else pair))
             for pair, turn in zip(ends, turned, strict=True)]  # fmt: skip
    one = connectors(a="input", gained="output") if told else ""
    other = connectors(a="input", integral="output") if told else ""
    own = bindings(bound(parameters({"k": "2", "c": "1"})))
    root = system(
        "s", [part("a", one, own), part("b", other)], links,
        connectors(go="input", out="output"), bindings(bound(parameters({"go": "3"}))),
    )  # fmt: skip
    record = run(made(root, fmi=fmi))
    assert series(record, "a", "gained") == [0, 7, 7, 7, 7]
    assert series(record, "b", "integral") == [0, 0, 1.75, 3.5, 5.25]


def test_units_count_at_the_connectors_of_systems(made: Callable[..., Path]) -> None:
    """From m to ki, as if that were half, to m: only the middle is not converted."""
    one = system(
        "one", [part("a", connectors(gained="output m"))], [link("a.gained", ".out")],
        connectors(out="output ki"), bindings(bound(parameters({"a.c": "7"}))),
    )  # fmt: skip
    other = system(
        "other", [part("b", source="metres.fmu")], [link("b.a", ".into")],
        connectors(into="input half"),
    )  # fmt: skip
    middle = link("other.into", "one.out", suppressUnitConversion="true")
    there = part("c", connectors(a="input km"))
    into = [middle, link(".far", "c.a"), link("one.out", "c.b")]
    root = system(
        "s", [one, other, there], into, connectors(far="input m"),
        bindings(bound(parameters({"far": "8000"}))),
    )  # fmt: skip
    record = run(made(root))
    arrived = [3.0, *[7 / 1024 * 0.5 + 3] * 3]
    assert series(record, "other", "b", "integral") == integral(arrived)
    assert series(record, "c", "integral") == [0, 2, 4, 6, 8]
    assert series(record, "c", "total") == [0, 8, *[8 + 7 / 1024] * 3]


def test_the_unit_of_a_connector_is_that_of_a_value(made: Callable[..., Path]) -> None:
    """0.002 km at a connector in m, of a variable that has no unit, or another one (Real)."""
    values = bindings(bound(parameters({"k": "0.002 km", "c": "3 ki", "a": "4", "d": "5 m"})))
    units = connectors(k="parameter m", c="parameter half", a="input km", d="parameter m")
    elements = [part("plain", units, values), part("metres", units, values, source="metres.fmu")]
    record = run(made(system("s", elements)))
    c = (3 * 1024 - 3) / 0.5
    for name in ("plain", "metres"):
        assert series(record, name, "gained")[1:] == [2 * 4 + c] * 4
        assert series(record, name, "total")[1:] == [2 * 4 + c + 5] * 4


def test_a_unit_that_nothing_else_has_is_remarked_on(made: Callable[..., Path]) -> None:
    own = bindings(bound(parameters({"k": "0.002 km", "a": "4"})))
    with pytest.warns(ConfigurationWarning, match=r"a\.k: .*\bkm\b.*unit"):
        record = sblcosim.run(made(system("s", [part("a", own)]))).record
    assert series(record, "a", "gained")[1:] == [0.002 * 4] * 4


def test_a_unit_in_brackets_is_that_unit(made: Callable[..., Path]) -> None:
    values = parameters({"k": "0.002 km", "a": "4"}).replace('"km"', '"[km]"')
    own = part("a", connectors(k="parameter m"), bindings(bound(values)))
    result = sblcosim.run(made(system("s", [own])))
    assert series(result.record, "a", "gained")[1:] == [2 * 4] * 4
    assert any("the unit '[km]' is read as 'km'" in remark for remark in result.remarks)


def test_temperatures_have_an_offset(made: Callable[..., Path]) -> None:
    kelvin, bare = connectors(c="parameter K", a="input K"), connectors(c="parameter K")
    both = connectors(c="parameter K", gained="output degC")
    inner = system("inner", [part("b", kelvin)], [link(".t", "b.a")], connectors(t="input K"))
    root = system(
        "s", [part("a", both), part("plain", bare), inner],
        [link("a.gained", "inner.t"), link(".set", "plain.c")], connectors(set="parameter K"),
        bindings(bound(parameters({"a.c": "20 degC", "inner.b.c": "-10 degC", "set": "1 degC"}))),
    )  # fmt: skip
    record = run(made(root))
    assert series(record, "a", "gained")[1:] == [20 + 273.15] * 4
    assert series(record, "plain", "gained")[1:] == [1 + 273.15] * 4
    arrived = [273.15, *[(20 + 273.15) + 273.15] * 3]
    assert series(record, "inner", "b", "integral") == integral(arrived)
    assert series(record, "inner", "b", "gained")[1:] == [x + (273.15 - 10) for x in arrived]


def test_systems_are_nested_two_deep(made: Callable[..., Path]) -> None:
    """Values of a higher level come first; of one level, the last (ParameterBindings)."""
    low = bindings(bound(parameters({"k": "9", "c": "9", "d": "9", "b": "1"})))
    inner = system(
        "inner", [part("a", low), part("e")],
        [link("a.total", ".up"), link(".down", "a.a"), link("e.a", "a.integral")],
        connectors(up="output", down="input"),
        bindings(bound(parameters({"a.k": "8", "a.c": "8", "a.d": "0.5"}))),
    )  # fmt: skip
    outer = system(
        "outer", [inner, part("b")],
        [link("b.gained", "inner.down"), link("inner.up", "b.a"), link(".top", "inner.up")],
        connectors(top="output"),
        bindings(bound(parameters({"inner.a.k": "7", "inner.a.c": "0.25"})),
                 bound(parameters({"b.c": "6"}))),
    )  # fmt: skip
    root = system(
        "s", [outer, part("z")], [link("outer.top", "z.a")], "",
        bindings(bound(parameters({"outer.inner.a.k": "3", "outer.b.c": "5"})),
                 bound(parameters({"outer.inner.a.k": "2", "outer.b.c": "1"}))),
    )  # fmt: skip
    record = run(made(root))
    total, gained = [0.0], [0.0]  # (2 a + 0.25) + (2 * 1 + 0.5), and b's: 1 a + 1
    for _ in range(4):
        total, gained = [*total, 2 * gained[-1] + 2.75], [*gained, total[-1] + 1]
    assert series(record, "outer", "inner", "a", "total") == total
    assert series(record, "outer", "b", "gained") == gained
    assert series(record, "z", "integral") == integral(total[:-1])
    inside = integral(gained[:-1])
    assert series(record, "outer", "inner", "e", "integral") == integral(inside[:-1])


@pytest.mark.parametrize("outside", [False, True], ids=["inline", "files"])
def test_mappings_rename_convert_and_transform(outside: bool, made: Callable[..., Path]) -> None:
    """Units first, then the transformation; what is not mapped is not applied (SSM)."""
    values = parameters({"p": "2 ki", "q": "5", "in.b.k": "9", "none": "4"}, UNITS, alone=outside)
    entries = mapping(
        entry("x.p", "in.a.c", linear(2, 1)), entry("x.p", "in.b.c"),
        entry("x.p", "in.a.d", linear(0.5), suppressUnitConversion="true"),
        entry("x.q", "z.k", linear(0.5, -2)), entry("x.q", "set", linear(offset=1)),
        alone=outside,
    )  # fmt: skip
    if outside:
        whole, files = bound("v.ssv", "m.ssm", prefix="x."), {"v__ssv": values, "m__ssm": entries}
    else:
        whole, files = bound(values, entries, prefix="x."), {}
    inner = system("in", [part("a", source="metres.fmu"), part("b", source="metres.fmu")])
    root = system(
        "s", [inner, part("z")], [link("z.c", ".set")], connectors(set="parameter"),
        bindings(whole, bound(parameters({"z.a": "8", "in.b.a": "16"}))),
    )  # fmt: skip
    record = run(made(root, **files))
    assert series(record, "in", "a", "gained")[1:] == [2 * 2048 + 1] * 4
    assert series(record, "in", "a", "total")[1:] == [2 * 2048 + 1 + 1] * 4
    assert series(record, "in", "b", "gained")[1:] == [16 + 2048] * 4
    assert series(record, "z", "gained")[1:] == [0.5 * 8 + 6] * 4


def test_a_set_has_its_own_units(made: Callable[..., Path]) -> None:
    """Units are those of the file; "km" is something else in each (Units)."""
    long = {"km": {"m": 1, "factor": 2048}}
    files = {
        "near__ssv": parameters({"c": "2 km"}, {"km": {"m": 1, "factor": 4}}, alone=True),
        "far__ssv": parameters({"d": "2 km"}, {"km": {"m": 1, "factor": 512}}, alone=True),
    }
    own = bindings(bound("near.ssv"), bound("far.ssv"), bound(parameters({"a": "1 km"}, long)))
    elements = [part("a", own, source="metres.fmu"), part("b", source="metres.fmu")]
    root = system("s", elements, [], bindings(bound(parameters({"b.c": "3 km"}))))
    record = run(made(root, **files))
    assert series(record, "a", "total")[1:] == [2048 + 8 + 1024] * 4
    assert series(record, "b", "gained")[1:] == [3000] * 4


def test_prefixes_stand_before_names(made: Callable[..., Path]) -> None:
    values = parameters({"k": "2", "a": "3"})
    inner = system("in", [part("a"), part("ab")], [], bindings(bound(values, prefix="ab.")))
    root = system(
        "s", [inner, part("a")], [link(".go", "a.b")], connectors(go="input"),
        bindings(
            bound(values, prefix="in.a."), bound(parameters({".c": "5"}), prefix="in.ab"),
            bound(parameters({"o": "7"}), prefix="g"),
        ),
    )  # fmt: skip
    record = run(made(root))
    assert series(record, "in", "a", "gained")[1:] == [6] * 4
    assert series(record, "in", "ab", "gained")[1:] == [11] * 4
    assert series(record, "a", "total")[1:] == [7] * 4


DOUBLER = """\
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real, String

class Doubler(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.into, self.factor, self.twice, self.word = 0.0, 2.0, 0.0, ""
        self.register_variable(String("word", causality=Fmi2Causality.parameter,
                                      variability=Fmi2Variability.tunable))
        self.register_variable(Real("into", causality=Fmi2Causality.input))
        self.register_variable(Real("factor", causality=Fmi2Causality.parameter,
                                    variability=Fmi2Variability.tunable))
        self.register_variable(Real("twice", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.twice = self.factor * self.into + current_time + len(self.word)
        return True
"""


def test_an_fmu_of_pythonfmu_stands_beside_one_in_c(
    made: Callable[..., Path], tmp_path: Path
) -> None:
    (tmp_path / "doubler.py").write_text(DOUBLER)
    command = [sys.executable, "-m", "pythonfmu", "build", "-f", "doubler.py"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    python = system(
        "python", [part("p", connectors(into="input half"), source="doubler.fmu")],
        [link(".into", "p.into"), link("p.twice", ".out")],
        connectors(into="input ki", out="output"), bindings(bound(parameters({"p.factor": "4"}))),
    )  # fmt: skip
    root = system(
        "s", [part("a", connectors(gained="output m")), python, part("b")],
        [link("python.into", "a.gained", linear(2)), link("b.a", "python.out")], "",
        bindings(bound(parameters({"a.c": "1"})),
                 bound(parameters({"x": "'two words'"}), mapping(entry("x", "python.p.word")))),
    )  # fmt: skip
    doubler = (tmp_path / "Doubler.fmu").read_bytes()
    record = run(made(root, doubler__fmu=doubler))
    # From m to ki, twice as much, and to half: (2 x - 3) / 0.5 of x in m.
    into = [(2 * x - 3) / 0.5 for x in (0, 1, 1, 1)]
    twice = [0.0, *(4 * x + t + 9 for x, t in zip(into, (0, 0.25, 0.5, 0.75), strict=True))]
    assert series(record, "python", "p", "twice") == twice
    assert series(record, "b", "integral") == integral(twice[:-1])


@pytest.mark.parametrize("master", ["native", "python"])
def test_fmi_2_stands_beside_fmi_3(
    master: str, made: Callable[..., Path], stranger: Stranger
) -> None:
    """An alias of FMI 3 is a name for a connector, too (Connectors)."""
    three = block(stranger, 3, {"a": "ki"}, aliases={"a": "drive", "c": "bias"})
    other = block(stranger, 3, {"gained": "half"})
    root = system(
        "s",
        [part("two", source="metres.fmu"), part("three", source="three.fmu"),
         part("other", connectors(gained="output"), source="other.fmu")],
        [link("two.gained", "three.drive"), link("other.a", "three.gained"),
         link("two.a", "other.gained")], "",
        bindings(bound(parameters({"two.c": "1024", "three.bias": "0.5", "other.k": "2"}))),
    )  # fmt: skip
    path = made(root, three__fmu=three, other__fmu=other)
    record = sblcosim.run(path, master=master).record
    two, third, last = [0.0], [0.0], [0.0]
    for _ in range(4):
        two, third, last = (
            [*two, (last[-1] * 0.5 + 3) + 1024],
            [*third, two[-1] / 1024 + 0.5],
            [*last, 2 * third[-1]],
        )
    assert series(record, "two", "gained") == two
    assert series(record, "three", "gained") == third
    assert series(record, "other", "gained") == last


# --- What else the standard says ------------------------------------------------------------------


@pytest.mark.parametrize(("suppressed", "value"), [("false", 2 * 5 * 1024 + 1), ("true", 11)])
def test_a_value_is_transformed_after_its_unit(
    suppressed: str, value: float, made: Callable[..., Path]
) -> None:
    """It is "already converted to the target unit" then (LinearTransformation)."""
    own = bindings(bound(parameters({"c": "5"})))
    root = system(
        "s", [part("a", connectors(gained="output ki"), own), part("b", source="metres.fmu")],
        [link("b.a", "a.gained", linear(2, 1), suppressUnitConversion=suppressed)],
    )  # fmt: skip
    arrived = [1.0, *[value] * 3]
    assert series(run(made(root)), "b", "integral") == integral(arrived)


def test_a_system_connector_without_a_unit_passes_that_of_the_value(
    made: Callable[..., Path],
) -> None:
    """The unit of what it is connected to is used (Real)."""
    one = system(
        "one", [part("a", connectors(gained="output ki"))], [link("a.gained", ".out")],
        connectors(out="output"), bindings(bound(parameters({"a.c": "2"}))),
    )  # fmt: skip
    other = system(
        "other", [part("b", source="metres.fmu")], [link(".into", "b.a"), link(".set", "b.c")],
        connectors(into="input", set="parameter"),
    )  # fmt: skip
    root = system(
        "s", [one, other], [link("one.out", "other.into")], "",
        bindings(bound(parameters({"other.set": "3 ki"}))),
    )  # fmt: skip
    record = run(made(root))
    assert series(record, "other", "b", "integral") == integral([0, *[2048] * 3])
    assert series(record, "other", "b", "gained")[1:] == [3072, *[2048 + 3072] * 3]


def test_a_value_passes_straight_through_a_system(made: Callable[..., Path]) -> None:
    root = system(
        "s",
        [part("a", source="metres.fmu"), through("through", "input ki", "output half"),
         part("b", source="metres.fmu")],
        [link("a.gained", "through.into"), link("through.out", "b.a")], "",
        bindings(bound(parameters({"a.c": "5"}))),
    )  # fmt: skip
    assert series(run(made(root)), "b", "integral") == integral([0, 5, 5, 5])


@pytest.mark.parametrize("into", ["input", "parameter", "structuralParameter", "unspecified"])
@pytest.mark.parametrize("out", ["output", "local", "unspecified"])
@one_in(3)
def test_kinds_give_or_take(into: str, out: str, made: Callable[..., Path]) -> None:
    """The table of Allowed Connections; an unspecified kind is what it has to be."""
    turned = (len(into) + len(out)) % 2
    ends = [[(".set", "p.c"), (".go", "p.a"), ("p.total", ".shown")],
            [("a.a", "in.shown"), ("a.gained", "in.go")]]  # fmt: skip
    inside, outside = (
        [link(*(pair[::-1] if turned else pair)) for pair in level] for level in ends
    )
    kinds = connectors(set=into, go="unspecified" if into == "unspecified" else "input", shown=out)
    inner = system("in", [part("p")], inside, kinds, bindings(bound(parameters({"set": "2"}))))
    root = system(
        "s", [inner, part("a")], outside, "", bindings(bound(parameters({"a.c": "1"})))
    )  # fmt: skip
    record = run(made(root))
    total, gained = [0.0], [0.0]  # p: (a + 2) + 0, a: a + 1
    for _ in range(4):
        total, gained = [*total, gained[-1] + 2], [*gained, total[-1] + 1]
    assert series(record, "in", "p", "total") == total
    assert series(record, "a", "gained") == gained


def test_a_name_of_several_variables_is_that_of_all(made: Callable[..., Path]) -> None:
    """A value is applied to all that have its hierarchical name (ParameterBindings)."""
    inner = system("x", [part("y"), part("y.z")], [link("y.gained", "y.z.a")])
    values = parameters({"x.y.c": "2", "x.y.z.k": "3", "x.y.z.d": "1"})
    root = system("s", [inner, part("x.y"), part("x.y.z")], [], bindings(bound(values)))
    record = run(made(root))
    words = {name: float(values[-1]) for name, values in record.values.items()}
    gained = sorted(v for name, v in words.items() if name.endswith(".gained"))
    total = sorted(v for name, v in words.items() if name.endswith(".total"))
    assert gained == [0, 2, 2, 6]
    assert total == [1, 2, 2, 7]


@pytest.mark.parametrize("names", [("x.p.c", "x.set"), ("x.set", "x.p.c")])
def test_what_is_connected_has_the_value_of_the_other_end(
    names: tuple[str, str], made: Callable[..., Path]
) -> None:
    """A value of the variable itself counts where the connector has none."""
    inner = system("x", [part("p")], [link(".set", "p.c"), link("p.d", ".free")],
                   connectors(set="parameter", free="parameter"))  # fmt: skip
    values = {"x.p.c": "5", "x.set": "3"}
    own = [bound(parameters({name: values[name]})) for name in names]
    root = system("s", [inner], [], bindings(*own, bound(parameters({"x.p.d": "8"}))))
    record = run(made(root))
    assert series(record, "x", "p", "gained")[1:] == [3] * 4
    assert series(record, "x", "p", "total")[1:] == [3 + 8] * 4


def test_arrays_and_their_elements_pass_systems(
    made: Callable[..., Path], stranger: Stranger
) -> None:
    two, three = (stranger(fmi).read_bytes() for fmi in (2, 3))  # offset, u and y are in m
    inner = system(
        "in", [part("e", source="two.fmu"), part("w", source="three.fmu")],
        [link("e.u[2]", ".one"), link(".far", "e.y[1,1]"), link(".all", "w.u")],
        connectors(one="input ki", far="output half", all="input ki"),
        bindings(bound(parameters({"w.offset": "1 2"}))),
    )  # fmt: skip
    root = system(
        "s", [inner, part("a", source="metres.fmu")],
        [link("in.far", "a.a"), link("a.gained", "in.one"), link("in.all", ".all")],
        connectors(all="input m"),
        bindings(bound(parameters({"in.e.offset[1]": "2 ki"})),
                 bound(parameters({"p": "0.5 1 ki"}), mapping(entry("p", "all", linear(2))))),
    )  # fmt: skip
    record = run(made(root, two__fmu=two, three__fmu=three))
    assert record.values["in/w.y"][-1].tolist() == [[1024 + 1, 1024], [2048 + 2, 2048]]
    far = [0.0, *[2048.0] * 4]
    assert record.values["in/e.y"][:, 0, 0].tolist() == far
    gained = [0.0, *far[:-1]]
    assert series(record, "a", "gained") == gained
    assert record.values["in/e.y"][:, 1, 1].tolist() == integral(gained[:-1])


def test_components_of_one_name_in_two_systems_are_two(made: Callable[..., Path]) -> None:
    def inner(name: str) -> str:
        return system(name, [part("a"), part("b")], [link("a.gained", "b.a")])

    values = parameters({"x.a.c": "1", "y.a.c": "2", "a.c": "4", "y.b.c": "8"})
    root = system("s", [inner("x"), inner("y"), part("a")], [], bindings(bound(values)))
    record = run(made(root))
    assert series(record, "x", "b", "gained") == [0, 0, 1, 1, 1]
    assert series(record, "y", "b", "gained") == [0, 8, 10, 10, 10]
    assert series(record, "a", "gained") == [0, 4, 4, 4, 4]


def test_a_value_of_a_connector_that_leads_nowhere_is_called_that(
    made: Callable[..., Path],
) -> None:
    inner = system("in", [part("a")], [], connectors(free="input", f="parameter km"))
    root = system(
        "s", [inner], [], connectors(idle="input"),
        bindings(bound(parameters({"idle": "1", "in.free": "2", "in.f": "3 m"}))),
    )  # fmt: skip
    with pytest.warns(ConfigurationWarning) as caught:
        sblcosim.run(made(root))
    said = [str(each.message) for each in caught]
    assert len(said) == 3
    assert all(re.search("'(idle|in.free|in.f)'", words) for words in said)
    assert not [words for words in said if "no such" in words]
    with pytest.warns(ConfigurationWarning, match=r"in\.fre'.*did you mean 'in\.free'"):
        sblcosim.run(made(root.replace('"in.free"', '"in.fre"')))


# --- Times and names ------------------------------------------------------------------------------


def test_times_that_the_package_leaves_open_are_those_of_its_fmus(
    made: Callable[..., Path], stranger: Stranger
) -> None:
    """The longest stop time; each its step, and the smallest where there is none."""
    files = {
        "one__fmu": block(stranger, 2, stopTime=1.5, stepSize=0.5),
        "two__fmu": block(stranger, 3, stopTime=3, stepSize=0.25),
        "three__fmu": block(stranger, 2, stopTime=2),
    }
    inner = system(
        "in", [part("two", source="two.fmu"), part("none")],
        [link("none.a", ".go"), link(".now", "two.now")], connectors(go="input", now="output"),
    )  # fmt: skip
    root = system(
        "s", [part("one", source="one.fmu"), inner, part("three", source="three.fmu")],
        [link("one.now", "in.go"), link("three.a", "in.now"), link("one.a", "three.integral")],
    )  # fmt: skip
    record = run(made(root, "", **files))
    assert record.time_ns.tolist() == [250_000_000 * i for i in range(13)]
    steps = {re.findall("[a-z]+", name)[-1]: ns for name, ns in record.intervals_ns.items()}
    assert steps == {name: 500_000_000 if name == "one" else 250_000_000 for name in steps}
    assert steps.keys() == {"one", "two", "three", "none"}
    quarters = [0.25 * i for i in range(13)]
    halves = [0.5 * (i // 2) for i in range(13)]  # what the slow one shows
    assert series(record, "one", "now") == halves
    assert series(record, "in", "two", "now") == quarters
    assert series(record, "in", "none", "integral") == integral(halves[:-1])
    three = integral(quarters[:-1])
    assert series(record, "three", "integral") == three
    slow = integral(three[:-1:2], 0.5)
    assert series(record, "one", "integral") == [slow[i // 2] for i in range(13)]


def test_steps_and_parameters_of_one_name_are_each_its_own(
    made: Callable[..., Path], stranger: Stranger
) -> None:
    files = {
        "slow__fmu": block(stranger, 2, stepSize=0.5),
        "fast__fmu": block(stranger, 3, stepSize=0.25),
    }
    one = bindings(bound(parameters({"k": "2", "c": "1"})))
    other = bindings(bound(parameters({"k": "4", "c": "3"})))
    root = system(
        "s", [part("slow", one, source="slow.fmu"), part("fast", other, source="fast.fmu")],
        [link("slow.gained", "fast.a"), link("fast.gained", "slow.a")], "",
        bindings(bound(parameters({"fast.d": "5", "slow.d": "6"}))),
    )  # fmt: skip
    record = run(made(root, tag("ssd:DefaultExperiment", stopTime=2), **files))
    slow, fast = [0.0], [0.0]
    for i in range(8):
        # The slow one took its input at the last even instant, and shows the result at the next.
        ended = 2 * fast[i - 1] + 1 if i % 2 else slow[i]
        slow, fast = [*slow, ended], [*fast, 4 * slow[i] + 3]
    assert series(record, "fast", "gained") == fast
    assert series(record, "slow", "gained") == slow


# --- What is refused ------------------------------------------------------------------------------

AB = [part("a", connectors(gained="output m", a="input m")), part("b")]
INNER = system("in", AB, [], connectors(into="input", out="output", more="input"))
WRONG: dict[str, tuple[str, tuple[str, ...]]] = {
    "two outputs": (system("s", AB, [link("a.gained", "b.gained")]), ("a.gained", "b.gained")),
    "two inputs": (system("s", AB, [link("a.a", "b.a")]), ("a.a", "b.a")),
    "an output that would be an input": (
        system("s", AB, [link(".x", "a.gained")], connectors(x="input")), ("x", "a.gained"),
    ),
    "an input that would be an output": (
        system("s", AB, [link(".x", "b.a")], connectors(x="output")), ("x", "b.a"),
    ),
    "two sources": (
        system("s", AB, [link("a.gained", "b.a"), link("b.a", "a.total")]), ("b.a", "one source"),
    ),
    "two sources of a system's input": (
        system("s", [system("in", AB, [link(".into", "b.a")], connectors(into="input")), part("c")],
               [link("c.gained", "in.into"), link("c.total", "in.into")]),
        ("in.into", "one source"),
    ),
    "another quantity at a system's connector": (
        system("s", [*AB], [link(".x", "a.a")], connectors(x="input kg"),
               bindings(bound(parameters({"x": "1"})))),
        ("x", "a.a", "kg", "'m'"),
    ),
    "another quantity within": (
        system("s", [system("in", AB, [link(".into", "a.a")], connectors(into="input kg")),
                     part("c")], [link("c.gained", "in.into")]),
        ("into", "a.a", "kg", "'m'"),
    ),
    "a value in another quantity than the connector": (
        system("s", [part("a", connectors(k="parameter m"),
                          bindings(bound(parameters({"k": "1 kg"}))))]),
        ("a.k", "'?m\\b", "quantity"),
    ),
    "two values mapped to one": (
        system("s", AB, [], bindings(bound(parameters({"p": "1", "q": "2"}),
                                           mapping(entry("p", "a.k"), entry("q", "a.k"))))),
        ("a.k",),
    ),
    "a mapping that is not there": (
        system("s", AB, [], bindings(bound(parameters({"p": "1"}), "none.ssm"))), ("none.ssm",),
    ),
    "a transformation of other kind": (
        system("s", AB, [], bindings(bound(parameters({"p": "1"}), mapping(
            entry("p", "a.k", tag("ssc:BooleanMappingTransformation")))))),
        ("BooleanMappingTransformation",),
    ),
    "connectors in a ring": (
        system("s", [through("x"), through("y"), part("a")],
               [link("x.out", "y.into"), link("y.out", "x.into"), link("x.out", "a.a")]),
        ("into",),
    ),
    "one element of an array": (
        system("s", AB, [link("a.gained", "b.a", startIndices="1")]), ("startIndices",),
    ),
    "a dictionary within": (
        system("s", [system("in", [
            tag("ssd:SignalDictionaryReference", name="d", dictionary="x")])]),
        ("SignalDictionaryReference", "'d'"),
    ),
    "Model Exchange within": (
        system("s", [system("in", [part("a", implementation="ModelExchange")])]),
        ("in.a", "ModelExchange"),
    ),
    "one name twice within": (
        system("s", [system("in", [part("a"), part("a")])]), ("unique", r"\ba\b"),
    ),
    "an unknown element within": (
        system("s", [system("in", AB, [link("c.gained", "b.a")]), part("c")]), ("'c'",),
    ),
    "an unknown connector of a system": (
        system("s", [INNER, part("c")], [link("c.gained", "in.intoo")]), ("intoo", "into"),
    ),
    "an element of an element": (
        system("s", [INNER, part("c")], [link("c.gained", "in.a.a")]), ("in.a",),
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_what_is_wrong_is_refused_by_name(what: str, made: Callable[..., Path]) -> None:
    root, named = WRONG[what]
    path = made(root)
    done = CliRunner().invoke(
        app, ["run", str(path), "--no-figures", "--out", str(path.parent / "out")]
    )
    assert (done.exit_code, done.stdout) == (2, "")
    wrong = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert len(wrong) == 1, done.stderr
    assert wrong[0].startswith(f"error: {path}: ")
    for words in named:
        assert re.search(words, wrong[0]), wrong[0]
