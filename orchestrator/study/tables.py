"""The tables of a study file: factors, conditions, design."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

from ..errors import shortened
from ..scenario.schema import Table
from .design import Level
from .distributions import Distribution, Kind, Numbers
from .space import LEAST_BASE_ROWS, MOST_BASE_ROWS, NEWEST, SampleVersion

RESERVED = (
    "point", "replicate", "run_order", "seed", "error", "run_id", "centre",
    "runs", "mean", "std", "fit", "value",
)
"""Columns of the table of runs, or of tables derived from it, that are not factors."""
LONGEST_NAME = 60  # characters of a factor's name
RECEIVERS_KEY = "receivers"
"""The only key of a factor whose levels are receivers, as in `Definition.receivers`."""
BASE_ROWS = 256
"""Default number of base rows of a space."""


def array(value: Any) -> Any:
    """A list as a tuple; other values are refused later."""
    return tuple(value) if isinstance(value, list) else value


def _levels(value: Any) -> Any:
    if value is None:
        return None
    if isinstance(value, Mapping):
        for name, given in value.items():
            if not isinstance(given, Mapping):
                raise PydanticCustomError(
                    "levels",
                    "must be a table of tables of keys, or of files, in {level}, too",
                    {"level": shortened(str(name))},
                )
        return dict(value)
    if not isinstance(value, list | tuple) or any(
        not isinstance(v, bool | int | float | str) for v in value
    ):
        raise PydanticCustomError(
            "levels", "must be an array of numbers, texts or truth values, or a table of names"
        )
    return tuple(value)


_Texts = Annotated[tuple[str, ...], BeforeValidator(array)]


class FactorTable(Numbers):
    """Table ``[factors.NAME]``.

    Attributes
    ----------
    keys
        Keys of the scenario, ``table.key``; all are set to the level. Or ``receivers`` alone.
    levels
        In the units of the keys: numbers, and in a grid also texts and truth values. With two
        levels, the first is coded −1 and the second +1. Without keys: by name, the keys that a
        level sets and their values (in a file, tables of a scenario, or the name of such a file).
    distribution
        For a space: distribution of the values; `sblcosim.study.distributions.Distribution` lists
        its numbers.
    label, unit
        Display name, and unit shown after the levels (default: from the suffix of the keys).
    """

    keys: _Texts = ()
    levels: Annotated[Any, BeforeValidator(_levels)] = None
    distribution: Kind | None = Field(default=None, description="In a space: how values are drawn")
    label: str = Field(default="", description="Display name")
    unit: str = Field(default="", description="Shown after the levels; default: unit of the keys")

    @cached_property
    def settings(self) -> Mapping[Level, Mapping[str, Any]]:
        """What each level sets: keys of the scenario and their values."""
        if self.levels is None:
            return {}
        if isinstance(self.levels, Mapping):
            return {name: dict(flat(tables)) for name, tables in self.levels.items()}
        given = zip(self.values, self.levels, strict=True)
        return {level: dict.fromkeys(self.keys, value) for level, value in given}

    @property
    def values(self) -> tuple[Level, ...]:
        """The levels as they appear in tables: numbers, or names if any of them is a name."""
        # In an array, duplicate levels must be detected.
        levels = tuple(map(named, self.levels or ()))
        texts = any(isinstance(level, str) for level in levels)
        return tuple(map(_text, levels)) if texts else levels

    @property
    def numbers(self) -> Mapping[Level, Level]:
        """The numbers among names, by how they appear in tables."""
        levels = map(named, self.levels or ())
        return {_text(level): level for level in levels if not isinstance(level, str)}

    @property
    def law(self) -> Distribution | None:
        """The distribution, if it has one."""
        if self.distribution is None:
            return None
        numbers = {name: getattr(self, name) for name in Numbers.model_fields}
        levels = None if self.levels is None else tuple(self.levels)
        return Distribution(distribution=self.distribution, levels=levels, **numbers)

    @property
    def all_keys(self) -> tuple[str, ...]:
        """Keys that any level sets."""
        if not isinstance(self.levels, Mapping):
            return self.keys
        return tuple(dict.fromkeys(key for setting in self.settings.values() for key in setting))


def named(level: Any) -> Level:
    """A level as it appears in tables."""
    number: Level = str(level).lower() if isinstance(level, bool) else level
    return number


def _text(level: Level) -> str:
    """A level among names: a number as short as it can be read back."""
    short = level if isinstance(level, str) else f"{level:g}"
    return short if isinstance(level, str) or float(short) == level else repr(level)


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
    """Table ``[conditions.NAME]``: like a factor, but not the user's choice.

    Attributes
    ----------
    combine
        How responses combine over the conditions: their ``average``, or the worst, for a design
        that must hold in ``all``.
    """

    combine: Literal["average", "all"] = Field(
        default="average", description="Combine the conditions by their average, or by the worst"
    )


class DesignTable(Table):
    """Table ``[design]``.

    Attributes
    ----------
    kind
        ``full`` (two levels, all combinations), ``fraction`` (part of a full design), ``sweep``
        (one factor at a time, any number of levels), ``grid`` (any number of levels, all
        combinations or some at random), ``space`` (distributions, sampled for Sobol' indices), or
        ``single`` (the scenario itself, without factors).
    generators, resolution
        For a fraction, see `sblcosim.study.design.fractional`.
    centre_points
        Number of points in the middle of all factors.
    order
        Interactions up to this order must not be aliased with each other.
    points
        For a grid: number of combinations, drawn with the study's seed; default: all.
    base_rows
        For a space: a power of 2; for k factors each one is k + 3 runs.
    sample
        For a space: version of its sample, see `sblcosim.study.space.sample`; default: that of the
        results folder if it has runs, otherwise the newest.
    """

    kind: Literal["full", "fraction", "sweep", "grid", "space", "single"] = Field(
        default="full",
        description="Two levels, all combinations or a part of them; one factor at a time; any "
        "levels, all combinations or a random part; distributions; or the scenario itself",
    )
    generators: _Texts = Field(default=(), description="Generators of a fraction, such as C=AB")
    resolution: Annotated[int, Field(ge=3)] | None = Field(
        default=None, description="Resolution of a fraction"
    )
    centre_points: Annotated[int, Field(ge=0, le=1000)] = Field(
        default=0, description="Number of points in the middle of all factors"
    )
    order: Annotated[int, Field(ge=1)] = Field(
        default=1, description="Interactions up to this order must not be aliased with each other"
    )
    points: Annotated[int, Field(ge=1)] | None = Field(
        default=None, description="For a grid: number of combinations to draw; default: all"
    )
    base_rows: Annotated[int, Field(ge=LEAST_BASE_ROWS, le=MOST_BASE_ROWS)] | None = Field(
        default=None, description=f"For a space: a power of 2; default: {BASE_ROWS}"
    )
    sample: SampleVersion | None = Field(
        default=None,
        description=f"For a space: version of its sample; default: that of the folder, or {NEWEST}",
    )
