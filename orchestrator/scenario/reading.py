"""Read the user's text files, and limit what TOML may contain."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from sblcosim.fmus.files import regular

from ..errors import ConfigurationError, nearest, quoted, shortened

DEEPEST = 16
"""Maximum nesting of tables and arrays, and of parts of a key; a scenario needs four."""
LARGEST = 1 << 20
"""Maximum size of a file [bytes]; a scenario has a few thousand."""
_INTEGERS = 2**63  # TOML integers have 64 bits
_LONGEST_PATH = 240  # characters of a path in a message


def shown(path: Path) -> str:
    """A path, shortened for a message."""
    return shortened(str(path), _LONGEST_PATH)


def _beside(path: Path) -> list[str]:
    """Names of the files of a kind beside a path that does not exist."""
    try:
        if path.exists():
            return []
        return [it.name for it in path.parent.iterdir() if it.suffix == path.suffix]
    except (OSError, ValueError):
        return []


def read_text(path: Path, names: Sequence[str], what: str = "scenario") -> str:
    """Text of the user's file; ``names`` are the shipped names to suggest if it does not exist.

    Raises
    ------
    ConfigurationError
        The file cannot be read.
    """
    where = shown(path)
    close = nearest(path.name.removesuffix(".toml"), names) or nearest(path.name, _beside(path))
    if os.path.isdir(path):
        raise ConfigurationError(f"{where}: is a folder, not a {what} file")
    try:
        with regular(path).open("rb") as file:
            content = file.read(LARGEST + 1)
        if len(content) > LARGEST:
            raise ConfigurationError(f"{where}: must have at most {LARGEST:,} bytes, got more")
        return content.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        byte = error.object[error.start]
        hint = "; 'sblcosim run' and 'plan' take packages" if path.suffix == ".ssp" else ""
        raise ConfigurationError(
            f"{where}: must be a text file in UTF-8, got the byte 0x{byte:02x} at {error.start}"
            f"{hint}"
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
    """Parse a TOML text into tables.

    Raises
    ------
    ConfigurationError
        The text is not TOML, is nested too deeply, or has integers of more than 64 bits.
    """
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigurationError(_problem(where, text, error)) from None
    except RecursionError:
        raise ConfigurationError(f"{where}: {_TOO_DEEP}, got far more") from None
    except ValueError:  # Python refuses integers of more than 4,300 digits
        raise ConfigurationError(f"{where}: {_TOO_LONG}, got one of thousands of digits") from None
    check_values(where, tables)
    return tables


_TOO_DEEP = f"must have tables, arrays and keys of at most {DEEPEST} levels"
_TOO_LONG = "must have integers of 64 bits"
_NO_VALUE = "must be a value of TOML (numbers begin with a digit, texts are in quotes)"


def check_values(where: str, content: Any, above: int = 0) -> None:
    """Refuse tables that are nested too deeply, and integers of more than 64 bits.

    Parameters
    ----------
    above
        Number of levels above the content.

    Raises
    ------
    ConfigurationError
        The content has such a table or integer.
    """
    waiting: list[tuple[tuple[Any, ...], Any]] = [((), content)]
    while waiting:
        path, value = waiting.pop()
        too_long = isinstance(value, int) and not -_INTEGERS <= value < _INTEGERS
        if too_long or above + len(path) > DEEPEST:
            at = f"{where}: {shortened('.'.join(map(str, path)))}" if path else where
            must = f"{_TOO_LONG}, got {shortened(value)}" if too_long else f"{_TOO_DEEP}, got more"
            raise ConfigurationError(f"{at}: {must}")
        if isinstance(value, Mapping):
            waiting += (((*path, key), inner) for key, inner in value.items())
        elif isinstance(value, list | tuple):
            waiting += (((*path, i), inner) for i, inner in enumerate(value, 1))


def _problem(where: str, text: str, error: tomllib.TOMLDecodeError) -> str:
    message = str(error)
    at = re.search(r" \(at line (\d+), column (\d+)\)$", message)
    if at is None:
        if message.startswith("Invalid value"):
            return f"{where}: {_NO_VALUE}, got the end of the file"
        return f"{where}: must be TOML: {shortened(message)}"
    if message.startswith("Cannot overwrite a value"):
        # The location is the end of the value, which may span several lines.
        before = text.split("\n")[: int(at[1])]
        keys = (re.match(r"\s*([\w.\"'-]+)\s*=", line) for line in reversed(before))
        key = next((found[1] for found in keys if found), None)
        if key is not None:
            return f"{where}, line {at[1]}: {shortened(key)} must be given once, got it twice"
    place = f"{where}, line {at[1]}, column {at[2]}"
    if message.startswith("Invalid value"):
        line = text.split("\n")[int(at[1]) - 1][int(at[2]) - 1 :]
        got = re.match(r"[^\s,\]}#]*", line)
        return f"{place}: {_NO_VALUE}, got {quoted(got[0]) if got and got[0] else 'none'}"
    return f"{place}: {shortened(message[: at.start()])}"


def relative(file: Path, folder: Path) -> str:
    """The path of a file relative to a folder."""
    try:
        # Resolve the folder only: if the file is a link, keep its own name.
        found = os.path.relpath(file.parent.resolve() / file.name, folder.resolve())
    except ValueError:  # on another drive
        return str(file)
    return Path(found).as_posix()
