"""Test functions of sensitivity analysis, with the indices that are published for them."""

from __future__ import annotations

import math

import numpy as np
from sblcosim.study.distributions import distribution_of
from sblcosim.study.space import DrawnFactor

ANGLE = distribution_of("uniform", range=[-math.pi, math.pi])
ANGLES = tuple(DrawnFactor(f"x{i}", ANGLE) for i in (1, 2, 3))
UNIT = distribution_of("uniform", range=[0, 1])
UNITS = tuple(DrawnFactor(f"x{i}", UNIT) for i in range(1, 9))
WEIGHTS = (0.0, 1.0, 4.5, 9.0, 99.0, 99.0, 99.0, 99.0)

ISHIGAMI = {"first": (0.3139, 0.4424, 0.0), "total": (0.5576, 0.4424, 0.2437)}
"""T. Ishigami and T. Homma, ISUMA '90, 398–403, with a = 7 and b = 0.1."""
ISHIGAMI_VARIANCE = 0.5 + 7**2 / 8 + 0.1 * math.pi**4 / 5 + 0.1**2 * math.pi**8 / 18
G = {
    "first": (0.7162, 0.1790, 0.0237, 0.0072, 0.0001, 0.0001, 0.0001, 0.0001),
    "total": (0.7871, 0.2422, 0.0343, 0.0105, 0.0001, 0.0001, 0.0001, 0.0001),
}
"""A. Saltelli and I. M. Sobol', Reliab. Eng. Syst. Saf. 50, 1995, 225–239; to four digits."""
WITH_NOISE = {
    "first": (*(s / 2 for s in ISHIGAMI["first"]), 0.5),
    "total": (*(s / 2 for s in ISHIGAMI["total"]), 0.5),
}
"""Of the Ishigami function plus as much variance of noise; the last is the seed."""


def ishigami(x1, x2, x3, a=7.0, b=0.1):
    return math.sin(x1) + a * math.sin(x2) ** 2 + b * x3**4 * math.sin(x1)


def noisy(x1, x2, x3, seed):
    noise = np.random.Generator(np.random.Philox(key=seed)).normal()
    return ishigami(x1, x2, x3) + math.sqrt(ISHIGAMI_VARIANCE) * noise


def g(x1, x2, x3, x4, x5, x6, x7, x8):
    pairs = zip((x1, x2, x3, x4, x5, x6, x7, x8), WEIGHTS, strict=True)
    return math.prod((abs(4 * x - 2) + a) / (1 + a) for x, a in pairs)
