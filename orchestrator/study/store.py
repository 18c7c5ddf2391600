"""The result folder of a study.

It holds ``study.json`` (the complete definition of the runs) and ``parts/``: Parquet files, each
written as a whole, with one row per run. Runs in the parts are not repeated. When all are done,
``runs.parquet`` holds the whole table. `sblcosim.study.parts` reads and writes these files.

The name of a part ends with the SHA-256 of the file, and ``study.json`` contains its own, so that
damaged data are never taken for results. A damaged part is moved to ``parts/damaged/``, and its
runs are repeated.
"""

from __future__ import annotations

import json
import os
import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, TypeVar

import pandas as pd
from sblcosim.fmus import files

from .. import artifacts
from ..errors import ConfigurationError, ConfigurationWarning, DamageWarning, one_line
from ..manifests import OTHER, sealed, unsealed
from . import parts
from .campaign import Campaign
from .definition import Definition
from .parts import PARTS, RUNS, Finished, Parts, Wanted, looked_through, refusal, write_file
from .space import SampleVersion

Space = TypeVar("Space", bound=Definition)

STUDY = "study.json"
DAMAGED = "damaged"
FORMAT = 2
IDENTITY, RULE = "identity", 3
"""Entry of the description: the rule that identifies the user's code (1 or missing: its source; 2:
without some parts of 3, such as the order of dicts)."""
_CODE = ("receivers", "responses", "model")


def check_folder(folder: Path, campaign: Campaign) -> int:
    """Check that the folder belongs to this study or is empty; returns its number of replicates.

    Raises
    ------
    ConfigurationError
        The folder belongs to another study, or holds something else.
    """
    if os.path.lexists(folder) and not folder.is_dir():
        raise ConfigurationError(f"{folder}: must be a folder or not exist yet, got a file")
    if (folder / STUDY).exists():
        before, definition = described(folder), campaign.definition()
        there, here = _identity(before["definition"]), _identity(definition)
        if there != here:
            raise ConfigurationError(
                f"{folder}: must be empty or hold results of this study, got those of "
                f"{before['definition']['study']['name']!r} with other "
                f"{_difference(there, here)}"
                f"{_changed_code(there, here, before.get(IDENTITY) == RULE)}"
            )
        return int(before["replicates"])
    if folder.is_dir():
        names = sorted(f.name for f in folder.iterdir() if not files.is_hidden(f.name))
        if PARTS in names and set(names) <= {PARTS, RUNS}:
            return _replicates(folder, campaign)
        if names:
            raise ConfigurationError(
                f"{folder}: must be empty or hold results of this study, got "
                f"{artifacts.what(names)} in it"
            )
    return 0


def as_begun(study: Space, folder: Path) -> Space:
    """The study with the sample version of its folder, if it is a space that names none.

    Raises
    ------
    ConfigurationError
        The description of the folder is damaged.
    """
    free = study.design.kind == "space" and study.design.sample is None
    if not free or not (folder / STUDY).exists():
        return study
    before = described(folder)["definition"]
    if before["study"]["design"]["kind"] != "space":
        return study
    return study.with_sample(version_of_sample(before))


def version_of_sample(definition: Mapping[str, Any]) -> SampleVersion:
    """Sample version of a space according to its folder; older folders name none."""
    version: SampleVersion = definition["study"]["design"].get("sample", 1)
    return version


def _replicates(folder: Path, campaign: Campaign) -> int:
    """Number of replicates in a folder without its `STUDY` file."""
    runs = finished(folder)
    for row in runs.strangers(campaign):
        raise ConfigurationError(
            f"{folder}: must hold results of this study, got run {int(runs.run_id[row]):016x} of "
            "another study"
        )
    if campaign.study.rounded and set(runs.campaigns) - {campaign.digest}:
        raise ConfigurationError(
            f"{folder}: must hold results of this study, got runs whose levels may differ from its "
            f"own beyond six digits, and no {STUDY} to decide"
        )
    return int(runs.replicate.max(initial=0))


def open_folder(folder: Path, campaign: Campaign) -> Parts:
    """Make the folder, or check that it belongs to this study; returns its content.

    Raises
    ------
    ConfigurationError
        The folder belongs to another study, holds something else, or is not writable.
    """
    definition = campaign.definition()
    content = {
        "format": FORMAT,
        "replicates": max(campaign.study.replicates, check_folder(folder, campaign)),
        "title": campaign.study.title,
        "names": {
            name: {"label": f.label, "unit": f.unit}
            for name, f in (campaign.study.factors | campaign.study.conditions).items()
        },
        "definition": definition,
        **({IDENTITY: RULE} if _code_of(definition["study"]) else {}),
        "software": artifacts.software(),
        "table": _table_of(folder),
    }
    write_file(folder / STUDY, sealed(content))
    return _set_aside(folder)


def _table_of(folder: Path) -> dict[str, Any]:
    """Entry of the whole table in the description; missing in old folders."""
    if not (folder / STUDY).exists():
        return {}
    said: dict[str, Any] = described(folder).get("table", {})
    return said


def save(there: Parts) -> Parts:
    """Write the whole table, unless it exists unchanged."""
    if there.in_table == {path.name for path in there.paths}:
        return there
    said = parts.save(there)
    write_file(there.folder / STUDY, sealed({**described(there.folder), "table": said}))
    return Parts(there.folder, there.paths, frozenset(said["parts"]))


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
            raise refusal(folder, error) from None
        if other:
            warnings.warn(
                f"{folder}: should have one study at a time, but another one is at work there; "
                "the table will be right, but runs are done twice",
                ConfigurationWarning,
                stacklevel=2,
            )
        yield


def _difference(before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Names of the parts in which two definitions of runs differ."""
    parts = [
        key
        for key in now["study"]
        if before["study"].get(key) != now["study"][key]
    ]
    if before.get("scenario") != now.get("scenario"):
        parts.append("scenario")
    old, new = before.get("fmus", {}), now.get("fmus", {})
    changed = sorted(name for name in old.keys() & new.keys() if old[name] != new[name])
    if changed:
        parts.append(f"FMU or code of {' and '.join(changed)}")
    elif old != new and not parts:
        parts.append("FMUs")
    return ", ".join(parts) or "contents"


def _identity(definition: Mapping[str, Any]) -> dict[str, Any]:
    """The part of a definition that affects its runs: without names, titles and locations of files.

    The hashes of files are in it, and in the ids of the runs.
    """
    made = {
        part: {k: v for k, v in it.items() if part == "fmus" or k not in ("name", "title")}
        for part, it in definition.items()
    }
    found: dict[str, Any] = _unplaced(made)
    return found


def _unplaced(value: Any) -> Any:
    """Plain data with names of files instead of their paths."""
    if isinstance(value, str):
        return re.split(r"[/\\]", value)[-1]
    if isinstance(value, Mapping):
        return {key: _unplaced(it) for key, it in value.items()}
    return [_unplaced(it) for it in value] if isinstance(value, list) else value


def _is_code(entry: Any) -> bool:
    return isinstance(entry, dict) and {"from", "sha256"} <= set(entry)


def _changed_code(before: Mapping[str, Any], now: Mapping[str, Any], same_rule: bool) -> str:
    """The user's code that differs despite the same name, as the end of a message."""
    old, new = (
        {entry["from"]: entry["sha256"] for entry in _code_of(d["study"])} for d in (before, now)
    )
    changed = [name for name, sha256 in new.items() if old.get(name, sha256) != sha256]
    if not changed:
        return ""
    if same_rule:
        return f"; the code of {', '.join(changed)}, or what it imports, has changed"
    return (
        f"; the code of {', '.join(changed)} has changed, or this folder is from an earlier "
        "version "
        "of sblcosim, which did not identify code by everything it refers to"
    )


def _code_of(study: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    entries: list[Any] = []
    for key in _CODE:
        value = study.get(key) or []
        entries += value if isinstance(value, list) else [value]
    return [entry for entry in entries if _is_code(entry)]


def described(folder: Path) -> dict[str, Any]:
    """Read the description of a folder."""
    path = folder / STUDY
    try:
        text = files.regular(path).read_text("utf-8")
        content = json.loads(text)
    except FileNotFoundError:
        raise ConfigurationError(
            f"{folder}: must be a folder of a study's results, got no {STUDY} in it"
        ) from None
    except (OSError, ValueError, RecursionError) as error:
        raise ConfigurationError(f"{path}: must be readable, got {one_line(error)}") from None
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise ConfigurationError(
            f"{path}: must have format {FORMAT}, got another, from another version of sblcosim"
        )
    known = unsealed(text, content)
    if known is None:
        raise ConfigurationError(
            f"{path}: must be as it was written, got other content; delete it, and 'sblcosim "
            "study' with the same study and folder writes it again"
        )
    return known


def _set_aside(folder: Path) -> Parts:
    """Move damaged parts away, and warn about each; returns the others."""
    said = _table_of(folder)
    there, damaged = looked_through(folder, said)
    _tell_of_table(there, said, "it is made from the parts again")
    for path in damaged:
        target = path.parent / DAMAGED / path.name
        try:
            files.make_folder(target.parent)
            path.replace(target)
        except OSError as error:
            raise refusal(target, error) from None
        _warn(f"{path}: {OTHER}; it is now in {DAMAGED}/, and its runs are repeated")
    return there


def _tell_of_table(there: Parts, said: Mapping[str, Any], then: str) -> None:
    """Warn about a whole table that is not the one in the description."""
    inside, path = {*said.get("parts", ())}, there.folder / RUNS
    all_there = bool(inside) and inside <= {part.name for part in there.paths}
    if all_there and not there.in_table and path.exists():
        _warn(f"{path}: must be the table that {STUDY} names, got another; {then}")


def _warn(message: str) -> None:
    warnings.warn(message, DamageWarning, stacklevel=3)


def finished(results: str | Path, *, tell: bool = False) -> Finished:
    """The finished runs in a result folder.

    Parameters
    ----------
    tell
        Whether to warn about damaged parts, whose runs count as missing.
    """
    folder = Path(results)
    there, damaged = looked_through(folder, _table_of(folder))
    for path in damaged if tell else ():
        _warn(f"{path}: {OTHER}; its runs count as missing")
    return parts.finished(there)


def table(results: str | Path, wanted: Wanted | None = None) -> pd.DataFrame:
    """All finished runs in a result folder, sorted by replicate and point.

    Parameters
    ----------
    wanted
        Selects the columns to read from the names of all columns; None: all.

    Raises
    ------
    ConfigurationError
        There are no runs, or a part is damaged or gone.
    """
    folder = Path(results)
    said = described(folder).get("table", {})
    there, damaged = looked_through(folder, said)
    gone = {*said.get("parts", ())} - {path.name for path in (*there.paths, *damaged)}
    wrong = dict.fromkeys(damaged, OTHER) | {
        folder / PARTS / name: f"must be there, as {STUDY} names it, got no such file"
        for name in sorted(gone)
    }
    for path, problem in wrong.items():
        raise ConfigurationError(
            f"{path}: {problem}; 'sblcosim study' with the same study and folder repeats its runs"
        )
    if not there.paths:
        raise ConfigurationError(f"{folder}: must hold runs, got none yet")
    _tell_of_table(there, said, "the parts are read instead")
    return parts.table(there, wanted)
