"""The masters, of which one runs a plan. All give the same record, to the last bit."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from . import lanes, native
from . import master as python
from .errors import ConfigurationError, check_choice
from .plan import Plan
from .record import Record

MASTERS = ("python", "native", "lanes")
"""Their names."""


def execute(
    plan: Plan,
    progress: Callable[[float], None] | None = None,
    record: Sequence[str] | None = None,
    *,
    master: str | None = None,
    step_timeout: float | None = None,
) -> Record:
    """Run a plan from its start to its stop.

    Parameters
    ----------
    progress, record
        As in `sblcosim.master.execute`.
    master
        ``"native"``, a loop in C; ``"python"``, many times slower; or ``"lanes"``, for components
        of ours, meant for many runs (`sblcosim.lanes`). None: native if all components are FMUs
        and there is a C compiler, else python.
    step_timeout
        As in `sblcosim.native.execute`; for this master only, the others wait for ever.

    Raises
    ------
    ConfigurationError, FmuError
        As the master's own function; and if there is no such master.
    """
    if master is not None:
        check_choice("master", master, MASTERS)
    else:
        master = "native" if native.foreign(plan) is None and native.available() else "python"
    if master != "native" and step_timeout is not None:
        raise ConfigurationError(
            f"step_timeout: must be left out with the {master} master, which waits for ever, got "
            f"{step_timeout}"
        )
    if master == "native":
        return native.execute(plan, progress, record, step_timeout)
    if master == "python":
        return python.execute(plan, progress, record)
    return _one_lane(plan, progress, record)


def _one_lane(
    plan: Plan, progress: Callable[[float], None] | None, record: Sequence[str] | None
) -> Record:
    columns = [c.name for c in plan.columns] if record is None else record
    return lanes.execute(plan, {}, record=columns, lanes=1, progress=progress).record(0)
