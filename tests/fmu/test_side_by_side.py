"""What the cache lacks: announced, built side by side, and nothing half-written after an error."""

from __future__ import annotations

import os
import re
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from sblcosim.fmus import files
from sblcosim.fmus.build import compiler, factory
from sblcosim.fmus.build.factory import Wanted
from sblcosim.fmus.errors import BuildError
from sblcosim.fmus.host.libraries import ours
from sblcosim.fmus.read.ports import read
from sblcosim.models import declared
from seams import Seam

FOUR = [
    Wanted(name, fmi, constants={"beacons": 6})
    for name in ("range_model", "platform") for fmi in (2, 3)
]  # fmt: skip
TWO_LINES = re.compile(
    r"compiling (.+): about \d+ (?:s|min) on an idle machine\n"
    r"compiled in \d+ (?:s|min), and kept for later runs\n"
)


@pytest.fixture
def said(capfd: pytest.CaptureFixture[str]) -> Callable[[], list[str]]:
    """What has been announced since the last call; nothing else may be on standard error."""

    def announced() -> list[str]:
        out, err = capfd.readouterr()
        names = TWO_LINES.findall(err)
        assert (out, TWO_LINES.sub("", err)) == ("", "")
        return names

    return announced


def hidden(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if files.is_hidden(path.name)]


def baked(*names: str) -> list[Wanted]:
    """FMUs that need one run of the compiler each."""
    return [Wanted(name, baked=replace(declared(name), stop_time=7.0)) for name in names]


class Turns:
    """A stand-in for the compiler's method: does something before each of its calls."""

    def __init__(self, seam: Seam, before: Callable[[int], None]) -> None:
        self.calls: list[tuple[str, ...]] = []
        compile_ = compiler.Compiler.compile

        def counted(self_: Any, source: str, *more: Any) -> None:
            self.calls.append((source, *more[2]))
            before(len(self.calls))
            compile_(self_, source, *more)

        seam.instead(compiler.Compiler.compile, counted)


@pytest.mark.slow
def test_four_at_once_are_the_same_bytes_as_one_after_the_other(
    fresh_cache: Path, monkeypatch: pytest.MonkeyPatch, said: Callable[[], list[str]]
) -> None:
    together = factory.build_all(FOUR)
    assert [path.name for path in together] == [
        "range_model6.fmu", "range_model6.fmu", "platform6.fmu", "platform6.fmu"
    ]  # fmt: skip
    assert said() == ["range_model6, platform6"]
    assert all(map(files.intact, together))
    assert all(ours(read(path)) for path in together)
    monkeypatch.setenv(factory.CACHE_VARIABLE, str(fresh_cache.with_name("apart")))
    apart = [factory.build(w.name, w.fmi, **w.constants) for w in FOUR]
    assert said() == ["range_model6", "range_model6", "platform6", "platform6"]
    for one, other in zip(together, apart, strict=True):
        assert one.relative_to(fresh_cache) == other.relative_to(fresh_cache.with_name("apart"))
        assert one.read_bytes() == other.read_bytes()
    assert content(fresh_cache) == content(fresh_cache.with_name("apart"))


def content(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_nothing_is_said_when_all_are_in_the_cache(
    fresh_cache: Path, said: Callable[[], list[str]], seam: Seam
) -> None:
    factory.build_all(FOUR[:2])
    assert said() == ["range_model6"]
    turns = Turns(seam, lambda _: None)
    factory.build_all(FOUR[:2])
    factory.build("range_model", 3, beacons=6)
    assert (said(), turns.calls) == ([], [])
    factory.build_all(FOUR[:3])  # the name of what is missing, alone
    assert said() == ["platform6"]


def test_libraries_are_announced_too(fresh_cache: Path, said: Callable[[], list[str]]) -> None:
    for _ in range(2):
        factory.library("small", {"small.c": b"int f(void);\nint f(void) { return 1; }\n"},
                        compiler=compiler.find())  # fmt: skip
    assert said() == ["library small"]


def test_the_engines_of_both_versions_are_compiled_once(fresh_cache: Path, seam: Seam) -> None:
    turns = Turns(seam, lambda _: None)
    factory.build_all(FOUR[:2])
    assert len(turns.calls) == len({*turns.calls})
    assert {"fmi2.c", "fmi3.c", "lanes.c", "dispatch.c"} == {call[0] for call in turns.calls}
    shared = [call for call in turns.calls if "-DSHARED_ENGINE" in call]
    assert sorted(call[0] for call in shared) == ["fmi2.c", "fmi3.c", "lanes.c"]


@pytest.mark.slow
def test_the_functions_of_fmi_have_no_engine_of_their_own(
    fresh_cache: Path, seam: Seam
) -> None:
    """Unless the FMU has no others."""
    sizes: dict[str, int] = {}
    compile_ = compiler.Compiler.compile

    def measured(own: Any, source: str, output: str, include: Any, flags: Any, folder: Path
                 ) -> None:
        compile_(own, source, output, include, flags, folder)
        sizes[source] = (folder / output).stat().st_size

    seam.instead(compiler.Compiler.compile, measured)
    factory.build("platform", 3)
    alone = dict(sizes)
    factory.build_all(baked("platform"))
    assert sizes["fmi2.c"] > alone["fmi3.c"] + 0.5 * alone["lanes.c"]


def test_a_request_made_twice_is_built_once(fresh_cache: Path, seam: Seam) -> None:
    turns = Turns(seam, lambda _: None)
    one, other = factory.build_all(2 * baked("range_model"))
    assert one == other
    assert len(turns.calls) == 1


def test_different_fmus_are_compiled_at_the_same_time(
    fresh_cache: Path, monkeypatch: pytest.MonkeyPatch, seam: Seam
) -> None:
    both = threading.Barrier(2, timeout=600)
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    Turns(seam, lambda _: both.wait() and None)
    assert len({*factory.build_all(baked("range_model", "platform"))}) == 2


def test_the_first_error_cancels_the_others_and_nothing_is_half_written(
    fresh_cache: Path, monkeypatch: pytest.MonkeyPatch, seam: Seam
) -> None:
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    asked = baked("range_model", "platform", "acoustics", "multilateration", "sequential", "ekf")

    def before(call: int) -> None:
        if call == 2:
            raise BuildError("cc failed:\nthe second is wrong")
        if call > 2:
            time.sleep(0.5)  # cancelling takes a millisecond

    turns = Turns(seam, before)
    with pytest.raises(BuildError, match=r"\Acc failed:\nthe second is wrong\Z"):
        factory.build_all(asked)
    assert len(turns.calls) < len(asked)
    (complete,) = fresh_cache.rglob("*.fmu")
    assert complete.name == "range_model.fmu"
    assert files.intact(complete)
    assert hidden(fresh_cache) == []


@pytest.mark.parametrize("closed", [True, False], ids=["closed", "missing"])
def test_without_standard_error_nothing_is_said(
    closed: bool, fresh_cache: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    with (tmp_path / "file").open("w") as file:
        monkeypatch.setattr("sys.stderr", file if closed else None)
    assert factory.build("range_model").is_file()
    assert capfd.readouterr() == ("", "")
