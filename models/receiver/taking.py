"""What the filter `coupled` and those made of it take from their inputs: one sample at a time.

A sample is a depth, a packet with its range, or both if they have the same epoch.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import casadi as ca

from ..equations import Symbols, Values
from . import pose, surroundings, waves
from .measurements import DEPTH, Samples, with_beacons
from .surroundings import HEADING, STATES, VERTICAL_ERROR
from .waves import Heave, Swing


@dataclass(frozen=True, slots=True)
class StateModel:
    """The states of a filter besides those of `surroundings`, and what a sample is.

    Attributes
    ----------
    states
        Number of all states.
    prior_stds, around
        As in `surroundings`, with the other states.
    together
        Whether all ranges of an epoch are one sample.
    """

    states: int
    prior_stds: Callable[[Any], Mapping[int, Any]]
    around: Callable[[Any, Any, Any], tuple[dict[tuple[int, int], Any], ...]]
    together: bool = False


ALONE = StateModel(STATES, surroundings.prior_stds, surroundings.around)
"""The states of `surroundings` alone; each range is a sample."""


SAMPLE = (
    "pending", "pause", "range", "placing", "sounding", "floating", "posing", "ranging", "using",
    "enough", "first", "last",
)
"""What the filters need to know of a sample besides the packet: `Sample`."""


def sample_of(x: Symbols) -> SimpleNamespace:
    """The sample at hand.

    Attributes
    ----------
    pending
        Whether the filters have not used it yet.
    pause
        Time since the sample before [s].
    range
        Its range [m].
    placing, sounding, floating, posing, ranging
        Whether it places the platform for the first time, has a depth to be used, a depth of the
        platform, a pose, a range.
    using
        Whether the filter has started and does not start again.
    enough, first
        Whether the latest receptions suffice for a fix, and whether this is the first.
    last
        Whether it is the last of the new ones.
    """
    return SimpleNamespace(**{name: x.sample[i] for i, name in enumerate(SAMPLE)})


def unprocessed(p: Symbols, x: Symbols, u: Symbols, t: Any) -> Any:
    """Whether there is a sample that has not been used."""
    return with_beacons(x, u, u.ping_beacon_position).any_new


def reading(
    row: int, model: StateModel = ALONE
) -> Callable[[Symbols, Symbols, Symbols, Symbols, Any], Values]:
    """The body that takes the oldest sample; a depth and a packet of one epoch together.

    The first fix waits for the platform and for the last of the new samples.

    Parameters
    ----------
    row
        The filter whose heading and expected changes are those of heave and swing. They are common
        to all filters: what reports say of them does not depend on the diver's motion.
    """
    def read(p: Symbols, x: Symbols, u: Symbols, w: Symbols, t: Any) -> Values:
        return _read(p, x, u, x.mean[row, :].T, model)

    return read


def _read(p: Symbols, x: Symbols, u: Symbols, mean: Any, model: StateModel) -> Values:
    s = with_beacons(x, u, u.ping_beacon_position)
    oldest, depth, packet, chosen, z = _oldest(s)
    taken = arriving(s) if model.together else chosen
    newest = oldest >= ca.mmax(s.epoch[:DEPTH])
    epoch = ca.fmax(oldest, x.epoch)
    using = x.ready * (x.passes == 0)
    pause = epoch - x.epoch
    phi, noise = model.around(ca, p, pause)
    drift = surroundings.drift(p, phi, noise)
    said, own = pose.read(p, u, s, chosen, newest, pose.later(x, drift))
    placing = packet * said.complete * (x.located == 0)
    located = ca.fmax(x.located, placing)
    # Several packets of one epoch hold the same pose, errors included.
    fresh = packet * (1 - (oldest == x.pose_epoch) * (said.is_own == 0))
    posing = fresh * located
    before = _waves_later(p, x, mean, pause, phi, drift)
    angle = waves.causes(split(mean))[2] + _changes(phi, mean)[1][2]
    angle = ca.if_else(placing, said.first_heading, angle)
    heave, swing = _waves_reported(p, before, said, angle, fresh, posing)
    if model.together:
        arms = ca.vertcat(*(_turned_arm(said, p.beacon_offset[i, :]).T for i in range(s.count)))
    else:
        arms = ca.repmat(_turned_arm(said, said.arm).T, s.count, 1)
    last = ca.sum1(s.new) <= ca.sum1(taken) + depth if model.together else (
        ca.sum1(s.new) <= packet + depth
    )
    sample = {
        "pending": 1, "pause": pause, "range": z, "placing": placing, "sounding": depth * using,
        "floating": fresh, "posing": posing, "ranging": packet * located * using,
        "using": using, "enough": s.enough * located,
        "first": (x.ready == 0) * s.enough * located * last, "last": last,
    }
    return {
        "seen": ca.if_else(ca.vertcat(taken, depth), s.mark, x.seen),
        "epoch": epoch,
        "located": located,
        "pose_epoch": ca.if_else(packet, oldest, x.pose_epoch),
        "platform_down": ca.if_else(packet, said.pose.down, x.platform_down),
        "heave": ca.vertcat(*heave.numbers),
        "swing": ca.vertcat(*swing.numbers),
        "before": ca.vertcat(*before[0].numbers, *before[1].numbers),
        "arm": ca.if_else(ca.repmat(taken, 1, 3), arms, x.arm),
        **own.states,
        "sample": ca.vertcat(*(sample[name] for name in SAMPLE)),
        "packet": said.numbers,
        "around": ca.vertcat(*phi.values(), *noise.values()),
        "share": 0,
        "short": 0,
        "fast": 0,
    }


def pending(x: Symbols) -> Any:
    """Whether the sample at hand has still to be processed."""
    return sample_of(x).pending


def _oldest(s: Samples) -> tuple[Any, Any, Any, Any, Any]:
    """The oldest epoch, whether it has a depth and a packet, the packet's beacon and its range."""
    pending = [ca.if_else(s.new[i], s.epoch[i], s.newest + 1) for i in range(s.count + 1)]
    oldest = ca.mmin(ca.vertcat(*pending))
    which, packet, z = [], ca.SX(0), ca.SX(0)
    for i in range(s.count):  # the first of equal epochs
        this = (pending[i] <= oldest) * (packet == 0)
        which.append(this)
        packet += this
        z = ca.if_else(this, s.z[i], z)
    return oldest, pending[DEPTH] <= oldest, packet, ca.vertcat(*which), z


def arriving(s: Samples) -> Any:
    """Which ranges are new and of the oldest epoch, (N, 1)."""
    return s.new[:DEPTH] * (s.epoch[:DEPTH] <= _oldest(s)[0])


def _turned_arm(said: pose.Packet, nominal: Any) -> Any:
    """A beacon's arm with its packet's tilt, at a heading of 0, (3, 1)."""
    at_zero = [ca.SX(0)] * STATES
    arm = [nominal[i] for i in range(3)]
    return ca.vertcat(*surroundings.arm_of(ca, at_zero, said.pose, arm))


def split(column: Any) -> list[Any]:
    """The elements of a column."""
    return [column[i] for i in range(column.numel())]


def heave_of(x: Symbols) -> Heave:
    """The platform's depth, from the states."""
    return waves.heave_of(split(x.heave))


def _changes(phi: Mapping[tuple[int, int], Any], mean: Any) -> tuple[Any, tuple[Any, Any, Any]]:
    """Expected changes of g_z, and of p + g, north and east, and ψ + e_ψ, in a transition."""
    change: list[Any] = [ca.SX(0)] * mean.numel()
    for (i, j), value in phi.items():
        change[i] += (value - (i == j)) * mean[j]
    return change[VERTICAL_ERROR], waves.causes(change)


def _waves_later(
    p: Symbols, x: Symbols, mean: Any, dt: Any, phi: Mapping[tuple[int, int], Any],
    drift: tuple[Any, Any, Any],
) -> tuple[Heave, Swing]:
    """Heave and swing after dt."""
    sunk, moved = _changes(phi, mean)
    return (
        waves.heave_later(ca, p, heave_of(x), dt, sunk, drift[2]),
        waves.swing_later(ca, p, waves.swing_of(split(x.swing)), dt, moved, drift[:2]),
    )


def _waves_reported(
    p: Symbols, before: tuple[Heave, Swing], said: pose.Packet, angle: Any, floating: Any,
    posing: Any,
) -> tuple[Heave, Swing]:
    """Heave and swing after a packet, if ψ + e_ψ is about `angle`."""
    heave, swing = before
    down = waves.down_after(ca, p, heave, said.pose.own, split(said.arm))
    at: list[Any] = [ca.SX(0)] * STATES
    at[HEADING] = angle
    rows = surroundings.places(ca, p, at, split(said.body), said.heading_variance)
    place, lever = split(said.place), said.body[2]
    return (
        waves.heaved(heave, down, said.pose.down, floating),
        waves.swung(at, rows, place, lever, swing, posing),
    )
