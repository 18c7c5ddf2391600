"""The table of Sobol' indices, its columns declared."""

from __future__ import annotations

from ...data.tables import Columns, TableColumn

INDICES = Columns(
    "SobolIndex",
    "Share of the variance of a response that a factor of a space explains.",
    (),
    (
        TableColumn("response", "Column of the table of runs.", type=str),
        TableColumn("factor", "``seed``: chance.", type=str),
        TableColumn("first", "Alone."),
        TableColumn("first_low", "Of its interval."),
        TableColumn("first_high", "Of its interval."),
        TableColumn("total", "With all interactions."),
        TableColumn("total_low", "Of its interval."),
        TableColumn("total_high", "Of its interval."),
        TableColumn("transform", "Of the response.", type=str, in_json=False),
    ),
)
