"""The JSON schema of a study file, for editors; as `sblcosim.scenario.file_schema`."""

from __future__ import annotations

from typing import Any

from ..results.responses import ALL_PERCENTILES, ON_REQUEST
from ..scenario.file_schema import DRAFT, TITLES, inlined, scenario_schema
from .checks import known_keys
from .definition import LONGEST_NAME, RESERVED, Definition

_ALPHABETIC = r"[^\x00-@\[-^`{-\x7f]"
_OF_OTHERS = r"^\w+\.parameters\..+$"
"""Key of a parameter of somebody else's FMU."""


def study_schema() -> dict[str, Any]:
    """Schema of a study file."""
    content = inlined(Definition)
    keys = content["properties"]
    scenario = scenario_schema()
    del scenario["$schema"]
    tables = {name: scenario["properties"][name] for name in TITLES}
    keys["scenario"] = {
        "description": "Name, file, or tables of a scenario",
        "anyOf": [{"type": "string"}, scenario],
    }
    keys["fixed"] = {
        "type": "object",
        "description": "Keys of the scenario to change in all runs",
        "properties": tables | {"fmi": scenario["properties"]["fmi"]} | {
            f"{name}.{key}": schema
            for name, table in tables.items()
            for key, schema in table["properties"].items()
        },
        "patternProperties": {_OF_OTHERS: {}},
        "additionalProperties": False,
    }  # fmt: skip
    keys["receivers"] = _texts("Names, FMU files and FILE.py:CLASS, in place of the scenario's")
    keys["responses"] = _texts("Names of further responses, and FILE.py:FUNCTION")
    keys["responses"]["items"] = {
        "anyOf": [{"enum": [*ON_REQUEST, ALL_PERCENTILES]}, {"type": "string", "pattern": ":"}]
    }
    keys["design"]["description"] = "Which combinations of levels are run"
    _describe_factors(keys["factors"])
    about = {"title": "Study", "description": "Keys of a scenario to vary, and how often"}
    return {"$schema": DRAFT, **content, **about}


def _describe_factors(schema: dict[str, Any]) -> None:
    schema["propertyNames"] = {
        "pattern": f"^{_ALPHABETIC}[^\\x00-/:-@\\[-^`{{-\\x7f]*$",
        "maxLength": LONGEST_NAME,
        "not": {"enum": [*RESERVED]},
    }
    schema["additionalProperties"]["description"] = "What is varied"
    factor = schema["additionalProperties"]["properties"]
    factor["keys"] = {
        "type": "array",
        "description": "Keys of the scenario; all are set to the level",
        "items": {"anyOf": [{"enum": [*known_keys()]}, {"type": "string", "pattern": _OF_OTHERS}]},
        "minItems": 1,
    }
    factor["levels"] = {
        "type": "array",
        "description": "In the units of the keys; of two, the first is coded -1, the second +1",
        "items": {"type": "number"},
        "minItems": 2,
        "uniqueItems": True,
    }


def _texts(description: str) -> dict[str, Any]:
    return {"type": "array", "description": description, "items": {"type": "string"}}
