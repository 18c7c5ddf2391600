"""Functions of uniform columns with known Sobol' indices, for many samples at once.

Indices are exact where a formula is near; the others are those of 2¹⁸ base rows, four times, whose
standard deviation is below 2e-4.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Known:
    """A function of the first columns, one for each of its indices; the others are without effect.

    ``of`` takes u of shape (…, columns), and its values have the shape (…).
    """

    of: Callable[[Floats], Floats]
    first: tuple[float, ...]
    total: tuple[float, ...]

    def rows(self, a: Floats, b: Floats) -> Floats:
        """The responses at A, with each column alone from B, and at B; shape (…, columns + 2)."""
        k = len(self.total)
        a, b = a[..., :k], b[..., :k]
        swapped = [self.of(np.where(np.arange(k) == i, b, a)) for i in range(k)]
        return np.stack([self.of(a), *swapped, self.of(b)], axis=-1)


def linear(*weights: float, of: Callable[[Floats], Floats] = lambda u: u) -> Known:
    """A sum of like terms with weights."""
    w = np.array(weights)
    shares = tuple(w**2 / (w**2).sum())
    return Known(lambda u: (w * of(u)).sum(axis=-1), shares, shares)


def product(columns: int, ratio: float, of: Callable[[Floats], Floats]) -> Known:
    """A product of like factors, each with a variance of so many times its squared mean."""
    whole = (1 + ratio) ** columns - 1
    return Known(
        lambda u: np.prod(of(u), axis=-1), (ratio / whole,) * columns,
        (ratio * (1 + ratio) ** (columns - 1) / whole,) * columns,
    )  # fmt: skip


def interaction(columns: int, of: Callable[[Floats], Floats]) -> Known:
    """A product of factors whose mean is 0."""
    return Known(lambda u: np.prod(of(u), axis=-1), (0.0,) * columns, (1.0,) * columns)


def g(*weights: float) -> Known:
    """Sobol's G function (A. Saltelli, I. M. Sobol', Reliab. Eng. Syst. Saf. 50, 1995, 225–239)."""
    a = np.array(weights)
    part = 1 / 3 / (1 + a) ** 2
    whole = np.prod(1 + part) - 1
    return Known(
        lambda u: np.prod((np.abs(4 * u - 2) + a) / (1 + a), axis=-1), tuple(part / whole),
        tuple(part / (1 + part) * (1 + whole) / whole),
    )  # fmt: skip


Part = tuple[Known, float]
"""A function of columns of its own, and its variance."""


def added(*parts: Part) -> Known:
    """A sum of parts."""
    whole = sum(variance for _, variance in parts)
    starts = np.cumsum([0, *(len(known.total) for known, _ in parts)])

    def of(u: Floats) -> Floats:
        values = [k.of(u[..., s:]) for (k, _), s in zip(parts, starts[:-1], strict=True)]
        return np.sum(values, axis=0)

    first, total = (
        tuple(index * variance / whole for k, variance in parts for index in getattr(k, kind))
        for kind in ("first", "total")
    )
    return Known(of, first, total)


def uniform(height: float = 1.0) -> Part:
    return Known(lambda u: height * u[..., 0], (1.0,), (1.0,)), height**2 / 12


def normal(height: float = 1.0) -> Part:
    return Known(lambda u: height * stats.norm.ppf(u[..., 0]), (1.0,), (1.0,)), height**2


def of_two() -> Part:
    """A product of two uniform columns."""
    return product(2, 1 / 3, lambda u: u[..., :2]), 7 / 144


def choice(weights: Sequence[float], levels: Sequence[float]) -> Part:
    """A column that has levels with weights; a step if they are two."""
    share, of = np.array(weights) / np.sum(weights), np.array(levels)
    edges = np.cumsum(share)[:-1]
    variance = float((share * of**2).sum() - (share * of).sum() ** 2)
    return Known(
        lambda u: of[np.searchsorted(edges, u[..., 0], side="right")], (1.0,), (1.0,)
    ), variance


def step(share: float, height: float = 5.0) -> Part:
    return choice((1 - share, share), (0.0, height))


def corner(one: float, other: float, height: float = 5.0) -> Part:
    """A step where each of two columns is among its largest."""
    both = one * other
    variance = both * (1 - both)
    first = (other**2 * one * (1 - one) / variance, one**2 * other * (1 - other) / variance)
    total = (both * (1 - one) / variance, both * (1 - other) / variance)
    return Known(
        lambda u: height * ((u[..., 0] > 1 - one) & (u[..., 1] > 1 - other)), first, total
    ), height**2 * variance


def tilt(share: float) -> Part:
    """A column counts only beyond a step of another, and is 0 in the mean."""
    return Known(
        lambda u: 4 * (u[..., 0] > 1 - share) * (u[..., 1] - 0.5), (0.0, share), (1 - share, 1.0)
    ), 4 / 3 * share


def between(low: Sequence[float], high: Sequence[float], u: Floats) -> tuple[Floats, ...]:
    """The columns, each within its range."""
    return tuple(np.moveaxis(np.array(low) + (np.array(high) - low) * u, -1, 0))


def wing(u: Floats) -> Floats:
    """Weight of a wing (A. Forrester et al., Engineering Design via Surrogate Modelling, 2008)."""
    area, fuel, aspect, sweep, q, taper, thick, load, gross, paint = between(
        [150, 220, 6, -10, 16, 0.5, 0.08, 2.5, 1700, 0.025],
        [200, 300, 10, 10, 45, 1, 0.18, 6, 2500, 0.08], u,
    )  # fmt: skip
    c = np.cos(np.deg2rad(sweep))
    return (
        0.036 * area**0.758 * fuel**0.0035 * (aspect / c**2) ** 0.6 * q**0.006 * taper**0.04
        * (100 * thick / c) ** -0.3 * (load * gross) ** 0.49 + area * paint
    )  # fmt: skip


def borehole(u: Floats) -> Floats:
    """Flow through a borehole, with its normal and log-normal inputs.

    M. Morris, T. Mitchell, D. Ylvisaker, Technometrics 35, 1993, 243–255.
    """
    radius = 0.1 + 0.0161812 * stats.norm.ppf(u[..., 0])
    ratio = np.exp(7.71 + 1.0056 * stats.norm.ppf(u[..., 1])) / radius
    upper, head, lower, bottom, length, k = between(
        [63070, 990, 63.1, 700, 1120, 9855], [115600, 1110, 116, 820, 1680, 12045], u[..., 2:]
    )
    log = np.log(ratio)
    share = 1 + 2 * length * upper / (log * radius**2 * k) + upper / lower
    return 2 * np.pi * upper * (head - bottom) / (log * share)


def k_function(u: Floats) -> Floats:
    """P. Bratley, B. L. Fox, H. Niederreiter, ACM Trans. Model. Comput. Simul. 2, 1992, 195–213."""
    return (np.cumprod(u, axis=-1) * (-1.0) ** np.arange(1, u.shape[-1] + 1)).sum(axis=-1)


def ishigami(u: Floats) -> Floats:
    """T. Ishigami, T. Homma, ISUMA '90, 398–403."""
    x = np.pi * (2 * u - 1)
    return (1 + 0.1 * x[..., 2] ** 4) * np.sin(x[..., 0]) + 7 * np.sin(x[..., 1]) ** 2


def friedman(u: Floats) -> Floats:
    """J. H. Friedman, Ann. Statist. 19, 1991, 1–67."""
    bend = 10 * np.sin(np.pi * u[..., 0] * u[..., 1]) + 20 * (u[..., 2] - 0.5) ** 2
    return bend + 10 * u[..., 3] + 5 * u[..., 4]


def circuit(u: Floats) -> Floats:
    """A circuit without a transformer (E. N. Ben-Ari, D. M. Steinberg, Qual. Eng. 19, 2007)."""
    b1, b2, f, c1, c2, gain = between(
        [50, 25, 0.5, 1.2, 0.25, 50], [150, 70, 3, 2.5, 1.2, 300], u
    )
    loop = gain * (c2 + 9)
    volt = 12 * b2 / (b1 + b2) + 0.74
    return (volt * loop + 11.35 * f + 0.74 * f * loop / c1) / (loop + f)


def piston(u: Floats) -> Floats:
    """Time of a piston's cycle (R. S. Kenett, S. Zacks, Modern Industrial Statistics, 1998)."""
    mass, area, volume, spring, pressure, air, gas = between(
        [30, 0.005, 0.002, 1000, 90000, 290, 340], [60, 0.02, 0.01, 5000, 110000, 296, 360], u
    )
    force = pressure * area + 19.62 * mass - spring * volume / area
    work = pressure * volume / gas
    v = area / (2 * spring) * (np.sqrt(force**2 + 4 * spring * work * air) - force)
    return 2 * np.pi * np.sqrt(mass / (spring + area**2 * work * air / v**2))


def waves(u: Floats) -> Floats:
    return np.sin(10 * u[..., 0]) * (1 + u[..., 2]) + u[..., 1]


E = float(np.exp(0.25))
FUNCTIONS: dict[str, Known] = {
    **{f"sum of {k}": linear(*[1.0] * k) for k in (2, 3, 4, 6, 8, 12)},
    "weights 1 to 6": linear(1, 2, 3, 4, 5, 6),
    "weights halved": linear(*(0.5**i for i in range(8))),
    "sum of 4 normal": linear(*[1.0] * 4, of=stats.norm.ppf),
    "sum of 4 exponential": linear(*[1.0] * 4, of=lambda u: -np.log(u)),
    "sum of 3 log-normal": linear(*[1.0] * 3, of=lambda u: np.exp(stats.norm.ppf(u))),
    "sum of 4 squares": linear(*[1.0] * 4, of=lambda u: stats.norm.ppf(u) ** 2),
    "wing": Known(
        wing, (0.1245, 0, 0.2202, 0.0005, 0.0001, 0.0018, 0.141, 0.4116, 0.085, 0.0033),
        (0.1279, 0, 0.226, 0.0005, 0.0001, 0.0019, 0.1451, 0.4196, 0.0876, 0.0034),
    ),
    "borehole": Known(
        borehole, (0.6637, 0, 0, 0.0949, 0, 0.0949, 0.0906, 0.0219),
        (0.6941, 0, 0, 0.1061, 0, 0.1061, 0.1028, 0.0251),
    ),
    "K of 4": Known(
        k_function, (0.6076, 0.2187, 0.0243, 0.0243), (0.7057, 0.3168, 0.0576, 0.0576)
    ),
    "K of 10": Known(
        k_function, (0.6659, 0.1675, 0.0414, 0.0106, 0.0026, 0.0007, 0.0002, 0.0001, 0, 0),
        (0.7494, 0.251, 0.0829, 0.0282, 0.009, 0.0032, 0.0009, 0.0004, 0.0001, 0.0001),
    ),
    **{f"interaction of {k}": interaction(k, lambda u: u - 0.5) for k in (2, 3, 4)},
    "interaction of 3 normal": interaction(3, stats.norm.ppf),
    "pairs": Known(
        lambda u: (u[..., 0] - 0.5) * (u[..., 1] - 0.5) + (u[..., 2] - 0.5) * (u[..., 3] - 0.5),
        (0.0,) * 4, (0.5,) * 4,
    ),
    "product of 3": product(3, 1 / 3, lambda u: u),
    "product of 6": product(6, 1 / 3, lambda u: u),
    "product of 3 exponential": product(3, 1.0, lambda u: -np.log(u)),
    "product of 3 log-normal": product(3, E - 1, lambda u: np.exp(0.5 * stats.norm.ppf(u))),
    "Ishigami": Known(ishigami, (0.3139, 0.4424, 0), (0.5576, 0.4424, 0.2437)),
    "G": g(0, 1, 4.5, 9, 99, 99, 99, 99),
    "G, all alike": g(0, 0, 0, 0),
    "Friedman": Known(
        friedman, (0.1973, 0.1973, 0.0933, 0.3498, 0.0874),
        (0.2722, 0.2722, 0.0933, 0.3498, 0.0874),
    ),
    "circuit": Known(
        circuit, (0.4957, 0.4072, 0.0708, 0.0186, 0, 0), (0.5001, 0.4117, 0.074, 0.0218, 0, 0)
    ),
    "piston": Known(
        piston, (0.039, 0.5571, 0.3211, 0.0206, 0.0012, 0, 0),
        (0.0509, 0.5994, 0.3528, 0.067, 0.0013, 0, 0.0001),
    ),
    "largest of 4": Known(lambda u: u.max(axis=-1), (1 / 6,) * 4, (5 / 14,) * 4),
    "least of 3": Known(lambda u: u.min(axis=-1), (5 / 21,) * 3, (4 / 9,) * 3),
    "waves": Known(waves, (0.8902, 0.0744, 0.0025), (0.9231, 0.0744, 0.0355)),
}  # fmt: skip

STEPS: dict[str, Known] = {
    **{
        f"step in {p:.0%}": added(step(p), uniform(), of_two()) for p in (0.5, 0.3, 0.2, 0.1, 0.05)
    },
    "low step in 10%": added(step(0.1, 1.0), uniform(), of_two()),
    "high step in 5%": added(step(0.05, 10.0), uniform(), uniform()),
    "step and noise": added(step(0.2, 10.0), uniform(), normal()),
    "two steps": added(step(0.1, 3.0), step(0.1, 3.0), uniform()),
    **{
        f"choice of {k}, one bad": added(choice([1] * k, [0] * (k - 1) + [5]), uniform(), uniform())
        for k in (3, 4, 5, 6)
    },
    "choice of 3, seldom bad": added(choice((8, 1, 1), (0, 1, 5)), uniform(), uniform()),
    "choice of 4 with weights": added(choice((5, 2, 2, 1), (0, 1, 5, 9)), uniform(), uniform()),
    "whole numbers": added(*(choice([1] * k, range(k)) for k in (4, 3, 2)), uniform(0.1)),
    "corner of 9%": added(corner(0.3, 0.3), uniform(), uniform()),
    "corner of 10%": added(corner(0.2, 0.5), uniform()),
    "tilt in 20%": added(tilt(0.2), uniform()),
    "clipped": Known(
        lambda u: 3 * np.maximum(0, u[..., 0] + u[..., 1] - 1.6) + 0.2 * u[..., 2],
        (0.1666, 0.1666, 0.155), (0.6784, 0.6784, 0.155),
    ),
    "saturated": Known(
        lambda u: np.minimum(0.2, u[..., 0] * u[..., 1]) * (1 + u[..., 2]),
        (0.3861, 0.3861, 0.1132), (0.4864, 0.4864, 0.1449),
    ),
}  # fmt: skip
"""Functions with steps, corners and limits, which few runs show."""
RARE: dict[str, tuple[int, Known]] = {
    "step in 3%": (32, added(step(0.03), uniform(), uniform())),
    "step in 2%": (64, added(step(0.02), uniform(), uniform())),
    "corner of 4%": (64, added(corner(0.1, 0.4), uniform())),
    "corner of 2%": (128, added(corner(0.1, 0.2), uniform())),
}
"""Those that too few base rows need not show at all, and the base rows that do."""
