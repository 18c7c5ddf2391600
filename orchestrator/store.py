"""The folder of a study's results.

It holds ``study.json`` (what is run, completely) and ``parts/``: Parquet files, each complete, with
a row per run. What is in the parts is not run again. When all is there, ``runs.parquet`` is the
whole table.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
from pyarrow import parquet
from sblcosim.fmus.files import write_file

from . import artifacts
from .errors import ConfigurationError, one_line
from .points import Campaign, Run
from .study import Study
from .study import load as load_study

RUNS = "runs.parquet"
STUDY = "study.json"
PARTS = "parts"
FORMAT = 1


def check_folder(folder: Path, campaign: Campaign) -> int:
    """See that the folder is of this study, or could be; the replicates that it is to have so far.

    Raises
    ------
    ConfigurationError
        It is of another study, or holds something else.
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
        for file in sorted(folder.iterdir()):
            raise ConfigurationError(
                f"{folder}: must be empty or hold results of this study, got {file.name!r} in it"
            )
    return 0


def open_folder(folder: Path, campaign: Campaign) -> None:
    """Make the folder, or see that it is of this study.

    Raises
    ------
    ConfigurationError
        It is of another study, holds something else, or cannot be written to.
    """
    content = {
        "format": FORMAT,
        "replicates": max(campaign.study.replicates, check_folder(folder, campaign)),
        "title": campaign.study.title,
        "names": {
            name: {"label": f.label, "unit": f.unit} for name, f in campaign.study.factors.items()
        },
        "definition": campaign.definition(),
        "software": artifacts.software(),
    }
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    _write_file(folder / STUDY, text.encode())


def _difference(before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """In which parts two definitions differ."""
    parts = [
        key
        for key in now["study"]
        if before["study"].get(key) != now["study"][key]
    ]
    parts += [key for key in ("scenario", "fmus") if before.get(key) != now[key]]
    return ", ".join(parts).replace("fmus", "FMUs") or "contents"


def described(folder: Path) -> dict[str, Any]:
    """What a folder says about itself."""
    path = folder / STUDY
    try:
        content = json.loads(path.read_text("utf-8"))
    except FileNotFoundError:
        raise ConfigurationError(
            f"{folder}: must be a folder of a study's results, got no {STUDY} in it"
        ) from None
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"{path}: must be readable, got {one_line(error)}") from None
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise ConfigurationError(f"{path}: must have format {FORMAT}, got another")
    return content


def _parts(folder: Path) -> list[Path]:
    return sorted(p for p in (folder / PARTS).glob("*.parquet") if not p.name.startswith("."))


def _parquet(path: Path, columns: list[str] | None = None) -> pa.Table:
    try:
        return parquet.read_table(path, columns=columns, partitioning=None)
    except (OSError, pa.ArrowInvalid) as error:
        raise ConfigurationError(
            f"{path}: must be a Parquet file that can be read, got {one_line(error)}; delete it, "
            "and its runs are done again"
        ) from None


def finished(results: str | Path) -> set[str]:
    """Ids of the runs that are in a folder of results."""
    return {
        run_id
        for path in _parts(Path(results))
        for run_id in _parquet(path, ["run_id"])["run_id"].to_pylist()
    }


def table(results: str | Path) -> pd.DataFrame:
    """All runs in a folder of results, by replicate and point, also of an unfinished campaign.

    Raises
    ------
    ConfigurationError
        There are no runs.
    """
    folder = Path(results)
    described(folder)
    # What is missing in a column of flags is not false.
    flags = {pa.bool_(): pd.BooleanDtype()}.get
    parts = [_parquet(path).to_pandas(types_mapper=flags) for path in _parts(folder)]
    if not parts:
        raise ConfigurationError(f"{folder}: must hold runs, got none yet")
    whole: pd.DataFrame = pd.concat(parts, ignore_index=True).drop_duplicates("run_id")
    known = [c for c in whole if whole[c].dtype == "boolean" and whole[c].notna().all()]
    whole = whole.astype(dict.fromkeys(known, bool))
    return whole.sort_values(["replicate", "point"], ignore_index=True)


def study_of(results: str | Path) -> Study:
    """The study whose results a folder holds."""
    content = described(Path(results))
    definition = content["definition"]
    tables = {k: v for k, v in definition["study"].items() if v is not None}
    tables["design"] = {k: v for k, v in tables["design"].items() if v is not None}
    names = content.get("names", {})
    tables["factors"] = {k: v | names.get(k, {}) for k, v in tables["factors"].items()}
    return load_study(
        {
            **tables,
            "title": content["title"],
            "replicates": content["replicates"],
            "scenario": definition["scenario"],
        }
    )


def write(folder: Path, runs: Sequence[Run], made: pd.DataFrame) -> None:
    """Keep some runs; their part appears when it is complete."""
    ids = hashlib.sha256(" ".join(r.run_id for r in runs).encode()).hexdigest()[:16]
    save(folder / PARTS / f"{runs[0].replicate:06d}-{ids}.parquet", made)


def save(path: Path, made: pd.DataFrame) -> None:
    arrow = pa.Table.from_pandas(made, preserve_index=False)
    for name in ("error", "run_id"):
        place = arrow.schema.get_field_index(name)
        arrow = arrow.set_column(place, name, arrow[name].cast(pa.string()))
    stream = pa.BufferOutputStream()
    parquet.write_table(arrow.replace_schema_metadata(None), stream)
    _write_file(path, stream.getvalue().to_pybytes())


def _write_file(path: Path, content: bytes) -> None:
    try:
        write_file(path, content)
    except OSError as error:
        raise ConfigurationError(
            f"{path}: must be writable, got {error.strerror or error}; runs that are finished "
            "are kept"
        ) from None
