"""A fixed-lag smoother on a factor graph, with GTSAM (pip install gtsam)."""

import gtsam
import numpy as np
from sblcosim import Depth, Estimate, Receiver

NOISE = gtsam.noiseModel
CAUCHY = NOISE.mEstimator.Cauchy.Create(2.0)  # so that echoes count for little


def factor(noise, function, *keys):
    """A factor: the function of its states returns the error and the Jacobians."""

    def error(factor, values, jacobians):
        result, *derivatives = function(*map(values.atVector, keys))
        for i in range(0 if jacobians is None else len(keys)):
            jacobians[i] = derivatives[i]
        return result

    return gtsam.CustomFactor(noise, keys, error)


def measured(x, s):
    jacobian = np.zeros((1, 6))
    if isinstance(s, Depth):
        jacobian[0, 4] = 1.0
        return x[4:5] - s.depth, jacobian
    line = x[::2] - s.beacon_position
    length = np.linalg.norm(line)
    jacobian[0, ::2] = line / length
    return np.array([length - s.range]), jacobian


class FactorGraph(Receiver):
    """A state (x, vx, y, vy, z, vz) per epoch, constant velocity between them, and the samples."""

    parameters = {"acceleration_psd": 0.01, "lag": 2.0}
    outputs = ("velocity", "covariance")

    def start(self):
        self.smoother, self.key, self.epoch = gtsam.BatchFixedLagSmoother(self.lag), 0, None

    def update(self, samples):
        graph, values, epochs = gtsam.NonlinearFactorGraph(), gtsam.Values(), {}
        if self.epoch is None:
            if (position := self.fix(samples)) is None:
                return None
            epochs[0] = self.epoch = samples[-1].epoch
            self.x, samples = np.kron(position, [1.0, 0.0]), ()
            values.insert(0, self.x)
            graph.add(gtsam.PriorFactorVector(0, self.x, NOISE.Diagonal.Sigmas([1.0, 0.5] * 3)))
        for s in samples:
            if s.epoch > self.epoch:
                dt, self.key = s.epoch - self.epoch, self.key + 1
                epochs[self.key] = self.epoch = s.epoch
                F = np.kron(np.eye(3), [[1.0, dt], [0.0, 1.0]])
                Q = np.kron(np.eye(3), [[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
                self.x = F @ self.x
                values.insert(self.key, self.x)
                noise = NOISE.Gaussian.Covariance(Q * self.acceleration_psd)
                keys = self.key - 1, self.key
                graph.add(factor(noise, lambda x, y, F=F: (y - F @ x, -F, np.eye(6)), *keys))
            std = self.depth_std if isinstance(s, Depth) else self.range_std
            noise = NOISE.Robust.Create(CAUCHY, NOISE.Isotropic.Sigma(1, std))
            graph.add(factor(noise, lambda x, s=s: measured(x, s), self.key))
        self.smoother.update(graph, values, epochs)
        found = self.smoother.calculateEstimate()
        self.x = found.atVector(self.key)
        P = gtsam.Marginals(self.smoother.getFactors(), found).marginalCovariance(self.key)
        return Estimate(self.epoch, self.x[::2], velocity=self.x[1::2], covariance=P)
