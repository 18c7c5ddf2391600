"""Equations of the Acoustics (the paper's sections 2 and 2.3; the packet loss of section 4).

Echoes and profiles of the speed of sound are in a loop of their own, and so are two-way and
inverted ranging, so that a channel without them costs nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import accumulate
from math import prod
from types import SimpleNamespace
from typing import Any

import casadi as ca

from ..equations import Draw, Equations, Loop, Symbols, Values
from ..geometry import rotation
from ..ports import BEACONS
from .contents import CONTENTS, Content
from .propagation import images, leg_length, mean_speed, path_length
from .range_errors import FOUND
from .ranging import RANGINGS, Ranging
from .schedules import SCHEDULES
from .shadow import of_course
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
        "loss_chance": ca.repmat(p.loss_probability, n, 1),
        "loss_after": ca.vertcat(*_loss_after(p)),
        "turn": -1,
        "waiting": 0,
        "sounding": 0,
        "unwritten": 0,
        "asking": 0,
        "turnaround_error": (
            p.turnaround_bias_std * w.turnaround_bias + p.turnaround_beacon_std * w.turnaround_each
        ),
        "request_chance": ca.repmat(p.loss_probability, n, 1),
        "answer_chance": ca.repmat(p.loss_probability, n, 1),
        "last_position": ca.SX.zeros(n, 3),
        "last_epoch": t,
        "listening": 0,
        "common_error": 0,
        "ping_draws": ca.SX.zeros(sum(draw.size for draw in _SHARED)),
    }


def _loss_after(p: Symbols) -> tuple[Any, Any]:
    """Probability that a packet is lost after one that was received, and after one that was lost.

    E. N. Gilbert, Capacity of a burst-noise channel, Bell Syst. Tech. J. 39, 1960, 1253-1265, with
    all packets lost in the bad state and none in the good one. The share ``loss_probability`` of
    all packets is lost, and ``loss_burst_length`` in a row on average.
    """
    chance, burst = p.loss_probability, p.loss_burst_length
    bursts = burst > 0
    length = ca.fmax(ca.if_else(bursts, burst, 1), 1)
    there = ca.if_else(chance < 1, 1 - chance, 1)
    begins = ca.fmin(ca.if_else(chance < 1, chance / (length * there), 1), 1)
    continues = ca.if_else(chance < 1, 1 - 1 / length, 1)
    return ca.if_else(bursts, begins, chance), ca.if_else(bursts, continues, chance)


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
_CHANNEL = "channel"
"""The loop over the beacons that have just pinged, for echoes and profiles."""
_DRAWS_OF_CHANNEL = (
    *(replace(draw, occasion=_CHANNEL)
      for draw in _DRAWS if draw.occasion == "tick" and draw.name != "loss"),
    *(Draw(f"{mirror}_echo", "uniform", _CHANNEL, 1, (f"{mirror}_echo_probability",))
      for mirror in ("surface", "bottom")),
)
_ROUND_TRIP = "round_trip"
"""The loop over the beacons that have just been asked."""
_LEGS = ("request", "answer")
_DRAWS_OF_ROUND_TRIP = (
    Draw("turnaround_bias", "normal", "initial", 1, ("turnaround_bias_std",)),
    Draw("turnaround", "normal", _ROUND_TRIP, 1, ("turnaround_std",)),
    *(Draw(f"{leg}_loss", "uniform", _ROUND_TRIP, 1, ("loss_probability",)) for leg in _LEGS),
    *(Draw(f"{leg}_{mirror}_echo", "uniform", _ROUND_TRIP, 1, (f"{mirror}_echo_probability",))
      for leg in _LEGS for mirror in ("surface", "bottom")),
    *(replace(draw, occasion=_ROUND_TRIP)
      for draw in _DRAWS if draw.occasion == "tick" and draw.name != "loss"),
)
_ARRIVAL = "arrival"
"""The loop over the beacons that hear the ping of the diver."""
_DRAWS_OF_ARRIVALS = (
    Draw("arrival_loss", "uniform", _ARRIVAL, 1, ("loss_probability",)),
    Draw("arrival_shadow", "uniform", _ARRIVAL, 1, ("shadow_loss_probability",)),
    *(Draw(f"arrival_{mirror}_echo", "uniform", _ARRIVAL, 1, (f"{mirror}_echo_probability",))
      for mirror in ("surface", "bottom")),
    *(replace(draw, occasion=_ARRIVAL)
      for draw in _DRAWS if draw.occasion == "tick" and draw.name != "loss"),
)
_SHARED = (
    *(draw for draw in _DRAWS_OF_ARRIVALS if draw.name.startswith(_ARRIVAL)),
    *FOUND["outliers"].draws,
)
"""What all arrivals of a ping take from the first one if they are lost or late together."""
_DRAW_OF_PING = Draw("range_common", "normal", "tick", 1, ("range_common_std",))
_DRAW_OF_EACH = Draw(
    "turnaround_each", "normal", "initial", 1, ("turnaround_beacon_std",), each=BEACONS
)
_SHADOW = ("shadow_loss_probability",)
_DRAWS_OF_SHADOW = (
    *(Draw("shadow", "uniform", it, 1, _SHADOW) for it in ("tick", _OTHERS)),
    *(Draw(f"{leg}_shadow", "uniform", _ROUND_TRIP, 1, _SHADOW) for leg in _LEGS),
)


def _tick(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any, k: Any) -> Values:
    in_turn = 1 - _which(p, lambda it: it.from_diver)
    turn = _counted_round(p, k - 1)
    for it in SCHEDULES.values():
        if it.first is not None:
            own = _counted_round(p, it.first(k - 1))
            turn = ca.if_else((p.schedule == it.number) * in_turn, own, turn)
    others = sum(
        (p.schedule == it.number) * (it.together(p.beacons) - 1)
        for it in SCHEDULES.values() if it.together(p.beacons) > 1
    )
    sounding = (
        (p.surface_echo_probability + p.bottom_echo_probability + p.profile_count > 0)
        * _broadcast(p) * (others + 1)
    )
    partial = prod(p.packet_content != it.number for it in CONTENTS.values() if it.is_everything)
    return {
        **_ping(p, x, u, w, t, turn), "turn": turn, "waiting": others * in_turn,
        "sounding": sounding, "unwritten": partial + _is_rounded(p) > 0,
        "asking": _which(p, lambda it: it.legs > 1) * (others + 1),
        "listening": _which(p, lambda it: it.from_diver) * p.beacons,
        "common_error": p.range_common_std * w.range_common,
    }


def _which(p: Symbols, of: Callable[[Ranging], bool]) -> Any:
    """1 if the way to range meets the condition, else 0."""
    return sum(p.ranging == it.number for it in RANGINGS.values() if of(it))


def _broadcast(p: Symbols) -> Any:
    """1 if beacons ping and the diver only listens, else 0."""
    return _which(p, lambda it: it.legs == 1 and not it.from_diver)


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
    is_turn = _is_turn(p, x, turn)
    beacon = _pinging(u, is_turn)
    true_range = path_length(p, u, beacon, p.sound_speed)
    travel_time = true_range / p.sound_speed
    chance = sum(ca.if_else(it, x.loss_chance[i], 0) for i, it in enumerate(is_turn))
    received = w.loss >= chance * _UNIFORMS
    after = ca.if_else(received, x.loss_after[0], x.loss_after[1])
    heard = received * (w.shadow >= _shade(p, u, beacon) * _UNIFORMS) * _broadcast(p)
    return {
        **_latched(x, u, t, [heard * it for it in is_turn], {
            "range": _measured(p, x, w, t, travel_time),
            "true_range": true_range,
            "reception_count": x.reception_count + 1,
            "arrival_epoch": t + travel_time,
        }),
        "packet_beacon_position": ca.if_else(
            heard, u.reported_beacon_position, x.packet_beacon_position
        ),
        "loss_chance": ca.vertcat(*(
            ca.if_else(it, after, x.loss_chance[i]) for i, it in enumerate(is_turn)
        )),
    }


def _shade(p: Symbols, u: Symbols, beacon: Any) -> Any:
    """Probability that the diver's body takes a packet. The condition skips it without a shadow."""
    offset = beacon - u.target_position
    chance = of_course(
        ca, [offset[i] for i in range(3)], [u.target_velocity[i] for i in range(2)],
        p.shadow_direction, p.shadow_loss_probability, p.shadow_half_width,
    )
    return ca.if_else(p.shadow_loss_probability > 0, chance, 0)


def _is_turn(p: Symbols, x: Symbols, turn: Any) -> list[Any]:
    """Whether it is each beacon's turn."""
    return [turn == x.slot[i] for i in range(p.beacons)]


def _pinging(u: Symbols, is_turn: list[Any]) -> Any:
    """True position of the beacon whose turn it is, NED [m]."""
    return _row(u.beacon_position, is_turn)


def _row(rows: Any, is_turn: list[Any]) -> Any:
    """The row of the beacon whose turn it is, as a column."""
    return sum(ca.if_else(it, rows[i, :].T, 0) for i, it in enumerate(is_turn))


def _measured(p: Symbols, x: Symbols, w: Symbols, t: Any, travel_time: Any) -> Any:
    """The range that the receiver forms [m], with the errors of its clock and of the range."""
    delay = (
        x.clock_offset + x.clock_drift * (t - x.start)
        + p.processing_delay - p.processing_delay_correction
    )
    measured = p.assumed_sound_speed * (travel_time + delay)
    for it in FOUND.values():
        measured = measured + it.error(p, w)
    return measured


def _latched(x: Symbols, u: Symbols, t: Any, new: list[Any], values: Values) -> dict[str, Any]:
    """Replace the rows of the beacons whose packets were received just now."""

    def latch(value: Any, old: Any) -> Any:
        return ca.vertcat(*(
            ca.if_else(it, value[i, :] if value.shape == old.shape else value, old[i, :])
            for i, it in enumerate(new)
        ))

    values = {
        "range_epoch": t,
        "ping_beacon_position": u.reported_beacon_position,
        "ping_platform_position": u.reported_position.T,
        "ping_platform_attitude": u.reported_attitude.T,
        **values,
    }
    return {name: latch(ca.SX(value), getattr(x, name)) for name, value in values.items()}


def _sound(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """Echo and profile for one of the beacons that have pinged, the last one first.

    If its packet has arrived, the speed of sound along its path replaces the constant one. If not,
    the earliest of its echoes may arrive.
    """
    is_turn = _is_turn(p, x, x.turn)
    beacon = _pinging(u, is_turn)
    heard = sum(it * (x.range_epoch[i] == t) for i, it in enumerate(is_turn)) > 0
    z, diver, bottom = beacon[2], u.target_position[2], p.water_depth
    speed = mean_speed(p, (z, diver))
    direct = path_length(p, u, beacon, speed)
    time = direct / speed
    chances = (p.surface_echo_probability, ca.if_else(bottom > 0, p.bottom_echo_probability, 0))
    spans = (((0, z), (0, diver)), ((z, bottom), (diver, bottom)))
    drawn = (w.surface_echo, w.bottom_echo)
    arrives = [w < chance * _UNIFORMS for w, chance in zip(drawn, chances, strict=True)]
    echoes = []
    for image, depths, there in zip(images(p, beacon), spans, arrives, strict=True):
        along = mean_speed(p, *depths)
        # A beacon lifted out of the water by a wave has no image: its echo counts as direct.
        late = ca.fmax(path_length(p, u, image, along) / along, time)
        echoes.append(ca.if_else(there, late, _NEVER))
    earliest = ca.fmin(*echoes)
    travel_time = ca.if_else(heard, time, earliest)
    new = [it * (heard + (earliest < _NEVER) > 0) for it in is_turn]
    # The noise of a packet that has arrived is in its range; that of an echo is drawn here.
    corrected = x.range + p.assumed_sound_speed * (time - x.true_range / p.sound_speed)
    echo = ca.repmat(_measured(p, x, w, t, travel_time), p.beacons, 1)
    return {
        **_latched(x, u, t, new, {
            "range": ca.if_else(heard, corrected, echo),
            "true_range": direct,
            "reception_count": x.reception_count + 1 - heard,
            "arrival_epoch": t + travel_time,
        }),
        "packet_beacon_position": ca.if_else(
            sum(new) > 0, u.reported_beacon_position, x.packet_beacon_position
        ),
        "turn": ca.if_else(x.turn > 0, x.turn - 1, p.beacons - 1),
        "sounding": x.sounding - 1,
    }


_NEVER = 1e9
"""Travel time [s] of an echo that does not arrive."""


def _round_trip(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """Request and answer of one of the beacons that have been asked, the last one first.

    The tick is in the middle of the turn-around. The request comes to the beacon half of it before,
    the answer leaves half of it after. Diver and beacon move at constant velocities, the beacon at
    that of the last slot.
    """
    is_turn = _is_turn(p, x, x.turn)
    beacon = _pinging(u, is_turn)
    drift = _drift(p, x, beacon, is_turn, t)
    half = p.turnaround / 2
    shade = _shade(p, u, beacon)
    lengths, times, arrived, chances = [], [], [], {}
    for leg, sign in zip(_LEGS, (-1, 1), strict=True):
        velocity = sign * u.target_velocity * p.motion_during_travel
        direct, time, echo = _leg(
            p, u.target_position + velocity * half, velocity, beacon + sign * drift * half,
            [getattr(w, f"{leg}_{mirror}_echo") for mirror in ("surface", "bottom")],
        )
        heard, chances[f"{leg}_chance"] = _passed(
            x, is_turn, getattr(x, f"{leg}_chance"), getattr(w, f"{leg}_loss")
        )
        heard = heard * (getattr(w, f"{leg}_shadow") >= shade * _UNIFORMS)
        lengths.append(direct)
        times.append(ca.if_else(heard, time, echo))
        arrived.append(heard + (echo < _NEVER) > 0)
    new = [it * arrived[0] * arrived[1] for it in is_turn]
    late = (
        sum(ca.if_else(it, x.turnaround_error[i], 0) for i, it in enumerate(is_turn))
        + p.turnaround_std * w.turnaround
        + p.processing_delay - p.processing_delay_correction
    )
    measured = p.assumed_sound_speed * ((times[0] + times[1] + late) / 2)
    for it in FOUND.values():
        measured = measured + it.error(p, w)
    return {
        **_latched(x, u, t, new, {
            "range": ca.repmat(measured, p.beacons, 1),
            "true_range": (lengths[0] + lengths[1]) / 2,
            "reception_count": x.reception_count + 1,
            "arrival_epoch": t + half + times[1],
        }),
        **chances,
        **_next(p, x, u, t, new, x.asking),
        "asking": x.asking - 1,
    }


def _passed(x: Symbols, is_turn: list[Any], chance: Any, loss: Any) -> tuple[Any, Any]:
    """Whether a packet of the beacon whose turn it is passes, and the chances of the next ones."""
    heard = loss >= _UNIFORMS * sum(
        ca.if_else(it, chance[i], 0) for i, it in enumerate(is_turn)
    )
    after = ca.if_else(heard, x.loss_after[0], x.loss_after[1])
    return heard, ca.vertcat(*(
        ca.if_else(it, after, chance[i]) for i, it in enumerate(is_turn)
    ))


def _next(p: Symbols, x: Symbols, u: Symbols, t: Any, new: list[Any], left: Any) -> Values:
    """What follows for the beacon before this one; after the last of them, for the next slot."""
    return {
        "packet_beacon_position": ca.if_else(
            sum(new) > 0, u.reported_beacon_position, x.packet_beacon_position
        ),
        "last_position": ca.if_else(left > 1, x.last_position, u.beacon_position),
        "last_epoch": ca.if_else(left > 1, x.last_epoch, t),
        "turn": ca.if_else(x.turn > 0, x.turn - 1, p.beacons - 1),
    }


def _drift(p: Symbols, x: Symbols, beacon: Any, is_turn: list[Any], t: Any) -> Any:
    """Velocity of a beacon over the last slot [m/s]; 0 in the first one."""
    slot = t - x.last_epoch
    known = (x.last_epoch > x.start) * (slot > 0)
    moved = (beacon - _row(x.last_position, is_turn)) / ca.if_else(known, slot, 1)
    return ca.if_else(known, moved, 0) * p.motion_during_travel


def _arrival(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """Arrival of the diver's ping at one of the beacons, the last one first.

    The tick is when the ping passes the middle of the beacons. It left the diver before, and comes
    to each beacon a little earlier or later. Diver and beacon move at constant velocities, the
    beacon at that of the last slot.
    """
    is_turn = _is_turn(p, x, x.turn)
    beacon = _pinging(u, is_turn)
    drift = _drift(p, x, beacon, is_turn, t)
    w, drawn = _of_ping(p, x, w)
    middle = ca.sum1(u.beacon_position).T / p.beacons
    speed = mean_speed(p, (middle[2], u.target_position[2]))
    since = leg_length(p, u.target_position - middle, -u.target_velocity, speed) / speed
    diver = u.target_position - since * p.motion_during_travel * u.target_velocity
    direct, time, echo = _leg(
        p, beacon - since * drift, drift, diver,
        [getattr(w, f"arrival_{mirror}_echo") for mirror in ("surface", "bottom")],
    )
    heard, chance = _passed(x, is_turn, x.request_chance, w.arrival_loss)
    heard = heard * (w.arrival_shadow >= _shade(p, u, beacon) * _UNIFORMS)
    travel_time = ca.if_else(heard, time, echo)
    new = [it * (heard + (echo < _NEVER) > 0) for it in is_turn]
    unknown = p.assumed_sound_speed * (since + x.clock_offset + x.clock_drift * (t - x.start))
    measured = _rounded(
        _measured(p, x, w, t, travel_time)
        + ca.if_else(p.common_clock, x.common_error, -unknown),
        p.range_resolution,
    )
    late = travel_time - since
    carried = ca.repmat((drift * late).T, p.beacons, 1)
    return {
        **_latched(x, u, t, new, {
            "range": ca.repmat(measured, p.beacons, 1),
            "true_range": direct,
            "reception_count": x.reception_count + 1,
            "ping_beacon_position": u.reported_beacon_position + carried,
            "arrival_epoch": t + late,
        }),
        "request_chance": chance,
        **_next(p, x, u, t, new, x.listening),
        "listening": x.listening - 1,
        "ping_draws": drawn,
    }


def _of_ping(p: Symbols, x: Symbols, w: Symbols) -> tuple[Symbols, Any]:
    """The draws of an arrival, and those that it shares with the others of its ping if they do."""
    own = ca.vertcat(*(getattr(w, draw.name) for draw in _SHARED))
    later = p.arrivals_shared * (x.listening < p.beacons)
    drawn = ca.if_else(later, x.ping_draws, own)
    parts = ca.vertsplit(drawn, [0, *accumulate(draw.size for draw in _SHARED)])
    names = (draw.name for draw in _SHARED)
    return SimpleNamespace(**{**vars(w), **dict(zip(names, parts, strict=True))}), drawn


def _leg(p: Symbols, diver: Any, velocity: Any, beacon: Any, drawn: list[Any]
         ) -> tuple[Any, Any, Any]:
    """Length of the direct path [m], its travel time, and that of the earliest echo [s].

    Parameters
    ----------
    diver, beacon
        Positions when the sound is at the beacon, NED [m]; or, if the diver pings, those of the
        beacon and of the diver.
    velocity
        That of the first of them, in the direction of the sound's time, NED [m/s].
    drawn
        Uniform numbers for the echoes from surface and bottom.
    """
    z, depth, bottom = beacon[2], diver[2], p.water_depth
    speed = mean_speed(p, (z, depth))
    direct = leg_length(p, diver - beacon, velocity, speed)
    time = direct / speed
    chances = (p.surface_echo_probability, ca.if_else(bottom > 0, p.bottom_echo_probability, 0))
    spans = (((0, z), (0, depth)), ((z, bottom), (depth, bottom)))
    echoes = []
    for image, depths, w, chance in zip(images(p, beacon), spans, drawn, chances, strict=True):
        along = mean_speed(p, *depths)
        late = ca.fmax(leg_length(p, diver - image, velocity, along) / along, time)
        echoes.append(ca.if_else(w < chance * _UNIFORMS, late, _NEVER))
    return direct, time, ca.fmin(*echoes)


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
        Loop(_CHANNEL, lambda p, x, u, t: x.sounding, _sound),
        Loop(_ROUND_TRIP, lambda p, x, u, t: x.asking, _round_trip),
        Loop(_ARRIVAL, lambda p, x, u, t: x.listening, _arrival),
        Loop(_PACKET, lambda p, x, u, t: x.unwritten, _written),
    ),
    draws=(*_DRAWS, *_DRAWS_OF_OTHERS, *_DRAWS_OF_CHANNEL, *_DRAWS_OF_ROUND_TRIP,
           _DRAW_OF_EACH, *_DRAWS_OF_SHADOW, *_DRAWS_OF_ARRIVALS, _DRAW_OF_PING),
)
