"""JSON schemas for editors and programs."""

from __future__ import annotations

from typing import Any

from pydantic.json_schema import GenerateJsonSchema


class Plainly(GenerateJsonSchema):
    """Without a title for each key, which would only repeat its name."""

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False
