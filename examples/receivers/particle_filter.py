"""A particle filter in plain NumPy. Its random numbers are determined by the run's seed."""

import numpy as np
from sblcosim import Depth, Estimate, Receiver


class ParticleFilter(Receiver):
    """Particles move horizontally with white acceleration; the depth is the last reading."""

    parameters = {"particles": 4000, "acceleration_psd": 0.003, "outliers": 0.001}
    outputs = ("covariance",)

    def start(self):
        self.random = np.random.default_rng(self.seed)
        self.epoch = None

    def update(self, samples):
        if self.epoch is None:
            if (position := self.fix(samples)) is None:
                return None
            self.epoch, self.depth, samples = samples[-1].epoch, position[2], ()
            shape = (self.particles, 2)
            self.position = position[:2] + self.random.normal(0.0, 1.0, shape)
            self.velocity = self.random.normal(0.0, 0.5, shape)
            self.weight = np.full(self.particles, 1 / self.particles)
        for sample in samples:
            self.move(sample.epoch)
            if isinstance(sample, Depth):
                self.depth = sample.depth
            else:
                self.weigh(sample.range, sample.beacon_position)
        covariance = np.diag([0.0, 0.0, self.depth_std**2])
        covariance[:2, :2] = np.cov(self.position.T, aweights=self.weight)
        position = [*self.weight @ self.position, self.depth]
        return Estimate(self.epoch, position, covariance=covariance)

    def move(self, epoch):
        dt = max(epoch - self.epoch, 0.0)
        self.epoch += dt
        push = self.random.normal(0.0, np.sqrt(self.acceleration_psd * dt), self.velocity.shape)
        self.position += dt * (self.velocity + push / 2)
        self.velocity += push

    def weigh(self, measured, beacon):
        square = ((self.position - beacon[:2]) ** 2).sum(axis=1) + (self.depth - beacon[2]) ** 2
        off = (measured - np.sqrt(square)) / self.range_std
        self.weight *= np.exp(-0.5 * off**2) + self.outliers
        self.weight /= self.weight.sum()
        n = self.particles
        if 1 / (self.weight**2).sum() < n / 2:  # few carry all the weight: resample by weight
            steps = (np.arange(n) + self.random.random()) / n
            chosen = np.searchsorted(self.weight.cumsum(), steps).clip(max=n - 1)
            for values in (self.position, self.velocity):  # apart: copies add nothing
                near = self.random.normal(0.0, 0.1, values.shape) * values.std(axis=0)
                values[:] = values[chosen] + near
            self.weight[:] = 1 / n
