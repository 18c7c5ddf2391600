"""What decides about a run, as `sblcosim new` asks for it: where it is in a scenario."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import accumulate, pairwise
from math import hypot
from typing import Any

from sblcosim.models.acoustics.ranging import RANGINGS
from sblcosim.models.acoustics.schedules import schedule_of
from sblcosim.models.platform.gps import GRADES
from sblcosim.models.receiver.receiver import Beacons
from sblcosim.models.target.variables import TRAJECTORIES

from ..errors import ConfigurationError, quoted
from ..words.lists import counted, listed
from ..words.numbers import meters, quantity
from . import conditions, effects, typed
from .explained import explained
from .likes import ASKED
from .scenario import Scenario
from .tracks import FILE, FILE_KEYS, POINT_KEYS
from .units import unit_of

Values = dict[str, Any]
"""Keys with their tables, ``platform.gps_grade``, and their values; None: to be left out."""


@dataclass(frozen=True)
class Decision:
    """A decision, and where a scenario has it.

    Attributes
    ----------
    keys
        Its keys in a scenario, with their tables.
    takes
        What may be typed.
    shown
        What the scenario has, with the unit.
    read
        From what was typed to values of keys; a message has no place.
    unfit
        Kinds of beacons for which there is nothing to decide, and why.
    names
        Names that may be typed.
    """

    keys: Callable[[Scenario], Sequence[str]]
    takes: Callable[[Scenario], str]
    shown: Callable[[Scenario], str]
    read: Callable[[str, Scenario], Values]
    unfit: Mapping[Beacons, str] = field(default_factory=dict)
    names: Collection[str] = ()

    def moot(self, scenario: Scenario, kind: Beacons | None) -> str | None:
        """Why there is nothing to decide in a scenario with this kind of beacons; None: there is.
        """
        keys = self.keys(scenario)
        tables = {key.partition(".")[0] for key in keys}
        for table in tables:
            if getattr(getattr(scenario, table), "fmu", None) is not None:
                return f"[{table}] is another FMU"
        if kind is not None and kind in self.unfit:
            return self.unfit[kind]
        why = idle(scenario, keys)
        return why[keys[0]] if len(why) == len(keys) else None


def idle(scenario: Scenario, keys: Sequence[str]) -> dict[str, str]:
    """Those of the keys that have no effect in a scenario, each with the reason."""
    found = effects.idle(
        scenario, effects.components_of(scenario), [tuple(key.split(".")) for key in keys]
    )
    return {".".join(key): why for key, why in found.items()}


def value_of(scenario: Scenario, key: str) -> Any:
    """The value of a key in a table."""
    table, own = key.split(".")
    return getattr(getattr(scenario, table), own)


# --- One number ----------------------------------------------------------------------------------


def _number(
    key: str | Callable[[Scenario], str], unfit: Mapping[Beacons, str] | None = None
) -> Decision:
    """The decision about a number, which the schema explains."""

    def own(scenario: Scenario) -> str:
        return key if isinstance(key, str) else key(scenario)

    def read(text: str, scenario: Scenario) -> Values:
        return {own(scenario): typed.number(text, unit_of(own(scenario)))}

    return Decision(
        keys=lambda scenario: [own(scenario)],
        takes=lambda scenario: explained(*own(scenario).split(".")),
        shown=lambda scenario: quantity(value_of(scenario, own(scenario)), unit_of(own(scenario))),
        read=read,
        unfit=unfit or {},
    )


_HEADING = ("turn_on_std", "bias", "markov_std", "std")


def _compass(scenario: Scenario) -> str:
    """The first part of the heading's error that a scenario has; else the one that lasts a run."""
    keys = [f"platform.imu_heading_{part}_deg" for part in _HEADING]
    return next((key for key in keys if value_of(scenario, key)), keys[0])


def _interval(text: str, scenario: Scenario) -> Values:
    """The time between pings, also as a rate."""
    if re.search(r"hz\s*$", text, re.IGNORECASE):
        rate = typed.number(text, "Hz")
        if not rate > 0:
            raise ConfigurationError(f"must be more than 0, got {quoted(text)}")
        return {_PINGS: round(1.0 / rate, 9)}
    return {_PINGS: typed.number(text, "s")}


_PINGS = "time.sampling_time_s"


def _pings_takes(scenario: Scenario) -> str:
    """What may be typed, and when each beacon of a scenario pings."""
    acoustics, beacons = scenario.acoustics, scenario.beacons
    if RANGINGS[acoustics.ranging].from_diver:
        return "T in s, or a rate in Hz. Here the diver pings every T, and all beacons hear it"
    schedule, together = acoustics.schedule, schedule_of(acoustics).together(beacons)
    every = "T" if together >= beacons else f"{beacons / together:g} T"
    here = f"Here ({schedule}) each of {beacons} beacons pings every {every}"
    return f"T in s, or a rate in Hz. {here}"


# --- The beacons, the GPS and the sea ------------------------------------------------------------


def _crossed(scenario: Scenario) -> bool:
    """Whether the beacons are at the ends of a cross."""
    return bool(scenario.platform.arrangement == "cross")


def _beacons_keys(scenario: Scenario) -> Sequence[str]:
    return ["platform.arm_length_m" if _crossed(scenario) else "platform.beacon_m"]


def _beacons_takes(scenario: Scenario) -> str:
    places = explained("platform", "beacon_m")
    arms = f"{explained('platform', 'arm_length_m')}, or number x length"
    return f"{arms}. Or: {places}" if _crossed(scenario) else places


def _beacons_shown(scenario: Scenario) -> str:
    if _crossed(scenario):
        return f"{scenario.beacons} arms of {quantity(scenario.platform.arm_length_m, 'm')}"
    rows = _rows(scenario.platform.beacon_m)
    return "; ".join(" ".join(f"{value:g}" for value in row) for row in rows) + " m"


_COUNTED = re.compile(r"\s*(\d+) *(?:[x×*]|arms of\b)(.*)", re.IGNORECASE)


def _beacons(text: str, scenario: Scenario) -> Values:
    crossed = _crossed(scenario)
    both = _COUNTED.fullmatch(text) if crossed else None
    if both is not None:
        arms: Values = {"platform.arm_length_m": typed.number(both[2], "m")}
        count = int(both[1])
        return arms if count == scenario.beacons else {**arms, "platform.beacons": count}
    if crossed and re.fullmatch(r"\s*[3-8]\s*", text):
        it = text.strip()
        raise ConfigurationError(
            f"must have a unit or a length, '{it} m' for arms of {it} m or '{it} x 3 m' for {it} "
            f"beacons on arms of 3 m, got {quoted(text)}"
        )
    found = typed.rows(re.sub(r"\barms of\b", "", text), "m")
    if len(found) == 1 and crossed:
        return {"platform.arm_length_m": found[0]}
    return {"platform.beacon_m": found, "platform.beacons": None}


def _rows(flat: Sequence[float]) -> list[Sequence[float]]:
    return [flat[i : i + 3] for i in range(0, len(flat), 3)]


_WHITE, _GRADE = "platform.gps_horizontal_std_m", "platform.gps_grade"
_SIZES = "sizes of the errors as platform.gps_… in the file"
_ALSO = {
    "rtk": "rtk_fixed", "dgps": "differential", "egnos": "sbas", "waas": "sbas",
    "autonomous": "standalone", "ordinary": "standalone", "normal": "standalone",
}  # fmt: skip
"""Grades of GPS under the names that data sheets and people have for them."""


def _white(scenario: Scenario) -> bool:
    """Whether one number is all of the GPS's horizontal error, as in the paper."""
    it = scenario.platform
    slow = it.gps_horizontal_bias_std_m or it.gps_horizontal_markov_std_m
    return it.gps_grade is None and not slow


def _gps_takes(scenario: Scenario) -> str:
    sizes = [f"{name} ({meters(it.within)})" for name, it in GRADES.items()]
    grades = f"{listed(sizes, 'or')}; in brackets what 95 % of its positions are within"
    number = explained(*_WHITE.split(".")) if _white(scenario) else _SIZES
    return f"{grades}. Or: {number}"


def _gps_shown(scenario: Scenario) -> str:
    if _white(scenario):
        return quantity(value_of(scenario, _WHITE), "m")
    return scenario.platform.gps_grade or listed([*conditions.gps(scenario.platform)])


def _gps(text: str, scenario: Scenario) -> Values:
    size = typed.are_numbers(text)
    if _white(scenario) and size:
        return {_WHITE: typed.number(text, "m")}
    others = "a number in m" if _white(scenario) else _SIZES if size else ""
    return {_GRADE: typed.name(text, GRADES, _ALSO, others)}


def _sea_shown(scenario: Scenario) -> str:
    level = scenario.platform.beaufort
    if level is not None:
        return f"Beaufort {level}"
    return listed([*conditions.sea(scenario.platform)] or ["at rest"])


def _sea(text: str, scenario: Scenario) -> Values:
    level = typed.number(re.sub("beaufort", "", text, flags=re.IGNORECASE))
    return {"platform.beaufort": int(level) if float(level).is_integer() else level}


# --- The dive ------------------------------------------------------------------------------------

_WAYPOINTS, _FILES = "waypoints", (".csv", ".gpx")
_SHAPES = tuple(it for it in TRAJECTORIES.values() if it not in (_WAYPOINTS, FILE))
_OWN_POINTS = ("waypoint_m", "waypoint_count", *POINT_KEYS, *FILE_KEYS)

_POINTS = "points, each north, east and down in m"
_TRACK = f"the file of a recorded track, {listed(_FILES, 'or')}"


def _path_takes(scenario: Scenario) -> str:
    return f"{', '.join(_SHAPES)}. Or {_POINTS}. Or {_TRACK}"


def _path_shown(scenario: Scenario) -> str:
    target = scenario.target
    if target.trajectory == _WAYPOINTS:
        return f"through {counted(target.waypoint_count, 'point')}"
    return "a recorded track" if target.trajectory == FILE else str(target.trajectory)


def _path(text: str, scenario: Scenario) -> Values:
    without: Values = dict.fromkeys([f"target.{key}" for key in _OWN_POINTS])
    if text.casefold().endswith(_FILES):
        return {**without, "target.trajectory": FILE, "target.track_file": text}
    if typed.are_numbers(text):
        points = typed.rows(text, "m")
        if any(len(it) != 3 for it in points if isinstance(it, list)):
            raise ConfigurationError(
                f"must be {_POINTS}, e.g. {ASKED['path'].example}, got {quoted(text)}"
            )
        return {**without, "target.trajectory": _WAYPOINTS, "target.waypoint_m": points}
    others = f"{_POINTS}, or {_TRACK}"
    return {"target.trajectory": typed.name(text, _SHAPES, others=others)}


def _on_points(scenario: Scenario) -> bool:
    return bool(scenario.target.trajectory == _WAYPOINTS)


_ONE_OR_TWO = "one depth or two"


def _depth_keys(scenario: Scenario) -> Sequence[str]:
    keys = ("waypoint_m",) if _on_points(scenario) else ("depth_start_m", "depth_end_m")
    return [f"target.{key}" for key in keys]


def _depth_takes(scenario: Scenario) -> str:
    return "One depth in m, or that of the beginning and that of the end"


def _depth_shown(scenario: Scenario) -> str:
    target = scenario.target
    ends = target.depth_start_m, target.depth_end_m
    if _on_points(scenario):
        depths = [point[2] for point in _rows(target.waypoint_m)]
        ends = min(depths), max(depths)
    first, last = (f"{end:g}" for end in ends)
    return f"{first} m" if first == last else f"{first} to {last} m"


def _depth(text: str, scenario: Scenario) -> Values:
    found = typed.numbers(re.sub(r"\bto\b", " ", text), "m", _ONE_OR_TWO)
    if len(found) > 2:
        raise ConfigurationError(f"must be {_ONE_OR_TWO} in m, got {quoted(text)}")
    first, last = found[0], found[-1]
    if not _on_points(scenario):
        return dict(zip(_depth_keys(scenario), (first, last), strict=True))
    if min(found) < 0:
        raise ConfigurationError(f"must be at least 0, got {min(found):g}")
    points = _rows(scenario.target.waypoint_m)
    return {"target.waypoint_m": [
        [x, y, round(first + share * (last - first), 3)]
        for (x, y, _), share in zip(points, _shares(points), strict=True)
    ]}  # fmt: skip


def _shares(points: Sequence[Sequence[float]]) -> list[float]:
    """Share of the horizontal way that is behind the diver at each point."""
    legs = [hypot(there[0] - here[0], there[1] - here[1]) for here, there in pairwise(points)]
    behind = [*accumulate(legs, initial=0.0)]
    return [way / (behind[-1] or 1.0) for way in behind]


# --- All of them ---------------------------------------------------------------------------------

_OF_BUOYS = "each buoy has a GPS of its own"
_OF_BOTTOM = "beacons on the bottom have none"
_ROWS: Mapping[str, Decision] = {
    "beacons": Decision(_beacons_keys, _beacons_takes, _beacons_shown, _beacons),
    "mounting": replace(
        _number("platform.mounting_std_m", {"buoys": _OF_BUOYS}),
        takes=lambda scenario: "Standard deviation of a beacon's position, per axis, in m",
    ),
    "gps": Decision(
        lambda scenario: [_WHITE if _white(scenario) else _GRADE],
        _gps_takes, _gps_shown, _gps, {"survey": _OF_BOTTOM}, GRADES,
    ),
    "compass": _number(_compass, {"survey": _OF_BOTTOM, "buoys": _OF_BUOYS}),
    "sea": Decision(
        lambda scenario: ["platform.beaufort"],
        lambda scenario: explained("platform", "beaufort"), _sea_shown,
        _sea,
        {"survey": "beacons on the bottom rest",
         "buoys": "waves that move each buoy by itself are not modelled"},
    ),
    "pings": replace(_number(_PINGS), read=_interval, takes=_pings_takes),
    "noise": _number("acoustics.range_std_m"),
    "path": Decision(
        lambda scenario: ["target.trajectory"], _path_takes, _path_shown, _path, names=_SHAPES
    ),
    "depth": Decision(_depth_keys, _depth_takes, _depth_shown, _depth),
    "speed": _number("target.speed_m_s"),
}  # fmt: skip
DECISIONS: Mapping[str, Decision] = {name: _ROWS[name] for name in ASKED}
"""The decisions, by their names, in the order in which they are asked for."""
