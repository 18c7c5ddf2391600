"""An unscented Kalman filter, with FilterPy (pip install filterpy)."""

import numpy as np
from filterpy.common import Q_continuous_white_noise
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
from sblcosim import Depth, Estimate, Receiver


def moved(x, dt):  # the state is (x, vx, y, vy, z, vz), NED
    return x + dt * np.kron(x[1::2], [1.0, 0.0])


def depth(x):
    return x[[4]]


def distance(x, beacon):
    return np.array([np.linalg.norm(x[::2] - beacon)])


class Ukf(Receiver):
    """Constant velocity, disturbed by white acceleration; each sample at its own epoch."""

    parameters = {"acceleration_psd": 0.003, "gate": 4.0}
    outputs = ("velocity", "covariance")

    def start(self):
        points = MerweScaledSigmaPoints(6, alpha=0.1, beta=2.0, kappa=0.0)
        self.ukf = UnscentedKalmanFilter(6, 1, 1.0, hx=depth, fx=moved, points=points)
        self.ukf.P = np.diag([1.0, 0.25] * 3)
        self.epoch = None

    def update(self, samples):
        ukf = self.ukf
        if self.epoch is None:
            if (position := self.fix(samples)) is None:
                return None
            self.epoch, ukf.x, samples = samples[-1].epoch, np.kron(position, [1.0, 0.0]), ()
        for s in samples:
            dt = max(s.epoch - self.epoch, 0.0)
            self.epoch += dt
            ukf.Q = Q_continuous_white_noise(2, dt, self.acceleration_psd, block_size=3)
            ukf.predict(dt)
            if isinstance(s, Depth):
                ukf.update([s.depth], self.depth_std**2)
            else:
                line = ukf.x[::2] - s.beacon_position
                length = np.linalg.norm(line)
                std = np.sqrt(line @ ukf.P[::2, ::2] @ line / length**2 + self.range_std**2)
                excess = max(abs(s.range - length) / std / self.gate, 1.0)  # of an echo
                variance = (self.range_std * excess) ** 2
                ukf.update([s.range], variance, hx=distance, beacon=s.beacon_position)
        return Estimate(self.epoch, ukf.x[::2], velocity=ukf.x[1::2], covariance=ukf.P)
