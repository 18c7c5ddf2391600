"""A dive drawn from the model of `coupled` itself: its samples, and its true states."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from sblcosim.data.samples import Samples
from sblcosim.estimation import model
from sblcosim.estimation.after import assumed
from sblcosim.models.receiver.waves import HEAVE, STATES
from sblcosim.scenario.scenario import load
from scipy.spatial.transform import Rotation

START = np.array([12.0, 5.0, 6.0])
HEADING = 0.3


def parameters(**keys: Any) -> Any:
    """Of a realistic dive that starts at `START`, with some keys of the receiver changed."""
    given = {
        "range_std_m": 0.1, "prior_position_m": tuple(START), "initialisation": "prior",
        "acceleration_psd_m2_s3": 0.003, "prior_velocity_std_m_s": 0.2, **keys,
    }
    scenario = assumed(
        load("realistic-dive"), {f"receiver.{key}": value for key, value in given.items()}
    )
    return model.parameters(scenario, START)


def drawn(rng: np.random.Generator, covariance: np.ndarray) -> np.ndarray:
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors @ (np.sqrt(np.maximum(values, 0)) * rng.standard_normal(len(values))))


def dive(
    p: Any, seed: int, epochs: int = 60, *, loss: float = 0.25, late: float = 0.05,
    psd: np.ndarray | None = None,
) -> tuple[Samples, np.ndarray]:
    """Samples at 1, 2, … s, the beacons in turn, and the states there, (epochs, 22).

    With ``psd`` the diver moves with this q in the step to each epoch [m²/s³].
    """
    rng = np.random.default_rng(seed)
    ns = 1_000_000_000 * np.arange(1, epochs + 1)
    mean, std = model.prior(p, np.zeros(STATES))
    std[[6, 7, 12]], mean[12] = 0.0, HEADING
    x = mean + std * rng.standard_normal(STATES)
    phi, noise, which = model.transitions(p, 0, ns, psd)
    states = []
    for turn in which:
        x = phi[turn] @ x + drawn(rng, noise[turn])
        states.append(x)
    truth = np.array(states)
    beacon = np.arange(epochs) % 4
    tilt = p.tilt_std * rng.standard_normal((epochs, 2))
    attitude = np.column_stack([tilt, truth[:, 12]])
    arm = Rotation.from_euler("xyz", attitude).apply(p.beacon_offset[beacon])
    place = truth[:, [6, 7, HEAVE]]
    distance = np.linalg.norm(truth[:, :3] - place - arm, axis=1)
    excess = (rng.uniform(size=epochs) < late) * rng.exponential(p.outlier_mean, epochs)
    measured = (1 + truth[:, 16]) * distance + truth[:, 15] + excess
    measured += p.range_std * rng.standard_normal(epochs)
    attitude[:, :2] += p.imu_tilt_std * rng.standard_normal((epochs, 2))
    attitude[:, 2] += truth[:, 14] + max(p.imu_heading_std, 1e-3) * rng.standard_normal(epochs)
    place[:, :2] += truth[:, 10:12] + max(p.gps_std, 0.01) * rng.standard_normal((epochs, 2))
    place[:, 2] += truth[:, 18] + p.gps_vertical_std * rng.standard_normal(epochs)
    depth = truth[:, 2] + truth[:, 17] + p.depth_std * rng.standard_normal(epochs)
    samples = Samples(
        0, ns, depth, ns, beacon, measured, np.ones(epochs, bool), place, attitude
    )
    return without(samples, rng.uniform(size=epochs) < loss), truth


def without(samples: Samples, lost: np.ndarray) -> Samples:
    """The same without some of the packets."""
    names = ("range_ns", "beacon", "range", "has_pose", "position", "attitude")
    return replace(samples, **{name: getattr(samples, name)[~lost] for name in names})
