"""Contents of a study file: factors, conditions, design, replicates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field
from pydantic_core import PydanticCustomError
from sblcosim.fmus.host.nanoseconds import nanoseconds, settled
from sblcosim.models import RECEIVERS

from ..errors import ConfigurationError
from ..results.responses import ALL_PERCENTILES, ON_REQUEST, PERCENTILES, Response
from ..scenario import effects
from ..scenario.scenario import Scenario
from ..scenario.scenario import load as load_scenario
from ..scenario.schema import SEED, Name, Table
from ..simulation.user_code import PythonSource
from . import design as designs
from .design import Design, Factor, Level, Number
from .grid import crossed, grid

RESERVED = (
    "point", "replicate", "run_order", "seed", "error", "run_id", "centre",
    "runs", "mean", "std", "fit", "value",
)
"""Columns of the table of runs, or of tables derived from it, that are not factors."""
LONGEST_NAME = 60  # characters of a factor's name
RECEIVERS_KEY = "receivers"
"""As the only key of a factor: its levels are receivers, as in `Definition.receivers`."""


def _array(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _levels(value: Any) -> Any:
    if isinstance(value, Mapping):
        if not all(isinstance(v, Mapping) for v in value.values()):
            raise PydanticCustomError("levels", "must be a table of tables of keys, or of files")
        return dict(value)
    if not isinstance(value, list | tuple) or any(
        not isinstance(v, bool | int | float | str) for v in value
    ):
        raise PydanticCustomError(
            "levels", "must be an array of numbers, texts or truth values, or a table of names"
        )
    return tuple(value)


def _sources(value: Any) -> Any:
    value = _array(value)
    if isinstance(value, tuple) and not all(isinstance(v, str | PythonSource) for v in value):
        raise PydanticCustomError("receivers", "must be an array of names and files")
    return value


_Texts = Annotated[tuple[str, ...], BeforeValidator(_array)]


class FactorTable(Table):
    """Table ``[factors.NAME]``.

    Attributes
    ----------
    keys
        Keys of the scenario, ``table.key``; all are set to the level. Or ``receivers`` alone.
    levels
        In the units of the keys: numbers, and in a grid texts and truth values, too. Of two levels,
        the first is coded −1 and the second +1. Without keys: by name, the keys that a level
        sets and their values (in a file, tables of a scenario, or the name of such a file).
    label, unit
        Display name, and unit shown after the levels (default: from the suffix of the keys).
    """

    keys: _Texts = ()
    levels: Annotated[Any, BeforeValidator(_levels)]
    label: str = Field(default="", description="Display name")
    unit: str = Field(default="", description="Shown after the levels; else that of the keys")

    @cached_property
    def settings(self) -> Mapping[Level, Mapping[str, Any]]:
        """What each level sets: keys of the scenario and their values."""
        if isinstance(self.levels, Mapping):
            return {name: dict(flat(tables)) for name, tables in self.levels.items()}
        return {_named(level): dict.fromkeys(self.keys, level) for level in self.levels}

    @property
    def values(self) -> tuple[Level, ...]:
        """The levels as they stand in tables: numbers, and names."""
        # Of an array, twice the same level must be seen.
        return tuple(map(_named, self.levels))

    @property
    def all_keys(self) -> tuple[str, ...]:
        """Keys that some level sets."""
        if not isinstance(self.levels, Mapping):
            return self.keys
        return tuple(dict.fromkeys(key for setting in self.settings.values() for key in setting))


def _named(level: Any) -> Level:
    """A level as it stands in tables."""
    number: Level = str(level).lower() if isinstance(level, bool) else level
    return number


def flat(tables: Mapping[str, Any], above: str = "") -> Iterable[tuple[str, Any]]:
    """Keys of nested tables, ``table.key``, and their values."""
    for key, value in tables.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


VARIED = ("factors", "conditions")
"""Tables of a study whose entries are varied."""


class ConditionTable(FactorTable):
    """Table ``[conditions.NAME]``: as a factor, but nobody's choice.

    Attributes
    ----------
    combine
        What counts of the responses in the conditions: their ``average``, or the worst, for a
        design that must hold in ``all``.
    """

    combine: Literal["average", "all"] = Field(
        default="average", description="What counts is the average of the conditions, or the worst"
    )


class DesignTable(Table):
    """Table ``[design]``.

    Attributes
    ----------
    kind
        ``full`` (two levels, all combinations), ``fraction`` (part of a full design), ``sweep``
        (one factor at a time, any number of levels), ``grid`` (any number of levels, all
        combinations or some at random), or ``single`` (the scenario itself, without factors).
    generators, resolution
        For a fraction, see `sblcosim.study.design.fractional`.
    centre_points
        Number of points in the middle of all factors.
    order
        Interactions up to this order must not be aliased with each other.
    points
        Of a grid: so many combinations, drawn with the study's seed; default: all.
    """

    kind: Literal["full", "fraction", "sweep", "grid", "single"] = Field(
        default="full",
        description="Two levels, all combinations or a part of them; one factor at a time; any "
        "levels, all combinations or a random part; or the scenario itself",
    )
    generators: _Texts = Field(default=(), description="Of a fraction: C=AB")
    resolution: Annotated[int, Field(ge=3)] | None = Field(
        default=None, description="Of a fraction"
    )
    centre_points: Annotated[int, Field(ge=0, le=1000)] = Field(
        default=0, description="Number of points in the middle of all factors"
    )
    order: Annotated[int, Field(ge=1)] = Field(
        default=1, description="Interactions up to this order must not be aliased with each other"
    )
    points: Annotated[int, Field(ge=1)] | None = Field(
        default=None, description="Of a grid: so many of its combinations, at random"
    )


class Definition(Table):
    """A factorial campaign, as defined in its file.

    Attributes
    ----------
    scenario
        Name, file, or tables of a scenario.
    replicates
        Number of runs at each point.
    seeding
        ``independent``: each run has its own noise; ``common``: all points of a replicate share it.
    seed
        Seed of the first run and of the run order.
    settling_time_s
        Errors count from this time after the start [s].
    receivers
        As in `sblcosim.run`: names, FMU files, ``file.py:Class``, and (in Python) classes; empty:
        the scenario's own receiver.
    responses
        Extra responses: names in `sblcosim.results.responses.ON_REQUEST`
        (``absolute_total_p95_m``), ``percentiles`` for all percentiles, and functions, as
        ``file.py:function`` or as objects.
    fixed
        Keys of the scenario to change in all runs.
    factors
        What is chosen, by name.
    conditions
        What is met: every point runs in each combination of them, and the analysis is of what
        they give together.
    """

    name: Name = Field(default="study", description="Of the folder of results")
    title: str = Field(default="", description="What people read, on top of reports")
    scenario: str | dict[str, Any]
    replicates: Annotated[int, Field(ge=1)] = Field(
        default=1, description="Number of runs at each point"
    )
    seeding: Literal["independent", "common"] = Field(
        default="independent",
        description="Each run has its own noise, or all points of a replicate share it",
    )
    seed: Annotated[int, Field(ge=SEED.min, le=SEED.max)] = Field(
        default=1, description="Of the first run, and of the run order"
    )
    settling_time_s: Annotated[
        float, Field(ge=0.0, allow_inf_nan=False), AfterValidator(settled)
    ] = Field(default=0.0, description="Errors count from this time after the start")
    receivers: Annotated[tuple[Any, ...], BeforeValidator(_sources)] = ()
    responses: Annotated[tuple[Any, ...], BeforeValidator(_array)] = ()
    fixed: dict[str, Any] = Field(default_factory=dict)
    design: DesignTable = Field(default_factory=DesignTable)
    factors: dict[str, FactorTable] = Field(default_factory=dict)
    conditions: dict[str, ConditionTable] = Field(default_factory=dict)

    @cached_property
    def base(self) -> Scenario:
        """The scenario with the fixed keys applied."""
        return load_scenario(self.scenario, self.fixed.items())

    @cached_property
    def asked(self) -> tuple[Response, ...]:
        """The extra responses, each once."""
        responses: dict[str, Response] = {}
        for entry in self.responses:
            if isinstance(entry, Response):
                responses[entry.name] = entry
            elif entry == ALL_PERCENTILES:
                responses |= PERCENTILES
            elif entry in ON_REQUEST:
                responses[entry] = ON_REQUEST[entry]
        return tuple(responses.values())

    @cached_property
    def points(self) -> Design:
        """The design points, in all conditions."""
        conditions = [Factor(name, c.values) for name, c in self.conditions.items()]
        return crossed(self._chosen, conditions)

    @property
    def _chosen(self) -> Design:
        """The design without its conditions."""
        factors = [Factor(name, f.values) for name, f in self.varied_factors.items()]
        table = self.design
        if not factors:
            return Design((), ((),), (False,))
        if table.kind == "full":
            design = designs.full(factors, table.centre_points)
        elif table.kind == "grid":
            return grid(factors, table.points, self.seed)
        elif table.kind == "fraction":
            design = designs.fractional(
                factors, table.generators, table.resolution, table.centre_points
            )
        else:
            design = designs.sweep(factors, self.sweep_base or [0.0])
        design.require(min(table.order, len(factors)))
        return design

    @property
    def receiver_factor(self) -> str | None:
        """The factor whose levels are the receivers: they run side by side, on the same noise."""
        return next((n for n, f in self.factors.items() if f.keys == (RECEIVERS_KEY,)), None)

    @property
    def varied_factors(self) -> Mapping[str, FactorTable]:
        """The factors that make a run another one: all but the receivers."""
        return {n: f for n, f in self.factors.items() if n != self.receiver_factor}

    @property
    def varied(self) -> Mapping[str, FactorTable]:
        """Factors and conditions that make a run another one, in the order of a point's values."""
        return {**self.varied_factors, **self.conditions}

    @property
    def sweep_base(self) -> list[Number]:
        """Values of the factors while another one is swept; empty for a single factor."""
        if self.design.kind != "sweep" or len(self.varied_factors) < 2:
            return []
        return [self._base_of(name) for name in self.varied_factors]

    @property
    def labels(self) -> dict[str, str]:
        """Display names of the factors, by name."""
        return {name: f.label or name for name, f in {**self.factors, **self.conditions}.items()}

    @property
    def units(self) -> dict[str, str]:
        """Units of the factors, by name; the default is the unit of the keys if they agree."""
        return {
            name: f.unit or _unit(f.keys) for name, f in {**self.factors, **self.conditions}.items()
        }

    def components(self, scenario: Scenario) -> effects.Ours:
        """Our components in the runs, by the table whose keys they use."""
        by_table = dict(effects.components_of(scenario))
        if self.receivers:
            named = all(name in RECEIVERS for name in self.receivers)
            by_table["receiver"] = self.receivers if named else ()
        return by_table

    def _base_of(self, name: str) -> Number:
        values = [value_of(self.base, key) for key in self.factors[name].keys]
        if len(set(values)) > 1 or isinstance(values[0], bool | str | tuple | None):
            keys = " and ".join(self.factors[name].keys)
            raise ConfigurationError(
                f"[factors.{name}] keys: must have one number in the scenario, from which the "
                f"others are swept, got {', '.join(map(repr, values))} for {keys}"
            )
        number: Number = values[0]
        return number

    def overrides(self, point: int) -> dict[str, Any]:
        """Keys of the scenario and their values at a point (counted from 1)."""
        changes: dict[str, Any] = {}
        for factor, value in zip(
            self.varied.values(), self.points.values[point - 1], strict=True
        ):
            # Only an array's levels are continued: a sweep's base, and the middle of two.
            changes |= factor.settings.get(value) or dict.fromkeys(factor.keys, value)
        return changes

    def at(self, point: int) -> str:
        """The levels at a point (counted from 1), for people."""
        levels = zip(self.varied, self.points.values[point - 1], strict=True)
        return ", ".join(f"{name} = {designs.shown(level)}" for name, level in levels)

    def run_seed(self, point: int, replicate: int) -> int:
        """Seed of a run; points and replicates count from 1."""
        if self.seeding == "common":
            return self.seed + replicate - 1
        return self.seed + (replicate - 1) * len(self.points.values) + point - 1

    @property
    def settling_ns(self) -> int:
        """The settling time [ns]."""
        return nanoseconds(self.settling_time_s)


UNITS = {
    "_deg_s": "°/s", "_deg_K": "°/K", "_K_s": "K/s", "_m_s": "m/s", "_m2_s3": "m²/s³",
    "_s_s": "s/s", "_deg": "°", "_Hz": "Hz", "_K": "K", "_m": "m", "_s": "s",
}
"""Units by suffix of the key, longer suffixes first."""


def _unit(keys: Sequence[str]) -> str:
    """The common unit of some keys; empty if they have different ones."""
    units = {next((UNITS[end] for end in UNITS if key.endswith(end)), "") for key in keys}
    return units.pop() if len(units) == 1 else ""


def value_of(scenario: Scenario, key: str) -> Any:
    value: Any = scenario
    for part in key.split("."):
        value = value.get(part) if isinstance(value, Mapping) else getattr(value, part, None)
    return value
