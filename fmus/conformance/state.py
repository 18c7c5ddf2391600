"""Checks of saved states."""

from __future__ import annotations

from .bench import Bench, NotApplicableError, advance, expect_same, half_way, middle, run


def save_and_restore(bench: Bench) -> str:
    if not bench.subject.saves:
        raise NotApplicableError("the FMU does not claim to save its state")
    half, level = middle(bench), bench.facts["level"]
    expected = bench.reference()[half:]
    instance = half_way(bench)
    state = instance.state()
    run(instance, level, first=half)
    for again in ("", " the second time"):
        instance.restore(state)
        rows = run(instance, level, first=half)
        expect_same(bench, expected, rows, f"the run after going back{again}")
    instance.restore(state)
    advance(instance, level, half)
    instance.keep(state)  # a copy may be written over
    run(instance, level, first=half + 1)
    instance.restore(state)
    rows = run(instance, level, first=half + 1)
    expect_same(bench, expected[1:], rows, "the run after going back to an overwritten copy")
    instance.free_state(state)
    instance.free()
    return "a run goes on from a saved state, each time"


def serialise(bench: Bench) -> str:
    if not bench.subject.serialises:
        raise NotApplicableError("the FMU does not claim to serialise its state")
    half, level = middle(bench), bench.facts["level"]
    expected = bench.reference()[half:]
    instance = half_way(bench)
    state = instance.state()
    data = instance.serialised(state)
    instance.free_state(state)
    run(instance, level, first=half)
    state = instance.deserialised(data)
    instance.restore(state)
    instance.free_state(state)
    rows = run(instance, level, first=half)
    expect_same(bench, expected, rows, "the run after going back to a serialised state")
    instance.free()
    return f"{len(data)} bytes"


def write_state(bench: Bench) -> str:
    if not bench.subject.serialises:
        raise NotApplicableError("the FMU does not claim to serialise its state")
    bench.reference()
    instance = half_way(bench)
    state = instance.state()
    (bench.folder / "state").write_bytes(instance.serialised(state))
    instance.free_state(state)
    instance.free()
    return ""


def go_on_from_state(bench: Bench) -> str:
    half, level = middle(bench), bench.facts["level"]
    expected = bench.reference()[half:]
    instance = bench.instance()
    instance.begin()
    state = instance.deserialised((bench.folder / "state").read_bytes())
    instance.restore(state)
    rows = run(instance, level, first=half)
    instance.free_state(state)
    instance.free()
    expect_same(bench, expected, rows, "the run from a state of another process")
    return "a run goes on from a state that another process has saved"
