"""The run of a comparison in which the best receiver is worst, with its full record."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ... import api
from ...errors import ConfigurationError
from ...scenario.scenario import Receivers, load

if TYPE_CHECKING:
    from ...results.result import Result
    from .result import Tournament


def worst_run(
    it: Tournament, receivers: Receivers = (), *, master: str | None = None,
    step_timeout: float | None = None,
) -> Result:
    """Repeat the run with the largest response of the best receiver, of any scenario.

    Parameters
    ----------
    receivers, master, step_timeout
        As they were given to `sblcosim.compare`.

    Raises
    ------
    ConfigurationError
        The best receiver failed in all runs.
    """
    best = it.receivers[0]
    values = it.table[f"{best}.{it.response}"].to_numpy(np.float64, na_value=np.nan)
    if not np.isfinite(values).any():
        raise ConfigurationError(
            f"replay: must be of a run in which {best} gives estimates, got none"
        )
    row = it.table.iloc[int(np.nanargmax(np.where(np.isfinite(values), values, np.nan)))]
    scenario = next(own for own in map(load, it.settings["scenarios"])
                    if own.name == row["scenario"])
    return api.run(
        scenario.override({"seed": int(row["seed"])}), receivers, master=master,
        step_timeout=step_timeout,
    )
