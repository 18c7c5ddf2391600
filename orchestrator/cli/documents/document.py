"""What commands print with ``--json``: a class for each, which is also its JSON schema.

Lengths are in m, times in s, angles in degrees where a name ends so; what is missing or not finite
is null. A `Document` checks what it is made of, so nothing is printed that its schema does not say.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Literal, Self

from pydantic import BaseModel, ConfigDict

Number = float | None
Claimed = Literal["absolute", "own_relative"]
"""Frames in which a receiver may have a covariance."""


class DocumentPart(BaseModel):
    """A part of a document; its fields are those of the schema, and no others."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)


class Document(DocumentPart):
    """All that a command prints."""

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> Self:
        """A document from plain data and numbers of NumPy and pandas."""
        from ...artifacts import plain

        return cls.model_validate(plain(content))

    def text(self) -> str:
        """As JSON, in ASCII."""
        return json.dumps(json.loads(self.model_dump_json()), indent=2)


class Entry(DocumentPart):
    """A scenario or a study that comes along."""

    name: str
    title: str
