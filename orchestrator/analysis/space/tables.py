"""The table of Sobol' indices, its columns declared."""

from __future__ import annotations

from ...data.tables import Columns, TableColumn

INDICES = Columns(
    "SobolIndex",
    "Share of the variance of a response that a factor of a space explains.",
    (),
    (
        TableColumn("response", "Column of the table of runs.", type=str),
        TableColumn("factor", "Name of the factor; ``seed`` is chance.", type=str),
        TableColumn("first", "Share that the factor explains alone."),
        TableColumn("first_low", "Lower end of its interval."),
        TableColumn("first_high", "Upper end of its interval."),
        TableColumn("total", "Share that the factor explains with all its interactions."),
        TableColumn("total_low", "Lower end of its interval."),
        TableColumn("total_high", "Upper end of its interval."),
        TableColumn("transform", "Transform of the response.", type=str, in_json=False),
    ),
)
