"""Output of commands with ``--json``: a class for each, which is also its JSON schema.

Lengths are in m, times in s, angles in degrees where the name says so. Values that are missing or
not finite are null. A `Document` checks its contents, so it prints nothing that its schema lacks.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from types import GenericAlias
from typing import Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, create_model

from ...data.tables import Columns, TableColumn

Number = float | None
Claimed = Literal["absolute", "own_relative"]
"""Frames in which a receiver may have a covariance."""


class DocumentPart(BaseModel):
    """A part of a document; it has exactly the fields of the schema."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)


class Document(DocumentPart):
    """The whole output of a command."""

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> Self:
        """A document from plain data and numbers of NumPy and pandas."""
        from ...artifacts import plain

        return cls.model_validate(plain(content))

    def text(self) -> str:
        """As JSON, in ASCII."""
        return json.dumps(json.loads(self.model_dump_json()), indent=2)


def part_of(columns: Columns, *before: TableColumn) -> Any:
    """A row of a table, as a part of documents; `before` are further fields, at its beginning."""
    fields: dict[str, Any] = {
        column.name: (
            column.type,
            Field(None if column.sometimes else ..., description=column.description or None),
        )
        for column in (*before, *columns.columns)
        if column.in_json
    }
    return create_model(columns.part, __base__=DocumentPart, __doc__=columns.about, **fields)


def by_index(columns: Columns) -> Any:
    """A row for each value of the index's first column, which holds a row for each of the next,
    …"""
    rows: Any = part_of(columns)
    for column in reversed(columns.index):
        rows = GenericAlias(dict, (column.type, rows))
    return rows


class Entry(DocumentPart):
    """An included scenario or study."""

    name: str
    title: str
