"""From tables as read to a checked log: nothing that is wrong goes on, and all of it is told."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from sblcosim.fmus.host.nanoseconds import SECOND

from ..data.estimates import Estimates, Flags, Floats, Integers
from ..data.truth import Truth
from ..data.turns import turned
from ..errors import ConfigurationError, nearest, quoted, shortened
from ..scenario.doubts import of_sound_speed
from ..scenario.tracks import ABOVE
from ..words.lists import first_of, listed
from .columns import AT_ARRIVAL, FARTHEST, FROM_DIVER, KINDS, SIGNED, TABLES, TIMES
from .log import Log, Receptions
from .meta import BEACONS, Meta, meta_of
from .rates import check_rate
from .raw import REPEATED
from .times import MISSING, fast, in_nanoseconds, whole
from .times import NAMES as TIME_COLUMNS

if TYPE_CHECKING:
    from .raw import Raw

UNPLACED = "a beacon without a position"
"""What is said of ranges that cannot be used as nobody knows where their beacon is."""
_PLACED_S = 5.0
"""A line whose time is farther than this from its neighbours' [s] has a wrong time: it is not only
out of order."""
_APART_S = 3600.0
"""A few lines at either end that are farther than this from all others [s] have a wrong time."""
_FEW = 3
"""Number of such lines, at most, or a hundredth of all."""
_NOTHING = ("", "nan", "none", "null", "na", "n/a")
"""Words that stand for nothing, in small letters."""
_SWITCHES = {
    "": "", "true": True, "1": True, "1.0": True, "yes": True,
    "false": False, "0": False, "0.0": False, "no": False,
}
"""Words of switches, in small letters; without a word, nothing is marked."""
_NUMBERS = (
    "range_m", "time_of_flight_s", "turn_around_s", *(f"reported_{axis}_m" for axis in "ned"),
    *(f"platform_{axis}_m" for axis in "ned"),
    *(f"platform_{angle}_rad" for angle in ("roll", "pitch", "yaw")),
)
"""Columns of receptions whose cells must be numbers or empty."""
_ONE = {"depth": "a depth", "truth": "a true position", "fixes": "a position"}
"""What a row of a table is."""
DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?", re.ASCII)
_WITH_COMMA = "a number with a decimal comma, which decimal = \",\" in [mapping.{}] reads"
_NO_KIND = f"a kind of range that is none of {listed(KINDS)}"
EARLY_NS = 500_000_000
"""So long after its arrival no clock's offset explains the epoch of a range."""
_PACKET = re.compile(r"packet_(.+)_([ned])_m")


def log_of(raw: Raw) -> Log:
    """Check what a reader has read.

    Raises
    ------
    ConfigurationError
        A column is missing, or what the log says about itself is wrong.
    """
    meta, remarks = meta_of(raw.meta, raw.where)
    problem = of_sound_speed(meta.sound_speed_m_s)
    remarks += [] if problem is None else [f"{raw.where}: sound_speed_m_s: {problem}"]
    remarks += _unknown_columns(raw)
    entries = {name: len(table) for name, table in raw.tables.items()}
    for finding in raw.findings:  # of lines that are in no table
        if not finding.used:
            entries[finding.table] = entries.get(finding.table, 0) + 1
    raw.tables = {name: in_nanoseconds(table) for name, table in raw.tables.items()}
    heard, beacons = _receptions(raw, meta)
    depth_ns, depth = _depth(raw, meta)
    remarks += _of_depths(raw, depth_ns, depth, heard)
    dry = [name for name, place in meta.beacons.items() if place[2] < -ABOVE]
    if dry:
        remarks.append(
            f"{raw.where}: beacons should be under water (down is positive), got {listed(dry)} at "
            f"depths of {listed([f'{meta.beacons[it][2]:g}' for it in dry])} m"
        )
    if meta.dimension == 2 and len(raw.tables.get("depth", ())):
        remarks.append("depths are not used: the log has dimension = 2")
    remarks += _of_times(raw, heard)
    truth, fixes = _truth(raw), _fixes(raw)
    if truth is not None and meta.dimension == 3 and meta.frame.truth == "same":
        remarks += _above(raw.files.get("truth", "truth"), "true positions", truth.position[:, 2])
    turnaround = _usual_turn_around(raw.tables.get("receptions"))
    remarks += _own_axes(meta, fixes)
    return Log(
        name=meta.name or raw.name, meta=meta, beacons=beacons, receptions=heard,
        depth_ns=depth_ns, depth=depth, truth=truth, fixes=fixes,
        findings=tuple(raw.findings), remarks=(*raw.remarks, *remarks), scenario=raw.scenario,
        entries=entries, turnaround_s=turnaround,
    )


def _of_depths(raw: Raw, time_ns: Integers, depth: Floats, heard: Receptions) -> Iterator[str]:
    """Remarks on depths above the water, and on those of another time than the ranges."""
    file, times = raw.files.get("depth", "depth"), heard.arrival_ns[heard.arrival_ns != MISSING]
    yield from _above(file, "depths", depth)
    if len(depth) and len(times) and (time_ns[0] > times.max() or time_ns[-1] < times.min()):
        apart = max(int(time_ns[0] - times.max()), int(times.min() - time_ns[-1])) / SECOND
        yield (
            f"{file}: depths should be of the time of the ranges, got none: they are "
            f"{apart:,.1f} s {'after' if time_ns[0] > times.max() else 'before'} them"
        )


def _above(file: str, what: str, depth: Floats) -> Iterator[str]:
    """A remark on depths [m] above the water."""
    dry = int((depth < -ABOVE).sum())
    if dry:
        yield (
            f"{file}: {what} should be under water (down is positive), got "
            f"{np.nanmin(depth):.4g} m; {dry:,} of {len(depth):,} are more than {ABOVE:g} m above "
            "it"
        )


def _of_times(raw: Raw, heard: Receptions) -> Iterator[str]:
    """Remarks on a time that is not used, and on ranges that belong to a time after they came."""
    file, table = raw.files.get("receptions", "receptions"), raw.tables.get("receptions")
    if table is not None and {"time_ns", "arrival_ns"} <= {*table.columns}:
        other = whole(table["time_ns"]) != whole(table["arrival_ns"])
        if other.any():
            yield f"{file}: time_ns is not used beside arrival_ns, from which it differs"
    both = (heard.epoch_ns != MISSING) & (heard.arrival_ns != MISSING)
    early = (heard.epoch_ns - heard.arrival_ns)[both]
    many = int((early > EARLY_NS).sum())
    if many:
        yield (
            f"{file}: an epoch should be before the arrival, got one {early.max() / SECOND:.4g} s "
            f"after it; {many:,} of {len(early):,} are more than {EARLY_NS / SECOND:g} s late"
        )


def _own_axes(meta: Meta, devices: Iterable[str]) -> list[str]:
    """A remark on what is not along north and east."""
    own = [name for name in meta.frame.own_axes if name in devices]
    if BEACONS in meta.frame.own_axes:
        own.append("the beacons")
    return [
        f"positions of {listed(own)} are forward, starboard and down, not north and east: their "
        "direction is not in the log"
    ] if own else []


def _unknown_columns(raw: Raw) -> list[str]:
    lines = []
    for name, table in raw.tables.items():
        known = {*TABLES[name].names, *TIME_COLUMNS, "file"}
        other = [c for c in table.columns if c not in known and not _PACKET.fullmatch(str(c))]
        if other:
            close = nearest(str(other[0]), known) if len(other) == 1 else ""
            lines.append(
                f"{raw.files.get(name, name)}: columns without a meaning in a log are not used: "
                f"{first_of([shortened(str(it)) for it in other], 5)}{close}"
            )
    return lines


# --- Receptions -----------------------------------------------------------------------------------


def _receptions(raw: Raw, meta: Meta) -> tuple[Receptions, tuple[str, ...]]:
    table = raw.tables.get("receptions")
    if table is None or table.empty:
        names = (*meta.beacons, *(name for name in meta.arms_m if name not in meta.beacons))
        return _arrays(pd.DataFrame(), meta, names), names
    table = _renamed(raw, table)
    table["arrival"], table["epoch"] = _times(table)
    table["beacon"] = [*map(_word, table["beacon"].to_numpy())]
    table = _marked(raw, "receptions", table)
    if "kind" in table:
        known = table["kind"].map(_word).isin(("", *KINDS)).to_numpy(bool)
        table = _without(raw, "receptions", table, ~known, _NO_KIND)
    wrong, comma = _unreadable(table)
    table = _without(raw, "receptions", table, comma, _WITH_COMMA.format("receptions"))
    table = _without(raw, "receptions", table, wrong[~comma], "a number that cannot be read")
    table["range"] = _ranges(table, meta)
    least = np.where(_kinds(table) == SIGNED, -FARTHEST, 0.0)
    bad = ~((table["range"] >= least) & (table["range"] <= FARTHEST))
    table = _without(raw, "receptions", table, bad.to_numpy(), "no range from 0 m to 1,000 km")
    untimed = ((table["arrival"] == MISSING) & (table["epoch"] == MISSING)).to_numpy(bool)
    table = _without(raw, "receptions", table, untimed, "no time")
    table = _without(raw, "receptions", table, (table["beacon"] == "").to_numpy(), "no beacon")
    check_rate(raw, "receptions", table, ("arrival", "epoch"), "a range of a beacon", "beacon")
    table = _with_both_times(table, meta)
    same = table.duplicated(["arrival", "epoch", "beacon", "range"]).to_numpy()
    table = _without(raw, "receptions", table, same, "the same as one before")
    table = _in_order(raw, "receptions", table, "arrival")
    names = _beacons(table, meta)
    placed = _arrays(table, meta, names)
    known = np.all(np.isfinite(placed.beacon_position), axis=1)
    if not known.all():
        table = _without(raw, "receptions", table, ~known, UNPLACED)
        names = _beacons(table, meta)
        placed = _arrays(table, meta, names)
    return placed, names


def _renamed(raw: Raw, table: pd.DataFrame) -> pd.DataFrame:
    """The table with a number of the line, after its columns have been checked."""
    file = raw.files.get("receptions", "receptions")
    table = table.copy()
    if "arrival_ns" not in table and "time_ns" in table:
        table = table.rename(columns={"time_ns": "arrival_ns"})
    for either in (("beacon",), ("range_m", "time_of_flight_s"), ("arrival_ns", "epoch_ns")):
        if not {*either} & {*table.columns}:
            ours = {"arrival_ns", "epoch_ns"}  # from columns of other units
            added = ours if ({*TIME_COLUMNS} - ours) & {*table.columns} else set()
            raise _lacking(file, either, [str(c) for c in table.columns if c not in added])
    if "line" not in table:
        table["line"] = 0
    return table.reset_index(drop=True)


def _lacking(file: str, needed: Sequence[str], columns: Sequence[str]) -> ConfigurationError:
    """A table has none of the needed columns; a column in another unit is not taken for one."""
    columns = [c for c in columns if c != "line"]
    stems = {name.rpartition("_")[0] for name in needed if "_" in name}
    other = [c for c in columns if c not in needed and c.rpartition("_")[0] in stems]
    meant = [(c, nearest(c, needed).removesuffix("?")) for c in columns if c not in other]
    close = next((f"{it} by {quoted(c)}?" for c, it in meant if it), "")
    if other:
        close = f"; a mapping says the unit of a column such as {quoted(other[0])}"
    return ConfigurationError(
        f"{file}: must have a column {' or '.join(needed)}, got "
        f"{first_of([*map(quoted, columns)], 8) or 'none'}{close}"
    )


def _times(table: pd.DataFrame) -> tuple[Integers, Integers]:
    none = np.full(len(table), MISSING)
    return tuple(  # type: ignore[return-value]
        whole(table[name]) if name in table else none for name in ("arrival_ns", "epoch_ns")
    )


def numbers(values: Any) -> Floats:
    """Numbers; NaN for what is none."""
    values = fast(values)
    if values.dtype.kind in "iuf":
        found: Floats = values.to_numpy(np.float64)
    else:
        found = np.array([number(value) for value in values], np.float64)
    return np.where(np.isfinite(found), found, np.nan)


def number(value: Any) -> float:
    """A number; NaN for what is none."""
    if isinstance(value, bool | np.bool_) or (
        isinstance(value, str) and ("_" in value or not value.isascii())
    ):
        return np.nan
    try:
        found = float(value)
    except (TypeError, ValueError, OverflowError):
        return np.nan
    return found if np.isfinite(found) else np.nan


def _word(value: Any) -> str:
    """A word; empty for what stands for nothing."""
    text = "" if value is None or value != value else str(value).strip()
    return "" if text.lower() in _NOTHING else text


def _marked(raw: Raw, name: str, table: pd.DataFrame) -> pd.DataFrame:
    """The rows that are marked neither as not valid nor as read again."""
    for flag, bad, what in (("valid", False, "marked as not valid"), ("repeated", True, REPEATED)):
        if flag in table:
            marks = [_SWITCHES.get(_word(value).lower()) for value in table[flag]]
            wrong = np.array([mark is None for mark in marks], bool)
            marked = np.array([mark is bad for mark in marks], bool)
            table = _without(raw, name, table, marked, what)
            table = _without(raw, name, table, wrong[~marked], f"{flag} is neither true nor false")
    return table


def _unreadable(table: pd.DataFrame) -> tuple[Flags, Flags]:
    """Rows of receptions with a cell that is neither a number nor empty, where one must be, and
    those of them where it has a decimal comma.

    The columns of numbers hold numbers from then on.
    """
    wrong, comma = np.zeros((2, len(table)), bool)
    for column in table.columns:
        if column in _NUMBERS or _PACKET.fullmatch(str(column)):
            found = numbers(table[column])
            wrong |= _filled(table[column], np.isnan(found))
            comma |= _with_comma(table[column], np.isnan(found))
            table[column] = found
    for column, time in (("arrival_ns", "arrival"), ("epoch_ns", "epoch")):
        if column in table:
            wrong |= _filled(table[column], (table[time] == MISSING).to_numpy(bool))
    return wrong, comma


def _with_comma(values: Any, which: Flags) -> Flags:
    """Which of some cells are numbers with a decimal comma."""
    found = which.copy()
    found[which] = [DECIMAL_COMMA.fullmatch(_word(value)) is not None for value in values[which]]
    return found


def _filled(values: Any, which: Flags) -> Flags:
    """Which of some cells are not empty."""
    filled = which.copy()
    filled[which] = [_word(value) != "" for value in values[which]]
    return filled


def _without(
    raw: Raw, name: str, table: pd.DataFrame, bad: Flags, what: str
) -> pd.DataFrame:
    """The other rows; those that are left out are noted."""
    if not bad.any():
        return table
    raw.note(name, table[bad], what)
    return table[~bad].reset_index(drop=True)


def _ranges(table: pd.DataFrame, meta: Meta) -> Floats:
    given = numbers(table["range_m"]) if "range_m" in table else np.full(len(table), np.nan)
    if "time_of_flight_s" not in table:
        return given
    flight, waits = numbers(table["time_of_flight_s"]), _turn_around(table)
    two_way = _kinds(table) == "two-way"
    length = np.where(two_way, (flight - waits) / 2, flight) * meta.sound_speed_m_s
    return np.where(np.isnan(given), length, given)


def _turn_around(table: pd.DataFrame) -> Floats:
    if "turn_around_s" not in table:
        return np.zeros(len(table))
    return np.nan_to_num(numbers(table["turn_around_s"]))


def _kinds(table: pd.DataFrame) -> Any:
    if "kind" not in table:
        return np.full(len(table), KINDS[0])
    words = table["kind"].map(_word)
    return words.where(words.isin(KINDS), KINDS[0]).to_numpy(str)


def _usual_turn_around(table: pd.DataFrame | None) -> float:
    """Of two-way ranges [s]; 0: there are none, or it is not known."""
    if table is None or table.empty:
        return 0.0
    waits = _turn_around(table)[_kinds(table) == "two-way"]
    return float(np.median(waits)) if len(waits) else 0.0


def _with_both_times(table: pd.DataFrame, meta: Meta) -> pd.DataFrame:
    """Epochs from arrivals where the device gives none, and the reverse.

    A two-way range is the mean of the distances at the question and at the answer: it belongs to
    the middle between them. The arrivals of a numbered ping of the diver belong to their mean.
    """
    kinds = _kinds(table)
    flight = table["range"].to_numpy() / meta.sound_speed_m_s
    wait = np.where(kinds == "two-way", _turn_around(table) / 2, 0.0)
    after = np.where(np.isin(kinds, AT_ARRIVAL), 0.0, flight + wait)
    late = np.rint(after * SECOND).astype(TIMES)
    arrival, epoch = table["arrival"].to_numpy(), table["epoch"].to_numpy()
    table["arrival"] = np.where(arrival == MISSING, epoch + late, arrival)
    table["epoch"] = np.where(epoch == MISSING, arrival - late, epoch)
    heard = np.isin(kinds, FROM_DIVER) & (epoch == MISSING) & (arrival != MISSING)
    if "ping" in table:
        pings = numbers(table["ping"])
        heard &= np.isfinite(pings)
        for ping in np.unique(pings[heard]).tolist():
            own = heard & (pings == ping)
            first = arrival[own].min()
            table.loc[own, "epoch"] = first + int(np.rint((arrival[own] - first).mean()))
    return table


def _in_order(raw: Raw, name: str, table: pd.DataFrame, key: str) -> pd.DataFrame:
    """Rows by their time; those with a time that cannot be right are left out.

    The longest sequence of rows with times that do not decrease is right. Another row is only out
    of order if its time lies near those of its neighbours in this sequence.
    """
    times = table[key].to_numpy(TIMES)
    right = _longest(times) if len(times) else np.zeros(0, np.intp)
    right = right[_together(times[right])]
    inside = np.zeros(len(times), bool)
    inside[right] = True
    if inside.all():
        return table
    others = np.flatnonzero(~inside)
    if not len(right):
        return table
    after = np.clip(np.searchsorted(right, others), 0, len(right) - 1)
    before = np.clip(after - 1, 0, len(right) - 1)
    off = np.minimum(
        *(np.abs(times[others].astype(float) - times[right[side]]) for side in (before, after))
    )
    near = off <= _PLACED_S * SECOND
    for which, what, used in ((others[near], "out of order", True),
                              (others[~near], "a time far from that of its neighbours", False)):
        raw.note(name, table.iloc[which], what, used=used)
    kept = np.setdiff1d(np.arange(len(times)), others[~near])
    order = kept[np.argsort(times[kept], kind="stable")]
    return table.iloc[order].reset_index(drop=True)


def _longest(times: Integers) -> Any:
    """Indices of the longest sequence of times that do not decrease."""
    if np.all(np.diff(times) >= 0):
        return np.arange(len(times))
    ends: list[int] = []
    where: list[int] = []
    before = np.full(len(times), -1)
    for i, time in enumerate(times.tolist()):
        at = bisect_right(ends, time)
        before[i] = where[at - 1] if at else -1
        ends[at : at + 1] = [time]
        where[at : at + 1] = [i]
    chain, i = [], where[-1]
    while i >= 0:
        chain.append(i)
        i = int(before[i])
    return np.array(chain[::-1], np.intp)


def _together(times: Integers) -> slice:
    """All but a few rows at either end with times far from all others."""
    few = max(_FEW, len(times) // 100)
    far = np.flatnonzero(np.diff(times) > _APART_S * SECOND) + 1
    first = max((i for i in far.tolist() if i <= few), default=0)
    last = min((i for i in far.tolist() if len(times) - i <= few), default=len(times))
    return slice(first, last) if last - first > few else slice(0, len(times))


def _beacons(table: pd.DataFrame, meta: Meta) -> tuple[str, ...]:
    """Names of the beacons: those of ``meta.toml``, then others by name."""
    stated = dict.fromkeys((*meta.beacons, *meta.arms_m))
    heard = {*map(str, table["beacon"].to_numpy())} - stated.keys()
    return (*stated, *sorted(heard, key=_by_number))


def _by_number(name: str) -> tuple[Any, ...]:
    return tuple(int(it) if it.isdecimal() else it for it in re.split(r"(\d+)", name)[1::2]), name


def _arrays(table: pd.DataFrame, meta: Meta, names: tuple[str, ...]) -> Receptions:
    n = len(table)
    number = {name: i for i, name in enumerate(names)}
    beacon = np.array([number[b] for b in table["beacon"].to_numpy()] if n else [], np.intp)

    def columns(prefix: str, parts: str | tuple[str, ...], unit: str) -> Floats:
        wanted = [f"{prefix}_{part}_{unit}" for part in parts]
        if not n or not {*wanted} <= {*table.columns}:
            return np.full((n, 3), np.nan)
        return np.column_stack([numbers(table[name]) for name in wanted])

    place, turn = (
        columns("platform", "ned", "m"), columns("platform", ("roll", "pitch", "yaw"), "rad"),
    )
    posed = np.all(np.isfinite(np.hstack([place, turn])), axis=1)
    place, turn = (np.where(posed[:, None], it, 0.0) for it in (place, turn))
    position = columns("reported", "ned", "m")
    fixed = np.array([meta.beacons.get(name, (np.nan,) * 3) for name in names]).reshape(-1, 3)
    whole_place = np.isfinite(position).all(axis=1, keepdims=True)
    position = np.where(whole_place, position, fixed[beacon])
    arms = np.array([meta.arms_m.get(name, (np.nan,) * 3) for name in names]).reshape(-1, 3)
    by_pose = np.flatnonzero(posed & ~np.isfinite(position).all(axis=1))
    if len(by_pose):
        position[by_pose] = place[by_pose] + turned(turn[by_pose], arms[beacon[by_pose]])
    packet = np.zeros((n, len(names), 3))
    for column in table.columns:
        found = _PACKET.fullmatch(str(column))
        if found and found[1] in number:
            values = np.nan_to_num(numbers(table[column]))
            packet[:, number[found[1]], "ned".index(found[2])] = values
    if not n:
        return Receptions(
            arrival_ns=np.zeros(0, TIMES), epoch_ns=np.zeros(0, TIMES), beacon=beacon, kind=beacon,
            range=np.zeros(0), beacon_position=position, has_pose=posed, platform_position=place,
            platform_attitude=turn, packet=packet, line=np.zeros(0, TIMES),
        )
    return Receptions(
        arrival_ns=table["arrival"].to_numpy(TIMES), epoch_ns=table["epoch"].to_numpy(TIMES),
        beacon=beacon, kind=np.array([KINDS.index(it) for it in _kinds(table)], np.intp),
        range=table["range"].to_numpy(float), beacon_position=position,
        has_pose=posed, platform_position=place, platform_attitude=turn, packet=packet,
        line=table["line"].to_numpy(TIMES),
    )


# --- The other tables -----------------------------------------------------------------------------


def _timed(
    raw: Raw, name: str, needed: tuple[str, ...], table: pd.DataFrame | None = None
) -> pd.DataFrame | None:
    """A table with usable times and numbers, in order; None if the log has no such table."""
    table = raw.tables.get(name) if table is None else table
    if table is None or table.empty:
        return None
    for column in ("time_ns", *needed):
        if column not in table:
            added = {"time_ns"} if ({*TIME_COLUMNS} - {"time_ns"}) & {*table.columns} else set()
            columns = [str(c) for c in table.columns if c not in added]
            raise _lacking(raw.files.get(name, name), (column,), columns)
    table = table.reset_index(drop=True)
    if "line" not in table:
        table["line"] = 0
    table["time"] = whole(table["time_ns"])
    table = _without(
        raw, name, table, (table["time"] == MISSING).to_numpy(), "no time"
    )
    for column in needed:
        given, table[column] = table[column], numbers(table[column])
        comma = _with_comma(given, table[column].isna().to_numpy())
        table = _without(raw, name, table, comma, _WITH_COMMA.format(name))
        bad = ~(table[column].abs() <= FARTHEST).to_numpy()
        table = _without(raw, name, table, bad, f"no {column} within 1,000 km")
    check_rate(raw, name, table, ("time",), _ONE[name])
    return _in_order(raw, name, table, "time")


def _depth(raw: Raw, meta: Meta) -> tuple[Integers, Floats]:
    table = _timed(raw, "depth", ("depth_m",))
    if table is None or meta.dimension == 2:
        return np.zeros(0, TIMES), np.zeros(0)
    same = table.duplicated("time").to_numpy()
    table = _without(raw, "depth", table, same, "a time that has a reading already")
    return table["time"].to_numpy(TIMES), table["depth_m"].to_numpy(float)


def _truth(raw: Raw) -> Truth | None:
    table = _timed(raw, "truth", ("n_m", "e_m", "d_m"))
    if table is None or table.empty:
        return None
    same = table.duplicated("time").to_numpy()
    table = _without(raw, "truth", table, same, "a time that has a position already")
    speeds = [f"velocity_{axis}_m_s" for axis in "ned"]
    velocity = None
    if {*speeds} <= {*table.columns}:
        found = np.column_stack([numbers(table[name]) for name in speeds])
        velocity = found if np.isfinite(found).all() else None
    return Truth(
        time_ns=table["time"].to_numpy(TIMES),
        position=table[["n_m", "e_m", "d_m"]].to_numpy(float), velocity=velocity,
    )


def _fixes(raw: Raw) -> dict[str, Estimates]:
    table = raw.tables.get("fixes")
    if table is None or table.empty:
        return {}
    table = table.reset_index(drop=True)
    if "line" not in table:
        table = table.assign(line=0)
    table = _marked(raw, "fixes", table)
    words = table["device"].map(_word) if "device" in table else pd.Series("", table.index)
    fixes = {}
    for name, rows in table.groupby(words.replace("", "device"), sort=True):
        own = _timed(raw, "fixes", ("n_m", "e_m", "d_m"), rows)
        if own is None or own.empty:
            continue
        same = own.duplicated("time").to_numpy()
        own = _without(raw, "fixes", own, same, "a time that has a position already")
        std = numbers(own["std_m"]) if "std_m" in own else np.full(len(own), np.nan)
        if 0 < np.isnan(std).sum() < len(std):
            raw.remarks.append(f"{name}: some positions have no std_m, so that none is used")
        fixes[str(name)] = Estimates(
            epoch_ns=own["time"].to_numpy(TIMES),
            position=own[["n_m", "e_m", "d_m"]].to_numpy(float),
            position_std=None if np.isnan(std).any() else np.repeat(std[:, None], 3, axis=1),
        )
    return fixes
