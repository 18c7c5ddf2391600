"""Result of a package without receivers: the record, without anything to judge."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from .. import artifacts, shown, style
from ..judge.consistency import Verdict
from ..layout import fitted, table
from ..results.result import Result

if TYPE_CHECKING:
    from ..results.figures.artist import Artist


class Recording(Result):
    """A finished run of a system in which there are no receivers whose errors can be known.

    As `Result`, but `errors`, `percentiles` and `summary` are empty, there are no figures, and the
    folder holds the record and the manifest.
    """

    @cached_property
    def errors(self) -> pd.DataFrame:
        """Empty."""
        return pd.DataFrame()

    @cached_property
    def percentiles(self) -> pd.DataFrame:
        """Empty."""
        return pd.DataFrame()

    @cached_property
    def _judged(self) -> pd.DataFrame:
        return pd.DataFrame()

    @cached_property
    def consistency(self) -> dict[str, dict[str, Verdict]]:
        """Empty."""
        return {}

    def save(
        self,
        directory: str | Path,
        *,
        figures: bool = True,
        theme: style.ThemeName = "light",
        other: artifacts.Other = "refuse",
        artist: Artist | None = None,
    ) -> Path:
        """Write the record and the manifest into a folder; the rest as `Result.save`."""
        return super().save(directory, figures=False, theme=theme, other=other)

    def _write_tables(self, folder: Path, directory: str | Path) -> None:
        artifacts.write_table(self.table, folder, "record")

    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """What was run, and the last values that were recorded.

        Parameters
        ----------
        verbose
            Has no effect.
        width
            Columns to fit into; None: sentences are not wrapped.
        """
        last = self.table.iloc[-1]
        rows = [(str(name), f"{value:.10g}") for name, value in last.items() if name != "time_s"]
        head = [
            f"{self.scenario_name}: {self.record._gist().removeprefix('of ')}",
            *self.remarks,
        ]
        lines = [*head, "", *table(rows, width, ("output", f"at {last['time_s']:g} s"))]
        return fitted("\n".join(lines), width)

    def _gist(self) -> str:
        return f"{self.scenario_name}: {self.record._gist().removeprefix('of ')}"

    def _repr_html_(self) -> str:
        return shown.page(self.scenario_name, self.table.to_html(max_rows=10))
