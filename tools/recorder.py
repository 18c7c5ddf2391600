"""A pytest plugin that records which test executes which lines, with coverage.py.

It needs two variables of the environment: ``SBLCOSIM_RECORD``, the folder to write to, and
``SBLCOSIM_SOURCES``, the folders of the sources, separated as in ``PATH``. Each process writes a
file of coverage.py, ``lines.*``, whose contexts are the tests' ids, and ``seconds.*.json``, how
long each test that passed took. The lines of a fixture that several tests share have the file of
the tests as their context, and those executed by imports have none. Python processes that a test
starts are recorded, too, unless they are killed; what lives on belongs to the test that started it.
"""

from __future__ import annotations

import json
import os
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import coverage
import pytest

CONTEXT = "SBLCOSIM_CONTEXT"
"""Variable of the environment with the context of processes that are started now."""
IN_PROCESSES = f"""
import os

try:
    os.getcwd()
except FileNotFoundError:  # coverage.py cannot begin
    os.environ.pop("{CONTEXT}", None)

if "{CONTEXT}" in os.environ:
    import atexit

    import coverage

    record = coverage.Coverage(
        data_file=os.path.join(os.environ["SBLCOSIM_RECORD"], "lines"), data_suffix=True,
        source=os.environ["SBLCOSIM_SOURCES"].split(os.pathsep), config_file=False,
        context=os.environ["{CONTEXT}"], messages=False,
    )
    # A process says what it says without a record.
    record.set_option("run:disable_warnings", [
        "no-data-collected", "module-not-imported", "module-not-measured",
    ])

    def finish(own=os.getpid()):
        if os.getpid() == own:  # and not a fork
            record.stop()
            record.save()

    def leave(code, leave=os._exit):
        finish()
        leave(code)

    os._exit = leave
    atexit.register(finish)
    record.start()
"""
"""`sitecustomize.py` of all processes; Python runs it first."""


class Recorder:
    """Records the tests of one process."""

    def __init__(self, folder: Path, sources: list[str]) -> None:
        self.folder = folder
        self.coverage = coverage.Coverage(
            data_file=str(folder / "lines"), data_suffix=True, source=sources, config_file=False
        )
        self.seconds: defaultdict[str, float] = defaultdict(float)
        self.failed: set[str] = set()
        self.context = ""
        self.coverage.start()

    def _switch(self, context: str) -> str:
        before, self.context = self.context, context
        self.coverage.switch_context(context)
        if context:
            os.environ[CONTEXT] = context
        else:
            os.environ.pop(CONTEXT, None)
        return before

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        before = self._switch(item.nodeid)
        try:
            return (yield)
        finally:
            self._switch(before)

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any, request: Any) -> Iterator[None]:
        if fixturedef.scope == "function":
            return (yield)
        before = self._switch(self.context.partition("::")[0])
        try:
            return (yield)
        finally:
            self._switch(before)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item) -> Iterator[None]:
        report: Any = yield
        self.seconds[item.nodeid] += report.duration
        if report.outcome != "passed":
            self.failed.add(item.nodeid)
        return report

    def pytest_sessionfinish(self) -> None:
        self.coverage.stop()
        self.coverage.save()
        passed = {name: s for name, s in self.seconds.items() if name not in self.failed}
        (self.folder / f"seconds.{os.getpid()}.json").write_text(json.dumps(passed))


def pytest_configure(config: pytest.Config) -> None:
    """Record in workers, or where there are none."""
    if hasattr(config, "workerinput") or not config.getoption("numprocesses", None):
        sources = os.environ["SBLCOSIM_SOURCES"].split(os.pathsep)
        folder = Path(os.environ["SBLCOSIM_RECORD"])
        at_start = folder / "at start"
        at_start.mkdir(exist_ok=True)
        part = at_start / f"{os.getpid()}.part"
        part.write_text(IN_PROCESSES)
        part.rename(at_start / "sitecustomize.py")
        os.environ["PYTHONPATH"] = os.pathsep.join([str(at_start), os.environ["PYTHONPATH"]])
        config.pluginmanager.register(Recorder(folder, sources))
