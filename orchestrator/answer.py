"""The common form of an answer: of a run, an analysis, a comparison, a budget, a map, a question, …

A class of answers provides a sentence, tables, figures and remarks. The terminal, JSON, notebooks,
pages and folders treat all answers alike.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from . import artifacts, style
from .catalogue import Job
from .data.tables import Columns
from .shown import Shown, page, verbatim

if TYPE_CHECKING:
    import pandas as pd


class Answer(Shown):
    """What was found.

    Attributes
    ----------
    document
        Its form in JSON: a key of `sblcosim.cli.documents.by_command.DOCUMENTS`. Empty if no
        command prints it, for example because it is a part of another answer.
    report
        Name of the page in its folder; empty if there is none.
    """

    document: ClassVar[str] = ""
    report: ClassVar[str] = ""

    @property
    @abstractmethod
    def columns(self) -> Mapping[str, Columns]:
        """The declared columns of the tables, by the names of their files."""

    @property
    @abstractmethod
    def title(self) -> str:
        """Of a page."""

    @property
    @abstractmethod
    def answer(self) -> str:
        """The answer, in a sentence or a few."""

    @property
    @abstractmethod
    def tables(self) -> Mapping[str, pd.DataFrame]:
        """The numbers, by the names of their files."""

    @property
    def figures(self) -> Sequence[Job]:
        """The figures, each with the name of its file."""
        return ()

    @property
    def remarks(self) -> Sequence[str]:
        """Remarks that are needed to read the answer, one line each."""
        return ()

    @property
    def problems(self) -> Sequence[str]:
        """A line for each receiver that gave nothing at all."""
        return ()

    @abstractmethod
    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """The answer, then its tables.

        Parameters
        ----------
        verbose
            Add all numbers, and how to read them.
        width
            Columns to fit into; None: sentences are not wrapped.
        """

    @abstractmethod
    def to_json(self) -> dict[str, Any]:
        """Plain data in the form of its document, except for the places of files."""

    def located(self, folder: Path) -> dict[str, Any]:
        """The places of files, in the form of its document."""
        return {"folder": str(folder)} | (
            {"report": str(folder / self.report)} if self.report else {}
        )

    @abstractmethod
    def manifest(self) -> dict[str, Any]:
        """The question, as plain data; equal for equal answers."""

    def save(
        self,
        directory: str | Path,
        *,
        figures: bool = True,
        theme: style.ThemeName = "light",
        other: artifacts.Other = "refuse",
    ) -> Path:
        """Write tables, figures and manifest into a folder, which appears when it is complete.

        An earlier result of the same kind and question is replaced.

        Parameters
        ----------
        other
            What to do if the folder holds the result of another question: ``"refuse"``,
            ``"replace"``, or ``"number"``, which appends the next free number.

        Returns
        -------
        Path
            The folder.

        Raises
        ------
        ConfigurationError
            The path holds something else, or the theme does not exist.
        """
        style.named(theme)
        with artifacts.draft(directory, self.manifest(), other) as draft:
            self.write(draft.folder, theme, figures)
        return draft.saved

    def write(
        self, folder: Path, theme: style.ThemeName = "light", figures: bool = True
    ) -> None:
        """Write tables and figures into an existing folder."""
        for name, table in self.tables.items():
            artifacts.write_table(table, folder, name)
        for job in self.figures if figures else ():
            job.save(folder, theme)

    def __str__(self) -> str:
        return self.text()

    def _repr_html_(self) -> str:
        return page(self.title, verbatim(self.text()))


class Extended(Answer):
    """An answer that adds to another one, and otherwise equals it."""

    @property
    @abstractmethod
    def main(self) -> Answer:
        """The other answer."""

    @property
    def columns(self) -> Mapping[str, Columns]:
        """The declared columns of the tables, by the names of their files."""
        return self.main.columns

    @property
    def title(self) -> str:
        """Of a page."""
        return self.main.title

    @property
    def answer(self) -> str:
        """The answer, in a sentence or a few."""
        return self.main.answer

    @property
    def tables(self) -> Mapping[str, pd.DataFrame]:
        """The numbers, by the names of their files."""
        return self.main.tables

    @property
    def figures(self) -> Sequence[Job]:
        """The figures, each with the name of its file."""
        return self.main.figures

    @property
    def remarks(self) -> Sequence[str]:
        """Remarks that are needed to read the answer, one line each."""
        return self.main.remarks

    @property
    def problems(self) -> Sequence[str]:
        """A line for each receiver that gave nothing at all."""
        return self.main.problems

    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """As in the other answer."""
        return self.main.text(verbose=verbose, width=width)

    def to_json(self) -> dict[str, Any]:
        """As in the other answer."""
        return self.main.to_json()

    def manifest(self) -> dict[str, Any]:
        """As in the other answer."""
        return self.main.manifest()
