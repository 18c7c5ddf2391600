"""Motion of a body in a sea with a spectrum: waves of drawn frequency, phase and direction."""

from __future__ import annotations

from math import pi
from typing import Any

import casadi as ca

from ..equations import Draw, Symbols, Values
from .spectrum import GRAVITY, LOWEST, peak_rate, response, share, width
from .variables import WAVES

DRAWS = (
    Draw("wave", "uniform", "initial", 2 * WAVES, ("motion",) * (2 * WAVES)),
    Draw("wave_direction", "normal", "initial", WAVES, ("motion",) * WAVES),
)
STATES = ("wave_rate", "wave_phase", "wave_up", "wave_north", "wave_east")


def still() -> Values:
    """The states without a spectrum."""
    return {name: ca.SX.zeros(WAVES) for name in STATES}


def initial(p: Symbols, w: Symbols) -> Values:
    """The waves of a run: one in each band, all bands being equally wide on a logarithmic scale."""
    count = ca.DM(range(WAVES))
    there = count < p.wave_components
    drawn = 2.0**-53 * ca.reshape(w.wave, WAVES, 2)
    peak = peak_rate(ca, p.wave_height, p.wave_period)
    band = width(ca, peak, p.raft_size) / p.wave_components
    x = LOWEST * ca.exp(ca.if_else(there, count + drawn[:, 0], 0) * band)
    rate = x * peak
    number = rate * rate / GRAVITY
    amplitude = p.wave_height / 4 * ca.sqrt(2 * band * share(ca, x, p.wave_peak_enhancement))
    moved = amplitude * response(ca, number, p.raft_size, p.raft_draught)
    direction = p.wave_direction + p.wave_spreading * w.wave_direction
    # Waves that are not there have no angle either: the sine of 0 takes the least work.
    return {
        "wave_rate": ca.if_else(there, rate, 0),
        "wave_phase": ca.if_else(there, 2 * pi * drawn[:, 1], 0),
        "wave_up": ca.if_else(there, moved, 0),
        "wave_north": ca.if_else(there, moved * ca.cos(direction), 0),
        "wave_east": ca.if_else(there, moved * ca.sin(direction), 0),
    }


def motion(x: Symbols, t: Any, yaw: Any) -> tuple[Any, Any]:
    """Roll and pitch [rad], and the displacement NED [m], of a body with a heading [rad]."""
    angle = x.wave_rate * t + x.wave_phase
    sine, cosine = ca.sin(angle), ca.cos(angle)
    north, east = x.wave_north * sine, x.wave_east * sine
    number = x.wave_rate * x.wave_rate / GRAVITY
    slope_north, slope_east = (ca.sum1(number * it) for it in (north, east))
    c, s = ca.cos(yaw), ca.sin(yaw)
    tilt = ca.vertcat(slope_north * s - slope_east * c, slope_north * c + slope_east * s)
    return tilt, ca.vertcat(ca.sum1(north), ca.sum1(east), -ca.sum1(x.wave_up * cosine))
