"""Preparation of a package."""

from __future__ import annotations

from pathlib import Path

from sblcosim.models.ports import REQUIRED_ESTIMATE

from ..data.description import RunDescription
from ..data.truth import TRUTH
from ..packages.read import Package
from ..scenario.schema import CORE_COMPONENTS
from ..simulation.plans.checks import check_size
from ..simulation.resolve import resolve
from .prepared import Prepared, origins_of, shortening


def of_package(package: Package) -> Prepared:
    """Resolve the system of an open package.

    Receivers are the components that have all ports of a receiver, provided the system has the true
    values to compare their estimates with.

    Raises
    ------
    ConfigurationError, FmuError
        As `sblcosim.simulation.resolve.resolve`.
    """
    plan = resolve(package.system, where=str(package.path))
    check_size(plan)
    planned = {c.name: c for c in plan.components}
    known = {c.name for c in plan.columns}
    receivers = [
        name
        for name in planned
        if name not in CORE_COMPONENTS
        and {*TRUTH, *(f"{name}.{port}" for port in REQUIRED_ESTIMATE)} <= known
    ]
    seeds = {
        c.name: int(s.values[0]) for c in plan.components for s in c.settings
        if s.port.name == "seed" and s.port.causality == "parameter"
    }  # fmt: skip
    sources = {name: Path(name) for name in receivers}
    description = RunDescription(
        scenario_name=package.name,
        scenario={"package": f"{package.name}.ssp", "sha256": package.sha256},
        receivers=receivers,
        fmus={name: component.file_sha256 for name, component in planned.items()},
        seeds=seeds,
        origins=origins_of(sources, package.system, plan),
        remarks=[*package.remarks, *shortening(package.system, plan, 0)],
    )
    used = {c.source.partition(".")[0] for c in package.system.connections}
    return Prepared(
        package.system, plan, description,
        may_fail=[name for name in receivers if name not in used],
        update_interval_ns=planned[receivers[0]].tick_ns if receivers else None,
    )
