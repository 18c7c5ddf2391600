"""The posterior Cramér-Rao (Riccati) recursion along true paths: C, from the receivers' equations.

J₊ = (Q + Φ J⁻¹ Φᵀ)⁻¹ + Σ Hᵀ H/R, with the rows H at the true state (P. Tichavský, C. H. Muravchik,
A. Nehorai, Posterior Cramér-Rao bounds for discrete-time nonlinear filtering, IEEE Trans. Signal
Process. 46, 1998, 1386-1396, for additive Gaussian noise). ``fmus/c/bound.c`` implements the
recursion, and `sblcosim.models.receiver.bound` its equations.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus.build import bound as library
from sblcosim.models.ports import BEACONS
from sblcosim.models.receiver.bound import BOUNDS, SITUATION

from ..errors import SblcosimError

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_LEAST_TOLD = 1e-12
"""Smallest share of the information in a range; it only keeps numbers finite."""


@dataclass(frozen=True, eq=False)
class Epochs:
    """True values and measurements at n epochs, common to all divers but for the last.

    Attributes
    ----------
    step_s
        Time since the previous epoch, or since the start [s]; (n,).
    readings
        Number of depth readings, 0 or more; (n,).
    heard
        Number of packets received from each beacon; 0.75 is 75 % of the information of one; (n, N).
    packets
        Number of packets with the platform's pose; (n,).
    platform, attitude
        Its reference point, NED [m], and roll, pitch, yaw [rad]; (n, 3).
    beacons
        Nominal positions in the body frame, or true positions, NED, for beacons with own errors
        [m]; (n, N, 3).
    told
        Share of the information in a range of each beacon that is left; for each of m divers:
        (m, N).
    """

    step_s: Floats
    readings: Floats
    heard: Floats
    packets: Floats
    platform: Floats
    attitude: Floats
    beacons: Floats
    told: Floats | float = 1.0


@dataclass(frozen=True, eq=False)
class ReceiverModel:
    """A receiver's model with its numbers.

    Attributes
    ----------
    name
        A key of `sblcosim.models.receiver.bound.BOUNDS`.
    parameters
        Has the model's parameters as attributes, except the first, which is the diver's own.
    situation
        Values of `sblcosim.models.receiver.bound.SITUATION`, by name.
    """

    name: str
    parameters: Any
    situation: Mapping[str, float]

    @property
    def own_errors(self) -> bool:
        """Whether each beacon has its own error and there is no platform."""
        return self.name == "field"

    def values(self) -> Floats:
        """All numbers, in the order of the C code."""
        given = [getattr(self.parameters, name) for name in BOUNDS[self.name].parameters]
        return np.array([*given, *(self.situation[name] for name in SITUATION)], float)


class BoundTask(ctypes.Structure):
    """``struct bound_task`` of bound.h."""

    _fields_ = (
        *((n, ctypes.c_int32) for n in ("model", "beacons", "epochs", "divers", "kept")),
        *((n, ctypes.c_void_p) for n in (
            "parameters", "acceleration_psd", "dt", "readings", "packets", "heard", "told",
            "position", "platform", "attitude", "beacon", "keep", "absolute", "relative",
        )),
    )  # fmt: skip


@cache
def _entry() -> Any:
    entry = ctypes.CDLL(str(library.library())).sblcosim_bound
    entry.argtypes, entry.restype = (ctypes.c_uint32, ctypes.POINTER(BoundTask)), ctypes.c_int32
    return entry


def _whole(values: Floats, shape: tuple[int, ...]) -> Floats:
    """An array in the layout of the C code; values common to all epochs are repeated."""
    return np.ascontiguousarray(np.broadcast_to(values, shape), np.float64)


def covariances(
    model: ReceiverModel,
    epochs: Epochs,
    position: Floats,
    acceleration_psd: Floats,
    keep: Integers | None = None,
    lanes: int = 0,
) -> tuple[Floats, Floats]:
    """Covariances of the divers' positions after the measurements at some epochs.

    Parameters
    ----------
    position
        True positions of m divers, NED [m]; (n, m, 3).
    acceleration_psd
        q of each [m²/s³]; (m,).
    keep
        Numbers of the epochs whose covariances are wanted, increasing; None: all.
    lanes
        Number of divers at once: 1, 2, 4 or 8 if the processor supports it; 0: as many as it
        supports well. The numbers do not depend on it.

    Returns
    -------
    absolute, relative
        In the world, and relative to the platform, NED [m²]; (epochs kept, m, 3, 3).

    Raises
    ------
    BuildError
        The library must be built, but cannot be.
    SblcosimError
        There are too many beacons, or the processor does not support that many lanes.
    """
    n, m, count, numbers = *position.shape[:2], epochs.heard.shape[1], model.values()
    shapes = {
        "acceleration_psd": (acceleration_psd, (m,)), "dt": (epochs.step_s, (n,)),
        "readings": (epochs.readings, (n,)), "packets": (epochs.packets, (n,)),
        "heard": (epochs.heard, (n, count)), "position": (position, (n, m, 3)),
        "told": (np.fmax(epochs.told, _LEAST_TOLD), (m, count)),
        "platform": (epochs.platform, (n, 3)), "attitude": (epochs.attitude, (n, 3)),
        "beacon": (epochs.beacons, (n, count, 3)), "parameters": (numbers, numbers.shape),
    }  # fmt: skip
    arrays = {name: _whole(values, shape) for name, (values, shape) in shapes.items()}
    wanted = np.ascontiguousarray(np.arange(n) if keep is None else keep, np.int32)
    absolute, relative = np.empty((2, len(wanted), m, 3, 3))
    pointers: dict[str, NDArray[Any]] = {
        **arrays, "keep": wanted, "absolute": absolute, "relative": relative
    }
    task = BoundTask(
        [*BOUNDS].index(model.name), count, n, m, len(wanted),
        **{name: array.ctypes.data for name, array in pointers.items()},
    )
    if _entry()(lanes, ctypes.byref(task)):
        raise SblcosimError(
            f"bound: must have at most {BEACONS.most} beacons, and a number of lanes that this "
            f"processor supports, got {count} and {lanes}"
        )
    return absolute, relative
