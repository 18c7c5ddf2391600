"""Questions: a requirement, choices with their costs, conditions, and a budget of runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import Field, ValidationError

from ..analysis.advice.costs import of_levels
from ..analysis.common.conditions import BETTER_IF_LARGE
from ..errors import ConfigurationError, instance, nearest, quoted, shortened
from ..results.responses import FLAGS, ON_REQUEST, RESPONSES, check_limit, unit_of
from ..scenario import library
from ..scenario.labels import RAW
from ..scenario.schema import Table
from ..scenario.sources import choose
from ..shown import Shown
from ..study.checks import line
from ..study.design import Level
from ..study.design import shown as level_shown
from ..study.study import Study, of_tables, read
from ..study.tables import RECEIVERS_KEY
from ..words.numbers import with_unit
from ..words.shares import percent
from .sequential import MOST_RUNS, Rule

PACKAGE = "sblcosim.require"
_FRAME = "absolute_"
"""Frame of a response whose name has none: errors in the world."""
OF_STUDY = ("name", "title", "scenario", "fixed", "seed", "settling_time_s", "conditions")
"""Keys with the same meaning in a study file."""
_OF_CHOICE = ("label", "unit", "keys", "levels", "costs")
_Share = Annotated[float, Field(gt=0.0, lt=1.0)]


class Terms(Table):
    """Keys of a question file that have no equal in a study file.

    Attributes
    ----------
    response
        The required response of each run: a name, or ``FILE.py:FUNCTION``. A name without a frame
        is for the absolute error: ``total_p95_m`` is ``absolute_total_p95_m``.
    limit
        Largest value of the response with which a run passes, in its unit.
    share
        Share of the runs that must pass.
    confidence
        Probability that no claim about any design is wrong.
    most_runs
        Budget of runs.
    currency
        Currency of the costs.
    """

    response: str = Field(description="Required response of each run")
    limit: Annotated[float, Field(allow_inf_nan=False)] = Field(
        description="Largest value of the response with which a run passes"
    )
    share: _Share = Field(default=0.95, description="Share of the runs that must pass")
    confidence: _Share = Field(
        default=0.95, description="Probability that no claim about any design is wrong"
    )
    most_runs: Annotated[int, Field(ge=1, le=MOST_RUNS)] = Field(
        default=40_000, description="Budget of runs"
    )
    currency: str = Field(default="", description="Of the costs")


@dataclass(frozen=True)
class Candidate:
    """A combination of levels.

    Attributes
    ----------
    levels
        Level of each choice.
    cost
        Sum over the choices.
    group
        Index among the combinations of all choices except the receiver, in the study's order.
    receiver
        Label of its receiver.
    """

    levels: Mapping[str, Level]
    cost: float
    group: int
    receiver: str


@dataclass(frozen=True, eq=False, repr=False)
class Question(Shown):
    """A question. Made by `load`.

    Attributes
    ----------
    terms
        The requirement and the budget.
    study
        The choices are its factors, and every run is one of its runs.
    costs
        Cost of each level, by choice. Choices without costs are left out.
    response
        Second part of the column in the table of runs.
    tables
        Tables of the question's file.
    """

    terms: Terms
    study: Study
    costs: Mapping[str, Mapping[Level, float]]
    response: str
    tables: Mapping[str, Any]

    def _gist(self) -> str:
        return (
            f"{self.study.name}: {self.requirement}; {len(self.designs)} designs"
            + (f" in {len(self.conditions)} conditions" if len(self.conditions) > 1 else "")
        )

    @property
    def unit(self) -> str:
        """Unit of response and limit."""
        return unit_of(self.response)

    @property
    def words(self) -> str:
        """The response for people."""
        known = RESPONSES.get(self.response)
        return self.response if known is None else known.words

    @property
    def flag(self) -> str:
        """What a run must not be, such as ``misleading``; empty if the response is no flag."""
        return self.response if self.response in FLAGS else ""

    @property
    def requirement(self) -> str:
        """What must hold, for people."""
        most = f"{self.terms.limit:g}{self.unit and f' {self.unit}'}"
        what = f"not {self.flag}" if self.flag else f"{self.words} of at most {most}"
        return f"{what} in {percent(self.terms.share)} of the runs"

    @property
    def passes(self) -> str:
        """What holds of a run that passes, for people."""
        if self.flag:
            return f"it is not {self.flag}"
        most = f"{self.terms.limit:g}{self.unit and f' {self.unit}'}"
        return f"its {self.words} is at most {most}"

    @cached_property
    def rule(self) -> Rule:
        """The rule for when a design surely suffices."""
        return Rule(
            self.terms.share, 1 - self.terms.confidence, len(self.designs), len(self.conditions)
        )

    @cached_property
    def designs(self) -> tuple[Candidate, ...]:
        """All designs, the cheapest first."""
        study, own = self.study, self.study.receiver_factor
        groups = len(study.points.values) // len(self._rows)
        labels = [label for label in choose(study.base, list(study.receivers)) if label != RAW]
        made = []
        for group, label in product(range(groups), labels):
            point = dict(zip(study.varied_factors, study.points.values[group], strict=False))
            levels = {n: label if n == own else point[n] for n in study.factors}
            costs = [self.costs[n][v] for n, v in levels.items() if n in self.costs]
            # As on paper: in binary, 0.1 + 0.2 is dearer than 0.3.
            cost = float(sum(Decimal(str(c)) for c in costs))
            made.append(Candidate(levels, cost, group, label))
        return tuple(sorted(made, key=lambda design: design.cost))

    @property
    def _rows(self) -> list[dict[str, Level]]:
        """Conditions of the points, which change more slowly than all choices."""
        study, first = self.study, len(self.study.varied_factors)
        rows = dict.fromkeys(tuple(values[first:]) for values in study.points.values)
        return [dict(zip(study.conditions, row, strict=True)) for row in rows]

    @cached_property
    def conditions(self) -> dict[tuple[tuple[str, Level], ...], list[int]]:
        """Conditions in each of which a design must suffice, each with its rows of points.

        The runs of all rows of one condition count together.
        """
        found: dict[tuple[tuple[str, Level], ...], list[int]] = {}
        for index, row in enumerate(self._rows):
            key = tuple((n, v) for n, v in row.items() if self.study.conditions[n].combine == "all")
            found.setdefault(key, []).append(index)
        return found

    def places(self, group: int, condition: int, start: int, stop: int) -> NDArray[np.int64]:
        """Points, from 0, of the replicates after ``start`` of a group of designs in a condition.

        Where conditions count together, each replicate is in one of them, drawn at random. The runs
        of a design are therefore draws from one distribution. The replicate's number decides the
        draw.
        """
        rows = np.array([*self.conditions.values()][condition], np.int64)
        drawn = np.random.Philox(key=self.study.seed).random_raw(stop)[start:]
        index = ((drawn >> np.uint64(32)) * np.uint64(len(rows))) >> np.uint64(32)
        return rows[index.astype(np.int64)] * self.groups + group

    @cached_property
    def groups(self) -> int:
        """Number of groups of designs that share their runs."""
        return 1 + max(design.group for design in self.designs)

    def with_budget(self, most_runs: int) -> Question:
        """A copy with another budget; runs within both budgets are equal.

        Raises
        ------
        ConfigurationError
            The budget is out of range.
        """
        if not isinstance(most_runs, int) or not 1 <= most_runs <= MOST_RUNS:
            raise ConfigurationError(
                f"most_runs: must be a whole number from 1 to {MOST_RUNS}, got {most_runs!r}"
            )
        terms = self.terms.model_copy(update={"most_runs": most_runs})
        return replace(self, terms=terms, study=self.study.with_replicates(most_runs))

    def named(self, levels: Mapping[str, Level]) -> str:
        """Levels for people: label, level and unit."""
        labels = self.study.labels
        return ", ".join(f"{labels[n]} {self.quantity(n, level)}" for n, level in levels.items())

    def quantity(self, name: str, level: Level) -> str:
        """A level for people, with its unit if it is a number."""
        study = self.study
        factor = study.factors.get(name) or study.conditions[name]
        number = not isinstance(level, str) or level in factor.numbers
        unit = study.units[name] if number else ""
        return with_unit(level_shown(level), unit)

    def price(self, cost: float) -> str:
        """A cost for people."""
        number = f"{cost:,.2f}".removesuffix(".00")
        return f"{number} {self.terms.currency}".rstrip()


def shipped() -> tuple[str, ...]:
    """Names of the shipped questions."""
    return library.shipped(PACKAGE)


def load(source: str | Path | Mapping[str, Any]) -> Question:
    """Read a question and check it.

    Parameters
    ----------
    source
        Name of a shipped question (``"one-metre"``), path of a TOML file, or nested tables.

    Raises
    ------
    ConfigurationError
        The question does not exist or is invalid.
    """
    where, raw, folder = read(source, "question", PACKAGE)
    if "factors" in raw:
        raise ConfigurationError(
            f"{where}: factors: must be choices in a question ([choices.NAME]), got factors; a "
            "study of them is run by 'sblcosim study'"
        )
    given = dict(raw)
    choices = _choices(where, raw.pop("choices", None))
    tables = {key: raw.pop(key) for key in OF_STUDY if key in raw}
    try:
        terms = Terms.model_validate(raw)
    except ValidationError as error:
        raise ConfigurationError("\n".join(_lines(where, error))) from None
    if "scenario" not in tables:
        raise ConfigurationError(f"{where}: scenario: must be given, got nothing")
    if "settling_time_s" not in tables:
        raise ConfigurationError(
            f"{where}: settling_time_s: must be given, got nothing; 0 counts errors from the start"
        )
    response, asked = _response(where, terms.response)
    _check_limit(f"{where}: limit", terms.limit, response)
    # Receivers run side by side on the same noise; every bound here holds whatever runs share.
    alone = ([RECEIVERS_KEY], (RECEIVERS_KEY,))
    receivers = any(table.get("keys") in alone for table in choices.values())
    made = {
        **tables,
        "design": {"kind": "grid"},
        "seeding": "common" if receivers else "independent",
        "replicates": terms.most_runs,
        "responses": asked,
        "factors": {
            name: {k: v for k, v in table.items() if k != "costs"}
            for name, table in choices.items()
        },
    }
    try:
        study = of_tables(where, made, folder)
    except ConfigurationError as error:
        raise ConfigurationError(str(error).replace("[factors.", "[choices.")) from None
    response = response or study.asked[0].name
    costs = {
        name: of_levels(f"{where}: [choices.{shortened(name)}] costs", table["costs"],
                        study.factors[name].values)
        for name, table in choices.items() if "costs" in table
    }  # fmt: skip
    return Question(terms, study, costs, response, given)


def _lines(where: str, error: ValidationError) -> list[str]:
    """Pydantic's findings in our own wording; a misspelt key is not reported as missing too."""
    found = dict.fromkeys(line(e, where, _Known) for e in error.errors())
    meant = {text.rpartition("did you mean ")[2] for text in found}
    missing = "{}: {}: must be given, got nothing"
    misspelt = {missing.format(where, key) for key in Terms.model_fields if f"'{key}'?" in meant}
    return [text for text in found if text not in misspelt]


class _Known(Terms):
    """All keys of a question file, for messages."""

    name: Any = None
    title: Any = None
    scenario: Any = None
    fixed: Any = None
    seed: Any = None
    settling_time_s: Any = None
    conditions: Any = None
    choices: Any = None


def _choices(where: str, given: Any) -> dict[str, dict[str, Any]]:
    if not isinstance(given, Mapping) or not given:
        got = "nothing" if given is None else shortened(instance(given))
        raise ConfigurationError(f"{where}: choices: must have at least one, got {got}")
    for name, table in given.items():
        if not isinstance(table, Mapping):
            raise ConfigurationError(
                f"{where}: [choices.{shortened(str(name))}]: must be a table, got "
                f"{shortened(instance(table))}"
            )
        for key in table:
            if key not in _OF_CHOICE:
                raise ConfigurationError(
                    f"{where}: [choices.{shortened(str(name))}] there is no key {quoted(str(key))}"
                    f"{nearest(str(key), _OF_CHOICE)}"
                )
    return {name: dict(table) for name, table in given.items()}


def _check_limit(where: str, limit: float, response: str) -> None:
    check_limit(where, limit, response)
    if response in FLAGS and limit != 0:
        raise ConfigurationError(
            f"{where}: must be 0, as a run is {response} (1) or not (0); share says in how many "
            f"runs it must not be, got {limit:g}"
        )


def _response(where: str, name: str) -> tuple[str, list[str]]:
    """Name of a response, and what a study must be asked for to record it."""
    if ":" in name:
        return "", [name]
    known = name if name in RESPONSES else f"{_FRAME}{name}"
    better = [n for n in RESPONSES if n not in BETTER_IF_LARGE]
    if known not in better:
        short = [n.removeprefix(_FRAME) for n in better]
        why = " of which less is better" if known in BETTER_IF_LARGE else ""
        raise ConfigurationError(
            f"{where}: response: must be the name of a response{why}, or FILE.py:FUNCTION, got "
            f"{quoted(name)}{nearest(name, [*short, *better])}"
        )
    return known, [known] if known in ON_REQUEST else []


def passable(table: pd.DataFrame, response: str, label: str) -> NDArray[np.float64]:
    """A receiver's response in some runs; infinite where the run failed or is lost."""
    values = table[f"{label}.{response}"].to_numpy(np.float64, na_value=np.nan)
    lost = table[f"{label}.lost"].to_numpy(np.float64, na_value=1.0) != 0
    errors = table["error"].fillna("").to_numpy(str)
    mine = [bool(text) and (f"{label}: " in text or ": " not in text) for text in errors]
    return np.where(lost | np.array(mine, bool) | ~np.isfinite(values), np.inf, values)
