"""The project's own format of logs: a folder with a table for each kind of data, and meta.toml."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from pyarrow import parquet
from sblcosim.fmus.files import regular

from .. import manifests
from ..data.estimates import Floats
from ..errors import ConfigurationError, one_line, quoted, shortened
from ..scenario.reading import shown
from ..scenario.schema import toml
from . import meta, text
from .columns import KINDS, TABLES
from .log import Log
from .raw import Raw

SCENARIO = "scenario.toml"
_ENDINGS = (".parquet", ".csv")


def raw_of(folder: Path, about: Mapping[str, Any], where: str) -> Raw:
    """The tables in a folder, unchecked.

    Parameters
    ----------
    about
        What the log says about itself.
    where
        Name of the file that says it, for messages.

    Raises
    ------
    ConfigurationError
        A file cannot be read.
    """
    own = {key: value for key, value in about.items() if key != "mapping"}
    raw = Raw(folder.resolve().name, own, where)
    for name in TABLES:
        files = [
            file for ending in _ENDINGS
            if os.path.lexists(file := folder / f"{name}{ending}")
        ]
        if len(files) > 1:
            raw.remarks.append(f"{files[1].name} is not read: there is {files[0].name}")
        if files:
            raw.files[name] = files[0].name
            raw.tables[name] = table(files[0], name, raw)
    if (folder / SCENARIO).is_file():
        raw.scenario = folder / SCENARIO
    written = manifests.of_folder(folder) or {}
    if manifests.HASHES in written:
        raw.remarks += [
            f"{name} was edited or damaged after it was written"
            for name in manifests.changed(folder, written)
        ]
    return raw


def is_log(folder: Path) -> bool:
    """Whether a folder is a log in this format."""
    return any(
        os.path.lexists(folder / f"{name}{ending}")
        for name in ("receptions", "fixes") for ending in _ENDINGS
    )


def table(path: Path, name: str, raw: Raw, delimiter: str = "") -> pd.DataFrame:
    """A table in a file, CSV or Parquet, with a column of lines or rows.

    Raises
    ------
    ConfigurationError
        The file cannot be read.
    """
    if path.suffix.lower() == ".parquet":
        found = _parquet(path)
        return found.assign(line=range(1, len(found) + 1))
    return text.table(path, name, raw, delimiter)


def _parquet(path: Path) -> pd.DataFrame:
    try:
        table: pd.DataFrame = parquet.read_table(regular(path)).to_pandas()
    except (pa.ArrowException, OSError, ValueError, KeyError, TypeError) as error:
        got = shortened(one_line(error))
        raise ConfigurationError(f"{shown(path)}: must be a table of Parquet, got {got}") from None
    table.columns = [str(column) for column in table.columns]
    again = table.columns[table.columns.duplicated()]
    if len(again):
        raise ConfigurationError(
            f"{shown(path)}: must have columns of different names, got {quoted(again[0])} twice"
        )
    return table


# --- Writing --------------------------------------------------------------------------------------


def frame_of(log: Log) -> pd.DataFrame:
    """The packets of a log as a table."""
    heard = log.receptions
    columns: dict[str, Any] = {
        "arrival_ns": heard.arrival_ns,
        "epoch_ns": heard.epoch_ns,
        "beacon": np.array(log.beacons, object)[heard.beacon],
        **({"kind": np.array(KINDS, object)[heard.kind]} if heard.kind.any() else {}),
        "range_m": heard.range,
        **_three("reported_{}_m", "ned", heard.beacon_position),
    }
    if heard.has_pose.any():
        known = heard.has_pose[:, None]
        place = np.where(known, heard.platform_position, np.nan)
        turn = np.where(known, heard.platform_attitude, np.nan)
        columns |= _three("platform_{}_m", "ned", place)
        columns |= _three("platform_{}_rad", ("roll", "pitch", "yaw"), turn)
    if heard.packet.any():
        for i, name in enumerate(log.beacons):
            columns |= _three(f"packet_{name}_{{}}_m", "ned", heard.packet[:, i])
    return pd.DataFrame(columns)


def _three(name: str, parts: Any, values: Floats) -> dict[str, Floats]:
    return {name.format(part): values[:, i] for i, part in enumerate(parts)}


def write(log: Log, folder: Path) -> None:
    """Write a log into an existing folder; numbers read back are the same to the bit.

    What was left out of the log is not written, and neither are the lines of its source.
    """
    tables = {
        "receptions": frame_of(log),
        "depth": pd.DataFrame({"time_ns": log.depth_ns, "depth_m": log.depth}),
        "fixes": _fixes(log),
    }
    if log.truth is not None:
        truth = {"time_ns": log.truth.time_ns, **_three("{}_m", "ned", log.truth.position)}
        if log.truth.velocity is not None:
            truth |= _three("velocity_{}_m_s", "ned", log.truth.velocity)
        tables["truth"] = pd.DataFrame(truth)
    for name, table in tables.items():
        if len(table):
            table.to_csv(folder / f"{name}.csv", index=False, lineterminator="\n")
    about = {"name": log.name, **log.meta.model_dump(exclude_defaults=True)}
    (folder / meta.FILE).write_text(_toml(about), "utf-8")


def _fixes(log: Log) -> pd.DataFrame:
    """The positions of all devices as a table."""
    each = []
    for name, own in log.fixes.items():
        columns = {"time_ns": own.epoch_ns, "device": name, **_three("{}_m", "ned", own.position)}
        if own.position_std is not None:
            columns["std_m"] = own.position_std[:, 0]
        each.append(pd.DataFrame(columns))
    return pd.concat(each, ignore_index=True) if each else pd.DataFrame()


def _toml(content: Mapping[str, Any], prefix: str = "") -> str:
    """Tables as TOML, keys before tables."""
    lines = [f"{_key(k)} = {toml(v)}" for k, v in content.items() if not isinstance(v, dict)]
    for key, inner in content.items():
        if isinstance(inner, dict):
            name = f"{prefix}{_key(key)}"
            lines += ["", f"[{name}]", _toml(inner, f"{name}.").rstrip("\n")]
    return "\n".join(lines).lstrip("\n") + "\n"


def _key(name: str) -> str:
    bare = name.replace("_", "").replace("-", "")
    return name if bare.isascii() and bare.isalnum() else toml(name)
