"""Equations of the Platform: pose in waves, beacons, and both as GPS and IMU report them.

The waves are the paper's sines, or a sea with a spectrum (``seaway.py``) and a mooring
(``mooring.py``). Everything else is common to both.

White noise and Gauss-Markov errors are held between ticks. Drift, temperature and shock are
continuous functions of time.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import pi
from types import SimpleNamespace
from typing import Any

import casadi as ca

from .. import track
from ..arrangement import cross
from ..declaration import number_of
from ..equations import Draw, Equations, Loop, Row, Symbols, Values
from ..geometry import rotation
from ..ports import BEACONS
from ..target.course import TOLERANCE
from . import mooring, seaway
from .variables import ANGLES, ARRANGEMENT, DISPLACEMENTS, MOTION

AXES = (*ANGLES, *DISPLACEMENTS)
_CROSS = number_of(ARRANGEMENT, "cross")


def _scales(sensor: str, axes: tuple[str, str, str], *parts: str) -> tuple[str, ...]:
    """Parameters that scale the numbers drawn for a sensor, one per number."""
    return tuple(f"{sensor}_{axis}_{part}" for part in parts for axis in axes)


_GPS = ("gps", ("horizontal", "horizontal", "vertical"))
_IMU = ("imu", ("tilt", "tilt", "heading"))
DRAWS = (
    Draw("phase", "uniform", "initial", len(AXES)),
    Draw("first_gps", "normal", "initial", 9),
    Draw("first_imu", "normal", "initial", 9),
    Draw("gps", "normal", "tick", 6, _scales(*_GPS, "std", "markov_std")),
    Draw("imu", "normal", "tick", 6, _scales(*_IMU, "std", "markov_std")),
    Draw("mounting", "normal", "initial", 3, ("mounting_std",) * 3, each=BEACONS),
    Draw("first_own_gps", "normal", "initial", 9, each=BEACONS),
    Draw("own_gps", "normal", "buoys", 6, _scales(*_GPS, "std", "markov_std"), each=BEACONS),
    *seaway.DRAWS,
    *mooring.DRAWS,
    Draw("misalignment", "normal", "initial", 3, tuple(
        f"misalignment_{angle}_std" for angle in ("tilt", "tilt", "heading")
    )),
)


Motion = Callable[[Symbols, Symbols, Any], tuple[Any, Any]]
"""``motion(p, x, t)``: inclination [rad] and displacement NED [m]."""


def _initial(p: Symbols, w: Symbols, t: Any) -> Values:
    fixed_phase = ca.vertcat(*(getattr(p, f"{axis}_phase") for axis in AXES))
    return {
        "start": t,
        "phase": ca.if_else(p.random_phases, 2 * pi * 2.0**-53 * w.phase, fixed_phase),
        "gps_white": _gps(p, "std") * w.first_gps[:3],
        "gps_bias": _gps(p, "bias_std") * w.first_gps[3:6],
        "gps_markov": _gps(p, "markov_std") * w.first_gps[6:],
        "gps_decay": ca.exp(-p.sampling_time / p.gps_correlation_time),
        "imu_white": _imu(p, "std") * w.first_imu[:3],
        "imu_turn_on": _imu(p, "turn_on_std") * w.first_imu[3:6],
        "imu_markov": _imu(p, "markov_std") * w.first_imu[6:],
        "imu_decay": ca.exp(-p.sampling_time / p.imu_correlation_time),
        "own_white": _own(p, "std") * _each(p, w.first_own_gps, 0, 3),
        "own_bias": _own(p, "bias_std") * _each(p, w.first_own_gps, 1, 3),
        "own_markov": _own(p, "markov_std") * _each(p, w.first_own_gps, 2, 3),
        "waiting": 0,
        "mounting": p.gps_shared * (
            p.mounting_error + p.mounting_std * ca.reshape(w.mounting, 3, p.beacons).T
        ) + p.gps_shared * _turned(p, w.misalignment),
        **seaway.still(),
        **mooring.still(),
        **_departing(p, w),
    }


def _turned(p: Symbols, numbers: Any) -> Any:
    """How far a misaligned frame moves each beacon, body frame, one per row [m]."""
    tilt, heading = p.misalignment_tilt_std, p.misalignment_heading_std
    R = rotation(ca.vertcat(tilt, tilt, heading) * numbers)
    return _beacons(p) @ (R - ca.SX.eye(3)).T


def _tick(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any, k: Any) -> Values:
    return {
        "gps_white": _gps(p, "std") * w.gps[:3],
        "gps_markov": _markov(x.gps_markov, x.gps_decay, _gps(p, "markov_std"), w.gps[3:]),
        "imu_white": _imu(p, "std") * w.imu[:3],
        "imu_markov": _markov(x.imu_markov, x.imu_decay, _imu(p, "markov_std"), w.imu[3:]),
        "waiting": p.gps_shared == 0,
    }


def _buoys(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """Errors of the buoys' own GPS receivers."""
    return {
        "own_white": _own(p, "std") * _each(p, w.own_gps, 0, 2),
        "own_markov": _markov(
            x.own_markov, x.gps_decay, _own(p, "markov_std"), _each(p, w.own_gps, 1, 2)
        ),
        "waiting": 0,
    }


def _sines(p: Symbols, x: Symbols, t: Any) -> tuple[Any, Any]:
    """Inclination [rad] and displacement [m] in the paper's waves, one of each axis."""
    waves = [_wave(p, axis, t, x.phase[i]) for i, axis in enumerate(AXES)]
    return ca.vertcat(*waves[:3]), ca.vertcat(*waves[3:])


def _spectrum(p: Symbols, x: Symbols, t: Any) -> tuple[Any, Any]:
    """The same in a sea with a spectrum; only the swing about the mooring is a sine."""
    swing = _wave(p, "yaw", t, x.phase[AXES.index("yaw")])
    _, heading = _way(p, x, t)
    tilt, displacement = seaway.motion(x, t, heading + swing)
    drift = ca.vertcat(mooring.place(p, x, t), 0)
    return ca.vertcat(tilt, swing), displacement + drift


def _output(motion: Motion, p: Symbols, x: Symbols, u: Symbols, t: Any) -> Values:
    inclination, displacement = motion(p, x, t)
    way, heading = _way(p, x, t)
    mean_attitude = ca.vertcat(0, 0, heading)
    attitude = mean_attitude + inclination
    position = p.mean_position + displacement + way
    reported_attitude = mean_attitude + _measured(p, inclination) + _imu_error(p, x, t)

    R = rotation(attitude)
    gps_error = x.gps_white + x.gps_bias + x.gps_markov
    reported_position = position + R @ p.gps_antenna_offset + gps_error
    b = _beacons(p)
    true = _placed(position, R, b + x.mounting)
    return {
        "position": position,
        "attitude": attitude,
        "beacon_position": true,
        "reported_beacon_position": ca.if_else(
            p.gps_shared, _placed(reported_position, rotation(reported_attitude), b),
            true + x.own_white + x.own_bias + x.own_markov,
        ),
        "reported_position": ca.if_else(p.gps_shared, reported_position, 0),
        "reported_attitude": ca.if_else(p.gps_shared, reported_attitude, 0),
    }


def _way(p: Symbols, x: Symbols, t: Any) -> tuple[Any, Any]:
    """What a boat under way has covered [m], and its heading [rad]."""
    straight = _straight(p, t - x.start)
    if not _may_follow(p):
        return straight, p.mean_heading
    found, _ = track.along(x, _since(p, x, t))
    follows = p.track_count > 0
    way = ca.if_else(follows, ca.vertcat(found[:2], 0), straight)
    return way, p.mean_heading + ca.if_else(follows, found[2], 0)


def _straight(p: Symbols, since: Any) -> Any:
    """The way at constant speed [m]. The condition skips the sines of a boat at rest."""
    north, east = ca.cos(p.boat_course), ca.sin(p.boat_course)
    return ca.vertcat(*(
        ca.if_else(p.boat_speed != 0, p.boat_speed * since * it, 0) for it in (north, east)
    ), 0)


# --- A boat's track: north, east and heading, between points -------------------------------------


def _may_follow(p: Symbols) -> bool:
    """Whether the platform is built for a track: others have neither its states nor its code."""
    return bool(p.boat_points > 1)


def _since(p: Symbols, x: Symbols, t: Any) -> Any:
    """Time since the boat's departure [s]; negative before it."""
    return t - x.start - p.departure_time


def _departing(p: Symbols, w: Symbols) -> Values:
    if not _may_follow(p):
        return {}
    return track.states(ca.vertcat(w.first, w.first_heading), w.first_time)


def _due(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Any:
    return track.due(p, x, _since(p, x, t) + TOLERANCE) if _may_follow(p) else 0


def _leg(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    given = vars(w)
    points = {
        f"{it}point": ca.vertcat(given[f"{it}place"], given[f"{it}heading"])
        for it in ("", "next_", "after_")
    }
    return track.leg(p, x, SimpleNamespace(**{**given, **points}))


def _wave(p: Symbols, axis: str, t: Any, phase: Any) -> Any:
    """Wave equation (the paper's section 4). The condition skips the sine if there is no motion."""
    amplitude = getattr(p, f"{axis}_amplitude")
    angle = 2 * pi * getattr(p, f"{axis}_frequency") * t + phase
    return ca.if_else(amplitude != 0, amplitude * ca.sin(angle), 0)


def _beacons(p: Symbols) -> Any:
    """Nominal beacon positions in the body frame, one per row."""
    arms = ca.vertcat(
        *(ca.horzcat(*b) for b in cross(p.beacons, p.arm_length, p.beacon_depth))
    )
    given = ca.if_else(p.arrangement == _CROSS, arms, p.beacon)
    return ca.horzcat(p.beacon_scale * given[:, :2], given[:, 2])


def _placed(position: Any, R: Any, points: Any) -> Any:
    """Transform body-frame points (rows) to NED."""
    return ca.repmat(position.T, points.shape[0], 1) + points @ R.T


def _markov(value: Any, decay: Any, std: Any, noise: Any) -> Any:
    """Exact step of a stationary first-order Gauss-Markov process with decay = exp(-T/τ)."""
    return decay * value + std * ca.sqrt(ca.fmax(1 - decay**2, 0)) * noise


def _measured(p: Symbols, inclination: Any) -> Any:
    """Scale factor and misalignment ε to first order: (1 + k) θ − ε × θ (the paper's Figure 4)."""
    scaled = (1 + _imu(p, "scale_factor_error")) * inclination
    return scaled - ca.cross(p.imu_misalignment, inclination)


def _imu_error(p: Symbols, x: Symbols, t: Any) -> Any:
    """Additive errors of roll, pitch, yaw [rad]: the four terms of section 2.2, shock and noise."""
    since = t - x.start
    temperature = p.imu_temperature_offset + p.imu_temperature_rate * since
    fixed = _imu(p, "bias")
    in_run = x.imu_markov + _imu(p, "drift") * since
    shock = ca.if_else(since >= p.imu_step_time, _imu(p, "step"), 0)
    return (
        fixed
        + _imu(p, "temperature_coefficient") * temperature
        + x.imu_turn_on
        + in_run
        + shock
        + x.imu_white
    )


def _gps(p: Symbols, part: str) -> Any:
    horizontal = getattr(p, f"gps_horizontal_{part}")
    return ca.vertcat(horizontal, horizontal, getattr(p, f"gps_vertical_{part}"))


def _own(p: Symbols, part: str) -> Any:
    """One part of the GPS error of each buoy, one buoy per row."""
    return ca.repmat(_gps(p, part).T, p.beacons, 1)


def _each(p: Symbols, numbers: Any, part: int, parts: int) -> Any:
    """Three of the numbers drawn for each beacon, one beacon per row."""
    rows = ca.reshape(numbers, 3 * parts, p.beacons).T
    return rows[:, 3 * part : 3 * part + 3]


def _imu(p: Symbols, part: str) -> Any:
    tilt = getattr(p, f"imu_tilt_{part}")
    return ca.vertcat(tilt, tilt, getattr(p, f"imu_heading_{part}"))


def _spectrum_initial(p: Symbols, w: Symbols, t: Any) -> Values:
    return {**_initial(p, w, t), **seaway.initial(p, w), **mooring.initial(p, w, t)}


def _spectrum_tick(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any, k: Any) -> Values:
    return {**_tick(p, x, u, w, t, k), **mooring.tick(p, x, w, t)}


_BUOYS = (Loop("buoys", lambda p, x, u, t: x.waiting, _buoys),)
_LEGS = (Loop("leg", _due, _leg, rows=track.rows(
    "track_time", place="track", heading="track_heading",
)),)
_FIRST = tuple(
    Row(name, array, lambda p, x: 0)
    for name, array in (
        ("first", "track"), ("first_heading", "track_heading"), ("first_time", "track_time"),
    )
)


def _of(motion: Motion, initial: Any, tick: Any) -> Equations:
    return Equations(
        partial(_output, motion), initial, tick, advance=_LEGS, iterate=_BUOYS, draws=DRAWS,
        rows=_FIRST,
    )


EQUATIONS = {
    number_of(MOTION, "sines"): _of(_sines, _initial, _tick),
    number_of(MOTION, "spectrum"): _of(_spectrum, _spectrum_initial, _spectrum_tick),
}
