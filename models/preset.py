"""What a key declares of itself that sets others of its table: the grade of a sensor, the sea."""

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
        The key, and the table of a scenario that it is in.
    about
        What it is for; ``{}`` stands for its values.
    parameters
        Parameters in SI units, by name, that a value sets.
    values
        All that it may have: names, or whole numbers that follow each other.
    """

    name: str
    table: str
    about: str
    parameters: Callable[[Any], Mapping[str, float]]
    values: Collection[Any]

    @property
    def description(self) -> str:
        """What the key is for, with its values."""
        first, *_ = values = [*self.values]
        shown = f"{first} to {values[-1]}" if isinstance(first, int) else ", ".join(values)
        return self.about.format(shown)
