"""Text that fits a terminal: long lines are wrapped at words, tables are no wider than it.

Without a width, as in a pipe or a file, nothing is wrapped.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from itertools import zip_longest

WIDTH = 80
"""Columns of texts with their own layout, unless a terminal gives a number."""
_BEFORE_UNIT = re.compile(
    r"(?<=\d) (?=(?:%|°C|(?:[kcmµn]?m|[mµn]?s|k?Hz|min|h|ppm)(?:/s)?)(?:\W|$))"
)
_KEPT = "\N{NO-BREAK SPACE}"


def fitted(text: str, width: int | None) -> str:
    """A text with its long lines wrapped; continuation lines are indented.

    A word longer than a line, such as a path, is not broken.

    Parameters
    ----------
    width
        Columns; None: the text as it is.
    """
    if width is None:
        return text
    return "\n".join(part for line in text.split("\n") for part in _wrapped(line, width))


def _wrapped(line: str, width: int) -> list[str]:
    if len(line) <= width:
        return [line]
    indent = line[: len(line) - len(line.lstrip())]
    parts = textwrap.wrap(
        with_units(line), width, subsequent_indent=f"{indent}  ",
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip
    return [part.replace(_KEPT, " ") for part in parts]


def with_units(text: str) -> str:
    """A text to be broken into lines, in which numbers stay with their units."""
    return _BEFORE_UNIT.sub(_KEPT, text)


def filled(text: str, width: int) -> str:
    """A label or title of a figure in lines of at most that many characters."""
    return textwrap.fill(with_units(text), width).replace(_KEPT, " ")


def shorter(name: str, longest: int) -> str:
    """A name with its middle left out, if it is too long."""
    if len(name) <= longest:
        return name
    tail = (longest - 1) // 2
    return f"{name[: longest - tail - 1]}…{name[len(name) - tail :]}"


def table(
    rows: Iterable[Sequence[str]],
    width: int | None,
    head: Sequence[str] = (),
    right: Sequence[int] = (),
) -> Iterator[str]:
    """The lines of a table. If it would be too wide, its cells are wrapped, between words if
    possible.

    Parameters
    ----------
    rows
        Cells; all rows have the same number.
    width
        Columns; None: as wide as the cells.
    head
        Names of the columns.
    right
        Columns that are aligned to the right, counted from 0.
    """
    lines = [*([head] if head else []), *rows]
    columns = [*zip(*lines, strict=True)]
    words = [max((len(word) for cell in cells for word in cell.split()), default=1)
             for cells in columns]  # fmt: skip
    gaps = len(columns) - 1
    gap = 2 if width is None or sum(words) + 2 * gaps <= width else 1
    sizes = [max(map(len, cells)) for cells in columns]
    if width is not None:
        _shrink(sizes, words, width - gap * gaps)
    for line in lines:
        parts = [
            [cell] if len(cell) <= size else textwrap.wrap(cell, size, break_on_hyphens=False)
            for cell, size in zip(line, sizes, strict=True)
        ]
        for row in zip_longest(*parts, fillvalue=""):
            yield (" " * gap).join(
                part.rjust(size) if i in right else part.ljust(size)
                for i, (part, size) in enumerate(zip(row, sizes, strict=True))
            ).rstrip()


def _shrink(sizes: list[int], words: Sequence[int], room: int) -> None:
    """Make the widest columns narrower until all fit; break words only if necessary."""
    while sum(sizes) > room:
        free = [i for i, size in enumerate(sizes) if size > words[i]]
        widest = max(free or range(len(sizes)), key=sizes.__getitem__)
        if sizes[widest] == 1:
            return
        sizes[widest] -= 1
