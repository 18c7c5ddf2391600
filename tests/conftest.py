"""Makes the helpers beside the tests importable (``from stepper import Stepper``)."""

import functools
import gc
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import typer.main
import typer.testing

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in the command, before NumPy is loaded
sys.path.insert(0, str(Path(__file__).parent / "unit" / "models"))
sys.path.insert(0, str(Path(__file__).parent / "unit" / "fmus"))
sys.path.insert(0, str(Path(__file__).parent / "physics"))
sys.path.insert(0, str(Path(__file__).parent))

from quick import thin
from seams import Seam

# A command of typer is the same each time that it is made, from hundreds of signatures.
typer.main.get_command = typer.testing._get_command = functools.cache(typer.main.get_command)
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # of a shell, for what runs in the background
    signal.signal(signal.SIGINT, signal.default_int_handler)
gc.set_threshold(100_000)  # as in the command: what a worker has loaded is not garbage


@pytest.hookimpl(tryfirst=True)
def pytest_sessionstart(session: pytest.Session) -> None:
    """Build all components and libraries before the workers of a whole run begin.

    Otherwise each would do it, and say so on standard error.
    """
    option = session.config.option
    is_worker = hasattr(session.config, "workerinput")
    if is_worker or not getattr(option, "numprocesses", None) or option.file_or_dir:
        return
    from sblcosim.fmus.build import bound
    from sblcosim.fmus.build.factory import Wanted, build_all
    from sblcosim.fmus.errors import BuildError
    from sblcosim.identification import innovations
    from sblcosim.models import COMPONENTS
    from sblcosim.simulation.masters import c_libraries, lanes_driver, native, replay

    with suppress(BuildError):  # the tests say so
        build_all([Wanted(name, fmi) for fmi in (2, 3) for name in COMPONENTS])
        bound.library()
        for driver in (native.DRIVER, lanes_driver.DRIVER, replay.DRIVER, innovations.DRIVER):
            c_libraries.library(driver)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """One more than there are processors, as many tests wait for commands and browsers."""
    return (os.cpu_count() or 1) + 1


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Whole files go to workers with ``--dist loadfile``, but for some."""
    if config.getoption("dist") != "loadfile":
        return None
    from spread import Spread

    return Spread(config, log)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    thin(items)


@pytest.fixture
def seam() -> Iterator[Seam]:
    """Stand-ins for things of the product, until the end of the test."""
    with Seam() as made:
        yield made


HANGS = "hangs"
"""Name of the file that whatever hangs on purpose leaves, in `fmu/hang.h` and in Python alike."""
LONG = 600.0
"""Seconds that whatever does not hang may take, on a machine that has much else to do."""


@pytest.fixture
def only_hangs_take_time(monkeypatch: pytest.MonkeyPatch, seam: Seam) -> None:
    """Time limits of calls begin when one hangs on purpose; healthy ones may take long."""
    from sblcosim.fmus.conformance import runner
    from sblcosim.simulation.children.process import Process

    next_, wait = Process._next, runner._wait

    def patient_next(self: Process, *arguments: Any) -> Any:
        _wait_for(
            lambda: not self._answers.empty()
            or self._process.poll() is not None
            or bool(_marks(Path(self._folder)))
        )
        return next_(self, *arguments)

    def patient_wait(process: Any, folder: Path, patience: float) -> bool:
        hung = str(process.pid)  # others may have hung there before
        _wait_for(lambda: process.poll() is not None or hung in _marks(folder))
        return wait(process, folder, patience)

    monkeypatch.setattr(Process, "_next", patient_next)
    seam.instead(runner._wait, patient_wait)


def _wait_for(done: Callable[[], bool]) -> None:
    until = time.monotonic() + LONG
    while not done() and time.monotonic() < until:
        time.sleep(0.01)


def _marks(folder: Path) -> list[str]:
    """What stands in the files of those that hang."""
    with suppress(OSError):  # the folder is just being filled or removed
        return [path.read_text() for path in folder.rglob(HANGS)]
    return []
