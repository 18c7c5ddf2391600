"""What our folders say about their files, and whether the files are unchanged.

A manifest has the SHA-256 of each file beside it (for a result within a result, of that result's
manifest), and its own. So a damaged file is found and identified.
"""

from __future__ import annotations

import hashlib
import json
import os
import warnings
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

from .errors import ConfigurationError, DamageWarning, one_line, shortened

MANIFEST = "manifest.json"
FILES, HASHES, SEAL = "files", "hashes", "sha256"
"""Entries of a manifest: names, SHA-256 by name, and SHA-256 of the manifest without this entry."""
OTHER = "must be as it was written, got other bytes"


class DamagedManifestError(ConfigurationError):
    """A manifest of ours has been changed since it was written."""


def sealed(content: Mapping[str, Any]) -> bytes:
    """Plain data as JSON text, with its own SHA-256."""
    digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
    whole = {**content, SEAL: digest}
    return (json.dumps(whole, indent=2, ensure_ascii=False, allow_nan=False) + "\n").encode()


def unsealed(text: str, content: Mapping[str, Any]) -> dict[str, Any] | None:
    """What `sealed` wrote, without its SHA-256; None if it has been changed.

    Parameters
    ----------
    content
        The text as plain data.
    """
    rest = {key: value for key, value in content.items() if key != SEAL}
    try:
        return rest if sealed(rest).decode() == text else None
    except (ValueError, RecursionError):
        return None


def of_folder(folder: Path) -> dict[str, Any] | None:
    """The manifest of a folder, without its own SHA-256; None if the folder has none from us.

    Manifests from before hashes were introduced have no entry `HASHES`.

    Raises
    ------
    DamagedManifestError
        It has been changed since it was written.
    """
    path = folder / MANIFEST
    if not path.is_file():  # reading from a pipe may block for ever
        return None
    try:
        text = path.read_text("utf-8")
        content: Any = json.loads(text)
    except OSError:
        return None
    except (ValueError, RecursionError) as error:
        got = one_line(error) if path.stat().st_size else "an empty file"
        raise _damage(path, got) from None
    if not isinstance(content, dict):
        return None
    if SEAL in content or HASHES in content:  # a flipped bit cannot remove both
        known = unsealed(text, content)
        if known is None or not isinstance(known.get(HASHES), dict):
            raise _damage(path, "other bytes")
        return known
    names = content.get(FILES)
    old = isinstance(names, list) and all(isinstance(name, str) for name in names)
    return content if old else None


def _damage(path: Path, got: str) -> DamagedManifestError:
    return DamagedManifestError(
        f"{path}: must be as it was written, got {shortened(got)}; delete its folder, or take "
        "another one"
    )


def hashes(folder: Path) -> dict[str, str]:
    """SHA-256 of the files in a folder, by name."""
    return _sha256s(folder, sorted(f.name for f in folder.iterdir() if f.name != MANIFEST))


def _sha256s(folder: Path, names: Sequence[str]) -> dict[str, str]:
    with ThreadPoolExecutor() as pool:
        return dict(zip(names, pool.map(partial(_sha256, folder), names), strict=True))


def _sha256(folder: Path, name: str) -> str:
    """SHA-256 of a file, or of the manifest of a result within the result; empty without either."""
    path = folder / name / MANIFEST if (folder / name).is_dir() else folder / name
    if not path.is_file():
        return ""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""


def changed(folder: Path, manifest: Mapping[str, Any]) -> list[str]:
    """Changed files in a folder; files that no longer exist are left out."""
    known: Mapping[str, str] = manifest.get(HASHES, {})
    found = []
    there = [name for name in known if os.path.lexists(folder / name)]
    for name, digest in _sha256s(folder, there).items():
        within = folder / name
        if digest != known[name]:
            found.append(f"{name}/{MANIFEST}" if within.is_dir() else name)
        elif within.is_dir() and (inner := of_folder(within)) is not None:
            found += [f"{name}/{other}" for other in changed(within, inner)]
    return found


def warn(folder: Path, name: str, then: str) -> None:
    """Warn about a file that has been changed since it was written."""
    path = folder / name
    warnings.warn(f"{path}: {OTHER}; {then}", DamageWarning, stacklevel=3)


def tell(folder: Path, then: str) -> None:
    """Warn about each changed file of a folder, and say what is done about it."""
    if not os.path.isdir(folder):
        return
    try:
        manifest = of_folder(folder)
        for name in changed(folder, manifest or {}):
            warn(folder, name, then)
    except DamagedManifestError as error:
        warnings.warn(str(error), DamageWarning, stacklevel=3)
