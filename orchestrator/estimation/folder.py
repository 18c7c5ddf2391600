"""Read a run back from the folder written by `sblcosim.results.result.Result.save`."""

from __future__ import annotations

import re
import tomllib
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import parquet
from sblcosim.fmus import files
from sblcosim.fmus.host.nanoseconds import nanoseconds

from .. import manifests
from ..data.description import RunDescription
from ..data.estimates import Estimates, Integers
from ..data.record import Record
from ..data.truth import TRUTH
from ..errors import ConfigurationError, ConfigurationWarning, one_line, shortened
from ..manifests import HASHES, MANIFEST, OTHER
from ..results.result import MADE, Result
from ..scenario.reading import shown
from ..scenario.scenario import Scenario, load
from ..scenario.schema import CORE_COMPONENTS

RECORD = "record.parquet"
SCENARIO = "scenario.toml"
_LONGEST = 300
"""Number of characters shown of a message about an edited scenario."""
_INDEX = r"(?:\[(\d{1,3}(?:,\d{1,3})*)\])?"
_OUTPUT = re.compile(rf"([^.\[\]]+\.[^\[\]]+){_INDEX}")
_FIELD = re.compile(rf"([^.\[\]]+){_INDEX}")


def read_run(folder: str | Path) -> Result:
    """The result of a run from its folder.

    Raises
    ------
    ConfigurationError
        There is no such folder, it does not hold a run, or its files are damaged.
    """
    path = Path(folder)
    what = "must be a folder written by 'sblcosim run'"
    if not path.is_dir():
        got = "a file" if path.exists() else "nothing of that name"
        raise ConfigurationError(f"{shown(path)}: {what}, got {got}")
    for name in (MANIFEST, RECORD, SCENARIO):
        if not (path / name).is_file():
            if name == SCENARIO and _is_of_package(path):
                raise ConfigurationError(
                    f"{shown(path)}: a run of a package cannot be smoothed, because a package does "
                    "not "
                    f"state its errors (there is no {SCENARIO}); run and smooth the scenario"
                )
            raise ConfigurationError(f"{shown(path)}: {what}, got no {name} in it")
    about = _manifest(path)
    changed = _changed(path, about)
    scenario = _scenario(path / SCENARIO, about["scenario"], SCENARIO in changed)
    time_ns, values = _record(path / RECORD)
    labels = [str(receiver["label"]) for receiver in about["receivers"]]
    made = {n: _made(file) for n in labels if (file := path / f"{MADE}{n}.parquet").is_file()}
    missing = [name for name in TRUTH if name not in values]
    missing += [f"{n}.update_count" for n in labels if f"{n}.update_count" not in values
                and n not in {*about.get("failures", {}), *made}]
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
    ran = [label for label in labels if label not in made]
    record = Record(time_ns, values, _intervals(scenario, ran))
    interval_ns = nanoseconds(scenario.receiver.update_interval_s)
    return Result(description, record, interval_ns, about.get("failures"), made=made)


def _intervals(scenario: Scenario, labels: list[str]) -> dict[str, int]:
    tables = {name: getattr(scenario, name) for name in CORE_COMPONENTS}
    tables |= dict.fromkeys(labels, scenario.receiver)
    return {name: nanoseconds(table.interval_s) for name, table in tables.items()}


def _is_of_package(path: Path) -> bool:
    """Whether a folder holds a run of a package."""
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
    """Files that have changed since they were written; a damaged record is refused."""
    if HASHES not in about:
        warnings.warn(
            f"{shown(path)}: must have hashes of its files in {MANIFEST}, got none, as in folders "
            "of earlier versions; damaged files go unnoticed", ConfigurationWarning, stacklevel=4
        )
    changed = manifests.changed(path, about)
    for name in changed:
        if name == RECORD or name.startswith(MADE):
            raise ConfigurationError(
                f"{shown(path / name)}: {OTHER}; repeat the run, into another folder"
            )
    for name in changed:
        if name != SCENARIO:
            manifests.warn(path, name, "the smoother does not need it")
    return changed


def _scenario(path: Path, before: Mapping[str, Any], changed: bool) -> Scenario:
    """The scenario of a run; one that has changed counts as edited."""
    try:
        scenario = load(path)
    except ConfigurationError as error:
        if not changed:
            raise
        raise ConfigurationError(
            f"{shown(path)}: must be unchanged, or edited into a valid scenario, "
            f"got {shortened(one_line(error), _LONGEST)}"
        ) from None
    if changed:
        now = ", ".join(_differences(path, scenario, before))
        warnings.warn(
            f"{shown(path)}: was edited or damaged after the run; the smoother uses its current "
            f"content{f': {shortened(now, _LONGEST)}' if now else ''}",
            ConfigurationWarning, stacklevel=4,
        )
    return scenario


def _differences(path: Path, scenario: Scenario, before: Mapping[str, Any]) -> Iterator[str]:
    """Keys in a file whose values differ from the run's."""
    after = RunDescription(scenario.name, scenario, ()).manifest()["scenario"]
    for table, given in tomllib.loads(path.read_text("utf-8")).items():
        inner = isinstance(given, dict) and isinstance(before.get(table), dict)
        for key in given if inner else ("",):
            now, was = (s.get(table) if not inner else s[table].get(key) for s in (after, before))
            if now != was and not _is_file(now):
                yield f"{f'{table}.{key}' if inner else table} = {now!r} (was {was!r})"


def _is_file(value: object) -> bool:
    """Whether a value may be a path, which differs between folders."""
    return isinstance(value, str) and bool(Path(value).suffix)


def _record(path: Path) -> tuple[Integers, dict[str, NDArray[np.generic]]]:
    """Instants [ns], and the outputs in their shapes."""
    columns = _read(path)
    time_s = columns.pop("time_s", np.zeros(0))
    if time_s.dtype != np.float64 or not len(time_s) or not np.all(np.diff(time_s) > 0):
        raise _refusal(path, "no time_s that increases")
    return np.rint(time_s * 1e9).astype(np.int64), _shaped(path, columns, _OUTPUT)


def _made(path: Path) -> Estimates:
    """Estimates that were made after the run."""
    values = _shaped(path, _read(path), _FIELD)
    known = {f.name for f in fields(Estimates)}
    missing = [*({"epoch_ns", "position"} - values.keys()), *(values.keys() - known)]
    if missing:
        raise _refusal(path, missing[0])
    return Estimates(**values)


def _read(path: Path) -> dict[str, NDArray[Any]]:
    try:
        table = parquet.read_table(files.regular(path))
        return {name: table[name].to_numpy() for name in table.column_names}
    except (pa.ArrowException, OSError, ValueError, KeyError) as error:
        got = shortened(one_line(error))
        raise ConfigurationError(f"{shown(path)}: must be a table of Parquet, got {got}") from None


def _refusal(path: Path, got: str) -> ConfigurationError:
    return ConfigurationError(
        f"{shown(path)}: must be the record of a run, got {shortened(got)}"
    )


def _shaped(
    path: Path, columns: Mapping[str, NDArray[Any]], pattern: re.Pattern[str]
) -> dict[str, NDArray[Any]]:
    """The arrays that `frame_of` turned into columns."""
    wrong = [name for name, values in columns.items() if values.dtype.kind not in "fiub"]
    elements: dict[str, dict[tuple[int, ...], NDArray[Any]]] = {}
    for name, column in columns.items():
        match = pattern.fullmatch(name)
        if match is None:
            wrong.append(name)
        else:
            index = tuple(int(i) - 1 for i in match[2].split(",")) if match[2] else ()
            elements.setdefault(match[1], {})[index] = column
    values = {}
    for name, parts in elements.items():
        shape = tuple(np.max(list(parts), axis=0) + 1) if () not in parts else ()
        if len(parts) != np.prod(shape, dtype=int) or {*parts} != {*np.ndindex(shape)}:
            wrong.append(name)
        else:
            rows = np.stack([parts[index] for index in np.ndindex(shape)], axis=1)
            values[name] = rows.reshape(len(rows), *shape)
    if wrong:
        raise _refusal(path, wrong[0])
    return values
