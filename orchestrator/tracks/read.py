"""Read a track from the user's file."""

from __future__ import annotations

import codecs
import os
import re
from pathlib import Path

from sblcosim.fmus.files import regular

from ..errors import ConfigurationError, quoted, shortened
from .track import LONGEST, MOST_POINTS, Recorded

LARGEST = 64 << 20
"""Largest file of a track [bytes]."""
KINDS = (".csv", ".gpx", ".txt", ".tsv")


def read(path: Path, *, depths: bool = True) -> Recorded:
    """The track in a file.

    Parameters
    ----------
    depths
        Whether points must have a depth; if not, those without one are at the surface.

    Raises
    ------
    ConfigurationError
        The file cannot be read, or its contents are wrong; the message names line and column.
    """
    name = shortened(str(path), 240)
    if path.suffix.lower() not in KINDS:
        raise ConfigurationError(
            f"{name}: must be a .csv or .gpx file, got {quoted(path.suffix or path.name)}"
        )
    text = _text(path, name)
    track = _track(path, name, text, depths)
    if len(track.times) > MOST_POINTS:
        raise ConfigurationError(
            f"{track.where(MOST_POINTS, 0)}: must be one of at most {MOST_POINTS:,} points, got "
            f"{len(track.times):,}"
        )
    if track.times[-1] > LONGEST:
        raise ConfigurationError(
            f"{track.where(len(track.times) - 1, 0)}: must be within {LONGEST:g} s of the first "
            f"point, got {track.times[-1]:g} s"
        )
    return track


def _track(path: Path, name: str, text: str, depths: bool) -> Recorded:
    # Only a scenario with a track waits for the import of its reader.
    if path.suffix.lower() == ".gpx":
        from . import gpx

        return gpx.read(name, text, depths=depths)
    from . import table

    return table.read(name, text, depths=depths)


def _text(path: Path, name: str) -> str:
    try:
        if os.path.isdir(path):
            raise ConfigurationError(f"{name}: is a folder, not the file of a track")
        with regular(path).open("rb") as file:
            content = file.read(LARGEST + 1)
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        if isinstance(error, FileNotFoundError):
            raise ConfigurationError(f"{name}: no such file") from None
        reason = getattr(error, "strerror", None) or error
        raise ConfigurationError(
            f"{name}: must be a file that can be read, got {reason}"
        ) from None
    if len(content) > LARGEST:
        raise ConfigurationError(f"{name}: must have at most {LARGEST:,} bytes, got more")
    encoding = _encoding(content) if path.suffix.lower() == ".gpx" else "utf-8-sig"
    try:
        return content.decode(encoding).replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        column = error.start - content.rfind(b"\n", 0, error.start)
        what = encoding.upper().removesuffix("-SIG")
        raise ConfigurationError(
            f"{name}, line {line}, column {column}: must be text in {shortened(what)}, got the "
            f"byte 0x{content[error.start]:02x}"
        ) from None
    except (LookupError, UnicodeError):
        raise ConfigurationError(
            f"{name}, line 1, column 1: must be XML in an encoding that Python knows, got "
            f"{quoted(encoding)}"
        ) from None


def _encoding(content: bytes) -> str:
    """Encoding of XML, from its first bytes or its declaration (XML 1.0, appendix F)."""
    for begin, encoding in _BEGIN.items():
        if content.startswith(begin):
            return encoding
    declared = re.match(rb"<\?xml[^>]*?\sencoding\s*=\s*[\"']([^\"'>]*)[\"']", content[:1000])
    return declared[1].decode("ascii", "replace") if declared else "utf-8"


_BEGIN = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF32_LE: "utf-32", codecs.BOM_UTF32_BE: "utf-32",  # before those of UTF-16
    codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16",
    b"<\0\0\0": "utf-32-le", b"\0\0\0<": "utf-32-be",
    b"<\0": "utf-16-le", b"\0<": "utf-16-be",
}  # fmt: skip
