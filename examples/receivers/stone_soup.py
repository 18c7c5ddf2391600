"""An extended Kalman filter, with Stone Soup (pip install stonesoup)."""

from datetime import datetime, timedelta

import numpy as np
from sblcosim import Depth, Estimate, Receiver
from stonesoup.base import Property
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.measurement.nonlinear import NonLinearGaussianMeasurement
from stonesoup.models.transition.linear import CombinedGaussianTransitionModel, ConstantVelocity
from stonesoup.predictor.kalman import ExtendedKalmanPredictor
from stonesoup.types import array, detection, hypothesis, state
from stonesoup.updater.kalman import ExtendedKalmanUpdater


class Distance(NonLinearGaussianMeasurement):
    beacon: np.ndarray = Property(doc="Its position")
    ndim_meas = 1

    def function(self, state, noise=False, **kwargs):  # of (x, vx, y, vy, z, vz), NED
        line = state.state_vector[::2, :].astype(float) - self.beacon[:, None]
        return array.StateVectors(np.linalg.norm(line, axis=0)[None])


class StoneSoup(Receiver):
    """Constant velocity, disturbed by white acceleration; each sample at its own epoch."""

    parameters = {"acceleration_psd": 0.003}
    outputs = ("velocity", "covariance")

    def start(self):
        motion = CombinedGaussianTransitionModel([ConstantVelocity(self.acceleration_psd)] * 3)
        self.predictor, self.updater = ExtendedKalmanPredictor(motion), ExtendedKalmanUpdater()
        self.state = None

    def time(self, epoch):
        return datetime(2000, 1, 1) + timedelta(seconds=epoch)

    def update(self, samples):
        if self.state is None:
            if (position := self.fix(samples)) is None:
                return None
            self.epoch, samples = samples[-1].epoch, ()
            mean, covariance = np.kron(position, [1.0, 0.0]), np.diag([1.0, 0.25] * 3)
            self.state = state.GaussianState(mean, covariance, self.time(self.epoch))
        for s in samples:
            self.epoch = max(self.epoch, s.epoch)
            if isinstance(s, Depth):
                z, model = s.depth, LinearGaussian(6, (4,), np.diag([self.depth_std**2]))
            else:
                noise = np.diag([self.range_std**2])
                z, model = s.range, Distance(6, (0, 2, 4), noise, beacon=s.beacon_position)
            now = self.time(self.epoch)
            predicted = self.predictor.predict(self.state, timestamp=now)
            seen = detection.Detection([z], timestamp=now, measurement_model=model)
            self.state = self.updater.update(hypothesis.SingleHypothesis(predicted, seen))
        x, P = np.array(self.state.mean, float).ravel(), np.array(self.state.covar, float)
        return Estimate(self.epoch, x[::2], velocity=x[1::2], covariance=P)
