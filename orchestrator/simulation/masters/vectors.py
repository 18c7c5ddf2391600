"""The outputs of all components in one array of each type, and the ways in and out of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from sblcosim.fmus.host.instances import DTYPES, Vector

from ..plan import Plan, Read, Write

Vectors = Mapping[str, Vector]
"""Latest outputs of all components, by type; see `sblcosim.simulation.plan`."""


def vectors_of(plan: Plan) -> Vectors:
    """Zeros for the outputs of a plan."""
    return {kind: np.zeros(size, DTYPES[kind]) for kind, size in plan.sizes.items()}


def converter(write: Write, inputs: Vector) -> Callable[[], None] | None:
    """A function that converts those inputs of a write that are to be; None if there are none."""
    given = [[np.array(column) for column in zip(*own, strict=True)] for own in write.rounds]

    def convert() -> None:
        for where, factors, offsets in given:
            inputs[where] = inputs[where] * factors + offsets

    return convert if given else None


def views(read: Read, vector: Vector) -> dict[str, Vector]:
    """View of each output in the vector, in its shape."""
    views, start = {}, read.start
    for port in read.ports:
        views[port.name] = vector[start : start + port.size].reshape(port.shape)
        start += port.size
    return views
