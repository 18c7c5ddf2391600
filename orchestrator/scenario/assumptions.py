"""What a receiver may assume of a scenario's system, where some of it is somebody else's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sblcosim.models.settings import assumptions
from sblcosim.models.settings.assumptions import SOURCES


def assumed(
    target: Any, platform: Any, acoustics: Any, source: str | None = None, *, everything: bool
) -> dict[str, Any]:
    """As `sblcosim.models.settings.assumptions.assumed`, without what nobody can know.

    Of a component of somebody else only what is given is known: nothing follows from the starts
    of ours.

    Parameters
    ----------
    everything
        Otherwise of the clock only, which the noise of ranges depends on.
    """
    if everything:
        values = assumptions.assumed(target, platform, acoustics, source)
    else:
        values = assumptions.clock(acoustics)
    tables = {"target": target, "platform": platform, "acoustics": acoustics}
    foreign = {name: table for name, table in tables.items() if table.fmu is not None}
    if not foreign:
        return values
    return {key: value for key, value in values.items() if not _unknown(foreign, key)}


_DECISIVE = {
    key: (table := sources[0].partition(".")[0], [
        name for where, _, name in (source.partition(".") for source in sources) if where == table
    ])
    for key, sources in SOURCES.items()
}  # fmt: skip
"""The first table of `SOURCES`, and the keys in it."""


def _unknown(foreign: Mapping[str, Any], key: str) -> bool:
    """Whether a key follows from a component of somebody else of which the scenario says nothing.
    """
    name, keys = _DECISIVE[key]
    return name in foreign and foreign[name].model_fields_set.isdisjoint(keys)
