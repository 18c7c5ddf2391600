"""Text files that a user has written, and what of TOML is taken."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..errors import ConfigurationError, nearest, quoted, shortened

DEEPEST = 16
"""Tables and arrays inside each other, and parts of a key; a scenario needs four."""
LARGEST = 1 << 20
"""Bytes of a file; a scenario has some thousand."""
_INTEGERS = 2**63  # of TOML: 64 bits
_LONGEST_PATH = 240  # characters of one that a message shows


def shown(path: Path) -> str:
    """A path for a message."""
    return shortened(str(path), _LONGEST_PATH)


def read_text(path: Path, names: Sequence[str], what: str = "scenario") -> str:
    """Text of a file that somebody names, in place of one of the names that come with the project.

    Raises
    ------
    ConfigurationError
        It cannot be read.
    """
    where = shown(path)
    close = nearest(path.name.removesuffix(".toml"), names)
    if os.path.isdir(path):
        raise ConfigurationError(f"{where}: is a folder, not a {what} file")
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST + 1)  # a device has no end
        if len(content) > LARGEST:
            raise ConfigurationError(f"{where}: must have at most {LARGEST:,} bytes, got more")
        return content.decode("utf-8").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        byte = error.object[error.start]
        raise ConfigurationError(
            f"{where}: must be a text file in UTF-8, got the byte 0x{byte:02x} at {error.start}"
        ) from None
    except FileNotFoundError:
        if path.suffix == ".toml" or len(path.parts) > 1:
            raise ConfigurationError(f"{where}: no such file{close}") from None
        raise ConfigurationError(
            f"{what}: must be a TOML file or one of {', '.join(names)}, got "
            f"{quoted(str(path))}" + close
        ) from None
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        reason = getattr(error, "strerror", None) or error
        raise ConfigurationError(
            f"{where}: must be a file that can be read, got {reason}"
        ) from None


def parse(where: str, text: str) -> dict[str, Any]:
    """The tables of a text in TOML.

    Raises
    ------
    ConfigurationError
        It is no TOML, nested too deeply, or has integers of more than 64 bits.
    """
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigurationError(_problem(where, error)) from None
    except RecursionError:
        raise ConfigurationError(f"{where}: {_TOO_DEEP}, got far more") from None
    except ValueError:  # Python reads no integers of more than 4,300 digits
        raise ConfigurationError(f"{where}: {_TOO_LONG}, got one of thousands of digits") from None
    check_values(where, tables)
    return tables


_TOO_DEEP = f"must have tables, arrays and keys of at most {DEEPEST} levels"
_TOO_LONG = "must have integers of 64 bits"


def check_values(where: str, content: Any, above: int = 0) -> None:
    """Refuse what is nested too deeply, and integers of more than 64 bits.

    Parameters
    ----------
    above
        Levels that the content is in.

    Raises
    ------
    ConfigurationError
        There is such a thing.
    """
    waiting: list[tuple[tuple[Any, ...], Any]] = [((), content)]
    while waiting:
        path, value = waiting.pop()
        at = f"{where}: {shortened('.'.join(map(str, path)))}" if path else where
        if isinstance(value, int) and not -_INTEGERS <= value < _INTEGERS:
            raise ConfigurationError(f"{at}: {_TOO_LONG}, got {shortened(value)}")
        if above + len(path) > DEEPEST:
            raise ConfigurationError(f"{at}: {_TOO_DEEP}, got more")
        if isinstance(value, Mapping):
            waiting += (((*path, key), inner) for key, inner in value.items())
        elif isinstance(value, list | tuple):
            waiting += (((*path, i), inner) for i, inner in enumerate(value, 1))


def _problem(where: str, error: tomllib.TOMLDecodeError) -> str:
    message = str(error)
    place = re.search(r" \(at line (\d+), column (\d+)\)$", message)
    if place is None:
        return f"{where}: must be TOML: {shortened(message)}"
    return f"{where}, line {place[1]}, column {place[2]}: {shortened(message[: place.start()])}"
