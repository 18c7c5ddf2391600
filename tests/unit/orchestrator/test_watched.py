"""Who is named when a child process ends or stands still; messages and played records by hand."""

from __future__ import annotations

import io
import struct
import warnings
from typing import Any

import numpy as np
import pytest
from sblcosim.errors import ConfigurationError, ConfigurationWarning, FmuError
from sblcosim.fmus.host.instances import LOADING, UNLOADING
from sblcosim.models.declaration import output
from sblcosim.simulation.children.messages import Begun, TaskEnded
from sblcosim.simulation.children.state import (
    CALLING,
    LOOP,
    OUTSIDE,
    SIZE,
    State,
    receive,
    send,
)
from sblcosim.simulation.children.watched import Watched
from sblcosim.simulation.player import Player

NAMES = {"first": "FMU a.fmu", "second": "FMU b.fmu", "third": "the Python component C"}
CRASH = "crashed (signal SIGSEGV)"


def state(where: int, component: int = 0, function: str = "", **more: Any) -> State:
    it = State(where=where, component=component, function=function.encode(), saying=-1)
    for name, value in more.items():
        setattr(it.progress if name in ("row", "at") else it, name, value)
    return it


def watched(*suspects: str, **more: Any) -> Watched:
    return Watched(NAMES, suspects, **more)


def told(error: FmuError) -> tuple[str, str | None, tuple[str, ...]]:
    return str(error), error.component, tuple(error.suspects)


def test_a_call_that_ends_the_process_names_its_component() -> None:
    said = told(watched("second", "third").failure(state(CALLING, 1, "fmi3Reset"), None, CRASH))
    assert said == (
        "second: FMU b.fmu crashed (signal SIGSEGV) in fmi3Reset", "second", ("second", "third")
    )
    for function, words in ((LOADING, "loading its library"), (UNLOADING, "unloading its library")):
        said = told(watched("second").failure(state(CALLING, 1, function), None, CRASH))
        assert said == (
            f"second: FMU b.fmu crashed (signal SIGSEGV) in {words}", "second", ()
        )
    each = watched("first", cases=("case 7", "", "case 9"))
    for row, when in ((0, " at case 7"), (1, ""), (2, " at case 9"), (3, "")):
        said = told(each.failure(state(CALLING, 0, "f", row=row), None, CRASH))
        assert said[0] == f"first: FMU a.fmu crashed (signal SIGSEGV) in f{when}"


def test_a_call_that_does_not_return_names_its_component_whoever_it_is() -> None:
    for suspects in (("second", "third"), ("first",), ()):
        said = told(watched(*suspects).failure(state(CALLING, 0, "do_step"), 2.5))
        assert said == (
            "first: FMU a.fmu has not returned from do_step for 2.5 s", "first", ()
        )


def test_outside_its_calls_only_one_suspect_can_be_named() -> None:
    said = told(watched("second").failure(state(OUTSIDE), None, CRASH))
    assert said == (
        "second: FMU b.fmu crashed (signal SIGSEGV) outside its calls, perhaps in a thread",
        "second", (),
    )
    said = told(watched("second").failure(state(CALLING, 0, "fmi3Reset"), None, CRASH))
    assert said[:2] == (  # in a call of ours, which is not to blame
        "second: FMU b.fmu crashed (signal SIGSEGV) outside its calls, perhaps in a thread",
        "second",
    )
    said = told(watched("second", "third").failure(state(OUTSIDE), None, CRASH))
    assert said == (
        "second, third: one of these has crashed (signal SIGSEGV)", None, ("second", "third")
    )
    said = told(watched().failure(state(OUTSIDE), None, CRASH))
    assert said == (
        "the process for third-party FMUs: one of these has crashed (signal SIGSEGV)", None, ()
    )
    said = told(watched("second", "third").failure(state(OUTSIDE, 1, "f"), 60.0))
    assert said == ("second, third: one of these has made no progress for 60 s", None, ())
    for odd in (-1, 3):
        said = told(watched("second").failure(state(CALLING, odd, "f"), 4.0))
        assert said == ("second: one of these has made no progress for 4 s", None, ())


def test_in_the_loop_the_call_and_its_instant_are_named() -> None:
    instants = (0, 250_000_000, 500_000_000)
    begun = Begun((("first", "fmi2DoStep"), ("third", "do_step")), ())
    running = watched("first", "third", instants=instants, begun=begun)
    said = told(running.failure(state(LOOP, row=1, at=1), None, CRASH))
    assert said == (
        "third: the Python component C crashed (signal SIGSEGV) in do_step at 0.25 s", "third",
        ("first", "third"),
    )
    said = told(running.failure(state(LOOP, row=2, at=0), 1.5))
    assert said == (
        "first: FMU a.fmu has not returned from fmi2DoStep at 0.5 s for 1.5 s", "first", ()
    )
    early = watched("first", "third", instants=instants)
    said = told(early.failure(state(LOOP, row=2, at=1), 1.5))
    assert said == ("first, third: one of these has made no progress for 1.5 s at 0.5 s", None, ())


def test_the_last_message_of_the_component_itself_is_told() -> None:
    for saying, said in ((1, "second: no memory"), (1, "no memory")):
        it = state(CALLING, 1, "f", saying=saying, said=said.encode())
        assert str(watched("second").failure(it, None, CRASH)) == (
            "second: FMU b.fmu crashed (signal SIGSEGV) in f: no memory"
        )
    it = state(CALLING, 0, "f", saying=0, said=b"first: no disk")
    assert str(watched("first").failure(it, 2.0)) == (
        "first: FMU a.fmu has not returned from f for 2 s: no disk"
    )
    for saying in (0, 2, -1, 3):
        it = state(CALLING, 1, "f", saying=saying, said=b"first: fine")
        assert str(watched("second").failure(it, None, CRASH)).endswith(" in f")


def test_what_a_call_has_changed_is_told_and_warnings_are_passed_on() -> None:
    ended = TaskEnded(
        habits=(("first", LOADING, 3), ("third", "do_step", 2), ("second", "f", 1)),
        warned=(("mine", UserWarning, "file.py", 7),),
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        watched().tell(ended)
    assert [str(it.message) for it in caught] == [
        "first: FMU a.fmu must leave the floating-point state of the processor and the locale "
        "unchanged, got a change in loading its library; it was undone",
        "third: the Python component C must leave the locale unchanged, got a change in do_step; "
        "it was undone",
        "second: FMU b.fmu must leave the floating-point state of the processor unchanged, got a "
        "change in f; it was undone",
        "mine",
    ]
    assert [it.category for it in caught] == [ConfigurationWarning] * 3 + [UserWarning]
    assert (caught[3].filename, caught[3].lineno) == ("file.py", 7)


def test_a_message_comes_with_its_length_and_is_whole_or_none() -> None:
    pipe = io.BytesIO()
    send(pipe, b"some bytes")
    send(pipe, b"")
    assert pipe.getvalue() == struct.pack("<Q", 10) + b"some bytes" + struct.pack("<Q", 0)
    pipe.seek(0)
    assert [receive(pipe), receive(pipe), receive(pipe)] == [b"some bytes", b"", None]
    whole = pipe.getvalue()[:18]
    for length in (3, 8, 17):
        assert receive(io.BytesIO(whole[:length])) is None
    assert SIZE >= 2000 + 64
    assert SIZE % 4096 == 0


def test_recorded_outputs_are_those_of_the_newest_instant_that_is_not_later() -> None:
    shown = output("place", "Place", "m", shape=(7,))
    values = np.arange(6.0).reshape(3, 2)
    player = Player((shown,), np.array([10, 20, 40]), {"place": values})
    assert [v.shape for v in player.variables] == [(2,)]
    for start, row in ((5, 0), (10, 0), (19, 0), (20, 1), (39, 1), (40, 2), (90, 2)):
        assert player.initialise(start, {})["place"].tolist() == values[row].tolist()
    assert player.do_step(15, 4, {})["place"].tolist() == [0, 1]
    assert player.do_step(15, 5, {})["place"].tolist() == [2, 3]
    for instants, got in (([10, 20], "got 3 at 2"), ([], "got 3 at 0")):
        with pytest.raises(ConfigurationError) as caught:
            Player((shown,), np.array(instants, np.int64), {"place": values})
        assert str(caught.value) == f"place: must have a value at each instant, {got}"
    with pytest.raises(ConfigurationError, match=r"got 0 at 0$"):
        Player((shown,), np.array([], np.int64), {"place": values[:0]})
