"""The JSON schema of a question file, for editors; as `sblcosim.study.file_schema`."""

from __future__ import annotations

from typing import Any

from ..scenario.file_schema import inlined
from ..study.file_schema import study_schema
from .question import OF_STUDY, Terms

_COST = {"type": "number", "minimum": 0}
_COSTS = {
    "description": "Cost of each level, in their order or by name; none: free",
    "anyOf": [
        {"type": "array", "items": _COST},
        {"type": "object", "additionalProperties": _COST},
    ],
}


def question_schema() -> dict[str, Any]:
    """Schema of a question file."""
    study = study_schema()
    own, keys = inlined(Terms), study["properties"]
    choice = keys["factors"]["additionalProperties"]
    choice["properties"]["costs"] = _COSTS
    choices = {**keys["factors"], "minProperties": 1}
    about = {"title": "Question", "description": "Which design is the cheapest that suffices"}
    return {
        "$schema": study["$schema"],
        **own,
        **about,
        "properties": {
            **{name: keys[name] for name in OF_STUDY}, **own["properties"], "choices": choices,
        },
        "required": [*own["required"], "scenario", "settling_time_s", "choices"],
    }  # fmt: skip
