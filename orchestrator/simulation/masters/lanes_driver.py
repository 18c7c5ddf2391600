"""Interface to the lanes master's C driver, and to the engines in our FMUs."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus.host.libraries import binary_of, ours
from sblcosim.fmus.read.ports import Fmu

from ...errors import FmuError
from ..plans.plan import Plan, PlannedComponent
from . import c_libraries

Floats = NDArray[np.float64]
SUMS = (
    "estimates",
    "error_x", "error_y", "error_z", "error_total",
    "square_x", "square_y", "square_z",
    "relative_x", "relative_y", "relative_z", "relative_total",
    "relative_square_x", "relative_square_y", "relative_square_z",
    "nees", "nees_estimates",
    "nis", "nis_degrees", "nis_estimates",
    "late_estimates", "late_error_square", "late_distance_square",
    "available_ns",
    "updates",
    "broken",
    "unjudged",
    "own_relative_x", "own_relative_y", "own_relative_z", "own_relative_total",
    "own_relative_square_x", "own_relative_square_y", "own_relative_square_z",
    "own_relative_estimates",
    "own_relative_nees", "own_relative_nees_estimates",
    "beyond_ns", "beyond_longest_ns",
)
"""Sums over the estimates of a run; the C driver's ``enum sum`` is generated from these names.

``beyond_longest_ns`` is not a sum, but the longest of several times.

``unjudged`` counts estimates whose epoch is older than the driver's memory or in the future. Such a
run must be judged from its record.
"""

LENGTHS = ("absolute_horizontal", "absolute_total", "relative_horizontal", "relative_total")
"""Lengths of errors that have order statistics; the C driver's ``enum length``."""

ENTRY = "sblcosim_lanes"
MAX_COMPONENTS, MAX_RECEIVERS = 64, 16
MOMENT = 13  # number of values that the driver keeps for an instant
DRIVER = c_libraries.Driver(
    "lanes_master",
    lanes=True,
    includes=("order_statistics.h",),
    header=f"enum sum {{ {', '.join(name.upper() for name in SUMS)}, SUMS }};"
    " /* sums per receiver and run */\n"
    f"enum length {{ {', '.join(f'LENGTH_{name.upper()}' for name in LENGTHS)}, LENGTHS }};\n"
    f"enum {{ MAX_COMPONENTS = {MAX_COMPONENTS}, MAX_RECEIVERS = {MAX_RECEIVERS}, "
    f"MOMENT = {MOMENT} }};\n",
)


class Engine(ctypes.Structure):
    """``struct lanes`` of lanes.h."""

    _fields_ = (
        ("version", ctypes.c_uint32),
        ("lanes", ctypes.c_uint32),
        ("parameters", ctypes.c_uint32),
        ("inputs", ctypes.c_uint32),
        ("outputs", ctypes.c_uint32),
        ("block_size", ctypes.c_uint32),
        ("initial", ctypes.c_void_p),
        ("step", ctypes.c_void_p),
    )


def _integers(name: str, fields: Sequence[str]) -> Any:
    """A C structure of 32-bit integers."""
    return type(name, (ctypes.Structure,), {"_fields_": [(f, ctypes.c_int32) for f in fields]})


Link = _integers("Link", ("source", "from_", "target", "to", "count"))
RECEIVER_PORTS = (
    "valid", "update_count", "epoch", "position", "covariance", "nis", "nis_degrees",
    "relative_position", "relative_covariance",
)
Receiver = _integers("Receiver", ("component", *RECEIVER_PORTS))
Truth = _integers(
    "Truth",
    ("target", "target_position", "target_velocity", "platform", "platform_position", "beacon",
     "reported", "beacons"),
)
Span = _integers("Span", ("component", "from_", "count"))


class LanesPlan(ctypes.Structure):
    """``struct plan`` of c/lanes_master.c."""

    _fields_ = (
        *((n, ctypes.c_int32) for n in ("n_components", "n_links", "n_handovers", "n_receivers",
                                        "n_spans", "n_instants", "remembered", "sparse")),
        *((n, ctypes.c_void_p) for n in ("components", "interval_ns", "links", "handovers",
                                         "receivers", "truth", "spans", "instants_ns")),
        ("settling_ns", ctypes.c_int64),
    )


class Errors(ctypes.Structure):
    """``struct errors`` of c/lanes_master.c."""

    _fields_ = (
        *((n, ctypes.c_int64) for n in ("room", "n_percentages")),
        *((n, ctypes.c_void_p) for n in ("percentages", "squares", "keys", "candidates")),
    )


def unsupported(plan: Plan) -> str | None:
    """Name of the first component without an engine for lanes, or None."""
    for component in plan.components:
        source = component.source
        if not isinstance(source, Fmu) or not has_engine(source):
            return component.name
    return None


def has_engine(fmu: Fmu) -> bool:
    """Whether an FMU has an engine for lanes; only ours are loaded to find out."""
    return ours(fmu) and _entry(fmu) is not None


def loaded_driver() -> ctypes.CDLL:
    return c_libraries.load(DRIVER)


def engine_of(component: PlannedComponent, lanes: int) -> Any:
    assert isinstance(component.source, Fmu)
    version = ctypes.c_uint32.in_dll(loaded_driver(), "sblcosim_lanes_version").value
    return engine_in(component.source, component.name, lanes, version)


def engine_in(fmu: Fmu, name: str, lanes: int, version: int) -> Any:
    """The engine of an FMU of ours.

    Parameters
    ----------
    name
        What messages call it.
    version
        Version of the interface that the driver speaks.

    Raises
    ------
    FmuError
        The processor does not support that many lanes, or the FMU has another version.
    """
    entry = _entry(fmu)
    assert entry is not None
    engine = entry(lanes)
    if not engine:
        raise FmuError(f"{name}: this processor must support {lanes} lanes, but does not")
    if engine.contents.version != version:
        raise FmuError(
            f"{name}: must have version {version} of the engine, got "
            f"{engine.contents.version}; build the FMU again"
        )
    return engine


def _entry(fmu: Fmu) -> Any:
    """The FMU's function that returns its engine, or None."""
    return _entry_in(str(binary_of(fmu)))


@cache
def _entry_in(library: str) -> Any:
    try:
        entry = getattr(ctypes.CDLL(library), ENTRY, None)
    except OSError:
        return None
    if entry is not None:
        entry.restype = ctypes.POINTER(Engine)
        entry.argtypes = (ctypes.c_uint32,)
    return entry
