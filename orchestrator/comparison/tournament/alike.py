"""Duplicates under two names: receivers with the same content, scenarios with the same runs."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sblcosim.fmus.build.factory import build
from sblcosim.fmus.files import sha256_of
from sblcosim.fmus.host.libraries import ours
from sblcosim.fmus.read.ports import Fmu, read
from sblcosim.models import COMPONENTS, RECEIVERS, of_file

from ...errors import ConfigurationError, quoted
from ...scenario import effects
from ...scenario.scenario import Source
from ...scenario.sources import file_of, known_source, labelled
from ...simulation.code.user_code import PythonSource
from ...study.campaign import prepare
from ...study.study import Study


def check_receivers(study: Study) -> None:
    """Refuse receivers of a study that are the same under two names."""
    seen: dict[Any, str] = {}
    for label, source in labelled([known_source(it) for it in study.receivers]).items():
        content = _content(source)
        if content in seen:
            raise ConfigurationError(
                "receivers: must differ in more than their names, got the same content as "
                f"{quoted(seen[content])} and as {quoted(label)}"
            )
        seen[content] = label


def check_scenarios(studies: Mapping[str, Study]) -> None:
    """Refuse scenarios, each with its runs as a study, that are the same under two names."""
    seen: dict[str, str] = {}
    for name, study in studies.items():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # they are issued when it runs
            runs = prepare(study).digest
        if runs in seen:
            raise ConfigurationError(
                "scenarios: must differ in more than their names, got the same runs as "
                f"{quoted(seen[runs])} and as {quoted(name)}"
            )
        seen[runs] = name


def in_effect(study: Study) -> dict[str, Any]:
    """The scenario of a study without the keys that have no effect."""
    tables: dict[str, Any] = study.base.given()
    known = study.components(study.base)
    for table, key in effects.idle(study.base, known, effects.given(study.base)):
        tables[table].pop(key, None)
    return tables


def origin(source: Source) -> Any:
    """A receiver for the manifest; independent of file paths."""
    if isinstance(source, PythonSource):
        return {"python": source.__qualname__, "sha256": source.sha256}
    if file_of(source) is None or not isinstance(source, str | Path):
        return source
    return {"fmu": Path(source).name, "sha256": sha256_of(Path(source))}


def _content(source: Source) -> Any:
    """Identity of a receiver, whatever its file is called."""
    if isinstance(source, PythonSource):
        return source.sha256, source.__name__
    if file_of(source) is None or not isinstance(source, str | Path):
        return source
    return _built_as(read(Path(source)))


def _built_as(fmu: Fmu) -> str:
    """Name of our receiver from which an FMU of either version was built; else its hash."""
    for name in RECEIVERS if ours(fmu) else ():
        known = of_file(f"{name}{fmu.identifier.removeprefix(COMPONENTS[name].name)}")
        if known is None:
            continue
        # The cache may hold the build of an earlier version, which is another receiver.
        today = build(name, 2 if fmu.fmi == 2 else 3, False, None, **known[1])
        if read(today).token == fmu.token:
            return name
    return fmu.sha256
