"""How a command ends: every exception and warning becomes a line, and an exit code."""

from __future__ import annotations

import errno
import os
import re
import shlex
import signal
import sys
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NoReturn

import typer
from sblcosim.fmus import stopping
from sblcosim.fmus.files import working_directory_problem
from sblcosim.fmus.stopping import Terminated
from typer.core import TyperCommand, TyperGroup

from ...errors import (
    ConfigurationError,
    ConfigurationWarning,
    DamageWarning,
    SblcosimError,
    escaped,
    nearest,
    one_line,
    shortened,
)
from ...scenario.files import naming
from .options import in_options

TRACEBACK = "SBLCOSIM_TRACEBACK"
"""Environment variable that lets unexpected exceptions through, with their traceback."""

_HINT = f"; {TRACEBACK}=1 shows where"

_NO_OUTPUT = (errno.ENOSPC, errno.EIO, errno.EBADF, errno.EFBIG, errno.EDQUOT)
"""Errors of writing to standard output; errors of our files have a file name."""

_DECLARATION = "DeclarationError"
"""Name of the exception of a wrong declaration, which keeps the package that has it from loading.
"""

_UsageError: Any = typer.BadParameter.__base__
"""Click's exceptions, which Typer keeps in different places."""


class Command(TyperCommand):
    """A command whose help names its arguments as our texts do, whatever the version of Typer.

    It takes no option for the value of the option before. ``--out=--x`` is a value.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        if not ctx.resilient_parsing:
            self._check_values(args)
        return super().parse_args(ctx, args)

    def _check_values(self, args: list[str]) -> None:
        """Refuse an option in the place of another option's value.

        Raises
        ------
        ConfigurationError
            It names the option whose value is missing.
        """
        takers = {name for it in self.params if not getattr(it, "is_flag", False)
                  for name in _names(it)}  # fmt: skip
        words = iter(args)
        for word in words:
            if word == "--":
                return
            value = next(words, "") if word in takers else ""
            if value.startswith("--") or value == "-h":
                raise ConfigurationError(
                    f"{word}: must have a value, got none before {shortened(repr(value))}"
                )

    def get_help(self, ctx: Any) -> str:
        usage, _, rest = super().get_help(ctx).partition("\n\n")
        usage = re.sub(r"\{([^{}\s]+)\}", r"\1", usage)
        rest = re.sub(
            r"^(  \S+) (<[\w\[\], ]+>)",
            lambda found: found[1] + " " * (1 + len(found[2])), rest, flags=re.M,
        )
        return f"{usage}\n\n{rest}"


class App(typer.Typer):
    """A Typer whose commands are ours."""

    def command(  # type: ignore[override]
        self, name: str | None = None, **options: Any
    ) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
        """As Typer's."""
        return super().command(name, cls=Command, **options)


class Commands(TyperGroup):
    """Commands; an unknown one is refused in our wording."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        name = args[0]
        if name not in self.commands and not (name.startswith("-") or ctx.resilient_parsing):
            known = list(self.commands)
            raise ConfigurationError(
                f"{ctx.command_path}: the command must be one of {', '.join(known)}, got "
                f"{shortened(repr(name))}{nearest(name, known)}"
            )
        resolved = super().resolve_command(ctx, args)
        _typed[:] = resolved[1], tuple(resolved[2])  # the parser empties the list
        return resolved


class ErrorReportingGroup(Commands):
    """Prints a line for each problem, and each warning once."""

    def make_context(
        self, info_name: str | None, args: list[str], *arguments: Any, **options: Any
    ) -> Any:
        _typed.clear()
        if options.get("resilient_parsing"):  # the shell completes and wants no messages
            return super().make_context("sblcosim", args, *arguments, **options)
        with _in_lines():  # messages show the command as typed, however the program was started
            _check_surroundings(args)
            return super().make_context("sblcosim", args, *arguments, **options)

    def invoke(self, ctx: Any) -> Any:
        stoppable = stopping.stoppable(command=True, ends=(typer.Exit, typer.Abort))
        with _in_lines(), _warnings_in_lines(), naming(), stoppable:
            return super().invoke(ctx)


def _check_surroundings(args: list[str]) -> None:
    problem = working_directory_problem()
    if problem is not None:
        raise ConfigurationError(problem)
    for argument in args:
        if any("\ud800" <= c <= "\udfff" for c in argument):
            shown = shortened(repr(os.fsencode(argument)))
            raise ConfigurationError(f"arguments: must be UTF-8, got {shown}")


@contextmanager
def _in_lines() -> Iterator[None]:
    try:
        yield
    except (typer.Exit, typer.Abort, BrokenPipeError):
        raise
    except SblcosimError as error:
        _fail(*str(error).splitlines())
    except MemoryError:
        _fail(
            "the memory of this machine must be enough, got too large a run; make it shorter or "
            "the sampling time longer"
        )
    except KeyboardInterrupt as stop:
        _end(stopped_line(stop), stopped(stop))
    except Exception as error:
        if type(error).__name__ == _DECLARATION:
            _fail(*str(error).splitlines())
        if isinstance(error, OSError) and error.filename is None and error.errno in _NO_OUTPUT:
            _forget(sys.stdout)
            _fail(f"output: must be writable, got {error.strerror}")
        if isinstance(error, _UsageError):
            if type(error).__name__ == "NoArgsIsHelpError":
                raise
            _fail(_usage(error))
        if os.environ.get(TRACEBACK):
            raise
        _fail(_unforeseen(error))


def stopped_line(stop: KeyboardInterrupt) -> str:
    """Message of a stopped command; the exception lists the folders that were complete by then."""
    what = "terminated" if isinstance(stop, Terminated) else "interrupted"
    written = ", ".join(shortened(str(path), 240) for path in stop.args)
    return f"{what}; {f'complete before that: {written}' if written else 'nothing was written'}"


def stopped(stop: KeyboardInterrupt) -> int:
    """Exit code."""
    return 128 + (signal.SIGTERM if isinstance(stop, Terminated) else signal.SIGINT)


def kept(stop: KeyboardInterrupt, runs: str, folder: Path) -> NoReturn:
    """End a command that was stopped.

    It says how many runs are in a folder and how to continue. Without a folder, nothing was
    written.
    """
    if not folder.exists():
        raise stop
    _end(f"interrupted; {runs} runs are in {folder}; go on with: {typed()}", stopped(stop))


def typed() -> str:
    """The command as typed, for a shell."""
    return shlex.join(["sblcosim", *sys.argv[1:]])


def _fail(*lines: str) -> NoReturn:
    for line in lines:
        typer.echo(f"error: {escaped(_in_options(line))}", err=True)
    raise typer.Exit(2) from None


def _end(line: str, code: int) -> NoReturn:
    typer.echo(line, err=True)
    raise typer.Exit(code) from None


def _unforeseen(error: Exception) -> str:
    """The line for an exception of another kind."""
    if isinstance(error, OSError) and error.strerror:
        if error.filename is None:
            return f"reading and writing must succeed, got {error.strerror}{_HINT}"
        where = shortened(os.fsdecode(error.filename))
        return f"{where}: must be readable and writable, got {error.strerror}"
    got = f"{type(error).__name__}: {shortened(one_line(error))}"
    return f"this must not happen, please report it: got {got}{_HINT}"


def _forget(stream: Any) -> None:
    """Drop unwritten output: at exit it would fail again."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def _usage(error: Any) -> str:
    """What is wrong with the arguments."""
    where = "sblcosim" if error.ctx is None else error.ctx.command_path
    param = getattr(error, "param", None)
    if hasattr(error, "possibilities"):
        known = [*(o for p in error.ctx.command.params for o in _names(p)), "--help"]
        name = error.option_name
        return (
            f"{where}: an option must be one of {', '.join(known)}, got {shortened(repr(name))}"
            f"{nearest(name, known)}"
        )
    if hasattr(error, "option_name"):
        alone = "not take" in error.message
        return f"{error.option_name}: must " + (
            "stand alone, got a value" if alone else "have a value, got none"
        )
    if param is not None and type(error).__name__ == "MissingParameter":
        name = (_names(param) or [param.metavar])[0]
        return f"{where}: {name} must be given, got nothing; {where} --help says what it is"
    if param is not None:
        return f"{(_names(param) or [param.metavar])[0]}: {one_line(error)}"
    extra = re.match(r"Got unexpected extra arguments? ?(?:\(s\) )?\((.*)\)$", error.message, re.S)
    if extra:
        takes = [p.metavar for p in error.ctx.command.params if not _names(p)]
        what = f"no arguments beside {' '.join(takes)}" if takes else "no arguments"
        return f"{where}: must have {what}, got {shortened(extra[1])}"
    return f"{where}: {shortened(error.message)}"


def _names(param: Any) -> list[str]:
    """Names of an option; an argument has none."""
    return [name for name in param.opts if name.startswith("-")]


def _in_options(line: str) -> str:
    """A message about an argument that names the typed option."""
    return in_options(line, *_typed) if _typed else line


_typed: list[Any] = []
"""The running command, and what was typed after its name."""
_pending: Counter[str] = Counter()
_said: set[str] = set()


@contextmanager
def _warnings_in_lines() -> Iterator[None]:
    """Print each warning once, with its number of occurrences."""
    _pending.clear()
    _said.clear()
    try:
        with warnings.catch_warnings():
            for ours in (ConfigurationWarning, DamageWarning):
                warnings.simplefilter("always", ours)
            warnings.showwarning = _note
            yield
    finally:
        say_warnings()


def _note(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    if str(message) not in _said:
        _pending[str(message)] += 1


def say_warnings() -> None:
    """Print the warnings so far."""
    for text, times in list(_pending.items()):
        again = f" ({times} times)" if times > 1 else ""
        typer.echo(f"warning: {escaped(_in_options(text))}{again}", err=True)
    _said.update(_pending)
    _pending.clear()
