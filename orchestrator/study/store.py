"""The result folder of a study.

It holds ``study.json`` (the complete definition of the runs) and ``parts/``: Parquet files, each
written as a whole, with a row per run. Runs in the parts are not repeated. When all are done,
``runs.parquet`` holds the whole table.

The name of a part ends with the SHA-256 of the file, and ``study.json`` contains its own, so that
damaged data are never taken for results: a damaged part is moved to ``parts/damaged/`` and its runs
are repeated.
"""

from __future__ import annotations

import hashlib
import json
import os
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
from pyarrow import parquet
from sblcosim.fmus import files

from .. import artifacts
from ..errors import ConfigurationError, ConfigurationWarning, DamageWarning, one_line
from .campaign import Campaign, Run

RUNS = "runs.parquet"
STUDY = "study.json"
PARTS = "parts"
DAMAGED = "damaged"
FORMAT = 2


def check_folder(folder: Path, campaign: Campaign) -> int:
    """Check that the folder belongs to this study or is empty; return the replicates it has so far.

    Raises
    ------
    ConfigurationError
        The folder belongs to another study, or holds something else.
    """
    if os.path.lexists(folder) and not folder.is_dir():
        raise ConfigurationError(f"{folder}: must be a folder or not exist yet, got a file")
    if (folder / STUDY).exists():
        before, definition = described(folder), campaign.definition()
        if before["definition"] != definition:
            raise ConfigurationError(
                f"{folder}: must be empty or hold results of this study, got those of "
                f"{before['definition']['study']['name']!r} with other "
                f"{_difference(before['definition'], definition)}"
            )
        return int(before["replicates"])
    if folder.is_dir():
        names = sorted(f.name for f in folder.iterdir() if not files.is_hidden(f.name))
        if PARTS in names and set(names) <= {PARTS, RUNS}:
            return _replicates(folder, campaign)
        for name in names:
            raise ConfigurationError(
                f"{folder}: must be empty or hold results of this study, got {name!r} in it"
            )
    return 0


def _replicates(folder: Path, campaign: Campaign) -> int:
    """Number of replicates in a folder that has lost its `STUDY`."""
    runs = finished(folder, ["point", "replicate"])
    for run_id, (point, replicate) in runs.items():
        seed = campaign.study.run_seed(point, replicate)
        if not 0 < point <= len(campaign.points) or (
            campaign.points[point - 1].run_id(seed) != run_id
        ):
            raise ConfigurationError(
                f"{folder}: must hold results of this study, got run {run_id} of another in it"
            )
    return max((replicate for _, replicate in runs.values()), default=0)


def open_folder(folder: Path, campaign: Campaign) -> None:
    """Make the folder, or check that it belongs to this study.

    Raises
    ------
    ConfigurationError
        The folder belongs to another study, holds something else, or is not writable.
    """
    content = {
        "format": FORMAT,
        "replicates": max(campaign.study.replicates, check_folder(folder, campaign)),
        "title": campaign.study.title,
        "names": {
            name: {"label": f.label, "unit": f.unit}
            for name, f in (campaign.study.factors | campaign.study.conditions).items()
        },
        "definition": campaign.definition(),
        "software": artifacts.software(),
    }
    _write_file(folder / STUDY, sealed(content))
    set_aside(folder)


def sealed(content: Mapping[str, Any]) -> bytes:
    """The description of a folder as JSON text, with its own SHA-256."""
    whole = {**content, "sha256": _digest(content)}
    return (json.dumps(whole, indent=2, ensure_ascii=False, allow_nan=False) + "\n").encode()


def _digest(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


@contextmanager
def at_work(folder: Path) -> Iterator[None]:
    """Mark a folder as in use by this process, and warn if another one uses it."""
    with ExitStack() as stack:
        try:
            files.make_folder(folder)
            files.sweep(folder / PARTS)
            files.sweep(folder)
            other = any(map(files.is_hidden, os.listdir(folder)))
            stack.enter_context(files.unfinished(folder))
        except OSError as error:
            raise _refusal(folder, error) from None
        if other:
            warnings.warn(
                f"{folder}: should have one study at a time, got another that is at work there; "
                "the table will be right, but runs are done twice",
                ConfigurationWarning,
                stacklevel=2,
            )
        yield


def _difference(before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Names of the parts in which two definitions differ."""
    parts = [
        key
        for key in now["study"]
        if before["study"].get(key) != now["study"][key]
    ]
    parts += [key for key in ("scenario", "fmus") if before.get(key) != now[key]]
    return ", ".join(parts).replace("fmus", "FMUs") or "contents"


def described(folder: Path) -> dict[str, Any]:
    """Read the description of a folder."""
    path = folder / STUDY
    try:
        content = json.loads(path.read_text("utf-8"))
    except FileNotFoundError:
        raise ConfigurationError(
            f"{folder}: must be a folder of a study's results, got no {STUDY} in it"
        ) from None
    except (OSError, ValueError, RecursionError) as error:
        raise ConfigurationError(f"{path}: must be readable, got {one_line(error)}") from None
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise ConfigurationError(
            f"{path}: must have format {FORMAT}, got another, of another version of sblcosim"
        )
    if content.pop("sha256", None) != _digest(content):
        raise ConfigurationError(
            f"{path}: must be as it was written, got other content; delete it, and 'sblcosim "
            "study' with the same study and folder writes it again"
        )
    return content


def _parts(folder: Path) -> list[Path]:
    return sorted(p for p in (folder / PARTS).glob("*.parquet") if not p.name.startswith("."))


def _name(runs: str, content: bytes) -> str:
    """Name of a part: its runs, and the hash of the file."""
    return f"{runs}-{hashlib.sha256(content).hexdigest()[:32]}.parquet"


def _parquet(path: Path, columns: list[str] | None = None) -> pa.Table | None:
    """Read a part; None if it is damaged or gone."""
    try:
        content = path.read_bytes()
        if path.name != _name(path.stem.rpartition("-")[0], content):
            return None
        part = parquet.read_table(pa.BufferReader(content), columns=columns)
    except FileNotFoundError:
        return None  # another process has moved it away
    except (OSError, pa.ArrowInvalid) as error:
        raise ConfigurationError(
            f"{path}: must be a Parquet file that can be read, got {one_line(error)}"
        ) from None
    for name in ("run_id", "replicate", "point") if columns is None else columns:
        if name not in part.column_names:
            raise ConfigurationError(f"{path}: must have a column {name}, got none")
    return part


_OTHER = "must be as it was written, got other bytes"


def set_aside(folder: Path) -> None:
    """Move damaged parts away, and warn about each."""
    for path in _parts(folder):
        if _parquet(path, []) is None and path.exists():
            target = path.parent / DAMAGED / path.name
            try:
                files.make_folder(target.parent)
                path.replace(target)
            except OSError as error:
                raise _refusal(target, error) from None
            _warn(f"{path}: {_OTHER}; it is now in {DAMAGED}/, and its runs are done again")


def _warn(message: str) -> None:
    warnings.warn(message, DamageWarning, stacklevel=3)


def finished(
    results: str | Path, columns: Sequence[str] = (), *, tell: bool = False
) -> dict[str, tuple[int, ...]]:
    """Ids of the finished runs in a result folder, with the values of some integer columns.

    Parameters
    ----------
    tell
        Warn about damaged parts, whose runs count as missing.
    """
    runs: dict[str, tuple[int, ...]] = {}
    for path in _parts(Path(results)):
        part = _parquet(path, ["run_id", *columns])
        if part is None:
            if tell:
                _warn(f"{path}: {_OTHER}; its runs count as missing")
            continue
        run_ids, *numbers = (part[name].to_pylist() for name in ("run_id", *columns))
        runs |= dict(zip(run_ids, zip(*numbers, strict=True) if columns else [()] * len(run_ids),
                          strict=True))
    return runs


def table(results: str | Path) -> pd.DataFrame:
    """All finished runs in a result folder, sorted by replicate and point.

    Raises
    ------
    ConfigurationError
        There are no runs, or a part is damaged.
    """
    folder = Path(results)
    described(folder)
    # Nullable type: a missing flag must not become False.
    flags = {pa.bool_(): pd.BooleanDtype()}.get
    parts = []
    for path in _parts(folder):
        part = _parquet(path)
        if part is None:
            raise ConfigurationError(
                f"{path}: {_OTHER}; 'sblcosim study' with the same study and folder does its runs "
                "again"
            )
        parts.append(part.to_pandas(types_mapper=flags))
    if not parts:
        raise ConfigurationError(f"{folder}: must hold runs, got none yet")
    whole: pd.DataFrame = pd.concat(parts, ignore_index=True).drop_duplicates("run_id")
    known = [c for c in whole if whole[c].dtype == "boolean" and whole[c].notna().all()]
    whole = whole.astype(dict.fromkeys(known, bool))
    return whole.sort_values(["replicate", "point"], ignore_index=True)


def write(folder: Path, runs: Sequence[Run], made: pd.DataFrame) -> None:
    """Store some runs as a part, which appears when it is complete."""
    ids = hashlib.sha256(" ".join(r.run_id for r in runs).encode()).hexdigest()[:16]
    content = _as_parquet(made)
    name = _name(f"{runs[0].replicate:06d}-{ids}", content)
    # The hash in its name reveals an incomplete file, so do not wait for the disk.
    _write_file(folder / PARTS / name, content, durable=False)


def save(path: Path, made: pd.DataFrame) -> None:
    """Write a table of runs."""
    _write_file(path, _as_parquet(made))


def _as_parquet(frame: pd.DataFrame) -> bytes:
    arrow = pa.Table.from_pandas(frame, preserve_index=False)
    for name in ("error", "run_id"):
        index = arrow.schema.get_field_index(name)
        arrow = arrow.set_column(index, name, arrow[name].cast(pa.string()))
    stream = pa.BufferOutputStream()
    parquet.write_table(arrow.replace_schema_metadata(None), stream)
    content: bytes = stream.getvalue().to_pybytes()
    return content


def _write_file(path: Path, content: bytes, durable: bool = True) -> None:
    try:
        files.write_file(path, content, durable=durable)
    except OSError as error:
        raise _refusal(path, error) from None


def _refusal(path: Path, error: OSError) -> ConfigurationError:
    return ConfigurationError(
        f"{path}: must be writable, got {error.strerror or error}; runs that are finished are kept"
    )
