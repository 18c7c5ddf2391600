"""How runs are executed: one value, on which no result depends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class How:
    """How runs are executed.

    Attributes
    ----------
    master
        Which master; see `sblcosim.simulation.execution.execute`.
    step_timeout
        Time limit for a call of an FMU [s].
    progress
        Called at intervals with the completed share, 0 to 1.
    """

    master: str | None = None
    step_timeout: float | None = None
    progress: Callable[[float], None] | None = None
