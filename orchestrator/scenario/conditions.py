"""The conditions of a scenario in words, as a data sheet and a map name them.

They are the sea, the GPS, the heading, the beacons, what happens to ranges, and what is exact.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from math import hypot, isclose
from pathlib import Path
from typing import Any

from sblcosim.models.acoustics.ranging import RANGINGS, legs
from sblcosim.models.acoustics.schedules import schedule_of
from sblcosim.models.settings.presets import preset

from ..words.lists import listed
from ..words.numbers import figure
from ..words.shares import rough_percent
from . import tracks
from .arrangement import errors_of
from .scenario import Scenario

_GRADES: Mapping[str, str] = {
    "sbas": "SBAS GPS", "rtk_float": "RTK float GPS", "rtk_fixed": "RTK fixed GPS",
}  # fmt: skip
"""Grades whose names are no words."""
_ANGLES = ("roll", "pitch", "yaw")
_SHIFTS = ("surge", "sway", "heave")
_OF_SPECTRUM, _OF_SINES = "wave_", "(roll|pitch|heave)_"
"""Keys of a sea state that only one kind of motion takes."""
_SIGMA = "1σ per axis"


def conditions(scenario: Scenario) -> list[str]:
    """Sea, GPS, heading, beacons and pings; errors of ranges and of the clock; what is exact.

    A sea state or a grade is named only where all keys that it sets have its values. Otherwise the
    sizes are given. Of another FMU, only the name is known.
    """
    platform, acoustics = scenario.platform, scenario.acoustics
    parts: list[Iterator[str]] = [sea(platform), gps(platform), _heading(platform),
                                  _beacons(platform), _survey(platform)]  # fmt: skip
    if platform.fmu is not None:
        parts = [_named("platform", platform)]
    if acoustics.fmu is None:
        parts += [_pings(acoustics, platform.beacons), _ranges(acoustics), _clock(acoustics)]
    else:
        parts.append(_named("acoustics", acoustics))
    return [words for part in (*parts, _exact(platform, acoustics)) for words in part]


def _named(component: str, table: Any) -> Iterator[str]:
    yield f"{component} of {Path(table.fmu).name}"


def _holds(table: Any, name: str, but: str = "none") -> bool:
    """Whether a preset is given, and all keys that it sets have its values, but for some."""
    value = getattr(table, name)
    return value is not None and all(
        isclose(getattr(table, key), it, rel_tol=1e-9, abs_tol=1e-12)
        for key, it in preset(name, value).items() if re.match(but, key) is None
    )


def sea(platform: Any) -> Iterator[str]:
    """The sea state, and waves, a drift and amplitudes that are not its own."""
    known: set[str] = set()
    sines = platform.motion == "sines"
    if _holds(platform, "beaufort", _OF_SPECTRUM if sines else _OF_SINES):
        yield f"Beaufort {platform.beaufort}{'' if sines else ' as a spectrum'}"
        known = {key.partition("_")[0] for key in preset("beaufort", platform.beaufort)}
    if sines:
        moving = [*_amplitudes(platform, _ANGLES, "deg", "°", known),
                  *_amplitudes(platform, _SHIFTS, "m", " m", known)]  # fmt: skip
    else:
        moving = [*_waves(platform, known), *_amplitudes(platform, ("yaw",), "deg", "°", known)]
    yield from moving
    if tracks.follows("platform", platform):
        yield "boat on a recorded track"
    elif platform.boat_speed_m_s:
        yield f"boat under way at {figure(platform.boat_speed_m_s)} m/s"
    elif not moving and not known:
        rests = "platform" if errors_of(platform) in (None, "platform") else "beacons"
        yield f"{rests} at rest"


def _waves(platform: Any, known: set[str]) -> Iterator[str]:
    """A sea with a spectrum, unless it is a known one, and the drift in the watch circle."""
    if platform.wave_height_m and "wave" not in known:
        period = platform.wave_period_s
        peak = "fully developed" if isinstance(period, str) else f"peak at {figure(period)} s"
        yield f"waves of {figure(platform.wave_height_m)} m (significant height, {peak})"
    if platform.watch_circle_m:
        yield f"drift in a circle of {figure(platform.watch_circle_m)} m"


def _amplitudes(
    platform: Any, names: Sequence[str], end: str, unit: str, known: set[str]
) -> Iterator[str]:
    """Motions of a kind, those of one amplitude together."""
    alike: dict[float, list[str]] = {}
    for name in names:
        size = getattr(platform, f"{name}_amplitude_{end}")
        if size and name not in known:
            alike.setdefault(size, []).append(name)
    for size, some in alike.items():
        yield f"{listed(some)} of ±{figure(size)}{unit}"


def gps(platform: Any) -> Iterator[str]:
    """The grade, or the sizes of the errors; nothing where the beacons need none."""
    if errors_of(platform) == "survey":
        return
    each = "" if platform.gps_shared else " on each buoy"
    if _holds(platform, "gps_grade"):
        grade = platform.gps_grade
        yield f"{_GRADES.get(grade, f'{grade} GPS'.replace('_', ' '))}{each}"
        return
    sizes = {
        way: hypot(*(getattr(platform, f"gps_{way}_{end}") for end in (
            "std_m", "bias_std_m", "markov_std_m"
        ))) for way in ("horizontal", "vertical")
    }  # fmt: skip
    if not any(sizes.values()):
        yield f"GPS{each} without error"
        return
    ways = {"horizontal": f"horizontal ({_SIGMA})", "vertical": "vertical (1σ)"}
    parts = [f"{figure(size)} m {ways[way]}" for way, size in sizes.items() if size]
    yield f"GPS error{each} {listed(parts)}"


def _heading(platform: Any) -> Iterator[str]:
    """The IMU's grade, and the heading's error, where a platform's beacons share one."""
    if not platform.gps_shared or errors_of(platform) == "survey":
        return
    if _holds(platform, "imu_grade"):
        yield f"{platform.imu_grade} IMU"
    size = hypot(*(
        getattr(platform, f"imu_heading_{end}_deg")
        for end in ("std", "bias", "turn_on_std", "markov_std", "step")
    ))
    if size:
        yield f"heading error {figure(size)}° RMS"


def _beacons(platform: Any) -> Iterator[str]:
    arms = platform.beacon_scale * platform.arm_length_m
    on = f" on arms of {figure(arms)} m" if platform.arrangement == "cross" else ""
    yield f"{platform.beacons} beacons{on}"


def _pings(acoustics: Any, beacons: int) -> Iterator[str]:
    every = f"every {figure(acoustics.sampling_time_s)} s"
    if RANGINGS[acoustics.ranging].from_diver:
        yield f"a ping of the diver {every}"
        return
    which = "a ping" if schedule_of(acoustics).together(beacons) == 1 else "pings of all"
    yield f"{which} {every}"


def _misaligned(platform: Any) -> dict[str, float]:
    """Standard deviations of the alignment of the beacons' frame [degrees]."""
    return {it: getattr(platform, f"misalignment_{it}_std_deg") for it in ("tilt", "heading")}


def _survey(platform: Any) -> Iterator[str]:
    if platform.mounting_std_m:
        yield f"beacons surveyed to {figure(platform.mounting_std_m)} m ({_SIGMA})"
    turned = [f"{figure(size)}° in {name}" for name, size in _misaligned(platform).items() if size]
    if turned and platform.gps_shared:
        yield f"beacons' frame misaligned by {listed(turned)} (1σ)"


def _bursts(acoustics: Any) -> str:
    length = acoustics.loss_burst_length
    return f" in bursts of {figure(length)} packets" if length else ""


def _ranges(acoustics: Any) -> Iterator[str]:
    """Noise, loss, echoes and outliers of ranges, and how wrong the assumed speed of sound is."""
    if RANGINGS[acoustics.ranging].from_diver:
        yield "inverted ranging"
    if legs(acoustics.ranging) > 1:
        yield "two-way ranging"
        error = hypot(*(
            getattr(acoustics, f"turnaround_{end}_s") for end in ("std", "bias_std", "beacon_std")
        ))
        if error:
            yield f"turn-around error {figure(1e3 * error)} ms (1σ)"
    noise = acoustics.range_std_m
    yield f"range noise {figure(noise)} m (1σ)" if noise else "ranges without noise"
    if acoustics.loss_probability:
        yield f"{rough_percent(acoustics.loss_probability)} packet loss{_bursts(acoustics)}"
    shadow = acoustics.shadow_loss_probability
    if shadow:
        yield f"{rough_percent(shadow)} loss in the shadow of the diver's body"
    mirrors = [
        mirror for mirror in ("surface", "bottom")
        if (acoustics.loss_probability or shadow)
        and getattr(acoustics, f"{mirror}_echo_probability")
        and (mirror == "surface" or acoustics.water_depth_m)
    ]
    if mirrors:
        yield f"echoes from {listed(mirrors)}"
    if acoustics.outlier_probability and acoustics.outlier_mean_m:
        yield f"{rough_percent(acoustics.outlier_probability)} outliers"
    wrong = abs(acoustics.assumed_sound_speed_m_s / acoustics.sound_speed_m_s - 1)
    if wrong:
        yield f"speed of sound off by {rough_percent(wrong)}"


def _clock(acoustics: Any) -> Iterator[str]:
    """The clock's grade or its drift, and since when; and its offset when it was set."""
    if legs(acoustics.ranging) > 1:
        return
    offset = hypot(acoustics.clock_offset_s, acoustics.clock_offset_std_s)
    drift = _drift(acoustics)
    age = acoustics.clock_sync_age_s
    since = f" set {figure(age / 60)} min before" if age else " just set"
    if drift and _holds(acoustics, "clock_grade"):
        grade = acoustics.clock_grade
        yield f"{grade if grade == 'crystal' else grade.upper()} clock{since}"
    elif drift:
        yield f"clock{since} with a drift of {figure(1e6 * drift)} ppm (1σ)"
    if offset:
        yield f"clock offset {figure(1e3 * offset)} ms (1σ)"


def _drift(acoustics: Any) -> float:
    return hypot(acoustics.clock_drift_s_s, acoustics.clock_drift_std_s_s)


def _exact(platform: Any, acoustics: Any) -> Iterator[str]:
    """What has no error, though it has one in every real system."""
    names = []
    if acoustics.fmu is None:
        offsets = (acoustics.clock_offset_s, acoustics.clock_offset_std_s)
        if legs(acoustics.ranging) == 1 and not any((*offsets, _drift(acoustics))):
            names.append("clock")
        if acoustics.assumed_sound_speed_m_s == acoustics.sound_speed_m_s:
            names.append("speed of sound")
    mounted = platform.fmu is None and platform.gps_shared
    errors = (platform.mounting_std_m, *platform.mounting_error_m, *_misaligned(platform).values())
    if mounted and not any(errors):
        names.append("mounting")
    if names:
        yield f"exact {listed(names)}"
