"""Equations of the Acoustics (the paper's sections 2 and 2.3; the packet loss of section 4)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import prod
from typing import Any

import casadi as ca

from ..equations import Draw, Equations, Loop, Symbols, Values
from ..geometry import rotation
from .contents import CONTENTS, Content
from .range_errors import FOUND
from .schedules import SCHEDULES
from .variables import COMPONENT

_UNIFORMS = 2.0**53
"""Number of values that a uniform draw can take."""


def _initial(p: Symbols, w: Symbols, t: Any) -> Values:
    drift = p.clock_drift + p.clock_drift_std * w.clock_drift
    n = p.beacons
    slots = [sum((p.slot_order[j] == i + 1) * (j + 1) for j in range(n)) - 1 for i in range(n)]
    return {
        "start": t,
        "clock_offset": (
            p.clock_offset + p.clock_offset_std * w.clock_offset + drift * p.clock_sync_age
        ),
        "clock_drift": drift,
        "range": ca.SX.zeros(n),
        "true_range": ca.SX.zeros(n),
        "range_epoch": ca.repmat(t, n, 1),
        "reception_count": ca.SX.zeros(n),
        "ping_beacon_position": ca.SX.zeros(n, 3),
        "packet_beacon_position": ca.SX.zeros(n, 3),
        "ping_platform_position": ca.SX.zeros(n, 3),
        "ping_platform_attitude": ca.SX.zeros(n, 3),
        "arrival_epoch": ca.repmat(t, n, 1),
        "slot": ca.vertcat(*slots),
        "turn": -1,
        "waiting": 0,
        "unwritten": 0,
    }


def _path_length(p: Symbols, u: Symbols, beacon: Any) -> Any:
    """Acoustic path length [m], from the ping of a beacon to its arrival.

    The travel time solves ``|x + v tau - s| = c tau`` exactly, with x and v at the ping (section
    2.3). It exists as long as the diver is slower than sound.
    """
    offset = u.target_position - beacon
    c = p.sound_speed
    c2_v2 = ca.fmax(c**2 - ca.sumsqr(u.target_velocity), 1e-9 * c**2)
    along = ca.dot(offset, u.target_velocity)
    tau = (along + ca.sqrt(along**2 + c2_v2 * ca.sumsqr(offset))) / c2_v2
    return ca.if_else(p.motion_during_travel, c * tau, ca.sqrt(ca.sumsqr(offset)))


_DRAWS = (
    Draw("clock_offset", "normal", "initial", 1, ("clock_offset_std",)),
    Draw("clock_drift", "normal", "initial", 1, ("clock_drift_std",)),
    Draw("loss", "uniform", "tick", 1, ("loss_probability",)),
    *FOUND["outliers"].draws,
    *FOUND["noise"].draws,
    *(draw for name, it in FOUND.items() if name not in ("outliers", "noise") for draw in it.draws),
)
"""Draws of the clock, the loss and the errors. New draws come last, so that existing draws keep
their numbers."""
_OTHERS = "others"
"""The loop over the beacons that ping together with the first one."""
_PACKET = "packet"
"""The loop that writes the contents of packets."""
_DRAWS_OF_OTHERS = tuple(
    replace(draw, occasion=_OTHERS) for draw in _DRAWS if draw.occasion == "tick"
)


def _tick(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any, k: Any) -> Values:
    turn = _counted_round(p, k - 1)
    for it in SCHEDULES.values():
        if it.first is not None:
            own = _counted_round(p, it.first(k - 1))
            turn = ca.if_else(p.schedule == it.number, own, turn)
    others = sum(
        (p.schedule == it.number) * (it.together(p.beacons) - 1)
        for it in SCHEDULES.values() if it.together(p.beacons) > 1
    )
    partial = prod(p.packet_content != it.number for it in CONTENTS.values() if it.is_everything)
    return {
        **_ping(p, x, u, w, t, turn), "turn": turn, "waiting": others,
        "unwritten": partial + _is_rounded(p) > 0,
    }


def _counted_round(p: Symbols, place: Any) -> Any:
    return place - p.beacons * ca.floor(place / p.beacons)


def _says(p: Symbols, what: Callable[[Content], bool]) -> Any:
    """1 if the packet's content meets the condition, else 0."""
    return sum(p.packet_content == it.number for it in CONTENTS.values() if what(it))


def _other(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """Let the next beacon ping at the same time."""
    turn = ca.if_else(x.turn + 1 < p.beacons, x.turn + 1, 0)
    return {**_ping(p, x, u, w, t, turn), "turn": turn, "waiting": x.waiting - 1}


def _ping(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any, turn: Any) -> Values:
    """The packet of the beacon that pings now."""
    is_turn = [turn == x.slot[i] for i in range(p.beacons)]
    beacon = sum(
        ca.if_else(is_turn[i], u.beacon_position[i, :].T, 0) for i in range(p.beacons)
    )
    true_range = _path_length(p, u, beacon)
    delay = (
        x.clock_offset + x.clock_drift * (t - x.start)
        + p.processing_delay - p.processing_delay_correction
    )
    travel_time = true_range / p.sound_speed
    measured = p.assumed_sound_speed * (travel_time + delay)
    for it in FOUND.values():
        measured = measured + it.error(p, w)
    received = w.loss >= p.loss_probability * _UNIFORMS

    def latch(new: Any, old: Any) -> Any:
        """Replace the row of the pinging beacon if its packet was received."""
        return ca.vertcat(*(
            ca.if_else(received * is_turn[i], new[i, :] if new.shape == old.shape else new,
                       old[i, :])
            for i in range(p.beacons)
        ))

    return {
        "range": latch(measured, x.range),
        "true_range": latch(true_range, x.true_range),
        "range_epoch": latch(t, x.range_epoch),
        "reception_count": latch(x.reception_count + 1, x.reception_count),
        "ping_beacon_position": latch(u.reported_beacon_position, x.ping_beacon_position),
        "packet_beacon_position": ca.if_else(
            received, u.reported_beacon_position, x.packet_beacon_position
        ),
        "ping_platform_position": latch(u.reported_position.T, x.ping_platform_position),
        "ping_platform_attitude": latch(u.reported_attitude.T, x.ping_platform_attitude),
        "arrival_epoch": latch(t + travel_time, x.arrival_epoch),
    }


def _is_rounded(p: Symbols) -> Any:
    return (p.packet_resolution > 0) + (p.packet_angle_resolution > 0) > 0


def _rounded(value: Any, resolution: Any) -> Any:
    """The nearest multiple of a resolution; a resolution of 0 leaves the value unchanged."""
    step = ca.if_else(resolution > 0, resolution, 1)
    return ca.if_else(resolution > 0, ca.floor(value * (1 / step) + 0.5) * step, value)


def _written(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """Round the contents of the packets received just now to the bits they have.

    This is a separate loop, so that packets with full and exact contents cost nothing.
    """
    new = [x.range_epoch[i] == t for i in range(p.beacons)]
    position = _rounded(u.reported_position, p.packet_resolution)
    attitude = _rounded(u.reported_attitude, p.packet_angle_resolution)
    beacons = ca.if_else(
        _says(p, lambda it: it.beacons == "none") * _is_rounded(p), _placed(u, position, attitude),
        _rounded(u.reported_beacon_position, p.packet_resolution),
    )
    has_pose = _says(p, lambda it: it.pose) > 0

    def of_new(row: Any, old: Any) -> Any:
        return ca.vertcat(*(
            ca.if_else(new[i], row[i, :] if row.shape == old.shape else row, old[i, :])
            for i in range(p.beacons)
        ))

    own = of_new(beacons, x.ping_beacon_position)
    return {
        "unwritten": 0,
        "ping_beacon_position": own,
        "packet_beacon_position": ca.if_else(
            _says(p, lambda it: it.beacons == "own"), own,
            ca.if_else(sum(new) > 0, beacons, x.packet_beacon_position),
        ),
        "ping_platform_position": of_new(
            ca.if_else(has_pose, position, 0).T, x.ping_platform_position
        ),
        "ping_platform_attitude": of_new(
            ca.if_else(has_pose, attitude, 0).T, x.ping_platform_attitude
        ),
    }


def _placed(u: Symbols, position: Any, attitude: Any) -> Any:
    """Beacon positions (N, 3) implied by a rounded pose; they rotate with it."""
    n = u.reported_beacon_position.shape[0]
    arms = u.reported_beacon_position - ca.repmat(u.reported_position.T, n, 1)
    turn = rotation(attitude) @ rotation(u.reported_attitude).T
    return ca.repmat(position.T, n, 1) + arms @ turn.T


def _output(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Values:
    return {v.name: getattr(x, v.name) for v in COMPONENT.of("output")}


EQUATIONS = Equations(
    initial=_initial,
    tick=_tick,
    output=_output,
    iterate=(
        Loop(_OTHERS, lambda p, x, u, t: x.waiting, _other),
        Loop(_PACKET, lambda p, x, u, t: x.unwritten, _written),
    ),
    draws=(*_DRAWS, *_DRAWS_OF_OTHERS),
)
