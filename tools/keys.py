"""Write the keys of a scenario, with their types, for type checkers and editors.

    python tools/keys.py

They come from the tables of `sblcosim.scenario`, and so from the declarations of the components. A
test checks that the file is current.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, Literal, get_args, get_origin

from pydantic import BaseModel
from sblcosim.scenario.scenario import Scenario

FILE = Path(__file__).parents[1] / "orchestrator" / "scenario" / "keys.py"
_HEAD = '''"""The keys that overrides may change, and their types; made by ``tools/keys.py``."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypedDict

Overrides = TypedDict(
    "Overrides",
    {
'''
_TAIL = '''    },
    total=False,
)
Overrides.__doc__ = "Keys of a scenario, ``table.key``, or whole tables; None takes a key back."
'''
_WIDTH = 100


def text() -> str:
    """The text of the module."""
    return _HEAD + "".join(_entry(key, kind) for key, kind in _keys()) + _TAIL


def _keys() -> Iterator[tuple[str, str]]:
    """All keys and their types, in Python's notation."""
    for name, field in Scenario.model_fields.items():
        table = field.annotation
        if not (isinstance(table, type) and issubclass(table, BaseModel)):
            yield name, _kind(table)
            continue
        yield name, "Mapping[str, Any]"
        variables = getattr(table, "variables", {})
        for key, inner in table.model_fields.items():
            shape = variables[key].shape if key in variables else ()
            yield f"{name}.{key}", _kind(inner.annotation, shape)


def _kind(annotation: Any, shape: tuple[int, ...] = ()) -> str:
    """A type in Python's notation, without None; a two-dimensional array is given by rows."""
    origin, inner = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _kind(inner[0], shape)
    if origin is Literal:
        return f"Literal[{', '.join(map(_quoted, inner))}]"
    if origin is tuple:
        row = f"Sequence[{_kind(inner[0])}]"
        return f"Sequence[{row}]" if len(shape) == 2 else row
    if origin is dict:
        return "Mapping[str, Any]"
    if origin is not None:  # a union
        return " | ".join(_kind(each, shape) for each in inner if each is not NoneType)
    return str(annotation.__name__)


def _quoted(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else repr(value)


def _entry(key: str, kind: str) -> str:
    line = f'        "{key}": {kind} | None,\n'
    if len(line) <= _WIDTH:
        return line
    head, _, choices = kind.partition("[")
    inner = "".join(f"            {each},\n" for each in choices.removesuffix("]").split(", "))
    return f'        "{key}": {head}[\n{inner}        ] | None,\n'


if __name__ == "__main__":
    FILE.write_text(text(), "utf-8")
