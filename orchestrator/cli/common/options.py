"""Messages of the API in the words of the command line: options instead of arguments."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import zip_longest
from typing import Any

_UNIT = re.compile(r"(_time)?(_(m|s|m_s|Hz))?$")
"""Suffixes of argument names that options omit."""


def in_options(line: str, command: Any, args: Sequence[str]) -> str:
    """A message that names the typed option instead of the argument that it became.

    Parameters
    ----------
    line
        ``ARGUMENT: what must hold``, ``COMMAND ARGUMENT: …`` or ``override KEY: …``; also after the
        name of a scenario or a component, if the message ends with the typed value. Any other
        message is returned unchanged.
    command
        Click's, with its parameters.
    args
        What was typed after the command's name. Without that name in front, an argument may be the
        name of a scenario, so its option must be among these.
    """
    head, colon, rest = line.partition(": ")
    if not colon:
        return line
    options, typed = _options(command), _typed(args)
    before, _, last = head.partition(" ")
    if before == "override":
        own = options.get(_plain(last), "")
        option = own if own in typed else "--set" if "--set" in typed else None
        key = "" if option == own or not last else f" {last}"
        return line if option is None else f"{option}{key}: {rest}"
    if before == command.name and last and _plain(last) in options:
        return f"{options[_plain(last)]}: {rest}"
    if options.get(_plain(head)) in typed:
        return f"{options[_plain(head)]}: {rest}"
    *places, name = re.split(r": |\.", line.partition(": must")[0])
    option = options.get(_plain(name))
    if places and option in typed and _ends_with(line, typed[option]):
        return f"{option}: must{line.partition(': must')[2]}"
    return line


def _typed(args: Sequence[str]) -> dict[str, str]:
    """Typed values by option; empty for an option without one."""
    found = {}
    for word, after in zip_longest(args, args[1:], fillvalue=""):
        if word.startswith("--"):
            option, equals, value = word.partition("=")
            found[option] = value if equals else after
    return found


def _options(command: Any) -> dict[str, str]:
    """Options by the plain names of the arguments that they become."""
    found = {}
    for param in command.params:
        for option in param.opts:
            if option.startswith("--"):
                for name in (param.metavar or param.name, param.name, option[2:]):
                    found[_plain(name.lower())] = option
    return found


def _plain(name: str) -> str:
    """The name of an argument without unit and plural."""
    return _UNIT.sub("", re.sub("[ -]", "_", name.strip("_"))).removesuffix("s")


def _ends_with(line: str, value: str) -> bool:
    """Whether a message says that it got a value."""
    got = line.rpartition(", got ")[2].partition(" ")[0].strip("'")
    try:
        return float(got) == float(value)
    except ValueError:
        return got == value
