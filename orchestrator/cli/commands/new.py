"""The command that begins a scenario: options and questions for what decides."""

from __future__ import annotations

import json
import re
import shlex
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...errors import ConfigurationError
from ...layout import table
from ...scenario import likes
from ...scenario.likes import ASKED, LIKES, USUAL
from ...words.numbers import quantity
from ..common import completion
from ..common.app import app, ask, say, width
from ..common.outcome import say_warnings

if TYPE_CHECKING:
    from ...scenario.decided import Decided
    from ...scenario.scenario import Scenario


def _option(name: str) -> Any:
    """The option that answers a question."""
    it = ASKED[name]
    return typer.Option(
        f"--{name}", metavar="ANSWER", help=f"{it.about} E.g. {shlex.quote(it.example)}.",
        autocompletion=completion.answers(name),
    )  # fmt: skip


@app.command()
def new(
    file: Annotated[Path, typer.Argument(metavar="FILE.toml", help="Scenario file to write.")],
    source: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="SCENARIO",
            help="Begin with the keys of this scenario.",
            autocompletion=completion.scenarios,
        ),
    ] = None,
    like: Annotated[
        str | None,
        typer.Option(
            "--like",
            metavar="|".join(LIKES),
            help=f"Begin with a system of this kind [default: {USUAL}].",
            autocompletion=completion.likes,
        ),
    ] = None,
    beacons: Annotated[str | None, _option("beacons")] = None,
    mounting: Annotated[str | None, _option("mounting")] = None,
    gps: Annotated[str | None, _option("gps")] = None,
    compass: Annotated[str | None, _option("compass")] = None,
    sea: Annotated[str | None, _option("sea")] = None,
    pings: Annotated[str | None, _option("pings")] = None,
    noise: Annotated[str | None, _option("noise")] = None,
    path: Annotated[str | None, _option("path")] = None,
    depth: Annotated[str | None, _option("depth")] = None,
    speed: Annotated[str | None, _option("speed")] = None,
    all_: Annotated[
        bool, typer.Option("--all", help="Write all keys; those not in use are comments.")
    ] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Ask nothing.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
) -> None:
    """Write a scenario file to begin with.

    On a terminal, it asks for what decides about the run, unless an option says it. The file has
    these keys, and those that differ from their defaults. The scenario runs as it is. Its schema is
    written beside it; editors use it to complete and explain keys.
    """
    from ...scenario.scenario import load
    from ...scenario.starter import starter

    file = _checked(file, force)
    if like is not None and source is not None:
        raise ConfigurationError("--like: must come without --from, got both")
    given = {
        "beacons": beacons, "mounting": mounting, "gps": gps, "compass": compass, "sea": sea,
        "pings": pings, "noise": noise, "path": path, "depth": depth, "speed": speed,
    }  # fmt: skip
    answers = {name: text for name, text in given.items() if text is not None}
    asking = not yes and sys.stdin.isatty()
    if asking:
        say("Enter keeps what is in brackets.", err=True)
    if like is None and source is None and asking:
        like = _kind()
    begin = load(likes.like(like or USUAL).source if source is None else source)
    made = _decided(begin, answers, asking)
    if made.scenario.time.duration_s != begin.time.duration_s:
        end = quantity(made.scenario.time.duration_s, "s")
        say(f"the path has no end: the run ends after {end} (duration_s)", err=True)
    text = starter(
        file.stem, made.scenario, asked=made.keys, short=not all_, folder=file.parent
    )
    _write(file, text, force)


_OTHER_FORMAT = r"\.[^\W\d]\w*"
"""An end that is not part of the name, as it is in ``dive.1``."""


def _checked(file: Path, force: bool) -> Path:
    """The file to write, as far as can be told before there is something to write."""
    if not re.match(r"\w", file.name):
        raise ConfigurationError(
            f"{file}: must have a name that begins with a letter or digit, got {file.name!r}"
        )
    if file.suffix != ".toml" and re.fullmatch(_OTHER_FORMAT, file.suffix):
        raise ConfigurationError(f"{file}: must be a TOML file, FILE.toml, got {file.suffix}")
    if file.suffix != ".toml":
        file = file.with_name(f"{file.name}.toml")
    if not file.parent.is_dir():
        raise ConfigurationError(f"{file}: must be in a folder that exists, got {file.parent}")
    if file.is_dir():
        raise ConfigurationError(f"{file}: must be a file, got a folder")
    if file.exists() and not force:
        raise _exists(file)
    return file


def _exists(file: Path) -> ConfigurationError:
    return ConfigurationError(
        f"{file}: must not exist yet, got an existing file; --force replaces it"
    )


def _write(file: Path, text: str, force: bool) -> None:
    """Write a scenario and the schema that goes with it, or neither."""
    from sblcosim.fmus.files import write_file

    from ...scenario.file_schema import FILE_NAME, scenario_schema

    schema = file.with_name(FILE_NAME)
    alone = not schema.exists()
    try:
        write_file(schema, json.dumps(scenario_schema(), indent=1).encode())
    except OSError as error:
        raise ConfigurationError(f"{schema}: must be writable, got {error.strerror}") from None
    try:
        write_file(file, text.encode(), replace=force)
    except OSError as error:
        if alone:
            schema.unlink(missing_ok=True)
        if isinstance(error, FileExistsError):
            raise _exists(file) from None
        raise ConfigurationError(f"{file}: must be writable, got {error.strerror}") from None
    command = shlex.join(["sblcosim", "run", str(file)])
    say(f"written to {file}, with {schema.name} for editors beside it; simulate it with: {command}")


# --- Questions -----------------------------------------------------------------------------------


def _kind() -> str:
    """The kind of system, asked until there is one."""
    say("\nWhat your system is like.", err=True)
    for line in table([(name, it.about) for name, it in LIKES.items()], width()):
        typer.echo(f"  {line}", err=True)
    while True:
        word = ask(f"like [{USUAL}]") or USUAL
        try:
            likes.like(word)
        except ConfigurationError as error:
            _tell(error)
        else:
            return word


def _decided(begin: Scenario, answers: Mapping[str, str], asking: bool) -> Decided:
    """The scenario with the answers that were given as options, and, if asking, with all others."""
    from ...scenario.decided import decided

    made = decided(begin, answers)
    for name in answers:
        _confirm(name, answers[name], made)
    for name in ASKED if asking else ():
        if name not in answers and name in made.open:
            made, answers = _answered(begin, answers, name, made)
    return made


def _answered(
    begin: Scenario, answers: Mapping[str, str], name: str, made: Decided
) -> tuple[Decided, Mapping[str, str]]:
    """One more decision, asked until it can be made, and all answers with it."""
    from ...scenario.decided import decided
    from ...scenario.decisions import DECISIONS

    say_warnings()  # about earlier answers
    it, asked = DECISIONS[name], ASKED[name]
    say(f"\n{asked.about}\n  {it.takes(made.scenario)}.\n  E.g. {asked.example}", err=True)
    while text := ask(f"{name} [{it.shown(made.scenario)}]"):
        try:
            made, answers = decided(begin, {**answers, name: text}), {**answers, name: text}
        except ConfigurationError as error:
            _tell(error)
        else:
            _confirm(name, text, made)
            break
    return made, answers


def _confirm(name: str, text: str, made: Decided) -> None:
    """Show how an answer was read, unless it shows that itself."""
    from ...scenario.decisions import DECISIONS

    shown = DECISIONS[name].shown(made.scenario)
    if shown != text:
        say(f"  {name}: {shown}", err=True)


def _tell(error: ConfigurationError) -> None:
    """Print what is wrong with an answer."""
    for line in str(error).splitlines():
        say(f"  {line}", err=True)
