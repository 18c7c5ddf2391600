"""The exceptions of the package, for use by and in the orchestrator."""

from __future__ import annotations

from collections.abc import Collection

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

__all__ = [
    "BuildError",
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
    "one_line",
    "quoted",
    "shortened",
]


class ConfigurationError(SblcosimError):
    """Something that the user wrote, in a file or in Python, cannot be carried out."""


def check_choice(where: str, value: object, choices: Collection[str] | Collection[int]) -> None:
    """Refuse an argument that is none of a few words or whole numbers.

    Raises
    ------
    ConfigurationError
        So it is; the nearest choice is named.
    """
    plain = isinstance(value, str | int) and not isinstance(value, bool)
    if not plain or value not in choices:
        close = nearest(value, map(str, choices)) if isinstance(value, str) else ""
        raise ConfigurationError(
            f"{where}: must be {' or '.join(map(str, choices))}, got "
            f"{shortened(instance(value))}{close}"
        )


class ConfigurationWarning(Concise, UserWarning):
    """Something that the user wrote can be carried out, but is perhaps not what was meant."""


class NoEffectWarning(ConfigurationWarning):
    """A key was given by hand that has no effect."""
