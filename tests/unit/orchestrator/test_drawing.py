"""Figures drawn by two processes: the same bytes, warnings and errors as by one."""

from __future__ import annotations

import os
import time
import warnings
from pathlib import Path
from typing import Any

import pytest
from matplotlib.axes import Axes
from sblcosim import style
from sblcosim.results.catalogue import Job, drawing

HERE = os.getpid()


def plot(number: int, *, theme: style.ThemeName) -> Axes:
    with style.use(theme):
        ax = style.new_figure(3, 2).subplots()
        ax.plot([0, number])
        ax.set_title(f"figure {number}")
    return ax


def slow(number: int, *, theme: style.ThemeName) -> Axes:
    """Takes long enough for both processes to have one."""
    time.sleep(0.3)
    return plot(number, theme=theme)


def warning(number: int, *, theme: style.ThemeName) -> Axes:
    warnings.warn("it looks odd", stacklevel=1)
    return plot(number, theme=theme)


def elsewhere(number: int, *, theme: style.ThemeName) -> Axes:
    """Only the process of the tests can draw it."""
    if os.getpid() != HERE:
        os._exit(3)
    return plot(number, theme=theme)


def failing(number: int, *, theme: style.ThemeName) -> Axes:
    raise ValueError(f"no figure {number}")


def jobs(*plots: Any) -> list[Job]:
    return [Job(f"figure_{n}", how, (n,)) for n, how in enumerate(plots)]


def content(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


@pytest.fixture
def children(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The processes that are begun."""
    begun: list[int] = []

    def fork(fork: Any = os.fork) -> int:
        begun.append(fork())
        return begun[-1]

    monkeypatch.setattr(os, "fork", fork)
    return begun


def ended(children: list[int]) -> bool:
    """Whether a process was begun, and nothing is left of it."""
    return len(children) == 1 and not Path(f"/proc/{children[0]}").exists()


@pytest.fixture(autouse=True)
def folders(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / name).mkdir()


@pytest.mark.parametrize("plots", [(), (plot,), (slow,) * 5, (plot, elsewhere, elsewhere, plot)])
def test_the_same_bytes(plots: Any, tmp_path: Path, children: list[int]) -> None:
    with drawing(jobs(*plots), tmp_path / "one"):
        pass
    with drawing(jobs(*plots), tmp_path / "two", processes=2):
        pass
    assert content(tmp_path / "one") == content(tmp_path / "two")
    assert len(content(tmp_path / "two")) == 2 * len(plots)
    assert ended(children)


def test_both_processes_draw(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    saved = []
    monkeypatch.setattr(Job, "save", lambda job, folder, theme: (
        time.sleep(0.2), saved.append(job.name), (folder / job.name).touch()
    ))
    with drawing(jobs(*[plot] * 6), tmp_path / "two", processes=2):
        pass
    assert len(content(tmp_path / "two")) == 6
    assert 0 < len(saved) < 6


def test_a_warning_is_given_here(tmp_path: Path) -> None:
    with (
        pytest.warns(UserWarning, match="it looks odd"),
        drawing(jobs(slow, warning, slow, warning), tmp_path / "two", processes=2),
    ):
        time.sleep(0.5)  # the other process begins
    assert len(content(tmp_path / "two")) == 8


def test_an_error_is_raised_here(tmp_path: Path, children: list[int]) -> None:
    with (
        pytest.raises(ValueError, match="no figure 1"),
        drawing(jobs(plot, failing), tmp_path / "two", processes=2),
    ):
        time.sleep(0.5)
    assert ended(children)


def test_an_error_before_the_figures_ends_the_other_process(
    tmp_path: Path, children: list[int]
) -> None:
    with (
        pytest.raises(ValueError, match="the disk"),
        drawing(jobs(*[slow] * 50), tmp_path / "two", processes=2),
    ):
        raise ValueError("the disk")
    assert ended(children)
    assert len(content(tmp_path / "two")) < 10
