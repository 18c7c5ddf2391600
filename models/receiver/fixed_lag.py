"""The filter `coupled` with delayed estimates: each uses everything received up to the lag later.

The filter itself is unchanged. Every quarter of the lag it keeps a copy of the current estimate of
diver and platform. Whatever corrects the state later also corrects the copies, in proportion to
their covariance with it: a fixed-lag smoother by delayed states (B. D. O. Anderson, J. B. Moore,
Optimal Filtering, 1979, section 7.3). A copy that is as old as the lag becomes an estimate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import casadi as ca

from ..equations import Equations, Loop, Symbols, Values
from ..ports import DEPTH, PING_POSE, RECEPTION
from . import bank, coupled, start, taking
from .estimate import pack, unpack
from .steps import Delayed, Step, packed, unpacked
from .surroundings import STATES
from .waves import Heave, heave_of

_KEPT = list(coupled.KEPT)
_SPACING = 4
"""Copies per lag."""
_COPIES = _SPACING + 1
"""One more than per lag: the oldest is output before it makes room for the newest."""
_SIZE = len(_KEPT)
_TRIANGLE = _SIZE * (_SIZE + 1) // 2
_BEFORE = 5
"""Numbers of a copy before its mean."""
_GIVEN = _BEFORE + _SIZE + _TRIANGLE
_NUMBERS = _GIVEN + _SIZE * STATES
_SAME = 1e-6
"""Times closer than this [s] count as equal."""


@dataclass(frozen=True, slots=True)
class _Copy:
    """Diver and platform at an earlier time, as known now.

    Attributes
    ----------
    there
        Whether the copy exists: 0 or 1.
    epoch
        Its time [s].
    heave
        The platform's depth, as known at that time.
    past
        Delayed states, those of `_KEPT`.
    """

    there: Any
    epoch: Any
    heave: Heave
    past: Delayed

    @property
    def numbers(self) -> Any:
        """All numbers as a row. An estimate needs only the first `_GIVEN` of them."""
        return ca.vertcat(
            self.there, self.epoch, *self.heave.numbers, self.past.mean,
            pack(self.past.covariance), ca.vec(self.past.cross),
        ).T


def _copy(row: Any) -> _Copy:
    return _Copy(row[0], row[1], heave_of([row[2], row[3], row[4]]), Delayed(
        row[_BEFORE : _BEFORE + _SIZE].T,
        unpack(row[_BEFORE + _SIZE : _GIVEN].T, _SIZE),
        ca.reshape(row[_GIVEN:], _SIZE, STATES),
    ))


def _initial(p: Symbols, w: Symbols, t: Any) -> Values:
    states = {**coupled.initial(p, w, t), "shown": ca.SX.zeros(0, 1)}
    ports = {
        v.name: (p.beacons, *v.shape[1:]) if v.rows else v.shape
        for v in (*RECEPTION, *DEPTH, *PING_POSE)
    }
    inputs = {name: ca.SX.zeros(*(*shape, 1, 1)[:2]) for name, shape in ports.items()}
    steps = _steps(p, SimpleNamespace(**states), SimpleNamespace(**inputs))
    given = ca.SX.zeros(1, _GIVEN)
    given[1] = t
    return {
        **states,
        "steps": ca.SX.zeros(packed(steps).shape[0]),
        "copies": ca.SX.zeros(_COPIES, _NUMBERS),
        "turns": 0,
        "due": 0,
        "given": given,
        "given_nis": 0,
        "given_degrees": 0,
    }


def _steps(p: Symbols, x: Symbols, u: Symbols) -> list[Step]:
    """The steps of the row that the copies follow."""
    return coupled.filtered(p, bank.row_of(x, bank.EXTRA), u, 1)[1]


def _pending(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Any:
    """Whether a row processes the sample: the last one, with the density that the others find."""
    return taking.pending(x) * ca.fmax(x.row == bank.EXTRA, bank.learned(p) * x.ready)


def _filter(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    changed, steps = coupled.filtered(p, x, u, x.row == bank.EXTRA)
    return {**changed, "steps": packed(steps)}  # those of the last row stay


def _settle(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """As `coupled`; then the copies are due. A restart discards them as wrong."""
    changed = coupled.settle(p, x, u, w, t)
    going = changed["passes"] == 0
    working = changed["ready"] * x.located * going
    newest = _copy(x.copies[-1, :])
    old = x.epoch - newest.epoch >= p.lag / _SPACING - _SAME
    due = working * ca.fmax(newest.there == 0, old)
    copies = ca.SX(x.copies)
    copies[:, 0] *= going
    return {
        **changed,
        "update_count": x.update_count,
        "copies": copies,
        "due": due,
        "turns": ca.if_else(working, _COPIES + due, 0),
    }


def _turn(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """Correct the oldest copy and move it to the end. The last pass stores a new copy if due."""
    old = _copy(x.copies[0, :])
    followed = replace(old, past=old.past.after(unpacked(_steps(p, x, u), x.steps)))
    now = bank.row_of(x, bank.EXTRA)
    P = unpack(now.covariance, STATES)
    new = _Copy(
        ca.SX(1), x.epoch, taking.heave_of(x),
        Delayed(now.mean[_KEPT], P[_KEPT, _KEPT], P[_KEPT, :]),
    )
    last = ca.if_else(x.due * (x.turns == 1), new.numbers, followed.numbers)
    return {"copies": ca.vertcat(x.copies[1:, :], last), "turns": x.turns - 1}


def _ripe(p: Symbols, x: Symbols, t: Any) -> Any:
    """Which copies are as old as the lag, (n, 1)."""
    return x.copies[:, 0] * (t - x.copies[:, 1] >= p.lag - _SAME)


def _give(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
    """Output the newest ripe copy: of several, only one would be seen."""
    ripe = _ripe(p, x, t)
    given = x.given
    for i in range(_COPIES):  # oldest first
        given = ca.if_else(ripe[i], x.copies[i, :_GIVEN], given)
    copies = ca.SX(x.copies)
    copies[:, 0] -= ripe
    return {
        "copies": copies,
        "given": given,
        "update_count": x.update_count + 1,
        "given_nis": x.nis,
        "given_degrees": x.nis_degrees,
        "nis": 0,
        "nis_degrees": 0,
    }


def _output(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Values:
    known = _copy(ca.horzcat(x.given, ca.SX.zeros(1, _SIZE * STATES)))
    mean, P = x.mean[bank.EXTRA, :].T, ca.SX.zeros(STATES, STATES)
    mean[_KEPT] = known.past.mean
    P[_KEPT, _KEPT] = known.past.covariance
    shown = SimpleNamespace(
        update_count=x.update_count, epoch=known.epoch, nis=x.given_nis,
        nis_degrees=x.given_degrees, restarts=x.restarts, believed=x.believed,
    )
    return coupled.outputs(p, shown, mean, P, known.heave)


EQUATIONS = Equations(
    initial=_initial,
    output=_output,
    iterate=(
        Loop(
            "process", taking.unprocessed, taking.reading(bank.EXTRA),
            inner=(
                Loop("filter", _pending, _filter, each=bank.STATES),
                Loop("settle", lambda p, x, u, t: taking.pending(x), _settle),
                Loop("turn", lambda p, x, u, t: x.turns, _turn),
            ),
        ),
        *start.anew(bank.EXTRA),
        *bank.loops(()),
        Loop("give", lambda p, x, u, t: ca.mmax(_ripe(p, x, t)), _give),
    ),
)
