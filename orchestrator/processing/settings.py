"""The settings with which receivers run on a log: a scenario, given or made from the log."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from sblcosim.fmus.host.nanoseconds import SECOND, nanoseconds
from sblcosim.models.declaration import number_of
from sblcosim.models.ports import BEACONS
from sblcosim.models.receiver.variables import INITIALISATION
from sblcosim.models.settings.assumptions import has_clock

from ..data.estimates import Floats
from ..data.turns import turned
from ..errors import ConfigurationError, shortened
from ..logs.columns import SIGNED
from ..logs.log import Log
from ..logs.raw import Flaw
from ..scenario.overrides import Changes
from ..scenario.scenario import Scenario, load
from ..words.numbers import meters, rounded
from . import windows
from .playing import plane_of
from .quality import resemblance
from .windows import Window

Arrangement = Literal["platform", "fixed", "buoys"]
Given = str | Path | Mapping[str, Any] | Scenario | None
"""A scenario with settings."""
_FIXED_M = 1e-3
"""A beacon whose reported positions differ by less than this [m] is fixed."""
_STEPS = (1, 2, 5)
LEAST_S, MOST_S = 0.001, 10.0
"""Bounds of the interval between ticks [s]."""
MOST_TICKS = 2_000_000
"""Largest number of ticks."""
_TIMES_STD = 3.0
"""Standard deviation of the start over that of the window, whose ranges the receivers use again."""
_LEAST_STD = 0.01
_SPEED_STD = 1.0
PRIOR = number_of(INITIALISATION, "prior")

ROUGH = {
    "outlier_probability": 0.05,
    "sound_speed_share": 0.05,
    "mounting_std_m": 0.3,
    "clock_offset_std_s": 1e-3,
    "depth_std_m": 0.1,
}
"""Assumptions on an unknown device: share of late ranges, standard deviations
of the speed of sound, of the places of fixed beacons, of the clock, and of the depth."""
_PLACE_SHARE = 0.01
"""Of the distance of the beacons, likewise: places close to each other are measured better."""
_TIMES_OFFSET = 2.0
"""Errors of places over the offsets of beacons from straight lines, which take up a part."""
_DRIFTS_M = 2.0
"""A platform whose reported positions are spread farther than this [m] drifts or sails: of the
assumed GPS, 95 % of the errors are below 1.1 m."""
_ROUNDS = 5
"""Number of times that wrong ranges are looked for."""
_LATE = 5.0
"""Mean excess of late ranges over the noise, likewise, unless the log shows a larger one."""
_FEWEST_LATE = 5
"""Number of late ranges that show their mean excess."""


@dataclass(frozen=True, eq=False)
class Settled:
    """Everything that is decided before receivers run on a log.

    Attributes
    ----------
    log
        The log without ranges that are far too short or far too late.
    scenario
        The scenario with the settings.
    said
        Where they are from, as a sentence.
    arrangement
        What carries the beacons.
    interval_ns
        Time between the ticks of the receivers [ns].
    newest
        Whether a range replaces an earlier one of the same tick, as in simulations.
    slots
        Number of beacons that the receivers are made for.
    window
        Where the receivers start; None: as the scenario says.
    origin
        What is subtracted from all positions, because numbers near 0 are exact; NED [m].
    platform
        Reference point of a platform made up for fixed beacons, minus `origin`, NED [m], or None.
    alike
        `resemblance` of the residuals of ranges to fixed beacons, about straight lines.
    """

    log: Log
    scenario: Scenario
    said: str
    arrangement: Arrangement
    interval_ns: int
    newest: bool
    slots: int
    window: Window | None
    origin: Floats
    platform: Floats | None
    alike: float = 1.0


def settled(
    log: Log, scenario: Given = None, overrides: Changes = (), interval_s: float | None = None,
) -> Settled:
    """Decide how receivers run on a log.

    Parameters
    ----------
    scenario
        A scenario with the settings; None: that of the log itself or, without one, values made
        from the log and `ROUGH`.
    overrides
        Keys of the scenario to change.
    interval_s
        Time between the ticks of receivers [s]; None: that of the scenario, if it made the log,
        otherwise from the times between receptions.

    Raises
    ------
    ConfigurationError
        The log has no ranges or no depths, or a scenario does not fit its beacons.
    """
    _check(log)
    arrangement, origin = arrangement_of(log), _origin(log, arrangement_of(log))
    slots = int(min(max(len(log.beacons), BEACONS.least), BEACONS.most))
    own = scenario is None and log.scenario is not None
    simulated = own and log.meta.start_ns is not None
    straight = None
    if not simulated and SIGNED not in log.kinds:
        log, straight = _believed(log)
    alike = _alike(log, straight) if straight is not None and arrangement == "fixed" else 1.0
    step_ns = _interval(log) if interval_s is None else nanoseconds(interval_s)
    if own or scenario is not None:
        given = load(log.scenario if own else scenario, overrides)  # type: ignore[arg-type]
        said = "those of the log's own scenario" if own else f"those of {given.name!r}"
        if given.beacons != slots:
            raise ConfigurationError(
                f"{given.name}: must have as many beacons as the log, {slots}, got {given.beacons}"
            )
        _check_differences(log, given)
        if simulated and interval_s is None:
            step_ns = nanoseconds(given.receiver.update_interval_s)
    else:
        _check_differences(log, None)
        given = load(rough(log, arrangement, slots, straight, step_ns, origin), overrides)
        said = (
            f"usual values; range noise {meters(_noise(straight))}, from straight lines through "
            "short windows of the log"
        )
    _check_ticks(log, step_ns)
    made_up = arrangement == "fixed" and not simulated and len(log.beacons) <= slots
    return Settled(
        log, given, f"settings: {said}", arrangement, step_ns, simulated, slots,
        None if straight is None else straight.first, origin,
        _made_up(log, origin) if made_up else None,
        alike,
    )


def _check_differences(log: Log, given: Scenario | None) -> None:
    """Refuse differences of arrivals without a scenario that has them."""
    if SIGNED not in log.kinds:
        return
    if given is None:
        raise ConfigurationError(
            f"{shortened(log.called)}: must come with a scenario, as its differences of arrivals "
            "do not tell where receivers can start"
        )
    if has_clock(given.acoustics):
        raise ConfigurationError(
            f"{given.name}: must have acoustics.ranging = 'inverted' and common_clock = false, as "
            f"{log.name} has differences of arrivals"
        )


def _check_ticks(log: Log, step_ns: int) -> None:
    span = log.stop_ns - log.start_ns
    if span // step_ns > MOST_TICKS:
        raise ConfigurationError(
            f"interval: must make at most {MOST_TICKS:,} ticks of the log's "
            f"{rounded(span / SECOND)} s, got {rounded(step_ns / SECOND)} s"
        )


def _lines(log: Log, per_beacon: int = windows.PER_BEACON) -> windows.Lines:
    """Straight lines through windows of a log; times count from its start."""
    heard = log.receptions
    order = np.lexsort((heard.beacon, heard.epoch_ns))
    depth = plane_of(log) if log.meta.dimension == 2 else None
    return windows.lines(log.samples(), heard.beacon_position[order], depth, per_beacon)


def _alike(log: Log, straight: windows.Lines) -> float:
    """Whether errors of ranges last, by their residuals about straight lines."""
    heard = log.receptions
    inside = np.isfinite(straight.residual)
    if straight.scatter is None or not inside.any():
        return 1.0
    beacon = heard.beacon[np.lexsort((heard.beacon, heard.epoch_ns))]
    return resemblance(beacon[inside], straight.residual[inside] / straight.scatter)


def _noise(straight: windows.Lines | None) -> float:
    """Scatter of the ranges about straight lines, at least `_LEAST_STD` [m]; 1 m if not known."""
    return max((straight.scatter if straight is not None else None) or 1.0, _LEAST_STD)


def _late_mean(straight: windows.Lines | None, std: float) -> float:
    """Mean excess of late ranges [m]: by the straight lines, but at least the usual one.

    Excesses beyond a limit are an exponential variable beyond it, with the same mean.
    """
    usual = _LATE * std
    beyond = np.zeros(0) if straight is None else straight.residual - usual
    beyond = beyond[beyond > 0]  # nor NaN, outside windows
    return max(usual, float(beyond.mean())) if len(beyond) >= _FEWEST_LATE else usual


def _believed(log: Log) -> tuple[Log, windows.Lines]:
    """A log without the ranges that are wrong, and straight lines through the others.

    If there are any, long windows come first: in a short one, wrong ranges may be more than half.
    """
    straight, found = _lines(log), []
    for _ in range(_ROUNDS):
        if not straight.wrong.any():
            break
        for per_beacon in (windows.LONG, windows.PER_BEACON):
            heard, straight = log.receptions, _lines(log, per_beacon)
            wrong = np.lexsort((heard.beacon, heard.epoch_ns))[straight.wrong]
            off = straight.residual[straight.wrong]
            found += [*zip(heard.line[wrong], heard.beacon[wrong], off, strict=True)]
            log = replace(log, receptions=heard.chosen(np.delete(np.arange(len(heard)), wrong)))
    else:
        straight = _lines(log)
    return replace(log, findings=(*log.findings, *_wrong(log, sorted(found)))), straight


def _wrong(log: Log, found: Sequence[tuple[int, int, float]]) -> Iterator[Flaw]:
    """Findings of the lines, beacons and residuals [m] of ranges that are wrong."""
    for what, which in (("short", [it for it in found if it[2] < 0]),
                        ("late", [it for it in found if it[2] > 0])):
        sizes = [meters(size) for size in sorted(abs(off) for _, _, off in which)]
        by = " to ".join(dict.fromkeys((*sizes[:1], *sizes[-1:])))
        words = f"a range too {what} by {by}, against at least three other beacons"
        for line, beacon, _ in which:
            yield Flaw("receptions", int(line), words, of=log.beacons[beacon], table="receptions")


def _check(log: Log) -> None:
    """Refuse a log that no receiver can use."""
    if not len(log.receptions):
        raise ConfigurationError(
            f"{shortened(log.called)}: must have ranges to be processed, got none"
            + ("; it has fixes only" if log.fixes else "")
        )
    if not len(log.depth) and log.meta.dimension == 3:
        raise ConfigurationError(
            f"{shortened(log.called)}: must have readings of depth, or dimension = 2 in meta.toml "
            "for a log in a plane, got neither"
        )
    heard = len(set(log.receptions.beacon.tolist()))
    if heard < BEACONS.least:
        raise ConfigurationError(
            f"{shortened(log.called)}: must have ranges of at least {BEACONS.least} beacons, got "
            f"{heard}{''.join(f'; {it}' for it in log.counted())}"
        )


def arrangement_of(log: Log) -> Arrangement:
    """What carries the beacons of a log."""
    heard = log.receptions
    if heard.has_pose.any() or log.meta.arms_m:
        return "platform"
    for one in range(len(log.beacons)):
        own = heard.beacon_position[heard.beacon == one]
        if len(own) and np.ptp(own, axis=0).max() > _FIXED_M:
            return "buoys"
    return "fixed"


def _origin(log: Log, arrangement: Arrangement) -> Floats:
    """What is subtracted from all positions: whole kilometres, if they are far from 0."""
    middle = np.median(log.receptions.beacon_position, axis=0)
    middle[2] = 0.0
    far = np.abs(middle).max() > 2_000.0
    whole: Floats = np.round(middle, -3) if far else np.zeros(3)
    return whole


def _interval(log: Log) -> int:
    """Time between ticks that gives most receptions a tick of their own [ns]: 1, 2 or 5 · 10ⁿ."""
    spacing = np.diff(np.unique(log.receptions.arrival_ns)) / SECOND
    usual = float(np.percentile(spacing, 25)) if len(spacing) else 1.0
    usual = min(max(usual, LEAST_S), MOST_S)
    power = 10.0 ** np.floor(np.log10(usual) + 1e-9)
    step = max(s for s in _STEPS if s * power <= usual * (1 + 1e-9))
    return nanoseconds(round(float(step * power), 9))


def places_of(log: Log) -> Floats:
    """Position of each beacon, the first that is reported, NED [m]; (beacons, 3)."""
    heard = log.receptions
    rows = np.zeros((len(log.beacons), 3))
    for one in range(len(log.beacons)):
        own = heard.beacon_position[heard.beacon == one]
        rows[one] = own[0] if len(own) else log.meta.beacons.get(log.beacons[one], (0.0,) * 3)
    return rows


def arms_of(log: Log) -> Floats | None:
    """Nominal position of each beacon on its platform, body frame [m]; (beacons, 3).

    As ``meta.toml`` says, else the median of the reported places relative to the reported pose.
    None if neither is known of a beacon.
    """
    heard, rows = log.receptions, []
    for one, name in enumerate(log.beacons):
        if name in log.meta.arms_m:
            rows.append(np.array(log.meta.arms_m[name]))
            continue
        own = heard.chosen(heard.has_pose & (heard.beacon == one))
        if not len(own):
            return None
        off = own.beacon_position - own.platform_position
        rows.append(np.median(turned(own.platform_attitude, off, inverse=True), axis=0))
    return np.round(rows, 4)


def drift_of(log: Log) -> float:
    """Radius about the middle that holds 95 % of the reported positions of a platform [m]."""
    heard = log.receptions
    if heard.has_pose.any():
        groups = [heard.platform_position[heard.has_pose]]
    else:
        groups = [heard.beacon_position[heard.beacon == one] for one in range(len(log.beacons))]
    off = [np.hypot(*(own - own.mean(axis=0))[:, :2].T) for own in groups if len(own)]
    return float(np.percentile(np.concatenate(off), 95)) if off else 0.0


def _made_up(log: Log, origin: Floats) -> Floats:
    """Reference point of a platform that carries fixed beacons; never 0, which means no pose."""
    middle = np.round(places_of(log).mean(axis=0) - origin)
    return middle if middle.any() else np.array([1.0, 0.0, 0.0])


def rough(
    log: Log, arrangement: Arrangement, slots: int, straight: windows.Lines | None, step_ns: int,
    origin: Floats,
) -> dict[str, Any]:
    """The tables of the scenario of an unknown device.

    Parameters
    ----------
    straight
        Straight lines through the log, which tell errors of ranges and of fixed beacons' places;
        None: there are none.
    """
    c = log.meta.sound_speed_m_s
    step_s = step_ns / SECOND
    platform: dict[str, Any] = {"beacons": slots}
    if arrangement == "platform":
        arms = arms_of(log)
        if arms is not None and len(arms) == slots:
            platform["beacon_m"] = arms.tolist()
        platform |= {"beaufort": 2, "gps_grade": "sbas", "imu_grade": "consumer"}
        radius = drift_of(log)
        if radius > _DRIFTS_M:
            circle = min(float(np.ceil(radius)), 1000.0)
            platform |= {"motion": "spectrum", "watch_circle_m": circle}
    else:
        places = places_of(log)[:slots] - origin
        more = [places[-1] + [0.0, 0.0, -1.0 - i] for i in range(slots - len(places))]
        platform["beacon_m"] = _apart(np.vstack([places, *more])).tolist()
        if arrangement == "fixed":
            apart = float(np.ptp(places[:, :2], axis=0).max())
            off = 0.0 if straight is None else _TIMES_OFFSET * straight.offset
            off = max(off, _PLACE_SHARE * apart)
            platform["mounting_std_m"] = min(ROUGH["mounting_std_m"], off)
        else:
            platform |= {"gps_shared": False, "gps_grade": "sbas"}
    std = _noise(straight)
    types = {"platform": "coupled", "fixed": "long_baseline", "buoys": "long_baseline"}
    type_ = types[arrangement] if len(log.beacons) <= slots else "sequential"
    receiver: dict[str, Any] = {"type": type_}
    if type_ != "sequential":
        receiver["acceleration_psd_m2_s3"] = "learned"
    return {
        "name": log.name or "log",
        "title": log.meta.title or log.name,
        "seed": 1,
        "time": {"sampling_time_s": step_s, "duration_s": max(10 * step_s, 1.0)},
        "target": {"depth_std_m": ROUGH["depth_std_m"]},
        "platform": platform,
        "acoustics": {
            "range_std_m": std,
            "outlier_probability": ROUGH["outlier_probability"],
            "outlier_mean_m": _late_mean(straight, std),
            "sound_speed_m_s": c * (1 + ROUGH["sound_speed_share"]),
            "assumed_sound_speed_m_s": c,
            **_of_clock(log),
        },
        "receiver": receiver,
    }


def _of_clock(log: Log) -> dict[str, Any]:
    """How ranges are measured, and the error that all share: of clock or turn-around."""
    if log.kinds.get("inverted") == 1.0:
        return {"ranging": "inverted", "clock_offset_std_s": ROUGH["clock_offset_std_s"]}
    if log.kinds.get("two-way") != 1.0:
        return {"clock_offset_std_s": ROUGH["clock_offset_std_s"]}
    # Half of it is in a range, so this is as many metres.
    return {"ranging": "two_way", "turnaround_bias_std_s": 2 * ROUGH["clock_offset_std_s"]}


def _apart(places: Floats) -> Floats:
    """Places that differ: in a plane, beacons on one pole are at the same. A millimetre of height
    changes no range."""
    each = places.copy()
    for i in range(1, len(each)):
        while (np.abs(each[:i] - each[i]).max(axis=1) < 1e-6).any():
            each[i, 2] += 1e-3
    return each


def start_values(settled: Settled, std: float) -> dict[str, Any]:
    """Parameters with which a receiver starts at the window."""
    window = settled.window
    if window is None:
        return {}
    spread = max(_TIMES_STD * float(window.std.max()), std)
    place = window.position - settled.origin
    return {
        "initialisation": PRIOR,
        "prior_position": tuple(map(float, place)),
        "prior_velocity": tuple(map(float, window.velocity)),
        "prior_position_std": spread,
        "prior_velocity_std": _SPEED_STD,
    }
