"""Figures drawn by another process: the same bytes, warnings and errors as by this one."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from matplotlib.axes import Axes
from quick import one_in
from sblcosim import style
from sblcosim.catalogue import Job
from sblcosim.results.figures import artist
from sblcosim.results.figures.artist import Artist, drawing, forked_artist

HERE = os.getpid()
PATIENCE = 300.0
"""Seconds, on a machine that has much else to do."""


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


def slower(number: int, *, theme: style.ThemeName) -> Axes:
    time.sleep(3.0)
    return plot(number, theme=theme)


def warning(number: int, *, theme: style.ThemeName) -> Axes:
    warnings.warn("it looks odd", stacklevel=1)
    return plot(number, theme=theme)


def only_here(number: int, *, theme: style.ThemeName) -> Axes:
    """Only the process of the tests can draw it."""
    if os.getpid() != HERE:
        os._exit(3)
    return plot(number, theme=theme)


def only_there(number: int, *, theme: style.ThemeName) -> Axes:
    if os.getpid() == HERE:
        raise AssertionError("drawn here")
    axes = plot(number, theme=theme)
    axes.set_gid(f"drawn by {os.getpid()}")
    return axes


def together(number: int, place: Path, *, theme: style.ThemeName) -> Axes:
    """Waits until two processes draw."""
    (place / str(os.getpid())).touch()
    until = time.monotonic() + PATIENCE
    while len([*place.iterdir()]) < 2 and time.monotonic() < until:
        time.sleep(0.01)
    return only_there(number, theme=theme)


def failing(number: int, *, theme: style.ThemeName) -> Axes:
    raise ValueError(f"no figure {number}")


def interrupt(error: BaseException) -> None:
    time.sleep(0.5)
    raise error


def jobs(*plots: Any) -> list[Job]:
    return [Job(f"figure_{n}", how, (n,)) for n, how in enumerate(plots)]


def content(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


@pytest.fixture(autouse=True)
def folders(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / name).mkdir()


@pytest.fixture
def children(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The processes that are begun, in a program without threads and on two processors."""
    begun: list[int] = []

    def fork(fork: Any = os.fork) -> int:
        begun.append(fork())
        return begun[-1]

    monkeypatch.setattr(os, "fork", fork)
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    monkeypatch.setattr(threading, "active_count", lambda: 1)
    return begun


@pytest.fixture
def helper(children: list[int]) -> Iterator[Artist]:
    with forked_artist() as found:
        assert found is not None
        yield found
    assert ended(children)


def ended(children: list[int]) -> bool:
    """Whether a process was begun, and it and its own fork are gone or can do nothing any more."""
    if len(children) != 1 or Path(f"/proc/{children[0]}").exists():
        return False
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            group = (process / "stat").read_text().rpartition(")")[2].split()[2]
            # The fork is an orphan, and init may take its time; its files are closed before that.
            if int(group) == children[0] and [*(process / "fd").iterdir()]:
                return False
    return True


@one_in(2)
@pytest.mark.parametrize("theme", style.THEMES)
@pytest.mark.parametrize("plots", [(), (plot,), (slow,) * 5, (plot, only_here, only_here, plot)])
def test_the_same_bytes(
    plots: Any, theme: style.ThemeName, tmp_path: Path, helper: Artist
) -> None:
    with drawing(jobs(*plots), tmp_path / "one", theme):
        pass
    with drawing(jobs(*plots), tmp_path / "two", theme, helper):
        pass
    assert content(tmp_path / "one") == content(tmp_path / "two")
    assert len(content(tmp_path / "two")) == 2 * len(plots)


def test_two_processes_draw_and_this_one_does_not(tmp_path: Path, helper: Artist) -> None:
    eight = [Job(f"figure_{n}", together, (n, tmp_path / "one")) for n in range(8)]
    with drawing(eight, tmp_path / "two", "light", helper):
        pass
    assert len(content(tmp_path / "two")) == 16
    texts = [path.read_text() for path in (tmp_path / "two").glob("*.svg")]
    drawn_by = {re.findall(r'id="drawn by (\d+)"', text)[0] for text in texts}
    assert len(drawn_by) == 2


def test_a_warning_is_given_here(tmp_path: Path, helper: Artist) -> None:
    with (
        pytest.warns(UserWarning, match="it looks odd"),
        drawing(jobs(slow, warning, slow, warning), tmp_path / "two", "light", helper),
    ):
        pass
    assert len(content(tmp_path / "two")) == 8


def test_an_error_is_raised_here(tmp_path: Path, helper: Artist, capfd: Any) -> None:
    with (
        pytest.raises(ValueError, match="no figure 1"),
        drawing(jobs(plot, failing), tmp_path / "two", "light", helper),
    ):
        pass
    assert capfd.readouterr() == ("", "")


def test_one_that_is_killed_is_replaced(
    tmp_path: Path, helper: Artist, children: list[int]
) -> None:
    os.kill(children[0], signal.SIGKILL)
    time.sleep(0.1)
    with drawing(jobs(plot, plot), tmp_path / "two", "light", helper):
        pass
    assert len(content(tmp_path / "two")) == 4


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_error_while_it_draws_ends_it(
    error: type[BaseException], tmp_path: Path, helper: Artist, children: list[int]
) -> None:
    with (
        pytest.raises(error, match="the disk"),
        drawing(jobs(*[slower] * 100), tmp_path / "two", "light", helper),
    ):
        interrupt(error("the disk"))
    assert ended(children)  # now, before the folder is removed
    assert len(content(tmp_path / "two")) < 200  # all take more than two minutes


def test_an_error_before_the_figures_ends_it(children: list[int], capfd: Any) -> None:
    with pytest.raises(ValueError, match="the scenario"), forked_artist():
        raise ValueError("the scenario")
    assert ended(children)
    assert capfd.readouterr() == ("", "")


def test_the_death_of_this_process_ends_it(tmp_path: Path) -> None:
    """Also where nothing can be done any more."""
    code = (
        "import os, time\n"
        "from sblcosim.results.figures.artist import forked_artist\n"
        "with forked_artist() as artist:\n"
        "    print(artist._process, flush=True)\n"
        "    os.kill(os.getpid(), 9)\n"
    )
    if (os.cpu_count() or 1) < 2:
        pytest.skip("one processor")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert int(done.stdout) > 0  # the pipes are closed, so it has ended
    assert done.stderr == ""


@pytest.mark.parametrize("reason", ["no fork", "a thread", "one processor", "not wanted"])
def test_without_another_process(
    reason: str, tmp_path: Path, children: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    if reason == "no fork":
        monkeypatch.delattr(os, "fork")
    if reason == "a thread":
        monkeypatch.setattr(threading, "active_count", lambda: 2)
    if reason == "one processor":
        monkeypatch.setattr(os, "cpu_count", lambda: 1)
    with forked_artist(reason != "not wanted") as found:
        assert found is None
        with drawing(jobs(plot, only_here), tmp_path / "two", "light", found):
            assert not content(tmp_path / "two")
    assert len(content(tmp_path / "two")) == 4
    assert not children


@pytest.mark.slow
def test_neither_process_waits_for_what_it_does_not_need() -> None:
    """Matplotlib is for the one that draws, scenarios are for the one that simulates."""
    needless = (
        ("api", "matplotlib"), ("api", "scipy.optimize"), ("api", "scipy.special"),
        ("api", "gpxpy"), ("api", "sblcosim.packages.read"),
        ("results.figures.run", "sblcosim.scenario.schema"),
    )
    for module, foreign in needless:
        code = f"import sys, sblcosim.{module}; print({foreign!r} in sys.modules)"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        assert done.stdout == "False\n", done.stderr


def test_it_is_quick_to_begin() -> None:
    """It is forked before anything is imported that takes long."""
    code = f"import sys, {artist.__name__}; print({{'numpy', 'typer'}} & {{*sys.modules}})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout == "set()\n", done.stderr
