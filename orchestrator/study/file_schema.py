"""The JSON schema of a study file, for editors; see `sblcosim.scenario.file_schema`."""

from __future__ import annotations

from typing import Any

from ..results.responses import ALL_PERCENTILES, ON_REQUEST
from ..scenario.file_schema import DRAFT, TITLES, inlined, scenario_schema
from .checks import known_keys
from .definition import Definition
from .tables import LONGEST_NAME, RECEIVERS_KEY, RESERVED, VARIED

_ALPHABETIC = r"[^\x00-@\[-^`{-\x7f]"
_KIND = {"required": ["kind"], "properties": {"kind": {"enum": ["grid", "space"]}}}
_RULES = [
    {
        "if": {"not": {"required": ["model"]}},
        "then": {
            "properties": {
                table: {
                    "additionalProperties": {
                        "anyOf": [
                            {"required": ["keys"]},
                            {"properties": {"levels": {"type": "object"}}},
                        ]
                    }
                }
                for table in VARIED
            }
        },
    },
    {
        "if": {
            "not": {
                "anyOf": [
                    {"required": ["model"]},
                    {"required": ["design"], "properties": {"design": _KIND}},
                ]
            }
        },
        "then": {
            "properties": {
                "factors": {
                    "additionalProperties": {
                        "properties": {"levels": {"type": "array", "items": {"type": "number"}}}
                    }
                }
            }
        },
    },
]
"""Arguments of a model need no keys. Levels other than numbers need a grid, a space or a model."""
_OF_OTHERS = r"^\w+\.parameters\..+$"
"""Key of a parameter of a third-party FMU."""


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
    changes = {
        "type": "object",
        "properties": tables | {"fmi": scenario["properties"]["fmi"]} | {
            f"{name}.{key}": schema
            for name, table in tables.items()
            for key, schema in table["properties"].items()
        },
        "patternProperties": {_OF_OTHERS: {}},
        "additionalProperties": False,
    }  # fmt: skip
    keys["model"] = {
        "type": "string",
        "pattern": ":",
        "description": "FILE.py:FUNCTION of the factors, in place of the simulation",
    }
    content["oneOf"] = [{"required": ["scenario"]}, {"required": ["model"]}]
    keys["fixed"] = {**changes, "description": "Keys of the scenario to change in all runs"}
    keys["receivers"] = _texts("Names, FMU files and FILE.py:CLASS, in place of the scenario's")
    keys["responses"] = _texts("Names of further responses, and FILE.py:FUNCTION")
    keys["responses"]["items"] = {
        "anyOf": [{"enum": [*ON_REQUEST, ALL_PERCENTILES]}, {"type": "string", "pattern": ":"}]
    }
    keys["design"]["description"] = "Which combinations of levels are run"
    for name, words in (
        ("factors", "What is varied"), ("conditions", "What is met, in every combination")
    ):
        _describe_levels(keys[name], words, changes, receivers=name == "factors")
    about = {"title": "Study", "description": "Keys of a scenario to vary, and how often"}
    return {"$schema": DRAFT, **content, **about, "allOf": _RULES}


def _describe_levels(
    schema: dict[str, Any], about: str, changes: dict[str, Any], receivers: bool
) -> None:
    schema["propertyNames"] = {
        "pattern": f"^{_ALPHABETIC}[^\\x00-/:-@\\[-^`{{-\\x7f]*$",
        "maxLength": LONGEST_NAME,
        "not": {"enum": [*RESERVED]},
    }
    table = schema["additionalProperties"]
    table["description"] = about
    factor = table["properties"]
    known = [*known_keys(), *([RECEIVERS_KEY] if receivers else [])]
    factor["keys"] = {
        "type": "array",
        "description": "Keys of the scenario; all are set to the level"
        + (". Or 'receivers' alone" if receivers else ""),
        "items": {"anyOf": [{"enum": known}, {"type": "string", "pattern": _OF_OTHERS}]},
        "minItems": 1,
    }
    factor["levels"] = {
        "description": "In the units of the keys; with two levels, the first is coded -1, the "
        "second +1. "
        "Without keys: by name, the keys that each level sets, or a file with them",
        "anyOf": [
            {
                "type": "array",
                "items": {"type": ["number", "string", "boolean"]},
                "minItems": 2,
                "uniqueItems": True,
            },
            {
                "type": "object",
                "additionalProperties": {"anyOf": [{"type": "string"}, changes]},
                "minProperties": 2,
            },
        ],
    }
    table["anyOf"] = [
        {"required": ["levels"], "properties": {"levels": {"type": "array"}}},
        {
            "required": ["levels"],
            "not": {"required": ["keys"]},
            "properties": {"levels": {"type": "object"}},
        },
        {"required": ["distribution"]},
    ]


def _texts(description: str) -> dict[str, Any]:
    return {"type": "array", "description": description, "items": {"type": "string"}}
