"""Modules of WebAssembly with the lanes master, replays and the engines of components."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sblcosim.fmus.build import modules
from sblcosim.models import RECEIVERS

from ..errors import ConfigurationError, nearest
from ..scenario.schema import CORE_COMPONENTS
from ..simulation.masters import c_libraries, replay
from ..simulation.masters.lanes_driver import (
    DRIVER,
    LENGTHS,
    MOMENT,
    SUMS,
    Engine,
    Errors,
    LanesPlan,
)

SCRIPT = Path(__file__).with_name("engine.js")
"""The module of JavaScript that runs modules and plans."""
_ENTRY = "wasm_lanes.c"


def module(
    receivers: Sequence[str] = (), beacons: int = 4, lanes: int = 1, **constants: int
) -> Path:
    """Path of a module that simulates whole scenarios, built only if it has changed.

    Parameters
    ----------
    receivers
        Names of our receivers; default: all.
    beacons
        Number of beacons: a module is for one number of them.
    lanes
        Simulations side by side: 1, or 2 where WebAssembly has vectors (``simd128``). Results do
        not depend on it.
    constants
        Other constants of the build: ``track_points=256``.

    Raises
    ------
    ConfigurationError
        There is no such receiver or number of lanes.
    BuildError
        CasADi or ``ziglang`` is missing, or the compiler fails.
    ValueError
        A component cannot be made for this number of beacons.
    """
    for name in receivers:
        if name not in RECEIVERS:
            raise ConfigurationError(
                f"receivers: each must be one of {', '.join(RECEIVERS)}; got {name!r}"
                f"{nearest(name, RECEIVERS)}"
            )
    if lanes not in modules.FLAGS:
        raise ConfigurationError(
            f"lanes: must be {' or '.join(map(str, modules.FLAGS))} in WebAssembly, got {lanes}"
        )
    components = (*CORE_COMPONENTS, *dict.fromkeys(receivers or RECEIVERS))
    return modules.module(
        f"beacons_{beacons}_lanes_{lanes}.wasm", _driver(), components, lanes,
        _description(components, beacons, lanes), beacons=beacons, **constants,
    )


def key(receivers: Sequence[str], beacons: int, lanes: int, **constants: int) -> str:
    """Cache key of everything that a module is made from; arguments as for `module`."""
    components = (*CORE_COMPONENTS, *receivers)
    described = _description(components, beacons, lanes)
    return modules.key(_driver(), components, lanes, described, beacons=beacons, **constants)


def _driver() -> dict[str, bytes]:
    """The C sources of the lanes master and of replays."""
    entry = {_ENTRY: (c_libraries.FOLDER / _ENTRY).read_bytes()}
    return {**entry, **c_libraries.sources(replay.DRIVER), **c_libraries.sources(DRIVER)}


def _description(components: Sequence[str], beacons: int, lanes: int) -> dict[str, object]:
    """What a module says of itself, for a host that knows no C."""
    structures = {
        "plan": LanesPlan, "errors": Errors, "engine": Engine, "replay": replay.Replay,
    }
    return {
        "beacons": beacons,
        "lanes": lanes,
        "components": list(components),
        "sums": list(SUMS),
        "lengths": list(LENGTHS),
        "moment": MOMENT,
        "structures": {name: fields_of(structure) for name, structure in structures.items()},
    }


def fields_of(structure: Any) -> dict[str, Any]:
    """Size of a C structure, and offset and size of its fields [bytes]; pointers have 32 bits."""
    narrow = [
        (name, ctypes.c_uint32 if kind is ctypes.c_void_p else kind)
        for name, kind in structure._fields_
    ]
    same = type(structure.__name__, (ctypes.LittleEndianStructure,), {"_fields_": narrow})
    fields = {name: [getattr(same, name).offset, getattr(same, name).size] for name, _ in narrow}
    return {"size": ctypes.sizeof(same), "fields": fields}
