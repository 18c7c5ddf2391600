"""The exceptions of the package, and the wording they share.

A message is one line: ``WHERE: what must hold, got WHAT; did you mean NEAREST?``. The command line
prints it as it is.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import PurePath

LONGEST = 80
"""Characters of a value that a message shows."""

LONGEST_PATH = 255
"""Of a path, because people go there."""

_LONG = re.compile(
    r"""(?<!\w)'(?:\\.|[^'\\\n])+'(?!\w) | (?<!\w)"(?:\\.|[^"\\\n])+"(?!\w)
      | (?<=got\ )[\[{(][^\n]{255,} | \S+""",
    re.VERBOSE,
)


class Concise:
    """Messages in which no value is longer than people read, whoever has put it there."""

    def __init__(self, *arguments: object) -> None:
        super().__init__(*(concise(a) if isinstance(a, str) else a for a in arguments))


class SblcosimError(Concise, Exception):
    """Base of every exception that `sblcosim` raises on purpose."""

    component: str | None = None
    """Name of the component whose failure ended a run."""
    suspects: tuple[str, ...] = ()
    """Names of all that may have caused it, where that is not certain."""


class FmuError(SblcosimError):
    """An FMU is missing or broken, does not fit this machine, or has reported a failure."""


class BuildError(FmuError):
    """An FMU could not be built."""


class DamageWarning(Concise, UserWarning):
    """A file of ours is not as it was written, and something is done about it."""


def one_line(error: BaseException) -> str:
    """What an exception says, without line breaks."""
    return " ".join(str(error).split()) or type(error).__name__


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
    """A value of a wrong type, for messages."""
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


def concise(message: str) -> str:
    """A message whose quoted values and words are shortened; of paths, only the absurdly long."""

    def short(match: re.Match[str]) -> str:
        word = match[0]
        is_path = "/" in word or "\\" in word
        if len(word) <= (LONGEST_PATH if is_path else LONGEST + 2):  # two quotes
            return word
        return shortened(word)

    return _LONG.sub(short, message) if len(message) > LONGEST else message


def escaped(text: str) -> str:
    """A text whose characters all print, and so on one line."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
