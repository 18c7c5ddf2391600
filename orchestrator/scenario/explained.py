"""Keys of a scenario in words: what each is, its unit, its choices or bounds."""

from __future__ import annotations

from sblcosim.models.declaration import Variable

from .schema import TABLES, range_of, toml
from .units import unit_of


def explained(table: str, key: str) -> str:
    """A key in words: ``Speed along the path, in space [m/s]; 0 to 20``."""
    unit = unit_of(key)
    kind = TABLES[table]
    text = kind.model_fields[key].description
    return f"{text}{f' [{unit}]' if unit else ''}{_range(kind.variables.get(key))}"


def _range(variable: Variable | None) -> str:
    """Choices or bounds, in words."""
    if variable is None:
        return ""
    if variable.choices is not None:
        return ": " + ", ".join(variable.choices.values())
    if variable.type == "Boolean":
        return ""
    names = "".join(f", or {toml(name)}" for name in variable.named or ())
    low, high = (None if bound is None else f"{bound:g}" for bound in range_of(variable))
    if high is None:
        return names if low is None else f"; at least {low}{names}"
    return f"; at most {high}{names}" if low is None else f"; {low} to {high}{names}"
