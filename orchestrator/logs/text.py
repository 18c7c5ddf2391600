"""Tables of text (CSV) in which lines may be damaged."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from pyarrow import compute
from pyarrow import csv as csv_of
from sblcosim.fmus.files import regular

from ..errors import ConfigurationError, quoted
from ..scenario.reading import shown
from .raw import Raw

LARGEST = 1 << 30
"""Largest file [bytes]."""
_LONG = 100_000
"""Shortest line [characters] that `csv` may refuse."""
_LOST = "\N{REPLACEMENT CHARACTER}"


def content(path: Path) -> str:
    """Text of a file; bytes that are not UTF-8 become a mark, and their lines are found later.

    Only line feeds and carriage returns end a line, as editors count; all become line feeds.

    Raises
    ------
    ConfigurationError
        The file cannot be read.
    """
    try:
        with regular(path).open("rb") as file:
            found = file.read(LARGEST + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ConfigurationError(
            f"{shown(path)}: must be a file that can be read, got {reason}"
        ) from None
    if len(found) > LARGEST:
        raise ConfigurationError(f"{shown(path)}: must have at most {LARGEST:,} bytes, got more")
    if found[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise ConfigurationError(f"{shown(path)}: must be a text file in UTF-8, got UTF-16")
    text = found.decode("utf-8-sig", "replace")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def damaged(line: str) -> bool:
    """Whether a line has bytes that no text has."""
    return _LOST in line or "\0" in line


def table(path: Path, name: str, raw: Raw, delimiter: str = "") -> pd.DataFrame:
    """A table of words, with the number of each line; damaged lines are noted.

    Parameters
    ----------
    name
        Name of the table in `Raw.tables`, for the findings.
    delimiter
        What separates columns; empty: comma, semicolon or tabulator, whichever is in the first
        line most often.

    Raises
    ------
    ConfigurationError
        The file cannot be read, or does not begin with the names of its columns.
    """
    text = content(path)
    everything = text.split("\n")
    numbers = [
        number for number, line in enumerate(everything)
        if line.strip() and not line.startswith("#")
    ]
    first = everything[numbers[0]] if numbers else ""
    delimiter = delimiter or max(",;\t", key=first.count)
    header = [] if damaged(first) else _cells(first, delimiter)
    if not any(header):
        raise ConfigurationError(f"{shown(path)}: must begin with the names of its columns")
    again = next((c for i, c in enumerate(header) if c in header[:i]), None)
    if again is not None:
        raise ConfigurationError(
            f"{shown(path)}: must have columns of different names, got {quoted(again)} twice"
        )
    numbers = numbers[1:]
    lines = [everything[number] for number in numbers]
    columns, good = (_split if _is_plain(text, delimiter) else _parsed)(
        lines, len(header), delimiter
    )
    line, whole = np.array(numbers, np.int64) + 1, np.array(good, bool)
    raw.damaged(name, path.name, line[~whole].tolist(), "damaged")
    table = pd.DataFrame(dict(zip(header, columns, strict=True)), dtype=object)
    return table.assign(line=line[whole])


_Columns = tuple[Sequence[Any], list[bool]]
"""Columns of words, and whether each line is in them."""


def _parsed(lines: Sequence[str], width: int, delimiter: str) -> _Columns:
    """Columns of lines that may have quotes and damage."""
    cells = [[] if damaged(line) else _cells(line, delimiter) for line in lines]
    good = [len(own) == width for own in cells]
    rows = [own for own in cells if len(own) == width]
    return [*zip(*rows, strict=True)] if rows else [()] * width, good


def _is_plain(text: str, delimiter: str) -> bool:
    """Whether each delimiter in a text divides cells, and all white space is that of ASCII."""
    odd = ('"', "\0", *map(chr, range(0x1C, 0x20)))
    short = len(text) < _LONG or max(map(len, text.split("\n"))) < _LONG
    return text.isascii() and delimiter.isascii() and short and not any(c in text for c in odd)


def _split(lines: Sequence[str], width: int, delimiter: str) -> _Columns:
    """Columns of lines in which delimiters have no other meaning: some ten times faster."""
    good = [line.count(delimiter) == width - 1 for line in lines]
    kept = "\n".join(compress(lines, good))
    if not kept:
        return [()] * width, good
    names = [str(number) for number in range(width)]
    table = csv_of.read_csv(
        pa.py_buffer(kept.encode()),
        csv_of.ReadOptions(use_threads=False, column_names=names),
        csv_of.ParseOptions(delimiter=delimiter, quote_char=False, double_quote=False),
        csv_of.ConvertOptions(column_types=dict.fromkeys(names, pa.string())),
    )
    return [compute.ascii_trim_whitespace(own).to_numpy() for own in table.columns], good


def _cells(line: str, delimiter: str) -> list[str]:
    try:
        (row,) = csv.reader([line], delimiter=delimiter, strict=True)
    except (csv.Error, ValueError):
        return []
    return [cell.strip() for cell in row]
