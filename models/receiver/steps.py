"""What happens to a state between two times, in a form that its past can follow.

The error of the state passes through sparse maps and is corrected by scalar measurements. Anything
correlated with it, such as the state at an earlier time, follows (`Delayed`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca

from .least_squares import symmetric


@dataclass(frozen=True, slots=True)
class Map:
    """A linear map of the state's error: the identity except for some (row, column)."""

    elements: Mapping[tuple[int, int], Any]

    def matrix(self, n: int) -> Any:
        """As an (n, n) matrix."""
        matrix = ca.SX.eye(n)
        for (i, j), value in self.elements.items():
            matrix[i, j] = value
        return matrix


@dataclass(frozen=True, slots=True)
class Correction:
    """A scalar measurement with row H: mean += αPH', P += β(PH')(PH')'.

    Attributes
    ----------
    row
        H, by the index of the state.
    crossing
        PH' before the measurement, (n, 1).
    alpha, beta
        Factors; both 0 if there is no measurement.
    """

    row: Mapping[int, Any]
    crossing: Any
    alpha: Any
    beta: Any


Step = Map | Correction


def packed(steps: Sequence[Step]) -> Any:
    """All numbers of a sequence of steps, as a column."""
    values: list[Any] = []
    for step in steps:
        if isinstance(step, Map):
            values += step.elements.values()
        else:
            values += [*step.row.values(), step.crossing, step.alpha, step.beta]
    return ca.vertcat(*values)


def unpacked(steps: Sequence[Step], column: Any) -> list[Step]:
    """Steps of the same form as the given ones, with the numbers of a column."""
    at = 0

    def taken(n: int) -> Any:
        nonlocal at
        at += n
        return column[at - n : at]

    def like(step: Step) -> Step:
        if isinstance(step, Map):
            elements = taken(len(step.elements))
            return Map({key: elements[i] for i, key in enumerate(step.elements)})
        row = taken(len(step.row))
        return Correction(
            {key: row[i] for i, key in enumerate(step.row)},
            taken(step.crossing.numel()), taken(1), taken(1),
        )

    return [like(step) for step in steps]


@dataclass(frozen=True, slots=True)
class Delayed:
    """Some states at an earlier time: mean (m, 1), covariance (m, m) and covariance with the state
    now.

    Whatever corrects the state now corrects them too, in proportion to `cross`, (m, n).
    """

    mean: Any
    covariance: Any
    cross: Any

    def after(self, steps: Sequence[Step]) -> Delayed:
        """The delayed states after these steps of the state."""
        known = self
        for step in steps:
            known = known._after(step)
        return known

    def _after(self, step: Step) -> Delayed:
        n = self.cross.shape[1]
        if isinstance(step, Map):
            return replace(self, cross=self.cross @ step.matrix(n).T)
        H = ca.SX(n, 1)
        for i, value in step.row.items():
            H[i] = value
        gain = self.cross @ H
        return Delayed(
            self.mean + step.alpha * gain,
            symmetric(self.covariance + step.beta * (gain @ gain.T)),
            self.cross + step.beta * (gain @ step.crossing.T),
        )
