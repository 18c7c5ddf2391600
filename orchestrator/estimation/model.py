"""The models of a whole run: their parameters, and their measurements at a trajectory.

`ON_PLATFORM` is the model of `coupled`. That of `long_baseline` is `sblcosim.estimation.field`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import pi
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.models.declaration import Component, number_of
from sblcosim.models.receiver import surroundings, waves
from sblcosim.models.receiver.bound import ANYWHERE, FAR_STD
from sblcosim.models.receiver.receivers.coupled import COMPONENT as COUPLED
from sblcosim.models.receiver.surroundings import (
    HEADING,
    PLATFORM,
    POSITION,
    VELOCITY,
    Elements,
    Measurement,
    Pose,
)
from sblcosim.models.receiver.variables import INITIALISATION
from sblcosim.models.receiver.waves import STATES
from sblcosim.models.settings.keys import in_si

from ..data.estimates import Integers
from ..data.motion import motion_psd
from ..data.record import Record
from ..data.samples import Samples
from ..scenario.scenario import Scenario
from .linear import Floats, Problem

Indices = NDArray[np.intp]
RowsOfKind = tuple[Indices, Indices, Floats, Floats, Floats]
"""Measurements of one kind: node, order of use, row, residual and variance."""
PRIOR = number_of(INITIALISATION, "prior")
_PSD = "acceleration_psd"


def psd_of(receiver: str | None, record: Record) -> float:
    """q of the diver's motion as a receiver learned it [m²/s³]: the median over its updates.

    The start value of `coupled` without a receiver, or for one that does not say what it learned.
    """
    learned = None if receiver is None else motion_psd(record, receiver)
    return float(COUPLED[_PSD].starts[0]) if learned is None else float(np.median(learned))


def settled(p: Any, receiver: str | None, record: Record) -> Any:
    """The parameters with a number for q: if it is to be learned, that of `psd_of`."""
    return p if p.acceleration_psd >= 0 else _moving(p, psd_of(receiver, record))


def parameters(scenario: Scenario, start: Floats, component: Component = COUPLED) -> Any:
    """The parameters of a receiver in a scenario, as attributes, in SI units and in their shapes.

    Its FMU takes them as they are; `settled` makes those of a model.

    Parameters
    ----------
    scenario
        A scenario with that receiver.
    start
        True position at the start, NED [m]: the prior, if the scenario asks for the true one.
    """
    values: dict[str, Any] = {"beacons": scenario.beacons}
    for v in component.of("parameter"):
        value = np.asarray(in_si(v, getattr(scenario.receiver, v.key)), dtype=float)
        shape = (-1, *v.shape[1:])  # one row per beacon
        values[v.name] = value.reshape(shape) if v.shape else value.item()
    if scenario.true_prior:
        values |= {"prior_position": np.asarray(start, float), "prior_velocity": np.zeros(3)}
    return SimpleNamespace(**values)


@dataclass(frozen=True, eq=False)
class ScalarRows:
    """Scalar measurements at a trajectory, by epoch.

    Attributes
    ----------
    node
        Index of the epoch; shape (m,).
    H, residual, variance
        Row, measured minus predicted, and variance of the white noise; shape (m, d), (m,), (m,).
    is_range
        Whether it is a range, which may be late; shape (m,).
    """

    node: Indices
    H: Floats
    residual: Floats
    variance: Floats
    is_range: NDArray[np.bool_]


def first_ns(p: Any, samples: Samples) -> int:
    """Epoch of the first estimate [ns]; with a prior the first epoch, as for `coupled`."""
    enough = samples.enough_ns()
    if p.initialisation == PRIOR or enough is None:
        return int(samples.epochs_ns[0])
    return enough


def pose_of(p: Any, samples: Samples) -> Pose:
    """What the packets say about the platform besides position and heading; shape (m,).

    Swing is a state: see `sblcosim.models.receiver.waves`.
    """
    roll, variance = surroundings.tilt(p, samples.attitude[:, 0])
    pitch, _ = surroundings.tilt(p, samples.attitude[:, 1])
    arm = p.beacon_offset[samples.beacon]
    return Pose(
        down=samples.position[:, 2] - np.where(samples.has_pose, 0.0, arm[:, 2]),
        roll=np.where(samples.has_pose, roll, 0.0),
        pitch=np.where(samples.has_pose, pitch, 0.0),
        tilt_variance=np.where(samples.has_pose, variance, 0.0),
        own=np.where(samples.has_pose, 0.0, 1.0),
    )


@dataclass(frozen=True, eq=False)
class RunModel:
    """The functions of a model.

    Attributes
    ----------
    component
        Declaration of the receiver whose model it is.
    states
        ``states(p)``: their number d.
    position, velocity
        Indices of the diver's states, NED.
    parts
        ``parts(p, samples, trajectory)``: the measurements at a trajectory.
    prior
        ``prior(p, begin)``: mean and standard deviations at the start, shape (d,). ``begin`` is the
        state at the beginning of the first trajectory, about which states without a prior start.
    transition
        ``transition(p, dt)``: Φ without its ones, and the upper triangle of Q, over dt [s].
    """

    component: Component
    states: Callable[[Any], int]
    position: tuple[int, ...]
    velocity: tuple[int, ...]
    parts: Callable[[Any, Samples, Floats], Iterator[RowsOfKind]]
    prior: Callable[[Any, Floats], tuple[Floats, Floats]]
    transition: Callable[[Any, float], tuple[Elements, ...]]


def rows(p: Any, samples: Samples, trajectory: Floats, of: RunModel | None = None) -> ScalarRows:
    """The measurements at a trajectory.

    Parameters
    ----------
    trajectory
        States at the epochs of the samples; shape (n, d).
    """
    parts = [*(of or ON_PLATFORM).parts(p, samples, trajectory)]
    node, kind = (np.concatenate([part[i] for part in parts]) for i in (0, 1))
    order = np.lexsort((kind, node))
    H, residual, variance = (np.concatenate([part[i] for part in parts])[order] for i in (2, 3, 4))
    return ScalarRows(node[order], H, residual, variance, kind[order] == RANGE)


RANGE = 5
"""Order of use of ranges: after all others of their epoch."""


def part(
    kind: int, node: Indices, row: Measurement, z: Floats, states: int, *, wrapped: bool = False
) -> RowsOfKind:
    """Measurements z of one kind, from their formulas."""
    H = np.zeros((len(node), states))
    for i, value in row.row.items():
        H[:, i] = value
    residual = z - row.value
    if wrapped:
        residual = residual - 2 * pi * np.floor((residual + pi) / (2 * pi))
    return node, np.full(len(node), kind), H, residual, row.variance + 0 * residual


def _parts(p: Any, samples: Samples, trajectory: Floats) -> Iterator[RowsOfKind]:
    epochs = samples.epochs_ns
    node = np.searchsorted(epochs, samples.depth_ns)
    yield part(0, node, surroundings.depth(p, [*trajectory[node].T]), samples.depth, STATES)

    node = np.searchsorted(epochs, samples.range_ns)
    x, arm = [*trajectory[node].T], [*p.beacon_offset[samples.beacon].T]
    fresh, pose = samples.has_own_pose, pose_of(p, samples)
    place, body = [v[fresh] for v in x], [v[fresh] for v in arm]
    own = pose.own[fresh]
    row = waves.down(np, p, place, own, body)
    yield part(4, node[fresh], row, pose.down[fresh], STATES)
    point = [own * v for v in body]
    for i, row in enumerate(waves.places(np, p, place, point)):
        yield part(1 + i, node[fresh], row, samples.position[fresh, i], STATES)
    said = samples.has_pose & fresh
    if said.any():
        row = surroundings.heading(np, p, [v[said] for v in x])
        yield part(3, node[said], row, samples.attitude[said, 2], STATES, wrapped=True)
    row = waves.range_(np, p, x, pose, arm)
    yield part(RANGE, node, row, samples.range, STATES)


def prior(p: Any, begin: Floats) -> tuple[Floats, Floats]:
    """Mean and standard deviations at the start, shape (d,).

    Parameters
    ----------
    begin
        State at the beginning of the first trajectory, about which states without a prior start.
    """
    mean, std = np.zeros(STATES), np.zeros(STATES)
    for i, value in waves.prior_stds(p).items():
        std[i] = value
    std[list(VELOCITY)] = p.prior_velocity_std
    if p.initialisation == PRIOR:
        mean[list(POSITION)], std[list(POSITION)] = p.prior_position, p.prior_position_std
        mean[list(VELOCITY)] = p.prior_velocity
    else:
        mean[list(POSITION)], std[list(POSITION)] = begin[list(POSITION)], FAR_STD
    mean[list(PLATFORM)], std[list(PLATFORM)] = begin[list(PLATFORM)], FAR_STD
    mean[HEADING], std[HEADING] = begin[HEADING], ANYWHERE
    return mean, std


def transition(p: Any, dt: float, of: RunModel | None = None) -> tuple[Floats, Floats]:
    """Φ and Q over dt [s]; (d, d) each."""
    of = of or ON_PLATFORM
    phi, noise = of.transition(p, dt)
    Phi, Q = np.eye(of.states(p)), np.zeros((of.states(p),) * 2)
    for (i, j), value in phi.items():
        Phi[i, j] = value
    for (i, j), value in noise.items():
        Q[i, j] = Q[j, i] = value
    return Phi, Q


def transitions(
    p: Any, start_ns: int, epochs_ns: Integers, psd: Floats | None = None,
    of: RunModel | None = None,
) -> tuple[Floats, Floats, Indices]:
    """Φ and Q of all distinct steps, and the index of the one before each epoch.

    Parameters
    ----------
    psd
        q of the diver's motion in the step to each epoch [m²/s³]; None: that of the parameters.
    """
    own = np.full(len(epochs_ns), float(p.acceleration_psd)) if psd is None else psd
    steps, step = np.unique(np.diff(epochs_ns, prepend=start_ns), return_inverse=True)
    pairs, which = np.unique(np.column_stack([step, own]), axis=0, return_inverse=True)
    # Q is that of an unmoved diver, and q times that of a density of 1.
    seconds = [float(step) / 1e9 for step in steps]
    both = [transition(_moving(p, 0.0), dt, of) for dt in seconds]
    phi, still = np.array([Phi for Phi, _ in both]), np.array([Q for _, Q in both])
    restless = np.array([transition(_moving(p, 1.0), dt, of)[1] for dt in seconds]) - still
    width, q = pairs[:, 0].astype(np.intp), pairs[:, 1]
    return phi[width], still[width] + q[:, None, None] * restless[width], which.ravel()


def _moving(p: Any, psd: float) -> Any:
    return SimpleNamespace(**vars(p) | {_PSD: psd})


def problem(
    p: Any, samples: Samples, begin: Floats, psd: Floats | None = None, of: RunModel | None = None
) -> Problem:
    """The linear problem without its measurements: prior and motion; see `transitions`."""
    mean, std = (of or ON_PLATFORM).prior(p, begin)
    epochs = samples.epochs_ns
    phi, noise, which = transitions(p, samples.start_ns, epochs, psd, of)
    nothing = np.zeros(0)
    return Problem(
        mean, np.diag(std**2), phi, noise, which, np.zeros(len(epochs) + 1, np.intp),
        np.zeros((0, len(mean))), nothing, nothing,
    )


ON_PLATFORM = RunModel(
    COUPLED, lambda p: STATES, POSITION, VELOCITY, _parts, prior,
    lambda p, dt: waves.transition(np, p, dt),
)
"""The diver, the platform, and the errors of their sensors: `surroundings` and `waves`."""
