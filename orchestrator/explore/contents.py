"""What a page holds: a scenario, all keys, components, presets, sources of error, and modules."""

from __future__ import annotations

import zlib
from base64 import b64encode
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from sblcosim.fmus.build import bound
from sblcosim.fmus.platforms import WASM
from sblcosim.models import RECEIVERS
from sblcosim.models.acoustics.contents import CONTENTS, PLACED
from sblcosim.models.acoustics.ranging import INVERTED, RANGINGS
from sblcosim.models.ports import BEACONS
from sblcosim.models.receiver.receivers import FOUND
from sblcosim.models.settings.assumptions import PARAMETERS
from sblcosim.models.settings.keys import starts

from ..data.arms import LONGEST_ARM
from ..errors import ConfigurationError
from ..judge.definitions import LOST, MISLEADING
from ..scenario import settings, sources, water
from ..scenario.doubts import PINGS
from ..scenario.error_sources import FLOOR, SOURCES, Source
from ..scenario.filling import DEFAULT_RECEIVER
from ..scenario.labels import RAW
from ..scenario.scenario import Scenario
from ..scenario.schema import CORE_COMPONENTS, SEED, TABLES, given_of
from ..scenario.tracks import FOLLOWERS, capacity, follows
from ..simulation.plans.plan import LAG
from ..style import LINES, THEMES
from ..wasm import modules
from . import bounds
from .declarations import declarations
from .parts import parts

COMPARED = ("coupled", "ekf", "multilateration")
"""Receivers that every page has, beside those of its scenario."""
USUAL_POINTS = 256
"""Largest number of points of a recorded track in a page, unless its scenario has a longer one. A
boat has a track in a page only if it has one in the scenario: others have no code for it."""
LATE = "receiver.outlier_mean_m"
"""What a receiver assumes about late ranges: the mean excess of outliers and echoes."""
LANES = (2, 1)
"""Runs side by side of a page's modules; the second is for browsers without vectors. These simulate
the scenario's number of beacons only, as those of all numbers would need a third more space."""
DIVE = "sblcosim dive 1"
"""What the file of a recorded dive says that it is."""


class PackedDive(Protocol):
    """What a page needs of a recorded dive; see `sblcosim.processing.dive`."""

    def packed(self, **more: Any) -> str: ...


def contents(
    scenario: Scenario,
    receivers: Sequence[str] = (),
    beacons: Collection[int] = (),
    lanes: Collection[int] = LANES,
    dive: PackedDive | None = None,
) -> dict[str, Any]:
    """The content of a page, as plain data; `js/explorer.js` reads it.

    Parameters
    ----------
    receivers
        Names of our receivers to begin with; default: the scenario's own.
    beacons
        Numbers of beacons that can be chosen, beside that of the scenario.
    lanes
        Runs side by side for which there are modules.
    dive
        A recorded dive that the page shows first; its settings must be the scenario.

    Raises
    ------
    ConfigurationError
        The scenario has files of other authors, or a receiver is not one of ours.
    BuildError
        A module must be built, and CasADi or ``ziglang`` is missing, or the compiler fails.
    """
    refuse(scenario)
    chosen = _chosen(scenario, receivers)
    types = [it for it in RECEIVERS if it in {*chosen.values(), *COMPARED}]
    points = _points(scenario)
    counts = sorted({scenario.beacons, *beacons})
    for count in counts:
        if not BEACONS.least <= count <= BEACONS.most:
            raise ConfigurationError(
                f"beacons: must be from {BEACONS.least} to {BEACONS.most}, got {count}"
            )
    return {
        "name": scenario.name, "title": scenario.title or scenario.name,
        "seed": scenario.seed, "fmi": scenario.fmi,
        "given": given(scenario),
        "receivers": [label for label in chosen if label != RAW],
        "types": types,
        "keys": declarations(),
        "words": {"lost": LOST, "misleading": MISLEADING},
        "systems": {str(count): _system(count, types, points) for count in counts},
        "rules": _rules(scenario),
        "bound": bounds.facts(),
        "sources": [_source(it) for it in SOURCES.values()],
        "modules": _modules(counts, scenario.beacons, types, lanes, points),
        "dive": None if dive is None else document(scenario, receivers, dive),
    }


def document(
    scenario: Scenario, receivers: Sequence[str], dive: PackedDive
) -> dict[str, Any]:
    """A recorded dive with its settings, as plain data; `js/recorded.js` reads it.

    Parameters
    ----------
    scenario, receivers
        The settings, and the receivers to begin with, as in `contents`.

    Raises
    ------
    ConfigurationError
        See `contents`.
    """
    refuse(scenario)
    labels = [label for label in _chosen(scenario, receivers) if label != RAW]
    return {"format": DIVE, "data": dive.packed(given=given(scenario), receivers=labels)}


def _chosen(scenario: Scenario, receivers: Sequence[str]) -> Mapping[str, Any]:
    """Receivers of ours by label, with the raw fix."""
    chosen = sources.choose(scenario, tuple(receivers))
    for it in chosen.values():
        if it not in RECEIVERS:
            raise ConfigurationError(
                f"receiver: must be one of {', '.join(RECEIVERS)} to explore a scenario, got "
                f"{sources.named(it)}"
            )
    return chosen


def refuse(scenario: Scenario) -> None:
    """Refuse a scenario whose numbers a page cannot have.

    Raises
    ------
    ConfigurationError
        It has files of other authors.
    """
    for name in (*CORE_COMPONENTS, "receiver"):
        table = getattr(scenario, name)
        if table.fmu is not None or table.parameters:
            raise ConfigurationError(
                f"{scenario.where(name, 'fmu')}: must be left out to explore the scenario, as a "
                "page has our components only"
            )


def is_possible(scenario: Scenario, receiver: str) -> bool:
    """Whether a page can have a scenario and a receiver."""
    try:
        refuse(scenario)
    except ConfigurationError:
        return False
    return receiver in RECEIVERS


def given(scenario: Scenario) -> dict[str, Any]:
    """The keys that a scenario gives, by path; arrays are flat."""
    found: dict[str, Any] = {}
    for name in TABLES:
        table = getattr(scenario, name)
        own = given_of(table)  # in no order
        found |= {
            f"{name}.{key}": own[key] for key in type(table).model_fields
            if own.get(key) is not None and key not in ("fmu", "fmi", "parameters")
        }
    return found


def _points(scenario: Scenario) -> dict[str, int]:
    """The constants of the build for recorded tracks."""
    return {
        constant: max(USUAL_POINTS, count)
        for name in FOLLOWERS
        for table in (getattr(scenario, name),) if name == "target" or follows(name, table)
        for constant, count in capacity(name, table).items()
    }


def _system(
    beacons: int, types: Sequence[str], points: Mapping[str, int]
) -> dict[str, Any]:
    """Components, start values and the settings module for a number of beacons."""
    names = {*CORE_COMPONENTS, *types}
    described = settings.description(beacons)
    computed = {
        kind: {
            it: own for it, own in described[kind].items()
            if it.partition(".")[0] in names or it in bounds.PARAMETERS
        } for kind in ("values", "copies")
    }
    computed["values"] |= {f"levels.{it}": [place] for it, place in described["levels"].items()}
    return {
        "parts": parts(types, beacons=beacons, **points),
        "defaults": {name: dict(starts(name, beacons)) for name in CORE_COMPONENTS},
        "settings": {**{k: described[k] for k in ("keys", "optional")}, **computed},
    }


def _source(source: Source) -> dict[str, Any]:
    """A source of error, and the levels of better equipment."""
    return {
        "name": source.name, "words": source.words,
        "parts": [
            {"keys": [*it.keys], "better": [[*level] for level in it.better.items()],
             "off": it.off, "about": it.about, "relative": it.relative,
             "unmodelled": [*it.unmodelled]}
            for it in source.parts
        ],
    }


def _rules(scenario: Scenario) -> dict[str, Any]:
    """Tables that rules of a scenario need."""
    acoustics = scenario.acoustics
    measured = {
        f"acoustics.{key}": getattr(acoustics, key)
        for key in ("temperature_C", "salinity", "sample_depth_m", "profile_depth_m",
                    "profile_temperature_C", "profile_salinity")
        if key in acoustics.model_fields_set
    }
    return {
        "beacons": int(BEACONS),
        "receiver": DEFAULT_RECEIVER,
        "receiver_keys": {
            name: [v.key for v in it.of("parameter")] for name, it in RECEIVERS.items()
        },
        "doubts": {
            "receivers": {
                name: {"purpose": it.purpose, "unfit": {**it.unfit}} for name, it in FOUND.items()
            },
            "pings": {name: [f"acoustics.{key}", words] for name, (key, words) in PINGS.items()},
            "inverted": [*INVERTED],
        },
        "lag": LAG,
        "legs": {name: it.legs for name, it in RANGINGS.items()},
        "contents": {
            name: {
                "places": {str(n): it.places(n) for n in range(BEACONS.least, BEACONS.most + 1)},
                "pose": it.pose, "only_own": it.only_own, "placed": name in PLACED,
            }
            for name, it in CONTENTS.items()
        },
        "seed": {"least": SEED.min, "most": SEED.max},
        "track_points": {
            name: _points(scenario).get(it.constant.name, 0) for name, it in FOLLOWERS.items()
        },
        "floor": FLOOR,
        "late": {"key": LATE, "value": _late(scenario)},
        "far": LONGEST_ARM,
        "style": {
            "colours": len(THEMES["light"].receivers),
            "lines": [[] if isinstance(it, str) else [*it[1]] for it in LINES],
        },
        "water": {
            "setters": water.SETTERS, "keys": water.KEYS,
            "given": measured, "speed": acoustics.sound_speed_m_s,
            "profile": acoustics.profile_speed_m_s,
        },
    }


def _late(scenario: Scenario) -> float | None:
    """What receivers assume about echoes along the path [m]; None without echoes.

    The settings module cannot compute it for a path of points. There, the page keeps this value.
    """
    acoustics = scenario.acoustics
    if not acoustics.surface_echo_probability and not acoustics.bottom_echo_probability:
        return None
    name = LATE.partition(".")[2]
    value: float = scenario.assumptions(PARAMETERS)[name]
    return value


def _modules(
    counts: Sequence[int], own: int, types: Sequence[str], lanes: Collection[int],
    points: Mapping[str, int],
) -> dict[str, str]:
    """WebAssembly by its use, number of beacons and of lanes; compressed, as base64."""
    found = {"bound": packed(bound.library(platform=WASM).read_bytes())}
    for count in counts:
        found[f"settings.{count}"] = packed(settings.library(count, platform=WASM).read_bytes())
        for lane in lanes if count == own else sorted(lanes)[-1:]:
            file = modules.module(types, count, lane, **points)
            found[f"engine.{count}.{lane}"] = packed(file.read_bytes())
    return found


def ready(
    counts: Collection[int] = range(BEACONS.least, BEACONS.most + 1),
    lanes: Collection[int] = LANES,
) -> dict[str, Path]:
    """The modules of pages with the usual receivers, by cache key and name of the file."""
    types = [it for it in RECEIVERS if it in COMPARED]
    points = {FOLLOWERS["target"].constant.name: USUAL_POINTS}
    file = bound.library(platform=WASM)
    found = {f"{bound.key(WASM)}/{file.name}": file}
    for count in counts:
        file = settings.library(count, platform=WASM)
        found[f"{settings.key(count, WASM)}/{file.name}"] = file
        for lane in lanes:
            file = modules.module(types, count, lane, **points)
            found[f"{modules.key(types, count, lane, **points)}/{file.name}"] = file
    return found


def packed(content: bytes) -> str:
    """Bytes, compressed with zlib and written as base64."""
    return b64encode(zlib.compress(content, 9)).decode()


