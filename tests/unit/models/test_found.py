"""Declarations that lack a part, or have a wrong one: one line that names the file."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import fields
from pathlib import Path

import pytest
from sblcosim.models.acoustics.range_error import RangeError
from sblcosim.models.declaration import DeclarationError
from sblcosim.models.found import declared
from sblcosim.models.receiver.receiver import ReceiverDeclaration
from sblcosim.models.target.trajectory import Trajectory

KINDS = {
    "TRAJECTORY": (Trajectory, "sblcosim.models.target.trajectory", {
        "number": "9", "equations": "lambda: None",
    }),
    "RANGE_ERROR": (RangeError, "sblcosim.models.acoustics.range_error", {
        "number": "9", "words": "'bubbles'", "parameters": "()", "error": "lambda p, w: 0.0",
    }),
    "RECEIVER": (ReceiverDeclaration, "sblcosim.models.receiver.receiver", {
        "component": "receiver('Own', 90, 'A receiver', ())",
    }),
}  # fmt: skip
NEEDED = [
    (name, part) for name, parts in {
        "TRAJECTORY": ("number",), "RANGE_ERROR": ("number", "words", "parameters", "error"),
        "RECEIVER": ("component",),
    }.items() for part in parts
]  # fmt: skip

Written = Callable[[str], str]


@pytest.fixture
def written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Written]:
    """Write the module ``own`` of a package; returns the package's name."""
    name = f"declares_{tmp_path.name.replace('-', '_')}"
    (tmp_path / name).mkdir()
    (tmp_path / name / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)

    def write(text: str) -> str:
        (tmp_path / name / "own.py").write_text(text)
        return name

    yield write
    for module in [it for it in sys.modules if it.partition(".")[0] == name]:
        del sys.modules[module]


def text_of(name: str, **changed: str | None) -> str:
    """A module that declares, with parts changed or (None) left out."""
    kind, home, parts = KINDS[name]
    kept = {key: value for key, value in {**parts, **changed}.items() if value is not None}
    arguments = ", ".join(f"{key}={value}" for key, value in kept.items())
    return (
        f"from {home} import {kind.__name__}\n"
        "from sblcosim.models.receiver.variables import receiver\n"
        f"{name} = {kind.__name__}({arguments})\n"
    )


@pytest.mark.parametrize("name", KINDS)
def test_what_is_complete_is_found(written: Written, name: str) -> None:
    kind = KINDS[name][0]
    (found,) = declared(written(text_of(name)), name, kind).items()
    assert found[0] == "own"
    assert isinstance(found[1], kind)


@pytest.mark.parametrize(("name", "part"), NEEDED)
def test_a_part_that_is_missing_is_named(written: Written, name: str, part: str) -> None:
    with pytest.raises(DeclarationError) as raised:
        declared(written(text_of(name, **{part: None})), name, KINDS[name][0])
    assert str(raised.value).startswith(f"own.py: must declare {name} completely: ")
    assert f"'{part}'" in str(raised.value)


@pytest.mark.parametrize("name", KINDS)
def test_a_part_that_does_not_exist_is_named(written: Written, name: str) -> None:
    with pytest.raises(DeclarationError, match=r"own\.py: must declare .*'colour'"):
        declared(written(text_of(name, colour="1")), name, KINDS[name][0])


@pytest.mark.parametrize("value", ["0", "-1", "1.5", "'7'", "None", "True"])
@pytest.mark.parametrize("name", ["TRAJECTORY", "RANGE_ERROR"])
def test_a_number_is_a_whole_number(written: Written, name: str, value: str) -> None:
    parts = text_of(name).replace("number=9", f"number={value}")
    with pytest.raises(DeclarationError) as raised:
        declared(written(parts), name, KINDS[name][0])
    assert str(raised.value) == (
        f"own.py: {name}: number must be a whole number from 1, got {value}"
    )


WRONG = [
    *(("TRAJECTORY", part, value) for part in ("takes", "parameters", "draws")
      for value in ("3", "'x'", "None")),
    *(("TRAJECTORY", part, value) for part in ("equations",) for value in ("3", "'x'")),
    ("TRAJECTORY", "random", "3"), ("TRAJECTORY", "random", "None"), ("TRAJECTORY", "place", "'x'"),
    *(("RANGE_ERROR", part, value) for part in ("parameters", "draws", "random")
      for value in ("3", "'x'", "None")),
    *(("RANGE_ERROR", "error", value) for value in ("3", "'x'", "None")),
    *(("RANGE_ERROR", "words", value) for value in ("3", "None", "()")),
    ("RANGE_ERROR", "modelled", "'x'"), ("RANGE_ERROR", "sizes", "3"),
    ("RECEIVER", "purpose", "3"), ("RECEIVER", "equations", "'x'"),
]


@pytest.mark.parametrize(("name", "part", "value"), WRONG)
def test_a_part_of_a_wrong_type_is_named(
    written: Written, name: str, part: str, value: str
) -> None:
    with pytest.raises(DeclarationError) as raised:
        declared(written(text_of(name, **{part: value})), name, KINDS[name][0])
    said = str(raised.value)
    assert said.startswith("own.py: ")
    assert part in said
    assert said.endswith(f"got {value}")


@pytest.mark.parametrize(
    ("name", "part"), [(name, it.name) for name in KINDS for it in fields(KINDS[name][0])]
)
def test_every_part_has_a_type(written: Written, name: str, part: str) -> None:
    with pytest.raises(DeclarationError, match=rf"^own\.py: .*{part}"):
        declared(written(text_of(name, **{part: "object()"})), name, KINDS[name][0])


@pytest.mark.parametrize(("name", "part"), [
    (name, it.name) for name in KINDS for it in fields(KINDS[name][0]) if "tuple[" in str(it.type)
])  # fmt: skip
@pytest.mark.parametrize("element", ["3", "None", "object()"])
def test_every_element_has_a_type(written: Written, name: str, part: str, element: str) -> None:
    with pytest.raises(DeclarationError, match=rf"^own\.py: .*{part} must be .*tuple"):
        declared(written(text_of(name, **{part: f"({element},)"})), name, KINDS[name][0])


@pytest.mark.parametrize(("component", "said"), [
    ("3", "component must be Component, got 3"),
    ("None", "component must be Component, got None"),
    ("receiver(3, 90, 'x', ())", "name must be str, got 3"),
    ("receiver('Own', None, 'x', ())", "number must be int, got None"),
    ("receiver('Own', 'a', 'x', ())", "number must be int, got 'a'"),
    ("receiver('Own', 90, 3, ())", "description must be str, got 3"),
    ("receiver('Own', 90, 'x', (3,))", "parameters must be tuple[Variable, ...], got (3,)"),
    ("receiver('Own', 90, 'x', parameters=3)", "parameters must be tuple[Variable, ...], got 3"),
    ("receiver('Own', 90, 'x')", "'parameters'"),
])  # fmt: skip
def test_a_wrong_component_is_named(written: Written, component: str, said: str) -> None:
    with pytest.raises(DeclarationError) as raised:
        declared(written(text_of("RECEIVER", component=component)), "RECEIVER", ReceiverDeclaration)
    assert str(raised.value).startswith("own.py: ")
    assert str(raised.value).endswith(said)


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize(("text", "got"), [
    ("x = (", "SyntaxError"), ("import nothing_here", "ModuleNotFoundError"),
    ("x = nothing", "NameError"), ("x = 1 / 0", "ZeroDivisionError"),
])  # fmt: skip
def test_a_module_that_cannot_be_imported_is_named(
    written: Written, name: str, text: str, got: str
) -> None:
    said = rf"^own\.py: must be a module that can be imported, got {got}: "
    with pytest.raises(DeclarationError, match=said):
        declared(written(text), name, KINDS[name][0])


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize(("text", "got"), [("", "none"), ("{} = 3", "int"), ("{} = 'x'", "str")])
def test_a_module_must_declare_one(written: Written, name: str, text: str, got: str) -> None:
    kind = KINDS[name][0]
    with pytest.raises(DeclarationError) as raised:
        declared(written(text.format(name)), name, kind)
    assert str(raised.value) == (
        f"own.py: must declare {name}, of the type {kind.__name__}, got {got}"
    )
