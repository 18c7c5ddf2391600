"""The exceptions of the package, for use by and in the orchestrator."""

from __future__ import annotations

from sblcosim.fmus.errors import BuildError, DamageWarning, FmuError, SblcosimError, nearest

__all__ = [
    "BuildError",
    "ConfigurationError",
    "ConfigurationWarning",
    "DamageWarning",
    "FmuError",
    "SblcosimError",
    "instance",
    "nearest",
    "one_line",
]


def instance(value: object) -> str:
    """What somebody gave in place of something else, for messages."""
    if value is None or isinstance(value, bool | int | float | str | bytes):
        return repr(value)
    return f"an instance of {type(value).__qualname__}"


def one_line(error: BaseException) -> str:
    """What an exception says, without line breaks."""
    return " ".join(str(error).split()) or type(error).__name__


class ConfigurationError(SblcosimError):
    """Something that the user wrote, in a file or in Python, cannot be carried out."""


class ConfigurationWarning(UserWarning):
    """Something that the user wrote can be carried out, but is perhaps not what was meant."""
