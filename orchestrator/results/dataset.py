"""A run as one xarray Dataset: all outputs by time, all errors by epoch, with units.

Its contents, by dimension:

- ``time``: the communication instants. An output ``target.position`` is ``target_position``. The
  outputs that our receivers can have are stacked along ``receiver``, as ``receiver_position``. Any
  other output of a receiver has its label, as in ``mine_bias``.
- ``epoch``: the times to which estimates belong, for all receivers together. ``estimate``,
  ``error`` and the like are those of `sblcosim.judge.metrics.track`. ``frame`` is what an error
  is relative to. If a receiver has several estimates for one epoch, the last one is kept.
- ``axis`` (x, y, z: north, east, down), ``angle`` (roll, pitch, yaw), ``beacon`` (1 to N), and
  ``state``, the order of covariances.

NaN means missing: the receiver has no such output, or no estimate for an epoch. Integers and
flags that are missing for some receiver are therefore floats. Times are seconds since the start of
the simulated clock, as floats, so there is no NaT. Outputs are as recorded: before its first
estimate a receiver's position is 0, and ``receiver_valid`` says so.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sblcosim.fmus.host.nanoseconds import SECOND
from sblcosim.models import COMPONENTS
from sblcosim.models.declaration import Dimension, Variable
from sblcosim.models.ports import BEACONS, ESTIMATE, SYSTEM

from ..data.description import RunDescription
from ..errors import ConfigurationError
from ..judge.definitions import AXES, FRAMES, PREFIXES

if TYPE_CHECKING:
    import xarray as xr

    from ..data.record import Record

Array = NDArray[Any]
_Parts = Iterator[tuple[str, tuple[tuple[str, ...], Array, dict[str, str]]]]
"""Names of variables, each with its dimensions, values and attributes."""

_STATES = ["x", "vx", "y", "vy", "z", "vz"]
_COORDINATES: Mapping[str, tuple[list[Any], str]] = {
    "axis": ([*AXES], "North, east, down"),
    "axis_2": ([*AXES], "North, east, down: columns of covariances"),
    "angle": (["roll", "pitch", "yaw"], "Roll, pitch, yaw"),
    "beacon": ([*range(1, BEACONS.most + 1)], "Number of the beacon"),
    "frame": ([*FRAMES], "What errors are relative to"),
    "state": (_STATES, "Positions and velocities, in the order of the paper's state"),
    "state_2": (_STATES, "Positions and velocities: columns of covariances"),
}
_SIZES = {len(AXES): "axis", len(_STATES): "state"}
_PORTS = {v.name: v for v in (*ESTIMATE, *SYSTEM)}
"""Outputs that are stacked along ``receiver``."""


def dataset(
    description: RunDescription, record: Record, tracks: Mapping[str, pd.DataFrame]
) -> xr.Dataset:
    """Everything about a run; the docstring of this module lists the contents.

    Parameters
    ----------
    tracks
        What `sblcosim.judge.metrics.track` returns, by receiver.

    Raises
    ------
    ConfigurationError
        xarray is not installed.
    """
    try:
        import xarray as xr
    except ImportError:
        raise ConfigurationError(
            "to_xarray: must have xarray, got no such package; pip install 'sblcosim[xarray]'"
        ) from None
    epochs = np.unique(np.concatenate([[], *(t["epoch_s"] for t in tracks.values())]))
    coordinates: dict[str, Any] = {
        "time": ("time", record.time_ns / SECOND, _about("Communication instant", "s")),
        "epoch": ("epoch", epochs, _about("Time to which an estimate belongs", "s")),
        "receiver": ("receiver", list(tracks), _about("Receiver")),
    }
    variables: dict[str, Any] = {}
    for parts in (_outputs(record, tracks), _ports(record, tracks), _judged(tracks, epochs)):
        for name, part in parts:
            while name in variables:  # a label may end as one of our names begins
                name += "_"
            variables[name] = part
    sizes = {
        dim: n
        for dims, values, _ in variables.values()
        for dim, n in zip(dims, np.shape(values), strict=True)
    }
    for dim in sizes.keys() & _COORDINATES.keys():
        values, words = _COORDINATES[dim]
        coordinates[dim] = (dim, values[: sizes[dim]], _about(words))
    about = {
        "title": getattr(description.scenario, "title", "") or description.scenario_name,
        "scenario": description.scenario_name,
        "seeds": json.dumps(dict(description.seeds)),
        "source": "sblcosim",
    }
    return xr.Dataset(variables, coordinates, about)


def _about(words: str, unit: str | None = None) -> dict[str, str]:
    return {"long_name": words} | ({} if unit is None else {"units": unit})


def _outputs(record: Record, receivers: Mapping[str, Any]) -> _Parts:
    """The outputs of all components; for receivers, those that only they have."""
    for name, values in record.values.items():
        owner, _, output = name.partition(".")
        if owner in receivers and output in _PORTS:
            continue
        component = COMPONENTS.get(owner)
        declared = {v.name: v for v in component or ()}.get(output)
        full = f"{owner}_{output}".replace("/", "_")  # netCDF allows no slash in names
        yield full, _part(full, ("time",), values, declared)


def _ports(record: Record, receivers: Mapping[str, Any]) -> _Parts:
    """The outputs that receivers share."""
    for name, port in _PORTS.items():
        found = [record.values.get(f"{receiver}.{name}") for receiver in receivers]
        if all(values is None for values in found):
            continue
        missing = np.full((len(record), *port.shape), np.nan)
        stack = np.stack([missing if v is None else v for v in found], axis=1)
        yield f"receiver_{name}", _part(f"receiver_{name}", ("time", "receiver"), stack, port)


def _part(
    name: str, before: tuple[str, ...], values: Array, declared: Variable | None
) -> tuple[tuple[str, ...], Array, dict[str, str]]:
    """A variable, with known dimensions where it is declared, else with its own."""
    shape = values.shape[len(before) :]
    if declared is None or not _fits(declared.shape, shape):
        return (*before, *(f"{name}_{i + 1}" for i in range(len(shape)))), values, {}
    dims: list[str] = []
    for size in declared.shape:
        if isinstance(size, Dimension):
            dim = "beacon"
        else:
            dim = "angle" if size == len(AXES) and declared.unit == "rad" else _SIZES[size]
        dims.append(f"{dim}_2" if dim in dims else dim)
    return (*before, *dims), values, _about(declared.legend, _unit(declared))


def _fits(declared: tuple[int, ...], shape: tuple[int, ...]) -> bool:
    """Whether an array has the declared shape (any number of beacons) and known dimensions."""
    return len(declared) == len(shape) and all(
        isinstance(n, Dimension) or (n == size and n in _SIZES)
        for n, size in zip(declared, shape, strict=True)
    )


def _unit(declared: Variable) -> str | None:
    if declared.type != "Float64":
        return None
    return {"relative_covariance": "m2"}.get(declared.name, declared.unit)


def _judged(tracks: Mapping[str, pd.DataFrame], epochs: Array) -> _Parts:
    """The estimates and their errors, at the epochs of all receivers; empty without receivers."""
    if not tracks:
        return
    at = {
        name: track.drop_duplicates("epoch_s", keep="last").set_index("epoch_s").reindex(epochs)
        for name, track in tracks.items()
    }

    def stacked(*columns: str) -> Array:
        """Shape (receivers, epochs, columns); NaN for a column that a receiver does not have."""
        found = [table.reindex(columns=list(columns)).to_numpy(float) for table in at.values()]
        return np.stack(found)

    def by_frame(name: str, *suffixes: str) -> Array:
        """Shape (receivers, epochs, frames, suffixes)."""
        every = [stacked(*(f"{PREFIXES[f]}{name}{s}" for s in suffixes)) for f in FRAMES]
        return np.stack(every, axis=2)

    here, axes = ("receiver", "epoch"), tuple(f"_{axis}_m" for axis in AXES)
    whole = stacked(*(f"true{axis}" for axis in axes))
    true = np.full(whole.shape[1:], np.nan)
    for own in whole:  # the same for all receivers with an estimate there
        true = np.where(np.isnan(true), own, true)
    yield "true_position", (("epoch", "axis"), true, _about("True position, NED", "m"))
    yield "estimate", (
        (*here, "axis"), stacked(*(axis[1:] for axis in axes)),
        _about("Estimated position, NED", "m"),
    )
    yield "error", (
        (*here, "frame", "axis"), by_frame("error", *axes), _about("Estimate minus truth, NED", "m")
    )
    yield "error_total", (
        (*here, "frame"), by_frame("error", "_total_m")[..., 0], _about("Length of the error", "m")
    )
    yield "std", (
        (*here, "frame", "axis"), by_frame("std", *axes),
        _about("Standard deviation that the receiver claims, NED", "m"),
    )
    yield "nees_position", (
        (*here, "frame"), by_frame("nees_position", "")[..., 0],
        _about("Normalised estimation error squared of the position, 3 expected", "1"),
    )
    for name, words in (
        ("nees_state", "Normalised estimation error squared of position and velocity, 6 expected"),
        ("nis", "Normalised innovation squared"),
        ("nis_degrees", "Degrees of freedom of the NIS"),
    ):
        if any(name in table for table in at.values()):
            yield name, (here, stacked(name)[..., 0], _about(words, "1"))
