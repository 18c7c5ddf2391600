"""The same study as `numpy_study`, written directly from the equations in NumPy.

Vectorised over the runs, which are the first axis: rotation matrices, and an EKF with stacked 6 x 6
and 5 x 5 matrices, products by ``@`` and gains by ``numpy.linalg.solve``. Everything besides the
simulation itself (design, target, batches) is that of the tuned script.

Run by hand: ``python benchmarks/competitors/numpy_plain.py``
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from numpy_study import (
    BEACON_DEPTH,
    DEPTH,
    WAVE_AMPLITUDE,
    WAVE_FREQUENCY,
    Factors,
    Q,
    epochs,
    main,
    target,
)

Floats = NDArray[np.float64]

BATCH = 256
"""Maximum number of runs simulated at once; with more, the arrays leave the cache."""
ARMS = np.array([[1.0, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])


def rotation(attitude: Floats) -> Floats:
    """R = Rz Ry Rx of roll, pitch, yaw, (N, 3), as (N, 3, 3)."""
    cr, cp, cy = np.cos(attitude).T
    sr, sp, sy = np.sin(attitude).T
    matrix = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    return np.moveaxis(matrix, 2, 0)


def simulate(sampling_time: float, rng: np.random.Generator, factors: Factors) -> Floats:
    """Simulate one run per element of the factors' arrays, all at once.

    Returns
    -------
    RMS over the run of the errors in x, y, z and of the total error in m, (4, N).
    """
    T = sampling_time
    N = len(factors["baseline"])
    steps = epochs(T)
    imu, gps = factors["imu_std"][:, None], factors["gps_std"][:, None]
    beacons = factors["baseline"][:, None, None] * ARMS + [0, 0, BEACON_DEPTH]
    phase = rng.uniform(0, 2 * np.pi, (N, 3))

    Phi = np.kron(np.eye(3), [[1, T], [0, 1]])
    Q6 = Q * np.kron(np.eye(3), [[T**3 / 3, T**2 / 2], [T**2 / 2, T]])
    R = np.zeros((N, 5, 5))  # literally the standard deviations
    R[:, range(4), range(4)] = factors["range_std"][:, None]
    R[:, 4, 4] = factors["depth_std"]
    x = np.zeros((N, 6))
    x[:, ::2] = target(np.zeros(1))
    P = np.tile(np.eye(6), (N, 1, 1))

    z, reported = np.zeros((N, 5)), np.zeros((N, 4, 3))
    heard = np.zeros((N, 5), dtype=bool)
    heard[:, 4] = True
    squares = np.zeros((N, 3))
    for k in range(steps):
        t = T * (k + 1)
        truth = target(np.array(t))
        attitude = WAVE_AMPLITUDE * np.sin(2 * np.pi * WAVE_FREQUENCY * t + phase)
        placed = beacons @ rotation(attitude).transpose(0, 2, 1)
        measured = attitude + imu * rng.standard_normal((N, 3))
        broadcast = beacons @ rotation(measured).transpose(0, 2, 1)
        broadcast[:, :, :2] += (gps * rng.standard_normal((N, 2)))[:, None]

        turn = k % 4
        received = rng.random(N) >= factors["loss_probability"]
        distance = np.linalg.norm(truth - placed[:, turn], axis=1)
        distance += factors["range_std"] * rng.standard_normal(N)
        z[:, turn] = np.where(received, distance, z[:, turn])
        z[:, 4] = DEPTH + factors["depth_std"] * rng.standard_normal(N)
        heard[:, turn] |= received
        reported = np.where(received[:, None, None], broadcast, reported)

        x = x @ Phi.T
        P = Phi @ P @ Phi.T + Q6
        offset = x[:, None, ::2] - reported
        expected = np.empty((N, 5))
        expected[:, :4] = np.linalg.norm(offset, axis=2)
        expected[:, 4] = x[:, 4]
        H = np.zeros((N, 5, 6))
        H[:, :4, ::2] = offset / expected[:, :4, None]
        H[:, 4, 4] = 1
        H *= heard[:, :, None]
        HP = H @ P
        K = np.linalg.solve(HP @ H.transpose(0, 2, 1) + R, HP).transpose(0, 2, 1)
        x = x + (K @ (z - expected)[:, :, None])[:, :, 0]
        P = P - K @ HP
        squares += (x[:, ::2] - truth) ** 2
    squares /= steps
    rms: Floats = np.sqrt(np.vstack([squares.T, squares.sum(axis=1)]))
    return rms


if __name__ == "__main__":
    main(simulate, BATCH, __doc__)
