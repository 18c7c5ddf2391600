"""A space of a study: its factors with the bounds of their keys, and its sample as a design."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from typing import Any

from ..errors import ConfigurationError
from ..scenario.file_schema import scenario_schema
from .design import Design, Factor
from .space import DrawnFactor, Sample
from .tables import FactorTable, named

ROUNDED: Mapping[str, float] = {"time.sampling_time_s": 1e-3}
"""Keys whose values are rounded to whole multiples: runs with equal values go side by side."""


def factor_of(
    name: str, factor: FactorTable, of_keys: bool, *, label: str = "", unit: str = ""
) -> DrawnFactor:
    """A factor of a space: its distribution, with the bounds of its keys.

    Parameters
    ----------
    of_keys
        Whether it sets keys of a scenario, not an argument of a function.

    Raises
    ------
    ConfigurationError
        It has no distribution, or one that does not fit these keys.
    """
    law = factor.law
    if law is None:
        close = "; did you mean distribution = 'choice'?" if factor.levels is not None else ""
        raise ConfigurationError(
            f"factor {name}: distribution: must be given in a space, got nothing{close}"
        )
    low, high, step = -math.inf, math.inf, 0.0
    names: tuple[str, ...] = ()
    # A choice sets names. The points show whether the scenario accepts them.
    for key in factor.keys if of_keys and law.distribution != "choice" else ():
        known = _of_numbers(_schemas().get(key, {}))
        low = max(low, known.get("minimum", -math.inf))
        high = min(high, known.get("maximum", math.inf))
        whole = known.get("type") == "integer"
        step = max(step, ROUNDED.get(key, 1.0 if whole else 0.0))
        names = names or tuple(known.get("enum", ()))
        if known.get("type") == "boolean":
            names = ("true", "false")
    return DrawnFactor(name, law, low, high, step or None, names, label, unit)


def _of_numbers(schema: Mapping[str, Any]) -> Mapping[str, Any]:
    """The schema of a key; of one that may be a number or a name, that of its numbers."""
    return next((it for it in schema.get("anyOf", ()) if it.get("type") == "number"), schema)


@cache
def _schemas() -> Mapping[str, Any]:
    """The schema of each key, ``table.key``, of a scenario."""
    tables = scenario_schema()["properties"]
    return {
        f"{table}.{key}": schema
        for table, content in tables.items()
        for key, schema in content.get("properties", {}).items()
    }


def design_of(sample: Sample) -> Design:
    """The rows of a space as points; a number's levels are its smallest and largest value."""
    columns = [[*map(named, sample.values[f.name].tolist())] for f in sample.factors]
    factors = tuple(
        Factor(f.name, (min(column), max(column)) if f.numeric else tuple(dict.fromkeys(column)))
        for f, column in zip(sample.factors, columns, strict=True)
    )
    return Design(factors, tuple(zip(*columns, strict=True)), (False,) * len(sample))
