"""Make many small changes to a source file, and list those that no test notices.

    python tools/mutate.py orchestrator/study/store.py --seed 7 --count 20 \\
        --tests 'tests/unit/orchestrator/test_store.py'

Each mutation is made alone, in a copy of this tree, and the tests run until one fails. Survivors
are printed as a diff with their number; ``--number 12`` repeats that mutation. Kinds: a sign, a
comparison, a dropped term or factor, a factor of two, an index increased by one, a removed check, a
unit (a factor of time, length or angle). Left out is what the syntax shows to change nothing: twice
a product with 0, and twice what is compared with 0. C files need ``--build``, a command that fails
if the file does not compile, for example
``--build 'python -c "from sblcosim.fmus.build import factory; factory.build(\\"ekf\\")"'``.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import difflib
import os
import random
import re
import shlex
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import IO

from tree import ROOT, copy

KINDS = ("sign", "comparison", "term", "factor", "index", "check", "unit")
OPPOSITES = {
    "<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "==", "in": "not in",
    "not in": "in", "is": "is not", "is not": "is", "and": "or", "or": "and", "&&": "||",
    "||": "&&",
}  # fmt: skip
POWER_OF_TEN = re.compile(r"1e[+-]?0*([3-9]|1\d)|1_?000(_?000)*(\.0)?|0\.001", re.I)
MORE_UNITS = {"60": "1", "60.0": "1.0", "3600": "60", "3600.0": "60.0", "180": "1", "180.0": "1.0"}
ANGLES = {
    "radians": "degrees", "degrees": "radians", "deg2rad": "rad2deg", "rad2deg": "deg2rad",
}  # fmt: skip
SPEAKS = re.compile(r"(^|\.)(warn|echo|print|debug|info|warning|error|log|add_argument|fail)$")
CHECKS = re.compile(r"(^|[._])(check|refuse|require|validate|verify|ensure|raise|must)\w*$")


@dataclass(frozen=True)
class Mutation:
    """A part of a text, by its characters, and its replacement."""

    kind: str
    start: int
    end: int
    text: str

    @property
    def length(self) -> int:
        return self.end - self.start

    def of(self, source: str) -> str:
        """The changed text."""
        return source[: self.start] + self.text + source[self.end :]


def mutations(source: str, suffix: str) -> list[Mutation]:
    """All mutations of a file that compile, in the order of their places.

    Parameters
    ----------
    source
        Content of the file.
    suffix
        Suffix of its name: ``.py``, or ``.c`` and ``.h``, which are not compiled here.
    """
    found = {*_Python(source)} if suffix == ".py" else {*_of_c(source)}
    return sorted(found, key=lambda m: (m.start, m.end, KINDS.index(m.kind), m.text))


def _dump(source: str) -> str | None:
    """The mutations of a text; none if it does not compile."""
    try:
        tree = ast.parse(source)
        compile(tree, "mutated", "exec", dont_inherit=True)
    except (SyntaxError, ValueError):
        return None
    return ast.dump(tree)


class _Python:
    """The mutations of a Python file."""

    def __init__(self, source: str) -> None:
        self.source = source
        self.tree = ast.parse(source)
        self.lines = source.splitlines(keepends=True)
        self.starts = [0]
        for line in self.lines:
            self.starts.append(self.starts[-1] + len(line))

    def __iter__(self) -> Iterator[Mutation]:
        for statement in self.tree.body:  # each is parsed alone, which is fast
            start, end = self._start(statement), self._end(statement)
            text = self.source[start:end]
            known = _dump(text)
            for mutation in self._below(statement):
                new = mutation.of(self.source)[start : end + len(mutation.text) - mutation.length]
                if _dump(new) not in (None, known):
                    yield mutation

    def _below(self, node: ast.AST) -> Iterator[Mutation]:
        yield from self._at(node)
        for name, value in ast.iter_fields(node):
            if name in {"annotation", "returns", "decorator_list", "type_params"}:
                continue
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST) and not self._is_silent(child):
                    yield from (m for m in self._below(child) if not self._is_equal(m, node, child))

    def _is_equal(self, mutation: Mutation, parent: ast.AST, child: ast.AST) -> bool:
        """Whether a factor of two changes nothing: what it doubles is compared with 0."""
        return (
            mutation.kind == "factor"
            and isinstance(parent, ast.Compare)
            and isinstance(child, ast.BinOp)
            and (mutation.start, mutation.end) == (self._start(child), self._end(child))
            and all(it is child or _is_zero(it) for it in (parent.left, *parent.comparators))
        )

    def _is_silent(self, node: ast.AST) -> bool:
        """Whether it is a message, or something else that no test could notice."""
        if isinstance(node, ast.Raise | ast.JoinedStr | ast.Import | ast.ImportFrom):
            return True
        if isinstance(node, ast.FunctionDef) and _is_stub(node):
            return True
        if isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
            return True
        return isinstance(node, ast.Call) and bool(SPEAKS.search(ast.unparse(node.func)))

    def _at(self, node: ast.AST) -> Iterator[Mutation]:
        match node:
            case ast.BinOp(left, op, right) if not _is_text(left) and not _is_text(right):
                yield from self._arithmetic(node, left, op, right)
            case ast.AugAssign(target, ast.Add() | ast.Sub() as op, value):
                start, end = self._end(target), self._start(value)
                old, new = ("+=", "-=") if isinstance(op, ast.Add) else ("-=", "+=")
                yield from self._swap("sign", start, end, old, new)
            case ast.UnaryOp(ast.USub(), _):
                yield Mutation("sign", self._start(node), self._start(node) + 1, "+")
            case ast.Compare():
                operands = pairwise([node.left, *node.comparators])
                for (a, b), symbol in zip(operands, node.ops, strict=True):
                    old = _SYMBOLS[type(symbol)]
                    yield from self._swap(
                        "comparison", self._end(a), self._start(b), old, OPPOSITES[old]
                    )
            case ast.BoolOp():
                old = "and" if isinstance(node.op, ast.And) else "or"
                for a, b in pairwise(node.values):
                    yield from self._swap(
                        "comparison", self._end(a), self._start(b), old, OPPOSITES[old]
                    )
            case ast.Subscript(_, index):
                yield from self._index(index)
            case ast.If(test, [*_, ast.Raise() | ast.Return() | ast.Continue() | ast.Break()], []):
                yield self._whole("check", test, "False")
            case ast.Expr(ast.Call(func)) if CHECKS.search(ast.unparse(func)):
                yield self._whole("check", node, "pass")
            case ast.Constant(int() | float() as value) if not isinstance(value, bool):
                yield from self._number(node, value)
            case ast.Attribute(_, name) | ast.Name(name) if name in ANGLES:
                end = self._end(node)
                yield Mutation("unit", end - len(name), end, ANGLES[name])
            case ast.Name("SECOND", ast.Load()):
                yield self._whole("unit", node, "(SECOND // 1000)")

    def _arithmetic(
        self, node: ast.BinOp, left: ast.expr, op: ast.operator, right: ast.expr
    ) -> Iterator[Mutation]:
        if not isinstance(op, ast.Add | ast.Sub | ast.Mult | ast.Div | ast.FloorDiv | ast.Pow):
            return
        if isinstance(op, ast.Add | ast.Sub):
            old, new = ("+", "-") if isinstance(op, ast.Add) else ("-", "+")
            yield from self._swap("sign", self._end(left), self._start(right), old, new)
        yield self._whole("term", node, self._text(left))
        if isinstance(op, ast.Add | ast.Mult):
            yield self._whole("term", node, self._text(right))
        if not _is_zero(node):
            yield self._whole("factor", node, f"(2 * ({self._text(node)}))")

    def _index(self, index: ast.expr) -> Iterator[Mutation]:
        parts = index.elts if isinstance(index, ast.Tuple) else [index]
        ends = [end for p in parts if isinstance(p, ast.Slice) for end in (p.lower, p.upper)]
        for part in (*ends, *(p for p in parts if not isinstance(p, ast.Slice))):
            if isinstance(part, ast.Name | ast.Attribute | ast.BinOp):
                yield self._whole("index", part, f"({self._text(part)} + 1)")
            elif part is not None and re.fullmatch(r"-?\d+", self._text(part)):
                step = -1 if self._text(part).startswith("-") else 1
                yield self._whole("index", part, str(int(self._text(part)) + step))

    def _number(self, node: ast.Constant, value: float) -> Iterator[Mutation]:
        text = self._text(node)
        if POWER_OF_TEN.fullmatch(text):
            yield self._whole("unit", node, f"({text} * 1000)")
        elif text in MORE_UNITS:
            yield self._whole("unit", node, MORE_UNITS[text])
        if isinstance(value, float) and value:
            yield self._whole("factor", node, f"(2 * {text})")

    def _swap(self, kind: str, start: int, end: int, old: str, new: str) -> Iterator[Mutation]:
        """Between two expressions are their operator, brackets, spaces and comments."""
        between = re.sub(r"#.*", lambda m: " " * len(m[0]), self.source[start:end])
        pattern = r"\s+".join(map(re.escape, old.split()))
        found = re.search(pattern, between)
        if found:
            yield Mutation(kind, start + found.start(), start + found.end(), new)

    def _whole(self, kind: str, node: ast.expr | ast.stmt, text: str) -> Mutation:
        return Mutation(kind, self._start(node), self._end(node), text)

    def _text(self, node: ast.expr) -> str:
        return self.source[self._start(node) : self._end(node)]

    def _start(self, node: ast.expr | ast.stmt) -> int:
        return self._offset(node.lineno, node.col_offset)

    def _end(self, node: ast.expr | ast.stmt) -> int:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return self._offset(node.end_lineno, node.end_col_offset)

    def _offset(self, line: int, column: int) -> int:
        """The syntax tree counts bytes."""
        return self.starts[line - 1] + len(self.lines[line - 1].encode()[:column].decode())


_SYMBOLS: dict[type[ast.cmpop], str] = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=",
    ast.In: "in", ast.NotIn: "not in", ast.Is: "is", ast.IsNot: "is not",
}  # fmt: skip


def _is_zero(node: ast.expr) -> bool:
    """Whether it is 0, or a product with 0, which remains what it is when it is doubled."""
    match node:
        case ast.Constant(int() | float() as value):
            return value == 0 and not isinstance(value, bool)
        case ast.UnaryOp(ast.USub() | ast.UAdd(), operand):
            return _is_zero(operand)
        case ast.BinOp(left, ast.Mult(), right):
            return _is_zero(left) or _is_zero(right)
        case ast.BinOp(left, ast.Div() | ast.FloorDiv(), _):
            return _is_zero(left)
    return False


def _is_stub(node: ast.FunctionDef) -> bool:
    """Whether a function does nothing: those of protocols, and signatures for type checkers."""
    rest = node.body[1:] if ast.get_docstring(node) is not None else node.body
    return all(
        isinstance(it, ast.Expr) and isinstance(it.value, ast.Constant) and it.value.value is ...
        for it in rest
    )


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.JoinedStr) or (
        isinstance(node, ast.Constant) and isinstance(node.value, str | bytes)
    )


TOKEN = re.compile(
    r"""(?P<skip>\s+|//[^\n]*|/\*.*?\*/|\\\n)
      | (?P<directive>^[ \t]*\#[ \t]*(?!define)(?:\\\n|[^\n])*)
      | (?P<define>^[ \t]*\#[ \t]*define[ \t]+\w+(?:\([^)]*\))?)
      | (?P<text>"(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*')
      | (?P<number>(?:\d|\.\d)(?:[eEpP][+-]|[\w.])*)
      | (?P<name>[A-Za-z_]\w*)
      | (?P<sign><<=|>>=|\.\.\.|->|\+\+|--|<<|>>|<=|>=|==|!=|&&|\|\||[-+*/%&|^]=|.)""",
    re.VERBOSE | re.DOTALL | re.MULTILINE,
)
TYPES = {
    "return", "sizeof", "case", "const", "double", "int", "size_t", "char", "void", "else",
    "unsigned", "static", "real", "struct", "float", "uint32_t", "uint64_t", "int64_t", "int32_t",
}  # fmt: skip
LEAVES = {"return", "goto", "continue", "break"}


@dataclass(frozen=True)
class _Token:
    kind: str
    text: str
    start: int
    end: int


def _of_c(source: str) -> Iterator[Mutation]:
    """The mutations of a C file, from its tokens."""
    tokens = [
        _Token(str(m.lastgroup), m[0], m.start(), m.end())
        for m in TOKEN.finditer(source)
        if m.lastgroup not in {"skip", "directive", "define"}
    ]
    for i, token in enumerate(tokens[:-1]):
        before = tokens[i - 1] if i else None
        binary = before is not None and (
            before.text in {")", "]"}
            or (before.kind in {"name", "number"} and before.text not in TYPES)
        )
        if token.text in {"+", "-", "*", "/"} and binary and before is not None:
            if token.text in "+-":
                new = "-" if token.text == "+" else "+"
                yield Mutation("sign", token.start, token.end, new)
            last = _operand(tokens, i + 1, products=token.text in "+-")
            if last is not None:
                yield Mutation("term", token.start, tokens[last].end, "")
        elif token.text == "-":
            yield Mutation("sign", token.start, token.end, "+")
        elif token.text in {"+=", "-="}:
            yield Mutation("sign", token.start, token.end, "-=" if token.text == "+=" else "+=")
        elif token.text in OPPOSITES and token.kind == "sign":
            yield Mutation("comparison", token.start, token.end, OPPOSITES[token.text])
        elif token.text in {"=", "return"}:
            last = _until(tokens, i + 1, {";", ",", "{"})
            if (
                last is not None
                and tokens[last].text == ";"
                and (last > i + 2 or tokens[i + 1].kind == "name")
            ):
                start, end = tokens[i + 1].start, tokens[last - 1].end
                yield Mutation("factor", start, end, f"2 * ({source[start:end]})")
        elif token.text == "[" and binary:
            last = _until(tokens, i + 1, {"]"})
            if last is not None and last > i + 1 and not _declares(tokens, i - 2):
                start, end = tokens[i + 1].start, tokens[last].start
                yield Mutation("index", start, end, f"({source[start:end]}) + 1")
        elif token.text == "if" and tokens[i + 1].text == "(":
            last = _until(tokens, i + 2, {")"})
            if last is not None:
                then = tokens[last + 1 :][:2]
                words = [t.text for t in then if t.text != "{"]
                if words and words[0] in LEAVES:
                    yield Mutation("check", tokens[i + 2].start, tokens[last].start, "0")
        elif token.kind == "number" and POWER_OF_TEN.fullmatch(token.text):
            yield Mutation("unit", token.start, token.end, f"({token.text} * 1000)")
        elif token.kind == "number" and re.fullmatch(r"\d*\.\d*(e[+-]?\d+)?", token.text):
            yield Mutation("factor", token.start, token.end, f"(2 * {token.text})")


def _declares(tokens: Sequence[_Token], i: int) -> bool:
    """Whether the text before a name makes it a declaration."""
    while i > 0 and tokens[i].text == "*":
        i -= 1
    return i >= 0 and tokens[i].kind == "name" and tokens[i].text not in {"return", "sizeof"}


def _operand(tokens: Sequence[_Token], i: int, products: bool) -> int | None:
    """Index of the last token of an operator's right operand."""
    while i < len(tokens) and tokens[i].text in {"-", "+", "!", "*", "&"}:
        i += 1
    if i >= len(tokens) or not (tokens[i].kind in {"name", "number"} or tokens[i].text == "("):
        return None
    last = i
    if tokens[i].text == "(":
        closing = _until(tokens, i + 1, {")"})
        if closing is None:
            return None
        last = closing
    while last + 1 < len(tokens):
        following = tokens[last + 1].text
        if following in {"(", "["}:
            closing = _until(tokens, last + 2, {")" if following == "(" else "]"})
            if closing is None:
                return None
            last = closing
        elif following in {".", "->"}:
            last += 2
        elif products and following in {"*", "/"}:
            more = _operand(tokens, last + 2, products=True)
            return last if more is None else more
        else:
            break
    return last


def _until(tokens: Sequence[_Token], i: int, ends: set[str]) -> int | None:
    """Index of the first of some tokens, outside brackets opened on the way."""
    depth = 0
    for place in range(i, len(tokens)):
        text = tokens[place].text
        if depth == 0 and text in ends:
            return place
        if text in {"(", "[", "{"}:
            depth += 1
        elif text in {")", "]", "}"}:
            depth -= 1
            if depth < 0:
                return None
    return None


def chosen(
    count: int, known: Sequence[Mutation], seed: int, kinds: Sequence[str] = KINDS
) -> list[int]:
    """Numbers of some mutations, spread over the kinds as evenly as possible."""
    generator = random.Random(seed)
    heaps = [[n for n, m in enumerate(known) if m.kind == kind] for kind in kinds]
    for heap in heaps:
        generator.shuffle(heap)
    numbers: list[int] = []
    while any(heaps) and len(numbers) < count:
        numbers += [heap.pop() for heap in heaps if heap]
    return numbers[:count]


@dataclass(frozen=True)
class Bench:
    """A copy of a tree, in which files are changed and tests run.

    Attributes
    ----------
    folder
        Holds the copy in ``tree``.
    limit
        Time limit of the tests in seconds.
    """

    folder: Path
    tests: Sequence[str]
    build: Sequence[str]
    limit: float

    @property
    def tree(self) -> Path:
        return self.folder / "tree"

    def outcome(self) -> str:
        """Result of the tests for the current tree: passed, killed, slow, or does not build."""
        if self.build and self._run(self.build, self.limit, {}) != 0:
            return "does not build"
        code, _ = self.pytest(["-x", *self.tests], self.limit)
        if code in {0, 1, None}:
            return {0: "passed", 1: "killed", None: "slow"}[code]
        return "killed"  # it cannot be imported, or ends the interpreter

    def change(self, file: str, text: str) -> None:
        """Write a file, with a time of its own: otherwise its compiled form may seem up to date."""
        path = self.tree / file
        later = path.stat().st_mtime_ns // 10**9 + 1
        path.write_text(text)
        os.utime(path, (later, later))

    def pytest(
        self, arguments: Sequence[str], limit: float | None, more: Mapping[str, str] | None = None
    ) -> tuple[int | None, str]:
        """Exit code of pytest, none after the time limit, and what it prints.

        Parameters
        ----------
        arguments
            Of pytest.
        limit
            Time limit in seconds, or none.
        more
            Variables of the environment. Those that exist are extended, like ``PATH``.
        """
        with tempfile.TemporaryFile("w+") as said:
            command = [sys.executable, "-m", "pytest", "-q", *arguments]
            code = self._run(command, limit, more or {}, said)
            said.seek(0)
            return code, said.read()

    def _run(
        self,
        command: Sequence[str],
        limit: float | None,
        more: Mapping[str, str],
        output: IO[str] | int = subprocess.DEVNULL,
    ) -> int | None:
        known = self._environment
        process = subprocess.Popen(
            command, cwd=self.tree, start_new_session=True, stdin=subprocess.DEVNULL,
            stdout=output, stderr=output,
            env=known | {k: os.pathsep.join(filter(None, (known.get(k), more[k]))) for k in more},
        )  # fmt: skip
        try:
            return process.wait(limit)
        except subprocess.TimeoutExpired:
            return None
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)  # including what it has left behind
            process.wait()

    @property
    def _environment(self) -> dict[str, str]:
        """Environment for processes that import from the copy, however it is installed."""
        places = (self.folder / "site", self.tree, self.tree / "src")
        return os.environ | {
            "PYTHONPATH": os.pathsep.join(map(str, places)),
            "SBLCOSIM_CACHE": str(self.folder / "cache"),
            "MPLBACKEND": "Agg",
        }


def bench_of(root: Path, folder: Path, tests: str, build: str, limit: float) -> Bench:
    """Copy a tree, and give its folders the names under which they are imported."""
    bench = Bench(folder, shlex.split(tests), shlex.split(build), limit)
    copy(root, bench.tree)
    for package, source in sorted(_package_folders(bench.tree).items()):
        place = (folder / "site").joinpath(*package.split("."))
        place.mkdir(parents=True, exist_ok=True)
        for entry in (bench.tree / source).iterdir():
            (place / entry.name).symlink_to(entry)
    return bench


def _package_folders(tree: Path) -> dict[str, str]:
    file = tree / "pyproject.toml"
    tools = tomllib.loads(file.read_text())["tool"] if file.is_file() else {}
    folders: dict[str, str] = tools.get("setuptools", {}).get("package-dir", {})
    return folders


def main() -> int:
    """Print the survivors; the exit code is 1 if there are any, 2 if nothing could be done."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file", help="file to change, from the root of the tree")
    parser.add_argument("--tests", required=True, help="arguments for pytest")
    parser.add_argument("--seed", type=int, default=1, help="seed of the choice")
    parser.add_argument("--count", type=int, default=20, help="number of mutations")
    parser.add_argument("--number", type=int, action="append", help="only this; may be repeated")
    parser.add_argument("--kind", choices=KINDS, action="append", help="only these")
    parser.add_argument("--build", default="", help="command that fails if it does not compile")
    parser.add_argument("--limit", type=float, help="seconds [ten times what the tests take]")
    parser.add_argument("--root", type=Path, default=ROOT, help="the tree [this one]")
    given = parser.parse_args()

    source = (given.root / given.file).read_text()
    known = mutations(source, Path(given.file).suffix)
    numbers = given.number or chosen(given.count, known, given.seed, given.kind or KINDS)
    with tempfile.TemporaryDirectory(prefix="sblcosim-mutate-") as name:
        bench = bench_of(given.root, Path(name), given.tests, given.build, given.limit or 3600.0)
        started = time.monotonic()
        if (found := bench.outcome()) != "passed":
            print(f"the tests must pass before anything is changed, got: {found}", file=sys.stderr)
            return 2
        if not given.limit:
            bench = replace(bench, limit=10 * (time.monotonic() - started) + 10)
        counts: Counter[str] = Counter()
        for number in numbers:
            mutated = known[number].of(source)
            bench.change(given.file, mutated)
            found = bench.outcome()
            counts[found] += 1
            line = 1 + source.count("\n", 0, known[number].start)
            where = f"number {number} of {len(known)}: {known[number].kind}, line {line}"
            print(f"{where}: {'SURVIVED' if found == 'passed' else found}", flush=True)
            if found == "passed":
                print(difference(given.file, source, mutated), flush=True)
    tried = sum(counts.values()) - counts["does not build"]
    print(f"seed {given.seed}: {counts['passed']} of {tried} mutations of {given.file} survive")
    return 1 if counts["passed"] else 0


def difference(name: str, before: str, after: str) -> str:
    """The mutation as a unified diff."""
    lines = difflib.unified_diff(
        before.splitlines(), after.splitlines(), f"a/{name}", f"b/{name}", lineterm="", n=1
    )
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
