"""Requirements on the channel: bursts of losses, echoes, profiles, slots; and what is doubtful."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

from sblcosim.models.acoustics.ranging import legs
from sblcosim.models.settings.beacons import beacons_of

from ..words.lists import listed
from . import water
from .timing import slot_of

_LOSSLESS = 1e-9
_SAME_SPEED = 1e-6
"""Largest difference between equal speeds of sound [m/s]."""
BENT = 0.01
"""Error of straight rays [m] from which on it is worth a word."""


def problems(target: Any, platform: Any, acoustics: Any) -> Iterator[str]:
    """Contradictions in the tables of a scenario; one line each."""
    if acoustics.fmu is not None:
        return
    yield from _of_bursts(acoustics)
    yield from _of_profile(acoustics)
    depth = acoustics.water_depth_m
    if depth and platform.fmu is None:
        yield from _of_bottom(target, platform, depth)
    slot, two_way = slot_of(acoustics), legs(acoustics.ranging) > 1
    between = f"the time between pings, {acoustics.sampling_time_s:g} s"
    if two_way and acoustics.turnaround_s >= acoustics.sampling_time_s:
        yield (
            f"[acoustics] turnaround_s: must be less than {between}, "
            f"got {acoustics.turnaround_s:g} s"
        )
    elif slot is not None and two_way and (
        acoustics.sampling_time_s < slot.packet_s + slot.turnaround_s
    ):
        yield (
            f"[acoustics] packet_duration_s: request, turn-around and answer must be within "
            f"{between}, got {slot.packet_s + slot.turnaround_s:g} s"
        )
    elif slot is not None and acoustics.sampling_time_s < slot.packet_s:
        yield (
            f"[acoustics] packet_duration_s: must be at most the time between pings, "
            f"{acoustics.sampling_time_s:g} s, got {slot.packet_s:g} s"
        )


def _of_bursts(acoustics: Any) -> Iterator[str]:
    length, loss = acoustics.loss_burst_length, acoustics.loss_probability
    if not length:
        return
    if length < 1:
        yield (
            f"[acoustics] loss_burst_length: must be at least 1 packet, or 0 for losses that are "
            f"independent of each other, got {length:g}"
        )
    elif loss < 1 and length * (1 - loss) < loss * (1 - _LOSSLESS):
        yield (
            f"[acoustics] loss_burst_length: must be at least {loss / (1 - loss):.4g}, as "
            f"{loss:.4g} of all packets are lost and one is received between two bursts, "
            f"got {length:g}"
        )


def _of_profile(acoustics: Any) -> Iterator[str]:
    depths, given = acoustics.profile_depth_m, acoustics.model_fields_set
    for key in ("profile_speed_m_s", "profile_temperature_C", "profile_salinity"):
        values = getattr(acoustics, key)
        if key in given and len(values or ()) != len(depths):
            yield (
                f"[acoustics] {key}: must have as many numbers as profile_depth_m, {len(depths)}, "
                f"got {len(values or ())}"
            )
    if "profile_count" in given and acoustics.profile_count != len(depths):
        yield (
            f"[acoustics] profile_count: must be the number of points of profile_depth_m, "
            f"{len(depths)}, got {acoustics.profile_count}"
        )
    if "profile_speed_m_s" in given and "profile_temperature_C" in given:
        yield "[acoustics] profile_temperature_C: must be left out with profile_speed_m_s"
    if not depths:
        return
    if any(b <= a for a, b in pairwise(depths)):
        yield f"[acoustics] profile_depth_m: must increase, got {list(depths)}"
    if water.profile_speeds(acoustics) is None and not given & {
        "profile_temperature_C", "profile_speed_m_s"
    }:
        yield (
            "[acoustics] profile_depth_m: must come with profile_speed_m_s or "
            "profile_temperature_C, got neither"
        )
    for key in ("sound_speed_m_s", "temperature_C"):
        if key in given:
            yield (
                f"[acoustics] {key}: must be left out with a profile, got "
                f"{getattr(acoustics, key):g}"
            )


def _of_bottom(target: Any, platform: Any, depth: float) -> Iterator[str]:
    """Beacons and paths below the bottom."""
    down = beacons_of(platform)[2::3]
    shift = platform.mean_position_m[2]
    low = [i for i, z in enumerate(down, 1) if z + shift > depth]
    if low:
        deepest = max(down) + shift
        yield (
            f"[acoustics] water_depth_m: must be at least the depth of the beacons, {deepest:g} m "
            f"(beacon {listed([str(i) for i in low])}), got {depth:g}"
        )
    if target.fmu is not None:
        return
    deepest = max(target.depth_start_m, target.depth_end_m)
    if target.trajectory == "waypoints":
        deepest = max(target.waypoint_m[2 : 3 * target.waypoint_count : 3], default=0.0)
    elif target.trajectory == "file":
        deepest = max(target.track_m[2::3], default=0.0)
    if deepest > depth:
        yield (
            f"[acoustics] water_depth_m: must be at least the depth of the diver, {deepest:g} m, "
            f"got {depth:g}"
        )


def _without_effect(acoustics: Any) -> Iterator[tuple[str, str]]:
    """Keys of the water and of the slot that nothing follows from, and why."""
    profile = acoustics.profile_count > 0
    if acoustics.temperature_C is None:
        if acoustics.sample_depth_m is not None:
            yield "sample_depth_m", " without temperature_C"
        if acoustics.salinity is not None and not acoustics.profile_temperature_C:
            yield "salinity", " without a temperature"
    elif not profile:
        speed = water.derived(acoustics)["sound_speed_m_s"]
        given = acoustics.sound_speed_m_s
        if abs(given - speed) > _SAME_SPEED:
            yield "temperature_C", (
                f", as sound_speed_m_s is {given:g} m/s; in this water it is {speed:.6g} m/s"
            )
    if acoustics.packet_duration_s is None:
        if acoustics.guard_interval_s is not None:
            yield "guard_interval_s", " without packet_duration_s"
        if acoustics.reach_m is not None and acoustics.profile_count < 2:
            yield "reach_m", " without packet_duration_s"


def doubts(scenario: Any) -> Iterator[str]:
    """Possible mistakes; one line each, which names the key."""
    acoustics = scenario.acoustics
    if acoustics.fmu is not None:
        return
    for key, why in _without_effect(acoustics):
        yield f"{scenario.where('acoustics', key)}: has no effect{why}"
    slot = slot_of(acoustics)
    if slot is not None and acoustics.sampling_time_s < slot.needed_s * (1 - 1e-9):
        table = "acoustics" if "sampling_time_s" in acoustics.model_fields_set else "time"
        reach = f"{acoustics.reach_m or 0:g} m away"
        echo = slot.travel_s + slot.echo_s + slot.packet_s + slot.turnaround_s
        two_way = legs(acoustics.ranging) > 1
        sent, start, following = (
            ("an answer", "request", "request") if two_way
            else ("a packet", "ping", "beacon's packet")
        )
        last = f"{sent}'s last echo" if slot.echo_s > 0 else sent
        yield (
            f"{scenario.where(table, 'sampling_time_s')}: should be at least {slot.needed_s:g} s, "
            f"got {acoustics.sampling_time_s:g} s: {reach}, {last} ends {echo:.3g} s after its "
            f"{start}, and collides there with the next {following}"
        )
    if acoustics.profile_count > 1 and acoustics.reach_m:
        depths, speeds = acoustics.profile_depth_m, acoustics.profile_speed_m_s
        bent = water.bending(depths, speeds, acoustics.reach_m)
        if bent > BENT:
            yield (
                f"{scenario.where('acoustics', 'profile_depth_m')}: rays are straight here, and "
                f"the sound's way through this profile is bent: {acoustics.reach_m:g} m away, "
                f"ranges are wrong by up to {bent:.2g} m"
            )
