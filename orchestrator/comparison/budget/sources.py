"""Sources of error, switched off or made better in a scenario.

Switching a source off sets its keys to 0, or to `FLOOR` where a receiver divides by them. Better
equipment scales the keys of a part until their root sum of squares is the first of the part's
levels that is below it. It never makes them larger. The switch changes the world, and the
receiver's assumptions follow from it.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from math import hypot
from types import MappingProxyType
from typing import Any, NamedTuple

from ...errors import ConfigurationError, nearest, quoted
from ...scenario.error_sources import OF_BITS, SOURCES, Part, Source
from ...scenario.scenario import Scenario
from ...scenario.schema import rows


def of_scenario(scenario: Scenario, better: bool = False) -> tuple[str, ...]:
    """The sources of a scenario: those whose switch changes it.

    Parameters
    ----------
    better
        Consider better equipment instead of switching off.
    """
    return tuple(name for name in SOURCES if _changed(scenario, SOURCES[name], better))


def switched(
    scenario: Scenario, sources: Iterable[str], better: bool = False
) -> dict[str, Any]:
    """Overrides that switch some sources off, or make them better."""
    changes: dict[str, Any] = {}
    for name in sources:
        changes |= _changed(scenario, SOURCES[name], better)
    return changes


def equipment(scenario: Scenario) -> dict[str, str]:
    """Better equipment in a few words, by source; without the sources that nothing better has."""
    found = {}
    for name, source in SOURCES.items():
        words = [it.word for part in source.parts if (it := _improved(scenario, part))]
        if words:
            found[name] = " ".join(dict.fromkeys(words))
    return found


def missing(scenario: Scenario, better: bool = False) -> dict[str, str]:
    """Why the other sources cannot be switched, by name.

    Parameters
    ----------
    better
        Whether they would be replaced with better equipment.
    """
    there = of_scenario(scenario)
    why = {}
    for name in SOURCES.keys() - of_scenario(scenario, better):
        if name not in there:
            why[name] = f"which is no error in {scenario.name}"
        elif any(part.better for part in SOURCES[name].parts):
            why[name] = f"which is as good as the best equipment known in {scenario.name}"
        else:
            why[name] = "for which nothing better is known: it can only be switched off"
    return why


def combination(
    text: str | Sequence[str],
    known: Collection[str],
    others: Mapping[str, str] = MappingProxyType({}),
) -> tuple[str, ...]:
    """The sources named together, each once, in the order of `SOURCES`.

    Parameters
    ----------
    text
        ``"clock+sound speed"``, or names; case does not matter; a hyphen or underscore is a space.
    known
        The sources that the scenario has.
    others
        Why others cannot be switched, by name.

    Raises
    ------
    ConfigurationError
        One of them is not in the scenario. The message says why, or suggests the nearest.
    """
    names = text.split("+") if isinstance(text, str) else text
    by_word = {_word(name): name for name in known}
    why = {_word(name): reason for name, reason in others.items()}
    found = set()
    for name in names:
        if _word(name) not in by_word:
            reason = why.get(_word(name))
            raise ConfigurationError(
                f"together: must be one of {', '.join(known)}, joined by '+', got {quoted(name)}"
                + (nearest(_word(name), {**by_word, **why}) if reason is None else f", {reason}")
            )
        found.add(by_word[_word(name)])
    return tuple(name for name in SOURCES if name in found)


def fixed(scenario: Scenario, sources: Iterable[str]) -> tuple[str, ...]:
    """Sources with a part whose error is the same in every run."""
    drawn = re.compile("_std_|probability|amplitude|wave_height|watch_circle|resolution")
    return tuple(
        name for name in sources
        if any(not drawn.search(key) for key in _changed(scenario, SOURCES[name], False))
    )


def _word(name: str) -> str:
    return " ".join(re.sub("[-_]", " ", str(name)).lower().split())


def _changed(scenario: Scenario, source: Source, better: bool) -> dict[str, Any]:
    """Overrides that switch a source; empty if there is nothing to switch."""
    changes: dict[str, Any] = {}
    for part in source.parts:
        if not better:
            changes |= _reduced(scenario, part, part.off)
        elif improved := _improved(scenario, part):
            changes |= improved.changes
    if any(key in OF_BITS for key in changes) and scenario.acoustics.packet_bits:
        changes["acoustics.packet_bits"] = None  # bits cannot hold values that are not rounded
    return changes


class _Improved(NamedTuple):
    """Better equipment, and the keys that it changes."""

    word: str
    changes: dict[str, Any]


def _improved(scenario: Scenario, part: Part) -> _Improved | None:
    """The first equipment that is better; None if none is known."""
    for word, level in part.better.items():
        changes = _reduced(scenario, part, level)
        if changes:
            return _Improved(word, changes)
    return None


def _reduced(scenario: Scenario, part: Part, level: float) -> dict[str, Any]:
    """The keys of a part that have an effect, scaled to a level; empty if not above it."""
    about = float(_value(scenario, part.about) or 0.0) if part.about else 0.0
    idle = {".".join(key) for key in scenario.idle()}
    values = {key: _value(scenario, key) for key in part.keys if key not in idle}
    values = {key: value for key, value in values.items() if value is not None}
    if part.about and _value(scenario, part.about) is None:
        return {}
    size = hypot(*(v - about for value in values.values() for v in _flat(value)))
    level *= about if part.relative else 1.0
    if size <= level * (1 + 1e-9):
        return {}
    changes = {}
    for key, value in values.items():
        table, _, name = key.partition(".")
        scaled = tuple(about + (v - about) * (level / size) for v in _flat(value))
        if scaled == _flat(value):
            continue
        several = isinstance(value, tuple)
        variable = getattr(scenario, table).variables[name]
        changes[key] = rows(variable, scaled) if several else scaled[0]
    return changes


def _value(scenario: Scenario, key: str) -> Any:
    """The value of a key; None if the component may not have it."""
    name, _, key = key.partition(".")
    table = getattr(scenario, name)
    if table.fmu is not None and key not in table.model_fields_set:
        return None
    return getattr(table, key)


def _flat(value: Any) -> tuple[float, ...]:
    return tuple(value) if isinstance(value, tuple) else (value,)
