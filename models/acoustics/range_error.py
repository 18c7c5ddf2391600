"""What an error of the ranges declares of itself; each is a module of ``range_errors``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from ..declaration import Variable
from ..draws import Draw
from ..numbered import in_order
from ..symbols import Symbols


@dataclass(frozen=True)
class RangeError:
    """An error that is added to a range, for the component, the scenario, the budget and the bound.

    Attributes
    ----------
    number
        Errors are added, and their draws and parameters listed, in the order of numbers.
    words
        What it is called in sentences: ``"the bubbles"``.
    parameters
        Its own.
    error
        ``error(p, w)``: the error [m], from the parameters and the draws.
    draws
        For each ping.
    random
        When it makes a run random: of each group, one parameter is not zero.
    sizes
        Names of the parameters that are 0 where there is no such error; None: all.
    modelled
        Whether what is possible accounts for it; else "possible" names it as left out.
    """

    number: int
    words: str
    parameters: tuple[Variable, ...]
    error: Callable[[Symbols, Symbols], Any]
    draws: tuple[Draw, ...] = ()
    random: tuple[tuple[str, ...], ...] = ()
    sizes: tuple[str, ...] | None = None
    modelled: bool = False

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of ``[acoustics]`` that are 0 where there is no such error."""
        return tuple(
            v.key for v in self.parameters if self.sizes is None or v.name in self.sizes
        )


def numbered(errors: Mapping[str, RangeError]) -> Mapping[str, RangeError]:
    """Range errors in the order of their numbers, as `in_order` says."""
    return in_order("range errors", errors)
