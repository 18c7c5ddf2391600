"""Contents of a study file: factors, conditions, design, replicates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Annotated, Any, Literal, Self

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
from ..scenario.units import unit_of
from ..simulation.code.user_code import PythonSource, check
from . import design as designs
from . import drawn
from .design import Design, Factor, Number
from .grid import crossed, grid
from .space import NEWEST, Sample, SampleVersion
from .space import sample as draw
from .stand_in import StandIn
from .tables import (
    BASE_ROWS,
    RECEIVERS_KEY,
    ConditionTable,
    DesignTable,
    FactorTable,
    array,
)


def _sources(value: Any) -> Any:
    value = array(value)
    if isinstance(value, tuple) and not all(isinstance(v, str | PythonSource) for v in value):
        raise PydanticCustomError("receivers", "must be an array of names and files")
    return value


def _model(value: Any) -> Any:
    if value is not None and not isinstance(value, StandIn):
        raise PydanticCustomError("model", "must be FILE.py:FUNCTION or a function")
    return value


class Definition(Table):
    """A factorial campaign, as defined in its file.

    Attributes
    ----------
    scenario
        Name, file, or tables of a scenario.
    model
        Function of the factors in place of the scenario, ``file.py:function`` or (in Python) the
        function.
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
        Quantities that the user chooses, by name.
    conditions
        Circumstances that the user must accept: every point runs in each combination of them, and
        the analysis combines the results.
    """

    name: Name = Field(default="study", description="Name of the results folder")
    title: str = Field(default="", description="Title shown above reports")
    scenario: str | dict[str, Any] = ""
    model: Annotated[Any, BeforeValidator(_model)] = None
    replicates: Annotated[int, Field(ge=1)] = Field(
        default=1, description="Number of runs at each point"
    )
    seeding: Literal["independent", "common"] = Field(
        default="independent",
        description="Each run has its own noise, or all points of a replicate share it",
    )
    seed: Annotated[int, Field(ge=SEED.min, le=SEED.max)] = Field(
        default=1, description="Seed of the first run, and of the run order"
    )
    settling_time_s: Annotated[
        float, Field(ge=0.0, allow_inf_nan=False), AfterValidator(settled)
    ] = Field(default=0.0, description="Errors count from this time after the start")
    receivers: Annotated[tuple[Any, ...], BeforeValidator(_sources)] = ()
    responses: Annotated[tuple[Any, ...], BeforeValidator(array)] = ()
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
        chosen = self._chosen if self.sample is None else drawn.design_of(self.sample)
        conditions = [Factor(name, c.values) for name, c in self.conditions.items()]
        return crossed(chosen, conditions)

    @cached_property
    def sample(self) -> Sample | None:
        """The runs of a space; None for other designs."""
        if self.design.kind != "space":
            return None
        factors = [
            drawn.factor_of(
                name, factor, self.model is None, label=self.labels[name], unit=self.units[name]
            )
            for name, factor in self.varied_factors.items()
        ]
        return draw(
            factors, self.design.base_rows or BASE_ROWS, self.seed, self.design.sample or NEWEST
        )

    def with_sample(self, version: SampleVersion) -> Self:
        """A copy, for a space, with another version of its sample."""
        given = {name: getattr(self, name) for name in self.model_fields_set}
        design = self.design.model_copy(update={"sample": version})
        return self.model_construct(**given | {"design": design})

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

    @cached_property
    def receiver_factor(self) -> str | None:
        """The factor whose levels are the receivers: they run side by side, on the same noise."""
        return next((n for n, f in self.factors.items() if f.keys == (RECEIVERS_KEY,)), None)

    @cached_property
    def varied_factors(self) -> Mapping[str, FactorTable]:
        """The factors that define a run: all except the receivers."""
        return {n: f for n, f in self.factors.items() if n != self.receiver_factor}

    @cached_property
    def varied(self) -> Mapping[str, FactorTable]:
        """Factors and conditions that define a run, in the order of a point's values."""
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
                f"[factors.{name}] keys: must have the same number in the scenario, as the base of "
                "the "
                f"other sweeps, got {', '.join(map(repr, values))} for {keys}"
            )
        number: Number = values[0]
        return number

    def overrides(self, point: int) -> dict[str, Any]:
        """Keys of the scenario and their values at a point (counted from 1)."""
        changes: dict[str, Any] = {}
        for factor, value in zip(
            self.varied.values(), self.points.values[point - 1], strict=True
        ):
            # Only an array's levels are interpolated: a sweep's base, and the middle of two.
            changes |= factor.settings.get(value) or dict.fromkeys(factor.keys, value)
        return changes

    def at(self, point: int) -> str:
        """The levels at a point (counted from 1), for people."""
        levels = zip(self.varied, self.points.values[point - 1], strict=True)
        return ", ".join(f"{name} = {designs.shown(level)}" for name, level in levels)

    def check_code(self) -> None:
        """Refuse code given in Python that has changed since the study was loaded.

        Raises
        ------
        CodeChangedError
            The message names the code.
        """
        for source in self.receivers:
            if isinstance(source, PythonSource):
                check(source.maker, source.origin, source.sha256, "receivers")
        for response in self.asked:
            if not response.shipped:
                check(response.definition, response.origin, response.sha256, "responses")
        if self.model is not None:
            check(self.model.function, self.model.origin, self.model.sha256, "model")

    @cached_property
    def rounded(self) -> list[str]:
        """Levels of a function, exactly; its run ids hold them with fewer digits."""
        if self.model is None:
            return []
        levels = (v for row in self.points.values for v in row if not isinstance(v, str))
        return [float(v).hex() for v in levels if float(designs.shown(v)) != v]

    def run_seed(self, point: int, replicate: int) -> int:
        """Seed of a run; points and replicates count from 1."""
        if self.sample is not None:  # the seed is a factor, and conditions share it
            return int(self.sample.seeds[(point - 1) % len(self.sample)])
        if self.seeding == "common":
            return self.seed + replicate - 1
        return self.seed + (replicate - 1) * len(self.points.values) + point - 1

    @property
    def settling_ns(self) -> int:
        """The settling time [ns]."""
        return nanoseconds(self.settling_time_s)


def _unit(keys: Sequence[str]) -> str:
    """The common unit of some keys; empty if they have different ones."""
    units = {*map(unit_of, keys)}
    return units.pop() if len(units) == 1 else ""


def value_of(scenario: Scenario, key: str) -> Any:
    value: Any = scenario
    for part in key.split("."):
        value = value.get(part) if isinstance(value, Mapping) else getattr(value, part, None)
    return value
