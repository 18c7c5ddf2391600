"""Folders of results: written as a whole or not at all, with a manifest of where they come from."""

from __future__ import annotations

import errno
import json
import os
import platform
import shutil
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
from pyarrow import csv, parquet

from .errors import ConfigurationError

MANIFEST = "manifest.json"
PACKAGES = ("sblcosim", "numpy", "casadi", "fmpy", "pandas", "matplotlib")


@contextmanager
def folder(path: str | Path, manifest: Mapping[str, Any]) -> Iterator[Path]:
    """A new folder that appears under its name when everything in it is complete.

    Write into the folder that is given. At the end the manifest is added, with the versions of the
    software and the list of files, and the folder gets its name. On an error or Ctrl-C it vanishes.
    An empty folder that is there already is kept, and gets the files when they are complete.

    Parameters
    ----------
    path
        Where the folder is to be. Results of an earlier run that nobody added to are replaced.
    manifest
        What the manifest says; plain data.

    Raises
    ------
    ConfigurationError
        There is something else under that name, or its parent cannot be written to.
    """
    path = Path(path).resolve()
    _refuse_foreign(path)
    part, old = (path.with_name(f".{path.name}.{uuid.uuid4().hex}") for _ in range(2))
    filled = os.path.isdir(path) and not any(path.iterdir())
    if filled:  # somebody's own folder, perhaps with rights of its own: it stays
        part = path / part.name
    try:
        part.mkdir(parents=True)
    except OSError as error:
        raise _refusal(path, error) from error
    files: list[str] = []
    try:
        yield part
        files = sorted(file.name for file in part.iterdir())
        content = {**manifest, "software": software(), "files": files}
        (part / MANIFEST).write_text(
            json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n", "utf-8"
        )
        if filled:
            _refuse_foreign(path, part.name)
            for name in (*files, MANIFEST):
                (part / name).rename(path / name)
            part.rmdir()
            return
        _refuse_foreign(path)
        if path.exists():
            shutil.copymode(path, part)
            path.rename(old)
        part.rename(path)
    except BaseException as error:
        for name in files:
            if filled and part.exists() and not (part / name).exists():  # it was moved already
                (path / name).unlink(missing_ok=True)
        if old.exists() and not path.exists():
            old.rename(path)
        if isinstance(error, OSError):
            raise _refusal(path, error) from error
        raise
    finally:
        shutil.rmtree(part, ignore_errors=True)
        shutil.rmtree(old, ignore_errors=True)


def check(path: str | Path) -> None:
    """Whether `folder` could write there, as far as this can be said beforehand.

    Raises
    ------
    ConfigurationError
        As `folder`.
    """
    path = Path(path).resolve()
    _refuse_foreign(path)
    above = path.parent
    while not os.path.lexists(above):
        above = above.parent
    if os.path.isdir(path) and not any(path.iterdir()):
        above = path
    if not os.path.isdir(above):
        raise _refusal(path, NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR)))
    if not os.access(above, os.W_OK | os.X_OK):
        raise _refusal(path, PermissionError(errno.EACCES, os.strerror(errno.EACCES)))


def _refusal(path: Path, error: OSError) -> ConfigurationError:
    return ConfigurationError(
        f"{path}: must be a folder that can be made and written to, got {error.strerror or error}"
    )


def _refuse_foreign(path: Path, ours: str | None = None) -> None:
    """Only what an earlier run wrote, all of it listed in its manifest, may be replaced."""
    if not os.path.lexists(path):
        return
    if not os.path.isdir(path):
        raise ConfigurationError(f"{path}: must be a folder or not exist yet, got a file")
    try:
        present = {file.name for file in path.iterdir()} - {ours}
    except OSError as error:
        raise _refusal(path, error) from error
    try:
        known = {*json.loads((path / MANIFEST).read_text("utf-8"))["files"], MANIFEST}
    except (OSError, ValueError, KeyError, TypeError):
        known = set()
    foreign = sorted(present - known)
    if foreign:
        raise ConfigurationError(
            f"{path}: must be empty or hold nothing but an earlier result, got {foreign[0]!r} in it"
        )


def software() -> dict[str, str]:
    """Versions of everything that has a say in the numbers."""
    found = {"python": platform.python_version(), "platform": platform.platform()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


def write_table(table: pd.DataFrame, folder: Path, name: str) -> None:
    """Write a table as Parquet and CSV; numbers in full precision."""
    arrow = pa.Table.from_pandas(table, preserve_index=False)
    parquet.write_table(arrow, folder / f"{name}.parquet")
    csv.write_csv(arrow, folder / f"{name}.csv")


def plain(value: Any) -> Any:
    """The same as numbers, words, lists and dicts that JSON knows; what is missing becomes None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if value is pd.NA:
        return None
    if isinstance(value, float):
        return value if abs(value) < float("inf") else None
    return value if value is None or isinstance(value, (bool, int, str)) else str(value)
