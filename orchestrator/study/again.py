"""Repeat a run of a study, with its full record."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ..api import run as run_scenario
from ..errors import ConfigurationError
from ..results.result import Result
from ..scenario.schema import CORE_COMPONENTS
from .campaign import point_digest, receivers_of, resolved_alone, seeded_inputs
from .groups import PreparedPoint
from .store import table
from .study import study_of


def replay(
    results: str | Path,
    run_id: str,
    *,
    master: str | None = None,
    progress: Callable[[float], None] | None = None,
    before: Callable[[Mapping[str, Any]], None] | None = None,
) -> Result:
    """Repeat a run of a study and record everything.

    Parameters
    ----------
    results
        Folder of the study's results.
    run_id
        Identifier in the table of runs, or its beginning.
    before
        Called with the manifest just before the simulation.

    Raises
    ------
    ConfigurationError
        There is no such run, or it cannot be repeated because the FMUs have changed.
    """
    study = study_of(results)
    if study.model is not None:
        raise ConfigurationError(
            f"{results}: must hold simulated runs to repeat one, got those of the function "
            f"{study.model.name}"
        )
    runs = table(results)
    matches = runs[runs["run_id"].str.startswith(run_id)] if run_id else runs[:0]
    if len(matches) != 1:
        what = f"the beginning of {len(matches)}" if len(matches) else "none of them"
        raise ConfigurationError(
            f"run: must be the run_id of one run in {results}, got {run_id!r}, which is {what}"
        )
    number, seed, run_id = (matches.iloc[0][name] for name in ("point", "seed", "run_id"))
    scenario, system, plan = resolved_alone(study, int(number))
    labels = [name for name in system.components if name not in CORE_COMPONENTS]
    seeded, handovers = seeded_inputs(study, system, labels)
    free = {f"{name}.seed" for name in seeded} | {c.target for c in handovers}
    digest = point_digest(study, int(number), system, plan, free)
    if PreparedPoint(int(number), (), system, digest).run_id(int(seed)) != run_id:
        raise ConfigurationError(
            f"run {run_id}: must be repeated with the original FMUs and files, got others"
        )
    return run_scenario(
        scenario.override({"seed": int(seed)}),
        receivers_of(study),
        master=master,
        progress=progress,
        before=before,
    )
