"""Likelihood of recorded ranges, for many sets of parameters side by side."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus import stopping

from ..data.estimates import Floats
from ..simulation.masters import c_libraries

PARAMETERS = (
    "range_std", "late_share", "late_mean", "acceleration_psd", "turn_rate", "turn_std",
    "range_walk",
)
"""Parameters of the likelihood: σ [m], π, m [m], q [m²/s³], rate of turns [1/s], standard deviation
of the velocity's change at a turn, per axis [m/s], and of an offset's change in a second [m/√s]."""
PRIOR = (
    "north", "east", "velocity_north", "velocity_east", "position_std", "velocity_std",
    "clock_std", "clock_walk", "scale_std", "depth_bias_std", "offset_std", "place_std",
    "place_down_std", "place_noise_std", "place_down_noise_std",
)
"""What is known before the first range, in m, m/s and m²/s."""
POSITION, VELOCITY, CLOCK, SCALE, DEPTH_BIAS, OFFSET = 0, 2, 4, 5, 6, 7
MOST = 8
"""Largest number of hypotheses of the time of the last turn."""
MOST_BEACONS = 16
BY_RANGE = ("innovation", "variance", "punctual", "north", "east", "turn", "density")
_INDICES = {
    "POSITION": POSITION, "VELOCITY": VELOCITY, "CLOCK": CLOCK, "SCALE": SCALE,
    "DEPTH_BIAS": DEPTH_BIAS, "OFFSET": OFFSET, "MOST": MOST, "MOST_BEACONS": MOST_BEACONS,
    "SHOWN": len(BY_RANGE),
}
DRIVER = c_libraries.Driver(
    "innovations",
    lanes=True,
    header=f"enum {{ {', '.join(f'{n} = {v}' for n, v in _INDICES.items())} }};\n"
    f"enum {{ {', '.join(f'PRIOR_{name.upper()}' for name in PRIOR)} }};\n",
    folder=Path(__file__).with_name("c"),
)


class _Log(ctypes.Structure):
    """``struct log`` of c/innovations.c."""

    _fields_ = (
        *((n, ctypes.c_int32) for n in ("ranges", "beacons", "uncertain", "most")),
        *((n, ctypes.c_void_p) for n in ("time", "range", "place", "down", "down_variance",
                                         "beacon", "prior")),
    )


@dataclass(frozen=True, eq=False)
class Ranges:
    """Ranges of a log in the order of their arrival.

    Attributes
    ----------
    time
        Arrival [s]; (n,).
    beacon, range
        Index of the beacon, and range [m]; (n,).
    place
        Reported position of that beacon, NED [m]; (n, 3).
    down, down_variance
        Depth of the diver at that time [m], and its variance [m²]; (n,).
    prior
        By the names of `PRIOR`.
    beacons
        Number of beacons.
    """

    time: Floats
    beacon: NDArray[np.intp]
    range: Floats
    place: Floats
    down: Floats
    down_variance: Floats
    prior: Mapping[str, float]
    beacons: int

    @property
    def uncertain(self) -> bool:
        """Whether the beacons' places have errors."""
        return bool(self.prior["place_std"] > 0 or self.prior["place_down_std"] > 0)

    @property
    def states(self) -> int:
        """Number of states of the filter."""
        return OFFSET + self.beacons * (4 if self.uncertain else 1)

    def part(self, rows: Any) -> Ranges:
        """Some of the ranges."""
        return Ranges(
            self.time[rows], self.beacon[rows], self.range[rows], self.place[rows],
            self.down[rows], self.down_variance[rows], self.prior, self.beacons,
        )


@dataclass(frozen=True, eq=False)
class Filtered:
    """What a filter found with some sets of parameters.

    Attributes
    ----------
    likelihood
        Its logarithm; (sets,).
    by_range
        By the names of `BY_RANGE`, (sets, ranges), or empty.
    mean, covariance
        At the end, (sets, states) and (sets, states, states), or empty.
    """

    likelihood: Floats
    by_range: Mapping[str, Floats]
    mean: Floats
    covariance: Floats


def likelihoods(ranges: Ranges, parameters: Floats, hypotheses: int = 1) -> Floats:
    """Logarithm of the likelihood of each row of parameters; (sets,)."""
    return evaluate(ranges, parameters, hypotheses, details=False).likelihood


def evaluate(
    ranges: Ranges, parameters: Floats, hypotheses: int = 1, details: bool = True
) -> Filtered:
    """Filter the ranges with each row of parameters, in the order of `PARAMETERS`."""
    lanes = int(_driver().sblcosim_innovations_lanes())
    while lanes > 1 and 2 * len(parameters) <= lanes:
        lanes //= 2
    kept, log = _as_c(ranges, hypotheses)
    n, rows = ranges.states, len(ranges.time)
    groups = -(-len(parameters) // lanes)
    chosen = np.minimum(np.arange(groups * lanes), len(parameters) - 1)
    found = np.empty(groups * lanes)
    by_range = np.empty((groups if details else 0, rows, len(BY_RANGE), lanes))
    moments = np.empty((groups if details else 0, n + n * (n + 1) // 2, lanes))
    bytes_of = ctypes.c_uint64.in_dll(_driver(), f"sblcosim_innovations_bytes_{lanes}").value
    memory, result = _aligned(bytes_of), _aligned(8 * lanes)
    given = _aligned(8 * len(PARAMETERS) * lanes)
    run = _driver()[f"sblcosim_innovations_{lanes}"]
    for group in range(groups):
        stopping.check()
        own = chosen[group * lanes : (group + 1) * lanes]
        given.view(np.float64)[:] = parameters[own].T.ravel()
        run(
            ctypes.byref(log), *(ctypes.c_void_p(a.ctypes.data) for a in (given, memory, result)),
            *(ctypes.c_void_p(a[group].ctypes.data if details else None)
              for a in (by_range, moments)),
        )
        found[group * lanes : (group + 1) * lanes] = result.view(np.float64)
    del kept
    count = len(parameters)
    if not details:
        return Filtered(found[:count], {}, np.empty((0, n)), np.empty((0, n, n)))
    flat = np.moveaxis(by_range, 3, 1).reshape(-1, rows, len(BY_RANGE))[:count]
    ends = np.moveaxis(moments, 2, 1).reshape(groups * lanes, -1)[:count]
    covariance = np.empty((count, n, n))
    upper = np.triu_indices(n)
    covariance[:, upper[0], upper[1]] = covariance[:, upper[1], upper[0]] = ends[:, n:]
    return Filtered(
        found[:count], {name: flat[..., i] for i, name in enumerate(BY_RANGE)}, ends[:, :n],
        covariance,
    )


def _as_c(ranges: Ranges, hypotheses: int) -> tuple[list[NDArray[Any]], _Log]:
    columns: list[NDArray[Any]] = [
        np.ascontiguousarray(column, np.float64)
        for column in (ranges.time, ranges.range, ranges.place, ranges.down, ranges.down_variance)
    ]
    columns.append(np.ascontiguousarray(ranges.beacon, np.int32))
    columns.append(np.array([ranges.prior[name] for name in PRIOR]))
    return columns, _Log(
        len(ranges.time), ranges.beacons, ranges.uncertain, hypotheses,
        *(column.ctypes.data for column in columns),
    )


def _aligned(size: int) -> NDArray[np.uint8]:
    memory = np.zeros(size + 64, np.uint8)
    first = -memory.ctypes.data % 64
    return memory[first : first + size]


@cache
def _driver() -> ctypes.CDLL:
    driver = c_libraries.load(DRIVER)
    driver.sblcosim_innovations_lanes.restype = ctypes.c_uint32
    return driver
