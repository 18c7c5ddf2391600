"""Files of NMEA 0183 sentences: the platform's position and direction, and fixes of devices.

Positions relative to the platform become north, east, down where its position and direction are
known. Times are those of the sentences, or of a time stamp of the logger before each.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, date, datetime
from math import cos, isfinite, nan, radians, sin
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ..errors import ConfigurationError, shortened
from ..lazy import Module
from ..scenario.reading import shown
from ..tracks.place import Origin
from . import mapped, text
from .mapping import PSIMSSB, mapping_of
from .raw import Raw
from .times import MISSING, of_date, scaled

pynmea2: Any = Module("pynmea2")

_SENTENCE = re.compile(r"[$!][A-Z].*|\+*(?:\d+:)?(?=[A-Z:,\d+]*USBLLONG,).*", re.DOTALL)
_TAG = re.compile(r"\\(?:[^\\]*,)?c:(\d+)[^\\]*\\$")
_DAY_NS = 86_400 * 10**9
_AGE_NS = 5 * 10**9
"""The platform's position and direction are used for at most this long [ns]."""
_DIGITS = {10: "s", 13: "ms", 16: "us", 19: "ns"}
"""Units of whole numbers since 1970 by their number of digits."""
_UNIX_S = 1e9
"""Times of a device from which on they are seconds since 1970, rather than since its start [s]."""


@dataclass
class _Fix:
    """A position of a device, not yet on Earth."""

    line: int
    time_ns: int
    device: str
    ahead: tuple[float, float] | None = None  # forward, starboard
    north: tuple[float, float] | None = None  # north, east
    place: tuple[float, float] | None = None  # latitude, longitude
    down: float = nan
    std: float = nan
    valid: bool = True


@dataclass
class _State:
    """What has been read so far."""

    raw: Raw
    file: str
    psimssb: str
    stamped: bool = False
    time_ns: int = MISSING
    day: int | None = None
    dated: bool = False
    from_start: bool = False  # no times but those of a device, since its start
    place: tuple[int, float, float] | None = None
    turn: tuple[int, float] | None = None
    fixes: list[_Fix] = field(default_factory=list)
    ships: list[_Fix] = field(default_factory=list)
    poses: list[tuple[Any, Any]] = field(default_factory=list)
    other: Counter[str] = field(default_factory=Counter)
    said: set[str] = field(default_factory=set)
    bad: dict[str, list[int]] = field(default_factory=dict)

    def note(self, line: int, what: str) -> None:
        self.bad.setdefault(what, []).append(line)

    def say(self, remark: str) -> None:
        if remark not in self.said:
            self.said.add(remark)
            self.raw.remarks.append(remark)


def raw_of(place: Path, content: str, about: Mapping[str, Any], where: str) -> Raw:
    """The tables of a file of sentences, unchecked.

    Raises
    ------
    ConfigurationError
        There is no sentence with a position, or the mapping is wrong.
    """
    own = dict(about)
    mapping = mapping_of(own.pop("mapping", {}), where)
    raw = Raw(place.resolve().stem, own, where)
    raw.files = {"fixes": place.name}
    state = _State(raw, place.name, mapping.psimssb or PSIMSSB[0])
    lines = [(i, line) for i, line in enumerate(content.split("\n"), 1) if line.strip()]
    split = [(number, *_split(line)) for number, line in lines]
    stamps = [_stamp(prefix) for _, prefix, _ in split]
    state.stamped = sum(it != MISSING for it in stamps) > len(stamps) / 2
    sealed = {_name(it) for _, _, it in split if re.search(r"\*[0-9A-Fa-f]{2}\s*$", it)}
    for (number, _, sentence), stamp in zip(split, stamps, strict=True):
        _line(state, number, sentence, stamp, sealed)
    for what, numbers in state.bad.items():
        raw.damaged("", place.name, numbers, what)
    _finish(state, place)
    return raw


def _finish(state: _State, place: Path) -> None:
    raw = state.raw
    if state.stamped:
        state.say("times are those before the sentences")
    elif state.from_start:
        state.say("times of USBLLONG count from the start of the device")
    elif not state.dated:
        state.say("no sentence has a date: times count from midnight")
    if state.other:
        words = ", ".join(f"{shortened(k)} ({n:,})" for k, n in state.other.most_common(5))
        raw.remarks.append(f"sentences that are not used: {words}")
    chosen = state.fixes or state.ships
    if not chosen:
        other = [*state.bad, *(f"sentences {shortened(name)}" for name in state.other)][:3]
        raise ConfigurationError(
            f"{shown(place)}: must hold sentences with positions (GGA, RMC, PSIMSSB, RATLL, "
            f"USBLLONG or USRTH), got {', '.join(other) or 'none'}"
        )
    if state.fixes and state.ships:
        state.say(f"{len(state.ships):,} positions in GGA and RMC are those of the platform")
    _origin(state)
    found = [_row(state, fix, i) for i, fix in enumerate(chosen)]
    lost = [fix.line for fix, row in zip(chosen, found, strict=True) if row is None]
    raw.damaged(
        "fixes", state.file, lost, "no position and direction of the platform in the 5 s before"
    )
    rows = [row for row in found if row is not None]
    if not rows:
        raise ConfigurationError(
            f"{shown(place)}: must hold the position and direction of the platform (GGA or RMC, "
            "HDT) beside fixes relative to it, got none in the 5 s before a fix"
        )
    raw.tables["fixes"] = pd.DataFrame(rows).assign(file=state.file)
    mapped.located(raw)


# --- Lines ----------------------------------------------------------------------------------------


def _split(line: str) -> tuple[str, str]:
    """What the logger wrote before a sentence, and the sentence."""
    found = _SENTENCE.search(line)
    return (line[: found.start()], line[found.start() :].strip()) if found else (line, "")


def _name(sentence: str) -> str:
    if "USBLLONG," in sentence:
        return "USBLLONG"
    return sentence[1:].partition(",")[0]


def _stamp(prefix: str) -> int:
    """Nanoseconds of a time before a sentence; `MISSING` if there is none."""
    tag = _TAG.search(prefix.strip())
    words = tag[1] if tag else prefix.strip(" \t,;:[]()|")
    whole, _, part = words.partition(".")
    if whole.isascii() and whole.isdigit() and (not part or part.isdigit()):
        unit = _DIGITS.get(len(whole))
        factor = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
        return MISSING if unit is None else int(scaled([words], factor[unit])[0])
    return of_date(words, zone=False)


def _line(
    state: _State, number: int, sentence: str, stamp: int, sealed: set[str]
) -> None:
    if text.damaged(sentence) or not sentence:
        state.note(number, "damaged, or no sentence")
        return
    name = _name(sentence)
    if state.stamped and stamp == MISSING:
        state.note(number, "no time before the sentence")
        return
    if state.stamped:
        state.time_ns = stamp
    if name == "USBLLONG":
        _usbllong(state, number, sentence)
        return
    if "*" not in sentence and name in sealed:
        state.note(number, "no checksum: cut off")
        return
    try:
        parsed = _parsed(sentence, name)
    except pynmea2.ChecksumError:
        state.note(number, "a wrong checksum")
        return
    except pynmea2.SentenceTypeError:
        state.other[name] += 1
        return
    except (pynmea2.ParseError, ValueError, IndexError):
        state.note(number, "damaged, or no sentence")
        return
    reader = _READERS.get(name if name in _READERS else name[2:])
    if reader is None:
        state.other[name] += 1
        return
    try:
        reader(state, number, parsed)
    except (ValueError, TypeError, IndexError, AttributeError, OverflowError):
        state.note(number, "fields that cannot be read")


def _parsed(sentence: str, name: str) -> Any:
    """Fields of a sentence whose checksum, if it has one, is right."""
    if name in ("USRTH", "PSIMSSB") or name[2:] == "THS":
        body, star, seal = sentence[1:].partition("*")
        if star and seal.strip() and f"{pynmea2.NMEASentence.checksum(body):02X}" != seal.upper():
            raise pynmea2.ChecksumError("", "")
        return body.split(",")[1:]
    return pynmea2.parse(sentence)


# --- Times ----------------------------------------------------------------------------------------


def _at(state: _State, moment: Any) -> int:
    """Time of a sentence: the logger's, or its own time of the day, or that of the last one."""
    if state.stamped:
        return state.time_ns
    if moment is None or moment == "":
        return state.time_ns
    if isinstance(moment, str):
        moment = _clock(moment)
    within = (
        (moment.hour * 3600 + moment.minute * 60 + moment.second) * 10**9
        + moment.microsecond * 1000
    )
    if state.day is None:
        state.day = 0
    time = int(state.day * _DAY_NS + within)
    if state.from_start:  # what came before came just before
        _shift(state, time - state.time_ns)
        state.from_start = False
    elif state.time_ns != MISSING:  # the day that is nearest, around midnight
        days = round((state.time_ns - time) / _DAY_NS)
        if days in (-1, 1):
            time += days * _DAY_NS
            state.day += days
    state.time_ns = time
    return time


def _clock(words: str) -> Any:
    """A time of the day, ``hhmmss.sss``."""
    if not re.fullmatch(r"\d{6}(\.\d{0,9})?", words, re.ASCII):
        raise ValueError(words)
    part = int(f"{words[7:]:0<6}"[:6])
    return datetime(
        1970, 1, 1, int(words[:2]), int(words[2:4]), int(words[4:6]), part, tzinfo=UTC
    )


def _on(state: _State, day: date, moment: Any) -> int:
    """Time of a sentence that has a date."""
    if state.stamped:
        return state.time_ns
    number = (day - date(1970, 1, 1)).days
    if not state.dated:  # sentences before it were of this day, too, or of the one before midnight
        before = state.day
        _at(state, moment)
        if before is not None and state.day is not None and state.day < before:  # a long silence
            state.day, state.time_ns = before, state.time_ns + _DAY_NS
        _shift(state, (number - (state.day or 0)) * _DAY_NS)
    state.day, state.dated = number, True
    return _at(state, moment)


def _shift(state: _State, ahead: int) -> None:
    """Move all times so far by some nanoseconds."""
    for fix in (*state.fixes, *state.ships):
        fix.time_ns += ahead if fix.time_ns != MISSING else 0
    state.poses = [
        tuple(None if it is None else (it[0] + ahead, *it[1:]) for it in pose)  # type: ignore[misc]
        for pose in state.poses
    ]
    state.place = None if state.place is None else (state.place[0] + ahead, *state.place[1:])
    state.turn = None if state.turn is None else (state.turn[0] + ahead, *state.turn[1:])
    state.time_ns += ahead if state.time_ns != MISSING else 0


# --- Sentences ------------------------------------------------------------------------------------


def _gga(state: _State, number: int, it: Any) -> None:
    if not it.lat or int(it.gps_qual or 0) == 0:
        state.note(number, "marked as no position")
        return
    time = _at(state, it.timestamp)
    place = _degrees(it)
    state.place = (time, *place)
    height = float(it.altitude) if it.altitude not in (None, "") else nan
    state.ships.append(_Fix(number, time, "GGA", place=place, down=-height))


def _rmc(state: _State, number: int, it: Any) -> None:
    if it.status != "A" or not it.lat:
        state.note(number, "marked as no position")
        return
    dated = it.datestamp is not None and it.datestamp != ""
    time = _on(state, it.datestamp, it.timestamp) if dated else _at(state, it.timestamp)
    place = _degrees(it)
    same = state.place is not None and state.place[0] == time
    state.place = (time, *place)
    if not same:
        state.ships.append(_Fix(number, time, "RMC", place=place))


def _degrees(it: Any) -> tuple[float, float]:
    latitude, longitude = float(it.latitude), float(it.longitude)
    if not (abs(latitude) <= 90 and abs(longitude) <= 180):
        raise ValueError
    return latitude, longitude


def _zda(state: _State, number: int, it: Any) -> None:
    if it.day and it.month and it.year:
        _on(state, date(int(it.year), int(it.month), int(it.day)), it.timestamp)
    else:
        _at(state, it.timestamp)


def _turned(state: _State, degrees: Any) -> None:
    turn = float(degrees)
    if not isfinite(turn) or not 0 <= turn <= 360:
        raise ValueError
    state.turn = state.time_ns, turn


def _hdt(state: _State, number: int, it: Any) -> None:
    _turned(state, it.data[0])


def _ths(state: _State, number: int, fields: list[str]) -> None:
    if fields[1:2] == ["V"]:
        state.note(number, "marked as no direction")
        return
    _turned(state, fields[0])


def _hdm(state: _State, number: int, it: Any) -> None:
    _turned(state, it.data[0])
    state.say("HDM is a magnetic direction: the variation of the compass is not in it")


def _hdg(state: _State, number: int, it: Any) -> None:
    degrees = float(it.data[0])
    fields = [*it.data, "", "", "", ""]
    for value, side in ((fields[1], fields[2]), (fields[3], fields[4])):
        if value:
            degrees += float(value) * (-1 if side == "W" else 1)
    if not fields[3]:
        state.say("HDG has no variation of the compass: directions are magnetic")
    _turned(state, degrees % 360)


def _psimssb(state: _State, number: int, fields: list[str]) -> None:
    device, status, system, up = fields[1], fields[2], fields[4], fields[5]
    if status != "A":
        state.note(number, "marked as no position")
        return
    time = _at(state, fields[0])
    x, y, depth = (float(it) for it in fields[7:10])
    std = nan
    if len(fields) > 10 and not re.fullmatch("[A-Z]", fields[10]):
        std = float(fields[10]) if fields[10] else nan
    else:
        state.say("PSIMSSB comes without the field of the accuracy")
    if not all(map(isfinite, (x, y, depth))):
        raise ValueError
    fix = _Fix(number, time, device or "PSIMSSB", down=depth, std=std if std > 0 else nan)
    if system == "P":
        bearing = radians(y)
        pair = x * cos(bearing), x * sin(bearing)
    elif system == "C" and up == "E":
        pair = y, x
    elif system == "C" and up == "H" and state.psimssb == PSIMSSB[0]:
        pair = y, x
        state.say(
            "PSIMSSB with C,H: x is taken for starboard and y for forward; some makers have it the "
            f'other way round: [mapping] psimssb = "{PSIMSSB[1]}"'
        )
    elif system == "C":
        pair = x, y
    else:
        state.note(number, f"coordinates of another kind ({shortened(system, 10)})")
        return
    if up == "H":
        fix.ahead = pair
    elif up in ("N", "E"):
        fix.north = pair
    else:
        state.note(number, f"coordinates of another kind ({shortened(up, 10)})")
        return
    state.fixes.append(fix)
    state.poses.append((state.place, state.turn))


def _tll(state: _State, number: int, it: Any) -> None:
    if not it.lat or it.target_status == "L":
        state.note(number, "marked as no position")
        return
    time = _at(state, it.timestamp)
    device = str(it.target_name or it.target_number or "RATLL")
    state.fixes.append(_Fix(number, time, device, place=_degrees(it)))
    state.poses.append((state.place, state.turn))


def _usrth(state: _State, number: int, fields: list[str]) -> None:
    """Cerulean: slant range with apparent and, if its compass is right, true directions."""
    time = _at(state, None)
    apparent, elevation, slant, true, true_elevation = (
        float(fields[i]) if fields[i] else nan for i in (1, 2, 3, 5, 6)
    )
    if not isfinite(slant):
        state.note(number, "marked as no position")
        return
    fix = _Fix(number, time, "USRTH")
    if isfinite(true) and isfinite(true_elevation):
        flat = slant * cos(radians(true_elevation))
        fix.north = flat * cos(radians(true)), flat * sin(radians(true))
        fix.down = -slant * sin(radians(true_elevation))
    elif isfinite(apparent) and isfinite(elevation):
        flat = slant * cos(radians(elevation))
        fix.ahead = flat * cos(radians(apparent)), flat * sin(radians(apparent))
        fix.down = -slant * sin(radians(elevation))
        state.say("USRTH without true directions: they are taken along the axes of the receiver")
    else:
        state.note(number, "marked as no position")
        return
    state.fixes.append(fix)
    state.poses.append((state.place, state.turn))


def _usbllong(state: _State, number: int, sentence: str) -> None:
    """EvoLogics: times [s] of the device, the target, its place in two frames, accuracy [m]."""
    fields = sentence.partition("USBLLONG,")[2].partition("*")[0].split(",")
    try:
        values = [float(it) for it in fields]
    except ValueError:
        values = []
    if len(values) != 16 or not all(map(isfinite, values)) or values[2] != int(values[2]):
        state.note(number, "not the 17 fields of USBLLONG")
        return
    since_1970 = values[1] >= _UNIX_S
    if not state.stamped and (since_1970 or state.from_start or state.time_ns == MISSING):
        now = int(scaled([fields[1]], 10**9)[0])
        if state.from_start and since_1970:  # it has been set
            _shift(state, now - state.time_ns)
        state.time_ns = now
        state.from_start = not since_1970
        state.dated = state.dated or since_1970
    x, y, z, east, north, up = values[3:9]
    std = values[15] if values[15] > 0 else nan
    fix = _Fix(number, state.time_ns, f"USBL {int(values[2])}", std=std)
    if east or north or up:
        fix.north, fix.down = (north, east), -up
    else:
        fix.ahead, fix.down = (x, y), z
        state.say("USBLLONG has no east and north: x, y and z are taken for forward, starboard, "
                  "down")
    state.fixes.append(fix)
    state.poses.append((state.place, state.turn))


_READERS: Mapping[str, Callable[[_State, int, Any], None]] = {
    "GGA": _gga, "RMC": _rmc, "ZDA": _zda, "HDT": _hdt, "THS": _ths, "HDM": _hdm, "HDG": _hdg,
    "TLL": _tll, "PSIMSSB": _psimssb, "USRTH": _usrth,
}  # fmt: skip
"""What reads a sentence, by its name without the talker."""


# --- On Earth -------------------------------------------------------------------------------------


def _origin(state: _State) -> None:
    """The first position of the platform is the origin of fixes relative to it."""
    if not state.fixes or not state.ships or "origin" in state.raw.meta:
        return
    places = [it.place for it in state.ships if it.place is not None]
    middle = [sorted(it[k] for it in places)[len(places) // 2] for k in (0, 1)]
    first = next(
        (it for it in places if all(abs(it[k] - middle[k]) < 1 for k in (0, 1))), places[0]
    )
    state.raw.meta["origin"] = {"latitude_deg": first[0], "longitude_deg": first[1]}
    state.say(
        f"the log has no origin: it is the first position of the platform, {first[0]:.6f}°, "
        f"{first[1]:.6f}°"
    )


def _row(state: _State, fix: _Fix, index: int) -> dict[str, Any] | None:
    """A row of the table of fixes; None without the platform's pose, where others have it."""
    row: dict[str, Any] = {
        "line": fix.line, "time_ns": fix.time_ns, "device": fix.device, "std_m": fix.std,
    }
    if fix.place is not None:
        row["latitude_deg"], row["longitude_deg"] = fix.place
        row["depth_m"] = fix.down
        return row
    where, turn = state.poses[index]
    pair = fix.north
    if pair is None and fix.ahead is not None:
        known = turn is not None and 0 <= fix.time_ns - turn[0] <= _AGE_NS
        if known:
            c, s = cos(radians(turn[1])), sin(radians(turn[1]))
            ahead, right = fix.ahead
            pair = c * ahead - s * right, s * ahead + c * right
        else:
            pair = fix.ahead
            if state.turn is not None:
                return None
            state.say(
                "fixes without a direction of the platform are along its axes (forward, "
                "starboard), not north and east"
            )
    home = _home(state)
    place = (0.0, 0.0)
    if home is not None and where is not None and 0 <= fix.time_ns - where[0] <= _AGE_NS:
        place = tuple(home.local(np.array([[where[1], where[2], 0.0]]))[0, :2])
    elif state.ships:
        return None
    else:
        state.say("positions relative to a device are from that device: its place is not in the "
                  "log")
    assert pair is not None
    row["n_m"], row["e_m"] = pair[0] + place[0], pair[1] + place[1]
    row["d_m"] = 0.0 if fix.down != fix.down else fix.down
    return row


def _home(state: _State) -> Origin | None:
    given = state.raw.meta.get("origin")
    try:
        return None if given is None else Origin(
            float(given["latitude_deg"]), float(given["longitude_deg"]),
            float(given.get("height_m", 0.0)),
        )
    except (KeyError, TypeError, ValueError, AttributeError):
        return None  # the check of what the log says about itself refuses it
