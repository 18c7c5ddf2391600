"""What a receiver may assume about a scenario's system, which may have third-party parts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sblcosim.models.settings import assumptions
from sblcosim.models.settings.assumptions import SOURCES


def assumed(
    target: Any, platform: Any, acoustics: Any, source: str | None = None, *, everything: bool
) -> dict[str, Any]:
    """As `sblcosim.models.settings.assumptions.assumed`, without what cannot be known.

    For third-party components, only given keys are known: the start values of ours imply
    nothing.

    Parameters
    ----------
    everything
        Whether to return everything, or only the clock, which the range noise depends on.
    """
    tables = {"target": target, "platform": platform, "acoustics": acoustics}
    foreign = {name: table for name, table in tables.items() if table.fmu is not None}
    if everything:
        placed = foreign.keys().isdisjoint(("target", "platform"))
        values = assumptions.assumed(target, platform, acoustics, source, place_known=placed)
    else:
        values = assumptions.clock(acoustics)
    if not foreign:
        return values
    return {key: value for key, value in values.items() if not _unknown(foreign, key)}


_DECISIVE = {
    key: (table := sources[0].partition(".")[0], [
        name for where, _, name in (source.partition(".") for source in sources) if where == table
    ])
    for key, sources in SOURCES.items()
}  # fmt: skip
"""The first table of `SOURCES` for each key, and the keys in that table."""


def _unknown(foreign: Mapping[str, Any], key: str) -> bool:
    """Whether a key depends on a foreign component that the scenario does not describe."""
    name, keys = _DECISIVE[key]
    return name in foreign and foreign[name].model_fields_set.isdisjoint(keys)
