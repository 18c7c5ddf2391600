"""The recursion for many divers at once: what is possible at many places of a scenario.

Nothing is random here. A packet lost with probability p counts with 1 − p of its information, and
the platform rests at its mean position and heading. Waves count as receivers assume them. Losses in
bursts and in the shadow of a diver are the exception: several sequences of them are averaged over.
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
from sblcosim.models.acoustics.ranging import legs
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
"""Maximum number of slots in the recursion; above it, several are combined."""
SEQUENCES = 8
"""Number of sequences of losses in bursts that are averaged over."""
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
    sequences = [
        epochs_of(scenario, model, span_s[1], sequence) for sequence in _sequences(scenario)
    ]
    epochs = sequences[0]
    # What a ping has of its own averages out over the pings of an epoch.
    pings = {"pings": max(float(epochs.heard.mean()), 1e-3)}
    model = replace(model, situation={**model.situation, **pings})
    end_s = np.cumsum(epochs.readings) * scenario.acoustics.sampling_time_s
    late = np.flatnonzero(end_s >= span_s[0])
    late = late if len(late) else np.array([len(end_s) - 1])
    picked = np.round(np.linspace(0, len(late) - 1, min(len(late), MOST_EPOCHS))).astype(int)
    kept = late[picked]

    positions = np.stack([path(time) for time in end_s.tolist()])
    shaded = bool(scenario.acoustics.shadow_loss_probability)
    velocities = _velocities(path, end_s) if shaded else positions
    together = 1 if shaded else _TOGETHER  # the shadow of each diver is another one

    def part(first: int) -> tuple[Floats, Floats, Floats]:
        some = slice(first, first + together)
        position = positions[:, some]
        told = 1.0 if shaded else _told(scenario, position[len(position) // 2])
        heard = (
            _shaded(scenario, position[:, 0], velocities[:, first], sequences) if shaded
            else sequences
        )
        found = [
            recursion.covariances(model, replace(it, heard=it.heard * told), position,
                                  acceleration_psd[some], kept)
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
    """Information in ranges of each beacon despite echoes, mean over places; (N,)."""
    if not any(echo_chances(scenario.acoustics)):
        return 1.0
    of_places = shares(scenario.acoustics, position[:, None], still_beacons(scenario))
    mean: Floats = of_places.mean(0)
    return mean


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
        drawn = np.random.default_rng([number, 2]).binomial(pings, arrives) / pings
        left = epochs.heard * drawn
        before = epochs.heard.sum(1) if one_by_one else epochs.heard.max(1)
        share = (left.sum(1) if one_by_one else left.max(1)) / np.where(before > 0, before, 1.0)
        yield replace(epochs, heard=left * tells, packets=epochs.packets * share)


def _sequences(scenario: Scenario) -> list[int | None]:
    """Numbers of the sequences of losses; None: each packet counts with its mean information."""
    a = scenario.acoustics
    bursts = a.loss_burst_length and 0 < a.loss_probability < 1
    mean = [None] * (SEQUENCES if a.shadow_loss_probability else 1)
    return [*range(SEQUENCES)] if bursts else [*mean]


def losses_in_bursts(
    scenario: Scenario, pings: Integers, sequence: int, leg: int = 0
) -> Floats:
    """1 where a packet of a beacon is lost directly, in bursts; (pings of each, N).

    Each leg of two-way ranges has sequences of its own.
    """
    a = scenario.acoustics
    rng = np.random.default_rng([sequence, leg] if leg else sequence)
    p, length = a.loss_probability, a.loss_burst_length
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
    """The slots of a run; if there are many, several are combined at their end.

    Parameters
    ----------
    sequence
        Number of a sequence of losses in bursts; None: each packet counts with the mean of its
        information.
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
    packets = np.full(total, 1 - missing**at_once)
    if sequence is not None:
        numbers = np.cumsum(sent, axis=0).astype(int) - 1
        by_echo = 1 - lost_of_leg(a) / a.loss_probability  # of the packets that are lost directly
        heard = sent
        for leg in range(legs(a.ranging)):
            losses = losses_in_bursts(scenario, numbers[-1] + 1, sequence, leg)
            is_lost = np.take_along_axis(losses, np.fmax(numbers, 0), 0) > 0
            heard = heard * np.where(is_lost, by_echo, 1.0)
        packets = heard.max(axis=1)
    together = -(-total // MOST_STEPS)
    firsts = np.arange(0, total, together)
    slots = np.diff(firsts, append=total)
    own = model.own_errors
    return Epochs(
        step_s=slots * a.sampling_time_s,
        readings=slots.astype(np.float64),
        heard=np.add.reduceat(heard, firsts),
        packets=np.add.reduceat(packets, firsts),
        platform=_place(scenario),
        attitude=np.array([0.0, 0.0, np.deg2rad(scenario.platform.mean_heading_deg)]),
        beacons=still_beacons(scenario) if own else beacons_of(model.parameters),
    )
