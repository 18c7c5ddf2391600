"""The command that prints JSON schemas."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated, Any

import typer

from ..errors import check_choice
from .base import app, table

_FILES: Mapping[str, str] = {
    "scenario": "scenario files; 'sblcosim new' writes it beside a scenario",
    "study": "study files; write it beside yours, whose first line is then #:schema ./FILE",
}


@app.command()
def schema(
    name: Annotated[
        str | None, typer.Argument(metavar="[NAME]", help="scenario, study, or COMMAND.json.")
    ] = None,
) -> None:
    """Print a JSON schema: of the files that commands read, or of what they print with --json.

    Without a name, list all. Editors of TOML take the first two, e.g. Even Better TOML.
    """
    from .documents import DOCUMENTS

    printed = {f"{command}.json": command for command in DOCUMENTS}
    if name is None:
        rows = [*_FILES.items()]
        rows += [(file, f"what 'sblcosim {it} --json' prints") for file, it in printed.items()]
        table(rows)
        return
    check_choice("schema", name, [*_FILES, *printed])
    typer.echo(json.dumps(_schema(name, printed), indent=2))


def _schema(name: str, printed: Mapping[str, str]) -> dict[str, Any]:
    if name == "scenario":
        from ..scenario.file_schema import scenario_schema

        return scenario_schema()
    if name == "study":
        from ..study.file_schema import study_schema

        return study_schema()
    from .documents import schema as schema_of

    return schema_of(printed[name])
