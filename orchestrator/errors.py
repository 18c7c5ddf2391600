"""The exceptions of the package, as the orchestrator uses and exports them."""

from __future__ import annotations

import errno
import stat
from collections.abc import Collection
from pathlib import Path

from sblcosim.fmus.errors import (
    BuildError,
    Concise,
    DamageWarning,
    FmuError,
    SblcosimError,
    escaped,
    instance,
    nearest,
    one_line,
    quoted,
    shortened,
)
from sblcosim.fmus.files import KINDS

__all__ = [
    "BuildError",
    "CodeChangedError",
    "ConfigurationError",
    "ConfigurationWarning",
    "DamageWarning",
    "FmuError",
    "NoEffectWarning",
    "SblcosimError",
    "check_choice",
    "escaped",
    "instance",
    "nearest",
    "no_file",
    "one_line",
    "quoted",
    "resolved",
    "shortened",
]


class ConfigurationError(SblcosimError):
    """Invalid input from the user, in a file or in Python."""


class CodeChangedError(ConfigurationError):
    """The user's code has changed since it was hashed, so none of its runs can be identified."""


def check_choice(where: str, value: object, choices: Collection[str] | Collection[int]) -> None:
    """Refuse an argument that is not one of the given words or whole numbers.

    Raises
    ------
    ConfigurationError
        The value is not among the choices; the message suggests the nearest one.
    """
    plain = isinstance(value, str | int) and not isinstance(value, bool)
    if not plain or value not in choices:
        close = nearest(value, map(str, choices)) if isinstance(value, str) else ""
        raise ConfigurationError(
            f"{where}: must be {' or '.join(map(str, choices))}, got "
            f"{shortened(instance(value))}{close}"
        )


class ConfigurationWarning(Concise, UserWarning):
    """Valid input that the user may not have intended."""


class NoEffectWarning(ConfigurationWarning):
    """A key was given explicitly but has no effect."""


def no_file(path: Path) -> str:
    """What is at a path in place of a file, for a message."""
    try:
        mode = path.stat().st_mode
    except OSError as error:
        return "no such file" if error.errno == errno.ENOENT else str(error.strerror)
    return "a folder" if stat.S_ISDIR(mode) else KINDS.get(stat.S_IFMT(mode), "a file")


def resolved(path: str | Path) -> Path:
    """A path given by the user, made absolute and without links.

    Raises
    ------
    ConfigurationError
        Its links go round in a loop.
    """
    try:
        return Path(path).resolve()
    except (RuntimeError, OSError) as error:  # the former before Python 3.13
        raise ConfigurationError(
            f"{path}: must lead to a place, got links that go round in a loop"
            if isinstance(error, RuntimeError) or error.errno == errno.ELOOP
            else f"{path}: must lead to a place, got {error.strerror}"
        ) from None
