"""Write the paths of a run or a log into its folder."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from datetime import datetime, timedelta
from importlib.util import find_spec
from pathlib import Path

from ..errors import ConfigurationError, check_choice, shortened
from ..tracks.place import Origin
from . import geojson, gpx, kml, mcap, tum
from .diver_path import DiverPath
from .earth import EPOCH, on_earth

TUM, MCAP = "tum", "mcap"
TRAJECTORIES = (TUM, MCAP)
"""Files that are written if asked for; they need no place on Earth."""
_YEARS = 1970, 2200


def check(trajectories: str | Collection[str]) -> tuple[str, ...]:
    """The kinds of trajectories, each once and in their order.

    Raises
    ------
    ConfigurationError
        There is no such kind, or a package that it needs is not installed.
    """
    wanted = (trajectories,) if isinstance(trajectories, str) else tuple(trajectories)
    for kind in wanted:
        check_choice("trajectories", kind, TRAJECTORIES)
    if MCAP in wanted and find_spec("mcap") is None:
        raise ConfigurationError(
            "trajectories: must have the package mcap for 'mcap', got none; "
            "pip install 'sblcosim[mcap]'"
        )
    return tuple(kind for kind in TRAJECTORIES if kind in wanted)


def write(
    folder: Path, title: str, paths: Sequence[DiverPath], origin: Origin | None = None, *,
    start: datetime | None = None, trajectories: str | Collection[str] = (),
    dated: bool = False,
) -> None:
    """Write paths for maps, if the origin is known, and trajectories, if asked for.

    Parameters
    ----------
    folder
        An existing folder. It gets ``path.geojson``, ``path.gpx`` and ``path.kml`` with an origin,
        ``path-NAME.tum`` for each path, and ``path.mcap``.
    title
        Title of the maps.
    paths
        The paths, the true one first.
    origin
        Origin of north, east and down.
    start
        Clock time of time 0, with a time zone; None: the start of 1970.
    trajectories
        Some of `TRAJECTORIES`.
    dated
        Whether times of the paths are since 1970.

    Raises
    ------
    ConfigurationError
        As in `check`; or the start has no time zone, or times are out of the range of a file.
    """
    wanted = check(trajectories)
    _check_start(start)
    if not paths:
        return
    if origin is not None:
        earth = [on_earth(path, origin) for path in paths]
        geojson.write(folder, earth, origin, start)
        gpx.write(folder, title, earth, start, dated)
        kml.write(folder, title, earth, start, dated)
    if TUM in wanted:
        tum.write(folder, paths, start_ns(start))
    if MCAP in wanted:
        mcap.write(folder, title, paths, origin, start_ns(start))


def start_ns(start: datetime | None) -> int:
    """Time 0 since 1970 [ns]."""
    return 0 if start is None else (start - EPOCH) // timedelta(microseconds=1) * 1000


def _check_start(start: datetime | None) -> None:
    if start is None:
        return
    first, last = _YEARS
    if start.tzinfo is None or not first <= start.year < last:
        raise ConfigurationError(
            f"start: must have a time zone and a year from {first} to {last - 1}, got "
            f"{shortened(str(start))}"
        )
