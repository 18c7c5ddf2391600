"""A hundred random systems, nested and flat, equal what they are when flattened by hand.

A case is named by its number. All numbers are sums of few powers of two, which is looked at, so
that neither the order of additions nor that of conversions has an effect on a bit.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

import made_packages as ssp
import numpy as np
import pytest
import sblcosim

LENGTHS = {name: ssp.UNITS[name] for name in ("m", "ki", "half", "quarter", "four")}
QUICK, ALL = 10, 100
BITS = 40
"""Of a number at most."""
PARAMETERS, INPUTS, OUTPUTS = ("k", "c", "d"), ("a", "b"), ("gained", "total", "integral")
Number = Fraction
NONE, ONE = Number(0), Number(1)
Path_ = tuple[str, ...]


@dataclass(frozen=True)
class Through:
    """What becomes of a value: factor x + offset."""

    factor: Number = ONE
    offset: Number = NONE

    def then(self, other: Through) -> Through:
        """This first."""
        return Through(self.factor * other.factor, self.offset * other.factor + other.offset)

    def of(self, value: Number) -> Number:
        return self.factor * value + self.offset


def converted(one: str, other: str) -> Through:
    """From one unit to another; nothing where one of them is missing."""
    if not (one and other):
        return Through()
    (f, o), (g, p) = ((Number(LENGTHS[u].get("factor", 1)), Number(LENGTHS[u].get("offset", 0)))
                      for u in (one, other))  # fmt: skip
    return Through(f / g, (o - p) / g)


@dataclass
class Element:
    """A component, or a system with elements in it."""

    path: Path_
    elements: list[Element] = field(default_factory=list)
    connectors: dict[str, str] = field(default_factory=dict)
    passed: dict[str, str] = field(default_factory=dict)
    links: list[str] = field(default_factory=list)
    bindings: list[str] = field(default_factory=list)
    fmu: str = ""

    def unit(self, name: str) -> str:
        """Its own, or that of what a connector without one has been given."""
        return self.connectors[name].partition(" ")[2] or self.passed.get(name, "")


@dataclass
class Flat:
    """The flattened system: what each component has, and where its inputs come from."""

    values: dict[tuple[Path_, str], Number] = field(default_factory=dict)
    sources: dict[tuple[Path_, str], tuple[Path_, str, Through]] = field(default_factory=dict)


class Maker:
    """Makes one system, and its flattened form beside."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.flat = Flat()
        self.files: dict[str, str] = {}
        self.units = self.random.random() < 0.85
        self.fmus: dict[str, tuple[int, dict[str, str], float]] = {}
        self.steps = {0.25} if self.random.random() < 0.7 else {0.25, 0.5}
        self.root = Element(())
        self._grow(self.root, self.random.choice([0, 1, 2, 3]))
        self.parts = list(self._below(self.root))
        self.shared: dict[tuple[Path_, Path_, str], tuple[str, Through]] = {}
        for each in self.parts:
            for name in INPUTS:
                self._source(each, name)
            for name in (*PARAMETERS, *INPUTS):
                self._value(each, name)
        self._outside()

    def some(self, share: float) -> bool:
        return self.random.random() < share

    def number(self) -> Number:
        return Number(self.random.choice([0, 1, 2, 3, 5, -1, -2, 0.5, 0.25, 1.5]))

    def unit(self, share: float = 0.9) -> str:
        return self.random.choice(list(LENGTHS)) if self.units and self.some(share) else ""

    # --- Elements ---

    def _grow(self, inside: Element, deep: int) -> None:
        for i in range(self.random.choice([1, 2, 3]) + (not deep)):
            name = f"p{i}"
            self._component(inside, name)
        for i in range(self.random.choice([1, 2]) if deep else 0):
            below = Element((*inside.path, f"s{i}"))
            inside.elements.append(below)
            self._grow(below, deep - 1)
        self.random.shuffle(inside.elements)

    def _component(self, inside: Element, name: str) -> None:
        made = Element((*inside.path, name), fmu=f"f{len(self.fmus)}")
        own = {v: self.unit(0.5) for v in (*PARAMETERS, *INPUTS, *OUTPUTS)}
        seconds = self.random.choice(sorted(self.steps)) if self.fmus else 0.25
        self.fmus[made.fmu] = (self.random.choice([2, 3]), own, seconds)
        for v, unit in own.items():
            kind = "parameter" if v in PARAMETERS else "input" if v in INPUTS else "output"
            said = self.unit(0.5)
            made.connectors[v] = f"{kind} {said or unit}" if said or unit else kind
        inside.elements.append(made)

    def _below(self, inside: Element) -> Iterator[Element]:
        for each in inside.elements:
            if each.fmu:
                yield each
            else:
                yield from self._below(each)

    def _at(self, path: Path_) -> Element:
        found = self.root
        for i in range(len(path)):
            (found,) = (e for e in found.elements if e.path == path[: i + 1])
        return found

    # --- Connections ---

    def _source(self, target: Element, name: str) -> None:
        kind = self.random.choices(["output", "system", "none"], [6, 2, 2])[0]
        if kind == "output":
            source = self.random.choice(self.parts)
            output = self.random.choice(OUTPUTS)
            through, at, connector = Through(), source, output
            common = _common(source.path[:-1], target.path[:-1])
            while len(at.path) - 1 > len(common):
                at, connector, own = self._outwards(at, connector)
                through = through.then(own)
            through = through.then(self._inwards(common, at, connector, target, name))
            self.flat.sources[target.path, name] = (source.path, output, through)
        elif kind == "system":
            level = self.random.randrange(len(target.path))
            self._given(target, name, self.random.choice(["input", "parameter"]), level)

    def _outwards(self, at: Element, connector: str) -> tuple[Element, str, Through]:
        """Through a connector of the system around, perhaps one that is there."""
        around = self._at(at.path[:-1])
        new, through = self._through(around, at, connector, around, "output")
        return around, new, through

    def _through(
        self, around: Element, at: Element, connector: str, system_: Element, kind: str
    ) -> tuple[str, Through]:
        """A connector of a system that has something from there, perhaps one that it has."""
        key = (system_.path, at.path, connector)
        if key not in self.shared or self.some(0.5):
            new = f"{kind[0]}{len(system_.connectors)}"
            bare = self.some(0.15)
            system_.connectors[new] = f"{kind} {'' if bare else self.unit(1)}".strip()
            if bare:
                system_.passed[new] = at.unit(connector)
            self.shared[key] = (new, self._link(around, at, connector, system_, new, bare))
        return self.shared[key]

    def _inwards(
        self, common: Path_, at: Element, connector: str, target: Element, name: str
    ) -> Through:
        """From an element of a system, or that system itself, down to the target."""
        through = Through()
        for size in range(len(common) + 1, len(target.path)):
            into = self._at(target.path[:size])
            around = self._at(into.path[:-1])
            new, own = self._through(around, at, connector, into, self._kind)
            through = through.then(own)
            at, connector = into, new
        return through.then(self._link(self._at(target.path[:-1]), at, connector, target, name))

    _kind = "input"

    def _link(
        self, around: Element, one: Element, x: str, other: Element, y: str, plain: bool = False
    ) -> Through:
        """A connection in a system, in any direction of writing; plain: of what is connected."""
        suppressed, transformed = (not plain and self.some(share) for share in (0.2, 0.25))
        through = Through() if suppressed else converted(one.unit(x), other.unit(y))
        inside = []
        if transformed:
            own = Through(Number(self.random.choice([2, 0.5, 1, -1])), self.number())
            inside.append(ssp.linear(float(own.factor), float(own.offset)))
            through = through.then(own)
        ends = [
            f".{end}" if e is around else f"{e.path[-1]}.{end}" for e, end in ((one, x), (other, y))
        ]
        if self.some(0.5):
            ends.reverse()
        more = {"suppressUnitConversion": "true"} if suppressed else {}
        around.links.append(ssp.link(*ends, *inside, **more))
        return through

    # --- Values ---

    def _value(self, each: Element, name: str) -> None:
        """Bindings at any levels; the highest and last counts."""
        if self.some(0.3) or (each.path, name) in self.flat.values:
            return
        if name in PARAMETERS and self.some(0.3):
            self._given(each, name, "parameter", self.random.randrange(len(each.path)))
            return
        levels = sorted(self.random.choices(range(len(each.path) + 1), k=2), reverse=True)
        for level in levels:
            owner = self._at(each.path[:level])
            words = ".".join((*each.path[level:], name))
            number = abs(self.number()) if name == "k" else self.number()
            arrived = self._bind(owner, words, each.unit(name), number, self.unit(0.6))
            self.flat.values[each.path, name] = arrived

    def _given(self, each: Element, name: str, kind: str, level: int) -> None:
        """By a connector of a system around, to which a value is bound."""
        owner = self._at(each.path[:level])
        new = f"v{len(owner.connectors)}"
        bare, said = self.some(0.15), self.unit(0.6)
        owner.connectors[new] = f"{kind} {'' if bare else self.unit(1)}".strip()
        if bare:
            owner.passed[new] = said
        self._kind = kind
        through = self._inwards(owner.path, owner, new, each, name)
        self._kind = "input"
        above = self._at(owner.path[: self.random.randrange(level + 1)])
        words = ".".join((*owner.path[len(above.path) :], new))
        value = self._bind(above, words, owner.unit(new), self.number(), said, plain=bare)
        self.flat.values[each.path, name] = through.of(value)
        if self.some(0.3):  # one of its own has no effect
            level = self.random.randrange(len(each.path) + 1)
            words = ".".join((*each.path[level:], name))
            self._bind(self._at(each.path[:level]), words, "", self.number(), "")

    def _bind(
        self, owner: Element, words: str, unit: str, value: Number, said: str, plain: bool = False
    ) -> Number:
        """A binding of one value; what arrives, in a unit."""
        through = converted(said, unit)
        prefix, mapped = None, None
        if self.some(0.3):
            prefix = words[: self.random.randrange(len(words))]
            words = words[len(prefix) :]
        if not plain and self.some(0.3):
            own = Through(Number(self.random.choice([2, 0.5, 1])), abs(self.number()))
            suppressed = self.some(0.3)
            through = (Through() if suppressed else through).then(own)
            more = {"suppressUnitConversion": "true"} if suppressed else {}
            transformation = [ssp.linear(float(own.factor), float(own.offset))]
            mapped = (f"{prefix or ''}{words}-", (prefix or "") + words, transformation, more)
            words += "-"
        given = {words: f"{float(value)} {said}".strip(), f"{words}-none": "7"}
        alone, apart = self.some(0.3), self.some(0.3)
        values = ssp.parameters(given, LENGTHS, alone=alone)
        if alone:
            values = self._file(values, "ssv")
        entries = None
        if mapped is not None:
            source, target, inside, more = mapped
            entries = ssp.mapping(ssp.entry(source, target, *inside, **more), alone=apart)
            entries = self._file(entries, "ssm") if apart else entries
        owner.bindings.append(ssp.bound(values, entries, **({"prefix": prefix} if prefix else {})))
        return through.of(value)

    def _file(self, content: str, end: str) -> str:
        name = f"x{len(self.files)}"
        self.files[f"{name}__{end}"] = content
        return f"{name}.{end}"

    def _outside(self) -> None:
        """Outputs of the system, which have no effect."""
        for each in self.random.choices(self.parts, k=2):
            if len(each.path) == 1:
                new = f"z{len(self.root.connectors)}"
                self.root.connectors[new] = f"output {self.unit(1)}".strip()
                self._link(self.root, each, "total", self.root, new)

    # --- What is written, and what it must give ---

    def description(self) -> str:
        if len(self.steps) == 1:
            after = ssp.step(0.25) + ssp.tag("ssd:DefaultExperiment", startTime=0.5, stopTime=2)
        else:
            after = ssp.tag("ssd:DefaultExperiment", startTime=0.5, stopTime=2)
        return ssp.described(self._written(self.root), after, LENGTHS)

    def _written(self, each: Element) -> str:
        own = dict(each.connectors)
        name = each.path[-1] if each.path else "root"
        before = [ssp.connectors(**own)] if own else []
        if each.bindings:
            before.append(ssp.bindings(*each.bindings))
        if each.fmu:
            _, units, _ = self.fmus[each.fmu]
            said = {v: words for v, words in own.items() if words.partition(" ")[2] != units[v]}
            said |= {v: own[v].partition(" ")[0] for v in own if v not in said and self.some(0.3)}
            head = [ssp.connectors(**said)] if said else []
            return ssp.part(name, *head, *before[1:], source=f"{each.fmu}.fmu")
        inside = [self._written(below) for below in each.elements]
        self.random.shuffle(each.links)
        return ssp.system(name, inside, each.links, *before)

    def expected(self, kind: type) -> Mapping[tuple[Path_, str], list]:
        """All outputs at all instants, in a type of number: `float` by NumPy, or `Fraction`."""
        paths = [each.path for each in self.parts]
        rows = {path: i for i, path in enumerate(paths)}
        n = len(paths)

        def array(name: str, default: int) -> np.ndarray:
            given = [self.flat.values.get((path, name), Number(default)) for path in paths]
            return np.array([kind(x) for x in given], object if kind is Number else float)

        k, c, d = array("k", 1), array("c", 0), array("d", 0)
        u = np.stack([array("a", 0), array("b", 0)])
        F, g, driven = np.zeros((2, n, 3, n), u.dtype), u.copy(), np.zeros((2, n), bool)
        for (path, name), (source, output, through) in self.flat.sources.items():
            i, j = INPUTS.index(name), rows[path]
            F[i, j, OUTPUTS.index(output), rows[source]] = kind(through.factor)
            g[i, j], driven[i, j] = kind(through.offset), True
        y = np.zeros((3, n), u.dtype)
        steps = np.array([self.fmus[each.fmu][2] for each in self.parts])
        if len(self.steps) == 1:
            steps[:] = 0.25
        kept = [y]
        pending = y.copy()
        for i in range(6):
            shown = kept[-1]
            due = (0.25 * i) % steps == 0
            now = np.where(driven, (F * shown).sum(axis=(2, 3)) + g, g)
            u = np.where(due, now, u)
            h = np.array([kind(x) for x in steps], u.dtype)
            gained = k * u[0] + c
            stepped = np.stack([gained, gained + (k * u[1] + d), pending[2] + h * u[0]])
            pending = np.where(due, stepped, pending)
            ended = (0.25 * (i + 1)) % steps == 0
            kept.append(np.where(ended, pending, shown))
        return {
            (path, output): [row[o, j] for row in kept]
            for j, path in enumerate(paths)
            for o, output in enumerate(OUTPUTS)
        }


def _common(one: Path_, other: Path_) -> Path_:
    same = 0
    while same < min(len(one), len(other)) and one[same] == other[same]:
        same += 1
    return one[:same]


def exact(value: Number) -> bool:
    """Whether a number has few bits, so that sums of such numbers are exact."""
    size = max(abs(value.numerator).bit_length(), value.denominator.bit_length())
    return not value.denominator & (value.denominator - 1) and size <= BITS


def case(number: int) -> tuple[Maker, Mapping[tuple[Path_, str], list]]:
    """The first of the number's systems that is computed without rounding."""
    for again in range(100):
        made = Maker(1000 * number + again)
        if any(v < 0 for (_, name), v in made.flat.values.items() if name == "k"):
            continue  # which a block refuses
        found = made.expected(Number)
        throughs = [through for _, _, through in made.flat.sources.values()]
        numbers = [v for t in throughs for v in (t.factor, t.offset)]
        if all(map(exact, [*numbers, *(v for row in found.values() for v in row)])):
            return made, found
    raise AssertionError(number)


@pytest.mark.filterwarnings("ignore::sblcosim.errors.ConfigurationWarning")
@pytest.mark.parametrize(
    "number",
    [pytest.param(n, marks=[pytest.mark.slow] if n >= QUICK else []) for n in range(ALL)],
)
def test_a_random_system_equals_its_flattened_form(
    number: int, stranger: Callable[[int], Path], tmp_path: Path
) -> None:
    made, found = case(number)
    files = {
        f"{name}__fmu": ssp.block(stranger, fmi, {v: u for v, u in units.items() if u},
                              stepSize=seconds)
        for name, (fmi, units, seconds) in made.fmus.items()
    }  # fmt: skip
    path = ssp.packed(tmp_path / "random.ssp", made.description(), **files, **made.files)
    record = sblcosim.run(path, master=["native", "python"][number % 2]).record
    by_numpy = made.expected(float)
    for (owner, output), values in found.items():
        assert [float(v) for v in values] == by_numpy[owner, output]
        assert ssp.series(record, *owner, output) == by_numpy[owner, output], (owner, output)
