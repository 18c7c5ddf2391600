"""Study files: which keys of a scenario are varied, over which levels, and how often.

>>> from sblcosim import study                                       # doctest: +SKIP
>>> table = study.load("paper-scenario-1").run("studies/scenario-1")  # doctest: +SKIP
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, cached_property
from importlib import resources
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, ValidationError
from pydantic_core import ErrorDetails, PydanticCustomError
from sblcosim.fmus.host.nanoseconds import nanoseconds, settled
from sblcosim.models import RECEIVERS

from ..errors import ConfigurationError, instance, nearest, quoted, shortened
from ..scenario import effects
from ..scenario.reading import check_values, parse, read_text, shown
from ..scenario.scenario import SETTERS, Scenario, no_effect, requirement
from ..scenario.scenario import load as load_scenario
from ..scenario.schema import SEED, Name, Table, toml
from . import design as designs
from .design import TIMES, Design, Number

if TYPE_CHECKING:
    from concurrent.futures import Executor

    import pandas as pd

RESERVED = (
    "point", "replicate", "run_order", "seed", "error", "run_id", "centre",
    "runs", "mean", "std", "fit", "value",
)
"""Columns of a table of runs, or of what comes of it, that are no factors."""
_SHIPPED = resources.files("sblcosim.study") / "shipped"
_LONGEST = 60  # characters in a factor's name


def _array(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _levels(value: Any) -> Any:
    if not isinstance(value, list | tuple) or any(
        isinstance(v, bool) or not isinstance(v, int | float) for v in value
    ):
        raise PydanticCustomError("levels", "must be an array of numbers")
    return tuple(value)


_Texts = Annotated[tuple[str, ...], BeforeValidator(_array)]


class FactorTable(Table):
    """Table ``[factors.NAME]``.

    Attributes
    ----------
    keys
        Of the scenario, ``table.key``; all get the level.
    levels
        In the units of the keys; of two, the first is coded −1 and the second +1.
    label, unit
        What people read: in place of the name, and after the levels (default: from the suffix of
        the keys).
    """

    keys: _Texts
    levels: Annotated[tuple[Any, ...], BeforeValidator(_levels)]
    label: str = ""
    unit: str = ""


class DesignTable(Table):
    """Table ``[design]``.

    Attributes
    ----------
    kind
        ``full`` (two levels, all combinations), ``fraction`` (of that), ``sweep`` (one factor
        at a time, any number of levels), or ``single`` (the scenario itself, without factors).
    generators, resolution
        Of a fraction, see `sblcosim.study.design.fractional`.
    centre_points
        Points in the middle of all factors.
    order
        Interactions up to this order must not be aliased with each other.
    """

    kind: Literal["full", "fraction", "sweep", "single"] = "full"
    generators: _Texts = ()
    resolution: Annotated[int, Field(ge=3)] | None = None
    centre_points: Annotated[int, Field(ge=0, le=1000)] = 0
    order: Annotated[int, Field(ge=1)] = 1


class Study(Table):
    """A factorial campaign. Made by `load`.

    Attributes
    ----------
    scenario
        Name, file, or tables of a scenario.
    replicates
        Runs of each point.
    seeding
        ``independent``: each run has its own noise; ``common``: all points of a replicate share it.
    seed
        Of the first run, and of the run order.
    settling_time_s
        Errors count from then on.
    receivers
        As in `sblcosim.run`; none: the scenario's own.
    fixed
        Keys of the scenario that are changed for all runs.
    """

    name: Name = "study"
    title: str = ""
    scenario: str | dict[str, Any]
    replicates: Annotated[int, Field(ge=1)] = 1
    seeding: Literal["independent", "common"] = "independent"
    seed: Annotated[int, Field(ge=SEED.min, le=SEED.max)] = 1
    settling_time_s: Annotated[
        float, Field(ge=0.0, allow_inf_nan=False), AfterValidator(settled)
    ] = 0.0
    receivers: _Texts = ()
    fixed: dict[str, Any] = Field(default_factory=dict)
    design: DesignTable = Field(default_factory=DesignTable)
    factors: dict[str, FactorTable] = Field(default_factory=dict)

    @cached_property
    def base(self) -> Scenario:
        """The scenario with the fixed keys."""
        return load_scenario(self.scenario, self.fixed)

    @cached_property
    def plan(self) -> Design:
        """The points."""
        factors = [designs.Factor(name, f.levels) for name, f in self.factors.items()]
        table = self.design
        if table.kind == "single":
            return Design((), ((),), (False,))
        if table.kind == "full":
            made = designs.full(factors, table.centre_points)
        elif table.kind == "fraction":
            made = designs.fractional(
                factors, table.generators, table.resolution, table.centre_points
            )
        else:
            made = designs.sweep(factors, self.sweep_base or [0.0])
        made.require(min(table.order, len(factors)))
        return made

    @property
    def sweep_base(self) -> list[Number]:
        """Where the factors of a sweep are while another one is swept; none for a single factor."""
        if self.design.kind != "sweep" or len(self.factors) < 2:
            return []
        return [self._base_of(name) for name in self.factors]

    @property
    def labels(self) -> dict[str, str]:
        """What people read for the factors, by name."""
        return {name: f.label or name for name, f in self.factors.items()}

    @property
    def units(self) -> dict[str, str]:
        """Units of the factors, by name; where none is given, those of the keys if they agree."""
        return {name: f.unit or _unit(f.keys) for name, f in self.factors.items()}

    def components(self, scenario: Scenario) -> effects.Ours:
        """Our components in the runs, by the table whose keys they take."""
        found = dict(effects.components_of(scenario))
        if self.receivers:
            named = all(name in RECEIVERS for name in self.receivers)
            found["receiver"] = self.receivers if named else ()
        return found

    def _base_of(self, name: str) -> Number:
        values = [_value(self.base, key) for key in self.factors[name].keys]
        if len(set(values)) > 1 or isinstance(values[0], bool | str | tuple | None):
            keys = " and ".join(self.factors[name].keys)
            raise ConfigurationError(
                f"[factors.{name}] keys: must have one number in the scenario, from which the "
                f"others are swept, got {', '.join(map(repr, values))} for {keys}"
            )
        number: Number = values[0]
        return number

    def overrides(self, point: int) -> dict[str, Number]:
        """Keys of the scenario and their values at a point (from 1)."""
        values = self.plan.points[point - 1]
        return {
            key: value
            for factor, value in zip(self.factors.values(), values, strict=True)
            for key in factor.keys
        }

    def run_seed(self, point: int, replicate: int) -> int:
        """Seed of a run (both from 1)."""
        if self.seeding == "common":
            return self.seed + replicate - 1
        return self.seed + (replicate - 1) * len(self.plan.points) + point - 1

    @property
    def settling_ns(self) -> int:
        """The settling time in ns."""
        return nanoseconds(self.settling_time_s)

    def with_replicates(self, replicates: int) -> Study:
        """The same with another number of replicates; those there are in both are equal."""
        return load(self.model_dump(exclude_unset=True) | {"replicates": replicates})

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
        """Do what is missing of the campaign in a folder; see `sblcosim.study.runner.run`."""
        from .runner import run

        return run(
            self, out, workers=workers, executor=executor, scheduler=scheduler, master=master,
            step_timeout=step_timeout, progress=progress,
        )


UNITS = {
    "_deg_s": "°/s", "_deg_K": "°/K", "_K_s": "K/s", "_m_s": "m/s", "_m2_s3": "m²/s³",
    "_s_s": "s/s", "_deg": "°", "_Hz": "Hz", "_K": "K", "_m": "m", "_s": "s",
}
"""Units by the suffixes of keys, the longer ones first."""


def _unit(keys: Sequence[str]) -> str:
    """The unit of all these keys; empty if it is not one and the same."""
    found = {next((UNITS[end] for end in UNITS if key.endswith(end)), "") for key in keys}
    return found.pop() if len(found) == 1 else ""


@cache
def shipped() -> tuple[str, ...]:
    """Names of the studies that come with the project."""
    return tuple(sorted(f.name.removesuffix(".toml") for f in _SHIPPED.iterdir()))


def load(source: str | Path | Mapping[str, Any]) -> Study:
    """Read a study and check it.

    Parameters
    ----------
    source
        Name of a study that comes with the project (``"paper-scenario-1"``), path of a TOML file,
        or nested tables.

    Raises
    ------
    ConfigurationError
        There is no such study, or something in it is wrong.
    """
    where, raw, folder = _read(source)
    if isinstance(source, str | Path) and "name" not in raw:
        raw["name"] = Path(source).stem
    scenario = raw.get("scenario")
    if isinstance(scenario, str) and os.path.isfile(folder / scenario):
        raw["scenario"] = str(folder / scenario)
    if isinstance(raw.get("receivers"), list | tuple):
        raw["receivers"] = [
            str((folder / r).resolve()) if isinstance(r, str) and r.endswith(".fmu") else r
            for r in raw["receivers"]
        ]
    try:
        study = Study.model_validate(raw)
    except ValidationError as error:
        lines = dict.fromkeys(_line(e, where) for e in error.errors())
        raise ConfigurationError("\n".join(lines)) from None
    try:
        _ = study.base  # a scenario that is wrong is found before anything else
    except ConfigurationError as error:
        raise ConfigurationError(_prefixed(f"{where}: scenario", error)) from None
    problems = [*_problems(study)]
    if problems:
        raise ConfigurationError("\n".join(f"{where}: {problem}" for problem in problems))
    try:
        points = len(study.plan.points)
    except ConfigurationError as error:
        raise ConfigurationError(_prefixed(where, error)) from None
    idle = [*_idle_factors(study)]
    if idle:
        raise ConfigurationError("\n".join(f"{where}: {problem}" for problem in idle))
    last = study.run_seed(points, study.replicates)
    if SEED.max is not None and last > SEED.max:
        raise ConfigurationError(
            f"{where}: seed: must leave room for all runs below {int(SEED.max)}, got {study.seed} "
            f"with {last - study.seed + 1} seeds"
        )
    return study


def _read(source: str | Path | Mapping[str, Any]) -> tuple[str, dict[str, Any], Path]:
    """Where it comes from, the tables, and the folder of relative paths."""
    if isinstance(source, Mapping):
        where = shortened(str(source.get("name", "study")))
        check_values(where, source)
        return where, dict(source), Path.cwd()
    if not isinstance(source, str | Path):
        raise ConfigurationError(
            f"study: must be a name, a TOML file or tables, got {instance(source)}"
        )
    path = Path(source)
    name = str(source).removesuffix(".toml")
    if name in shipped() and not os.path.isfile(path):
        text = (_SHIPPED / f"{name}.toml").read_text(encoding="utf-8")
    else:
        text = read_text(path, shipped(), "study")
    return shown(path), parse(shown(path), text), path.resolve().parent


# --- Checks and messages -------------------------------------------------------------------------


def _prefixed(where: str, error: Exception) -> str:
    return "\n".join(f"{where}: {line}" for line in str(error).splitlines())


def _problems(study: Study) -> Iterator[str]:
    """What is wrong with the factors; one line each."""
    known = known_keys()
    owner: dict[str, str] = {}
    if not study.factors and study.design.kind != "single":
        yield "factors: must have at least one, got none"
    if study.factors and study.design.kind == "single":
        yield f"[design] kind: must not be 'single' with factors, got {', '.join(study.factors)}"
    called: dict[str, str] = {}
    for name, label in study.labels.items():
        place = f"[factors.{shortened(name)}]"
        if label in called:
            yield f"{place} label: must differ from that of {called[label]}, got {quoted(label)}"
        if study.factors[name].label and (TIMES.strip() in label or label in RESERVED):
            yield f"{place} label: must be a word or a few, got {quoted(label)}"
        called[label] = name
    fixed = set(_flat(study.fixed))
    if "seed" in fixed:
        yield "fixed: must not have seed, the study's own seed rules"
    for name, factor in study.factors.items():
        place = f"[factors.{shortened(name)}]"
        if not name.isidentifier() or name in RESERVED or len(name) > _LONGEST:
            yield (
                f"{place}: must have a name of at most {_LONGEST} letters, digits and _, none of "
                f"{', '.join(RESERVED)}, got {quoted(name)}"
            )
        if not factor.keys:
            yield f"{place} keys: must have at least one key, got none"
        for key in factor.keys:
            if key not in known and ".parameters." not in key:
                yield f"{place} keys: there is no key {quoted(key)}{_near(key, known)}"
                continue
            if key in owner:
                yield f"{place} keys: {key} must belong to one factor, got {owner[key]}, too"
            if key in fixed:
                yield f"{place} keys: {key} must not be among the fixed keys, too"
            owner[key] = name
        try:
            designs.Factor(name, factor.levels)
        except ConfigurationError as error:
            yield f"{place} levels: {str(error).partition(': ')[2]}"
            continue
        if not all(key in known or ".parameters." in key for key in factor.keys):
            continue
        problem = next((p for v in factor.levels for p in _level(study, factor, v)), None)
        if problem is not None:
            yield f"{place} levels: {problem}"
    if study.design.kind != "fraction" and (study.design.generators or study.design.resolution):
        yield "[design] kind: must be 'fraction' with generators or a resolution, got " + toml(
            study.design.kind
        )
    if study.design.kind in ("sweep", "single") and study.design.centre_points:
        yield (
            f"[design] centre_points: must be 0 for kind '{study.design.kind}', got "
            f"{study.design.centre_points}"
        )
    if study.seeding == "common" and study.design.centre_points > 1:
        yield (
            "[design] centre_points: must be at most 1 with seeding 'common', where they would all "
            f"be the same run, got {study.design.centre_points}"
        )


def _level(study: Study, factor: FactorTable, level: Number) -> Iterator[str]:
    """What is wrong with a level alone; it may need another factor's, which is seen later."""
    try:
        study.base.override(dict.fromkeys(factor.keys, level))
    except ConfigurationError as error:
        for line in str(error).splitlines():
            if any(line.startswith(f"override {key}: must be") for key in factor.keys):
                yield line.removeprefix("override ")


def _idle_factors(study: Study) -> Iterator[str]:
    """Keys of factors that have no effect at any point; one line each."""
    for name, factor in study.factors.items():
        for key in factor.keys:
            why = _why_idle(study, key)
            if why is not None:
                yield f"[factors.{name}] keys: {key} must have an effect, got none, as {why}"


def _why_idle(study: Study, key: str) -> str | None:
    """Why a key has no effect at any point; None if it has one."""
    path = tuple(key.split("."))
    on = set(effects.conditions(path))
    if not on and path not in SETTERS:
        return None
    decisive = {path, *on, *SETTERS}
    names = [
        any(tuple(k.split(".")) in decisive for k in factor.keys)
        for factor in study.factors.values()
    ]
    why, seen = None, set()
    for number, values in enumerate(study.plan.points, 1):
        levels = tuple(compress(values, names))
        if levels in seen:
            continue
        seen.add(levels)
        try:
            scenario = study.base.override(study.overrides(number))
        except ConfigurationError as error:
            lead = f"{no_effect(path)}, as "
            found = [line for line in str(error).splitlines() if line.startswith(lead)]
            if not found:
                return None  # it is told elsewhere what is wrong with that point
            why = found[0].removeprefix(lead)
            continue
        why = effects.in_vain(scenario, study.components(scenario), [path]).get(path)
        if why is None:
            return None
    return why


@cache
def known_keys() -> tuple[str, ...]:
    """Keys that a factor may have, ``table.key``."""
    keys = []
    for name, field in Scenario.model_fields.items():
        kind = field.annotation
        if isinstance(kind, type) and issubclass(kind, Table):
            keys += [f"{name}.{key}" for key in kind.model_fields if key not in _NO_FACTORS]
    return tuple(keys)


_NO_FACTORS = ("seed", "fmi", "fmu", "parameters", "type", "prior", "imu_grade")


def _near(key: str, known: Sequence[str]) -> str:
    """The nearest key; one without its table counts by its own name."""
    same = [k for k in known if k.partition(".")[2] == key.rpartition(".")[2]]
    if same:
        return f"; did you mean {same[0]!r}?"
    if "." in key:
        return nearest(key, known)
    close = nearest(key, [k.partition(".")[2] for k in known])
    for k in known:
        if close == nearest(key, [k.partition(".")[2]]) != "":
            return f"; did you mean {k!r}?"
    return ""


def _flat(tables: Mapping[str, Any], above: str = "") -> Iterator[str]:
    for key, value in tables.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{above}{key}.")
        else:
            yield f"{above}{key}"


def _value(scenario: Scenario, key: str) -> Any:
    value: Any = scenario
    for part in key.split("."):
        value = value.get(part) if isinstance(value, Mapping) else getattr(value, part, None)
    return value


def _line(error: ErrorDetails, where: str) -> str:
    """A problem that pydantic found, in our wording."""
    location = [str(part) for part in error["loc"]]
    place, models = location[0], Study.model_fields
    table: type[Table] = Study
    if place == "design" and len(location) > 1:
        table, place, location = DesignTable, f"[design] {location[1]}", location[1:]
    elif place == "factors" and len(location) > 2:
        table = FactorTable
        place, location = f"[factors.{shortened(location[1])}] {location[2]}", location[2:]
    elif place == "factors" and len(location) == 2:
        place = f"[factors.{shortened(location[1])}]"
    if error["type"] == "extra_forbidden":
        inside = "" if table is Study else place.partition("] ")[0] + "] "
        return (
            f"{where}: {inside}there is no key {quoted(location[0])}"
            f"{nearest(location[0], table.model_fields if table is not Study else models)}"
        )
    if error["type"] == "missing":
        return f"{where}: {place}: must be given, got nothing"
    if location[0] == "scenario":
        return f"{where}: scenario: must be a name, a file or a table, got {_text(error['input'])}"
    must, choices = requirement(error)
    got = error["input"]
    close = nearest(got, choices) if isinstance(got, str) else ""
    return f"{where}: {place}: {must}, got {_text(got)}{close}"


def _text(value: Any) -> str:
    if isinstance(value, float) and not math.isfinite(value):
        return repr(value)
    return shortened(toml(value))


__all__ = ["DesignTable", "FactorTable", "Study", "known_keys", "load", "shipped"]
