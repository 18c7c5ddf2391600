"""Change random places of the whole tree, each alone, and list the changes that no test notices.

    python tools/mutate_tree.py record RECORD --tests 'tests/unit -n 2 --dist loadfile'
    python tools/mutate_tree.py draw RECORD --seed 7 --count 150

``record`` runs the tests once, in a copy of the tree, and stores in the folder RECORD which test
executes which lines, and how long each takes. It may be repeated with other tests. ``draw`` chooses
mutations among all those of ``mutate.py`` in the folders, and runs for each only tests that execute
its lines: those that take the least time for what they execute of the module come first, and the
first failure ends it. What a test file keeps for several of its tests is executed by the first of
them, so the other tests of these files follow. Lines that only imports execute, such as constants,
have all tests of their module. A survivor is printed with ``file`` and ``number`` for
``mutate.py FILE --number``.

Files in C have no such record; use ``mutate.py``.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import shlex
import shutil
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from coverage import CoverageData
from coverage.exceptions import DataError
from mutate import Bench, Mutation, bench_of, difference, mutations
from tree import ROOT

FOLDERS = ("models", "orchestrator")
ROUNDS = (4.0, 20.0)
"""Seconds of tests after which the first runs of pytest end; the last ends at the limit."""
SLOW = 4.0
"""Seconds of a test that runs after all quicker ones, so that many run until the limit."""
PATIENCE = 400.0
"""Seconds that a run of pytest may take longer than its tests once took: it may compile."""
OF_EQUATIONS = "tests/unit/models/test_equations.py"
"""Tests of all equations, which compile nothing. Others compile first what is changed."""


@dataclass(frozen=True)
class Place:
    """One mutation: the file's name from the root, and its number among those of the file."""

    file: str
    number: int
    mutation: Mutation

    def lines(self, source: str) -> range:
        first, last = (1 + source.count("\n", 0, n) for n in self._ends)
        return range(first, last + 1)

    @property
    def _ends(self) -> tuple[int, int]:
        return self.mutation.start, self.mutation.end


def drawn(root: Path, folders: Sequence[str], seed: int, count: int) -> list[Place]:
    """Some of all mutations of the Python files in some folders, each as likely as any other."""
    files = sorted(
        str(path.relative_to(root)) for name in folders for path in (root / name).rglob("*.py")
    )
    known = [
        Place(file, number, mutation)
        for file in files
        for number, mutation in enumerate(mutations((root / file).read_text(), ".py"))
    ]
    return random.Random(seed).sample(known, min(count, len(known)))


class Record:
    """Which tests execute which lines, and how many seconds each takes."""

    def __init__(self, folder: Path) -> None:
        self.seconds: dict[str, float] = json.loads((folder / "seconds.json").read_text())
        self._data = CoverageData(str(folder / "lines"))
        self._data.read()

    @cached_property
    def _files(self) -> dict[str, list[str]]:
        """Tests that passed, by file."""
        files: defaultdict[str, list[str]] = defaultdict(list)
        for test in self.seconds:
            files[test.partition("::")[0]].append(test)
        return files

    def stages(self, place: Place, source: str) -> list[list[str]]:
        """Tests that execute the mutation's lines, and the others of their files."""
        known = {
            line: set(names) - {""}
            for line, names in self._data.contexts_by_lineno(place.file).items()
        }
        executed = Counter(
            name.partition("::")[0] for names in known.values() for name in names
        )  # of the module's lines, by test file and test
        lines = place.lines(source)
        called = _within_function(source, lines)  # all imports execute the others
        here = set().union(*(known.get(line, ()) for line in lines)) if called else set()
        names = here or set().union(*known.values())
        tests = {
            test
            for name in names
            for test in ([name] if "::" in name else self._files.get(name, ()))
            if test in self.seconds
        }
        files = {test.partition("::")[0] for test in tests}
        cost = {f: sum(self.seconds[t] for t in self._files[f] if t in tests) for f in files}
        order = sorted(files, key=lambda f: (0.5 + cost[f]) / executed[f])
        first = [t for f in order for t in self._files[f] if t in tests]
        first.sort(key=lambda test: self.seconds[test] > SLOW)
        return [first, [t for f in order for t in self._files[f] if t not in tests]]

    def rounds(self, place: Place, source: str, limit: float) -> Iterator[list[str]]:
        """These tests for one run of pytest after another, until the limit in seconds."""
        first, second = self.stages(place, source)
        if any(test.startswith(OF_EQUATIONS) for test in first):
            all_equations = self._files[OF_EQUATIONS]
            yield all_equations
            first = [test for test in first if test not in all_equations]
            second = [test for test in second if test not in all_equations]
        yield from self._parts(first, limit)
        yield from self._parts(second, limit - sum(self.seconds[test] for test in first))

    def _parts(self, given: Sequence[str], limit: float) -> Iterator[list[str]]:
        ends, spent, tests = [*ROUNDS, limit], 0.0, list[str]()
        for test in given:
            spent += self.seconds[test]
            if spent > limit:
                break
            if spent > ends[0] and tests:
                yield tests
                tests = []
                ends = [end for end in ends if end >= spent]
            tests.append(test)
        if tests:
            yield tests


def _within_function(source: str, lines: range) -> bool:
    """Whether a call executes some of these lines, and not the import of the module."""
    return any(
        max(lines.start, node.body[0].lineno) < min(lines.stop, (node.end_lineno or 0) + 1)
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.FunctionDef)
    )


@dataclass(frozen=True)
class Trial:
    """A copy of the tree, in which one file at a time is changed."""

    bench: Bench
    record: Record
    limit: float

    def killer(self, place: Place) -> str | None:
        """The test that fails for a mutation, or what ends the tests; none for a survivor."""
        path = self.bench.tree / place.file
        source = path.read_text()
        try:
            self.bench.change(place.file, place.mutation.of(source))
            for tests in self.record.rounds(place, source, self.limit):
                if found := self.failing(tests, first=True):
                    return found[0]
            return None
        finally:
            self.bench.change(place.file, source)

    def failing(self, tests: Sequence[str], first: bool = False) -> list[str]:
        """Which tests fail; a run that ends otherwise fails with a sentence."""
        listed = self.bench.folder / "tests"
        listed.write_text("\n".join(tests))
        limit = PATIENCE + 3 * sum(self.record.seconds[test] for test in tests)
        which = ["-m", "", *(["-x"] if first else []), f"@{listed}"]  # slow ones are recorded, too
        code, said = self.bench.pytest(which, limit)
        if code == 0:
            return []
        found = [
            line.split(maxsplit=1)[1].partition(" - ")[0]
            for line in said.splitlines()
            if line.startswith(("FAILED ", "ERROR "))
        ]
        return found or ["no end in time" if code is None else f"pytest ended with {code}"]


def _trial(given: argparse.Namespace, folder: Path) -> Bench:
    bench = bench_of(given.root, folder, "", "", 0.0)
    cache = os.environ.get("SBLCOSIM_CACHE")
    if cache and Path(cache).is_dir():
        shutil.copytree(cache, folder / "cache")
    return bench


def record(given: argparse.Namespace) -> int:
    """Run tests and add what they execute to the record; the exit code is that of pytest."""
    with tempfile.TemporaryDirectory(prefix="sblcosim-mutate-") as name:
        bench = _trial(given, Path(name))
        part = Path(name) / "record"
        part.mkdir()
        more = {
            "PYTHONPATH": str(bench.tree / "tools"),
            "SBLCOSIM_RECORD": str(part),
            "SBLCOSIM_SOURCES": os.pathsep.join(str(bench.tree / f) for f in given.folder),
        }
        code, said = bench.pytest(["-p", "recorder", *shlex.split(given.tests)], None, more)
        print(said)
        added = join(part, bench.tree, given.record)
        print(f"{added} tests in {given.record}")
    return 1 if code is None else code


def join(part: Path, tree: Path, into: Path) -> int:
    """Add what the processes of a run have written to a record, and return its number of tests."""
    into.mkdir(parents=True, exist_ok=True)
    whole = CoverageData(str(into / "lines"))
    whole.read()
    for path in sorted(part.glob("lines.*")):
        one = CoverageData(str(path))
        try:
            one.read()
        except DataError:  # of a process that was killed before it had written all
            continue
        whole.update(one, map_path=lambda name: os.path.relpath(name, tree.resolve()))
    whole.write()
    stored = into / "seconds.json"
    seconds = json.loads(stored.read_text()) if stored.exists() else {}
    for path in part.glob("seconds.*.json"):
        seconds |= json.loads(path.read_text())
    stored.write_text(json.dumps(seconds))
    return len(seconds)


def draw(given: argparse.Namespace) -> int:
    """Print the survivors; the exit code is 1 if there are any."""
    places = drawn(given.root, given.folder, given.seed, given.count)
    killers: defaultdict[str, list[int]] = defaultdict(list)
    survivors = tried = 0
    with tempfile.TemporaryDirectory(prefix="sblcosim-mutate-") as name:
        trial = Trial(_trial(given, Path(name)), Record(given.record), given.limit)
        for n in range(len(places))[given.skip :: given.step]:
            place = places[n]
            tried += 1
            source = (given.root / place.file).read_text()
            killer = trial.killer(place)
            where = f"{n}: {place.file} number {place.number}, line {place.lines(source)[0]}"
            print(f"{where}, {place.mutation.kind}: {killer or 'SURVIVED'}", flush=True)
            if killer is None:
                survivors += 1
                print(difference(place.file, source, place.mutation.of(source)), flush=True)
            else:
                killers[killer].append(n)
        known = [test for test in killers if test in trial.record.seconds]
        for test in trial.failing(known):
            print(f"fails without a mutation, too: {test}: repeat {killers[test]}")
    print(f"seed {given.seed}: {survivors} of {tried} mutations survive")
    return 1 if survivors else 0


def main(arguments: Iterable[str] | None = None) -> int:
    """Record, or draw; see the top of the file."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("action", choices=["record", "draw"])
    parser.add_argument("record", type=Path, help="folder of the record, outside the tree")
    parser.add_argument("--tests", default="tests/unit", help="arguments for pytest, to record")
    parser.add_argument("--seed", type=int, default=1, help="seed of the draw")
    parser.add_argument("--count", type=int, default=150, help="number of mutations")
    parser.add_argument("--skip", type=int, default=0, help="number of the first to leave out")
    parser.add_argument("--step", type=int, default=1, help="each second only, and so on")
    parser.add_argument("--limit", type=float, default=60.0, help="seconds of tests a mutation")
    parser.add_argument("--folder", action="append", help="of sources [models, orchestrator]")
    parser.add_argument("--root", type=Path, default=ROOT, help="the tree [this one]")
    given = parser.parse_args(None if arguments is None else list(arguments))
    given.folder = given.folder or FOLDERS
    return record(given) if given.action == "record" else draw(given)


if __name__ == "__main__":
    sys.exit(main())
