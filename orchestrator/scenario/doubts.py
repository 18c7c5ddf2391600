"""Valid input of a scenario that may be a mistake."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import pi, sqrt

from sblcosim.models import RECEIVERS
from sblcosim.models.acoustics.contents import CONTENTS
from sblcosim.models.acoustics.ranging import INVERTED
from sblcosim.models.platform.spectrum import GRAVITY
from sblcosim.models.receiver.receiver import ReceiverDeclaration
from sblcosim.models.receiver.receivers import FOUND
from sblcosim.models.settings.beacons import beacons_of

from ..simulation.plans.alike import alike
from ..simulation.user.receivers import of_fmu
from ..words.lists import listed, plural
from . import arrangement, channel
from .components import by_name, takes
from .scenario import Scenario, Source
from .tracks import ABOVE

PURPOSES: Mapping[str, str] = {name: it.purpose for name, it in FOUND.items() if it.purpose}
"""Purpose of each of our receivers."""


SOUND = (1350.0, 1650.0)
"""Range of sound speeds in any diving water, with a margin [m/s]."""
PINGS: Mapping[str, tuple[str, str]] = {
    "unheard": ("ranging", "no array hears a ping of the diver: try coupled"),
    "no pose": ("packet_content", "packets say nothing of the array's pose ({}): try coupled"),
    "differences": ("common_clock", "there are no ranges, only differences ({}): try array"),
    "common": (
        "range_common_std_m", "all arrivals of a ping share most of their error ({}): try array"
    ),
}
"""What is wrong with receivers for arrivals of a ping: the key of the channel, and the words."""
STEEPEST = 7.0
"""Length of a wave in deep water, in heights, below which it breaks (J. H. Michell, 1893)."""


def doubts(scenario: Scenario, chosen: Mapping[str, Source]) -> Iterator[str]:
    """Possible mistakes; one line each, which names the key or the receiver.

    Parameters
    ----------
    chosen
        The receivers of the run, by label.
    """
    yield from _of_receivers(scenario, chosen)
    yield from _of_names(scenario, chosen)
    yield from _of_waypoints(scenario)
    yield from _of_departure(scenario)
    yield from _of_sound(scenario)
    yield from _of_arrangement(scenario)
    yield from channel.doubts(scenario)
    yield from _of_waves(scenario)


def _of_names(scenario: Scenario, chosen: Mapping[str, Source]) -> Iterator[str]:
    """Named values that no receiver of the run takes.

    A file may have one for its own receiver when another one runs.
    """
    own = scenario.receiver.type
    for key, value in by_name(scenario).items():
        found = {label: takes(source, key, value) for label, source in chosen.items()}
        kept = [label for label, does in found.items() if does is False]
        where = scenario.where("receiver", key)
        for_own = own is not None and takes(own, key, value)
        if not kept or True in found.values() or (for_own and not where.startswith("override ")):
            continue
        others = [name for name in RECEIVERS if takes(name, key, value)]
        keep = plural(len(kept), "keeps its start value", "keep their start values")
        yield (
            f"{where}: {getattr(scenario.receiver, key)!r} is for {listed(others)}; "
            f"{listed(kept)} {keep}"
        )


def _of_waypoints(scenario: Scenario) -> Iterator[str]:
    """Waypoints above the water."""
    target = scenario.target
    if target.fmu is not None or target.trajectory != "waypoints":
        return
    depths = target.waypoint_m[2 : 3 * target.waypoint_count : 3]
    dry = [row for row, depth in enumerate(depths, 1) if depth < -ABOVE]
    if dry:
        rows = "" if len(dry) == 1 else f", likewise {len(dry) - 1} more of {len(depths)} rows"
        yield (
            f"{scenario.where('target', 'waypoint_m')}[{dry[0]},3]: should be under water (down is "
            f"positive), got a depth of {depths[dry[0] - 1]:g} m{rows}"
        )


def _of_departure(scenario: Scenario) -> Iterator[str]:
    """A departure after the end of the run."""
    end = scenario.time.duration_s
    for name, table in (("target", scenario.target), ("platform", scenario.platform)):
        departs = table.departure_time_s
        if table.fmu is None and isinstance(end, float | int) and departs >= end:
            yield (
                f"{scenario.where(name, 'departure_time_s')}: should be before the end of the run "
                f"at {end:g} s, got {departs:g} s: nothing of the path is followed"
            )


def _of_sound(scenario: Scenario) -> Iterator[str]:
    """Speeds of sound that no water has."""
    for key in ("sound_speed_m_s", "assumed_sound_speed_m_s"):
        problem = of_sound_speed(getattr(scenario.acoustics, key))
        if scenario.acoustics.fmu is None and problem is not None:
            yield f"{scenario.where('acoustics', key)}: {problem}"


def of_sound_speed(speed: float) -> str | None:
    """Why a speed of sound [m/s] may be a mistake: no water has it."""
    low, high = SOUND
    if low <= speed <= high:
        return None
    return f"should be from {low:g} to {high:g} m/s, as in water, got {speed:g} m/s"


def _of_waves(scenario: Scenario) -> Iterator[str]:
    """Waves so steep that they break."""
    platform = scenario.platform
    if platform.fmu is not None or platform.motion != "spectrum":
        return
    height, period = platform.wave_height_m, platform.wave_period_s
    shortest = sqrt(2 * pi * STEEPEST * height / GRAVITY)
    if isinstance(period, float) and period < shortest:
        yield (
            f"{scenario.where('platform', 'wave_period_s')}: should be at least {shortest:.3g} s, "
            f"as shorter waves of {height:g} m break, got {period:g} s"
        )


def _of_arrangement(scenario: Scenario) -> Iterator[str]:
    """Beacons above the water, and ambiguities due to their arrangement."""
    platform = scenario.platform
    if platform.fmu:
        return
    is_given = platform.arrangement == "given"
    depths = beacons_of(platform)[2::3]
    dry = [number for number, depth in enumerate(depths, 1) if depth < 0]
    if dry:
        rows = "" if len(dry) == 1 else f", likewise {len(dry) - 1} more of {len(depths)} beacons"
        yield (
            f"{scenario.where('platform', 'beacon_m' if is_given else 'beacon_depth_m')}: beacons "
            f"should be under water (down is positive), got beacon {dry[0]} at a depth of "
            f"{depths[dry[0] - 1]:g} m{rows}"
        )
    problem = alike(
        "degenerate", id(platform), lambda: arrangement.degenerate(beacons_of(platform)), platform
    )
    if problem is not None:
        yield f"{scenario.where('platform', 'beacon_m')}: {problem}"  # arms are in a circle


def _of_receivers(scenario: Scenario, chosen: Mapping[str, Source]) -> Iterator[str]:
    """Receivers for beacons with errors of another kind than the scenario's, or for other ranges.
    """
    platform = scenario.platform
    beacons = alike("errors", id(platform), lambda: arrangement.errors_of(platform), platform)
    for label, source in chosen.items():
        ours = FOUND.get(source) if isinstance(source, str) else None
        declared = ours if isinstance(source, str) else of_fmu(source)
        if declared is None:
            continue
        what = declared.unfit.get(beacons) if beacons is not None else None
        if what is None and ours is not None and (found := _of_pings(scenario, ours)) is not None:
            key, words = PINGS[found]
            what = words.format(scenario.where("acoustics", key))
        if what is not None:
            yield f"receiver {label}: is for {declared.purpose}; here {what}"


def _of_pings(scenario: Scenario, declared: ReceiverDeclaration) -> str | None:
    """Which of `PINGS` holds for one of our receivers."""
    acoustics = scenario.acoustics
    if acoustics.fmu is not None:
        return None
    inverted = acoustics.ranging in INVERTED
    names = {v.name for v in declared.component.of("parameter")}
    if "range_common_std" in names:
        if not inverted:
            return "unheard"
        return "no pose" if CONTENTS[acoustics.packet_content].only_own else None
    claims = "clock_std" in names  # others are for comparisons, or take no errors of a system
    if inverted and not acoustics.common_clock and "beacon_position_source" not in names:
        return "differences"
    common = acoustics.range_common_std_m > acoustics.range_std_m
    return "common" if claims and inverted and common else None
