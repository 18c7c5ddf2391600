"""What compiled code reads: globals, their attributes, and the modules that it imports."""

from __future__ import annotations

import dis
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import CodeType

Chains = tuple[tuple[str, ...], ...]
"""Attributes that follow a name, such as ``(("part", "LIMIT"), ())``; ``()``: the name alone."""
_GLOBAL = {"LOAD_GLOBAL", "LOAD_NAME", "LOAD_FROM_DICT_OR_GLOBALS"}
_ATTRIBUTE = {"LOAD_ATTR", "LOAD_METHOD"}
_WHOLE = {"globals", "eval", "exec", "__globals__", "f_globals"}
_OWN = {"__name__", "__module__"}
"""Names of the module itself: code that also finds modules by name may read all of it."""
_BY_NAME = {"import_module", "__import__", "modules"}
_ASKS = {
    "__annotations__": "annotations", "get_annotations": "annotations", "annotation": "annotations",
    "get_type_hints": "annotations", "return_annotation": "annotations", "__doc__": "texts",
    "getdoc": "texts", "__dict__": "order", "vars": "order", "__subclasses__": "subclasses",
}  # fmt: skip
"""Names by which code reads things that otherwise do not affect a run."""
HELD = "from "
"""Prefix of the variable that stands for the module in ``from module import …``."""


@dataclass(frozen=True)
class Reads:
    """What code, including all nested code, reads.

    Attributes
    ----------
    globals
        Names that may be globals.
    chains
        Chains of attributes by the name of a variable: global, local or in a closure.
    imports
        Name, level, and the variable that stands for the module.
    named
        Texts that may be names of modules, if code finds modules by texts.
    is_whole
        Whether it may read all globals.
    """

    globals: frozenset[str]
    chains: Mapping[str, Chains]
    imports: frozenset[tuple[str, int, str]]
    named: frozenset[str]
    is_whole: bool


def asks(code: CodeType) -> set[str]:
    """Properties of classes and functions that code reads: keys of `_ASKS`."""
    texts = (text for text in code.co_consts if isinstance(text, str))
    return {_ASKS[name] for name in (*code.co_names, *texts) if name in _ASKS}


@lru_cache(1024)
def reads(code: CodeType) -> Reads:
    """Everything that code reads, wherever it is in it."""
    names: set[str] = set()
    chains: dict[str, set[tuple[str, ...]]] = {}
    imports: set[tuple[str, int, str]] = set()
    _collect(code, names, chains, imports)
    return Reads(
        frozenset(names), {k: tuple(sorted(v)) for k, v in chains.items()}, frozenset(imports),
        frozenset(_named(code)), _is_whole(names | {*_all_names(code)}),
    )  # fmt: skip


def _is_whole(names: set[str]) -> bool:
    return bool(_WHOLE & names or (_OWN & names and _BY_NAME & names))


def _all_names(code: CodeType) -> Iterator[str]:
    """All names of globals and attributes, but for the `__name__` that every class reads."""
    yield from (name for name in code.co_names if name != "__name__")
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _all_names(constant)


def _named(code: CodeType) -> Iterator[str]:
    if not _BY_NAME.isdisjoint(code.co_names):
        yield from (text for text in code.co_consts if isinstance(text, str))
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _named(constant)


def _collect(
    code: CodeType,
    names: set[str],
    chains: dict[str, set[tuple[str, ...]]],
    imports: set[tuple[str, int, str]],
) -> None:
    current: tuple[str, list[str]] | None = None
    statement: _Import | None = None
    constants: list[object] = [0, 0]  # the last two
    for instruction in dis.get_instructions(code):
        name, value = instruction.opname, instruction.argval
        if name in ("EXTENDED_ARG", "CACHE", "NOP"):
            continue
        if name in _ATTRIBUTE and current is not None:
            current[1].append(value)
            continue
        if current is not None:
            chains.setdefault(current[0], set()).add(tuple(current[1]))
            current = None
        if name in _GLOBAL and (name, value) != ("LOAD_NAME", "__name__"):  # in every class
            names.add(value)
            current = (value, [])
        elif name.startswith("LOAD_") and ("FAST" in name or "DEREF" in name):
            last = value[-1] if isinstance(value, tuple) else value
            cell = "FAST" in name and last in (*code.co_cellvars, *code.co_freevars)
            current = None if cell else (last, [])
        elif name == "IMPORT_NAME":
            level = constants[0] if isinstance(constants[0], int) else 0
            statement = _Import(value, level, bool(constants[1]))
            imports.add((value, level, HELD + value))
        elif name == "IMPORT_FROM" and statement is not None:
            statement.part = value
            if statement.is_from:
                chains.setdefault(HELD + statement.module, set()).add((value,))
        elif name.startswith("STORE_") and statement is not None:
            imports.add(statement.stored(value))
            statement = statement if statement.is_from else None
        elif name == "POP_TOP" and statement is not None and statement.is_from:
            statement = None
        constants = [constants[1], value]
    if current is not None:
        chains.setdefault(current[0], set()).add(tuple(current[1]))
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            _collect(constant, names, chains, imports)


@dataclass
class _Import:
    """An import statement, while its names are stored."""

    module: str
    level: int
    is_from: bool
    part: str = ""

    def stored(self, variable: str) -> tuple[str, int, str]:
        """Name and level of the module that a variable may be."""
        if self.is_from:
            name = f"{self.module}.{self.part}" if self.module else self.part
        else:  # `import a.b` sets `a`, `import a.b as c` the whole module
            name = self.module if self.part else self.module.partition(".")[0]
        return name, self.level, variable
