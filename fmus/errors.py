"""The exceptions of the package, and the wording they share.

A message is one line: ``WHERE: what must hold, got WHAT; did you mean NEAREST?``. The command line
prints it as it is.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import PurePath

LONGEST = 80
"""Characters of a value that a message shows."""


class SblcosimError(Exception):
    """Base of every exception that `sblcosim` raises on purpose."""

    component: str | None = None
    """Name of the component whose failure ended a run."""
    suspects: tuple[str, ...] = ()
    """Names of all that may have caused it, where that is not certain."""


class FmuError(SblcosimError):
    """An FMU is missing or broken, does not fit this machine, or has reported a failure."""


class BuildError(FmuError):
    """An FMU could not be built."""


class DamageWarning(UserWarning):
    """A file of ours is not as it was written, and something is done about it."""


def nearest(name: str, candidates: Iterable[str]) -> str:
    """The end of a message about an unknown name.

    Returns
    -------
    str
        ``"; did you mean 'x'?"``, or nothing if no candidate resembles the name.
    """
    matches = get_close_matches(name, list(candidates), n=1)
    return f"; did you mean {matches[0]!r}?" if matches else ""


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
        A text or a path is taken as it is, so that the caller decides about quotes, but what does
        not print, such as a line break, is escaped; of anything else it is the `repr`.
    """
    try:
        text = escaped(str(value)) if isinstance(value, str | PurePath) else repr(value)
    except (ValueError, RecursionError):  # an integer of thousands of digits, or a deep nesting
        text = instance(value) if not isinstance(value, int) else "an integer with too many digits"
    if len(text) <= longest:
        return text
    end = longest // 3
    return f"{text[: longest - end - 3]}...{text[-end:]}"


def quoted(value: object) -> str:
    """A value for a message as Python writes it, shortened; texts in quotes."""
    return shortened(repr(value)) if isinstance(value, str) else shortened(value)


def escaped(text: str) -> str:
    """A text whose characters all print, and so on one line."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
