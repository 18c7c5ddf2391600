"""Logs for tests: of simulated dives, and made by hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import sblcosim
from numpy.typing import NDArray
from sblcosim.data.estimates import Estimates
from sblcosim.logs.checks import log_of
from sblcosim.logs.log import Log
from sblcosim.logs.raw import Raw
from sblcosim.logs.read import read_log
from sblcosim.processing.processed import Processed

PLACES = {"A": [1.0, 2.0, 3.0], "B": [40.0, -5.0, 6.0], "C": [-7.0, 80.0, 9.0]}
"""Beacons of a log of a few lines."""
CORNERS = np.array([[40.0, 40, 14], [-40, 40, 12], [-40, -40, 13], [40, -40, 15]])


def checked(meta: dict[str, Any] | None = None, **tables: dict[str, Any]) -> Log:
    """The log of some tables; lines count from 2."""
    raw = Raw("log", {"beacons": PLACES, **(meta or {})})
    for name, columns in tables.items():
        raw.tables[name] = pd.DataFrame(columns)
        raw.tables[name]["line"] = np.arange(len(raw.tables[name])) + 2
        raw.files[name] = f"{name}.csv"
    return log_of(raw)


def written(folder: Path, scenario: str, receivers: Any, **keys: Any) -> tuple[Any, Path]:
    """A run, and its log in a folder."""
    run = sblcosim.run(scenario, receivers, keys.pop("overrides", {}))
    run.save(folder, figures=False, log=True)
    return run, folder / "log"


def made(
    *, seconds: int = 300, beacons: NDArray[np.float64] = CORNERS, std: float = 0.1,
    speed: float = 0.5, seed: int = 1, meta: Mapping[str, Any] | None = None,
    scale: float = 1.0, offsets: NDArray[np.float64] | None = None, start_s: float = 0.0,
    plane: bool = False, truth: bool = True, origin: tuple[float, float, float] = (0, 0, 0),
    turning: float = 0.02,
) -> Log:
    """The log of a diver on an arc among fixed beacons, one range a second, as a device gives it.

    Parameters
    ----------
    turning
        Rate of turn [rad/s].
    """
    random = np.random.default_rng(seed)
    time = np.arange(1, seconds + 1, dtype=float)
    angle = turning * time
    radius = speed / turning
    position = np.column_stack([
        radius * np.sin(angle), radius * (1 - np.cos(angle)), np.full(len(time), 8.0),
    ])
    if plane:
        position[:, 2] = 0.0
    beacon = np.arange(len(time)) % len(beacons)
    at = beacons[beacon].copy()
    if plane:
        at[:, 2] = 0.0
    off = np.zeros(len(beacons)) if offsets is None else offsets
    ranges = scale * np.linalg.norm(position - at, axis=1) + off[beacon]
    ranges += std * random.standard_normal(len(time))
    at, position = at + origin, position + origin
    ns = np.rint((time + start_s) * 1e9).astype(np.int64)
    raw = Raw("made", meta={"dimension": 2 if plane else 3, **(meta or {})})
    raw.tables["receptions"] = pd.DataFrame({
        "arrival_ns": ns, "epoch_ns": ns, "beacon": [f"B{b}" for b in beacon], "range_m": ranges,
        "reported_n_m": at[:, 0], "reported_e_m": at[:, 1], "reported_d_m": at[:, 2],
        "line": np.arange(2, len(time) + 2),
    })
    if not plane:
        deep = position[:, 2] + 0.05 * random.standard_normal(len(time))
        raw.tables["depth"] = pd.DataFrame({"time_ns": ns, "depth_m": deep})
    if truth:
        raw.tables["truth"] = pd.DataFrame({
            "time_ns": ns, "n_m": position[:, 0], "e_m": position[:, 1], "d_m": position[:, 2],
        })
    return log_of(raw)


def on_a_boat(**keys: Any) -> Log:
    """A log of `made`, whose beacons are on arms of a boat that is moored and reports its pose."""
    arms = np.array([[4.0, 4.0, 2.0], [-4.0, 4.0, 1.5], [-4.0, -4.0, 2.0], [4.0, -4.0, 1.0]])
    log = made(beacons=arms, **keys)
    heard = log.receptions
    meta = log.meta.model_copy(update={
        "arms_m": dict(zip(log.beacons, map(tuple, arms.tolist()), strict=True))})
    return replace(log, receptions=replace(heard, has_pose=np.ones(len(heard), bool)), meta=meta)


def in_folder(folder: Path) -> Path:
    """A short log in the project's own format, as a device gives it."""
    from sblcosim.logs.folder import write

    folder.mkdir()
    write(made(seconds=60), folder)
    return folder


def processed() -> Processed:
    """A short log with the raw fixes only, without running anything."""
    log = made(seconds=20)
    own = Estimates(
        epoch_ns=np.arange(3, 20, dtype=np.int64) * 10**9, position=np.ones((17, 3))
    )
    return Processed(log=log, scenario=sblcosim.load("harbour-lbl"), made={"raw": own},
                     truth=log.truth)


def changed(log: Log, which: Any, by: Any) -> Log:
    """A log with other ranges."""
    ranges = log.receptions.range.copy()
    ranges[which] += by
    return replace(log, receptions=replace(log.receptions, range=ranges))


__all__ = ["CORNERS", "PLACES", "changed", "checked", "made", "on_a_boat", "read_log", "written"]
