"""The command that prints JSON schemas."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated, Any

import typer

from ...errors import check_choice
from ..common import completion
from ..common.app import app, table

_FILES: Mapping[str, str] = {
    "scenario": "scenario files; 'sblcosim new' writes it beside a scenario",
    "study": "study files; write it beside yours and begin yours with #:schema ./FILE",
    "question": "question files; the same applies",
}


def _names() -> dict[str, str]:
    """The schemas, each with its purpose."""
    from ..documents.by_command import COMMANDS

    printed = {f"{it}.json": f"what 'sblcosim {that} --json' prints"
               for it, that in COMMANDS.items()}  # fmt: skip
    return {**_FILES, **printed}


def _offers(incomplete: str) -> completion.Offers:
    return completion.starting(_names().items(), incomplete)


@app.command()
def schema(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME",
            help="scenario, study, question, or COMMAND.json; none: list all.",
            autocompletion=_offers,
        ),
    ] = None,
) -> None:
    """Print a JSON schema of files, or of the output of --json.

    Editors for TOML, e.g. Even Better TOML, use the schemas of files to complete and explain keys.
    Without a name, list all schemas.
    """
    if name is None:
        table([*_names().items()])
        return
    check_choice("schema", name, [*_names()])
    typer.echo(json.dumps(_schema(name), indent=2))


def _schema(name: str) -> dict[str, Any]:
    if name == "scenario":
        from ...scenario.file_schema import scenario_schema

        return scenario_schema()
    if name == "study":
        from ...study.file_schema import study_schema

        return study_schema()
    if name == "question":
        from ...require.file_schema import question_schema

        return question_schema()
    from ..documents.by_command import schema as schema_of

    return schema_of(name.removesuffix(".json"))
