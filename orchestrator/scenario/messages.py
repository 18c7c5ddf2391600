"""Pydantic's errors in a scenario, in our own wording."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence

from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from ..errors import nearest, quoted, shortened
from .schema import NAMED, Table, toml

# --- Messages ------------------------------------------------------------------------------------

Fields = Mapping[str, FieldInfo]
"""The keys of a scenario, as described by pydantic."""


def lines(
    error: ErrorDetails, where: str, changed: set[tuple[str, ...]], fields: Fields
) -> Iterator[str]:
    """An error that pydantic found in a scenario, in our own wording."""
    location = error["loc"]
    if not location:
        for line in str(error["ctx"]["error"]).splitlines():
            yield cross_check(line, where, changed)
        return
    table, key = str(location[0]), ".".join(str(part) for part in location[1:2])
    if any(path[: len(location[:2])] == location[:2] for path in changed):
        where = prefix = f"override {shortened('.'.join((table, key)) if key else table)}"
    elif key:
        prefix = f"{where}: [{table}] {key}"
    else:
        prefix = f"{where}: {f'[{table}]' if is_table(fields, table) else table}"
    if error["type"] == "extra_forbidden":
        yield f"{where}: {_unknown(fields, location)}"
        return
    must, choices = requirement(error)
    got = error["input"]
    close = nearest(got, choices) if isinstance(got, str) else ""
    yield f"{prefix}{_element(fields, location)}: {must}, got {shortened(toml(got))}{close}"


def cross_check(line: str, where: str, changed: set[tuple[str, ...]]) -> str:
    """A contradiction between keys, attributed to the override that caused it, if there is one."""
    match = re.match(r"\[(\w+)\](?: (\w+))?: ", line)
    if match is not None:
        table, keys = match[1], (match[2],) if match[2] else ("fmu", "type")
        for key in keys:
            if (table, key) in changed:
                return f"override {table}.{key}: {line[match.end() :]}"
    return f"{where}: {line}"


def requirement(error: ErrorDetails) -> tuple[str, list[str]]:
    """The requirement in words, and the valid names of a choice."""
    context = error.get("ctx", {})
    kind = error["type"]
    if kind == "literal_error":
        choices = re.findall(r"'([^']*)'", context["expected"])
        return f"must be {context['expected']}", choices
    if kind == NAMED:
        return error["msg"], context["names"]
    wording = {
        "float_type": "must be a number",
        "finite_number": "must be a finite number",
        "int_type": "must be a whole number",
        "int_from_float": "must be a whole number",
        "bool_type": "must be true or false",
        "string_type": "must be a string",
        "tuple_type": "must be an array",
        "dict_type": "must be a table",
        "model_type": "must be a table",
        "too_long": "must have at most {max_length} values",
        "greater_than_equal": "must be at least {ge}",
        "less_than_equal": "must be at most {le}",
        "greater_than": "must be more than {gt}",
        "less_than": "must be less than {lt}",
    }
    return wording.get(kind, error["msg"]).format(**context), []


def is_table(fields: Fields, name: object) -> bool:
    """Whether a key of a scenario is a table."""
    field = fields.get(str(name))
    return (
        field is not None
        and isinstance(field.annotation, type)
        and issubclass(field.annotation, Table)
    )


def _element(fields: Fields, location: Sequence[str | int]) -> str:
    """Subscript of an array element, 1-based as in FMI."""
    if len(location) < 3 or not isinstance(location[2], int):
        return ""
    table = fields[str(location[0])].annotation
    variable = getattr(table, "variables", {}).get(location[1])
    if variable is None:
        return ""
    row, column = divmod(location[2], math.prod(variable.shape[1:]))
    return f"[{row + 1},{column + 1}]" if variable.shape[1:] else f"[{row + 1}]"


def _unknown(fields: Fields, location: Sequence[str | int]) -> str:
    """Message for an unknown key or table, with the nearest valid name."""
    tables = {
        name: list(field.annotation.model_fields)
        for name, field in fields.items()
        if is_table(fields, name) and isinstance(field.annotation, type)
    }
    name = str(location[-1])
    if len(location) == 1:
        homes = [table for table, keys in tables.items() if name in keys]
        if homes:
            return f"key {name!r} must stand in the table [{homes[0]}]"
        return f"there is no key or table {quoted(name)}" + nearest(name, fields)
    table = str(location[0])
    close = nearest(name, tables[table])
    homes = [other for other, keys in tables.items() if name in keys]
    if homes:
        close = f"; did you mean {name!r} in [{homes[0]}]?"
    elif not close:
        # Suggest a key that contains the name: "arm" for "arm_length_m".
        parts = [key for key in tables[table] if name.lower() in key.lower()]
        close = f"; did you mean {parts[0]!r}?" if parts else ""
        if not close and table == "receiver":
            close = "; what a receiver of your own has is set by receiver.parameters.NAME"
    return f"[{table}] has no key {quoted(name)}{close}"
