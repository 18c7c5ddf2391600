"""Straight-line C with loops where many values are computed alike, for small processors.

A value that is used once belongs to the expression that uses it, so that a function becomes a list
of expressions. Those of one shape that do not depend on each other, such as the elements of a
covariance after a correction, become one loop over a table of the places of their operands. Order
and operations of each expression stay, and so do the bits.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from .folding import Folded
from .straight_line import COSTLY

_NAME = re.compile(r"\b[am]\d+\b")
_PLACE = re.compile(r"(\w+)\[(\d+)\]")
_ARRAY = "v"
"""Array of the values that loops compute or use."""
MANY = 2000
"""Fewest values of a function with loops: they take longer, and the size of others hardly matters.
"""
LEAST = 200
"""Least that a loop must save [B]. Of `coupled` on a Cortex-M7, 0 saves 3 kB more and costs a
twentieth more instructions; 1000 costs 18 kB and saves a sixth of the instructions."""
_FEWEST = 4
"""Fewest stores that become a loop."""
_OPERATION, _LOOP, _COLUMN = 4, 44, 10
"""Bytes of code on a Cortex-M: of an operation, a load or a store; of a loop; and of an operand
that a loop finds in its table. Estimates, which decide what becomes a loop."""


@dataclass
class _Tree:
    """An expression: a value with all values that only it needs.

    Attributes
    ----------
    root
        The value.
    nodes
        Its operations, each after its operands.
    leaves
        What these use besides each other, in order.
    level
        Length of the longest chain of expressions that it follows from.
    """

    root: str
    nodes: list[str] = field(default_factory=list)
    leaves: list[str] = field(default_factory=list)
    level: int = 0


class Rolled(Folded):
    """Values whose expressions become loops where they are alike."""

    def body(self, stores: Mapping[str, str], where: str) -> list[str]:
        wanted = set(stores.values())
        branches = self.branches(wanted)
        needed = [value for value in self.texts if value in branches]
        if where or len(needed) < MANY:
            return super().body(stores, where)
        trees = self._trees(needed, wanted)
        groups = [group for group in self._groups(trees, branches) if self._worth(group)]
        targets = {value: target for target, value in stores.items()}
        for group in groups:
            group.sort(key=lambda tree: _element(targets.get(tree.root, "")))
        plan = _Plan(self, branches, trees, groups, wanted)
        return _without_unused([*plan.lines(), *plan.writes(stores)])

    def _trees(self, needed: Sequence[str], wanted: set[str]) -> list[_Tree]:
        """The expressions of the needed values, by their level."""
        uses = Counter(operand for value in needed for operand in set(self.operands[value]))
        owner: dict[str, _Tree] = {}
        levels: dict[str, int] = {}
        operations = [value for value in needed if self.operands[value]]
        trees = [_Tree(v) for v in operations if uses[v] != 1 or v in wanted]
        owner = {tree.root: tree for tree in trees}
        for value in reversed(operations):
            for operand in self.operands[value]:
                if self.operands[operand]:
                    owner.setdefault(operand, owner[value])
        for value in operations:
            tree = owner[value]
            tree.nodes.append(value)
            tree.leaves += [
                it for it in self.operands[value]
                if owner.get(it) is not tree and it not in tree.leaves
            ]
        for tree in trees:
            tree.level = 1 + max((levels.get(leaf, 0) for leaf in tree.leaves), default=0)
            levels[tree.root] = tree.level
        return sorted(trees, key=lambda tree: tree.level)

    def _groups(
        self, trees: Iterable[_Tree], branches: Mapping[str, str]
    ) -> Iterator[list[_Tree]]:
        """Numbers that are computed alike, and do not depend on each other."""
        alike: dict[tuple[object, ...], list[_Tree]] = {}
        inside = set(branches.values()) - {""}
        for tree in trees:
            number = tree.root[0] == "a" and not any(branches[node] for node in tree.nodes)
            if number and not any(
                node in inside or self.texts[node].startswith(COSTLY) for node in tree.nodes
            ):
                alike.setdefault((tree.level, *self._shape(tree)), []).append(tree)
        yield from (group for group in alike.values() if len(group) > 1)

    def _shape(self, tree: _Tree) -> list[str]:
        """What two expressions have in common that differ only in places of their operands."""
        names = {node: f"n{i}" for i, node in enumerate(tree.nodes)}
        for leaf in tree.leaves:
            place = self.place(leaf)
            if leaf[0] == "m" or (place is None and not self.operands[leaf]):
                names[leaf] = self.texts[leaf] if not self.operands[leaf] else leaf
            else:
                kind = _ARRAY if place is None else place[0]
                names[leaf] = f"{kind} {tree.leaves.index(leaf)}"
        return [_NAME.sub(lambda match: names[match[0]], self.texts[node]) for node in tree.nodes]

    def place(self, value: str) -> tuple[str, int] | None:
        """Array and element of an argument."""
        match = None if self.operands[value] else _PLACE.fullmatch(self.texts[value])
        return None if match is None else (match[1], int(match[2]))

    def differ(self, values: Iterable[str]) -> bool:
        """Whether values differ: not if they are the same argument or the same number."""
        return len({value if self.operands[value] else self.texts[value] for value in values}) > 1

    def _worth(self, group: Sequence[_Tree]) -> bool:
        """Whether a loop is enough shorter to be worth its time."""
        one = len(group[0].nodes) + len(group[0].leaves) + 1
        varying = sum(self.differ(column) for column in _columns(group))
        loop = _LOOP + _OPERATION * one + varying * (_COLUMN + 2 * len(group))
        return loop + LEAST < _OPERATION * one * len(group)


def _columns(group: Sequence[_Tree]) -> Iterator[tuple[str, ...]]:
    """Each operand of expressions of one shape, in all of them."""
    return zip(*(tree.leaves for tree in group), strict=True)


def _without_unused(lines: Sequence[str]) -> list[str]:
    """Without arguments that loops find by themselves."""
    uses = Counter(name for line in lines for name in set(_NAME.findall(line)))
    argument = re.compile(r"\s*const real (a\d+) = (?:\w+\[\d+\]|r_set1\(\S+\));")
    return [
        line for line in lines
        if not ((match := argument.fullmatch(line)) and uses[match[1]] == 1)
    ]


def _element(target: str) -> int:
    """Element of a place in an array; for others a large number."""
    match = _PLACE.fullmatch(target)
    return int(match[2]) if match else 1 << 30


class _Plan:
    """Where values are while the statements run, and the statements.

    Parameters
    ----------
    groups
        Expressions that become loops.
    wanted
        Values that are needed in the end.
    """

    def __init__(
        self, values: Rolled, branches: Mapping[str, str], trees: Sequence[_Tree],
        groups: Sequence[Sequence[_Tree]], wanted: set[str],
    ) -> None:
        self.values, self.branches = values, branches
        rolled = {tree.root for group in groups for tree in group}
        self.items = [
            *groups, *([tree] for tree in trees if tree.root not in rolled)
        ]
        self.items.sort(key=lambda item: item[0].level)
        self.rolled = rolled
        self.size = 0
        self.slots = self._placed(wanted)

    def _placed(self, wanted: set[str]) -> dict[str, int]:
        """Elements of the array: of values that loops make, and of others that they look up."""
        last = self._last_uses(wanted)
        in_array = {
            leaf for item in self.items if item[0].root in self.rolled
            for column in _columns(item)
            if self.values.differ(column) for leaf in column if self.values.operands[leaf]
        }
        slots: dict[str, int] = {}
        free_at: list[int] = []  # for each element, the item from which on it is free
        for number, item in enumerate(self.items):
            roots = [t.root for t in item if t.root in self.rolled or t.root in in_array]
            if not roots:
                continue
            at = _room(free_at, len(roots), number)
            free_at += [0] * (at + len(roots) - len(free_at))
            until = max(last[root] for root in roots)
            free_at[at : at + len(roots)] = [until + 1] * len(roots)
            slots |= {root: at + i for i, root in enumerate(roots)}
        self.size = len(free_at)
        return slots

    def _last_uses(self, wanted: set[str]) -> dict[str, int]:
        """The last item that uses each expression; those in a branch are computed at its end."""
        item_of = {n: i for i, item in enumerate(self.items) for tree in item for n in tree.nodes}

        def runs_at(node: str) -> int:
            while self.branches[node]:
                node = self.branches[node]
            return item_of[node]

        last = {node: len(self.items) if node in wanted else item_of[node] for node in item_of}
        for item in self.items:
            for tree in item:
                for node in tree.nodes:
                    for operand in self.values.operands[node]:
                        if operand in last:
                            last[operand] = max(last[operand], runs_at(node))
        return last

    def lines(self) -> list[str]:
        """The statements."""
        order = [
            leaf for leaf in self.values.texts
            if leaf in self.branches and not self.values.operands[leaf]
        ]
        others, branches = {}, dict(self.branches)
        for item in self.items:
            root = item[0].root
            if root in self.rolled:
                order.append(root)
                others[root] = self._loop(item)
                continue
            order += item[0].nodes
            if root in self.slots:
                kept = f"{root} in the array"
                order.append(kept)
                others[kept], branches[kept] = f"{self._in_array(root)} = {root};", ""
        found = self.values.printed(order, branches, others)
        array = [f"real {_ARRAY}[{self.size}];"] if self.size else []
        return [*array, *(_NAME.sub(self._name, line) for line in found)]

    def _name(self, match: re.Match[str]) -> str:
        """A value in a statement."""
        return self._in_array(match[0]) if match[0] in self.rolled else match[0]

    def _in_array(self, value: str) -> str:
        return f"{_ARRAY}[{self.slots[value]}]"

    def _loop(self, group: Sequence[_Tree]) -> str:
        """A loop that computes expressions of one shape."""
        table: list[list[int]] = []
        first = group[0]
        names = {node: f"n{i}" for i, node in enumerate(first.nodes)}
        for column in _columns(group):
            names[column[0]] = self._operand(column, table)
        lines = [
            f"const {'real' if node[0] == 'a' else 'mask'} {names[node]} = "
            f"{_NAME.sub(lambda match: names[match[0]], self.values.texts[node])};"
            for node in first.nodes
        ]
        rows = ", ".join(f"{{{', '.join(map(str, row))}}}" for row in zip(*table, strict=True))
        kind = "uint8_t" if max((i for column in table for i in column), default=0) < 256 else (
            "uint16_t")
        declared = [f"static const {kind} at[{len(group)}][{len(table)}] = {{{rows}}};"]
        slot = self.slots[first.root]
        return "\n".join([
            "{",
            *(declared if table else []),
            f"for (int j = 0; j < {len(group)}; j++) {{",
            *(f"    {line}" for line in lines),
            f"    {_ARRAY}[{slot} + j] = {names[first.root]};",
            "}",
            "}",
        ])

    def _operand(self, column: Sequence[str], table: list[list[int]]) -> str:
        """An operand in a loop, given that of each expression; perhaps with a column of places."""
        if not self.values.differ(column):
            return self.values.texts[column[0]] if not self.values.operands[column[0]] else (
                column[0])
        places = [self.values.place(it) or (_ARRAY, self.slots[it]) for it in column]
        array, elements = places[0][0], [element for _, element in places]
        step = elements[1] - elements[0]
        if elements == [elements[0] + step * j for j in range(len(elements))]:
            return f"{array}[{elements[0]} + {step} * j]"
        table.append(elements)
        return f"{array}[at[j][{len(table) - 1}]]"

    def writes(self, stores: Mapping[str, str]) -> list[str]:
        """Statements that write values to their targets; neighbours in a loop."""
        runs: list[list[tuple[str, str]]] = []
        for target, value in sorted(stores.items(), key=lambda it: _element(it[0])):
            if runs and self._next(runs[-1][-1], (target, value)):
                runs[-1].append((target, value))
            else:
                runs.append([(target, value)])
        lines = []
        for run in runs:
            if len(run) < _FEWEST:
                lines += [f"{target} = {self._read(value)};" for target, value in run]
                continue
            array, element = _PLACE.fullmatch(run[0][0]).groups()  # type: ignore[union-attr]
            lines.append(f"for (int j = 0; j < {len(run)}; j++)")
            lines.append(f"    {array}[{element} + j] = "
                         f"{_ARRAY}[{self.slots[run[0][1]]} + j];")
        return lines

    def _read(self, value: str) -> str:
        return self._in_array(value) if value in self.rolled else value

    def _next(self, one: tuple[str, str], other: tuple[str, str]) -> bool:
        """Whether two stores are neighbours, in the array and where they go."""
        places = [_PLACE.fullmatch(target) for target, _ in (one, other)]
        values = [self.slots[value] if value in self.rolled else -9 for _, value in (one, other)]
        a, b = places
        return bool(
            a and b and a[1] == b[1] and int(b[2]) == int(a[2]) + 1 and values[0] >= 0
            and values[1] == values[0] + 1
        )


def _room(free_at: Sequence[int], count: int, number: int) -> int:
    """First of ``count`` elements in a row that are free for an item."""
    at = 0
    while True:
        taken = [i for i in range(at, min(at + count, len(free_at))) if free_at[i] > number]
        if not taken:
            return at
        at = taken[-1] + 1
