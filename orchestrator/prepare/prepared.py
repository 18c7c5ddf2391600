"""Everything that is settled before a run."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sblcosim.fmus.host.nanoseconds import SECOND, text_of

from ..data.description import RunDescription
from ..scenario.scenario import Source
from ..simulation.plans.plan import Plan
from ..simulation.system import System


@dataclass(frozen=True, eq=False)
class Prepared:
    """What will run, and how it is described.

    Attributes
    ----------
    system, plan
        The components with their connections, and how they are executed.
    description
        Content of the manifest: scenario as run, receivers, FMUs, seeds, origins, remarks.
    may_fail
        Receivers that may fail as long as another one remains.
    update_interval_ns
        Update interval of the receivers [ns]; None: there are none.
    """

    system: System
    plan: Plan
    description: RunDescription
    may_fail: Collection[str]
    update_interval_ns: int | None


def origins_of(
    chosen: Mapping[str, Source], system: System, plan: Plan
) -> dict[str, dict[str, Any]]:
    """The origin of each receiver; independent of file paths."""
    planned = {c.name: c for c in plan.components}
    origins: dict[str, dict[str, Any]] = {}
    for label, source in chosen.items():
        component = planned[label]
        if isinstance(source, str):
            origin: dict[str, Any] = {"type": source}
        else:
            origin = {"fmu" if isinstance(source, Path) else "python": component.origin}
        if component.file_sha256:
            origin["sha256"] = component.file_sha256
        if component.lag_s > 0:
            origin["looks_back"] = True
        origins[label] = {**origin, "parameters": dict(system.components[label].parameters)}
    return origins


def shortening(system: System, plan: Plan, most_ns: int) -> list[str]:
    """A remark on a run that is shorter than requested by more than ``most_ns``."""
    wanted, simulated = system.stop_ns - system.start_ns, plan.stop_ns - plan.start_ns
    lost = wanted - simulated
    if lost <= most_ns:
        return []
    digits = max(6, math.ceil(math.log10(wanted / lost)) + 1)
    return [
        f"simulated {text_of(simulated).removesuffix(' s')} of {wanted / SECOND:.{digits}g} s: "
        "a run ends with the last common multiple of all communication intervals"
    ]
