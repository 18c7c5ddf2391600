"""The study's simulations in NumPy, all runs of a batch at once, tuned hard.

Scenario 1 of the paper in the preset ``paper-literal`` (see the shipped ``paper-scenario-1.toml``),
with the factors of the paper's Table 3 different in each run and one sampling time per call.
Nothing here uses sblcosim.

The runs are the last axis of arrays, so that each operation works on contiguous memory. Quantities
that do not depend on the filter (noise, attitude, beacons, ranges) are computed for several
sampling instants at once. NED frame, SI units, angles in rad.

Run by hand: ``python benchmarks/competitors/numpy_study.py --runs 4096 --sampling-time 0.1``
"""

from __future__ import annotations

import argparse
import itertools
import time
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Factors = Mapping[str, Floats]
"""Arrays (N,) by the names of `FACTORS`, in SI units."""

Simulate = Callable[[float, np.random.Generator, Factors], Floats]

FACTORS = {
    "loss_probability": (0.0, 0.25),
    "baseline": (3.0, 0.4),
    "gps_std": (0.1, 3.5),
    "imu_std": (np.radians(1.0), np.radians(10.0)),
    "depth_std": (0.01, 0.1),
    "range_std": (0.1, 1.0),
}
"""The paper's Table 3 without the sampling time; the level with the smaller error first."""

RADIUS, DEPTH, SPEED = 15.0, 5.0, 0.5
BEACON_DEPTH = 0.5
WAVE_AMPLITUDE = np.radians([5.0, 5.0, 5.0])
WAVE_FREQUENCY = np.array([0.30, 0.25, 0.05])
Q = 0.01

BATCH = 2000
"""Maximum number of runs simulated at once. The time per run is flat from 1500 to 2000: with fewer
runs the calls cost more, with more the arrays leave the cache. A multiple of 16, see `simulate`."""
BLOCK = 4
"""Sampling instants whose noise and ranges are computed at once; a multiple of the beacons."""


def target(t: Floats) -> Floats:
    """True positions on the semicircle, (..., 3)."""
    angle = SPEED * t / RADIUS
    return np.stack(
        [RADIUS * np.cos(angle), RADIUS * np.sin(angle), np.full_like(angle, DEPTH)], axis=-1
    )


def epochs(sampling_time: float, length: float = np.pi * RADIUS) -> int:
    """Number of estimates in a run along a path of some length: at T, 2T, ...

    As in sblcosim, the last two samples of a run come too late: one for the filter, which at an
    instant sees what was sampled before, and one because its result becomes visible an interval
    later.
    """
    return int(length / SPEED / sampling_time) - 2


def simulate(
    sampling_time: float, rng: np.random.Generator, factors: Factors, path: Floats | None = None
) -> Floats:
    """Simulate one run per element of the factors' arrays, all at once.

    Parameters
    ----------
    path
        True positions at 0, T, 2T, ... instead of the semicircle's, (epochs + 1, 3, N).

    Returns
    -------
    RMS over the run of the errors in x, y, z and of the total error in m, (4, N).
    """
    # NumPy copies arrays that broadcast or are not contiguous through a buffer, unless it is as
    # long as a row; its length must be a multiple of 16.
    N = len(factors["baseline"])
    usual = np.setbufsize(-(-N // 16) * 16)
    try:
        return _simulate(sampling_time, rng, factors, path)
    finally:
        np.setbufsize(usual)


def _simulate(
    sampling_time: float, rng: np.random.Generator, factors: Factors, path: Floats | None
) -> Floats:
    N = len(factors["baseline"])
    if path is None:
        path = target(sampling_time * np.arange(epochs(sampling_time) + 1.0))[:, :, None]
    steps, truth = len(path) - 1, path[1:]
    t = sampling_time * np.arange(1, steps + 1, dtype=np.float64)
    waves = _Surroundings(t, truth, rng, factors)
    ekf = _Filter(
        sampling_time, path[0], factors["range_std"], factors["depth_std"]
    )

    z = np.zeros((4, N))
    error, squares = np.empty((3, N)), np.zeros((3, N))
    for first in range(0, steps, BLOCK):
        n = min(BLOCK, steps - first)
        reported, ranges, depths, received = waves.sample(first, n)
        for k in range(n):
            turn = k % 4
            where = received[k] if waves.lossy else True
            np.copyto(z[turn], ranges[k], where=where)
            if not ekf.all_heard:
                ekf.hear(turn, where)
            ekf.predict()
            ekf.update(z, depths[k], reported[k])
            np.subtract(ekf.position, truth[first + k], out=error)
            np.multiply(error, error, out=error)
            squares += error
    squares /= steps
    rms: Floats = np.sqrt(np.concatenate([squares, squares.sum(axis=0, keepdims=True)]))
    return rms


class _Surroundings:
    """Platform, ranges and depth sensor."""

    def __init__(
        self, t: Floats, truth: Floats, rng: np.random.Generator, factors: Factors
    ) -> None:
        self.truth, self.rng, self.loss = truth, rng, factors["loss_probability"]
        self.lossy = bool(self.loss.any())
        N = self.loss.size
        # A sin(2 pi f t + phase) = sin(2 pi f t) (A cos phase) + cos(2 pi f t) (A sin phase):
        # sines of the time are the same in all runs.
        # Angles are halved, because the tangent of the half gives sine and cosine.
        phase = rng.uniform(0.0, 2 * np.pi, (3, N))
        argument = 2 * np.pi * t[:, None] * WAVE_FREQUENCY
        self.wave = np.sin(argument)[:, :, None], np.cos(argument)[:, :, None]
        half = WAVE_AMPLITUDE[:, None] / 2
        self.amplitude = half * np.cos(phase), half * np.sin(phase)
        self.pose_std = np.stack([*[factors["imu_std"] / 2] * 3, *[factors["gps_std"]] * 2])
        self.sensor_std = np.stack([factors["range_std"], factors["depth_std"]])
        arm = factors["baseline"]
        self.lever = np.stack([np.full(N, BEACON_DEPTH), arm, arm])[:, None]
        self.noise = np.empty((BLOCK, 7, N))
        self.pose, self.last_packet = np.empty((BLOCK, 8, N)), np.zeros((5, N))
        self.sin, self.cos = np.empty((BLOCK, 2, 3, N)), np.empty((BLOCK, 2, 3, N))
        self.cross = np.empty((BLOCK, 2, 3, 3, N))
        self.temporary = np.empty((BLOCK, 2, N))
        self.offset = np.empty((BLOCK, 3, N))
        self.ranges = np.empty((BLOCK, N))
        self.uniform = np.empty((BLOCK, N))
        self.received = np.empty((BLOCK, N), dtype=bool)
        self.lost = np.empty((BLOCK, N), dtype=bool)

    def sample(self, first: int, n: int) -> tuple[Floats, Floats, Floats, NDArray[np.bool_]]:
        """Sensor data at `n` instants; `first` is a multiple of four.

        Returns
        -------
        reported
            The cross according to the newest packet: its centre and the two arms from there, (n, 3,
            3, N).
        ranges, depths
            (n, N).
        received
            Whether the packet arrives, (n, N); not filled if no packet is lost in any run.
        """
        now = slice(first, first + n)
        noise, received, lost = self.noise[:n], self.received[:n], self.lost[:n]
        self.rng.standard_normal(out=noise)
        pose = self.pose[:n]
        true, reported, gps = pose[:, :3], pose[:, 3:6], pose[:, 6:]
        np.multiply(noise[:, :5], self.pose_std, out=pose[:, 3:])
        np.multiply(self.wave[0][now], self.amplitude[0], out=true)
        true += np.multiply(self.wave[1][now], self.amplitude[1], out=noise[:, :3])
        reported += true
        if self.lossy:
            uniform = self.uniform[:n]
            self.rng.random(out=uniform)
            np.less(uniform, self.loss, out=lost)
            np.logical_not(lost, out=received)
            newest = self.last_packet
            for k in range(n):
                np.copyto(pose[k, 3:], newest, where=lost[k])
                newest = pose[k, 3:]
            self.last_packet[...] = newest

        cross = self._cross(pose[:, :6].reshape(n, 2, 3, -1))
        cross[:, 1, 0, :2] += gps

        offset = np.subtract(self.truth[now], cross[:, 0, 0], out=self.offset[:n])
        for turn in range(4):
            arm = cross[turn::4, 0, 1 + turn % 2]
            if turn < 2:
                offset[turn::4] -= arm
            else:
                offset[turn::4] += arm
        np.multiply(offset, offset, out=offset)
        ranges = np.add.reduce(offset, axis=1, out=self.ranges[:n])
        np.sqrt(ranges, out=ranges)
        sensors = noise[:, 5:]
        sensors *= self.sensor_std
        ranges += sensors[:, 0]
        depths = sensors[:, 1]
        depths += self.truth[now, 2]
        return cross[:, 1], ranges, depths, received

    def _cross(self, half: Floats) -> Floats:
        """Centre of the beacons and the two arms, true and as reported: R = Rz Ry Rx times b.

        With u = tan(angle / 2), sin = 2 u / (1 + u^2) and cos = 2 / (1 + u^2) - 1.
        """
        n = len(half)
        sin, cos = self.sin[:n], self.cos[:n]
        np.tan(half, out=sin)
        np.multiply(sin, sin, out=cos)
        cos += 1.0
        np.divide(2.0, cos, out=cos)
        sin *= cos
        cos -= 1.0
        (sr, sp, sy), (cr, cp, cy) = (np.moveaxis(a, 2, 0) for a in (sin, cos))
        cross, temporary = self.cross[:n], self.temporary[:n]
        down, forward, starboard = (np.moveaxis(cross[:, :, i], 2, 0) for i in range(3))
        np.multiply(cy, cp, out=forward[0])
        np.multiply(sy, cp, out=forward[1])
        np.negative(sp, out=forward[2])
        np.multiply(cp, sr, out=starboard[2])
        np.multiply(cp, cr, out=down[2])
        np.multiply(cy, sp, out=temporary)
        np.multiply(temporary, sr, out=starboard[0])
        np.multiply(temporary, cr, out=down[0])
        np.multiply(sy, sp, out=temporary)
        np.multiply(temporary, sr, out=starboard[1])
        np.multiply(temporary, cr, out=down[1])
        starboard[0] -= np.multiply(sy, cr, out=temporary)
        down[0] += np.multiply(sy, sr, out=temporary)
        starboard[1] += np.multiply(cy, cr, out=temporary)
        down[1] -= np.multiply(cy, sr, out=temporary)
        cross *= self.lever
        return cross


class _Filter:
    """The EKF of the paper's section 3 on the latest four ranges and the depth.

    The state is kept as position and velocity times T, which makes Phi a matrix of ones and needs
    no product for the prediction. Its covariance is kept in three blocks of 3 x 3.

    All measurements depend on the position p alone, so the correction needs only 3 x 3 matrices:
    with A = H' R^-1 H, r = H' R^-1 (z - h(x)) and the rows P_p of P,

        P_p+ = (I + P_pp A)^-1 P_p,    P_vv+ = P_vv - P_vp A P_pv+,    x+ = x + P_p+' r

    which is the paper's corrector, rearranged (matrix inversion lemma).
    """

    def __init__(
        self, sampling_time: float, start: Floats, range_std: Floats, depth_std: Floats
    ) -> None:
        N = range_std.size
        self.x = np.zeros((2, 3, N))
        self.x[0] = start
        self.position, self.velocity = self.x
        # P_pp and P_pv have a second place, for their values after a correction.
        self.P_p, self.next_P_p = np.zeros((2, 3, 3, N)), np.zeros((2, 3, 3, N))
        self.P_vv = np.zeros((3, 3, N))
        self.diagonal_p, self.next_diagonal_p = _diagonal(self.P_p), _diagonal(self.next_P_p)
        self.diagonal_vv = _diagonal(self.P_vv)
        self.diagonal_p[0], self.diagonal_vv[:] = 1.0, sampling_time**2
        self.Q = (Q * sampling_time**3 * np.array([1 / 3, 1 / 2, 1.0]))[:, None, None]
        # R is literally the standard deviations; a beacon not heard yet has no weight.
        self.range_weight, self.depth_weight = 1 / range_std, 1 / depth_std
        self.weight = np.zeros((4, N))
        self.all_heard = False

        # Buffers. Offsets from beacons +x, +y and -x, -y become the rows of H in place.
        self.centre, self.offset = np.empty((3, N)), np.empty((2, 2, 3, N))
        self.h = self.offset.reshape(4, 3, N)
        self.weighted = np.empty((4, 3, N))
        self.distance, self.inverse = np.empty((4, N)), np.empty((4, N))
        self.A, self.r = np.empty((3, 3, N)), np.empty((3, N))
        self.products = np.empty((4, 3, 3, N))
        self.extended = np.empty((5, 5, N))
        self.S = self.extended[:3, :3]
        self.diagonal_S = _diagonal(self.S)
        self.cofactor, self.nine = np.empty((3, 3, N)), np.empty((3, 3, N))
        self.one, self.eighteen = np.empty(N), np.empty((2, 3, 3, N))

    def hear(self, turn: int, received: NDArray[np.bool_] | bool) -> None:
        """Use a beacon if its packet arrives."""
        np.copyto(self.weight[turn], self.range_weight, where=received)
        self.all_heard = bool(self.weight.all())

    def predict(self) -> None:
        """Time update over one sampling time."""
        self.position += self.velocity
        P_pp, P_pv = self.P_p
        P_pp += P_pv
        P_pv += self.P_vv
        P_pp += P_pv.transpose(1, 0, 2)
        self.diagonal_p += self.Q[:2]
        self.diagonal_vv += self.Q[2]

    def update(self, z: Floats, depth: Floats, beacons: Floats) -> None:
        """Correct with ranges, (4, N), depth, (N,), and the reported cross, (3, 3, N)."""
        h, distance, A, r = self.h, self.distance, self.A, self.r
        P_pp, P_pv = self.P_p
        np.subtract(self.position, beacons[0], out=self.centre)
        np.subtract(self.centre, beacons[1:], out=self.offset[0])
        np.add(self.centre, beacons[1:], out=self.offset[1])
        np.multiply(h, h, out=self.weighted)
        np.add.reduce(self.weighted, axis=1, out=distance)
        np.sqrt(distance, out=distance)
        np.divide(1.0, distance, out=self.inverse)
        h *= self.inverse[:, None]

        np.multiply(h, self.weight[:, None], out=self.weighted)
        for i in range(3):
            products = self.products[:, 0, i:]
            np.multiply(self.weighted[:, i, None], h[:, i:], out=products)
            np.add.reduce(products, axis=0, out=A[i, i:])
        A[1:, 0] = A[0, 1:]
        A[2, 1] = A[1, 2]
        A[2, 2] += self.depth_weight
        np.subtract(z, distance, out=distance)
        self.weighted *= distance[:, None]
        np.add.reduce(self.weighted, axis=0, out=r)
        np.subtract(depth, self.position[2], out=self.one)
        self.one *= self.depth_weight
        r[2] += self.one

        # S = I + P_pp A, and its cofactors: with rows and columns repeated in a cycle they are all
        # the same product of shifted matrices.
        extended, cofactor = self.extended, self.cofactor
        _product(P_pp, A, self.S, self.nine)
        self.diagonal_S += 1.0
        extended[3:, :3] = extended[:2, :3]
        extended[:, 3:] = extended[:, :2]
        np.multiply(extended[1:4, 1:4], extended[2:, 2:], out=cofactor)
        np.multiply(extended[1:4, 2:], extended[2:, 1:4], out=self.nine)
        cofactor -= self.nine
        np.multiply(extended[0, :3], cofactor[0], out=self.nine[0])
        np.add.reduce(self.nine[0], axis=0, out=self.one)  # the determinant
        np.divide(1.0, self.one, out=self.one)
        cofactor *= self.one

        _product(cofactor.transpose(1, 0, 2), self.P_p, self.next_P_p, self.eighteen)
        _product(A, self.next_P_p[1], cofactor, self.nine)
        _product(P_pv.transpose(1, 0, 2), cofactor, self.S, self.nine)
        self.P_vv -= self.S
        self.P_p, self.next_P_p = self.next_P_p, self.P_p
        self.diagonal_p, self.next_diagonal_p = self.next_diagonal_p, self.diagonal_p
        for k in range(3):
            change = self.eighteen[:, k]
            self.x += np.multiply(self.P_p[:, k], r[k], out=change)


def _diagonal(matrices: Floats) -> Floats:
    """The diagonals of (..., n, n, N) as a view, (..., n, N)."""
    diagonal: Floats = np.einsum("...iin->...in", matrices)
    return diagonal


def _product(a: Floats, b: Floats, out: Floats, temporary: Floats) -> None:
    """Matrix products, (..., 3, 3, N)."""
    np.multiply(a[:, 0, None], b[..., None, 0, :, :], out=out)
    for k in (1, 2):
        np.multiply(a[:, k, None], b[..., None, k, :, :], out=temporary)
        out += temporary


def design(runs: int) -> Factors:
    """The 64 combinations of the levels, as equally often as `runs` allows; factors by name.

    Runs without loss come first: a batch in which no packet is lost needs no masks.
    """
    combinations = np.array(list(itertools.product(*FACTORS.values())))
    rows = combinations[np.arange(runs) * len(combinations) // runs]
    return dict(zip(FACTORS, np.ascontiguousarray(rows.T), strict=True))


def study(
    sampling_time: float,
    factors: Factors,
    seed: int = 1,
    batch: int = BATCH,
    simulate: Simulate = simulate,
) -> Floats:
    """Simulate many runs, one per element of the factors' arrays, at most `batch` at once.

    `simulate` is that of this module or of `numpy_plain`.

    Returns
    -------
    RMS errors in m as those of `simulate`, (4, runs).
    """
    rng = np.random.Generator(np.random.SFC64(seed))
    runs = len(factors["baseline"])
    batch = -(-runs // -(-runs // batch))  # avoids a small one at the end
    batch += -batch % 16
    return np.concatenate(
        [
            simulate(sampling_time, rng, {k: v[i : i + batch] for k, v in factors.items()})
            for i in range(0, runs, batch)
        ],
        axis=1,
    )


def main(simulate: Simulate, batch: int, description: str | None) -> None:
    """A study with the options of the command line; `batch` unless they say otherwise."""
    parser = argparse.ArgumentParser(description=(description or "").partition("\n")[0])
    parser.add_argument("--runs", type=int, default=3200)
    parser.add_argument("--sampling-time", type=float, default=0.1, help="s")
    parser.add_argument("--batch", type=int, default=batch, help="runs simulated at once")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=3, help="the smallest time is printed")
    for name, (low, high) in FACTORS.items():
        parser.add_argument(
            f"--{name.replace('_', '-')}", type=float, help=f"{low:g} or {high:g} if not given"
        )
    arguments = parser.parse_args()

    factors = design(arguments.runs)
    for name in FACTORS:
        if (level := getattr(arguments, name)) is not None:
            factors[name][:] = level
    seconds = []
    for _ in range(arguments.repeats):
        began = time.perf_counter()
        rms = study(
            arguments.sampling_time, factors, arguments.seed, arguments.batch, simulate
        )
        seconds.append(time.perf_counter() - began)
    ns = min(seconds) / epochs(arguments.sampling_time) / arguments.runs * 1e9
    for axis, values in zip(("x", "y", "z", "total"), rms, strict=True):
        error = values.std(ddof=1) / np.sqrt(values.size)
        print(f"RMS error {axis:5} mean {values.mean():8.4f} m  standard error {error:.4f} m")
    print(f"{ns:.1f} ns per step and run (NumPy {np.__version__}, {arguments.runs} runs)")


if __name__ == "__main__":
    main(simulate, BATCH, __doc__)
