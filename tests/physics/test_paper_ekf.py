"""The EKF, step by step, against one written here in NumPy from the paper's section 3."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sblcosim
from numpy.typing import NDArray

Array = NDArray[np.float64]
BEACONS = 4


class PaperEkf:
    """Predictor and corrector as printed, with the 5 x 1 measurement and full matrices."""

    def __init__(self, x: Array, P: Array, q: float, sigma: Array, literal: bool) -> None:
        self.x, self.P, self.q = x, P, q
        self.R = np.diag(sigma if literal else sigma**2)
        self.epoch = 0.0

    def update(self, epoch: float, z: Array, beacons: Array, heard: NDArray[np.bool_]) -> None:
        dt = epoch - self.epoch
        self.epoch = epoch
        Phi = np.kron(np.eye(3), np.array([[1.0, dt], [0.0, 1.0]]))
        Q = np.kron(np.eye(3), self.q * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]))
        x, P = Phi @ self.x, Phi @ self.P @ Phi.T + Q
        offsets = x[[0, 2, 4]] - beacons
        ranges = np.linalg.norm(offsets, axis=1)
        H = np.zeros((5, 6))
        H[:4, [0, 2, 4]] = offsets / ranges[:, None]
        H[4, 4] = 1.0
        used = np.append(heard, True)
        H, R = H[used], self.R[np.ix_(used, used)]
        innovation = (z - np.append(ranges, x[4]))[used]
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        self.x, self.P = x + K @ innovation, P - K @ H @ P


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"receiver.measurement_noise": "variance", "receiver.beacon_position_source": "own_packet"},
        {"time.sampling_time_s": 1.0, "acoustics.loss_probability": 0.25},
        {"time.ekf_ratio": 4, "acoustics.loss_probability": 0.5, "target.speed_m_s": 1.5},
        {"platform.arm_length_m": 0.4, "platform.gps_horizontal_std_m": 3.5,
         "acoustics.range_std_m": 1.0},
    ],
)
def test_the_ekf_agrees_with_the_paper_s_equations(changes: dict[str, Any]) -> None:
    result = sblcosim.run("paper-scenario-1", "ekf", {"seed": 11, **changes})
    scenario = sblcosim.load("paper-scenario-1", changes)
    receiver = scenario.receiver
    record, estimates = result.table, result.tracks["ekf"]

    def column(name: str, size: int = 1) -> Array:
        if size == 1:
            return record[name].to_numpy(float)
        names = [c for c in record.columns if c.startswith(f"{name}[")]
        return record[names].to_numpy(float)

    start = column("target.position", 3)[0]
    q = receiver.acceleration_psd_m2_s3
    sigma = np.array([receiver.range_std_m] * 4 + [receiver.depth_std_m])
    ekf = PaperEkf(
        np.array([start[0], 0, start[1], 0, start[2], 0]), np.eye(6), q, sigma,
        receiver.measurement_noise == "literal",
    )
    source = "ping" if receiver.beacon_position_source == "own_packet" else "packet"
    counts = column("acoustics.reception_count", 4)
    ranges, beacons = column("acoustics.range", 4), column(f"acoustics.{source}_beacon_position", 4)
    depth, depth_epoch = column("target.depth"), column("target.depth_epoch")
    period = round(scenario.time.ekf_ratio)
    expected = []
    for k in range(period, len(record), period):  # the tick at instant k sees what is out by then
        if k == len(record) - 1:
            break  # what this tick does is seen only after one more step
        if depth_epoch[k] > 0:
            ekf.update(
                depth_epoch[k], np.append(ranges[k], depth[k]), beacons[k].reshape(4, 3),
                counts[k] > 0,
            )
            expected.append([ekf.epoch, *ekf.x[[0, 2, 4]]])
    got = estimates[["epoch_s", "x_m", "y_m", "z_m"]].to_numpy()
    assert len(got) == len(expected) > 20
    np.testing.assert_allclose(got, np.array(expected), rtol=0, atol=1e-9)
    # The comparison means something: the estimates are not simply the truth.
    assert np.abs(estimates["error_x_m"]).max() > 0.05
