"""Captures of the JSON API of the Water Linked Underwater GPS.

A capture holds an object for each poll, on a line of its own or in an array: the time, the path of
the endpoint and what it answered.
"""

from __future__ import annotations

import json
import os
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ..data.estimates import Floats
from ..errors import ConfigurationError, shortened
from ..scenario.reading import shown
from ..tracks.place import Origin
from ..words.lists import counted
from ..words.shares import rough_percent
from . import mapped
from .axes import to_ned
from .checks import number
from .mapping import mapping_of
from .meta import BEACONS
from .raw import Raw
from .times import MISSING, UNITS, of_date, scaled

ACOUSTIC = ("position/acoustic/raw", "position/acoustic/filtered")
"""Positions in the axes of the topside unit, with ranges; of the first that is there, the ranges
are used."""
GLOBAL, MASTER, RECEIVERS = "position/global", "position/master", "config/receivers"
ANTENNA = "config/antenna"
"""Place of an antenna as a whole, whose receivers have none of their own there."""
PATHS = (*ACOUSTIC, GLOBAL, MASTER, RECEIVERS, ANTENNA)
"""The endpoints that are read."""
_SETTINGS = (RECEIVERS, ANTENNA)
"""Those whose answers have no time of their own, and may repeat."""
EXCERPT = {"acoustic.csv": ("x_m", "y_m", "z_m"), "global.csv": ("latitude_deg", "longitude_deg")}
"""Files of an excerpt, and the columns beside the time."""
OWN_AXES = "acoustic, own axes"
"""Device of acoustic positions beside those on Earth, if the direction of their axes is unknown."""
_AGE_NS = 5 * 10**9
"""A position of the topside unit is used for at most this long [ns]."""
_TIMES = (*(f"time_{unit}" for unit in UNITS), "time", "timestamp")
_BODIES = ("body", "data", "response")
_NO_DATA = -1.0
_UNITS_BY_DIGITS = ((11, "s"), (14, "ms"), (17, "us"), (20, "ns"))


@dataclass
class _Poll:
    """An answer of the device."""

    line: int
    time_ns: int
    body: Any
    repeated: bool = False


@dataclass
class _Capture:
    """All answers, by endpoint."""

    polls: dict[str, list[_Poll]] = field(default_factory=dict)
    other: Counter[str] = field(default_factory=Counter)


def raw_of(place: Path, content: str, about: Mapping[str, Any], where: str) -> Raw:
    """The tables of a capture, unchecked.

    Raises
    ------
    ConfigurationError
        It is no capture, or the mapping is wrong.
    """
    own = dict(about)
    mapping = mapping_of(own.pop("mapping", {}), where)
    raw = Raw(place.resolve().stem, own, where)
    raw.files = dict.fromkeys(("receptions", "depth", "fixes"), place.name)
    capture = _capture(content, place.name, raw)
    if not capture.polls:
        got = ", ".join(shortened(path) for path in [*capture.other][:3])
        raise ConfigurationError(
            f"{shown(place)}: must be a capture with the paths {', '.join(PATHS)}, got "
            f"{got or 'none that can be read'}"
        )
    for path, count in capture.other.items():
        raw.remarks.append(f"{counted(count, 'answer')} of {shortened(path)} not used")
    axes = mapping.axes or "forward-starboard-down"
    masters = _masters(capture, raw)
    receivers = _receivers(capture, raw, axes)
    _ranges(capture, raw, receivers, masters)
    _positions(capture, raw, axes, masters)
    repeated = sum(poll.repeated for polls in capture.polls.values() for poll in polls)
    total = sum(map(len, capture.polls.values()))
    raw.remarks.append(
        f"{repeated:,} of {total:,} answers ({rough_percent(repeated / total)}) only repeat the "
        "one before"
    )
    raw.remarks.append("times are those of the polls, after the arrival of the sound")
    mapped.located(raw)
    return raw


# --- Answers --------------------------------------------------------------------------------------


def _capture(content: str, file: str, raw: Raw) -> _Capture:
    """The answers, by endpoint, with repeats marked."""
    found: list[tuple[int, Mapping[str, Any]]] = []
    damaged = []
    for line, entry in _entries(content):
        if isinstance(entry, Mapping):
            found.append((line, entry))
        else:
            damaged.append(line)
    raw.damaged("", file, damaged, "damaged")
    times = _times(found, raw)
    capture = _Capture()
    before: dict[str, str] = {}
    unnamed, late = [], []
    for (line, entry), time in zip(found, times, strict=True):
        path, body = _path(entry), _body(entry)
        if not path:
            unnamed.append(line)
        elif path not in PATHS:
            capture.other[path] += 1
        elif time == MISSING and path not in _SETTINGS:
            late.append(line)
        else:
            repeated = path not in _SETTINGS and before.get(path) == (said := _said(body))
            if path not in _SETTINGS:
                before[path] = said
            capture.polls.setdefault(path, []).append(_Poll(line, time, body, repeated))
    raw.damaged("", file, unnamed, "no path of an endpoint")
    raw.damaged("", file, late, "no time")
    return capture


def _said(body: Any) -> str:
    return json.dumps(body, sort_keys=True, default=str)


def _entries(content: str) -> Iterator[tuple[int, Any]]:
    """Each object with the line on which it begins; None for what is damaged."""
    decoder = json.JSONDecoder(parse_float=str)
    gap = re.compile(r"[\s,\[\]]*")
    at, line = 0, 1
    while True:
        begin = gap.match(content, at)
        end = begin.end() if begin else at
        line += content.count("\n", at, end)
        at = end
        if at >= len(content):
            return
        try:
            entry, end = decoder.raw_decode(content, at)
        except (ValueError, RecursionError):
            yield line, None
            end = content.find("\n", at)
            end = len(content) if end < 0 else end
        else:
            whole = isinstance(entry, dict) and "\N{REPLACEMENT CHARACTER}" not in content[at:end]
            yield line, entry if whole else None
        line += content.count("\n", at, end)
        at = end


def _times(found: list[tuple[int, Mapping[str, Any]]], raw: Raw) -> list[int]:
    """The time of each answer [ns]; `MISSING` if it has none."""
    numbers: dict[int, Any] = {}
    times = [MISSING] * len(found)
    for i, (_, entry) in enumerate(found):
        key = next((key for key in _TIMES if key in entry), None)
        value = None if key is None else entry[key]
        if key is not None and key.startswith("time_"):
            times[i] = int(scaled([value], UNITS[key.removeprefix("time_")])[0])
        elif isinstance(value, str) and of_date(value) != MISSING:
            times[i] = of_date(value)
        elif value is not None:
            numbers[i] = value
    if numbers:
        digits = sorted(len(str(value).partition(".")[0]) for value in numbers.values())
        middle = digits[len(digits) // 2]
        unit = next((unit for most, unit in _UNITS_BY_DIGITS if middle <= most), "ns")
        words = {"s": "seconds", "ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds"}
        raw.remarks.append(f"times have {middle} digits and are taken for {words[unit]}")
        for i, value in numbers.items():
            times[i] = int(scaled([value], UNITS[unit])[0])
    return times


def _path(entry: Mapping[str, Any]) -> str:
    """The endpoint of an answer, without host and version; by its content if it is not named."""
    named = next((entry[key] for key in ("path", "endpoint", "url") if key in entry), None)
    if isinstance(named, str):
        path = named.partition("?")[0].rstrip("/").lower()
        path = re.sub(r"^.*api/v\d+/", "", path).lstrip("/")
        return RECEIVERS if re.fullmatch(rf"{RECEIVERS}/\d+", path) else path
    body = _body(entry)
    if isinstance(body, Mapping) and ({"x", "y", "z"} <= body.keys()):
        return ACOUSTIC[1]
    return ""


def _body(entry: Mapping[str, Any]) -> Any:
    body = next((entry[key] for key in _BODIES if key in entry), entry)
    if isinstance(body, str):
        try:
            return json.loads(body, parse_float=str)
        except (ValueError, RecursionError):
            return None
    if body is entry:
        return {key: value for key, value in entry.items() if key not in _TIMES}
    return body


def _number(body: Any, *keys: str) -> float:
    """The number under one of the keys; NaN without."""
    value = next((body[key] for key in keys if key in body), None) if isinstance(
        body, Mapping) else None
    return number(value)


# --- Tables ---------------------------------------------------------------------------------------


def _masters(capture: _Capture, raw: Raw) -> Floats:
    """Time [ns], latitude, longitude and direction [°] of the topside unit; shape (n, 4).

    The times are exact to some hundred nanoseconds.
    """
    rows = []
    for poll in capture.polls.get(MASTER, ()):
        turn = _number(poll.body, "orientation")
        row = (float(poll.time_ns), _number(poll.body, "lat", "latitude"),
               _number(poll.body, "lon", "longitude"), turn)
        if all(map(np.isfinite, row)) and 0 <= turn <= 360 and (row[1] or row[2]):
            rows.append(row)
    found = np.array(sorted(rows), float).reshape(-1, 4)
    table: Floats = found[(np.abs(found[:, 1]) <= 90) & (np.abs(found[:, 2]) <= 180)]
    if len(table):
        raw.remarks.append(
            f"{len(table):,} positions of the topside unit place its axes on Earth; its roll and "
            "pitch are taken for 0"
        )
        if "origin" not in raw.meta:
            middle = np.median(table[:, 1:3], axis=0)
            near = np.flatnonzero(np.all(np.abs(table[:, 1:3] - middle) < 1.0, axis=1))
            first = table[near[0] if len(near) else 0]
            raw.meta["origin"] = {"latitude_deg": first[1], "longitude_deg": first[2]}
            raw.remarks.append(
                "the log has no origin: it is the first position of the topside unit, "
                f"{first[1]:.6f}°, {first[2]:.6f}°"
            )
    return table


def _poses(raw: Raw, masters: Floats, times: Any) -> tuple[Floats, Floats]:
    """North, east, down of the topside unit [m] and its direction [°]; NaN where unknown."""
    place, turn = np.full((len(times), 3), np.nan), np.full(len(times), np.nan)
    origin = raw.meta.get("origin")
    if not len(masters) or not len(times) or not isinstance(origin, Mapping):
        return place, turn
    try:
        home = Origin(
            float(origin["latitude_deg"]), float(origin["longitude_deg"]),
            float(origin.get("height_m", 0.0)),
        )
    except (KeyError, TypeError, ValueError):
        return place, turn  # the check of what the log says about itself refuses it
    when = np.asarray(times, float)
    last = np.searchsorted(masters[:, 0], when, "right") - 1
    known = (last >= 0) & (when - masters[last, 0] <= _AGE_NS)
    rows = masters[last[known]]
    ned = home.local(np.column_stack([rows[:, 1:3], np.full(len(rows), home.height_m)]))
    ned[:, 2] = 0.0
    place[known], turn[known] = ned, rows[:, 3]
    return place, turn


def _receivers(capture: _Capture, raw: Raw, axes: str) -> dict[str, list[float]]:
    """Positions of the receivers in the axes of the topside unit: forward, starboard, down."""
    found: dict[float, list[float]] = {}
    for poll in capture.polls.get(RECEIVERS, ()):
        many = isinstance(poll.body, list)
        for i, one in enumerate(poll.body if many else [poll.body]):
            place = [_number(one, axis) for axis in "xyz"]
            named = _number(one, "id")
            if all(map(np.isfinite, place)):
                found[named if np.isfinite(named) else i] = place
    if not found:
        return {}
    ned = to_ned(np.array([found[i] for i in sorted(found)]), axes)
    return {f"R{i}": place for i, place in enumerate(ned.tolist())}


def _ranges(
    capture: _Capture, raw: Raw, receivers: dict[str, list[float]], masters: Floats
) -> None:
    """Receptions of the receivers, and depths."""
    path = next((path for path in ACOUSTIC if path in capture.polls), None)
    polls = capture.polls.get(path, []) if path else []
    heard: dict[str, list[Any]] = {
        name: [] for name in ("line", "arrival_ns", "beacon", "range_m", "valid", "repeated")
    }
    depths, before = [], None
    for poll in polls:
        body = poll.body if isinstance(poll.body, Mapping) else {}
        ranges, valid = body.get("receiver_distance"), body.get("receiver_valid")
        again = poll.repeated or (bool(ranges) and ranges == before)
        before = ranges
        for i, value in enumerate(ranges if isinstance(ranges, list) else ()):
            counts = valid[i] if isinstance(valid, list) and i < len(valid) else 1
            row = (poll.line, poll.time_ns, f"R{i}", value, number(counts) != 0
                   if not isinstance(counts, bool) else counts, again)
            for column, cell in zip(heard.values(), row, strict=True):
                column.append(cell)
        place = [_number(body, axis) for axis in "xyz"]
        if not poll.repeated and _fixed(body, place):
            depths.append((poll.line, poll.time_ns, place[2]))
    raw.tables["depth"] = pd.DataFrame(depths, columns=["line", "time_ns", "depth_m"])
    table = pd.DataFrame(heard)
    if table.empty:
        return
    silent = np.array([number(value) == _NO_DATA for value in table["range_m"]])
    raw.note("receptions", table[silent], "no data (-1)")
    table = table[~silent].reset_index(drop=True)
    if not receivers and not {"beacons", "arms_m"} & raw.meta.keys():
        raw.remarks.append(
            f"ranges cannot be used without positions of the receivers: the capture has no "
            f"{RECEIVERS}, and the log neither [arms_m] nor [beacons]"
            + (f"; {ANTENNA} has one place for all of them" if ANTENNA in capture.polls else "")
        )
    poses, turn = _poses(raw, masters, table["arrival_ns"])
    if len(masters):
        raw.meta.setdefault("arms_m", receivers)
        for name, values in zip(("n_m", "e_m", "d_m"), poses.T, strict=True):
            table[f"platform_{name}"] = values
        table["platform_roll_rad"] = table["platform_pitch_rad"] = 0.0
        table["platform_yaw_rad"] = np.radians(turn)
    elif receivers and "beacons" not in raw.meta:
        raw.meta["beacons"] = receivers
        _along_own_axes(raw, BEACONS)
    raw.tables["receptions"] = table


def _fixed(body: Mapping[str, Any], place: list[float]) -> bool:
    """Whether an answer has a position, and not zeros before the first or -1 for no data."""
    valid = body.get("position_valid", True)
    return (
        bool(valid) and all(map(np.isfinite, place)) and any(place)
        and not all(value == _NO_DATA for value in place)
    )


def _positions(capture: _Capture, raw: Raw, axes: str, masters: Floats) -> None:
    """Positions that the device has computed itself."""
    rows: list[dict[str, Any]] = []
    depths = raw.tables["depth"]
    for path in (*ACOUSTIC, GLOBAL):
        polls = [it for it in capture.polls.get(path, ()) if isinstance(it.body, Mapping)]
        bodiless = [it.line for it in capture.polls.get(path, ())
                    if not isinstance(it.body, Mapping)]
        raw.damaged("fixes", raw.files["fixes"], bodiless, "no answer of the device")
        device = path.removeprefix("position/").replace("/", " ")
        nothing = []
        for poll in polls:
            row = {"line": poll.line, "time_ns": poll.time_ns, "device": device,
                   "repeated": poll.repeated, "valid": bool(poll.body.get("position_valid", True))}
            std = _number(poll.body, "std")
            row["std_m"] = std if std > 0 else np.nan
            if path == GLOBAL:
                row["latitude_deg"] = _number(poll.body, "lat", "latitude")
                row["longitude_deg"] = _number(poll.body, "lon", "longitude")
            else:
                place = [_number(poll.body, axis) for axis in "xyz"]
                if not poll.repeated and row["valid"] and all(
                    value == place[0] for value in place
                ) and place[0] in (0.0, _NO_DATA):
                    nothing.append(poll.line)
                    continue
                row["xyz"] = place
            rows.append(row)
        raw.damaged("fixes", raw.files["fixes"], nothing, "zeros or -1: no position yet")
    if not rows:
        return
    table = pd.DataFrame(rows).drop(columns="xyz", errors="ignore")
    own = np.array(["xyz" in row for row in rows])
    ned = np.full((len(rows), 3), np.nan)
    if own.any():
        ned[own] = to_ned(np.array([row["xyz"] for row in rows if "xyz" in row]), axes)
        if len(masters):
            poses, turn = _poses(raw, masters, table["time_ns"])
            c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
            north, east = c * ned[:, 0] - s * ned[:, 1], s * ned[:, 0] + c * ned[:, 1]
            turned = np.column_stack([north, east, ned[:, 2]]) + poses
            ned = np.where(own[:, None], turned, ned)
        else:
            _along_own_axes(raw, *dict.fromkeys(table["device"][own]))
    for i, axis in enumerate("ned"):
        table[f"{axis}_m"] = ned[:, i]
    lost = own & ~table["repeated"].to_numpy(bool) & ~np.isfinite(ned).all(axis=1)
    raw.damaged("fixes", raw.files["fixes"], table["line"][lost],
                "no numbers, or no position of the topside unit at that time")
    table = table[~lost].reset_index(drop=True)
    if "latitude_deg" in table and len(depths):
        depths = depths.sort_values("time_ns", kind="stable")
        when = depths["time_ns"].to_numpy(np.int64)
        last = np.searchsorted(when, table["time_ns"].to_numpy(np.int64), "right") - 1
        table["depth_m"] = np.where(last >= 0, depths["depth_m"].to_numpy(float)[last], np.nan)
    raw.tables["fixes"] = table.assign(file=raw.files["fixes"])


def _along_own_axes(raw: Raw, *names: str) -> None:
    """Note devices, or the beacons, whose positions are along the axes of the topside unit."""
    frame = raw.meta.setdefault("frame", {})
    if isinstance(frame, dict) and "own_axes" not in frame:
        raw.meta["frame"] = {**frame, "own_axes": [*names]}
    elif isinstance(frame, dict) and isinstance(frame["own_axes"], list):
        raw.meta["frame"] = {**frame, "own_axes": [*dict.fromkeys((*frame["own_axes"], *names))]}


# --- Excerpts -------------------------------------------------------------------------------------


def is_excerpt(folder: Path) -> bool:
    """Whether a folder has positions of the device as `EXCERPT`."""
    return any(os.path.lexists(folder / name) for name in EXCERPT)


def raw_of_excerpt(folder: Path, about: Mapping[str, Any], where: str) -> Raw:
    """The tables of an excerpt, unchecked: polled positions, acoustic and on Earth.

    Raises
    ------
    ConfigurationError
        A file cannot be read, or has other columns.
    """
    sources = [
        {"file": name, "repeats": True, "device_name": "global"} if "x_m" not in columns else
        {"file": name, "repeats": True, "device_name": OWN_AXES, "position": list(columns),
         "no_data": 0}
        for name, columns in EXCERPT.items() if os.path.lexists(folder / name)
    ]
    given = about.get("mapping")
    mapping = {"axes": "forward-starboard-down", **(given if isinstance(given, Mapping) else {})}
    where = where if about else shown(folder)
    raw = mapped.raw_of(folder, {**about, "mapping": {**mapping, "fixes": sources}}, where)
    if any(source["file"] == "acoustic.csv" for source in sources):
        _along_own_axes(raw, OWN_AXES)
    return raw
