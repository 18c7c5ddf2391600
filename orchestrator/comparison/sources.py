"""Sources of error: the keys of a scenario that each consists of, and how each is switched.

Switched off, a source's keys are 0, or `FLOOR` where a receiver divides by them. Made better, the
keys of a part are scaled until their root sum of squares is the part's level; they are never made
larger. It is the world that changes; what the receiver assumes follows from it.

Levels of what is better:

GPS, tilt
    The grades ``rtk_fixed`` of `sblcosim.models.platform.gps` and ``tactical`` of
    `sblcosim.models.platform.imu`, with their sources.
heading
    0.5°, of a compass with two GNSS antennas: 0.1° to 1.0°, by their distance (u-blox, *GNSS
    Heading*, u-blox.com/en/technologies/gnss-heading).
clock
    0.05 m of sound travel, 33 µs: set by the pulse of a GPS receiver just before the dive. What
    it drifts from then on remains. The figure is an assumption.
sound speed
    0.2 %, 3 m/s: a thermometer that is right to 1 K at 20 °C (2.7 m/s per kelvin: K. V. Mackenzie,
    J. Acoust. Soc. Am. 70, 1981, 807-812).
range noise
    0.02 m, twice the Cramér-Rao bound c/(2π β √(2E/N₀)) of a time of arrival (S. M. Kay,
    *Fundamentals of Statistical Signal Processing* I, 1993, section 3.11) for β = 5 kHz and 13 dB.
depth sensor
    0.02 m, an assumption.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import hypot
from types import MappingProxyType
from typing import Any

from sblcosim.models.settings.presets import preset

from ..errors import ConfigurationError, nearest, quoted
from ..scenario.scenario import Scenario
from ..scenario.schema import rows

FLOOR = 0.01
"""Standard deviation [m] of ranges and depth readings that are switched off. A diver moves so far
while the sound travels: told of less, a receiver believes its model too much."""


@dataclass(frozen=True)
class Part:
    """Keys of one unit that are switched together.

    Attributes
    ----------
    keys
        With their tables.
    better
        Root sum of squares of the values of better equipment; None: it has the same.
    off
        The same of equipment without this error.
    about
        Key of the value that is no error; empty: 0.
    relative
        Whether `better` is a share of that value.
    """

    keys: Sequence[str]
    better: float | None = None
    off: float = 0.0
    about: str = ""
    relative: bool = False


@dataclass(frozen=True)
class Source:
    """A source of error.

    Attributes
    ----------
    name, words
        For tables, and for sentences.
    better
        What is better, in a few words; empty: nothing that can be bought.
    """

    name: str
    words: str
    parts: Sequence[Part]
    better: str = ""


def _keys(table: str, start: str, ends: Iterable[str]) -> tuple[str, ...]:
    return tuple(f"{table}.{start}{end}" for end in ends)


def _grade(name: str, value: str, keys: Iterable[str]) -> float:
    """Root sum of squares of some keys that a grade sets."""
    values = preset(name, value)
    return hypot(*(values.get(key.partition(".")[2], 0.0) for key in keys))


def _gps() -> Iterator[Part]:
    for axis in ("horizontal", "vertical"):
        keys = _keys("platform", f"gps_{axis}_", ("std_m", "bias_std_m", "markov_std_m"))
        yield Part(keys, _grade("gps_grade", "rtk_fixed", keys))
    yield Part(("platform.gps_antenna_offset_m",))


def _imu(axis: str, better: float) -> Iterator[Part]:
    start = f"imu_{axis}_"
    steady = ("std_deg", "bias_deg", "turn_on_std_deg", "markov_std_deg", "step_deg")
    yield Part(_keys("platform", start, steady), better)
    for end in ("drift_deg_s", "temperature_coefficient_deg_K", "scale_factor_error"):
        yield Part(_keys("platform", start, (end,)))


_OF_BITS = ("acoustics.packet_resolution_m", "acoustics.packet_angle_resolution_deg")
_AMPLITUDES = ("roll_amplitude_deg", "pitch_amplitude_deg", "yaw_amplitude_deg",
               "surge_amplitude_m", "sway_amplitude_m", "heave_amplitude_m")

SOURCES: Mapping[str, Source] = {
    source.name: source
    for source in (
        Source("GPS", "the GPS", tuple(_gps()), "RTK"),
        Source("heading", "the heading", tuple(_imu("heading", 0.5)), "0.5°"),
        Source(
            "tilt", "the tilt",
            tuple(_imu("tilt", _grade("imu_grade", "tactical", ("platform.imu_tilt_bias_deg",)))),
            "tactical",
        ),
        Source(
            "IMU alignment", "the alignment of the IMU",
            (Part(("platform.imu_misalignment_deg",)),),
        ),
        Source(
            "mounting", "where the beacons are mounted",
            (Part(("platform.mounting_error_m", "platform.mounting_std_m")),),
        ),
        Source(
            "clock", "the clock",
            (
                Part(_keys("acoustics", "clock_", ("offset_s", "offset_std_s")), 0.05 / 1500),
                Part(_keys("acoustics", "clock_", ("drift_s_s",))),
                Part(_keys("acoustics", "clock_", ("drift_std_s_s",))),
                Part(_keys("acoustics", "clock_", ("sync_age_s",)), 0.0),
            ),
            "0.05 m",
        ),
        Source(
            "processing delay", "the processing delay",
            (Part(
                ("acoustics.processing_delay_s",), about="acoustics.processing_delay_correction_s"
            ),),
        ),
        Source(
            "sound speed", "the sound speed",
            (Part(
                ("acoustics.sound_speed_m_s",), 0.002, about="acoustics.assumed_sound_speed_m_s",
                relative=True,
            ),),
            "0.2 %",
        ),
        Source(
            "range noise", "the noise of the ranges",
            (Part(("acoustics.range_std_m",), 0.02, FLOOR),), "0.02 m",
        ),
        Source("outliers", "outliers", (Part(("acoustics.outlier_probability",)),)),
        Source("packet loss", "packet loss", (Part(("acoustics.loss_probability",)),)),
        Source(
            "rounding", "the rounding of packets",
            tuple(Part((key,)) for key in _OF_BITS),
        ),
        Source(
            "depth sensor", "the depth sensor",
            (
                Part(("target.depth_std_m",), 0.02, FLOOR),
                Part(("target.depth_bias_m", "target.depth_bias_std_m"), 0.02),
            ),
            "0.02 m",
        ),
        Source(
            "platform motion", "the platform's motion",
            tuple(Part((f"platform.{key}",)) for key in _AMPLITUDES),
        ),
    )
}
"""By name."""


def of_scenario(scenario: Scenario, better: bool = False) -> tuple[str, ...]:
    """The sources that a scenario has: those that switching changes.

    Parameters
    ----------
    better
        Those that better equipment changes.
    """
    idle = {".".join(key) for key in scenario.idle()}
    return tuple(
        name for name in SOURCES
        if any(key not in idle for key in _changed(scenario, SOURCES[name], better))
    )


def switched(
    scenario: Scenario, sources: Iterable[str], better: bool = False
) -> dict[str, Any]:
    """Overrides that switch some sources off, or make them better."""
    changes: dict[str, Any] = {}
    for name in sources:
        changes |= _changed(scenario, SOURCES[name], better)
    return changes


def missing(scenario: Scenario, better: bool = False) -> dict[str, str]:
    """Why the other sources cannot be switched, by name.

    Parameters
    ----------
    better
        Whether they would be replaced by better equipment.
    """
    there = of_scenario(scenario)
    why = {}
    for name in SOURCES.keys() - of_scenario(scenario, better):
        if name not in there:
            why[name] = f"which is no error in {scenario.name}"
        elif SOURCES[name].better:
            why[name] = f"which is as good as better equipment in {scenario.name}"
        else:
            why[name] = "for which nothing better is known: it can only be switched off"
    return why


def combination(
    text: str | Sequence[str],
    known: Collection[str],
    others: Mapping[str, str] = MappingProxyType({}),
) -> tuple[str, ...]:
    """The sources that are named together, each once, in the order of `SOURCES`.

    Parameters
    ----------
    text
        ``"clock+sound speed"``, or names; case does not matter; a hyphen or underscore is a space.
    known
        Those that are there.
    others
        Why others are not, by name.

    Raises
    ------
    ConfigurationError
        One of them is not there; the message says why, or suggests the nearest.
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
    """Those of some sources that have a part with the same error in every run."""
    drawn = re.compile("_std_|probability|amplitude|resolution")
    return tuple(
        name for name in sources
        if any(not drawn.search(key) for key in _changed(scenario, SOURCES[name], False))
    )


def _word(name: str) -> str:
    return " ".join(re.sub("[-_]", " ", str(name)).lower().split())


def _changed(scenario: Scenario, source: Source, better: bool) -> dict[str, Any]:
    """Overrides that switch a source; none where there is nothing to switch."""
    changes: dict[str, Any] = {}
    for part in source.parts:
        changes |= _reduced(scenario, part, part.better if better else part.off)
    if any(key in _OF_BITS for key in changes) and scenario.acoustics.packet_bits:
        changes["acoustics.packet_bits"] = None  # they do not hold what is not rounded
    return changes


def _reduced(scenario: Scenario, part: Part, level: float | None) -> dict[str, Any]:
    """The keys of a part, scaled to a level; none where they are not larger."""
    about = float(_value(scenario, part.about) or 0.0) if part.about else 0.0
    values = {key: _value(scenario, key) for key in part.keys}
    values = {key: value for key, value in values.items() if value is not None}
    if level is None or (part.about and _value(scenario, part.about) is None):
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
    """The value of a key; None if it is not known whether the component has it."""
    name, _, key = key.partition(".")
    table = getattr(scenario, name)
    if table.fmu is not None and key not in table.model_fields_set:
        return None
    return getattr(table, key)


def _flat(value: Any) -> tuple[float, ...]:
    return tuple(value) if isinstance(value, tuple) else (value,)
