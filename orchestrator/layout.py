"""Text that fits a terminal: long lines are wrapped at words, tables are no wider than it is.

Without a width, as in a pipe or a file, nothing is wrapped.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from math import isfinite

WIDTH = 80
"""Columns of what has a layout of its own, where no terminal says otherwise."""
_UNLIMITED = 10_000
_BEFORE_UNIT = re.compile(r"(?<=\d) (?=(?:%|m|s)(?:\W|$))")
_KEPT = "\N{NO-BREAK SPACE}"


def fitted(text: str, width: int | None) -> str:
    """A text with its long lines wrapped; what follows of such a line is indented.

    A word that is longer than a line, such as a path, is left whole.

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
        _BEFORE_UNIT.sub(_KEPT, line), width, subsequent_indent=f"{indent}  ",
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip
    return [part.replace(_KEPT, " ") for part in parts]


def meters(length: float) -> str:
    """A length in m for a sentence, with two digits that mean something."""
    if not isfinite(length):
        return "– m"
    digits = 0 if length >= 9.95 else 1 if length >= 0.995 else 2 if length >= 0.0995 else 3
    return f"{length:,.{digits}f} m"


def table(
    rows: Iterable[Sequence[str]],
    width: int | None,
    head: Sequence[str] = (),
    right: Sequence[int] = (),
) -> Iterator[str]:
    """The lines of a table; cells are wrapped where it would be too wide.

    Parameters
    ----------
    rows
        Cells, as many in each row.
    width
        Columns; None: as wide as the cells are.
    head
        Names of the columns.
    right
        Columns that are aligned to the right, counted from 0.
    """
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    grid = Table(box=None, pad_edge=False, show_header=bool(head), header_style="")
    lines = [*rows]
    for i in range(len(head) or len(lines[0])):
        side = "right" if i in right else "left"
        grid.add_column(Text(head[i]) if head else "", justify=side, overflow="fold")  # type: ignore[arg-type]
    for line in lines:
        grid.add_row(*map(Text, line))
    screen = Console(width=width or _UNLIMITED, color_system=None, legacy_windows=False)
    with screen.capture() as captured:
        screen.print(grid)
    for text in captured.get().splitlines():
        yield text.rstrip()
