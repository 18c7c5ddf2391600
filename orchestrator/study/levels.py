"""Levels of a study file that name something else: files, and receivers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from sblcosim.models import RECEIVERS

from ..errors import ConfigurationError, instance, quoted, resolved, shortened
from ..scenario.reading import parse, read_text, shown
from ..scenario.sources import known_source, labelled, named
from ..simulation.code.user_code import component_of, is_python
from .tables import RECEIVERS_KEY, VARIED


def receiver(entry: Any, folder: Path) -> Any:
    """A receiver of a study with its file found; its existence is checked later."""
    if isinstance(entry, str | Path):
        text = str(entry)
        is_file = text.endswith(".fmu") or is_python(text) or bool(
            text and text not in RECEIVERS and (folder / text).is_dir()
        )
        return str(resolved(folder / text)) if is_file else text
    return component_of(entry) if callable(entry) else entry


def read_files(where: str, raw: dict[str, Any], folder: Path) -> None:
    """Replace levels that are files by their tables: ``levels = {rib = "rib.toml"}``.

    Raises
    ------
    ConfigurationError
        A file cannot be read.
    """
    for table in VARIED:
        for name, factor in _entries(raw, table):
            levels = factor.get("levels")
            if not isinstance(levels, Mapping):
                continue
            read = dict(levels)
            for level, file in levels.items():
                if isinstance(file, str):
                    at = f"{where}: [{table}.{shortened(name)}] levels: {shortened(str(level))}"
                    read[level] = _tables(at, folder / file)
            raw[table] = {**raw[table], name: {**factor, "levels": read}}


def _tables(at: str, path: Path) -> dict[str, Any]:
    """The tables of a scenario in a file, without those that only name it."""
    try:
        tables = parse(shown(path), read_text(path, (), "level"))
    except ConfigurationError as error:
        raise ConfigurationError(f"{at}: {error}") from None
    return {key: value for key, value in tables.items() if key not in ("name", "title")}


def name_receivers(where: str, raw: dict[str, Any], folder: Path) -> None:
    """If the receivers are a factor, use its levels as the study's receivers.

    Raises
    ------
    ConfigurationError
        A level is not a receiver, or appears twice, or the study also has receivers.
    """
    for name, factor in _entries(raw, "factors"):
        if factor.get("keys") not in ([RECEIVERS_KEY], (RECEIVERS_KEY,)):
            continue
        if raw.get("receivers"):
            raise ConfigurationError(
                f"{where}: receivers: must be left out with the factor {shortened(name)}, whose "
                "levels they are"
            )
        at, given = f"{where}: [factors.{shortened(name)}] levels", factor.get("levels")
        if not isinstance(given, list | tuple):
            raise ConfigurationError(
                f"{at}: must be an array of receivers, got {shortened(instance(given))}"
            )
        found = [receiver(entry, folder) for entry in given]
        try:
            sources = [known_source(entry) for entry in found]
        except ConfigurationError as error:
            raise ConfigurationError(f"{at}: {str(error).removeprefix('receiver: ')}") from None
        for i, source in enumerate(sources):
            if source in sources[:i]:
                raise ConfigurationError(
                    f"{at}: must have levels that differ, got {quoted(named(source))} twice"
                )
        raw["receivers"] = found
        raw["factors"] = {**raw["factors"], name: {**factor, "levels": [*labelled(sources)]}}


def _entries(raw: Mapping[str, Any], table: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Names and tables of factors or conditions; anything that is not a table is refused later."""
    entries = raw.get(table)
    if isinstance(entries, Mapping):
        for name, factor in [*entries.items()]:
            if isinstance(factor, Mapping):
                yield str(name), factor
