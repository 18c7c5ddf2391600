"""Numbers that may be given by a name: what follows from the one declaration."""

from __future__ import annotations

import math
import pickle
import xml.etree.ElementTree as ET
from dataclasses import replace
from typing import Any

import pytest
from sblcosim.fmus.build.description import model_description
from sblcosim.models import COMPONENTS, RECEIVERS
from sblcosim.models.declaration import Component, Variable, parameter
from sblcosim.models.loading import load
from sblcosim.models.settings.keys import OF_RECEIVERS, default, in_si, start_of, within

ANGLE = parameter("turn", "An angle", "rad", start=math.radians(30), min=0.0, max=math.pi,
                  named={"free": -1.0, "locked": 9.0})  # fmt: skip
LEARN = ("coupled", "fixed_lag", "long_baseline", "array")
KEY = "acceleration_psd_m2_s3"


def component(variable: Variable) -> Component:
    return Component("Some", 900, "For a test", (variable,), None)


def test_bounds_of_the_fmu_include_the_named_values_and_those_of_numbers_do_not() -> None:
    assert (ANGLE.min, ANGLE.max) == (-1.0, 9.0)
    assert ANGLE.bounds == (0.0, math.pi)
    assert ANGLE.legend == "An angle; -1: free; 9: locked"
    above = parameter("x", "Unbounded above", min=0.0, named={"off": -3.0})
    assert (above.min, above.max, above.bounds) == (-3.0, None, (0.0, None))
    plain = parameter("x", "A number", min=0.0, max=2.0)
    assert plain.bounds == (plain.min, plain.max) == (0.0, 2.0)
    assert plain.unnamed == plain
    assert (ANGLE.unnamed.min, ANGLE.unnamed.max, ANGLE.unnamed.named) == (0.0, math.pi, None)
    assert ANGLE.unnamed.legend == "An angle"


@pytest.mark.parametrize("copied", [replace(ANGLE, description="Another"),
                                    pickle.loads(pickle.dumps(ANGLE)),
                                    replace(replace(ANGLE, start=0.0), start=1.0)])  # fmt: skip
def test_a_copy_has_the_same_bounds(copied: Variable) -> None:
    assert (copied.min, copied.max, copied.bounds) == (-1.0, 9.0, (0.0, math.pi))


@pytest.mark.parametrize(
    ("rest", "message"),
    [
        ({"min": 0.0, "named": {"on": 0.5}}, "'on' must be outside the bounds of numbers"),
        ({"named": {"on": -1.0}}, "'on' must be outside the bounds of numbers"),
        ({"min": 0.0, "shape": (2,), "named": {"on": -1.0}}, "only a number can have named values"),
        ({"type": "Int32", "start": 1, "min": 0, "named": {"on": -1}}, "only a number"),
        ({"type": "Boolean", "start": True, "named": {"on": -1}}, "only a number"),
        ({"start": 1, "choices": {1: "a", 2: "b"}, "named": {"on": -1.0}}, "only a number"),
    ],
)
def test_a_name_that_a_number_could_mean_is_refused(rest: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        parameter("x", "Something", **rest)


def test_a_name_becomes_its_value_and_has_no_unit() -> None:
    assert in_si(ANGLE, "free") == -1.0
    assert in_si(ANGLE, "locked") == 9.0
    assert in_si(ANGLE, 180.0) == pytest.approx(math.pi)
    assert within(ANGLE, -5.0) == 0.0  # what is assumed is never a named value
    assert within(ANGLE, 500.0) == 180.0


def test_a_start_that_is_a_named_value_is_shown_by_its_name() -> None:
    assert default(component(ANGLE), ANGLE) == pytest.approx(30)
    free = replace(ANGLE, start=-1.0)
    assert default(component(free), free) == "free"


@pytest.mark.parametrize("name", [n for n, r in RECEIVERS.items() if KEY in {v.key for v in r}])
def test_who_learns_has_it_in_its_fmu_and_the_others_keep_their_start(name: str) -> None:
    psd = RECEIVERS[name]["acceleration_psd"]
    low, value = (-1.0, -1.0) if name in LEARN else (0.0, 0.01)
    assert (psd.min, psd.bounds, psd.starts) == (low, (0.0, None), (0.01,))
    assert in_si(psd, "learned") == value
    assert in_si(psd, 0.25) == 0.25
    assert psd.legend.endswith("; -1: learned") == (name in LEARN)
    for fmi in (2, 3):
        root = ET.fromstring(model_description(load(name), fmi, "token", []))
        (found,) = root.findall(".//*[@name='acceleration_psd']")
        assert found.get("description") == psd.legend
        (low_there,) = {e.get("min") for e in found.iter()} - {None}
        assert float(low_there) == low


def test_all_that_take_a_word_are_declared_alike() -> None:
    named = {(name, v.name) for name, c in COMPONENTS.items() for v in c if v.named}
    assert named == {("platform", "wave_period"), *((name, "acceleration_psd") for name in LEARN)}
    assert OF_RECEIVERS[KEY].named == {"learned": -1.0}
    assert start_of(KEY) == 0.01
