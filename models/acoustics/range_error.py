"""Declaration of a range error; each is a module of ``range_errors``."""

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
    """An error added to a range, as used by the component, the scenario, the budget and the bound.

    Attributes
    ----------
    number
        Decides the order in which errors are added and their draws and parameters listed.
    words
        Its name in sentences: ``"the bubbles"``.
    parameters
        Its own parameters.
    error
        ``error(p, w)``: the error [m], from the parameters and the draws.
    draws
        Random numbers drawn for each ping.
    random
        Condition for the error to make a run random: in each group, at least one parameter is not
        zero.
    sizes
        Names of the parameters that are 0 if the error is absent; None: all parameters.
    modelled
        Whether the possible error accounts for it; otherwise it is named as left out.
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
        """Keys of ``[acoustics]`` that are 0 if the error is absent."""
        return tuple(
            v.key for v in self.parameters if self.sizes is None or v.name in self.sizes
        )


def numbered(errors: Mapping[str, RangeError]) -> Mapping[str, RangeError]:
    """Range errors in the order of their numbers; see `in_order`."""
    return in_order("range errors", errors)
