"""Read a run back from the folder that `sblcosim.results.result.Result.save` has written."""

from __future__ import annotations

import re
import tomllib
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import parquet
from sblcosim.fmus import files
from sblcosim.fmus.host.nanoseconds import nanoseconds

from .. import manifests
from ..errors import ConfigurationError, ConfigurationWarning, one_line, shortened
from ..manifests import HASHES, MANIFEST, OTHER
from ..results.definitions import TRUTH
from ..results.description import RunDescription
from ..results.result import Result
from ..scenario.reading import shown
from ..scenario.scenario import Scenario, load
from ..scenario.schema import CORE_COMPONENTS
from ..simulation.record import Record

RECORD = "record.parquet"
SCENARIO = "scenario.toml"
_LONGEST = 300
"""Characters of what is said of a scenario that was edited."""
_COLUMN = re.compile(r"([^.\[\]]+\.[^\[\]]+)(?:\[(\d{1,3}(?:,\d{1,3})*)\])?")


def read_run(folder: str | Path) -> Result:
    """The result of a run from its folder.

    Raises
    ------
    ConfigurationError
        There is no such folder, it holds no run, or its files are damaged.
    """
    path = Path(folder)
    what = "must be a folder that 'sblcosim run' has written"
    if not path.is_dir():
        got = "a file" if path.exists() else "nothing of that name"
        raise ConfigurationError(f"{shown(path)}: {what}, got {got}")
    for name in (MANIFEST, RECORD, SCENARIO):
        if not (path / name).is_file():
            if name == SCENARIO and _is_of_package(path):
                raise ConfigurationError(
                    f"{shown(path)}: a run of a package cannot be smoothed, as a package does not "
                    f"say what its errors are (there is no {SCENARIO}); run and smooth the scenario"
                )
            raise ConfigurationError(f"{shown(path)}: {what}, got no {name} in it")
    about = _manifest(path)
    changed = _changed(path, about)
    scenario = _scenario(path / SCENARIO, about["scenario"], SCENARIO in changed)
    time_ns, values = _columns(path / RECORD)
    labels = [str(receiver["label"]) for receiver in about["receivers"]]
    missing = [name for name in TRUTH if name not in values]
    missing += [f"{n}.update_count" for n in labels if f"{n}.update_count" not in values
                and n not in about.get("failures", {})]
    if missing:
        raise ConfigurationError(
            f"{shown(path / RECORD)}: must have all outputs of the run, got no {', '.join(missing)}"
        )
    description = RunDescription(
        scenario_name=about["scenario_name"],
        scenario=scenario,
        receivers=labels,
        fmus=about["fmus"],
        seeds=about["seeds"],
        origins={
            str(receiver["label"]): {k: v for k, v in receiver.items() if k != "label"}
            for receiver in about["receivers"]
        },
        remarks=about["remarks"],
    )
    record = Record(time_ns, values, _intervals(scenario, labels))
    interval_ns = nanoseconds(scenario.receiver.update_interval_s)
    return Result(description, record, interval_ns, about.get("failures"))


def _intervals(scenario: Scenario, labels: list[str]) -> dict[str, int]:
    tables = {name: getattr(scenario, name) for name in CORE_COMPONENTS}
    tables |= dict.fromkeys(labels, scenario.receiver)
    return {name: nanoseconds(table.interval_s) for name, table in tables.items()}


def _is_of_package(path: Path) -> bool:
    """Whether a folder is that of a run of a package."""
    scenario = (manifests.of_folder(path) or {}).get("scenario")
    return isinstance(scenario, dict) and "package" in scenario


def _manifest(path: Path) -> dict[str, Any]:
    """The manifest of a run, from its folder."""
    content = manifests.of_folder(path) or {}
    where = shown(path / MANIFEST)
    kinds = {"scenario_name": str, "receivers": list, "fmus": dict, "seeds": dict, "remarks": list,
             "scenario": dict}
    for key, kind in kinds.items():
        if not isinstance(content.get(key), kind):
            raise ConfigurationError(f"{where}: must be the manifest of a run, got no {key} in it")
    if not all(isinstance(r, dict) and isinstance(r.get("label"), str) for r in
               content["receivers"]) or not isinstance(content.get("failures", {}), dict):
        raise ConfigurationError(f"{where}: must be the manifest of a run, got other receivers")
    return content


def _changed(path: Path, about: Mapping[str, Any]) -> list[str]:
    """Files that are not as they were written, a damaged record being refused."""
    if HASHES not in about:
        warnings.warn(
            f"{shown(path)}: must have hashes of its files in {MANIFEST}, got none, as in folders "
            "of earlier versions; damaged files go unnoticed", ConfigurationWarning, stacklevel=4
        )
    changed = manifests.changed(path, about)
    if RECORD in changed:
        raise ConfigurationError(
            f"{shown(path / RECORD)}: {OTHER}; do the run again, into another folder"
        )
    for name in changed:
        if name != SCENARIO:
            manifests.warn(path, name, "the smoother does not need it")
    return changed


def _scenario(path: Path, before: Mapping[str, Any], changed: bool) -> Scenario:
    """The scenario of a run; one that is not as it was written is taken as edited."""
    try:
        scenario = load(path)
    except ConfigurationError as error:
        if not changed:
            raise
        raise ConfigurationError(
            f"{shown(path)}: must be as it was written, or edited into a scenario that is right, "
            f"got {shortened(one_line(error), _LONGEST)}"
        ) from None
    if changed:
        now = ", ".join(_differences(path, scenario, before))
        warnings.warn(
            f"{shown(path)}: was edited or damaged after the run; the smoother goes by what it "
            f"says now{f': {shortened(now, _LONGEST)}' if now else ''}",
            ConfigurationWarning, stacklevel=4,
        )
    return scenario


def _differences(path: Path, scenario: Scenario, before: Mapping[str, Any]) -> Iterator[str]:
    """Keys in a file that were others in the run."""
    after = RunDescription(scenario.name, scenario, ()).manifest()["scenario"]
    for table, given in tomllib.loads(path.read_text("utf-8")).items():
        inner = isinstance(given, dict) and isinstance(before.get(table), dict)
        for key in given if inner else ("",):
            now, was = (s.get(table) if not inner else s[table].get(key) for s in (after, before))
            if now != was and not _is_file(now):
                yield f"{f'{table}.{key}' if inner else table} = {now!r} (was {was!r})"


def _is_file(value: object) -> bool:
    """Whether a value may be a path, which differs from folder to folder."""
    return isinstance(value, str) and bool(Path(value).suffix)


def _columns(path: Path) -> tuple[NDArray[np.int64], dict[str, NDArray[np.generic]]]:
    """Instants [ns], and the outputs in their shapes."""
    where = shown(path)
    try:
        table = parquet.read_table(files.regular(path))
        found = {name: table[name].to_numpy() for name in table.column_names}
    except (pa.ArrowException, OSError, ValueError, KeyError) as error:
        got = shortened(one_line(error))
        raise ConfigurationError(f"{where}: must be a table of Parquet, got {got}") from None
    time_s = found.pop("time_s", np.zeros(0))
    wrong = ""
    if time_s.dtype != np.float64 or not len(time_s) or not np.all(np.diff(time_s) > 0):
        wrong = "no time_s that increases"
    wrong = wrong or next((n for n, v in found.items() if v.dtype.kind not in "fiub"), "")
    elements: dict[str, dict[tuple[int, ...], NDArray[np.generic]]] = {}
    for name, column in found.items():
        match = _COLUMN.fullmatch(name)
        if match is None:
            wrong = wrong or name
        else:
            index = tuple(int(i) - 1 for i in match[2].split(",")) if match[2] else ()
            elements.setdefault(match[1], {})[index] = column
    values = {}
    for name, parts in elements.items():
        shape = tuple(np.max(list(parts), axis=0) + 1) if () not in parts else ()
        if len(parts) != np.prod(shape, dtype=int) or {*parts} != {*np.ndindex(shape)}:
            wrong = wrong or name
        else:
            rows = np.stack([parts[index] for index in np.ndindex(shape)], axis=1)
            values[name] = rows.reshape(len(time_s), *shape)
    if wrong:
        raise ConfigurationError(f"{where}: must be the record of a run, got {shortened(wrong)}")
    return np.rint(time_s * 1e9).astype(np.int64), values
