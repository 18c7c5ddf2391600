"""Trajectories and receivers, each declared in one module: what follows from that."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from itertools import product
from pathlib import Path

import pytest
from sblcosim.models import RECEIVERS
from sblcosim.models.declaration import Component
from sblcosim.models.receiver.receiver import ReceiverDeclaration, in_order
from sblcosim.models.receiver.receivers import FOUND as DECLARED
from sblcosim.models.target.trajectories import FOUND
from sblcosim.models.target.trajectory import HORIZONTAL, Trajectory, numbered
from sblcosim.models.target.variables import COMPONENT, SHARED

ROOT = Path(__file__).parents[3]


def has_effect(name: str, **values: float) -> bool:
    """Whether a parameter has one, where others are at their start values or as given."""
    return all(
        any(c.holds(values.get(c.parameter, COMPONENT[c.parameter].starts[0])) for c in group)
        for group in COMPONENT[name].needs
    )


def test_a_parameter_has_an_effect_with_the_trajectories_that_take_it() -> None:
    own = {v.name for it in FOUND.values() for v in it.parameters}
    assert own
    for name in own | {n for it in FOUND.values() for n in it.takes}:
        for trajectory in FOUND.values():
            taken = name in trajectory.all
            assert has_effect(name, trajectory=trajectory.number, speed=1.0) == taken


def test_who_does_not_take_the_speed_moves_without_it() -> None:
    still = {it.number for it in FOUND.values()
             if has_effect("departure_time", trajectory=it.number, speed=0.0)}  # fmt: skip
    assert still == {it.number for it in FOUND.values()
                     if "departure_time" in it.all and "speed" not in it.all}  # fmt: skip
    assert still


def test_a_seed_has_an_effect_where_the_sensor_or_the_trajectory_is_random() -> None:
    stds = sorted({s for it in FOUND.values() if it.random != "always" for s in it.random})
    for it, sensor, *values in product(FOUND.values(), (0.0, 0.1), *[(0.0, 0.1)] * len(stds)):
        given = dict(zip(stds, values, strict=True))
        drawn = it.random == "always" or any(given[s] for s in it.random)
        random = has_effect(
            "seed", trajectory=it.number, depth_std=sensor, depth_bias_std=0.0, **given
        )
        assert random == (drawn or sensor > 0)


def any_trajectory(number: int) -> Trajectory:
    return replace(FOUND["square"], number=number)


def test_numbers_decide_the_order_and_are_no_one_elses() -> None:
    assert [*numbered({"b": any_trajectory(3), "a": any_trajectory(7), "c": any_trajectory(1)})] \
        == ["c", "b", "a"]  # fmt: skip
    with pytest.raises(ValueError, match="a number of its own, got 3 for b and c; 4 is free"):
        numbered({"b": any_trajectory(3), "c": any_trajectory(3)})


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"course": None}, "must have a course with its length"),
        ({"length": None}, "must have a course with its length"),
        ({"course": None, "length": None}, "must have a course, or equations"),
        ({"equations": lambda: None}, "must have a course, or equations"),
    ],
)
def test_a_trajectory_has_a_course_or_equations(fields: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(FOUND["square"], **fields)


def test_receivers_are_listed_by_number_but_for_those_with_a_place() -> None:
    def of(number: int, place: int | None = None) -> ReceiverDeclaration:
        return ReceiverDeclaration(Component("N", number, "", (), None), place=place)

    order = in_order({"last": of(2, 9), "new": of(9), "first": of(1), "newest": of(10)})
    assert [*order] == ["first", "last", "new", "newest"]
    assert [*RECEIVERS] == [*DECLARED]


def test_a_receiver_that_is_not_for_everything_says_what_it_is_for() -> None:
    with pytest.raises(ValueError, match="Coupled: must have a purpose"):
        replace(DECLARED["coupled"], purpose="")
    assert all(it.purpose for it in DECLARED.values())


TAKES = """
from ...declaration import parameter
from ..course import circle
from ..trajectory import HORIZONTAL, Trajectory

TRAJECTORY = Trajectory(number=70, takes=(*HORIZONTAL, {takes!r}),
                        course=circle, length=lambda p: p.{takes})
"""
ASKED = """
import json, sys
from sblcosim.models import COMPONENTS
target = COMPONENTS["target"]
print(json.dumps([target["trajectory"].choices, [v.name for v in target]]))
assert "casadi" not in sys.modules
"""


def added(tmp_path: Path, text: str) -> subprocess.CompletedProcess[str]:
    """What the Target has in a copy of the models with one file more."""
    package = tmp_path / "sblcosim" / "models"
    shutil.copytree(ROOT / "models", package, ignore=shutil.ignore_patterns("__pycache__"))
    (package.parent / "__init__.py").touch()
    (package / "target" / "trajectories" / "loop.py").write_text(text)
    return subprocess.run(
        [sys.executable, "-B", "-c", ASKED], capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
    )  # fmt: skip


def test_a_file_in_the_folder_is_a_trajectory(tmp_path: Path) -> None:
    done = added(tmp_path, TAKES.format(takes="radius"))
    assert done.returncode == 0, done.stderr
    choices, names = json.loads(done.stdout)
    assert choices["70"] == "loop"
    assert names == [v.name for v in COMPONENT]


def test_the_recipe_says_which_numbers_and_names_are_free() -> None:
    text = " ".join((ROOT / "CONTRIBUTING.md").read_text("utf-8").split())
    assert f"Numbers from {max(it.number for it in FOUND.values()) + 1} are free" in text
    *first, last = (f"`{v.name}`" for v in SHARED)
    assert f"the shared {', '.join(first)} and {last} (`HORIZONTAL` is all of them but" in text
    assert {v.name for v in SHARED} - {*HORIZONTAL} == {"heading"}


def test_a_trajectory_that_takes_what_nobody_declares_is_refused(tmp_path: Path) -> None:
    done = added(tmp_path, TAKES.format(takes="radios"))
    line = done.stderr.splitlines()[-1]
    assert "DeclarationError: trajectory loop: must take shared parameters (speed, " in line
    assert line.endswith(" or those of another trajectory, got 'radios'; did you mean 'radius'?")
