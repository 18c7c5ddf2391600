"""The receiver `coupled` a second time: full matrices in NumPy, from its definitions.

Derivatives are complex steps of the plain functions, moments are sums over a grid, erfc is SciPy's,
and a start is least squares over position and clock by SciPy. Nothing is taken from the component.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from typing import Any

import numpy as np
from bank_reference import mixed
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import erfc, erfcx

Array = NDArray[np.float64]
N = 19
X, V, P_, W, G = slice(0, 3), slice(3, 6), slice(6, 8), slice(8, 10), slice(10, 12)
PSI, RATE, E_PSI, BETA, KAPPA, BIAS, SINK = range(12, 19)
J = np.array([[0.0, -1.0], [1.0, 0.0]])
_GRID = np.linspace(-10, 10, 801)
_DENSITY = np.exp(-(_GRID**2) / 2) / np.exp(-(_GRID**2) / 2).sum()


def gradient(f: Callable[[Any], Any], x: Array) -> Array:
    """Derivatives of f, which may be a column, by complex steps; a row per element of f."""
    steps = x + 1e-30j * np.eye(len(x))
    return np.stack([np.imag(f(step)) / 1e-30 for step in steps], axis=-1)


def turn(angle: Any) -> Any:
    """Rotation by an angle, (2, 2)."""
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def rotation(roll: Any, pitch: Any, yaw: Any) -> Any:
    """R_z(yaw) R_y(pitch) R_x(roll)."""
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    z = np.zeros((3, 3), dtype=np.result_type(roll, pitch, yaw, float))
    z[:2, :2], z[2, 2] = turn(yaw), 1
    return z @ np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]]) @ np.array(
        [[1, 0, 0], [0, cr, -sr], [0, sr, cr]])


def length(v: Any) -> Any:
    """Euclidean length, also of complex steps."""
    return np.sqrt((v * v).sum())


def wrapped_moments(s: float) -> tuple[float, float, float]:
    """Of an angle γ ~ N(0, s): E cos γ, Var cos γ, and what the line k γ leaves of sin γ."""
    angle = np.sqrt(s) * _GRID
    k = _DENSITY @ np.cos(angle)
    return k, _DENSITY @ (np.cos(angle) - k) ** 2, _DENSITY @ (np.sin(angle) - k * angle) ** 2


def fit(points: Array, body: Array) -> tuple[Array, Array]:
    """Position and rotation that bring body-frame points to where they are said to be."""
    s, b = points - points.mean(0), body - body.mean(0)
    inverse = np.linalg.inv(b[:, :2].T @ b[:, :2])
    e_z = np.array([0.0, 0.0, 1.0])
    for _ in range(4):
        columns = (s - np.outer(b[:, 2], e_z)).T @ b[:, :2] @ inverse
        e_x = columns[:, 0] / length(columns[:, 0])
        e_y = columns[:, 1] - e_x * (e_x @ columns[:, 1])
        e_y = e_y / length(e_y)
        e_z = np.cross(e_x, e_y)
    R = np.column_stack([e_x, e_y, e_z])
    return points.mean(0) - R @ body.mean(0), R


def punctual(p: Mapping[str, Any], nu: float, S: float) -> tuple[float, float]:
    """Probability that a range is not late, and density of the innovation."""
    chance, m = p["outlier_probability"], p["outlier_mean"]
    normal = np.exp(-(nu**2) / (2 * S))
    a = (np.sqrt(S) / m - nu / np.sqrt(S)) / np.sqrt(2)
    late = normal * erfcx(a) if a > 0 else np.exp(S / (2 * m**2) - nu / m) * erfc(a)
    inside = (1 - chance) * normal / np.sqrt(2 * np.pi * S)
    density = inside + chance / (2 * m) * late + 1e-4 / 50
    return float(inside / density), float(density)


def retracted(mean: Array, d: Any) -> Any:
    """The correction d taken along the arc about the platform."""
    y = mean[:2] - mean[P_]
    radius = length(y)
    e_r = y / radius
    e_t = J @ e_r
    d_y = d[:2] - d[P_]
    out, angle = e_r @ d_y, e_t @ d_y / radius
    M = turn(angle)
    result = mean + d
    result[:2] = mean[P_] + d[P_] + M @ (y + out * e_r)
    result[3:5] = M @ (mean[3:5] + d[3:5] - angle * (J @ mean[3:5]))
    return result


def retract(mean: Array, P: Array, d: Array) -> tuple[Array, Array]:
    """Mean and covariance after the correction d."""
    y = mean[:2] - mean[P_]
    radius = length(y)
    d_y = d[:2] - d[P_]
    if radius <= 1 or y @ d_y / radius <= -radius / 2 or abs((J @ y) @ d_y) / radius**2 >= 1:
        return mean + d, P
    A = gradient(lambda d: retracted(mean, d), d)
    return retracted(mean, d), A @ P @ A.T


class Beside:
    """What is filtered beside the state: a − C x + error, with states x and variance V."""

    def __init__(self, size: int, std: float, time: float) -> None:
        self.a, self.C, self.V = np.zeros(size), np.zeros((size, N)), std**2
        self.std, self.time = std, time

    def at(self, x: Any) -> Any:
        return self.a - self.C @ x

    def predict(self, dt: float, change: Array, drift: Callable[[Array], float]) -> None:
        """The state changes by `change`; C x by that and something of variance drift(C)."""
        left = np.exp(-dt / self.time)
        self.C = left * self.C
        self.a = left * self.a + self.C @ change
        self.V = left**2 * self.V + drift(self.C) + self.std**2 * (1 - left**2)

    def innovation(
        self, x: Array, off: Array, H: Array, lever: float, R: Array
    ) -> tuple[Array, Array, Array]:
        """Of measurements H x + lever times this, `off` from H x: what it says of the state."""
        return off - lever * self.at(x), H - lever * self.C, R + lever**2 * self.V

    def update(self, x: Array, off: Array, H: Array, lever: float, R: float) -> None:
        gain = lever * self.V / (lever**2 * self.V + R)
        at = self.at(x) + gain * (off - lever * self.at(x))
        self.C = self.C + gain * (H - lever * self.C)
        self.a = at + self.C @ x
        self.V *= 1 - gain * lever


class Reference:
    """One receiver; `tick` takes its inputs, attributes are its outputs."""

    def __init__(self, p: Mapping[str, Any]) -> None:
        self.p = p
        self.ready = p["initialisation"] == 2
        self.located, self.score, self.restarts, self.updates = False, 0.0, 0, 0
        self.density = 1.0
        self.nis, self.degrees, self.epoch, self.depth_epoch = 0.0, 0, 0.0, 0.0
        self.counts = np.zeros(4)
        self.down, self.pose_epoch = 0.0, 0.0
        self.heave = Beside(1, p["heave_std"], p["heave_time"])
        self.swing = Beside(2, p["tilt_std"], p["tilt_time"])
        self.lead: Reference = self  # whose heave and swing these are
        self.before = (self.heave, self.swing)
        self.angle, self.sounded = 0.0, -1.0
        self.arm = np.zeros((4, 3))
        self.own, self.own_P, self.own_count = np.zeros(4), np.diag([0.0, 0.0, 0.5, 0.5]), 0
        self.mean = np.zeros(N)
        self.mean[X], self.mean[V] = p["prior_position"], p["prior_velocity"]
        std = np.zeros(N)
        std[X], std[V] = p["prior_position_std"], p["prior_velocity_std"]
        std[W], std[G] = p["platform_velocity_std"], p["gps_markov_std"]
        std[[RATE, E_PSI, BETA, KAPPA, BIAS, SINK]] = [
            p[f"{name}_std"] for name in
            ("heading_rate", "imu_heading_error", "clock", "sound_speed", "depth_bias",
             "gps_vertical_error")
        ]
        self.P = np.diag(std**2)

    def tick(self, u: Mapping[str, Any]) -> None:
        """One update with what is new on the inputs."""
        queue = [(u["range_epoch"][i], 1 + i)
                 for i in np.flatnonzero(u["reception_count"] != self.counts)]
        if u["depth_epoch"] != self.depth_epoch:
            queue.append((u["depth_epoch"], 0))
        self.counts, self.depth_epoch = u["reception_count"], u["depth_epoch"]
        if not queue:
            return
        enough = (self.counts > 0).sum() >= 3 and self.depth_epoch > 0
        fix = False
        if self.ready:
            self.nis, self.degrees = 0.0, 0
        using = self.ready
        queue.sort()
        for n, (epoch, which) in enumerate(queue):
            self.sample(u, epoch, which, using)
            if n + 1 < len(queue) and which == 0 and queue[n + 1][0] == epoch:
                continue  # a depth and a packet are one
            if using and enough and self.located and (self.score > 12 or self.too_fast()):
                self.score, using, fix = 0.0, False, True
                self.restarts += 1
            if using and self.located:
                self.sampled()
        if enough and self.located and not self.ready:
            self.ready = fix = True
        self.updates += self.ready
        if fix:
            self.anew(u)

    def sample(self, u: Mapping[str, Any], epoch: float, which: int, using: bool) -> None:
        """Take a sample: the depth, or the packet of a beacon, counted from 1."""
        self.predict(max(epoch - self.epoch, 0.0))
        self.epoch = max(epoch, self.epoch)
        if which == 0 or self.sounded != epoch:  # a depth and a packet are one
            self.angle = self.mean[PSI] + self.mean[E_PSI]
        self.sounded = epoch if which == 0 else -1.0
        if which:
            self.packet(u, which - 1, using)
        elif using:
            self.depth(u["depth"])

    def too_fast(self) -> bool:
        """Whether the estimate is not credible."""
        return bool(length(self.mean[V]) > self.p["speed_limit"])

    def sampled(self) -> None:
        """A sample has been used."""

    def predict(self, dt: float) -> None:
        """Propagate by dt."""
        F, Q = self.transition(dt)
        change = F @ self.mean - self.mean
        self.mean = self.mean + change
        self.P = F @ self.P @ F.T + Q

        p = self.p

        def far(rate: str) -> float:  # of a rate that is a Gauss-Markov process
            std, tau = p[f"{rate}_std"], p[f"{rate}_time"]
            return float(2 * std**2 * tau**2 * (dt / tau - 1 + np.exp(-dt / tau)))

        def off(std: str, tau: str) -> float:
            return float(2 * p[std] ** 2 * (1 - np.exp(-dt / p[tau])))

        turned = far("heading_rate") + off("imu_heading_error_std", "imu_heading_error_time")
        went = far("platform_velocity") + off("gps_markov_std", "gps_correlation_time")
        sank = off("gps_vertical_error_std", "gps_vertical_error_time")
        if self.lead is self:
            self.heave.predict(dt, change, lambda C: sank * C[0, SINK] ** 2)
            self.swing.predict(
                dt, change, lambda C: went * C[0, 6] ** 2 + turned * (C[:, PSI] @ C[:, PSI]) / 2
            )
            self.before = copy(self.heave), copy(self.swing)
        else:
            self.before, self.heave, self.swing = (
                self.lead.before, self.lead.heave, self.lead.swing
            )
        keep = np.exp(-turned / 2)
        F = np.diag([1, 1, keep, keep])
        self.own = F @ self.own
        self.own_P = F @ self.own_P @ F + np.diag([went, went, *[0.5 * (1 - keep**2)] * 2])

    def own_place(self, z: Array, b: Array) -> None:
        """Where a beacon said it was: of (p + g, cos, sin), linear."""
        H = np.array([[1, 0, b[0], -b[1]], [0, 1, b[1], b[0]]])
        R = (max(self.p["gps_std"], 0.01) ** 2 + (b[2] * self.p["tilt_std"]) ** 2) * np.eye(2)
        if self.own_count == 0:  # nothing is known of the place: it is z less the rest
            T = np.vstack([np.hstack([np.zeros((2, 2)), -H[:, 2:]]), np.eye(4)[2:]])
            self.own = T @ self.own
            self.own[:2] += z
            self.own_P = T @ self.own_P @ T.T
            self.own_P[:2, :2] += R
        else:
            K = self.own_P @ H.T @ np.linalg.inv(H @ self.own_P @ H.T + R)
            self.own = self.own + K @ (z - H @ self.own)
            rest = np.eye(4) - K @ H
            self.own_P = rest @ self.own_P @ rest.T + K @ R @ K.T
        self.own_count += 1

    def transition(self, dt: float) -> tuple[Array, Array]:
        """Phi and Q."""
        p, F, Q = self.p, np.eye(N), np.zeros((N, N))
        q = p["acceleration_psd"]
        for i in range(3):
            pair = np.ix_([i, i + 3], [i, i + 3])
            F[pair] = [[1, dt], [0, 1]]
            Q[pair] = q * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        for pairs, std, tau in (
            ([(6, 8), (7, 9)], p["platform_velocity_std"], p["platform_velocity_time"]),
            ([(PSI, RATE)], p["heading_rate_std"], p["heading_rate_time"]),
        ):
            a = np.exp(-dt / tau)
            noise = 2 * std**2 / tau
            corner = noise * tau**2 * (dt - 2 * tau * (1 - a) + tau * (1 - a**2) / 2)
            side = noise * tau**2 * (1 - 2 * a + a**2) / 2
            for pair in pairs:
                F[np.ix_(pair, pair)] = [[1, tau * (1 - a)], [0, a]]
                Q[np.ix_(pair, pair)] = [[corner, side], [side, noise * tau * (1 - a**2) / 2]]
        for states, std, tau in (
            ((10, 11), p["gps_markov_std"], p["gps_correlation_time"]),
            ((E_PSI,), p["imu_heading_error_std"], p["imu_heading_error_time"]),
            ((SINK,), p["gps_vertical_error_std"], p["gps_vertical_error_time"]),
        ):
            for i in states:
                F[i, i] = np.exp(-dt / tau)
                Q[i, i] = std**2 * (1 - F[i, i] ** 2)
        Q[BETA, BETA] = p["clock_walk_psd"] * dt
        return F, Q

    def correct(self, d: Array) -> None:
        """Take the correction d, which P has already seen."""
        self.mean, self.P = retract(self.mean, self.P, d)

    def update(self, nu: float, H: Array, R: float, weight: float = 1.0) -> tuple[Array, float]:
        """A scalar update that is true with probability ``weight``: correction and NIS."""
        c = self.P @ H
        S = H @ c + R
        K = c / S
        self.P = self.P - weight * S * np.outer(K, K)
        self.P += weight * (1 - weight) * nu**2 * np.outer(K, K)
        return weight * nu * K, weight * nu**2 / S

    def depth(self, z: float) -> None:
        """A reading of the depth sensor."""
        H = np.zeros(N)
        H[[2, BIAS]] = 1
        d, nis = self.update(z - H @ self.mean, H, max(self.p["depth_std"], 1e-3) ** 2)
        self.mean = self.mean + d
        self.nis += nis
        self.degrees += 1

    def packet(self, u: Mapping[str, Any], i: int, using: bool) -> None:
        """The packet of a beacon: its pose or place, then its range."""
        p = self.p
        newest = u["range_epoch"][i] == u["range_epoch"].max()
        body, own = p["beacon_offset"][i], u["ping_beacon_position"][i]
        self.own_place(own[:2], body)
        source, attitude, variance, enough = p["pose_source"], None, 0.0, True
        if source == 1 and (u["ping_platform_position"][i].any()
                            or u["ping_platform_attitude"][i].any()):
            position, attitude = u["ping_platform_position"][i], u["ping_platform_attitude"][i]
        elif source != 3 and newest:
            position, R = fit(u["packet_beacon_position"], p["beacon_offset"])
            attitude = angles(R)
        first = attitude
        if attitude is None:
            variance = self.own_P[2, 2] / max(length(self.own[2:]), 1e-6)
            enough = variance < 0.1 or self.own_count >= 12
            variance = min(variance, np.pi**2 / 3)
            position, first = self.own[:2], [0, 0, np.arctan2(self.own[3], self.own[2])]
        if not self.located and enough:
            self.located = True
            states = [6, 7, PSI]
            self.mean[states] = [*position[:2], first[2]]
            self.angle = first[2]
            self.P[states, :] = self.P[:, states] = 0
            self.P[states, states] = [900, 900, 100]
            if attitude is None:  # ψ + e_ψ is what they say
                self.mean[PSI] -= self.mean[E_PSI]
                self.P[PSI, PSI] = variance + self.P[E_PSI, E_PSI]
                self.P[PSI, E_PSI] = self.P[E_PSI, PSI] = -self.P[E_PSI, E_PSI]
        own_square, white = p["tilt_std"] ** 2, p["imu_tilt_std"] ** 2
        fresh = attitude is None or u["range_epoch"][i] != self.pose_epoch
        if attitude is None:
            self.down, roll, pitch, tilt_variance = own[2] - body[2], 0.0, 0.0, 0.0
            self.floated((own_square + white) * (body[:2] @ body[:2]))
        else:
            trust = own_square / (own_square + white) if own_square else 0.0
            self.down, tilt_variance = position[2], trust * white
            roll, pitch = trust * attitude[0], trust * attitude[1]
            if fresh:
                self.floated(0.0)
        self.arm[i] = rotation(roll, pitch, 0.0) @ body
        if not self.located:
            self.pose_epoch = u["range_epoch"][i]
            return
        if attitude is None:
            self.place(own[:2], body, variance)
        elif fresh:
            self.pose(position, attitude[2])
        self.pose_epoch = u["range_epoch"][i]
        if using:
            lever = body[2] if attitude is None else 0.0
            self.range(u["range"][i], body, (roll, pitch), tilt_variance, lever, attitude is None)

    def floated(self, variance: Any) -> None:
        """A reported depth of the platform; of the state it corrects its slow error alone."""
        H = np.zeros((1, N))
        H[0, SINK] = 1
        off = self.down - H @ self.mean
        R = np.array([max(self.p["gps_vertical_std"], 1e-3) ** 2 + variance])
        nu, across, S = self.before[0].innovation(self.mean, off, H, 1.0, R)
        slope, before = across[0, SINK], self.mean
        gain = np.zeros(N)
        gain[SINK] = self.P[SINK, SINK] * slope / (slope**2 * self.P[SINK, SINK] + S[0])
        self.partly(gain, across[0], nu[0], S[0])
        if self.lead is self:
            self.heave.update(before, off, H, 1.0, R[0])

    def partly(self, gain: Array, H: Array, nu: float, R: float) -> None:
        """A scalar update with any gain."""
        rest = np.eye(N) - np.outer(gain, H)
        self.mean = self.mean + gain * nu
        self.P = rest @ self.P @ rest.T + R * np.outer(gain, gain)

    def pose(self, position: Array, heading: float) -> None:
        """A reported position and heading: linear, so that one correction is all three."""
        R = max(self.p["gps_std"], 0.01) ** 2
        H = np.zeros((3, N))
        H[0, [6, 10]] = H[1, [7, 11]] = H[2, [PSI, E_PSI]] = 1
        z = np.array([*position[:2], heading]) - H @ self.mean
        z[2] = (z[2] + np.pi) % (2 * np.pi) - np.pi
        self.batch(z, H, np.diag([R, R, max(self.p["imu_heading_std"], 1e-3) ** 2]))

    def place(self, place: Array, body: Array, variance: float) -> None:
        """A reported place of a beacon. `variance`: of the heading, from own positions alone."""
        spread = self.P[np.ix_([PSI, E_PSI], [PSI, E_PSI])].sum()
        value, H, R = self.seen(self.mean, body, spread)
        nu, along, S = self.before[1].innovation(self.mean, place - value, H, body[2], R)
        self.batch(nu, along, np.diag(S))
        if self.lead is self:
            at = np.zeros(N)
            at[PSI] = self.angle
            value, H, R = self.seen(at, body, variance)
            self.swing.update(at, place - value, H, body[2], R.mean())

    def seen(self, x: Array, body: Array, spread: float) -> tuple[Array, Array, Array]:
        """North and east of a beacon without swing: the best line over the heading's spread."""
        k, by_cos, by_sin = wrapped_moments(spread)
        arm = turn(x[PSI] + x[E_PSI]) @ body[:2]

        def h(x: Any) -> Any:
            return x[P_] + x[G] + k * (turn(x[PSI] + x[E_PSI]) @ body[:2])

        R = max(self.p["gps_std"], 0.01) ** 2 + (body[2] * self.p["imu_tilt_std"]) ** 2
        return h(x), gradient(h, x), R + by_cos * arm**2 + by_sin * (J @ arm) ** 2

    def batch(self, z: Array, H: Array, R: Array) -> None:
        """A linear update with several measurements at once."""
        K = np.linalg.solve(H @ self.P @ H.T + R, H @ self.P).T
        rest = np.eye(N) - K @ H
        self.P = rest @ self.P @ rest.T + K @ R @ K.T
        self.correct(K @ z)

    def range(
        self, z: float, body: Array, tilt: tuple[float, float], tilt_variance: float, lever: float,
        own: bool,
    ) -> None:
        """A range, over the spread of bearing, heading and distance."""
        p, mean, P, (roll, pitch) = self.p, self.mean, self.P, tilt

        def h(x: Any, roll: Any = roll, pitch: Any = pitch) -> Any:
            s = rotation(roll, pitch, x[PSI]) @ body
            s[:2] += x[P_] + lever * self.swing.at(x)
            s[2] += self.down - x[SINK]
            return (1 + x[KAPPA]) * length(x[X] - s) + x[BETA]

        H = gradient(h, mean)
        by_tilt = gradient(lambda a: h(mean.astype(complex), a[0], a[1]), np.array([roll, pitch]))
        R = max(p["range_std"], 1e-3) ** 2 + tilt_variance * (by_tilt @ by_tilt)
        R += H[2] ** 2 * p["gps_vertical_std"] ** 2
        R += H[:2] @ H[:2] * lever**2 * self.swing.V
        R += own * H[2] ** 2 * (body[:2] @ body[:2]) * p["imu_tilt_std"] ** 2
        value = h(mean)
        y = mean[:2] - mean[P_]
        radius = length(y)
        if radius > 1:
            e_t = J @ y / radius
            D = np.zeros((2, N))
            D[:, :2], D[:, P_] = np.eye(2), -np.eye(2)
            bearing = e_t @ D / radius
            spread = np.zeros(N)
            spread[PSI] = 1
            turned = min(max((bearing - spread) @ P @ (bearing - spread) - P[PSI, PSI], 0), 2)
            k, by_cos, by_sin = wrapped_moments(P[PSI, PSI])
            rho = (value - mean[BETA]) / (1 + mean[KAPPA])
            arm = y @ (rotation(roll, pitch, mean[PSI]) @ body)[:2] / rho
            first = (H[:2] @ e_t) * radius
            second = 0.5 * (k * arm - first**2 / rho) * turned
            out = (y / radius) @ D @ P @ D.T @ (y / radius)
            center = np.array([*mean[P_], self.down - mean[SINK]])

            def further(r: float, beacon: Array) -> float:
                place = np.array([*(mean[P_] + r * y / radius), mean[2]])
                return (1 + mean[KAPPA]) * float(np.linalg.norm(place - beacon))

            beacon = center + rotation(roll, pitch, mean[PSI]) @ body
            beacon[:2] += lever * self.swing.at(mean)
            stencil = {-2: -1, -1: 16, 0: -30, 1: 16, 2: -1}  # of second derivatives
            bend = [
                sum(n * further(radius + 0.05 * k, s) for k, n in stencil.items()) / (12 * 0.05**2)
                for s in (beacon, center)
            ]
            # What a range tells of the distance, if nothing is known of the clock but its prior.
            row = np.zeros(N)
            row[:2] = (H[:2] @ y / radius) * y / radius
            row[P_], row[BETA] = -row[:2], 1
            tells = (y / radius) @ D @ P @ row
            flat = 0.5 * (bend[0] - bend[1]) * max(out - tells**2 / (row @ P @ row + R), 0.0)
            H[PSI] *= k
            H -= (1 - k) * first * bearing
            value += (1 - k) * arm + second + flat
            R += by_cos * arm**2 + by_sin * first**2 + 2 * second**2 + 2 * flat**2
        nu = z - value
        share, self.density = punctual(p, nu, H @ P @ H + R)
        d, nis = self.update(nu, H, R, share)
        self.correct(d)
        self.nis += nis
        self.heard(share, (1 - share) * (nu < 0))

    def heard(self, share: float, short: float) -> None:
        """Count a range that is punctual with this probability, or too short with this one."""
        self.degrees += share > 0.5
        evidence = np.log(0.9 / max(self.p["outlier_probability"], 0.01))
        self.score = max(0.0, self.score + (1 - share) * evidence - 1.1 * share + 8 * short)

    def anew(self, u: Mapping[str, Any]) -> None:
        """A fix from the newest receptions: least squares over position and clock."""
        p, mean = self.p, self.mean
        heard = np.flatnonzero(self.counts)
        newest = max(u["range_epoch"].max(), u["depth_epoch"])
        age = newest - u["range_epoch"][heard]
        center = np.array([*mean[P_], self.down - mean[SINK]])
        beacons = center + self.arm[heard] @ rotation(0.0, 0.0, mean[PSI]).T
        beacons[:, :2] -= age[:, None] * mean[W]
        z = u["range"][heard]
        moved = p["prior_velocity_std"] * np.append(age, newest - u["depth_epoch"])
        together = (moved[:-1] < p["range_std"]).sum() >= 3
        late = 2 * p["outlier_probability"] * p["outlier_mean"] ** 2 * together
        variances = np.append(np.full(len(heard), max(p["range_std"], 1e-3) ** 2 + late),
                              max(p["depth_std"], 1e-3) ** 2 + p["depth_bias_std"] ** 2) + moved**2
        x = np.append(closed_form(beacons, z, u["depth"]), 0.0)

        for _ in range(20):  # the clock's prior depends on the distance
            ahead = length(x[:3] - center)
            offset = p["clock_std"] ** 2 + (p["sound_speed_std"] * ahead) ** 2 + 1e-6
            scales = np.sqrt(np.concatenate([variances, [offset, 900, 900]]))

            def residuals(x: Any, scales: Array = scales) -> Any:
                predicted = [length(x[:3] - s) + x[3] for s in beacons]
                return (np.array([*z, u["depth"], 0, *center[:2]])
                        - np.array([*predicted, x[2], x[3], x[0], x[1]])) / scales

            x = least_squares(residuals, x, jac=lambda x: gradient(residuals, x), method="lm",
                              xtol=1e-15, ftol=1e-15, gtol=1e-15).x
        x = self.outward(x, center, offset, residuals)
        rows = gradient(residuals, x)
        information = rows.T @ rows
        cost = (residuals(x) ** 2).sum()
        near = np.diag([1 / 900, 1 / 900, 0])
        with_clock = information[:3, 3] / information[3, 3]
        alone = information[:3, :3] - np.outer(with_clock, information[:3, 3]) - near
        doubt = max(1.0, cost / max(len(heard) - 2, 1))
        own = np.linalg.inv(alone / doubt + near)
        gain = np.array([p["clock_std"] ** 2, p["sound_speed_std"] ** 2 * ahead]) / offset
        common = (with_clock, 1 / information[3, 3], offset, gain)
        # By an error of 1 m of the platform's depth: the ranges alone see it.
        ranges = rows[: len(heard)]
        seen = ranges[:, :3].T @ ranges[:, 2] - with_clock * (ranges[:, 3] @ ranges[:, 2])
        self.join(x, own, common, 1 / variances[-1] / doubt, -own @ seen / doubt)

    @staticmethod
    def outward(x: Array, center: Array, offset: float, residuals: Any) -> Array:
        """The fix, or one that is as far as the priors have the diver in half of the cases."""
        least = min(0.6745 / np.sqrt(1 / offset + 1 / 900), 50.0)
        away = x[:2] - center[:2]
        if np.linalg.norm(away) >= least:
            return x
        there = x.copy()
        there[:2] = center[:2] + least * away / np.linalg.norm(away)
        # The clock fits there, too: the residuals are linear in it.
        slope, rest = gradient(residuals, there)[:, 3], residuals(there)
        there[3] -= slope @ rest / (slope @ slope)
        fits = (residuals(there) ** 2).sum() < (residuals(x) ** 2).sum() + 9
        return there if fits else x

    def join(
        self, x: Array, own: Array, common: tuple[Array, float, float, Array],
        depth_weight: float, sunk: Array,
    ) -> None:
        """Mean and covariance: errors of the diver are those of the fix and of the platform."""
        lean, alone, offset, gain = common
        p, fresh = self.p, [0, 1, 2, 3, 4, 5, BETA, KAPPA, BIAS, SINK]
        y = x[:2] - self.mean[P_]
        sunk_variance = self.P[SINK, SINK]
        bias = p["depth_bias_std"] ** 2
        # Independent parts: fix without the bias, bias, what the offset has alone, v, platform.
        T = np.eye(N)
        T[fresh] = 0
        T[:2, P_] = np.eye(2)
        T[:2, PSI] = J @ y
        self.P[fresh, :] = self.P[:, fresh] = 0
        self.P = T @ self.P @ T.T
        through = np.zeros(N)  # by an error of 1 m of the bias
        through[X] = -own[:, 2] * depth_weight
        through[[BETA, KAPPA]] = -gain * (lean @ through[X])
        through[BIAS] = 1
        fixed = np.zeros((N, 3))
        fixed[X] = np.eye(3)
        fixed[[BETA, KAPPA]] = -np.outer(gain, lean)
        rest = own - bias * np.outer(through[X], through[X])
        self.P += fixed @ rest @ fixed.T + bias * np.outer(through, through)
        sinking = np.zeros(N)
        sinking[X], sinking[SINK] = sunk, 1
        sinking[[BETA, KAPPA]] = -gain * (lean @ sunk + lean[2])
        self.P += sunk_variance * np.outer(sinking, sinking)
        # Clock and speed: what the offset tells of them, and what it does not.
        both = np.ix_([BETA, KAPPA], [BETA, KAPPA])
        prior = np.diag([p["clock_std"] ** 2, p["sound_speed_std"] ** 2])
        self.P[both] += alone * np.outer(gain, gain) + prior - offset * np.outer(gain, gain)
        self.P[V, V] += p["prior_velocity_std"] ** 2 * np.eye(3)
        self.mean[fresh[:-1]] = 0
        self.mean[X], self.mean[[BETA, KAPPA]] = x[:3], gain * x[3]
        self.nis, self.degrees = 0.0, 0

    def output(self) -> dict[str, Any]:
        """Outputs: the moments of the banana, in the order of the ports."""
        p, mean, P = self.p, self.mean.copy(), self.P.copy()
        y = mean[:2] - mean[P_]
        radius = length(y)
        if radius > 1:
            e_r = y / radius
            e_t = J @ e_r
            P_yy = P[:2, :2] - P[:2, P_] - P[P_, :2] + P[P_, P_]
            bearing = min(e_t @ P_yy @ e_t / radius**2, 2)
            s = bearing * np.clip(1 - e_r @ P_yy @ e_r / (bearing * radius**2), 0, 1)
            c, sn = np.cos(np.sqrt(s) * _GRID), np.sin(np.sqrt(s) * _GRID)
            along, across = _DENSITY @ (c - _DENSITY @ c) ** 2, _DENSITY @ sn**2 - s
            mean[:2] = mean[P_] + y * (_DENSITY @ c)
            P[:2, :2] += radius**2 * (along * np.outer(e_r, e_r) + across * np.outer(e_t, e_t))
        D = np.zeros((3, N))
        D[:, X], D[:2, P_] = np.eye(3), -np.eye(2)
        D[2] += self.heave.C[0]
        relative = D @ P @ D.T
        relative[2, 2] += self.heave.V
        P[:2, :2] += p["gps_bias_std"] ** 2 * np.eye(2)
        order = [0, 3, 1, 4, 2, 5]
        platform = np.array([*mean[P_], *self.heave.at(mean)])
        return {
            "epoch": self.epoch, "update_count": self.updates,
            "position": mean[X], "velocity": mean[V], "covariance": P[np.ix_(order, order)],
            "platform_position": platform, "relative_position": mean[X] - platform,
            "relative_covariance": relative,
            "clock_offset": mean[BETA] / p["assumed_sound_speed"],
            "sound_speed": p["assumed_sound_speed"] / (1 + mean[KAPPA]),
            "restart_count": self.restarts, "nis": self.nis, "nis_degrees": self.degrees,
        }


def angles(R: Array) -> Array:
    """Roll, pitch, yaw of a rotation."""
    return np.array([np.arctan2(R[2, 1], R[2, 2]), -np.arcsin(R[2, 0]),
                     np.arctan2(R[1, 0], R[0, 0])])


def closed_form(beacons: Array, z: Array, depth: float) -> Array:
    """A position from differences of squared ranges, at a depth."""
    mean = beacons.mean(0)
    q = beacons - mean
    right = ((q**2).sum(1) - z**2) / 2 - q[:, 2] * (depth - mean[2])
    horizontal = np.linalg.lstsq(q[:, :2].T @ q[:, :2], q[:, :2].T @ right, rcond=None)[0]
    return np.array([*(mean[:2] + horizontal), depth])


class Learning(Reference):
    """Filters with a density of the acceleration each, as an interacting multiple model.

    In the form of the textbooks: probabilities of the transitions between the filters, and for each
    filter a mixture of all. It is one receiver: `Reference` has what the filters share.
    """

    def __init__(
        self, p: Mapping[str, Any], psds: Sequence[float], chances: Sequence[float], memory: float,
        every: float,
    ) -> None:
        super().__init__(p)
        self.psds, self.chances = np.array(psds), np.array(chances)
        self.memory, self.every = memory, every
        self.filters = [_Filter({**p, "acceleration_psd": q}) for q in psds]
        for f in self.filters:
            f.lead = self.filters[0]
        self.weights = self.chances.copy()
        self.mixed = 0.0
        self.follow()

    def follow(self) -> None:
        """Take the moments of the mixture."""
        self.mean = np.einsum("k,ki->i", self.weights, [f.mean for f in self.filters])
        self.P = sum(
            w * (f.P + np.outer(f.mean - self.mean, f.mean - self.mean))
            for w, f in zip(self.weights, self.filters, strict=True)
        )

    def sample(self, u: Mapping[str, Any], epoch: float, which: int, using: bool) -> None:
        """All filters take it; their ranges weigh them."""
        self.epoch = max(epoch, self.epoch)
        for f in self.filters:
            f.density, f.shares, f.nis = 1.0, (0.0, 0.0), 0.0
            f.sample(u, epoch, which, using)
        first = self.filters[0]
        self.located, self.arm, self.down = first.located, first.arm, first.down
        self.heave = first.heave
        parts = self.weights
        self.nis += float(parts @ [f.nis for f in self.filters])
        self.degrees += using * (which == 0)
        if which and using and self.located:
            share, short = (float(v) for v in parts @ [f.shares for f in self.filters])
            self.heard(share, short)
        self.weights = parts * [f.density for f in self.filters]
        self.weights /= self.weights.sum()

    def too_fast(self) -> bool:
        """Whether more than half of the weight is."""
        return bool(self.weights @ [float(f.too_fast()) for f in self.filters] > 0.5)

    def tick(self, u: Mapping[str, Any]) -> None:
        """One update; then the filters are mixed, if it is time."""
        super().tick(u)
        self.follow()
        self.shown = self.weights
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

    def anew(self, u: Mapping[str, Any]) -> None:
        """A fix of the first filter, and all others begin there."""
        first = self.filters[0]
        first.counts, first.depth_epoch = self.counts, self.depth_epoch
        first.anew(u)
        for f in self.filters:
            f.mean, f.P, f.ready = first.mean.copy(), first.P.copy(), True
        self.weights = self.chances.copy()
        self.nis, self.degrees, self.mixed = 0.0, 0, self.epoch

    def output(self) -> dict[str, Any]:
        """Outputs of the mixture, and what it believes."""
        return super().output() | {"motion_psd": float(np.exp(self.shown @ np.log(self.psds)))}


class _Filter(Reference):
    """One of them: it only says what it makes of a range."""

    def heard(self, share: float, short: float) -> None:
        self.shares = (share, short)
