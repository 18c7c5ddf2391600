"""The one form of an answer: of a run, an analysis, a comparison, a budget, a map, a question, …

A class of answers says what it has: a sentence, tables, figures, remarks. The terminal, JSON,
notebooks, pages and folders take any answer alike.
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
    """What has been found out.

    Attributes
    ----------
    document
        What it is in JSON: a key of `sblcosim.cli.documents.by_command.DOCUMENTS`; empty if no
        command prints it, as if it is a part of another answer.
    report
        Name of the page in its folder; empty if there is none.
    """

    document: ClassVar[str] = ""
    report: ClassVar[str] = ""

    @property
    @abstractmethod
    def columns(self) -> Mapping[str, Columns]:
        """Of the tables, declared, by the names of their files."""

    @property
    @abstractmethod
    def title(self) -> str:
        """Of a page."""

    @property
    @abstractmethod
    def answer(self) -> str:
        """What was found, in a sentence or a few."""

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
        """What must be known to read the answer, a line each."""
        return ()

    @property
    def problems(self) -> Sequence[str]:
        """A line for each receiver that has given nothing at all."""
        return ()

    @abstractmethod
    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """The answer, then its tables.

        Parameters
        ----------
        verbose
            With all numbers, and how to read them.
        width
            Columns to fit into; None: sentences are not wrapped.
        """

    @abstractmethod
    def to_json(self) -> dict[str, Any]:
        """Plain data, as its document says it, but for the places of files."""

    def located(self, folder: Path) -> dict[str, Any]:
        """Where the files are, as its document says it."""
        return {"folder": str(folder)} | (
            {"report": str(folder / self.report)} if self.report else {}
        )

    @abstractmethod
    def manifest(self) -> dict[str, Any]:
        """What was asked, as plain data; equal for equal answers."""

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
        """Write tables and figures into a folder that is there."""
        for name, table in self.tables.items():
            artifacts.write_table(table, folder, name)
        for job in self.figures if figures else ():
            job.save(folder, theme)

    def __str__(self) -> str:
        return self.text()

    def _repr_html_(self) -> str:
        return page(self.title, verbatim(self.text()))


class Extended(Answer):
    """An answer that says more than another one, and is otherwise that."""

    @property
    @abstractmethod
    def main(self) -> Answer:
        """The other one."""

    @property
    def columns(self) -> Mapping[str, Columns]:
        """Of the tables, declared, by the names of their files."""
        return self.main.columns

    @property
    def title(self) -> str:
        """Of a page."""
        return self.main.title

    @property
    def answer(self) -> str:
        """What was found, in a sentence or a few."""
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
        """What must be known to read the answer, a line each."""
        return self.main.remarks

    @property
    def problems(self) -> Sequence[str]:
        """A line for each receiver that has given nothing at all."""
        return self.main.problems

    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """As that of the other one."""
        return self.main.text(verbose=verbose, width=width)

    def to_json(self) -> dict[str, Any]:
        """As that of the other one."""
        return self.main.to_json()

    def manifest(self) -> dict[str, Any]:
        """As that of the other one."""
        return self.main.manifest()
