"""Answers about files that are worked out once."""

from __future__ import annotations

from pathlib import Path

from sblcosim.fmus import unchanged
from sblcosim.fmus.build import factory
from sblcosim.fmus.read import ports
from seams import Seam


def test_a_question_is_answered_once_while_files_stay_as_they_are() -> None:
    asked: list[int] = []

    def answer() -> int:
        asked.append(1)
        return len(asked)

    assert [unchanged.once("q", answer), unchanged.once("q", answer)] == [1, 2]
    with unchanged.assumed():
        assert [unchanged.once("q", answer), unchanged.once("q", answer)] == [3, 3]
        assert unchanged.once("other", answer) == 4
    assert unchanged.once("q", answer) == 5


def test_fmus_are_looked_at_once(seam: Seam) -> None:
    looks: list[Path] = []
    opened = ports.opened
    seam.instead(ports.opened, lambda path: (looks.append(path), opened(path))[1])
    with unchanged.assumed():
        paths = {factory.build("target"), factory.build("target", 3), factory.build("target")}
        assert len(paths) == 2
        assert len({id(ports.read(path)) for path in [*paths, *paths]}) == 2
    assert sorted(looks) == sorted(paths)
