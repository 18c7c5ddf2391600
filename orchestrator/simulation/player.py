"""A Python component that plays recorded outputs back, instant by instant."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.models.declaration import Variable

from ..errors import ConfigurationError


class Player:
    """Plays recorded values back: at each time, the newest values that are not later.

    Parameters
    ----------
    variables
        Declarations of the outputs; shapes are those of the values.
    time_ns
        Instants of the values [ns], increasing; shape (n,).
    values
        By name of the output; shape (n, …).

    Raises
    ------
    ConfigurationError
        There is no instant, or an output has a different number of values.
    """

    def __init__(
        self,
        variables: Iterable[Variable],
        time_ns: NDArray[np.int64],
        values: Mapping[str, NDArray[Any]],
    ) -> None:
        for name, column in values.items():
            if not len(time_ns) or len(column) != len(time_ns):
                raise ConfigurationError(
                    f"{name}: must have a value at each instant, got {len(column)} at "
                    f"{len(time_ns)}"
                )
        self.variables = tuple(replace(v, shape=values[v.name].shape[1:]) for v in variables)
        self._time_ns = time_ns
        self._values = dict(values)

    def initialise(self, start_ns: int, parameters: Mapping[str, Any]) -> Mapping[str, Any]:
        return self._at(start_ns)

    def do_step(
        self, time_ns: int, step_ns: int, inputs: Mapping[str, Any]
    ) -> Mapping[str, Any]:
        return self._at(time_ns + step_ns)

    def _at(self, time_ns: int) -> Mapping[str, Any]:
        i = max(int(np.searchsorted(self._time_ns, time_ns, side="right")) - 1, 0)
        return {name: column[i] for name, column in self._values.items()}
