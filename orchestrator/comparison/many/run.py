"""Many runs of a scenario: averages for its receivers, a typical run and the worst one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from sblcosim.fmus.stopping import interruptible

from ... import api
from ...errors import ConfigurationError
from ...packages import is_package
from ...scenario.files import naming_files
from ...scenario.scenario import Receivers, Scenario, load
from ...simulation.children.process import patient
from ...study.kept import Kept
from ..common.evaluation import PERCENTILE, receivers_in
from ..tournament.result import RESPONSE
from ..tournament.run import compare
from .data_sheet import RESPONSES
from .result import TYPICAL, WORST, Many

if TYPE_CHECKING:
    from ...scenario.overrides import Changes



@interruptible
@naming_files
@patient
def run_many(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    receiver: Receivers = (),
    overrides: Changes = (),
    *,
    runs: int,
    workers: int | None = None,
    master: str | None = None,
    step_timeout: float | None = None,
    progress: Callable[[float], None] | None = None,
    keep: Kept | None = None,
    before: Callable[[Mapping[str, Any]], None] | None = None,
) -> Many:
    """Simulate a scenario many times with consecutive seeds, beginning with that of the scenario.

    Parameters
    ----------
    scenario, receiver, overrides, master, step_timeout
        As in `sblcosim.run`; no package, and receivers without labels.
    runs
        Number of runs, at least 2.
    workers
        Threads; default: all cores.
    progress
        Called at intervals with the completed share, 0 to 1.
    keep
        Folder of finished runs, which are not repeated; None: nothing is written.
    before
        Called with what is known of the manifest, before the first run.

    Raises
    ------
    ConfigurationError
        The scenario or an argument is invalid.
    FmuError
        An FMU cannot be built or is broken.
    """
    if is_package(scenario):
        raise ConfigurationError(
            "runs: must be left out for an SSP package, which has seeds of its own, got "
            f"{runs!r}"
        )
    settled = load(scenario, overrides)
    comparison = compare(
        settled, receiver, runs=runs, seed=settled.seed,
        workers=workers, master=master, step_timeout=step_timeout, timed=False, keep=keep,
        percentiles=[it for it in RESPONSES if it.name != PERCENTILE],
        progress=None if progress is None else lambda share, _: progress(0.9 * share),
        before=None if before is None else lambda known: before({"runs": known["comparison"]}),
    )  # fmt: skip
    seeds = _chosen(comparison.table, receivers_in(comparison.table)[0])
    drawn = {
        which: api.run(
            settled.override({"seed": seed}), receiver, master=master, step_timeout=step_timeout
        )
        for which, seed in seeds.items()
    }
    if progress is not None:
        progress(1.0)
    return Many(comparison, drawn, seeds)


def _chosen(table: pd.DataFrame, receiver: str) -> dict[str, int]:
    """Seeds of the typical and of the worst run."""
    y = table[f"{receiver}.{RESPONSE}"].to_numpy(np.float64)
    order = np.argsort(y, kind="stable")[: int(np.isfinite(y).sum())]
    if not len(order):
        return {}
    seeds = table["seed"].to_numpy()
    return {TYPICAL: int(seeds[order[(len(order) - 1) // 2]]), WORST: int(seeds[order[-1]])}
