"""The exceptions of the package, for use by and in the orchestrator."""

from __future__ import annotations

from collections.abc import Collection

from sblcosim.fmus.errors import BuildError, DamageWarning, FmuError, SblcosimError, nearest

__all__ = [
    "BuildError",
    "ConfigurationError",
    "ConfigurationWarning",
    "DamageWarning",
    "FmuError",
    "NoEffectWarning",
    "SblcosimError",
    "check_choice",
    "instance",
    "nearest",
    "one_line",
    "quoted",
    "shortened",
]

LONGEST = 80
"""Characters of a value that a message shows."""


def instance(value: object) -> str:
    """What somebody gave in place of something else, for messages."""
    if value is None or isinstance(value, bool | int | float | str | bytes):
        return quoted(value)
    return f"an instance of {type(value).__qualname__}"


def shortened(value: object, longest: int = LONGEST) -> str:
    """A value for a message, without its middle if it is longer than so many characters.

    Parameters
    ----------
    value
        A text is taken as it is, so that the caller decides about quotes; of anything else it is
        the `repr`.
    """
    try:
        text = value if isinstance(value, str) else repr(value)
    except (ValueError, RecursionError):  # an integer of thousands of digits, or a deep nesting
        kind = type(value).__qualname__
        text = "an integer of thousands of digits" if isinstance(value, int) else f"a {kind}"
    if len(text) <= longest:
        return text
    end = longest // 3
    return f"{text[: longest - end - 3]}...{text[-end:]}"


def quoted(value: object) -> str:
    """A value for a message as Python writes it, shortened; texts in quotes."""
    return shortened(repr(value)) if isinstance(value, str) else shortened(value)


def one_line(error: BaseException) -> str:
    """What an exception says, without line breaks."""
    return " ".join(str(error).split()) or type(error).__name__


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
            f"{where}: must be {' or '.join(map(str, choices))}, got {instance(value)}{close}"
        )


class ConfigurationWarning(UserWarning):
    """Something that the user wrote can be carried out, but is perhaps not what was meant."""


class NoEffectWarning(ConfigurationWarning):
    """A key was given by hand that has no effect."""
