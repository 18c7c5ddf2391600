"""Study files: the keys of a scenario to vary, their levels, and the number of replicates.

>>> from sblcosim import study                                       # doctest: +SKIP
>>> table = study.load("paper-scenario-1").run("studies/scenario-1")  # doctest: +SKIP
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Mapping, Sequence
from html import escape
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from ..errors import ConfigurationError, check_choice, instance, resolved, shortened
from ..results.responses import Response
from ..results.user_responses import of_file, of_function, of_origin
from ..scenario import files, library
from ..scenario.reading import check_values, parse, read_text, shown
from ..scenario.scenario import Source
from ..scenario.schema import SEED
from ..shown import Listing, page
from ..simulation.code.user_code import component_of_origin
from ..words.lists import counted
from . import levels, runner, store
from .checks import idle_factors, known_keys, line, problems
from .definition import Definition
from .design import shown as level_shown
from .stand_in import StandIn, model_of, stand_in_of
from .tables import RECEIVERS_KEY, VARIED, DesignTable, FactorTable

if TYPE_CHECKING:
    from concurrent.futures import Executor

    import pandas as pd


class Study(Definition):
    """A factorial campaign. Made by `load`; its attributes are the keys of a study file."""

    def __repr__(self) -> str:
        return f"<Study {self.name}: {self._size()}>"

    __str__ = __repr__

    def _repr_html_(self) -> str:
        rows = {
            name: f"{factor.label and f'{factor.label}: '}"
            f"{', '.join(map(level_shown, factor.values))} {self.units[name]}".rstrip()
            for name, factor in {**self.factors, **self.conditions}.items()
        }
        return page(
            self.title or self.name,
            f"<p>{escape(self._size())}, of {escape(self._subject())}</p>",
            Listing(rows)._repr_html_(),
        )

    def _subject(self) -> str:
        return f"the scenario {self.base.name}" if self.model is None else self.model.name

    def _size(self) -> str:
        points, met = len(self.points.values), len(self.conditions)
        return (
            f"{counted(len(self.factors), 'factor')}, "
            + (f"{counted(met, 'condition')}, " if met else "")
            + f"{counted(points, 'point')} × {self.replicates:,} = "
            + counted(points * self.replicates, "run")
        )

    def with_replicates(self, replicates: int) -> Study:
        """A copy with another number of replicates; the runs common to both are equal."""
        return load(self.tables() | {"replicates": replicates})

    def with_levels(self, **levels: Any) -> Study:
        """A copy with other levels of some factors, as ``with_levels(gps=[0.1, 1.0])``.

        Raises
        ------
        ConfigurationError
            There is no such factor, or it cannot have these levels.
        """
        tables = self.tables()
        for name, given in levels.items():
            check_choice("factor", name, self.factors)
            tables["factors"][name]["levels"] = given
        return load(tables)

    def without(self, *factors: str) -> Study:
        """A copy without some factors, whose keys then have the values of the scenario.

        Raises
        ------
        ConfigurationError
            There is no such factor, or the design needs it.
        """
        tables = self.tables()
        for name in factors:
            check_choice("factor", name, tables["factors"])
            del tables["factors"][name]
        return load(tables)

    def tables(self) -> dict[str, Any]:
        """The tables of the study's file."""
        tables = self.model_dump(exclude_unset=True)
        if self.receiver_factor is not None:
            tables["factors"][self.receiver_factor]["levels"] = tables.pop("receivers")
        return tables

    def run(
        self,
        out: str | Path,
        *,
        workers: int | None = None,
        executor: str | Executor = "threads",
        scheduler: str | None = None,
        master: str | None = None,
        step_timeout: float | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> pd.DataFrame:
        """Run the missing runs of the campaign in a folder; see `sblcosim.study.runner.run`."""
        return runner.run(
            self, out, workers=workers, executor=executor, scheduler=scheduler, master=master,
            step_timeout=step_timeout, progress=progress,
        )


def shipped() -> tuple[str, ...]:
    """Names of the shipped studies."""
    return library.shipped("sblcosim.study")


def load(
    source: str | Path | Mapping[str, Any],
    responses: Sequence[str | Callable[..., Any] | Response] = (),
    receivers: Sequence[Source] = (),
) -> Study:
    """Read a study and check it.

    Parameters
    ----------
    source
        Name of a shipped study (``"paper-scenario-1"``), path of a TOML file, or nested tables.
    responses
        Added to those of the source: names of percentiles, ``file.py:function``, or functions of a
        `sblcosim.results.responses.Run`.
    receivers
        Instead of those of the source: names, FMU files, ``file.py:Class``, or classes or functions
        that make a Python component.

    Raises
    ------
    ConfigurationError
        The study does not exist or is invalid.
    """
    where, raw, folder = read(source)
    if not isinstance(source, Mapping):
        files.note(str(raw["name"]), where)
    return of_tables(where, raw, folder, responses, receivers)


def of_tables(
    where: str,
    raw: dict[str, Any],
    folder: Path,
    responses: Sequence[str | Callable[..., Any] | Response] = (),
    receivers: Sequence[Source] = (),
) -> Study:
    """As `load`, for tables from a source called ``where`` with files relative to a folder."""
    if "choices" in raw:
        raise ConfigurationError(
            f"{where}: choices: must be factors in a study ([factors.NAME]), got choices; a "
            "question is answered by 'sblcosim require'"
        )
    scenario = raw.get("scenario")
    if isinstance(scenario, str) and os.path.isfile(folder / scenario):
        raw["scenario"] = str(folder / scenario)
    levels.read_files(where, raw, folder)
    if receivers:
        raw["receivers"] = [levels.receiver(entry, Path.cwd()) for entry in receivers]
    elif isinstance(raw.get("receivers"), list | tuple):
        raw["receivers"] = [levels.receiver(entry, folder) for entry in raw["receivers"]]
    levels.name_receivers(where, raw, folder)
    if not isinstance(raw.get("model"), StandIn | None):
        raw["model"] = model_of(raw["model"], folder)
    file = where if (folder / Path(where).name).is_file() else ""
    with files.about(file):
        given = _responses(raw.get("responses", ()), folder)
    raw["responses"] = [*given, *_responses(responses, Path.cwd())]
    with files.about(file):
        study = _checked(raw, where)
    study.__dict__["_file"] = file
    return study


def _checked(raw: Mapping[str, Any], where: str) -> Study:
    """Make a study from tables, and check it."""
    try:
        study = Study.model_validate(raw)
    except ValidationError as error:
        lines = dict.fromkeys(line(e, where) for e in error.errors())
        raise ConfigurationError("\n".join(lines)) from None
    try:
        if study.model is None and study.scenario:
            _ = study.base  # report an invalid scenario before anything else
    except ConfigurationError as error:
        said = str(error).removeprefix("scenario: ").splitlines()
        of_fixed = "override "
        raise ConfigurationError("\n".join(
            f"{where}: fixed: {it.removeprefix(of_fixed)}" if it.startswith(of_fixed)
            else f"{where}: scenario: {it}" for it in said
        )) from None
    wrong = [*problems(study)]
    if wrong:
        raise ConfigurationError("\n".join(f"{where}: {problem}" for problem in wrong))
    try:
        points = len(study.points.values)
    except ConfigurationError as error:
        raise ConfigurationError(_prefixed(where, error)) from None
    idle = [*idle_factors(study)] if study.model is None else []
    if idle:
        raise ConfigurationError("\n".join(f"{where}: {problem}" for problem in idle))
    last = study.run_seed(points, study.replicates)
    if SEED.max is not None and last > SEED.max:
        raise ConfigurationError(
            f"{where}: seed: must leave room for all runs below {int(SEED.max)}, got {study.seed} "
            f"with {last - study.seed + 1} seeds of {study.replicates} replicates"
        )
    return study


def _responses(given: Any, folder: Path) -> list[Any]:
    """The given responses, with functions looked up; `problems` checks all others."""
    if isinstance(given, str) or not isinstance(given, Sequence):
        raise ConfigurationError(
            f"responses: must be an array of names or functions, got {shortened(instance(given))}"
        )
    responses: list[Any] = []
    for entry in given:
        if isinstance(entry, str) and ":" in entry:
            responses.append(of_file(entry, folder))
        else:
            responses.append(of_function(entry) if inspect.isfunction(entry) else entry)
    return responses


def study_of(results: str | Path) -> Study:
    """The study that a result folder belongs to."""
    content = store.described(Path(results))
    definition = content["definition"]
    tables = {k: v for k, v in definition["study"].items() if v is not None}
    tables["responses"] = [
        r if isinstance(r, str) else of_origin(r["name"], r["from"], r["sha256"])
        for r in tables.get("responses", ())
    ]
    tables["receivers"] = [
        r if isinstance(r, str) else component_of_origin(r["from"], r["sha256"])
        for r in tables.get("receivers", ())
    ]
    if "model" in tables:
        tables["model"] = stand_in_of(tables["model"]["from"], tables["model"]["sha256"])
    tables["design"] = {k: v for k, v in tables["design"].items() if v is not None}
    if tables["design"]["kind"] == "space":
        tables["design"].setdefault("sample", store.version_of_sample(definition))
    names = content.get("names", {})
    for table in VARIED:
        tables[table] = {k: v | names.get(k, {}) for k, v in tables.get(table, {}).items()}
    for factor in tables["factors"].values():
        if list(factor["keys"]) == [RECEIVERS_KEY]:
            factor["levels"] = tables.pop("receivers")
    return load(
        {
            **tables,
            "title": content["title"],
            "replicates": content["replicates"],
            **({"scenario": definition["scenario"]} if "scenario" in definition else {}),
        }
    )


def read(
    source: str | Path | Mapping[str, Any], what: str = "study", package: str = "sblcosim.study"
) -> tuple[str, dict[str, Any], Path]:
    """Name of the source for messages, its tables, and the folder for relative paths.

    Parameters
    ----------
    what, package
        Kind of the file, and the package that includes files of this kind.

    Raises
    ------
    ConfigurationError
        There is no such file, or it is not TOML.
    """
    if isinstance(source, Mapping):
        where = shortened(str(source.get("name", what)))
        check_values(where, source)
        return where, dict(source), Path.cwd()
    if not isinstance(source, str | Path):
        raise ConfigurationError(
            f"{what}: must be a name, a TOML file or tables, got {instance(source)}"
        )
    path, known = Path(source), library.shipped(package)
    name = str(source).removesuffix(".toml")
    if name in known and not os.path.isfile(path):
        text = (resources.files(package) / "shipped" / f"{name}.toml").read_text(encoding="utf-8")
    else:
        text = read_text(path, known, what)
    raw = parse(shown(path), text)
    raw.setdefault("name", path.stem)
    return shown(path), raw, resolved(path).parent


# --- Checks and messages -------------------------------------------------------------------------


def _prefixed(where: str, error: Exception) -> str:
    return "\n".join(f"{where}: {line}" for line in str(error).splitlines())


__all__ = ["DesignTable", "FactorTable", "Study", "known_keys", "load", "shipped"]
