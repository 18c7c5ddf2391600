"""The parts of a study's report that all designs share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from ..catalogue import Figure, jobs
from .page import Block, PagePicture, Section

Subject = TypeVar("Subject")


@dataclass(frozen=True, eq=False)
class StudySections:
    """The parts that depend on the kind of a design.

    Attributes
    ----------
    title, answer, warnings
        Title of the page; the findings in sentences; doubts about them.
    pictures, tables, method
        Figures, tables of numbers, and how they were made.
    runs
        Number of runs that were analysed.
    heading
        Heading of the tables.
    """

    title: str
    answer: str
    warnings: Sequence[str]
    pictures: Sequence[PagePicture]
    tables: Sequence[Block]
    method: Sequence[Block]
    runs: int
    heading: str = "Numbers"


def pictures(
    figures: Mapping[str, Figure[Subject]], subject: Subject, folder: Path | None
) -> list[PagePicture]:
    """The figures of a subject for a page: read from a folder, or drawn for the page alone.

    They have the light theme, which a page can turn dark.
    """
    found = []
    for job in jobs(figures, subject):
        figure, file = figures[job.name], folder and folder / f"{job.name}.svg"
        svg = file.read_text("utf-8") if file and file.exists() else job.svg()
        found.append(PagePicture(job.name, svg, figure.caption(subject), figure.alt(subject)))
    return found


def folded(pictures: Sequence[PagePicture]) -> list[Section]:
    """A section for each figure, which is small until it is opened."""
    return [
        Section(picture.caption.partition(":")[0], f"place-{picture.name}", [picture], folded=True)
        for picture in pictures
    ]
