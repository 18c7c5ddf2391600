"""A fixed-lag smoother on a factor graph, with GTSAM (pip install gtsam)."""

import gtsam
import numpy as np
from sblcosim import Depth, Estimate, Receiver

NOISE = gtsam.noiseModel
CAUCHY = NOISE.mEstimator.Cauchy.Create(2.0)  # so that echoes have little weight

def factor(noise, function, *keys):
    """A factor: a function of its states returns the error and the Jacobians."""
    def error(factor, values, jacobians):
        result, *derivatives = function(*map(values.atVector, keys))
        for i, derivative in enumerate(derivatives if jacobians is not None else ()):
            jacobians[i] = derivative
        return result
    return gtsam.CustomFactor(noise, keys, error)

def measured(x, s):
    if isinstance(s, Depth):
        return x[4:5] - s.depth, np.eye(1, 6, 4)
    length = np.linalg.norm(line := x[::2] - s.beacon_position)
    return np.array([length - s.range]), np.kron(line / length, [[1.0, 0.0]])

class FactorGraph(Receiver):
    """A state (x, vx, y, vy, z, vz) per epoch, constant velocity between them, and the samples."""
    parameters = {"acceleration_psd": 0.003, "window": 2.0}
    outputs = ("velocity", "covariance")

    def start(self):
        self.smoother, self.key, self.epoch = gtsam.BatchFixedLagSmoother(self.window), 0, None

    def update(self, samples):
        graph, values, epochs = gtsam.NonlinearFactorGraph(), gtsam.Values(), {}
        if self.epoch is None:
            if (position := self.fix(samples)) is None:
                return None
            epochs[0], self.x = samples[-1].epoch, np.kron(position, [1.0, 0.0])
            self.epoch, samples = epochs[0], ()
            values.insert(0, self.x)
            graph.add(gtsam.PriorFactorVector(0, self.x, NOISE.Diagonal.Sigmas([1.0, 0.5] * 3)))
        for s in samples:
            if s.epoch > self.epoch:
                dt, k, self.key = s.epoch - self.epoch, self.key, self.key + 1
                epochs[self.key] = self.epoch = s.epoch
                F = np.kron(np.eye(3), [[1.0, dt], [0.0, 1.0]])
                Q = self.acceleration_psd * np.kron(np.eye(3), [[dt**3/3, dt**2/2], [dt**2/2, dt]])
                self.x = F @ self.x
                values.insert(self.key, self.x)
                noise = NOISE.Gaussian.Covariance(Q)
                graph.add(factor(noise, lambda x, y, F=F: (y - F @ x, -F, np.eye(6)), k, self.key))
            std = self.depth_std if isinstance(s, Depth) else self.range_std
            noise = NOISE.Robust.Create(CAUCHY, NOISE.Isotropic.Sigma(1, std))
            graph.add(factor(noise, lambda x, s=s: measured(x, s), self.key))
        self.smoother.update(graph, values, epochs)
        found = self.smoother.calculateEstimate()
        self.x = found.atVector(self.key)
        P = gtsam.Marginals(self.smoother.getFactors(), found).marginalCovariance(self.key)
        return Estimate(self.epoch, self.x[::2], velocity=self.x[1::2], covariance=P)
