"""Checks of an instance's life, from its start to its end, and of several instances."""

from __future__ import annotations

import math
import pickle
import sys
import threading

from ..host.signatures import ERROR
from .bench import (
    INSTANCES,
    LEVELS,
    STILL,
    Bench,
    BlockedError,
    ConformanceError,
    Values,
    advance,
    begin,
    digest,
    expect_same,
    middle,
    refuse_single,
    run,
)
from .environment import of_log
from .library import RefusedError


def loading(bench: Bench) -> str:
    """Load, instantiate, initialise and end. Only the first two must succeed."""
    bench.talks = True
    functions(bench)
    instance = bench.instance()
    if instance.try_enter() <= 1 and instance.try_("ExitInitializationMode") <= 1:
        instance.try_("Terminate")
    instance.free()
    return ""


def functions(bench: Bench) -> str:
    missing = [name for name in bench.subject.functions if not bench.library.has(name)]
    if missing:
        more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
        raise ConformanceError(f"it does not export {', '.join(missing[:3])}{more}")
    return f"all {len(bench.subject.functions)}"


def find_level(bench: Bench) -> str:
    """The first life: determines how much activity a run may have."""
    bench.talks = True
    subject, library = bench.subject, bench.library
    version = (library.call("GetVersion") or b"").decode(errors="replace")
    if not version.startswith(f"{subject.fmi}."):
        what = f"fmi{subject.fmi}GetVersion"
        raise ConformanceError(
            f"{what} must return {subject.version}, got {version!r}", ("2.1.4", "2.2.5")
        )
    for index in range(bench.first, len(LEVELS)):
        level = LEVELS[index]
        try:
            rows = _tried(bench, level)
        except RefusedError as refusal:
            if level == STILL and subject.tool:
                raise BlockedError(f"it needs a tool, which may be missing: {refusal}") from None
            if level == STILL or of_log(refusal.said):
                raise
            if subject.once:
                bench.resume = index + 1
                return ""
        else:
            break
    moving = sum(any(row[i] != rows[0][i] for row in rows) for i in range(len(rows[0])))
    text = (
        f"{subject.steps} steps of {subject.step:g} s, {level}; "
        f"{moving} of {len(rows[0])} outputs move"
    )
    (bench.folder / "rows").write_bytes(pickle.dumps(rows))
    bench.write_facts(level=level, digest=digest(rows), text=text)
    return text


def live_again(bench: Bench) -> str:
    """The same life in another process, and again in this one if allowed."""
    facts = bench.facts
    for _ in range(1 if bench.subject.once else 2):
        instance = bench.instance()
        rows = run(begin(instance, facts["level"]), facts["level"])
        instance.do("Terminate")
        instance.free()
    bench.write_facts(**facts, repeats=digest(rows) == facts["digest"])
    return ""


def free_any_time(bench: Bench) -> str:
    """An instance may be freed in every state."""
    level = bench.facts["level"]
    for advanced in range(bench.first, 4):
        instance = bench.instance()
        if advanced == 1:
            instance.enter()
        elif advanced > 1:
            begin(instance, level)
            if advanced == 3:
                advance(instance, level, 0)
        instance.free()
        if bench.subject.once and advanced < 3:
            bench.resume = advanced + 1
            return ""
    text: str = bench.facts["text"]
    return text


def _tried(bench: Bench, level: str) -> list[Values]:
    """The run of the first instance, provided that all can run like this."""
    for number in range(1 if bench.subject.once else INSTANCES):
        instance = bench.instance()
        try:
            rows = run(begin(instance, level, number), level, number)
        finally:
            instance.free()
        if level != STILL and not all(math.isfinite(x) for x in rows[-1] if isinstance(x, float)):
            raise RefusedError("the run", ERROR, "its results are not finite")
        if number == 0:
            first = rows
    return first


def reset(bench: Bench) -> str:
    expected, level = bench.reference(), bench.facts["level"]
    instance = bench.instance()
    for steps, when in ((0, "before any step"), (middle(bench), "half-way")):
        begin(instance, level)
        for step in range(steps):
            advance(instance, level, step)
        instance.do("Reset")
        rows = run(begin(instance, level), level)
        instance.do("Reset")
        expect_same(bench, expected, rows, f"a run after a reset {when}")
    run(begin(instance, level), level)
    instance.do("Terminate")
    instance.do("Reset")
    rows = run(begin(instance, level), level)
    expect_same(bench, expected, rows, "a run after termination and reset")
    instance.free()
    return "a run after a reset is the run of a fresh instance"


def instances(bench: Bench) -> str:
    refuse_single(bench)
    level = bench.facts["level"]
    expected = [bench.reference()]
    for n in range(INSTANCES):
        instance = bench.instance()
        rows = run(begin(instance, level, n), level, n)
        instance.free()
        if n == 0:
            expect_same(bench, expected[0], rows, "a second instance")
        else:
            expected.append(rows)
    many = [bench.instance(f"conformance {n}") for n in range(INSTANCES)]
    for n, instance in enumerate(many):
        begin(instance, level, n)
    interleaved = [[instance.outputs()] for instance in many]
    for step in range(bench.subject.steps):
        for n, instance in enumerate(many):
            interleaved[n].append(advance(instance, level, step, n))
    for n, instance in enumerate(many):
        expect_same(bench, expected[n], interleaved[n], f"{INSTANCES} instances in turn")
        instance.free()
    return f"{INSTANCES} instances in turn do what each does alone"


def threads(bench: Bench) -> str:
    refuse_single(bench)
    level = bench.facts["level"]
    expected = [bench.reference()]
    for n in range(1, INSTANCES):
        instance = bench.instance()
        expected.append(run(begin(instance, level, n), level, n))
        instance.free()
    problems: list[Exception] = []
    together = threading.Barrier(INSTANCES)

    def work(n: int) -> None:
        together.wait()
        try:
            for _ in range(5):
                instance = bench.instance(f"conformance {n}")
                rows = run(begin(instance, level, n), level, n)
                instance.free()
                expect_same(bench, expected[n], rows, f"{INSTANCES} threads at once")
        except (ConformanceError, RefusedError) as problem:
            problems.append(problem)

    workers = [threading.Thread(target=work, args=(n,)) for n in range(INSTANCES)]
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    sys.setswitchinterval(interval)
    if problems:
        raise problems[0]
    return f"{INSTANCES} threads with an instance each do what each does alone"
