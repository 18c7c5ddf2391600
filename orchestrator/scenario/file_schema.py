"""The JSON schema of a scenario file, for editors: completion, explanations, errors in red.

It is derived from the declarations, like the reader of the files. It does not cover relations
between keys, such as one dividing another; `sblcosim run` does.
"""

from __future__ import annotations

import json
from typing import Any

from sblcosim.models import COMPONENTS, RECEIVERS
from sblcosim.models.settings.keys import default

from .json_schema import Plainly
from .scenario import Scenario, load
from .schema import CORE_COMPONENTS, Table, rows

DRAFT = "http://json-schema.org/draft-07/schema#"
"""Version of the schema; TOML editors support no newer one."""
FILE_NAME = "sblcosim-scenario.schema.json"
"""Name of the file next to a scenario, so that editors need neither network nor machine paths."""
DIRECTIVE = f"#:schema ./{FILE_NAME}"
"""First line of a scenario with its schema in the same folder."""
TITLES = {
    "time": "When things happen",
    "place": "Where on Earth it is",
    "target": "The diver and the depth sensor",
    "platform": "The platform: beacons, waves, GPS and IMU",
    "acoustics": "The acoustic channel",
    "receiver": "The receiver that computes the position",
}
"""The tables of a scenario, and their subjects."""
_FROM_ELSEWHERE = ("sampling_time_s", "update_interval_s", "seed")
"""Keys of components that are derived from other keys if not given."""


def scenario_schema() -> dict[str, Any]:
    """Schema of a scenario file."""
    content = inlined(Scenario)
    for name, title in TITLES.items():
        content["properties"][name]["description"] = title
    for name in (*CORE_COMPONENTS, "receiver"):
        _add_defaults(name, content["properties"][name]["properties"])
    about = {"title": "Scenario", "description": "A run of sblcosim; keys end with their unit"}
    return {"$schema": DRAFT, **content, **about}


def inlined(model: type[Table]) -> dict[str, Any]:
    """Schema of a table with its inner tables; no key may be null, as in TOML."""
    content = model.model_json_schema(schema_generator=Plainly)
    definitions = content.pop("$defs", {})
    schema: dict[str, Any] = _plain(content, definitions)
    return schema


def _plain(node: Any, definitions: dict[str, Any]) -> Any:
    """A schema without references and without null."""
    if isinstance(node, list):
        return [_plain(item, definitions) for item in node]
    if not isinstance(node, dict):
        return node
    if "$ref" in node:
        node = {**definitions[node["$ref"].rpartition("/")[2]], **node}
        del node["$ref"], node["title"]
    plain = {key: _plain(value, definitions) for key, value in node.items()}
    if plain.get("default", ...) is None:
        del plain["default"]
    if "const" in plain:
        plain["enum"] = [plain.pop("const")]
    if "anyOf" in plain:
        some = [one for one in plain.pop("anyOf") if one != {"type": "null"}]
        plain |= some[0] if len(some) == 1 else {"anyOf": some}
    return plain


def _add_defaults(name: str, keys: dict[str, Any]) -> None:
    """State the default of each key, except for those derived from others."""
    derived = {*_FROM_ELSEWHERE}
    components = [COMPONENTS[name]] if name in COMPONENTS else []
    if name == "receiver":
        components = [*RECEIVERS.values()]
        derived |= {*load({}).assumptions(["clock_std"]), *load({}).assumptions([])}
    for component in components:
        for variable in component.of("parameter"):
            value = rows(variable, default(component, variable))
            if variable.key not in derived and value != ():
                keys[variable.key].setdefault("default", json.loads(json.dumps(value)))
