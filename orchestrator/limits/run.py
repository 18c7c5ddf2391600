"""The reference for a run: what was possible with the measurements received."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus.stopping import interruptible
from sblcosim.models.settings.assumptions import has_clock
from sblcosim.models.settings.parameters import STOCHASTIC

from ..data.record import Record, epochs_ns
from ..data.truth import held_at, recorded, state_at
from ..scenario.scenario import Scenario
from ..scenario.schema import CORE_COMPONENTS
from .echoes import echo_chances, shares_along
from .parameters import beacons_of, conditions, model_of, own_beacon
from .path import path_psd
from .recursion import Epochs, ReceiverModel, covariances
from .unknown import left_out, squares
from .verdict import Limits, limits_of

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_PORTS = (
    "target.position", "target.velocity", "target.depth_epoch", "platform.position",
    "platform.attitude", "acoustics.range_epoch", "acoustics.reception_count",
)  # fmt: skip
"""Outputs of a run that `of_run` reads."""
MOST_EPOCHS = 20_000
"""Instants of a run and epochs of its estimates are at most twice as many, or it takes too long."""


@interruptible
def reference(
    record: Record,
    scenario: Scenario,
    *,
    acceleration_psd: float | None = None,
    own_beacon: bool = False,
    at_ns: Integers | None = None,
) -> Limits:
    """The posterior Cramér-Rao recursion along the true path of a run.

    The model is that of the receiver ``coupled`` without arcs and outliers, or that of
    ``long_baseline`` if each beacon has its own error (`has_own_errors`). Priors and noises are the
    scenario's true ones, and the measurements are those actually received. Outliers reduce the
    information (`fisher_factor`), and so do echoes (`shares`); other errors are listed in
    ``without``. If the motion is drawn from the model (``trajectory =
    "white_noise_acceleration"``), no receiver can be better on average over runs, given the stated
    priors. On any other path q is a choice: by default that of the path over the filter's own
    memory (`path_psd`).

    Parameters
    ----------
    record, scenario
        Record and scenario of a run with our own target, platform and acoustics.
    acceleration_psd
        q of the diver [m²/s³].
    own_beacon
        Whether packets hold only their own beacon's position.
    at_ns
        Additional epochs [ns], for example those of estimates.

    Examples
    --------
    >>> result = sblcosim.run("realistic-dive")                          # doctest: +SKIP
    >>> reference(result.record, result.scenario).verdict().absolute_rms  # doctest: +SKIP
    """
    epoch, heard, depth = events_of(record, at_ns)
    is_bound = scenario.target.trajectory == STOCHASTIC and acceleration_psd is None
    if acceleration_psd is None and not is_bound:
        acceleration_psd = psd_of(record, scenario)
    model = model_of(scenario, acceleration_psd, own_beacon)
    q = model.parameters.acceleration_psd if acceleration_psd is None else acceleration_psd
    position, epochs = epochs_along(record, model, epoch, heard, depth)
    if any(echo_chances(scenario.acoustics)):
        beacons = held_at(record.time_ns, recorded(record, "platform.beacon_position"), epoch)
        velocity = _states(record, epoch)[1]
        known = shares_along(scenario.acoustics, position, beacons, velocity)
        epochs = replace(epochs, heard=epochs.heard * known)
    absolute, relative = (
        P[:, 0] for P in covariances(model, epochs, position[:, None], np.array([q], float))
    )
    found = limits_of(epoch, absolute, relative, position - epochs.platform, q, is_bound,
                      timed=has_clock(scenario.acoustics))
    # With beacons far apart, a position is no bearing, and there is no ring.
    return replace(
        found, ring=found.ring & (not model.own_errors), without=left_out(scenario),
        left_out=squares(scenario, position, (epoch - record.time_ns[0]) / 1e9),
    )


def of_run(
    record: Record,
    scenario: Any,
    fmus: Mapping[str, Any],
    estimates_ns: Integers,
    acceleration_psd: float | None = None,
) -> Limits | None:
    """`reference` of a run, if its target, platform and acoustics are our own.

    Parameters
    ----------
    fmus
        Components that are FMUs.
    estimates_ns
        Epochs of all estimates [ns].
    acceleration_psd
        See `reference`.
    """
    ours = isinstance(scenario, Scenario) and all(
        name in fmus and getattr(scenario, name).fmu is None for name in CORE_COMPONENTS
    )
    if not ours or any(name not in record.values for name in _PORTS):
        return None
    start, stop = record.time_ns[0], record.time_ns[-1]
    at = np.unique(estimates_ns[(start <= estimates_ns) & (estimates_ns <= stop)])
    if len(record) + len(at) > 2 * MOST_EPOCHS:
        return None
    return reference(
        record, scenario, acceleration_psd=acceleration_psd, own_beacon=own_beacon(scenario),
        at_ns=at,
    )


def psd_of(record: Record, scenario: Scenario) -> float:
    """q of the path of a run [m²/s³]; see `path_psd`."""
    c, own = conditions(scenario, 0.0), record.own("target")
    o = recorded(record, "target.position") - recorded(record, "platform.position")
    distance_square = float((o**2).sum(1).mean())
    if not np.isfinite(c.round):
        return 0.0
    R = c.range_std**2 * distance_square / max(c.spread, 1e-12)
    return path_psd(
        record.time_ns[own] / 1e9, recorded(record, "target.velocity")[own], R * c.round
    )


def events_of(record: Record, at_ns: Integers | None) -> tuple[Integers, Floats, Floats]:
    """Epochs [ns], and the number of packets and readings at each; (n,), (n, N), (n,)."""
    count = record.values["acoustics.reception_count"].astype(np.int64)
    new = np.diff(count, axis=0, prepend=0) > 0
    heard_ns = epochs_ns(
        record.time_ns, recorded(record, "acoustics.range_epoch").ravel()
    ).reshape(new.shape)
    depth_s = recorded(record, "target.depth_epoch")
    read = np.diff(depth_s, prepend=depth_s[0]) > 0
    depth_ns = epochs_ns(record.time_ns, depth_s[read])
    further = np.zeros(0, np.int64) if at_ns is None else at_ns
    epoch = np.unique(np.concatenate([heard_ns[new], depth_ns, further]))
    heard, depth = np.zeros((len(epoch), new.shape[1])), np.zeros(len(epoch))
    for i, column in enumerate(new.T):
        heard[np.searchsorted(epoch, heard_ns[column, i]), i] = 1
    depth[np.searchsorted(epoch, depth_ns)] = 1
    return epoch, heard, depth


def epochs_along(
    record: Record, model: ReceiverModel, epoch: Integers, heard: Floats, depth: Floats
) -> tuple[Floats, Epochs]:
    """True positions of the diver at epochs, (n, 3), and the true values there."""
    time = record.time_ns
    position, _ = _states(record, epoch)

    def held(name: str) -> Floats:
        return held_at(time, recorded(record, f"platform.{name}"), epoch)

    return position, Epochs(
        step_s=np.diff(epoch, prepend=time[0]) * 1e-9,
        readings=depth,
        heard=heard,
        packets=heard.max(axis=1, initial=0),
        platform=held("position"),
        attitude=held("attitude"),
        beacons=held("beacon_position") if model.own_errors else beacons_of(model.parameters),
    )


def _states(record: Record, epoch: Integers) -> tuple[Floats, Floats]:
    """True positions [m] and velocities [m/s] of the diver at epochs, NED; (n, 3) each."""
    own = record.own("target")
    return state_at(
        record.time_ns[own], recorded(record, "target.position")[own],
        recorded(record, "target.velocity")[own], epoch,
    )
