"""The notebooks of the documents can be run from top to bottom, and show what they say."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

ROOT = Path(__file__).parents[2]
NOTEBOOKS = sorted(ROOT.glob("docs/notebooks/*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_what_it_shows(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    assert notebook.metadata["kernelspec"]["name"] == "python3"
    for cell in notebook.cells:
        if cell.cell_type == "code":
            assert (cell.outputs, cell.execution_count) == ([], None)
            assert not cell.source.startswith(("%", "!"))


@pytest.fixture(scope="module")
def executed(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The first notebook after a run, in an empty folder."""
    notebook = nbformat.read(ROOT / "docs" / "notebooks" / "first_run.ipynb", as_version=4)
    folder = tmp_path_factory.mktemp("notebook")
    client = NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(folder)}})
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("MPLBACKEND", raising=False)  # as at a user's
        client.execute()
    return notebook


def shown(notebook: Any, cell: str) -> Any:
    """The one thing that a cell shows, by its kind."""
    (found,) = (c for c in notebook.cells if c.id == cell)
    (output,) = found.outputs
    return output.data


@pytest.mark.parametrize("cell", ["map", "errors", "own-map", "pareto"])
def test_a_plot_in_a_notebook_is_one_picture(executed: Any, cell: str) -> None:
    data = shown(executed, cell)
    assert len(data["image/png"]) > 10_000
    assert data["text/plain"].startswith("<Picture of")


PAGES = ("import", "run", "tables", "own", "study", "runs", "analysis", "xarray")


@pytest.mark.parametrize("cell", PAGES)
def test_objects_in_a_notebook_are_pages(executed: Any, cell: str) -> None:
    data = shown(executed, cell)
    assert data["text/html"].strip().startswith(("<", " <"))
    assert "text/plain" in data


def test_the_notebook_says_nothing_but_what_it_was_asked(executed: Any) -> None:
    """No warning, no picture twice: each cell shows one thing, or nothing."""
    for cell in executed.cells:
        if cell.cell_type == "code":
            assert [o.output_type for o in cell.outputs] in ([], ["execute_result"]), cell.id
    assert "AlphaBeta" in shown(executed, "own")["text/plain"]
    assert "gps" in shown(executed, "analysis")["text/plain"].lower()
