"""Tables, with each column declared once.

The declarations define DataFrames and their files, printed tables, notebook views, the documents of
``--json`` with their JSON schemas, and the tables of the reference.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from .estimates import Floats

if TYPE_CHECKING:
    import pandas as pd

Number = float | None
"""Type of a number in JSON; missing or infinite values are null."""


@dataclass(frozen=True)
class TableColumn:
    """A column of a table.

    Parameters
    ----------
    name
        Name in DataFrames, files and JSON, including the unit at the end.
    description
        Its meaning, as stated in the reference and in JSON schemas.
    unit
        Empty if it has none.
    heading
        Heading of the printed column; columns without one are not printed.
    type
        Type in JSON.
    of
        Function that computes its value from the object of a row.
    without
        Its value in a row for no values at all.
    sometimes
        Whether it may be missing.
    in_json
        Whether JSON includes it.
    """

    name: str
    description: str
    unit: str = ""
    heading: str = ""
    type: Any = Number
    of: Callable[[Any], Any] | None = None
    without: Any = np.nan
    sometimes: bool = False
    in_json: bool = True

    @property
    def choices(self) -> tuple[str, ...]:
        """The possible values of a column of words."""
        given = (self.type, *get_args(self.type))
        return tuple(word for kind in given for word in get_args(kind) if isinstance(word, str))


@dataclass(frozen=True)
class Columns:
    """The columns of a table: those that identify a row, and the others.

    Attributes
    ----------
    part
        Name of a row in JSON schemas.
    about
        What a row describes, in those schemas.
    title, unit
        Title and unit of the printed table; a heading states any other unit.
    more
        Description of further columns whose names are not known beforehand, such as those of
        factors.
    """

    part: str
    about: str
    index: tuple[TableColumn, ...]
    columns: tuple[TableColumn, ...]
    title: str = ""
    unit: str = "m"
    more: str = ""

    @property
    def names(self) -> list[str]:
        """Names of the columns."""
        return [column.name for column in self.columns]

    @property
    def printed(self) -> tuple[TableColumn, ...]:
        """Columns that are printed."""
        return tuple(column for column in self.columns if column.heading)

    def head(self, name: str) -> str:
        """Printed headings, by name of the column."""
        return next(column.heading for column in self.columns if column.name == name)

    def heading(self, column: TableColumn) -> str:
        """Printed heading of a column."""
        other = column.unit not in ("", self.unit)
        return f"{column.heading} [{column.unit}]" if other else column.heading

    def rows(self, table: pd.DataFrame) -> list[dict[str, Any]]:
        """Rows of a table for JSON; missing values that may be missing are None."""
        kept = [column for column in self.columns if column.in_json]
        idle = {c.name: None for c in kept if c.sometimes and c.name not in table}
        rows: Any = table.assign(**idle)[[column.name for column in kept]].to_dict("records")
        return list(rows)

    def row(self, values: Floats) -> dict[str, Any]:
        """Columns computed from values (m,)."""
        return {c.name: c.of(values) if len(values) else c.without for c in self.columns if c.of}
