"""The receiver `long_baseline` a second time: full matrices in NumPy, from its definitions.

Derivatives are complex steps of the plain functions, densities are SciPy's, and a start is least
squares by SciPy. Nothing is taken from the component.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from types import SimpleNamespace
from typing import Any

import numpy as np
from bank_reference import mixed
from numpy.typing import NDArray
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
        self.there: Reference | None = None
        self.lead, self.looked, self.fresh, self.sides = 0.0, 0.0, False, 0

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
                self.begin(u)
                self.nis, self.degrees = 0.0, 0
            return
        self.updates += 1
        self.nis, self.degrees = 0.0, 0
        samples = [(u["depth_epoch"], -1)] if sounded else []
        samples += [(u["range_epoch"][i], i) for i in new]
        for left, (epoch, i) in zip(  # of equal epochs the depth is first
            range(len(samples) - 1, -1, -1), sorted(samples, key=lambda s: s[0]), strict=True
        ):
            if i < 0:
                self.advance(epoch)
                self.sound(u["depth"])
                self.depth_epoch = epoch
            elif self.hear(u, i, epoch, bool(enough)):
                return
            else:
                self.counts[i] = u["reception_count"][i]
            if self.there is not None and not left and self.lead > 4:
                self.cross()
            elif self.there is not None and self.lead < -8:
                self.there = None
            elif self.there is None and not left and enough and self.epoch - self.looked >= 4:
                self.look(u)

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
        if self.there is not None:
            self.there.advance(epoch)

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
        if self.there is not None:
            self.there.sound(z)

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
        # The second order, faded out where the diver may be anywhere.
        P, u = self.P[np.ix_(X, X)], H[X] / length(H[X])
        bent = (np.eye(3) - np.outer(u, u)) / H[KAPPA]
        valid = 1 / (1 + (np.trace(bent @ P) / H[KAPPA] / 0.42**2) ** 2)
        R += valid * 0.5 * np.trace(bent @ P @ bent @ P)
        return H, z - h - valid * 0.5 * np.trace(bent @ P), R

    def densities(self, innovation: float, root: float) -> tuple[float, float]:
        """Of an innovation with this standard deviation: of a punctual range, and of others."""
        p, m = self.p, self.p["outlier_mean"]
        punctual = (1 - p["outlier_probability"]) * norm.pdf(innovation, scale=root)
        late = WRONG
        if p["outlier_probability"]:
            late += p["outlier_probability"] * exponnorm.pdf(innovation, m / root, scale=root)
        return float(punctual), float(late)

    @staticmethod
    def wrong(innovation: float, punctual: float, late: float) -> float:
        """Probability that a range is neither punctual nor late."""
        return (late if innovation < 0 else WRONG) / (punctual + late)

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
            score = self.scored(share, self.wrong(innovation, punctual, late) * (not begins))
            anew = score > 12 and enough and not begins
            again = begins and innovation < 0
            if not again:
                self.learn(H, innovation, R, share)
            self.turns += begins
            if self.there is not None:
                found = self.there.beside(u["range"][i], known, i, about, not again)
                self.lead += np.log(found / (punctual + late)) * (not again)
            for it in (self, self.there) if begins else ():
                if it is not None:
                    it.widen(since)
            self.score = 0.0 if anew or begins else score
            self.doubt = 0.0 if anew or begins else doubt
            self.pause = pause
            if not again:
                self.ranged = epoch
            if anew:
                self.anew(u)
            if not again:
                return bool(anew)

    def widen(self, since: float) -> None:
        """The diver has turned."""
        for j, k in zip(X, V, strict=True):
            block = np.array([[since**2, since], [since, 1]]) * self.p["prior_velocity_std"] ** 2
            self.P[np.ix_([j, k], [j, k])] += block

    def anew(self, u: Mapping[str, Any]) -> None:
        """Start again."""
        self.restarts += 1
        self.begin(u)
        self.nis, self.degrees = 0.0, 0

    def begin(self, u: Mapping[str, Any]) -> None:
        """Start, and look at the other side with the next samples."""
        self.fix(u)
        self.there, self.looked, self.fresh = None, self.epoch - 4, True

    # --- The other side ---

    def here(self) -> tuple[Array, Array, float]:
        """Position, velocity, and sum of the position's variances."""
        return self.mean[X], self.mean[V], float(np.trace(self.P[np.ix_(X, X)]))

    def twin(self) -> Reference:
        """A filter for the other side."""
        return Reference(self.p, self.count)

    def beside(self, z: float, known: Array, i: int, about: Array, use: bool) -> float:
        """Take a range that another filter judges; density of its innovation."""
        H, innovation, R = self.measured(z, known, i, about)
        punctual, late = self.densities(innovation, np.sqrt(H @ self.P @ H + R))
        if use:
            self.learn(H, innovation, R, punctual / (punctual + late))
        return punctual + late

    def cross(self) -> None:
        """The other side is right."""
        assert self.there is not None
        self.mean, self.P, self.there = self.there.mean, self.there.P, None
        self.restarts += 1
        self.sides += 1
        self.score, self.doubt, self.looked = 0.0, 0.0, self.epoch

    def look(self, u: Mapping[str, Any]) -> None:
        """Seek a fix on the other side, in two damped steps from the mirror image."""
        self.looked, p = self.epoch, self.p
        heard = np.flatnonzero(u["reception_count"] > 0)
        s, z = u["ping_beacon_position"][heard], np.append(u["range"][heard], u["depth"])
        newest = max(u["range_epoch"].max(), u["depth_epoch"])
        age = newest - np.append(u["range_epoch"][heard], u["depth_epoch"])
        common = p["clock_std"] ** 2 + p["beacon_error_std"] ** 2 + p["beacon_noise_std"] ** 2

        def variances(x: Array) -> Array:
            far = np.linalg.norm(x - s, axis=1)
            ranges = max(p["range_std"], 1e-3) ** 2 + common + (p["sound_speed_std"] * far) ** 2
            depth = max(p["depth_std"], 1e-3) ** 2 + p["depth_bias_std"] ** 2
            return np.append(ranges, depth) + (p["prior_velocity_std"] * age) ** 2

        def residuals(x: Array, v: Array) -> Array:
            then = x - age[:, None] * v
            return z - np.append(np.linalg.norm(then[:-1] - s, axis=1), then[-1, 2])

        def likely(x: Array, v: Array, R: Array) -> float:
            r = residuals(x, v)[:-1]
            return sum(float(np.log(sum(self.densities(e, np.sqrt(V_)))))
                       for e, V_ in zip(r, R, strict=False))

        x, v, spread = self.here()
        w, best = 1 / variances(x)[:-1], np.inf
        y, image = x, v
        for i, j in combinations(range(len(heard)), 2):
            a = (s[j] - s[i])[:2] / np.linalg.norm((s[j] - s[i])[:2])
            flip = np.diag([0.0, 0.0, 1.0])
            flip[:2, :2] = 2 * np.outer(a, a) - np.eye(2)
            origin = np.append(s[i, :2], 0)
            found, way = origin + flip @ (x - origin), flip @ v
            cost = np.minimum(w * residuals(found, way)[:-1] ** 2, 20).sum()
            if (found - x) @ (found - x) > 1.4**2 * spread and cost < best:
                y, image, best = found, way, cost
        fixed = self.common(s, z, y, image, age, p["clock_std"], 2)
        y = fixed.place
        R = variances(x)[:-1]
        lead = likely(y, image, R) - likely(x, v, R) - 1.5 - (0 if self.fresh else 4)
        self.fresh = False
        if lead <= -8 or (y - x) @ (y - x) <= 1.4**2 * (spread + np.trace(fixed.P[:3, :3])):
            return
        self.there, self.lead = self.twin(), lead
        there = self.there
        there.P, there.mean, there.epoch = self.unknown(), np.zeros(self.n), self.epoch
        there.mean[X], there.mean[V], there.mean[BETA] = y, image, fixed.clock
        there.P[np.ix_([*X, BETA], [*X, BETA])] = fixed.P

    def fix(self, u: Mapping[str, Any]) -> None:
        """Start from the latest receptions alone; all but the clock is noise of the ranges."""
        heard = np.flatnonzero(u["reception_count"] > 0)
        beacons, z = u["ping_beacon_position"][heard], np.append(u["range"][heard], u["depth"])
        newest = max(u["range_epoch"].max(), u["depth_epoch"])
        age = newest - np.append(u["range_epoch"][heard], u["depth_epoch"])
        x = np.append(self.rough(beacons, z[:-1], u["depth"]), u["depth"])
        if self.p["clock_std"] > 5:
            x[:2] = beacons[:, :2].mean(axis=0)
        fixed = self.common(beacons, z, x, np.zeros(3), age, self.p["clock_std"], 20)
        self.mean, self.P = np.zeros(self.n), self.unknown()
        self.mean[X], self.mean[BETA] = fixed.place, fixed.clock
        self.P[np.ix_([*X, BETA], [*X, BETA])] = fixed.P
        self.epoch = newest
        self.counts, self.depth_epoch = u["reception_count"].copy(), u["depth_epoch"]

    def common(
        self, s: Array, z: Array, x: Array, v: Array, age: Array, clock_std: float, passes: int
    ) -> SimpleNamespace:
        """Damped steps of a fix of place and clock; both have priors."""
        p, damping = self.p, 1e-6
        about = np.append(s[:, :2].mean(axis=0), 0.0)
        near = max(z[:-1].max(), 30.0)

        def rows(x: Array, w: Array) -> tuple[Array, Array, float]:
            """Weighted residuals with the clock that fits best, their slopes, and this clock."""
            then = x - age[:, None] * v
            off = then[:-1] - s
            far = np.linalg.norm(off, axis=1)
            H = np.zeros((len(z) + 3, 4))
            H[: len(far), :3], H[: len(far), 3] = off / far[:, None], 1
            H[len(far), 2] = 1
            H[-3, 3], H[-2, 0], H[-1, 1] = 1, 1, 1
            e = np.concatenate([z - np.append(far, then[-1, 2]), [0.0], (about - x)[:2]])
            e, H = e * np.sqrt(w), H * np.sqrt(w)[:, None]
            clock = H[:, 3] @ e / (H[:, 3] @ H[:, 3])
            return e - clock * H[:, 3], H, clock

        for _ in range(passes):
            far = np.linalg.norm(x - age[:-1, None] * v - s, axis=1)
            noise = p["beacon_error_std"] ** 2 + p["beacon_noise_std"] ** 2
            noise += max(p["range_std"], 1e-3) ** 2
            R = np.append(noise + (p["sound_speed_std"] * far) ** 2,
                          max(p["depth_std"], 1e-3) ** 2 + p["depth_bias_std"] ** 2)
            w = 1 / np.append(R + (p["prior_velocity_std"] * age) ** 2,
                              [max(clock_std, 1e-3) ** 2, near**2, near**2])
            e, H, _ = rows(x, w)
            A = H.T @ H
            N = A[:3, :3] - np.outer(A[:3, 3], A[3, :3]) / A[3, 3]
            step = np.linalg.solve(N + damping * np.diag(np.diag(N)), H[:, :3].T @ e)
            after = rows(x + step, w)[0]
            better = after @ after <= e @ e
            x, damping = x + better * step, damping * (0.01 if better else 100)
            if step @ step < 1e-14:
                break
        e, H, clock = rows(x, w)
        doubt = max(e @ e / max(len(z) - 3, 1), 1.0)
        A = H.T @ H
        own = doubt * np.linalg.inv(A[:3, :3] - np.outer(A[:3, 3], A[3, :3]) / A[3, 3])
        lean = A[:3, 3] / A[3, 3]
        P = np.zeros((4, 4))
        P[:3, :3], P[:3, 3], P[3, :3] = own, -own @ lean, -own @ lean
        P[3, 3] = 1 / A[3, 3] + lean @ own @ lean
        return SimpleNamespace(place=x, clock=clock, P=P)

    @staticmethod
    def rough(beacons: Array, z: Array, depth: float) -> Array:
        """North and east from differences of squared ranges."""
        flat = np.sqrt(np.maximum(z**2 - (depth - beacons[:, 2]) ** 2, 0))
        A = 2 * (beacons[1:, :2] - beacons[0, :2])
        squares = (beacons[:, :2] ** 2).sum(1) - flat**2
        found: Array = np.linalg.lstsq(A, squares[1:] - squares[0], rcond=None)[0]
        return found

    def output(self) -> dict[str, Any]:
        mean, P = self.mean[:6], self.P[:6, :6]
        clock, speed = self.mean[BETA], self.mean[KAPPA]
        if self.there is not None:
            share, claim = (1 / (1 + np.exp(-k * self.lead)) for k in (1, 0.4))
            there, P_there = self.there.mean[:6], self.there.P[:6, :6]
            both = (1 - share) * mean + share * there
            P = (1 - claim) * (P + np.outer(mean - both, mean - both)) + claim * (
                P_there + np.outer(there - both, there - both))
            mean = both
            clock, speed = (
                (1 - share) * self.mean[k] + share * self.there.mean[k] for k in (BETA, KAPPA))
        c0 = self.p["assumed_sound_speed"]
        return {
            "position": mean[X], "velocity": mean[V], "covariance": P,
            "clock_offset": clock / c0, "sound_speed": c0 / (1 + speed),
            "nis": self.nis, "nis_degrees": self.degrees, "restart_count": self.restarts,
        }


class Learning(Reference):
    """Filters with a density of the acceleration each, as an interacting multiple model.

    In the form of the textbooks: probabilities of the transitions between the filters, and for each
    filter a mixture of all. It knows of no turns. What a range says of all filters is the mean with
    the weights after the range.
    """

    def __init__(
        self, p: Mapping[str, Any], psds: Sequence[float], chances: Sequence[float], memory: float,
        every: float, beacons: int = 4,
    ) -> None:
        super().__init__(p, beacons)
        self.psds, self.chances = np.array(psds), np.array(chances)
        self.memory, self.every = memory, every
        self.filters = [Reference({**p, "acceleration_psd": q}, beacons) for q in psds]
        self.weights = self.shown = self.chances.copy()
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
        if self.there is not None:
            self.there.advance(epoch)

    def here(self) -> tuple[Array, Array, float]:
        self.follow()
        return super().here()

    def twin(self) -> Reference:
        return Reference({**self.p, "acceleration_psd": self.believed()}, self.count)

    def believed(self) -> float:
        """q that was shown last."""
        return float(np.exp(self.shown @ np.log(self.psds)))

    def cross(self) -> None:
        super().cross()
        self.spread()

    def spread(self) -> None:
        """All filters are where the mean is."""
        for f in self.filters:
            f.mean, f.P, f.epoch = self.mean.copy(), self.P.copy(), self.epoch
        self.weights, self.mixed = self.chances.copy(), self.epoch

    def sound(self, z: float) -> None:
        for f in self.filters:
            f.sound(z)
        self.nis += float(self.weights @ [f.nis for f in self.filters])
        self.degrees += 1
        if self.there is not None:
            self.there.sound(z)

    def hear(self, u: Mapping[str, Any], i: int, epoch: float, enough: bool) -> bool:
        self.advance(epoch)
        known, found = u["ping_beacon_position"][i], []
        about = self.filters[0].about(known, i)
        for f in self.filters:
            H, innovation, R = f.measured(u["range"][i], known, i, about)
            punctual, late = f.densities(innovation, np.sqrt(H @ f.P @ H + R))
            share = punctual / (punctual + late)
            f.learn(H, innovation, R, share)
            found.append((punctual + late, share, self.wrong(innovation, punctual, late), f.nis))
        density, *told = np.array(found).T
        if self.there is not None:
            ahead = self.there.beside(u["range"][i], known, i, about, True)
            self.lead += np.log(ahead / (self.weights @ density))
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
        self.spread()

    def tick(self, u: Mapping[str, Any]) -> None:
        """One update; then the filters are mixed, if it is time."""
        super().tick(u)
        self.follow()
        self.shown = self.weights
        if self.there is not None:
            self.there.p = {**self.p, "acceleration_psd": self.believed()}
        if not self.ready or self.epoch - self.mixed < self.every:
            return
        stay = np.exp(-(self.epoch - self.mixed) / self.memory)
        means = np.array([f.mean for f in self.filters])
        ahead, means, covariances = mixed(
            self.weights, self.chances, means, [f.P for f in self.filters], stay
        )
        for f, m, P in zip(self.filters, means, covariances, strict=True):
            f.mean, f.P = m, P
        self.weights, self.mixed = ahead, self.epoch

    def output(self) -> dict[str, Any]:
        return super().output() | {"motion_psd": self.believed()}
