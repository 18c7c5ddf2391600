"""Result folders: written completely or not at all, with a manifest that records their origin."""

from __future__ import annotations

import errno
import json
import os
import platform
import shutil
import warnings
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Literal, get_args

import pandas as pd
import pyarrow as pa
from pyarrow import csv, parquet
from sblcosim.fmus import files, stopping

from . import manifests
from .errors import ConfigurationError, DamageWarning, check_choice, resolved
from .manifests import FILES, HASHES, MANIFEST

UNFINISHED, NOTE = "-unfinished", "unfinished.txt"
"""Suffix of the folder with the runs of an unfinished command, and the file that marks it."""
PACKAGES = ("sblcosim", "numpy", "casadi", "fmpy", "pandas", "matplotlib")


Other = Literal["replace", "refuse", "number"]


@dataclass
class Draft:
    """A result folder while it is being written.

    Attributes
    ----------
    folder
        Temporary folder; write into it.
    path
        Intended path of the result; at the end, its actual path.
    given
        The path as the caller gave it.
    """

    folder: Path
    path: Path
    given: Path

    @property
    def saved(self) -> Path:
        """Final place of the result, in the folder of the given path."""
        return self.given.with_name(self.path.name)


@contextmanager
def folder(path: str | Path, manifest: Mapping[str, Any]) -> Iterator[Path]:
    """Like `draft`, for a result that replaces any earlier one."""
    with draft(path, manifest) as result:
        yield result.folder


@contextmanager
def draft(
    path: str | Path, manifest: Mapping[str, Any], other: Other = "replace", *, adds: bool = False
) -> Iterator[Draft]:
    """A new folder that gets its final name only when its contents are complete.

    Write into ``Draft.folder``; a folder in it must also be made by `draft`. At the end the
    manifest is added, with the software versions and the list of files, and the folder is renamed.
    On an error or Ctrl-C it is removed. The remains of a killed process are removed by the next
    one. An existing empty folder is kept, and receives the files when they are complete.

    Parameters
    ----------
    path
        Path of the folder. An equal result (same manifest, any software version) is replaced,
        unless files have been added to it.
    manifest
        Content of the manifest, as plain data.
    other
        What to do if a different result has this name: replace it, refuse to write, or give the
        new folder the next free number.
    adds
        Whether files that only an equal earlier result of the same software has, are kept. The
        manifest must then decide all of them.

    Raises
    ------
    ConfigurationError
        The path holds something else, or its parent is not writable.
    """
    given = Path(path)
    check(given, manifest, other)
    path = resolved(given)
    try:
        empty = _is_empty(path)
        # Keep a folder that the user made: it may have its own permissions.
        above = path if empty else path.parent
        files.make_folder(above)
        with files.unfinished(above) as part:
            part.mkdir()
            result = Draft(part, path, given)
            yield result
            if adds:
                _keep(place_for(path, manifest, other), part, manifest)
            _finish(part, manifest)
            stopping.check()
            with stopping.deferred():
                result.path = _named(path, part, manifest, other, empty)
    except OSError as error:
        raise _refusal(path, error) from error


def _named(
    path: Path, part: Path, manifest: Mapping[str, Any], other: Other, empty: bool
) -> Path:
    """Give a complete folder its name; returns the name."""
    if not empty:
        path = _name(path, part, manifest, other)
    elif _fill(path, part):  # `part` is in the folder that may be replaced
        with files.unfinished(path.parent) as beside:
            part.rename(beside)
            path = _name(path, beside, manifest, other)
    if not any(files.is_hidden(part) for part in path.parts):  # not a result within a result
        stopping.named(path)
    return path


def _finish(part: Path, manifest: Mapping[str, Any]) -> None:
    """Add the manifest, and flush all files to disk."""
    hashes = manifests.hashes(part)
    content = {**manifest, "software": software(), FILES: [*hashes], HASHES: hashes}
    (part / MANIFEST).write_bytes(manifests.sealed(content))
    with ThreadPoolExecutor() as pool:  # a disk syncs many files as fast as one
        list(pool.map(files.sync_file, (file for file in part.rglob("*") if file.is_file())))


def _keep(earlier: Path, part: Path, manifest: Mapping[str, Any]) -> None:
    """Copy the files that only an equal earlier result has, except those that have been changed."""
    if not os.path.isdir(earlier) or not _may_go(earlier, manifest):
        return
    before = manifests.of_folder(earlier)
    if before is None or before.get("software") != software():
        return
    damaged = {Path(name).parts[0] for name in manifests.changed(earlier, before)}
    for name in {*before.get(HASHES, ())} - damaged:
        old, new = earlier / name, part / name
        if os.path.lexists(new) or not os.path.lexists(old):
            continue
        if old.is_dir():
            shutil.copytree(old, new)
        else:
            shutil.copyfile(old, new)


def _fill(path: Path, part: Path) -> bool:
    """Move everything into an empty folder; True (and no change) if it is no longer empty."""
    names = sorted((file.name for file in part.iterdir()), key=lambda name: name != MANIFEST)
    if not _is_empty(path):
        return True
    moved = []
    try:
        for name in names:  # manifest first: after a kill, it lists the files to remove
            (part / name).rename(path / name)
            moved.append(name)
    except BaseException:
        for name in moved:
            files.remove(path / name)
        raise
    files.sync_folder(path)
    return False


def _name(path: Path, part: Path, manifest: Mapping[str, Any], other: Other) -> Path:
    """Give a complete folder its name, or a numbered name if it has been taken meanwhile."""
    while True:
        check(path, manifest, other)
        target = place_for(path, manifest, other)
        try:
            if not os.path.lexists(target):
                part.rename(target)
            else:
                manifests.tell(target, "the folder is written anew")
                shutil.copymode(target, part)
                with files.unfinished(target.parent, instead=target.name) as old:
                    target.rename(old)
                    try:
                        part.rename(target)
                    except BaseException:
                        if not os.path.lexists(target):
                            old.rename(target)
                        raise
        except OSError as error:
            if error.errno in (errno.ENOTEMPTY, errno.EEXIST, errno.ENOENT) and part.is_dir():
                continue  # another process was faster
            raise
        files.sync_folder(target.parent)
        return target


def place_for(path: Path, manifest: Mapping[str, Any], other: Other) -> Path:
    """The given path, or the next numbered one that is free or holds an equal result."""
    check_choice("other", other, get_args(Other))
    if other != "number":
        return path
    candidate, number = path, 1
    while os.path.lexists(candidate) and not _may_go(candidate, manifest):
        number += 1
        candidate = path.with_name(f"{path.name}-{number}")
    return candidate


def _may_go(path: Path, manifest: Mapping[str, Any], part: bool = False) -> bool:
    """Whether a path may be replaced: it is empty or holds an equal result, or one with a part."""
    try:
        _refuse_foreign(path)
    except manifests.DamagedManifestError as error:
        warnings.warn(str(error), DamageWarning, stacklevel=2)
        return False
    except ConfigurationError:
        return False
    before = manifests.of_folder(path)
    if before is None:
        return True
    outcome = ("software", FILES, HASHES, "failures")
    kept, new = (
        {key: value for key, value in content.items() if key not in outcome}
        for content in (before, json.loads(json.dumps(manifest)))
    )
    return _agrees(new, kept) if part else bool(kept == new)


def _agrees(part: Any, whole: Any) -> bool:
    """Whether plain data have all entries of a part of them."""
    if isinstance(part, dict) and isinstance(whole, dict):
        return all(key in whole and _agrees(item, whole[key]) for key, item in part.items())
    if isinstance(part, list) and isinstance(whole, list) and len(part) == len(whole):
        return all(map(_agrees, part, whole))
    return bool(part == whole)


def _empty(path: Path) -> None:
    """Remove the files that a killed process moved into an empty folder."""
    try:
        before = manifests.of_folder(path)
    except manifests.DamagedManifestError:  # it does not say which files may be removed
        return
    if before is None or all((path / name).exists() for name in before[FILES]):
        return
    for name in (*before[FILES], MANIFEST):
        files.remove(path / name)


def check(
    path: str | Path, manifest: Mapping[str, Any] | None = None, other: Other = "replace",
    *, part: bool = False,
) -> None:
    """Check in advance, as far as possible, that `draft` can write there.

    Parameters
    ----------
    part
        Whether the manifest is only what is known of it before the work. A result in the folder
        must then agree with that part.

    Raises
    ------
    ConfigurationError
        As in `draft`.
    """
    check_choice("other", other, get_args(Other))
    shown, path = path, resolved(path)
    files.sweep(path.parent)
    if files.sweep(path):
        _empty(path)
    if other != "number":
        _refuse_foreign(path)
    if (
        other == "refuse"
        and manifest is not None
        and os.path.lexists(path)
        and not _may_go(path, manifest, part)
    ):
        raise ConfigurationError(
            f"{shown}: must be empty or hold the result of this very run, got that of another; "
            "--force (in Python other='replace') replaces it"
        )
    try:
        os.lstat(path)
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as error:  # its name is too long, for example
        raise _refusal(path, error) from error
    check_place(path, within=path if _is_empty(path) else path.parent)


def check_kind(path: str | Path, key: str) -> None:
    """Refuse a folder with a result of another kind, where an earlier one is replaced unasked.

    Parameters
    ----------
    key
        Key of the manifests of that kind.

    Raises
    ------
    ConfigurationError
        The folder holds such a result.
    """
    known = manifests.of_folder(resolved(path))
    if known is not None and key not in known:
        raise ConfigurationError(
            f"{path}: must be empty or hold an earlier result of this command, got that of another"
        )


def check_place(path: Path, within: Path | None = None) -> None:
    """Check in advance, as far as possible, that a folder can be made and written to.

    Parameters
    ----------
    within
        Where something will be made for it; None: in the folder itself.

    Raises
    ------
    ConfigurationError
        It cannot: a file is in the way, for example.
    """
    above = within or path
    while not os.path.lexists(above):
        above = above.parent
    if not os.path.isdir(above):
        raise _refusal(path, NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR)))
    if not os.access(above, os.W_OK | os.X_OK):
        raise _refusal(path, PermissionError(errno.EACCES, os.strerror(errno.EACCES)))


def _is_empty(path: Path) -> bool:
    """Whether this is an empty folder, apart from files being written."""
    return os.path.isdir(path) and all(files.is_hidden(file.name) for file in path.iterdir())


def _refusal(path: Path, error: OSError) -> ConfigurationError:
    return ConfigurationError(
        f"{path}: must be a folder that can be made and written to, got {error.strerror or error}"
    )


def _refuse_foreign(path: Path) -> None:
    """Refuse a folder with files that are not in the manifest of an earlier run."""
    if not os.path.lexists(path):
        return
    if not os.path.isdir(path):
        raise ConfigurationError(f"{path}: must be a folder or not exist yet, got a file")
    try:
        present = {file.name for file in path.iterdir() if not files.is_hidden(file.name)}
    except OSError as error:
        raise _refusal(path, error) from error
    before = manifests.of_folder(path)
    foreign = sorted(present if before is None else present - {*before[FILES], MANIFEST})
    if foreign:
        raise ConfigurationError(
            f"{path}: must be empty or hold nothing but an earlier result, got {what(foreign)} "
            "in it"
        )
    for name in present - {MANIFEST}:
        if os.path.isdir(path / name):  # a result within a result
            _refuse_foreign(path / name)


def what(names: Sequence[str]) -> str:
    """Contents of a folder, for a message: a kind that covers all names, or one of the names."""
    if NOTE in names:
        return "runs of a command that was interrupted"
    return repr(MANIFEST if MANIFEST in names else names[0])


def software() -> dict[str, str]:
    """Versions of all software that affects the results."""
    versions = {"python": platform.python_version(), "platform": platform.platform()}
    for package in PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "not installed"
    return versions


def write_table(table: pd.DataFrame, folder: Path, name: str) -> None:
    """Write a table as Parquet and CSV; numbers in full precision.

    A column of texts and other values, such as the levels of several factors, is written as texts.
    """
    mixed = {
        at: column.map(lambda value: str(plain(value)), na_action="ignore")
        for at, (_, column) in enumerate(table.items())
        if column.dtype == object and len({type(plain(value)) for value in column.dropna()}) > 1
    }
    if mixed:
        table = table.copy(deep=False)
        for at, column in mixed.items():
            table.isetitem(at, column.to_numpy())
    arrow = pa.Table.from_pandas(table, preserve_index=False)
    parquet.write_table(arrow, folder / f"{name}.parquet")
    csv.write_csv(arrow, folder / f"{name}.csv")


def plain(value: Any) -> Any:
    """The value as JSON types: numbers, strings, lists, dicts; missing values become None."""
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
