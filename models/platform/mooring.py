"""Drift of a moored platform in its watch circle: place and velocity of each horizontal axis.

An Ornstein-Uhlenbeck process of velocity, pulled back to the mooring with critical damping. It is
exact at ticks, which draw the next tick's place and velocity ahead; a cubic joins them.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from ..equations import Draw, Symbols, Values
from ..track import motion
from .spectrum import WITHIN

_SCALE = ("watch_circle",) * 4
DRAWS = (
    Draw("first_drift", "normal", "initial", 8, _SCALE * 2),
    Draw("drift", "normal", "tick", 4, _SCALE),
)
_STATES = ("drift", "drift_rate", "next_drift", "next_drift_rate")


def still() -> Values:
    """The states without a mooring."""
    return {**{name: ca.SX.zeros(2) for name in _STATES}, "drift_time": 0}


def initial(p: Symbols, w: Symbols, t: Any) -> Values:
    """A place and a velocity as they may be at any time, and the next ones."""
    std = p.watch_circle / WITHIN
    place, rate = std * w.first_drift[:2], std / p.mooring_time * w.first_drift[2:4]
    return {"drift": place, "drift_rate": rate, **_following(p, place, rate, w.first_drift[4:]),
            "drift_time": t}


def tick(p: Symbols, x: Symbols, w: Symbols, t: Any) -> Values:
    """Places and velocities from this tick to the next."""
    return {"drift": x.next_drift, "drift_rate": x.next_drift_rate,
            **_following(p, x.next_drift, x.next_drift_rate, w.drift), "drift_time": t}


def place(p: Symbols, x: Symbols, t: Any) -> Any:
    """Displacement, north and east [m]."""
    passed = ca.fmin(ca.fmax((t - x.drift_time) / p.sampling_time, 0), 1)
    step = x.next_drift - x.drift
    rates = x.drift_rate, x.next_drift_rate
    return motion(passed, p.sampling_time, x.drift, step, *rates)[0]


def _following(p: Symbols, place: Any, rate: Any, n: Any) -> Values:
    """Place and velocity one tick later, drawn exactly."""
    std, r = p.watch_circle / WITHIN, p.sampling_time / p.mooring_time
    a, y = ca.exp(-r), 2 * r
    # 1 - a²(1 + y + y²/2), which is y³/6 for short ticks: its series does not cancel.
    series = y * y * y / 6 * (1 + y / 4 * (1 + y / 5 * (1 + y / 6 * (1 + y / 7))))
    first = ca.if_else(y < 0.1, a * a * series, 1 - a * a * (1 + y + y * y / 2))
    both = 2 * a * a * r * r
    second = 1 - a * a * (1 - y + y * y / 2)
    root = ca.sqrt(first)
    shared = both / root
    own = ca.sqrt(ca.fmax(second - shared * shared, 0))
    return {
        "next_drift": a * ((1 + r) * place + p.sampling_time * rate) + std * root * n[:2],
        "next_drift_rate": a * ((1 - r) * rate - r / p.mooring_time * place)
        + std / p.mooring_time * (shared * n[:2] + own * n[2:]),
    }
