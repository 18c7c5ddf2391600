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
"""Number of characters of a value that a message shows."""

LONGEST_PATH = 255
"""The same for a path, because people go there."""

_LONG = re.compile(
    r"""(?<!\w)'(?:\\.|[^'\\\n])+'(?!\w) | (?<!\w)"(?:\\.|[^"\\\n])+"(?!\w)
      | (?<=got\ )[\[{(][^\n]{255,} | \S+""",
    re.VERBOSE,
)


class Concise:
    """Messages in which overlong values are shortened, wherever they come from."""

    def __init__(self, *arguments: object) -> None:
        super().__init__(*(concise(a) if isinstance(a, str) else a for a in arguments))


class SblcosimError(Concise, Exception):
    """Base of every exception that `sblcosim` raises on purpose."""

    component: str | None = None
    """Name of the component whose failure ended a run."""
    suspects: tuple[str, ...] = ()
    """Names of all components that may have caused it, if that is not certain."""


class FmuError(SblcosimError):
    """An FMU is missing or broken, does not fit this machine, or has reported a failure."""


class BuildError(FmuError):
    """An FMU could not be built."""


class DamageWarning(Concise, UserWarning):
    """One of our files has changed since it was written; something is being done about it."""


def one_line(error: BaseException) -> str:
    """The text of an exception, without line breaks."""
    return " ".join(str(error).split()) or type(error).__name__


def nearest(name: str, candidates: Iterable[str]) -> str:
    """The end of a message about an unknown name.

    Returns
    -------
    str
        ``"; did you mean 'x'?"``, or nothing if no candidate resembles the name, in any case.
        Best is the shortest candidate that has all words of the name in their order.
    """
    known = list(candidates)
    whole = [it for it in known if _has_words(it, name.split("_"))] if len(name) > 2 else []
    if whole:
        return f"; did you mean {min(whole, key=len)!r}?"
    spelled = {it.casefold(): it for it in reversed(known)}
    matches = get_close_matches(name, known, n=1) or [
        spelled[it] for it in get_close_matches(name.casefold(), spelled, n=1)
    ]
    return f"; did you mean {matches[0]!r}?" if matches else ""


def _has_words(name: str, words: list[str]) -> bool:
    rest = iter(name.split("_"))
    return all(word in rest for word in words)


def instance(value: object) -> str:
    """A value of a wrong type, as named in messages."""
    if value is None or isinstance(value, bool | int | float | str | bytes):
        return quoted(value)
    return f"an instance of {type(value).__qualname__}"


def shortened(value: object, longest: int = LONGEST) -> str:
    """A value for a message, shortened in the middle if it has too many characters.

    Parameters
    ----------
    value
        A text or a path is used as it is, so that the caller decides about quotes, but unprintable
        characters such as line breaks are escaped. Other values are shown by their `repr`.
    """
    try:
        text = escaped(str(value)) if isinstance(value, str | PurePath) else repr(value)
    except (ValueError, RecursionError):  # an integer with thousands of digits, or deep nesting
        text = instance(value) if not isinstance(value, int) else "an integer with too many digits"
    if len(text) <= longest:
        return text
    end = longest // 3
    return f"{text[: longest - end - 3]}...{text[-end:]}"


def quoted(value: object) -> str:
    """A value for a message as Python writes it, shortened; texts in quotes."""
    return shortened(repr(value)) if isinstance(value, str) else shortened(value)


def concise(message: str) -> str:
    """A message with its quoted values and words shortened; paths only if absurdly long."""

    def short(match: re.Match[str]) -> str:
        word = match[0]
        is_path = "/" in word or "\\" in word
        if len(word) <= (LONGEST_PATH if is_path else LONGEST + 2):  # two quotes
            return word
        return shortened(word)

    return _LONG.sub(short, message) if len(message) > LONGEST else message


def escaped(text: str) -> str:
    """A text with only printable characters, hence on one line."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
