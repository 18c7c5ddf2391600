"""The receiver `long_baseline` a second time: full matrices in NumPy, from its definitions.

Derivatives are complex steps of the plain functions, densities are SciPy's, and a start is least
squares by SciPy. Nothing is taken from the component.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import exponnorm, norm

Array = NDArray[np.float64]
X, V = [0, 2, 4], [1, 3, 5]
BETA, KAPPA, BIAS, FIRST = 6, 7, 8, 9
WRONG = 1e-4 / 50


def length(v: Any) -> Any:
    """Euclidean length, also of complex steps."""
    return np.sqrt((v * v).sum())


class Reference:
    """One receiver; `tick` takes its inputs, `output` gives its outputs."""

    def __init__(self, p: Mapping[str, Any], beacons: int = 4) -> None:
        self.p, self.count = p, beacons
        self.n = FIRST + 3 * beacons
        self.ready = p["initialisation"] == 2
        self.mean, self.P = np.zeros(self.n), self.unknown()
        self.mean[X], self.mean[V] = p["prior_position"], p["prior_velocity"]
        self.P[X, X] = p["prior_position_std"] ** 2
        self.epoch = self.ranged = self.depth_epoch = 0.0
        self.pause = self.score = self.doubt = self.nis = 0.0
        self.updates = self.restarts = self.turns = self.degrees = 0
        self.counts = np.zeros(beacons)
        self.anchor: dict[int, Array] = {}

    def unknown(self) -> Array:
        """P before any measurement, but for the diver's place."""
        p = self.p
        stds = np.zeros(self.n)
        stds[V], stds[BETA] = p["prior_velocity_std"], p["clock_std"]
        stds[KAPPA], stds[BIAS] = p["sound_speed_std"], p["depth_bias_std"]
        across, up = p["beacon_error_std"], p["beacon_vertical_error_std"]
        stds[FIRST:] = [across, across, up] * self.count
        return np.diag(stds**2)

    def tick(self, u: Mapping[str, Any]) -> None:
        """One tick, with the receptions on its inputs."""
        new = [i for i in range(self.count) if u["reception_count"][i] != self.counts[i]]
        sounded = u["depth_epoch"] != self.depth_epoch
        if not (new or sounded):
            return
        enough = (u["reception_count"] > 0).sum() >= 3 and u["depth_epoch"] > 0
        if not self.ready:
            if enough:
                self.ready = True
                self.updates += 1
                self.fix(u)
                self.nis, self.degrees = 0.0, 0
            return
        self.updates += 1
        self.nis, self.degrees = 0.0, 0
        samples = [(u["depth_epoch"], -1)] if sounded else []
        samples += [(u["range_epoch"][i], i) for i in new]
        for epoch, i in sorted(samples, key=lambda s: s[0]):  # of equal epochs the depth is first
            if i < 0:
                self.advance(epoch)
                self.sound(u["depth"])
                self.depth_epoch = epoch
            elif self.hear(u, i, epoch, bool(enough)):
                return
            else:
                self.counts[i] = u["reception_count"][i]

    def advance(self, epoch: float) -> None:
        """To an epoch that is not before."""
        epoch = max(epoch, self.epoch)
        dt, p = epoch - self.epoch, self.p
        self.epoch = epoch
        F, Q = np.eye(self.n), np.zeros((self.n, self.n))
        q = p["acceleration_psd"]
        for i, j in zip(X, V, strict=True):
            F[i, j] = dt
            Q[i, i], Q[i, j], Q[j, j] = q * dt**3 / 3, q * dt**2 / 2, q * dt
            Q[j, i] = Q[i, j]
        Q[BETA, BETA] = p["clock_walk_psd"] * dt
        decay = np.exp(-dt / p["beacon_error_time"])
        errors = range(FIRST, self.n)
        F[errors, errors] = decay
        Q[errors, errors] = np.diag(self.unknown())[FIRST:] * (1 - decay**2)
        self.mean, self.P = F @ self.mean, F @ self.P @ F.T + Q

    def learn(self, H: Array, innovation: float, R: float, share: float = 1.0) -> None:
        """Update with a sample that counts with its probability, `share`."""
        S = H @ self.P @ H + R
        K = self.P @ H / S
        self.mean = self.mean + share * innovation * K
        left = share * (1 - share) * innovation**2 - share * S
        self.P = self.P + left * np.outer(K, K)
        self.nis += share * innovation**2 / S
        self.degrees += share > 0.5

    def sound(self, z: float) -> None:
        H = np.zeros(self.n)
        H[[X[2], BIAS]] = 1
        self.learn(H, z - H @ self.mean, max(self.p["depth_std"], 1e-3) ** 2)

    def about(self, known: Array, i: int) -> Array:
        """Where derivatives of the ranges of a beacon are taken."""
        first = self.anchor.get(i, known)
        moved = length(known - first) > 0.1 * length(self.mean[X] - known)
        self.anchor[i] = known if moved or not first.any() else first
        return self.anchor[i]

    def measured(self, z: float, known: Array, i: int, about: Array) -> tuple[Array, float, float]:
        """Row, innovation and noise of a range."""
        p, e = self.p, slice(FIRST + 3 * i, FIRST + 3 * i + 3)

        def at_anchor(x: Any) -> Any:
            """The range whose derivatives are taken; κ and the length as they are there."""
            return (1 + x[KAPPA]) * length(x[X] - about - (x[e] - self.mean[e])) + x[BETA]

        steps = self.mean + 1e-30j * np.eye(self.n)
        H = np.array([np.imag(at_anchor(step)) / 1e-30 for step in steps])
        R = max(p["range_std"], 1e-3) ** 2
        R += (H[X[0]] ** 2 + H[X[1]] ** 2) * p["beacon_noise_std"] ** 2
        R += H[X[2]] ** 2 * p["beacon_vertical_noise_std"] ** 2
        x = self.mean
        h = (1 + x[KAPPA]) * length(x[X] - known - x[e]) + x[BETA]
        return H, z - h, R

    def densities(self, innovation: float, root: float) -> tuple[float, float]:
        """Of an innovation with this standard deviation: of a punctual range, and of others."""
        p, m = self.p, self.p["outlier_mean"]
        punctual = (1 - p["outlier_probability"]) * norm.pdf(innovation, scale=root)
        late = WRONG
        if p["outlier_probability"]:
            late += p["outlier_probability"] * exponnorm.pdf(innovation, m / root, scale=root)
        return float(punctual), float(late)

    def scored(self, share: float, short: float) -> float:
        """The score after a range."""
        evidence = np.log(0.9) - np.log(max(self.p["outlier_probability"], 0.01))
        return float(max(self.score + (1 - share) * evidence - 1.1 * share + 8 * short, 0.0))

    def hear(self, u: Mapping[str, Any], i: int, epoch: float, enough: bool) -> bool:
        """One range; whether the filter starts anew."""
        self.advance(epoch)
        p, known = self.p, u["ping_beacon_position"][i]
        about = self.about(known, i)
        while True:
            H, innovation, R = self.measured(u["range"][i], known, i, about)
            S = H @ self.P @ H + R
            punctual, late = self.densities(innovation, np.sqrt(S))
            share = punctual / (punctual + late)
            pause = epoch - self.ranged if epoch > self.ranged else self.pause
            since = 3 * pause
            wider = np.sqrt(S + (p["prior_velocity_std"] * since) ** 2)
            turned = (1 - p["outlier_probability"]) * norm.pdf(innovation, scale=wider)
            doubt = max(self.doubt + np.log(turned / (punctual + late)), 0.0)
            begins = doubt > 9
            score = self.scored(share, (1 - share) * (innovation < 0) * (not begins))
            anew = score > 12 and enough and not begins
            again = begins and innovation < 0
            if not again:
                self.learn(H, innovation, R, share)
            self.turns += begins
            if begins:
                for j, k in zip(X, V, strict=True):
                    block = np.array([[since**2, since], [since, 1]]) * p["prior_velocity_std"] ** 2
                    self.P[np.ix_([j, k], [j, k])] += block
            self.score = 0.0 if anew or begins else score
            self.doubt = 0.0 if anew or begins else doubt
            self.pause = pause
            if not again:
                self.ranged = epoch
            if anew:
                self.anew(u)
            if not again:
                return bool(anew)

    def anew(self, u: Mapping[str, Any]) -> None:
        """Start again."""
        self.restarts += 1
        self.fix(u)
        self.nis, self.degrees = 0.0, 0

    def fix(self, u: Mapping[str, Any]) -> None:
        """Start from the latest receptions alone; what is common to ranges is their noise."""
        p = self.p
        heard = np.flatnonzero(u["reception_count"] > 0)
        beacons, z = u["ping_beacon_position"][heard], u["range"][heard]
        newest = max(u["range_epoch"].max(), u["depth_epoch"])
        motion = p["prior_velocity_std"] * (newest - np.append(u["range_epoch"][heard],
                                                               u["depth_epoch"]))
        common = p["clock_std"] ** 2 + p["beacon_error_std"] ** 2 + p["beacon_noise_std"] ** 2

        def weights(x: Array) -> Array:
            far = np.linalg.norm(x - beacons, axis=1)
            ranges = max(p["range_std"], 1e-3) ** 2 + common + (p["sound_speed_std"] * far) ** 2
            depth = max(p["depth_std"], 1e-3) ** 2 + p["depth_bias_std"] ** 2
            return 1 / (np.append(ranges, depth) + motion**2)

        def residuals(x: Array) -> Array:
            return np.append(z - np.linalg.norm(x - beacons, axis=1), u["depth"] - x[2])

        x = np.append(self.rough(beacons, z, u["depth"]), u["depth"])
        for _ in range(30):  # the weights are those of where a pass begins
            w = np.sqrt(weights(x))
            x = least_squares(lambda x, w=w: w * residuals(x), x, xtol=1e-15, ftol=1e-15).x
        w = weights(x)
        far = np.linalg.norm(x - beacons, axis=1)
        rows = np.vstack([(x - beacons) / far[:, None], [0, 0, 1]])
        doubt = max((w * residuals(x) ** 2).sum() / max(len(heard) + 1 - 3, 1), 1.0)
        self.mean, self.P = np.zeros(self.n), self.unknown()
        self.mean[X] = x
        self.P[np.ix_(X, X)] = doubt * np.linalg.inv(rows.T @ np.diag(w) @ rows)
        self.epoch = newest
        self.counts, self.depth_epoch = u["reception_count"].copy(), u["depth_epoch"]

    @staticmethod
    def rough(beacons: Array, z: Array, depth: float) -> Array:
        """North and east from differences of squared ranges."""
        flat = np.sqrt(np.maximum(z**2 - (depth - beacons[:, 2]) ** 2, 0))
        A = 2 * (beacons[1:, :2] - beacons[0, :2])
        squares = (beacons[:, :2] ** 2).sum(1) - flat**2
        found: Array = np.linalg.lstsq(A, squares[1:] - squares[0], rcond=None)[0]
        return found

    def output(self) -> dict[str, Any]:
        return {
            "position": self.mean[X], "velocity": self.mean[V], "covariance": self.P[:6, :6],
            "nis": self.nis, "nis_degrees": self.degrees, "restart_count": self.restarts,
        }


class Learning(Reference):
    """Filters with a density of the acceleration each, as an interacting multiple model.

    In the form of the textbooks: probabilities of the transitions between the filters, and for each
    filter a mixture of all. It knows of no turns. What a range says of all filters is the mean with
    the weights after the range.
    """

    def __init__(
        self, p: Mapping[str, Any], psds: Sequence[float], memory: float, every: float,
        beacons: int = 4,
    ) -> None:
        super().__init__(p, beacons)
        self.psds, self.memory, self.every = np.array(psds), memory, every
        self.filters = [Reference({**p, "acceleration_psd": q}, beacons) for q in psds]
        self.weights = self.shown = np.full(len(psds), 1 / len(psds))
        self.mixed = 0.0

    def follow(self) -> None:
        """Take the moments of the mixture."""
        self.mean = np.einsum("k,ki->i", self.weights, [f.mean for f in self.filters])
        self.P = sum(
            w * (f.P + np.outer(f.mean - self.mean, f.mean - self.mean))
            for w, f in zip(self.weights, self.filters, strict=True)
        )

    def advance(self, epoch: float) -> None:
        self.epoch = max(epoch, self.epoch)
        for f in self.filters:
            f.nis = 0.0
            f.advance(epoch)

    def sound(self, z: float) -> None:
        for f in self.filters:
            f.sound(z)
        self.nis += float(self.weights @ [f.nis for f in self.filters])
        self.degrees += 1

    def hear(self, u: Mapping[str, Any], i: int, epoch: float, enough: bool) -> bool:
        self.advance(epoch)
        known, found = u["ping_beacon_position"][i], []
        about = self.filters[0].about(known, i)
        for f in self.filters:
            H, innovation, R = f.measured(u["range"][i], known, i, about)
            punctual, late = f.densities(innovation, np.sqrt(H @ f.P @ H + R))
            share = punctual / (punctual + late)
            f.learn(H, innovation, R, share)
            found.append((punctual + late, share, (1 - share) * (innovation < 0), f.nis))
        density, *told = np.array(found).T
        self.weights = self.weights * density / (self.weights @ density)
        share, short, nis = (float(self.weights @ values) for values in told)
        self.score = self.scored(share, short)
        self.nis += nis
        self.degrees += share > 0.5
        anew = self.score > 12 and enough
        if anew:
            self.score = 0.0
            self.anew(u)
        return anew

    def fix(self, u: Mapping[str, Any]) -> None:
        super().fix(u)
        for f in self.filters:
            f.mean, f.P, f.epoch = self.mean.copy(), self.P.copy(), self.epoch
        self.weights, self.mixed = np.full(len(self.psds), 1 / len(self.psds)), self.epoch

    def tick(self, u: Mapping[str, Any]) -> None:
        """One update; then the filters are mixed, if it is time."""
        super().tick(u)
        self.follow()
        self.shown = self.weights
        if not self.ready or self.epoch - self.mixed < self.every:
            return
        stay, n = np.exp(-(self.epoch - self.mixed) / self.memory), len(self.psds)
        transitions = stay * np.eye(n) + (1 - stay) / n
        ahead = transitions.T @ self.weights
        share = transitions * self.weights[:, None] / ahead
        means = np.array([f.mean for f in self.filters])
        mixed = share.T @ means
        off = means[:, None] - mixed[None]
        before = [f.P for f in self.filters]
        for j, f in enumerate(self.filters):
            f.mean, f.P = mixed[j], sum(
                share[i, j] * (P + np.outer(off[i, j], off[i, j])) for i, P in enumerate(before)
            )
        self.weights, self.mixed = ahead, self.epoch

    def output(self) -> dict[str, Any]:
        return super().output() | {"motion_psd": float(np.exp(self.shown @ np.log(self.psds)))}
