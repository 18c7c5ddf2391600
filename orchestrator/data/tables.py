"""Tables, the columns of each declared once.

From the declarations follow DataFrames and their files, what is printed and what notebooks show,
the documents that ``--json`` prints with their JSON schemas, and the tables of the reference.
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
"""Type of a number in JSON, where what is missing or not finite is null."""


@dataclass(frozen=True)
class TableColumn:
    """A column of a table.

    Parameters
    ----------
    name
        In DataFrames, files and JSON; it ends with the unit.
    description
        What it is, as the reference and JSON schemas say it.
    unit
        Empty for what has none.
    heading
        Over the column, where the table is printed; without one, the column is not printed.
    type
        In JSON.
    of
        Its value, of what a row is made from.
    without
        Its value in a row that is made from no values at all.
    sometimes
        Whether it may be missing.
    in_json
        Whether JSON has it.
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
        """The values of a column of words."""
        given = (self.type, *get_args(self.type))
        return tuple(word for kind in given for word in get_args(kind) if isinstance(word, str))


@dataclass(frozen=True)
class Columns:
    """The columns of a table: those that say what a row is about, and the others.

    Attributes
    ----------
    part
        Name of a row in JSON schemas.
    about
        What a row is, as they say it.
    title, unit
        Of the table, where it is printed; a heading tells another unit.
    more
        What further columns there are, whose names are not known before, such as those of factors.
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
        """The columns that are printed."""
        return tuple(column for column in self.columns if column.heading)

    def head(self, name: str) -> str:
        """What is printed over a column, by its name."""
        return next(column.heading for column in self.columns if column.name == name)

    def heading(self, column: TableColumn) -> str:
        """What is printed over a column."""
        other = column.unit not in ("", self.unit)
        return f"{column.heading} [{column.unit}]" if other else column.heading

    def rows(self, table: pd.DataFrame) -> list[dict[str, Any]]:
        """Rows of a table as JSON has them; what may be missing and is, is None."""
        kept = [column for column in self.columns if column.in_json]
        idle = {c.name: None for c in kept if c.sometimes and c.name not in table}
        rows: Any = table.assign(**idle)[[column.name for column in kept]].to_dict("records")
        return list(rows)

    def row(self, values: Floats) -> dict[str, Any]:
        """The columns that are functions of values, (m,)."""
        return {c.name: c.of(values) if len(values) else c.without for c in self.columns if c.of}
