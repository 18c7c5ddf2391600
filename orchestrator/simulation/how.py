"""How runs are executed: one value that no result depends on."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from concurrent.futures import Executor


@dataclass(frozen=True)
class How:
    """How runs are executed.

    Attributes
    ----------
    master
        The master; see `sblcosim.simulation.execution.execute`. None: the fastest one possible.
    step_timeout
        Time limit for a call of a third-party FMU [s]; None: one minute.
    workers
        Threads or processes; None: all cores.
    executor, scheduler
        Where runs of a study are executed; see `sblcosim.study.runner.run`.
    progress
        Called at intervals with the completed share, 0 to 1.
    """

    master: str | None = None
    step_timeout: float | None = None
    workers: int | None = None
    executor: str | Executor = "threads"
    scheduler: str | None = None
    progress: Callable[[float], None] | None = None

    @property
    def threads(self) -> int:
        """Number of workers on this machine."""
        return self.workers or os.cpu_count() or 1

    def tell(self, share: float) -> None:
        """Report the completed share."""
        if self.progress is not None:
            self.progress(share)


HOW = How()
"""The default."""
