"""The one place where tests put something else where the product has its own.

A function or class is named by the object itself, so a module that moves is an edit of an import.
Whoever has imported it, under whatever name, finds the stand-in. Numbers are in the table below.
"""

from __future__ import annotations

import ast
import inspect
import sys
from collections.abc import Iterator
from functools import cache, reduce
from types import ModuleType
from typing import Any, Self

import pytest


@cache
def numbers() -> dict[str, tuple[ModuleType, str]]:
    """Where the numbers of the product stand that tests make small, or large."""
    from sblcosim.analysis.common import bounds
    from sblcosim.analysis.levels import linear
    from sblcosim.cli.common import app
    from sblcosim.estimation import smoother
    from sblcosim.fmus.build import rolling
    from sblcosim.fmus.conformance import runner as conformance
    from sblcosim.fmus.read import archive, description
    from sblcosim.limits import places
    from sblcosim.models.receiver import bound
    from sblcosim.paths import earth
    from sblcosim.processing import dive, windows
    from sblcosim.require import limiting
    from sblcosim.results.figures import animation
    from sblcosim.simulation.children import process
    from sblcosim.simulation.masters import lanes, replay
    from sblcosim.study import executors, parts, runner
    from sblcosim.tracks import read, track

    return {
        "alone": (runner, "ALONE"),
        "archive_bytes": (archive, "MAX_FILE"),
        "archive_files": (archive, "MAX_ENTRIES"),
        "archive_unpacked": (archive, "MAX_UNPACKED"),
        "batch": (runner, "BATCH"),
        "close": (smoother, "CLOSE"),
        "design_numbers": (linear, "MOST_NUMBERS"),
        "dive_instants": (dive, "MOST_INSTANTS"),
        "elements": (description, "MAX_ELEMENTS"),
        "far_std": (bound, "FAR_STD"),
        "farewell": (process, "FAREWELL"),
        "few_lines": (windows, "TOGETHER"),
        "frames": (animation, "FRAMES"),
        "group": (parts, "GROUP"),
        "kept_steps": (runner, "KEPT_STEPS"),
        "limiting_runs": (limiting, "RUNS"),
        "most_steps": (places, "MOST_STEPS"),
        "path_points": (earth, "MOST_POINTS"),
        "patience": (conformance, "PATIENCE"),
        "reach": (bounds, "REACH"),
        "rolled_from": (rolling, "MANY"),
        "rolled_gain": (rolling, "LEAST"),
        "replayed_together": (replay, "_TOGETHER"),
        "room_bytes": (lanes, "ROOM_BYTES"),
        "track_bytes": (read, "LARGEST"),
        "track_points": (track, "MOST_POINTS"),
        "variables": (description, "MAX_VARIABLES"),
        "waiting": (app, "PATIENCE"),
        "worker_patience": (executors, "PATIENCE"),
    }


def program(**values: Any) -> str:
    """Text for ``python -c``: the command line with other values of the numbers of the table."""
    lines = ["from sblcosim import cli"]
    for known_as, value in values.items():
        module, name = numbers()[known_as]
        lines.append(f"import {module.__name__} as module; module.{name} = {value!r}")
    return "\n".join([*lines, "cli.main()"])


class Seam:
    """Stand-ins for things of the product, until the end of a test or a block.

    In a test it is the fixture ``seam``; elsewhere ``with Seam() as seam:``.
    """

    def __init__(self) -> None:
        self._patch = pytest.MonkeyPatch()
        self._made: list[tuple[Any, Any, list[tuple[ModuleType, str]]]] = []
        self._forgetful: list[ModuleType] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.undo()

    def instead(self, thing: Any, stand_in: Any, only: ModuleType | None = None) -> None:
        """Put a stand-in where the product has a function, a class, a method or another object.

        With ``only`` nobody but that module finds it.
        """
        assert not isinstance(thing, int | float | str | None), "others may be equal: use `tuned`"
        places: list[tuple[Any, str]] = [p for p in _holders(thing) if only in (None, p[0])]
        *owners, name = getattr(thing, "__qualname__", "").split(".")
        if owners and "<locals>" not in owners:
            places.append((reduce(getattr, owners, sys.modules[thing.__module__]), name))
        assert places, f"nobody in sblcosim has {thing}"
        self._made.append((thing, stand_in, [*_holders(stand_in)]))
        for place, name in places:
            self._patch.setattr(place, name, stand_in)

    def tuned(self, **values: Any) -> None:
        """Give numbers of the product, by their names in the table, other values."""
        for known_as, value in values.items():
            module, name = numbers()[known_as]
            now = getattr(module, name)
            for place, other in [*_holders(now)]:
                if other == name:
                    self._patch.setattr(place, name, value)

    def forgets(self, *modules: ModuleType) -> None:
        """Modules remember nothing of earlier calls, as in a new process; nor afterwards."""
        self._forgetful.extend(modules)
        for module in modules:
            for memory in _memories(module):
                (memory.cache_clear if hasattr(memory, "cache_clear") else memory.clear)()

    def undo(self) -> None:
        """Put everything back, in modules too that were loaded in the meantime."""
        self._patch.undo()
        for thing, stand_in, its_own in reversed(self._made):
            for place, name in [*_holders(stand_in)]:
                if (place, name) not in its_own:
                    setattr(place, name, thing)
        self._made.clear()
        self.forgets(*self._forgetful)
        self._forgetful.clear()


def _holders(thing: Any) -> Iterator[tuple[ModuleType, str]]:
    """Modules of the product that have something, and the names by which they have it."""
    for known_as, module in [*sys.modules.items()]:
        own = known_as.partition(".")[0] == "sblcosim"
        if own and id(thing) in map(id, vars(module).values()):
            yield from ((module, name) for name, value in vars(module).items() if value is thing)


def _memories(module: ModuleType) -> Iterator[Any]:
    """What a module keeps from call to call: cached functions, and what is empty at first."""
    yield from (own for own in vars(module).values() if hasattr(own, "cache_clear"))
    for node in ast.parse(inspect.getsource(module)).body:
        if isinstance(node, ast.AnnAssign | ast.Assign) and node.value is not None:
            target = node.target if isinstance(node, ast.AnnAssign) else node.targets[0]
            if ast.unparse(node.value) in ("{}", "set()", "[]"):
                yield getattr(module, ast.unparse(target))
