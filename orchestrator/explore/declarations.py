"""All keys of a scenario as plain data: bounds, choices and words, as for loading."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from sblcosim.models import COMPONENTS, RECEIVERS
from sblcosim.models.declaration import UNITS, Variable
from sblcosim.models.settings.keys import start_of
from sblcosim.models.settings.names import names_of
from sblcosim.models.settings.presets import DECLARED, preset

from ..scenario.schema import FILES, TABLES, Table

_TIMES = ("sampling_time_s", "update_interval_s", "interval_s", "duration_s")
"""Keys that lose their rounding errors when loaded."""
_LEFT_OUT = (*FILES, "fmi", "parameters", "track_tolerance_m")
"""Keys that need files, or do not change a number."""
_BOUNDS = {"minimum": "least", "maximum": "most", "exclusiveMinimum": "above",
           "exclusiveMaximum": "below"}
_KINDS = {"number": "number", "integer": "integer", "boolean": "switch"}


def declarations() -> list[dict[str, Any]]:
    """All keys of the tables that a page can change, in their order.

    Returns
    -------
    list
        For each key ``path``, ``table``, ``key``, ``words``, ``unit`` (or None) and ``kind``:
        ``number``, ``integer``, ``switch``, ``choice``, ``vector`` or ``matrix``. Where they
        apply: ``bounds`` (``least``, ``most``, ``above``, ``below``), ``choices``, ``names``
        (names that stand for a number), ``numbers`` (what names are in a component), ``rows``
        (smallest and largest number of rows), ``columns``, ``whole`` (of elements), ``default``,
        ``needs`` (what makes it have an effect) and ``sets`` (keys, by value, of a preset).
    """
    return [*_all()]


def _all() -> Iterator[dict[str, Any]]:
    for name, table in TABLES.items():
        for key, schema in table.model_json_schema()["properties"].items():
            if key not in _LEFT_OUT:
                yield _declared(name, table, key, schema)


def _declared(
    name: str, table: type[Table], key: str, schema: Mapping[str, Any]
) -> dict[str, Any]:
    variable = table.variables.get(key)
    found: dict[str, Any] = {
        "path": f"{name}.{key}", "table": name, "key": key,
        "words": schema["description"], "unit": _unit(key, variable),
        **_form(schema), "default": _default(name, table, key, variable),
    }
    if key in _TIMES:
        found["time"] = True
    if variable is not None:
        found["parameter"] = variable.name
        found["angle"] = bool(variable.unit and variable.unit.startswith("rad"))
        numbers = {
            (str(it).lower() if isinstance(it, bool) else it): value
            for it, value in names_of(variable).items()
        }
        found["numbers"] = {**numbers, **(variable.named or {})}
        found["needs"] = [
            [[_key(name, key, it.parameter), [*it.values]] for it in group]
            for group in variable.needs
        ]
    if key in DECLARED:
        found["sets"] = {str(value): preset(key, value) for value in DECLARED[key].values}
    return found


def _key(table: str, key: str, parameter: str) -> str:
    """Key of another parameter of a component that has this key."""
    component = next(it for name, it in COMPONENTS.items() if key in {v.key for v in it} and (
        name == table or (table == "receiver" and name in RECEIVERS)))
    return component[parameter].key


def _form(schema: Mapping[str, Any]) -> dict[str, Any]:
    """Kind, bounds and choices of a key from its JSON schema."""
    forms = [it for it in schema.get("anyOf", [schema]) if it.get("type") != "null"]
    names = [name for it in forms for name in _names(it)]
    form: Mapping[str, Any] = next((it for it in reversed(forms) if not _names(it)), {})
    if not form:
        return {"kind": "choice", "choices": names}
    if form["type"] == "array":  # the last form is flat
        inner = form["items"]
        lists = [it for it in forms if it["items"].get("type") == "array"]
        shape = lists[0] if lists else form
        found = {
            "kind": "matrix" if lists else "vector",
            "rows": [shape.get("minItems", 0), shape.get("maxItems", shape.get("maxLength"))],
            "columns": lists[0]["items"]["maxItems"] if lists else 1,
            "bounds": _bounds(inner), "whole": inner["type"] == "integer",
        }
    else:
        found = {"kind": _KINDS[form["type"]], "bounds": _bounds(form)}
    return {**found, "names": names} if names else found


def _names(form: Mapping[str, Any]) -> list[Any]:
    return [form["const"]] if "const" in form else form.get("enum", [])


def _bounds(form: Mapping[str, Any]) -> dict[str, float]:
    return {ours: form[name] for name, ours in _BOUNDS.items() if name in form}


def _unit(key: str, variable: Variable | None) -> str | None:
    """Unit of a key in a scenario file, for people."""
    if variable is not None and variable.unit is not None:
        suffix = UNITS[variable.unit].suffix
        return variable.unit if not variable.unit.startswith("rad") else suffix.replace(
            "deg", "°").replace("_", "/")
    ends = {"_m": "m", "_s": "s", "_C": "°C", "_deg": "°"}
    return next((unit for end, unit in ends.items() if key.endswith(end)), None)


def _default(name: str, table: type[Table], key: str, variable: Variable | None) -> Any:
    """Value of a key that is not given, if it does not depend on other keys."""
    if name in ("time", "place"):
        return table.model_fields[key].default
    return start_of(key) if name == "receiver" and variable is not None else None


