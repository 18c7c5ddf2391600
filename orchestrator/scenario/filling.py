"""Fills in the missing keys of a scenario: its complete tables.

Tables are not modified, so the points of a study share unchanged ones.
"""

from __future__ import annotations

import marshal
from collections.abc import Mapping
from functools import cache
from typing import Any

from sblcosim.models import RECEIVERS
from sblcosim.models.settings.beacons import arranged
from sblcosim.models.settings.boat import heading
from sblcosim.models.settings.keys import starts
from sblcosim.models.settings.paths import counts, points
from sblcosim.models.settings.presets import PRESET_TABLES, preset

from ..simulation.plans.alike import alike
from . import packets, water
from .schema import SHARED_PARAMETERS, TRUE, Platform, Receiver, filled, given_of

DEFAULT_RECEIVER = "coupled"
"""Default receiver of a scenario."""


def beacons_of(platform: Platform) -> int:
    """The number of beacons, from the given keys of a platform."""
    given = platform.beacons if "beacons" in platform.model_fields_set else None
    return int(arranged(platform.beacon_m)["beacons"] if given is None else given)


def component(name: str, table: Any, beacons: int, common: Mapping[str, Any]) -> Any:
    """The complete table of a component that every system has.

    Parameters
    ----------
    table
        Its given keys.
    common
        Values derived from other tables.
    """

    def made() -> Any:
        values = dict(starts(name, beacons))
        for key, where in PRESET_TABLES.items():
            if where == name and getattr(table, key) is not None:
                values |= preset(key, getattr(table, key))
        if name == "target":
            values |= counts(table)
        elif name == "platform":
            values |= {**arranged(table.beacon_m), **points(table)}
            values["mean_heading_deg"] = heading(filled(table, values))
        else:
            values |= packets.resolutions(table, beacons)
            values |= water.derived(table)
        return filled(table, {**values, **common})

    return alike("complete", (name, id(table), beacons, *common.values()), made, table)


def _ours(table: Receiver) -> str | None:
    """Our receiver that a scenario names, or the default; None: it has another one."""
    if table.type is None and table.fmu is None:
        return DEFAULT_RECEIVER
    name: str | None = table.type
    return name


def parameters_of(table: Receiver) -> frozenset[str]:
    """Names of all variables of the receiver of a scenario, if it is one of ours."""
    return _names(_ours(table) or "")


@cache
def _names(receiver: str) -> frozenset[str]:
    return frozenset(v.name for v in RECEIVERS.get(receiver, ()))


def receiver(
    table: Receiver, beacons: int, assumed: Mapping[str, Any], update_interval_s: float
) -> Receiver:
    """The complete table of the receiver.

    Parameters
    ----------
    table
        Its given keys.
    assumed
        What it may assume about the system.
    """
    name = _ours(table)
    derived = {**assumed, "update_interval_s": update_interval_s}
    if table.prior == TRUE:
        derived["initialisation"] = "prior"

    def made() -> Receiver:
        if name is None:
            shared = {k for k in derived if table.variables[k].name in SHARED_PARAMETERS}
            values = {k: v for k, v in derived.items() if k in {*shared, "initialisation"}}
        else:
            start = starts(name, beacons)
            values = {**start, **{k: v for k, v in derived.items() if k in start}}
        interval = {**values, **given_of(table)}["update_interval_s"]
        return filled(table, {"type": name, **values, "interval_s": interval})

    # Version 2: without references, so that equal values have equal bytes.
    key = ("receiver", id(table), beacons, marshal.dumps([*derived.items()], 2))
    return alike("complete", key, made, table)
