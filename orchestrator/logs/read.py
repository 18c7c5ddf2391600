"""Read a log, of whatever format."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..errors import ConfigurationError, quoted
from ..scenario.reading import parse, read_text, shown
from . import folder, mapped, meta, nmea, text, water_linked
from .checks import UNPLACED, log_of
from .log import Log
from .mapping import mapping_of
from .raw import Raw

FORMATS = (
    "the folder of a log (receptions.csv or fixes.csv), CSV or Parquet, a capture of the Water "
    "Linked API (JSON), or NMEA sentences"
)
_SENTENCE = re.compile(r"[$!][A-Z]{5,8},|(^|[^A-Z])USBLLONG,")
_JSON = re.compile(r"\s*(\{|\[\s*(\{|\]))")
_LOOKED_AT = 200
"""Number of lines in which a sentence is looked for."""


def read_log(path: str | Path, mapping: str | Path | None = None) -> Log:
    """The log in a folder or file.

    Parameters
    ----------
    path
        A folder in the project's own format; a file or folder of CSV or Parquet; a capture of the
        Water Linked API as JSON; or a file of NMEA sentences.
    mapping
        TOML file that says what the log says about itself (as ``meta.toml``) and, in its table
        ``[mapping]``, which column is what. None: ``meta.toml`` beside the file, if there is one.

    Raises
    ------
    ConfigurationError
        There is no such log, or it cannot be used; the message names the file.
    """
    place = Path(path)
    if mapping is not None and not os.path.isfile(mapping):
        raise ConfigurationError(f"mapping: must be a TOML file, got {quoted(str(mapping))}")
    if not os.path.exists(place):
        raise ConfigurationError(f"{shown(place)}: must be a log, got nothing of that name")
    about, where = _about(place, mapping)
    log = replace(log_of(_raw(place, about, where)), source=shown(place))
    if not len(log.receptions) and not any(map(len, log.fixes.values())):
        found = "; ".join(log.counted()[:3])
        if any(flaw.what == UNPLACED for flaw in log.findings):
            found += "; positions are columns (reported_n_m, …) or stand in [beacons] of meta.toml"
        for remark in (it for it in log.remarks if meta.UNUSED in it):
            found += f"; {remark}"
        raise ConfigurationError(
            f"{shown(place)}: must hold ranges of beacons with positions, or positions, got none"
            f"{f'; {found}' if found else ''}"
        )
    return log


def _about(place: Path, mapping: str | Path | None) -> tuple[dict[str, Any], str]:
    """What a log says about itself, and the name of the file that says it."""
    file = (place if os.path.isdir(place) else place.parent) / meta.FILE
    if mapping is not None:
        file = Path(mapping)
    elif not os.path.lexists(file):
        return {}, meta.FILE
    return parse(shown(file), read_text(file, (), "mapping")), shown(file)


def _raw(place: Path, about: Mapping[str, Any], where: str) -> Raw:
    """The tables of a log, by its content."""
    if mapping_of(about.get("mapping", {}), where).tables:
        return mapped.raw_of(place, about, where)
    if os.path.isdir(place):
        if folder.is_log(place):
            return folder.raw_of(place, about, where)
        if water_linked.is_excerpt(place):
            return water_linked.raw_of_excerpt(place, about, where)
        own = place / "log"
        close = f"; did you mean {str(own)!r}?" if folder.is_log(own) else ""
        raise ConfigurationError(f"{shown(place)}: must be {FORMATS}, got another folder{close}")
    if place.suffix.lower() == ".parquet":
        return mapped.raw_of(place, about, where)
    content = text.content(place)
    if _JSON.match(content):
        return water_linked.raw_of(place, content, about, where)
    lines = [line for line in content[: 1 << 20].split("\n")[:_LOOKED_AT] if line.strip()]
    if any(_SENTENCE.search(line) for line in lines):
        return nmea.raw_of(place, content, about, where)
    if lines and any(mark in lines[0] for mark in ",;\t"):
        return mapped.raw_of(place, about, where)
    got = f"one that begins with {quoted(lines[0])}" if lines else "an empty file"
    raise ConfigurationError(f"{shown(place)}: must be {FORMATS}, got {got}")
