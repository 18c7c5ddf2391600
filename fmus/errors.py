"""The exceptions of the package, and the wording they share.

A message is one line: ``WHERE: what must hold, got WHAT; did you mean NEAREST?``. The command line
prints it as it is.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


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


def nearest(name: str, candidates: Iterable[str]) -> str:
    """The end of a message about an unknown name.

    Returns
    -------
    str
        ``"; did you mean 'x'?"``, or nothing if no candidate resembles the name.
    """
    matches = get_close_matches(name, list(candidates), n=1)
    return f"; did you mean {matches[0]!r}?" if matches else ""
