"""Result of a package without receivers: the record, with nothing to judge."""

from __future__ import annotations

from collections.abc import Collection
from functools import cached_property
from pathlib import Path
from warnings import warn

import pandas as pd

from .. import shown
from ..catalogue import Job
from ..errors import NoEffectWarning
from ..judge.consistency import Verdict
from ..layout import fitted, table
from ..paths.diver_path import DiverPath
from ..results.result import Result


class Recording(Result):
    """A finished run of a system without receivers whose errors can be known.

    Like `Result`, but `estimates`, `errors`, `percentiles` and `summary` are empty, there are no
    figures, and the folder holds the record and the manifest.
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

    @property
    def answer(self) -> str:
        """What was run, in one line."""
        return f"{self.scenario_name}: {self.record._gist().removeprefix('of ')}"

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The record."""
        return {"record": self.table}

    @property
    def figures(self) -> list[Job]:
        """None."""
        return []

    @property
    def paths(self) -> list[DiverPath]:
        """None."""
        return []

    def _write_paths(self, folder: Path, trajectories: Collection[str]) -> None:
        if trajectories:
            warn(
                "trajectories: have no effect, as the package has no receivers", NoEffectWarning,
                stacklevel=3,
            )

    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """What was run, and the last recorded values.

        Parameters
        ----------
        verbose
            Has no effect.
        width
            Columns to fit into; None: sentences are not wrapped.
        """
        last = self.table.iloc[-1]
        rows = [(str(name), f"{value:.10g}") for name, value in last.items() if name != "time_s"]
        head = ("output", f"at {last['time_s']:g} s")
        lines = [self.answer, *self.remarks, "", *table(rows, width, head)]
        return fitted("\n".join(lines), width)

    def _gist(self) -> str:
        return self.answer

    def _repr_html_(self) -> str:
        return shown.page(self.scenario_name, self.table.to_html(max_rows=10))
