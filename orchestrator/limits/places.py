"""The recursion for many divers at once: what is possible at many places of a scenario.

Nothing is random here. A packet lost with probability p counts with 1 − p of its information, and
the platform rests at its mean position and heading. Waves count as receivers assume them. Losses in
bursts, in the shadow of a diver and of arrivals of a ping are the exception: several sequences of
them are averaged over.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from math import ceil, cos, sin

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus import stopping
from sblcosim.models.acoustics.ranging import INVERTED, legs
from sblcosim.models.acoustics.schedules import schedule_of

from ..scenario.scenario import Scenario
from . import recursion
from .echoes import echo_chances, lost_in, lost_of_leg, shades, shares
from .parameters import beacons_of, conditions, model_of, own_beacon, parameters
from .recursion import Epochs, ReceiverModel

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Path = Callable[[float], Floats]
"""Positions at a time since the start [s], NED [m]; (n, 3)."""

MOST_STEPS = 300
"""Number of slots up to which each is a step of the recursion; of more, several are combined."""
_GROWTH, _LONGEST_S = 0.1, 10.0
"""Duration of slots that are combined: in parts of the time to the next epoch that is kept, and at
most [s]."""
SEQUENCES = 8
"""Number of sequences of losses that are averaged over."""
MOST_EPOCHS = 8
"""Number of epochs whose covariances are kept."""
_TOGETHER = 128
"""Number of places in one part, whose positions fit into a processor's cache."""


@dataclass(frozen=True, eq=False)
class Covariances:
    """Covariances of divers' positions at some epochs, NED [m²]; (epochs, n, 3, 3).

    Attributes
    ----------
    absolute, relative
        In the world frame, and relative to the platform.
    offset
        True x − p at these epochs [m]; (epochs, n, 3).
    own_errors
        Each beacon has its own error: there is no platform, and relative is absolute.
    """

    absolute: Floats
    relative: Floats
    offset: Floats
    own_errors: bool


def still_beacons(scenario: Scenario) -> Floats:
    """Positions of the beacons in still water, NED [m]; (N, 3)."""
    heading = np.deg2rad(scenario.platform.mean_heading_deg)
    c, s = cos(heading), sin(heading)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    rows: Floats = beacons_of(parameters(scenario)) @ turn.T + _place(scenario)
    return rows


def _place(scenario: Scenario) -> Floats:
    """Mean position of the platform, NED [m]; (3,)."""
    return np.asarray(scenario.platform.mean_position_m, np.float64)


def noise_densities(scenario: Scenario, position: Floats) -> Floats:
    """R T_eff of the fix across the line to the platform [m² s], for `circle_psd`; (n,)."""
    c = conditions(scenario, 0.0)
    offset = position - still_beacons(scenario).mean(0)
    densities: Floats = c.range_std**2 * (offset**2).sum(1) / max(c.spread, 1e-12) * c.round
    return densities


def covariances(
    scenario: Scenario,
    path: Path,
    acceleration_psd: Floats,
    span_s: tuple[float, float],
    workers: int | None = None,
) -> Covariances:
    """What is possible for divers on given paths, each on its own with the platform.

    Parameters
    ----------
    acceleration_psd
        q of each path [m²/s³], see `circle_psd`; (n,).
    span_s
        Time at which covariances begin to count, and end time, from the start [s].
    workers
        Number of threads; the result does not depend on it. None: all cores.
    """
    model = model_of(scenario, 0.0, own_beacon(scenario))
    slot_s = scenario.acoustics.sampling_time_s
    every = [epochs_of(scenario, model, span_s[1], sequence) for sequence in _sequences(scenario)]
    total = len(every[0].step_s)
    late = np.flatnonzero(np.arange(1, total + 1) * slot_s >= span_s[0])
    late = late if len(late) else np.array([total - 1])
    picked = np.round(np.linspace(0, len(late) - 1, min(len(late), MOST_EPOCHS))).astype(int)
    groups = groups_of(total, late[picked], slot_s)
    sequences = [combined(epochs, groups) for epochs in every]
    kept, times = np.searchsorted(groups, late[picked]), _middles(groups) * slot_s

    positions = np.stack([path(time) for time in times.tolist()])
    shaded = bool(scenario.acoustics.shadow_loss_probability)
    velocities = _velocities(path, times) if shaded else positions
    together = 1 if shaded else _TOGETHER  # the shadow of each diver is another one

    def part(first: int) -> tuple[Floats, Floats, Floats]:
        some = slice(first, first + together)
        position = positions[:, some]
        told = 1.0 if shaded else _told(scenario, position[kept].mean(0))
        heard = (
            _shaded(scenario, position[:, 0], velocities[:, first], sequences) if shaded
            else sequences
        )
        found = [
            recursion.covariances(
                model, replace(it, told=told), position, acceleration_psd[some], kept
            )
            for it in heard
        ]
        absolute, relative = (np.concatenate(it) for it in zip(*found, strict=True))
        offset = position[kept] - _place(scenario)
        return absolute, relative, np.concatenate([offset] * len(sequences))

    with ThreadPoolExecutor(workers or os.cpu_count() or 1) as pool:
        firsts = range(0, len(acceleration_psd), together)
        parts = [*stopping.results([pool.submit(part, first) for first in firsts])]
    absolute, relative, offset = (np.concatenate(it, axis=1) for it in zip(*parts, strict=True))
    return Covariances(absolute, relative, offset, model.own_errors)


def _told(scenario: Scenario, position: Floats) -> Floats | float:
    """Information in ranges of each beacon despite echoes, at n places; (n, N)."""
    if not any(echo_chances(scenario.acoustics)):
        return 1.0
    found: Floats = shares(scenario.acoustics, position[:, None], still_beacons(scenario))
    return found


def _velocities(path: Path, end_s: Floats) -> Floats:
    """Velocities at these times [m/s]; (times, n, 3)."""
    step = 1e-3
    return np.stack([(path(t + step) - path(t - step)) / (2 * step) for t in end_s.tolist()])


def _shaded(
    scenario: Scenario, position: Floats, velocity: Floats, sequences: Sequence[Epochs]
) -> Iterator[Epochs]:
    """Sequences of epochs, of which the shadow of one diver's body takes drawn packets.

    Parameters
    ----------
    position, velocity
        Of the diver, NED [m] and [m/s]; (n, 3).
    """
    a, beacons = scenario.acoustics, still_beacons(scenario)
    shade = shades(a, position[:, None], beacons, velocity[:, None])
    best = 1 - float(lost_in(a, np.zeros(())))
    arrives = (1 - lost_in(a, shade)) / (best if best > 0 else 1.0)
    tells = shares(a, position[:, None], beacons, shade)
    one_by_one = schedule_of(a).together(len(beacons)) == 1
    for number, epochs in enumerate(sequences):
        pings = np.fmax(np.ceil(epochs.heard), 1).astype(int)
        some = slice(0, 1) if _shared(scenario) else slice(None)  # all share the first one's
        rng = np.random.default_rng([number, 2])
        drawn = rng.binomial(pings[:, some], arrives[:, some]) / pings[:, some]
        left = epochs.heard * drawn
        before = epochs.heard.sum(1) if one_by_one else epochs.heard.max(1)
        share = (left.sum(1) if one_by_one else left.max(1)) / np.where(before > 0, before, 1.0)
        yield replace(epochs, heard=left * tells, packets=epochs.packets * share)


def _sequences(scenario: Scenario) -> list[int | None]:
    """Numbers of the sequences of losses; None: each packet counts with its mean information."""
    a = scenario.acoustics
    # A ping that only some beacons hear tells less of the direction than its share of arrivals.
    drawn = 0 < a.loss_probability < 1 and (a.loss_burst_length or a.ranging in INVERTED)
    mean = [None] * (SEQUENCES if a.shadow_loss_probability else 1)
    return [*range(SEQUENCES)] if drawn else [*mean]


def _shared(scenario: Scenario) -> bool:
    """Whether all beacons lose a ping together."""
    return bool(scenario.acoustics.arrivals_shared and scenario.acoustics.ranging in INVERTED)


def losses_in_bursts(
    scenario: Scenario, pings: Integers, sequence: int, leg: int = 0
) -> Floats:
    """1 where a packet of a beacon is lost directly; (pings of each, N).

    Each leg of two-way ranges has sequences of its own. Independent losses are bursts, too, with a
    mean length of 1/(1 − p).
    """
    a = scenario.acoustics
    rng = np.random.default_rng([sequence, leg] if leg else sequence)
    p = a.loss_probability
    length = a.loss_burst_length or 1 / (1 - p)
    most = int(pings.max())
    columns = []
    for _ in pings:
        bad = rng.geometric(1 / length, most)
        good = rng.geometric(min(p / (length * (1 - p)), 1.0), most)
        runs = np.stack([bad, good], axis=1).ravel()
        kinds = np.tile([1.0, 0.0], most)
        if rng.random() >= p:  # the first run is one of packets that arrive
            runs, kinds = runs[1:], kinds[1:]
        enough = np.searchsorted(np.cumsum(np.fmin(runs, most)), most) + 1
        columns.append(np.repeat(kinds[:enough], np.fmin(runs[:enough], most))[:most])
    return np.stack(columns, axis=1)


def epochs_of(
    scenario: Scenario, model: ReceiverModel, duration_s: float, sequence: int | None = None
) -> Epochs:
    """The slots of a run.

    Parameters
    ----------
    sequence
        Number of a sequence of losses; None: each packet counts with the mean of its information.
    """
    a, count = scenario.acoustics, scenario.beacons
    total = max(ceil(duration_s / a.sampling_time_s - 1e-9) - 1, 1)  # the end is not sampled
    missing = float(lost_in(a, np.zeros(())))
    schedule = schedule_of(a)
    at_once = schedule.together(count)
    first = schedule.place(np.arange(total))
    order = np.array(a.slot_order) - 1
    pinging = order[(first[:, None] + np.arange(at_once)) % count]
    sent = np.eye(count)[pinging].sum(1)
    heard = (1 - missing) * sent
    packets = np.full(total, 1 - (missing if _shared(scenario) else missing**at_once))
    if sequence is not None:
        numbers = np.cumsum(sent, axis=0).astype(int) - 1
        by_echo = 1 - lost_of_leg(a) / a.loss_probability  # of the packets that are lost directly
        heard = sent
        for leg in range(legs(a.ranging)):
            losses = losses_in_bursts(scenario, numbers[-1] + 1, sequence, leg)
            if _shared(scenario):
                losses[:] = losses[:, :1]
            is_lost = np.take_along_axis(losses, np.fmax(numbers, 0), 0) > 0
            heard = heard * np.where(is_lost, by_echo, 1.0)
        packets = heard.max(axis=1)
    own = model.own_errors
    return Epochs(
        step_s=np.full(total, a.sampling_time_s),
        readings=np.ones(total),
        heard=heard,
        packets=packets,
        platform=_place(scenario),
        attitude=np.array([0.0, 0.0, np.deg2rad(scenario.platform.mean_heading_deg)]),
        beacons=still_beacons(scenario) if own else beacons_of(model.parameters),
    )


def groups_of(total: int, kept: Integers, slot_s: float) -> Integers:
    """The first slot of each group of slots that count together, and the end of the last group.

    A slot that is kept is alone. The longer the time to it, the more slots are combined: what they
    tell of it has had that time to fade, so that their own times hardly matter.
    """
    if total <= MOST_STEPS:
        return np.arange(total + 1)
    most, begin, firsts = max(int(_LONGEST_S / slot_s), 1), 0, []
    for alone in kept.tolist():
        some = [alone]
        while some[-1] > begin:
            size = min(max(int(_GROWTH * (alone - some[-1] + 1)), 1), most)
            some.append(max(some[-1] - size, begin))
        firsts += some[::-1]
        begin = alone + 1
    return np.array([*firsts, begin])


def _middles(groups: Integers) -> Floats:
    """Mean times of groups of slots, in slots from the start."""
    middle: Floats = (groups[:-1] + groups[1:] + 1) / 2
    return middle


def combined(epochs: Epochs, groups: Integers) -> Epochs:
    """Groups of slots, each in the middle of its time.

    Parameters
    ----------
    groups
        Of `groups_of`.
    """
    step = np.diff(_middles(groups), prepend=0.0) * epochs.step_s[0]

    def sums(values: Floats) -> Floats:
        found: Floats = np.add.reduceat(values[: groups[-1]], groups[:-1])
        return found

    return replace(
        epochs, step_s=step, readings=sums(epochs.readings), heard=sums(epochs.heard),
        packets=sums(epochs.packets),
    )
