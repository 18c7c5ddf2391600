"""A pytest plugin that records which test executes which lines, with coverage.py.

It needs two variables of the environment: ``SBLCOSIM_RECORD``, the folder to write to, and
``SBLCOSIM_SOURCES``, the folders of the sources, separated as in ``PATH``. Each process writes a
file of coverage.py, ``lines.*``, whose contexts are the tests' ids, and ``seconds.*.json``, how
long each test that passed took. The lines of a fixture that several tests share have the file of
the tests as their context, and those executed by imports have none.
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
        config.pluginmanager.register(Recorder(Path(os.environ["SBLCOSIM_RECORD"]), sources))
