"""What a report of a study is made of, whatever its design."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import pandas as pd

from .. import artifacts
from ..results.figures.catalogue import Figure, jobs
from .page import Block, PagePicture

Subject = TypeVar("Subject")


@dataclass(frozen=True, eq=False)
class StudySections:
    """The parts that depend on the kind of a design.

    Attributes
    ----------
    title, answer, warnings
        Of the page; what is found, in sentences; what stands against it.
    pictures, tables, method
        Figures, tables of numbers, and how they were made.
    files
        Tables to write, by the names of their files.
    runs
        That were analysed.
    heading
        Of the tables.
    """

    title: str
    answer: str
    warnings: Sequence[str]
    pictures: Sequence[PagePicture]
    tables: Sequence[Block]
    method: Sequence[Block]
    runs: int
    files: Mapping[str, pd.DataFrame] = field(default_factory=dict)
    heading: str = "Numbers"

    def write(self, folder: Path) -> None:
        """Write the tables."""
        for name, table in self.files.items():
            artifacts.write_table(table, folder, name)


def pictures(
    figures: Mapping[str, Figure[Subject]], subject: Subject, folder: Path
) -> list[PagePicture]:
    """Draw all figures that the subject has, into the folder and for a page."""
    drawn = []
    for job in jobs(figures, subject):
        figure = figures[job.name]
        job.save(folder)
        svg = (folder / f"{job.name}.svg").read_text("utf-8")
        drawn.append(PagePicture(job.name, svg, figure.caption(subject), figure.alt(subject)))
    return drawn
