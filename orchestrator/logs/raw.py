"""What readers hand over: tables with the columns of a log, not yet checked."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd


REPEATED = "a value that was only read again"
"""What is said of lines whose value was not measured anew."""


@dataclass(frozen=True)
class Flaw:
    """A line of a log that could not be used as it stands.

    Attributes
    ----------
    file, line
        Where it stands; lines count from 1.
    what
        What is wrong with such lines, as the end of "3 lines ...": the same words for all of a
        kind.
    used
        Whether the line counts all the same, put right.
    of
        Name of the beacon or device, where it is known.
    table
        Name of the table that the line belongs to, where it is known.
    """

    file: str
    line: int
    what: str
    used: bool = False
    of: str = ""
    table: str = ""


@dataclass
class Raw:
    """A log as read: tables of `sblcosim.logs.columns`, with values of any type.

    Attributes
    ----------
    name
        Name of the log.
    meta
        Content of ``meta.toml``.
    where
        Name of the file that `meta` is from, for messages.
    tables
        By name; a table that the source lacks is left out. Each has a column ``line``, and may
        have ``file``; without it, `files` names the file of a table.
    findings
        Lines that are not in the tables.
    remarks
        What else must be known, as sentences.
    scenario
        File of the scenario that made the log, or whose settings fit it.
    """

    name: str
    meta: dict[str, Any] = field(default_factory=dict)
    where: str = "meta.toml"
    tables: dict[str, pd.DataFrame] = field(default_factory=dict)
    files: dict[str, str] = field(default_factory=dict)
    findings: list[Flaw] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    scenario: Path | None = None

    def note(self, table: str, rows: pd.DataFrame, what: str, *, used: bool = False) -> None:
        """Note rows of a table, which have a column ``line``."""
        n, blank = len(rows), [""] * len(rows)
        of = {"receptions": "beacon", "fixes": "device"}.get(table)
        names = list(map(str, rows[of])) if of in rows else blank
        files = list(rows["file"]) if "file" in rows else [self.files.get(table, table)] * n
        self.findings += [
            Flaw(file, int(line), what, used, name, table)
            for file, line, name in zip(files, rows["line"], names, strict=True)
        ]

    def damaged(self, table: str, file: str, lines: Iterable[int], what: str) -> None:
        """Note lines that are in no table."""
        self.findings += [Flaw(file, line, what, table=table) for line in lines]
