"""The exceptions of the package, for use by and in the orchestrator."""

from __future__ import annotations

from sblcosim.fmus.errors import (
    BuildError,
    FmuError,
    SblcosimError,
    escaped,
    instance,
    nearest,
    shortened,
)

__all__ = [
    "BuildError",
    "ConfigurationError",
    "ConfigurationWarning",
    "FmuError",
    "SblcosimError",
    "escaped",
    "instance",
    "nearest",
    "one_line",
    "shortened",
]


def one_line(error: BaseException) -> str:
    """What an exception says, without line breaks."""
    return " ".join(str(error).split()) or type(error).__name__


class ConfigurationError(SblcosimError):
    """Something that the user wrote, in a file or in Python, cannot be carried out."""


class ConfigurationWarning(UserWarning):
    """Something that the user wrote can be carried out, but is perhaps not what was meant."""
