"""Arrays in a scenario file: row by row, some with one row per beacon or point."""

from __future__ import annotations

import math
from typing import Any

from pydantic_core import PydanticCustomError
from sblcosim.models.declaration import Dimension, Variable


def most(bound: float | None) -> float | None:
    """The largest value of a size that may be a constant of the build."""
    return bound.most if isinstance(bound, Dimension) else bound


def counts_of(variable: Variable, partial_rows: bool) -> tuple[int, int]:
    """Smallest and largest number of rows of an array."""
    if variable.rows is not None:
        return 0 if partial_rows else variable.rows.least, variable.rows.most
    return 0 if partial_rows else variable.shape[0], variable.shape[0]


def flat(shape: tuple[int, ...], counts: tuple[int, int], value: Any) -> Any:
    """Flatten rows and check the number of elements."""
    if not isinstance(value, list | tuple):
        return value  # not an array: pydantic refuses it later
    parts = [row if isinstance(row, (list, tuple)) else (row,) for row in value]
    flat = tuple(x for row in parts for x in row)
    width = math.prod(shape[1:])
    low, high = counts
    fits = len(flat) % width == 0 and low * width <= len(flat) <= high * width
    nested = {len(row) for row in parts}
    if fits and (not nested or nested == {1} or nested == {width}):
        return flat
    if low == high:
        wanted = " x ".join(map(str, shape)) + " numbers"
    else:
        most = f"{low} to {high}" if low else f"at most {high}"
        wanted = f"{most} rows of {width} numbers" if len(shape) > 1 else f"{most} numbers"
    raise PydanticCustomError("shape", "must be an array of {wanted}", {"wanted": wanted})


def json_schema(
    variable: Variable, counts: tuple[int, int], low: float | None, high: float | None
) -> dict[str, Any]:
    """JSON schema of the input of `flat`: elements in sequence, or by rows."""
    bounds = {"minimum": low, "maximum": high}
    kind = "integer" if variable.type == "Int32" else "number"
    element = {"type": kind} | {k: v for k, v in bounds.items() if v is not None}
    width = math.prod(variable.shape[1:])

    def array(items: dict[str, Any], of: int) -> dict[str, Any]:
        least, most = (of * n for n in counts)
        return {"type": "array", "items": items, "minItems": least, "maxItems": most}

    flat = array(element, width)
    if len(variable.shape) == 1:
        return flat
    row = {"type": "array", "items": element, "minItems": width, "maxItems": width}
    return {"anyOf": [array(row, 1), flat]}
