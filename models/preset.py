"""Declaration of a key that sets others of its table: the grade of a sensor, the sea."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Preset:
    """A key that sets other keys of its table.

    Attributes
    ----------
    name, table
        The key, and its table in a scenario.
    about
        Its purpose; ``{}`` stands for its values.
    parameters
        Function from a value to the parameters that it sets, by name, in SI units.
    values
        All accepted values: names, or consecutive whole numbers.
    """

    name: str
    table: str
    about: str
    parameters: Callable[[Any], Mapping[str, float]]
    values: Collection[Any]

    @property
    def description(self) -> str:
        """Purpose of the key, with its values."""
        first, *_ = values = [*self.values]
        shown = f"{first} to {values[-1]}" if isinstance(first, int) else ", ".join(values)
        return self.about.format(shown)
